"""What the model of today says of kept inspections: worked out when it is asked for, never kept.

Margin, limits, repairs, version and correction of an inspection are thus always those that stand.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

from mlg_troubleshoot.decision.assessment import Assessment
from mlg_troubleshoot.decision.inspection import Inspection
from mlg_troubleshoot.decision.judge_rows import assess
from mlg_troubleshoot.decision.ranking import Listed
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.indices.index_table import IndexTable
from mlg_troubleshoot.life.folding import GearLife, KeptInspection, TodaysVerdict
from mlg_troubleshoot.life.since_repairs import since_repairs


def since_kept_repairs(kept: KeptInspection, life: GearLife, gear: Gear) -> Inspection:
    """A kept inspection since the repairs of its gear; on one day those entered by hand follow each
    other as they were entered.
    """
    row = kept.inspection
    day = kept.record.day
    later = any(r.day == day and r.seq > kept.record.seq for r in life.repairs)
    by_hand = row.source.file is None and not later
    (found,) = since_repairs([row], gear, {life.key: life}, entered_now=by_hand)
    return found if isinstance(found, Inspection) else row


def judge_lives(
    lives: Iterable[GearLife], gear: Gear, table: IndexTable, *, every: bool = False
) -> list[GearLife]:
    """Judge of each life what may be the last inspection, and those that an outcome names, or every
    one; what a repair is later than is judged as it was found.
    """
    asked = list(lives)
    numbers = set(gear.joint_numbers)
    rows: dict[tuple[str, bool], Inspection] = {}
    for life in asked:
        named = {record.record_id for record in life.outcomes}
        newest = {kept.record.digest for kept in life.newest}
        for kept in life.inspections:
            digest = kept.record.digest
            last = digest in newest
            if (every or last or kept.record.record_id in named) and (
                kept.inspection.clearance_in.keys() <= numbers
            ):
                rows[digest, False] = kept.inspection
                if last and not life.is_repaired_since(kept):
                    rows[digest, True] = since_kept_repairs(kept, life, gear)
    different = {at: row for at, row in rows.items() if not at[1] or row is not rows[at[0], False]}
    found = dict(zip(different, _judged([*different.values()], gear, table), strict=True))
    return [
        replace(
            life,
            judged={
                digest: found[digest, False]
                for kept in life.inspections
                if ((digest := kept.record.digest), False) in found
            },
            standing={
                digest: found.get((digest, True), found[digest, False])
                for kept in life.newest
                if ((digest := kept.record.digest), False) in found
            },
        )
        for life in asked
    ]


def _judged(rows: Sequence[Inspection], gear: Gear, table: IndexTable) -> list[TodaysVerdict]:
    return [
        TodaysVerdict(
            found.verdict,
            found.predicted_displacement_in,
            found.margin_in,
            found.ranked[0].joint,
            found.plan,
            found.in_brief,
            (not (line := Listed.of(found)).is_fine, *(-x for x in line.severity)),
        )
        for found in assess(rows, gear, table)
        if isinstance(found, Assessment)
    ]
