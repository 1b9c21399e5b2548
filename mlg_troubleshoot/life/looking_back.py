"""What the records say about the past: how worn gears usually are."""

from __future__ import annotations

from mlg_troubleshoot.decision.fleet import Fleet
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.store import Record, RecordKind, Store, inspection_from

# Newest inspections that a fleet is judged by, which give a share to a few percent; fewest gears.
_MOST = 500
_FEWEST = 10


def expected_of(store: Store, gear: Gear) -> Fleet | None:
    """Learn from the last inspection of each gear among the newest that are kept; None with too
    few that fit this linkage.
    """
    from mlg_troubleshoot.decision.learning import learned

    joints = set(gear.joint_numbers)
    last: dict[tuple[str, str], Record] = {}
    for record in store.newest(RecordKind.INSPECTION, _MOST):
        last.setdefault((record.tail_no, record.side), record)
    found = [inspection_from(record) for record in last.values()]
    rows = [row for row in found if row.clearance_in and set(row.clearance_in) <= joints]
    return learned(gear, rows) if len(rows) >= _FEWEST else None
