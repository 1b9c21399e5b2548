"""Causes that come gradually or group by group: a gauge that creeps between its calibrations, a
technician who learns, a modification that only some gears have.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from mlg_troubleshoot.arrays import Array, log_sum
from mlg_troubleshoot.diagnosis.causes.base import (
    MOST_UNREAD,
    Candidate,
    Scene,
    levels,
    share_never_read,
)
from mlg_troubleshoot.diagnosis.causes.reading import (
    RowShift,
    change_date,
    dated,
    days_since,
)
from mlg_troubleshoot.diagnosis.noise import FREEDOM, growth
from mlg_troubleshoot.misfit.beliefs import Beliefs
from mlg_troubleshoot.units import DAYS_PER_YEAR

# A gauge is calibrated once a year; in which month is not known.
_MONTHS = 12
# Aircraft from which on a step is one of several; turns in which steps and their size settle. [1]
_LEAST_AIRCRAFT = 3
_TURNS = 20
_TAILS = "tails "
# Times in which a beginner comes down to a third of what he was off, from two months on, each
# twice the last. [d]
_LEARNING_DAYS = DAYS_PER_YEAR / 6 * 2 ** np.arange(4)


class GaugeDrift(RowShift):
    """A gauge, or all of them, creep from one calibration to the next."""

    name = "gauge_drift"
    needs = ("gauge_id", "day")
    parameter = "drift_in_per_year"
    sentence = "Readings with {target} creep between calibrations"
    inspect = "Calibration of that gauge now, and its zero at each inspection"
    separates = "one gear measured right before and right after a calibration"

    def candidates(self, scene: Scene) -> Iterator[Candidate]:
        """Yield each gauge, and all together, with each month of calibration."""
        days = scene.table.quantities["day"]
        known = days[np.isfinite(days)]
        if len(known) == 0 or np.ptp(known) <= 0.5 * DAYS_PER_YEAR:
            return
        first = float(known.min())
        for gauge in (None, *levels(scene.table.factors["gauge_id"])):
            for month in range(_MONTHS):
                day = round(first - month * DAYS_PER_YEAR / _MONTHS)
                setting = {"value": gauge, **dated(scene, day)}
                yield Candidate(self, None if gauge is None else f"gauge {gauge}", setting)

    def rows(self, candidate: Candidate) -> Mapping[str, str]:
        """Those of that gauge, or all."""
        return super().rows(candidate) if candidate.target else {}

    def share(self, scene: Scene, setting: Mapping[str, Any]) -> Any:
        """Time since the calibration. [a]"""
        return days_since(scene, setting) % DAYS_PER_YEAR / DAYS_PER_YEAR

    def words(self, target: str | None) -> str:
        """Say which gauge, or that it is all of them."""
        return self.sentence.format(target=target or "every gauge")


class TechnicianLearning(RowShift):
    """A technician is off at first and becomes better with time."""

    name = "technician_learning"
    needs = ("technician_id", "day")
    parameter = "offset_at_first_in"
    sentence = "Readings by {target} were shifted at first, less and less since"
    inspect = "The earliest readings of that technician: read those gears again"
    separates = "an early gear of this technician measured again by another one"

    def candidates(self, scene: Scene) -> Iterator[Candidate]:
        """Yield each technician from his first day on, with each time in which he learns."""
        days = scene.table.quantities["day"]
        people = scene.table.factors["technician_id"]
        for person in levels(people):
            own = days[(people == person) & np.isfinite(days)]
            if len(np.unique(own)) < 2:
                continue
            first = float(own.min())
            for time in _LEARNING_DAYS:
                if 2.0 * time < np.ptp(own):
                    setting = {"value": person, **dated(scene, first), "learning_days": time}
                    yield Candidate(self, f"technician {person}", setting)

    def share(self, scene: Scene, setting: Mapping[str, Any]) -> Any:
        """The later, the less."""
        return np.exp(-np.maximum(days_since(scene, setting), 0.0) / setting["learning_days"])


class Modification(RowShift):
    """Rows of some gears are shifted: those that a column of the table's own sets apart (a
    modification, a base, a shop), or those of some aircraft, each from a date of its own.
    """

    name = "modification"
    sentence = "Readings with {target} are shifted"
    inspect = "What was changed on these gears, or is done otherwise there"
    separates = "one gear measured right before and right after the change, by the same technician"

    def is_distinct(self) -> bool:
        """A column of the table's own does not follow the clearances; aircraft are not offered
        where it matters.
        """
        return True

    def candidates(self, scene: Scene) -> Iterator[Candidate]:
        """Yield each value of each column that only this table has, and the aircraft and dates that
        a common step up or down fits best.
        """
        table = scene.table
        for column in table.own_factors:
            for value in _apart(scene, column):
                yield Candidate(self, f"{column} {value}", {"column": column, "value": value})
        datable = "tail_no" in table.factors and "day" in table.quantities and not table.doubt
        if not datable or share_never_read(scene) > MOST_UNREAD:
            return
        misfit = table.measured_in - scene.over_in
        for direction in (1.0, -1.0):
            steps = _likeliest_steps(scene, direction * misfit)
            if steps is not None and len(steps.shown) >= _LEAST_AIRCRAFT:
                since = {tail: change_date(scene, day) or day for tail, day in steps.days.items()}
                target = _TAILS + ",".join(steps.sure)
                yield Candidate(self, target, {"steps": since}, rarity=steps.rarity)

    def rows(self, candidate: Candidate) -> Mapping[str, str]:
        """Those with that value, or all."""
        setting = candidate.setting
        return {setting["column"]: setting["value"]} if "column" in setting else {}

    def share(self, scene: Scene, setting: Mapping[str, Any]) -> Any:
        """Shift the aircraft that have a step, each from its date on."""
        if "column" in setting:
            return 1.0
        after = np.zeros(len(scene.table), bool)
        for tail, step in setting["steps"].items():
            known = isinstance(step, str)
            from_day = {"day": np.nan if known else step, "since": step if known else None}
            after |= (scene.table.tails == tail) & (days_since(scene, from_day) >= 0.0)
        return after

    def words(self, target: str | None) -> str:
        """Say whose readings they are."""
        of_aircraft = target is not None and target.startswith(_TAILS)
        each = ", each from its own date on" if of_aircraft else ""
        return f"Readings {'of' if of_aircraft else 'with'} {target} are shifted{each}"


@dataclass(frozen=True)
class _Steps:
    """Which aircraft have a step of one size, and from which day on.

    Attributes
    ----------
    days : dict of str to float
        The likeliest first day of each aircraft that more likely has a step than not.
    shown : dict of str to float
        Probability of each of them that it has rows on both sides of its step. [1]
    rarity : float
        Logarithm of the likelihood over all aircraft and days, less that with these days and their
        own best size.
    """

    days: dict[str, float]
    shown: dict[str, float]
    rarity: float

    @property
    def sure(self) -> list[str]:
        """As many aircraft as have it together with half of the doubt that a name may leave (the
        other half is that of its cause); the two likeliest at least.
        """
        order = sorted(self.shown, key=lambda tail: -self.shown[tail])
        together = np.cumprod([self.shown[tail] for tail in order])
        count = max(int(np.sum(together >= (1.0 + Beliefs().sure) / 2.0)), 2)
        return sorted(order[:count])


def _apart(scene: Scene, column: str) -> list[str]:
    """Values that a column sets apart: of two the one that came later; the other is the rest."""
    texts = scene.table.factors[column]
    found = [*levels(scene.table.factors[column])]
    days = scene.table.quantities.get("day", scene.table.row.astype(float))
    if len({*texts} - {""}) == 2 and len(found) == 2:
        return [max(found, key=lambda value: float(np.nanmean(days[texts == value])))]
    return found


def _likeliest_steps(scene: Scene, misfit: Array) -> _Steps | None:
    """Find the aircraft that have a step up of one size, if there is one.

    Each is modified or not with equal chance, on each of its days with equal chance, its first one
    among them; size, level and scatter by expectation and maximisation. The likeliest steps with
    their own best size stand for all that are near them: rarity is what they fit better than all
    together.
    """
    day = scene.table.quantities["day"]
    known = np.isfinite(day + misfit)
    values = misfit[known]
    if not len(values):
        return None
    days = day[known]
    tails = scene.table.tails[known]
    rows = {tail: np.flatnonzero(tails == tail) for tail in levels(tails)}
    # One visit after it is enough: that other aircraft have the same step holds it.
    offered = {tail: np.unique(days[own]) for tail, own in rows.items()}
    after = {tail: days[rows[tail]] >= at[:, None] for tail, at in offered.items()}
    centred = values - np.median(values)
    relative = growth(centred, scene.over_in[known])
    # Of rows as they are, and with the step.
    chance = np.array([centred <= 0.0, centred > 0.0], float)
    likely = np.zeros(chance.shape, bool)
    far = np.ones(chance.shape)
    shown: dict[str, float] = {}
    first: dict[str, float] = {}
    together = 0.0
    for _turn in range(_TURNS):
        fitted = _two_levels(values, relative, chance * far)
        if fitted is None:
            return None
        density, far = fitted
        gain = density[1] - density[0]
        together = float(density[0].sum())
        first = {}
        shown = {}
        chance[1] = 0.0
        likely[1] = False
        for tail, at in offered.items():
            gains = after[tail] @ gain[rows[tail]]
            each = np.log(0.5) + np.r_[0.0, gains - np.log(len(at))]
            total = float(log_sum(each))
            together += total
            own = np.exp(each - total)
            chance[1, rows[tail]] = own[1:] @ after[tail]
            if own[0] < 0.5:
                best = int(np.argmax(gains))
                first[tail] = float(at[best])
                likely[1, rows[tail]] = after[tail][best]
                if best:
                    shown[tail] = float(own[2:].sum())
        chance[0] = 1.0 - chance[1]
    likely[0] = ~likely[1]
    for _turn in range(_TURNS):
        fitted = _two_levels(values, relative, likely * far)
        if fitted is None:
            return None
        density, far = fitted
    return _Steps(first, shown, together - float(density[likely].sum()))


def _two_levels(values: Array, relative: Array, weight: Array) -> tuple[Array, Array] | None:
    """Fit two levels, the second one higher, and a scatter to rows by their weights: log-density of
    each row at either, and the weight of a row so far out in the tails of Student's t, both (2, n).
    """
    weight = weight / relative**2
    if not weight.sum(axis=1).all():
        return None
    middle = weight @ values / weight.sum(axis=1)
    if middle[1] <= middle[0]:
        return None
    off = values - middle[:, None]
    scatter = np.sqrt(np.sum(weight * off**2) / len(values))
    square = (off / (scatter * relative)) ** 2
    density = -0.5 * (FREEDOM + 1.0) * np.log1p(square / FREEDOM) - np.log(scatter)
    return density, (FREEDOM + 1.0) / (FREEDOM + square)
