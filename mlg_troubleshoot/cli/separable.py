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
    output.show_page("separable", output.console(), causes=causes)
