"""``mlg check``. Nothing heavy is imported before it runs."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, ClassVar

import typer

from mlg_troubleshoot.cli import options
from mlg_troubleshoot.cli.options import ReportFormat

EPILOG = (
    "Example: [b]mlg check inspections.xlsx --report out[/b] · one gear by hand: [b]mlg check[/b] ·"
    " scripted: [b]mlg check --tail N123 --side LH --convention RADIAL --set 3=0.013in --set"
    " 5=0.007in[/b]"
)


@dataclass(frozen=True, slots=True)
class Flags:
    """One gear that is entered by flags."""

    panel: ClassVar = "One gear by hand"

    values: Annotated[
        list[str] | None,
        typer.Option(
            "--set",
            metavar="COLUMN=VALUE",
            help=(
                "A value of any column, e.g. 3=0.013in, plunger=0.041in, outcome=FAILED,"
                " landings=4000, restored=3,5; may repeat."
            ),
        ),
    ] = None
    tail: Annotated[
        str | None, typer.Option("--tail", help="Tail number, with --set or the prompts.")
    ] = None
    side: Annotated[
        str | None,
        typer.Option(
            "--side",
            metavar="LH|RH",
            help="Side of the gear; with FILE, used where no column gives it.",
        ),
    ] = None


@dataclass(frozen=True, slots=True)
class CheckOutputs(options.OutputOptions):
    """What ``mlg check`` shows and writes."""

    panel: ClassVar = "Output"

    formats: Annotated[
        list[ReportFormat] | None,
        typer.Option(
            "--format",
            metavar="html|pdf",
            parser=options.report_format,
            help="Report format, may repeat; default html and pdf. HTML is the accessible form.",
        ),
    ] = None
    annotate: Annotated[
        Path | None,
        typer.Option(
            metavar="OUT.xlsx",
            help="Your workbook with bad cells marked and verdicts added.",
        ),
    ] = None
    csv: Annotated[
        Path | None,
        typer.Option(metavar="OUT.csv", help="Verdicts as a CSV, one line per gear."),
    ] = None
    detail: Annotated[
        bool, typer.Option("--detail", help="All joints, repairs, re-rigging and the uncertainty.")
    ] = False


@dataclass(frozen=True, slots=True)
class Wanted(CheckOutputs):
    """What ``mlg check`` predicts with, shows, writes and keeps."""

    panel: ClassVar = "This run"

    extension: Annotated[
        list[Path] | None,
        typer.Option(
            metavar="TOML",
            help="Predict with an extension of the model; may repeat.",
        ),
    ] = None
    causes: options.Causes = None
    resume: Annotated[
        bool, typer.Option("--resume", help="Continue the last unfinished entry.")
    ] = False
    keep: Annotated[
        bool,
        typer.Option("--keep", help="Add the inspections to the store; the prompts always do."),
    ] = False
    store: options.Place = None
    tails: Annotated[
        str | None,
        typer.Option(
            metavar="same|apart",
            help="Whether tails that differ only in case, blanks, dashes or O for 0 are one"
            " aircraft.",
        ),
    ] = None
    workers: Annotated[
        int | None,
        typer.Option(min=1, help="Processor cores for more than 512 rows; all if not given."),
    ] = None


@options.flat
def check(
    *,
    files: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="[FILE|-]...",
            help="Inspection tables (CSV, xlsx, xls), folders, or - for stdin.",
        ),
    ] = None,
    flags: Flags,
    tables: options.Tables,
    wanted: Wanted,
) -> None:
    """Check gears: clearances in, verdict and ranked joints out.

    Without FILE on a terminal it asks, joint by joint. Exit codes: 0 every gear within margin · 1
    something needs attention · 3 no row could be judged · 2 usage.
    """
    from mlg_troubleshoot.cli.check_run import Run

    raise typer.Exit(Run(files or [], flags, tables, wanted).run())


app = options.alone(check, EPILOG)
