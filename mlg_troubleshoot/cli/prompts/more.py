"""The optional answers at the end, typed on one line: what the gear did, the plunger, the margin."""

from __future__ import annotations

import math
import re
from dataclasses import replace

from mlg_troubleshoot.cli.prompts.answers import Answers
from mlg_troubleshoot.cli.prompts.lines import Line, Tone, line
from mlg_troubleshoot.cli.prompts.pages import both_units
from mlg_troubleshoot.decision.inspection import Outcome
from mlg_troubleshoot.errors import UsageError
from mlg_troubleshoot.units import LengthUnit, parse_length

PLUNGER_LIMIT_IN = 0.5
MARGIN_LIMIT_IN = 0.2

_ITEM = re.compile(
    r"""\s*[,;]?\s*(?:
        (?P<outcome>failed|fail|f|retracted|r|x)(?![a-z])
      | (?P<name>plunger|margin|p|m)\s*[=:]?\s*(?P<sign>[-+\u2212\u2013]?)\s*
        (?P<length>(?:\d+[.,]\d+|\d+\.|[.,]?\d+)
          \s*(?:(?:in|inch|inches|thou|thous|mils?|mm)(?![a-z])|["″”])?)
    )\s*""",
    re.VERBOSE | re.IGNORECASE,
)


def read_more(answers: Answers, typed: str) -> tuple[Answers, tuple[Line, ...]]:
    """Read the optional answers.

    Parameters
    ----------
    answers : Answers
        Answers so far.
    typed : str
        For example ``f p .041 m .028``; ``x`` takes all of them away.

    Returns
    -------
    answers : Answers
        The new answers.
    told : tuple of Line
        What was understood.

    Raises
    ------
    UsageError
        If any of it is not understood or cannot be; then nothing is taken.
    """
    told: list[Line] = []
    at = 0
    while at < len(typed):
        item = _ITEM.match(typed, at)
        if item is None:
            raise UsageError(
                f"{typed[at:].strip()!r} is not understood", "Type f, r, p .041 or m .028, or Enter alone."
            )
        at = item.end()
        answers, said = _with_outcome(answers, item["outcome"]) if item["outcome"] else _with_length(answers, item)
        told.append(line((said, Tone.GOOD)))
    return answers, tuple(told)


def _with_outcome(answers: Answers, word: str) -> tuple[Answers, str]:
    first = word[0].lower()
    if first == "x":
        return replace(answers, outcome=None, plunger_in=None, margin_in=None), "– outcome, plunger, margin: none"
    outcome = Outcome.FAILED if first == "f" else Outcome.RETRACTED
    return replace(answers, outcome=outcome), f"✓ outcome {outcome}"


def _with_length(answers: Answers, item: re.Match[str]) -> tuple[Answers, str]:
    unit = answers.unit or LengthUnit.INCH
    length_in = parse_length(item["length"]).inches(unit)
    if item["sign"] not in ("", "+"):
        length_in = -length_in
    if item["name"][0].lower() == "p":
        if not abs(length_in) <= PLUNGER_LIMIT_IN:
            raise UsageError(
                f"a plunger displacement of {_plain(length_in)} in cannot be",
                f"It lies between -{PLUNGER_LIMIT_IN:g} and +{PLUNGER_LIMIT_IN:g} in. "
                f"Write the unit if it is not {unit.value}.",
            )
        return replace(answers, plunger_in=length_in), f"✓ plunger {both_units(length_in, sign=True)}"
    if not 0 < length_in <= MARGIN_LIMIT_IN:
        raise UsageError(
            f"a margin of {_plain(length_in)} in cannot be",
            f"It is above 0 and at most {MARGIN_LIMIT_IN:g} in; write the unit if it is not {unit.value}.",
        )
    return replace(answers, margin_in=length_in), f"✓ margin {both_units(length_in)}"


def _plain(length_in: float) -> str:
    return f"{length_in:g}" if math.isfinite(length_in) else "so many"
