"""What is kept of a gear when its technician comes back: the last inspection, and what it asked
for.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from datetime import date
from types import MappingProxyType
from typing import Any

from mlg_troubleshoot.cli.prompts.answers import (
    CONFIRMED,
    MORE,
    NOT_MEASURED,
    Answers,
    JointAnswer,
    parse_reading,
)
from mlg_troubleshoot.decision.columns import (
    BY_NAME,
    DATE,
    OUTCOME,
    PLUNGER_DISPLACEMENT,
    RESTORED_JOINTS,
    RIGGING_CHECKED,
)
from mlg_troubleshoot.decision.inspection import Inspection, Side, plain_tail
from mlg_troubleshoot.decision.judge_rows import assess
from mlg_troubleshoot.decision.plan import Action
from mlg_troubleshoot.errors import UsageError
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.life.folding import GearLife, KeptInspection, lives
from mlg_troubleshoot.life.state import state_now
from mlg_troubleshoot.store import Record, Store, inspection_from
from mlg_troubleshoot.units import LengthUnit, Sentence, parse_length
from mlg_troubleshoot.workflows.index_tables import load_index_table

# The one question that a step asks, by its column; joints to read are asked one by one.
_ASKS = {
    Action.READ_PLUNGER: PLUNGER_DISPLACEMENT.name,
    Action.CHECK_RIGGING: RIGGING_CHECKED.name,
    Action.RESTORE: RESTORED_JOINTS.name,
    Action.RETRACT: OUTCOME.name,
}
_WITH_JOINTS = (Action.MEASURE, Action.MEASURE_AGAIN)


@dataclass(frozen=True, slots=True)
class Visit:
    """The last inspection of a gear as it counts today.

    `read_on` is the day on which each reading was entered, `before` the answers before the last
    change that was not undone, `todo` what NEXT asks for,
    `stays_open` what was not settled, `versions` the answers of each version by its hash.
    """

    record: Record
    row: Inspection
    answers: Answers
    read_on: Mapping[int, str]
    verdict: str
    next: Sentence
    action: Action | None
    todo: tuple[int | str, ...]
    joints: tuple[int, ...]
    before: Answers | None = None
    stays_open: Sentence | None = None
    versions: Mapping[str, Answers] = field(default_factory=dict)

    def begun(self, today: date | None) -> Answers:
        """The answers with what NEXT asks for still to come, on the day of this visit."""
        inspected = self.row.inspection_date
        answers = replace(self.answers, todo=self.todo)
        if self.action is Action.MEASURE_AGAIN:
            names = " ".join(map(str, {*self.row.measured_again, *self.joints}))
            answers = answers.with_more(measured_again=names)
        if today is None or inspected is None:
            return answers
        return answers.with_more(inspection_date=max(today, inspected).isoformat())

    def with_both_readings(self, answers: Answers) -> Answers:
        """The answers with the plunger's first reading too, where NEXT asked for a second one."""
        name = PLUNGER_DISPLACEMENT.name
        first = self.answers.more.get(name)
        if first is None or self.todo != (name,) or len(self.row.standing_readings_in) != 1:
            return answers
        return answers.with_more(**{name: f"{first}; {answers.more[name]}"})

    def read_in(self, unit: LengthUnit | None) -> Visit:
        """The visit in the unit that was just chosen, where no clearance says which."""
        unit = self.answers.unit or unit
        before = self.before and replace(self.before, unit=self.before.unit or unit)
        return replace(self, answers=replace(self.answers, unit=unit), before=before)

    def completed(self, read: Inspection) -> Inspection:
        """What was typed, with what only the kept inspection says: prompts do not ask for all."""
        asked = {BY_NAME[name].filled for name in MORE} | {"warnings", "unit_question"}
        kept = {
            field.name: getattr(self.row, field.name)
            for field in fields(Inspection)
            if field.name not in asked
            and getattr(read, field.name) in (field.default, None, {}, ())
            and field.name not in ("clearance_in", "entered")
        }
        typed = PLUNGER_DISPLACEMENT.name
        unit = self.answers.unit or LengthUnit.INCH
        if self.answers.more.get(typed) == _more(read, unit).get(typed):
            kept["readings_in"] = self.row.readings_in
        if not self.row.gauge_u_is_default:
            kept |= {"gauge_u_in": self.row.gauge_u_in, "gauge_u_is_default": False}
        kept["carried"] = {**self.row.carried, **read.carried}
        return replace(read, **kept)


def last_visit(store: Store, gear: Gear, tail: str, side: Side) -> Visit | None:
    """The last inspection of a gear, under whichever spelling of its tail number it is kept."""
    if store.is_new:
        return None
    kept = [t for t, s in store.gears() if s == side and plain_tail(t) == plain_tail(tail)]
    if not kept or (tail not in kept and len(kept) > 1):
        return None
    key = (tail if tail in kept else kept[0], side.value)
    life = lives(store, *key)[key]
    return None if life.latest is None else _visit(life, life.latest, gear)


def _visit(life: GearLife, latest: KeptInspection, gear: Gear) -> Visit | None:
    stood = latest.inspection
    if not set(stood.clearance_in) <= set(gear.joint_numbers):
        return None
    state = state_now(life.visits, gear)
    if state is None or state.visit.place != life.places[latest.record.digest]:
        return None
    (found,) = assess([state.inspection], gear, load_index_table(gear))
    since = set(state.inspection.restored_joints) - set(stood.restored_joints)
    restored = tuple(sorted(since - state.inspection.clearance_in.keys()))
    row = _with_repairs(stood, state.inspection, since)
    step = found.next_action
    action = step.action
    asked = _ASKS.get(action)
    todo = step.joints if action in _WITH_JOINTS else () if asked is None else (asked,)
    said = Sentence.of("{}", step.text)
    question = found.plan.open_question
    if restored:
        names = ", ".join(f"#{joint}" for joint in restored)
        action = Action.MEASURE
        todo = restored
        said = Sentence(f"Restored since, as the records say: {names}. Enter the new clearances.")
    versions = life.versions(latest.record)
    by_version = {v.digest: answers_of(inspection_from(v), gear, "") for v in versions}
    standing = _not_undone([*by_version.values()])
    return Visit(
        latest.record,
        row,
        answers_of(row, gear, latest.record.digest),
        _read_on(versions),
        found.verdict.words,
        said,
        action,
        todo,
        step.joints,
        replace(standing[-2], continues=latest.record.digest) if len(standing) > 1 else None,
        Sentence.of("{}", question) if question and not restored else None,
        by_version,
    )


def _with_repairs(stood: Inspection, counts: Inspection, since: set[int]) -> Inspection:
    """An inspection with the repairs that were recorded after it."""
    if not since and counts.rigging_checked is stood.rigging_checked:
        return stood
    day = stood.inspection_date
    return replace(
        stood,
        clearance_in={j: c for j, c in stood.clearance_in.items() if j in counts.clearance_in},
        restored_joints=counts.restored_joints,
        rigging_checked=counts.rigging_checked,
        repair_date=counts.repair_date,
        plunger_date=stood.plunger_date or (day if stood.readings_in else None),
        outcome_date=stood.outcome_date or (day if stood.outcome else None),
    )


def _not_undone(versions: list[Answers]) -> list[Answers]:
    """The versions that lead to the last one, a change and its undoing left out."""
    standing: list[Answers] = []
    for version in versions:
        if version in standing[-2:-1]:
            standing.pop()
        else:
            standing.append(version)
    return standing


def _read_on(versions: list[Record]) -> Mapping[int, str]:
    """The day of the entry that each reading came with."""
    days: dict[int, str] = {}
    readings: Mapping[int, Any] = {}
    for version in versions:
        entered = inspection_from(version).entered
        days = {
            joint: days[joint] if readings.get(joint) == text else version.day
            for joint, text in entered.items()
        }
        readings = entered
    return days


def answers_of(row: Inspection, gear: Gear, continues: str) -> Answers:
    """An inspection as answers, each as it was typed."""
    unit = row.unit_entered
    joints = {
        joint: _answer(row, joint) if joint in row.clearance_in else NOT_MEASURED
        for joint in gear.joint_numbers
    }
    return Answers(
        tail_no=row.tail_no,
        side=row.side,
        # Without a clearance the unit of the next ones is asked for again.
        unit=unit if row.entered else None,
        convention=row.convention,
        record_id=row.record_id,
        joints=MappingProxyType(joints),
        todo=(),
        continues=continues,
    ).with_more(**_more(row, unit))


def _answer(row: Inspection, joint: int) -> JointAnswer:
    entered = row.entered.get(joint)
    if entered is not None:
        try:
            written = parse_reading(entered.bound + entered.text)
            said = next((each for each in row.warnings if each.startswith(CONFIRMED)), "")
            named = said.removeprefix(CONFIRMED).split(", ")
            return JointAnswer(replace(written, unit=entered.unit), f"#{joint}" in named)
        except UsageError:
            pass
    read_in = row.clearance_in[joint] * row.convention.per_radial
    return JointAnswer(parse_length(f"{read_in:.6g} in"))


def _more(row: Inspection, unit: LengthUnit) -> dict[str, str]:
    """The optional answers of an inspection, by column."""
    found = {}
    for name in MORE:
        column = BY_NAME[name]
        value = getattr(row, column.filled, None) if not column.carried else row.carried.get(name)
        if column.copies > 1 and value:
            found[name] = "; ".join(f"{unit.from_inches(float(each)):.6g} {unit}" for each in value)
            continue
        if value in (None, (), "", False):
            continue
        if column.is_length:
            found[name] = f"{unit.from_inches(float(value)):.6g} {unit}"
        elif isinstance(value, tuple):
            found[name] = ("; " if isinstance(value[0], str) else " ").join(map(str, value))
        elif value is True:
            found[name] = "yes"
        elif name != DATE.name and hasattr(value, "isoformat"):
            found[name] = value.isoformat(" ") if hasattr(value, "hour") else value.isoformat()
        else:
            found[name] = f"{value:g}" if isinstance(value, float) else str(value)
    return found
