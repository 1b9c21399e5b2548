"""Causes that come gradually or group by group: a gauge that creeps between its calibrations, a
technician who learns, a modification that only some gears have.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import ClassVar

import numpy as np

from mlg_troubleshoot.arrays import Array, Mask, log_sum
from mlg_troubleshoot.diagnosis.causes.base import (
    MOST_UNREAD,
    Candidate,
    Cause,
    Scene,
    levels,
    offset,
    share_never_read,
)
from mlg_troubleshoot.diagnosis.causes.reading import change_date, days_since
from mlg_troubleshoot.gear.adjustment import Adjustment
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


class GaugeDrift(Cause):
    """A gauge, or all of them, creep from one calibration to the next."""

    name: ClassVar[str] = "gauge_drift"
    needs: ClassVar[tuple[str, ...]] = ("gauge_id", "day")
    parameter: ClassVar[str] = "drift_in_per_year"
    trial: ClassVar[float] = 0.001
    sentence: ClassVar[str] = "Readings with {target} creep between calibrations"
    inspect: ClassVar[str] = "Calibration of that gauge now, and its zero at each inspection"
    separates: ClassVar[str] = "one gear measured right before and right after a calibration"

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
                setting = {"value": gauge, "day": day, "since": change_date(scene, day)}
                yield Candidate(self, None if gauge is None else f"gauge {gauge}", setting)

    def adjust(self, scene: Scene, candidate: Candidate, value: float) -> Adjustment:
        """Shift the rows of that gauge by the time since it was calibrated."""
        since = np.nan_to_num(days_since(scene, candidate.setting)) % DAYS_PER_YEAR / DAYS_PER_YEAR
        return offset(scene, since * _of_value(scene, self.needs[0], candidate), value)

    def words(self, target: str | None) -> str:
        """Say which gauge, or that it is all of them."""
        return self.sentence.format(target=target or "every gauge")


class TechnicianLearning(Cause):
    """A technician is off at first and becomes better with time."""

    name: ClassVar[str] = "technician_learning"
    needs: ClassVar[tuple[str, ...]] = ("technician_id", "day")
    parameter: ClassVar[str] = "offset_at_first_in"
    trial: ClassVar[float] = 0.001
    sentence: ClassVar[str] = "Readings by {target} were shifted at first, less and less since"
    inspect: ClassVar[str] = "The earliest readings of that technician: read those gears again"
    separates: ClassVar[str] = "an early gear of this technician measured again by another one"

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
                    setting = {
                        "value": person,
                        "day": first,
                        "since": change_date(scene, first),
                        "learning_days": time,
                    }
                    yield Candidate(self, f"technician {person}", setting)

    def adjust(self, scene: Scene, candidate: Candidate, value: float) -> Adjustment:
        """Shift the rows of that technician, the later the less."""
        since = np.maximum(days_since(scene, candidate.setting), 0.0)
        left = np.nan_to_num(np.exp(-since / candidate.setting["learning_days"]))
        return offset(scene, left * _of_value(scene, self.needs[0], candidate), value)


class Modification(Cause):
    """Rows of some gears are shifted: those that a column of the table's own sets apart (a
    modification, a base, a shop), or those of some aircraft, each from a date of its own.
    """

    name: ClassVar[str] = "modification"
    parameter: ClassVar[str] = "offset_in"
    trial: ClassVar[float] = 0.001
    sentence: ClassVar[str] = "Readings with {target} are shifted"
    inspect: ClassVar[str] = "What was changed on these gears, or is done otherwise there"
    separates: ClassVar[str] = (
        "one gear measured right before and right after the change, by the same technician"
    )

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
        dated = "tail_no" in table.factors and "day" in table.quantities and not table.doubt
        if dated and share_never_read(scene) <= MOST_UNREAD:
            yield from self._of_aircraft(scene)

    def adjust(self, scene: Scene, candidate: Candidate, value: float) -> Adjustment:
        """Shift the rows with that value, or those of the aircraft from its date on."""
        setting = candidate.setting
        table = scene.table
        if "column" in setting:
            return offset(scene, _of_value(scene, setting["column"], candidate), value)
        after = np.zeros(len(table), bool)
        for tail, step in setting["steps"].items():
            dated = isinstance(step, str)
            from_day = {"day": np.nan if dated else step, "since": step if dated else None}
            after |= (table.tails == tail) & (days_since(scene, from_day) >= 0)
        return offset(scene, after, value)

    def words(self, target: str | None) -> str:
        """Say whose readings they are."""
        of_aircraft = target is not None and target.startswith(_TAILS)
        each = ", each from its own date on" if of_aircraft else ""
        return f"Readings {'of' if of_aircraft else 'with'} {target} are shifted{each}"

    def _of_aircraft(self, scene: Scene) -> Iterator[Candidate]:
        misfit = scene.table.measured_in - scene.over_in
        for direction in (1.0, -1.0):
            steps, rarity = _likeliest_steps(scene, direction * misfit)
            if len(steps) >= _LEAST_AIRCRAFT:
                dated = {tail: change_date(scene, day) or day for tail, day in steps.items()}
                setting = {"steps": dated}
                yield Candidate(self, _TAILS + ",".join(steps), setting, rarity=rarity)


def _apart(scene: Scene, column: str) -> list[str]:
    """Values that a column sets apart: of two the one that came later; the other is the rest."""
    texts = scene.table.factors[column]
    found = [*levels(scene.table.factors[column])]
    days = scene.table.quantities.get("day", scene.table.row.astype(float))
    if len({*texts} - {""}) == 2 and len(found) == 2:
        return [max(found, key=lambda value: float(np.nanmean(days[texts == value])))]
    return found


def _likeliest_steps(scene: Scene, misfit: Array) -> tuple[dict[str, float], float]:
    """Which aircraft have a step up of one size, and from which day on.

    Each is modified or not with equal chance, on each of its days with equal chance; size, level
    and scatter by expectation and maximisation.

    Returns
    -------
    tuple
        The day of each modified aircraft, and the logarithm of the chance of just these steps: no
        more than what all that are as likely have together.
    """
    days = scene.table.quantities["day"]
    tails = scene.table.tails
    rows = {t: np.flatnonzero((tails == t) & np.isfinite(days + misfit)) for t in levels(tails)}
    # One visit after it is enough: that other aircraft have the same step holds it.
    offered = {t: np.unique(days[own])[1:].tolist() for t, own in rows.items()}
    after = {t: days[own] >= np.array(offered[t])[:, None] for t, own in rows.items()}
    known = np.isfinite(misfit)
    if not known.any():
        return {}, 0.0
    chance = (misfit > np.median(misfit[known])).astype(float)
    steps: dict[str, float] = {}
    rarity = 0.0
    for _turn in range(_TURNS):
        if not 0.0 < chance[known].sum() < known.sum():
            return {}, 0.0
        level = np.average(misfit[known], weights=1.0 - chance[known])
        size = np.average(misfit[known], weights=chance[known]) - level
        if size <= 0.0:
            return {}, 0.0
        scatter = np.nanstd(misfit - level - size * chance)
        gain = size * (misfit - level - 0.5 * size) / scatter**2
        steps = {}
        rarity = 0.0
        chance = np.zeros(len(tails))
        for tail, own in rows.items():
            count = len(after[tail])
            gains = np.r_[0.0, after[tail] @ gain[own]]
            each = np.log(0.5) + gains - np.r_[0.0, np.full(count, np.log(max(count, 1)))]
            total = float(log_sum(each))
            chance[own] = np.exp(each[1:] - total) @ after[tail]
            modified = count > 0 and each[0] - total < np.log(0.5)
            best = 1 + int(np.argmax(each[1:])) if modified else 0
            rarity += float(each[best] - gains[best])
            if modified:
                steps[tail] = offered[tail][best - 1]
    return steps, rarity


def _of_value(scene: Scene, factor: str, candidate: Candidate) -> Mask:
    """Rows that have the value of a candidate, all rows if it has no target, shape (n,)."""
    if candidate.target is None:
        return np.ones(len(scene.table), bool)
    texts = scene.table.factors.get(factor, np.full(len(scene.table), ""))
    return np.asarray(texts == candidate.setting["value"])
