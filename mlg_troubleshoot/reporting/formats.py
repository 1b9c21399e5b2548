"""Numbers as a reader sees them: every figure, table and sentence of a report formats with
these.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime

from mlg_troubleshoot.decision import sentences
from mlg_troubleshoot.units import LengthUnit, said_in

ABSENT = "–"
MINUS = "−"


def number(value: float | None, decimals: int, signed: bool = False) -> str:
    if value is None or not math.isfinite(value):
        return ABSENT
    text = f"{abs(value):.{decimals}f}"
    if float(text) == 0.0:
        return text
    return (MINUS if value < 0 else "+" if signed else "") + text


@dataclass(frozen=True, slots=True)
class Lengths:
    """How a document writes lengths: in the one unit that its reader chose."""

    unit: LengthUnit = LengthUnit.INCH

    def bare(self, value_in: float | None, signed: bool = False, fine: int = 0) -> str:
        """Write the number alone; `fine` adds decimals."""
        value = None if value_in is None else self.unit.from_inches(value_in)
        return number(value, self.unit.decimals + fine, signed)

    def full(self, value_in: float | None, signed: bool = False, fine: int = 0) -> str:
        """Write a length with its unit: ``0.0472 in``."""
        text = self.bare(value_in, signed, fine)
        return text if text == ABSENT else f"{text}\u00a0{self.unit}"

    def said(self, sentence: str) -> str:
        """Say a sentence of the program in this unit."""
        return said_in(sentence, self.unit)


def percent(share: float | None) -> str:
    """Write a probability: ``25 %``, ``< 0.1 %``, ``> 99.9 %``; never a rounded 0 or 100 that is
    neither.
    """
    if share is None or math.isnan(share):
        return ABSENT
    return sentences.percent(share).replace(" ", "\u00a0")


def joint_list(joints: Sequence[int]) -> str:
    """Write joints: ``#3``, ``#3 and #5``, ``#1, #2 and #4``."""
    names = [f"#{joint}" for joint in joints]
    if not names:
        return ABSENT
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"


def moment(value: datetime) -> str:
    zone = value.tzname()
    return f"{value:%Y-%m-%d %H:%M}{f' {zone}' if zone else ''}"


def several(count: int, one: str, many: str | None = None) -> str:
    """Write a count with its noun: ``1 gear``, ``12 gears``."""
    return f"{count}\u00a0{one if count == 1 else many or one + 's'}"


def short(text: str, length: int) -> str:
    """Cut a text that is too long for its place."""
    return text if len(text) <= length else text[: length - 1] + "…"


def landings(ends: Mapping[str, float | None] | None) -> str:
    """Write the quantiles of a forecast, to two digits: it has no more."""
    if ends is None:
        return ABSENT
    said = ["beyond" if end is None else landings_count(end) for end in ends.values()]
    return said[0] if len({*said}) == 1 else ", ".join(said)


def landings_count(count: float | None) -> str:
    """Write landings that remain, to two digits: a forecast has no more."""
    return ABSENT if count is None else f"{float(f'{count:.2g}'):.0f}"


def minutes(value: float) -> str:
    """Write a time of work; less than half a minute is written as none."""
    return f"{value:.0f}\u00a0min" if value >= 0.5 else ""
