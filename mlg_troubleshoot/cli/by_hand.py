"""One gear entered by hand: by flags, or by the questions on a terminal."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from typing import TYPE_CHECKING

from mlg_troubleshoot.cli.check import Flags
from mlg_troubleshoot.decision.columns import (
    CLEARANCE,
    CONVENTION,
    OUTCOME,
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
            " RADIAL, DIAMETRAL or TOTAL_PLAY): there is no default.",
        )
    values: dict[str, object] = {RECORD_ID.name: "-", **flags.typed}
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
    from mlg_troubleshoot.cli.prompts.answers import LENGTHS

    store, terminal, gear = SessionStore(place), RichTerminal(), load_gear(declared.gear)
    saved = store.latest() if resume else None
    if resume and saved is None:
        raise UsageError("there is no unfinished entry to resume", "Start a new one: mlg check")
    typed, unit = flags.typed, declared.unit or LengthUnit.INCH
    nobody = {RECORD_ID.name: "-", TAIL_NO.name: "-", CONVENTION.name: "RADIAL"}
    judged = _judged({SIDE.name: "LH", **typed, **nobody}, {}, flags, declared)
    with_unit = {
        name: text if text[-1:].isalpha() else f"{text} {unit}"
        for name, text in typed.items()
        if name in LENGTHS
    }
    given = Answers(
        tail_no=typed.get(TAIL_NO.name),
        side=judged.side if SIDE.name in typed else None,
        unit=declared.unit,
        convention=declared.convention,
        record_id=typed.get(RECORD_ID.name),
    ).with_more(**{**typed, **with_unit, OUTCOME.name: judged.outcome})
    entry = ask_inspection(gear, terminal, store, given, saved=saved, advice=_advice(gear))
    while True:
        ending = publish(entry.inspection, entry.session.answers.unit or unit)
        now = "" if ending.report is None else _what_now(terminal)
        if now == "c":
            entry = ask_inspection(gear, terminal, store, given, saved=entry.session, correct=True)
            continue
        if now == "r" and ending.report is not None:
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
        if advice.stop and left:
            return f"{advice.text} Type done.", None
        joint = next((worth.joint for worth in advice.worth if worth.joint in left), None)
        if joint is None:
            return None
        if advice.expected is not None and joint == advice.joint:
            return f"{advice.text} Or type done.", joint
        return f"Most useful next reading: {gear.joint(joint).label}.", joint

    return advise
