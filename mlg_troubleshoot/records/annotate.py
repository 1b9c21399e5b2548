"""The user's own workbook with bad cells marked and verdicts added, everything else as it was."""

from __future__ import annotations

import io
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING
from zipfile import BadZipFile, ZipFile

from mlg_troubleshoot.decision.inspection import RowSource
from mlg_troubleshoot.errors import OutputError, Problem, UsageError
from mlg_troubleshoot.records.cachedvalues import restore_results
from mlg_troubleshoot.records.cells import column_letters
from mlg_troubleshoot.records.columns import Kind
from mlg_troubleshoot.records.export import write_bytes
from mlg_troubleshoot.records.model import FileRefusedError, ReadResult, SheetLayout
from mlg_troubleshoot.records.xlsx import XlsxFile

if TYPE_CHECKING:
    from openpyxl.cell import Cell, MergedCell
    from openpyxl.worksheet.worksheet import Worksheet

_BAD_FILL = "FFFFB3B3"
_HEADER_FILL = "FFD9E2EC"
_AUTHOR = "mlg check"

VerdictColumns = Mapping[RowSource, Mapping[str, str | float | None]]


def annotate_workbook(
    source: str | Path, out: str | Path, result: ReadResult, verdicts: VerdictColumns, *, name: str | None = None
) -> tuple[str, ...]:
    """Write a copy of a workbook with bad cells marked and verdict columns behind the table.

    Parameters
    ----------
    source : str or Path
        The workbook that was read, .xlsx or .xlsm.
    out : str or Path
        File to write; it appears whole or not at all. Macros are kept if it ends in .xlsm.
    result : ReadResult
        What was read from it.
    verdicts : mapping of RowSource to mapping
        New columns by header, for each row.
    name : str, optional
        What `result` calls the file; the path as given if left out.

    Returns
    -------
    tuple of str
        What the copy could not take over, such as pictures and drawn shapes, in plain words; empty if nothing.

    Raises
    ------
    UsageError
        If the source is no .xlsx or .xlsm workbook, or is the file to write.
    OutputError
        If the copy cannot be written.
    """
    label = name if name is not None else str(source)
    data = _load(source, out)
    from openpyxl import load_workbook

    keep_macros = Path(out).suffix.lower() == ".xlsm"
    try:
        book = load_workbook(io.BytesIO(data), keep_vba=keep_macros, rich_text=True)
    except (BadZipFile, KeyError, ValueError, TypeError, AttributeError, IndexError, SyntaxError, OSError) as error:
        raise OutputError(
            f"{source} cannot be copied ({type(error).__name__}): a part of it is not understood",
            "Open it in a spreadsheet program, save it again as .xlsx, and annotate the copy.",
        ) from None
    for layout in result.layouts:
        if layout.file == label and layout.sheet in book.sheetnames:
            sheet = book[layout.sheet]
            free = _free_column(sheet, layout)
            for problem in result.problems:
                if problem.file == label and problem.sheet == layout.sheet:
                    _mark(sheet, layout, problem)
            own = {s: v for s, v in verdicts.items() if s.file == label and s.sheet == layout.sheet}
            if layout.kind == "form":
                _beside_form(sheet, layout, free, own)
            else:
                _behind_table(sheet, layout, free, own)
    buffer = io.BytesIO()
    book.save(buffer)
    written = restore_results(data, buffer.getvalue())
    write_bytes(out, written)
    return _not_taken_over(data, written)


# Parts that the library may drop in silence: their folder, and what a user calls them.
_DROPPABLE = (
    ("xl/media/", "pictures"),
    ("xl/charts/chart", "charts"),
    ("xl/pivottables/", "pivot tables"),
    ("xl/ctrlprops/", "form controls"),
    ("xl/slicers/", "slicers"),
    ("xl/threadedcomments/", "threaded comments"),
    ("xl/diagrams/data", "diagrams"),
)
_SHAPES = (b"<xdr:sp ", b"<xdr:sp>", b"<xdr:cxnSp", b"<xdr:grpSp")


def _not_taken_over(before: bytes, after: bytes) -> tuple[str, ...]:
    """Compare what the two packages hold beside their cells."""
    with ZipFile(io.BytesIO(before)) as old, ZipFile(io.BytesIO(after)) as new:
        lost = [
            f"the annotated copy lacks {count} of the {what} of the workbook"
            for folder, what in _DROPPABLE
            if (count := _count(old, folder) - _count(new, folder)) > 0
        ]
        shapes = _shapes(old) - _shapes(new)
    if shapes > 0:
        lost.append(f"the annotated copy lacks {shapes} of the drawn shapes of the workbook")
    return tuple(lost)


def _count(archive: ZipFile, folder: str) -> int:
    return sum(1 for name in archive.namelist() if name.lower().startswith(folder) and "_rels" not in name)


def _shapes(archive: ZipFile) -> int:
    drawings = [name for name in archive.namelist() if name.lower().startswith("xl/drawings/drawing")]
    return sum(archive.read(name).count(mark) for name in drawings for mark in _SHAPES)


def _load(source: str | Path, out: str | Path) -> bytes:
    path = Path(source)
    if Path(out).resolve() == path.resolve():
        raise UsageError(f"{out} is the workbook itself", "Name another file for the annotated copy.")
    try:
        data = path.read_bytes()
        if not data.startswith(b"PK") or b"opendocument" in data[:200]:
            raise UsageError(
                f"{source} is no .xlsx workbook, so it cannot be annotated",
                "Save it as .xlsx first, or use --csv for the results.",
            )
        # The same guard as in reading: nothing dangerous reaches the library that writes.
        XlsxFile(data)
    except FileRefusedError as refusal:
        raise UsageError(f"{source}: {refusal.found}", refusal.remedy) from None
    except OSError as error:
        raise UsageError(f"{source} cannot be opened: {error.strerror}", "Check the path.") from None
    return data


def _free_column(sheet: Worksheet, layout: SheetLayout) -> int:
    """Return the first column, counted from 1, with nothing in it or to the right of it."""
    used = max((cell.column for row in sheet.iter_rows() for cell in row if cell.value is not None), default=0)
    return int(max(used, layout.width)) + 1


def _mark(sheet: Worksheet, layout: SheetLayout, problem: Problem) -> None:
    from openpyxl.cell import MergedCell
    from openpyxl.comments import Comment
    from openpyxl.styles import PatternFill

    place = problem.cell
    if place is None:
        row = problem.row or layout.header_row
        place = f"{column_letters(layout.index_of(Kind.RECORD_ID.value) or 0)}{row}"
    cell = sheet[place]
    if isinstance(cell, MergedCell):
        anchor = next((r for r in sheet.merged_cells.ranges if place in r), None)
        if anchor is None:
            return
        cell = sheet.cell(anchor.min_row, anchor.min_col)
    cell.fill = PatternFill("solid", fgColor=_BAD_FILL)
    text = f"{_AUTHOR}: found {problem.value or 'nothing'}; expected {problem.expected}. {problem.remedy}"
    before = cell.comment
    comment = Comment(f"{before.text}\n{text}" if before is not None else text, _AUTHOR, height=160, width=360)
    cell.comment = comment


def _put(cell: Cell | MergedCell, value: str | float | None) -> None:
    """Put a value into a cell; a text stays a text even if it begins like a formula."""
    from openpyxl.cell import Cell as OrdinaryCell

    if not isinstance(cell, OrdinaryCell):
        return
    cell.value = value
    if isinstance(value, str):
        cell.data_type = "s"
        if value.startswith(("=", "+", "-", "@")):
            cell.quotePrefix = True


def _headers(own: VerdictColumns) -> list[str]:
    return list(dict.fromkeys(header for values in own.values() for header in values))


def _behind_table(sheet: Worksheet, layout: SheetLayout, free: int, own: VerdictColumns) -> None:
    from openpyxl.styles import Alignment, Font, PatternFill

    for offset, header in enumerate(_headers(own)):
        cell = sheet.cell(layout.header_row, free + offset)
        _put(cell, header)
        cell.font = Font(bold=True)
        cell.fill = PatternFill("solid", fgColor=_HEADER_FILL)
        cell.alignment = Alignment(wrap_text=True, vertical="center")
        for source, values in own.items():
            if source.row is not None and values.get(header) is not None:
                _put(sheet.cell(source.row, free + offset), values[header])


def _beside_form(sheet: Worksheet, layout: SheetLayout, free: int, own: VerdictColumns) -> None:
    from openpyxl.styles import Font

    for values in own.values():
        for offset, (header, value) in enumerate(values.items()):
            label = sheet.cell(layout.header_row + offset, free)
            _put(label, header)
            label.font = Font(bold=True)
            if value is not None:
                _put(sheet.cell(layout.header_row + offset, free + 1), value)
