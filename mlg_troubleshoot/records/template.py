"""The empty inspection workbook, which reads back when it is filled in."""

from __future__ import annotations

import io
from collections.abc import Sequence
from pathlib import Path

from openpyxl import Workbook
from openpyxl.comments import Comment
from openpyxl.styles import Alignment, Border, Font, PatternFill
from openpyxl.styles import Side as Edge
from openpyxl.worksheet.datavalidation import DataValidation
from openpyxl.worksheet.properties import PageSetupProperties
from openpyxl.worksheet.worksheet import Worksheet

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
from mlg_troubleshoot.gear.gauges import DEFAULT_GAUGE_U_IN
from mlg_troubleshoot.gear.gear import Gear, JointSpec
from mlg_troubleshoot.outputs import write_bytes
from mlg_troubleshoot.records.cells import column_letters
from mlg_troubleshoot.records.forms import FORM_TITLE
from mlg_troubleshoot.records.headers import Field
from mlg_troubleshoot.units import ClearanceConvention, LengthUnit

_ROWS = 500
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
    every_column: bool = True,
) -> None:
    """Write the workbook of a gear: columns in a unit, and in it the numbers that explain them."""
    book = Workbook()
    book.properties.title = "Main landing gear: joint clearance inspections"
    _instructions(book, gear.joints)
    _table(book, gear, unit, every_column=every_column)
    _form(book, gear, unit, every_column=every_column)
    book.active = 1
    write_book(path, book)


def write_book(path: str | Path, book: Workbook) -> None:
    buffer = io.BytesIO()
    book.save(buffer)
    write_bytes(path, buffer.getvalue())


def _fields(gear: Gear, unit: LengthUnit | None, *, every_column: bool) -> list[Field]:
    """Return the columns in one unit, or the lines of the form: these say their unit on a line of
    its own.
    """
    wanted = COLUMNS if every_column else (*USUAL, UNIT)
    return [
        Field(column, number, unit if column.is_length else None)
        for column in wanted
        if column.in_template and (column is not UNIT or unit is None)
        for number in _numbers_of(column, gear, every_column=every_column)
    ]


def _numbers_of(column: Column, gear: Gear, *, every_column: bool) -> Sequence[int | None]:
    if column.needs_joint:
        return gear.joint_numbers
    copies = column.copies if every_column else 1
    return range(1, copies + 1) if column.copies > 1 else (None,)


def _explain(field: Field, gear: Gear, unit: LengthUnit) -> str:
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
        text += f" Limit: {_length(joint.limit.value, unit)} radial."
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


def _table(book: Workbook, gear: Gear, unit: LengthUnit, *, every_column: bool) -> None:
    sheet = book.create_sheet("Inspections")
    fields = _fields(gear, unit, every_column=every_column)
    for index, field in enumerate(fields):
        letters = column_letters(index)
        name = field.name
        if field.column is CLEARANCE and field.number is not None and not every_column:
            name = f"{gear.joint(field.number).label}, {unit}"
        cell = sheet.cell(1, index + 1, name)
        cell.font = BOLD
        cell.fill = PatternFill(
            "solid", fgColor=_REQUIRED_FILL if _is_must(field.column) else HEADER_FILL
        )
        cell.alignment = Alignment(wrap_text=True, vertical="center", horizontal="center")
        cell.border = Border(bottom=_LINE, right=_LINE)
        cell.comment = Comment(_explain(field, gear, unit), "mlg", width=320, height=120)
        sheet.column_dimensions[letters].width = 30 if field.column is REMARKS else 13
        for row in range(2, _ROWS + 2) if field.column.holds in _FORMATS else ():
            sheet.cell(row, index + 1).number_format = _FORMATS[field.column.holds]
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


def _form(book: Workbook, gear: Gear, unit: LengthUnit, *, every_column: bool) -> None:
    sheet = book.create_sheet("Form")
    sheet["A1"] = FORM_TITLE
    sheet["A1"].font = _TITLE
    sheet["A2"] = (
        "One sheet is one inspection. Yellow lines must be filled in; blank means not measured."
    )
    for letters, width in (("A", 28), ("B", 24), ("C", 66)):
        sheet.column_dimensions[letters].width = width
    for row, field in enumerate(_fields(gear, None, every_column=every_column), 4):
        label = sheet.cell(row, 1, field.label)
        value = sheet.cell(row, 2)
        hint = sheet.cell(row, 3)
        must = _is_must(field.column)
        value.fill = PatternFill("solid", fgColor=_REQUIRED_FILL if must else "FFFFFFFF")
        value.border = Border(left=_LINE, right=_LINE, top=_LINE, bottom=_LINE)
        value.number_format = _FORMATS.get(field.column.holds, "General")
        value.alignment = label.alignment = Alignment(horizontal="left", vertical="top")
        label.font = Font(name=FONT, bold=must)
        hint.value = _explain(field, gear, unit)
        hint.data_type = "s"
        hint.alignment = _WRAPPED
        hint.font = Font(name=FONT, size=9, color="FF52606D")
        _as_high_as(sheet, row, hint.value, 94)
        _validate(sheet, field.column, f"B{row}")
    sheet.freeze_panes = "B4"
    sheet.print_title_rows = "1:2"
    _fit_to_width(sheet)
