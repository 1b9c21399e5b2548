"""``mlg template``: an empty inspection workbook."""

from __future__ import annotations

from pathlib import Path

import typer

from mlg_troubleshoot import workflows
from mlg_troubleshoot.errors import OutputError, UsageError


def run(file: Path, gear: str, *, force: bool) -> None:
    """Write the workbook.

    Parameters
    ----------
    file : Path
        Where to write it.
    gear : str
        The gear whose joints it lists.
    force : bool
        Replace a file that exists.
    """
    if file.suffix.lower() != ".xlsx":
        raise UsageError(f"{file.name!r} does not end in .xlsx", "Give a name that ends in .xlsx.")
    if file.exists() and not force:
        raise OutputError(f"{file} exists already", "Give another name, or --force to replace it.")
    workflows.write_template(file, gear)
    typer.echo(f"Written: {file}. Fill it in, then: mlg check {file} --report DIR")
