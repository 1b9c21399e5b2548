"""What the inspections that are kept teach of a gear before anything is read on it."""

from __future__ import annotations

from mlg_troubleshoot.decision.case import Cases
from mlg_troubleshoot.decision.fleet import Fleet
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.store import Record, RecordKind, Store, inspection_from

# Newest inspections that are looked at: they tell a share to some percent.
_MOST = 500


def expected_of(store: Store, gear: Gear) -> Fleet | None:
    """Learn from the last inspection of each gear among the newest that are kept; None without any
    that fits this linkage.
    """
    from mlg_troubleshoot.decision.learning import learned

    joints = set(gear.joint_numbers)
    last: dict[tuple[str, str], Record] = {}
    for record in store.newest(RecordKind.INSPECTION, _MOST):
        last.setdefault((record.tail_no, record.side), record)
    found = [inspection_from(record) for record in last.values()]
    rows = [row for row in found if row.clearance_in and set(row.clearance_in) <= joints]
    return learned(Cases.of(gear, rows)) if rows else None
