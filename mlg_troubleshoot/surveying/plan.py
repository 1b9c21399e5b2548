"""Which readings are worth taking: the rows of a template, the next reading, and what a survey
leaves unknown.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mlg_troubleshoot.arrays import Array
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.surveying import tuned
from mlg_troubleshoot.surveying.readings import (
    DEFAULT_U,
    MINUTES,
    Quantity,
    ReadingKind,
    Readings,
    SurveyedLinkage,
    SurveyReading,
)
from mlg_troubleshoot.surveying.survey import Prior


@dataclass(frozen=True, slots=True)
class Suggested:
    """A reading worth taking: the share by which it is expected to narrow what is unknown. [1]"""

    reading: SurveyReading
    narrowing: float


def planned(gear: Gear, distances: int = 24) -> tuple[tuple[SurveyReading, bool], ...]:
    """The rows of a template, each with whether the others check it.

    The extension, the plunger over the stroke, the angles, and distances at the reference position:
    those that leave the least unknown of the logarithms of the amplification indices, by a linear
    estimate on average over linkages of the ensemble and between them, and that check each other.
    From the rigid pairs each is exchanged for a better one until none is better: other choices to
    begin with end worse.
    """
    design = _Design(SurveyedLinkage(gear))
    count = min(distances, len(design.free))
    first = design.free[: min(count, len(design.linkage.rigid))]
    rows = [
        *design.given,
        *sorted(design.exchanged(first, count)),
    ]
    held = np.median(design.held(rows), axis=0)
    is_checked = (held > tuned.CHECKED).tolist()
    chosen = [design.pool[i] for i in rows]
    return tuple(zip(chosen, is_checked, strict=True))


class _Design:
    """Slopes of everything that can be read, in variables in which the prior is the unit sphere."""

    def __init__(
        self,
        linkage: SurveyedLinkage,
        taken: Readings = (),
        quantity: Quantity | None = None,
    ) -> None:
        prior = Prior(linkage)
        members = prior.members
        between = [
            (1 - t) * a + t * b
            for i, a in enumerate(members)
            for b in members[:i]
            for t in tuned.BETWEEN
        ]
        points = np.array([*members, *between])
        points = points[linkage.closes(points)]
        self.linkage = linkage
        self.pool = (*linkage.candidates(), *taken)
        u = np.array([r.u for r in self.pool])
        with np.errstate(all="ignore"):
            _, slopes = linkage.slopes(self.pool, points)
            slopes = slopes / u[:, None] @ prior.root
            wanted = linkage.log_slopes(points, quantity) @ prior.root
        sound = np.isfinite(slopes).all(axis=(1, 2))
        sound &= np.isfinite(wanted).all(axis=(1, 2))
        self.slopes = slopes[sound]
        self.wanted = wanted[sound]
        is_distance = [r.kind is ReadingKind.DISTANCE for r in self.pool]
        self.given = [i for i, distance in enumerate(is_distance) if not distance]
        self.free = [i for i, distance in enumerate(is_distance) if distance]
        self.known = np.eye(slopes.shape[2])
        if linkage.travel is not None:
            travel = prior.root[-1] / DEFAULT_U[ReadingKind.TRAVEL]
            self.known = self.known + np.outer(travel, travel)

    def covariance(self, rows: list[int]) -> Array:
        """Covariance of each linkage's variables after these readings."""
        g = self.slopes[:, rows]
        return np.linalg.inv(self.known + np.swapaxes(g, 1, 2) @ g)

    def held(self, rows: list[int]) -> Array:
        """How much of each reading the others check, shape (n_linkages, n_rows): 1 if they tell it
        exactly. [1]
        """
        g = self.slopes[:, rows]
        left: Array = (g @ self.covariance(rows) * g).sum(axis=2)
        return 1.0 - left

    def after(self, rows: list[int], others: list[int]) -> tuple[Array, Array, Array, Array]:
        """Variances of the wanted logarithms after these readings and one of the others.

        Returns the variances, shape (n_linkages, n_quantities, n_others), [1] and with what they
        were found: the covariance, how each other reading moves the variables, and its variance in
        units of its own.
        """
        covariance = self.covariance(rows)
        g = self.slopes[:, others]
        moved = np.swapaxes(g @ covariance, 1, 2)
        known = (np.swapaxes(g, 1, 2) * moved).sum(axis=1)
        size = 1.0 + known[:, None, :]
        before = (self.wanted @ covariance * self.wanted).sum(axis=2)
        wanted = before[:, :, None] - (self.wanted @ moved) ** 2 / size
        return wanted, covariance, moved, size

    def best(self, taken: list[int]) -> int:
        """The distance to read in addition to those taken."""
        rows = [*self.given, *taken]
        others = [j for j in self.free if j not in taken]
        wanted, covariance, moved, size = self.after(rows, others)
        known = self.slopes[:, rows]
        before = (known @ covariance * known).sum(axis=2)[:, :, None]
        held = 1.0 - before + (known @ moved) ** 2 / size
        held = np.concatenate([held, 1.0 / size], axis=1)
        held = np.maximum(held, 0.0)
        checks = np.log(held + tuned.LOOSE).sum(axis=1)
        variances = np.maximum(wanted, 0.0) + tuned.WELL_KNOWN**2
        unknown = np.log(variances).sum(axis=1)
        cost = unknown - tuned.BRACING * checks
        return others[int(np.argmin(cost.mean(axis=0)))]

    def exchanged(self, taken: list[int], count: int) -> list[int]:
        """Fill up a choice and exchange its distances stepwise."""
        while len(taken) < count:
            taken = [*taken, self.best(taken)]
        for _ in range(tuned.SWEEPS if count < len(self.free) else 0):
            before = set(taken)
            for _ in range(count):
                taken = [*taken[1:], self.best(taken[1:])]
            if before == set(taken):
                break
        return taken


def suggested_early(
    linkage: SurveyedLinkage, taken: Readings, quantity: Quantity
) -> Suggested | None:
    """The reading that narrows the wanted quantities most per minute while little is known.

    What fits a few readings may be far from any gear that is built, so that it tells little about
    the next: this is the linear estimate on average over the linkages of the ensemble and between
    them, as for a template.
    """
    design = _Design(linkage, taken, quantity)
    known = {r.what for r in taken}
    first = len(design.pool) - len(taken)
    others = [j for j in range(first) if design.pool[j].what not in known]
    rows = list(range(first, len(design.pool)))
    if not others or not len(design.slopes):
        return None
    variances = design.wanted @ design.covariance(rows) * design.wanted
    before = variances.sum(axis=(1, 2))[:, None]
    wanted, *_ = design.after(rows, others)
    after = np.maximum(wanted.sum(axis=1), 0.0)
    left = np.divide(after, before, out=np.ones_like(after), where=before > 0.0)
    narrowing = 1.0 - np.sqrt(left).mean(axis=0)
    return _worth_most(tuple(design.pool[j] for j in others), narrowing)


def _worth_most(candidates: Readings, narrowing: Array) -> Suggested | None:
    """The reading that narrows most per minute, None if it hardly does."""
    minutes = np.array([MINUTES[c.kind] for c in candidates])
    best = int(np.argmax(narrowing / minutes))
    return (
        Suggested(candidates[best], float(narrowing[best]))
        if narrowing[best] >= tuned.LEAST_NARROWING
        else None
    )


def suggested(
    linkage: SurveyedLinkage, draws: Array, wanted: Array, taken: Readings
) -> Suggested | None:
    """The reading that narrows the wanted quantities most per minute, None if none of them matters.

    By how much is the linear estimate over the draws: a reading y with uncertainty u leaves of the
    variance of q the share 1 − cov(q, y)² / (var q · (var y + u²)). wanted, shape (n_draws,
    n_quantities): quantities in one unit, on which the variances add. [any]
    """
    known = {r.what for r in taken}
    candidates = tuple(c for c in linkage.candidates() if c.what not in known)
    if not candidates:
        return None
    with np.errstate(all="ignore"):
        y = linkage.predicted(candidates, draws)
    reached = np.isfinite(y).mean(axis=0) >= 1.0 - tuned.MOST_OPEN
    candidates = tuple(c for c, r in zip(candidates, reached, strict=True) if r)
    y = y[:, reached]
    sound = np.isfinite(np.hstack([y, wanted])).all(axis=1)
    y = y[sound] - y[sound].mean(axis=0)
    q = wanted[sound] - wanted[sound].mean(axis=0)
    total = float((q * q).sum())
    if total <= 0.0 or len(y) < 3 or not candidates:
        return None
    u = np.array([c.u for c in candidates])
    shared = ((q.T @ y) ** 2).sum(axis=0)
    squares = (y * y).sum(axis=0) + len(y) * u * u
    explained = shared / squares / total
    # What chance alone would explain with so many draws.
    beyond_chance = np.clip(explained - 1.0 / len(y), 0.0, 1.0)
    narrowing = 1.0 - np.sqrt(1.0 - beyond_chance)
    return _worth_most(candidates, narrowing)
