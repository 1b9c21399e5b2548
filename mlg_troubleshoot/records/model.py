"""What goes into reading a table, and what comes out of it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from mlg_troubleshoot.decision.inspection import Inspection, InvalidRow, RowSource
from mlg_troubleshoot.errors import Problem
from mlg_troubleshoot.units import ClearanceConvention, LengthUnit

Progress = Callable[[int, int | None], None]


@dataclass(frozen=True, slots=True)
class ReadOptions:
    """What the caller declares about the tables that are read.

    Parameters
    ----------
    unit : LengthUnit or None
        Unit of the lengths whose column and cell do not say one.
    convention : ClearanceConvention or None
        Convention of the rows that do not say one.
    sheet : str or None
        Worksheet to read; ``*`` reads every sheet that holds inspections; None takes the only one.
    column_map : mapping of str to str
        Column by header (or by letter), for headers that are not understood: ``{"Spiel 3": "clearance_3_mm"}``;
        the target ``carry`` lets a column travel to the report unread.
    decimal_comma : bool
        True if ``0,013`` means 0.013.
    joint_numbers : tuple of int
        The gear's joints.
    joint_names : mapping of int to str
        Names of the gear's joints, by which a header's number is checked; empty takes the reference gear's.
    clearance_hard_max_in : float
        A radial clearance above this is refused. [in]
    clearance_confirm_above_in : float
        A radial clearance above this is accepted with a warning. [in]
    plunger_hard_max_in : float
        A measured plunger displacement beyond this, either way, is refused. [in]
    """

    unit: LengthUnit | None = None
    convention: ClearanceConvention | None = None
    sheet: str | None = None
    column_map: Mapping[str, str] = field(default_factory=dict)
    decimal_comma: bool = False
    joint_numbers: tuple[int, ...] = tuple(range(1, 11))
    joint_names: Mapping[int, str] = field(default_factory=dict)
    clearance_hard_max_in: float = 0.050
    clearance_confirm_above_in: float = 0.015
    plunger_hard_max_in: float = 0.5


@dataclass(frozen=True, slots=True)
class ColumnReading:
    """How one column (or one line of a form) was read.

    Parameters
    ----------
    index : int
        Column, counted from 0.
    header : str
        Its header as found.
    read_as : str or None
        Canonical column; None for a column that is only carried.
    row : int or None
        Row of the value in a form; None in a table.
    """

    index: int
    header: str
    read_as: str | None
    row: int | None = None


@dataclass(frozen=True, slots=True)
class SheetLayout:
    """Where the parts of a table were found.

    Parameters
    ----------
    file : str or None
        File as the user named it.
    sheet : str or None
        Worksheet, None for CSV.
    kind : str
        ``wide``, ``long`` or ``form``.
    header_row : int
        Row of the header (its lower row if it has two), counted from 1.
    last_row : int
        Last row that was read.
    width : int
        Number of columns in use.
    columns : tuple of ColumnReading
        The columns.
    """

    file: str | None
    sheet: str | None
    kind: str
    header_row: int
    last_row: int
    width: int
    columns: tuple[ColumnReading, ...]

    def index_of(self, column: str) -> int | None:
        """Return the index of a canonical column, counted from 0; None if the table does not have it."""
        return next((c.index for c in self.columns if c.read_as == column), None)


@dataclass(frozen=True, slots=True)
class FileRead:
    """A file that was opened, for the report.

    Parameters
    ----------
    name : str
        File as the user named it.
    kind : str
        ``csv``, ``xlsx``, ``xlsm``, ``xls`` or ``ods``; ``unreadable`` if nothing could be read.
    sha256 : str or None
        Hash of its bytes.
    rows : int
        Data rows read.
    """

    name: str
    kind: str
    sha256: str | None
    rows: int


@dataclass(frozen=True, slots=True)
class ReadResult:
    """Everything that came out of one or more files: no row is lost.

    Parameters
    ----------
    rows : tuple of Inspection or InvalidRow
        One entry for each data row, in the order of the files.
    problems : tuple of Problem
        Errors only, each once.
    notes : tuple of str
        What was noticed and decided while reading.
    layouts : tuple of SheetLayout
        Where the tables were found.
    files : tuple of FileRead
        The files.
    """

    rows: tuple[Inspection | InvalidRow, ...]
    problems: tuple[Problem, ...]
    notes: tuple[str, ...] = ()
    layouts: tuple[SheetLayout, ...] = ()
    files: tuple[FileRead, ...] = ()

    @property
    def inspections(self) -> tuple[Inspection, ...]:
        """The rows that can be judged."""
        return tuple(row for row in self.rows if isinstance(row, Inspection))

    @property
    def invalid(self) -> tuple[InvalidRow, ...]:
        """The rows that cannot be judged."""
        return tuple(row for row in self.rows if isinstance(row, InvalidRow))

    def layout_of(self, source: RowSource) -> SheetLayout | None:
        """Return the layout of the table that a row came from; None for a row from elsewhere."""
        return next((lay for lay in self.layouts if (lay.file, lay.sheet) == (source.file, source.sheet)), None)


class FileRefusedError(Exception):
    """A file or a sheet that cannot be read as a table; caught inside this package and made a `Problem`.

    Parameters
    ----------
    code : str
        Stable name of the kind of problem.
    found : str
        What was found, in plain words.
    expected : str
        What was expected instead.
    remedy : str
        What to do.
    sheet : str, optional
        Worksheet.
    row : int, optional
        Row, counted from 1.
    cell : str, optional
        Cell, for example ``XFD1048576``.
    """

    def __init__(
        self,
        code: str,
        found: str,
        expected: str,
        remedy: str,
        *,
        sheet: str | None = None,
        row: int | None = None,
        cell: str | None = None,
    ) -> None:
        super().__init__(found)
        self.code = code
        self.found = found
        self.expected = expected
        self.remedy = remedy
        self.sheet = sheet
        self.row = row
        self.cell = cell

    def problem(self, file: str | None) -> Problem:
        """Return the refusal as an entry of the list of problems."""
        return Problem(self.code, file, self.sheet, self.row, None, self.cell, self.found, self.expected, self.remedy)
