"""Options that several commands share, and how their texts are read."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Callable
from dataclasses import asdict, dataclass, fields, is_dataclass
from enum import StrEnum
from functools import partial, wraps
from inspect import Parameter, Signature, signature
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TypeVar, get_type_hints

import typer

from mlg_troubleshoot.errors import UsageError
from mlg_troubleshoot.gear import DEFAULT_GEAR
from mlg_troubleshoot.units import ClearanceConvention, LengthUnit

if TYPE_CHECKING:
    from mlg_troubleshoot.store import Store


_Word = TypeVar("_Word", bound=StrEnum)


class ReportFormat(StrEnum):
    HTML = "html"
    PDF = "pdf"


def one_of(kind: type[_Word], text: str, flag: str) -> _Word:
    """Judge a word that must be one of a few."""
    try:
        return kind(text)
    except ValueError:
        raise UsageError(
            f"{flag} {text!r} is not known", f"Give one of {', '.join(kind)}."
        ) from None


class PaperSize(StrEnum):
    A4 = "A4"
    LETTER = "Letter"


def paper_size() -> str:
    """The paper that the environment asks for."""
    return one_of(PaperSize, os.environ.get("MLG_PAGE") or PaperSize.A4, "MLG_PAGE").value


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
    str,
    typer.Option(
        "--gear", metavar="NAME|TOML", envvar="MLG_GEAR", help="Shipped gear or a gear file."
    ),
]
Unit = Annotated[
    LengthUnit | None,
    typer.Option(
        "--unit",
        parser=LengthUnit.parse,
        metavar="in|thou|mm",
        envvar="MLG_UNIT",
        help="Unit of lengths that do not state one.",
    ),
]


def _convention(text: str) -> ClearanceConvention:
    """A convention by its name or a word that the prompts take for it."""
    from mlg_troubleshoot.decision.columns import CONVENTION

    return ClearanceConvention.parse(CONVENTION.hints.get(text.lower(), text))


Convention = Annotated[
    ClearanceConvention | None,
    typer.Option(
        "--convention",
        parser=_convention,
        metavar="RADIAL|DIAMETRAL|TOTAL_PLAY",
        envvar="MLG_CONVENTION",
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
        metavar="HEADER=COLUMN|TOML",
        help="How to read a header, e.g. 'Spiel 3=clearance_3_mm', or a file of such headers.",
    ),
]
DecimalComma = Annotated[bool, typer.Option("--decimal-comma", help="0,013 means 0.013.")]
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
        metavar="FILE.py|FILE.toml",
        help="Your own causes (runs this file: give only one that you trust); for a diagnosis also"
        " prior probabilities and sizes of effects in your fleet.",
    ),
]
Report = Annotated[
    Path | None,
    typer.Option("--report", metavar="DIR", help="Write printable reports to this folder."),
]
Show = Annotated[
    LengthUnit | None,
    typer.Option(
        "--show",
        parser=LengthUnit.parse,
        metavar="in|thou|mm",
        envvar="MLG_SHOW",
        help="Unit to show lengths in; else that of the entry, or inches.",
    ),
]
Force = Annotated[
    bool,
    typer.Option(
        "--force", help="Replace outputs that exist; never an input, a store or a gear file."
    ),
]
Json = Annotated[bool, typer.Option("--json", help="Write the result as JSON to stdout.")]
Quiet = Annotated[
    bool, typer.Option("--quiet", "-q", help="No progress; of the notes only what was not read.")
]


Place = Annotated[
    str | None,
    typer.Option(
        "--store",
        metavar="PATH|URL",
        envvar="MLG_STORE",
        help="Store of the records; else a file of your own.",
    ),
]

NoForecast = Annotated[
    bool, typer.Option("--no-forecast", help="Records only, without a forecast: faster.")
]


@dataclass(frozen=True, slots=True)
class Shown:
    """What a command writes in addition to its screen, and how it shows lengths."""

    report: Report = None
    force: Force = False
    show: Show = None
    as_json: Json = False
    quiet: Quiet = False

    def unit(self, *entered_in: LengthUnit | None) -> LengthUnit:
        """The unit that lengths are shown in; where none is asked for, that of most entries."""
        show, usual = (os.environ.get(name) for name in ("MLG_SHOW", "MLG_UNIT"))
        entered = Counter(filter(None, entered_in)) or {LengthUnit.parse(usual or "in"): 1}
        shown = max(entered, key=entered.__getitem__)
        return self.show or (LengthUnit.parse(show) if show else shown)


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
        from mlg_troubleshoot.workflows.keep import KeptGate

        return Store(self.store, judge=KeptGate(load_gear(self.gear)))


@dataclass(frozen=True, slots=True)
class MeasuredTables:
    """The gear, and what is declared about the tables that a diagnosis reads."""

    gear: Gear = DEFAULT_GEAR
    unit: Unit = None
    convention: Convention = None
    sheet: Sheet = None
    column_map: ColumnMap = None

    @property
    def map_files(self) -> list[str]:
        """Files of headers among what ``--map`` was given."""
        return [given for given in self.column_map or () if given.endswith(".toml")]

    def declared(self) -> dict[str, Any]:
        """What a task receives of them."""
        from mlg_troubleshoot.cli.output import say
        from mlg_troubleshoot.workflows.header_file import read_header_file

        for name, used in (("MLG_UNIT", self.unit), ("MLG_CONVENTION", self.convention)):
            if used is not None and os.environ.get(name, "").upper() == used.upper():
                say(f"Note: {name}={used} counts for rows that do not state it.")
        shared: dict[str, str] = {}
        for file in self.map_files:
            shared.update(read_header_file(Path(file)))
        return {**asdict(self), "column_map": self._columns(), "shared_map": shared}

    def _columns(self) -> dict[str, str]:
        """What ``--map`` was given, by header."""
        mapped = {}
        for pair in self.column_map or ():
            header, sign, column = pair.rpartition("=")
            if pair in self.map_files:
                continue
            if not sign or not header.strip() or not column.strip():
                raise UsageError(
                    f"--map {pair!r} is not HEADER=COLUMN",
                    "Write for example --map 'Spiel 3=clearance_3_mm', or name a TOML file.",
                )
            mapped[header.strip()] = column.strip()
        return mapped


@dataclass(frozen=True)
class Tables(MeasuredTables):
    """The same of tables that are typed by hand: how numbers and dates are written."""

    decimal_comma: DecimalComma = False
    dates: Dates = None


def flat(command: Callable[..., None]) -> Callable[..., None]:
    """Let a command take options as dataclasses: on the command line each field of one is an
    option.
    """
    hints = get_type_hints(command, include_extras=True)
    groups: dict[str, Any] = {name: hint for name, hint in hints.items() if is_dataclass(hint)}
    shown: list[Parameter] = []
    for parameter in signature(command).parameters.values():
        group = groups.get(parameter.name)
        own = get_type_hints(group, include_extras=True) if group else hints
        shown += (
            Parameter(
                each.name, Parameter.KEYWORD_ONLY, default=each.default, annotation=own[each.name]
            )
            for each in (fields(group) if group else [parameter])
        )

    @wraps(command)
    def run(**given: Any) -> None:
        for name, group in groups.items():
            given[name] = group(**{each.name: given.pop(each.name) for each in fields(group)})
        command(**given)

    run.__annotations__ = {each.name: each.annotation for each in shown}
    run.__dict__["__signature__"] = Signature(shown)
    return run


# The help is plain everywhere, and no wider than reads well.
HELP = {"help_option_names": ["-h", "--help"], "max_content_width": 100}
commands = partial(typer.Typer, add_completion=False, rich_markup_mode=None, context_settings=HELP)


def alone(command: Callable[..., None], epilog: str) -> typer.Typer:
    """A command that has no others below it."""
    app = commands()
    app.command(epilog=epilog)(command)
    return app
