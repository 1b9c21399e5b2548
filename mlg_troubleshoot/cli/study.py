"""``mlg study``. Nothing heavy is imported before it runs."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer

from mlg_troubleshoot.cli import options
from mlg_troubleshoot.gear import DEFAULT_GEAR

EPILOG = (
    "Example: [b]mlg study[/b] · the paper's design: [b]mlg study --design lhs[/b] · its"
    " statements: [b]mlg study --statements[/b] · the table that mlg check uses: [b]mlg study"
    " --design tensor --write-table[/b]"
)


@dataclass(frozen=True, slots=True)
class StudyFlags(options.OutputOptions):
    """What ``mlg study`` computes, shows and writes."""

    report: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR",
            help="Write a printable report with figures and statements.",
        ),
    ] = None
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
    workers: Annotated[
        int | None,
        typer.Option(min=1, help="Cores for the total order of lhs; all if not given."),
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


@options.flat
def study(flags: StudyFlags, _version: options.Version = False) -> None:
    """Recompute the sensitivity and amplification indices of every joint."""
    from mlg_troubleshoot.cli import study_run
    from mlg_troubleshoot.cli.claims import WRITE_TABLE
    from mlg_troubleshoot.gear.gear_file import load_gear

    outputs = [("--csv", flags.csv)]
    if flags.write_table:
        outputs.append((WRITE_TABLE, load_gear(flags.gear).indices_file))
    flags.claim(flags.gear, [flags.given], outputs)
    with study_run.asked(flags) as (known, wanted):
        study_run.run(known, wanted, flags)


app = options.alone(study, EPILOG)
