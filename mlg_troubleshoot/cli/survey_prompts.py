"""The readings of a survey asked for on a terminal, one row of the template after the other, each
kept at once.
"""

from __future__ import annotations

import csv
import re
from dataclasses import dataclass, field
from pathlib import Path

from mlg_troubleshoot.cli.prompts.conversation import (
    Effect,
    Page,
    Terminal,
    Turn,
    again,
    ask_all,
)
from mlg_troubleshoot.cli.prompts.lines import BLANK, Line, Tone, keys, line, note
from mlg_troubleshoot.errors import UsageError
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.outputs import write_csv
from mlg_troubleshoot.records.survey_table import COLUMNS, read_survey
from mlg_troubleshoot.surveying.readings import SurveyedLinkage
from mlg_troubleshoot.units import THOU_PER_IN

_KEYS = keys(
    ("Enter", "not read"),
    ("b", "back"),
    ("done", "no more"),
    ("?", "help"),
    ("q", "stop; what was read is kept"),
)
_TYPED = re.compile(
    r"(?P<number>[-+]?(?:\d+\.?\d*|\.\d+))\s*(?P<unit>in|thou|mm|deg|°)?", re.IGNORECASE
)
_SIGNED = re.compile(r"[-+]\d*\.?\d+(e-\d+)?")


def ask_survey(file: Path, gear: Gear, terminal: Terminal) -> bool:
    """Ask for the readings that a template still lacks and keep each in it; False if the user
    stopped.
    """
    if file.suffix.lower() != ".csv":
        raise UsageError(
            f"{file.name!r} does not end in .csv", "Answers are kept as CSV: give such a name."
        )
    sheet = _Sheet(file, gear)
    terminal.say([_KEYS])
    return ask_all(sheet, terminal, sheet.first_open, len(sheet.rows))


@dataclass(slots=True)
class _Sheet:
    """The course through the rows of a template; its state is the place of a row."""

    file: Path
    gear: Gear
    header: list[str] = field(init=False)
    rows: list[list[str]] = field(init=False)

    def __post_init__(self) -> None:
        with self.file.open(newline="", encoding="utf-8-sig", errors="replace") as text:
            self.header, *rows = [*csv.reader(text)] or [[]]
        if not set(COLUMNS) <= set(self.header):
            raise UsageError(
                f"{self.file} is not a survey template",
                "Give a new name, or one that mlg gear survey wrote.",
            )
        self.rows = [[*row, *[""] * (len(self.header) - len(row))] for row in rows]

    @property
    def first_open(self) -> int:
        """The first row without a reading."""
        return next((k for k in range(len(self.rows)) if not self._read(k)), len(self.rows))

    def page(self, state: int, width: int) -> Page:  # noqa: ARG002 - as every course
        row = self._row(state)
        asked = line((f"{state + 1} of {len(self.rows)}: {_words(row)}", Tone.STRONG))
        return Page(
            (BLANK, asked, line(row.get("how", ""))), f" {self._read(state) or _unit(row)} > "
        )

    def help(self, state: int) -> tuple[Line, ...]:
        unit = _unit(self._row(state))
        return (
            note(f"A number such as 7.15 or 181.6 mm, in {unit} where it has no unit."),
            _KEYS,
        )

    def back(self, state: int) -> Turn[int]:
        return Turn(max(state - 1, 0))

    def take(self, state: int, typed: str) -> Turn[int]:
        if typed.lower() == "done":
            return Turn(state, effect=Effect.COMPUTE)
        if not typed:
            return Turn(state + 1)
        found = _TYPED.fullmatch(typed)
        unit = _unit(self._row(state))
        if found is None:
            return again(
                state,
                f"{typed!r}: expected a number such as 7.15 or 181.6 mm, in {unit} where it has no"
                " unit.",
            )
        before = self.rows[state]
        stated = (found["unit"] or unit).lower().replace("°", "deg")
        self.rows[state] = self._with(before, float(found["number"]), stated)
        self._keep()
        problems = read_survey(self.file, SurveyedLinkage(self.gear))[1]
        wrong = [p for p in problems if p.row == state + 2]
        if wrong:
            self.rows[state] = before
            self._keep()
            return again(state, f"{typed!r}: expected {wrong[0].expected}.")
        return Turn(state + 1)

    def _row(self, place: int) -> dict[str, str]:
        return dict(zip(self.header, self.rows[place], strict=False))

    def _read(self, place: int) -> str:
        """The reading of a row with its unit; empty without a reading."""
        known = (
            f"{text} {name.removeprefix('value_')}"
            for name, text in self._row(place).items()
            if name.startswith("value_") and text
        )
        return next(known, "")

    def _with(self, row: list[str], number: float, unit: str) -> list[str]:
        """The row with a value in the column of its unit alone; thou are kept in inches."""
        if unit == "thou":
            number = number / THOU_PER_IN
            unit = "in"
        return [
            repr(number) if name == f"value_{unit}" else "" if name.startswith("value_") else text
            for name, text in zip(self.header, row, strict=False)
        ]

    def _keep(self) -> None:
        """Write the table; numbers as numbers, since a text that begins with a sign would be taken
        for a formula.
        """
        plain = [
            [float(cell) if _SIGNED.fullmatch(cell) else cell for cell in row] for row in self.rows
        ]
        write_csv(self.file, self.header, plain)


def _unit(row: dict[str, str]) -> str:
    return "deg" if row.get("u_deg") else "mm" if row.get("u_mm") else "in"


def _words(row: dict[str, str]) -> str:
    ends = " ".join(
        part for part in (row["from"], "to" if row["kind"] == "DISTANCE" else "", row["to"]) if part
    )
    at = next(
        (f"at extension {row[c]} {c[10:]}" for c in ("extension_in", "extension_mm") if row.get(c)),
        "",
    )
    return " ".join(part for part in (row["kind"].lower(), ends, at) if part)
