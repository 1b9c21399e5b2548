"""Several columns of numbers for one joint: which hold what was found, and of which visit.

A heading such as ``found``, ``actual`` or ``today`` names a reading; ``nominal``, ``limit`` or
``last year`` a number that is given next to it. A side, a day, or ``as left`` names the visit.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

from mlg_troubleshoot.decision.inspection import Side
from mlg_troubleshoot.records.dates import find_day
from mlg_troubleshoot.records.headers import tidy
from mlg_troubleshoot.units import UNIT_SPELLINGS


class Kind(StrEnum):
    """What a heading says of the numbers below it."""

    READING = "reading"
    REFERENCE = "reference"
    UNSAID = "unsaid"


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
    """A heading taken apart; `rest` is what the words of readings and visits leave of it."""

    kind: Kind
    visit: Occasion = ONE_VISIT
    rest: str = ""

    @property
    def is_bare(self) -> bool:
        """Whether nothing but a unit is left."""
        return {*re.findall(r"[^\W_]+", self.rest)} <= _NO_MATTER

    @property
    def is_said(self) -> bool:
        return self.kind is not Kind.UNSAID or self.visit != ONE_VISIT


_FILLERS = "value|values|gear|side|mlg|at|on|the|of|wert|column"
_NO_MATTER = {*UNIT_SPELLINGS, *_FILLERS.split("|")}


def _phrases(text: str) -> re.Pattern[str]:
    return re.compile(rf"\b(?:{text})\b")


_LEFT = _phrases("as[ -]?left|after(?: (?:repair|work|overhaul|restoration))?|nachher")
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
_SIDE = re.compile(r"\b(?:[lr]/?h|left|right|port|stbd|starboard)\b|^[lr]$")


def take_apart(text: str) -> Heading:
    """What a heading says of the numbers below it; two words that contradict say nothing."""
    rest = re.sub(r"\s*_+\s*", " ", tidy(text))
    day = find_day(rest)
    rest = rest.replace(day.casefold(), " ") if day else rest
    is_left = _LEFT.search(rest) is not None
    rest = _LEFT.sub(" ", rest)
    # "Reading" is part of "last reading".
    is_reference = _REFERENCE.search(rest) is not None
    rest = _REFERENCE.sub(" ", rest)
    is_reading = _READING.search(rest) is not None
    rest = _READING.sub(" ", rest)
    sides = {Side.spelt(word) for word in _SIDE.findall(rest)}
    rest = re.sub(
        r"[\s(\[,;:/-]+$|^[\s)\],;:/-]+|\(\s*\)", "", " ".join(_SIDE.sub(" ", rest).split())
    )
    if len(sides) > 1 or is_reference + is_reading + is_left > 1:
        return Heading(Kind.UNSAID, rest=rest)
    kind = Kind.UNSAID
    if is_reference:
        kind = Kind.REFERENCE
    elif is_reading or is_left:
        kind = Kind.READING
    return Heading(kind, Occasion(next(iter(sides), None), day, is_left), rest)


def visits_of(headings: Sequence[Heading]) -> list[Occasion | None]:
    """The visit that each of several columns of one quantity is a reading of, None for a number
    that is only given next to it; empty where that cannot be decided.
    """
    read = [each for each in headings if each.kind is not Kind.REFERENCE]
    visits = {each.visit for each in read}
    sides = {visit.side for visit in visits}
    is_clear = len(headings) == 1 or all(each.is_said for each in read)
    if not read or not is_clear or len(visits) < len(read) or (None in sides and len(sides) > 1):
        return []
    return [None if each.kind is Kind.REFERENCE else each.visit for each in headings]
