"""``mlg study``: reads what the command line asks for, calls the study, shows it."""

from __future__ import annotations

import os
from collections.abc import Iterator
from concurrent.futures import Executor
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import fields, replace

import numpy as np
import typer

from mlg_troubleshoot.cli import options, output
from mlg_troubleshoot.cli.progress import stages
from mlg_troubleshoot.cli.study import StudyFlags
from mlg_troubleshoot.errors import ExitCode, UsageError
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.gear.gear_file import load_gear
from mlg_troubleshoot.paper.study import (
    Directions,
    StudyDesign,
    StudyOptions,
)
from mlg_troubleshoot.paper.targets import targets_file
from mlg_troubleshoot.workflows import study as task

# Bar of the largest first-order index. [characters]
_LONGEST_BAR = 50


@contextmanager
def asked(flags: StudyFlags) -> Iterator[tuple[Gear, StudyOptions]]:
    """Read what the flags ask of the study itself, and hold its processes while it runs."""
    known = load_gear(flags.gear)
    fixed = None
    if flags.fixed is not None:
        try:
            fixed = np.radians([float(part) for part in flags.fixed.split(",")])
        except ValueError:
            raise UsageError(
                f"directions {flags.fixed!r}",
                "Give degrees separated by commas, one per joint.",
            ) from None
    plain = {
        each.name: getattr(flags, each.name)
        for each in fields(StudyOptions)
        if hasattr(flags, each.name)
    }
    read = {
        "design": options.one_of(StudyDesign, flags.design.lower(), "--design"),
        "directions": (
            options.one_of(Directions, flags.directions.lower(), "--directions")
            if fixed is None
            else Directions.FIXED
        ),
        "fixed_rad": fixed,
        "limits_in": None if flags.limit is None else np.full(len(known.joints), flags.limit),
    }
    with _workers(flags) as executor:
        yield known, StudyOptions(**{**plain, **read, "executor": executor})


def _workers(flags: StudyFlags) -> AbstractContextManager[Executor | None]:
    count = flags.workers or os.cpu_count() or 1
    if count == 1 or flags.design.lower() != StudyDesign.LHS:
        return nullcontext()
    from mlg_troubleshoot.workers import WorkerProcesses

    return WorkerProcesses(count)


def run(gear: Gear, options: StudyOptions, flags: StudyFlags) -> None:
    """Run a study and show, write and return what was asked for; exit 130 if it was interrupted."""
    wants_report = flags.report is not None
    given = None if flags.given is None else task.given_data_study(flags.given, gear, options.seed)
    if flags.write_table:
        task.refuse_other_tables(options)
    with stages(quiet=flags.quiet) as progress:
        findings = task.run_study(
            gear,
            options,
            statements=flags.statements or (wants_report and targets_file(gear).exists()),
            designs=wants_report,
            progress=progress,
        )
    said = findings.statements if flags.statements else ()
    shown = replace(findings, statements=said)
    if flags.as_json:
        from mlg_troubleshoot.reporting.model_json import study_as_json

        output.write_json(study_as_json(shown, given))
    else:
        screen = output.console(unit=flags.unit(), elsewhere=output.WIDEST)
        rows = [*zip(gear.joints, findings.result.table.joints, strict=True)]
        first = np.nan_to_num([entry.first_order for _, entry in rows]).clip(0.0)
        lengths = _LONGEST_BAR * first / max(first.max(), 1e-9)
        output.show_page(
            "study",
            screen,
            f=shown,
            rows=rows,
            bars=["█" * round(length) for length in lengths],
            given=given,
        )
    if flags.csv is not None:
        task.write_study_csv(findings, flags.csv)
    if flags.report is not None:
        written = task.write_study_report(
            findings,
            flags.report,
            flags.page.value,
            unit=flags.unit(),
        )
        output.say_written([written])
    if flags.write_table:
        output.say(f"Table written: {task.write_study_table(findings)}")
    if not findings.result.finished:
        output.say("Interrupted: these are partial results.")
        raise typer.Exit(ExitCode.INTERRUPTED)
