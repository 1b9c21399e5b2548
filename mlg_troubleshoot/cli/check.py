"""``mlg check``: clearances in, verdict and ranked joints out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import astuple, dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from mlg_troubleshoot.cli import history, options, output
from mlg_troubleshoot.cli.options import ReportFormat
from mlg_troubleshoot.errors import UsageError
from mlg_troubleshoot.units import LengthUnit

if TYPE_CHECKING:
    from mlg_troubleshoot.cli import by_hand
    from mlg_troubleshoot.cli.remembered import Settings
    from mlg_troubleshoot.decision.inspection import Inspection
    from mlg_troubleshoot.store import Store
    from mlg_troubleshoot.workflows import check as task

EPILOG = (
    "Example: [b]mlg check inspections.xlsx --report out[/b] · one gear by hand: [b]mlg check[/b] · "
    "scripted: [b]mlg check --tail N123 --side LH --convention RADIAL --set 3=0.013in --set 5=0.007in[/b]"
)
Files = Annotated[
    list[str] | None,
    typer.Argument(metavar="[FILE|-]...", help="Inspection tables (CSV, xlsx, xls, ods), folders, or - for stdin."),
]
Formats = Annotated[
    list[ReportFormat] | None,
    typer.Option(
        "--format", help="Report format, may repeat; default html and pdf. pdf-ua: tagged, for screen readers."
    ),
]
Repairs = Annotated[bool, typer.Option("--repairs", hidden=True, help="Always done.")]
Extensions = Annotated[
    list[Path] | None,
    typer.Option("--extension", metavar="TOML", help="Predict with an extension of the model; may repeat."),
]
Annotate = Annotated[
    Path | None,
    typer.Option("--annotate", metavar="OUT.xlsx", help="Your workbook with bad cells marked and verdicts added."),
]
Csv = Annotated[Path | None, typer.Option("--csv", metavar="OUT.csv", help="Verdicts as a CSV, one line a gear.")]
Resume = Annotated[bool, typer.Option("--resume", help="Go on with the last unfinished entry.")]
Keep = Annotated[bool, typer.Option("--keep", help="Add the inspections to the store; the prompts always do.")]
Tails = Annotated[
    str | None,
    typer.Option("--tails", metavar="same|apart", help="Spellings of a tail that differ in case, blanks or dashes."),
]
Detail = Annotated[bool, typer.Option("--detail", help="All joints, repairs, re-rigging and the uncertainty.")]
Every = Annotated[bool, typer.Option("--all", help="A batch: every inspection, not the latest of each gear.")]
Seed = Annotated[int, typer.Option("--seed", min=0, help="Seed of the Monte Carlo draws of a gear looked at alone.")]


@dataclass(frozen=True, slots=True)
class Flags:
    """What the flags say of one gear, as it was typed."""

    values: Annotated[
        list[str] | None, typer.Option("--set", metavar="JOINT=VALUE", help="One clearance, e.g. 3=0.013in.")
    ] = None
    tail: Annotated[str | None, typer.Option("--tail", help="Tail number, with --set or the prompts.")] = None
    side: Annotated[str | None, typer.Option("--side", metavar="LH|RH", help="Which gear.")] = None
    record_id: Annotated[str | None, typer.Option("--record-id", help="Identity of the record.")] = None
    outcome: Annotated[str | None, typer.Option("--outcome", metavar="RETRACTED|FAILED", help="What the gear did.")] = (
        None
    )
    measured: Annotated[
        str | None,
        typer.Option(
            "--measured", metavar="VALUE", help="Measured plunger displacement at mid-position, e.g. 0.041in."
        ),
    ] = None
    margin: Annotated[
        str | None, typer.Option("--margin", metavar="VALUE", help="This gear's own margin, e.g. 0.028in.")
    ] = None


@options.flat
def check(
    *,
    files: Files = None,
    flags: Flags,
    tables: options.Tables,
    report: options.Report = None,
    formats: Formats = None,
    page: options.Paper = None,
    _repairs: Repairs = False,
    extension: Extensions = None,
    causes: options.Causes = None,
    annotate: Annotate = None,
    csv: Csv = None,
    resume: Resume = False,
    keep: Keep = False,
    store: history.Place = None,
    tails: Tails = None,
    detail: Detail = False,
    every: Every = False,
    show: options.Show = None,
    remember: options.Remember = False,
    seed: Seed = 1,
    as_json: options.Json = False,
    quiet: options.Quiet = False,
    _version: options.Version = False,
) -> None:
    """Check gears: clearances in, verdict and ranked joints out.

    Without FILE on a terminal it asks, joint by joint. Exit codes: 0 every gear within margin · 1 something needs
    attention · 3 no row could be judged · 2 usage.
    """
    from mlg_troubleshoot.cli import by_hand
    from mlg_troubleshoot.cli.remembered import settings
    from mlg_troubleshoot.store import Store
    from mlg_troubleshoot.workflows import check as task
    from mlg_troubleshoot.workflows.diagnose import load_model_extension

    given = files or []
    if annotate is not None and (len(given) != 1 or given[0] == "-"):
        raise UsageError("--annotate needs exactly one workbook", "Give one .xlsx FILE.")
    if formats and report is None:
        output.say("Note: --format is for reports: without --report DIR none is written.")
    inputs = [*given, *(extension or ()), *(causes or ())]
    options.keep_inputs(tables.gear, inputs, [("--csv", csv), ("--annotate", annotate)], report)
    shown = settings(show, page, tables.columns, keep=remember, quiet=quiet)
    asked = task.CheckOptions(
        **tables.declared(shown.headers),
        remembered=shown.note or None,
        seed=seed,
        extension=load_model_extension(extension or (), tables.gear, causes or ()),
    )
    reader_unit = shown.show if show or shown.show is not LengthUnit.INCH else None

    place = Store(store) if keep or not (given or flags.values) else None
    kept = partial(_keep, asked=asked, place=place, tails=tails, quiet=quiet)

    def publish(result: task.CheckResult, entered_in: LengthUnit = LengthUnit.INCH) -> None:
        if as_json:
            from mlg_troubleshoot.reporting.json_form import check_as_json, check_json_pieces

            found = (result.gear, result.judgements, result.problems, result.notes, result.seed)
            output.write_json(check_json_pieces(*found) if len(result.judgements) > 1 else check_as_json(*found))
        else:
            _show(result, reader_unit or entered_in, detail=detail, every=every, quiet=quiet)
        if csv is not None:
            task.write_verdicts(result, csv)
        if annotate is not None:
            _annotate(Path(given[0]), annotate, result, quiet=quiet)
        if report is not None:
            seen = replace(shown, show=reader_unit or entered_in)
            _write_reports(result, asked, report, formats, seen, place, quiet=quiet)

    def publish_entry(inspection: Inspection, entered_in: LengthUnit) -> by_hand.Ending:
        result = task.check_inspection(inspection, asked)
        publish(result, entered_in)
        if report is not None or as_json:
            return by_hand.Ending(result, None)
        seen = replace(shown, show=reader_unit or entered_in)
        write = partial(_write_reports, result, asked, Path("report"), formats, seen, place, quiet=quiet)
        return by_hand.Ending(result, write)

    if given or flags.values:
        result = _result(given, flags, asked, quiet=quiet)
        publish(result)
        kept(result)
    else:
        if not output.can_ask():
            raise UsageError(
                "nothing to check: no FILE was given, and this is not a terminal to ask on",
                "Pass a FILE, - for standard input, or --set JOINT=VALUE with --tail, --side and --convention.",
            )
        result = by_hand.ask(flags, asked, publish_entry, kept, resume=resume, place=store)
    if result.problems and not as_json and not result.judgements:
        output.say("No row could be judged.")
    raise typer.Exit(result.exit_code)


def _keep(
    result: task.CheckResult, asked: task.CheckOptions, place: Store | None, tails: str | None, *, quiet: bool
) -> None:
    """Add what was judged to a store, if there is one."""
    if place is None:
        return
    from mlg_troubleshoot.workflows.history import keep

    if tails not in (None, "same", "apart"):
        raise UsageError(f"--tails {tails!r} is not same or apart", "Give same (one aircraft) or apart (two).")
    same_tail = history.ask_tail if output.can_ask() else None
    added = keep(result, asked, place, same_tail if tails is None else lambda _new, _kept: tails == "same")
    if not quiet:
        output.say(f"Kept in {place.place}: {added.new} new records, {added.known} known already.")


def _result(files: Sequence[str], flags: Flags, asked: task.CheckOptions, *, quiet: bool) -> task.CheckResult:
    from mlg_troubleshoot.cli import by_hand
    from mlg_troubleshoot.cli.progress import stages
    from mlg_troubleshoot.workflows import check as task

    if files and any(astuple(flags)):
        raise UsageError(
            "--set, --tail, --side, --record-id, --outcome, --measured and --margin describe one gear entered by "
            "hand, and a FILE was given as well",
            "Give either a FILE or the values of one gear.",
        )
    if not files:
        return task.check_inspection(by_hand.from_flags(flags, asked), asked)
    with stages(quiet=quiet) as bar:
        return task.check_files(
            [Path(name) for name in files],
            asked,
            on_read=partial(bar, "Reading"),
            on_judged=partial(bar, "Judging"),
        )


def _show(result: task.CheckResult, unit: LengthUnit, *, detail: bool, every: bool, quiet: bool) -> None:
    from mlg_troubleshoot.cli.views import batch, notes, one_gear
    from mlg_troubleshoot.workflows import check as task

    if not quiet:
        notes.show_notes(result.notes)
    notes.show_problems(result.problems)
    screen = output.console(unit=unit)
    if len(result.judgements) == 1:
        one_gear.show(result.judgements[0], result.gear, screen, detail=detail)
    elif result.judgements:
        batch.show(result, screen, every=every)
        both = task.before_and_after(result.judgements)
        if both is not None:
            batch.show_before_and_after(*both, screen)


def _annotate(workbook: Path, out: Path, result: task.CheckResult, *, quiet: bool) -> None:
    from mlg_troubleshoot.workflows import check as task

    if result.read is not None and not result.read.layouts:
        output.say(f"{out} was not written: no table was found to annotate.")
        return
    for loss in task.annotate(result, workbook, out):
        output.say(f"Note: {loss}.")
    if not quiet:
        output.say(f"Annotated workbook: {out}")


def _write_reports(
    result: task.CheckResult,
    asked: task.CheckOptions,
    directory: Path,
    formats: Sequence[ReportFormat] | None,
    shown: Settings,
    place: Store | None,
    *,
    quiet: bool,
) -> None:
    from mlg_troubleshoot.cli.progress import stages
    from mlg_troubleshoot.workflows import check as task
    from mlg_troubleshoot.workflows.history import seen_before

    before = [] if place is None else seen_before(result.judgements, place)
    wanted = tuple(str(f) for f in formats or (ReportFormat.HTML, ReportFormat.PDF))
    with stages(quiet=quiet) as bar:
        written = task.write_reports(
            result,
            asked,
            directory,
            wanted,
            str(shown.page),
            on_written=partial(bar, "Writing reports"),
            unit=shown.show,
            before=before,
        )
    output.say_written(written, quiet=quiet)
