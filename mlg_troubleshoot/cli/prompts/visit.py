"""What is kept of a gear when somebody comes back to it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

from mlg_troubleshoot.cli.prompts.entry import PLUNGER, Entry
from mlg_troubleshoot.decision.columns import (
    BY_NAME,
    CLEARANCE,
    LANDINGS,
    MARGIN,
    MARGIN_U,
    OUTCOME,
    RESTORED_JOINTS,
    RIGGING_CHECKED,
)
from mlg_troubleshoot.decision.inspection import Inspection, Side
from mlg_troubleshoot.decision.judge_rows import assess
from mlg_troubleshoot.decision.plan import Action, Step
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.life.folding import as_spelt, lives_of
from mlg_troubleshoot.life.logbook import shortened, visit_lines
from mlg_troubleshoot.life.state import GearState, state_now
from mlg_troubleshoot.store import Record, Store
from mlg_troubleshoot.units import said_in
from mlg_troubleshoot.workflows.check import CheckResult
from mlg_troubleshoot.workflows.index_tables import load_index_table

# The one question that a step asks, by its column; joints to read are asked one by one.
_ASKS = {
    Action.READ_PLUNGER: PLUNGER,
    Action.CHECK_RIGGING: RIGGING_CHECKED.name,
    Action.RESTORE: RESTORED_JOINTS.name,
    Action.RETRACT: OUTCOME.name,
}
_TO_READ = (Action.MEASURE, Action.MEASURE_AGAIN)
_STANDS = (MARGIN, MARGIN_U, BY_NAME["cannot_reach"], BY_NAME["no_spare"])
# Facts of a visit that an undo names at most.
_MOST_NAMED = 3


@dataclass(frozen=True, slots=True)
class Visit:
    """What stands of a gear, and what is said of it today.

    row: what stands. record: the visit that was recorded last. last: the last reading of each joint
    with its day. undoes: what an undo takes back, which is that visit; empty if nothing.
    """

    record: Record
    row: Inspection
    result: CheckResult
    last: Mapping[int, str]
    undoes: str = ""

    @property
    def step(self) -> Step:
        return self.result.judgements[0].next_action

    @property
    def joints(self) -> tuple[int, ...]:
        return self.step.joints

    @property
    def todo(self) -> tuple[str, ...]:
        """The columns that NEXT asks for."""
        if self.step.action in _TO_READ:
            return tuple(map(CLEARANCE.header, self.joints))
        asked = _ASKS.get(self.step.action)
        return () if asked is None else (asked,)


def find_visit(
    store: Store, gear: Gear, tail: str, side: Side, judge: Callable[[GearState], CheckResult]
) -> Visit | None:
    """What is kept of a gear, under whichever spelling of its tail number."""
    if store.is_new:
        return None
    key = (as_spelt([tail], store)[tail], side.value)
    life = lives_of(store, [key]).get(key)
    state = None if life is None else state_now(life.visits, gear)
    if life is None or state is None or not life.inspections:
        return None
    newest = max(life.inspections, key=lambda each: each.place)
    last = {
        joint: f"{entered} on {visit.at}" if visit.at else str(entered)
        for visit in life.visits
        for joint, entered in visit.inspection.entered.items()
    }
    row = state.inspection
    undoes = ""
    if len(life.visits) > 1 and newest.inspection.source.file is None:
        lines = [*shortened(visit_lines(newest.inspection, gear))]
        undoes = ", ".join(said_in(line.text, row.unit_entered) for line in lines[:_MOST_NAMED])
        undoes += " …" * (len(lines) > _MOST_NAMED)
    return Visit(newest.kept, row, judge(state), last, undoes)


def continued(known: Visit, row: Inspection, entry: Entry) -> Inspection:
    """A visit with what stands of the gear and was not typed anew: its margin, what the day does
    not allow; and which joints NEXT wanted measured again.
    """
    stands = [column.filled for column in _STANDS if column.name not in entry.typed]
    if row.inspection_date == known.row.inspection_date and LANDINGS.name not in entry.typed:
        stands.append(LANDINGS.filled)
    is_again = known.step.action is Action.MEASURE_AGAIN
    again = row.clearance_in.keys() & known.joints if is_again else ()
    more = {name: getattr(known.row, name) for name in stands}
    # What the reader of a row alone misses in it stands in other visits.
    said = tuple(each for each in row.warnings if each.startswith("asked again"))
    return replace(row, measured_again=tuple(sorted(again)), warnings=said, **more)


def reading_order(gear: Gear, entry: Entry) -> tuple[int, ...]:
    """The joints to read next, as the plan of an unfinished entry has them."""
    (judged,) = assess([entry.inspection(gear)], gear, load_index_table(gear))
    step = next((s for s in judged.plan.steps if s.action is Action.MEASURE), None)
    return () if step is None else step.joints
