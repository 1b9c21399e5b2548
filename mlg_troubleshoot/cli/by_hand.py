"""One gear entered by hand: by flags, or by the questions on a terminal."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from datetime import datetime
from typing import TYPE_CHECKING

from mlg_troubleshoot.cli import output
from mlg_troubleshoot.decision.columns import (
    CONVENTION,
    RECORD_ID,
    SIDE,
    TAIL_NO,
)
from mlg_troubleshoot.decision.inspection import Inspection, Side
from mlg_troubleshoot.decision.plan import Action
from mlg_troubleshoot.errors import OutputError, UsageError
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.gear.gear_file import load_gear
from mlg_troubleshoot.workflows import check as task

if TYPE_CHECKING:
    from mlg_troubleshoot.cli.check import Flags
    from mlg_troubleshoot.cli.prompts import (
        Answers,
        RichTerminal,
        Session,
        SessionStore,
        Visit,
    )
    from mlg_troubleshoot.store import Store


def from_flags(flags: Flags, declared: task.CheckOptions, place: Store | None = None) -> Inspection:
    """Let the judge of table rows judge the flags; a refusal names the flag. An id that was made
    is free in the store.
    """
    from mlg_troubleshoot.records import ReadOptions, admit, headers, made_record_id

    options = ReadOptions.of(load_gear(declared.gear), declared)
    own = {TAIL_NO.name: ("--tail", flags.tail), SIDE.name: ("--side", flags.side)}
    values = {column: text for column, (_, text) in own.items() if text is not None}
    labels = {column: f"{own[column][0]} {text!r}" for column, text in values.items()}
    for pair in flags.values or ():
        name, sign, text = pair.partition("=")
        if not sign or not text.strip():
            raise UsageError(
                f"--set {pair!r} is not COLUMN=VALUE",
                "Write for example --set 3=0.013in or --set outcome=FAILED.",
            )
        column = headers.column_named(name, options.joints)
        if column in values:
            raise UsageError(f"--set gives {column} twice", "Give each column once.")
        values[column] = text
        labels[column] = f"--set {pair!r}"
    known = {*values, *([CONVENTION.name] if declared.convention else [])}
    needed = {TAIL_NO.name: "--tail", SIDE.name: "--side", CONVENTION.name: "--convention"}
    missing = [flag for column, flag in needed.items() if column not in known]
    if missing:
        raise UsageError(
            f"--set needs {', '.join(missing)}",
            "Say which gear (--tail N123 --side LH) and what a clearance reading is (--convention"
            " RADIAL, DIAMETRAL or TOTAL_PLAY): it has no default.",
        )
    read = admit({RECORD_ID.name: "-", **values}, options, labels)
    if RECORD_ID.name in values:
        return read
    read = replace(read, record_id=made_record_id(read.tail_no, read.side, datetime.now()))
    if place is None:
        return read
    from mlg_troubleshoot.workflows.keep import under_a_free_id

    return under_a_free_id(read, place)


def answers_of(flags: Flags, declared: task.CheckOptions) -> Answers:
    """What the flags answer already of the questions on a terminal."""
    from mlg_troubleshoot.cli.prompts.answers import Answers
    from mlg_troubleshoot.records import ReadOptions, admit
    from mlg_troubleshoot.records.gate import NOBODY

    if flags.tail is not None:
        given = {**NOBODY, CONVENTION.name: "RADIAL", TAIL_NO.name: flags.tail}
        options = ReadOptions.of(load_gear(declared.gear), declared)
        admit(given, options, {TAIL_NO.name: f"--tail {flags.tail!r}"})
    return Answers(
        tail_no=flags.tail,
        side=declared.side,
        unit=declared.unit,
        convention=declared.convention,
    )


def unfinished(store: SessionStore, terminal: RichTerminal, gear: Gear, flags: Flags) -> Session:
    """The unfinished entry to resume: the last one, or the one of the gear that flags name."""
    from mlg_troubleshoot.cli.prompts.answers import Answers
    from mlg_troubleshoot.cli.prompts.flow import contradictions
    from mlg_troubleshoot.cli.prompts.pages import unfinished_lines

    found, damaged = store.unfinished(gear.id)
    for message in damaged:
        output.say(message)
    asked = Answers(tail_no=flags.tail, side=Side.spelt(flags.side or ""))
    named = (each for each in found if not contradictions(each.answers, asked))
    saved = next(named, None) or (None if flags.tail else store.latest())
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
    read: Inspection, answers: Answers, visit: Visit | None, gear: Gear
) -> tuple[Inspection, Visit | None]:
    """An entry that continues a kept inspection, and that inspection.

    What another window changed meanwhile stands next to what was typed here; where what it
    continues is no longer kept the entry is a new inspection.
    """
    if visit is not None and visit.record.digest == answers.continues:
        return visit.completed(read), visit
    begun = None if visit is None else visit.versions.get(answers.continues)
    if visit is None or begun is None:
        from mlg_troubleshoot.records import made_record_id

        output.say(
            "Note: the inspection that this entry continues is no longer kept: the entry is kept as"
            " a new inspection."
        )
        made = made_record_id(read.tail_no, read.side, datetime.now())
        return replace(read, record_id=made), None
    output.say(
        "Note: the inspection that this entry continues was changed meanwhile: what was entered"
        " there stands next to what was entered here."
    )
    merged = visit.answers.with_changes(begun, answers)
    return visit.completed(merged.inspection(gear, visit.record.record_id)), visit


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
