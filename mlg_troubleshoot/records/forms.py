"""Vertical forms: the label to the left, and in each column of values the readings of one visit."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import islice

from mlg_troubleshoot.decision.columns import (
    CLEARANCE,
    CONVENTION,
    DATE,
    IDENTITY,
    JOINT,
    OUTCOME,
    PLUNGER_DISPLACEMENT,
    RECORD_ID,
    SIDE,
    UNIT,
    Column,
)
from mlg_troubleshoot.decision.inspection import Side
from mlg_troubleshoot.records.cells import Cell, Cells, OddCell, column_letters, show
from mlg_troubleshoot.records.headers import UNKNOWN, Field, recognise
from mlg_troubleshoot.records.layout import ColumnReader, mapped_to
from mlg_troubleshoot.records.model import (
    CellPlace,
    ColumnReading,
    ReadOptions,
    SheetLayout,
    TableInHand,
)
from mlg_troubleshoot.records.rows import RowReader
from mlg_troubleshoot.records.source import FileRefusedError, NumberedRow
from mlg_troubleshoot.records.tables import Collected
from mlg_troubleshoot.records.values import may_be_outcome, says_failed, written_number
from mlg_troubleshoot.records.visits import ONE_VISIT, Heading, Occasion, take_apart, visits_of

FORM_TITLE = "MLG inspection form"
# What an untouched copy of the form may hold: it says how to read, not what was found.
_DECLARATIONS = (UNIT, CONVENTION)
_READ = (CLEARANCE, PLUNGER_DISPLACEMENT)
# What is of one visit, below the headings of several.
_MEASURED = (*_READ, OUTCOME)
_NUMBER = re.compile(r"[^\w]*\d")


@dataclass(frozen=True, slots=True)
class Form:
    """A form as found.

    lines: row, label and cells. value_column: of what is said once, above the row `measured_from`
    of readings as well. columns: of numbers next to joints, each with its heading and how it is
    called in a message. side: as a line says it of the whole form.
    """

    lines: Sequence[tuple[int, str, Cells]]
    label_column: int
    value_column: int
    columns: dict[int, tuple[Heading, str]]
    measured_from: int
    is_ours: bool
    side: Side | None = None

    def value(self, row: int, cells: Cells, column: int, *, is_measured: bool) -> Cell:
        """What a line says in a column, or else for all of them."""
        own, shared = (cells[i] if i < len(cells) else None for i in (column, self.value_column))
        is_own = is_measured and row >= self.measured_from
        return own if own is not None or is_own else shared

    def is_untouched(self, options: ReadOptions) -> bool:
        at = self.value_column
        filled = [label for _, label, cells in self.lines if any(cells[at : at + 1])]
        fields = (_field(label, options) for label in filled)
        return not self.columns and all(
            field is not None and field.column in _DECLARATIONS for field in fields
        )

    def visits(self) -> dict[int, Occasion]:
        """The columns that are read, each with its visit; none where that cannot be decided."""
        if not self.columns:
            return {self.value_column: ONE_VISIT}
        if self.is_ours and [*self.columns] != [self.value_column]:
            return {}
        visits = visits_of([heading for heading, _ in self.columns.values()])
        sides = {visit.side for visit in visits if visit is not None and visit.side}
        if self.side is not None and sides - {self.side}:
            return {}
        return {i: v for i, v in zip(self.columns, visits, strict=False) if v is not None}


def find_form(rows: Sequence[NumberedRow], options: ReadOptions) -> Form | None:
    kinds: dict[int, list[Column]] = {}
    for _, cells in rows:
        fields = ((i, _field(cell, options)) for i, cell in enumerate(cells[:4]))
        for index, field in islice(((i, f) for i, f in fields if f is not None), 1):
            kinds.setdefault(index, []).append(field.column)
    column = max(kinds, key=lambda index: len(kinds[index]), default=0)
    labelled = [
        (number, label, cells)
        for number, cells in _with_joints(rows, column, options)
        if column < len(cells) and isinstance(label := cells[column], str)
    ]
    known = [each.column for _, label, _ in labelled if (each := _field(label, options))]
    if len(known) < 3 or not {*IDENTITY} & {*known} or CLEARANCE not in known:
        return None
    value_column = column + 1
    is_ours = any(cell == FORM_TITLE for _, cells in rows[:2] for cell in cells[:1])
    if not is_ours:
        filled = {
            i for *_, cells in labelled for i, c in enumerate(cells) if i > column and c is not None
        }
        # Merged labels push the values further to the right.
        value_column = min(filled, default=value_column)
    joints = [
        (number, cells)
        for number, label, cells in labelled
        if (each := _field(label, options)) and each.column in _READ
    ]
    numbers = {
        i
        for _, cells in joints
        for i, cell in enumerate(cells)
        if (_is_number(cell) if i > column else _is_fraction(cell))
    }
    headings = _rows_of_headings(rows, joints[0][0], column, options)
    lines = [
        (number, label, cells)
        for number, label, cells in labelled
        if number not in headings and _is_line(label, cells[column + 1 :], options)
    ]
    columns = {
        i: _heading(i, [*headings.values(), *_told_apart(lines, column, options)])
        for i in sorted(numbers)
    }
    measured_from = min([joints[0][0], *headings])
    sides = [
        side
        for _, label, cells in lines
        if (each := _field(label, options)) and each.column is SIDE
        for cell in cells[column + 1 :]
        if isinstance(cell, str) and (side := Side.spelt(cell))
    ]
    side = sides[0] if len(sides) == 1 else None
    return Form(lines, column, value_column, columns, measured_from, is_ours, side)


def _with_joints(
    rows: Sequence[NumberedRow], column: int, options: ReadOptions
) -> Sequence[NumberedRow]:
    """Rows with the numbers below a label that says joint as the names of joints."""
    named: list[NumberedRow] = []
    is_list = False
    for number, cells in rows:
        label = cells[column] if column < len(cells) else None
        field = _field(label, options)
        is_list = is_list or (field is not None and field.column is JOINT)
        joint = show(label).strip()
        if is_list and joint.isdecimal():
            named.append((number, [*cells[:column], f"joint {joint}", *cells[column + 1 :]]))
        else:
            named.append((number, cells))
    return named


def _rows_of_headings(
    rows: Sequence[NumberedRow], first: int, column: int, options: ReadOptions
) -> dict[int, Cells]:
    """The rows above the first joint that hold headings: up to three, none of them a line."""
    found: dict[int, Cells] = {}
    for number, cells in reversed([row for row in rows if row[0] < first]):
        field = _field(cells[column] if column < len(cells) else None, options)
        if len(found) == 3 or (field is not None and field.column is not JOINT):
            break
        found = {number: cells, **found}
    return found


def _told_apart(
    lines: Sequence[tuple[int, str, Cells]], column: int, options: ReadOptions
) -> list[Cells]:
    """Lines of a side or a day that several columns fill."""
    return [
        cells
        for _, label, cells in lines
        if (field := _field(label, options))
        and field.column in (SIDE, DATE)
        and sum(cell is not None for cell in cells[column + 1 :]) > 1
    ]


def _heading(index: int, rows: Sequence[Cells]) -> tuple[Heading, str]:
    cells = [cells[index] for cells in rows if index < len(cells)]
    words = [cell.text if isinstance(cell, OddCell) else show(cell) for cell in cells]
    text = " ".join(filter(None, words))
    letters = column_letters(index)
    return take_apart(text), f"{letters} ({text[:40]!r})" if text else letters


def _field(cell: Cell, options: ReadOptions) -> Field | None:
    return recognise(cell, options.joints).field if isinstance(cell, str) else None


def _is_number(cell: Cell) -> bool:
    """Whether a cell may be a reading: a number, or a text that begins with one."""
    return cell is not None and (not isinstance(cell, str) or _NUMBER.match(cell) is not None)


def _is_fraction(cell: Cell) -> bool:
    """Whether a cell in front of a label may be a reading, not the number of its line."""
    number = math.nan if cell is None else written_number(cell, decimal_comma=True)[0]
    return number % 1.0 > 0.0


def _is_line(label: str, right: Cells, options: ReadOptions) -> bool:
    """Leave out titles, hints and signature lines, but not a label that may be a reading."""
    is_known = recognise(label, options.joints) is not UNKNOWN
    is_named = mapped_to(options, label, -1) is not None or label.rstrip().endswith(":")
    return is_known or is_named or any(map(_is_answer, right))


def _is_answer(cell: Cell) -> bool:
    return cell is not None and (
        _is_fraction(cell) or may_be_outcome(cell) or says_failed(show(cell))
    )


def read_form(
    form: Form, options: ReadOptions, *, file: str | None, sheet: str | None
) -> Collected:
    out = Collected()
    visits = form.visits()
    if not visits:
        named = ", ".join(name for _, name in form.columns.values())
        remedy = "Delete the columns that are not readings, or write found above those that are."
        if form.is_ours:
            remedy = f"Move the readings to column {column_letters(form.value_column)}."
        raise FileRefusedError(
            "form_columns",
            f"it holds numbers next to its joints in columns {named}",
            "one column of readings, or headings that tell found from limit, LH from RH, or the"
            " days",
            remedy,
            sheet=sheet,
        )
    labels = [CellPlace.at(row, form.label_column, label) for row, label, _ in form.lines]
    side = next(iter(visits.values())).side
    table = TableInHand(options, file, sheet, out.tell, options.decimal_comma, side)
    first = form.lines[0][0]
    columns = ColumnReader(table).place([label for _, label, _ in form.lines], first, places=labels)
    lines = [(row, p) for (row, *_), p in zip(form.lines, columns.placed, strict=True)]
    ids = [row for row, p in lines if p.field is not None and p.field.column is RECORD_ID]
    several = len(visits) > 1
    out.notes += filter(None, columns.notes())
    for column, visit in visits.items():
        places = [CellPlace.at(row, column, label) for row, label, _ in form.lines]
        cells = [
            form.value(
                row, line, column, is_measured=p.field is None or p.field.column in _MEASURED
            )
            for (row, _, line), p in zip(form.lines, columns.placed, strict=True)
        ]
        reader = RowReader(columns.placed, table.of_visit(visit, is_one_of_several=several))
        read = [reader.read(ids[0] if ids else first, cells, places)]
        said = reader.settle_dates(read)
        out.notes += [said] * bool(said)
        out.rows += read
        out.invalid_content[read[0].source] = hash(tuple(cells))
    if len(form.columns) > 1:
        shown = [form.columns[column][1] for column in visits]
        left = [name for column, (_, name) in form.columns.items() if column not in visits]
        not_read = f"; not read: {', '.join(left)}" if left else ""
        out.notes.append(f"the readings are those of column {', '.join(shown)}{not_read}")
    column = next(iter(visits))
    readings = tuple(ColumnReading(column, p.header, p.read_as, row) for row, p in lines)
    kind = "visits" if several else "form"
    out.layouts.append(SheetLayout(file, sheet, kind, first, max(visits) + 1, readings))
    return out
