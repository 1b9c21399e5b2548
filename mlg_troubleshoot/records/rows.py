"""One data row read and checked: an inspection, or a row that says what to correct.

Several columns of numbers for one joint: which hold what was found, and of which visit.

A heading such as ``found``, ``actual`` or ``today`` names a reading; ``nominal``, ``limit`` or
``last year`` a number that is given next to it. A side, a day, or ``as left`` names the visit.

What goes into reading a table, and what comes out of it.

Readings whose size fits another unit better: a pin hardly has less play than in new parts.

A row is compared with the play of new parts that the gear file states, by the mean ratio of its
non-zero readings; `tests/records/test_unit_confusions.py` counts what the numbers catch.
"""

from __future__ import annotations

import math
import re
import zlib
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from datetime import date, timedelta
from enum import IntEnum
from functools import lru_cache
from operator import itemgetter
from pathlib import PurePath
from typing import Any, NamedTuple

from mlg_troubleshoot.decision.columns import (
    AXIAL_FLOAT,
    CLEARANCE,
    CONVENTION,
    DATE,
    GAUGE_U,
    IDENTITY,
    JOINT,
    MEASURED_AGAIN,
    OUTCOME,
    PLUNGER_DISPLACEMENT,
    RECORD_ID,
    SIDE,
    SMALL_READINGS_TRUE,
    TAIL_NO,
    UNIT,
    Column,
    Holds,
)
from mlg_troubleshoot.decision.inspection import (
    EnteredClearance,
    Inspection,
    InvalidRow,
    Outcome,
    RowSource,
    Side,
)
from mlg_troubleshoot.errors import Problem
from mlg_troubleshoot.gear.gear import DEFAULT_GAUGE_U_IN, ROUNDING_IN, Gear
from mlg_troubleshoot.records.cells import (
    Cell,
    Cells,
    FileRefusedError,
    Filled,
    OddCell,
    column_letters,
    plain_text,
    quote,
    show,
    writable,
)
from mlg_troubleshoot.records.headers import (
    UNKNOWN,
    Field,
    Joints,
    Recognition,
    asks_outcome,
    suspect,
    tidy,
)
from mlg_troubleshoot.records.values import (
    NO_NAME,
    NOT_MEASURED,
    CellFaultError,
    DateOrder,
    answers_outcome,
    convention_word,
    days_of,
    find_day,
    may_be_outcome,
    read_date,
    read_joints,
    read_length,
    read_moment,
    read_value,
    says_failed,
    says_reading,
    written_number,
)
from mlg_troubleshoot.results import JsonOutput
from mlg_troubleshoot.units import (
    SLIPS,
    UNIT_SPELLINGS,
    ClearanceConvention,
    Length,
    LengthUnit,
    Sentence,
)


@dataclass(frozen=True, slots=True)
class Occasion:
    """Whose readings they are, as far as a heading says; the day as it is written."""

    side: Side | None = None
    day: str = ""
    is_left: bool = False

    def __str__(self) -> str:
        """As it stands in a record id."""
        return " ".join(filter(None, (self.side, self.day, "as left" * self.is_left)))


ONE_VISIT = Occasion()


@dataclass(frozen=True, slots=True)
class Heading:
    """A heading taken apart; `rest` is what the words of readings and visits leave of it.

    is_reading: whether it names what was found, not a number that is given next to it; None if it
    does not say.
    """

    is_reading: bool | None = None
    visit: Occasion = ONE_VISIT
    rest: str = ""

    @property
    def is_bare(self) -> bool:
        """Whether nothing but a unit is left."""
        return {*re.findall(r"[^\W_]+", self.rest)} <= _NO_MATTER

    @property
    def is_said(self) -> bool:
        return self.is_reading is not None or self.visit != ONE_VISIT


_FILLERS = "value|values|gear|side|mlg|at|on|the|of|wert|column"
_NO_MATTER = {*UNIT_SPELLINGS, *_FILLERS.split("|")}


def _phrases(text: str) -> re.Pattern[str]:
    return re.compile(rf"\b(?:{text})\b")


_LEFT = _phrases("as[ -]?left|after(?: (?:repair|work|rework|overhaul|restoration))?|nachher")
_READING = _phrases(
    "(?:as[ -])?found(?: today| now)?|actual|today|now|current(?:ly)?|(?:as )?measured"
    "|measurements?|readings?|before(?: (?:repair|work))?|ist|istwert|gefunden|gemessen|heute"
    "|vorher|mesurée?s?|relevée?s?|results?"
)
# The largest of several readings is not a limit.
_MOST = "(?:max|min)(?:imum)?"
_REFERENCE = _phrases(
    "(?:last|previous|prior|prev)(?: (?:year|month|time|visit|inspection|check|reading))?"
    "|new (?:parts?|clearance|bush(?:ing)?)|(?:as|when) new|nom|nominal|neuteile?|vorjahr|ref"
    "|reference|soll|sollwert|sollmaß|grenzwert|grenzmaß|dev|deviation|diff|difference|delta"
    rf"|(?:{_MOST} )?(?:(?:wear|repair|service|drawing|upper|lower) )?limits?(?: {_MOST})?"
    rf"|(?:{_MOST} )?(?:drawing|dwg|tol|tolerance|spec|specification|allow(?:ed|able)|permitted"
    rf"|permissible)(?: {_MOST})?"
)
_SIDE = re.compile(
    r"\b(?:[lr]/?h|left|right|port|stbd|starboard)\b(?: hand\b)?(?: side\b| gear\b)?|^[lr]$"
)
# A side, or what was left; not what remains of a life or a margin.
_OPEN = re.compile(r"(?<!landings )(?<!cycles )(?<!margin )\bleft\b(?! (?:hand|side|gear))")


def take_apart(text: str, beside: str = "") -> Heading:
    """What a heading says of the numbers below it; two words that contradict say nothing.

    beside: the headings next to it: left is a side where one says right, and else what was left
    where one says found.
    """
    rest = re.sub(r"\s*_+\s*", " ", tidy(text))
    day = find_day(rest)
    rest = rest.replace(day.casefold(), " ") if day else rest
    is_left = _LEFT.search(rest) is not None
    rest = _LEFT.sub(" ", rest)
    is_open = _OPEN.search(rest) is not None and "right" not in beside
    if is_open:
        rest = _OPEN.sub(" ", rest)
        is_left = _READING.search(beside) is not None or _SIDE.search(rest) is not None
    # "Reading" is part of "last reading".
    is_reference = _REFERENCE.search(rest) is not None
    rest = _REFERENCE.sub(" ", rest)
    is_reading = _READING.search(rest) is not None
    rest = _READING.sub(" ", rest)
    sides = {Side.spelt(word) for word in _SIDE.findall(rest)}
    rest = re.sub(
        r"[\s(\[,;:/-]+$|^[\s)\],;:/-]+|\(\s*\)", "", " ".join(_SIDE.sub(" ", rest).split())
    )
    if len(sides) > 1 or is_reference + is_reading + is_left > 1 or is_open > is_left:
        return Heading(rest=rest)
    kind = not is_reference if is_reference or is_reading or is_left else None
    return Heading(kind, Occasion(next(iter(sides), None), day, is_left), rest)


def visits_of(headings: Sequence[Heading]) -> list[Occasion | None]:
    """The visit that each of several columns of one quantity is a reading of, None for a number
    that is only given next to it; empty where that cannot be decided.
    """
    read = [each for each in headings if each.is_reading is not False]
    visits = {each.visit for each in read}
    sides = {visit.side for visit in visits}
    is_clear = len(headings) == 1 or all(each.is_said for each in read)
    if not read or not is_clear or len(visits) < len(read) or (None in sides and len(sides) > 1):
        return []
    return [None if each.is_reading is False else each.visit for each in headings]


_WORDS: Mapping[str, Callable[[str], object]] = {
    "unit": LengthUnit.parse,
    "convention": ClearanceConvention.parse,
    "dates": DateOrder.parse,
}


@dataclass(frozen=True, slots=True, kw_only=True)
class TableOptions:
    """What the user declares about tables.

    Parameters
    ----------
    unit : LengthUnit or None
        Unit of lengths that do not say one.
    convention : ClearanceConvention or None
        Convention of rows that do not say one.
    sheet : str or None
        Worksheet to read; ``*`` reads every sheet that holds inspections, None takes the only one.
    column_map : mapping of str to str
        Column by header (or by letter), for headers that are not understood: ``{"Spiel 3":
        "clearance_3_mm"}``; the target ``carry`` lets a column travel to the report unread.
    shared_map : mapping of str to str
        The same for several tables: a header that is absent is not reported.
    decimal_comma : bool
        True if ``0,013`` means 0.013.
    small_readings_true : bool
        True if readings below the play of new parts were checked: they were read in the unit that
        is stated.
    dates : DateOrder or None
        Order of day, month and year in dates that are written as numbers; None takes it from the
        column.
    side : Side or None
        Side of every row of a table without a column of sides; None takes it from the name of the
        sheet or the file.
    """

    unit: LengthUnit | None = None
    convention: ClearanceConvention | None = None
    sheet: str | None = None
    column_map: Mapping[str, str] = field(default_factory=dict)
    shared_map: Mapping[str, str] = field(default_factory=dict)
    decimal_comma: bool = False
    small_readings_true: bool = False
    dates: DateOrder | None = None
    side: Side | None = None

    def __post_init__(self) -> None:
        """Take a unit, a convention and an order of dates as people write them."""
        for name, read in _WORDS.items():
            said = getattr(self, name)
            if isinstance(said, str):
                object.__setattr__(self, name, read(said))


@dataclass(frozen=True, slots=True, kw_only=True, repr=False, eq=False)
class TableResult(JsonOutput):
    """What a task tells of the tables that it read.

    Parameters
    ----------
    gear : Gear
        The gear.
    problems : tuple of Problem
        What is wrong with the input.
    notes : tuple of str
        Notes on the input as a whole.
    unread : tuple of str
        Those of the notes that say what of the input was not read.
    unread_files : tuple of str
        Files that were given and hold no row that could be read.
    inputs_sha256 : mapping of str to str
        Hash of each input file by name.
    """

    gear: Gear
    problems: tuple[Problem, ...] = ()
    notes: tuple[str, ...] = ()
    unread: tuple[str, ...] = ()
    unread_files: tuple[str, ...] = ()
    inputs_sha256: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, kw_only=True)
class ReadOptions(TableOptions):
    """What is declared about tables, and what the gear says of the values in them.

    joints: numbers and names of the joints, by which headers are understood.
    clearance_hard_max_in, clearance_confirm_above_in: a radial clearance above the one is refused,
    above the other accepted with a warning. [in]
    plunger_hard_max_in: a measured plunger displacement beyond this, either way, is refused. [in]
    new_part_in, limit_in: radial clearance of a new part, and the largest one allowed, by joint;
    empty where no gear says them. [in]
    margin_in: largest displacement that the gear allows; infinite where no gear says it. [in]
    asks: a person is there to confirm what is unusual.
    """

    joints: Joints = field(default_factory=Joints)
    clearance_hard_max_in: float = 0.050
    clearance_confirm_above_in: float = 0.015
    plunger_hard_max_in: float = 0.5
    new_part_in: Mapping[int, float] = field(default_factory=dict)
    limit_in: Mapping[int, float] = field(default_factory=dict)
    margin_in: float = math.inf
    asks: bool = False

    def range_in(self, column: Column) -> tuple[float, float]:
        """Least and largest length that a column can hold, radial. [in]"""
        high = {
            CLEARANCE: self.clearance_hard_max_in,
            PLUNGER_DISPLACEMENT: self.plunger_hard_max_in,
        }.get(column, column.high)
        return max(column.low, -high), high

    @classmethod
    def of(cls, gear: Gear, tables: TableOptions | None = None, **declared: Any) -> ReadOptions:
        given = tables or TableOptions()
        names = [each.name for each in fields(TableOptions)]
        return cls(
            **{name: getattr(given, name) for name in names} | declared,
            joints=Joints.of(gear),
            new_part_in={joint.number: joint.new_part.value for joint in gear.joints},
            margin_in=gear.margin.value,
            limit_in={joint.number: joint.limit.value for joint in gear.joints},
            clearance_hard_max_in=gear.hard_limit.value,
            clearance_confirm_above_in=gear.confirm_above.value,
        )


class CellPlace(NamedTuple):
    """Where a problem stands, as far as it has a place."""

    row: int | None = None
    header: str | None = None
    cell: str | None = None

    @classmethod
    def at(cls, row: int, index: int, header: str) -> CellPlace:
        return cls(row, header, f"{column_letters(index)}{row}")

    @property
    def letters(self) -> str:
        """The column."""
        return (self.cell or "").rstrip("0123456789")


NOWHERE = CellPlace()


@dataclass(frozen=True, slots=True)
class TableInHand:
    """The table or form that is being read: how, where it stands, and who receives its
    problems.
    """

    options: ReadOptions
    file: str | None
    sheet: str | None
    report: Callable[[Problem], None]

    def tell(
        self, code: str, value: str | None, expected: str, remedy: str, place: CellPlace
    ) -> None:
        self.report(Problem(code, self.file, self.sheet, *place, value, expected, remedy))

    def tell_fault(self, fault: CellFaultError, raw: Cell, place: CellPlace) -> None:
        found = None if raw is None else quote(raw)
        self.tell(fault.code, found, fault.expected, fault.remedy, place)


class SheetLayout(NamedTuple):
    """Where the parts of a table were found, and how its columns were read.

    header_row: the lower row of the header, counted from 1, or the one by which a form is called.
    """

    file: str | None
    sheet: str | None
    kind: str
    header_row: int
    width: int
    columns: Sequence[PlacedField]

    def place(self, names: Collection[str | None], row: int) -> tuple[str, str] | None:
        """Header of a column with one of the canonical names, and its cell in a row or a form."""
        for p in self.columns:
            if p.read_as in names:
                at = row if p.place.row == self.header_row else p.place.row
                return p.header, f"{p.place.letters}{at}"
        return None


class FileRead(NamedTuple):
    """One file as read; a DataFrame has the labels of its rows, whatever they are."""

    name: str
    kind: str
    sha256: str | None
    rows: int
    labels: Sequence[object] = ()


@dataclass(frozen=True, slots=True)
class ReadResult:
    """Everything that came out of one or more files, in their order: no row is lost, each problem
    stands once.

    unread: those of the notes that say what was not read.
    """

    rows: tuple[Inspection | InvalidRow, ...]
    problems: tuple[Problem, ...]
    notes: tuple[str, ...] = ()
    layouts: tuple[SheetLayout, ...] = ()
    files: tuple[FileRead, ...] = ()
    unread: tuple[str, ...] = ()
    unread_sheets: tuple[str, ...] = ()

    @property
    def inputs_sha256(self) -> dict[str, str]:
        """Hash of each file that could be opened, by its name."""
        return {file.name: file.sha256 for file in self.files if file.sha256 is not None}

    @property
    def unread_files(self) -> tuple[str, ...]:
        """The files that no row came from, and the sheets of others that hold inspections and were
        left out.
        """
        return (*(file.name for file in self.files if not file.rows), *self.unread_sheets)

    @property
    def of_tables(self) -> dict[str, Any]:
        """What a `TableResult` tells of what was read, by its fields."""
        told = ("problems", "notes", "unread", "unread_files", "inputs_sha256")
        return {name: getattr(self, name) for name in told}

    @property
    def inspections(self) -> tuple[Inspection, ...]:
        return tuple(row for row in self.rows if isinstance(row, Inspection))


# Below this ratio to new parts a reading is clearly too small. Inches taken for millimetres stay
# below it unless the joints are worn beyond their limits on average (0.6 x 25.4 x 0.0005 in =
# 0.0076 in). A row whose mean lies between this and new parts may be of a new gear, or of a gear
# with its joints worn out on average that was read in another unit: it is asked about.
_TOO_SMALL = 0.6
# Fewer readings than this do not show what the others of the row were read in.
_FEWEST = 3
# A plunger reading in thou is asked about as one in millimetres only up to this size: above it
# both are usual. [in]
_PLUNGER_NEAR_ZERO_IN = 0.0025
# No reading of a clearance is smaller. [in]
_SMALLEST_IN = 0.0001
CONFIRM_SMALL = "Correct the unit, or confirm the readings: yes in a column small_readings_true."


class UnitFit(IntEnum):
    """How the readings of a row fit the unit that is stated: what matters most stands last."""

    FITS = 0
    LARGE = 1
    DOUBTFUL = 2
    TOO_SMALL = 3


class RowUnit(NamedTuple):
    """How the readings of a row fit their unit, the joints whose readings do not, and what to ask
    about them.
    """

    scale: UnitFit = UnitFit.FITS
    joints: tuple[int, ...] = ()
    question: str = ""


def judge_unit(
    radial_in: Mapping[int, float],
    entered: Mapping[int, EnteredClearance],
    convention: ClearanceConvention,
    options: ReadOptions,
) -> RowUnit:
    """Judge whether the readings of a row can have been read in the unit that is stated. [in]"""
    units: dict[LengthUnit, dict[int, float]] = {}
    for joint, value in radial_in.items():
        if value > 0.0 and options.new_part_in.get(joint, 0.0) > 0.0:
            units.setdefault(entered[joint].unit, {})[joint] = value
    several = len(radial_in) >= _FEWEST
    fits = [
        _judge_stated(read, unit, units.keys() & _larger(unit), convention, options, several)
        for unit, read in units.items()
    ]
    return max(fits, key=lambda fit: (fit.scale, len(fit.joints)), default=RowUnit())


def _judge_stated(
    read: Mapping[int, float],
    stated: LengthUnit,
    larger: Collection[LengthUnit],
    convention: ClearanceConvention,
    options: ReadOptions,
    several: bool,
) -> RowUnit:
    """Judge the readings of a row that state one unit; others of the row state larger ones. [in]

    several: True if the row has enough readings, zeros included, to be asked about as a whole.
    """
    ratios = {joint: value / options.new_part_in[joint] for joint, value in read.items()}
    mean = sum(ratios.values()) / len(ratios)
    enough = len(read) >= _FEWEST
    small = tuple(joint for joint, ratio in ratios.items() if ratio < _TOO_SMALL)
    scale = UnitFit.FITS
    if stated is LengthUnit.INCH:
        # No unit is larger: single readings say nothing, a row of them may be of another
        # convention.
        small = small if enough and mean < _TOO_SMALL else ()
    elif mean < _TOO_SMALL:
        scale = UnitFit.TOO_SMALL if enough else UnitFit.DOUBTFUL
    elif any(_plausible(tuple(read), read, stated, unit, options) for unit in larger):
        scale = UnitFit.DOUBTFUL
        small = tuple(read)
    elif several and mean < 1.0 - ROUNDING_IN:
        scale = UnitFit.DOUBTFUL
        small = tuple(joint for joint, ratio in ratios.items() if ratio < 1.0)
    if small:
        return RowUnit(scale, small, _small_question(small, read, stated, convention, options))
    over = tuple(joint for joint, value in read.items() if value > options.limit_in[joint])
    mostly_over = sum(read.values()) > sum(options.limit_in[joint] for joint in read)
    if stated is LengthUnit.THOU or not enough or not mostly_over:
        return RowUnit()
    other = LengthUnit.MILLIMETRE if stated is LengthUnit.INCH else LengthUnit.THOU
    question = (
        f"{_readings(over, read)} above the limit: {_asked(over)} {other.words}, not in"
        f" {stated.words}?"
    )
    if convention is ClearanceConvention.RADIAL:
        question += " Or is it a diametral clearance or total play, not radial (factor 2)?"
    return RowUnit(UnitFit.LARGE, over, question)


def plunger_question(displacement_in: float, stated: LengthUnit, options: ReadOptions) -> str:
    """Ask about a plunger reading that would be outside the margin in a larger unit. [in]"""
    number = stated.from_inches(displacement_in)
    others = [
        unit.words
        for unit in _larger(stated)
        if (unit is LengthUnit.INCH or abs(displacement_in) <= _PLUNGER_NEAR_ZERO_IN)
        and options.margin_in < abs(unit.to_inches(number)) <= options.plunger_hard_max_in
    ]
    if not others:
        return ""
    confirm = "" if options.asks else f" {CONFIRM_SMALL}"
    read = f"read in {' or '.join(others)}, not in {stated.words}"
    return Sentence.of(
        "the plunger reading of {} {} is {}: was it {}?{}",
        f"{number:g}",
        stated,
        Length(displacement_in),
        read,
        confirm,
    )


def _larger(stated: LengthUnit) -> list[LengthUnit]:
    return [unit for unit in LengthUnit if unit.per_inch < stated.per_inch]


def _small_question(
    joints: tuple[int, ...],
    read: Mapping[int, float],
    stated: LengthUnit,
    convention: ClearanceConvention,
    options: ReadOptions,
) -> str:
    new_in = options.new_part_in[joints[0]] * convention.per_radial
    below = all(read[joint] < options.new_part_in[joint] for joint in joints)
    kind = convention.words
    said = (
        f"{_readings(joints, read)} {'below' if below else 'near'} the play of new parts "
        f"({stated.from_inches(new_in):.4g} {stated} {kind})"
    )
    larger = _larger(stated)
    others = [unit for unit in larger if _plausible(joints, read, stated, unit, options)] or larger
    if others:
        names = " or ".join(unit.words for unit in others)
        confirm = "" if options.asks else f" {CONFIRM_SMALL}"
        return f"{said}: {_asked(joints)} {names}, not in {stated.words}?{confirm}"
    is_radial = convention is ClearanceConvention.RADIAL
    factor = "" if is_radial else ", or is it a radial clearance (factor 2)"
    return f"{said}: is the decimal point misplaced{factor}?"


def _plausible(
    joints: tuple[int, ...],
    read: Mapping[int, float],
    stated: LengthUnit,
    other: LengthUnit,
    options: ReadOptions,
) -> bool:
    """Whether the readings would be those of a gear, had they been read in the other unit."""
    mean_in = other.to_inches(
        stated.from_inches(sum(read[joint] for joint in joints) / len(joints))
    )
    return (
        options.new_part_in[joints[0]] * _TOO_SMALL <= mean_in <= options.clearance_confirm_above_in
    )


def _readings(joints: tuple[int, ...], read: Mapping[int, float]) -> str:
    named = ", ".join(f"#{joint}" for joint in joints)
    if len(read) == 1:
        return f"the reading of joint {joints[0]} is"
    return f"{len(joints)} of {len(read)} readings ({named}) {'are' if len(joints) > 1 else 'is'}"


def _asked(joints: tuple[int, ...]) -> str:
    return "were they read in" if len(joints) > 1 else "was it read in"


def scale_slip(
    value_in: float,
    unit: LengthUnit,
    convention: ClearanceConvention,
    plausible_max_in: float,
    *,
    halves: bool = True,
) -> str:
    """Name the slip of unit, decimal point or convention that would bring a value into the usual
    range.
    """
    entered = unit.from_inches(value_in * convention.per_radial)
    slips = [
        (
            factor,
            f"{entered:.4g} {other} would be {entered / factor:.4g} {unit}: was it read in"
            f" {other.words} (factor {factor:.4g})?",
        )
        for other in LengthUnit
        if (factor := other.per_inch / unit.per_inch) > 1.0
        and (other is not LengthUnit.THOU or entered >= 1.0)
    ]
    if halves and convention is ClearanceConvention.RADIAL:
        question = "Is it a diametral clearance or total play (factor 2)? Then say so in"
        slips.append((SLIPS["convention"].factor, f"{question} clearance_convention."))
    ten = SLIPS["point"].factor
    question = f"Is the decimal point misplaced (factor {ten:g})? It would be"
    slips.append((ten, f"{question} {entered / ten:.4g} {unit}."))
    return " ".join(
        question
        for factor, question in slips
        if _SMALLEST_IN <= value_in / factor <= plausible_max_in
    )


_REMEMBERED = 20_000
_MISSING_CONVENTION = (
    "RADIAL, DIAMETRAL or TOTAL_PLAY",
    (
        "Say how the clearances were taken, in the column clearance_convention or with"
        " --convention: RADIAL is the offset of the centres, DIAMETRAL is bore minus pin,"
        " TOTAL_PLAY is the dial reading."
    ),
)
_FIELDS = frozenset(each.name for each in fields(Inspection))


# What no word of an outcome, a convention or a unit is: one with a digit, such as a work order.
_CODE = re.compile(r"(?=..)\S*\d\S*")
_MONTHS = 12
_MADE_FROM_A_ROW = re.compile(r"-\d+-[0-9a-f]{8}\Z")


def is_made_for_row(record_id: str) -> bool:
    """Whether an id was made for a row of a table that states none."""
    return _MADE_FROM_A_ROW.search(record_id) is not None


# A clearance of which only an end was found; a no-go gauge did not enter, a go gauge did.
_END = re.compile(r"(?:(?P<below><=?|≤|no[ -]?go)|(?:>=?|≥|go))\s*(?=[\d.,])", re.IGNORECASE)
# That sign, or its word, in a cell of its own.
_ABOVE = re.compile(r"[>≥]=?|(?:more|greater|larger) than|above|over")
# What is short of mid-position is negative, however it was written.
_UNDER = re.compile(r"under[ _-]?travel", re.IGNORECASE)
_NO_END = "Measure with a gauge that reaches further, or leave it blank if it was not measured."


@lru_cache(4096)
def _tells_failure(header: str, cell: Filled) -> bool:
    """Whether a cell says that the gear failed, or answers whether it did; one word with a digit
    is a code.
    """
    text = cell if isinstance(cell, str) else ""
    if _CODE.fullmatch(text):
        return False
    # The rows of a long table are carried together.
    return any(map(says_failed, text.split("; "))) or answers_outcome(header, cell)


@lru_cache(4096)
def spoken(cell: Filled) -> tuple[ClearanceConvention | None, LengthUnit | None, bool]:
    """The convention or the unit that a cell is, and whether it says above of a number."""
    is_word = isinstance(cell, str) and not _CODE.fullmatch(cell)
    text = plain_text(show(cell)).lower() if is_word else ""
    return convention_word(text), UNIT_SPELLINGS.get(text), _ABOVE.fullmatch(text) is not None


@dataclass(slots=True)
class PlacedField:
    """A column of a table in hand, or a line of a form: its header, and what that means.

    is_settled: what it means was declared, or follows from the columns next to it. is_misread: its
    header names a column that bears a verdict, and it was declared to be another. visit: whose
    readings it holds, where a table holds those of several visits. found: what its header was
    understood as by itself.
    """

    index: int
    header: str
    field: Field | None
    refused: bool = False
    place: CellPlace = NOWHERE
    is_settled: bool = False
    is_misread: bool = False
    visit: Occasion | None = None
    found: Recognition = UNKNOWN

    @property
    def column(self) -> Column | None:
        """What it holds, refused or not; None if it is only carried."""
        return None if self.field is None else self.field.column

    @property
    def read_as(self) -> str | None:
        """Canonical column; None if it is refused or only carried."""
        return None if self.field is None or self.refused else self.field.name


# How a length is read, whichever joint it is of; equal cells of one kind are one length: the
# column, its unit, and whether it must be above zero.
_LengthKind = tuple[Column, LengthUnit | None, bool]


@dataclass(slots=True)
class Row:
    """The cells of one inspection, wherever they stand on the sheet.

    places: of the cells, where they are not those of the row. visit: whose readings they are.
    is_left: whether those as found stand in the same row. bad, warnings, questions: what was
    noticed while the cells were gathered; `bad` names headers.
    """

    number: int
    cells: list[Cell]
    places: list[CellPlace] = field(default_factory=list)
    visit: Occasion = ONE_VISIT
    is_left: bool = False
    bad: list[str] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)
    questions: list[str] = field(default_factory=list)


@dataclass(slots=True)
class _Found:
    """What the cells of one row say; lengths as entered and what each is in inches.

    scale: without its convention a reading is checked as the largest radial value that it may be.
    """

    convention: ClearanceConvention | None
    scale: ClearanceConvention
    values: dict[Column, Any] = field(default_factory=dict)
    carried: dict[str, str] = field(default_factory=dict)
    lengths: dict[Column, dict[int, float]] = field(default_factory=dict)
    entered: dict[int, EnteredClearance] = field(default_factory=dict)
    plunger: list[tuple[float, LengthUnit]] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)


class RowReader:
    """Reads the rows of one table, each bad cell reported once.

    is_several: True if the readings of several visits stand next to each other.
    """

    def __init__(
        self, placed: Sequence[PlacedField], table: TableInHand, *, is_several: bool = False
    ) -> None:
        self._table = table
        self._is_several = is_several
        self._options = table.options
        self._placed: dict[int, PlacedField] = {}
        good = [(p.index, p.field) for p in placed if p.field is not None and not p.refused]
        self._refused = [p.index for p in placed if p.refused]
        self._at = {known.column: index for index, known in reversed(good)}
        # Without a column of record ids a row is named after its place and content.
        self._makes_ids = all(p.column is not RECORD_ID for p in placed)
        # Clearances stand first, in the order of the joints, whatever the order of their columns.
        good.sort(key=lambda each: each[1].number or 0 if each[1].column is CLEARANCE else math.inf)
        self._lengths: list[tuple[int, Field, _LengthKind]] = [
            (index, known, (known.column, known.unit, known.column.is_above_zero(known.number)))
            for index, known in good
            if known.column.is_length
        ]
        # The readings of a fleet repeat: what was understood once is not taken apart again.
        self._length_of = lru_cache(_REMEMBERED)(self._one_length)
        self._value_of = lru_cache(_REMEMBERED)(self._one_value)
        self._others = [
            (index, known.column)
            for index, known in sorted(good, key=itemgetter(0))
            if not known.column.is_length and known.column not in (CONVENTION, UNIT, JOINT)
        ]
        self._blankable = [index for index, known in good if known.column.blank_by_word]
        self._unread: dict[int, str] = {}
        # What is only carried, and may still say that the gear failed or how it was read; with the
        # column of readings that each may be and whether any number may be one.
        self._unread_words: list[tuple[PlacedField, str | None, bool]] = []
        self._matters = lru_cache(_REMEMBERED)(self._may_matter)
        self._add(placed)
        self.not_measured: Counter[str] = Counter()
        self._without_unit: set[str | None] = set()
        # Somewhere it is tomorrow already.
        self._latest = min(date.today(), date.max - timedelta(1)) + timedelta(1)
        self._day_of = lru_cache(self._read_day_of_visit)
        # The dates of the column, and those of rows that wait for the others.
        self._days: set[Cell] = set()
        self._waiting: dict[RowSource, tuple[CellFaultError, Cell, CellPlace]] = {}
        # Those that do not say how they were read.
        self._declared: set[RowSource] = set()

    def _add(self, placed: Iterable[PlacedField]) -> None:
        """Take columns whose cells travel to the report, each under its own name, and are searched
        for what may be a reading or a failure.
        """
        taken = {column.name for column in self._at if column.carried} | {*self._unread.values()}
        for p in placed:
            self._placed[p.index] = p
            column = p.column
            is_unread = column is None or column.carried
            if p.is_misread or (is_unread and not (p.refused or p.is_settled)):
                nearest, is_sure = suspect(p.header, self._options.joints)
                # A column without a header may only number the rows if it is the first one.
                is_sure = is_sure or (not p.header and p.index > 0)
                self._unread_words.append((p, nearest, is_sure))
            if column is not None or p.refused:
                continue
            name = p.header or f"column {p.place.letters}"
            while name in taken:
                name = f"{name} (again)"
            taken.add(name)
            self._unread[p.index] = name

    def read(self, row: Row) -> Inspection | InvalidRow:
        """Read one row; every bad cell is reported once."""
        self._begin(row)
        convention = self._read_convention()
        found = _Found(convention, convention or ClearanceConvention.TOTAL_PLAY)
        self._read_lengths(found, self._read_row_unit())
        self._read_others(found)
        for index, name in self._unread.items():
            if self._cells[index] is not None:
                found.carried[name] = writable(show(self._cells[index]))
        asked = self._unit_questions(found)
        asked += self.ask_about(self._cells, found)
        asked += [each for each in row.questions if each not in asked]
        source = RowSource(self._table.file, self._table.sheet, row.number)
        how = self._at.get(CONVENTION)
        if how is None or self._cells[how] is None:
            self._declared.add(source)
        for index, fault in sorted(self._faults, key=itemgetter(0)):
            if fault.days and index == self._at.get(DATE):
                self._waiting[source] = fault, self._cells[index], self._place(index)
            else:
                self._tell(index, fault)
        identity = {column.name: found.values.pop(column, None) for column in IDENTITY}
        given = {**identity, "convention": found.convention, "source": source}
        # Numbers of a table none of whose headers is a clearance are not facts of a gear.
        is_unknown = bool(asked) and CLEARANCE not in self._at
        if self._bad or row.bad or is_unknown or None in given.values():
            bad = sorted(self._bad)
            named = [*row.bad, *(self._placed[index].header for index in bad)]
            named += [c.name for c in IDENTITY if c not in self._at and identity[c.name] is None]
            named += [CLEARANCE.header(1, LengthUnit.INCH)] if is_unknown else []
            return InvalidRow(
                **identity,
                correct=tuple(dict.fromkeys(named)),
                warnings=(*found.warnings, *row.warnings),
                source=source,
                understood=self._inspection(found, **given),
                cells=tuple(cell for index in bad if (cell := self._place(index).cell)),
            )
        self._warn(found)
        said = (*found.warnings, *row.warnings)
        question = Sentence.joined(asked) if asked else ""
        given |= {"unit_question": question, "warnings": said, "is_left": row.is_left}
        return self._inspection(found, **given)

    @staticmethod
    def _inspection(found: _Found, **given: Any) -> Inspection:
        """What was read of a row; of one that cannot be judged, as far as it could be read."""
        lengths = found.lengths
        per_radial = found.scale.per_radial
        clearance = lengths.pop(CLEARANCE, {})
        gauge_u = lengths.pop(GAUGE_U, {})
        common_u = gauge_u.pop(0, None)
        readings = sorted(lengths.pop(PLUNGER_DISPLACEMENT, {}).items())
        floats = lengths.pop(AXIAL_FLOAT, {})
        said = {column.filled: value for column, value in found.values.items()}
        said.update({column.filled: value[0] for column, value in lengths.items()})
        other = {name: said.pop(name) for name in [*said] if name not in _FIELDS}
        return Inspection(
            clearance_in=clearance,
            entered=found.entered,
            gauge_u_is_default=common_u is None,
            gauge_u_in=DEFAULT_GAUGE_U_IN if common_u is None else common_u / per_radial,
            gauge_u_by_joint_in={j: u / per_radial for j, u in gauge_u.items() if j in clearance},
            readings_in=tuple(value for _, value in readings),
            axial_float_in=floats,
            other_columns=other,
            carried=found.carried,
            **said,
            **given,
        )

    def _read_lengths(self, found: _Found, row_unit: LengthUnit | None) -> None:
        scale = found.scale
        usual = self._options.clearance_confirm_above_in
        for index, of, kind in self._lengths:
            cell = self._cells[index]
            if cell is None:
                continue
            try:
                length, entered = self._length_of(kind, row_unit, scale, cell)
            except CellFaultError as fault:
                self._fault(index, fault)
                continue
            number = of.number or 0
            if of.column is PLUNGER_DISPLACEMENT and _UNDER.search(self._placed[index].header):
                length = -abs(length)
            if entered.bound:
                warning, end = self._at_an_end(number, length, entered)
                found.warnings.append(warning)
                if end is None:
                    continue
                length = end
            found.lengths.setdefault(of.column, {})[number] = length
            if of.column is CLEARANCE:
                found.entered[number] = entered
                if length > usual + ROUNDING_IN:
                    slip = scale_slip(length, entered.unit, scale, usual)
                    facts = str(entered), scale.words, Length.brief(usual * scale.per_radial)
                    said = "joint {}: {} {} is above {}: check the reading.{}"
                    check = Sentence.of(said, number, *facts, f" {slip}" if slip else "")
                    found.warnings.append(check.said_in(entered.unit))
            elif of.column is PLUNGER_DISPLACEMENT:
                found.plunger.append((length, entered.unit))

    def _read_others(self, found: _Found) -> None:
        """Read the cells that are not lengths, and whose they are."""
        row = self._row
        for index, column in self._others:
            cell = self._cells[index]
            is_own = self._placed[index].visit in (None, row.visit)
            if cell is None and not (is_own and column in IDENTITY):
                continue
            if column is DATE:
                self._days.add(cell)
            try:
                value = self._value_of(index, column, cell)
            except CellFaultError as fault:
                self._fault(index, fault)
                continue
            if column.carried:
                found.carried[column.name] = value
            else:
                found.values[column] = value
        side = row.visit.side or self._options.side
        if SIDE in self._at and found.values.get(SIDE, side) is not side and row.visit.side:
            expected = f"{side}, as the headers of its readings say"
            remedy = "Correct the side, or the headers."
            self._fault(self._at[SIDE], CellFaultError("side_contradicts", expected, remedy))
        if self._makes_ids:
            found.values[RECORD_ID] = self._made_id(side)
        elif self._suffix and RECORD_ID in found.values:
            found.values[RECORD_ID] += self._suffix
        if SIDE not in self._at:
            found.values[SIDE] = side
        if row.visit.day:
            found.values[DATE] = self._day_of(row.visit.day)

    def _read_day_of_visit(self, text: str) -> date | None:
        """The day of a visit, as the heading of its readings says it."""
        try:
            return self._read_day(text)
        except CellFaultError as fault:
            self._table.tell_fault(fault, text, CellPlace(self._row.number, DATE.name))
            return None

    def _one_value(self, index: int, column: Column, cell: Cell) -> Any:
        """Read a cell that holds no length."""
        name = cell if column is TAIL_NO and isinstance(cell, str) else "0"
        # Gears that nobody can name are not one gear.
        is_named = any(map(str.isalnum, name)) and plain_text(name).casefold() not in NO_NAME
        if cell is None or not is_named:
            remedy = "Enter it; a row without it cannot be used."
            if column.choices is not None:
                remedy = f"Enter {column.asked}; it has no default."
            raise CellFaultError(f"{column.name}_missing", column.asked, remedy)
        if column is DATE:
            return self._read_day(cell)
        if column.holds is Holds.MOMENT:
            return read_moment(cell, self._options.dates, self._latest)
        if column.holds is Holds.JOINTS:
            return read_joints(cell, self._options.joints.numbers)
        header = self._placed[index].header
        return read_value(column, cell, header, decimal_comma=self._options.decimal_comma)

    def _warn(self, found: _Found) -> None:
        """Say what of a good row is of no use, or unusual."""
        clearance = found.lengths.get(CLEARANCE, {})
        if CLEARANCE in self._at and not clearance:
            found.warnings.append("no clearance is given: no joint was measured")
        elif len(clearance) > 1 and not any(clearance.values()):
            found.warnings.append(
                "every clearance is 0: a zero is read as measured; leave a joint blank if it was"
                " not measured"
            )

    def faulty(self, row: int, cells: Cells, why: FileRefusedError) -> InvalidRow:
        """Refuse a row as a whole."""
        problem = why.problem
        shown = f"{why}: {quote(','.join(map(show, cells)), 80)}"
        self._table.tell(problem.code, shown, problem.expected, problem.remedy, CellPlace(row))
        source = RowSource(self._table.file, self._table.sheet, row)
        return InvalidRow(None, None, None, ("row",), (), source)

    def _begin(self, row: Row) -> None:
        """Take up a row: fill it to the width of the header, and leave out what was not
        measured.
        """
        cells = row.cells
        width = len(self._placed)
        if len(cells) > width:
            # Something stands to the right of the last header.
            places = [CellPlace.at(row.number, i, "") for i in range(width, len(cells))]
            self._add(PlacedField(i, "", None, place=p) for i, p in enumerate(places, width))
        cells += [None] * (width - len(cells))
        for index in self._blankable:
            cell = cells[index]
            # None of the words ends in a digit.
            if cell.__class__ is str and not cell[-1].isdigit():
                word = cell.strip()
                if word.casefold() in NOT_MEASURED:
                    self.not_measured[word] += 1
                    cells[index] = None
        self._row = row
        # What tells the record ids of several visits apart.
        self._suffix = f" {row.visit}".rstrip() if self._is_several else ""
        self._cells = cells
        self._bad = {index for index in self._refused if cells[index] is not None}
        self._faults: list[tuple[int, CellFaultError]] = []

    def ask_about(self, cells: Cells, found: _Found | None = None) -> list[str]:
        """Ask about what stands in columns that are not read: numbers that may be readings, words
        that say that the gear failed or may say what it did, and those of another convention or
        unit. Without `found` it is a row of a long table.
        """
        asked = []
        of_joint = found is None
        found = found or _Found(None, ClearanceConvention.TOTAL_PLAY)
        outcome = found.values.get(OUTCOME)
        units = {entered.unit for entered in found.entered.values()}
        for place, (placed, nearest, is_sure) in enumerate(self._unread_words):
            cell = cells[placed.index]
            if cell is None or not self._matters(place, cell):
                continue
            header = placed.header or placed.place.letters
            is_unread = placed.field is None and (nearest is not None or of_joint)
            is_unread = is_unread or placed.is_misread
            # Under a header that names nothing only a number that may decide is asked about, or any
            # number where no header is a clearance.
            is_named = nearest or is_sure or of_joint or CLEARANCE not in self._at
            smallest = 0.0 if is_named else min(self._options.limit_in.values(), default=0.0)
            any_number = is_sure or units == {LengthUnit.THOU}
            said, unit, is_above = spoken(cell)
            is_said = not placed.header and says_reading(show(cell))
            is_length = self._may_be_length(cell, smallest, is_sure=any_number)
            if is_unread and (is_said or is_length):
                target = nearest or CLEARANCE.name
                meant = f'a reading, pass --map "{header}={target}" (a length with its unit)'
                if _UNDER.search(header):
                    meant += ", which is then negative"
            elif self._may_say_outcome(placed, cell, outcome):
                meant = f'what the gear did, pass --map "{header}={OUTCOME.name}"'
            elif said and found.convention and said.per_radial != found.convention.per_radial:
                meant = f'the convention, pass --map "{header}={CONVENTION.name}"'
            elif unit is not None and units and unit not in units:
                meant = f'the unit, pass --map "{header}={UNIT.name}"'
            elif is_above:
                meant = "of a reading, write > in front of its number"
            else:
                continue
            other = "rename the column" if placed.is_misread else f'"{header}=carry"'
            asked.append(
                f"{header!r} is not read and says {quote(cell, 40)}: if it is {meant}; else"
                f" {other}."
            )
        return asked

    def _may_matter(self, place: int, cell: Filled) -> bool:
        """Whether a cell of a column that is not read may be asked about in any row."""
        placed = self._unread_words[place][0]
        is_length = self._may_be_length(cell, 0.0, is_sure=True)
        is_length = is_length or says_reading(show(cell))
        return is_length or any(spoken(cell)) or self._may_say_outcome(placed, cell, None)

    def _may_say_outcome(self, placed: PlacedField, cell: Filled, outcome: Outcome | None) -> bool:
        """Whether an unread cell says that the gear failed or, where no outcome is known, may say
        what it did.
        """
        if outcome is Outcome.FAILED:
            return False
        if _tells_failure(placed.header, cell):
            return True
        is_open = outcome is None and placed.field is None and not placed.is_misread
        return is_open and may_be_outcome(cell, asked=asks_outcome(placed.header))

    def _may_be_length(self, cell: Filled, above_in: float, *, is_sure: bool) -> bool:
        """Whether a cell holds a length of a usual size: any number, or only a fraction or one
        with its unit.
        """
        # What is asked about may have either point.
        comma = self._options.decimal_comma or (isinstance(cell, str) and "," in cell)
        value, unit = written_number(cell, decimal_comma=comma)
        if unit is not None:
            units = [unit]
        elif is_sure:
            units = [*LengthUnit]
        else:
            units = [LengthUnit.INCH, LengthUnit.MILLIMETRE] if value % 1.0 > 0.0 else []
        most = self._options.plunger_hard_max_in
        return any(above_in < abs(each.to_inches(value)) <= most for each in units)

    def _made_id(self, side: Side | None) -> str:
        # Sheets of both sides may hold the same row.
        cells = [*map(show, self._cells), *filter(None, (side, self._suffix))]
        content = zlib.crc32("\x1f".join(cells).encode("utf-8", "replace"))
        name = PurePath(self._table.file or "-").stem
        return f"{'stdin' if name == '-' else name}-{self._row.number}-{content:08x}"

    def _read_how(self, column: Column, declared: Any) -> Any:
        """Read the cell that says how to read the others, or note its fault; without one take what
        is declared.
        """
        index = self._at.get(column)
        if index is None or self._cells[index] is None:
            return declared
        try:
            return self._one_value(index, column, self._cells[index])
        except CellFaultError as fault:
            self._fault(index, fault)
            return None

    def _read_convention(self) -> ClearanceConvention | None:
        found: ClearanceConvention | None = self._read_how(CONVENTION, self._options.convention)
        index = self._at.get(CONVENTION)
        if found is not None or index in self._bad:
            return found
        fault = CellFaultError("convention_missing", *_MISSING_CONVENTION)
        if index is None:
            self._row.bad.append(CONVENTION.name)
            self._table.tell_fault(fault, None, CellPlace(self._row.number, CONVENTION.name))
        else:
            self._fault(index, fault)
        return None

    def _read_row_unit(self) -> LengthUnit | None:
        unit: LengthUnit | None = self._read_how(UNIT, None)
        for i, of, _ in self._lengths if unit else ():
            if of.unit not in (None, unit) and self._cells[i] is not None:
                expected = f"{of.unit}, as the header {self._placed[i].header!r} says"
                remedy = (
                    "The row and the header name different units. Correct the one that is wrong."
                )
                self._fault(self._at[UNIT], CellFaultError("unit_contradiction", expected, remedy))
                return self._options.unit
        return unit or self._options.unit

    def _one_length(
        self,
        kind: _LengthKind,
        row_unit: LengthUnit | None,
        scale: ClearanceConvention,
        cell: Filled,
    ) -> tuple[float, EnteredClearance]:
        """Read a length that its column can hold; a clearance is radial. [in]"""
        column, unit, above_zero = kind
        low, high = self._options.range_in(column)
        is_clearance = column is CLEARANCE
        # The uncertainty of a gauge is one of the reading: its bound is that of its radial value.
        factor = scale.per_radial if column.scales else 1.0

        def expected(shown: LengthUnit, *, refined: bool = False) -> str:
            top = f"{shown.from_inches(high * factor):.4g} {shown.value}"
            if refined and above_zero:
                return f"a {column.plain} above 0 and up to {top}"
            what = column.expected or column.plain
            return f"{what} from {shown.from_inches(low):.4g} to {top}"

        stated = unit or row_unit or LengthUnit.INCH
        bound = ""
        number = cell
        if is_clearance and isinstance(cell, str) and (end := _END.match(plain_text(cell))):
            bound = "<" if end["below"] else ">"
            number = plain_text(cell)[end.end() :]
        if bound == ">" and self._options.asks:
            raise CellFaultError("not_a_length", expected(stated), _NO_END)
        try:
            value_in, found, text = read_length(
                number,
                unit,
                row_unit,
                signed=column.signed,
                decimal_comma=self._options.decimal_comma,
                expected=expected(stated),
            )
        except CellFaultError as fault:
            if is_clearance and fault.code == "length_negative":
                fault.code = "clearance_negative"
            raise
        beyond = not low - ROUNDING_IN <= value_in / factor <= high + ROUNDING_IN
        if beyond or ((above_zero or bound == "<") and value_in <= 0.0):
            if is_clearance:
                usual = self._options.clearance_confirm_above_in
                slip = scale_slip(value_in / factor, found, scale, usual)
            else:
                radial = ClearanceConvention.RADIAL
                slip = scale_slip(abs(value_in), found, radial, high * factor, halves=False)
            again = "Measure again, or check" if is_clearance else "Check"
            raise CellFaultError(
                f"{column.name}_out_of_range",
                expected(found if is_clearance else stated, refined=True),
                slip or f"{again} the unit and the decimal point.",
            )
        return (value_in / factor if is_clearance else value_in) + 0.0, EnteredClearance(
            text, found, bound
        )

    def _at_an_end(
        self, joint: int, radial_in: float, text: EnteredClearance
    ) -> tuple[str, float | None]:
        """What is counted where only an end of a clearance was found, and its words: the upper end;
        nothing if that is not known and the joint may be within its limit. [in]
        """
        shown = f"joint {joint}: {text.bound}{text.text}"
        if text.bound == "<":
            return f"{shown} is counted as {text.text}, its upper end", radial_in
        if radial_in < self._options.limit_in.get(joint, 0.0) - ROUNDING_IN:
            return f"{shown} may be anything above it: counted as not measured", None
        more = radial_in + 2.0 * ROUNDING_IN
        return f"{shown} is over the limit; how far is not known", more

    def _fault(self, index: int, fault: CellFaultError) -> None:
        """Note a fault; where the cell bears the verdict, the row cannot be judged then."""
        self._faults.append((index, fault))
        column = self._placed[index].column
        if column is None or column.bears_verdict:
            self._bad.add(index)

    def _tell(self, index: int, fault: CellFaultError) -> None:
        placed = self._placed[index]
        if fault.code != "unit_missing":
            self._table.tell_fault(fault, self._cells[index], self._place(index))
        elif self._at.get(UNIT) in self._bad:
            # The row names a unit, and its cell is told of.
            return
        elif placed.place.cell not in self._without_unit:
            self._without_unit.add(placed.place.cell)
            expected = "a unit: in, thou or mm"
            self._table.tell(fault.code, placed.header, expected, fault.remedy, placed.place)

    def _place(self, index: int) -> CellPlace:
        if self._row.places:
            return self._row.places[index]
        return CellPlace.at(self._row.number, index, self._placed[index].header)

    def _read_day(self, cell: Filled) -> date:
        return read_date(cell, self._options.dates, self._latest)

    def settle_dates(self, rows: list[Inspection | InvalidRow]) -> str:
        """Date the rows whose numbers only the other rows of the column explain; what was
        understood is returned.

        Where several orders, or none, fit all dates of the column, the cells are reported and stay
        unread.
        """
        texts = [plain_text(cell) for cell in self._days if isinstance(cell, str)]
        found = [*filter(None, map(days_of, texts))]
        # A day with its month as a word, or a year first, is the same in every order.
        written = [{*days} for days in found if len(days) < 3 or len({*days.values()}) > 1]
        typed = [cell.day.day for cell in self._days if isinstance(cell, OddCell) and cell.day]
        if written and typed and max(typed) <= _MONTHS:
            # A program that expects the other order makes dates of those only that fit both.
            return (
                f"dates whose day is not above {_MONTHS} stand among dates that are text: day and"
                " month may have been swapped when the file was opened. Check them"
            )
        if not self._waiting:
            return ""
        # A year first says nothing of the order of day and month in other cells.
        orders = set(DateOrder).intersection(*(each for each in written if each - {DateOrder.YMD}))
        if len(orders) != 1:
            for waiting in self._waiting.values():
                self._table.tell_fault(*waiting)
            return ""
        (order,) = orders
        for place, row in enumerate(rows):
            if row.source in self._waiting and isinstance(row, Inspection):
                fault, *_ = self._waiting[row.source]
                rows[place] = replace(row, inspection_date=fault.days[order])
        return f"dates are read as {order.words}: no other order fits all dates of the column"

    def settle_conventions(self, rows: list[Inspection | InvalidRow], texts: Iterable[str]) -> None:
        """Ask about the rows that are read as declared, where the texts of the sheet name another
        convention.
        """
        named = {text: said for text in texts if (said := convention_word(text))}
        for place, row in enumerate(rows):
            if not isinstance(row, Inspection) or row.source not in self._declared or not named:
                continue
            taken = row.convention.per_radial if row.convention else None
            if any(said.per_radial == taken for said in named.values()):
                continue
            text = quote(next(iter(named)), 60)
            question = (
                f"the sheet says {text!r}, but the row is read as {row.convention}, as declared:"
                " one of the two is wrong. Correct it."
            )
            asked = filter(None, (question, row.unit_question))
            rows[place] = replace(row, unit_question=Sentence.joined(asked))

    def _unit_questions(self, found: _Found) -> list[str]:
        """Refuse readings that cannot be of the stated unit; return what must be asked before the
        gear is cleared.
        """
        confirmed = self._options.small_readings_true or found.values.get(SMALL_READINGS_TRUE)
        if found.convention is None or confirmed:
            return []
        clearance = found.lengths.get(CLEARANCE, {})
        fit = judge_unit(clearance, found.entered, found.convention, self._options)
        again = {*found.lengths.get(GAUGE_U, {}), *found.values.get(MEASURED_AGAIN, ())}
        if fit.scale is UnitFit.LARGE and again.issuperset(fit.joints):
            fit = RowUnit()
        if fit.scale is UnitFit.TOO_SMALL and not self._options.asks:
            quantity = (CLEARANCE, fit.joints[0])
            index = next(i for i, of, _ in self._lengths if of.quantity == quantity)
            expected = "readings of new or worn parts in the unit that is stated"
            remedy = f"{fit.question[:1].upper()}{fit.question[1:]}"
            self._fault(index, CellFaultError("readings_too_small", expected, remedy))
        elif fit.question:
            found.warnings.append(fit.question)
        plunger = {plunger_question(value, unit, self._options) for value, unit in found.plunger}
        asked = sorted(plunger - {""})
        found.warnings += asked
        if fit.scale >= UnitFit.DOUBTFUL:
            asked.insert(0, fit.question)
        return asked
