"""Numbers as a reader sees them: every figure, table and sentence of a report formats with these."""

from __future__ import annotations

import math
from collections.abc import Sequence
from datetime import datetime

from mlg_troubleshoot.decision import wording
from mlg_troubleshoot.units import LengthUnit

ABSENT = "–"
MINUS = "−"


def number(value: float | None, decimals: int, signed: bool = False) -> str:
    """Write a number with a typographic minus.

    Parameters
    ----------
    value : float or None
        The number; None gives a dash.
    decimals : int
        Digits after the point.
    signed : bool
        True to write a plus, too.

    Returns
    -------
    str
        The number.
    """
    if value is None or math.isnan(value):
        return ABSENT
    text = f"{abs(value):.{decimals}f}"
    if float(text) == 0.0:
        return text
    return (MINUS if value < 0 else "+" if signed else "") + text


def inches(value_in: float | None, signed: bool = False, decimals: int = 4) -> str:
    """Write a length with its unit: ``0.0472 in``.

    Parameters
    ----------
    value_in : float or None
        Length. [in]
    signed : bool
        True to write a plus, too.
    decimals : int
        Digits after the point.

    Returns
    -------
    str
        The length; a dash if there is none.
    """
    text = number(value_in, decimals, signed)
    return text if text == ABSENT else f"{text}\u00a0in"


def millimetres(value_in: float | None, signed: bool = False, decimals: int = 3) -> str:
    """Write a length in millimetres: ``1.199 mm``.

    Parameters
    ----------
    value_in : float or None
        Length. [in]
    signed : bool
        True to write a plus, too.
    decimals : int
        Digits after the point.

    Returns
    -------
    str
        The length; a dash if there is none.
    """
    if value_in is None:
        return ABSENT
    return f"{number(LengthUnit.MILLIMETRE.from_inches(value_in), decimals, signed)}\u00a0mm"


def percent(share: float | None) -> str:
    """Write a probability: ``25 %``, ``< 0.1 %``, ``> 99.9 %``; never a rounded 0 or 100 that is neither.

    Parameters
    ----------
    share : float or None
        Probability. [1]

    Returns
    -------
    str
        The percentage; a dash if there is none.
    """
    if share is None or math.isnan(share):
        return ABSENT
    return wording.percent(share).replace(" ", "\u00a0")


def joint_list(joints: Sequence[int]) -> str:
    """Write joints: ``#3``, ``#3 and #5``, ``#1, #2 and #4``.

    Parameters
    ----------
    joints : sequence of int
        Numbers of joints.

    Returns
    -------
    str
        The list in words; a dash if it is empty.
    """
    names = [f"#{joint}" for joint in joints]
    if not names:
        return ABSENT
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"


def moment(value: datetime) -> str:
    """Write a date and time with its zone if it has one.

    Parameters
    ----------
    value : datetime.datetime
        The moment.

    Returns
    -------
    str
        ``2024-05-17 09:30 UTC``.
    """
    zone = value.tzname()
    return f"{value:%Y-%m-%d %H:%M}{f' {zone}' if zone else ''}"


def digest(sha256: str | None, length: int = 12) -> str:
    """Shorten a hash for reading.

    Parameters
    ----------
    sha256 : str or None
        Hash in hexadecimal.
    length : int
        Characters to keep.

    Returns
    -------
    str
        Its first characters; a dash if there is none.
    """
    return sha256[:length] if sha256 else ABSENT


def several(count: int, one: str, many: str | None = None) -> str:
    """Write a count with its noun: ``1 gear``, ``12 gears``.

    Parameters
    ----------
    count : int
        How many.
    one, many : str
        The noun for one and for several; without the second an ``s`` is added.

    Returns
    -------
    str
        Count and noun.
    """
    return f"{count}\u00a0{one if count == 1 else many or one + 's'}"
