"""One gear entered by hand: by flags, or by the questions on a terminal."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from typing import TYPE_CHECKING

from mlg_troubleshoot.cli.flags import Flags
from mlg_troubleshoot.decision.columns import (
    CLEARANCE,
    CONVENTION,
    MARGIN,
    OUTCOME,
    PLUNGER_DISPLACEMENT,
    RECORD_ID,
    SIDE,
    TAIL_NO,
)
from mlg_troubleshoot.decision.inspection import Inspection
from mlg_troubleshoot.errors import UsageError
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.gear.gear_file import load_gear
from mlg_troubleshoot.units import LengthUnit
from mlg_troubleshoot.workflows import check as task

if TYPE_CHECKING:
    from mlg_troubleshoot.cli.prompts import RichTerminal


@dataclass(frozen=True, slots=True)
class Ending:
    """A result that was shown, and what writes its report if that was not asked for by a flag."""

    result: task.CheckResult
    report: Callable[[], None] | None


def from_flags(flags: Flags, declared: task.CheckOptions) -> Inspection:
    from mlg_troubleshoot.records import made_record_id

    needed = (("--tail", flags.tail), ("--side", flags.side), ("--convention", declared.convention))
    missing = [flag for flag, value in needed if value is None]
    if missing or flags.side is None:
        raise UsageError(
            f"--set needs {', '.join(missing)}",
            "Say which gear (--tail N123 --side LH) and what a clearance reading is (--convention"
            " RADIAL, DIAMETRAL or TOTAL_PLAY): there is no default.",
        )
    values: dict[str, object] = {
        RECORD_ID.name: flags.record_id or "-",
        TAIL_NO.name: flags.tail,
        SIDE.name: flags.side,
    }
    labels: dict[str, str] = {}
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
        values[column], labels[column] = written, f"--set {text!r}"
    read = _judged(values, labels, flags, declared)
    made = made_record_id(read.tail_no, read.side, datetime.now())
    return replace(read, record_id=flags.record_id or made)


def _day(flags: Flags) -> dict[str, str | None]:
    """What the flags say of repairs and of the day, by column."""
    return {
        "restored_joints": flags.restored,
        "repair_date": flags.repair_date,
        "plunger_date": flags.plunger_date,
        "outcome_date": flags.outcome_date,
        "rigging_checked": flags.rigging_checked,
        "measured_again": flags.measured_again,
        "cannot_reach": flags.cannot_reach,
        "no_spare": flags.no_spare,
        "open_areas": flags.open_areas,
        "minutes_available": flags.minutes,
    }


def _judged(
    values: Mapping[str, object],
    labels: Mapping[str, str],
    flags: Flags,
    declared: task.CheckOptions,
) -> Inspection:
    """Let the judge of table rows judge the flags; a refusal names the flag."""
    from mlg_troubleshoot.records import ReadOptions, admit

    more = {
        OUTCOME.name: flags.outcome,
        PLUNGER_DISPLACEMENT.name: flags.measured,
        MARGIN.name: flags.margin,
        **_day(flags),
    }
    typed = {
        RECORD_ID.name: flags.record_id,
        TAIL_NO.name: flags.tail,
        SIDE.name: flags.side,
        **more,
    }
    names = {
        TAIL_NO.name: "tail",
        PLUNGER_DISPLACEMENT.name: "measured",
        "restored_joints": "restored",
        "open_areas": "open",
        "minutes_available": "minutes",
    }
    named = {
        column: f"--{names.get(column, column).replace('_', '-')} {text!r}"
        for column, text in typed.items()
    }
    options = ReadOptions.of(load_gear(declared.gear), declared)
    return admit({**values, **more}, options, {**named, **labels})


def ask(
    flags: Flags,
    declared: task.CheckOptions,
    publish: Callable[[Inspection, LengthUnit], Ending],
    keep: Callable[[task.CheckResult], None],
    *,
    resume: bool,
    place: str | None = None,
) -> task.CheckResult:
    """Ask on the terminal and show the result; the entry stays open until it was shown and kept."""
    from mlg_troubleshoot.cli.prompts import Answers, RichTerminal, SessionStore, ask_inspection

    store, terminal, gear = SessionStore(place), RichTerminal(), load_gear(declared.gear)
    saved = store.latest() if resume else None
    if resume and saved is None:
        raise UsageError("there is no unfinished entry to resume", "Start a new one: mlg check")
    nobody = {
        RECORD_ID.name: "-",
        TAIL_NO.name: "-",
        SIDE.name: flags.side or "LH",
        CONVENTION.name: "RADIAL",
    }
    judged = _judged(nobody, {}, flags, declared)
    unit = declared.unit or LengthUnit.INCH
    lengths = {PLUNGER_DISPLACEMENT.name: flags.measured, MARGIN.name: flags.margin}
    given = Answers(
        tail_no=flags.tail,
        side=None if flags.side is None else judged.side,
        unit=declared.unit,
        convention=declared.convention,
        record_id=flags.record_id,
    ).with_more(
        outcome=judged.outcome,
        **_day(flags),
        **{
            name: text if text is None or text[-1:].isalpha() else f"{text} {unit}"
            for name, text in lengths.items()
        },
    )
    entry = ask_inspection(gear, terminal, store, given, saved=saved, advice=_advice(gear))
    while True:
        ending = publish(entry.inspection, entry.session.answers.unit or unit)
        typed = "" if ending.report is None else _what_now(terminal)
        if typed == "c":
            entry = ask_inspection(gear, terminal, store, given, saved=entry.session, correct=True)
            continue
        if typed == "r" and ending.report is not None:
            ending.report()
        keep(ending.result)
        store.finish(entry.session)
        return ending.result


def _what_now(terminal: RichTerminal) -> str:
    try:
        while True:
            typed = (
                terminal.ask(" r = write the report, c = correct an answer, Enter = done > ")
                .strip()
                .lower()
            )
            if typed in ("", "r", "c"):
                return typed
    except EOFError:
        return ""


def _advice(
    gear: Gear,
) -> Callable[[Mapping[int, float], Sequence[int]], tuple[str, int | None] | None]:
    """Say after each critical joint which reading is most useful next, or that one may stop."""

    def advise(measured: Mapping[int, float], left: Sequence[int]) -> tuple[str, int | None] | None:
        advice = task.next_joint(gear, measured)
        if advice is None:
            return None
        if advice.stop and left:
            return f"{advice.text} Type done.", None
        joint = next((worth.joint for worth in advice.worth if worth.joint in left), None)
        if joint is None:
            return None
        return f"Most useful next reading: {gear.joint(joint).label}.", joint

    return advise
