"""``mlg study``. Nothing heavy is imported before it runs."""

from __future__ import annotations

import os
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated

import typer

from mlg_troubleshoot.cli import options, output
from mlg_troubleshoot.errors import UsageError
from mlg_troubleshoot.gear import DEFAULT_GEAR

EPILOG = (
    "Example: mlg study; the paper's design: mlg study --design lhs; the table"
    " that mlg check uses: mlg study --write-table"
)


@dataclass(frozen=True, slots=True)
class StudyFlags:
    """What ``mlg study`` computes and writes."""

    gear: options.Gear = DEFAULT_GEAR
    design: Annotated[
        str,
        typer.Option(
            metavar="tensor|lhs|lhs+ccd|ccd",
            help="tensor = exact; the others are the paper's.",
        ),
    ] = "tensor"
    seed: Annotated[int, typer.Option(min=0, help="Seed of all random draws.")] = 0
    size: Annotated[
        str | None,
        typer.Option(
            metavar="N1,N2,ITERATIONS",
            help="Size of a paper design; 100,1000,10 (lhs) or 100,862,10 if not given.",
        ),
    ] = None
    workers: Annotated[
        int | None,
        typer.Option(min=1, help="Cores for the total order of lhs; all if not given."),
    ] = None
    csv: Annotated[Path | None, typer.Option(metavar="OUT.csv", help="One line per joint.")] = None
    figure: Annotated[
        Path | None, typer.Option(metavar="OUT.svg", help="A picture of the indices of all joints.")
    ] = None
    write_table: Annotated[
        bool,
        typer.Option(
            "--write-table", help="Write the table that mlg check uses, next to the gear file."
        ),
    ] = False
    as_json: options.Json = False
    force: options.Force = False


@options.flat
def study(flags: StudyFlags) -> None:
    """Recompute the sensitivity and amplification indices of every joint."""
    from mlg_troubleshoot.cli.output import claim, stages
    from mlg_troubleshoot.gear.gear_file import load_gear
    from mlg_troubleshoot.paper.study import StudyDesign, StudyOptions
    from mlg_troubleshoot.workflows import study as task

    gear = load_gear(flags.gear)
    table = gear.indices_file if flags.write_table else None
    # The table may be written again, unless it is the gear file that is named so.
    kept = {*gear.files} - ({gear.indices_file} - {gear.path})
    outputs = [("--csv", flags.csv), ("--figure", flags.figure), ("--write-table", table)]
    claim(None, kept, outputs, force=flags.force)
    design = options.one_of(StudyDesign, flags.design.lower(), "--design")
    n1, n2, iterations = _size(flags.size)
    with ExitStack() as processes, stages(quiet=False) as progress:
        executor = None
        count = flags.workers or os.cpu_count() or 1
        if design is StudyDesign.LHS and count > 1:
            from mlg_troubleshoot.workers import WorkerProcesses

            executor = processes.enter_context(WorkerProcesses(count))
        asked = StudyOptions(design, flags.seed, n1=n1, n2=n2, iterations=iterations)
        if flags.write_table:
            task.refuse_other_tables(asked)
        findings = task.run_study(gear, replace(asked, executor=executor), progress)
    if flags.as_json:
        output.write_json(findings)
    else:
        rows = [*zip(gear.joints, findings.table.joints, strict=True)]
        output.show_page("study", output.console(), f=findings, rows=rows)
    if flags.csv is not None:
        task.write_study_csv(findings, flags.csv)
    if flags.figure is not None:
        findings.plot().save(flags.figure)
    if table is not None:
        task.write_study_table(findings)
        output.say(f"Table written: {table}")


def _size(text: str | None) -> Sequence[int | None]:
    if text is None:
        return None, None, None
    try:
        n1, n2, iterations = map(int, text.split(","))
    except ValueError:
        raise UsageError(
            f"size {text!r}", "Give N1,N2,ITERATIONS, for example 100,1000,10."
        ) from None
    return n1, n2, iterations


app = options.alone(study, EPILOG)
