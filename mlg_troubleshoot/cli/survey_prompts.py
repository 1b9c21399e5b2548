"""The readings of a survey asked for on a terminal, one row of the template after the other, each
kept at once.
"""

from __future__ import annotations

import csv
import re
from pathlib import Path

from mlg_troubleshoot.cli.prompts.lines import BLANK, Tone, keys, line
from mlg_troubleshoot.cli.prompts.terminal import RichTerminal
from mlg_troubleshoot.errors import UsageError
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.outputs import write_csv
from mlg_troubleshoot.records.survey_table import COLUMNS, read_survey
from mlg_troubleshoot.surveying.readings import SurveyedLinkage
from mlg_troubleshoot.units import THOU_PER_IN

_KEYS = keys(
    ("Enter", "not read"), ("b", "back"), ("done", "no more"), ("q", "stop; what was read is kept")
)
_TYPED = re.compile(
    r"(?P<number>[-+]?(?:\d+\.?\d*|\.\d+))\s*(?P<unit>in|thou|mm|deg|°)?", re.IGNORECASE
)
_SIGNED = re.compile(r"[-+]\d*\.?\d+(e-\d+)?")


def ask_survey(file: Path, gear: Gear, terminal: RichTerminal) -> bool:
    """Ask for the readings that a template still lacks and keep each in it; False if the user
    stopped.
    """
    if file.suffix.lower() != ".csv":
        raise UsageError(
            f"{file.name!r} does not end in .csv", "Answers are kept as CSV: give such a name."
        )
    linkage = SurveyedLinkage(gear)
    with file.open(newline="", encoding="utf-8-sig", errors="replace") as text:
        header, *rows = [*csv.reader(text)] or [[]]
    if not set(COLUMNS) <= set(header):
        raise UsageError(
            f"{file} is not a survey template",
            "Give a new name, or one that mlg gear survey wrote.",
        )
    rows = [[*row, *[""] * (len(header) - len(row))] for row in rows]
    values = [i for i, name in enumerate(header) if name.startswith("value_")]
    terminal.say([_KEYS, BLANK])
    at = next((k for k, row in enumerate(rows) if not any(row[i] for i in values)), len(rows))
    while at < len(rows):
        row = dict(zip(header, rows[at], strict=False))
        unit = "deg" if row.get("u_deg") else "mm" if row.get("u_mm") else "in"
        terminal.say(
            [
                line((f"{at + 1} of {len(rows)}: {_words(row)}", Tone.STRONG)),
                line(row.get("how", "")),
            ]
        )
        known = next(
            (
                row[header[i]] + " " + header[i].removeprefix("value_")
                for i in values
                if rows[at][i]
            ),
            "",
        )
        typed = terminal.ask(f" {known or unit} > ").strip()
        if typed in ("q", "done"):
            return typed == "done"
        if typed == "b" or not typed:
            at = max(at - 1, 0) if typed else at + 1
            continue
        before = rows[at]
        found = _TYPED.fullmatch(typed)
        if found is not None:
            rows[at] = [*before]
            _put(
                rows[at],
                header,
                float(found["number"]),
                (found["unit"] or unit).lower().replace("°", "deg"),
            )
            _keep(file, header, rows)
        wrong = [p for p in read_survey(file, linkage)[1] if p.row == at + 2]
        if found is None or wrong:
            rows[at] = before
            _keep(file, header, rows)
            expected = (
                wrong[0].expected
                if wrong
                else f"a number, as 7.15 or 181.6 mm, in {unit} where it has no unit"
            )
            terminal.say([line((f"{typed!r}: expected {expected}.", Tone.BAD))])
        else:
            at += 1
    return True


def _words(row: dict[str, str]) -> str:
    ends = " ".join(
        part for part in (row["from"], "to" if row["kind"] == "DISTANCE" else "", row["to"]) if part
    )
    at = next(
        (f"at extension {row[c]} {c[10:]}" for c in ("extension_in", "extension_mm") if row.get(c)),
        "",
    )
    return " ".join(part for part in (row["kind"].lower(), ends, at) if part)


def _put(row: list[str], header: list[str], number: float, unit: str) -> None:
    """Put a value into the column of its unit; thou are kept in inches."""
    for i, name in enumerate(header):
        if name.startswith("value_"):
            row[i] = ""
    if unit == "thou":
        number, unit = number / THOU_PER_IN, "in"
    row[header.index(f"value_{unit}")] = repr(number)


def _keep(file: Path, header: list[str], rows: list[list[str]]) -> None:
    """Write the table; numbers as numbers, since a text that begins with a sign would be taken for
    a formula.
    """
    plain = [[float(cell) if _SIGNED.fullmatch(cell) else cell for cell in row] for row in rows]
    write_csv(file, header, plain)
