"""Vertical forms: one sheet is one inspection, the label to the left and the value to the right."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import islice

from mlg_troubleshoot.decision.columns import (
    CLEARANCE,
    CONVENTION,
    IDENTITY,
    PLUNGER_DISPLACEMENT,
    RECORD_ID,
    SIDE,
    UNIT,
    Column,
)
from mlg_troubleshoot.decision.inspection import Side
from mlg_troubleshoot.records.cells import Cell, column_letters
from mlg_troubleshoot.records.headers import UNKNOWN, Field, recognise
from mlg_troubleshoot.records.layout import ColumnReader
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
from mlg_troubleshoot.records.values import written_number

FORM_TITLE = "MLG inspection form"
# What an untouched copy of the form may hold: it says how to read, not what was found.
_DECLARATIONS = (UNIT, CONVENTION)
_NUMBER = re.compile(r"[^\w]*\d")


@dataclass(frozen=True, slots=True)
class Form:
    """A form as found.

    lines: row, label and value. gears: the columns that hold the values of a gear, if several do or
    another one than that of the values. numbers: the columns that hold numbers next to joints.
    """

    lines: Sequence[tuple[int, str, Cell]]
    label_column: int
    value_column: int
    gears: Sequence[int] = ()
    numbers: Sequence[int] = ()

    def is_untouched(self, options: ReadOptions) -> bool:
        if self.gears:
            return False
        filled = [label for _, label, value in self.lines if value is not None]
        fields = (recognise(label, options.joints).field for label in filled)
        return all(field is not None and field.column in _DECLARATIONS for field in fields)


def find_form(rows: Sequence[NumberedRow], options: ReadOptions) -> Form | None:
    kinds: dict[int, list[Column]] = {}
    for _, cells in rows:
        fields = ((i, _field(cell, options)) for i, cell in enumerate(cells[:4]))
        for index, field in islice(((i, f) for i, f in fields if f is not None), 1):
            kinds.setdefault(index, []).append(field.column)
    column = max(kinds, key=lambda index: len(kinds[index]), default=0)
    known = kinds.get(column, [])
    if len(known) < 3 or not {*IDENTITY} & {*known} or CLEARANCE not in known:
        return None
    labelled = [
        (number, label, cells)
        for number, cells in rows
        if column < len(cells) and isinstance(label := cells[column], str)
    ]
    value_column = column + 1
    if not any(cell == FORM_TITLE for _, cells in rows[:2] for cell in cells[:1]):
        filled = {
            i for *_, cells in labelled for i, c in enumerate(cells) if i > column and c is not None
        }
        # Merged labels push the values further to the right.
        if filled and value_column not in filled:
            value_column = min(filled)
    lines = [
        (number, label, cells[value_column] if value_column < len(cells) else None)
        for number, label, cells in labelled
        if _is_line(label, options)
    ]
    held: dict[int, set[Column]] = {}
    numbers: set[int] = set()
    for _, label, cells in labelled:
        named = _field(label, options)
        if named is None:
            continue
        if named.column in (CLEARANCE, PLUNGER_DISPLACEMENT):
            numbers |= {
                i
                for i, value in enumerate(cells)
                if (_is_number(value) if i > column else _is_fraction(value))
            }
        for i, value in enumerate(cells):
            is_side = isinstance(value, str) and Side.spelt(value)
            if i > column and value is not None and (named.column is not SIDE or is_side):
                held.setdefault(i, set()).add(named.column)
    gears = [i for i in sorted(held) if {SIDE, CLEARANCE} <= held[i]]
    beside = CLEARANCE not in held.get(value_column, ())
    gears = gears if len(gears) > 1 or beside else []
    return Form(lines, column, value_column, gears, sorted(numbers))


def _field(cell: Cell, options: ReadOptions) -> Field | None:
    return recognise(cell, options.joints).field if isinstance(cell, str) else None


def _is_number(cell: Cell) -> bool:
    """Whether a cell may be a reading: a number, or a text that begins with one."""
    return cell is not None and (not isinstance(cell, str) or _NUMBER.match(cell) is not None)


def _is_fraction(cell: Cell) -> bool:
    """Whether a cell in front of a label may be a reading, not the number of its line."""
    number = math.nan if cell is None else written_number(cell, decimal_comma=True)[0]
    return number % 1.0 > 0.0


def _is_line(label: str, options: ReadOptions) -> bool:
    """Leave out titles, hints and signature lines, but not a label that may be a reading."""
    found = recognise(label, options.joints)
    return found is not UNKNOWN or label in options.column_map or label.rstrip().endswith(":")


def read_form(
    form: Form, options: ReadOptions, *, file: str | None, sheet: str | None
) -> Collected:
    out = Collected()
    if len(form.gears) == 1:
        (beside,) = map(column_letters, form.gears)
        meant = column_letters(form.value_column)
        raise FileRefusedError(
            "form_beside",
            f"its values stand in column {beside}",
            f"them in column {meant}, next to their labels",
            f"Move what was entered to column {meant}.",
            sheet=sheet,
        )
    if form.gears:
        raise FileRefusedError(
            "form_several",
            f"it holds several gears, in columns {', '.join(map(column_letters, form.gears))}",
            "one gear on a form, or a table with one gear in each row",
            "Swap rows and columns (copy, then paste special: transpose), or give each gear a"
            " sheet of its own.",
            sheet=sheet,
        )
    if len(form.numbers) > 1:
        raise FileRefusedError(
            "form_columns",
            f"it holds numbers next to its joints in columns"
            f" {', '.join(map(column_letters, form.numbers))}",
            "the readings of one gear on one day, in one column",
            "Delete the columns that are not the readings, or give each its own sheet.",
            sheet=sheet,
        )
    labels = [CellPlace.at(row, form.label_column, label) for row, label, _ in form.lines]
    values = [CellPlace.at(row, form.value_column, label) for row, label, _ in form.lines]
    table = TableInHand(options, file, sheet, out.tell, options.decimal_comma)
    first = form.lines[0][0]
    columns = ColumnReader(table).place([label for _, label, _ in form.lines], first, places=labels)
    reader = RowReader(columns.placed, table)
    named = [(row, p) for (row, *_), p in zip(form.lines, columns.placed, strict=True)]
    ids = [row for row, p in named if p.field is not None and p.field.column is RECORD_ID]
    cells = tuple(value for *_, value in form.lines)
    out.rows.append(reader.read(ids[0] if ids else first, cells, values))
    out.notes += filter(None, [*columns.notes(), reader.settle_dates(out.rows)])
    out.invalid_content[out.rows[0].source] = hash(cells)
    read = tuple(ColumnReading(form.value_column, p.header, p.read_as, row) for row, p in named)
    out.layouts.append(SheetLayout(file, sheet, "form", first, form.value_column + 1, read))
    return out
