"""The empty inspection workbook, which reads back when it is filled in."""

from __future__ import annotations

import io
from collections.abc import Sequence
from pathlib import Path

from openpyxl import Workbook
from openpyxl.comments import Comment
from openpyxl.styles import Alignment, Border, Font, PatternFill, Side
from openpyxl.worksheet.datavalidation import DataValidation
from openpyxl.worksheet.pagebreak import Break
from openpyxl.worksheet.properties import PageSetupProperties
from openpyxl.worksheet.worksheet import Worksheet

from mlg_troubleshoot.decision.inspection import DEFAULT_GAUGE_U_IN, RiggingCheck
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.gear.joints import JointSpec
from mlg_troubleshoot.outputs import write_bytes
from mlg_troubleshoot.records.cells import column_letters
from mlg_troubleshoot.records.columns import CARRIED, LENGTHS, PER_JOINT, Field, Kind
from mlg_troubleshoot.records.forms import FORM_TITLE
from mlg_troubleshoot.units import ClearanceConvention, LengthUnit

_ROWS = 500
# The font and the colour of headers of what this program writes into workbooks.
FONT = "Calibri"
HEADER_FILL = "FFD9E2EC"
_LINE_PT = 15.0
_LINE = Side(style="thin", color="FF9AA5B1")
_REQUIRED_FILL = "FFFFE9A8"
_TEXT_KINDS = (Kind.RECORD_ID, Kind.TAIL_NO, Kind.GAUGE_ID, Kind.TECHNICIAN_ID, *CARRIED)
_NUMBER_FORMATS = {**dict.fromkeys(_TEXT_KINDS, "@"), Kind.DATE: "yyyy-mm-dd"}
_MUST = frozenset({Kind.RECORD_ID, Kind.TAIL_NO, Kind.SIDE, Kind.CONVENTION, Kind.UNIT})
_NEVER_NEGATIVE = (LENGTHS | {Kind.LANDINGS}) - {Kind.PLUNGER_DISPLACEMENT, Kind.PLUNGER_DOWN_LOCK}
_CHOICES: dict[Kind, tuple[str, ...]] = {
    Kind.SIDE: ("LH", "RH"),
    Kind.CONVENTION: tuple(ClearanceConvention),
    Kind.UNIT: tuple(LengthUnit),
    Kind.APPROACH: ("EXTENDING", "RETRACTING"),
    Kind.OUTCOME: ("RETRACTED", "FAILED"),
    Kind.RIGGING_CHECKED: tuple(RiggingCheck),
}
# What each column holds, in the order of the columns; in braces the numbers of `_numbers`.
_MEANING: dict[Kind, str] = {
    Kind.RECORD_ID: "Required. Your own unique name of this inspection.",
    Kind.TAIL_NO: "Required. Tail number, kept as text.",
    Kind.SIDE: "Required. LH or RH; there is no default.",
    Kind.CONVENTION: (
        "Required. " + " ".join(f"{c.value}: {c.meaning}." for c in ClearanceConvention)
    ),
    Kind.UNIT: "Unit of every length on this sheet: in, thou or mm.",
    Kind.CLEARANCE: (
        "Clearance. Leave blank if it was not measured; 0 means measured and found to be zero."
    ),
    Kind.DATE: "Optional. Year-month-day, for example 2026-03-04.",
    Kind.OUTCOME: "Optional. What the gear did: RETRACTED or FAILED.",
    Kind.LANDINGS: "Optional. Landings since overhaul, 0 or more.",
    Kind.GAUGE_U: (
        "Optional. Standard uncertainty of one reading, as read. Blank: {gauge_u} radial is"
        " assumed."
    ),
    Kind.PLUNGER_DISPLACEMENT: (
        "Optional. Measured change of the plunger position at mid-position, over-travel "
        "positive, under-travel negative. Repeat readings have their own columns."
    ),
    Kind.PLUNGER_DOWN_LOCK: (
        "Optional. Measured plunger position at Down Lock; {down_lock} is allowed."
    ),
    Kind.PLUNGER_GAUGE_U: "Optional. Repeatability of one plunger reading.",
    Kind.MARGIN: "Optional. This gear's margin as found at rigging. Blank: {margin}.",
    Kind.MARGIN_U: "Optional. Standard uncertainty of that margin. Blank: 0.",
    Kind.TEMPERATURE: "Optional. Temperature in degrees Celsius, -60 to 60.",
    Kind.PRESSURE: "Optional. Hydraulic pressure in psi, 0 to 4000.",
    Kind.APPROACH: (
        "Optional. How the position was approached before the reading: EXTENDING or RETRACTING."
    ),
    Kind.GAUGE_ID: "Optional. The gauge set that was used.",
    Kind.TECHNICIAN_ID: "Optional. Who measured.",
    Kind.WORK_ORDER: "Optional. Goes to the report unchanged.",
    Kind.MANUAL_REF: "Optional. Manual reference; goes to the report unchanged.",
    Kind.MANUAL_REV: "Optional. Manual revision; goes to the report unchanged.",
    Kind.REMARKS: "Optional. Goes to the report unchanged.",
    Kind.RESTORED_JOINTS: (
        "Optional. Joints restored since the failure, for example 3 5. Their clearances in this row"
        " are those after the repair; outcome and plunger reading count as older."
    ),
    Kind.REPAIR_DATE: "Optional. When they were restored: year-month-day, with the time if known.",
    Kind.PLUNGER_DATE: "Optional. When the plunger was read, if that was after the repair.",
    Kind.OUTCOME_DATE: "Optional. When the outcome was seen, if that was after the repair.",
    Kind.RIGGING_CHECKED: (
        "Optional. Rigging and lock roller: no, yes (looked at) or corrected (set right)."
    ),
    Kind.CANNOT_REACH: "Optional. Joints that cannot be reached today, for example 4.",
    Kind.NO_SPARE: "Optional. Joints for which there is no spare part today.",
    Kind.OPEN_AREAS: "Optional. Areas that are open already: {areas}.",
    Kind.MINUTES_AVAILABLE: "Optional. Minutes left for the work today.",
    Kind.AXIAL_FLOAT: "Optional. End float of the joint along its pin.",
}
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


def write_template(path: str | Path, gear: Gear, *, unit: LengthUnit = LengthUnit.INCH) -> None:
    """Write the workbook of a gear: columns in a unit, and in it the numbers that explain them."""
    book = Workbook()
    book.properties.title = "Main landing gear: joint clearance inspections"
    _instructions(book, gear.joints)
    _table(book, gear, unit)
    _form(book, gear, unit)
    book.active = 1
    write_book(path, book)


def write_book(path: str | Path, book: Workbook) -> None:
    buffer = io.BytesIO()
    book.save(buffer)
    write_bytes(path, buffer.getvalue())


def _fields(gear: Gear, unit: LengthUnit | None) -> list[Field]:
    """Return the columns in one unit, or the lines of the form: these say their unit on a line of
    its own.
    """
    numbers = gear.joint_numbers
    several = {
        Kind.CLEARANCE: numbers,
        Kind.PLUNGER_DISPLACEMENT: (1, 2, 3),
        Kind.AXIAL_FLOAT: numbers,
    }
    kinds = [kind for kind in _MEANING if kind is not Kind.UNIT or unit is None]
    return [
        Field(kind, n, unit if kind in LENGTHS else None)
        for kind in kinds
        for n in several.get(kind, (None,))
    ]


def _explain(field: Field, gear: Gear, unit: LengthUnit) -> str:
    text = _MEANING[field.kind].format(**_numbers(gear, unit))
    if field.number is None or field.kind not in PER_JOINT:
        return text
    joint = gear.joint(field.number)
    if field.kind is Kind.CLEARANCE:
        text += f" Limit: {_length(joint.limit.value, unit)} radial."
    return f"Joint {joint.number}: {joint.name}. {joint.location}. {text}"


def _numbers(gear: Gear, unit: LengthUnit) -> dict[str, str]:
    low, high = (_length(end, unit) for end in gear.down_lock_range)
    return {
        "gauge_u": _length(DEFAULT_GAUGE_U_IN, unit),
        "down_lock": f"{low} to {high}",
        "margin": _length(gear.margin.value, unit),
        "areas": "; ".join(area.name for area in gear.areas),
    }


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
        cell.alignment = Alignment(wrap_text=True, vertical="top")
        _as_high_as(sheet, row, line, 83)
    sheet["A1"].font = Font(name=FONT, bold=True, size=14)
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


def _table(book: Workbook, gear: Gear, unit: LengthUnit) -> None:
    sheet = book.create_sheet("Inspections")
    fields = _fields(gear, unit)
    for index, field in enumerate(fields):
        letters = column_letters(index)
        cell = sheet.cell(1, index + 1, field.name)
        cell.font = Font(name=FONT, bold=True)
        cell.fill = PatternFill(
            "solid", fgColor=_REQUIRED_FILL if field.kind in _MUST else HEADER_FILL
        )
        cell.alignment = Alignment(wrap_text=True, vertical="center", horizontal="center")
        cell.border = Border(bottom=_LINE, right=_LINE)
        cell.comment = Comment(_explain(field, gear, unit), "mlg", width=320, height=120)
        sheet.column_dimensions[letters].width = 30 if field.kind is Kind.REMARKS else 13
        for row in range(2, _ROWS + 2) if field.kind in _NUMBER_FORMATS else ():
            sheet.cell(row, index + 1).number_format = _NUMBER_FORMATS[field.kind]
        _validate(sheet, field.kind, f"{letters}2:{letters}{_ROWS + 1}")
    sheet.row_dimensions[1].height = 45
    sheet.freeze_panes = "D2"
    # On paper: which gear on every page, and its clearances together on the first.
    sheet.print_title_rows, sheet.print_title_cols = "1:1", "A:C"
    sheet.page_setup.paperSize, sheet.page_setup.orientation, sheet.page_setup.scale = (
        9,
        "landscape",
        53,
    )
    for after in (Kind.CLEARANCE, Kind.MARGIN_U, Kind.REMARKS):
        sheet.col_breaks.append(
            Break(id=max(i for i, field in enumerate(fields, 1) if field.kind is after))
        )


def _validate(sheet: Worksheet, kind: Kind, cells: str) -> None:
    if kind in _CHOICES:
        rule = DataValidation(
            "list", formula1='"' + ",".join(_CHOICES[kind]) + '"', allow_blank=True
        )
        rule.errorTitle, rule.error = (
            "Not in the list",
            "Choose one of: " + ", ".join(_CHOICES[kind]),
        )
    elif kind in _NEVER_NEGATIVE:
        rule = DataValidation(
            "decimal", operator="greaterThanOrEqual", formula1="0", allow_blank=True
        )
        if kind in LENGTHS:
            rule.errorTitle, rule.error = (
                "Not a length",
                "Enter a number, 0 or more, or leave the cell blank.",
            )
            rule.errorStyle = "warning"
    else:
        return
    rule.showErrorMessage = True
    sheet.add_data_validation(rule)
    rule.add(cells)


def _form(book: Workbook, gear: Gear, unit: LengthUnit) -> None:
    sheet = book.create_sheet("Form")
    sheet["A1"] = FORM_TITLE
    sheet["A1"].font = Font(name=FONT, bold=True, size=14)
    sheet["A2"] = (
        "One sheet is one inspection. Yellow lines must be filled in; blank means not measured."
    )
    for letters, width in (("A", 28), ("B", 24), ("C", 66)):
        sheet.column_dimensions[letters].width = width
    for row, field in enumerate(_fields(gear, None), 4):
        label, value, hint = sheet.cell(row, 1, field.label), sheet.cell(row, 2), sheet.cell(row, 3)
        must = field.kind in _MUST
        value.fill = PatternFill("solid", fgColor=_REQUIRED_FILL if must else "FFFFFFFF")
        value.border = Border(left=_LINE, right=_LINE, top=_LINE, bottom=_LINE)
        value.number_format = _NUMBER_FORMATS.get(field.kind, "General")
        value.alignment = label.alignment = Alignment(horizontal="left", vertical="top")
        label.font = Font(name=FONT, bold=must)
        hint.value = _explain(field, gear, unit)
        hint.data_type = "s"
        hint.alignment = Alignment(wrap_text=True, vertical="top")
        hint.font = Font(name=FONT, size=9, color="FF52606D")
        _as_high_as(sheet, row, hint.value, 94)
        _validate(sheet, field.kind, f"B{row}")
    sheet.freeze_panes = "B4"
    sheet.print_title_rows = "1:2"
    _fit_to_width(sheet)
