"""The rows of one table, wide or long, turned into inspections."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace

from mlg_troubleshoot.decision.inspection import Inspection, InvalidRow, RowSource
from mlg_troubleshoot.errors import Problem
from mlg_troubleshoot.records.cells import Cell, column_letters
from mlg_troubleshoot.records.columns import CARRIED
from mlg_troubleshoot.records.layout import ColumnReader, Columns, Header
from mlg_troubleshoot.records.longform import LongReader
from mlg_troubleshoot.records.model import ColumnReading, ReadOptions, SheetLayout
from mlg_troubleshoot.records.rows import RowReader
from mlg_troubleshoot.records.source import NumberedRow, Sheet

_PROGRESS_ROWS = 500


@dataclass(slots=True)
class Collected:
    """What the sheets of one file gave.

    Parameters
    ----------
    rows : list of Inspection or InvalidRow
        The data rows.
    problems : list of Problem
        The errors.
    notes : list of str
        The notes.
    layouts : list of SheetLayout
        Where the tables are.
    invalid_content : dict of RowSource to int
        A hash of the cells of each row that cannot be judged, to tell a repeated row from another one.
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
    """Read a table with one header.

    Parameters
    ----------
    sheet : Sheet
        The sheet.
    header : Header
        Its header.
    rows : iterator of tuple
        All its rows, from the first.
    options : ReadOptions
        What the caller declared.
    file : str or None
        File as the user named it.
    delimiter : str or None
        Separator of a CSV file.
    tick : callable
        Called with a number of rows that were read.

    Returns
    -------
    Collected
        Rows, problems and notes.
    """
    out = Collected()
    columns = ColumnReader(options, file, sheet.name).place(header.texts, header.row, units=header.units)
    _spare_carried(columns)
    out.problems += columns.problems
    if header.row > 1:
        used = " and ".join(str(n) for n in header.rows_used)
        out.notes.append(
            f"the header stands in row {used}" if len(header.rows_used) == 1 else f"the header stands in rows {used}"
        )
    out.notes += columns.notes
    row_problems: list[Problem] = []
    comma = options.decimal_comma or delimiter == ";"
    reader = RowReader(
        columns.placed,
        options,
        file=file,
        sheet=sheet.name,
        decimal_comma=comma,
        report=row_problems.append,
        header_row=header.row,
    )
    long = (
        LongReader(columns.placed, options, file, sheet.name, comma, row_problems.append, header.row)
        if columns.is_long
        else None
    )
    last = header.row
    repeated = 0
    pending = 0
    width = header.width
    is_header = _header_test(header)
    faulty = sheet.facts.faulty
    collect = out.rows.append
    for number, cells in rows:
        if number <= header.row:
            continue
        if is_header(cells):
            repeated += 1
            continue
        last = number
        pending += 1
        if pending == _PROGRESS_ROWS:
            tick(pending)
            pending = 0
        if delimiter is not None and len(cells) != width and (len(cells) < width or any(cells[width:])):
            collect(reader.ragged(number, cells, width))
        elif number in faulty:
            collect(reader.faulty(number, cells, faulty[number]))
        elif long is not None:
            long.add(number, cells)
        else:
            read = reader.read(number, cells)
            collect(read)
            if read.__class__ is InvalidRow:
                out.invalid_content[read.source] = hash(tuple(cells))
    tick(pending)
    if long is not None:
        out.rows = _in_order([*out.rows, *long.finish()])
        out.notes.append("long layout: one row is one joint's reading; rows with one record id are one inspection")
    if repeated:
        out.notes.append(
            f"{repeated} repeated header rows were skipped" if repeated > 1 else "a repeated header row was skipped"
        )
    out.problems += row_problems
    out.notes += _hidden_notes(sheet, columns, header.row)
    out.layouts.append(
        SheetLayout(
            file,
            sheet.name,
            "long" if columns.is_long else "wide",
            header.row,
            last,
            len(header.texts),
            tuple(
                ColumnReading(p.index, p.header, p.field.name if p.field is not None and not p.refused else None)
                for p in columns.placed
            ),
        )
    )
    return out


def _header_test(header: Header) -> Callable[[Sequence[Cell]], bool]:
    """Return a test that tells the header printed again on a later page."""
    texts = tuple(text or None for text in header.texts)
    first = next((i for i, text in enumerate(texts) if text), 0)

    def is_header(cells: Sequence[Cell]) -> bool:
        return len(cells) > first and cells[first] == texts[first] and tuple(cells) == texts[: len(cells)]

    return is_header


def _in_order(rows: list[Inspection | InvalidRow]) -> list[Inspection | InvalidRow]:
    return sorted(rows, key=lambda row: row.source.row or 0)


def _spare_carried(columns: Columns) -> None:
    """Keep a second column of remarks as a column of its own instead of refusing it."""
    kept: list[Problem] = []
    for problem in columns.problems:
        placed = next((p for p in columns.placed if p.header_cell == problem.cell), None)
        spared = (
            problem.code == "header_duplicate"
            and placed is not None
            and placed.field is not None
            and placed.field.kind in CARRIED
        )
        if not spared or placed is None or placed.field is None:
            kept.append(problem)
            continue
        quantity = placed.field.quantity
        first = next(p for p in columns.placed if p.field is not None and p.field.quantity == quantity)
        columns.placed[first.index] = replace(first, refused=False)
        columns.placed[placed.index] = replace(placed, field=None, refused=False)
    columns.problems[:] = kept


def _hidden_notes(sheet: Sheet, columns: Columns, header_row: int) -> list[str]:
    notes: list[str] = []
    facts = sheet.facts
    hidden = sum(1 for row in facts.hidden_rows if row > header_row)
    if hidden:
        notes.append(f"{hidden} hidden or filtered {'rows were' if hidden > 1 else 'row was'} read too")
    width = len(columns.placed)
    blocks = [(a, min(b, width - 1)) for a, b in facts.hidden_columns if a < width]
    for first, last in blocks:
        letters = column_letters(first) if first == last else f"{column_letters(first)} to {column_letters(last)}"
        notes.append(f"hidden column {letters} was read too")
    if facts.formulas:
        counts = ", ".join(
            f"{column_letters(index)} ({count})" for index, count in sorted(facts.formulas.items()) if index < width
        )
        if counts:
            notes.append(f"formulas were read by their last calculated values: column {counts}")
    return notes
