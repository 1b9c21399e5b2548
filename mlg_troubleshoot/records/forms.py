"""Vertical forms: the label to the left, and in each column of values the readings of one visit."""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import islice, takewhile
from typing import NamedTuple

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
from mlg_troubleshoot.records.cells import Cell, Cells, OddCell, column_letters, quote, show
from mlg_troubleshoot.records.headers import UNKNOWN, recognise
from mlg_troubleshoot.records.layout import Columns, Header, mapped_to
from mlg_troubleshoot.records.model import CellPlace, ReadOptions
from mlg_troubleshoot.records.rows import Row
from mlg_troubleshoot.records.source import FileRefusedError, NumberedRow
from mlg_troubleshoot.records.values import may_be_outcome, says_failed, written_number
from mlg_troubleshoot.records.visits import ONE_VISIT, Heading, Occasion, take_apart, visits_of

FORM_TITLE = "MLG inspection form"
# What an untouched copy of the form may hold: it says how to read, not what was found.
_DECLARATIONS = (UNIT, CONVENTION)
_READ = (CLEARANCE, PLUNGER_DISPLACEMENT)
# What is of one visit, below the headings of several.
_MEASURED = (*_READ, OUTCOME)
_NUMBER = re.compile(r"[^\w]*\d")


class _Line(NamedTuple):
    """A row with a label, and the column of a table that this names; None if it names none."""

    row: int
    label: str
    column: Column | None
    cells: Cells


@dataclass(frozen=True, slots=True, kw_only=True)
class Form(Header):
    """A form as found: a table on its side, whose headers are the labels of its lines.

    value_column: of what is said once, above the row `measured_from` of readings as well. columns:
    of numbers next to joints, each with its heading and how it is called in a message.
    """

    lines: Sequence[_Line]
    width: int
    label_column: int
    value_column: int
    columns: Mapping[int, tuple[Heading, str]]
    measured_from: int
    is_ours: bool

    @property
    def places(self) -> Sequence[CellPlace]:
        return [CellPlace.at(line.row, self.label_column, line.label) for line in self.lines]

    @property
    def is_untouched(self) -> bool:
        at = self.value_column
        filled = [line.column for line in self.lines if any(line.cells[at : at + 1])]
        return not self.columns and all(column in _DECLARATIONS for column in filled)

    def visits(self, sheet: str | None) -> dict[int, Occasion]:
        """The columns that are read, each with its visit; what cannot be decided is refused."""
        if not self.columns:
            return {self.value_column: ONE_VISIT}
        visits = visits_of([heading for heading, _ in self.columns.values()])
        sides = {visit.side for visit in visits if visit is not None and visit.side}
        stated = [
            side
            for line in self.lines
            if line.column is SIDE
            for cell in line.cells[self.label_column + 1 :]
            if isinstance(cell, str) and (side := Side.spelt(cell))
        ]
        is_elsewhere = self.is_ours and [*self.columns] != [self.value_column]
        contradicts = len(stated) == 1 and sides - {*stated}
        if visits and not is_elsewhere and not contradicts:
            return {i: v for i, v in zip(self.columns, visits, strict=True) if v is not None}
        named = ", ".join(name for _, name in self.columns.values())
        remedy = "Delete the columns that are not readings, or write found above those that are."
        if self.is_ours:
            remedy = f"Move the readings to column {column_letters(self.value_column)}."
        raise FileRefusedError(
            "form_columns",
            f"it holds numbers next to its joints in columns {named}",
            "one column of readings, or headings that tell found from limit, LH from RH, or the"
            " days",
            remedy,
            sheet=sheet,
        )

    def upright(self, columns: Columns, visits: Mapping[int, Occasion]) -> Iterator[Row]:
        """The form as rows of a table, one for each visit."""
        ids = columns.at(RECORD_ID)
        row = self.lines[ids[0]].row if ids else self.row
        for column, visit in visits.items():
            found = Row(row, [], visit=visit)
            for line, p in zip(self.lines, columns.placed, strict=True):
                cells = dict(enumerate(line.cells))
                own, shared = cells.get(column), cells.get(self.value_column)
                is_measured = p.field is None or p.field.column in _MEASURED
                # Above the readings a line may say it once for all columns.
                is_own = is_measured and line.row >= self.measured_from
                is_read = any(cells.get(i) is not None for i in visits)
                if is_own and not is_read and shared is not None and line.column is not CLEARANCE:
                    # So may one that no column of readings fills; next to a reading stands a limit.
                    is_own = line.column is PLUNGER_DISPLACEMENT
                    if is_own:
                        found.questions.append(
                            f"{line.label!r} says {quote(shared, 40)} in a column that is not read:"
                            f" if it is a reading, move it to column {column_letters(column)}; else"
                            " delete it."
                        )
                found.cells.append(own if own is not None or is_own else shared)
                found.places.append(CellPlace.at(line.row, column, line.label))
            yield found

    def note(self, visits: Mapping[int, Occasion]) -> str:
        """Say which columns of numbers are the readings, if there are several."""
        if len(self.columns) < 2:
            return ""
        shown = [name for column, (_, name) in self.columns.items() if column in visits]
        left = [name for column, (_, name) in self.columns.items() if column not in visits]
        not_read = f"; not read: {', '.join(left)}" if left else ""
        return f"the readings are those of column {', '.join(shown)}{not_read}"


def find_form(rows: Sequence[NumberedRow], options: ReadOptions) -> Form | None:
    named: Counter[int] = Counter()
    for _, cells in rows:
        known = (i for i, cell in enumerate(cells[:4]) if _column(cell, options))
        named.update(islice(known, 1))
    at = max(named, key=lambda index: named[index], default=0)
    lines = _lines(rows, at, options)
    columns = [line.column for line in lines if line.column]
    joints = [line for line in lines if line.column in _READ]
    if len(columns) < 3 or not {*IDENTITY} & {*columns} or CLEARANCE not in columns:
        return None
    is_ours = any(cell == FORM_TITLE for _, cells in rows[:2] for cell in cells[:1])
    filled = {i for line in lines for i, c in enumerate(line.cells) if i > at and c is not None}
    # Merged labels push the values further to the right.
    value_column = at + 1 if is_ours else min(filled, default=at + 1)
    numbers = {
        i
        for line in joints
        for i, cell in enumerate(line.cells)
        if (_is_number(cell) if i > at else _is_fraction(cell))
    }
    # Up to three rows above the first joint hold headings, none of them a line.
    kinds = {line.row: line.column for line in lines if line.column is not JOINT}
    above = [(row, cells) for row, cells in reversed(rows) if row < joints[0].row]
    headings = dict(takewhile(lambda each: not kinds.get(each[0]), above[:3]))
    lines = [line for line in lines if line.row not in headings and _is_line(line, at, options)]
    # Lines of a side or a day that several columns fill also head them.
    told_apart = [
        line.cells
        for line in lines
        if line.column in (SIDE, DATE)
        and sum(cell is not None for cell in line.cells[at + 1 :]) > 1
    ]
    heads = [*reversed(headings.values()), *told_apart]
    return Form(
        row=lines[0].row,
        texts=tuple(line.label for line in lines),
        rows_used=(lines[0].row,),
        lines=lines,
        width=max(len(cells) for _, cells in rows),
        label_column=at,
        value_column=value_column,
        columns={i: _heading(i, heads) for i in sorted(numbers)},
        measured_from=min([joints[0].row, *headings]),
        is_ours=is_ours,
    )


def _lines(rows: Sequence[NumberedRow], at: int, options: ReadOptions) -> list[_Line]:
    """The rows with a label; numbers below a label that says joint are the names of joints."""
    lines: list[_Line] = []
    for row, cells in rows:
        label = cells[at] if at < len(cells) else None
        number = show(label).strip()
        if number.isdecimal() and any(line.column is JOINT for line in lines):
            label = f"joint {number}"
        if isinstance(label, str):
            lines.append(_Line(row, label, _column(label, options), cells))
    return lines


def _heading(index: int, rows: Sequence[Cells]) -> tuple[Heading, str]:
    cells = [cells[index] for cells in rows if index < len(cells)]
    words = [cell.text if isinstance(cell, OddCell) else show(cell) for cell in cells]
    text = " ".join(filter(None, words))
    letters = column_letters(index)
    return take_apart(text), f"{letters} ({text[:40]!r})" if text else letters


def _column(cell: Cell, options: ReadOptions) -> Column | None:
    field = recognise(cell, options.joints).field if isinstance(cell, str) else None
    return None if field is None else field.column


def _is_number(cell: Cell) -> bool:
    """Whether a cell may be a reading: a number, or a text that begins with one."""
    return cell is not None and (not isinstance(cell, str) or _NUMBER.match(cell) is not None)


def _is_fraction(cell: Cell) -> bool:
    """Whether a cell in front of a label may be a reading, not the number of its line."""
    number = math.nan if cell is None else written_number(cell, decimal_comma=True)[0]
    return number % 1.0 > 0.0


def _is_line(line: _Line, at: int, options: ReadOptions) -> bool:
    """Leave out titles, hints and signature lines, but not a label that may be a reading."""
    is_known = recognise(line.label, options.joints) is not UNKNOWN
    is_named = mapped_to(options, line.label, -1) is not None or line.label.rstrip().endswith(":")
    return (
        is_known
        or is_named
        or any(
            _is_fraction(cell) or may_be_outcome(cell, asked=False) or says_failed(show(cell))
            for cell in line.cells[at + 1 :]
            if cell is not None
        )
    )
