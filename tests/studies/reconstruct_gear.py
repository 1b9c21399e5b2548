"""Where the coordinates come from: a search for linkages that meet printed numbers.

The coordinates at mid-position, the planes, the plunger's axis and the release stroke are free;
link lengths and branch signs follow. Every target with ``search = true`` becomes a residual in
units of its tolerance. A start is polished by least squares; without a start, random linkages are
drawn, the best are polished, and the first that meets everything is taken. What the targets leave
free is reported: it is not known. The linkages that ship were found by such a search;
``mlg gear verify`` compares them with the paper.

``python -m tests.studies.reconstruct_gear [--start A] [--seed N] [--minutes M] [--targets TOML]``
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from time import monotonic

import numpy as np
import tomli_w
from numpy.random import Generator
from scipy.optimize import least_squares

from mlg_troubleshoot.arrays import Array, central_slopes, central_steps
from mlg_troubleshoot.errors import MechanismError
from mlg_troubleshoot.gear.assembly import DesignSpace, member_values
from mlg_troubleshoot.gear.gear import Gear, Linkage
from mlg_troubleshoot.gear.gear_file import load_gear
from mlg_troubleshoot.geometry.mechanism import Dyad
from mlg_troubleshoot.indices.index_table import Amplification, amplification
from mlg_troubleshoot.indices.variance import TensorIndices, tensor_indices
from mlg_troubleshoot.paper.verification import Computed, Facts, Target, load_targets, targets_file

# Stands for the miss of a target that a linkage has no value for, in its tolerances. [1]
_FAR = 50
# Decimals of a coordinate, as the paper prints them. [1]
_DECIMALS = 4
# A limit is met with this share of it, or of 0.05, to spare. [1]
_INSIDE = 0.02
# Linkages drawn at a time, and how many of them are polished. [1]
_WAVE = 150
_POLISHED = 4
# Positions of a curve while a linkage is sought. [1]
_CURVE = 61
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


class QuickFacts(Facts):
    """What a linkage gives, with fewer positions and points: good to 1e-4."""

    @cached_property
    def indices(self) -> TensorIndices:
        return tensor_indices(self.response, self.limits, order=2)

    @cached_property
    def growth(self) -> Amplification:
        return amplification(self.gear, self.model, _CURVE)

    @cached_property
    def curve(self) -> tuple[Array, Array]:
        stroke = np.linspace(*self.model.stroke, _CURVE)
        return stroke, self.model.plunger(stroke)


def reconstruct(
    gear: Gear,
    targets: tuple[Target, ...],
    rng: Generator,
    seed: int,
    start: Linkage | None = None,
    minutes: float = 15.0,
) -> Reconstruction | None:
    """Search a linkage of the gear's topology that meets targets; None if none did in time."""
    search = _Search(gear, tuple(target for target in targets if target.search))
    if start is not None:
        return search.report(search.polished(search.space.vector(start)), seed)
    until = monotonic() + 60.0 * minutes
    while monotonic() < until:
        drawn = [random_vector(search.space, rng) for _ in range(_WAVE)]
        order = np.argsort([search.loss(vector) for vector in drawn])
        for place in order[:_POLISHED]:
            found = search.polished(drawn[int(place)])
            if search.loss(found) < 1.0:
                report = search.report(found, seed)
                if report.meets_all:
                    return report
            if monotonic() > until:
                break
    return None


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
    """Residuals of candidate linkages, counted."""

    def __init__(self, gear: Gear, targets: tuple[Target, ...]) -> None:
        self.gear = gear
        self.targets = targets
        self.space = DesignSpace(gear.reference)
        self.tried = 0

    def residuals(self, vector: Array) -> Array:
        """Misses of all targets in units of their tolerances, and of plain mechanical sense."""
        self.tried += 1
        sense = self._sense(vector)
        try:
            with np.errstate(all="ignore"):
                model = self.gear.model_of(self.space.linkage(vector))
                facts = QuickFacts(self.gear, model)
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

    def polished(self, vector: Array) -> Array:
        """Improve a linkage by least squares, in which far misses count by their logarithm."""
        found = least_squares(self.residuals, vector, loss="cauchy", x_scale="jac", max_nfev=60)
        return np.asarray(found.x)

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
        binding = [each.target for each in met if _binds(each)]

        def measured(place: Array) -> Array:
            model = self.gear.model_of(self.space.linkage(place))
            facts = QuickFacts(self.gear, model)
            return np.array([facts.measure(target) for target in binding])

        step = 1e-4
        values = [measured(vector + moved) for moved in central_steps(len(vector), step)]
        rows = central_slopes(np.array(values), step).T
        determines = np.isfinite(rows).all(axis=1) & rows.any(axis=1)
        return rows[determines]


def _binds(each: Computed) -> bool:
    """Tell whether a target determines the linkage: a value, or a limit that the linkage is at."""
    low = each.target.low
    high = each.target.high
    if np.isfinite(low) and np.isfinite(high):
        return True
    bound = low if np.isfinite(low) else high
    return bool(abs(each.computed - bound) <= 2.5 * _INSIDE * max(abs(bound), 0.05))


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
    spare = _INSIDE * max(abs(bound), 0.05)
    return max(0.0, sense * (bound + sense * spare - computed)) / spare


def main() -> None:
    asked = argparse.ArgumentParser(description=__doc__)
    asked.add_argument("--start", help="polish this linkage of the gear, else search")
    asked.add_argument("--seed", type=int, default=0)
    asked.add_argument("--minutes", type=float, default=15.0)
    asked.add_argument("--targets", type=Path, help="numbers to meet, else those of the paper")
    given = asked.parse_args()
    gear = load_gear()
    linkages = {linkage.name: linkage for linkage in gear.ensemble}
    found = reconstruct(
        gear,
        load_targets(given.targets or targets_file(gear)),
        np.random.default_rng(given.seed),
        given.seed,
        None if given.start is None else linkages[given.start],
        given.minutes,
    )
    if found is None:
        print(f"No linkage met every number in {given.minutes:g} minutes.")
        return
    for each in found.met:
        met = "met" if each.holds else "NOT MET"
        print(f"{each.target.quantity}: {each.computed:.5g} ({each.target.accepted}), {met}")
    print(
        f"{found.numbers} numbers describe the linkage; the binding targets determine"
        f" {found.determined}. Least determined: {', '.join(n for n, _ in found.loosest)}."
        f" {found.evaluations} linkages tried."
    )
    print(tomli_w.dumps({"members": {"N": member_values(found.linkage)}}))


if __name__ == "__main__":
    main()
