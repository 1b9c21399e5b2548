"""What goes into reading a table, and what comes out of it."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields
from typing import Any, NamedTuple

from mlg_troubleshoot.decision.columns import CLEARANCE, PLUNGER_DISPLACEMENT, Column
from mlg_troubleshoot.decision.inspection import Inspection, InvalidRow, Side
from mlg_troubleshoot.errors import Problem
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.records.cells import Cell, column_letters, quote
from mlg_troubleshoot.records.dates import DateOrder
from mlg_troubleshoot.records.headers import Joints
from mlg_troubleshoot.records.values import CellFaultError
from mlg_troubleshoot.results import Result
from mlg_troubleshoot.units import ClearanceConvention, LengthUnit

_WORDS: Mapping[str, Callable[[str], object]] = {
    "unit": LengthUnit.parse,
    "convention": ClearanceConvention.parse,
    "dates": DateOrder,
}


@dataclass(frozen=True, slots=True, kw_only=True)
class TableOptions:
    """What the user declares about tables.

    Parameters
    ----------
    unit : LengthUnit or None
        Unit of lengths that do not say one.
    convention : ClearanceConvention or None
        Convention of rows that do not say one.
    sheet : str or None
        Worksheet to read; ``*`` reads every sheet that holds inspections, None takes the only one.
    column_map : mapping of str to str
        Column by header (or by letter), for headers that are not understood: ``{"Spiel 3":
        "clearance_3_mm"}``; the target ``carry`` lets a column travel to the report unread.
    shared_map : mapping of str to str
        The same for several tables: a header that is absent is not reported.
    decimal_comma : bool
        True if ``0,013`` means 0.013.
    small_readings_true : bool
        True if readings below the play of new parts were checked: they were read in the unit that
        is stated.
    dates : DateOrder or None
        Order of day, month and year in dates that are written as numbers; None takes it from the
        column.
    side : Side or None
        Side of every row of a table without a column of sides; None takes it from the name of the
        sheet or the file.
    """

    unit: LengthUnit | None = None
    convention: ClearanceConvention | None = None
    sheet: str | None = None
    column_map: Mapping[str, str] = field(default_factory=dict)
    shared_map: Mapping[str, str] = field(default_factory=dict)
    decimal_comma: bool = False
    small_readings_true: bool = False
    dates: DateOrder | None = None
    side: Side | None = None

    def __post_init__(self) -> None:
        """Take a unit, a convention and an order of dates as people write them."""
        for name, read in _WORDS.items():
            said = getattr(self, name)
            if isinstance(said, str):
                object.__setattr__(self, name, read(said))


@dataclass(frozen=True, slots=True, kw_only=True, repr=False, eq=False)
class TableResult(Result):
    """What a task tells of the tables that it read.

    Parameters
    ----------
    gear : Gear
        The gear.
    problems : tuple of Problem
        What is wrong with the input.
    notes : tuple of str
        Notes on the input as a whole.
    unread : tuple of str
        Those of the notes that say what of the input was not read.
    unread_files : tuple of str
        Files that were given and hold no row that could be read.
    inputs_sha256 : mapping of str to str
        Hash of each input file by name.
    """

    gear: Gear
    problems: tuple[Problem, ...] = ()
    notes: tuple[str, ...] = ()
    unread: tuple[str, ...] = ()
    unread_files: tuple[str, ...] = ()
    inputs_sha256: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, kw_only=True)
class ReadOptions(TableOptions):
    """What is declared about tables, and what the gear says of the values in them.

    joints: numbers and names of the joints, by which headers are understood.
    clearance_hard_max_in, clearance_confirm_above_in: a radial clearance above the one is refused,
    above the other accepted with a warning. [in]
    plunger_hard_max_in: a measured plunger displacement beyond this, either way, is refused. [in]
    new_part_in, limit_in: radial clearance of a new part, and the largest one allowed, by joint;
    empty where no gear says them. [in]
    margin_in: largest displacement that the gear allows; infinite where no gear says it. [in]
    asks: a person is there to confirm what is unusual.
    """

    joints: Joints = field(default_factory=Joints)
    clearance_hard_max_in: float = 0.050
    clearance_confirm_above_in: float = 0.015
    plunger_hard_max_in: float = 0.5
    new_part_in: Mapping[int, float] = field(default_factory=dict)
    limit_in: Mapping[int, float] = field(default_factory=dict)
    margin_in: float = math.inf
    asks: bool = False

    def range_in(self, column: Column) -> tuple[float, float]:
        """Least and largest length that a column can hold, radial. [in]"""
        high = {
            CLEARANCE: self.clearance_hard_max_in,
            PLUNGER_DISPLACEMENT: self.plunger_hard_max_in,
        }.get(column, column.high)
        return max(column.low, -high), high

    @classmethod
    def of(cls, gear: Gear, tables: TableOptions | None = None, **declared: Any) -> ReadOptions:
        given = (
            {}
            if tables is None
            else {each.name: getattr(tables, each.name) for each in fields(TableOptions)}
        )
        return cls(
            **given,
            **declared,
            joints=Joints.of(gear),
            new_part_in={joint.number: joint.new_part.value for joint in gear.joints},
            margin_in=gear.margin.value,
            limit_in={joint.number: joint.limit.value for joint in gear.joints},
            clearance_hard_max_in=gear.hard_limit.value,
            clearance_confirm_above_in=gear.confirm_above.value,
        )


class CellPlace(NamedTuple):
    """Where a problem stands, as far as it has a place."""

    row: int | None = None
    header: str | None = None
    cell: str | None = None

    @classmethod
    def at(cls, row: int, index: int, header: str) -> CellPlace:
        return cls(row, header, f"{column_letters(index)}{row}")


NOWHERE = CellPlace()


@dataclass(frozen=True, slots=True)
class TableInHand:
    """The table or form that is being read: how, where it stands, and who receives its
    problems.

    side: of every row of a table that has no column of sides.
    """

    options: ReadOptions
    file: str | None
    sheet: str | None
    report: Callable[[Problem], None]
    decimal_comma: bool
    side: Side | None = None

    def tell(
        self, code: str, value: str | None, expected: str, remedy: str, place: CellPlace
    ) -> None:
        self.report(Problem(code, self.file, self.sheet, *place, value, expected, remedy))

    def tell_fault(self, fault: CellFaultError, raw: Cell, place: CellPlace) -> None:
        found = None if raw is None else quote(raw)
        self.tell(fault.code, found, fault.expected, fault.remedy, place)


@dataclass(frozen=True, slots=True)
class ColumnReading:
    """How one column (or one line of a form) was read.

    index: column, counted from 0.
    read_as: canonical column; None for a column that is only carried.
    row: of the value in a form; None in a table.
    """

    index: int
    header: str
    read_as: str | None
    row: int | None = None


@dataclass(frozen=True, slots=True)
class SheetLayout:
    """Where the parts of a table were found.

    header_row: the lower row of the header, counted from 1.
    """

    file: str | None
    sheet: str | None
    kind: str
    header_row: int
    width: int
    columns: tuple[ColumnReading, ...]

    def index_of(self, column: str) -> int | None:
        """Return the index of a canonical column, counted from 0; None if the table does not have
        it.
        """
        return next((c.index for c in self.columns if c.read_as == column), None)


@dataclass(frozen=True, slots=True)
class FileRead:
    """One file as read; a DataFrame has the labels of its rows, whatever they are."""

    name: str
    kind: str
    sha256: str | None
    rows: int
    labels: Sequence[object] = ()


@dataclass(frozen=True, slots=True)
class ReadResult:
    """Everything that came out of one or more files, in their order: no row is lost, each problem
    stands once.

    unread: those of the notes that say what was not read.
    """

    rows: tuple[Inspection | InvalidRow, ...]
    problems: tuple[Problem, ...]
    notes: tuple[str, ...] = ()
    layouts: tuple[SheetLayout, ...] = ()
    files: tuple[FileRead, ...] = ()
    unread: tuple[str, ...] = ()
    unread_sheets: tuple[str, ...] = ()

    @property
    def inputs_sha256(self) -> dict[str, str]:
        """Hash of each file that could be opened, by its name."""
        return {file.name: file.sha256 for file in self.files if file.sha256 is not None}

    @property
    def unread_files(self) -> tuple[str, ...]:
        """The files that no row came from, and the sheets of others that hold inspections and were
        left out.
        """
        return (*(file.name for file in self.files if not file.rows), *self.unread_sheets)

    @property
    def of_tables(self) -> dict[str, Any]:
        """What a `TableResult` tells of what was read, by its fields."""
        told = ("problems", "notes", "unread", "unread_files", "inputs_sha256")
        return {name: getattr(self, name) for name in told}

    @property
    def inspections(self) -> tuple[Inspection, ...]:
        return tuple(row for row in self.rows if isinstance(row, Inspection))
