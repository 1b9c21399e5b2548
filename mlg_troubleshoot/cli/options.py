"""Options that several commands share, and how their texts are read."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from copy import copy
from dataclasses import dataclass, fields, is_dataclass, replace
from enum import StrEnum
from functools import partial, wraps
from inspect import Parameter, Signature, get_annotations, signature
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, TypeVar, get_type_hints

import typer

from mlg_troubleshoot.errors import UsageError
from mlg_troubleshoot.gear import DEFAULT_GEAR
from mlg_troubleshoot.units import ClearanceConvention, LengthUnit

if TYPE_CHECKING:
    from mlg_troubleshoot.cli.remembered import Settings
    from mlg_troubleshoot.outputs import OutputFile
    from mlg_troubleshoot.store import Store


_Word = TypeVar("_Word", bound=StrEnum)


class ReportFormat(StrEnum):
    HTML = "html"
    PDF = "pdf"


def report_format(text: str) -> ReportFormat:
    try:
        return ReportFormat(text)
    except ValueError:
        remedy = "Give html or pdf; the HTML report is the accessible form."
        raise UsageError(f"a report cannot be written as {text!r}", remedy) from None


def one_of(kind: type[_Word], text: str, flag: str) -> _Word:
    """Judge a word that must be one of a few."""
    try:
        return kind(text)
    except ValueError:
        raise UsageError(
            f"{flag} {text!r} is not known", f"Give one of {', '.join(kind)}."
        ) from None


class Tails(StrEnum):
    """Whether two spellings of a tail number are one aircraft."""

    SAME = "same"
    APART = "apart"


class PaperSize(StrEnum):
    A4 = "A4"
    LETTER = "Letter"


def _show_version(wanted: bool) -> None:
    # Some releases of typer call this with what stands for "not given": only True is an answer.
    if wanted is True:
        from importlib.metadata import version

        typer.echo(f"mlg {version('mlg-troubleshoot')}")
        raise typer.Exit


Version = Annotated[
    bool,
    typer.Option(
        "--version", callback=_show_version, is_eager=True, help="Show the version and stop."
    ),
]
Gear = Annotated[
    str, typer.Option("--gear", metavar="NAME|TOML", help="Shipped gear or a gear file.")
]
Unit = Annotated[
    LengthUnit | None,
    typer.Option(
        "--unit",
        parser=LengthUnit.parse,
        metavar="in|thou|mm",
        help="Unit of lengths that do not state one.",
    ),
]
Convention = Annotated[
    ClearanceConvention | None,
    typer.Option(
        "--convention",
        parser=ClearanceConvention.parse,
        metavar="RADIAL|DIAMETRAL|TOTAL_PLAY",
        help=(
            "What a clearance reading is, for rows that do not state it. No default: the factor"
            " of 2 changes verdicts."
        ),
    ),
]
Sheet = Annotated[
    str | None, typer.Option("--sheet", help="Worksheet; '*' reads every sheet with inspections.")
]
ColumnMap = Annotated[
    list[str] | None,
    typer.Option(
        "--map",
        metavar="HEADER=COLUMN",
        help="How to read a header, e.g. 'Spiel 3=clearance_3_mm'.",
    ),
]
DecimalComma = Annotated[bool, typer.Option("--decimal-comma", help="0,013 means 0.013.")]
SmallReadingsTrue = Annotated[
    bool,
    typer.Option(
        "--small-readings-true",
        help="Readings below the play of new parts were checked: the unit is right.",
    ),
]
Dates = Annotated[
    str | None,
    typer.Option(
        "--dates", metavar="dmy|mdy|ymd", help="Order of dates that are written as numbers."
    ),
]
Causes = Annotated[
    list[Path] | None,
    typer.Option(
        "--causes",
        metavar="FILE.py",
        help="Your own causes. Runs this file: give only one that you trust.",
    ),
]
Report = Annotated[
    Path | None,
    typer.Option("--report", metavar="DIR", help="Write printable reports to this folder."),
]
Paper = Annotated[
    PaperSize | None, typer.Option("--page", help="Paper size of the report; A4 unless remembered.")
]
Show = Annotated[
    str | None,
    typer.Option(
        "--show", metavar="in|thou|mm", help="Unit to show lengths in; inches unless remembered."
    ),
]
Remember = Annotated[
    bool,
    typer.Option(
        "--remember", help="Keep --show, --page and --map in mlg.toml here, for later runs."
    ),
]
Force = Annotated[
    bool,
    typer.Option(
        "--force",
        help="Replace a file that an earlier run did not write; never an input or a store.",
    ),
]
Json = Annotated[bool, typer.Option("--json", help="Write the result as JSON to stdout.")]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="No progress and no notes.")]


Place = Annotated[
    str | None,
    typer.Option(
        "--store",
        metavar="PATH|URL",
        help="Store of the records; else MLG_STORE, else a file of your own.",
    ),
]
# The flag of a column, what it takes and its help.
ColumnFlags = Mapping[str, tuple[str, str | None, str]]


NoForecast = Annotated[
    bool, typer.Option("--no-forecast", help="Records only, without a forecast: faster.")
]


@dataclass(frozen=True, slots=True)
class OutputOptions:
    """What a command writes in addition to its screen, and how it shows lengths."""

    panel: ClassVar = "Output"

    report: Report = None
    page: Paper = None
    force: Force = False
    show: Show = None
    as_json: Json = False
    quiet: Quiet = False

    def begin(
        self,
        gear: str,
        inputs: Iterable[str | Path | None] = (),
        outputs: Sequence[OutputFile] = (),
        *,
        store: str | None = None,
        tables: Tables | None = None,
        keep: bool = False,
    ) -> Settings:
        """Claim what will be written before anything is read; return how it is shown, and how the
        headers of tables are read.
        """
        from mlg_troubleshoot.cli.claims import claim
        from mlg_troubleshoot.cli.remembered import settings

        claim(gear, inputs, outputs, self.report, store=store, force=self.force)
        columns = {} if tables is None else tables.columns
        return settings(gear, self.show, self.page, columns, keep=keep)

    def seen(self, settings: Settings, entered_in: LengthUnit) -> Settings:
        """Lengths are shown in the unit that a flag or the memory says, or else in that of the
        entry.
        """
        said = self.show or settings.show is not LengthUnit.INCH
        return settings if said else replace(settings, show=entered_in)


@dataclass(frozen=True, slots=True)
class Records:
    """Where records are kept, and the gear that says what their joints are."""

    store: Place = None
    gear: Gear = DEFAULT_GEAR

    @property
    def kept(self) -> Store:
        """The store, in which every content is judged as it is read."""
        from mlg_troubleshoot.gear.gear_file import load_gear
        from mlg_troubleshoot.store import Store
        from mlg_troubleshoot.workflows.kept import KeptGate

        return Store(self.store, judge=KeptGate(load_gear(self.gear)))


@dataclass(frozen=True, slots=True)
class Tables:
    """The gear, and what is declared about the tables that are read."""

    panel: ClassVar = "Input"

    gear: Gear = DEFAULT_GEAR
    unit: Unit = None
    convention: Convention = None
    sheet: Sheet = None
    column_map: ColumnMap = None
    decimal_comma: DecimalComma = False
    small_readings_true: SmallReadingsTrue = False
    dates: Dates = None

    def declared(self, remembered: Mapping[str, str]) -> dict[str, Any]:
        """What a task receives of them, with the headers that are remembered."""
        from mlg_troubleshoot.records.dates import DateOrder

        declared = {each.name: getattr(self, each.name) for each in fields(self)}
        dates = None if self.dates is None else DateOrder.parse(self.dates)
        return {
            **declared,
            "dates": dates,
            "column_map": self.columns,
            "remembered_map": remembered,
        }

    @property
    def columns(self) -> dict[str, str]:
        """What ``--map`` was given, by header."""
        mapped = {}
        for pair in self.column_map or ():
            header, sign, column = pair.rpartition("=")
            if not sign or not header.strip() or not column.strip():
                raise UsageError(
                    f"--map {pair!r} is not HEADER=COLUMN",
                    "Write for example --map 'Spiel 3=clearance_3_mm'.",
                )
            mapped[header.strip()] = column.strip()
        return mapped


def _panel(group: type, name: str) -> str | None:
    """The panel of the help for an option that a group defines."""
    owners = (each for each in group.__mro__ if name in get_annotations(each))
    panel: str | None = next(owners).__dict__.get("panel")
    return panel


def _in_panel(hint: Any, panel: str | None) -> Any:
    """An option in a panel of the help."""
    if panel is None:
        return hint
    kind = hint.__origin__
    option = copy(hint.__metadata__[0])
    option.rich_help_panel = panel
    return Annotated[kind, option]


def flat(command: Callable[..., None]) -> Callable[..., None]:
    """Let a command take options as dataclasses: on the command line each field of one is an
    option, and a field with flags of columns is one option per column.
    """
    hints = get_type_hints(command, include_extras=True)
    groups: dict[str, Any] = {name: hint for name, hint in hints.items() if is_dataclass(hint)}
    shown: list[Parameter] = []
    columns: dict[str, ColumnFlags] = {}

    def show(name: str, default: Any, hint: Any) -> None:
        shown.append(Parameter(name, Parameter.KEYWORD_ONLY, default=default, annotation=hint))

    for name, parameter in signature(command).parameters.items():
        if name not in groups:
            show(name, parameter.default, hints[name])
            continue
        own = get_type_hints(groups[name], include_extras=True)
        # What all commands share stands last.
        for each in sorted(fields(groups[name]), key=lambda each: each in fields(OutputOptions)):
            (flags, *_) = getattr(own[each.name], "__metadata__", ((),))
            panel = _panel(groups[name], each.name)
            if not isinstance(flags, Mapping):
                show(each.name, each.default, _in_panel(own[each.name], panel))
                continue
            columns[each.name] = flags
            for column, (flag, takes, said) in flags.items():
                option = typer.Option(flag, metavar=takes, help=said, rich_help_panel=panel)
                show(column, None, Annotated[str | None, option])

    @wraps(command)
    def run(**given: Any) -> None:
        for name, flags in columns.items():
            typed = {column: given.pop(column) for column in flags}
            given[name] = {column: text for column, text in typed.items() if text is not None}
        for name, group in groups.items():
            given[name] = group(**{each.name: given.pop(each.name) for each in fields(group)})
        command(**given)

    run.__annotations__ = {each.name: each.annotation for each in shown}
    run.__dict__["__signature__"] = Signature(shown)
    return run


commands = partial(typer.Typer, add_completion=False, rich_markup_mode="rich")


def alone(command: Callable[..., None], epilog: str) -> typer.Typer:
    """A command that has no others below it."""
    app = commands()
    app.command(epilog=epilog)(command)
    return app
