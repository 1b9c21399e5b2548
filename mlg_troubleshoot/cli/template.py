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
    unit: options.Unit = None,
    convention: options.Convention = None,
    columns: Annotated[
        str, typer.Option(metavar="usual|all", help="Columns of the workbook.")
    ] = "usual",
) -> None:
    """Write an empty inspection workbook, or a one-page form (.pdf, .html) to fill in by hand."""
    from mlg_troubleshoot.workflows import check as task

    if file.suffix.lower() not in (".xlsx", ".pdf", ".html"):
        raise UsageError(
            f"{file.name!r} is not the name of a workbook or a form",
            "Give a name that ends in .xlsx, .pdf or .html.",
        )
    if columns not in ("usual", "all"):
        raise UsageError(f"--columns {columns!r} is not known", "Give usual or all.")
    output.claim(gear, (), [("the template", file)], force=force)
    task.write_template(
        file,
        gear,
        page=options.paper_size(),
        unit=unit,
        convention=convention,
        every_column=columns == "all",
    )
    is_book = file.suffix.lower() == ".xlsx"
    then = f"mlg check {file} --report DIR" if is_book else "mlg check"
    output.write(f"Written: {file}. Fill it in, then: {then}")


app = options.alone(
    template,
    "Examples: mlg template fleet.xlsx; mlg template form.pdf --unit thou --convention TOTAL_PLAY",
)
