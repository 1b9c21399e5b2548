"""``mlg template``: an empty inspection workbook, or a form to fill in by hand."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from mlg_troubleshoot.cli import options, output
from mlg_troubleshoot.errors import UsageError
from mlg_troubleshoot.gear import DEFAULT_GEAR


def template(
    file: Annotated[
        Path,
        typer.Argument(
            metavar="FILE.xlsx|FILE.pdf", help="Where to write it: a workbook, or a form to print."
        ),
    ],
    gear: options.Gear = DEFAULT_GEAR,
    force: options.Force = False,
    page: options.Paper = None,
    show: options.Show = None,
    _version: options.Version = False,
) -> None:
    """Write an empty inspection workbook, or a one-page form (.pdf, .html) to fill in by hand."""
    from mlg_troubleshoot.cli.claims import claim
    from mlg_troubleshoot.cli.remembered import settings
    from mlg_troubleshoot.outputs import TO_FILL_IN, OutputFile
    from mlg_troubleshoot.workflows import check as task

    if file.suffix.lower() not in (".xlsx", ".pdf", ".html"):
        raise UsageError(
            f"{file.name!r} is not the name of a workbook or a form",
            "Give a name that ends in .xlsx, .pdf or .html.",
        )
    claim(gear, (), [OutputFile("the template", file, TO_FILL_IN)], force=force)
    shown = settings(gear, show, page)
    task.write_template(file, gear, page=str(shown.page), unit=shown.show)
    if file.suffix.lower() == ".xlsx":
        output.write(f"Written: {file}. Fill it in, then: mlg check {file} --report DIR")
    else:
        output.write(f"Written: {file}. Print it, fill it in, then enter it: mlg check")


app = options.alone(template, "Example: [b]mlg template inspections.xlsx[/b]")
