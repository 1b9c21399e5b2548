"""Where the coordinates come from: a search for linkages that meet printed numbers.

The coordinates at mid-position, the planes, the plunger's axis and the release stroke are free; link lengths
and branch signs follow. Every target with ``search = true`` becomes a residual in units of its tolerance. A
start is polished by least squares; without a start, random linkages are drawn, the best are polished, and
the first that meets everything is taken. What the targets leave free is reported: it is not known.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from time import monotonic

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from mlg_troubleshoot.errors import InconclusiveDataError, MechanismError, UsageError
from mlg_troubleshoot.gear.gear import Gear, Linkage
from mlg_troubleshoot.geometry.mechanism import Dyad, Mechanism, Slider, Step
from mlg_troubleshoot.studies.targets import Target
from mlg_troubleshoot.studies.verification import Facts

Array = NDArray[np.float64]
Told = Callable[[str, int, int | None], None]

_FAR = 50.0
_INSIDE = 0.02
_DECIMALS = 4
_WAVE = 150
_POLISHED = 4
_SMALL_LENGTH_IN, _LARGE_IN = 0.4, 22.0


@dataclass(frozen=True, slots=True)
class Met:
    """One target on a reconstructed linkage.

    Parameters
    ----------
    target : Target
        The target.
    computed : float
        What the linkage gives. [the target's unit]
    holds : bool
        True if it is accepted.
    binds : bool
        True if it determines the linkage: a printed value, or a limit that the linkage lies at.
    """

    target: Target
    computed: float
    holds: bool
    binds: bool


@dataclass(frozen=True, slots=True)
class Reconstruction:
    """A linkage that was searched for.

    Parameters
    ----------
    linkage : Linkage
        The linkage, its coordinates rounded to 1e-4 in.
    met : tuple of Met
        Every target with its number.
    numbers : int
        Free numbers of the linkage: coordinates, angles, stroke.
    determined : int
        Directions in the space of these numbers that the binding targets determine.
    loosest : tuple of tuple of (str, float)
        Numbers that can change most while every target stays met to first order, with their part. [1]
    evaluations : int
        Linkages that were tried.
    seed : int
        Seed of the search.
    """

    linkage: Linkage
    met: tuple[Met, ...]
    numbers: int
    determined: int
    loosest: tuple[tuple[str, float], ...]
    evaluations: int
    seed: int

    @property
    def meets_all(self) -> bool:
        """True if every target is met."""
        return all(each.holds for each in self.met)


def reconstruct(
    gear: Gear,
    targets: tuple[Target, ...],
    rng: Generator,
    seed: int,
    start: Linkage | None = None,
    minutes: float = 15.0,
    told: Told | None = None,
) -> Reconstruction:
    """Search a linkage of the gear's topology that meets targets.

    Parameters
    ----------
    gear : Gear
        The gear: topology, joints, limits, calibration.
    targets : tuple of Target
        Printed numbers; those with ``search`` count.
    rng : Generator
        Source of random linkages.
    seed : int
        Its seed, for the result.
    start : Linkage, optional
        A linkage to polish, else random ones.
    minutes : float
        Time to give up after.
    told : callable, optional
        Called with the stage, linkages tried and None.

    Returns
    -------
    Reconstruction
        The best linkage found; it may not meet everything if it was polished from a start.

    Raises
    ------
    UsageError
        If no target is to be searched.
    InconclusiveDataError
        If no random linkage met the targets in time.
    """
    wanted = tuple(target for target in targets if target.search)
    if not wanted:
        raise UsageError("no target has search = true", "Mark the numbers that a linkage must meet.")
    search = _Search(gear, wanted, monotonic() + 60.0 * minutes, told)
    if start is not None:
        return search.report(search.polished(search.space.vector(start), 60), seed)
    while monotonic() < search.until:
        drawn = [search.space.random(rng) for _ in range(_WAVE)]
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
        f"no linkage met the {len(wanted)} targets in {minutes:g} minutes ({search.tried} were tried)",
        "Give more --minutes, another --seed, or wider tolerances; targets may contradict each other.",
    )


class _Space:
    """The free numbers of a mechanism as one vector."""

    def __init__(self, gear: Gear) -> None:
        self.gear = gear
        mechanism = gear.reference.mechanism
        # One pivot stays: moving everything together changes nothing.
        held = next((p.name for p in mechanism.points if p.fixed and p.virtual_link is not None), "")
        self.points = tuple(p.name for p in mechanism.points if p.name != held)
        self.planes = tuple(p.name for p in mechanism.planes if p.parent is not None)
        self.sliders = tuple(s.joint for s in mechanism.steps if isinstance(s, Slider))
        self.names = (
            *(f"{p}.{axis}" for p in self.points for axis in "xy"),
            *(f"{p}.{angle}" for p in self.planes for angle in ("hinge direction", "dihedral")),
            *(f"axis of {s}" for s in self.sliders),
            "stroke",
        )

    def vector(self, linkage: Linkage) -> Array:
        m = linkage.mechanism
        values = [v for name in self.points for v in (m.point(name).x, m.point(name).y)]
        values += [v for p in m.planes if p.parent is not None for v in (p.hinge_direction, p.dihedral)]
        values += [s.axis for s in m.steps if isinstance(s, Slider)]
        return np.array([*values, linkage.stroke[1] - linkage.stroke[0]])

    def random(self, rng: Generator) -> Array:
        reach = 7.0
        values = rng.uniform(-reach, reach, 2 * len(self.points))
        angles = [v for _ in self.planes for v in (rng.uniform(-np.pi, np.pi), rng.uniform(0.0, 1.0))]
        axes = rng.uniform(-np.pi, np.pi, len(self.sliders))
        vector = np.array([*values, *angles, *axes, rng.uniform(0.5, 1.1)])
        # The actuator's far end is remote.
        driven = next((s for s in self.gear.reference.mechanism.steps if isinstance(s, Dyad) and s.driven), None)
        if driven is not None and driven.upstream in self.points:
            i = 2 * self.points.index(driven.upstream)
            turn, length = rng.uniform(-np.pi, np.pi), rng.uniform(10.0, 18.0)
            vector[i : i + 2] = length * np.cos(turn), length * np.sin(turn)
        return vector

    def linkage(self, vector: Array, name: str = "N") -> Linkage:
        given = self.gear.reference
        low = given.stroke[0]
        values = iter(vector.tolist())
        places = {p: (next(values), next(values)) for p in self.points}
        turned = {p: (next(values), next(values)) for p in self.planes}
        axes = {s: next(values) for s in self.sliders}
        stroke = next(values)
        points = tuple(
            replace(p, x=places[p.name][0], y=places[p.name][1]) if p.name in places else p
            for p in given.mechanism.points
        )
        planes = tuple(
            replace(p, hinge_direction=turned[p.name][0], dihedral=turned[p.name][1]) if p.name in turned else p
            for p in given.mechanism.planes
        )
        steps = tuple(replace(s, axis=axes[s.joint]) if isinstance(s, Slider) else s for s in given.mechanism.steps)
        mechanism = Mechanism(planes, points, steps, given.mechanism.output, low + stroke)
        return Linkage(name, _signed(mechanism), (low, low + stroke))


def _signed(mechanism: Mechanism) -> Mechanism:
    """Set every branch sign as the coordinates have it."""
    steps: list[Step] = []
    for step in mechanism.steps:
        if isinstance(step, Dyad):
            _, axes = mechanism.frame(mechanism.point(step.joint).plane)
            start = mechanism.reference_in_space(step.upstream)
            base = axes[:2] @ (mechanism.reference_in_space(step.downstream) - start)
            arm = axes[:2] @ (mechanism.reference_in_space(step.joint) - start)
            steps.append(replace(step, sign=1.0 if base[0] * arm[1] - base[1] * arm[0] >= 0.0 else -1.0))
        elif isinstance(step, Slider):
            _, axes = mechanism.frame(mechanism.point(step.joint).plane)
            link = axes[:2] @ (mechanism.reference_in_space(step.joint) - mechanism.reference_in_space(step.upstream))
            ahead = link @ np.array([np.cos(step.axis), np.sin(step.axis)])
            steps.append(replace(step, sign=1.0 if ahead >= 0.0 else -1.0))
        else:
            steps.append(step)
    return replace(mechanism, steps=tuple(steps))


class _Search:
    """Residuals of candidate linkages, with a count and a deadline."""

    def __init__(self, gear: Gear, targets: tuple[Target, ...], until: float, told: Told | None) -> None:
        self.gear = gear
        self.targets = targets
        self.space = _Space(gear)
        self.until = until
        self.told = told
        self.tried = 0

    def residuals(self, vector: Array) -> Array:
        """Misses of all targets in units of their tolerances, and of plain mechanical sense."""
        self.tried += 1
        if self.told is not None and self.tried % 20 == 0:
            self.told("linkages tried", self.tried, None)
        sense = self._sense(vector)
        try:
            with np.errstate(all="ignore"):
                model = self.gear.model_of(self.space.linkage(vector))
                facts = Facts(self.gear, model, quick=True)
                misses = [_miss(target, facts.measure(target)) for target in self.targets]
        except (MechanismError, ValueError, np.linalg.LinAlgError):
            misses = [_FAR] * len(self.targets)
        return np.concatenate([np.nan_to_num(np.array(misses), nan=_FAR, posinf=_FAR, neginf=-_FAR), sense])

    def loss(self, vector: Array) -> float:
        return float(np.sum(np.log1p(self.residuals(vector) ** 2)))

    def _sense(self, vector: Array) -> Array:
        """No link so short or so long that nobody would build it."""
        mechanism = self.space.linkage(vector).mechanism
        lengths = []
        for step in mechanism.steps:
            for other in (getattr(step, name, "") for name in ("upstream", "downstream", "pivot")):
                if other:
                    ends = mechanism.reference_in_space(step.joint), mechanism.reference_in_space(other)
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
            for _ in range(6):
                gram = slopes.T @ slopes
                step = -np.linalg.solve(gram + damping * np.eye(len(vector)), slopes.T @ value)
                step *= min(1.0, 1.5 / float(np.abs(step).max()))
                trial = self.residuals(vector + step)
                if np.sum(np.log1p(trial**2)) < np.sum(np.log1p(value**2)):
                    vector, value, improved = vector + step, trial, True
                    damping = max(damping / 4.0, 1e-9)
                    break
                damping *= 6.0
            if not improved:
                break
        return vector

    def _slopes(self, vector: Array, value: Array, step: float = 1e-5) -> Array:
        columns = []
        for i in range(len(vector)):
            moved = vector.copy()
            moved[i] += step
            columns.append((self.residuals(moved) - value) / step)
        return np.clip(np.array(columns).T, -1e6, 1e6)

    def report(self, vector: Array, seed: int) -> Reconstruction:
        vector = np.round(vector, _DECIMALS)
        linkage = self.space.linkage(vector)
        facts = Facts(self.gear, self.gear.model_of(linkage))
        met = []
        for target in self.targets:
            computed = facts.measure(target)
            met.append(Met(target, computed, target.holds(computed), _binds(target, computed)))
        rows = self._binding_slopes(vector, met)
        determined, loosest = 0, tuple((name, 1.0) for name in self.space.names[:5])
        if len(rows):
            _, sizes, turned = np.linalg.svd(rows / np.linalg.norm(rows, axis=1, keepdims=True))
            determined = int(np.count_nonzero(sizes > 1e-6))
            free = np.linalg.norm(turned[determined:], axis=0)
            order = np.argsort(-free)[:5]
            loosest = tuple((self.space.names[int(i)], float(free[int(i)])) for i in order)
        return Reconstruction(linkage, tuple(met), len(vector), determined, loosest, self.tried, seed)

    def _binding_slopes(self, vector: Array, met: list[Met]) -> Array:
        binding = [each.target for each in met if each.binds]
        columns = []
        for i in range(len(vector)):
            ends = []
            for sign in (1.0, -1.0):
                moved = vector.copy()
                moved[i] += sign * 1e-4
                facts = Facts(self.gear, self.gear.model_of(self.space.linkage(moved)), quick=True)
                ends.append(np.array([facts.measure(target) for target in binding]))
            columns.append((ends[0] - ends[1]) / 2e-4)
        return np.array(columns).T


def _miss(target: Target, computed: float) -> float:
    """Distance from what is accepted, in tolerances; limits are met with a little to spare."""
    if np.isfinite(target.low) and np.isfinite(target.high):
        middle, half = (target.low + target.high) / 2.0, (target.high - target.low) / 2.0
        return (computed - middle) / half
    bound = target.low if np.isfinite(target.low) else target.high
    unit = max(abs(bound), 0.05)
    spare = bound + (1.0 if np.isfinite(target.low) else -1.0) * _INSIDE * unit
    short = spare - computed if np.isfinite(target.low) else computed - spare
    return max(0.0, short) / (_INSIDE * unit)


def _binds(target: Target, computed: float) -> bool:
    if np.isfinite(target.low) and np.isfinite(target.high):
        return True
    bound = target.low if np.isfinite(target.low) else target.high
    return abs(computed - bound) <= 2.5 * _INSIDE * max(abs(bound), 0.05)


def member_toml(linkage: Linkage, name: str) -> str:
    """Write a linkage as a member of an ensemble file.

    Parameters
    ----------
    linkage : Linkage
        The linkage.
    name : str
        Its name in the ensemble.

    Returns
    -------
    str
        A ``[members.NAME]`` table, to be appended to the gear's ensemble file.
    """
    m = linkage.mechanism
    lines = [f"[members.{name}]", f"range = [{linkage.stroke[0]!r}, {linkage.stroke[1]!r}]"]
    lines.append(f"reference = {m.reference_input!r}")
    for plane in m.planes:
        if plane.parent is not None:
            lines += ["", f"[members.{name}.planes.{plane.name}]"]
            lines.append(f"hinge_direction_deg = {float(np.degrees(plane.hinge_direction))!r}")
            lines.append(f"dihedral_deg = {float(np.degrees(plane.dihedral))!r}")
    lines += ["", f"[members.{name}.points]"]
    lines += [f'"{p.name}" = [{p.x!r}, {p.y!r}]' for p in m.points]
    lines += ["", f"[members.{name}.steps]"]
    for step in m.steps:
        if isinstance(step, Dyad):
            lines.append(f'"{step.joint}" = {{ sign = {step.sign:+.0f} }}')
        elif isinstance(step, Slider):
            axis = float(np.degrees(step.axis))
            lines.append(f'"{step.joint}" = {{ sign = {step.sign:+.0f}, axis_deg = {axis!r} }}')
    return "\n".join(lines) + "\n"
