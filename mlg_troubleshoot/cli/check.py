"""``mlg check``. Nothing heavy is imported before it runs."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer

from mlg_troubleshoot.cli import options
from mlg_troubleshoot.cli.options import ReportFormat

EPILOG = (
    "Examples: mlg check; mlg check N123AB LH; mlg check a.xlsx --report out; mlg"
    " check --tail N123 --side LH --convention RADIAL --set 3=0.013in --set outcome=FAILED"
)
# What --help shows; --help-all shows every option.
COMMON = (
    *("files", "values", "tail", "side", "unit", "convention"),
    *("report", "csv", "annotate", "as_json", "keep", "help"),
)


@dataclass(frozen=True, slots=True)
class Flags:
    """One gear that is entered by flags."""

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
class Wanted(options.Shown):
    """What ``mlg check`` predicts with, shows, writes and keeps."""

    formats: Annotated[
        list[ReportFormat] | None,
        typer.Option(
            "--format",
            metavar="html|pdf",
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
        typer.Option(metavar="OUT.csv", help="Verdicts as a CSV, one line per row."),
    ] = None
    detail: Annotated[
        bool, typer.Option("--detail", help="All joints, repairs and the uncertainty.")
    ] = False
    extension: Annotated[
        list[Path] | None,
        typer.Option(
            metavar="TOML",
            help="Predict with an extension of the model; may repeat.",
        ),
    ] = None
    causes: options.Causes = None
    keep: Annotated[
        bool,
        typer.Option("--keep", help="Add the inspections to the store; the prompts always do."),
    ] = False
    amend: Annotated[
        bool | None,
        typer.Option(
            "--amend/--keep-old",
            help="With --keep: take the cells of a table that changed, or leave what is kept.",
        ),
    ] = None
    store: options.Place = None


@options.flat
def check(
    *,
    files: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="[FILE|-]... | TAIL SIDE",
            help="Inspection tables (CSV, xlsx, xls), folders, or - for stdin; or one gear.",
        ),
    ] = None,
    flags: Flags,
    tables: options.Tables,
    wanted: Wanted,
) -> None:
    """Check gears: clearances in, verdict and ranked joints out.

    Without FILE it asks for one gear. Exit codes: 0 every gear within margin; 1 something needs
    attention; 3 no row could be judged; 2 usage.
    """
    from mlg_troubleshoot.cli.check_run import Run

    raise typer.Exit(Run(files or [], flags, tables, wanted).run())


app = options.alone(
    check,
    f"{EPILOG}; All options: mlg check --help-all; Defaults from the environment: MLG_UNIT,"
    " MLG_CONVENTION, MLG_SHOW, MLG_PAGE, MLG_GEAR, MLG_STORE; MLG_PLAIN=1 for plain text",
)
