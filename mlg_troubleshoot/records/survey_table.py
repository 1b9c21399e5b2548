"""The table of a survey: written empty for a gear, read back as readings; a bad cell is a
`Problem`.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, cast

import numpy as np
from openpyxl import Workbook
from openpyxl.chart import Reference, ScatterChart, Series
from openpyxl.chart.label import DataLabelList
from openpyxl.styles import Font
from openpyxl.worksheet.worksheet import Worksheet

from mlg_troubleshoot.decision.columns import Column, Holds
from mlg_troubleshoot.errors import Problem
from mlg_troubleshoot.outputs import write_csv
from mlg_troubleshoot.records.cells import Cells, Filled, column_letters, stored
from mlg_troubleshoot.records.frames import FrameSheet, as_frame, in_frame, is_frame, source_label
from mlg_troubleshoot.records.model import CellPlace, ReadOptions, TableInHand
from mlg_troubleshoot.records.read import load_bytes, open_book
from mlg_troubleshoot.records.source import FileRefusedError, Sheet
from mlg_troubleshoot.records.template import write_book
from mlg_troubleshoot.records.values import CellFaultError, read_number, read_text, read_value
from mlg_troubleshoot.surveying.readings import (
    ReadingKind,
    SurveyedLinkage,
    SurveyReading,
    default_u,
)
from mlg_troubleshoot.units import LengthUnit

if TYPE_CHECKING:
    from mlg_troubleshoot.records.read import File, Source

_UNITS = ("in", "mm", "deg")
COLUMNS = (
    "kind",
    "from",
    "to",
    *(f"{c}_{u}" for u in _UNITS for c in ("value", "u")),
    "extension_in",
    "extension_mm",
    "how",
)
_KIND = Column(name="kind", holds=Holds.CHOICE, choices=ReadingKind)
_HEADER_WITHIN = 30
_KINDS = {kind: kind for kind in ReadingKind if kind not in (ReadingKind.TRAVEL, ReadingKind.ORDER)}
# No linkage of a landing gear is longer than this; angles are read within one turn.
_LONGEST_IN = 500
_WIDEST_DEG = 360
_DEGREES: tuple[str, ...] = ("°", "deg", "degrees")
_HOW = {
    ReadingKind.DISTANCE: (
        "Pin centre to pin centre: over the outside of both pins, less half of each diameter."
    ),
    ReadingKind.PLUNGER: (
        "Dial on the plunger, zero at the reference extension; actuator at the extension given."
    ),
    ReadingKind.EXTENSION: "Travel of the actuator from Down Lock to the reference position.",
    ReadingKind.ANGLE: (
        "In the gear file's axes, with an inclinometer or from a photograph square to the plane."
    ),
}


def write_survey_template(
    path: Path,
    linkage: SurveyedLinkage,
    planned: Iterable[tuple[SurveyReading, bool]],
    unit: LengthUnit = LengthUnit.INCH,
) -> None:
    """Write the rows that are worth reading on this gear, as CSV or as a workbook with a sketch; in
    inches or mm.
    """
    rows = []
    metric = LengthUnit.MILLIMETRE if unit is LengthUnit.MILLIMETRE else LengthUnit.INCH
    drive = metric if linkage.driven_in == "in" else LengthUnit.INCH
    for reading, checked in planned:
        by_others = (
            "Checked by the other readings."
            if checked
            else "NOT checked by the others: read it twice."
        )
        values: dict[str, str | float | None] = {
            "kind": reading.kind.value,
            "from": reading.start,
            "to": reading.end,
            "how": f"{_HOW[reading.kind]} {by_others}",
        }
        if reading.is_angle:
            values["u_deg"] = round(float(np.degrees(reading.u)), 6)
        else:
            values[f"u_{metric}"] = round(metric.from_inches(reading.u), 6)
        if reading.extension is not None:
            values[f"extension_{drive}"] = round(drive.from_inches(reading.extension), 2)
        rows.append([values.get(column) for column in COLUMNS])
    if path.suffix.lower() == ".csv":
        write_csv(path, COLUMNS, rows)
        return
    book = Workbook()
    sheet = book.worksheets[0]
    sheet.title = "Survey"
    for row in (COLUMNS, *rows):
        sheet.append(list(row))
    for cell in sheet[1]:
        cell.font = Font(bold=True)
    sheet.column_dimensions[column_letters(len(COLUMNS) - 1)].width = 100
    sheet.freeze_panes = "D2"
    _sketch(book.create_sheet("Sketch"), linkage)
    write_book(path, book)


def _sketch(sheet: Worksheet, linkage: SurveyedLinkage) -> None:
    """The pins of each plane at the reference position, with their names, and the parts between
    them.
    """
    mechanism = linkage.space.mechanism
    sheet.append(["point", "plane", "x in", "y in", "", "part", "x in", "y in"])
    for point in mechanism.points:
        sheet.append([point.name, point.plane, point.x, point.y])
        sheet.cell(sheet.max_row, 1).data_type = sheet.cell(sheet.max_row, 2).data_type = "s"
    line = 2
    for k, plane in enumerate(mechanism.planes):
        chart = ScatterChart()
        chart.title = f"plane {plane.name}"
        chart.style = 13
        chart.height = 14
        chart.width = 20
        places = {p.name: (p.x, p.y) for p in mechanism.points if p.plane == plane.name}
        for pair in linkage.rigid:
            if pair <= places.keys():
                for name in sorted(pair):
                    sheet.cell(line, 6, " - ".join(sorted(pair)))
                    sheet.cell(line, 7, places[name][0])
                    sheet.cell(line, 8, places[name][1])
                    line += 1
                along, across = (
                    Reference(sheet, min_col=column, min_row=line - 2, max_row=line - 1)
                    for column in (7, 8)
                )
                part = Series(across, along)
                part.graphicalProperties.line.solidFill = "9AA5B1"
                chart.series.append(part)
        for row, point in enumerate(mechanism.points, start=2):
            if point.name in places:
                spot = Series(
                    Reference(sheet, min_col=4, min_row=row),
                    Reference(sheet, min_col=3, min_row=row),
                    title=point.name,
                )
                spot.marker.symbol = "circle"
                spot.dLbls = DataLabelList(
                    showSerName=True, showVal=False, showLegendKey=False, showCatName=False
                )
                chart.series.append(spot)
        chart.legend = None
        sheet.add_chart(chart, f"J{2 + 30 * k}")


def read_survey(
    table: Source, linkage: SurveyedLinkage
) -> tuple[tuple[SurveyReading, ...], tuple[Problem, ...], str]:
    """Read the rows that have a value, the cells that are wrong, and the file's SHA-256."""
    label = source_label(table)
    labels: Sequence[object] = ()
    try:
        if is_frame(table):
            framed = FrameSheet(as_frame(table))
            sheets: Sequence[Sheet] = (framed,)
            labels = framed.labels
            digest = ""
            delimiter = None
        else:
            data = load_bytes(cast("File", table))
            digest = hashlib.sha256(data).hexdigest()
            book = open_book(data, label, ReadOptions())
            sheets = book.sheets
            delimiter = book.delimiter
        for sheet in sheets:
            rows = list(sheet.rows())
            header = next(
                (
                    i
                    for i, (_, cells) in enumerate(rows[:_HEADER_WITHIN])
                    if "kind" in _names(cells)
                ),
                None,
            )
            if header is not None:
                problems: list[Problem] = []
                comma = delimiter == ";"
                in_hand = TableInHand(ReadOptions(), label, sheet.name, problems.append, comma)
                reader = _Rows(in_hand, _names(rows[header][1]), linkage)
                found = [reader.read(*row) for row in rows[header + 1 :]]
                named = tuple(in_frame(p, labels) if labels else p for p in problems)
                return tuple(r for r in found if r is not None), named, digest
        raise FileRefusedError(
            "header_missing",
            "no header of a survey was found",
            f"the columns {', '.join(COLUMNS[:4])} … in the first {_HEADER_WITHIN} rows",
            "Use the file that 'mlg gear survey template' writes.",
        )
    except FileRefusedError as refusal:
        return (), (replace(refusal.problem, file=label),), ""


def _names(cells: Cells) -> list[str]:
    return [cell.strip().lower() if isinstance(cell, str) else "" for cell in cells]


class _Rows:
    """Reads the rows of one sheet and tells what is wrong with them."""

    def __init__(self, table: TableInHand, header: list[str], linkage: SurveyedLinkage) -> None:
        self.table = table
        self.header = header
        self.linkage = linkage
        self.points = [p.name for p in linkage.space.mechanism.points]
        self.row: dict[str, Filled] = {}
        self.column = ""
        for i, name in enumerate(header):
            if name and header.index(name) != i:
                again = "each column once", "Remove one of the columns."
                self._tell(1, name, CellFaultError("header_duplicate", *again))

    def read(self, number: int, cells: Cells) -> SurveyReading | None:
        """Read one row; None if it has no value, or a cell that is wrong."""
        named = zip(self.header, cells, strict=False)
        self.row = {name: cell for name, cell in named if name and cell is not None}
        given = [f"value_{unit}" for unit in _UNITS if f"value_{unit}" in self.row]
        if not given:
            return None
        try:
            return self._reading(number, given)
        except CellFaultError as fault:
            self._tell(number, self.column, fault)
            return None

    def _reading(self, number: int, given: list[str]) -> SurveyReading:
        self.column = "kind"
        kind: ReadingKind = read_value(_KIND, self.row.get("kind") or "")
        turns = self.linkage.space.mechanism.output.kind == "angle"
        is_angle = kind is ReadingKind.ANGLE or (kind is ReadingKind.PLUNGER and turns)
        known = "one of " + ", ".join(_KINDS)
        self._require(kind in _KINDS, "kind", known, "Correct the word.", "kind_unknown")
        wanted = ("value_deg",) if is_angle else ("value_in", "value_mm")
        self._require(
            len(given) == 1 and given[0] in wanted,
            given[-1],
            f"one value, in {' or '.join(wanted)}",
            "Leave the other columns blank.",
            "value_columns",
        )
        value = self._quantity(given[0], kind in (ReadingKind.PLUNGER, ReadingKind.ANGLE))
        u = default_u(kind, is_angle=is_angle)
        for unit in _UNITS:
            column = f"u_{unit}"
            expected = "an uncertainty in the unit of the value"
            if column in self.row:
                fits = (unit == "deg") == is_angle
                self._require(fits, column, expected, "Move the number.", "unit_of_u")
                u = self._quantity(column, False)
        extension = self._extension()
        ends = self._ends(kind)
        driven_in = self.linkage.driven_in
        return SurveyReading(kind, *ends, value, u, extension, number, is_angle, driven_in)

    def _quantity(self, column: str, signed: bool) -> float:
        name, unit = column.split("_")
        if unit == "deg":
            most: float = _WIDEST_DEG
            units = _DEGREES
            expected = f"an angle from {-most if signed else 0:g} to {most:g} degrees"
        else:
            length = LengthUnit.parse(unit)
            most = length.from_inches(_LONGEST_IN)
            units = length.spellings
            expected = f"a length up to {most:g} {unit}"
        low = -most if signed else 0.0
        number = self._number(column, low, most, expected, units)
        value = math.radians(number) if unit == "deg" else length.to_inches(number)
        remedy = "Read it again, or leave it blank."
        self._require(value > 0.0 or signed, column, f"a {name} above 0", remedy, "out_of_range")
        return value

    def _extension(self) -> float | None:
        extension = None
        reach = 3.0 * abs(self.linkage.gear.reference.stroke[1] - self.linkage.low)
        for unit in (LengthUnit.INCH, LengthUnit.MILLIMETRE):
            column = f"extension_{unit}"
            most = unit.from_inches(reach)
            if column in self.row:
                one = extension is None and (
                    unit is LengthUnit.INCH or self.linkage.driven_in == "in"
                )
                expected = "one extension, in the unit of the input"
                self._require(one, column, expected, "Leave one.", "extension_columns")
                expected = f"an extension from 0 to {most:.4g}"
                extension = unit.to_inches(
                    self._number(column, 0.0, most, expected, unit.spellings)
                )
        return extension

    def _number(
        self, column: str, low: float, most: float, expected: str, units: tuple[str, ...]
    ) -> float:
        """Read a number, which may be followed by the unit of its column."""
        self.column = column
        comma = self.table.decimal_comma
        cell = self.row[column]
        return read_number(cell, low, most, decimal_comma=comma, expected=expected, units=units)

    def _ends(self, kind: ReadingKind) -> tuple[str, str]:
        texts = []
        for column in ("from", "to"):
            cell = stored(self.row.get(column))
            self.column = column
            # A spreadsheet takes the point 4 for a number.
            texts.append(
                f"{cell:g}" if isinstance(cell, float) else read_text(cell or "", "a name").strip()
            )
        start, end = texts
        space = self.linkage.space
        if kind is ReadingKind.DISTANCE:
            points = f"one of the points {', '.join(self.points)}"
            for column, name in (("from", start), ("to", end)):
                self._require(name in self.points, column, points, "Correct the name.")
            self._require(start != end, "to", "another point than in from", "Name both pins.")
        elif kind is ReadingKind.ANGLE:
            known = {
                **dict.fromkeys(space.planes, ("hinge", "dihedral")),
                **dict.fromkeys(space.sliders, ("axis",)),
            }
            expected = f"one of {', '.join(known)}"
            self._require(
                start in known, "from", expected, "Name a hinged plane or the slider's joint."
            )
            self._require(
                end in known[start], "to", " or ".join(known[start]), "Say which angle it is."
            )
        else:
            self._require(
                not (start or end),
                "from" if start else "to",
                "a blank cell",
                f"A {kind} needs no points.",
            )
        expected = "DISTANCE, PLUNGER or ANGLE"
        remedy = "The reference position of this gear is its Down Lock."
        self._require(
            kind is not ReadingKind.EXTENSION or space.moves_reference, "kind", expected, remedy
        )
        return start, end

    def _require(
        self, holds: bool, column: str, expected: str, remedy: str, code: str = "point_unknown"
    ) -> None:
        if not holds:
            self.column = column
            raise CellFaultError(code, expected, remedy)

    def _tell(self, row: int, column: str, fault: CellFaultError) -> None:
        place = CellPlace(row, column)
        if column in self.header:
            place = CellPlace.at(row, self.header.index(column), column)
        self.table.tell_fault(fault, self.row.get(column), place)
