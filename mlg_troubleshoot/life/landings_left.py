"""What a forecast says about tomorrow: landings left, the day of the next inspection, which gear
comes first.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from datetime import date
from math import inf
from operator import attrgetter
from typing import NamedTuple

from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.life.folding import GearLife, TodaysVerdict
from mlg_troubleshoot.life.forecast import Forecast, Quantiles
from mlg_troubleshoot.life.logbook import log_of
from mlg_troubleshoot.life.state import GearKey
from mlg_troubleshoot.life.unrecorded_work import suggestion
from mlg_troubleshoot.life.urgency import (
    OVER_LIMIT,
    Urgency,
    changes_since,
    repair_sentence,
    urgency_of,
)


@dataclass(frozen=True, slots=True)
class Asked:
    """What is asked of a fleet: since when (ISO 8601), and the readings of which joint."""

    gear: Gear
    since: str = ""
    joint: int | None = None


class Reading(NamedTuple):
    """A reading of one joint. [in]"""

    date: str | None
    gear_landings: float | None
    clearance_in: float


@dataclass(frozen=True, slots=True)
class FleetLine:
    """One gear of a fleet as every output shows it: its latest inspection, what is said of it
    today, and its landings left.

    inspections, repairs: how many count. Numbers stand as they did in the record.
    """

    tail_no: str
    side: str
    inspections: int
    repairs: int
    warnings: tuple[str, ...]
    now: TodaysVerdict
    ahead: Forecast
    record_id: str
    inspection_date: date | None
    gear_landings: int | float | None
    urgency: Urgency
    failed: tuple[str, ...]
    repair: str
    suggestion: str
    changed: tuple[str, ...]
    readings: tuple[Reading, ...]

    @classmethod
    def of(cls, life: GearLife, asked: Asked, ahead: Forecast) -> FleetLine:
        gear = asked.gear
        lines = log_of(life, gear, () if asked.joint is None else (asked.joint,))
        failed = [e.date or "no date" for e in lines if e.counts and e.kind == "FAILED"]
        row = None if life.latest is None else life.latest.inspection
        return cls(
            *life.key,
            len(life.inspections),
            len(life.repairs),
            life.warnings,
            life.now,
            ahead,
            "" if row is None else row.record_id,
            None if row is None else row.inspection_date,
            None if row is None else row.gear_landings,
            urgency_of(life, lines, gear),
            tuple(day for day in failed if day >= asked.since),
            repair_sentence(lines),
            suggestion(life, gear),
            changes_since(life, lines, asked.since) if asked.since else (),
            tuple(
                Reading(e.date, e.gear_landings, e.value_in or 0.0)
                for e in lines
                if e.counts and e.kind == "reading" and e.joints == (asked.joint,)
            ),
        )

    def by_when(self, gear: Gear) -> str:
        """When the gear is to be looked at: now, on a day, or after so many landings."""
        if self.urgency.rank <= OVER_LIMIT:
            return "now"
        after = self.ahead.next_inspection_landings
        left = "-" if after is None else f"{landings_shown(after, gear)} landings"
        return self.ahead.due_date or left

    @property
    def key(self) -> GearKey:
        return self.tail_no, self.side

    @property
    def place(self) -> tuple[int, float, float, GearKey]:
        """By what is most urgent, how far it is, and landings to the next inspection."""
        due = self.ahead.next_inspection_landings
        return self.urgency.rank, -self.urgency.size, inf if due is None else due, self.key


def most_urgent_first(lines: Iterable[FleetLine]) -> list[FleetLine]:
    """The gears that were inspected."""
    return sorted((line for line in lines if line.inspections), key=attrgetter("place"))


def work_sentence(lines: Sequence[FleetLine]) -> str:
    """Sum the minutes and the parts that the plans of a fleet expect."""
    parts = Counter(joint for line in lines for joint in line.now.restore)
    restored = ", ".join(f"#{joint} ({count})" for joint, count in sorted(parts.items()))
    minutes = sum(line.now.minutes for line in lines)
    return (
        f"Work that the plans expect: {minutes:.0f} min on"
        f" {sum(line.now.minutes > 0.0 for line in lines)} of {len(lines)} gears; joints to restore"
        f" (number of gears): {restored or 'none'}."
    )


def parts_within(lines: Iterable[FleetLine], landings: float) -> str:
    """The joints that more likely than not reach their limit within so many landings."""
    parts = Counter(
        joint
        for line in lines
        for joint, left in line.ahead.joints.items()
        if joint not in line.now.restore and left["p50"] is not None and left["p50"] <= landings
    )
    listed = ", ".join(f"#{joint} ({count})" for joint, count in sorted(parts.items()))
    return (
        f"Within {landings:g} landings these probably reach their limit as well (number of gears):"
        f" {listed or 'none'}."
    )


def span(ends: Quantiles | None, gear: Gear) -> str:
    """Median and 90 % interval of landings, the horizon standing for what lies beyond it."""
    if ends is None:
        return "-"
    low, middle, high = (landings_shown(end, gear) for end in ends.values())
    return middle if low == high else f"{middle} ({low} to {high})"


def landings_shown(count: float | None, gear: Gear) -> str:
    """Landings to two digits: a forecast has no more; None lies beyond the horizon."""
    return f"> {gear.horizon.value:.0f}" if count is None else f"{float(f'{count:.2g}'):.0f}"


def outlook_sentence(life: GearLife, ahead: Forecast, gear: Gear) -> str:
    """Say how many landings a gear has left, to which margin and by which joint; empty where
    nothing was forecast.
    """
    if ahead.due_now:
        return f"No landings left: {ahead.due_now}. Next inspection due now."
    if life.latest is not None and life.latest.inspection.gear_landings is None:
        return "No forecast: the last inspection does not state its landings (gear_landings)."
    if ahead.landings_to_limit is None:
        return ""
    joint = ""
    if ahead.limit_joint is not None:
        joint = f", where #{ahead.limit_joint} most likely reaches its limit first"
    after = ahead.next_inspection_landings
    due = "beyond the horizon" if after is None else f"in {landings_shown(after, gear)} landings"
    day = f", about {ahead.due_date}" if ahead.due_date else ""
    return (
        "Landings left from the last inspection: to a joint's limit"
        f" {span(ahead.landings_to_limit, gear)}{joint}; to the margin, by the worst-case bound,"
        f" {span(ahead.landings_to_margin, gear)}. Next inspection due"
        f" {due}{day} (accepted chance {gear.accepted_chance.value:.0%})."
    )
