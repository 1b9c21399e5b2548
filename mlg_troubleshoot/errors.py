"""What can go wrong, as exceptions that carry facts; bad input as a value; exit codes."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from enum import IntEnum


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
    """The table cannot answer the question that was asked (exit code 3)."""


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

    def as_dict(self) -> dict[str, str | int | None]:
        """Return the problem as plain values, in the order of the JSON contract."""
        return asdict(self)

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
