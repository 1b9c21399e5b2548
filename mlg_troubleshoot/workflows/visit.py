"""What is kept of a gear when somebody comes back to it, and what is said of it today."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass

from mlg_troubleshoot.decision.assessment import Action, Step
from mlg_troubleshoot.decision.columns import (
    CLEARANCE,
    OUTCOME,
    PLUNGER_DISPLACEMENT,
    RESTORED_JOINTS,
    RIGGING_CHECKED,
    SIGNED_OFF,
)
from mlg_troubleshoot.decision.inspection import Inspection, Side
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.life.folding import as_spelt, lives_of
from mlg_troubleshoot.life.logbook import in_words
from mlg_troubleshoot.life.state import GearKey, GearState, state_now
from mlg_troubleshoot.store import Record, Store
from mlg_troubleshoot.workflows.check import CheckResult

# The one question that a step asks, by its column; joints to read are asked one by one.
_ASKS = {
    Action.READ_PLUNGER: PLUNGER_DISPLACEMENT.name,
    Action.CHECK_RIGGING: RIGGING_CHECKED.name,
    Action.RESTORE: RESTORED_JOINTS.name,
    Action.RETRACT: OUTCOME.name,
}
_TO_READ = (Action.MEASURE, Action.MEASURE_AGAIN)


@dataclass(frozen=True, slots=True)
class Visit:
    """What stands of a gear, and what is said of it today.

    row: what stands. records: its visits in the order of their entry. last: the last reading of
    each joint with its day. is_own: whether its last visit was typed here. undoes: what an undo
    takes back, which is the last visit; empty if nothing. moved: or the gear that visits were moved
    from, with their ids. before: or what stood before a correction.
    """

    records: tuple[Record, ...]
    row: Inspection
    result: CheckResult
    last: Mapping[int, str]
    is_own: bool = False
    undoes: str = ""
    moved: tuple[GearKey, frozenset[str]] | None = None
    before: tuple[Record, ...] = ()

    @property
    def step(self) -> Step:
        return self.result.judgements[0].next_action

    @property
    def todo(self) -> tuple[str, ...]:
        """The columns that NEXT asks for; none where nothing is required."""
        if not self.step.required:
            may_sign = self.row.is_repaired and self.step.action is not Action.READ_PLUNGER
            return (SIGNED_OFF.name,) * may_sign
        if self.step.action in _TO_READ:
            return tuple(map(CLEARANCE.header, self.step.joints))
        asked = _ASKS.get(self.step.action)
        return () if asked is None else (asked,)


def find_visit(
    store: Store,
    gear: Gear,
    tail: str,
    side: Side,
    judge: Callable[[GearState], CheckResult],
    own: Collection[str] = (),
) -> Visit | None:
    """What is kept of a gear, under whichever spelling of its tail number. `own`: the visits that
    an undo may take back.
    """
    if store.is_new:
        return None
    key = (as_spelt([tail], store)[tail], side.value)
    life = lives_of(store, [key]).get(key)
    state = None if life is None else state_now(life.visits, gear)
    if life is None or state is None or not life.inspections:
        return None
    visits = sorted(life.inspections, key=lambda each: each.place)
    last = {
        joint: f"{entered} on {visit.at}" if visit.at else str(entered)
        for visit in life.visits
        for joint, entered in visit.inspection.entered.items()
    }
    row = state.inspection
    undoes = ""
    is_own = visits[-1].kept.record_id in own
    before = [each for each in life.visits if each.kept is not visits[-1].kept]
    if is_own and state_now(before, gear) is not None:
        undoes = in_words(visits[-1].inspection, gear)
    return Visit(tuple(each.kept for each in visits), row, judge(state), last, is_own, undoes)
