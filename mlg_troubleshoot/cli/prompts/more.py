"""The optional answers at the end, typed on one line: what the gear did, the plunger, the margin."""

from __future__ import annotations

import re

from mlg_troubleshoot.cli.prompts.answers import LENGTHS, Answers, judge_more
from mlg_troubleshoot.cli.prompts.lines import Line, Tone, line
from mlg_troubleshoot.errors import UsageError
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.units import LengthUnit

_ITEM = re.compile(
    r"""\s*[,;]?\s*(?:
        (?P<outcome>failed|fail|f|retracted|r|x)(?![a-z])
      | (?P<name>plunger|margin|p|m)\s*[=:]?\s*(?P<sign>[-+\u2212\u2013]?)\s*
        (?P<number>\d+[.,]\d+|\d+\.|[.,]?\d+)
        \s*(?P<unit>(?:in|inch|inches|thou|thous|mils?|mm)(?![a-z])|["″”])?
    )\s*""",
    re.VERBOSE | re.IGNORECASE,
)


def read_more(answers: Answers, typed: str, gear: Gear) -> tuple[Answers, tuple[Line, ...]]:
    """Read the optional answers; each is kept as it was typed, with the unit that it was typed in."""
    told: list[Line] = []
    at = 0
    while at < len(typed):
        item = _ITEM.match(typed, at)
        if item is None:
            raise UsageError(
                f"{typed[at:].strip()!r} is not understood", "Type f, r, p .041 or m .028, or Enter alone."
            )
        at = item.end()
        if item["outcome"] is None:
            column = LENGTHS[item["name"][0].lower() == "m"]
            sign = "-" if item["sign"] in ("-", "\u2212", "\u2013") else ""
            written = f"{sign}{item['number']} {item['unit'] or answers.unit or LengthUnit.INCH}"
            judge_more(column, written, answers.unit, gear)
            answers = answers.with_more(**{column: written})
            told.append(line((f"✓ {column.partition('_')[0]} {written}", Tone.GOOD)))
        elif item["outcome"].lower() == "x":
            answers = answers.with_more(outcome=None, **dict.fromkeys(LENGTHS))
            told.append(line(("– outcome, plunger, margin: none", Tone.GOOD)))
        else:
            answers = answers.with_more(outcome="FAILED" if item["outcome"][0].lower() == "f" else "RETRACTED")
            told.append(line((f"✓ outcome {answers.more['outcome']}", Tone.GOOD)))
    return answers, tuple(told)


def plunger_in(answers: Answers, gear: Gear) -> float | None:
    typed = answers.more.get("plunger_displacement")
    return None if typed is None else judge_more("plunger_displacement", typed, answers.unit, gear).readings_in[0]
