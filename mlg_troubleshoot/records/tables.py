"""The rows of one table, wide or long, turned into inspections."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import chain, islice
from pathlib import PurePath

from mlg_troubleshoot.decision.columns import CLEARANCE, IDENTITY, RECORD_ID, SIDE, TAIL_NO
from mlg_troubleshoot.decision.inspection import Inspection, InvalidRow, RowSource, Side
from mlg_troubleshoot.errors import Problem
from mlg_troubleshoot.records.cells import Cells, Filled, column_letters, quote
from mlg_troubleshoot.records.headers import UNKNOWN, recognise, tidy
from mlg_troubleshoot.records.layout import ColumnReader, Columns, Header, header_score
from mlg_troubleshoot.records.longform import LongReader
from mlg_troubleshoot.records.model import ColumnReading, ReadOptions, SheetLayout, TableInHand
from mlg_troubleshoot.records.rows import RowReader
from mlg_troubleshoot.records.source import FileRefusedError, MergedRange, NumberedRow, Sheet
from mlg_troubleshoot.units import ClearanceConvention

_PROGRESS_ROWS = 500
# Rows by which a column is known that holds sides, whatever its header says.
_LOOKED_AT = 50
_GEARS = frozenset(("gear", "mlg", "main gear", "landing gear", "leg", "hand", "l/r"))


@dataclass(slots=True)
class Collected:
    """What the sheets of one file gave.

    invalid_content: a hash of the cells of each row that cannot be judged, to recognize a repeated
    row.
    """

    rows: list[Inspection | InvalidRow] = field(default_factory=list)
    problems: list[Problem] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    layouts: list[SheetLayout] = field(default_factory=list)
    invalid_content: dict[RowSource, int] = field(default_factory=dict)


def read_table(
    sheet: Sheet,
    header: Header,
    rows: Iterator[NumberedRow],
    options: ReadOptions,
    *,
    file: str | None,
    delimiter: str | None,
    tick: Callable[[int], None],
) -> Collected:
    out = Collected()
    comma = options.decimal_comma or delimiter == ";"
    first = list(islice(rows, _LOOKED_AT))
    rows = chain(first, rows)
    options, side, said = _sides(sheet.name, header, first, options, file)
    in_hand = TableInHand(options, file, sheet.name, out.problems.append, comma, side)
    columns = ColumnReader(in_hand).place(header.texts, header.row, units=header.units)
    table = _Table(sheet, header, columns, in_hand, delimiter, out)
    taken = 0
    titles: list[str] = []
    for number, cells in rows:
        if number < header.rows_used[0]:
            titles += [cell for cell in cells if isinstance(cell, str)]
        elif number > header.row:
            table.take(number, cells)
            taken += 1
            if taken % _PROGRESS_ROWS == 0:
                tick(_PROGRESS_ROWS)
    tick(taken % _PROGRESS_ROWS)
    table.finish()
    placed = (
        f"the header is in row {' and '.join(map(str, header.rows_used))}" if header.row > 1 else ""
    )
    read, carried = columns.notes()
    about = "; ".join([*table.notes(), *_hidden_notes(sheet, columns, header.row)])
    against = _against_title(titles, options.convention)
    out.notes += filter(
        None, (against, "; ".join(filter(None, (placed, read, said))), carried, about)
    )
    kind = "long" if columns.is_long else "wide"
    readings = tuple(ColumnReading(p.index, p.header, p.read_as) for p in columns.placed)
    out.layouts.append(SheetLayout(file, sheet.name, kind, header.row, len(header.texts), readings))
    return out


def _against_title(titles: Sequence[str], declared: ClearanceConvention | None) -> str:
    """Say that a title above the header names another convention than the one declared."""
    if declared is None:
        return ""
    for title in titles:
        words = tidy(title).replace("_", " ")
        named = [c for c in ClearanceConvention if c.value.lower().replace("_", " ") in words]
        if named and all(c.per_radial != declared.per_radial for c in named):
            return (
                f"above the header stands {quote(title, 60)!r}, but rows that state no convention"
                f" are read as {declared}, as declared: one of the two is wrong"
            )
    return ""


def _sides(
    sheet: str | None,
    header: Header,
    rows: Sequence[NumberedRow],
    options: ReadOptions,
    file: str | None,
) -> tuple[ReadOptions, Side | None, str]:
    """Find the sides of a table without a column of them: in a column of gears that holds nothing
    else, as declared, or in the name of the sheet or the file. What was done is said in words.
    """
    known = [recognise(text, options.joints).field for text in header.texts]
    columns = {field.column for field in known if field is not None}
    mapped = {*options.column_map.values(), *options.remembered_map.values()}
    if SIDE in columns or SIDE.name in mapped:
        return options, None, ""
    for index, text in enumerate(header.texts):
        cells = [row[index] for number, row in rows if number > header.row and index < len(row)]
        words = [cell for cell in cells if cell is not None]
        if (
            tidy(text) in _GEARS
            and text not in options.column_map
            and words
            and all(isinstance(word, str) and Side.spelt(word) for word in words)
        ):
            mapping = {**options.column_map, text: SIDE.name}
            return replace(options, column_map=mapping), None, ""
    for name, place in ((sheet, "sheet"), (PurePath(file or "").stem, "file")):
        whole = name or ""
        found = (
            {Side.spelt(whole)}
            if Side.spelt(whole)
            else {Side.spelt(word) for word in re.findall(r"(?<![^\W_])[LR]H(?![^\W_])", whole)}
        )
        if options.side is None and len(found) == 1:
            (side,) = found
            return options, side, f"every row is {side}, as the name of the {place} says"
    return options, options.side, "" if options.side is None else f"every row is {options.side}"


# First words of rows that people write below or between inspections.
_NO_INSPECTION = re.compile(
    r"""(?:(?:grand|sub)?\W?totals?|sums?|averages?|avg|mean|median|max(?:imum)?|min(?:imum)?|std|count|limits?
      |sign(?:ed|ature)?s?|checked|approved|inspect(?:ed|or)|prepared|certified|verified|stamp|date|name
      |end|notes?|remarks?|legend|key|page|nil|no\ further)(?![^\s:.,'\u2019_/(\-])""",
    re.VERBOSE | re.IGNORECASE,
)
_RULE = re.compile(r"[-=_*.\s]{3,}")


class _Table:
    """The rows of one table: inspections, and what stands between them."""

    def __init__(
        self,
        sheet: Sheet,
        header: Header,
        columns: Columns,
        table: TableInHand,
        delimiter: str | None,
        out: Collected,
    ) -> None:
        self._reader = RowReader(columns.placed, table)
        self._long = LongReader(columns.placed, table) if columns.is_long else None
        self._faulty = sheet.facts.faulty
        self._texts = tuple(text or None for text in header.texts)
        self._width = len(header.texts) if delimiter is not None else None
        self._out = out
        self._sheet = sheet
        # A workbook's cell that is merged over several rows says the same of each; of a reading it
        # is not known which gear's it is, nor of which row a record's name.
        self._of_several = [
            p.index
            for p in columns.placed
            if delimiter is None and p.field is not None and not p.field.column.is_length
            if p.field.column is not RECORD_ID or columns.is_long
        ]
        self._above: dict[int, tuple[int, Filled]] = {}
        self._last_rows: dict[tuple[int, int], int] = {}
        self._merged: Sequence[MergedRange] | None = None
        self._filled_in = 0
        self._repeated = 0
        self._aside: list[str] = []
        self._dates = ""
        self._options = table.options
        self._second: FileRefusedError | None = None
        self._telling = [
            [p.index for p in columns.placed if p.field is not None and p.field.column is column]
            for column in (TAIL_NO, SIDE, CLEARANCE)
        ]

    def take(self, number: int, cells: Cells) -> None:
        # The header is printed again on a later page.
        if cells[0] == self._texts[0] and tuple(cells) == self._texts[: len(cells)] and any(cells):
            self._repeated += 1
            return
        if self._stands_aside(number, cells):
            return
        if self._of_several:
            cells = self._with_merged(number, cells)
        self._second = self._second or self._begins_again(number, cells)
        width = self._width
        collect = self._out.rows.append
        if self._second is not None:
            collect(self._reader.faulty(number, cells, self._second))
        elif (
            width is not None and len(cells) != width and (len(cells) < width or any(cells[width:]))
        ):
            collect(self._reader.ragged(number, cells, width))
        elif number in self._faulty:
            collect(self._reader.faulty(number, cells, self._faulty[number]))
        elif self._long is not None:
            self._long.add(number, cells)
        else:
            read = self._reader.read(number, cells)
            collect(read)
            if read.__class__ is InvalidRow:
                self._out.invalid_content[read.source] = hash(tuple(cells))

    def _with_merged(self, number: int, cells: Cells) -> Cells:
        """Cells of a row, with those that are merged with a filled one above."""
        for index in self._of_several:
            cell = cells[index] if index < len(cells) else None
            if cell is not None:
                self._above[index] = number, cell
            elif index in self._above:
                top, above = self._above[index]
                if number <= self._last_row(top, index):
                    cells = [*cells, *[None] * (index + 1 - len(cells))]
                    cells[index] = above
                    self._filled_in += 1
        return cells

    def _last_row(self, top: int, index: int) -> int:
        """The last row of the merged cells that begin in a row and a column; 0 if none do."""
        if self._merged is None:
            self._merged = self._sheet.merged()
        # An ods tells them row by row.
        for first, left, last, _right in islice(self._merged, len(self._last_rows), None):
            self._last_rows[first, left] = last
        return self._last_rows.get((top, index), 0)

    def _begins_again(self, number: int, cells: Cells) -> FileRefusedError | None:
        """Refuse what stands below the header of another table: its columns may be others."""
        joints = self._options.joints
        telling = [cells[i] for kind in self._telling for i in kind if i < len(cells)]
        words = [cell for cell in telling if isinstance(cell, str) and not cell.isdecimal()]
        if all(recognise(word, joints) is UNKNOWN for word in words):
            return None
        fields = [recognise(cell, joints).field for cell in cells if isinstance(cell, str)]
        names = any(field is not None and field.column in IDENTITY for field in fields)
        if not names or not header_score(cells, self._options):
            return None
        return FileRefusedError(
            "table_second",
            f"below the header of another table in row {number}",
            "one table with one header on each sheet",
            "Put each table on a sheet or into a file of its own.",
        )

    def _stands_aside(self, number: int, cells: Cells) -> bool:
        """Tell a row of totals, signatures and the like: it says so first, and lacks what makes an
        inspection.
        """
        place = next((i for i, cell in enumerate(cells) if cell is not None), None)
        first = None if place is None else cells[place]
        if not isinstance(first, str):
            return False
        ruled = all(
            cell is None or (isinstance(cell, str) and _RULE.fullmatch(cell)) for cell in cells
        )
        if not ruled and _NO_INSPECTION.match(first.strip()) is None:
            return False
        filled = [
            any(i != place and i < len(cells) and cells[i] is not None for i in kind)
            for kind in self._telling
        ]
        if sum(filled) > 1 and not ruled:
            return False
        self._aside.append(f"row {number} {quote(first, 40)!r}")
        return True

    def finish(self) -> None:
        """Read what could be read only with all rows at hand."""
        reader = self._reader
        if self._long is not None:
            self._out.rows[:] = sorted(
                [*self._out.rows, *self._long.finish()], key=lambda row: row.source.row or 0
            )
            reader = self._long.reader
        self._dates = reader.settle_dates(self._out.rows)

    def notes(self) -> list[str]:
        notes = []
        if self._long is not None:
            notes.append(
                "long layout: one row is one joint's reading; rows with one record id are one"
                " inspection"
            )
        if self._repeated:
            again = (
                f"{self._repeated} repeated header rows were"
                if self._repeated > 1
                else "a repeated header row was"
            )
            notes.append(f"{again} skipped")
        if self._filled_in:
            those = "cells that are" if self._filled_in > 1 else "cell that is"
            notes.append(f"{self._filled_in} blank {those} merged with one above read as it is")
        if self._aside:
            count = (
                f"{len(self._aside)} rows are not inspections"
                if len(self._aside) > 1
                else "1 row is not an inspection"
            )
            shown = ", ".join(self._aside[:5]) + (", …" if len(self._aside) > 5 else "")
            notes.append(f"{count}, set aside: {shown}")
        if self._dates:
            notes.append(self._dates)
        words = self._reader.not_measured
        if words:
            shown = ", ".join(repr(word) for word in list(words)[:4])
            cells = sum(words.values())
            notes.append(
                f"{cells} {'cells' if cells > 1 else 'cell'} with {shown} read as not measured"
            )
        return notes


def _hidden_notes(sheet: Sheet, columns: Columns, header_row: int) -> list[str]:
    notes: list[str] = []
    facts = sheet.facts
    width = len(columns.placed)
    hidden = sum(1 for row in facts.hidden_rows if row > header_row)
    if hidden:
        notes.append(
            f"{hidden} hidden or filtered {'rows were' if hidden > 1 else 'row was'} also read"
        )
    for first, last in facts.hidden_columns:
        ends = dict.fromkeys(column_letters(index) for index in (first, min(last, width - 1)))
        notes += [f"hidden column {' to '.join(ends)} was also read"] * (first < width)
    counts = [
        f"{column_letters(index)} ({n})"
        for index, n in sorted(facts.formulas.items())
        if index < width
    ]
    if counts:
        notes.append(
            f"formulas were read by their last calculated values: column {', '.join(counts)}"
        )
    return notes
