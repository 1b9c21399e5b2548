"""What a forecast says about tomorrow: landings left, the day of the next inspection, which gear
comes first.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from operator import attrgetter
from typing import NamedTuple

from mlg_troubleshoot.decision.plan import Action
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.life.folding import GearLife
from mlg_troubleshoot.life.forecast import Forecast, Quantiles
from mlg_troubleshoot.life.logbook import log_of
from mlg_troubleshoot.life.state import GearKey
from mlg_troubleshoot.life.unrecorded_work import suggestion
from mlg_troubleshoot.life.urgency import OVER_LIMIT, changes_since, repair_sentence, urgency_of


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
    """One gear of a fleet as every output shows it: its latest inspection, what stands of it today,
    and its landings left once they are forecast.

    inspections, repairs: how many count. Numbers stand as they did in the record.
    """

    tail_no: str
    side: str
    inspections: int
    repairs: int
    warnings: tuple[str, ...]
    record_id: str = ""
    inspection_date: str | None = None
    gear_landings: int | float | None = None
    verdict: str | None = None
    worst_joint: int | None = None
    predicted_displacement_in: int | float | None = None
    margin_in: int | float | None = None
    next_action: str | None = None
    minutes: int | float = 0
    restore: tuple[int, ...] = ()
    landings_to_limit: Quantiles | None = None
    limit_joint: int | None = None
    landings_to_margin: Quantiles | None = None
    next_inspection_landings: float | None = None
    due_date: str | None = None
    rank: int = 0
    size: float = 0.0
    why: str = ""
    failed: tuple[str, ...] = ()
    repair: str = ""
    suggestion: str = ""
    changed: tuple[str, ...] = ()
    readings: tuple[Reading, ...] = ()

    @classmethod
    def of(cls, life: GearLife, asked: Asked) -> FleetLine:
        counts = len(life.inspections), len(life.repairs)
        line = cls(*life.key, *counts, life.warnings)
        if life.latest is None:
            return line
        lines = log_of(life, asked.gear, () if asked.joint is None else (asked.joint,))
        urgent = urgency_of(life, lines, asked.gear)
        failed = [e.date or "no date" for e in lines if e.counts and e.kind == "FAILED"]
        line = replace(
            line,
            rank=urgent.rank,
            size=urgent.size,
            why=urgent.why,
            failed=tuple(day for day in failed if day >= asked.since),
            repair=repair_sentence(lines),
            suggestion=suggestion(life, asked.gear),
            changed=changes_since(life, lines, asked.since) if asked.since else (),
            readings=tuple(
                Reading(e.date, e.gear_landings, e.value_in or 0.0)
                for e in lines
                if e.counts and e.kind == "reading" and e.joints == (asked.joint,)
            ),
        )
        kept, found = life.latest, life.now
        line = replace(
            line,
            record_id=kept.inspection.record_id,
            inspection_date=None if kept.at is None else kept.at.isoformat(),
            gear_landings=kept.inspection.gear_landings,
        )
        if found is None:
            return line
        return replace(
            line,
            verdict=found.verdict.value,
            worst_joint=found.worst_joint,
            predicted_displacement_in=found.predicted_displacement_in,
            margin_in=found.margin_in,
            next_action=found.in_brief,
            minutes=sum(step.minutes for step in found.plan.steps),
            restore=tuple(
                n for s in found.plan.steps if s.action is Action.RESTORE for n in s.joints
            ),
        )

    def by_when(self, gear: Gear) -> str:
        """When the gear is to be looked at: now, on a day, or after so many landings."""
        if self.rank <= OVER_LIMIT:
            return "now"
        after = self.next_inspection_landings
        left = "-" if after is None else f"{landings_shown(after, gear)} landings"
        return self.due_date or left

    def forecast(self, ahead: Forecast) -> FleetLine:
        """The same gear with its landings left."""
        return replace(
            self,
            landings_to_limit=ahead.landings_to_limit,
            limit_joint=ahead.limit_joint,
            landings_to_margin=ahead.landings_to_margin,
            next_inspection_landings=ahead.next_inspection_landings,
            due_date=ahead.due_date,
        )

    @property
    def key(self) -> GearKey:
        return self.tail_no, self.side

    @property
    def urgency(self) -> tuple[int, float, float, GearKey]:
        """By what is most urgent, how far it is, and landings to the next inspection."""
        due = self.next_inspection_landings
        return self.rank, -self.size, float("inf") if due is None else due, self.key


def fleet_lines(
    lines: Iterable[FleetLine],
    forecasts: Mapping[GearKey, Forecast],
) -> list[FleetLine]:
    """The gears that were inspected, with their forecasts; the most urgent first."""
    seen = [
        line.forecast(forecasts.get(line.key, Forecast())) for line in lines if line.inspections
    ]
    return sorted(seen, key=attrgetter("urgency"))


def work_sentence(lines: Sequence[FleetLine]) -> str:
    """Sum the minutes and the parts that the plans of a fleet expect."""
    parts = Counter(joint for line in lines for joint in line.restore)
    restored = ", ".join(f"#{joint} ({count})" for joint, count in sorted(parts.items()))
    minutes = sum(line.minutes for line in lines)
    return (
        f"Work that the plans expect: {minutes:.0f} min on"
        f" {sum(line.minutes > 0.0 for line in lines)} of {len(lines)} gears; joints to restore"
        f" (number of gears): {restored or 'none'}."
    )


def parts_within(
    lines: Iterable[FleetLine], forecasts: Mapping[GearKey, Forecast], landings: float
) -> str:
    """The joints that more likely than not reach their limit within so many landings."""
    parts = Counter(
        joint
        for line in lines
        for joint, left in forecasts.get(line.key, Forecast()).joints.items()
        if joint not in line.restore and left["p50"] is not None and left["p50"] <= landings
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
