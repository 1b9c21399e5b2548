"""What the records say about the past: inspections in a row, and how worn gears usually are."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from mlg_troubleshoot.decision.assessment import Assessment, Judgement, Rejected
from mlg_troubleshoot.decision.fleet import Fleet
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.indices.index_table import IndexTable
from mlg_troubleshoot.life.folding import GearLife, lives_of
from mlg_troubleshoot.life.state import key_of
from mlg_troubleshoot.store import Record, RecordKind, Store, inspection_from

# Inspections that stand side by side on a page.
_SIDE_BY_SIDE = 4
# Newest inspections that a fleet is judged by, which give a share to a few percent; fewest gears.
_MOST = 500
_FEWEST = 10


@dataclass(frozen=True, slots=True)
class PastInspection:
    """One inspection of a gear, and what was restored since the one before."""

    record_id: str
    date: str
    gear_landings: float | None
    clearance_in: Mapping[int, float]
    restored: tuple[int, ...]
    rerigged: bool
    worst_in: float | None
    verdict: str | None


def side_by_side(life: GearLife, now: Assessment | None = None) -> list[PastInspection]:
    """The last inspections of a gear, up to one that is not kept yet; nothing where that one has
    none before it.
    """
    rows = [
        (
            kept.inspection,
            (kept.record.day, kept.record.seq),
            None if said is None else said.predicted_displacement_in,
            None if said is None else said.verdict.value,
        )
        for kept in life.inspections
        for said in (life.judged.get(kept.record.digest),)
    ]
    if now is not None:
        found = now.inspection
        day = found.inspection_date.isoformat() if found.inspection_date else ""
        at = (day or "9999", life.records[-1].seq + 1)
        rows = [r for r in rows if r[0].record_id != found.record_id and r[1] < at]
        rows += [(found, at, now.deciding_in, now.verdict.value)] if rows else []
    steps: list[PastInspection] = []
    before: tuple[str, int] | None = None
    for inspection, at, worst_in, verdict in rows:
        since = [r for r in life.repairs if before and before < (r.day, r.record.seq) <= at]
        day = inspection.inspection_date.isoformat() if inspection.inspection_date else ""
        steps.append(
            PastInspection(
                inspection.record_id,
                day,
                inspection.gear_landings,
                inspection.clearance_in,
                restored=tuple(sorted(frozenset().union(*(r.joints for r in since)))),
                rerigged=any(not r.joints for r in since),
                worst_in=worst_in,
                verdict=verdict,
            )
        )
        before = max(before or at, at)
    return steps[-_SIDE_BY_SIDE:]


def seen_before(
    judgements: Sequence[Judgement], store: Store, gear: Gear, table: IndexTable
) -> list[list[PastInspection]]:
    """What each judged gear was like before, side by side with what it is now; empty for one that
    is new.
    """
    from mlg_troubleshoot.life.judged import judge_lives

    now = [None if isinstance(each, Rejected) else each for each in judgements]
    keys = {key_of(each.inspection) for each in now if each is not None}
    known = judge_lives(lives_of(store, keys).values(), gear, table, every=True)
    lives = {life.key: life for life in known}
    return [
        []
        if each is None or key_of(each.inspection) not in lives
        else side_by_side(lives[key_of(each.inspection)], each)
        for each in now
    ]


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
