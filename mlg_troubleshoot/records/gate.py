"""The gate for values that stand in no file: flags, prompts and Python fill a row for the judge of
rows; a DataFrame is read as a file is, and inspections make one.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from datetime import date
from numbers import Real
from typing import TYPE_CHECKING, Any, TypeGuard

from mlg_troubleshoot.decision.columns import (
    CLEARANCE,
    COLUMNS,
    CONVENTION,
    GAUGE_U,
    IDENTITY,
    PLUNGER_DISPLACEMENT,
    RECORD_ID,
    SIDE,
    TAIL_NO,
    UNIT,
    Holds,
)
from mlg_troubleshoot.decision.inspection import (
    Inspection,
    InvalidRow,
    RowSource,
)
from mlg_troubleshoot.errors import Problem, UsageError
from mlg_troubleshoot.gear.gear import DEFAULT_GAUGE_U_IN
from mlg_troubleshoot.records.cells import Cell, NumberedRow, Sheet, typed
from mlg_troubleshoot.records.headers import Joints, parse_canonical, recognise
from mlg_troubleshoot.records.rows import ReadOptions, Row, RowReader, TableInHand
from mlg_troubleshoot.records.tables import Columns, Header
from mlg_troubleshoot.records.values import CellFaultError, read_text
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
# Who and which gear a value is judged for before that is known.
NOBODY = {RECORD_ID.name: "0", TAIL_NO.name: "0", SIDE.name: "LH"}


def judge_row(
    values: Mapping[str, object], options: ReadOptions
) -> tuple[Inspection | InvalidRow, list[Problem]]:
    """Judge values by column name as a table with these headers and one row would be."""
    if not any(name.startswith("clearance_") and name != CONVENTION.name for name in values):
        values = {**values, CLEARANCE.header(options.joints.numbers[0]): None}
    problems: list[Problem] = []
    table = TableInHand(
        options,
        None,
        None,
        lambda p: problems.append(replace(p, row=None, cell=None)),
    )
    columns = Columns(Header((1,), tuple(values)), table)
    for p in columns.placed:
        if p.field is None and not p.refused:
            expected = "a column of the inspection table"
            table.tell("column_unknown", p.header, expected, "", p.place)
    reader = RowReader(columns.placed, table)
    rows = [reader.read(Row(1, [typed(value) for value in values.values()]))]
    reader.settle_dates(rows)
    return replace(rows[0], source=RowSource()), problems


def admit(
    values: Mapping[str, object], options: ReadOptions, labels: Mapping[str, str] | None = None
) -> Inspection:
    """Return the inspection that the values make, or raise what a table would call a problem."""
    read, problems = judge_row(values, options)
    if problems or isinstance(read, InvalidRow):
        said = [f"{_label(p, labels or {})}: expected {p.expected}" for p in problems]
        remedies = dict.fromkeys(p.remedy for p in problems if p.remedy)
        raise UsageError(
            "; ".join(said) or "the values do not form an inspection", " ".join(remedies)
        )
    return read


def judge_length(
    column: str, text: str, options: ReadOptions
) -> tuple[Inspection | InvalidRow, list[Problem]]:
    """Judge one length alone, before it is known whose it is."""
    return judge_row({**NOBODY, column: text}, options)


def judge_text(label: str, text: str, remedy: str) -> None:
    """Refuse a text that is empty, or that no file can carry."""
    if not text.strip():
        raise UsageError(f"{label} is empty", remedy)
    try:
        read_text(text, "a text")
    except CellFaultError as fault:
        raise UsageError(f"{label} {text!r} is not a text", fault.remedy) from None


def made_record_id(inspection: Inspection) -> str:
    """The id of a visit that was entered by hand without one, by flags or at the prompts: its gear
    and its day.
    """
    day = inspection.inspection_date or date.today()
    return f"{inspection.tail_no}-{inspection.side}-{day:%Y%m%d}"


def judge_again(
    inspection: Inspection, options: ReadOptions, changes: Mapping[str, str] | None = None
) -> Inspection:
    """Judge an inspection made in Python, or one with other texts in some columns.

    Without `entered` its clearances and their uncertainties are readings in its convention, as in a
    table; with it they were read before and are radial. Numbers are inches.
    """
    given = inspection
    factor = given.convention.per_radial if given.entered and given.convention is not None else 1.0
    values = cells_of(given, options.joints, factor)
    required = [column.name for column in IDENTITY]
    changed = changes or {}
    stays = {
        name: value
        for name, value in values.items()
        if (value is not None or name in required) and name.removesuffix("_in") not in changed
    }
    read = admit(stays | {name: text for name, text in changed.items() if text}, options)
    kept = {n: e for n, e in given.entered.items() if CLEARANCE.header(n) not in changed}
    carried = {name: text for name, text in given.carried.items() if name not in changed}
    return replace(
        read,
        entered={n: kept.get(n, e) for n, e in read.entered.items()},
        # Numbers are inches here: what was asked about the unit of the entry stands until it is
        # confirmed.
        unit_question=(
            "" if given.small_readings_true else given.unit_question or read.unit_question
        ),
        carried={**carried, **read.carried},
        is_left=given.is_left,
        warnings=tuple(dict.fromkeys((*given.warnings, *read.warnings))),
        source=given.source,
    )


def cells_of(inspection: Inspection, joints: Joints, factor: float) -> dict[str, object]:
    """The values of an inspection by canonical column, in inches; `factor` makes readings of the
    lengths that a convention scales.
    """
    values: dict[str, object] = {}
    for column in COLUMNS:
        scale = factor if column.scales else 1.0
        if column is PLUNGER_DISPLACEMENT:
            for place, value in enumerate(inspection.readings_in, 1):
                values[column.header(place, LengthUnit.INCH)] = value
            continue
        unit = LengthUnit.INCH if column.is_length else None
        by_joint = getattr(inspection, column.joint_fills) if column.joint_fills else {}
        for joint, value in by_joint.items():
            name = column.header(joint, unit)
            if isinstance(joint, bool) or joint not in joints.numbers:
                said = f"{name}: expected a joint from {joints.span}"
                raise UsageError(said, f"T{joints.lack(joint)[1:]}.")
            values[name] = _times(value, scale)
        assumed = (
            column is GAUGE_U
            and inspection.gauge_u_is_default
            and inspection.gauge_u_in == DEFAULT_GAUGE_U_IN
        )
        if not (column.carried or column.needs_joint or assumed):
            values[column.header(unit=unit)] = _times(inspection.value(column.filled), scale)
    return values


def _times(value: object, factor: float) -> object:
    return float(value) * factor if factor != 1.0 and isinstance(value, Real) else value


def _label(problem: Problem, labels: Mapping[str, str]) -> str:
    column = problem.column or "the values"
    return labels.get(column) or (
        column if problem.value in (None, column) else f"{column}: {problem.value!r}"
    )


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
