"""Causes that come gradually or group by group: a gauge that creeps between its calibrations, a
technician who learns, a modification that only some gears have.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

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
from mlg_troubleshoot.misfit.beliefs import Beliefs
from mlg_troubleshoot.misfit.steps import common_steps
from mlg_troubleshoot.units import DAYS_PER_YEAR

# A gauge is calibrated once a year; in which month is not known.
_MONTHS = 12
# Aircraft from which on a step is one of several; those among them that show it within their rows,
# and so can be named. [1]
_LEAST_AIRCRAFT = 3
_LEAST_NAMED = 2
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
        day = table.quantities["day"]
        known = np.isfinite(day) & (table.tails != "")
        if scene.noise is None or not known.any():
            return
        noise = scene.noise.take(known)
        steps = common_steps(table.tails[known], day[known], scene.expected_in[known], noise)
        for found in steps:
            if found is None:
                continue
            if len(found.since) >= _LEAST_AIRCRAFT and len(found.seen) >= _LEAST_NAMED:
                since = {tail: change_date(scene, at) or at for tail, at in found.since.items()}
                target = _TAILS + ",".join(_sure(found.seen))
                yield Candidate(self, target, {"steps": since}, rarity=found.rarity)

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


def _sure(seen: Mapping[str, float]) -> list[str]:
    """As many aircraft as have a step together with half of the doubt that a name may leave (the
    other half is that of its cause); the two likeliest at least.
    """
    order = sorted(seen, key=lambda tail: -seen[tail])
    together = np.cumprod([seen[tail] for tail in order])
    count = max(int(np.sum(together >= (1.0 + Beliefs().sure) / 2.0)), _LEAST_NAMED)
    return sorted(order[:count])


def _apart(scene: Scene, column: str) -> list[str]:
    """Values that a column sets apart: of two the one that came later; the other is the rest."""
    texts = scene.table.factors[column]
    found = [*levels(scene.table.factors[column])]
    days = scene.table.quantities.get("day", scene.table.row.astype(float))
    if len({*texts} - {""}) == 2 and len(found) == 2:
        return [max(found, key=lambda value: float(np.nanmean(days[texts == value])))]
    return found
