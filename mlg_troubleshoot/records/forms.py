"""Vertical forms: one sheet is one inspection, the label to the left and the value to the right."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

from mlg_troubleshoot.decision.columns import (
    CLEARANCE,
    CONVENTION,
    IDENTITY,
    RECORD_ID,
    SIDE,
    UNIT,
    Column,
)
from mlg_troubleshoot.decision.inspection import Side
from mlg_troubleshoot.records.cells import Cell, column_letters
from mlg_troubleshoot.records.headers import UNKNOWN, recognise
from mlg_troubleshoot.records.layout import ColumnReader
from mlg_troubleshoot.records.model import ColumnReading, ReadOptions, SheetLayout, TableInHand
from mlg_troubleshoot.records.rows import RowReader
from mlg_troubleshoot.records.source import FileRefusedError, NumberedRow
from mlg_troubleshoot.records.tables import Collected

FORM_TITLE = "MLG inspection form"
# What an untouched copy of the form may hold: it says how to read, not what was found.
_DECLARATIONS = (UNIT, CONVENTION)


@dataclass(frozen=True, slots=True)
class Form:
    """A form as found.

    lines: row, label and value. gears: the columns that hold the values of a gear, if several do.
    """

    lines: Sequence[tuple[int, str, Cell]]
    label_column: int
    value_column: int
    gears: Sequence[int] = ()

    def is_untouched(self, options: ReadOptions) -> bool:
        filled = [label for _, label, value in self.lines if value is not None]
        fields = (recognise(label, options.joints).field for label in filled)
        return all(field is not None and field.column in _DECLARATIONS for field in fields)


def find_form(rows: Sequence[NumberedRow], options: ReadOptions) -> Form | None:
    kinds: dict[int, list[Column]] = {}
    for _, cells in rows:
        for index, cell in enumerate(cells[:4]):
            text = cell if isinstance(cell, str) else ""
            found = recognise(text, options.joints).field
            if found is not None:
                kinds.setdefault(index, []).append(found.column)
                break
    column = max(kinds, key=lambda index: len(kinds[index]), default=0)
    known = kinds.get(column, [])
    if len(known) < 3 or not {*IDENTITY} & {*known} or CLEARANCE not in known:
        return None
    ours = any(cell == FORM_TITLE for _, cells in rows[:2] for cell in cells[:1])
    value_column = column + 1
    if not ours:
        labelled = [
            cells for _, cells in rows if column < len(cells) and isinstance(cells[column], str)
        ]
        filled = Counter(
            i for cells in labelled for i in range(column + 1, len(cells)) if cells[i] is not None
        )
        # Merged labels push the values further to the right.
        if filled and column + 1 not in filled:
            value_column = min(filled)
    lines = []
    for number, cells in rows:
        label = cells[column] if column < len(cells) else None
        if isinstance(label, str) and _is_line(label, options):
            lines.append(
                (number, label, cells[value_column] if value_column < len(cells) else None)
            )
    gears = [
        i
        for i in range(column + 1, max(len(c) for _, c in rows))
        if _is_gear(rows, column, i, options)
    ]
    return Form(lines, column, value_column, gears if len(gears) > 1 else ())


def _is_gear(rows: Sequence[NumberedRow], labels: int, values: int, options: ReadOptions) -> bool:
    """Whether a column holds the side and a clearance of a gear."""
    held: set[Column] = set()
    for _, cells in rows:
        label = cells[labels] if max(labels, values) < len(cells) else None
        value = cells[values] if isinstance(label, str) else None
        field = recognise(label, options.joints).field if isinstance(label, str) else None
        if field is None or value is None:
            continue
        if field.column is not SIDE or (isinstance(value, str) and Side.spelt(value)):
            held.add(field.column)
    return {SIDE, CLEARANCE} <= held


def _is_line(label: str, options: ReadOptions) -> bool:
    """Leave out titles, hints and signature lines, but not a label that may be a reading."""
    found = recognise(label, options.joints)
    return found is not UNKNOWN or label in options.column_map or label.rstrip().endswith(":")


def read_form(
    form: Form, options: ReadOptions, *, file: str | None, sheet: str | None
) -> Collected:
    out = Collected()
    if form.gears:
        raise FileRefusedError(
            "form_several",
            f"it holds several gears, in columns {', '.join(map(column_letters, form.gears))}",
            "one gear on a form, or a table with one gear in each row",
            "Swap rows and columns (copy, then paste special: transpose), or give each gear a"
            " sheet of its own.",
            sheet=sheet,
        )
    letters = column_letters(form.label_column)
    values = column_letters(form.value_column)
    labels = [label for _, label, _ in form.lines]
    label_places = [(row, f"{letters}{row}") for row, _, _ in form.lines]
    value_places = [(row, f"{values}{row}") for row, _, _ in form.lines]
    table = TableInHand(options, file, sheet, out.problems.append, options.decimal_comma)
    columns = ColumnReader(table).place(labels, form.lines[0][0], places=label_places)
    out.notes += filter(None, columns.notes())
    reader = RowReader(columns.placed, table)
    named = list(zip((row for row, _, _ in form.lines), columns.placed, strict=True))
    ids = [row for row, p in named if p.field is not None and p.field.column is RECORD_ID]
    start = ids[0] if ids else form.lines[0][0]
    out.rows.append(reader.read(start, [value for _, _, value in form.lines], value_places))
    out.notes += filter(None, [reader.settle_dates(out.rows)])
    out.invalid_content[out.rows[0].source] = hash(tuple(value for _, _, value in form.lines))
    read = tuple(ColumnReading(form.value_column, p.header, p.read_as, row) for row, p in named)
    out.layouts.append(
        SheetLayout(file, sheet, "form", form.lines[0][0], form.value_column + 1, read)
    )
    return out
