"""``mlg diagnose``: measured against predicted, in seven lines."""

from __future__ import annotations

import io
import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import BinaryIO

import typer
from rich.text import Text

from mlg_troubleshoot import workflows
from mlg_troubleshoot.cli import output, views
from mlg_troubleshoot.cli.progress import stages
from mlg_troubleshoot.diagnosis import Diagnosis

NOTHING_FOUND, SOMETHING_FOUND = 0, 1


def run(
    files: Sequence[str],
    options: workflows.DiagnoseOptions,
    *,
    write_extension: Path | None,
    report: Path | None,
    page: str,
    as_json: bool,
    quiet: bool,
) -> None:
    """Run the command and leave with the exit code of the contract.

    Parameters
    ----------
    files : sequence of str
        Tables.
    options : DiagnoseOptions
        What the user declared.
    write_extension : Path or None
        Where to write the extension.
    report : Path or None
        Folder of the report.
    page : str
        Paper of the report.
    as_json : bool
        Write JSON to stdout.
    quiet : bool
        No progress and no notes.
    """
    sources: list[Path | BinaryIO] = [
        io.BytesIO(sys.stdin.buffer.read()) if name == "-" else Path(name) for name in files
    ]
    with stages(quiet=quiet) as bar:
        result = workflows.diagnose_files(
            sources, options, progress=lambda share: bar("Diagnosing", int(100 * share), 100)
        )
    diagnosis = result.diagnosis
    if as_json:
        from mlg_troubleshoot.reporting.diagnosis_json import diagnosis_as_json

        output.write(
            json.dumps(diagnosis_as_json(diagnosis, result.extension), allow_nan=False, ensure_ascii=False, indent=1)
        )
    else:
        if not quiet:
            views.show_notes(result.notes)
        views.show_problems(result.problems)
        _show(diagnosis)
    if write_extension is not None:
        if result.extension is None:
            typer.echo(f"No extension written: the verdict is {diagnosis.verdict}, no cause is named alone.", err=True)
        else:
            workflows.write_extension(result.extension, write_extension)
            typer.echo(f"Extension: {write_extension}. Use it: mlg check FILE --extension {write_extension}", err=True)
    if report is not None:
        for path in workflows.write_diagnosis_report(result, options, report, page):
            typer.echo(f"Report: {path}", err=True)
    raise typer.Exit(NOTHING_FOUND if diagnosis.verdict == "NONE" and not diagnosis.faults else SOMETHING_FOUND)


def _show(d: Diagnosis) -> None:
    from mlg_troubleshoot.reporting.diagnosis_lines import seven_lines

    console = output.console()
    for line in seven_lines(d):
        text = Text(f"{line.number} {line.word:<7}", style="bold")
        text.append(line.text, style="not bold")
        console.print(text)
