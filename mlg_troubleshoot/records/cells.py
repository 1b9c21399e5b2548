"""What a cell can hold, and what a spreadsheet program calls it."""

from __future__ import annotations

import re
from dataclasses import dataclass
from datetime import date, datetime
from enum import StrEnum

MAX_ROWS = 100_000
MAX_COLUMNS = 200

NO_VALUE_TEXT = "(formula without a result)"


class OddKind(StrEnum):
    """Kinds of cell that are neither blank nor text nor a plain number."""

    ERROR = "error"
    DATE = "date"
    BOOLEAN = "boolean"
    NO_VALUE = "formula without a result"
    PADDED = "number shown with leading zeros"


@dataclass(frozen=True, slots=True)
class OddCell:
    """A cell that is neither blank nor text nor a plain number.

    day: the day, if it is a date that the calendar knows.
    """

    kind: OddKind
    text: str
    day: date | None = None
    number: float | None = None


Cell = str | float | OddCell | None


def column_letters(index: int) -> str:
    letters = ""
    index += 1
    while index:
        index, rest = divmod(index - 1, 26)
        letters = chr(65 + rest) + letters
    return letters


LETTERS: tuple[str, ...] = tuple(column_letters(i) for i in range(MAX_COLUMNS))


def show_number(value: float) -> str:
    """Return a number as a spreadsheet program shows it when the column is wide enough."""
    return f"{value:.15g}"


def show(cell: Cell) -> str:
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
    text = show(cell)
    if len(text) > limit:
        text = text[:limit] + "…"
    return writable(_STEERING.sub(_visible, text))


def writable(text: str) -> str:
    """Return a text with the characters made visible that neither XML nor UTF-8 can carry."""
    return UNWRITABLE.sub(_visible, text)


def _visible(match: re.Match[str]) -> str:
    return f"\\x{ord(match[0]):02x}"


UNWRITABLE = re.compile(r"[\x00-\x08\x0b\x0c\x0e-\x1f\ud800-\udfff\ufffe\uffff]")
_STEERING = re.compile(r"[\x00-\x08\x0b\x0c\x0e-\x1f\x7f-\x9f]")
_ELAPSED = re.compile(r"\[[hms]+\]", re.IGNORECASE)
_NOT_CODE = re.compile(r'"[^"]*"|\\.|_.|\*.|\[[^\]]*\]', re.DOTALL)
_BUILTIN_DATES = frozenset((*range(14, 23), *range(27, 37), *range(45, 48), *range(50, 59)))


def is_date_format(format_id: int, code: str | None) -> bool:
    """Tell whether a number format shows a number as a date or a time."""
    if code is None:
        return format_id in _BUILTIN_DATES
    if _ELAPSED.search(code):
        return True
    bare = _NOT_CODE.sub("", code).lower()
    if "general" in bare:
        return False
    # In a plain number format E is the exponent; y, m, d, h and s stand only in dates and times.
    return any(letter in bare for letter in "ymdhs")


def padding_width(code: str | None) -> int:
    """Return how many digits a format such as ``000`` fills up with zeros."""
    return len(code) if code is not None and len(code) > 1 and set(code) == {"0"} else 0


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


def iso_date_cell(text: str) -> OddCell:
    try:
        return OddCell(OddKind.DATE, text[:10], datetime.fromisoformat(text).date())
    except ValueError:
        return OddCell(OddKind.DATE, text)
