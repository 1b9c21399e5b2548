"""``mlg check``. Nothing heavy is imported before it runs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, ClassVar

import typer

from mlg_troubleshoot.cli import options
from mlg_troubleshoot.cli.options import ReportFormat
from mlg_troubleshoot.decision.columns import (
    DATE,
    LANDINGS,
    MARGIN,
    OUTCOME,
    PLUNGER_DISPLACEMENT,
    RECORD_ID,
    SIDE,
    TAIL_NO,
)

EPILOG = (
    "Example: [b]mlg check inspections.xlsx --report out[/b] · one gear by hand: [b]mlg check[/b] ·"
    " scripted: [b]mlg check --tail N123 --side LH --convention RADIAL --set 3=0.013in --set"
    " 5=0.007in[/b]"
)
# Flags of one gear entered by hand: what each gives to its column as it is typed, and its help.
_OF_ONE_GEAR: options.ColumnFlags = {
    TAIL_NO.name: ("--tail", None, "Tail number, with --set or the prompts."),
    SIDE.name: ("--side", "LH|RH", "Side of the gear; with FILE, used where no column gives it."),
    RECORD_ID.name: ("--record-id", None, "Identifier of the record."),
    OUTCOME.name: ("--outcome", "RETRACTED|FAILED", "Outcome of the retraction."),
    PLUNGER_DISPLACEMENT.name: (
        "--measured",
        "VALUE",
        "Measured plunger displacement at mid-position, e.g. 0.041in.",
    ),
    MARGIN.name: ("--margin", "VALUE", "This gear's own margin, e.g. 0.028in."),
    DATE.name: ("--date", "DATE", "Date of the inspection, e.g. 2026-03-04."),
    LANDINGS.name: ("--landings", "N", "Landings since overhaul."),
    "restored_joints": ("--restored", "JOINTS", "Joints restored since, e.g. 3,5."),
    "repair_date": ("--repair-date", "DATE", "Date of that repair, e.g. '2026-03-04 14:30'."),
    "plunger_date": ("--plunger-date", "DATE", "Date of the plunger reading."),
    "outcome_date": ("--outcome-date", "DATE", "Date of the outcome."),
    "rigging_checked": (
        "--rigging-checked",
        "no|yes|corrected",
        "Rigging and lock roller: checked (yes) or corrected.",
    ),
    "measured_again": ("--measured-again", "JOINTS", "Joints measured again with another gauge."),
    "cannot_reach": ("--cannot-reach", "JOINTS", "Joints out of reach today, e.g. 4."),
    "no_spare": ("--no-spare", "JOINTS", "Joints without a spare part, e.g. 3."),
}


@dataclass(frozen=True, slots=True)
class Flags:
    """What the flags say of one gear, as it was typed: clearances by joint, the rest by column."""

    panel: ClassVar = "One gear by hand"

    values: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="JOINT=VALUE", help="One clearance, e.g. 3=0.013in."),
    ] = None
    typed: Annotated[Mapping[str, str], _OF_ONE_GEAR] = field(default_factory=dict)

    def labels(self) -> dict[str, str]:
        """What a refusal calls each column."""
        return {
            column: f"{_OF_ONE_GEAR[column][0]} {text!r}" for column, text in self.typed.items()
        }


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
    every: Annotated[
        bool,
        typer.Option(
            "--all", help="In a batch, every inspection instead of the latest of each gear."
        ),
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
            help="Inspection tables (CSV, xlsx, xls, ods), folders, or - for stdin.",
        ),
    ] = None,
    flags: Flags,
    tables: options.Tables,
    wanted: Wanted,
    _version: options.Version = False,
) -> None:
    """Check gears: clearances in, verdict and ranked joints out.

    Without FILE on a terminal it asks, joint by joint. Exit codes: 0 every gear within margin · 1
    something needs attention · 3 no row could be judged · 2 usage.
    """
    from mlg_troubleshoot.cli.check_run import Run

    raise typer.Exit(Run(files or [], flags, tables, wanted).run())


app = options.alone(check, EPILOG)
