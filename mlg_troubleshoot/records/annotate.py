"""The user's own workbook with bad cells marked and verdicts added, everything else as it was.

The empty inspection workbook, which reads back when it is filled in.
"""

from __future__ import annotations

import hashlib
import io
import warnings
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from types import MappingProxyType
from zipfile import ZIP_DEFLATED, ZipFile

from openpyxl import Workbook, load_workbook
from openpyxl.cell import Cell, MergedCell
from openpyxl.comments import Comment
from openpyxl.styles import Alignment, Border, Font, PatternFill
from openpyxl.styles import Side as Edge
from openpyxl.worksheet.datavalidation import DataValidation
from openpyxl.worksheet.properties import PageSetupProperties
from openpyxl.worksheet.worksheet import Worksheet
from openpyxl.writer.excel import ExcelWriter

from mlg_troubleshoot.decision.columns import (
    CLEARANCE,
    COLUMNS,
    CONVENTION,
    DATE,
    OUTCOME,
    PLUNGER_DISPLACEMENT,
    REMARKS,
    SIDE,
    TAIL_NO,
    UNIT,
    Column,
    Holds,
    Need,
)
from mlg_troubleshoot.decision.inspection import RowSource
from mlg_troubleshoot.errors import OutputError, Problem, UsageError
from mlg_troubleshoot.gear.gear import DEFAULT_GAUGE_U_IN, Gear, JointSpec
from mlg_troubleshoot.outputs import write_bytes
from mlg_troubleshoot.records.cells import MAX_ROWS, FileRefusedError, column_letters, writable
from mlg_troubleshoot.records.csvfile import PARSER_ERRORS
from mlg_troubleshoot.records.headers import Field
from mlg_troubleshoot.records.rows import ReadResult, SheetLayout
from mlg_troubleshoot.records.tables import FORM_TITLE
from mlg_troubleshoot.records.xlsx import XlsxFile
from mlg_troubleshoot.units import ClearanceConvention, LengthUnit

_ROWS = 500
# Those whose convention is filled in: they fit on one printed page.
_STATED_ROWS = 50
# The columns that people fill in; the others stand there on request.
USUAL = (TAIL_NO, SIDE, CONVENTION, CLEARANCE, DATE, OUTCOME, PLUNGER_DISPLACEMENT)
# The fonts and the colour of headers of what this program writes into workbooks.
FONT = "Calibri"
BOLD = Font(name=FONT, bold=True)
HEADER_FILL = "FFD9E2EC"
_TITLE = Font(name=FONT, bold=True, size=14)
_WRAPPED = Alignment(wrap_text=True, vertical="top")
_LINE_PT = 15
_LINE = Edge(style="thin", color="FF9AA5B1")
_REQUIRED_FILL = "FFFFE9A8"
_FORMATS = {Holds.TEXT: "@", Holds.DATE: "yyyy-mm-dd"}
_INSTRUCTIONS = (
    "Instructions (this sheet is not read)",
    "",
    "Use either of the two sheets, or both:",
    "  Inspections: one row is one inspection of one gear.",
    (
        "  Form: one sheet is one inspection. Copy the sheet for each further inspection (right"
        " click on its tab)."
    ),
    "",
    "Yellow columns and lines must be filled in. Everything else may stay blank.",
    (
        "Blank means not measured. 0 means measured and found to be zero. Never enter 0 for a joint"
        " that was not measured."
    ),
    "",
    "Clearance convention: say how the clearances were taken. A wrong convention is a factor of 2.",
    *(f"  {c.value}: {c.meaning}" for c in ClearanceConvention),
    "",
    (
        "Lengths: in the sheet Inspections the unit is the last word of the column's name (_in,"
        " _thou, _mm). To enter another unit, change that word in the header of that column."
    ),
    "In the sheet Form choose the unit in the line Unit.",
    "Use a decimal point or your program's own decimal mark, and no fractions.",
    (
        "Dates: year-month-day. Columns of your own may be added; they are carried to the report"
        " unchanged."
    ),
    "",
    "Each column is explained in the comment of its header.",
    "Troubleshooting aid, not maintenance data: the limits of the maintenance manual apply.",
    "",
    "The joints:",
)


def write_template(
    path: str | Path,
    gear: Gear,
    *,
    unit: LengthUnit = LengthUnit.INCH,
    convention: ClearanceConvention | None = None,
    every_column: bool = True,
) -> None:
    """Write the workbook of a gear: columns in a unit, and in it the numbers that explain them;
    made for a convention, it states it.
    """
    book = Workbook()
    book.properties.title = "Main landing gear: joint clearance inspections"
    _instructions(book, gear.joints)
    explained = partial(
        _explain, gear=gear, unit=unit, way=convention or ClearanceConvention.RADIAL
    )
    lines = [
        Field(column, number)
        for column in (COLUMNS if every_column else (*USUAL, UNIT))
        if column.in_template
        for number in _numbers_of(column, gear, column.copies if every_column else 1)
    ]
    columns = [
        replace(line, unit=unit if line.column.is_length else None)
        for line in lines
        if line.column is not UNIT
    ]
    names = [
        f"{gear.joint(each.number).label}, {unit}"
        if each.column is CLEARANCE and each.number and not every_column
        else each.name
        for each in columns
    ]
    stated = {CONVENTION: convention, UNIT: unit} if convention else {}
    _table(book, columns, names, explained, stated)
    _form(book, lines, explained, stated)
    book.active = 1
    write_book(path, book)


def write_book(path: str | Path, book: Workbook) -> None:
    buffer = io.BytesIO()
    book.save(buffer)
    write_bytes(path, buffer.getvalue())


def _numbers_of(column: Column, gear: Gear, copies: int) -> Sequence[int | None]:
    if column.needs_joint:
        return gear.joint_numbers
    return range(1, copies + 1) if column.copies > 1 else (None,)


def _explain(field: Field, gear: Gear, unit: LengthUnit, way: ClearanceConvention) -> str:
    low, high = (_length(end, unit) for end in gear.down_lock_range)
    text = field.column.explained(
        gauge_u=_length(DEFAULT_GAUGE_U_IN, unit),
        down_lock=f"{low} to {high}",
        margin=_length(gear.margin.value, unit),
    )
    if field.number is None or not field.column.needs_joint:
        return text
    joint = gear.joint(field.number)
    if field.column is CLEARANCE:
        limit = _length(joint.limit.value * way.per_radial, unit)
        text += f" Limit: {limit} {way.lower().replace('_', ' ')}."
    return f"Joint {joint.number}: {joint.name}. {joint.location}. {text}"


def _length(value_in: float, unit: LengthUnit) -> str:
    return f"{unit.shown(value_in)} {unit}"


def _instructions(book: Workbook, joints: Sequence[JointSpec]) -> None:
    sheet = book.worksheets[0]
    sheet.title = "Instructions"
    sheet.column_dimensions["A"].width = 74
    # One cell per line: labels next to values would look like a form.
    lines = [*_INSTRUCTIONS, *(f"  {joint.label}: {joint.location}" for joint in joints)]
    for row, line in enumerate(lines, 1):
        cell = sheet.cell(row, 1, line)
        cell.data_type = "s"
        cell.alignment = _WRAPPED
        _as_high_as(sheet, row, line, 83)
    sheet["A1"].font = _TITLE
    sheet.row_dimensions[1].height = 24
    _fit_to_width(sheet)


def _as_high_as(sheet: Worksheet, row: int, text: str, on_a_line: int) -> None:
    """Give a row the height of its longest text: not every program finds it itself."""
    sheet.row_dimensions[row].height = _LINE_PT * max(1, -(-len(text) // on_a_line))


def _fit_to_width(sheet: Worksheet) -> None:
    sheet.page_setup.paperSize = 9
    sheet.page_setup.fitToWidth = 1
    sheet.page_setup.fitToHeight = 0
    sheet.sheet_properties.pageSetUpPr = PageSetupProperties(fitToPage=True)


def _table(
    book: Workbook,
    fields: Sequence[Field],
    names: Sequence[str],
    explained: Callable[[Field], str],
    stated: Mapping[Column, str],
) -> None:
    sheet = book.create_sheet("Inspections")
    for index, field in enumerate(fields):
        letters = column_letters(index)
        cell = sheet.cell(1, index + 1, names[index])
        cell.font = BOLD
        cell.fill = PatternFill(
            "solid", fgColor=_REQUIRED_FILL if _is_must(field.column) else HEADER_FILL
        )
        cell.alignment = Alignment(wrap_text=True, vertical="center", horizontal="center")
        cell.border = Border(bottom=_LINE, right=_LINE)
        cell.comment = Comment(explained(field), "mlg", width=320, height=120)
        sheet.column_dimensions[letters].width = 30 if field.column is REMARKS else 13
        for row in range(2, _ROWS + 2) if field.column.holds in _FORMATS else ():
            sheet.cell(row, index + 1).number_format = _FORMATS[field.column.holds]
        for row in range(2, _STATED_ROWS + 2) if field.column in stated else ():
            sheet.cell(row, index + 1, stated[field.column])
        _validate(sheet, field.column, f"{letters}2:{letters}{_ROWS + 1}")
    sheet.row_dimensions[1].height = 45
    sheet.freeze_panes = "D2"
    # On paper: which gear on every page, and its clearances together on the first.
    sheet.print_title_rows = "1:1"
    sheet.print_title_cols = "A:C"
    sheet.page_setup.paperSize = 9
    sheet.page_setup.orientation = "landscape"
    sheet.page_setup.scale = 53


def _is_must(column: Column) -> bool:
    """Whether the column is yellow: the unit is asked for in the form alone."""
    return column.need is Need.REQUIRED or column is UNIT


def _validate(sheet: Worksheet, column: Column, cells: str) -> None:
    words = ",".join(column.words_taken)
    if words:
        rule = DataValidation("list", formula1=f'"{words}"', allow_blank=True)
        rule.errorTitle = "Not in the list"
        rule.error = "Choose one of: " + words.replace(",", ", ")
    elif column.holds in (Holds.LENGTH, Holds.NUMBER) and not column.signed:
        rule = DataValidation(
            "decimal", operator="greaterThanOrEqual", formula1="0", allow_blank=True
        )
        if column.is_length:
            rule.errorTitle = "Not a length"
            rule.error = "Enter a number, 0 or more, or leave the cell blank."
            rule.errorStyle = "warning"
    else:
        return
    rule.showErrorMessage = True
    sheet.add_data_validation(rule)
    rule.add(cells)


def _form(
    book: Workbook,
    fields: Sequence[Field],
    explained: Callable[[Field], str],
    stated: Mapping[Column, str],
) -> None:
    sheet = book.create_sheet("Form")
    sheet["A1"] = FORM_TITLE
    sheet["A1"].font = _TITLE
    sheet["A2"] = (
        "One sheet is one inspection. Yellow lines must be filled in; blank means not measured."
    )
    for letters, width in (("A", 28), ("B", 24), ("C", 66)):
        sheet.column_dimensions[letters].width = width
    for row, field in enumerate(fields, 4):
        label = sheet.cell(row, 1, field.label)
        value = sheet.cell(row, 2, stated.get(field.column))
        hint = sheet.cell(row, 3)
        must = _is_must(field.column)
        value.fill = PatternFill("solid", fgColor=_REQUIRED_FILL if must else "FFFFFFFF")
        value.border = Border(left=_LINE, right=_LINE, top=_LINE, bottom=_LINE)
        value.number_format = _FORMATS.get(field.column.holds, "General")
        value.alignment = label.alignment = Alignment(horizontal="left", vertical="top")
        label.font = Font(name=FONT, bold=must)
        hint.value = explained(field)
        hint.data_type = "s"
        hint.alignment = _WRAPPED
        hint.font = Font(name=FONT, size=9, color="FF52606D")
        _as_high_as(sheet, row, hint.value, 94)
        _validate(sheet, field.column, f"B{row}")
    sheet.freeze_panes = "B4"
    sheet.print_title_rows = "1:2"
    _fit_to_width(sheet)


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
    layouts = [layout for layout in result.layouts if layout.file == label]
    is_several = len({layout.sheet for layout in layouts}) < len(layouts)
    if is_several or any(layout.kind == "visits" for layout in layouts):
        raise OutputError(
            f"{source} holds readings of several visits next to each other, or several tables on"
            " one sheet",
            "Give each visit a row, and each table a sheet of its own, or use --csv for the"
            " results.",
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
        for problem in result.problems:
            if problem.file == label and problem.sheet == layout.sheet:
                _mark(sheet, layout, problem)
        own = {s: v for s, v in verdicts.items() if s.file == label and s.sheet == layout.sheet}
        if layout.kind != "long":
            _mark_over_limit(sheet, layout, own, over_limit)
        _write_results(sheet, layout, own)


# Parts that the library may drop in silence, by their folder, as a user calls them.
_DROPPABLE = {
    "media": "pictures",
    "charts": "charts",
    "pivottables": "pivot tables",
    "ctrlprops": "form controls",
    "slicers": "slicers",
    "threadedcomments": "threaded comments",
    "diagrams": "diagrams",
    "drawings": "drawings",
}


def _not_taken_over(before: bytes, after: bytes) -> tuple[str, ...]:
    """Say what the copy lacks, by the folders of its parts."""
    held, kept = (
        Counter(name.lower().split("/")[-2:][0] for name in ZipFile(io.BytesIO(data)).namelist())
        for data in (before, after)
    )
    lost = held - kept
    return tuple(
        f"the annotated copy lacks {lost[folder]} of the {what} of the workbook"
        for folder, what in _DROPPABLE.items()
        if lost[folder]
    )


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
    place = problem.cell or f"A{problem.row or layout.header_row}"
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


def _mark_over_limit(
    sheet: Worksheet, layout: SheetLayout, own: Iterable[RowSource], over_limit: OverLimit
) -> None:
    """Mark the clearances of a wide table or a form that are over their limit."""
    for source in own:
        for joint, limit_in in over_limit.get(source, {}).items():
            names = {CLEARANCE.header(joint, unit) for unit in (None, *LengthUnit)}
            found = layout.place(names, source.row or 0)
            if found is not None and isinstance(cell := sheet[found[1]], Cell):
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


def _write_results(sheet: Worksheet, layout: SheetLayout, own: VerdictColumns) -> None:
    """Write what was found behind the rows of a table, or line by line beside a form."""
    is_form = layout.kind == "form"
    top = layout.header_row
    # The first column behind the table, counted from 1.
    free = layout.width + 1
    headers = dict.fromkeys(header for values in own.values() for header in values)
    for place, header in enumerate(headers):
        line, column = (top + place, free) if is_form else (top, free + place)
        label = sheet.cell(line, column)
        _put(label, header)
        label.font = BOLD
        _fill(label, HEADER_FILL)
        label.alignment = Alignment(wrap_text=True, vertical="center")
        found = {
            s.row: v[header]
            for s, v in own.items()
            if s.row is not None and v.get(header) is not None
        }
        longest = max((len(v) for v in found.values() if isinstance(v, str)), default=0)
        is_long = longest >= 2 * _TEXT_WIDTH
        width = _LONG_WIDTH if is_long else _TEXT_WIDTH if longest else _NUMBER_WIDTH
        letters = column_letters(column - 1)
        sheet.column_dimensions[letters].width = _TEXT_WIDTH if is_form else width
        for row, value in found.items():
            at = line if is_form else row
            written = sheet.cell(at, column + is_form)
            _put(written, value)
            written.number_format = "General" if isinstance(value, str) else "0.0000"
            written.alignment = Alignment(wrap_text=is_long)
            if is_long and sheet.row_dimensions[at].height is None:
                sheet.row_dimensions[at].height = 15.0 * -(-len(str(value)) // _ON_A_LINE)
            if header == "verdict":
                _fill(written, _VERDICT_FILLS.get(str(value), _UNDECIDED_FILL))
    if is_form:
        sheet.column_dimensions[column_letters(free)].width = _LONG_WIDTH
    else:
        longest = max(map(len, headers), default=0)
        sheet.row_dimensions[top].height = 15.0 * -(-longest // (_NUMBER_WIDTH - 2))
