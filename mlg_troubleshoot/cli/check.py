"""``mlg check``: where the inspections come from, and what is shown of the judgements."""

from __future__ import annotations

import io
import json
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from pathlib import Path
from typing import BinaryIO

import typer

from mlg_troubleshoot import workflows
from mlg_troubleshoot.decision.inspection import DEFAULT_GAUGE_U_IN, EnteredClearance, Inspection, Outcome, Side
from mlg_troubleshoot.errors import OutputError, UsageError
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.gear.gear_file import load_gear
from mlg_troubleshoot.units import (
    ClearanceConvention,
    LengthUnit,
    WrittenLength,
    parse_length,
    parse_signed_length,
)


@dataclass(frozen=True, slots=True)
class CheckArguments:
    """The flags of ``mlg check``, parsed but not judged."""

    files: tuple[str, ...]
    values: tuple[str, ...]
    tail: str | None
    side: str | None
    record_id: str | None
    outcome: str | None
    measured: str | None
    margin: str | None
    gear: str
    unit: LengthUnit | None
    convention: ClearanceConvention | None
    sheet: str | None
    column_map: tuple[str, ...]
    decimal_comma: bool
    report: Path | None
    formats: tuple[str, ...]
    page: str
    repairs: bool
    extension: tuple[Path, ...]
    causes: tuple[Path, ...]
    annotate: Path | None
    csv: Path | None
    resume: bool
    as_json: bool
    quiet: bool


def run(arguments: CheckArguments) -> None:
    """Run the command and leave with the exit code of the contract.

    Parameters
    ----------
    arguments : CheckArguments
        The flags.
    """
    if arguments.annotate is not None and (len(arguments.files) != 1 or arguments.files[0] == "-"):
        raise UsageError("--annotate needs exactly one workbook", "Give one .xlsx FILE.")
    options = workflows.CheckOptions(
        gear=arguments.gear,
        unit=arguments.unit,
        convention=arguments.convention,
        sheet=arguments.sheet,
        column_map=columns_by_header(arguments.column_map),
        decimal_comma=arguments.decimal_comma,
        repairs=True if arguments.repairs else None,
        extension=workflows.load_model_extension(arguments.extension, arguments.gear, arguments.causes),
    )
    result = _result(arguments, options)
    _show(arguments, result)
    if arguments.csv is not None:
        workflows.write_verdicts(result, arguments.csv)
    if arguments.annotate is not None:
        _annotate(arguments, arguments.annotate, result)
    if arguments.report is not None:
        _write_reports(arguments, options, result)
    if result.problems and not arguments.as_json and not result.judgements:
        typer.echo("No row could be judged.", err=True)
    raise typer.Exit(result.exit_code)


def _result(arguments: CheckArguments, options: workflows.CheckOptions) -> workflows.CheckResult:
    single = (
        arguments.values,
        arguments.tail,
        arguments.side,
        arguments.record_id,
        arguments.outcome,
        arguments.measured,
        arguments.margin,
    )
    if arguments.files:
        if any(single):
            raise UsageError(
                "--set, --tail, --side, --record-id, --outcome, --measured and --margin describe one gear entered by "
                "hand, and a FILE was given as well",
                "Give either a FILE or the values of one gear.",
            )
        return _from_files(arguments, options)
    if arguments.values:
        return workflows.check_inspection(_from_flags(arguments, load_gear(arguments.gear)), options)
    if not (sys.stdin.isatty() and sys.stderr.isatty()):
        raise UsageError(
            "nothing to check: no FILE was given, and this is not a terminal to ask on",
            "Pass a FILE, - for standard input, or --set JOINT=VALUE with --tail, --side and --convention.",
        )
    return workflows.check_inspection(_from_prompts(arguments, load_gear(arguments.gear)), options)


def columns_by_header(pairs: Sequence[str]) -> dict[str, str]:
    """Read what ``--map`` was given.

    Parameters
    ----------
    pairs : sequence of str
        ``HEADER=COLUMN`` each.

    Returns
    -------
    dict of str to str
        Columns by header.

    Raises
    ------
    UsageError
        If one of them is no such pair.
    """
    mapped = {}
    for pair in pairs:
        header, sign, column = pair.rpartition("=")
        if not sign or not header.strip() or not column.strip():
            raise UsageError(
                f"--map {pair!r} is not HEADER=COLUMN", "Write for example --map 'Spiel 3=clearance_3_mm'."
            )
        mapped[header.strip()] = column.strip()
    return mapped


def _from_files(arguments: CheckArguments, options: workflows.CheckOptions) -> workflows.CheckResult:
    sources: list[Path | BinaryIO] = []
    for name in arguments.files:
        if name == "-":
            sources.append(io.BytesIO(sys.stdin.buffer.read()))
        else:
            sources.append(Path(name))
    from mlg_troubleshoot.cli.progress import stages

    with stages(quiet=arguments.quiet) as bar:
        return workflows.check_files(
            sources,
            options,
            on_read=lambda done, total: bar("Reading", done, total),
            on_judged=lambda done, total: bar("Judging", done, total),
        )


def _from_flags(arguments: CheckArguments, gear: Gear) -> Inspection:
    missing = [
        flag
        for flag, value in (
            ("--tail", arguments.tail),
            ("--side", arguments.side),
            ("--convention", arguments.convention),
        )
        if value is None
    ]
    if missing or arguments.tail is None or arguments.side is None or arguments.convention is None:
        raise UsageError(
            f"--set needs {', '.join(missing)}",
            "Say which gear (--tail N123 --side LH) and what a clearance reading is (--convention RADIAL, DIAMETRAL "
            "or TOTAL_PLAY): there is no default.",
        )
    if not arguments.tail.strip():
        raise UsageError("--tail is empty", "Give the tail number of the aircraft.")
    clearances: dict[int, float] = {}
    entered: dict[int, EnteredClearance] = {}
    for text in arguments.values:
        number, radial, reading = _one_value(text, arguments, gear, arguments.convention)
        if number in clearances:
            raise UsageError(f"--set gives joint {number} twice", "Give each joint once.")
        clearances[number], entered[number] = radial, reading
    return Inspection(
        record_id=arguments.record_id or f"{arguments.tail}-{_side(arguments.side)}-{datetime.now():%Y%m%dT%H%M%S}",
        tail_no=arguments.tail,
        side=_side(arguments.side),
        convention=arguments.convention,
        clearance_in=clearances,
        entered=entered,
        gauge_u_in=DEFAULT_GAUGE_U_IN / arguments.convention.per_radial,
        readings_in=_readings(arguments, gear),
        margin_in=_margin(arguments, gear),
        outcome=_outcome(arguments.outcome),
        warnings=tuple(
            _confirm(gear, number, value) for number, value in clearances.items() if value > gear.confirm_above.value
        ),
    )


def _confirm(gear: Gear, number: int, value: float) -> str:
    return (
        f"Joint #{number}: {value:.4f} in radial is above {gear.confirm_above.value:g} in. "
        "Check the reading, its unit and its convention."
    )


def _one_value(
    text: str, arguments: CheckArguments, gear: Gear, convention: ClearanceConvention
) -> tuple[int, float, EnteredClearance]:
    name, sign, written = text.partition("=")
    if not sign or not name.strip().lstrip("#").isdecimal():
        raise UsageError(f"--set {text!r} is not JOINT=VALUE", "Write for example --set 3=0.013in.")
    number = int(name.strip().lstrip("#"))
    if number not in gear.joint_numbers:
        raise UsageError(
            f"--set {text!r}: {gear.name} has no joint {number}",
            f"Its joints are {_numbers(gear.joint_numbers)}.",
        )
    length, inches = _length(f"--set {text!r}", written, arguments.unit, parse_length)
    radial = inches / convention.per_radial
    if radial > gear.hard_limit.value:
        raise UsageError(
            f"--set {text!r}: {radial:.4f} in radial is above {gear.hard_limit.value:g} in, which no joint can have",
            "Check the unit (mm entered as inch is a factor 25.4), the decimal point and the convention.",
        )
    unit = length.unit or arguments.unit or LengthUnit.INCH
    return number, radial, EnteredClearance(length.text, unit)


def _numbers(numbers: tuple[int, ...]) -> str:
    return ", ".join(str(n) for n in numbers)


def _side(text: str) -> Side:
    try:
        return Side(text.strip().upper())
    except ValueError:
        raise UsageError(f"--side {text!r} is not LH or RH", "Give LH or RH.") from None


def _outcome(text: str | None) -> Outcome | None:
    if text is None:
        return None
    try:
        return Outcome(text.strip().upper())
    except ValueError:
        raise UsageError(f"--outcome {text!r} is not RETRACTED or FAILED", "Give RETRACTED or FAILED.") from None


def _length(
    option: str, text: str, unit: LengthUnit | None, parse: Callable[[str], WrittenLength]
) -> tuple[WrittenLength, float]:
    """Read the length of an option; what is wrong with it is said with the option."""
    try:
        length = parse(text)
        return length, length.inches(unit)
    except UsageError as error:
        raise UsageError(f"{option}: {error.message}", error.remedy) from None


def _readings(arguments: CheckArguments, gear: Gear) -> tuple[float, ...]:
    if arguments.measured is None:
        return ()
    option = f"--measured {arguments.measured!r}"
    _written, value = _length(option, arguments.measured, arguments.unit, parse_signed_length)
    most = workflows.read_options(gear, workflows.CheckOptions()).plunger_hard_max_in
    if abs(value) > most:
        raise UsageError(f"{option} is more than {most:g} in, farther than the plunger can go", "Check its unit.")
    return (value,)


def _margin(arguments: CheckArguments, gear: Gear) -> float | None:
    if arguments.margin is None:
        return None
    option = f"--margin {arguments.margin!r}"
    _written, value = _length(option, arguments.margin, arguments.unit, parse_length)
    most = workflows.read_options(gear, workflows.CheckOptions()).plunger_hard_max_in
    if not 0.0 < value <= most:
        raise UsageError(f"{option} is not above 0 and up to {most:g} in", "Check its unit.")
    return value


def _from_prompts(arguments: CheckArguments, gear: Gear) -> Inspection:
    from mlg_troubleshoot.cli.prompts import Preset, RichTerminal, SessionStore, ask_inspection

    store = SessionStore()
    saved = store.latest() if arguments.resume else None
    if arguments.resume and saved is None:
        raise UsageError("there is no unfinished entry to resume", "Start a new one: mlg check")
    preset = Preset(
        tail_no=arguments.tail,
        side=None if arguments.side is None else _side(arguments.side),
        unit=arguments.unit,
        convention=arguments.convention,
        record_id=arguments.record_id,
    )
    outcome, readings, margin = _outcome(arguments.outcome), _readings(arguments, gear), _margin(arguments, gear)
    asked = ask_inspection(gear, RichTerminal(), store, preset, saved=saved, advice=_advice(gear))
    return replace(
        asked,
        outcome=asked.outcome or outcome,
        readings_in=asked.readings_in or readings,
        margin_in=margin if asked.margin_in is None else asked.margin_in,
    )


def _advice(gear: Gear) -> Callable[[Mapping[int, float], Sequence[int]], str | None]:
    """Say after each critical joint which one is worth most next, or that one may stop."""

    def advise(measured: Mapping[int, float], left: Sequence[int]) -> str | None:
        advice = workflows.next_joint(gear, measured)
        if advice.stop and left:
            return f"{advice.text} Type done."
        joint = next((worth.joint for worth in advice.worth if worth.joint in left), None)
        if joint is None:
            return None
        if advice.expected is not None and joint == advice.joint:
            return f"{advice.text} Type #{joint}, or done."
        return f"Worth most next: {gear.joint(joint).label} (type #{joint})."

    return advise


def _show(arguments: CheckArguments, result: workflows.CheckResult) -> None:
    if arguments.as_json:
        from mlg_troubleshoot.cli import output
        from mlg_troubleshoot.reporting.json_form import check_as_json, check_json_pieces

        found = (result.gear, result.judgements, result.problems, result.notes)
        if len(result.judgements) > 1:
            output.write_pieces(check_json_pieces(*found))
        else:
            output.write(json.dumps(check_as_json(*found), allow_nan=False, ensure_ascii=False, indent=1))
        return
    from mlg_troubleshoot.cli import views

    if not arguments.quiet:
        views.show_notes(result.notes)
    views.show_problems(result.problems)
    if len(result.judgements) == 1:
        views.show_one(result.judgements[0], result.gear)
    elif result.judgements:
        views.show_batch(result)
        both = workflows.before_and_after(result.judgements)
        if both is not None:
            views.show_before_and_after(*both)


def _annotate(arguments: CheckArguments, out: Path, result: workflows.CheckResult) -> None:
    if result.read is not None and not result.read.layouts:
        typer.echo(f"{out} was not written: no table was found to annotate.", err=True)
        return
    for loss in workflows.annotate(result, Path(arguments.files[0]), out):
        typer.echo(f"Note: {loss}.", err=True)
    if not arguments.quiet:
        typer.echo(f"Annotated workbook: {out}", err=True)


def _write_reports(arguments: CheckArguments, options: workflows.CheckOptions, result: workflows.CheckResult) -> None:
    from mlg_troubleshoot.cli.progress import stages

    if arguments.report is None:
        return
    with stages(quiet=arguments.quiet) as bar:
        written = workflows.write_reports(
            result,
            options,
            arguments.report,
            arguments.formats,
            arguments.page,
            on_written=lambda done, total: bar("Writing reports", done, total),
        )
    notes = dict.fromkeys(note for report in written for note in report.notes)
    for note in notes:
        typer.echo(f"Note: {note}", err=True)
    files = [path for report in written for path in report.files]
    if not files:
        raise OutputError("no report could be written", "See the notes above.")
    if not arguments.quiet:
        if len(files) <= 4:
            for path in files:
                typer.echo(f"Report: {path}", err=True)
        else:
            typer.echo(f"Reports: {len(files)} files in {arguments.report}, first {files[0].name}", err=True)
