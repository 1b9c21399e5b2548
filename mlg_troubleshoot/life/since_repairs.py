"""Rows that are older than a repair of their gear, which a row above states or the store keeps.

What a repair is not surely later than stands, and of two readings that cannot be ordered the worse
one does.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import date, datetime
from types import MappingProxyType
from typing import TYPE_CHECKING

from mlg_troubleshoot.decision.inspection import (
    Inspection,
    InvalidRow,
    Outcome,
    RiggingCheck,
    surely_later,
)
from mlg_troubleshoot.gear.gear import ROUNDING_IN, Gear

if TYPE_CHECKING:
    from mlg_troubleshoot.life.folding import GearKey, GearLife

# Rows that one note names at most.
_MOST_NAMED = 6


@dataclass(frozen=True, slots=True)
class Repair:
    """Joints that were restored at a moment, or the rigging set right; who says so, and in which
    row of the table.
    """

    at: date
    joints: frozenset[int]
    rerigged: bool
    said_by: str = field(compare=False)
    row: int | None = field(default=None, compare=False)

    @property
    def day(self) -> date:
        return self.at.date() if isinstance(self.at, datetime) else self.at


def key_of(row: Inspection) -> GearKey:
    return row.tail_no, row.side.value


def stated_repair(row: Inspection, place: int | None = None) -> Repair | None:
    """The repair that a row states, if it says when."""
    if not row.is_repaired or row.repair_date is None:
        return None
    rerigged = row.rigging_checked is RiggingCheck.CORRECTED
    joints = frozenset(row.restored_joints)
    return Repair(row.repair_date, joints, rerigged, f"{row.record_id} states", place)


def since_repairs(
    rows: Sequence[Inspection | InvalidRow],
    gear: Gear,
    lives: Mapping[GearKey, GearLife] = MappingProxyType({}),
    *,
    entered_now: bool = False,
) -> Sequence[Inspection | InvalidRow]:
    """The rows as they count after the repairs that rows above them state or that are kept.

    A repair that is surely later than a row makes its outcome, its plunger reading and what it says
    of the restored joints older. A row that states a repair and no outcome is that of a gear that
    failed, if the last row above it, or the last one kept, that says how the gear was is a failure
    or a plunger beyond its margin, and not after the repair: nobody has tried it since. What is
    kept of repairs reaches only rows with a date.

    entered_now: the rows are entered after all that is kept, which is their order on one day.
    """
    repairs: defaultdict[GearKey, list[Repair]] = defaultdict(list)
    for place, row in enumerate(rows):
        stated = stated_repair(row, place) if isinstance(row, Inspection) else None
        if stated is not None and isinstance(row, Inspection):
            repairs[key_of(row)].append(stated)
    complaints: dict[GearKey, Inspection | None] = {}
    for key, life in lives.items():
        repairs[key] += _kept(life)
        for each in life.inspections:
            complaints[key] = _complaint(each.inspection, complaints.get(key), gear)
    counting: list[Inspection | InvalidRow] = []
    for place, row in enumerate(rows):
        if not isinstance(row, Inspection):
            counting.append(row)
            continue
        key = key_of(row)
        before = complaints.get(key)
        complaints[key] = _complaint(row, before, gear)
        if row.is_repaired:
            counting.append(_untried(row, before))
        else:
            later = [
                repair
                for repair in repairs[key]
                if _may_be_later(repair, row, place, entered_now=entered_now)
            ]
            counting.append(
                _since(row, later) if later else _after_repairs(row, before, repairs[key])
            )
    return counting


def doubts(rows: Sequence[Inspection | InvalidRow]) -> tuple[str, ...]:
    """Name in one note the rows of a list of which something does not count, or not for certain,
    because of a repair.
    """
    named = [
        row.record_id
        for row in rows
        if isinstance(row, Inspection)
        and (
            (row.readings_in and row.is_since_repair(row.plunger_date) is not True)
            or (row.outcome and row.is_since_repair(row.outcome_date) is not True)
        )
    ]
    if not named:
        return ()
    listed = ", ".join(named[:_MOST_NAMED]) + (" …" if len(named) > _MOST_NAMED else "")
    rows_are = "1 row is" if len(named) == 1 else f"{len(named)} rows are"
    return (
        f"{rows_are} not surely newer than a repair of the gear ({listed}): what is older does not"
        " count, and where the order is not certain the worse reading does. The warnings of each"
        " row say which.",
    )


def _complaint(row: Inspection, before: Inspection | None, gear: Gear) -> Inspection | None:
    """The row with the last failure, or plunger beyond its margin, that nothing settles since."""
    margin = gear.margin.value if row.margin_in is None else row.margin_in
    beyond = any(abs(each) > margin + ROUNDING_IN for each in row.readings_in)
    if row.outcome is Outcome.FAILED or beyond:
        return row
    failed = before is not None and before.outcome is Outcome.FAILED
    settles = row.standing_outcome is not None or (row.readings_in and not failed)
    return None if settles else before


def _untried(row: Inspection, before: Inspection | None) -> Inspection:
    """A row with a repair as that of a gear that failed before it, where nothing says that it was
    tried since.
    """
    if (
        before is None
        or row.standing_outcome is not None
        or (row.readings_in and before.outcome is not Outcome.FAILED)
        or surely_later(before.inspection_date, row.repair_date)
    ):
        return row
    how = "failed" if before.outcome is Outcome.FAILED else "had its plunger beyond the margin"
    said = f"{before.record_id} states that this gear {how}: it was not tried since"
    return replace(
        row,
        outcome=Outcome.FAILED,
        outcome_date=before.inspection_date,
        warnings=(*row.warnings, said),
    )


def _after_repairs(
    row: Inspection, before: Inspection | None, repairs: Sequence[Repair]
) -> Inspection:
    """A row that is surely later than repairs of what failed before it, as that of a gear that was
    not tried since.
    """
    if before is None:
        return row
    since = [
        repair
        for repair in repairs
        if surely_later(row.inspection_date, repair.at)
        and not surely_later(before.inspection_date, repair.at)
    ]
    if not since:
        return row
    rerigged = any(repair.rerigged for repair in since)
    repaired = replace(
        row,
        restored_joints=tuple(sorted(frozenset().union(*(repair.joints for repair in since)))),
        repair_date=max(since, key=lambda repair: repair.day).at,
        rigging_checked=RiggingCheck.CORRECTED if rerigged else row.rigging_checked,
    )
    untried = _untried(repaired, before)
    return row if untried is repaired else untried


def _kept(life: GearLife) -> Iterator[Repair]:
    from mlg_troubleshoot.life.folding import moment_of_repair

    for record in life.repairs:
        at = moment_of_repair(record)
        if at is not None:
            joints = frozenset(int(n) for n in record.body.get("joints", ()))
            yield Repair(at, joints, not joints, "the store keeps")


def _may_be_later(repair: Repair, row: Inspection, place: int, *, entered_now: bool) -> bool:
    if surely_later(row.inspection_date, repair.at):
        return False
    if repair.row is not None:
        return place > repair.row
    if entered_now:
        return surely_later(repair.at, row.inspection_date)
    return row.inspection_date is not None


def _since(row: Inspection, later: Sequence[Repair]) -> Inspection:
    surely = [repair for repair in later if surely_later(repair.at, row.inspection_date)]
    last = max(surely or later, key=lambda repair: repair.day)
    gone = frozenset().union(*(repair.joints for repair in surely))
    joints = frozenset().union(*(repair.joints for repair in later))
    rerigged = any(repair.rerigged for repair in later)
    named = ", ".join(f"#{joint}" for joint in sorted(joints))
    what = " and ".join(filter(None, [named, "the rigging" if rerigged else ""]))
    then = "what is older does not count"
    if not surely:
        then = "this row may be older or newer, so its worse readings count"
    said = f"{last.said_by} a repair of {what} on {last.day.isoformat()}: {then}"
    own_day = row.inspection_date if surely else None
    return replace(
        row,
        clearance_in={j: value for j, value in row.clearance_in.items() if j not in gone},
        restored_joints=tuple(sorted(joints)),
        repair_date=last.at,
        plunger_date=row.plunger_date or own_day,
        outcome_date=row.outcome_date or own_day,
        rigging_checked=RiggingCheck.CORRECTED if rerigged else row.rigging_checked,
        warnings=(*row.warnings, said),
    )
