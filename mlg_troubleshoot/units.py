"""Lengths as people write them, and the year. The only place where 25.4 stands.

Inside the program a length is in inches and a clearance is radial: the offset of the pin centre
from the hole centre (section 3.2 of the paper).
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass
from enum import StrEnum
from typing import Self

from mlg_troubleshoot.errors import UsageError

# The one table of how a minus sign is written; the hyphen stands first, as in a set of a regular
# expression.
MINUS = "-\u2212\u2010\u2011\u2012\u2013\u2014\ufe63\uff0d"
MM_PER_IN = 25.4
THOU_PER_IN = 1000.0
DAYS_PER_YEAR = 365.25


class LengthUnit(StrEnum):
    """A unit that a length may be entered in.

    Attributes
    ----------
    per_inch : float
        How many of this unit make one inch.
    words : str
        The unit in full, in the plural.
    decimals : int
        Decimals that show a length to about 0.0001 in.
    """

    per_inch: float
    words: str
    decimals: int

    INCH = "in", 1.0, "inches", 4
    THOU = "thou", THOU_PER_IN, "thou", 1
    MILLIMETRE = "mm", MM_PER_IN, "millimetres", 3

    def __new__(cls, name: str, per_inch: float = 1.0, words: str = "", decimals: int = 4) -> Self:
        unit = str.__new__(cls, name)
        unit._value_ = name
        unit.per_inch = per_inch
        unit.words = words
        unit.decimals = decimals
        return unit

    @property
    def spellings(self) -> tuple[str, ...]:
        """How people write this unit, in lower case."""
        return tuple(word for word, unit in UNIT_SPELLINGS.items() if unit is self)

    def to_inches(self, value: float) -> float:
        """A length in this unit, in inches. [in]"""
        return value / self.per_inch

    def from_inches(self, value_in: float) -> float:
        """A length in inches, in this unit."""
        return value_in * self.per_inch

    def shown(self, value_in: float, *, sign: bool = False) -> str:
        """A length in inches as a number in this unit, with its decimals."""
        return f"{self.from_inches(value_in):{'+' if sign else ''}.{self.decimals}f}"

    @classmethod
    def parse(cls, text: str) -> LengthUnit:
        """Read a unit as people write it: ``in``, ``inch``, ``"``, ``thou``, ``mil``, ``mm``."""
        found = UNIT_SPELLINGS.get(text.strip().lower().rstrip("."))
        if found is None:
            raise UsageError(f"unit {text!r} is not known", "Give in, thou or mm.")
        return found


# The one table of how units are written, in lower case: for values, headers, columns of units and
# flags.
UNIT_SPELLINGS: dict[str, LengthUnit] = {
    **dict.fromkeys(("in", "inch", "inches", '"', "″", "”", "''"), LengthUnit.INCH),
    **dict.fromkeys(("thou", "thous", "mil", "mils"), LengthUnit.THOU),
    **dict.fromkeys(
        ("mm", "millimetre", "millimetres", "millimeter", "millimeters"), LengthUnit.MILLIMETRE
    ),
}


class ClearanceConvention(StrEnum):
    """What a clearance reading is a reading of. It must be stated: the factor 2 flips
    verdicts.

    per_radial: how many of such a reading make one radial clearance, 1 or 2. meaning: in a
    technician's words. words: its name in a sentence.
    """

    per_radial: float
    meaning: str
    words: str

    RADIAL = "RADIAL", 1.0, "offset of the pin centre from the hole centre (half the play)"
    DIAMETRAL = "DIAMETRAL", 2.0, "hole diameter minus pin diameter"
    TOTAL_PLAY = "TOTAL_PLAY", 2.0, "dial reading from one limit to the other"

    def __new__(cls, name: str, per_radial: float = 1.0, meaning: str = "") -> Self:
        convention = str.__new__(cls, name)
        convention._value_ = name
        convention.per_radial = per_radial
        convention.meaning = meaning
        convention.words = name.lower().replace("_", " ")
        return convention

    @classmethod
    def parse(cls, text: str) -> ClearanceConvention:
        """Read a convention, upper or lower case, with a space, hyphen or underscore."""
        name = re.sub(r"[\s\-]+", "_", text.strip()).upper()
        try:
            return cls(name)
        except ValueError:
            raise UsageError(
                f"clearance convention {text!r} is not known",
                "Give RADIAL (centre offset), DIAMETRAL (bore minus pin) or TOTAL_PLAY (dial"
                " reading).",
            ) from None


@dataclass(frozen=True, slots=True)
class Slip:
    """A slip of entry by a factor, and what makes a value that many times too small."""

    factor: float
    too_small: str


# The one table of slips: suggested wherever they would explain a value, never applied.
SLIPS: dict[str, Slip] = {
    "unit": Slip(MM_PER_IN, "inches read as millimetres"),
    "point": Slip(10.0, "a misplaced decimal point"),
    "convention": Slip(
        ClearanceConvention.TOTAL_PLAY.per_radial,
        "a radial clearance read as diametral or total play",
    ),
}


def with_unit(text: str, unit: LengthUnit) -> str:
    """Write a length as it was entered, with its unit where the text does not state one."""
    end = text.rstrip(".")[-1:]
    return text if end.isalpha() or end in "\"″”'" else f"{text} {unit}"


@dataclass(frozen=True, slots=True)
class WrittenLength:
    """A length as it was written: the number, its unit if one was written, and the text itself."""

    value: float
    unit: LengthUnit | None
    text: str


_WRITTEN = re.compile(
    r"""^\s*(?P<number>[+]?(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][+-]?\d+)?)
        [\s\u00a0\u202f]*(?P<unit>[A-Za-z"″”']*)\.?\s*$""",
    re.VERBOSE,
)


def parse_length(text: str) -> WrittenLength:
    """Read a length as people write it: ``.013``, ``0.013 in``, ``.013"``, ``13 thou``, ``0.33
    mm``.

    A decimal comma, a fraction, a minus sign or anything else that would have to be guessed is
    refused.

    Parameters
    ----------
    text : str
        What was typed.

    Returns
    -------
    WrittenLength
        The number, and the unit if one was written.

    Raises
    ------
    UsageError
        If the text is not such a length; the remedy says what would be.
    """
    match = _WRITTEN.match(text)
    if match is None:
        stripped = text.strip()
        if re.fullmatch(r"[+]?\d*,\d+\s*\D*", stripped):
            raise UsageError(
                f"{stripped!r} has a decimal comma",
                f"Write it with a point: {stripped.replace(',', '.')}",
            )
        if re.match(rf"^[{MINUS}]\s*[\d.]", stripped):
            raise UsageError(f"{stripped!r} is negative", "A clearance is zero or more.")
        if re.fullmatch(r"\d+\s*/\s*\d+.*", stripped):
            raise UsageError(
                f"{stripped!r} is a fraction", "Write a decimal number, for example 0.125."
            )
        raise UsageError(
            f"{stripped!r} is not a length", "Write for example 0.013 in, 13 thou or 0.33 mm."
        )
    written = match["unit"]
    unit = LengthUnit.parse(written) if written else None
    value = float(match["number"])
    if vanishes(match["number"], value):
        raise UsageError(f"{text.strip()!r} is too small to be a length", "Check the exponent.")
    return WrittenLength(value, unit, text.strip())


def vanishes(text: str, value: float) -> bool:
    """Whether a number that is not zero was read as zero, as ``1e-400`` is."""
    return value == 0.0 and re.search(r"[1-9]", text.lower().partition("e")[0]) is not None


@dataclass(frozen=True, slots=True)
class Length:
    """A length in a sentence. [in]

    decimals: of the number in inches; in another unit it keeps that resolution.
    named: false where the unit follows later, as in ``0.01 to 0.05 in``.
    """

    value_in: float
    decimals: int = 4
    sign: bool = False
    named: bool = True

    @classmethod
    def brief(cls, value_in: float) -> Length:
        """With as many decimals as the number has, to four digits."""
        return cls(value_in, len(f"{value_in:.4g}".partition(".")[2]))

    def __str__(self) -> str:
        return self.said_in(LengthUnit.INCH)

    def said_in(self, unit: LengthUnit) -> str:
        decimals = self.decimals
        if unit is not LengthUnit.INCH:
            decimals = max(decimals - LengthUnit.INCH.decimals + unit.decimals, 0)
        number = f"{unit.from_inches(self.value_in):{'+' if self.sign else ''}.{decimals}f}"
        return f"{number} {unit}" if self.named else number


class Sentence(str):
    """A sentence with lengths: a text in inches, as it is kept and written to JSON, that can also
    be said in the unit of its reader.
    """

    _template = ""
    _facts: tuple[object, ...] = ()

    @classmethod
    def of(cls, template: str, *facts: object) -> Sentence:
        """Make a sentence; each ``{}`` stands for a `Length`, another sentence or a text."""
        made = cls(template.format(*facts))
        made._template = template
        made._facts = facts
        return made

    @classmethod
    def joined(cls, sentences: Iterable[str], between: str = " ") -> Sentence:
        parts = tuple(sentences)
        return cls.of(between.join("{}" for _ in parts), *parts)

    def said_in(self, unit: LengthUnit) -> str:
        """Say it again, its lengths in another unit."""
        if unit is LengthUnit.INCH or not self._facts:
            return str(self)
        return self._template.format(*(said_in(fact, unit) for fact in self._facts))


def said_in(fact: object, unit: LengthUnit) -> str:
    """Say a part of a sentence in the unit of its reader; a text has no lengths of its own."""
    if isinstance(fact, Length | Sentence):
        return fact.said_in(unit)
    return str(fact)
