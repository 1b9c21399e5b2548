"""Rows that are older than a repair which the store keeps of the same gear."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from datetime import date

from mlg_troubleshoot.decision.inspection import (
    Inspection,
    InvalidRow,
    RiggingCheck,
    surely_later,
)
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.life.folding import lives
from mlg_troubleshoot.store import Record, RecordKind, Store


def since_kept_repairs(
    rows: Sequence[Inspection | InvalidRow], store: Store, gear: Gear
) -> list[Inspection | InvalidRow]:
    """The rows as they count after the repairs that are kept: a repair on the day of a row or later
    makes its outcome, its plunger reading and what it says of the restored joints older.

    A row without a date, or one that states a repair itself, stays as it is.
    """
    found = lives(store)
    return [
        _since(row, found[key].repairs, gear)
        if isinstance(row, Inspection)
        and row.inspection_date is not None
        and not row.is_repaired
        and (key := (row.tail_no, row.side.value)) in found
        else row
        for row in rows
    ]


def _since(row: Inspection, repairs: Sequence[Record], gear: Gear) -> Inspection:
    later = [
        record
        for record in repairs
        if record.day and not surely_later(row.inspection_date, date.fromisoformat(record.day))
    ]
    if not later:
        return row
    joints = {int(n) for r in later if r.kind is RecordKind.REPAIR for n in r.body["joints"]}
    day = date.fromisoformat(max(record.day for record in later))
    # On the day of the repair a reading within its limit may be one of the new part.
    gone = {
        joint
        for joint in joints & set(row.clearance_in)
        if surely_later(day, row.inspection_date)
        or gear.joint(joint).is_over_limit(row.clearance_in[joint])
    }
    rerigged = any(record.kind is RecordKind.RERIG for record in later)
    named = ", ".join(f"#{joint}" for joint in sorted(joints))
    what = " and ".join(filter(None, [named, "the rigging" if rerigged else ""]))
    said = f"the store keeps a repair of {what} on {day.isoformat()}: what is older does not count"
    return replace(
        row,
        clearance_in={j: value for j, value in row.clearance_in.items() if j not in gone},
        restored_joints=tuple(sorted(joints)),
        repair_date=day,
        rigging_checked=RiggingCheck.CORRECTED if rerigged else row.rigging_checked,
        warnings=(*row.warnings, said),
    )
