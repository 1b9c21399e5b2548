"""What is kept of a gear when somebody comes back to it, and what a sitting adds to it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import datetime, timedelta
from typing import Any

from mlg_troubleshoot.cli.prompts.entry import PLUNGER, Entry, column_of, joint_of
from mlg_troubleshoot.decision.columns import (
    CLEARANCE,
    CONVENTION,
    DATE,
    OUTCOME,
    RESTORED_JOINTS,
    RIGGING_CHECKED,
    SIDE,
    TAIL_NO,
    UNIT,
)
from mlg_troubleshoot.decision.inspection import Inspection, RiggingCheck, Side, plain_tail
from mlg_troubleshoot.decision.judge_rows import assess
from mlg_troubleshoot.decision.plan import Action, Step
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.life.folding import lives
from mlg_troubleshoot.store import (
    Record,
    Store,
    inspection_from,
    same_inspection,
)
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
_MICROSECOND = timedelta(microseconds=1)


@dataclass(frozen=True, slots=True)
class Visit:
    """What is kept of a gear, and what is said of it today.

    last: the last reading of each joint with its day. before: the inspection before the last
    change that was not undone, None where there is none.
    """

    record: Record
    row: Inspection
    result: CheckResult
    last: Mapping[int, str]
    before: Inspection | None = None

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

    @property
    def undoes(self) -> str:
        """What an undo takes back; empty if nothing."""
        if self.before is None:
            return ""
        found = [
            f"#{n} {self.row.entered.get(n, 'not read')}"
            for n in sorted({*self.row.clearance_in, *self.before.clearance_in})
            if self.row.clearance_in.get(n) != self.before.clearance_in.get(n)
        ]
        if self.row.readings_in != self.before.readings_in:
            unit = self.row.unit_entered
            read = "; ".join(unit.shown(each, sign=True) for each in self.row.readings_in)
            found.append(f"plunger {read or 'not read'} {unit}")
        for name in (OUTCOME.name, RESTORED_JOINTS.name, RIGGING_CHECKED.name):
            value = getattr(self.row, name)
            if value != getattr(self.before, name):
                shown = " ".join(map(str, value)) if isinstance(value, tuple) else value
                found.append(f"{column_of(name).plain} {shown or 'none'}")
        return ", ".join(found) or "the last change"


def find_visit(
    store: Store,
    tail: str,
    side: Side,
    judge: Callable[[Inspection], CheckResult],
) -> Visit | None:
    """What is kept of a gear, under whichever spelling of its tail number."""
    if store.is_new:
        return None
    kept = [t for t, s in store.gears() if s == side and plain_tail(t) == plain_tail(tail)]
    if not kept:
        return None
    key = (tail if tail in kept else kept[0], side.value)
    life = lives(store, *key)[key]
    if life.latest is None:
        return None
    row = life.latest.inspection
    versions = life.versions(life.latest.record)
    standing = _not_undone(versions)
    before = inspection_from(standing[-2]) if len(standing) > 1 else None
    return Visit(life.latest.record, row, judge(row), _last_readings(versions), before)


def _not_undone(versions: Sequence[Record]) -> list[Record]:
    """The versions that lead to the last one, a change and its undoing left out."""
    standing: list[Record] = []
    for version in versions:
        if standing[-2:-1] and same_inspection(standing[-2], version):
            standing.pop()
        else:
            standing.append(version)
    return standing


def _last_readings(versions: Sequence[Record]) -> Mapping[int, str]:
    """The last reading of each joint, with the day of the entry that it came with."""
    shown: dict[int, str] = {}
    read: Mapping[int, object] = {}
    for version in versions:
        row = inspection_from(version)
        for joint, entered in row.entered.items():
            if read.get(joint) != entered:
                shown[joint] = f"{entered} on {version.day}" if version.day else str(entered)
        read = row.entered
    return shown


def with_sitting(visit: Visit, typed: Inspection, entry: Entry) -> Inspection:
    """The kept inspection of a gear with what was typed since.

    A day that was stated stays; what is typed after a repair is dated after it.
    """
    row = _read_as(visit.row, typed)
    begin = datetime.combine(entry.day, datetime.now().time())
    # What is typed later happened later.
    moments = {name: begin + place * _MICROSECOND for place, name in enumerate(entry.typed, 1)}
    work = [RESTORED_JOINTS.name, RIGGING_CHECKED.name]
    changed: dict[str, Any] = {}
    carried = {**row.carried}
    for name in entry.typed:
        column = column_of(name)
        if column.carried:
            carried[name] = entry.cells[name]
        elif not joint_of(name) and name not in (TAIL_NO.name, SIDE.name, UNIT.name, DATE.name):
            changed[column.filled] = getattr(typed, column.filled)
    for field, name in (("plunger_date", PLUNGER), ("outcome_date", OUTCOME.name)):
        given = name in entry.typed and bool(entry.cells[name])
        if given and getattr(typed, field) is None and (row.is_repaired or row.inspection_date):
            changed[field] = moments[name]
    is_second = visit.step.action is Action.READ_PLUNGER and len(row.standing_readings_in) == 1
    if typed.readings_in and is_second:
        changed["readings_in"] = (*row.readings_in, *typed.readings_in)
    gone: tuple[int, ...] = ()
    is_repair = typed.restored_joints or typed.rigging_checked is RiggingCheck.CORRECTED
    if is_repair and not {*work}.isdisjoint(entry.typed):
        last = max(moments[name] for name in work if name in moments)
        at = datetime.combine(typed.repair_date or entry.day, last.time())
        changed["repair_date"] = at
        gone = typed.restored_joints
        for field, value in (("plunger_date", row.readings_in), ("outcome_date", row.outcome)):
            if value and getattr(row, field) is None and field not in changed:
                changed[field] = at - _MICROSECOND
    if visit.step.action is Action.MEASURE_AGAIN:
        again = {*row.measured_again, *(set(visit.joints) & set(typed.clearance_in))}
        changed["measured_again"] = tuple(sorted(again))
    kept = {n: value for n, value in row.clearance_in.items() if n not in gone}
    return replace(
        row,
        **changed,
        convention=typed.convention if CONVENTION.name in entry.cells else row.convention,
        clearance_in={**kept, **typed.clearance_in},
        entered={**{n: e for n, e in row.entered.items() if n in kept}, **typed.entered},
        carried=carried,
        inspection_date=row.inspection_date or entry.day,
        warnings=tuple(each for each in typed.warnings if each.startswith("asked again")),
    )


def _read_as(row: Inspection, typed: Inspection) -> Inspection:
    """The kept inspection, its readings in the convention of those that were typed."""
    if typed.convention is row.convention or not typed.clearance_in:
        return row
    factor = typed.convention.per_radial
    unit = row.unit_entered
    entered = {
        n: replace(each, text=f"{unit.from_inches(row.clearance_in[n] * factor):.4g}", unit=unit)
        for n, each in row.entered.items()
    }
    return replace(row, entered=entered, convention=typed.convention)


def reading_order(gear: Gear, entry: Entry) -> tuple[int, ...]:
    """The joints to read next, as the plan of an unfinished entry has them."""
    (judged,) = assess([entry.inspection(gear)], gear, load_index_table(gear))
    step = next((s for s in judged.plan.steps if s.action is Action.MEASURE), None)
    return () if step is None else step.joints
