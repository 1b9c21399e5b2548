"""What is read on a gear, and what a linkage of its type predicts for it."""

from __future__ import annotations

import csv
from dataclasses import dataclass
from enum import StrEnum
from itertools import permutations
from pathlib import Path
from typing import Any

import numpy as np

from mlg_troubleshoot.arrays import Array, central_slopes, central_steps
from mlg_troubleshoot.errors import UsageError
from mlg_troubleshoot.gear.design import DesignSpace
from mlg_troubleshoot.gear.gear import Gear, Linkage
from mlg_troubleshoot.geometry.kernel import Kernel
from mlg_troubleshoot.geometry.program import write_program
from mlg_troubleshoot.units import LengthUnit

# Positions over the stroke among which the least displacement of the plunger is sought.
_POSITIONS = 25
_COLUMNS = (
    *("kind", "from", "to", "value_in", "value_mm", "value_deg", "u_in", "u_mm", "u_deg"),
    *("extension_in", "extension_mm", "note"),
)


# What a frame or a file has in an empty cell.
_BLANK = ("", "nan", "None", "<NA>", "NaT")


class ReadingKind(StrEnum):
    """What is read: the distance of two pins, the plunger relative to its reference position, an
    angle, the extension from Down Lock to the reference position.
    """

    DISTANCE = "DISTANCE"
    PLUNGER = "PLUNGER"
    ANGLE = "ANGLE"
    EXTENSION = "EXTENSION"


# Standard uncertainty of a reading that states none: assumed for a caliper, a dial indicator and an
# inclinometer. [in or rad]
_ANGLE_U = float(np.radians(1))
_DEFAULT_U = {
    ReadingKind.DISTANCE: 0.01,
    ReadingKind.PLUNGER: 0.0015,
    ReadingKind.ANGLE: _ANGLE_U,
    ReadingKind.EXTENSION: 0.005,
}


@dataclass(frozen=True, slots=True)
class SurveyReading:
    """One reading.

    row: label of its row in the table. start, end: names of two points; a hinged plane and
    ``hinge`` or ``dihedral``; the joint of a slider and ``axis``. value, u: reading and its
    standard uncertainty. [in or rad] extension: input at the reading, from Down Lock; None at the
    reference position. [in or rad]
    """

    row: Any
    kind: ReadingKind
    start: str
    end: str
    value: float
    u: float
    extension: float | None
    is_angle: bool

    @property
    def name(self) -> str:
        parts = filter(None, (self.kind.lower(), self.start, self.end))
        at = "" if self.extension is None else f" at extension {self.extension:g}"
        return f"row {self.row}, {' '.join(parts)}{at}"

    def shown(self, value: float) -> str:
        return f"{np.degrees(value):.2f}°" if self.is_angle else f"{value:.4f} in"


class SurveyedLinkage:
    """The design variables of a gear's linkage and its travel, for batches of vectors."""

    def __init__(self, gear: Gear) -> None:
        self.gear = gear
        self.space = DesignSpace(gear.reference)
        self.kernel = Kernel(gear.reference.mechanism)
        self.travel = gear.calibration.travel_in
        self.names = (*self.space.names, *(() if self.travel is None else ("travel",)))
        self.is_angle = np.array(
            [name.endswith((".direction", ".dihedral", ".axis")) for name in self.names]
        )
        self.low, self.high = gear.reference.stroke
        self.after = self.high - gear.reference.mechanism.reference_input

    def vector(self, linkage: Linkage) -> Array:
        """The variables of one of the gear's linkages, shape (n_variables,). [in or rad]"""
        return np.append(self.space.vector(linkage), () if self.travel is None else self.travel)

    def linkage(self, vector: Array, name: str) -> Linkage:
        return self.space.linkage(vector[: len(self.space.names)], name)

    def _solver(self, vectors: Array) -> tuple[Any, Array, list[Any], Any]:
        """Mechanisms of a batch, their reference inputs, their numbers, each of shape (n_vectors,
        1), and their calibration rates k (section 4.2), by a parabola through the least position of
        the plunger and its neighbours. [1]
        """
        mechanism = self.space.assembled(vectors[:, : len(self.space.names)])
        count = len(vectors)
        reference = np.broadcast_to(np.asarray(mechanism.reference_input, float), count)[:, None]
        parameters = write_program(mechanism).parameters.values()
        numbers = [np.broadcast_to(np.asarray(v, float), count)[:, None] for v in parameters]
        if self.travel is None:
            return mechanism, reference, numbers, 1.0
        share = np.linspace(0.0, 1.0, _POSITIONS)
        inputs = self.low + (reference + self.after - self.low) * share
        raw = self.kernel.output(inputs, self.kernel.no_clearance(), numbers)
        direction = np.sign(raw[:, -1:] - raw[:, :1])
        along = direction * raw
        middle = np.clip(np.argmin(along, axis=1), 1, _POSITIONS - 2)[:, None]
        before, least, after = np.take_along_axis(along, middle + np.arange(-1, 2), 1).T
        slope = (after - before) / 2.0
        bend = after - 2.0 * least + before
        step = np.clip(-slope / np.maximum(bend, 1e-12), -1.0, 1.0)
        least = least + step * (slope + step * bend / 2.0)
        rate = direction * vectors[:, -1:] / (along[:, -1:] - least[:, None])
        return mechanism, reference, numbers, rate

    def predicted(self, readings: tuple[SurveyReading, ...], vectors: Array) -> Array:
        """What each vector predicts for each reading, shape (n_vectors, n_readings); NaN where the
        linkage does not close. [in or rad]
        """
        mechanism, reference, numbers, rate = self._solver(vectors)
        tight = self.kernel.no_clearance()
        extensions = list(dict.fromkeys((None, *(r.extension for r in readings))))
        inputs = np.hstack(
            [reference if e is None else np.full_like(reference, self.low + e) for e in extensions]
        )
        output = self.kernel.output(inputs, tight, numbers)
        plunger = (output - output[:, :1]) * rate
        places = {}
        for name, place in self.kernel.positions(inputs, tight, numbers).items():
            origin, axes = mechanism.frame(mechanism.point(name).plane)
            x, y = (np.broadcast_to(each, inputs.shape)[..., None] for each in place)
            across = x * axes[..., None, 0, :] + y * axes[..., None, 1, :]
            places[name] = origin[..., None, :] + across
        columns = []
        for r in readings:
            at = extensions.index(r.extension)
            if r.kind is ReadingKind.DISTANCE:
                apart = (places[r.start] - places[r.end])[:, at]
                columns.append(np.linalg.norm(apart, axis=1))
            elif r.kind is ReadingKind.PLUNGER:
                columns.append(plunger[:, at])
            elif r.kind is ReadingKind.EXTENSION:
                columns.append(reference[:, 0] - self.low)
            else:
                angle = f"{r.start}.{'direction' if r.end == 'hinge' else r.end}"
                turned = vectors[:, self.names.index(angle)]
                # The nearest of the turns that mean the same direction.
                turns = np.round((turned - r.value) / (2.0 * np.pi))
                columns.append(turned - 2.0 * np.pi * turns)
        return np.column_stack(columns)

    def amplification(self, vectors: Array) -> Array:
        """Plunger amplification index A_iP of each joint (Eq. 8), shape (n_vectors, n_joints);
        NaN where the linkage does not close over its whole stroke. [1]
        """
        _, reference, numbers, rate = self._solver(vectors)
        links = central_steps(len(self.kernel.no_clearance()))
        moved = self.kernel.output(reference + self.after, list(links.T), numbers)
        gradient = central_slopes(moved, axis=1) * rate
        found: Array = np.hypot(gradient[:, 0::2], gradient[:, 1::2])
        return found


def read_table(table: Any, linkage: SurveyedLinkage) -> tuple[SurveyReading, ...]:
    """Read the rows of a CSV file or frame that have a value; UsageError names every wrong cell."""
    if isinstance(table, str | Path):
        with Path(table).open(encoding="utf-8-sig", newline="") as file:
            rows = list(enumerate(csv.DictReader(file), start=2))
    else:
        rows = list(zip(table.index, table.to_dict("records"), strict=True))
    columns = dict.fromkeys(name for _, cells in rows for name in cells)
    wrong = [f"column {name!r} is unknown" for name in columns if name not in _COLUMNS]
    readings = []
    for row, cells in rows:
        filled = {k: v for k, v in cells.items() if str(v).strip() not in _BLANK}
        if any(name.startswith("value_") for name in filled):
            try:
                readings.append(_reading(row, filled, linkage))
            except (KeyError, ValueError) as error:
                wrong.append(f"row {row}: {error.args[0]}")
    if wrong or not readings:
        raise UsageError(
            f"the survey has no usable table of readings: {'; '.join(wrong) or 'no value in it'}",
            f"Its columns are {', '.join(_COLUMNS)}: see docs/how-to/measured-gear.md.",
        )
    return tuple(readings)


def _reading(row: Any, cells: dict[str, Any], linkage: SurveyedLinkage) -> SurveyReading:
    space = linkage.space
    kind = ReadingKind(str(cells.get("kind", "")).strip().upper())
    # A spreadsheet takes the point 4 for a number.
    texts = (cells.get(name, "") for name in ("from", "to"))
    ends = tuple(f"{each:g}" if isinstance(each, float) else str(each).strip() for each in texts)
    points = [point.name for point in space.mechanism.points]
    angles = [(plane, what) for plane in space.planes for what in ("hinge", "dihedral")]
    angles += [(slider, "axis") for slider in space.sliders]
    nothing = [("", "")]
    known = {
        ReadingKind.DISTANCE: list(permutations(points, 2)),
        ReadingKind.ANGLE: angles,
        ReadingKind.PLUNGER: nothing,
        ReadingKind.EXTENSION: nothing if space.moves_reference else [],
    }
    if ends not in known[kind]:
        raise ValueError(
            f"no {kind} from {ends[0]!r} to {ends[1]!r}: expected points of"
            f" {', '.join(points)}, angles of {angles}, for the plunger blank cells"
        )
    turns = space.mechanism.output.kind == "angle" and kind is ReadingKind.PLUNGER
    is_angle = turns or kind is ReadingKind.ANGLE
    value = _number(cells, "value", is_angle)
    u = _number(cells, "u", is_angle) or (_ANGLE_U if is_angle else _DEFAULT_U[kind])
    least = 0.0 if kind in (ReadingKind.DISTANCE, ReadingKind.EXTENSION) else -np.inf
    if value is None or not value > least or not u > 0.0:
        raise ValueError(f"{kind} {value} ± {u}: expected a reading above 0 and its uncertainty")
    extension = _number(cells, "extension", is_angle=False)
    return SurveyReading(row, kind, *ends, value, u, extension, is_angle)


def _number(cells: dict[str, Any], name: str, is_angle: bool) -> float | None:
    """The number of a quantity. [in or rad]"""
    given = [(unit, f"{name}_{unit}") for unit in ("in", "mm", "deg") if f"{name}_{unit}" in cells]
    if not given:
        return None
    ((unit, column),) = given[:1]
    text = str(cells[column])
    if len(given) > 1 or (unit == "deg") != is_angle:
        raise ValueError(f"{column} {text!r}: expected one {'angle' if is_angle else 'length'}")
    try:
        number = float(text)
    except ValueError:
        number = np.nan
    if not np.isfinite(number):
        raise ValueError(f"{column} {text!r}: expected a number")
    return float(np.radians(number)) if is_angle else LengthUnit.parse(unit).to_inches(number)
