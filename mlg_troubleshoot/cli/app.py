"""Commands and their options. Nothing heavy is imported before a command runs."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from mlg_troubleshoot.cli.boundary import Boundary
from mlg_troubleshoot.cli.reconstruct import EPILOG as RECONSTRUCT_EPILOG
from mlg_troubleshoot.cli.reconstruct import reconstruct
from mlg_troubleshoot.cli.study import EPILOG as STUDY_EPILOG
from mlg_troubleshoot.cli.study import study
from mlg_troubleshoot.units import ClearanceConvention, LengthUnit

app = typer.Typer(
    name="mlg",
    help=(
        "Do worn joints push the reversing-valve plunger of a main landing gear outside its margin? "
        "Which joint next? Where is the model wrong?\n\n"
        "Troubleshooting aid, not maintenance data: it does not replace the maintenance manual."
    ),
    no_args_is_help=True,
    context_settings={"help_option_names": ["-h", "--help"]},
    pretty_exceptions_enable=False,
    rich_markup_mode="rich",
)
gear_app = typer.Typer(
    name="gear",
    help="Which model is in use: joints, coordinates, provenance; [b]mlg gear verify[/b] checks it.",
    invoke_without_command=True,
)
app.add_typer(gear_app)


class ReportFormat(StrEnum):
    """Format of a printable report."""

    HTML = "html"
    PDF = "pdf"
    PDF_UA = "pdf-ua"


class Page(StrEnum):
    """Paper of a printable report."""

    A4 = "A4"
    LETTER = "Letter"


def _unit(text: str) -> LengthUnit:
    return LengthUnit.parse(text)


def _convention(text: str) -> ClearanceConvention:
    return ClearanceConvention.parse(text)


def _version(wanted: bool) -> None:
    if wanted:
        from importlib.metadata import version

        typer.echo(f"mlg {version('mlg-troubleshoot')}")
        raise typer.Exit


@app.callback()
def options(
    _version_wanted: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Show the version and stop.")
    ] = False,
) -> None:
    """Options of every command."""


GearOption = Annotated[str, typer.Option("--gear", metavar="NAME|TOML", help="Shipped gear or a gear file.")]
UnitOption = Annotated[
    str | None,
    typer.Option("--unit", metavar="in|thou|mm", help="Unit of lengths that do not say one."),
]
ColumnMapOption = Annotated[
    list[str] | None,
    typer.Option("--map", metavar="HEADER=COLUMN", help="How to read a header, e.g. 'Spiel 3=clearance_3_mm'."),
]
ConventionOption = Annotated[
    str | None,
    typer.Option(
        "--convention",
        metavar="RADIAL|DIAMETRAL|TOTAL_PLAY",
        help="What a clearance reading is, for rows that do not say it. No default: the factor 2 flips verdicts.",
    ),
]
JsonOption = Annotated[bool, typer.Option("--json", help="Write the result as JSON to stdout.")]
QuietOption = Annotated[bool, typer.Option("--quiet", "-q", help="No progress and no notes.")]


@app.command(
    epilog="Example: [b]mlg check inspections.xlsx --report out[/b] · one gear by hand: [b]mlg check[/b] · "
    "scripted: [b]mlg check --tail N123 --side LH --convention RADIAL --set 3=0.013in --set 5=0.007in[/b]"
)
def check(
    files: Annotated[
        list[str] | None,
        typer.Argument(metavar="[FILE|-]...", help="Inspection tables (CSV, xlsx, xls, ods), folders, or - for stdin."),
    ] = None,
    values: Annotated[
        list[str] | None, typer.Option("--set", metavar="JOINT=VALUE", help="One clearance, e.g. 3=0.013in.")
    ] = None,
    tail: Annotated[str | None, typer.Option("--tail", help="Tail number, with --set or the prompts.")] = None,
    side: Annotated[str | None, typer.Option("--side", metavar="LH|RH", help="Which gear.")] = None,
    record_id: Annotated[str | None, typer.Option("--record-id", help="Identity of the record.")] = None,
    outcome: Annotated[
        str | None, typer.Option("--outcome", metavar="RETRACTED|FAILED", help="What the gear did.")
    ] = None,
    measured: Annotated[
        str | None,
        typer.Option(
            "--measured", metavar="VALUE", help="Measured plunger displacement at mid-position, e.g. 0.041in."
        ),
    ] = None,
    margin: Annotated[
        str | None, typer.Option("--margin", metavar="VALUE", help="This gear's own margin, e.g. 0.028in.")
    ] = None,
    gear: GearOption = "hawker-800xp",
    unit: UnitOption = None,
    convention: ConventionOption = None,
    sheet: Annotated[
        str | None, typer.Option("--sheet", help="Worksheet; '*' reads every sheet with inspections.")
    ] = None,
    column_map: ColumnMapOption = None,
    decimal_comma: Annotated[bool, typer.Option("--decimal-comma", help="0,013 means 0.013.")] = False,
    report: Annotated[
        Path | None, typer.Option("--report", metavar="DIR", help="Write printable reports to this folder.")
    ] = None,
    formats: Annotated[
        list[ReportFormat] | None,
        typer.Option(
            "--format", help="Report format, may repeat; default html and pdf. pdf-ua: tagged, for screen readers."
        ),
    ] = None,
    page: Annotated[Page, typer.Option("--page", help="Paper of the report.")] = Page.A4,
    repairs: Annotated[bool, typer.Option("--repairs", help="Repair sets for each gear of a batch.")] = False,
    extension: Annotated[
        list[Path] | None,
        typer.Option("--extension", metavar="TOML", help="Predict with an extension of the model; may repeat."),
    ] = None,
    causes: Annotated[
        list[Path] | None, typer.Option("--causes", metavar="FILE.py", help="Your own causes that the extension names.")
    ] = None,
    annotate: Annotated[
        Path | None,
        typer.Option("--annotate", metavar="OUT.xlsx", help="Your workbook with bad cells marked and verdicts added."),
    ] = None,
    csv: Annotated[
        Path | None, typer.Option("--csv", metavar="OUT.csv", help="Verdicts as a CSV, one line a gear.")
    ] = None,
    resume: Annotated[bool, typer.Option("--resume", help="Go on with the last unfinished entry.")] = False,
    _seed: Annotated[int, typer.Option("--seed", help="Accepted everywhere; a check uses no random numbers.")] = 0,
    as_json: JsonOption = False,
    quiet: QuietOption = False,
) -> None:
    """Check gears: clearances in, verdict and ranked joints out.

    Without FILE on a terminal it asks, joint by joint. Exit codes: 0 every gear within margin · 1 something needs
    attention · 3 no row could be judged · 2 usage.
    """
    with Boundary():
        from mlg_troubleshoot.cli import check as command

        command.run(
            command.CheckArguments(
                files=tuple(files or ()),
                values=tuple(values or ()),
                tail=tail,
                side=side,
                record_id=record_id,
                outcome=outcome,
                measured=measured,
                margin=margin,
                gear=gear,
                unit=None if unit is None else _unit(unit),
                convention=None if convention is None else _convention(convention),
                sheet=sheet,
                column_map=tuple(column_map or ()),
                decimal_comma=decimal_comma,
                report=report,
                formats=tuple(str(f) for f in formats or (ReportFormat.HTML, ReportFormat.PDF)),
                page=str(page),
                repairs=repairs,
                extension=tuple(extension or ()),
                causes=tuple(causes or ()),
                annotate=annotate,
                csv=csv,
                resume=resume,
                as_json=as_json,
                quiet=quiet,
            )
        )


@app.command(
    epilog="Example: [b]mlg diagnose fleet.csv --write-extension EXT.toml[/b], then "
    "[b]mlg check FILE --extension EXT.toml[/b]"
)
def diagnose(
    files: Annotated[
        list[str], typer.Argument(metavar="FILE...", help="Tables with measured plunger displacements, or -.")
    ],
    write_extension: Annotated[
        Path | None, typer.Option("--write-extension", metavar="EXT.toml", help="Keep the extended model.")
    ] = None,
    report: Annotated[
        Path | None, typer.Option("--report", metavar="DIR", help="Write a printable report to this folder.")
    ] = None,
    page: Annotated[Page, typer.Option("--page", help="Paper of the report.")] = Page.A4,
    causes: Annotated[
        list[Path] | None, typer.Option("--causes", metavar="FILE.py", help="Your own causes, beside the catalogue.")
    ] = None,
    permutations: Annotated[
        int, typer.Option("--permutations", min=99, max=99999, help="Data sets drawn with nothing wrong.")
    ] = 999,
    seed: Annotated[int, typer.Option("--seed", min=0, help="Seed of all randomness.")] = 0,
    gear: GearOption = "hawker-800xp",
    unit: UnitOption = None,
    convention: ConventionOption = None,
    sheet: Annotated[str | None, typer.Option("--sheet", help="Worksheet.")] = None,
    column_map: ColumnMapOption = None,
    as_json: JsonOption = False,
    quiet: QuietOption = False,
) -> None:
    """Compare measured with predicted: what is wrong, the cause by name, the extension, the gain.

    Exit codes: 0 nothing found · 1 something found · 3 cannot be concluded from this table · 2 usage.
    """
    with Boundary():
        from mlg_troubleshoot import workflows
        from mlg_troubleshoot.cli import diagnose as command
        from mlg_troubleshoot.cli.check import columns_by_header

        command.run(
            files,
            workflows.DiagnoseOptions(
                gear=gear,
                unit=None if unit is None else _unit(unit),
                convention=None if convention is None else _convention(convention),
                sheet=sheet,
                column_map=columns_by_header(tuple(column_map or ())),
                cause_files=tuple(causes or ()),
                permutations=permutations,
                seed=seed,
            ),
            write_extension=write_extension,
            report=report,
            page=str(page),
            as_json=as_json,
            quiet=quiet,
        )


@app.command(epilog="Example: [b]mlg template inspections.xlsx[/b]")
def template(
    file: Annotated[Path, typer.Argument(metavar="FILE.xlsx", help="Where to write it.")],
    gear: GearOption = "hawker-800xp",
    force: Annotated[bool, typer.Option("--force", help="Replace a file that exists.")] = False,
) -> None:
    """Write an empty inspection workbook that mlg check reads back."""
    with Boundary():
        from mlg_troubleshoot.cli import template as command

        command.run(file, gear, force=force)


@gear_app.callback(epilog="Example: [b]mlg gear verify[/b]")
def gear_show(
    context: typer.Context,
    gear: GearOption = "hawker-800xp",
    as_json: JsonOption = False,
) -> None:
    """Show which model is in use."""
    context.obj = gear
    if context.invoked_subcommand is None:
        with Boundary():
            from mlg_troubleshoot.cli import gear as command

            command.show(gear, as_json=as_json)


@gear_app.command("verify", epilog="Example: [b]mlg gear verify[/b]")
def gear_verify(context: typer.Context, as_json: JsonOption = False) -> None:
    """Print every number the paper prints beside what the model gives; exit 1 if one that should hold does not."""
    with Boundary():
        from mlg_troubleshoot.cli import gear as command

        command.verify(context.obj, as_json=as_json)


@app.command(epilog="Example: [b]mlg doctor[/b]")
def doctor(gear: GearOption = "hawker-800xp", as_json: JsonOption = False) -> None:
    """Check whether this installation can do everything."""
    with Boundary():
        from mlg_troubleshoot.cli import doctor as command

        command.run(gear, as_json=as_json)


app.command(epilog=STUDY_EPILOG)(study)
gear_app.command(epilog=RECONSTRUCT_EPILOG)(reconstruct)
