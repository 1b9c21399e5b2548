"""Causes in rigging, gauges, people and habits: an offset of some rows."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from datetime import date, timedelta
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from mlg_troubleshoot.arrays import Array
from mlg_troubleshoot.decision.columns import TECHNICIAN_ID
from mlg_troubleshoot.diagnosis.causes.base import (
    MOST_UNREAD,
    Candidate,
    Cause,
    Scene,
    levels,
    offset,
    share_never_read,
)
from mlg_troubleshoot.gear.adjustment import Adjustment

_LEAST_ROWS = 3


def change_date(scene: Scene, day: float) -> str | None:
    """Date of a day of the table, ISO 8601; None if the table has no dates."""
    first = scene.table.first_day
    return (
        None
        if first is None
        else (date.fromisoformat(first) + timedelta(days=float(day))).isoformat()
    )


def days_since(scene: Scene, setting: Mapping[str, Any]) -> Array:
    """Days of each row since the setting's day, which is found by its date in any table; NaN where
    a row has no date, shape (n,). [d]
    """
    days = scene.table.quantities.get("day", np.full(len(scene.table), np.nan))
    start = setting["day"]
    if setting.get("since") is not None and scene.table.first_day is not None:
        start = (
            date.fromisoformat(setting["since"]) - date.fromisoformat(scene.table.first_day)
        ).days
    return np.asarray(days - start)


def _from_day_on(scene: Scene, setting: Mapping[str, Any]) -> NDArray[np.bool_]:
    """Rows from the setting's day on; all rows if it has none."""
    if setting.get("day") is None:
        return np.ones(len(scene.table), bool)
    return np.asarray(days_since(scene, setting) >= 0.0)


def _change_days(days: Array, least: int, most: int) -> list[float]:
    """Days between which a change may lie, so that enough rows of two days at least stand on both
    sides: one visit alone is more likely misread.
    """
    known = np.sort(days[np.isfinite(days)])
    seen = np.r_[0, np.cumsum(np.diff(known) > 0.0)] if len(known) else known
    places = [
        i
        for i in range(least, len(known) - least + 1)
        if i < len(known) and known[i] > known[i - 1] and 2 <= seen[i] <= seen[-1] - 1
    ]
    if len(places) > most:
        places = [places[k] for k in np.linspace(0, len(places) - 1, most).round().astype(int)]
    return [float(known[i]) for i in places]


class _Level(Cause):
    """An offset of all rows that share one value of a factor."""

    parameter = "offset_in"
    trial = 0.001

    def candidates(self, scene: Scene) -> Iterator[Candidate]:
        """Yield one candidate for each value that occurs often enough, but not everywhere."""
        for value in levels(scene.table.factors[self.needs[0]]):
            yield Candidate(self, f"{self.needs[0].removesuffix('_id')} {value}", {"value": value})

    def adjust(self, scene: Scene, candidate: Candidate, value: float) -> Adjustment:
        """Shift the rows of that value."""
        texts = scene.table.factors.get(self.needs[0], np.full(len(scene.table), ""))
        return offset(scene, texts == candidate.setting["value"], value)


class GaugeBias(_Level):
    """One gauge reads off."""

    name = "gauge_bias"
    needs = ("gauge_id",)
    sentence = "Readings with {target} are shifted"
    inspect = "Calibration of that gauge"
    separates = (
        "one gear measured with this gauge and with another by the same technician on one day"
    )


class TechnicianBias(_Level):
    """One technician reads off."""

    name = "technician_bias"
    needs = ("technician_id",)
    sentence = "Readings by {target} are shifted"
    inspect = "How that technician seats and zeroes the gauge"
    separates = (
        "one gear measured by this technician and by another with the same gauge on one day"
    )


class _Contrast(Cause):
    """Rows of two kinds shifted against each other, or those of one kind alone."""

    trial = 0.001
    shares: ClassVar[tuple[dict[str, float], ...]]

    def candidates(self, scene: Scene) -> Iterator[Candidate]:
        """Yield the difference, and each kind alone, where both kinds occur."""
        if len(levels(scene.table.factors[self.needs[0]])) == 2:
            for shares in self.shares:
                yield Candidate(self, None, {"shares": shares})

    def adjust(self, scene: Scene, candidate: Candidate, value: float) -> Adjustment:
        """Shift the kinds by their shares."""
        kinds = scene.table.factors[self.needs[0]]
        where = sum((kinds == kind) * share for kind, share in candidate.setting["shares"].items())
        return offset(scene, where, value)


class SideDifference(_Contrast):
    """Left and right gear differ."""

    name = "side_difference"
    needs = ("side",)
    parameter = "rh_minus_lh_in"
    shares = (
        {"RH": 1.0},
        {"LH": -1.0},
        {"RH": 0.5, "LH": -0.5},
    )
    sentence = "Right-hand and left-hand gears differ"
    inspect = "Rigging of one right-hand gear against its left-hand neighbour"
    separates = "both gears of one aircraft, same technician, same gauge, same day"


class ApproachHysteresis(_Contrast):
    """Lost motion: the reading depends on the direction of approach, of all or as the habit of one
    technician.
    """

    name = "approach_hysteresis"
    needs = ("approach",)
    parameter = "extending_minus_retracting_in"
    shares = (
        {"EXTENDING": 0.5, "RETRACTING": -0.5},
        {"EXTENDING": 1.0},
        {"RETRACTING": -1.0},
    )
    sentence = "Lost motion: the reading depends on the direction of approach"
    inspect = (
        "Approach mid-position always in the same direction; look for friction in the link assembly"
    )
    separates = "one gear read twice, approached extending and retracting"

    def candidates(self, scene: Scene) -> Iterator[Candidate]:
        """Yield the contrasts of all rows, and of the rows of each technician."""
        yield from super().candidates(scene)
        kinds = scene.table.factors[self.needs[0]]
        people = scene.table.factors.get(TECHNICIAN_ID.variable, np.full(len(kinds), ""))
        for person in levels(people):
            if len(levels(kinds[people == person])) == 2:
                for shares in self.shares:
                    setting = {"shares": shares, "value": person}
                    yield Candidate(self, f"technician {person}", setting)

    def adjust(self, scene: Scene, candidate: Candidate, value: float) -> Adjustment:
        """Shift the kinds by their shares, of one technician's rows if it is his habit."""
        shift = super().adjust(scene, candidate, value)
        if candidate.target is None or shift.offset_in is None:
            return shift
        people = scene.table.factors.get(TECHNICIAN_ID.variable, np.full(len(scene.table), ""))
        own = people == candidate.setting["value"]
        return replace(shift, offset_in=np.where(own, shift.offset_in, 0.0))

    def words(self, target: str | None) -> str:
        """Say whose habit it is."""
        return self.sentence + (f", in the rows of {target}" if target else "")


class DateStep(Cause):
    """A fleet-wide change of practice from a date on."""

    name = "date_step"
    needs = ("day",)
    parameter = "offset_in"
    trial = 0.001
    sentence = "All readings are shifted from a date on"
    inspect = "What changed that day: procedure, tooling, rigging instruction"
    separates = "one gear measured by the old and by the new practice on one day"

    def candidates(self, scene: Scene) -> Iterator[Candidate]:
        """Yield one candidate for each day on which the change may have come."""
        days = scene.table.quantities["day"]
        for day in _change_days(days, max(_LEAST_ROWS, len(days) // 25), 400):
            yield Candidate(self, None, {"day": day, "since": change_date(scene, day)})

    def adjust(self, scene: Scene, candidate: Candidate, value: float) -> Adjustment:
        """Shift the rows from that day on."""
        return offset(scene, _from_day_on(scene, candidate.setting), value)


class RiggingOffset(Cause):
    """The plunger rod of one aircraft, or of one of its gears, was re-rigged."""

    name = "rigging_offset"
    needs = ("tail_no",)
    parameter = "offset_in"
    trial = 0.001
    sentence = "The plunger rod of {target} was re-rigged"
    inspect = "Plunger rod length and rigging record of that gear"
    separates = (
        "rigging check of that gear: plunger at Down Lock and at mid-position"
    )

    def candidates(self, scene: Scene) -> Iterator[Candidate]:
        """Yield each aircraft and each single gear, over all its rows and from each possible day
        on.
        """
        table = scene.table
        days = table.quantities.get("day", np.full(len(table), np.nan))
        tails = table.factors["tail_no"]
        groups = [(f"tail {v}", {"tail": v}, tails == v) for v in levels(tails)]
        if "side" in table.factors:
            gears = table.gears
            groups += [
                (
                    f"tail {v}",
                    {
                        "tail": str(tails[gears == v][0]),
                        "side": str(table.factors["side"][gears == v][0]),
                    },
                    gears == v,
                )
                for v in levels(gears)
                if np.unique(gears[tails == tails[gears == v][0]]).size > 1
            ]
        for label, setting, rows in groups:
            for day in (None, *_change_days(days[rows], 1, 12)):
                # What was not read in any of its rows may be worn instead.
                if (
                    share_never_read(scene, rows if day is None else rows & (days >= day))
                    <= MOST_UNREAD
                ):
                    since = None if day is None else change_date(scene, day)
                    yield Candidate(self, label, {**setting, "day": day, "since": since})

    def adjust(self, scene: Scene, candidate: Candidate, value: float) -> Adjustment:
        """Shift the rows of that aircraft or gear from that day on."""
        table = scene.table
        setting = candidate.setting
        where = table.factors["tail_no"] == setting["tail"]
        if "side" in setting:
            where = where & (table.factors["side"] == setting["side"])
        return offset(scene, where & _from_day_on(scene, setting), value)

    def family(self, target: str | None) -> str | None:
        """Gather an aircraft and its single gears under one name."""
        if target is None:
            return None
        words = target.split(" ")
        return " ".join(words[:-1]) if words[-1] in {"LH", "RH"} else target
