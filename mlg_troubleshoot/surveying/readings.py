"""What a survey reads, and what a linkage predicts for it: distances, plunger positions, angles,
the extension.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import StrEnum
from itertools import combinations
from typing import Any

import numpy as np

from mlg_troubleshoot.arrays import STEP, Array, Mask, central_slopes, central_steps
from mlg_troubleshoot.gear.design import DesignSpace
from mlg_troubleshoot.gear.gear import Gear, Linkage
from mlg_troubleshoot.geometry.kernel import Kernel
from mlg_troubleshoot.geometry.mechanism import Crank, Dyad, Guided, Lever, Mechanism, Slider, Slot
from mlg_troubleshoot.geometry.program import write_program
from mlg_troubleshoot.units import Length, LengthUnit, Sentence

# Positive quantities of a batch of linkages, shape (n_vectors, n_quantities).
Quantity = Callable[[Array], Array]
# Positions over the stroke among which the plunger's least displacement is sought, and plunger
# positions to read.
_POSITIONS = 25
_PLUNGER_READINGS = 9


class ReadingKind(StrEnum):
    """What is read."""

    DISTANCE = "DISTANCE"
    PLUNGER = "PLUNGER"
    ANGLE = "ANGLE"
    EXTENSION = "EXTENSION"
    # Not a row of a table: the travel that the technical order prescribes (section 4.2) counts as
    # one more reading.
    TRAVEL = "TRAVEL"
    # Nor this, the mean of the logarithms of the amplification indices: most of what fits a few
    # readings would stand near a dead centre.
    ORDER = "ORDER"


# Standard uncertainties where a reading states none, assumed; the last two are those of the travel
# and of the logarithm of the order of the indices. [in, in, rad, in, in, 1]
DEFAULT_U = {
    ReadingKind.DISTANCE: 0.01,
    ReadingKind.PLUNGER: 0.0015,
    ReadingKind.ANGLE: float(np.radians(1)),
    ReadingKind.EXTENSION: 0.005,
    ReadingKind.TRAVEL: 0.005,
    ReadingKind.ORDER: 1,
}


def default_u(kind: ReadingKind, *, is_angle: bool) -> float:
    """Standard uncertainty of a reading that states none; an output that turns is read as an angle.
    [in or rad]
    """
    return DEFAULT_U[ReadingKind.ANGLE if is_angle else kind]


# Minutes that a reading takes at the gear, assumed: two hands and a caliper; the dial stands once
# for all positions.
MINUTES = {
    ReadingKind.DISTANCE: 3,
    ReadingKind.PLUNGER: 2,
    ReadingKind.ANGLE: 6,
    ReadingKind.EXTENSION: 2,
}


@dataclass(frozen=True, slots=True)
class SurveyReading:
    """One row of a survey.

    start, end: point names, or plane and ``hinge`` or ``dihedral``, or slider and ``axis``; empty
    where not needed. value: NaN for a reading that is planned. [in or rad] u: its standard
    uncertainty. [in or rad] extension: input at the reading, from Down Lock; None at the reference
    position. [in or rad] row: row of the file; None for a planned one and for the prescribed
    travel. is_angle: true if the value is an angle. driven_in: unit of the input.
    """

    kind: ReadingKind
    start: str = ""
    end: str = ""
    value: float = np.nan
    u: float = 0.01
    extension: float | None = None
    row: int | None = None
    is_angle: bool = False
    driven_in: str = "in"

    @property
    def what(self) -> tuple[str, frozenset[str], float | None]:
        """What is read, whichever pin is named first."""
        return self.kind.value, frozenset((self.start, self.end)), self.extension

    @property
    def words(self) -> Sentence:
        """What is read, in words."""
        at = ""
        if self.extension is not None and self.driven_in == LengthUnit.INCH:
            at = Sentence.of(" at extension {}", Length(self.extension))
        elif self.extension is not None:
            at = f" at extension {self.extension:.4f} {self.driven_in}"
        match self.kind:
            case ReadingKind.DISTANCE:
                return Sentence.of("distance {} to {}{}", self.start, self.end, at)
            case ReadingKind.ANGLE:
                return Sentence(f"angle of the {self.end} of {self.start}")
            case ReadingKind.PLUNGER:
                return Sentence.of("plunger{}", at)
            case ReadingKind.EXTENSION:
                return Sentence("extension from Down Lock to the reference position")
            case _:
                return Sentence("prescribed travel of the plunger")

    def in_units(self, value: float) -> float:
        """A value of this reading as a person writes it. [in or deg]"""
        return float(np.degrees(value)) if self.is_angle else value

    def shown(self, value: float) -> Sentence:
        """The same with its unit."""
        if self.is_angle:
            return Sentence(f"{np.degrees(value):.4g}°")
        return Sentence.of("{}", Length(value))


Readings = tuple[SurveyReading, ...]


class SurveyedLinkage:
    """Design variables of a gear's linkage with its calibration, and what they predict, for batches
    of vectors.
    """

    def __init__(self, gear: Gear) -> None:
        self.gear = gear
        self.space = DesignSpace(gear.reference)
        self.kernel = Kernel(gear.reference.mechanism)
        self.travel = gear.calibration.travel_in
        travel = () if self.travel is None else ("travel",)
        self.names = (*self.space.names, *travel)
        self.angles = np.array(
            [n.endswith((".direction", ".dihedral", ".axis")) for n in self.names]
        )
        # Signs of the variables of the same linkage, seen from the other side.
        is_upward = np.array([n.endswith(".y") for n in self.names])
        self.mirror = np.where(self.angles | is_upward, -1.0, 1.0)
        self.low = gear.reference.stroke[0]
        self.driven_in = (
            "rad" if any(isinstance(s, Crank) for s in self.space.mechanism.steps) else "in"
        )
        self._beyond = gear.reference.stroke[1] - gear.reference.mechanism.reference_input

    def vector(self, linkage: Linkage) -> Array:
        """The variables of one of the gear's linkages."""
        travel = [] if self.travel is None else [self.travel]
        return np.append(self.space.vector(linkage), travel)

    def linkage(self, vector: Array, name: str) -> Linkage:
        """The linkage of one vector."""
        return self.space.linkage(vector[: len(self.space.names)], name)

    def _assembled(self, vectors: Array) -> tuple[Mechanism, Array]:
        """Mechanisms of a batch and their reference inputs, shape (n_vectors, 1)."""
        mechanism = self.space.assembled(vectors[:, : len(self.space.names)])
        reference = np.asarray(mechanism.reference_input, float)
        reference = np.broadcast_to(reference, len(vectors))
        return mechanism, reference[:, None]

    def _numbers(self, mechanism: Mechanism, count: int) -> list[Any]:
        numbers = write_program(mechanism).parameters.values()
        return [np.broadcast_to(np.asarray(v, float), count)[:, None] for v in numbers]

    def _rate(self, vectors: Array, numbers: list[Any], reference: Array) -> Any:
        """Rate k of section 4.2 by a parabola through the least position and its neighbours, shape
        (n, 1). [1]
        """
        if self.travel is None:
            return 1.0
        at = self._positions(reference)
        raw = self.kernel.output(at, self.kernel.no_clearance(), numbers)
        direction = np.sign(raw[:, -1:] - raw[:, :1])
        along = direction * raw
        middle = np.clip(np.argmin(along, axis=1), 1, _POSITIONS - 2)
        around = middle[:, None] + np.arange(-1, 2)
        before, least, after = np.take_along_axis(along, around, 1).T
        slope = (after - before) / 2.0
        bend = after - 2.0 * least + before
        step = np.clip(-slope / np.maximum(bend, 1e-12), -1.0, 1.0)
        least = least + step * (slope + step * bend / 2.0)
        travelled = along[:, -1:] - least[:, None]
        return direction * vectors[:, -1:] / travelled

    def predicted(self, readings: Readings, vectors: Array) -> Array:
        """What each vector predicts for each reading, shape (n_vectors, n_readings); NaN where it
        does not close.
        """
        mechanism, reference = self._assembled(vectors)
        moves = [r for r in readings if r.kind is ReadingKind.PLUNGER or r.extension is not None]
        extensions = list(dict.fromkeys(r.extension for r in moves))
        nothing = self.kernel.no_clearance()
        moved: dict[str, Array] = {}
        curve = np.empty(())
        if moves:
            numbers = self._numbers(mechanism, len(vectors))
            at = [
                reference if e is None else np.full_like(reference, self.low + e)
                for e in extensions
            ]
            inputs = np.concatenate(at, axis=1)
            if any(r.kind is ReadingKind.DISTANCE for r in moves):
                positions = self.kernel.positions(inputs, nothing, numbers)
                for name in {
                    name
                    for r in moves
                    if r.kind is ReadingKind.DISTANCE
                    for name in (r.start, r.end)
                }:
                    origin, axes = mechanism.frame(mechanism.point(name).plane)
                    x, y = (np.broadcast_to(c, inputs.shape)[..., None] for c in positions[name])
                    along_x = x * axes[..., None, 0, :]
                    along_y = y * axes[..., None, 1, :]
                    moved[name] = origin[..., None, :] + along_x + along_y
            if any(r.kind is ReadingKind.PLUNGER for r in moves):
                curve = self.kernel.output(inputs, nothing, numbers) - self.kernel.output(
                    reference, nothing, numbers
                )
                curve = curve * self._rate(vectors, numbers, reference)
        still = {p.name: mechanism.reference_in_space(p.name) for p in mechanism.points}
        found = np.empty((len(vectors), len(readings)))
        for i, r in enumerate(readings):
            match r.kind:
                case ReadingKind.DISTANCE:
                    places = (
                        still
                        if r.extension is None
                        else {
                            name: moved[name][:, extensions.index(r.extension)]
                            for name in (r.start, r.end)
                        }
                    )
                    apart = places[r.start] - places[r.end]
                    squared = (apart * apart).sum(axis=-1)
                    found[:, i] = np.sqrt(squared)
                case ReadingKind.PLUNGER:
                    found[:, i] = curve[:, extensions.index(r.extension)]
                case ReadingKind.ANGLE:
                    name = f"{r.start}.{'direction' if r.end == 'hinge' else r.end}"
                    turned = vectors[:, self.names.index(name)]
                    # The nearest of the turns that mean the same direction.
                    found[:, i] = turned - 2 * np.pi * np.round(
                        (turned - np.nan_to_num(r.value)) / (2 * np.pi)
                    )
                case ReadingKind.EXTENSION:
                    found[:, i] = reference[:, 0] - self.low
                case ReadingKind.TRAVEL:
                    found[:, i] = vectors[:, -1]
                case ReadingKind.ORDER:
                    indices = self.amplification(vectors)
                    found[:, i] = np.log(indices).mean(axis=1)
        return found

    def slopes(self, readings: Readings, vectors: Array) -> tuple[Array, Array]:
        """Predictions and their derivatives by central differences, shape (n_vectors, n_readings,
        n_variables).
        """
        count, n = vectors.shape
        steps = np.vstack([np.zeros((1, n)), central_steps(n)])
        tried = (vectors[:, None, :] + steps).reshape(-1, n)
        found = self.predicted(readings, tried).reshape(count, 2 * n + 1, -1)
        slopes = central_slopes(found[:, 1:], axis=1)
        return found[:, 0], slopes.swapaxes(1, 2)

    def _gradient(self, vectors: Array) -> tuple[Array, Array, list[Any], Any]:
        """Derivatives of the displacement by the virtual links, with what a further solution
        needs.
        """
        mechanism, reference = self._assembled(vectors)
        numbers = self._numbers(mechanism, len(vectors))
        n = len(self.kernel.no_clearance())
        links = central_steps(n)
        rate = self._rate(vectors, numbers, reference)
        moved = self.kernel.output(reference + self._beyond, list(links.T), numbers)
        return central_slopes(moved, axis=1) * rate, reference, numbers, rate

    def amplification(self, vectors: Array) -> Array:
        """Plunger amplification index A_iP of each joint (Eq. 8) for a batch, shape (n_vectors,
        n_joints). [1]
        """
        gradient = self._gradient(vectors)[0]
        return np.hypot(gradient[:, 0::2], gradient[:, 1::2])

    def displacement(self, vectors: Array, clearance_in: Array) -> Array:
        """Displacement of the plunger, the larger of both senses, every clearance along its own
        gradient.

        clearance_in, shape (n_cases, n_joints): radial clearances. [in] Returns, shape (n_vectors,
        n_cases): displacement; NaN where the linkage does not close. [in]
        """
        gradient, reference, numbers, rate = self._gradient(vectors)
        length = np.hypot(gradient[:, 0::2], gradient[:, 1::2])
        length = np.repeat(np.maximum(length, 1e-12), 2, axis=1)
        unit = gradient / length
        link = np.repeat(clearance_in, 2, axis=1)[None] * unit[:, None]
        at = reference + self._beyond
        none = self.kernel.no_clearance()
        zero = self.kernel.output(at, none, numbers)
        ends = []
        for sense in (1.0, -1.0):
            links = [*np.moveaxis(sense * link, -1, 0)]
            ends.append(self.kernel.output(at, links, numbers) - zero)
        moved: Array = np.max(np.abs(ends), axis=0) * np.abs(rate)
        return moved

    def log_slopes(self, vectors: Array, quantity: Quantity | None = None) -> Array:
        """Derivatives of the logarithms of quantities, as a rule the amplification indices.

        Returns, shape (n_vectors, n_quantities, n_variables). [1/in, 1/rad]
        """
        count, n = vectors.shape
        # A quantity may itself be a derivative: a longer step.
        step = 10.0 * STEP
        steps = central_steps(n, step)
        tried = (vectors[:, None, :] + steps).reshape(-1, n)
        values = (quantity or self.amplification)(tried)
        found = np.log(np.maximum(values, 1e-9)).reshape(count, 2 * n, -1)
        return central_slopes(found, step, axis=1).swapaxes(1, 2)

    def closes(self, vectors: Array) -> Mask:
        """Tell which vectors make a linkage that moves over its stroke and moves its plunger as
        prescribed.
        """
        mechanism, reference = self._assembled(vectors)
        at = self._positions(reference)
        numbers = self._numbers(mechanism, len(vectors))
        curve = self.kernel.output(at, self.kernel.no_clearance(), numbers)
        values = np.hstack([curve, self.amplification(vectors)])
        closes: Mask = np.isfinite(values).all(axis=1)
        return closes

    def _positions(self, reference: Array) -> Array:
        """Inputs over the stroke and a little beyond its reference, one row per linkage."""
        share = np.linspace(0.0, 1.0, _POSITIONS)
        return self.low + (reference + self._beyond - self.low) * share

    def candidates(self) -> Readings:
        """Everything that can be read: the extension, the plunger over the stroke, every angle,
        every distance.
        """
        m, (low, high) = self.space.mechanism, self.gear.reference.stroke
        found = [SurveyReading(ReadingKind.EXTENSION)] if self.space.moves_reference else []
        # A round figure of each ninth of the stroke is easier to set than the ninth.
        stroke = high - low
        at = [round(stroke * k / _PLUNGER_READINGS, 2) for k in range(_PLUNGER_READINGS + 1)]
        at.pop(0 if not self.space.moves_reference else _PLUNGER_READINGS)
        found += [
            SurveyReading(ReadingKind.PLUNGER, extension=e, is_angle=m.output.kind == "angle")
            for e in at
        ]
        for plane in self.space.planes:
            found += [
                SurveyReading(ReadingKind.ANGLE, plane, what, is_angle=True)
                for what in ("hinge", "dihedral")
            ]
        found += [
            SurveyReading(ReadingKind.ANGLE, slider, "axis", is_angle=True)
            for slider in self.space.sliders
        ]
        names = [p.name for p in m.points]
        pairs = [*map(tuple, self.rigid), *combinations(names, 2)]
        ends = (sorted(p, key=names.index) for p in pairs)
        distances = {frozenset((a, b)): SurveyReading(ReadingKind.DISTANCE, a, b) for a, b in ends}
        return tuple(
            replace(r, u=default_u(r.kind, is_angle=r.is_angle), driven_in=self.driven_in)
            for r in (*found, *distances.values())
        )

    @property
    def rigid(self) -> tuple[frozenset[str], ...]:
        """Pairs of pins on one rigid part; the actuator counts as one at the reference position."""
        pairs: list[tuple[str, str]] = []
        for step in self.space.mechanism.steps:
            match step:
                case Dyad():
                    pairs += [(step.upstream, step.joint), (step.joint, step.downstream)]
                case Lever():
                    pairs += [
                        (step.pivot, step.joint),
                        (step.follows, step.joint),
                        (step.pivot, step.follows),
                    ]
                case Slot():
                    pairs += [
                        (step.pivot, step.joint),
                        (step.pivot, step.pin),
                        (step.pin, step.joint),
                    ]
                case Slider() | Guided():
                    pairs.append((step.upstream, step.joint))
                case _:
                    pairs.append((step.pivot, step.joint))
        return tuple(dict.fromkeys(map(frozenset, pairs)))
