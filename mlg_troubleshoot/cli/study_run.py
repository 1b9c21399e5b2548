"""``mlg study``: reads what the command line asks for, calls the study, shows it."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from dataclasses import fields, replace

import numpy as np
import typer
from rich.table import Table

from mlg_troubleshoot.cli import options, output
from mlg_troubleshoot.cli.progress import stages
from mlg_troubleshoot.cli.remembered import Settings
from mlg_troubleshoot.cli.study import StudyFlags
from mlg_troubleshoot.errors import ExitCode, UsageError
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.gear.gear_file import load_gear
from mlg_troubleshoot.indices.given_data import GivenDataResult
from mlg_troubleshoot.paper.study import (
    Directions,
    StudyDesign,
    StudyFindings,
    StudyOptions,
    StudyResult,
)
from mlg_troubleshoot.paper.targets import targets_file
from mlg_troubleshoot.units import Length, LengthUnit, Sentence
from mlg_troubleshoot.workflows import study as task

_BAR = 16


@contextmanager
def asked(flags: StudyFlags) -> Iterator[tuple[Gear, StudyOptions]]:
    """Read what the flags ask of the study itself, and hold its cluster while it runs."""
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
    with (
        nullcontext() if flags.scheduler is None else options.dask_client(flags.scheduler) as client
    ):
        yield known, StudyOptions(**{**plain, **read, "scheduler": client})


def run(gear: Gear, options: StudyOptions, flags: StudyFlags, settings: Settings) -> None:
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
            bound=flags.bound or wants_report,
            designs=wants_report,
            progress=progress,
        )
    said = findings.statements if flags.statements else ()
    searched = findings.searches if flags.bound else ()
    shown = replace(findings, statements=said, searches=searched)
    if flags.as_json:
        from mlg_troubleshoot.reporting.model_json import study_as_json

        output.write_json(study_as_json(shown, given))
    else:
        _show(shown, settings.show)
        if given is not None:
            _show_given(gear, given)
    if flags.report is not None:
        written = task.write_study_report(
            findings,
            flags.report,
            settings.page.value,
            unit=settings.show,
            remembered=settings.note or None,
        )
        output.say_written([written])
    if flags.write_table:
        output.say(f"Table written: {task.write_study_table(findings)}")
    if not findings.result.finished:
        output.say("Interrupted: these are partial results.")
        raise typer.Exit(ExitCode.INTERRUPTED)


def _show(findings: StudyFindings, unit: LengthUnit) -> None:
    console = output.console(unit=unit, elsewhere=output.WIDEST)
    gear = findings.gear
    result = findings.result
    table = result.table
    what = (
        "exceeding the margin"
        if findings.options.beyond_margin
        else "plunger displacement at mid-position"
    )
    console.print(f"{gear.name}: sensitivity of {what}", style="bold")
    console.print(f"Geometry: {gear.provenance}. Design: {table.design}, seed {table.seed}.")
    failed = f"{table.failed} did not close" if table.failed else "none failed"
    console.print(
        f"{table.evaluations} solutions of the linkage over {len(gear.ensemble)} linkages,"
        f" {failed}."
    )
    if result.indices.note:
        console.print(f"Note: {result.indices.note.rstrip('.')}.")
    console.print(_joints(gear, result))
    if result.plain is not None:
        plain = ", ".join(
            f"#{n} {v:.4f}" for n, v in zip(gear.joint_numbers, result.plain, strict=True)
        )
        console.print(f"First order before its bias is removed: {plain}.")
    ends = [group for group in result.groups if len(group.joints) > 1]
    if ends:
        together = ", ".join(f"{'+'.join(f'#{j}' for j in g.joints)} {g.closed:.4f}" for g in ends)
        console.print(f"Both ends of one link together: {together}.")
    console.print(
        "first, total: fractions of the variance, not normalised · linkages: range of the first"
        " order over all that fit the printed numbers · A_iP: plunger movement per clearance · max"
        " A: largest stage-wise index"
    )
    for found in findings.searches:
        sense = "over-travel" if found.sense > 0 else "under-travel"
        proved = found.proved
        gap = (
            "could not be proved"
            if math.isinf(proved.bound_in)
            else Sentence.of("proved ≤ {}", Length(proved.bound_in, 6))
        )
        console.sentence(
            Sentence.of(
                "Worst {} with every clearance at its limit: {}, {} over all directions and the"
                " whole stroke (sequential rule {}, global search {}).",
                sense,
                Length(proved.found_in, 6),
                gap,
                Length(found.sequential_in, 6),
                Length(found.searched_in, 6),
            )
        )
    for statement in findings.statements:
        console.print()
        console.print(statement.paragraph)


def _joints(gear: Gear, result: StudyResult) -> Table:
    table = result.table
    shown = output.plain_table(None)
    for heading in ("joint", "first", "±", "", "total", "linkages", "rank", "A_iP", "max A"):
        shown.add_column(
            heading, justify="left" if heading in {"joint", ""} else "right", no_wrap=True
        )
    largest = max(
        (j.first_order for j in table.joints if math.isfinite(j.first_order)), default=1.0
    )
    for joint, entry in zip(gear.joints, table.joints, strict=True):
        low, high = entry.first_order_interval
        length = (
            _BAR * max(entry.first_order, 0.0) / max(largest, 1e-9)
            if math.isfinite(entry.first_order)
            else 0
        )
        first, last = entry.rank_range
        shown.add_row(
            joint.label,
            _number(entry.first_order),
            f"{(high - low) / 2:.1g}" if math.isfinite(high - low) else "-",
            "█" * round(length),
            _number(entry.total_order),
            f"{_number(entry.first_order_spread[0])}-{_number(entry.first_order_spread[1])}",
            f"{entry.rank}" if first == last else f"{entry.rank} ({first}-{last})",
            f"{entry.plunger_amplification:.3f}",
            f"{entry.max_amplification_index:.3f}",
        )
    return shown


def _show_given(gear: Gear, given: GivenDataResult) -> None:
    found = given.indices
    each = ", ".join(
        f"#{number} {_number(first)} ({_number(ends[0])} to {_number(ends[1])})"
        for number, first, ends in zip(
            gear.joint_numbers, found.first_order.tolist(), found.interval.tolist(), strict=True
        )
    )
    output.console().print(
        f"Without a model, from {given.rows_used} measured of {given.rows_read} inspections in"
        f" {given.file}, first order with 95 % intervals: {each}. Where joints wear together, each"
        " index includes part of the others, and their sum exceeds 1."
    )


def _number(value: float) -> str:
    return f"{value:.4f}" if math.isfinite(value) else "-"
