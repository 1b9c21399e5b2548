"""Dates as people write them: the day and the month are never guessed."""

from __future__ import annotations

import re
from datetime import date
from enum import StrEnum

from mlg_troubleshoot.errors import UsageError


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


def written_day(text: str) -> date | None:
    """Return a day whose text says which number is which; None for another text, ValueError for no
    such day.
    """
    iso = _ISO_DAY.fullmatch(text)
    if iso is not None:
        return date.fromisoformat(iso[1] or iso[2])
    worded = _WORDED_DAY.fullmatch(text)
    if worded is None:
        return None
    month = _MONTHS.index((worded["month"] or worded["first"])[:3].lower()) + 1
    return date(_year(worded["year"]), month, int(worded["day"] or worded["second"]))


def find_day(text: str) -> str:
    """The part of a text that is a day, or only a month; empty without one."""
    patterns = _ISO_DAY, _WORDED_DAY, _NUMBERS, _MONTH_ALONE
    found = next(filter(None, (p.search(text) for p in patterns)), None)
    return found[0] if found is not None else ""


def readings(text: str) -> dict[DateOrder, date] | None:
    """Return the days that three numbers may mean, by their order; None for another text."""
    found = _NUMBERS.fullmatch(text)
    if found is None:
        return None
    first, sign, second, third = found.groups()
    orders = {DateOrder.YMD: (first, second, third)}
    if len(first) <= 2:
        orders = {DateOrder.DMY: (third, second, first), DateOrder.MDY: (third, first, second)}
        # Nobody writes a short year first with points between.
        if len(third) <= 2 and sign != ".":
            orders[DateOrder.YMD] = (first, second, third)
    days = {}
    for order, (year, month, day) in orders.items():
        try:
            if len(year) in (2, 4):
                days[order] = date(_year(year), int(month), int(day))
        except ValueError:
            continue
    return days


def _year(text: str) -> int:
    return int(text) + (2000 if len(text) <= 2 else 0)
