"""Causes that come gradually or group by group: a gauge that creeps between its calibrations, a
technician who learns, a modification that only some gears have.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import ClassVar

import numpy as np

from mlg_troubleshoot.arrays import Mask
from mlg_troubleshoot.diagnosis.causes.base import Candidate, Cause, Scene, levels, offset
from mlg_troubleshoot.diagnosis.causes.reading import change_date, days_since
from mlg_troubleshoot.gear.adjustment import Adjustment

# A gauge is calibrated once a year; in which month is not known.
_YEAR_DAYS, _MONTHS = 365.25, 12
# Times in which a beginner comes down to a third of what he was off, a season to a year. [d]
_LEARNING_DAYS = (60.0, 120.0, 240.0, 480.0)


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
        if not np.nanmax(days) - np.nanmin(days) > 0.5 * _YEAR_DAYS:
            return
        first = float(np.nanmin(days))
        for gauge in (None, *levels(scene.table.factors["gauge_id"])):
            for month in range(_MONTHS):
                day = round(first - month * _YEAR_DAYS / _MONTHS)
                setting = {"value": gauge, "day": day, "since": change_date(scene, day)}
                yield Candidate(self, None if gauge is None else f"gauge {gauge}", setting)

    def adjust(self, scene: Scene, candidate: Candidate, value: float) -> Adjustment:
        """Shift the rows of that gauge by the time since it was calibrated."""
        since = np.nan_to_num(days_since(scene, candidate.setting)) % _YEAR_DAYS / _YEAR_DAYS
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
        days, people = scene.table.quantities["day"], scene.table.factors["technician_id"]
        for person in levels(people):
            own = days[(people == person) & np.isfinite(days)]
            if len(np.unique(own)) < 2:
                continue
            first = float(own.min())
            for time in _LEARNING_DAYS:
                if time < np.ptp(own):
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
    """Rows that a column of the table's own sets apart: a modification, a base, a shop."""

    name: ClassVar[str] = "modification"
    parameter: ClassVar[str] = "offset_in"
    trial: ClassVar[float] = 0.001
    sentence: ClassVar[str] = "Readings with {target} are shifted"
    inspect: ClassVar[str] = "What was changed on these gears, or is done otherwise there"
    separates: ClassVar[str] = (
        "one gear measured right before and right after the change, by the same technician"
    )

    def is_distinct(self) -> bool:
        """A column of the table's own does not follow the clearances."""
        return True

    def candidates(self, scene: Scene) -> Iterator[Candidate]:
        """Yield each value of each column that only this table has."""
        for column in scene.table.own_factors:
            found = levels(scene.table.factors[column])
            for value in found:
                yield Candidate(self, f"{column} {value}", {"column": column, "value": value})

    def adjust(self, scene: Scene, candidate: Candidate, value: float) -> Adjustment:
        """Shift the rows with that value."""
        return offset(scene, _of_value(scene, candidate.setting["column"], candidate), value)


def _of_value(scene: Scene, factor: str, candidate: Candidate) -> Mask:
    """Rows that have the value of a candidate, all rows if it has none, shape (n,)."""
    value = candidate.setting["value"]
    if value is None:
        return np.ones(len(scene.table), bool)
    return np.asarray(scene.table.factors.get(factor, np.full(len(scene.table), "")) == value)
