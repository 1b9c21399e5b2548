"""``mlg gear separable``: which causes planned columns could distinguish."""

from __future__ import annotations

from typing import Annotated

import typer

from mlg_troubleshoot.cli import options, output
from mlg_troubleshoot.gear import DEFAULT_GEAR

EPILOG = (
    "Example: [b]mlg gear separable --columns"
    " tail_no,side,gear_landings,clearance_3_in,clearance_5_in[/b]"
)


def separable(
    context: typer.Context,
    columns: Annotated[
        str | None,
        typer.Option(
            metavar="A,B,…",
            help="Columns that will be recorded, as in a table; all if not given.",
        ),
    ] = None,
    as_json: options.Json = False,
    _version: options.Version = False,
) -> None:
    """Show which causes the planned columns could distinguish, and at what size of effect."""
    from mlg_troubleshoot.workflows.separable import separable as planned

    names = (
        None if columns is None else [name.strip() for name in columns.split(",") if name.strip()]
    )
    gear = context.obj or DEFAULT_GEAR
    causes = planned(gear, names)
    if as_json:
        from mlg_troubleshoot.json_outputs import SeparableOutput
        from mlg_troubleshoot.reporting.json_form import written

        output.write_json(written(SeparableOutput, columns=names, causes=causes))
        return
    console = output.console()
    console.print(
        "Smallest effects, rms in thou over 200 rows of 20 aircraft, that are detected, and"
        " distinguished from the nearest alternative, with 80 % power; the last column is the"
        " cheapest one that would distinguish them:"
    )
    headings = ("cause", "detected", "looks most like", "distinguished", "column to add")
    table = output.plain_table(None, *headings, right=("detected", "distinguished"))
    for cause in (c for c in causes if c.missing_column is None):
        table.add_row(
            " ".join(part for part in (cause.cause, cause.target) if part),
            _thou(cause.found_from_in),
            cause.nearest or "-",
            _thou(cause.told_apart_from_in),
            cause.further_column or "-",
        )
    console.print(table)
    for cause in causes:
        if cause.missing_column is not None:
            console.print(f"NOT TESTABLE without {cause.missing_column}: {cause.cause}")
    for cause in causes:
        if cause.nearest is not None and cause.told_apart_from_in is None:
            console.print(f"{cause.cause} {cause.target or ''}: only by {cause.separating_reading}")


def _thou(value_in: float | None) -> str:
    return "never" if value_in is None else f"{value_in * 1000.0:.1f}"
