"""Flags of ``mlg check`` and ``mlg study``, which have many; nothing heavy is imported here."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

import typer

from mlg_troubleshoot.cli import options
from mlg_troubleshoot.cli.options import ReportFormat
from mlg_troubleshoot.decision.columns import (
    MARGIN,
    OUTCOME,
    PLUNGER_DISPLACEMENT,
    RECORD_ID,
    SIDE,
    TAIL_NO,
)
from mlg_troubleshoot.gear import DEFAULT_GEAR

# Flags of one gear entered by hand: what each gives to its column as it is typed, and its help.
_OF_ONE_GEAR: options.ColumnFlags = {
    TAIL_NO.name: ("--tail", None, "Tail number, with --set or the prompts."),
    SIDE.name: ("--side", "LH|RH", "Which gear."),
    RECORD_ID.name: ("--record-id", None, "Identifier of the record."),
    OUTCOME.name: ("--outcome", "RETRACTED|FAILED", "What the gear did."),
    PLUNGER_DISPLACEMENT.name: (
        "--measured",
        "VALUE",
        "Measured plunger displacement at mid-position, e.g. 0.041in.",
    ),
    MARGIN.name: ("--margin", "VALUE", "This gear's own margin, e.g. 0.028in."),
    "restored_joints": ("--restored", "JOINTS", "Joints restored since, e.g. 3,5."),
    "repair_date": ("--repair-date", "DATE", "When, e.g. '2026-03-04 14:30'."),
    "plunger_date": ("--plunger-date", "DATE", "When the plunger was read."),
    "outcome_date": ("--outcome-date", "DATE", "When the outcome was seen."),
    "rigging_checked": (
        "--rigging-checked",
        "no|yes|corrected",
        "Rigging and lock roller: looked at, or set right.",
    ),
    "cannot_reach": ("--cannot-reach", "JOINTS", "Joints out of reach today, e.g. 4."),
    "no_spare": ("--no-spare", "JOINTS", "Joints without a spare part, e.g. 3."),
    "open_areas": ("--open", "AREAS", "Areas that are open, e.g. sidestay."),
    "minutes_available": ("--minutes", "MIN", "Minutes left for the work today."),
}


@dataclass(frozen=True, slots=True)
class Flags:
    """What the flags say of one gear, as it was typed: clearances by joint, the rest by column."""

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
class Wanted(options.Output):
    """What ``mlg check`` predicts with, shows, writes and keeps."""

    formats: Annotated[
        list[ReportFormat] | None,
        typer.Option(
            "--format",
            metavar="html|pdf",
            parser=options.report_format,
            help="Report format, may repeat; default html and pdf. HTML is the accessible form.",
        ),
    ] = None
    extension: Annotated[
        list[Path] | None,
        typer.Option(
            metavar="TOML",
            help="Predict with an extension of the model; may repeat.",
        ),
    ] = None
    causes: options.Causes = None
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
            help="Whether tails that differ only in case, blanks or dashes are one aircraft.",
        ),
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
    remember: options.Remember = False
    seed: Annotated[
        int,
        typer.Option(min=0, help="Seed of the Monte Carlo check of a single gear."),
    ] = 1


@dataclass(frozen=True, slots=True)
class StudyFlags(options.Output):
    """What ``mlg study`` computes, shows and writes."""

    gear: options.Gear = DEFAULT_GEAR
    design: Annotated[
        str,
        typer.Option(
            metavar="fast|sampled|tensor|lhs|lhs+ccd|ccd",
            help=(
                "fast = polynomial chaos that checks itself; sampled = Sobol points; tensor = exact"
                " reference; the others are the paper's."
            ),
        ),
    ] = "fast"
    accuracy: Annotated[float, typer.Option(help="Maximum error of every index.")] = 1e-3
    seed: Annotated[int, typer.Option(min=0, help="Seed of all random draws.")] = 0
    directions: Annotated[
        str,
        typer.Option(metavar="worst|over|under|random", help="Direction of the clearances."),
    ] = "worst"
    fixed: Annotated[
        str | None,
        typer.Option(metavar="DEG,DEG,…", help="Directions set by a load, one per joint."),
    ] = None
    distribution: Annotated[
        str,
        typer.Option(
            metavar="uniform|falling|rising|half-normal",
            help="Distribution of the clearances.",
        ),
    ] = "uniform"
    limit: Annotated[
        float | None,
        typer.Option(
            metavar="IN",
            help="One limit in inches for all joints, instead of the gear's.",
        ),
    ] = None
    beyond_margin: Annotated[
        bool,
        typer.Option(
            "--beyond-margin",
            help="Indices of the event that the margin is exceeded, instead of the displacement.",
        ),
    ] = False
    statements: Annotated[
        bool,
        typer.Option(
            "--statements", help="Which statements of section 4.3 hold, with the numbers."
        ),
    ] = False
    bound: Annotated[
        bool,
        typer.Option(
            "--bound",
            help="Worst displacement at the limits: sequential rule, global search, proved bound.",
        ),
    ] = False
    most: Annotated[int, typer.Option(min=1, help="Maximum number of evaluations.")] = 1 << 24
    n1: Annotated[
        int | None, typer.Option(help="Repetitions of a paper design; 100 if not given.")
    ] = None
    n2: Annotated[
        int | None,
        typer.Option(help="Levels of a paper design; 1000 (lhs) or 862 (lhs+ccd) if not given."),
    ] = None
    iterations: Annotated[
        int | None,
        typer.Option(help="Iterations of a paper design; 10 if not given."),
    ] = None
    workers: Annotated[int, typer.Option(min=1, help="Cores for the total order of lhs.")] = 2
    state: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Keep finished blocks here and resume from them."),
    ] = None
    scheduler: Annotated[
        str | None,
        typer.Option(metavar="ADDRESS", help="Dask cluster for the total order of lhs."),
    ] = None
    csv: Annotated[Path | None, typer.Option(metavar="OUT.csv", help="One line per joint.")] = None
    write_table: Annotated[
        bool,
        typer.Option(
            "--write-table", help="Write the table that mlg check uses, next to the gear file."
        ),
    ] = False
    given: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="Also estimate indices from measured inspections, without a model.",
        ),
    ] = None
