"""One gear entered by hand: by flags, or by the questions on a terminal."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from datetime import datetime
from typing import TYPE_CHECKING

from mlg_troubleshoot.cli import output
from mlg_troubleshoot.cli.check import Flags
from mlg_troubleshoot.decision.columns import (
    CLEARANCE,
    CONVENTION,
    OUTCOME,
    RECORD_ID,
    SIDE,
    TAIL_NO,
)
from mlg_troubleshoot.decision.inspection import Inspection, Side
from mlg_troubleshoot.decision.plan import Action
from mlg_troubleshoot.errors import OutputError, UsageError
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.gear.gear_file import load_gear
from mlg_troubleshoot.units import LengthUnit
from mlg_troubleshoot.workflows import check as task

if TYPE_CHECKING:
    from mlg_troubleshoot.cli.prompts import (
        Answers,
        RichTerminal,
        Session,
        SessionStore,
        Visit,
    )
    from mlg_troubleshoot.store import Store


def from_flags(flags: Flags, declared: task.CheckOptions) -> Inspection:
    from mlg_troubleshoot.records import made_record_id

    needed = (
        ("--tail", flags.typed.get(TAIL_NO.name)),
        ("--side", flags.typed.get(SIDE.name)),
        ("--convention", declared.convention),
    )
    missing = [flag for flag, value in needed if value is None]
    if missing:
        raise UsageError(
            f"--set needs {', '.join(missing)}",
            "Say which gear (--tail N123 --side LH) and what a clearance reading is (--convention"
            " RADIAL, DIAMETRAL or TOTAL_PLAY): it has no default.",
        )
    values = {RECORD_ID.name: "-", **flags.typed}
    labels = {}
    for text in flags.values or ():
        name, sign, written = text.partition("=")
        number = name.strip().lstrip("#")
        if not sign or not number.isdecimal() or not written.strip():
            raise UsageError(
                f"--set {text!r} is not JOINT=VALUE", "Write for example --set 3=0.013in."
            )
        column = CLEARANCE.header(int(number))
        if column in values:
            raise UsageError(f"--set gives joint {int(number)} twice", "Give each joint once.")
        values[column] = written
        labels[column] = f"--set {text!r}"
    read = _judged(values, labels, flags, declared)
    made = made_record_id(read.tail_no, read.side, datetime.now())
    return replace(read, record_id=flags.typed.get(RECORD_ID.name) or made)


def _judged(
    values: Mapping[str, object],
    labels: Mapping[str, str],
    flags: Flags,
    declared: task.CheckOptions,
) -> Inspection:
    """Let the judge of table rows judge the flags; a refusal names the flag."""
    from mlg_troubleshoot.records import ReadOptions, admit

    options = ReadOptions.of(load_gear(declared.gear), declared)
    return admit(values, options, {**flags.labels(), **labels})


def answers_of(flags: Flags, declared: task.CheckOptions) -> Answers:
    """What the flags answer already of the questions on a terminal, judged as a row would be."""
    from mlg_troubleshoot.cli.prompts.answers import LENGTHS, REST, Answers
    from mlg_troubleshoot.records.gate import NOBODY

    typed = flags.typed
    unit = declared.unit or LengthUnit.INCH
    judged = _judged({**NOBODY, CONVENTION.name: "RADIAL", **typed}, {}, flags, declared)
    with_unit = {
        name: text if text[-1:].isalpha() else f"{text} {unit}"
        for name, text in typed.items()
        if name in LENGTHS
    }
    return Answers(
        tail_no=typed.get(TAIL_NO.name),
        side=judged.side if SIDE.name in typed else None,
        unit=declared.unit,
        convention=declared.convention,
        record_id=typed.get(RECORD_ID.name),
        todo=tuple(asked for asked in REST if asked not in typed),
    ).with_more(**{**typed, **with_unit, OUTCOME.name: judged.outcome})


def unfinished(store: SessionStore, terminal: RichTerminal, gear: Gear, flags: Flags) -> Session:
    """The unfinished entry to resume: the last one, or the one of the gear that flags name."""
    from mlg_troubleshoot.cli.prompts.answers import Answers
    from mlg_troubleshoot.cli.prompts.flow import contradictions
    from mlg_troubleshoot.cli.prompts.pages import unfinished_lines

    found, damaged = store.unfinished(gear.id)
    for message in damaged:
        output.say(message)
    tail, side = (flags.typed.get(column.name) for column in (TAIL_NO, SIDE))
    asked = Answers(tail_no=tail, side=Side.spelt(side or ""))
    named = (each for each in found if not contradictions(each.answers, asked))
    saved = next(named, None) or (None if tail else store.latest())
    if saved is None:
        raise UsageError("there is no unfinished entry to resume", "Start a new one: mlg check")
    others = tuple(each for each in found if each.answers.joints and each.id != saved.id)
    if others:
        terminal.say(unfinished_lines(others))
        output.say("Resume another one: mlg check --resume --tail TAIL --side LH|RH")
    return saved


def kept_visit(store: Store, gear: Gear, tail: str, side: Side) -> Visit | None:
    """The last visit to a gear; records that cannot be read are reported and do not prevent a new
    visit."""
    from mlg_troubleshoot.cli.prompts import last_visit
    from mlg_troubleshoot.store import StoreError

    try:
        return last_visit(store, gear, tail, side)
    except (OutputError, StoreError) as error:
        output.say(f"The records of {tail} {side} cannot be read: {error.message}. {error.remedy}")
        return None


def continued(
    read: Inspection, continues: str, visit: Visit | None
) -> tuple[Inspection, Visit | None]:
    """An entry that continues a kept inspection, and that inspection; if it was changed meanwhile,
    the entry is a new inspection.
    """
    if visit is not None and visit.record.digest == continues:
        return visit.completed(read), visit
    from mlg_troubleshoot.records import made_record_id

    output.say(
        "Note: the inspection that this entry continues was changed meanwhile: the entry is kept"
        " as a new inspection."
    )
    return replace(read, record_id=made_record_id(read.tail_no, read.side, datetime.now())), None


def advice_for(
    gear: Gear,
) -> Callable[[Mapping[int, float], Sequence[int]], tuple[str, int | None] | None]:
    """Say after each critical joint which reading is most useful next, or that one may stop."""

    def advise(measured: Mapping[int, float], left: Sequence[int]) -> tuple[str, int | None] | None:
        step = task.next_step(gear, measured)
        if step.action not in (Action.MEASURE, Action.MEASURE_AGAIN):
            said = f"No measurement is needed now. Next: {step.words}. Type done."
            return (said, None) if left else None
        joint = next((joint for joint in step.joints if joint in left), None)
        if joint is None:
            return None
        return f"Most useful next reading: {gear.joint(joint).label}.", joint

    return advise
