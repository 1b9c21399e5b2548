"""What the model of today says of kept gears: worked out when it is asked for, never kept.

Margin, limits, repairs, version and correction of an inspection are thus always those that stand.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

from mlg_troubleshoot.decision.assessment import Assessment
from mlg_troubleshoot.decision.judge_rows import assess
from mlg_troubleshoot.decision.plan import Action
from mlg_troubleshoot.decision.ranking import Listed
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.indices.index_table import IndexTable
from mlg_troubleshoot.life.folding import GearLife, TodaysVerdict
from mlg_troubleshoot.life.state import GearState, state_now, states


def judge_lives(
    lives: Iterable[GearLife], gear: Gear, table: IndexTable, *, every: bool = False
) -> list[GearLife]:
    """Judge what stands of each gear today and, with `every`, what stood at each inspection."""
    asked = list(lives)
    numbers = set(gear.joint_numbers)
    found: dict[tuple[int, str], GearState] = {}
    for place, life in enumerate(asked):
        known = [v for v in life.visits if v.inspection.clearance_in.keys() <= numbers]
        if (now := state_now(known, gear)) is not None:
            found[place, _NOW] = now
        if not every:
            continue
        inspected = {visit.kept.digest for visit in life.inspections}
        found |= {
            (place, digest): state
            for state in states(known, gear)
            if (digest := state.visit.kept.digest) in inspected
        }
    said = dict(zip(found, _judged([*found.values()], gear, table), strict=True))
    return [
        replace(
            life,
            judged={digest: each for (n, digest), each in said.items() if n == place and digest},
            state=found.get((place, _NOW)),
            now=said.get((place, _NOW), TodaysVerdict()),
        )
        for place, life in enumerate(asked)
    ]


# Stands in place of the hash of an inspection.
_NOW = ""


def _judged(states: Sequence[GearState], gear: Gear, table: IndexTable) -> list[TodaysVerdict]:
    return [
        TodaysVerdict(
            found.verdict,
            found.predicted_displacement_in,
            found.margin_in,
            found.ranked[0].joint,
            found.in_brief,
            sum(step.minutes for step in found.plan.steps),
            tuple(n for s in found.plan.steps if s.action is Action.RESTORE for n in s.joints),
            Listed.of(replace(found, older=state.older)).is_fine,
        )
        for state, found in zip(
            states, assess([state.inspection for state in states], gear, table), strict=True
        )
        if isinstance(found, Assessment)
    ]
