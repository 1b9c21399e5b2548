"""``mlg gear survey``: the template of a survey, and what a filled-in one says about the gear."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from mlg_troubleshoot.cli import options, output
from mlg_troubleshoot.errors import UsageError
from mlg_troubleshoot.gear import DEFAULT_GEAR

if TYPE_CHECKING:
    from mlg_troubleshoot.units import LengthUnit

EPILOG = (
    "Example: [b]mlg gear survey template survey.xlsx[/b] · "
    "filled in: [b]mlg gear survey survey.xlsx --write my-gear.toml[/b] · "
    "asked for at the prompt: [b]mlg gear survey ask survey.csv[/b]"
)


@options.flat
def survey(
    *,
    context: typer.Context,
    file: Annotated[
        str,
        typer.Argument(
            metavar="FILE|template|ask",
            help="Filled-in survey, or one of the words template and ask.",
        ),
    ],
    template: Annotated[
        Path | None,
        typer.Argument(
            metavar="[FILE.csv|FILE.xlsx]",
            help="Template to write; after ask: file for the answers.",
        ),
    ] = None,
    write: Annotated[
        Path | None,
        typer.Option(metavar="GEAR.toml", help="Write the surveyed gear, ensemble and table."),
    ] = None,
    inspections: Annotated[
        Path | None,
        typer.Option(
            "--for",
            metavar="INSPECTIONS",
            help="Narrow the displacement of these inspections instead of the indices.",
        ),
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="Seed of all random draws.")] = 0,
    wanted: options.OutputOptions,
) -> None:
    """A geometry from measurements: your own gear in place of the reconstructed one.

    Exit codes: 0 fits · 1 something does not fit · 3 the table has no usable reading.
    """
    from mlg_troubleshoot.cli.claims import claim
    from mlg_troubleshoot.cli.progress import stages
    from mlg_troubleshoot.workflows import survey as task

    gear = context.obj or DEFAULT_GEAR
    unit = wanted.unit()
    if file in ("template", "ask") and template is None and not Path(file).exists():
        raise UsageError(
            f"{file} needs the name of a file",
            f"Give for example: mlg gear survey {file} survey.csv",
        )
    if file == "template" and template is not None:
        claim(gear, (), [("the template", template)], force=wanted.force)
        task.write_survey_template(template, gear, unit)
        output.write(
            f"Written: {template}. Fill in what you read, then: mlg gear survey {template} --write"
            " my-gear.toml"
        )
        return
    if file == "ask" and template is not None:
        file = _asked(template, gear, unit)
    elif template is not None:
        raise UsageError(
            f"unexpected {str(template)!r}",
            "Give one survey, or: mlg gear survey template FILE.csv",
        )
    outputs = () if write is None else task.written_with(write)
    claim(gear, [file, inspections], outputs, wanted.report, force=wanted.force)
    with stages(quiet=wanted.quiet) as bar:
        result = task.survey(
            file,
            gear,
            write=write,
            inspections=inspections,
            seed=seed,
            on_progress=partial(bar, "Fitting"),
        )
    if wanted.as_json:
        from mlg_troubleshoot.reporting.model_json import survey_as_json

        output.write_json(survey_as_json(result))
    else:
        for problem in result.problems:
            output.say(
                f"{problem.place()}: {problem.value}: expected {problem.expected}. {problem.remedy}"
            )
        each = result.gear.joints, result.amplification, result.interval, result.before
        rows = [*zip(*each, strict=True)]
        output.show_page("survey", output.console(unit=unit), result=result, rows=rows)
    written = None
    if wanted.report is not None:
        written = task.write_survey_report(
            result, Path(file), wanted.report, wanted.page.value, unit
        )
    if written is not None:
        output.say_written([written], quiet=wanted.quiet)
    raise typer.Exit(result.exit_code)


def _asked(file: Path, gear: str, unit: LengthUnit) -> str:
    """Ask for the readings on the terminal; the file keeps them, so that a later run continues
    where this one stopped.
    """
    from mlg_troubleshoot.cli.claims import claim
    from mlg_troubleshoot.cli.prompts import RichTerminal
    from mlg_troubleshoot.cli.survey_prompts import ask_survey
    from mlg_troubleshoot.gear.gear_file import load_gear
    from mlg_troubleshoot.workflows.survey import write_survey_template

    if not output.can_ask():
        raise UsageError(
            "this is not a terminal to ask on",
            "Fill in a template: mlg gear survey template FILE.csv",
        )
    claim(gear, (), [("the survey", file)], force=True)
    if not file.exists():
        write_survey_template(file, gear, unit)
    again = f"Kept: {file}. Continue with: mlg gear survey ask {file}"
    try:
        if ask_survey(file, load_gear(gear), RichTerminal()):
            return str(file)
    except (EOFError, KeyboardInterrupt):
        output.say(again)
        raise KeyboardInterrupt from None
    output.say(again)
    raise typer.Exit
