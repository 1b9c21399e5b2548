"""``mlg check``, its options. Nothing heavy is imported before it runs."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer

from mlg_troubleshoot.cli import history, options
from mlg_troubleshoot.cli.options import ReportFormat

EPILOG = (
    "Example: [b]mlg check inspections.xlsx --report out[/b] · one gear by hand: [b]mlg check[/b] · "
    "scripted: [b]mlg check --tail N123 --side LH --convention RADIAL --set 3=0.013in --set 5=0.007in[/b]"
)


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


@dataclass(frozen=True, slots=True)
class Wanted:
    """What ``mlg check`` predicts with, shows, writes and keeps."""

    report: options.Report = None
    formats: Annotated[
        list[ReportFormat] | None,
        typer.Option(
            "--format", help="Report format, may repeat; default html and pdf. pdf-ua: tagged, for screen readers."
        ),
    ] = None
    page: options.Paper = None
    extension: Annotated[
        list[Path] | None,
        typer.Option("--extension", metavar="TOML", help="Predict with an extension of the model; may repeat."),
    ] = None
    causes: options.Causes = None
    annotate: Annotated[
        Path | None,
        typer.Option("--annotate", metavar="OUT.xlsx", help="Your workbook with bad cells marked and verdicts added."),
    ] = None
    csv: Annotated[
        Path | None, typer.Option("--csv", metavar="OUT.csv", help="Verdicts as a CSV, one line a gear.")
    ] = None
    resume: Annotated[bool, typer.Option("--resume", help="Go on with the last unfinished entry.")] = False
    keep: Annotated[bool, typer.Option("--keep", help="Add the inspections to the store; the prompts always do.")] = (
        False
    )
    store: history.Place = None
    tails: Annotated[
        str | None,
        typer.Option(
            "--tails", metavar="same|apart", help="Spellings of a tail that differ in case, blanks or dashes."
        ),
    ] = None
    detail: Annotated[bool, typer.Option("--detail", help="All joints, repairs, re-rigging and the uncertainty.")] = (
        False
    )
    every: Annotated[bool, typer.Option("--all", help="A batch: every inspection, not the latest of each gear.")] = (
        False
    )
    show: options.Show = None
    remember: options.Remember = False
    seed: Annotated[
        int, typer.Option("--seed", min=0, help="Seed of the Monte Carlo draws of a gear looked at alone.")
    ] = 1
    as_json: options.Json = False
    quiet: options.Quiet = False


@options.flat
def check(
    *,
    files: Annotated[
        list[str] | None,
        typer.Argument(metavar="[FILE|-]...", help="Inspection tables (CSV, xlsx, xls, ods), folders, or - for stdin."),
    ] = None,
    flags: Flags,
    tables: options.Tables,
    wanted: Wanted,
    _repairs: Annotated[bool, typer.Option("--repairs", hidden=True, help="Always done.")] = False,
    _version: options.Version = False,
) -> None:
    """Check gears: clearances in, verdict and ranked joints out.

    Without FILE on a terminal it asks, joint by joint. Exit codes: 0 every gear within margin · 1 something needs
    attention · 3 no row could be judged · 2 usage.
    """
    from mlg_troubleshoot.cli.check_run import Run

    raise typer.Exit(Run(files or [], flags, tables, wanted).run())
