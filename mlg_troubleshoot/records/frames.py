"""DataFrames in and out: a frame is read through the gate of files, and inspections make one."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, TypeGuard

from mlg_troubleshoot.decision.columns import (
    CLEARANCE,
    CONVENTION,
    IDENTITY,
    UNIT,
    Holds,
)
from mlg_troubleshoot.decision.inspection import Inspection, InvalidRow
from mlg_troubleshoot.errors import Problem
from mlg_troubleshoot.records.cells import Cell, NumberedRow, Sheet, typed
from mlg_troubleshoot.records.gate import cells_of
from mlg_troubleshoot.records.headers import Joints, parse_canonical, recognise
from mlg_troubleshoot.records.tables import Header
from mlg_troubleshoot.units import ClearanceConvention, LengthUnit

if TYPE_CHECKING:
    import pandas as pd

    Frame = pd.DataFrame | pd.Series[Any] | Mapping[str, object]

# What stands for the name of a file.
FRAME = "DataFrame"
# The row of a file in which the first row of a frame would stand.
_FIRST_ROW = 2
# Dtypes of a frame that takes missing values.
_DTYPES = {Holds.YES_NO: "boolean", Holds.DATE: "datetime64[s]", Holds.MOMENT: "object"}
# What an inspection holds of a column that says nothing.
_UNSAID = {"margin_u_in": 0.0, "small_readings_true": False}


def is_frame(source: object) -> TypeGuard[Frame]:
    """Whether it is a DataFrame, or a Series or a mapping of one gear."""
    return isinstance(source, Mapping) or hasattr(source, "iloc")


def as_frame(source: Frame) -> pd.DataFrame:
    import pandas as pd

    if isinstance(source, Mapping):
        return pd.DataFrame([source])
    return source if isinstance(source, pd.DataFrame) else source.to_frame().T


class FrameSheet(Sheet):
    """A frame as a sheet: its columns are the header, and a missing value is a blank cell.

    labels: of its rows.
    """

    def __init__(self, frame: pd.DataFrame) -> None:
        super().__init__()
        self.header = Header((1,), tuple(map(str, frame.columns)))
        self.labels: list[object] = frame.index.tolist()
        self._columns = [_cells(frame.iloc[:, place]) for place in range(frame.shape[1])]

    def rows(self) -> Iterator[NumberedRow]:
        yield self.header.row, self.header.texts
        for number, cells in enumerate(zip(*self._columns, strict=True), _FIRST_ROW):
            if any(cell is not None for cell in cells):
                yield number, cells


def _cells(column: pd.Series[Any]) -> list[Cell]:
    known = column.astype(object).where(column.notna(), None).tolist()
    if column.dtype.kind == "M":
        # A column of days has no times.
        known = [day.date() if day is not None and day == day.normalize() else day for day in known]
    return [value if value.__class__ is float else typed(value) for value in known]


def clearances_alone(source: Frame, joints: Joints) -> pd.DataFrame:
    """The clearances of a frame, and what says how to read them, each row as of a gear of its
    own.
    """
    frame = as_frame(source)
    found = [recognise(str(name), joints) for name in frame.columns]
    kept = [
        place
        for place, each in enumerate(found)
        if each.reason or each.column in (CLEARANCE, CONVENTION, UNIT)
    ]
    rows = list(map(str, range(len(frame))))
    return frame.iloc[:, kept].assign(record_id=rows, tail_no=rows, side="LH")


def label_of(labels: Sequence[object], row: int | None) -> object:
    """The label of a row that is numbered as in a file; None for the header."""
    return None if row is None or row < _FIRST_ROW else labels[row - _FIRST_ROW]


def in_frame(problem: Problem, labels: Sequence[object]) -> Problem:
    """Name the place of a problem as it is looked up in the frame."""
    label = label_of(labels, problem.row)
    if label is None:
        return replace(problem, row=None, cell=None)
    place = repr(label) if problem.column is None else f"{label!r}, {problem.column!r}"
    return replace(problem, cell=f"loc[{place}]")


def frame_of(rows: Iterable[Inspection | InvalidRow], joints: Joints) -> pd.DataFrame:
    """Inspections as a frame of canonical columns, in inches and in the convention of each row."""
    import pandas as pd

    cells = [_row(row, joints) for row in rows]
    known = {name: None for row in cells for name in row}
    needed = [column.name for column in (*IDENTITY, CONVENTION)]
    clearances = [CLEARANCE.header(joint, LengthUnit.INCH) for joint in joints.numbers]
    first = dict.fromkeys([*needed, *clearances])
    frame = pd.DataFrame(cells, columns=[*first, *(name for name in known if name not in first)])
    return frame.astype({name: _dtype(name, joints) for name in frame.columns})


def _dtype(name: str, joints: Joints) -> Any:
    field = parse_canonical(name, joints)
    if field is None or field.column.carried:
        return "string"
    column = field.column
    if column.choices is not None:
        return "category"
    is_number = column.is_length or column.holds is Holds.NUMBER
    return _DTYPES.get(column.holds, "Float64" if is_number else "string")


def _row(row: Inspection | InvalidRow, joints: Joints) -> dict[str, object]:
    if isinstance(row, InvalidRow):
        named = {c.name: getattr(row, c.filled) for c in IDENTITY}
        understood = {} if row.understood is None else _row(row.understood, joints)
        return {**understood, **named}
    # Without its convention a reading was checked as total play.
    convention = row.convention or ClearanceConvention.TOTAL_PLAY
    values = cells_of(row, joints, convention.per_radial)
    cells = {name: _cell(value) for name, value in values.items() if _UNSAID.get(name) != value}
    return {**{name: cell for name, cell in cells.items() if cell is not None}, **row.carried}


def _cell(value: object) -> object:
    """Several joints or areas as one cell holds them."""
    return "; ".join(map(str, value)) or None if isinstance(value, tuple) else value
