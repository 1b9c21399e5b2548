"""What the records say about the past: how worn gears usually are."""

from __future__ import annotations

from mlg_troubleshoot.decision.fleet import Fleet
from mlg_troubleshoot.decision.inspection import Inspection
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.life.state import GearKey
from mlg_troubleshoot.store import RecordKind, Store, inspection_from

# Newest inspections that a fleet is judged by, which give a share to a few percent; fewest gears.
_MOST = 500
_FEWEST = 10


def expected_of(store: Store, gear: Gear) -> Fleet | None:
    """Learn from the last inspection of each gear among the newest that are kept; None with too
    few that fit this linkage.
    """
    from mlg_troubleshoot.decision.learning import learned

    joints = set(gear.joint_numbers)
    last: dict[GearKey, Inspection] = {}
    for record in store.newest(RecordKind.INSPECTION, _MOST):
        if (record.tail_no, record.side) not in last:
            row = inspection_from(record)
            # A visit at which no joint was read says nothing of wear.
            if row.clearance_in and set(row.clearance_in) <= joints:
                last[record.tail_no, record.side] = row
    rows = [*last.values()]
    return learned(gear, rows) if len(rows) >= _FEWEST else None
