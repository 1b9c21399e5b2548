"""Workbooks of Excel and LibreOffice (.xlsx, .xlsm), read by openpyxl behind a guard.

Openpyxl finds the sheets and walks over the rows. What stands in a cell is taken here, since it
would hide a formula without a result (blank), a date outside the calendar (an error value) and the
escaped characters of a text, refuse a whole sheet for ``NaN`` in a number, and tell neither hidden
rows nor which results are of formulas. Texts and styles are also taken here: its model of the
styles refuses workbooks of other programs for a colour it does not know, and a text with ``x005F_``
in it would lose that.
"""

from __future__ import annotations

import io
import re
import warnings
from collections.abc import Generator, Iterator, Sequence
from functools import cached_property
from typing import Any, cast
from xml.etree.ElementTree import Element, fromstring, iterparse

from openpyxl.reader.excel import ExcelReader
from openpyxl.utils.cell import column_index_from_string, range_boundaries
from openpyxl.utils.datetime import CALENDAR_MAC_1904
from openpyxl.utils.escape import unescape
from openpyxl.worksheet._reader import (
    COL_TAG,
    DATA_TAG,
    FORMULA_TAG,
    INLINE_STRING,
    ROW_TAG,
    VALUE_TAG,
    WorkSheetParser,
)
from openpyxl.xml.constants import SHEET_MAIN_NS

from mlg_troubleshoot.records.cells import (
    MAX_COLUMNS,
    MAX_ROWS,
    NO_VALUE_TEXT,
    Cell,
    NumberFormat,
    OddCell,
    OddKind,
    iso_date_cell,
)
from mlg_troubleshoot.records.source import (
    MACROS,
    MergedRange,
    NumberedRow,
    Sheet,
    Workbook,
)
from mlg_troubleshoot.records.zipguard import (
    MAX_ITEMS,
    GuardedZip,
    Stream,
    damage,
    damaged,
    outside_limits,
    too_large,
)
from mlg_troubleshoot.units import vanishes

_MERGE = re.compile(rb'<(?:\w+:)?mergeCell\s[^<>]*?ref="([A-Z]{1,3}\d{1,7}:[A-Z]{1,3}\d{1,7})"')
_TEXT_TAG, _PHONETIC_TAG, _STRING_TAG = (
    f"{{{SHEET_MAIN_NS}}}{name}" for name in ("t", "rPh", "si")
)
_RAISED = "{*}rPr/{*}vertAlign[@val='superscript']"
_SPANNING = tuple(f"{{{SHEET_MAIN_NS}}}{name}" for name in ("mergeCell", "hyperlink"))
_EXCEL_ROWS = 1 << 20
_EXCEL_COLUMNS = 1 << 14
_TRUE = ("1", "true", "on")
# "Strict Open XML", which Excel offers, differs from what openpyxl knows in the names of two
# vocabularies.
_STRICT = (
    (b"http://purl.oclc.org/ooxml/spreadsheetml/main", SHEET_MAIN_NS.encode()),
    (
        b"http://purl.oclc.org/ooxml/officeDocument/relationships",
        b"http://schemas.openxmlformats.org/officeDocument/2006/relationships",
    ),
)
_MAX_STRUCTURE_BYTES = 8_000_000


class _Package(GuardedZip):
    def chunks(self, name: str) -> Iterator[bytes]:
        """Unpack a part piece by piece, in the vocabulary that openpyxl knows."""
        pieces = super().chunks(name)
        root = next(pieces, b"")
        for strict, usual in _STRICT:
            root = root.replace(strict, usual)
        yield root
        yield from pieces

    def read(self, name: str) -> bytes:
        if self.size(name) > _MAX_STRUCTURE_BYTES:
            raise too_large(f"{name} unpacks to {self.size(name) / 1e6:.0f} MB")
        return super().read(name)


class XlsxFile(Workbook):
    sheets: Sequence[XlsxSheet]

    def __init__(self, data: bytes) -> None:
        self.archive = _Package(data)
        macros = any(name.endswith("vbaproject.bin") for name in self.archive.names)
        super().__init__("xlsm" if macros else "xlsx", (), [MACROS] if macros else [])
        with damage("its list of sheets cannot be read"), warnings.catch_warnings(action="ignore"):
            reader = ExcelReader(io.BytesIO(data), read_only=True, data_only=True, keep_links=False)
            reader.archive = cast(Any, self.archive)
            reader.read_manifest()
            reader.read_workbook()
            self.epoch_1904: bool = reader.wb.epoch == CALENDAR_MAC_1904
            self._parts = {
                rel.Type.rpartition("/")[2]: rel.target
                for rel in cast(dict[str, Any], reader.parser.rels).values()
            }
            self.sheets = tuple(
                XlsxSheet(sheet.name, rel.target, sheet.state != "visible", self)
                for sheet, rel in reader.parser.find_sheets()
                if rel.Type.endswith("/worksheet")
            )

    @cached_property
    def strings(self) -> list[str | None]:
        found: list[str | None] = []
        part = self._parts.get("sharedStrings", "")
        if part.lower() in self.archive.names:
            stream = Stream(self.archive, part)
            with damage(f"{part} is not well-formed"):
                for _, element in iterparse(stream):
                    if element.tag == _STRING_TAG:
                        found.append(_text(element))
                        element.clear()
                        stream.end_item()
        return found

    @cached_property
    def _styles(self) -> Element:
        part = self._parts.get("styles", "")
        if part.lower() not in self.archive.names:
            return Element("styleSheet")
        with damage(f"{part} is not well-formed"):
            return fromstring(self.archive.read(part))

    @cached_property
    def struck(self) -> frozenset[str]:
        """The styles whose text is struck through."""
        fonts = {
            str(index)
            for index, font in enumerate(self._styles.iterfind("{*}fonts/{*}font"))
            if (mark := font.find("{*}strike")) is not None and mark.get("val", "1") in _TRUE
        }
        styles = enumerate(self._styles.iterfind("{*}cellXfs/{*}xf"))
        return frozenset(str(index) for index, style in styles if style.get("fontId") in fonts)

    @cached_property
    def formats(self) -> dict[str, NumberFormat]:
        """Return the formats by style that do not show plain numbers."""
        root = self._styles
        codes = {
            number.get("numFmtId"): number.get("formatCode", "")
            for number in root.iterfind(".//{*}numFmt")
        }
        found: dict[str, NumberFormat] = {}
        for index, style in enumerate(root.iterfind("{*}cellXfs/{*}xf")):
            known = style.get("numFmtId", "0")
            number = int(known) if re.fullmatch(r"[0-9]{1,5}", known) else 0
            shown = NumberFormat.of(codes.get(known), number)
            if shown is not None:
                found[str(index)] = shown
        return found


def _text(element: Element) -> str | None:
    """Return the text of a cell, without its pronunciation and the marks of footnotes; None if it
    is blank.
    """
    runs = (run for run in element if run.tag != _PHONETIC_TAG and run.find(_RAISED) is None)
    pieces = (t.text or "" for run in runs for t in run.iter(_TEXT_TAG))
    return _shown("".join(pieces))


def _shown(text: str) -> str | None:
    text = unescape(text)
    return text if text and not text.isspace() else None


class XlsxSheet(Sheet):
    def __init__(self, name: str, part: str, hidden: bool, book: XlsxFile) -> None:
        super().__init__(name, hidden=hidden)
        self.part = part
        self.book = book

    def merged(self) -> Sequence[MergedRange]:
        """Search the part: they stand behind the last row and are asked for before the first is
        judged.
        """
        found: list[MergedRange] = []
        tail = b""
        for chunk in self.book.archive.chunks(self.part):
            piece = tail + chunk
            for match in _MERGE.finditer(piece):
                left, top, right, bottom = cast(MergedRange, range_boundaries(match[1].decode()))
                found.append((top, left - 1, bottom, right - 1))
            if len(found) > MAX_ITEMS:
                raise too_large(f"{self.part} holds more than {MAX_ITEMS} merged ranges")
            tail = piece[piece.rfind(b"<") :] if piece.rfind(b"<") > piece.rfind(b">") else b""
        return found

    def _read(self) -> Iterator[NumberedRow]:
        with damage(f"sheet {self.name!r} cannot be read"):
            yield from (row for row in _Rows(self).parse() if row[1])

    def covered(self) -> int:
        """Return how many cells its merged cells and links cover."""
        stream = Stream(self.book.archive, self.part)
        cells = 0
        with damage(f"sheet {self.name!r} cannot be read"):
            for _, element in iterparse(stream):
                if element.tag in _SPANNING:
                    left, top, right, bottom = range_boundaries(element.get("ref", ""))
                    wide = (right or _EXCEL_COLUMNS) - (left or 1) + 1
                    cells += wide * ((bottom or _EXCEL_ROWS) - (top or 1) + 1)
                if element.tag in (*_SPANNING, ROW_TAG):
                    element.clear()
                    stream.end_item()
        return cells

    def width(self) -> int:
        """Return the number of columns up to the last with something in it."""
        return max((len(cells) for _, cells in self.rows()), default=0)

    def elements(self) -> Iterator[Element]:
        stream = Stream(self.book.archive, self.part)
        for _, element in iterparse(stream):
            if element.tag == ROW_TAG:
                yield element
                element.clear()
                stream.end_item()
            elif element.tag == COL_TAG:
                yield element
            elif element.tag == DATA_TAG:
                return


class _Rows(WorkSheetParser):
    def __init__(self, sheet: XlsxSheet) -> None:
        super().__init__(cast(Any, None), cast(Any, sheet.book.strings), data_only=True)
        self._sheet = sheet
        self._formats = sheet.book.formats
        self._struck = sheet.book.struck

    def parse(self) -> Generator[NumberedRow]:
        """Read the rows only: what stands behind them, such as rules, can make openpyxl refuse the
        whole sheet.
        """
        for element in self._sheet.elements():
            if element.tag == ROW_TAG:
                yield self.parse_row(element)
            elif element.get("hidden") in _TRUE:
                self._sheet.facts.hidden_columns.append(
                    (int(element.get("min", "")) - 1, int(element.get("max", "")) - 1)
                )

    def parse_row(self, row: Any) -> tuple[int, list[Any]]:
        """Return the number of a row and its cells, in their columns."""
        number, found = super().parse_row(row)
        cells: list[Cell] = []
        for index, cell in cast(list[tuple[int, Cell]], found):
            if cell is not None:
                cells.extend([None] * (index + 1 - len(cells)))
                cells[index] = cell
        if cells and row.get("hidden") in _TRUE:
            self._sheet.facts.hidden_rows.add(number)
        return number, cells

    def parse_cell(self, element: Element) -> Any:
        """Return the column, counted from 0, and the content of a cell."""
        index = self._column(element.get("r"))
        value = element.findtext(VALUE_TAG)
        formula = element.find(FORMULA_TAG) is not None
        if value or formula:
            kind = element.get("t", "n")
            cell = self._value(kind, element.get("s"), value)
        else:
            inline = element.find(INLINE_STRING)
            cell = None if inline is None else _text(inline)
        if cell is None:
            return index, None
        if index >= MAX_COLUMNS or self.row_counter > MAX_ROWS:
            raise outside_limits(self._sheet.name, index, self.row_counter)
        if element.get("s") in self._struck:
            self._sheet.facts.struck[index] += 1
        if formula and not (isinstance(cell, OddCell) and cell.kind is OddKind.NO_VALUE):
            self._sheet.facts.formulas[index] += 1
        return index, cell

    def _column(self, reference: str | None) -> int:
        if reference is None:
            self.col_counter += 1
        else:
            letters = reference.rstrip("0123456789")
            if reference[len(letters) :] != str(self.row_counter):
                raise damaged(
                    f"cell {reference!r} of sheet {self._sheet.name!r} is in row {self.row_counter}"
                )
            self.col_counter = column_index_from_string(letters)
        return self.col_counter - 1

    def _value(  # noqa: PLR0911 - one return for each kind of cell
        self, kind: str, style: str | None, value: str | None
    ) -> Cell:
        if not value:
            return None if kind == "str" else OddCell(OddKind.NO_VALUE, NO_VALUE_TEXT)
        if kind == "n":
            number = float(value)
            if vanishes(value, number):
                return value
            shown = self._formats.get(style) if style else None
            if shown is None:
                return number
            return shown.cell(number, epoch_1904=self._sheet.book.epoch_1904)
        if kind == "s":
            return self._sheet.book.strings[int(value)]
        if kind == "e":
            return OddCell(OddKind.ERROR, value)
        if kind == "b":
            return OddCell(OddKind.BOOLEAN, "TRUE" if value.strip() in _TRUE else "FALSE")
        return iso_date_cell(value) if kind == "d" else _shown(value)
