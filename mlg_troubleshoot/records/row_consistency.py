"""Rows compared with each other: record ids and clearances that stand twice, tails that look
alike, and the order of time.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from mlg_troubleshoot.decision.columns import DATE, LANDINGS, RECORD_ID, Column
from mlg_troubleshoot.decision.inspection import (
    Inspection,
    InvalidRow,
    RowSource,
    plain_tail,
)
from mlg_troubleshoot.errors import Problem
from mlg_troubleshoot.life.state import GearVisit, Moment, contradictions
from mlg_troubleshoot.records.cells import column_letters, quote
from mlg_troubleshoot.records.rows import SheetLayout


def settle_duplicates(
    rows: list[Inspection | InvalidRow], layouts: Sequence[SheetLayout]
) -> list[Problem]:
    """Warn of rows that are the same inspection again, and refuse rows that share an id and
    differ.
    """
    named: dict[tuple[str | None, str], list[int]] = {}
    for place, row in enumerate(rows):
        if row.record_id is not None:
            named.setdefault((row.source.file, row.record_id), []).append(place)
    problems: list[Problem] = []
    for (_, record_id), places in named.items():
        if len(places) == 1:
            continue
        found = [rows[place] for place in places]
        said = [_content(row) for row in found]
        is_same = all(each == said[0] for each in said)
        for place, row in list(zip(places, found, strict=True))[is_same:]:
            if is_same:
                note = f"the same inspection as {where(found[0].source)}"
                rows[place] = replace(row, warnings=(*row.warnings, note))
                continue
            other = where(next(each.source for each in found if each is not row))
            other += f" and {len(found) - 2} more" if len(found) > 2 else ""
            header, cell = cell_of(row.source, layouts, RECORD_ID)
            problems.append(
                Problem(
                    "record_id_duplicate",
                    row.source.file,
                    row.source.sheet,
                    row.source.row,
                    header,
                    cell,
                    record_id,
                    f"a record id that no other inspection of the file has; {other} also has it",
                    "Keep the right row, or give each inspection its own record id.",
                )
            )
            identity = row.record_id, row.tail_no, row.side
            invalid = (
                row
                if isinstance(row, InvalidRow)
                else InvalidRow(*identity, (), row.warnings, row.source, row)
            )
            rows[place] = replace(invalid, correct=tuple(dict.fromkeys((header, *invalid.correct))))
    return problems


def _content(row: Inspection | InvalidRow) -> tuple[object, ...]:
    """What a row says, without its place."""
    known, correct = (row.understood, row.correct) if isinstance(row, InvalidRow) else (row, ())
    if known is not None:
        known = replace(known, source=RowSource(), warnings=(), entered={})
    return row.tail_no, row.side, correct, known


def where(source: RowSource) -> str:
    sheet = f" of sheet {source.sheet!r}" if source.sheet is not None else ""
    return f"row {source.row}{sheet} of {source.file or 'the input'}"


def cell_of(
    source: RowSource, layouts: Sequence[SheetLayout], wanted: Column
) -> tuple[str, str | None]:
    """Header of a column as it was written, and its cell in a row or a form; no cell if the table
    does not have it.
    """
    for layout in layouts:
        is_there = (layout.file, layout.sheet) == (source.file, source.sheet)
        for column in layout.columns if is_there else ():
            if column.read_as == wanted.name:
                return column.header, f"{column_letters(column.index)}{column.row or source.row}"
    return wanted.name, None


Rows = Sequence[Inspection | InvalidRow]


# So many different clearances are not read again exactly: a reading agrees with the one before to
# within its gauge's error only. Assumed. [1]
_DIFFERENT = 5


def copies(rows: Rows) -> dict[int, str]:
    """Name the rows, by their place, that repeat every clearance of an earlier row of the gear."""
    first: dict[object, Inspection] = {}
    found: dict[int, str] = {}
    for place, row in enumerate(rows):
        # Rows after a repair are of one reading of the clearances.
        if not isinstance(row, Inspection) or row.is_repaired:
            continue
        if len({value for value in row.clearance_in.values() if value > 0.0}) < _DIFFERENT:
            continue
        before = first.setdefault((row.tail_no, row.side, *row.clearance_in.items()), row)
        if before is row or before.record_id == row.record_id:
            continue
        said = "copied from that sheet?"
        if before.inspection_date == row.inspection_date:
            said = "the same inspection, entered twice?"
        found[place] = f"all clearances are those of {where(before.source)}: {said}"
    return found


def one_aircraft(rows: list[Inspection | InvalidRow]) -> list[str]:
    """Give rows whose tail numbers differ only in how they are spelt the first spelling; say which
    they are, each with a row of it.
    """
    tails: dict[str, RowSource] = {}
    for row in rows:
        if row.tail_no is not None:
            tails.setdefault(row.tail_no, row.source)
    spelt: dict[str, list[str]] = {}
    for tail in tails:
        spelt.setdefault(plain_tail(tail), []).append(tail)
    several = [same for same in spelt.values() if len(same) > 1]
    first = {tail: same[0] for same in several for tail in same[1:]}
    for place, row in enumerate(rows):
        if row.tail_no in first:
            rows[place] = replace(row, tail_no=first[row.tail_no])
    notes = []
    for same in several:
        named = " and ".join(f"{quote(tail, 40)!r} ({where(tails[tail])})" for tail in same)
        notes.append(f"tails {named} are taken as one aircraft: if they are two, correct them")
    return notes


def order_warnings(rows: Rows, layouts: Sequence[SheetLayout]) -> dict[int, str]:
    """Name the rows of one gear whose landings run backwards as its dates go on, each with its
    cell.
    """
    gears: dict[tuple[str, str], list[int]] = {}
    moments: dict[int, Moment] = {}
    for place, row in enumerate(rows):
        if isinstance(row, Inspection):
            moments[place] = Moment.of(GearVisit(row))
            gears.setdefault((row.tail_no, row.side), []).append(place)
    found: dict[int, str] = {}
    for (tail, side), places in gears.items():
        if len(places) == 1:
            continue

        def name(n: int, places: list[int] = places) -> str:
            source = rows[places[n]].source
            cells = [cell_of(source, layouts, column)[1] for column in (LANDINGS, DATE)]
            return ", ".join([where(source), *filter(None, cells)])

        for n, said in contradictions([moments[place] for place in places], name).items():
            found[places[n]] = (
                f"{tail} {side}: {said}. Unless the gear was overhauled in between, correct the"
                " landings or the date."
            )
    return found
