"""What a cell can hold, and what a spreadsheet program calls it.

What every kind of file looks like to the reader of tables: sheets with rows of cells; and what a
file that cannot be read is refused with.
"""

from __future__ import annotations

import re
from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from datetime import date, datetime
from enum import StrEnum
from numbers import Real
from typing import NamedTuple

from mlg_troubleshoot.errors import Problem

MAX_ROWS = 100_000
MAX_COLUMNS = 200

NO_VALUE_TEXT = "(formula without a result)"


class OddKind(StrEnum):
    """Kinds of cell that are neither blank nor text nor a plain number, as the codes of the problem
    that each may be.
    """

    ERROR = "cell_error"
    DATE = "cell_is_date"
    BOOLEAN = "cell_is_boolean"
    NO_VALUE = "formula_without_value"
    PADDED = "number shown with leading zeros"
    WORDED = "number_shown_otherwise"


@dataclass(frozen=True, slots=True)
class OddCell:
    """A cell that is neither blank nor text nor a plain number.

    text: what it shows. day: the day, if it is a date that the calendar knows.
    """

    kind: OddKind
    text: str
    day: date | None = None
    number: float | None = None


Filled = str | float | OddCell
Cell = Filled | None
Cells = Sequence[Cell]


def column_letters(index: int) -> str:
    letters = ""
    index += 1
    while index:
        index, rest = divmod(index - 1, 26)
        letters = chr(65 + rest) + letters
    return letters


def show_number(value: float) -> str:
    """Return a number as a spreadsheet program shows it when the column is wide enough."""
    return f"{value:.15g}"


def show(cell: Cell) -> str:
    """Return a cell as text, without the words that only its number format shows."""
    if isinstance(cell, OddCell) and cell.kind is OddKind.WORDED:
        cell = cell.number
    if cell is None:
        return ""
    if isinstance(cell, str):
        return cell
    if isinstance(cell, float):
        return show_number(cell)
    return cell.text


def quote(cell: Cell, limit: int = 300) -> str:
    """Return a cell as text for a message: not endless, and without characters that steer a
    terminal.
    """
    text = cell.text if isinstance(cell, OddCell) else show(cell)
    if len(text) > limit:
        text = text[:limit] + "…"
    return writable(_STEERING.sub(_visible, text))


def first_of(names: Sequence[str]) -> str:
    """The first of several names, and how many more there are."""
    more = [f"{len(names) - 5} more"] if len(names) > 5 else []
    return ", ".join([*names[:5], *more])


def plain_text(text: str) -> str:
    """Return a text without blanks at its ends and without what nobody sees."""
    return text.strip() if text.isascii() else text.translate(_INVISIBLE).strip()


def writable(text: str) -> str:
    """Return a text with the characters made visible that neither XML nor UTF-8 can carry."""
    return UNWRITABLE.sub(_visible, text)


def _visible(match: re.Match[str]) -> str:
    return f"\\x{ord(match[0]):02x}"


UNWRITABLE = re.compile(r"[\x00-\x08\x0b\x0c\x0e-\x1f\ud800-\udfff\ufffe\uffff]")
# What Unicode calls default ignorable: soft hyphens, joiners, marks of direction, fillers.
_INVISIBLE = dict.fromkeys(
    (
        *(0xAD, 0x34F, 0x61C, 0x115F, 0x1160, 0x17B4, 0x17B5, 0x3164, 0xFEFF, 0xFFA0),
        *range(0x180B, 0x1810),
        *range(0x200B, 0x2010),
        *range(0x202A, 0x202F),
        *range(0x2060, 0x2070),
        *range(0xFE00, 0xFE10),
        *range(0xE0000, 0xE0FFF),
    )
)
_STEERING = re.compile(r"[\x00-\x08\x0b\x0c\x0e-\x1f\x7f-\x9f]")
_ELAPSED = re.compile(r"\[[hms]+\]", re.IGNORECASE)
_BUILTIN_DATES = frozenset((*range(14, 23), *range(27, 37), *range(45, 48), *range(50, 59)))
_BUILTIN_CODES = {9: "0%", 10: "0.00%", 11: "0.00E+00", 48: "##0.0E+0"}
# What a number format is made of: words in quotes, a character behind a backslash, the sign of a
# currency, blanks of a width, colours and conditions, the number, the end of a section, the rest.
_PIECE = re.compile(
    r"""
    "(?P<words>[^"]*)" | \\(?P<character>.) | \[\$(?P<currency>[^\]-]*)[^\]]*\] | [_*].
    | \[[^\]]*\] | (?P<number>general|@|e[+-]|[0\#?.,%]+) | (?P<end>;) | (?P<bare>.)
    """,
    re.VERBOSE | re.IGNORECASE | re.DOTALL,
)
_NUMBER_PLACE = "\0"
_END = "\1"
_UNIT_MARKS = frozenset("\"'°″′”’%‰")
_PERCENT, _SCIENTIFIC = "%", "E+"


class NumberFormat(NamedTuple):
    """What a number format makes of a number.

    sections: text of each section, with a mark where the number stands.
    """

    kind: OddKind
    sections: tuple[str, ...] = ()

    @classmethod
    def of(cls, code: str | None, format_id: int = 0) -> NumberFormat | None:
        """Read a format, or take the one that programs know by a number; None if it shows plain
        numbers.
        """
        code = _BUILTIN_CODES.get(format_id) if code is None else code
        if code is None:
            return cls(OddKind.DATE) if format_id in _BUILTIN_DATES else None
        pieces = [*_PIECE.finditer(code)]
        bare = "".join(piece["bare"] or "" for piece in pieces).lower()
        # y, m, d, h and s without quotes stand only in dates and times.
        is_date = any(letter in bare for letter in "ymdhs") and "general" not in code.lower()
        if is_date or _ELAPSED.search(code):
            return cls(OddKind.DATE)
        if len(code) > 1 and set(code) == {"0"}:
            return cls(OddKind.PADDED, (code,))
        numbers = "".join(piece["number"] or "" for piece in pieces).upper()
        for notation in (_PERCENT, _SCIENTIFIC):
            if notation in numbers:
                return cls(OddKind.WORDED, (notation,))
        text = _PIECE.sub(_literal, code)
        if not any(c.isalpha() or c in _UNIT_MARKS for c in text):
            return None
        sections = [*map(str.strip, text.split(_END))]
        if len(sections) > 1 and "@" in code.rpartition(";")[2]:
            sections.pop()
        return cls(OddKind.WORDED, tuple(sections[:3]))

    def cell(self, number: float, *, epoch_1904: bool) -> Cell:
        """Return the cell of a number that is shown so."""
        if not abs(number) < 1e15:
            return number
        if self.kind is OddKind.DATE:
            return date_cell(number, epoch_1904=epoch_1904)
        if self.kind is OddKind.PADDED:
            text = show_number(number).zfill(len(self.sections[0]))
        elif self.sections == (_PERCENT,):
            text = f"{show_number(100.0 * number)}%"
        elif self.sections == (_SCIENTIFIC,):
            text = f"{number:.2E}"
        else:
            # Where the sections differ it is not guessed which is meant: no unit is understood.
            is_zero = number == 0.0 and len(self.sections) > 2
            sections = self.sections[2:] if is_zero else self.sections
            shown = [each.lstrip("-") for each in sections if _NUMBER_PLACE in each] or sections
            text = " or ".join(dict.fromkeys(shown)).replace(_NUMBER_PLACE, show_number(number))
        return OddCell(self.kind, text, None, number)


def _literal(piece: re.Match[str]) -> str:
    """What a piece of a number format shows."""
    literal = piece["words"] or piece["character"] or piece["currency"] or piece["bare"] or ""
    return _NUMBER_PLACE if piece["number"] else _END if piece["end"] else literal


def date_cell(serial: float, *, epoch_1904: bool) -> OddCell:
    # 25569 is 1970-01-01 in the 1900 system, 24107 in the 1904 system.
    days = serial - (24107 if epoch_1904 else 25569)
    # Before March 1900 the 1900 system counts a day that never was; no inspection is that old.
    is_real = serial >= (0 if epoch_1904 else 61)
    try:
        day = date.fromordinal(date(1970, 1, 1).toordinal() + int(days // 1)) if is_real else None
    except (ValueError, OverflowError):
        day = None
    text = f"{show_number(serial)} shown as a date or time" if day is None else day.isoformat()
    return OddCell(OddKind.DATE, text, day, serial)


def typed(value: object) -> Cell:
    """Return a value of Python as the cell of a spreadsheet would hold it."""
    if value is None or (isinstance(value, str) and not value.strip()):
        return None
    if isinstance(value, str):
        return str(value)
    if isinstance(value, tuple | list):
        return "; ".join(map(str, value)) or None
    if isinstance(value, datetime):
        return value.isoformat(sep=" ")
    if isinstance(value, bool) or not isinstance(value, Real | date):
        return OddCell(OddKind.BOOLEAN, str(value))
    return iso_date_cell(value.isoformat()) if isinstance(value, date) else float(value)


def iso_date_cell(text: str) -> OddCell:
    try:
        return OddCell(OddKind.DATE, text[:10], datetime.fromisoformat(text).date())
    except ValueError:
        return OddCell(OddKind.DATE, text)


HEADER_SEARCH_ROWS = 20
_SAVE_AGAIN = "Open it in a spreadsheet program, save it again as .xlsx, and read the copy."
COPY_THE_TABLE = "Copy the inspection table alone into a new workbook and read that."
# Expected, and the remedy; a refusal that knows better says so itself.
_USUAL = {
    "csv_nul": ("plain text", "Enter this row again, or save the table again as CSV (UTF-8)."),
    "csv_quote": (
        "quotation marks in pairs around a whole field",
        "Correct the quotation marks of this row; write inches as 0.013 in.",
    ),
    "file_damaged": ("a whole workbook", _SAVE_AGAIN),
    "file_empty": (
        "a table of inspections",
        "Check that the file was saved and copied completely.",
    ),
    "file_kind": (
        "an .xlsx workbook or a CSV file",
        "Save the table as .xlsx or as CSV (UTF-8) and read that.",
    ),
    "file_not_found": ("an existing file", "Check the path and the spelling."),
    "file_too_large": (
        "a table of inspections",
        "Read the inspection table alone, or split the file.",
    ),
    "file_unreadable": ("a readable file", "Check the path and the permissions."),
    "header_missing": (
        (
            "a header with record_id, tail_no, side and clearances in the first"
            f" {HEADER_SEARCH_ROWS} rows"
        ),
        "Use the workbook that 'mlg template' writes, or name the columns with --map.",
    ),
    "no_rows": (
        "at least one row below the header, or a filled-in form",
        "Enter the inspections and save the file.",
    ),
    "not_a_table": (
        "a CSV file in UTF-8, UTF-16 or Windows-1252, or an .xlsx workbook",
        "Save the table as .xlsx or as CSV (UTF-8) and read that.",
    ),
    "password_protected": (
        "a workbook without a password",
        "Save a copy without the password and read the copy.",
    ),
    "xml_declaration": ("a workbook as a spreadsheet program writes it", _SAVE_AGAIN),
}


class FileRefusedError(Exception):
    """A file or a sheet that cannot be read as a table; caught inside this package and made a
    `Problem`.
    """

    def __init__(
        self,
        code: str,
        found: str,
        expected: str = "",
        remedy: str = "",
        *,
        sheet: str | None = None,
        row: int | None = None,
        cell: str | None = None,
    ) -> None:
        super().__init__(found)
        usual = _USUAL.get(code, ("", ""))
        said = expected or usual[0], remedy or usual[1]
        self.problem = Problem(code, None, sheet, row, None, cell, found, *said)


NumberedRow = tuple[int, Cells]
MergedRange = tuple[int, int, int, int]
# Said of a workbook that holds some.
MACROS = "the workbook holds macros: they are ignored, the values are read"


class Sheet(ABC):
    """A table of cells; its name is None in CSV, which alone has a delimiter of its fields.

    What is noticed in addition to the values while the rows are read:

    hidden_rows: rows with something in them that are hidden or filtered out, counted from 1.
    formulas, struck: number of formula results, and of cells that are struck through, by column,
    counted from 0.
    faulty: rows that cannot be read although the file can, with the reason.
    """

    def __init__(self, name: str | None = None, *, hidden: bool = False) -> None:
        self.name = name
        self.hidden = hidden
        self.delimiter: str | None = None
        self.hidden_rows: set[int] = set()
        self.formulas: Counter[int] = Counter()
        self.struck: Counter[int] = Counter()
        self.faulty: dict[int, FileRefusedError] = {}

    @abstractmethod
    def rows(self) -> Iterator[NumberedRow]:
        """Read the rows that are not blank, with their numbers counted from 1."""

    @property
    def merged(self) -> Sequence[MergedRange]:
        """Return merged ranges as first row, first column, last row, last column (rows from 1,
        columns from 0).
        """
        return ()


@dataclass
class Workbook:
    """A file with one or more tables of cells.

    kind: ``csv``, ``xlsx``, ``xlsm`` or ``xls``.
    """

    kind: str
    sheets: Sequence[Sheet]
    notes: list[str] = field(default_factory=list)
