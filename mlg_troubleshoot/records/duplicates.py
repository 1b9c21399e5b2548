"""Record ids that stand twice: the same inspection again, or two that contradict each other."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from mlg_troubleshoot.decision.columns import RECORD_ID, Column
from mlg_troubleshoot.decision.inspection import Inspection, InvalidRow, RowSource
from mlg_troubleshoot.errors import Problem
from mlg_troubleshoot.records.cells import column_letters
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
            others = [where(other.source) for other in found if other is not row]
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
    shown = ", ".join(others[:3]) + (f" and {len(others) - 3} more" if len(others) > 3 else "")
    expected = f"a record id that no other inspection of the file has; {shown} also has it"
    remedy = "Keep the right row, or give each inspection its own record id."
    place = source.file, source.sheet, source.row, header, cell
    return Problem("record_id_duplicate", *place, record_id, expected, remedy)
