"""Where the coordinates come from: a search for linkages that meet printed numbers.

The coordinates at mid-position, the planes, the plunger's axis and the release stroke are free;
link lengths and branch signs follow. Every target with ``search = true`` becomes a residual in
units of its tolerance. A start is polished by least squares; without a start, random linkages are
drawn, the best are polished, and the first that meets everything is taken. What the targets leave
free is reported: it is not known.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from time import monotonic

import numpy as np
from numpy.random import Generator

from mlg_troubleshoot.arrays import STEP, Array, central_slopes, central_steps
from mlg_troubleshoot.errors import InconclusiveDataError, MechanismError, UsageError
from mlg_troubleshoot.gear.design import DesignSpace
from mlg_troubleshoot.gear.gear import Gear, Linkage
from mlg_troubleshoot.geometry.mechanism import Dyad
from mlg_troubleshoot.paper.targets import INSIDE, Computed, Target
from mlg_troubleshoot.paper.verification import Facts

Progress = Callable[[str, int, int | None], None]

# Stands for the miss of a target that a linkage has no value for, in its tolerances. [1]
_FAR = 50
# Decimals of a coordinate, as the paper prints them. [1]
_DECIMALS = 4
# Linkages drawn at a time, how many of them are polished, and dampings tried in a step. [1]
_WAVE = 150
_POLISHED = 4
_DAMPINGS = 12
# Links outside these lengths are not of a landing gear of this size, assumed. [in]
_SMALL_LENGTH_IN = 0.4
_LARGE_IN = 22


@dataclass(frozen=True, slots=True)
class Reconstruction:
    """A linkage that was searched for.

    Attributes
    ----------
    linkage : Linkage
        Its coordinates rounded to 1e-4 in.
    numbers : int
        How many numbers of the linkage are free: coordinates, angles, stroke.
    determined : int
        How many directions in the space of these numbers the binding targets determine.
    loosest : tuple of (str, float)
        Numbers that can change most while every target stays met to first order, with their part.
        [1]
    """

    linkage: Linkage
    met: tuple[Computed, ...]
    numbers: int
    determined: int
    loosest: tuple[tuple[str, float], ...]
    evaluations: int
    seed: int

    @property
    def meets_all(self) -> bool:
        return all(each.holds for each in self.met)


def reconstruct(
    gear: Gear,
    targets: tuple[Target, ...],
    rng: Generator,
    seed: int,
    start: Linkage | None = None,
    minutes: float = 15.0,
    on_progress: Progress | None = None,
) -> Reconstruction:
    """Search a linkage of the gear's topology that meets targets."""
    wanted = tuple(target for target in targets if target.search)
    if not wanted:
        raise UsageError(
            "no target has search = true", "Mark the numbers that a linkage must meet."
        )
    search = _Search(gear, wanted, monotonic() + 60.0 * minutes, on_progress)
    if start is not None:
        return search.report(search.polished(search.space.vector(start), 60), seed)
    while monotonic() < search.until:
        drawn = [random_vector(search.space, rng) for _ in range(_WAVE)]
        order = np.argsort([search.loss(vector) for vector in drawn])
        for place in order[:_POLISHED]:
            found = search.polished(drawn[int(place)], 45)
            if search.loss(found) < 1.0:
                report = search.report(found, seed)
                if report.meets_all:
                    return report
            if monotonic() > search.until:
                break
    raise InconclusiveDataError(
        f"no linkage met the {len(wanted)} targets in {minutes:g} minutes ({search.tried} were"
        " tried)",
        "Give more --minutes, another --seed, or wider tolerances; targets may contradict each"
        " other.",
    )


def random_vector(space: DesignSpace, rng: Generator) -> Array:
    """An implausible linkage, to start a search from: its driven link's far end is
    remote.
    """
    vector = rng.uniform(-7.0, 7.0, len(space.names))
    for i, name in enumerate(space.names):
        if name.endswith((".direction", ".axis")):
            vector[i] = rng.uniform(-np.pi, np.pi)
        elif name.endswith(".dihedral"):
            vector[i] = rng.uniform(0.0, 1.0)
        elif name == "extension":
            vector[i] = rng.uniform(0.5, 1.1)
    driven = next((s for s in space.mechanism.steps if isinstance(s, Dyad) and s.driven), None)
    if driven is not None and f"{driven.upstream}.x" in space.names:
        i = space.names.index(f"{driven.upstream}.x")
        turn = rng.uniform(-np.pi, np.pi)
        length = rng.uniform(10.0, 18.0)
        vector[i : i + 2] = length * np.cos(turn), length * np.sin(turn)
    return vector


class _Search:
    """Residuals of candidate linkages, with a count and a deadline."""

    def __init__(
        self, gear: Gear, targets: tuple[Target, ...], until: float, on_progress: Progress | None
    ) -> None:
        self.gear = gear
        self.targets = targets
        self.space = DesignSpace(gear.reference)
        self.until = until
        self.on_progress = on_progress
        self.tried = 0

    def residuals(self, vector: Array) -> Array:
        """Misses of all targets in units of their tolerances, and of plain mechanical sense."""
        self.tried += 1
        if self.on_progress is not None and self.tried % 20 == 0:
            self.on_progress("linkages tried", self.tried, None)
        sense = self._sense(vector)
        try:
            with np.errstate(all="ignore"):
                model = self.gear.model_of(self.space.linkage(vector))
                facts = Facts(self.gear, model, quick=True)
                misses = [_miss(target, facts.measure(target)) for target in self.targets]
        except (MechanismError, ValueError, np.linalg.LinAlgError):
            misses = [_FAR] * len(self.targets)
        found = np.array(misses)
        finite = np.nan_to_num(found, nan=_FAR, posinf=_FAR, neginf=-_FAR)
        return np.concatenate([finite, sense])

    def loss(self, vector: Array) -> float:
        return _loss(self.residuals(vector))

    def _sense(self, vector: Array) -> Array:
        """No link is implausibly short or long."""
        mechanism = self.space.linkage(vector).mechanism
        lengths = []
        for step in mechanism.steps:
            for other in (getattr(step, name, "") for name in ("upstream", "downstream", "pivot")):
                if other:
                    ends = (
                        mechanism.reference_in_space(step.joint),
                        mechanism.reference_in_space(other),
                    )
                    lengths.append(float(np.linalg.norm(ends[0] - ends[1])))
        spans = np.array(lengths)
        dihedral = np.array([p.dihedral for p in mechanism.planes if p.parent is not None])
        stroke = vector[-1]
        return np.concatenate(
            [
                np.maximum(0.0, _SMALL_LENGTH_IN - spans) * 10.0,
                np.maximum(0.0, spans - _LARGE_IN),
                np.maximum(0.0, np.abs(dihedral) - 1.2) * 10.0,
                [max(0.0, 0.3 - stroke) * 10.0, max(0.0, stroke - 1.5) * 10.0],
            ]
        )

    def polished(self, vector: Array, rounds: int) -> Array:
        """Improve a linkage by damped least squares; the step grows and shrinks with success."""
        value = self.residuals(vector)
        damping = 1e-2
        for _ in range(rounds):
            if monotonic() > self.until or not np.any(np.abs(value) > 1e-9):
                break
            slopes = self._slopes(vector, value)
            improved = False
            for _ in range(_DAMPINGS):
                gram = slopes.T @ slopes
                damped = gram + damping * np.eye(len(vector))
                step = -np.linalg.solve(damped, slopes.T @ value)
                step *= min(1.0, 1.5 / float(np.abs(step).max()))
                trial = self.residuals(vector + step)
                if _loss(trial) < _loss(value):
                    vector = vector + step
                    value = trial
                    improved = True
                    damping = max(damping / 4.0, 1e-9)
                    break
                damping *= 6.0
            if not improved:
                break
        return vector

    def _slopes(self, vector: Array, value: Array) -> Array:
        moves = STEP * np.eye(len(vector))
        columns = [(self.residuals(vector + moved) - value) / STEP for moved in moves]
        return np.clip(np.array(columns).T, -1e6, 1e6)

    def report(self, vector: Array, seed: int) -> Reconstruction:
        vector = np.round(vector, _DECIMALS)
        linkage = self.space.linkage(vector)
        facts = Facts(self.gear, self.gear.model_of(linkage))
        met = tuple(Computed(target, facts.measure(target)) for target in self.targets)
        rows = self._binding_slopes(vector, met)
        determined = 0
        loosest = tuple((name, 1.0) for name in self.space.names[:5])
        if len(rows):
            normalised = rows / np.linalg.norm(rows, axis=1, keepdims=True)
            _, sizes, turned = np.linalg.svd(normalised)
            determined = int(np.count_nonzero(sizes > 1e-6))
            free = np.linalg.norm(turned[determined:], axis=0)
            order = np.argsort(-free)[:5].tolist()
            names = self.space.names
            loosest = tuple((names[i], float(free[i])) for i in order)
        return Reconstruction(linkage, met, len(vector), determined, loosest, self.tried, seed)

    def _binding_slopes(self, vector: Array, met: tuple[Computed, ...]) -> Array:
        """Slopes of what binds; a target that moves with nothing, or has no value nearby,
        determines nothing.
        """
        binding = [each.target for each in met if each.binds]

        def measured(place: Array) -> Array:
            model = self.gear.model_of(self.space.linkage(place))
            facts = Facts(self.gear, model, quick=True)
            return np.array([facts.measure(target) for target in binding])

        step = 1e-4
        values = [measured(vector + moved) for moved in central_steps(len(vector), step)]
        rows = central_slopes(np.array(values), step).T
        determines = np.isfinite(rows).all(axis=1) & rows.any(axis=1)
        return rows[determines]


def _loss(residuals: Array) -> float:
    return float(np.sum(np.log1p(residuals**2)))


def _miss(target: Target, computed: float) -> float:
    """Distance from what is accepted, in tolerances; limits are met with a little to spare."""
    if np.isfinite(target.low) and np.isfinite(target.high):
        middle = (target.low + target.high) / 2.0
        half = (target.high - target.low) / 2.0
        return (computed - middle) / half
    is_least = np.isfinite(target.low)
    sense = 1.0 if is_least else -1.0
    bound = target.low if is_least else target.high
    spare = INSIDE * max(abs(bound), 0.05)
    return max(0.0, sense * (bound + sense * spare - computed)) / spare
