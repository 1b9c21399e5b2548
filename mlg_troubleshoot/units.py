"""Lengths as people write them. The only place where 25.4 stands.

Inside the program a length is in inches and a clearance is radial: the offset of the pin centre from the
hole centre (section 3.2 of the paper).
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from enum import StrEnum

from mlg_troubleshoot.errors import UsageError

MM_PER_IN = 25.4
THOU_PER_IN = 1000.0


class LengthUnit(StrEnum):
    """A unit that a length may be entered in."""

    INCH = "in"
    THOU = "thou"
    MILLIMETRE = "mm"

    @property
    def per_inch(self) -> float:
        """How many of this unit make one inch."""
        return {"in": 1.0, "thou": THOU_PER_IN, "mm": MM_PER_IN}[self.value]

    def to_inches(self, value: float) -> float:
        """Convert a value in this unit to inches.

        Parameters
        ----------
        value : float
            Length in this unit.

        Returns
        -------
        float
            Length. [in]
        """
        return value / self.per_inch

    def from_inches(self, value_in: float) -> float:
        """Convert inches to this unit.

        Parameters
        ----------
        value_in : float
            Length. [in]

        Returns
        -------
        float
            Length in this unit.
        """
        return value_in * self.per_inch

    @classmethod
    def parse(cls, text: str) -> LengthUnit:
        """Read a unit as people write it: ``in``, ``inch``, ``"``, ``thou``, ``mil``, ``mm``.

        Parameters
        ----------
        text : str
            The unit's name or sign.

        Returns
        -------
        LengthUnit
            The unit.

        Raises
        ------
        UsageError
            If the text is not one of the known names.
        """
        found = _UNIT_NAMES.get(text.strip().lower().rstrip("."))
        if found is None:
            raise UsageError(f"unit {text!r} is not known", "Give in, thou or mm.")
        return found


_UNIT_NAMES: dict[str, LengthUnit] = {
    **dict.fromkeys(("in", "inch", "inches", '"', "″", "”", "''"), LengthUnit.INCH),
    **dict.fromkeys(("thou", "thous", "mil", "mils"), LengthUnit.THOU),
    **dict.fromkeys(("mm", "millimetre", "millimetres", "millimeter", "millimeters"), LengthUnit.MILLIMETRE),
}


class ClearanceConvention(StrEnum):
    """What a clearance reading is a reading of. There is no default: the factor 2 flips verdicts."""

    RADIAL = "RADIAL"
    DIAMETRAL = "DIAMETRAL"
    TOTAL_PLAY = "TOTAL_PLAY"

    @property
    def per_radial(self) -> float:
        """How many of a reading in this convention make one radial clearance: 1 or 2."""
        return 1.0 if self is ClearanceConvention.RADIAL else 2.0

    @property
    def meaning(self) -> str:
        """The convention in a technician's words."""
        return {
            "RADIAL": "offset of the pin centre from the hole centre (half the play)",
            "DIAMETRAL": "hole diameter minus pin diameter",
            "TOTAL_PLAY": "dial reading from one limit to the other",
        }[self.value]

    @classmethod
    def parse(cls, text: str) -> ClearanceConvention:
        """Read a convention, upper or lower case, with a space, hyphen or underscore.

        Parameters
        ----------
        text : str
            The convention's name.

        Returns
        -------
        ClearanceConvention
            The convention.

        Raises
        ------
        UsageError
            If the text is not one of the three names.
        """
        name = re.sub(r"[\s\-]+", "_", text.strip()).upper()
        try:
            return cls(name)
        except ValueError:
            raise UsageError(
                f"clearance convention {text!r} is not known",
                "Give RADIAL (centre offset), DIAMETRAL (bore minus pin) or TOTAL_PLAY (dial reading).",
            ) from None


@dataclass(frozen=True, slots=True)
class WrittenLength:
    """A length as it was written: the number, its unit if one was written, and the text itself.

    Parameters
    ----------
    value : float
        The number as written.
    unit : LengthUnit or None
        The unit written beside it; None if there was none.
    text : str
        The text as entered.
    """

    value: float
    unit: LengthUnit | None
    text: str

    def inches(self, default: LengthUnit | None) -> float:
        """Return the length, reading a bare number in a default unit.

        Parameters
        ----------
        default : LengthUnit or None
            Unit of a number that was written without one.

        Returns
        -------
        float
            Length. [in]

        Raises
        ------
        UsageError
            If neither the text nor the default says the unit.
        """
        unit = self.unit or default
        if unit is None:
            raise UsageError(f"{self.text!r} has no unit", "Write the unit: 0.013in, 13thou or 0.33mm.")
        return unit.to_inches(self.value)


_WRITTEN = re.compile(
    r"""^\s*(?P<number>[+]?(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][+-]?\d+)?)
        [\s\u00a0\u202f]*(?P<unit>[A-Za-z"″”']*)\.?\s*$""",
    re.VERBOSE,
)


def parse_length(text: str) -> WrittenLength:
    """Read a length as people write it: ``.013``, ``0.013 in``, ``.013"``, ``13 thou``, ``0.33 mm``.

    A decimal comma, a fraction, a minus sign or anything else that would have to be guessed is refused.

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
                f"{stripped!r} has a decimal comma", f"Write it with a point: {stripped.replace(',', '.')}"
            )
        if re.match(r"^[-\u2212\u2013]\s*[\d.]", stripped):
            raise UsageError(f"{stripped!r} is negative", "A clearance is zero or more.")
        if re.fullmatch(r"\d+\s*/\s*\d+.*", stripped):
            raise UsageError(f"{stripped!r} is a fraction", "Write a decimal number, for example 0.125.")
        raise UsageError(f"{stripped!r} is not a length", "Write for example 0.013 in, 13 thou or 0.33 mm.")
    written = match["unit"]
    unit = LengthUnit.parse(written) if written else None
    return WrittenLength(float(match["number"]), unit, text.strip())


def parse_signed_length(text: str) -> WrittenLength:
    """Read a length that may be negative, as a plunger displacement: ``-0.02 in``, ``+41 thou``.

    Parameters
    ----------
    text : str
        What was typed; a Unicode minus counts as a minus.

    Returns
    -------
    WrittenLength
        The number with its sign, and the unit if one was written.

    Raises
    ------
    UsageError
        If the text is not such a length.
    """
    stripped = text.strip()
    negative = stripped[:1] in {"-", "\u2212"}
    written = parse_length(stripped[1:] if negative else stripped)
    return WrittenLength(-written.value if negative else written.value, written.unit, stripped)
