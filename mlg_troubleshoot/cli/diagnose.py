"""``mlg diagnose``: measured against predicted, in seven lines."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from mlg_troubleshoot.cli import options, output
from mlg_troubleshoot.errors import ExitCode, InconclusiveDataError, UsageError

if TYPE_CHECKING:
    from mlg_troubleshoot.diagnosis import Diagnosis
    from mlg_troubleshoot.units import LengthUnit
    from mlg_troubleshoot.workflows.diagnose import DiagnoseResult

EPILOG = (
    "Example: mlg diagnose fleet.csv --write-extension EXT.toml, then mlg check FILE"
    " --extension EXT.toml"
)


@options.flat
def diagnose(
    *,
    files: Annotated[
        list[str],
        typer.Argument(
            metavar="FILE...",
            help="Tables with the plunger measured at mid-position, or -.",
        ),
    ],
    write_extension: Annotated[
        Path | None,
        typer.Option(metavar="EXT.toml", help="Write the extended model to this file."),
    ] = None,
    approve: Annotated[
        str, typer.Option(metavar="NAME", help="Who approves that it may relax verdicts.")
    ] = "",
    why: Annotated[str, typer.Option(metavar="TEXT", help="Why it is approved.")] = "",
    causes: options.Causes = None,
    tables: options.MeasuredTables,
    shown: options.Shown,
) -> None:
    """Compare measured with predicted: what is wrong, the cause by name, the extension, the gain.

    Exit codes: 0 nothing found; 1 something found; 3 this table allows no conclusion; 2 usage.
    """
    from mlg_troubleshoot.cli.output import stages
    from mlg_troubleshoot.cli.views.batch import show_notes, show_problems
    from mlg_troubleshoot.diagnosis import write_extension as keep_extension
    from mlg_troubleshoot.workflows import diagnose as task

    if bool(approve.strip()) != bool(why.strip()) or (approve and write_extension is None):
        raise UsageError(
            "an approval lacks its name, its reason or its extension",
            'Give --write-extension EXT.toml --approve "NAME" --why "TEXT" together.',
        )
    inputs = [*files, *(causes or ()), *tables.map_files]
    priors = [file for file in causes or () if file.suffix == ".toml"]
    if len(priors) > 1:
        raise UsageError("two files of prior probabilities", "Give one --causes FILE.toml.")
    outputs = [("--write-extension", write_extension)]
    output.claim(tables.gear, inputs, outputs, shown.report, force=shown.force)
    asked = task.DiagnoseOptions(
        **tables.declared(),
        cause_files=tuple(file for file in causes or () if file not in priors),
        beliefs_file=priors[0] if priors else None,
    )
    try:
        with stages(quiet=shown.quiet) as bar:
            result = task.diagnose_files(
                [Path(name) for name in files],
                asked,
                progress=lambda share: bar("Diagnosing", int(100 * share), 100),
            )
    except InconclusiveDataError as error:
        if shown.as_json:
            output.write_json(error)
        elif not shown.quiet:
            show_notes(error.notes)
        show_problems(error.problems)
        raise
    if shown.as_json:
        output.write_json(result)
    else:
        show_notes(result.unread if shown.quiet else result.notes)
        show_problems(result.problems)
        _show(result, shown.unit())
    if write_extension is None:
        pass
    elif result.extension is None:
        output.say(_unwritten(result.diagnosis))
    else:
        keep_extension(
            result.extension, write_extension, approved_by=approve.strip(), reason=why.strip()
        )
        output.say(
            f"Extension: {write_extension}. Use it: mlg check FILE --extension {write_extension}"
        )
    if shown.report is not None:
        made = task.write_diagnosis_report(
            result,
            shown.report,
            options.paper_size(),
            unit=shown.unit(),
            replace_files=shown.force,
        )
        output.say_written([made], quiet=shown.quiet)
    found = result.diagnosis.verdict != "NONE" or result.diagnosis.faults or result.unread_files
    raise typer.Exit(ExitCode.ATTENTION if found else ExitCode.FINE)


def _unwritten(diagnosis: Diagnosis) -> str:
    if diagnosis.gain is not None and not diagnosis.gain.better:
        return "No extension written: held-out aircraft are not predicted better with it."
    far = [cause.candidate.cause.name for cause in diagnosis.causes if not cause.is_plausible]
    if far:
        return f"No extension written: {', '.join(far)} would be larger than is plausible."
    return (
        f"No extension written: the verdict is {diagnosis.verdict}, no cause of the model is named"
        " alone."
    )


def _show(result: DiagnoseResult, unit: LengthUnit) -> None:
    from mlg_troubleshoot.cli.views.batch import show_unread
    from mlg_troubleshoot.reporting.diagnosis_figures import seven_lines

    console = output.console(unit=unit)
    for line in seven_lines(result.diagnosis):
        said = output.text(line.text, "not bold")
        console.print(output.text(f"{line.number} {line.word:<7}", "bold").append_text(said))
    show_unread(result.unread_files, console)


app = options.alone(diagnose, EPILOG)
