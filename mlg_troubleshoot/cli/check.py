"""``mlg check``. Nothing heavy is imported before it runs."""

from __future__ import annotations

from typing import Annotated

import typer

from mlg_troubleshoot.cli import options
from mlg_troubleshoot.cli.flags import Flags, Wanted

EPILOG = (
    "Example: [b]mlg check inspections.xlsx --report out[/b] · one gear by hand: [b]mlg check[/b] ·"
    " scripted: [b]mlg check --tail N123 --side LH --convention RADIAL --set 3=0.013in --set"
    " 5=0.007in[/b]"
)


@options.flat
def check(
    *,
    files: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="[FILE|-]...",
            help="Inspection tables (CSV, xlsx, xls, ods), folders, or - for stdin.",
        ),
    ] = None,
    flags: Flags,
    tables: options.Tables,
    wanted: Wanted,
    _repairs: Annotated[
        bool, typer.Option("--repairs", hidden=True, help="No effect: repairs are always searched.")
    ] = False,
    _version: options.Version = False,
) -> None:
    """Check gears: clearances in, verdict and ranked joints out.

    Without FILE on a terminal it asks, joint by joint. Exit codes: 0 every gear within margin · 1
    something needs attention · 3 no row could be judged · 2 usage.
    """
    from mlg_troubleshoot.cli.check_run import Run

    raise typer.Exit(Run(files or [], flags, tables, wanted).run())
