"""``mlg study``, its options. Nothing heavy is imported before it runs."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer

from mlg_troubleshoot.cli import options

EPILOG = (
    "Example: [b]mlg study[/b] · the paper's design: [b]mlg study --design lhs[/b] · its statements: "
    "[b]mlg study --statements[/b] · the table that mlg check uses: [b]mlg study --design tensor --write-table[/b]"
)


@dataclass(frozen=True, slots=True)
class StudyFlags:
    """What ``mlg study`` computes, shows and writes."""

    gear: options.Gear = options.DEFAULT_GEAR
    design: Annotated[
        str,
        typer.Option(
            "--design",
            metavar="fast|sampled|tensor|lhs|lhs+ccd|ccd",
            help="fast = polynomial chaos that checks itself; sampled = Sobol points; tensor = exact reference; "
            "the others are the paper's.",
        ),
    ] = "fast"
    accuracy: Annotated[float, typer.Option("--accuracy", help="Wanted error of every index.")] = 1e-3
    seed: Annotated[int, typer.Option("--seed", min=0, help="Seed of everything random.")] = 0
    directions: Annotated[
        str, typer.Option("--directions", metavar="worst|over|under|random", help="How the clearances are turned.")
    ] = "worst"
    fixed: Annotated[
        str | None, typer.Option("--fixed", metavar="DEG,DEG,…", help="Directions set by a load, one for each joint.")
    ] = None
    distribution: Annotated[
        str,
        typer.Option(
            "--distribution", metavar="uniform|falling|rising|half-normal", help="Distribution of the clearances."
        ),
    ] = "uniform"
    limit: Annotated[
        float | None, typer.Option("--limit", metavar="IN", help="One limit for all joints, in, for the gear's.")
    ] = None
    beyond_margin: Annotated[
        bool, typer.Option("--beyond-margin", help="Indices of exceeding the margin, not of the displacement.")
    ] = False
    statements: Annotated[
        bool, typer.Option("--statements", help="Which statements of section 4.3 hold, with the numbers.")
    ] = False
    bound: Annotated[
        bool,
        typer.Option("--bound", help="Worst displacement at the limits: sequential rule, global search, proved bound."),
    ] = False
    most: Annotated[int, typer.Option("--most", min=1, help="Evaluations to stop at.")] = 1 << 24
    n1: Annotated[int | None, typer.Option("--n1", help="Repetitions of a paper design, 100.")] = None
    n2: Annotated[int | None, typer.Option("--n2", help="Levels of a paper design, 1000 or 862.")] = None
    iterations: Annotated[int | None, typer.Option("--iterations", help="Iterations of a paper design, 10.")] = None
    workers: Annotated[int, typer.Option("--workers", min=1, help="Cores for the total order of lhs.")] = 2
    state: Annotated[
        Path | None, typer.Option("--state", metavar="FILE", help="Keep finished blocks here and resume from them.")
    ] = None
    scheduler: Annotated[
        str | None, typer.Option("--scheduler", metavar="ADDRESS", help="Dask cluster for the total order of lhs.")
    ] = None
    csv: Annotated[Path | None, typer.Option("--csv", metavar="OUT.csv", help="One line a joint.")] = None
    write_table: Annotated[
        bool, typer.Option("--write-table", help="Write the table that mlg check uses, beside the gear file.")
    ] = False
    given: Annotated[
        Path | None,
        typer.Option("--given", metavar="FILE", help="Beside them the indices of measured inspections, without model."),
    ] = None
    report: Annotated[
        Path | None,
        typer.Option("--report", metavar="DIR", help="Write a printable report with figures, statements and bound."),
    ] = None
    page: options.Paper = None
    show: options.Show = None
    as_json: options.Json = False
    quiet: options.Quiet = False


@options.flat
def study(flags: StudyFlags, _version: options.Version = False) -> None:
    """Recompute the sensitivity and amplification indices of every joint."""
    from mlg_troubleshoot.cli import study_run
    from mlg_troubleshoot.cli.remembered import settings

    shown = settings(flags.show, flags.page, {}, keep=False, quiet=flags.quiet)
    outputs = [("--csv", flags.csv), ("--state", flags.state)]
    options.keep_inputs(flags.gear, [flags.given], outputs, flags.report, writes_table=flags.write_table)
    with study_run.asked(flags) as (known, wanted):
        study_run.run(known, wanted, flags, shown)
