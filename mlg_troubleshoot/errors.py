"""What can go wrong, as exceptions that carry facts; bad input as a value; exit codes."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass
from enum import IntEnum
from pathlib import PurePath
from typing import Literal

# Cells, rows or values that are named one by one; of more, how many.
_FEW = 6


class ExitCode(IntEnum):
    """How a command ends: the one table of exit codes."""

    FINE = 0
    # Something was found: a gear not within margin, a cause, a reading that does not fit.
    ATTENTION = 1
    USAGE = 2
    # Nothing could be judged, or the data allow no conclusion.
    NO_CONCLUSION = 3
    NOT_WRITTEN = 5
    INTERNAL = 70
    INTERRUPTED = 130


class TroubleshootError(Exception):
    """Base of every error that this package raises on purpose; its text is meant for the user.

    Parameters
    ----------
    message : str
        What happened, with the value, the limit and the place.
    remedy : str, optional
        What the user can do about it.
    """

    message: str
    remedy: str

    def __init__(self, message: str, remedy: str = "") -> None:
        super().__init__(message)
        self.message = message
        self.remedy = remedy


class UsageError(TroubleshootError):
    """The command or the call was not understood: nothing was computed (exit code 2)."""


class GearFileError(TroubleshootError):
    """A gear file, a precomputed table or an extension is not valid or does not belong to this
    geometry.
    """


class MechanismError(TroubleshootError):
    """A mechanism that cannot be assembled as it is described."""


class OutputError(TroubleshootError):
    """An output could not be written (exit code 5)."""


class InconclusiveDataError(TroubleshootError):
    """The table cannot answer the question that was asked (exit code 3).

    notes, problems: what was seen of the table all the same.
    """

    json_names = "schema_version verdict reason=message remedy warnings=notes"
    schema_version: Literal[2] = 2
    verdict: None = None
    notes: tuple[str, ...] = ()
    problems: tuple[Problem, ...] = ()


@dataclass(frozen=True, slots=True)
class Problem:
    """One thing that is wrong with the input, with its place and its remedy.

    Parameters
    ----------
    code : str
        Stable name of the kind of problem, for example ``clearance_out_of_range``.
    file : str or None
        As the user named it, or ``DataFrame``; None for values given on the command line.
    sheet : str or None
        Its worksheet.
    row : int or None
        Counted from 1 with the header included. [1]
    column, cell : str or None
        Its header, and as a spreadsheet program names it, for example ``F7``; of a DataFrame
        ``loc[label, column]``.
    value : str or None
        What stands there.
    expected, remedy : str
        What should stand there, and what to do.
    """

    code: str
    file: str | None
    sheet: str | None
    row: int | None
    column: str | None
    cell: str | None
    value: str | None
    expected: str
    remedy: str

    def place(self) -> str:
        """Return where it is, in words: file, sheet, cell or row, column."""
        parts = [self.file or "command line"]
        if self.sheet is not None:
            parts.append(f"sheet {self.sheet!r}")
        if self.cell is not None:
            parts.append(f"cell {self.cell}")
        elif self.row is not None:
            parts.append(f"row {self.row}")
        if self.column is not None:
            parts.append(f"column {self.column!r}")
        return ", ".join(parts)


@dataclass(frozen=True, slots=True)
class ProblemGroup:
    """Problems of one table that are one mistake: the same column, expectation and remedy."""

    problems: tuple[Problem, ...]

    @property
    def first(self) -> Problem:
        return self.problems[0]

    @property
    def file(self) -> str:
        """The table, without the folders that lead to it."""
        name = self.first.file or "command line"
        sheet = "" if self.first.sheet is None else f", sheet {self.first.sheet!r}"
        return PurePath(name).name + sheet

    @property
    def where(self) -> str:
        """The cells or, without any, the rows: ``rows 6–65``; empty for a table as a whole."""
        cells = [problem.cell for problem in self.problems if problem.cell is not None]
        rows = sorted({problem.row for problem in self.problems if problem.row is not None})
        if len(cells) == 1:
            return f"cell {cells[0]}"
        if cells and len(cells) <= _FEW:
            return f"cells {', '.join(cells)}"
        runs: list[list[int]] = []
        for row in rows:
            if runs and row == runs[-1][-1] + 1:
                runs[-1].append(row)
            else:
                runs.append([row])
        said = [f"{run[0]}–{run[-1]}" if len(run) > 1 else f"{run[0]}" for run in runs]
        more = f" and {len(said) - _FEW} more" if len(said) > _FEW else ""
        return f"{'rows' if len(rows) > 1 else 'row'} {', '.join(said[:_FEW])}{more}" * bool(rows)

    @property
    def found(self) -> str | None:
        """What stood there, the first few; None where nothing did."""
        values = [*dict.fromkeys(p.value for p in self.problems if p.value is not None)]
        more = f" and {len(values) - _FEW} more" if len(values) > _FEW else ""
        return ", ".join(values[:_FEW]) + more if values else None


def grouped(problems: Iterable[Problem]) -> list[ProblemGroup]:
    """Put together what one correction would answer, in the order of the first of each."""
    groups: dict[tuple[str | None, ...], list[Problem]] = {}
    for each in problems:
        # Counts and lists in it differ from row to row.
        remedy = re.sub(r"\([^)]*\)|\d+", "", each.remedy)
        same = each.code, each.file, each.sheet, each.column, each.expected, remedy
        groups.setdefault(same, []).append(each)
    return [ProblemGroup(tuple(group)) for group in groups.values()]
