"""The user's own workbook with bad cells marked and verdicts added, everything else as it was."""

from __future__ import annotations

import hashlib
import io
import warnings
from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from zipfile import ZIP_DEFLATED, ZipFile

from openpyxl import Workbook, load_workbook
from openpyxl.cell import Cell, MergedCell
from openpyxl.comments import Comment
from openpyxl.styles import Alignment, PatternFill
from openpyxl.worksheet.worksheet import Worksheet
from openpyxl.writer.excel import ExcelWriter

from mlg_troubleshoot.decision.columns import CLEARANCE, RECORD_ID
from mlg_troubleshoot.decision.inspection import RowSource
from mlg_troubleshoot.errors import OutputError, Problem, UsageError
from mlg_troubleshoot.outputs import write_bytes
from mlg_troubleshoot.records.cells import MAX_ROWS, column_letters, writable
from mlg_troubleshoot.records.model import ReadResult, SheetLayout
from mlg_troubleshoot.records.source import FileRefusedError
from mlg_troubleshoot.records.template import BOLD, HEADER_FILL
from mlg_troubleshoot.records.xlsx import XlsxFile
from mlg_troubleshoot.records.zipguard import PARSER_ERRORS
from mlg_troubleshoot.units import LengthUnit

_BAD_FILL = "FFFFB3B3"
_OVER_FILL = "FFFFD08A"
_VERDICT_FILLS = {"WITHIN_MARGIN": "FFC9E7CB", "OUTSIDE_MARGIN": "FFF4A3A0", "INVALID": "FFF4A3A0"}
_UNDECIDED_FILL = "FFFFEB9C"
_AUTHOR = "mlg check"
# Widths of columns, and what fits on a line of the widest: its letters are narrower than digits.
# [characters]
_TEXT_WIDTH = 17
_NUMBER_WIDTH = 11
_LONG_WIDTH = 52
_ON_A_LINE = 58

VerdictColumns = Mapping[RowSource, Mapping[str, str | float | None]]
OverLimit = Mapping[RowSource, Mapping[int, float]]


def annotate_workbook(
    source: str | Path,
    out: str | Path,
    result: ReadResult,
    verdicts: VerdictColumns,
    over_limit: OverLimit = MappingProxyType({}),
) -> tuple[str, ...]:
    """Write a copy of a workbook with bad cells and joints over their limit marked, and verdict
    columns.

    ``over_limit`` gives for a row its joints over their limit, each with that limit. [in]
    """
    label = writable(str(source))
    data, judged = _load(source, out)
    if hashlib.sha256(data).hexdigest() != result.inputs_sha256.get(label):
        raise OutputError(
            f"{source} is no longer the workbook that was judged", "Check the workbook again."
        )
    if any(layout.kind == "visits" for layout in result.layouts if layout.file == label):
        raise OutputError(
            f"{source} holds readings of several visits next to each other",
            "Give each visit a row of its own, or use --csv for the results.",
        )
    buffer = io.BytesIO()
    try:
        covered = sum(sheet.covered() for sheet in judged.sheets)
        if covered > MAX_ROWS:
            raise OutputError(
                f"merged cells and links of {source} cover {covered} cells, at most {MAX_ROWS} can"
                " be copied",
                "Split the merged cells and delete the links that span whole sheets.",
            )
        # What the library drops is said below, in the user's words.
        with warnings.catch_warnings(), ZipFile(buffer, "w", ZIP_DEFLATED) as package:
            warnings.simplefilter("ignore")
            macros = Path(out).suffix.lower() == ".xlsm"
            book = load_workbook(io.BytesIO(data), keep_vba=macros, rich_text=True)
            _annotate(book, label, result, verdicts, over_limit)
            ExcelWriter(book, package).save()
    except (FileRefusedError, *PARSER_ERRORS) as error:
        raise OutputError(
            f"{source} cannot be copied ({type(error).__name__}): a part of it is not understood",
            "Open it in a spreadsheet program, save it again as .xlsx, and annotate the copy.",
        ) from None
    write_bytes(out, buffer.getvalue())
    return _not_taken_over(data, buffer.getvalue())


def _annotate(
    book: Workbook,
    label: str,
    result: ReadResult,
    verdicts: VerdictColumns,
    over_limit: OverLimit,
) -> None:
    for layout in result.layouts:
        if layout.file != label or layout.sheet not in book.sheetnames:
            continue
        sheet = book[layout.sheet]
        # The first column behind the table, counted from 1.
        free = layout.width + 1
        for problem in result.problems:
            if problem.file == label and problem.sheet == layout.sheet:
                _mark(sheet, layout, problem)
        own = {s: v for s, v in verdicts.items() if s.file == label and s.sheet == layout.sheet}
        if layout.kind != "long":
            _mark_over_limit(sheet, layout, {s: over_limit[s] for s in own if s in over_limit})
        if layout.kind == "form":
            _beside_form(sheet, layout, free, own)
        else:
            _behind_table(sheet, layout, free, own)


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
    lost = _beside_cells(before) - _beside_cells(after)
    return tuple(
        f"the annotated copy lacks {count} of the {what} of the workbook"
        for what, count in lost.items()
    )


def _beside_cells(package: bytes) -> Counter[str]:
    """Count what a package holds in addition to its cells, by what a user calls it."""
    with ZipFile(io.BytesIO(package)) as archive:
        names = [name for name in archive.namelist() if "_rels" not in name]
        held = Counter(
            what for folder, what in _DROPPABLE for name in names if name.lower().startswith(folder)
        )
        drawings = [
            archive.read(name) for name in names if name.lower().startswith("xl/drawings/drawing")
        ]
    held["drawn shapes"] = sum(drawing.count(mark) for drawing in drawings for mark in _SHAPES)
    return held


def _load(source: str | Path, out: str | Path) -> tuple[bytes, XlsxFile]:
    path = Path(source)
    if Path(out).resolve() == path.resolve():
        raise UsageError(
            f"{out} is the workbook itself", "Name another file for the annotated copy."
        )
    try:
        data = path.read_bytes()
        if not data.startswith(b"PK"):
            raise UsageError(
                f"{source} is not an .xlsx workbook, so it cannot be annotated",
                "Save it as .xlsx first, or use --csv for the results.",
            )
        # The same guard as in reading: nothing dangerous reaches the library that writes.
        return data, XlsxFile(data)
    except FileRefusedError as refusal:
        raise UsageError(f"{source}: {refusal}", refusal.problem.remedy) from None
    except OSError as error:
        raise UsageError(
            f"{source} cannot be opened: {error.strerror}", "Check the path."
        ) from None


def _mark(sheet: Worksheet, layout: SheetLayout, problem: Problem) -> None:
    place = problem.cell
    if place is None:
        row = problem.row or layout.header_row
        place = f"{column_letters(layout.index_of(RECORD_ID.name) or 0)}{row}"
    cell = sheet[place]
    if isinstance(cell, MergedCell):
        anchor = next(r for r in sheet.merged_cells.ranges if place in r)
        cell = sheet.cell(anchor.min_row, anchor.min_col)
    said = f"found {problem.value or 'nothing'}; expected {problem.expected}. {problem.remedy}"
    _fill(cell, _BAD_FILL, said)


def _fill(cell: Cell | MergedCell, colour: str, said: str = "") -> None:
    cell.fill = PatternFill("solid", fgColor=colour)
    if said:
        before = f"{cell.comment.text}\n" if cell.comment is not None else ""
        cell.comment = Comment(f"{before}{_AUTHOR}: {said}", _AUTHOR, height=160, width=360)


def _mark_over_limit(sheet: Worksheet, layout: SheetLayout, over_limit: OverLimit) -> None:
    """Mark the clearances of a wide table or a form that are over their limit."""
    for source, limits in over_limit.items():
        for joint, limit_in in limits.items():
            names = {CLEARANCE.header(joint, unit) for unit in (None, *LengthUnit)}
            read = next((column for column in layout.columns if column.read_as in names), None)
            row = source.row if read is None else read.row or source.row
            if read is None or row is None:
                continue
            cell = sheet.cell(row, read.index + 1)
            if isinstance(cell, Cell):
                _fill(
                    cell, _OVER_FILL, f"over the limit of joint {joint}, {limit_in:.4f} in radial."
                )


def _put(cell: Cell | MergedCell, value: str | float | None) -> None:
    """Put a value into a cell; a text stays a text even if it begins like a formula."""
    if not isinstance(cell, Cell):
        return
    cell.value = value
    if isinstance(value, str):
        cell.data_type = "s"
        if value.startswith(("=", "+", "-", "@")):
            cell.quotePrefix = True


def _behind_table(sheet: Worksheet, layout: SheetLayout, free: int, own: VerdictColumns) -> None:
    sheet.row_dimensions[layout.header_row].height = None
    headers = dict.fromkeys(header for values in own.values() for header in values)
    for column, header in enumerate(headers, free):
        cell = sheet.cell(layout.header_row, column)
        _put(cell, header)
        cell.font = BOLD
        _fill(cell, HEADER_FILL)
        cell.alignment = Alignment(wrap_text=True, vertical="center")
        found = {
            s.row: v[header]
            for s, v in own.items()
            if s.row is not None and v.get(header) is not None
        }
        longest = max((len(v) for v in found.values() if isinstance(v, str)), default=0)
        width = (
            _NUMBER_WIDTH
            if not longest
            else _TEXT_WIDTH
            if longest < 2 * _TEXT_WIDTH
            else _LONG_WIDTH
        )
        sheet.column_dimensions[column_letters(column - 1)].width = width
        for row, value in found.items():
            written = sheet.cell(row, column)
            _put(written, value)
            written.number_format = "General" if isinstance(value, str) else "0.0000"
            written.alignment = Alignment(wrap_text=width == _LONG_WIDTH)
            if width == _LONG_WIDTH and sheet.row_dimensions[row].height is None:
                sheet.row_dimensions[row].height = 15.0 * -(-len(str(value)) // _ON_A_LINE)
            if header == "verdict":
                _fill(written, _VERDICT_FILLS.get(str(value), _UNDECIDED_FILL))
    longest = max(map(len, headers), default=0)
    sheet.row_dimensions[layout.header_row].height = 15.0 * -(-longest // (_NUMBER_WIDTH - 2))


def _beside_form(sheet: Worksheet, layout: SheetLayout, free: int, own: VerdictColumns) -> None:
    for values in own.values():
        for offset, (header, value) in enumerate(values.items()):
            label = sheet.cell(layout.header_row + offset, free)
            _put(label, header)
            label.font = BOLD
            _put(sheet.cell(layout.header_row + offset, free + 1), value)
