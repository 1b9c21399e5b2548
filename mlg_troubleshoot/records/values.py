"""Cell values read as lengths, numbers, names and dates; what cannot be read is a fault with its
remedy. The day and the month of a date are never guessed.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Collection, Mapping
from contextlib import suppress
from datetime import date, datetime, time
from enum import StrEnum
from functools import partial
from typing import Any, TypeVar

from mlg_troubleshoot.decision.columns import CONVENTION, OUTCOME, Column, Holds
from mlg_troubleshoot.decision.inspection import Outcome
from mlg_troubleshoot.errors import UsageError
from mlg_troubleshoot.records.cells import (
    UNWRITABLE,
    Filled,
    OddCell,
    OddKind,
    plain_text,
    show,
    show_number,
)
from mlg_troubleshoot.records.headers import tidy
from mlg_troubleshoot.units import MINUS, ClearanceConvention, LengthUnit, parse_length, vanishes


class DateOrder(StrEnum):
    """The order of day, month and year in a date that is written as numbers."""

    DMY = "dmy"
    MDY = "mdy"
    YMD = "ymd"

    @property
    def words(self) -> str:
        """The order in full."""
        names = {"d": "day", "m": "month", "y": "year"}
        return "-".join(names[letter] for letter in self.value)

    @classmethod
    def parse(cls, text: str) -> DateOrder:
        """Read an order as a flag states it."""
        try:
            return cls(text.strip().lower())
        except ValueError:
            raise UsageError(
                f"--dates {text!r} is not an order of dates", "Give dmy, mdy or ymd."
            ) from None


_MONTHS = ("jan", "feb", "mar", "apr", "may", "jun", "jul", "aug", "sep", "oct", "nov", "dec")
_MONTH = (
    r"jan(?:uary)?|feb(?:ruary)?|mar(?:ch)?|apr(?:il)?|may|june?|july?|aug(?:ust)?|sept?(?:ember)?|oct(?:ober)?"
    r"|nov(?:ember)?|dec(?:ember)?"
)
_WORDED_DAY = re.compile(
    rf"(?:(?<!\w)(?P<day>\d{{1,2}})[\s.\-/]*(?P<month>{_MONTH})|(?P<first>{_MONTH})[\s.\-/]*(?P<second>\d{{1,2}}),?\s)"
    r"[\s.,\-/]*(?P<year>\d{4}|\d{2})",
    re.IGNORECASE | re.ASCII,
)
_MONTH_ALONE = re.compile(
    rf"\b(?:{_MONTH})\b(?:[\s.\-/']*\d{{2,4}}\b)?|\b\d{{4}}-\d{{2}}\b", re.IGNORECASE | re.ASCII
)
_CLOCK = r"(?:[T ]\d{2}:\d{2}(?::\d{2}(?:\.\d+)?)?(?:Z|[+\-]\d{2}:?\d{2})?)?"
_ISO_DAY = re.compile(rf"(\d{{4}}-\d{{2}}-\d{{2}}){_CLOCK}|((?:19|20)\d{{6}})", re.ASCII)
_NUMBERS = re.compile(rf"(\d{{1,4}})([./\-])(\d{{1,2}})\2(\d{{1,4}}){_CLOCK}", re.ASCII)


def find_day(text: str) -> str:
    """The part of a text that is a day, or only a month; empty without one."""
    patterns = _ISO_DAY, _WORDED_DAY, _NUMBERS, _MONTH_ALONE
    found = next(filter(None, (p.search(text) for p in patterns)), None)
    return found[0] if found is not None else ""


def days_of(text: str) -> dict[DateOrder, date] | None:
    """The days that a text may mean, by the order of its numbers: of every order where it says
    which number is which, none where the calendar does not have it; None for another text.
    """
    numbers = _NUMBERS.fullmatch(text)
    worded = _WORDED_DAY.fullmatch(text)
    if iso := _ISO_DAY.fullmatch(text):
        day = (iso[1] or iso[2]).replace("-", "")
        orders = dict.fromkeys(DateOrder, (day[:4], day[4:6], day[6:]))
    elif worded is not None:
        month = _MONTHS.index((worded["month"] or worded["first"])[:3].lower()) + 1
        day = worded["day"] or worded["second"]
        orders = dict.fromkeys(DateOrder, (worded["year"], f"{month}", day))
    elif numbers is not None:
        first, sign, second, third = numbers.groups()
        orders = {DateOrder.YMD: (first, second, third)}
        if len(first) <= 2:
            orders = {DateOrder.DMY: (third, second, first), DateOrder.MDY: (third, first, second)}
            # Nobody writes a short year first with points between.
            if len(third) <= 2 and sign != ".":
                orders[DateOrder.YMD] = (first, second, third)
    else:
        return None
    days = {}
    for order, (year, month_no, day_no) in orders.items():
        with suppress(ValueError):
            if len(year) in (2, 4):
                century = 2000 if len(year) == 2 else 0
                days[order] = date(century + int(year), int(month_no), int(day_no))
    return days


_T = TypeVar("_T")


class CellFaultError(Exception):
    """A cell that does not hold what its column needs; caught by the row reader and made a
    `Problem`.

    days: of a date whose numbers may be read in several orders, the day by each.
    """

    def __init__(
        self,
        code: str,
        expected: str,
        remedy: str = "",
        days: Mapping[DateOrder, date] | None = None,
    ) -> None:
        super().__init__(code)
        self.code = code
        self.expected = expected
        self.days = days or {}
        self.remedy = remedy or _USUAL[code]


# The remedy by the code of a fault; a fault that knows better says so itself.
_USUAL = {
    "cell_is_boolean": "The cell holds TRUE or FALSE. Enter the value.",
    "cell_is_date": (
        "The cell is formatted as a date or time; a fraction such as 1/8 is turned into one. Format"
        " the cell as a number (or text) and enter the value again."
    ),
    "date_ambiguous": (
        "The order of day and month is not guessed. Enter year-month-day, for"
        " example 2026-03-04, or state the order with --dates dmy, mdy or ymd."
    ),
    "date_in_the_future": "Check the year, and the clock of this computer.",
    "date_invalid": "Enter year-month-day, for example 2026-03-04.",
    "date_out_of_range": "Check the year.",
    "date_serial": (
        "The cell holds a bare number. Format it as a date, or enter year-month-day as text."
    ),
    "formula_without_value": (
        "The formula has never been calculated. Open the file in a spreadsheet program, save it, "
        "read it again."
    ),
    "length_negative": (
        "It cannot be less than zero. Enter the value as measured, or leave it blank if it was not "
        "measured."
    ),
    "not_a_number": "Enter a plain number, or leave it blank if it is not known.",
    "not_finite": "Enter a number, or leave it blank if it was not measured.",
    "number_shown_otherwise": (
        "The cell shows something else than the number it holds. Format it as text and enter it"
        " again."
    ),
    "number_lost_digits": (
        "A spreadsheet keeps 15 digits of a number. Format the cell as text and enter it again."
    ),
    "outcome_unknown": "Enter RETRACTED or FAILED, or leave it blank if it is not known.",
    "out_of_range": "Check the number and the unit, or leave it blank if it is not known.",
    "text_control_character": "It contains a line break or an invisible character. Enter it again.",
    "text_unwritable": "It contains a character that cannot be stored. Enter the text again.",
    "unit_missing": (
        "The unit is missing. Write it with the value (0.013 in, 13 thou, 0.33 mm) or in the"
        " header (_in, _thou, _mm), or pass --unit."
    ),
}


_SIGNED = re.compile(rf"^\s*([{MINUS}+])\s*(?=[\d.,])")
_BEGINS = re.compile(rf"[{MINUS}+]?\s*[.,]?\d")
_COMMA_NUMBER = re.compile(r"\s*[+\-]?\d*,\d+(?![\d,.])[^,.]*")
_UNCLEAR_GROUP = re.compile(r"[+\-]?[1-9]\d{0,2}[,.]\d{3}")
_PLAIN = re.compile(r"[+\-]?(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][+\-]?\d+)?", re.ASCII)
_NOT_FINITE = re.compile(r"[+\-]?\s*(nan|inf|infinity|1\.#\w+)", re.IGNORECASE)

# What people write where nothing was measured; the error value #N/A is not one of them.
_BLANK_WORDS = (
    "-|--|\u2010|\u2011|\u2012|\u2013|\u2014|\u2212|n/a|na|n.a.|nm|n/m|n.m.|nil|none|not measured"
    "|not taken|not done|not applicable|not accessible"
)
NOT_MEASURED = frozenset(_BLANK_WORDS.split("|"))
# What they write for a tail that they do not know; NA and NONE may be tails.
_NO_NAME_WORDS = "n/a|n.a.|unknown|not known|tbd|tba|ditto|do.|do|idem|id.|same|as above"
NO_NAME = frozenset(_NO_NAME_WORDS.split("|"))


def odd_cell_fault(cell: OddCell, expected: str) -> CellFaultError:
    """Return the fault of a cell that holds an error, a date, a truth value or nothing that was
    computed.
    """
    if cell.kind is OddKind.ERROR:
        said = f"The cell shows the error {cell.text}, which is not the same as not measured."
        return CellFaultError(
            "cell_error",
            expected,
            f"{said} Enter the value, or empty the cell if it was not measured.",
        )
    return CellFaultError(cell.kind if cell.kind in _USUAL else "cell_is_boolean", expected)


def read_length(
    cell: Filled,
    unit: LengthUnit | None,
    declared: LengthUnit | None,
    *,
    signed: bool,
    decimal_comma: bool,
    expected: str,
) -> tuple[float, LengthUnit, str]:
    """Read a length in its own unit or that of its column, which must agree, or else in the
    declared one.
    """
    text = plain_text(show(cell))
    value, written = _parse(cell, decimal_comma, expected, partial(_length, expected, unit))
    if value < 0 and not signed:
        raise CellFaultError("length_negative", expected)
    if written is not None and unit is not None and written is not unit:
        same = f"{unit.from_inches(written.to_inches(value)):.6g}"
        who = "cell"
        plain = "enter the number without a unit"
        if not isinstance(cell, str):
            who = "number format of the cell"
            plain = "format the cell as a plain number"
        raise CellFaultError(
            "unit_contradiction",
            f"{expected}, in the unit of the column ({unit.value})",
            f"The {who} says {written.value}, the column says {unit.value}. If the cell is right,"
            f" enter {same} ({unit.value}); if the column is right, {plain}.",
        )
    found = written or unit or declared
    if found is None:
        raise CellFaultError("unit_missing", f"{expected} with its unit")
    return found.to_inches(value), found, text


def _parse(
    cell: Filled,
    decimal_comma: bool,
    expected: str,
    parse: Callable[[str, str], tuple[float, LengthUnit | None]],
) -> tuple[float, LengthUnit | None]:
    """The number of a cell, and the unit that `parse` finds next to it in the text that is entered
    or shown, which it takes whole and without a sign and with a point.
    """
    value = math.nan
    unit = None
    shown = cell if isinstance(cell, str) else ""
    if isinstance(cell, OddCell) and cell.kind is OddKind.WORDED:
        shown = cell.text
        decimal_comma = False
    if shown:
        text = plain_text(shown)
        if _NOT_FINITE.fullmatch(text):
            raise CellFaultError("not_finite", expected)
        sign = _SIGNED.match(text)
        body = text if sign is None else text[sign.end() :]
        if decimal_comma and _COMMA_NUMBER.fullmatch(body):
            body = body.replace(",", ".")
        value, unit = parse(text, body)
        value = value if sign is None or sign[1] == "+" else -value
    if isinstance(cell, float):
        value = cell
    elif isinstance(cell, OddCell):
        if cell.kind not in (OddKind.PADDED, OddKind.WORDED) or cell.number is None:
            raise odd_cell_fault(cell, expected)
        value = cell.number
    if not math.isfinite(value):
        raise CellFaultError("not_finite", expected)
    return value, unit


def _length(
    expected: str, unit: LengthUnit | None, text: str, body: str
) -> tuple[float, LengthUnit | None]:
    try:
        written = parse_length(body)
    except UsageError:
        raise _length_fault(text, body, expected, unit) from None
    return written.value, written.unit


_EXAMPLES = {LengthUnit.INCH: "0.013", LengthUnit.THOU: "13", LengthUnit.MILLIMETRE: "0.33"}


def _comma_fault(text: str, expected: str) -> CellFaultError:
    remedy = (
        f"If the comma is the decimal mark, enter {text.replace(',', '.')} or pass --decimal-comma."
    )
    return CellFaultError("decimal_comma", f"{expected}, with a decimal point", remedy)


def _length_fault(text: str, body: str, expected: str, unit: LengthUnit | None) -> CellFaultError:
    if _COMMA_NUMBER.fullmatch(body):
        return _comma_fault(text, expected)
    fraction = re.fullmatch(r"(?:(\d+)\s+)?(\d{1,9})\s*/\s*(\d{0,8}[1-9]\d{0,8})(\D.*)?", body)
    if fraction:
        whole, above, below, _ = fraction.groups()
        share = int(above) / int(below)
        value = f"{above}/{below} in = {LengthUnit.THOU.from_inches(share):.1f} thou"
        if whole:
            value = f"write {whole}{f'{share:g}'.lstrip('0')}"
        return CellFaultError("fraction", expected, f"Fractions are not read: {value}.")
    # A unit beside the number is refused where the header states another: the example is in the
    # header's.
    example = (
        f"{_EXAMPLES[unit]} ({unit.value})" if unit is not None else "0.013 in, 13 thou or 0.33 mm"
    )
    remedy = f"Enter a number, for example {example}, or leave it blank if it was not measured."
    return CellFaultError("not_a_length", expected, remedy)


def read_value(
    column: Column,
    cell: Filled,
    header: str = "",
    *,
    decimal_comma: bool = False,
) -> Any:
    """Read a cell of a column that holds neither a length nor a date."""
    if column.holds is Holds.NUMBER:
        return _read_number(column, cell, decimal_comma)
    if column.holds is Holds.YES_NO:
        if (answer := _yes_no(cell)) is None:
            raise CellFaultError("not_yes_or_no", "yes or no", "Enter yes or no.")
        return answer
    if column is OUTCOME:
        return _read_outcome(cell, header)
    if column.choices is not None:
        return _read_choice(column, cell)
    if not column.carried:
        return read_text(cell, column.asked, required=True)
    shown = (OddKind.DATE, OddKind.BOOLEAN, OddKind.WORDED)
    is_shown = isinstance(cell, OddCell) and cell.kind in shown
    return show(cell) if is_shown else read_text(cell, column.asked)


def _read_number(column: Column, cell: Filled, decimal_comma: bool) -> float:
    expected = column.asked
    unit = column.unit.lstrip("°").lower()
    unclear = decimal_comma and isinstance(cell, str)
    value, _ = _parse(cell, decimal_comma, expected, partial(_number, expected, unit, unclear))
    if not column.low <= value <= column.high:
        raise CellFaultError("out_of_range", expected)
    if unit == "landings" and (value % 1.0 or _UNCLEAR_GROUP.fullmatch(show(cell).strip())):
        remedy = "Landings are whole: enter them without a separator for thousands."
        raise CellFaultError("ambiguous_number", expected, remedy)
    return value


def _number(
    expected: str, unit: str, decimal_comma: bool, text: str, body: str
) -> tuple[float, None]:
    if unit and text.lower().endswith(unit):
        text, body = (each[: -len(unit)].rstrip("° ") for each in (text, body))
    if ("," in text or decimal_comma) and _UNCLEAR_GROUP.fullmatch(text):
        remedy = (
            f"{text!r} may be a thousand or a fraction. Enter it without a separator for thousands."
        )
        raise CellFaultError("ambiguous_number", expected, remedy)
    if _COMMA_NUMBER.fullmatch(body):
        raise _comma_fault(text, expected)
    if not _PLAIN.fullmatch(body) or vanishes(body, float(body)):
        raise CellFaultError("not_a_number", expected)
    return float(body), None


def read_text(cell: Filled, expected: str, *, required: bool = False) -> str:
    """Read an identifier or another text; numbers keep the digits they show."""
    if isinstance(cell, str):
        if cell.isascii() and cell.isprintable():
            return cell.strip()
        text = plain_text(cell)
        if UNWRITABLE.search(text):
            raise CellFaultError("text_unwritable", expected)
        if required and any(ord(c) < 32 or 127 <= ord(c) < 160 for c in text):
            raise CellFaultError("text_control_character", expected)
        return text
    if isinstance(cell, float):
        if not math.isfinite(cell) or abs(cell) >= 1e15:
            raise CellFaultError("number_lost_digits", expected)
        return show_number(cell)
    if cell.kind is OddKind.PADDED:
        return cell.text
    raise odd_cell_fault(cell, expected)


def _read_choice(column: Column, cell: Filled) -> StrEnum:
    """Read one of a few words, in upper or lower case."""
    choices = column.words_taken
    if isinstance(cell, str) and cell in choices:
        return choices[cell]
    text = plain_text(cell) if isinstance(cell, str) else ""
    name = re.sub(r"[\s\-]+", "_", text).casefold()
    alike = {word.casefold(): choice for word, choice in choices.items()}
    found = alike.get(name) or (column.spelt(text) if column.spelt is not None else None)
    if column is CONVENTION:
        found = found or convention_word(text)
    if found is not None:
        return found
    if isinstance(cell, OddCell):
        raise odd_cell_fault(cell, column.asked)
    hint = column.hints.get(text.casefold())
    remedy = f"Enter {hint} if that is meant." if hint else f"Enter {column.asked}."
    raise CellFaultError(f"{column.filled}_unknown", column.asked, remedy)


def _each(words: str, meaning: _T) -> dict[str, _T]:
    return dict.fromkeys(words.split("|"), meaning)


_YES_NO = {
    **_each("yes|y|true|1|ja|j|oui|si|sí|sim|\u2713|\u2714", True),
    **_each("no|n|false|0|nein|non|não|nao|nee|\u2717|\u2718", False),
}


def _yes_no(cell: Filled) -> bool | None:
    if isinstance(cell, OddCell) and cell.kind is not OddKind.BOOLEAN:
        return None
    return _YES_NO.get(show(cell).strip().casefold())


_OUTCOME_WORDS = {
    **_each("retracted|retracts|ok|okay|pass|passed|good|normal|satisfactory", Outcome.RETRACTED),
    **_each(
        "failed|fail|fails|failure|failed to retract|did not retract|not retracted|ng|nok|not ok"
        "|nicht ok|nio|nicht in ordnung|u s|unserviceable|defekt|ausfall|did not lock"
        "|did not lock up|no good|unsatisfactory|reject|rejected|stuck|jammed|hung|hung up"
        "|failed retraction|unretracted|no retraction|kaputt|nicht eingefahren|échec|échoué"
        "|fallo|falló|fallito|mislukt",
        Outcome.FAILED,
    ),
}


def in_words(text: str) -> str:
    """A text as plain words: lower case, one blank for whatever stands between them."""
    return re.sub(r"[\W_]+", " ", tidy(text).replace(".", "")).strip()


_TELLS_FAILURE = re.compile(
    r"(?<!no )(?<!not )(?<!never )(?<!without )"
    r"\b(?:failed|(?:did|does|would|could|can)(?:not| not|n t| t) (?:retract|lock up|come up)"
    r"|(?:unable|refused) to retract|(?:gear|leg|mlg|lh|rh) (?:is |was |got )?(?:hung|stuck|jammed)"
    r"|not retracted|retracted no|no retraction|nicht eingefahren)\b"
)


def says_failed(text: str) -> bool:
    """Whether a text says that the gear failed, wherever it stands and whatever follows."""
    words = in_words(text)
    return _OUTCOME_WORDS.get(words) is Outcome.FAILED or _TELLS_FAILURE.search(words) is not None


# Words of a reading that somebody wrote outside its column; a day is not one.
_JOINT_SAID = re.compile(r"\b(?:joints?|jt|plunger|clearance|gelenk)\b|#\s*\d", re.IGNORECASE)
_FRACTION = re.compile(
    r"(?<!unit: )(?<!units: )(?<![\d.,/\-])\d{0,3}[.,]\d+(?![\d.,/\-])|\d\s*(?:thou|mm)\b",
    re.IGNORECASE,
)


def says_reading(text: str) -> bool:
    """Whether a text names a joint or the plunger, and a number that may be its reading."""
    return _JOINT_SAID.search(text) is not None and _FRACTION.search(text) is not None


def may_be_outcome(cell: Filled, *, asked: bool | None) -> bool:
    """Whether a cell may say what the gear did: whatever is not plainly good where its header asks
    for that, else an answer to a question that is not known or one that doubts itself; nothing
    where the header asks for something else.
    """
    text = show(cell)
    found = _OUTCOME_WORDS.get(in_words(text))
    is_doubted = "?" in text and found is not None
    if asked:
        good = found is Outcome.RETRACTED or text.strip().casefold() in NOT_MEASURED
        return is_doubted or not good
    is_answer = not text.strip().isdigit() and _yes_no(cell) is not None
    return asked is not None and (is_doubted or is_answer)


def answers_outcome(header: str, cell: Filled) -> bool:
    """Whether a header asks what the gear did, and a cell says yes or no to it."""
    return _yes_no(cell) is not None and re.search(r"fail|retract", in_words(header)) is not None


def written_number(cell: Filled, *, decimal_comma: bool) -> tuple[float, LengthUnit | None]:
    """The number in a cell with its unit, NaN where it is not a plain number or a length."""
    if isinstance(cell, OddCell):
        return (math.nan if cell.number is None else cell.number), None
    if isinstance(cell, str):
        cell = plain_text(cell).lstrip("<>=≤≥ ")
        if not _BEGINS.match(cell):
            return math.nan, None
    try:
        return _parse(cell, decimal_comma, "", partial(_length, "", None))
    except CellFaultError:
        return math.nan, None


_CONVENTION_SAID = re.compile(r"\b(?:(radial)|(diametral|diametric)(?:al)?|(total play))(?:ly)?\b")


def convention_word(text: str) -> ClearanceConvention | None:
    """The convention that a text names, wherever it stands; None where it names several."""
    said = {match.lastindex or 0 for match in _CONVENTION_SAID.finditer(in_words(text))}
    is_clear = said == {1} or (said and 1 not in said)
    return [*ClearanceConvention][min(said) - 1] if is_clear else None


# Questions about the gear, by words of a header.
_ASKS_FAILURE = re.compile(
    r"fail|ausfall|versag|panne|échec|\b(?:no|not|nicht|non) (?:retract|eingefahren|rentr|ok|pass)"
)
_ASKS_SUCCESS = re.compile(r"retract|eingefahren|rentré|\bpass|\bok\b")


def _read_outcome(cell: Filled, header: str) -> Outcome:
    """Read what the gear did; yes and no count only where the header asks a question (`Retracted?`,
    `Failed?`).
    """
    if isinstance(cell, str):
        words = "?" if "?" in cell else in_words(cell)
        found = _OUTCOME_WORDS.get(words)
        # A sentence that says both, or a number, is not taken for either.
        if found is None and says_failed(words) and not re.search(r"(?<!not )retracted|\d", words):
            found = Outcome.FAILED
        if found is not None:
            return found
    question = in_words(header)
    asks_failure = _ASKS_FAILURE.search(question) is not None
    said = _yes_no(cell) if asks_failure or _ASKS_SUCCESS.search(question) else None
    if said is None:
        if isinstance(cell, OddCell):
            raise odd_cell_fault(cell, "RETRACTED or FAILED")
        raise CellFaultError("outcome_unknown", "RETRACTED or FAILED")
    return Outcome.FAILED if said is asks_failure else Outcome.RETRACTED


def read_date(cell: Filled, order: DateOrder | None = None, latest: date = date.max) -> date:
    """Read a day: ISO 8601, a month as a word, numbers in one order, or a cell that is formatted as
    a date.

    A day after `latest` is refused. Numbers of which only one order makes a day need no `order`;
    without one the fault of others has their days.
    """
    expected = "a date such as 2026-03-04 (year-month-day) or 4 Mar 2026"
    if isinstance(cell, float):
        raise CellFaultError("date_serial", expected)
    if isinstance(cell, OddCell):
        if cell.kind is not OddKind.DATE:
            raise odd_cell_fault(cell, expected)
        days = {} if cell.day is None else {DateOrder.YMD: cell.day}
    else:
        known = days_of(plain_text(cell))
        if known is None:
            raise CellFaultError("date_invalid", expected)
        days = {each: day for each, day in known.items() if order in (None, each)}
        if not days:
            in_order = f" in the order {order.words}" if order and known else ""
            no_such_day = "The calendar does not have this day."
            raise CellFaultError("date_invalid", f"{expected}{in_order}", no_such_day)
        # A day to come is not one that was meant, where another reading is.
        days = {each: day for each, day in days.items() if day <= latest} or days
    if len(set(days.values())) > 1:
        raise CellFaultError("date_ambiguous", expected, days=days)
    day = next(iter(days.values()), date.min)
    if not 1950 <= day.year <= 2100:
        raise CellFaultError("date_out_of_range", expected)
    if day > latest:
        raise CellFaultError("date_in_the_future", f"{expected}, not after {latest.isoformat()}")
    return day


def read_moment(cell: Filled, order: DateOrder | None = None, latest: date = date.max) -> date:
    """Read a day, with its time where the cell states one."""
    day = read_date(cell, order, latest)
    clock = re.search(
        r"[T ](\d{2}:\d{2}(?::\d{2}(?:\.\d{1,6})?)?(?:Z|[+\-]\d{2}:?\d{2})?)", show(cell)
    )
    if clock is None:
        return day
    try:
        return datetime.combine(day, time.fromisoformat(clock[1]))
    except ValueError:
        remedy = "Enter the time as hours and minutes, for example 2026-03-04 14:30."
        expected = "a time from 00:00 to 23:59 after the date"
        raise CellFaultError("date_invalid", expected, remedy) from None


def read_joints(cell: Filled, numbers: Collection[int]) -> tuple[int, ...]:
    """Read joint numbers in any of the ways people list them: ``3 5``, ``#3, #5``, ``3;5``."""
    expected = f"numbers of joints from {min(numbers)} to {max(numbers)}, for example 3 5"
    # Looked up as text: int refuses thousands of digits.
    known = {str(number): number for number in numbers}
    words = re.split(r"[\s,;#]+|\band\b", plain_text(show(cell)))
    found = [word for word in words if word]
    unknown = [word for word in found if word.lstrip("0") not in known]
    if isinstance(cell, OddCell) and cell.kind is not OddKind.PADDED:
        raise odd_cell_fault(cell, expected)
    if unknown:
        remedy = f"{unknown[0]!r} is not a joint of this gear. Enter numbers with blanks between."
        raise CellFaultError("joints_unknown", expected, remedy)
    return tuple(sorted({known[word.lstrip("0")] for word in found}))
