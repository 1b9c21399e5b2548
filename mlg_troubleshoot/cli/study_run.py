"""``mlg study``, its work: recompute the indices, show them, write the table that goes with a gear."""

from __future__ import annotations

import csv as csv_module
import json
import math
from contextlib import ExitStack
from dataclasses import asdict, dataclass, replace
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import typer

from mlg_troubleshoot.cli.boundary import INTERRUPTED
from mlg_troubleshoot.cli.progress import Advance, stages
from mlg_troubleshoot.errors import OutputError, UsageError
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.gear.gear_file import load_gear
from mlg_troubleshoot.studies.findings import StudyFindings
from mlg_troubleshoot.studies.statements import Statement, check_statements
from mlg_troubleshoot.studies.study import Design, Directions, StudyOptions, StudyResult, compare_designs, run_study
from mlg_troubleshoot.studies.table import write_index_table
from mlg_troubleshoot.studies.targets import targets_file
from mlg_troubleshoot.studies.worst_search import WorstSearch, search_worst

if TYPE_CHECKING:
    from mlg_troubleshoot.workflows import GivenDataResult

_BAR = 16
_Choice = TypeVar("_Choice", Design, Directions)


@dataclass(frozen=True, slots=True)
class StudyArguments:
    """What the command line asks for.

    Parameters
    ----------
    gear : str
        Shipped gear or gear file.
    design, directions, distribution : str
        How the points, the directions and the clearances are chosen.
    fixed_deg : str or None
        Directions set by a load, comma separated. [deg]
    limit : float or None
        One limit for all joints in place of the gear's. [in]
    accuracy : float
        Wanted error of every index. [1]
    seed : int
        Seed.
    most, n1, n2, iterations : int or None
        Sizes.
    workers : int
        Cores for the total-order study.
    state : Path or None
        File to resume from.
    scheduler : str or None
        Address of a Dask scheduler.
    beyond_margin, statements, bound, write_table, as_json, quiet : bool
        Look at exceeding the margin, check the paper's statements, prove the worst displacement, write the
        gear's table, write JSON, be quiet.
    csv : Path or None
        Write a CSV here.
    given : Path or None
        Inspections to take indices from, beside the study.
    report : Path or None
        Write a report to this folder.
    page : str
        Paper of the report.
    """

    gear: str
    design: str
    directions: str
    distribution: str
    fixed_deg: str | None
    limit: float | None
    accuracy: float
    seed: int
    most: int
    n1: int | None
    n2: int | None
    iterations: int | None
    workers: int
    state: Path | None
    scheduler: str | None
    beyond_margin: bool
    statements: bool
    bound: bool
    write_table: bool
    as_json: bool
    quiet: bool
    csv: Path | None
    given: Path | None
    report: Path | None
    page: str


def run(arguments: StudyArguments) -> None:
    """Run a study and show, write and return what was asked for; exit 130 if it was interrupted.

    Parameters
    ----------
    arguments : StudyArguments
        What the command line asks for.
    """
    gear = load_gear(arguments.gear)
    _check_page(arguments)
    given = _given(arguments, gear)
    with ExitStack() as stack:
        options = _options(arguments, gear, stack)
        if arguments.write_table and not options.is_standard:
            raise UsageError(
                "--write-table with other than the standard study",
                "Use design fast, sampled or tensor, without --directions, --distribution, --limit, --beyond-margin.",
            )
        advance = stack.enter_context(stages(quiet=arguments.quiet))
        result = run_study(gear, options, advance)
        findings = _findings(gear, options, result, arguments, advance)
    statements = findings.statements if arguments.statements else ()
    searches = findings.searches if arguments.bound else ()
    if arguments.as_json:
        values = as_json(gear, result, statements, searches, arguments)
        if given is not None:
            values["given_data"] = _given_as_json(gear, given)
        typer.echo(json.dumps(values, indent=1, allow_nan=False))
    else:
        _show(gear, result, statements, searches, arguments)
        if given is not None:
            _show_given(gear, given)
    if arguments.csv is not None:
        _write_csv(gear, result, arguments.csv)
    if arguments.report is not None:
        _write_report(findings, arguments.report, arguments.page)
    if arguments.write_table:
        if not result.finished:
            raise UsageError("the study was interrupted, its table is not complete", "Run it again to the end.")
        write_index_table(result.table, gear.indices_file)
        typer.echo(f"Table written: {gear.indices_file}", err=True)
    if not result.finished:
        typer.echo("Interrupted: the numbers above are of what was done.", err=True)
        raise typer.Exit(INTERRUPTED)


def _check_page(arguments: StudyArguments) -> None:
    """Refuse an unknown paper before the work, not after it."""
    if arguments.report is None:
        return
    from mlg_troubleshoot.reporting.publish import PAGES

    if arguments.page not in PAGES:
        raise UsageError(f"page {arguments.page!r} is not known", f"Give one of {', '.join(PAGES)}.")


def _given(arguments: StudyArguments, gear: Gear) -> GivenDataResult | None:
    if arguments.given is None:
        return None
    from mlg_troubleshoot.workflows import given_data_study

    return given_data_study(arguments.given, gear, arguments.seed)


def _findings(
    gear: Gear, options: StudyOptions, result: StudyResult, arguments: StudyArguments, advance: Advance
) -> StudyFindings:
    """Add to a finished study what was asked for beside it; a report shows all of it."""
    findings = StudyFindings(gear, options, result)
    if not result.finished:
        return findings
    has_statements = targets_file(gear).exists()
    if arguments.statements and not has_statements:
        raise UsageError(f"{gear.name} has no printed statements", f"Write {targets_file(gear).name} beside it.")
    wants_report = arguments.report is not None
    if wants_report:
        findings = replace(findings, designs=compare_designs(gear, options, advance))
    if arguments.statements or (wants_report and has_statements):
        found = check_statements(gear, progress=lambda done, total: advance("statements", done, total))
        findings = replace(findings, statements=found)
    if arguments.bound or wants_report:
        findings = replace(findings, searches=_searches(gear, options, advance))
    return findings


def _write_report(findings: StudyFindings, directory: Path, page: str) -> None:
    from mlg_troubleshoot.workflows import write_study_report

    written = write_study_report(findings, directory, page)
    for note in written.notes:
        typer.echo(f"Note: {note}", err=True)
    for path in written.files:
        typer.echo(f"Report: {path}", err=True)


def _searches(gear: Gear, options: StudyOptions, advance: Advance) -> tuple[WorstSearch, ...]:
    import numpy as np

    found = []
    for k, sense in enumerate((1.0, -1.0)):
        rng = np.random.default_rng(np.random.SeedSequence(options.seed, spawn_key=(1000 + k,)))
        limits = gear.limits_in if options.limits_in is None else options.limits_in
        found.append(search_worst(gear.model, limits, sense, rng, options.seed))
        advance("proof", k + 1, 2)
    return tuple(found)


def _options(arguments: StudyArguments, gear: Gear, stack: ExitStack) -> StudyOptions:
    import numpy as np

    design = _choice(Design, arguments.design, "design")
    directions = _choice(Directions, arguments.directions, "directions")
    fixed = None
    if arguments.fixed_deg is not None:
        try:
            fixed = np.radians([float(part) for part in arguments.fixed_deg.split(",")])
        except ValueError:
            raise UsageError(
                f"directions {arguments.fixed_deg!r}", "Give degrees with commas between, one for each joint."
            ) from None
        directions = Directions.FIXED
    scheduler = None
    if arguments.scheduler is not None:
        scheduler = stack.enter_context(_client(arguments.scheduler))
    return StudyOptions(
        design=design,
        accuracy=arguments.accuracy,
        seed=arguments.seed,
        distribution=arguments.distribution,
        limits_in=None if arguments.limit is None else np.full(len(gear.joints), arguments.limit),
        directions=directions,
        fixed_rad=fixed,
        beyond_margin=arguments.beyond_margin,
        most=arguments.most,
        n1=arguments.n1,
        n2=arguments.n2,
        iterations=arguments.iterations,
        workers=arguments.workers,
        state=arguments.state,
        scheduler=scheduler,
    )


def _choice(kind: type[_Choice], text: str, what: str) -> _Choice:
    try:
        return kind(text.lower())
    except ValueError:
        raise UsageError(f"{what} {text!r} is not known", f"Give one of {', '.join(kind)}.") from None


def _client(address: str) -> Any:
    try:
        distributed: Any = import_module("distributed")
    except ImportError:
        raise UsageError(
            "--scheduler needs dask.distributed", "Install the extra: pip install 'mlg-troubleshoot[cluster]'"
        ) from None
    try:
        return distributed.Client(address, timeout="10s")
    except (OSError, ValueError) as error:
        raise UsageError(f"no Dask scheduler at {address}: {error}", "Start one, or leave out --scheduler.") from error


def as_json(
    gear: Gear,
    result: StudyResult,
    statements: tuple[Statement, ...],
    searches: tuple[WorstSearch, ...],
    arguments: StudyArguments,
) -> dict[str, Any]:
    """Return the study as plain values, as the JSON contract has it; what is not known is null.

    Parameters
    ----------
    gear : Gear
        The gear.
    result : StudyResult
        What the study found.
    statements : tuple of Statement
        What became of the paper's statements.
    searches : tuple of WorstSearch
        Worst displacement of each sense.
    arguments : StudyArguments
        What was asked for.

    Returns
    -------
    dict
        Plain values.
    """
    growth = result.growth
    values = {
        **result.table.as_dict(),
        "directions": arguments.directions if arguments.fixed_deg is None else "fixed",
        "distribution": arguments.distribution,
        "of": "exceeding the margin" if arguments.beyond_margin else "displacement",
        "accuracy": arguments.accuracy,
        "finished": result.finished,
        "note": result.indices.note,
        "mean": result.indices.mean,
        "variance": result.indices.variance,
        "first_order_plain": None if result.plain is None else result.plain.tolist(),
        "second_order": None if result.indices.second_order is None else result.indices.second_order.tolist(),
        "groups": [asdict(group) for group in result.groups],
        "ensemble": [linkage.name for linkage in gear.ensemble],
        "amplification": {
            "local_stage": growth.local_stage.tolist(),
            "max_stage": growth.max_stage.tolist(),
            "local_plunger": growth.local_plunger.tolist(),
            "max_plunger": growth.max_plunger.tolist(),
            "exact_plunger": growth.exact.tolist(),
        },
        "statements": [
            {**asdict(statement), "outcome": str(statement.outcome), "paragraph": statement.paragraph}
            for statement in statements
        ],
        "bounds": [
            {
                "sense": "over-travel" if found.sense > 0 else "under-travel",
                "sequential_in": found.sequential_in,
                "searched_in": found.searched_in,
                "found_in": found.proved.found_in,
                "bound_in": found.proved.bound_in,
                "stroke_in": found.proved.stroke_in,
                "directions_rad": found.proved.directions.tolist(),
            }
            for found in searches
        ],
    }
    cleaned: dict[str, Any] = _without_nan(values)
    return cleaned


def _without_nan(value: Any) -> Any:
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, dict):
        return {key: _without_nan(entry) for key, entry in value.items()}
    if isinstance(value, (list, tuple)):
        return [_without_nan(entry) for entry in value]
    return value


def _show(
    gear: Gear,
    result: StudyResult,
    statements: tuple[Statement, ...],
    searches: tuple[WorstSearch, ...],
    arguments: StudyArguments,
) -> None:
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    console = Console(highlight=False)
    if not console.is_terminal:
        console = Console(highlight=False, width=120)
    table = result.table
    what = "exceeding the margin" if arguments.beyond_margin else "plunger displacement at mid-position"
    console.print(Text(f"{gear.name}: sensitivity of {what}", style="bold"))
    console.print(Text(f"Geometry: {gear.provenance}. Design: {table.design}, seed {table.seed}."))
    failed = f"{table.failed} did not close" if table.failed else "none failed"
    console.print(Text(f"{table.evaluations} solutions of the linkage over {len(gear.ensemble)} linkages, {failed}."))
    if result.indices.note:
        console.print(Text(f"Note: {result.indices.note.rstrip('.')}."))
    shown = Table(box=None, pad_edge=False, header_style="bold")
    for heading in ("joint", "first", "±", "", "total", "linkages", "rank", "A_iP", "max A"):
        shown.add_column(heading, justify="left" if heading in {"joint", ""} else "right", no_wrap=True)
    largest = max((j.first_order for j in table.joints if math.isfinite(j.first_order)), default=1.0)
    for joint, entry in zip(gear.joints, table.joints, strict=True):
        low, high = entry.first_order_interval
        length = _BAR * max(entry.first_order, 0.0) / max(largest, 1e-9) if math.isfinite(entry.first_order) else 0
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
    console.print(shown)
    if result.plain is not None:
        plain = ", ".join(f"#{n} {v:.4f}" for n, v in zip(gear.joint_numbers, result.plain, strict=True))
        console.print(Text(f"First order before its bias is removed: {plain}."))
    ends = [group for group in result.groups if len(group.joints) > 1]
    if ends:
        together = ", ".join(f"{'+'.join(f'#{j}' for j in g.joints)} {g.closed:.4f}" for g in ends)
        console.print(Text(f"Both ends of one link together: {together}."))
    console.print(
        Text(
            "first, total: fractions of the variance, not normalised · linkages: range of the first order over all "
            "that fit the printed numbers · A_iP: plunger movement per clearance · max A: largest stage-wise index"
        )
    )
    for found in searches:
        sense = "over-travel" if found.sense > 0 else "under-travel"
        proved = found.proved
        gap = "could not be proved" if math.isinf(proved.bound_in) else f"proved ≤ {proved.bound_in:.6f} in"
        console.print(
            Text(
                f"Worst {sense} with every clearance at its limit: {proved.found_in:.6f} in, {gap} over all directions "
                f"and the whole stroke (sequential rule {found.sequential_in:.6f}, "
                f"global search {found.searched_in:.6f})."
            )
        )
    for statement in statements:
        console.print()
        console.print(Text(statement.paragraph))


def _given_as_json(gear: Gear, given: GivenDataResult) -> dict[str, Any]:
    found = given.indices
    values: dict[str, Any] = _without_nan(
        {
            "file": given.file,
            "rows_read": given.rows_read,
            "rows_used": given.rows_used,
            "joints": [
                {"joint": number, "first_order": first, "first_order_interval": ends, "rows": rows}
                for number, first, ends, rows in zip(
                    gear.joint_numbers,
                    found.first_order.tolist(),
                    found.interval.tolist(),
                    found.rows.tolist(),
                    strict=True,
                )
            ],
        }
    )
    return values


def _show_given(gear: Gear, given: GivenDataResult) -> None:
    from mlg_troubleshoot.cli import output

    found = given.indices
    each = ", ".join(
        f"#{number} {_number(first)} ({_number(ends[0])} to {_number(ends[1])})"
        for number, first, ends in zip(
            gear.joint_numbers, found.first_order.tolist(), found.interval.tolist(), strict=True
        )
    )
    output.console().print(
        f"Without a model, from {given.rows_used} measured of {given.rows_read} inspections in {given.file}, "
        f"first order with 95 % intervals: {each}. Where joints wear together each explains what the others do, too, "
        "and these add to more than 1.",
        markup=False,
    )


def _number(value: float) -> str:
    return f"{value:.4f}" if math.isfinite(value) else "-"


def _write_csv(gear: Gear, result: StudyResult, path: Path) -> None:
    heads = [
        "joint", "name", "first_order", "first_order_low", "first_order_high", "total_order", "total_order_low",
        "total_order_high", "plunger_amplification", "max_amplification_index", "rank", "rank_least", "rank_greatest",
        "first_order_least", "first_order_greatest",
    ]  # fmt: skip
    try:
        with path.open("w", newline="", encoding="utf-8") as file:
            writer = csv_module.writer(file)
            writer.writerow(heads)
            for joint, e in zip(gear.joints, result.table.joints, strict=True):
                numbers = (
                    e.first_order, *e.first_order_interval, e.total_order, *e.total_order_interval,
                    e.plunger_amplification, e.max_amplification_index,
                )  # fmt: skip
                cells = ["" if not math.isfinite(v) else repr(v) for v in numbers]
                spread = ["" if not math.isfinite(v) else repr(v) for v in e.first_order_spread]
                writer.writerow([e.joint, joint.name, *cells, e.rank, *e.rank_range, *spread])
    except OSError as error:
        raise OutputError(f"{path}: cannot be written: {error}", "Choose another file.") from error
