"""Flags of ``mlg check`` and ``mlg study``, which have many; nothing heavy is imported here."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer

from mlg_troubleshoot.cli import history, options
from mlg_troubleshoot.cli.options import ReportFormat
from mlg_troubleshoot.gear import DEFAULT_GEAR


@dataclass(frozen=True, slots=True)
class Flags:
    """What the flags say of one gear, as it was typed."""

    values: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="JOINT=VALUE", help="One clearance, e.g. 3=0.013in."),
    ] = None
    tail: Annotated[
        str | None, typer.Option("--tail", help="Tail number, with --set or the prompts.")
    ] = None
    side: Annotated[str | None, typer.Option("--side", metavar="LH|RH", help="Which gear.")] = None
    record_id: Annotated[
        str | None, typer.Option("--record-id", help="Identifier of the record.")
    ] = None
    outcome: Annotated[
        str | None, typer.Option("--outcome", metavar="RETRACTED|FAILED", help="What the gear did.")
    ] = None
    measured: Annotated[
        str | None,
        typer.Option(
            "--measured",
            metavar="VALUE",
            help="Measured plunger displacement at mid-position, e.g. 0.041in.",
        ),
    ] = None
    margin: Annotated[
        str | None,
        typer.Option("--margin", metavar="VALUE", help="This gear's own margin, e.g. 0.028in."),
    ] = None
    restored: Annotated[
        str | None,
        typer.Option("--restored", metavar="JOINTS", help="Joints restored since, e.g. 3,5."),
    ] = None
    repair_date: Annotated[
        str | None,
        typer.Option("--repair-date", metavar="DATE", help="When, e.g. '2026-03-04 14:30'."),
    ] = None
    plunger_date: Annotated[
        str | None,
        typer.Option("--plunger-date", metavar="DATE", help="When the plunger was read."),
    ] = None
    outcome_date: Annotated[
        str | None,
        typer.Option("--outcome-date", metavar="DATE", help="When the outcome was seen."),
    ] = None
    rigging_checked: Annotated[
        str | None,
        typer.Option(
            "--rigging-checked",
            metavar="no|yes|corrected",
            help="Rigging and lock roller: looked at, or set right.",
        ),
    ] = None
    measured_again: Annotated[
        str | None,
        typer.Option("--measured-again", metavar="JOINTS", help="Read with another gauge too."),
    ] = None
    cannot_reach: Annotated[
        str | None,
        typer.Option("--cannot-reach", metavar="JOINTS", help="Joints out of reach today, e.g. 4."),
    ] = None
    no_spare: Annotated[
        str | None,
        typer.Option("--no-spare", metavar="JOINTS", help="Joints without a spare part, e.g. 3."),
    ] = None
    open_areas: Annotated[
        str | None,
        typer.Option("--open", metavar="AREAS", help="Areas that are open, e.g. sidestay."),
    ] = None
    minutes: Annotated[
        str | None,
        typer.Option("--minutes", metavar="MIN", help="Minutes left for the work today."),
    ] = None


@dataclass(frozen=True, slots=True)
class Wanted:
    """What ``mlg check`` predicts with, shows, writes and keeps."""

    report: options.Report = None
    formats: Annotated[
        list[ReportFormat] | None,
        typer.Option(
            "--format",
            metavar="html|pdf",
            parser=options.report_format,
            help="Report format, may repeat; default html and pdf. HTML is the accessible form.",
        ),
    ] = None
    page: options.Paper = None
    extension: Annotated[
        list[Path] | None,
        typer.Option(
            "--extension",
            metavar="TOML",
            help="Predict with an extension of the model; may repeat.",
        ),
    ] = None
    causes: options.Causes = None
    annotate: Annotated[
        Path | None,
        typer.Option(
            "--annotate",
            metavar="OUT.xlsx",
            help="Your workbook with bad cells marked and verdicts added.",
        ),
    ] = None
    csv: Annotated[
        Path | None,
        typer.Option("--csv", metavar="OUT.csv", help="Verdicts as a CSV, one line per gear."),
    ] = None
    resume: Annotated[
        bool, typer.Option("--resume", help="Continue the last unfinished entry.")
    ] = False
    keep: Annotated[
        bool,
        typer.Option("--keep", help="Add the inspections to the store; the prompts always do."),
    ] = False
    store: history.Place = None
    tails: Annotated[
        str | None,
        typer.Option(
            "--tails",
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
    force: options.Force = False
    show: options.Show = None
    remember: options.Remember = False
    seed: Annotated[
        int,
        typer.Option("--seed", min=0, help="Seed of the Monte Carlo check of a single gear."),
    ] = 1
    as_json: options.Json = False
    quiet: options.Quiet = False


@dataclass(frozen=True, slots=True)
class StudyFlags:
    """What ``mlg study`` computes, shows and writes."""

    gear: options.Gear = DEFAULT_GEAR
    design: Annotated[
        str,
        typer.Option(
            "--design",
            metavar="fast|sampled|tensor|lhs|lhs+ccd|ccd",
            help=(
                "fast = polynomial chaos that checks itself; sampled = Sobol points; tensor = exact"
                " reference; the others are the paper's."
            ),
        ),
    ] = "fast"
    accuracy: Annotated[float, typer.Option("--accuracy", help="Maximum error of every index.")] = (
        1e-3
    )
    seed: Annotated[int, typer.Option("--seed", min=0, help="Seed of all random draws.")] = 0
    directions: Annotated[
        str,
        typer.Option(
            "--directions", metavar="worst|over|under|random", help="Direction of the clearances."
        ),
    ] = "worst"
    fixed: Annotated[
        str | None,
        typer.Option(
            "--fixed", metavar="DEG,DEG,…", help="Directions set by a load, one per joint."
        ),
    ] = None
    distribution: Annotated[
        str,
        typer.Option(
            "--distribution",
            metavar="uniform|falling|rising|half-normal",
            help="Distribution of the clearances.",
        ),
    ] = "uniform"
    limit: Annotated[
        float | None,
        typer.Option(
            "--limit",
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
    most: Annotated[int, typer.Option("--most", min=1, help="Maximum number of evaluations.")] = (
        1 << 24
    )
    n1: Annotated[
        int | None, typer.Option("--n1", help="Repetitions of a paper design; 100 if not given.")
    ] = None
    n2: Annotated[
        int | None,
        typer.Option(
            "--n2", help="Levels of a paper design; 1000 (lhs) or 862 (lhs+ccd) if not given."
        ),
    ] = None
    iterations: Annotated[
        int | None,
        typer.Option("--iterations", help="Iterations of a paper design; 10 if not given."),
    ] = None
    workers: Annotated[
        int, typer.Option("--workers", min=1, help="Cores for the total order of lhs.")
    ] = 2
    state: Annotated[
        Path | None,
        typer.Option(
            "--state", metavar="FILE", help="Keep finished blocks here and resume from them."
        ),
    ] = None
    scheduler: Annotated[
        str | None,
        typer.Option(
            "--scheduler", metavar="ADDRESS", help="Dask cluster for the total order of lhs."
        ),
    ] = None
    csv: Annotated[
        Path | None, typer.Option("--csv", metavar="OUT.csv", help="One line per joint.")
    ] = None
    write_table: Annotated[
        bool,
        typer.Option(
            "--write-table", help="Write the table that mlg check uses, next to the gear file."
        ),
    ] = False
    given: Annotated[
        Path | None,
        typer.Option(
            "--given",
            metavar="FILE",
            help="Also estimate indices from measured inspections, without a model.",
        ),
    ] = None
    report: Annotated[
        Path | None,
        typer.Option(
            "--report",
            metavar="DIR",
            help="Write a printable report with figures, statements and bound.",
        ),
    ] = None
    page: options.Paper = None
    force: options.Force = False
    show: options.Show = None
    as_json: options.Json = False
    quiet: options.Quiet = False
