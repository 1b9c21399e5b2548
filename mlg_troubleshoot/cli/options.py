"""Options that several commands share, and how their texts are read."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from mlg_troubleshoot.errors import UsageError
from mlg_troubleshoot.units import ClearanceConvention, LengthUnit

DEFAULT_GEAR = "hawker-800xp"


class ReportFormat(StrEnum):
    HTML = "html"
    PDF = "pdf"
    PDF_UA = "pdf-ua"


class Page(StrEnum):
    A4 = "A4"
    LETTER = "Letter"


def _show_version(wanted: bool) -> None:
    # Some releases of typer call this with what stands for "not given": only True is an answer.
    if wanted is True:
        from importlib.metadata import version

        typer.echo(f"mlg {version('mlg-troubleshoot')}")
        raise typer.Exit


Version = Annotated[
    bool, typer.Option("--version", callback=_show_version, is_eager=True, help="Show the version and stop.")
]
Gear = Annotated[str, typer.Option("--gear", metavar="NAME|TOML", help="Shipped gear or a gear file.")]
Unit = Annotated[
    LengthUnit | None,
    typer.Option("--unit", parser=LengthUnit.parse, metavar="in|thou|mm", help="Unit of lengths that do not say one."),
]
Convention = Annotated[
    ClearanceConvention | None,
    typer.Option(
        "--convention",
        parser=ClearanceConvention.parse,
        metavar="RADIAL|DIAMETRAL|TOTAL_PLAY",
        help="What a clearance reading is, for rows that do not say it. No default: the factor 2 flips verdicts.",
    ),
]
Sheet = Annotated[str | None, typer.Option("--sheet", help="Worksheet; '*' reads every sheet with inspections.")]
ColumnMap = Annotated[
    list[str] | None,
    typer.Option("--map", metavar="HEADER=COLUMN", help="How to read a header, e.g. 'Spiel 3=clearance_3_mm'."),
]
DecimalComma = Annotated[bool, typer.Option("--decimal-comma", help="0,013 means 0.013.")]
Causes = Annotated[
    list[Path] | None,
    typer.Option("--causes", metavar="FILE.py", help="Your own causes. Runs this file: give only one that you trust."),
]
Report = Annotated[Path | None, typer.Option("--report", metavar="DIR", help="Write printable reports to this folder.")]
Paper = Annotated[Page | None, typer.Option("--page", help="Paper of the report; A4 unless remembered.")]
Show = Annotated[
    str | None, typer.Option("--show", metavar="in|thou|mm", help="Unit to show lengths in; inches unless remembered.")
]
Remember = Annotated[
    bool, typer.Option("--remember", help="Keep --show, --page and --map in mlg.toml here, for later runs.")
]
Json = Annotated[bool, typer.Option("--json", help="Write the result as JSON to stdout.")]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="No progress and no notes.")]


def columns_by_header(pairs: Sequence[str] | None) -> dict[str, str]:
    """Read what ``--map`` was given."""
    mapped = {}
    for pair in pairs or ():
        header, sign, column = pair.rpartition("=")
        if not sign or not header.strip() or not column.strip():
            raise UsageError(
                f"--map {pair!r} is not HEADER=COLUMN", "Write for example --map 'Spiel 3=clearance_3_mm'."
            )
        mapped[header.strip()] = column.strip()
    return mapped


def keep_inputs(
    gear: str,
    inputs: Iterable[str | Path | None],
    outputs: Sequence[tuple[str, str | Path | None]],
    report: Path | None = None,
    *,
    writes_table: bool = False,
) -> None:
    """Refuse, before anything is read, an output that is one of the inputs: tables, gear, extensions, causes.

    A report is a file of its own name: in its folder no input may be one that a report could replace.
    """
    from mlg_troubleshoot.gear.gear_file import load_gear
    from mlg_troubleshoot.outputs import refuse_inputs_as_outputs
    from mlg_troubleshoot.records import expand

    written = [(option, path) for option, path in outputs if path is not None]
    if report is not None and report.is_dir():
        written += [("--report", path) for path in report.iterdir() if path.suffix.lower() in {".html", ".pdf"}]
    if written or writes_table:
        known = load_gear(gear)
        files = [Path(str(file)) for name in inputs if name not in (None, "-") for file in expand(str(name))]
        files += [
            file for file in known.files if file == known.path or not (writes_table and file == known.indices_file)
        ]
        if writes_table:
            written.append(("--write-table", known.indices_file))
        refuse_inputs_as_outputs(files, written)
