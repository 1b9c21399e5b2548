"""Rows compared with each other: record ids and clearances that stand twice, tails that look alike,
and the order of time.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from mlg_troubleshoot.decision.columns import DATE, LANDINGS, RECORD_ID, Column
from mlg_troubleshoot.decision.inspection import (
    Inspection,
    InvalidRow,
    RowSource,
    Side,
    plain_tail,
)
from mlg_troubleshoot.errors import Problem
from mlg_troubleshoot.life.chronology import Moment, contradictions
from mlg_troubleshoot.records.cells import column_letters, quote
from mlg_troubleshoot.records.model import SheetLayout, to_correct


def settle_duplicates(
    rows: list[Inspection | InvalidRow],
    layouts: Sequence[SheetLayout],
    invalid_content: Mapping[RowSource, int],
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
        bare = [_content(row, invalid_content) for row in found]
        if all(b is not None and b == bare[0] for b in bare):
            for place in places[1:]:
                row = rows[place]
                note = f"the same inspection as {where(found[0].source)}"
                rows[place] = replace(row, warnings=(*row.warnings, note))
            continue
        for place, row in zip(places, found, strict=True):
            others = [where(other.source) for other in found[:4] if other is not row][:3]
            if len(found) > len(others) + 1:
                others[-1] += f" and {len(found) - 1 - len(others)} more"
            header, cell = cell_of(row.source, layouts, RECORD_ID)
            problems.append(_problem(record_id, row.source, others, header, cell))
            rows[place] = to_correct(row, header)
    return problems


def _content(
    row: Inspection | InvalidRow, invalid_content: Mapping[RowSource, int]
) -> Inspection | int | None:
    if isinstance(row, InvalidRow):
        return invalid_content.get(row.source)
    return replace(row, source=RowSource(), warnings=(), entered={})


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
        if (layout.file, layout.sheet) == (source.file, source.sheet):
            for column in layout.columns:
                if column.read_as == wanted.name:
                    return (
                        column.header,
                        f"{column_letters(column.index)}{column.row or source.row}",
                    )
    return wanted.name, None


def _problem(
    record_id: str, source: RowSource, others: list[str], header: str, cell: str | None
) -> Problem:
    shown = ", ".join(others)
    expected = f"a record id that no other inspection of the file has; {shown} also has it"
    remedy = "Keep the right row, or give each inspection its own record id."
    place = source.file, source.sheet, source.row, header, cell
    return Problem("record_id_duplicate", *place, record_id, expected, remedy)


# So many different clearances are not read again exactly: a reading agrees with the one before to
# within its gauge's error only. Assumed. [1]
_DIFFERENT = 5


def copies(rows: Sequence[Inspection | InvalidRow]) -> dict[int, str]:
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


def alike_tails(tails: Mapping[str, RowSource]) -> list[str]:
    """Say which tail numbers may be one that is written in several ways, each with a row of it."""
    alike: dict[str, list[str]] = {}
    for tail, source in tails.items():
        alike.setdefault(plain_tail(tail), []).append(f"{quote(tail, 40)!r} ({where(source)})")
    return [
        f"tails {' and '.join(same)} differ only in case, blanks, dashes or O for 0, and"
        " are taken as different aircraft: correct the one that is wrong"
        for same in alike.values()
        if len(same) > 1
    ]


def order_warnings(
    rows: Sequence[Inspection | InvalidRow], layouts: Sequence[SheetLayout]
) -> dict[int, str]:
    """Name the rows of one gear whose landings run backwards as its dates go on, each with its
    cell.
    """
    gears: dict[tuple[str, Side], list[tuple[int, Inspection]]] = {}
    for place, row in enumerate(rows):
        if isinstance(row, Inspection):
            gears.setdefault((row.tail_no, row.side), []).append((place, row))
    found: dict[int, str] = {}
    for (tail, side), seen in gears.items():
        if len(seen) == 1:
            continue

        def name(n: int, seen: list[tuple[int, Inspection]] = seen) -> str:
            source = seen[n][1].source
            cells = [
                cell for column in (LANDINGS, DATE) if (cell := cell_of(source, layouts, column)[1])
            ]
            return ", ".join([where(source), *cells])

        for n, said in contradictions([Moment.of(row) for _place, row in seen], name).items():
            found[seen[n][0]] = (
                f"{tail} {side}: {said}. Unless the gear was overhauled in between, correct the"
                " landings or the date."
            )
    return found
