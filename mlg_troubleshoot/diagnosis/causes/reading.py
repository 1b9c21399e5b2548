"""Causes in rigging, gauges, people and habits: an offset of some rows.

Clearances that one technician, gauge or aircraft has in the other convention: twice or half of
what was meant.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from datetime import date
from typing import Any, ClassVar

import numpy as np

from mlg_troubleshoot.arrays import Array, Mask
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
from mlg_troubleshoot.diagnosis.table import DiagnosisTable
from mlg_troubleshoot.diagnosis.wear import likely_clearances
from mlg_troubleshoot.gear.gear import Adjustment

_LEAST_ROWS = 3
# Half a turn of a dial with 0.1 in per turn: further off a reading is a turn that was miscounted.
# [in]
_DIAL_IN = 0.1 / 2


def change_date(scene: Scene, day: float) -> str | None:
    """Date of a day of the table, ISO 8601; None if the table has no dates."""
    first = scene.table.first_day
    return None if first is None else str(np.datetime64(first) + np.timedelta64(int(day), "D"))


def dated(scene: Scene, day: float | None) -> dict[str, Any]:
    """The day from which something acts as part of a setting; None if from ever on."""
    return {"day": day, "since": None if day is None else change_date(scene, day)}


def days_since(scene: Scene, setting: Mapping[str, Any]) -> Array:
    """Days of each row since the setting's day, which is found by its date in any table; NaN where
    a row has no date, shape (n,). [d]
    """
    days = scene.table.numbers("day")
    start = setting["day"]
    if setting.get("since") is not None and scene.table.first_day is not None:
        start = (
            date.fromisoformat(setting["since"]) - date.fromisoformat(scene.table.first_day)
        ).days
    return np.asarray(days - start)


def _change_days(days: Array, least: int, most: int, before: int = 2) -> list[float]:
    """Days between which a change may lie, so that enough rows stand on both sides: of two days at
    least after it (one visit alone is more likely misread), and of some before it.
    """
    known = np.sort(days[np.isfinite(days)])
    begins = np.diff(known, prepend=known[:1]) > 0.0
    seen = np.cumsum(begins)
    place = np.arange(len(known))
    enough = (place >= least) & (place <= len(known) - least)
    days = known[begins & enough & (seen >= before) & (seen < seen.max(initial=0))]
    if len(days) > most:
        days = days[np.linspace(0, len(days) - 1, most).round().astype(int)]
    return [*map(float, days)]


def _of_gear(candidate: Candidate) -> dict[str, str]:
    side = candidate.setting.get("side")
    return {"tail_no": candidate.setting["tail"]} | ({"side": side} if side else {})


class RowShift(Cause):
    """An offset of some rows, of each a share of it."""

    parameter = "offset_in"
    trial = 0.001

    @property
    def plausible_values(self) -> tuple[float, float]:
        """Ends of an offset. [in]"""
        return -_DIAL_IN, _DIAL_IN

    def rows(self, candidate: Candidate) -> Mapping[str, str]:
        """What a row that is shifted has in each of some columns."""
        return {self.needs[0]: candidate.setting["value"]}

    def share(self, scene: Scene, setting: Mapping[str, Any]) -> Any:
        """Share of the offset in each row, NaN where it is not known: all, from a day on. [1]"""
        return 1.0 if setting.get("day") is None else days_since(scene, setting) >= 0.0

    def adjust(self, scene: Scene, candidate: Candidate, value: float) -> Adjustment:
        """Shift each row by its share."""
        return offset(scene, self.acts(scene, candidate), value)

    def acts(self, scene: Scene, candidate: Candidate) -> Array:
        """Share of the effect in each row, shape (n,). [1]"""
        where = np.nan_to_num(np.ones(len(scene.table)) * self.share(scene, candidate.setting))
        for column, text in self.rows(candidate).items():
            where = where * (scene.table.texts(column) == text)
        return np.asarray(where)


class _Level(RowShift):
    """An offset of all rows that share one value of a factor."""

    def candidates(self, scene: Scene) -> Iterator[Candidate]:
        """Yield one candidate for each value that occurs often enough, but not everywhere."""
        for value in levels(scene.table.factors[self.needs[0]]):
            yield Candidate(self, f"{self.needs[0].removesuffix('_id')} {value}", {"value": value})


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
    separates = "one gear measured by this technician and by another with the same gauge on one day"


class _RowScale(RowShift):
    """Some rows displace in proportion too much: rarer than a zero that slipped."""

    often = 0.1

    parameter = "scale_change"
    trial = 0.05
    plausible_values = (-0.9, 2.0)

    def adjust(self, scene: Scene, candidate: Candidate, value: float) -> Adjustment:
        """Scale the displacement of these rows."""
        return Adjustment(scene.clearance_in, rate_factor=1.0 + value * self.acts(scene, candidate))


class GaugeScale(_RowScale, _Level):
    """One gauge shows more, or less, in proportion to what it reads."""

    name = "gauge_scale"
    needs = ("gauge_id",)
    sentence = "Readings with {target} are too large or too small in proportion"
    inspect = "Travel of that gauge against gauge blocks over its whole range"
    separates = (
        "a worn gear and a new one measured with this gauge and with another by one technician"
    )
    # A dial is off by some hundredths. [1]
    plausible = 0.05


class GearScale(_RowScale):
    """The plunger of one gear moves more, or less, in proportion: a bent link, its linkage."""

    name = "gear_scale"
    needs = ("tail_no",)
    sentence = "The plunger of {target} moves in proportion too far or too little"
    inspect = "Links of that gear for bending; its linkage against the drawing"
    separates = "the plunger of that gear read before and after a joint is restored"
    # A bent link moves the plunger by some tenths more or less. [1]
    plausible = 0.2

    def candidates(self, scene: Scene) -> Iterator[Candidate]:
        """Yield each single gear of which the joints that count were read."""
        table = scene.table
        for gear in levels(table.gears):
            rows = table.gears == gear
            if share_never_read(scene, rows) <= MOST_UNREAD:
                setting = {"tail": str(table.tails[rows][0])}
                if gear != setting["tail"]:
                    setting["side"] = str(table.factors["side"][rows][0])
                yield Candidate(self, f"tail {gear}", setting)

    def rows(self, candidate: Candidate) -> Mapping[str, str]:
        """Those of that gear."""
        return _of_gear(candidate)


class Modification(RowShift):
    """Rows that a column of the table's own sets apart are shifted: a modification, a base, a
    shop.
    """

    name = "modification"
    sentence = "Readings with {target} are shifted"
    inspect = "What was changed on these gears, or is done otherwise there"
    separates = "one gear measured right before and right after the change, by the same technician"

    def is_distinct(self) -> bool:
        """A column of the table's own does not follow the clearances."""
        return True

    def candidates(self, scene: Scene) -> Iterator[Candidate]:
        """Yield each value of each column that only this table has; of two the one that came
        later, for the other is the rest.
        """
        table = scene.table
        days = table.quantities.get("day", table.row.astype(float))
        for column in table.own_factors:
            texts = table.factors[column]
            found = [*levels(texts)]
            if len({*texts} - {""}) == 2 and len(found) == 2:
                found = [max(found, key=lambda value: float(np.nanmean(days[texts == value])))]
            for value in found:
                yield Candidate(self, f"{column} {value}", {"column": column, "value": value})

    def rows(self, candidate: Candidate) -> Mapping[str, str]:
        """Those with that value."""
        return {candidate.setting["column"]: candidate.setting["value"]}


class _Contrast(RowShift):
    """Rows of two kinds shifted against each other, or those of one kind alone."""

    shares: ClassVar[tuple[dict[str, float], ...]]

    def candidates(self, scene: Scene) -> Iterator[Candidate]:
        """Yield the difference, and each kind alone, where both kinds occur."""
        yield from self.of_rows(scene, slice(None), None)

    def of_rows(
        self, scene: Scene, rows: Mask | slice, target: str | None, **of_whom: str
    ) -> Iterator[Candidate]:
        """Yield the contrasts of some rows."""
        if len(levels(scene.table.factors[self.needs[0]][rows])) == 2:
            for shares in self.shares:
                yield Candidate(self, target, {"shares": shares, **of_whom})

    def rows(self, candidate: Candidate) -> Mapping[str, str]:
        """All rows, or those of one technician if it is his habit."""
        person = candidate.setting["value"] if candidate.target else None
        return {TECHNICIAN_ID.variable: person} if person else {}

    def share(self, scene: Scene, setting: Mapping[str, Any]) -> Any:
        """Shift the kinds by their shares."""
        kinds = scene.table.factors[self.needs[0]]
        return sum((kinds == kind) * share for kind, share in setting["shares"].items())


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
        people = scene.table.people
        for person in levels(people):
            yield from self.of_rows(scene, people == person, f"technician {person}", value=person)

    def words(self, target: str | None) -> str:
        """Say whose habit it is."""
        return self.sentence + (f", in the rows of {target}" if target else "")


class DateStep(RowShift):
    """A fleet-wide change of practice from a date on."""

    name = "date_step"
    needs = ("day",)
    sentence = "All readings are shifted from a date on"
    inspect = "What changed that day: procedure, tooling, rigging instruction"
    separates = "one gear measured by the old and by the new practice on one day"

    def candidates(self, scene: Scene) -> Iterator[Candidate]:
        """Yield one candidate for each day on which the change may have come."""
        days = scene.table.quantities["day"]
        for day in _change_days(days, max(_LEAST_ROWS, len(days) // 25), 400):
            yield Candidate(self, None, dated(scene, day))

    def rows(self, candidate: Candidate) -> Mapping[str, str]:
        """All of them."""
        return {}


class RiggingOffset(RowShift):
    """The plunger rod of one aircraft, or of one of its gears, was re-rigged."""

    name = "rigging_offset"
    needs = ("tail_no",)
    sentence = "The plunger rod of {target} was re-rigged"
    inspect = "Plunger rod length and rigging record of that gear"
    separates = "rigging check of that gear: plunger at Down Lock and at mid-position"
    # A third of it to three times as much: from what a locknut leaves to half a turn of a rod end
    # with 28 threads to the inch. [in]
    plausible = 5e-3

    def candidates(self, scene: Scene) -> Iterator[Candidate]:
        """Yield each aircraft and each single gear, over all its rows and from each possible day
        on.
        """
        table = scene.table
        days = table.numbers("day")
        tails = table.factors["tail_no"]
        groups = [(f"tail {v}", {"tail": v}, tails == v) for v in levels(tails)]
        for v in levels(table.gears) if "side" in table.factors else ():
            rows = table.gears == v
            tail = str(tails[rows][0])
            if np.unique(table.gears[tails == tail]).size > 1:
                side = str(table.factors["side"][rows][0])
                groups.append((f"tail {v}", {"tail": tail, "side": side}, rows))
        for label, setting, rows in groups:
            # One visit before it is enough: the shift itself is held by those after it.
            for day in (None, *_change_days(days[rows], 1, 12, before=1)):
                # What was not read in any of its rows may be worn instead.
                since = rows if day is None else rows & (days >= day)
                if share_never_read(scene, since) <= MOST_UNREAD:
                    yield Candidate(self, label, {**setting, **dated(scene, day)})

    def rows(self, candidate: Candidate) -> Mapping[str, str]:
        """Those of that aircraft or gear."""
        return _of_gear(candidate)

    def family(self, target: str | None) -> str | None:
        """Gather an aircraft and its single gears under one name."""
        return target and target.removesuffix(" LH").removesuffix(" RH")


# Rows from which a group can show a convention of its own.
_LEAST_ROWS_OF_CONVENTION = 6
# Measured over predicted in the rows of a group, over that of the fleet, from which its convention
# is in doubt. Read clearances are drawn to what wear makes expect: a slip of a factor 2 shows as
# 1.4 to 2, and scatter stays below. [1]
_DOUBT = 1.25
_LABELS = {"technician_id": "technician", "gauge_id": "gauge", "tail_no": "tail"}


class ConventionSlip(Cause):
    """Diametral or total play written as radial in the rows of one technician, gauge or aircraft,
    all of them or for a time, or the reverse.
    """

    name = "convention_slip"
    parameter = "share_of_slip"
    sized = False
    trial = 1.0
    sign = 1
    exact = 1.0
    extends = False
    sentence = (
        "The clearances of {target} stand in another convention than they say (radial against"
        " diametral or total play)"
    )
    inspect = "How those clearances were read and written; the file is left as it is"
    separates = "one joint measured again by another technician with another gauge"

    def candidates(self, scene: Scene) -> Iterator[Candidate]:
        """Yield each group whose readings are far off the fleet's share of their prediction; any
        other group might have been.
        """
        measured = scene.table.measured_in / np.maximum(scene.over_in, 1e-3)
        usual = float(np.median(measured))
        if usual <= 0.0:
            return
        groups = [
            (column, label, value)
            for column, label in _LABELS.items()
            for value in levels(scene.table.texts(column), _LEAST_ROWS_OF_CONVENTION)
        ]
        found: list[Candidate] = []
        for column, label, value in groups:
            group = scene.table.factors[column] == value
            own = float(np.median(measured[group])) / usual
            setting = {"column": column, "value": value}
            target = f"{label} {value}"
            if own * _DOUBT < 1.0 or own > _DOUBT:
                factor = 2.0 if own < 1.0 else 0.5
                found.append(Candidate(self, target, setting | {"written_factor": factor}))
            for stretch, rarity in _stretches(scene, group, measured / usual):
                found.append(Candidate(self, target, setting | stretch, rarity=rarity))
        offered = len({candidate.target for candidate in found})
        for candidate in found:
            yield replace(candidate, rarity=candidate.rarity + float(np.log(offered / len(groups))))

    def adjust(self, scene: Scene, candidate: Candidate, value: float) -> Adjustment:
        """Take the group's clearances as they were meant, and what wear makes expect of all rows
        with them.
        """
        right = likely_clearances(as_meant(scene.table, candidate.setting)).likely_in
        return Adjustment(
            np.maximum(scene.clearance_in + value * (right - scene.clearance_in), 0.0)
        )


def _stretches(
    scene: Scene, group: Mask, over_usual: Array
) -> Iterator[tuple[dict[str, Any], float]]:
    """The days between which a group's readings are furthest off, either way, and the logarithm of
    the share that these are of all that may be chosen.

    Of all stretches the one with the largest sum of how far each row is beyond doubt, in the
    logarithm: it ends where rows are as usual.
    """
    day = scene.table.numbers("day")
    rows = np.flatnonzero(group & np.isfinite(day) & (over_usual > 0.0))
    rows = rows[np.argsort(day[rows], kind="stable")]
    for factor, way in ((2.0, -1.0), (0.5, 1.0)):
        beyond = way * np.log(over_usual[rows]) - np.log(_DOUBT)
        total = np.r_[0.0, np.cumsum(beyond)]
        end = int(np.argmax(total - np.minimum.accumulate(total)))
        first = int(np.argmin(total[: end + 1]))
        days = np.unique(day[rows[first:end]])
        # One visit alone is more likely misread.
        if len(days) > 1 and end - first < len(rows):
            yield (
                {
                    "written_factor": factor,
                    "days": (days[0], days[-1]),
                    "since": change_date(scene, days[0]),
                    "until": change_date(scene, days[-1]),
                },
                -float(np.log(0.5 * len(rows) * (len(rows) + 1))),
            )


def as_meant(table: DiagnosisTable, setting: Any) -> DiagnosisTable:
    """The table with the clearances of the group, within its days if it has some, as they were
    meant.
    """
    rows = np.asarray(table.factors[setting["column"]] == setting["value"])
    if "days" in setting:
        first, last = setting["days"]
        rows &= (table.quantities["day"] >= first) & (table.quantities["day"] <= last)
    factor = np.where(rows, 1.0 / setting["written_factor"], 1.0)
    return replace(
        table,
        clearance_in=table.clearance_in * factor[:, None],
        gauge_u_in=table.gauge_u_in * factor,
    )
