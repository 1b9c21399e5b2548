"""Rows that are older than a repair of their gear, which a row above states or the store keeps."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from datetime import date, datetime
from typing import TYPE_CHECKING

from mlg_troubleshoot.decision.inspection import (
    Inspection,
    InvalidRow,
    Outcome,
    RiggingCheck,
    surely_later,
)
from mlg_troubleshoot.gear.gear import Gear

if TYPE_CHECKING:
    from mlg_troubleshoot.life.folding import GearKey
    from mlg_troubleshoot.store import Store


@dataclass(frozen=True, slots=True)
class Repair:
    """Joints that were restored on a day, or the rigging set right; who says so, and in which row
    of the table.
    """

    day: date
    joints: frozenset[int]
    rerigged: bool
    said_by: str = field(compare=False)
    row: int | None = field(default=None, compare=False)


def key_of(row: Inspection) -> GearKey:
    return row.tail_no, row.side.value


def stated_repair(row: Inspection, place: int | None = None) -> Repair | None:
    """The repair that a row states, if it says when."""
    day = row.repair_date
    if not row.is_repaired or day is None:
        return None
    if isinstance(day, datetime):
        day = day.date()
    rerigged = row.rigging_checked is RiggingCheck.CORRECTED
    return Repair(day, frozenset(row.restored_joints), rerigged, f"{row.record_id} states", place)


def since_repairs(
    rows: Sequence[Inspection | InvalidRow], gear: Gear, store: Store | None
) -> Sequence[Inspection | InvalidRow]:
    """The rows as they count after the repairs that rows above them state or the store keeps: a
    repair on the day of a row or later makes its outcome, its plunger reading and what it says of
    the restored joints older.

    A row that states a repair and no outcome is that of a gear that failed, if the last outcome
    above it, or in the store, is a failure before the repair: nobody has tried it since. What the
    store keeps of repairs reaches only rows with a date.
    """
    repairs: defaultdict[GearKey, list[Repair]] = defaultdict(list)
    for place, row in enumerate(rows):
        stated = stated_repair(row, place) if isinstance(row, Inspection) else None
        if stated is not None and isinstance(row, Inspection):
            repairs[key_of(row)].append(stated)
    if store is not None:
        for key, kept in _kept(store):
            repairs[key].append(kept)
    worked_on = (
        isinstance(r, Inspection) and (r.restored_joints or r.rigging_checked) for r in rows
    )
    if not repairs and not any(worked_on):
        return rows
    counting: list[Inspection | InvalidRow] = []
    failed = _failed(rows, store)
    for place, row in enumerate(rows):
        counts = row
        if isinstance(row, Inspection):
            key = key_of(row)
            if row.outcome is not None:
                failed[key] = row if row.outcome is Outcome.FAILED else None
            before = failed.get(key)
            if not row.is_repaired:
                counts = _since(row, place, repairs[key], gear) if key in repairs else row
            elif (
                row.outcome is None
                and before is not None
                and not surely_later(before.inspection_date, row.repair_date)
            ):
                said = f"{before.record_id} states that this gear failed: it was not tried since"
                counts = replace(
                    row,
                    outcome=Outcome.FAILED,
                    outcome_date=before.inspection_date,
                    warnings=(*row.warnings, said),
                )
        counting.append(counts)
    return counting


def _failed(
    rows: Sequence[Inspection | InvalidRow], store: Store | None
) -> dict[GearKey, Inspection | None]:
    """The kept inspection of each gear with its last outcome, where that is a failure."""
    if store is None:
        return {}
    from mlg_troubleshoot.life.folding import lives_of

    untried = {key_of(r) for r in rows if isinstance(r, Inspection) and r.is_repaired}
    found: dict[GearKey, Inspection | None] = {}
    for key, life in lives_of(store, untried).items() if untried else ():
        tried = (each.inspection for each in reversed(life.inspections))
        last = next((each for each in tried if each.outcome is not None), None)
        found[key] = last if last is not None and last.outcome is Outcome.FAILED else None
    return found


def _kept(store: Store) -> Iterator[tuple[GearKey, Repair]]:
    from mlg_troubleshoot.life.folding import lives

    for key, life in lives(store).items():
        for record in life.repairs:
            if record.day:
                joints = frozenset(int(n) for n in record.body.get("joints", ()))
                day = date.fromisoformat(record.day)
                yield key, Repair(day, joints, not joints, "the store keeps")


def _since(row: Inspection, place: int, repairs: Sequence[Repair], gear: Gear) -> Inspection:
    later = [
        repair
        for repair in repairs
        if not surely_later(row.inspection_date, repair.day)
        and (row.inspection_date is not None if repair.row is None else place > repair.row)
    ]
    if not later:
        return row
    joints = frozenset().union(*(repair.joints for repair in later))
    day = max(repair.day for repair in later)
    # On the day of the repair, and below it in the table, a reading within its limit may be one of
    # the new part.
    gone = {
        joint
        for joint in joints & set(row.clearance_in)
        if surely_later(day, row.inspection_date)
        or gear.joint(joint).is_over_limit(row.clearance_in[joint])
    }
    rerigged = any(repair.rerigged for repair in later)
    named = ", ".join(f"#{joint}" for joint in sorted(joints))
    what = " and ".join(filter(None, [named, "the rigging" if rerigged else ""]))
    by = later[-1].said_by
    said = f"{by} a repair of {what} on {day.isoformat()}: what is older does not count"
    return replace(
        row,
        clearance_in={j: value for j, value in row.clearance_in.items() if j not in gone},
        restored_joints=tuple(sorted(joints)),
        repair_date=day,
        rigging_checked=RiggingCheck.CORRECTED if rerigged else row.rigging_checked,
        warnings=(*row.warnings, said),
    )
