"""Workbooks of Excel and LibreOffice (.xlsx, .xlsm), read by openpyxl behind a guard.

Openpyxl finds the sheets. What stands in a cell is taken here, since it would hide a formula
without a result (blank), a date outside the calendar (an error value) and the escaped characters of
a text, refuse a whole sheet for ``NaN`` in a number or for a rule below the rows, and tell neither
hidden rows nor which results are of formulas. Texts and styles are also taken here: its model of
the styles refuses workbooks of other programs for a colour it does not know, and a text with
``x005F_`` in it would lose that.
"""

from __future__ import annotations

import io
import re
import warnings
from collections.abc import Iterator, Sequence
from functools import cached_property, lru_cache
from string import ascii_letters
from typing import Any, cast
from xml.etree.ElementTree import Element, TreeBuilder, XMLParser, fromstring, iterparse

from openpyxl.reader.excel import ExcelReader
from openpyxl.utils.cell import column_index_from_string, range_boundaries
from openpyxl.utils.datetime import CALENDAR_MAC_1904
from openpyxl.utils.escape import unescape
from openpyxl.worksheet._reader import (
    DATA_TAG,
    FORMULA_TAG,
    INLINE_STRING,
    VALUE_TAG,
)
from openpyxl.xml.constants import SHEET_MAIN_NS

from mlg_troubleshoot.records.cells import (
    MACROS,
    MAX_COLUMNS,
    MAX_ROWS,
    NO_VALUE_TEXT,
    Cell,
    MergedRange,
    NumberedRow,
    NumberFormat,
    OddCell,
    OddKind,
    Sheet,
    Workbook,
    iso_date_cell,
)
from mlg_troubleshoot.records.csvfile import (
    MAX_ITEMS,
    GuardedZip,
    Stream,
    damage,
    outside_limits,
    too_large,
)
from mlg_troubleshoot.units import vanishes

_MERGE, _SPANNING = (
    re.compile(rb"""<(?:\w+:)?(?:%s)\s[^<>]*?ref=["']([A-Z0-9:$]+)["']""" % tags)
    for tags in (b"mergeCell", b"mergeCell|hyperlink")
)
_TEXT_TAG, _PHONETIC_TAG, _STRING_TAG = (
    f"{{{SHEET_MAIN_NS}}}{name}" for name in ("t", "rPh", "si")
)
_FONT_OF_RUN = "{*}rPr"
_RAISED = f"{_FONT_OF_RUN}/{{*}}vertAlign[@val='superscript']"
_EXCEL_ROWS = 1 << 20
_EXCEL_COLUMNS = 1 << 14
_TRUE = ("1", "true", "on")


class XlsxFile(Workbook):
    sheets: Sequence[XlsxSheet]

    def __init__(self, data: bytes) -> None:
        self.archive = GuardedZip(data)
        macros = any(name.endswith("vbaproject.bin") for name in self.archive.parts)
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
        if part.lower() in self.archive.parts:
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
        if part.lower() not in self.archive.parts:
            return Element("styleSheet")
        with damage(f"{part} is not well-formed"):
            return fromstring(self.archive.read(part))

    @cached_property
    def struck(self) -> frozenset[str]:
        """The styles whose text is struck through."""
        fonts = {
            str(index)
            for index, font in enumerate(self._styles.iterfind("{*}fonts/{*}font"))
            if _is_struck(font)
        }
        styles = enumerate(self._styles.iterfind("{*}cellXfs/{*}xf"))
        return frozenset(str(index) for index, style in styles if style.get("fontId") in fonts)

    @cached_property
    def formats(self) -> dict[str | None, NumberFormat]:
        """Return the formats by style that do not show plain numbers."""
        root = self._styles
        codes = {
            number.get("numFmtId"): number.get("formatCode", "")
            for number in root.iterfind(".//{*}numFmt")
        }
        found: dict[str | None, NumberFormat] = {}
        for index, style in enumerate(root.iterfind("{*}cellXfs/{*}xf")):
            known = style.get("numFmtId", "0")
            number = int(known) if re.fullmatch(r"[0-9]{1,5}", known) else 0
            shown = NumberFormat.of(codes.get(known), number)
            if shown is not None:
                found[str(index)] = shown
        return found


@lru_cache(1024)
def _index(letters: str) -> int:
    """The column of a cell, counted from 0."""
    return column_index_from_string(letters) - 1


def _text(element: Element) -> str | None:
    """Return the text of a cell, without its pronunciation and the marks of footnotes; what is
    struck through stands between ~~, which no number has. None if it is blank.
    """
    pieces = []
    for run in element:
        if run.tag == _PHONETIC_TAG or (len(run) and run.find(_RAISED) is not None):
            continue
        if run.tag == _TEXT_TAG:
            pieces.append(run.text or "")
            continue
        text = "".join(t.text or "" for t in run.iter(_TEXT_TAG))
        pieces.append(f"~~{text}~~" if len(run) and _is_struck(run.find(_FONT_OF_RUN)) else text)
    return _shown("".join(pieces))


def _is_struck(font: Element | None) -> bool:
    mark = None if font is None else font.find("{*}strike")
    return mark is not None and mark.get("val", "1") in _TRUE


def _shown(text: str) -> str | None:
    text = unescape(text) if "_x" in text else text
    return text if text and not text.isspace() else None


class XlsxSheet(Sheet):
    def __init__(self, name: str, part: str, hidden: bool, book: XlsxFile) -> None:
        super().__init__(name, hidden=hidden)
        self.part = part
        self.book = book

    @cached_property
    def merged(self) -> Sequence[MergedRange]:
        """Search the part: they stand behind the last row and are asked for before the first is
        judged.
        """
        return [*self._ranges(_MERGE)]

    def covered(self) -> int:
        """Return how many cells its merged cells and links cover."""
        return sum(
            (right - left + 1) * (bottom - top + 1)
            for top, left, bottom, right in self._ranges(_SPANNING)
        )

    def _ranges(self, of: re.Pattern[bytes]) -> Iterator[MergedRange]:
        found = 0
        tail = b""
        for chunk in self.book.archive.chunks(self.part):
            piece = tail + chunk
            for match in of.finditer(piece):
                found += 1
                if found > MAX_ITEMS:
                    raise too_large(f"{self.part} holds more than {MAX_ITEMS} ranges")
                with damage(f"sheet {self.name!r} cannot be read"):
                    left, top, right, bottom = range_boundaries(match[1].decode())
                yield (
                    top or 1,
                    (left or 1) - 1,
                    bottom or _EXCEL_ROWS,
                    (right or _EXCEL_COLUMNS) - 1,
                )
            tail = piece[piece.rfind(b"<") :] if piece.rfind(b"<") > piece.rfind(b">") else b""

    def rows(self) -> Iterator[NumberedRow]:
        with damage(f"sheet {self.name!r} cannot be read"):
            number = 0
            for element in self.elements():
                located = next(filter(None, (each.get("r") for each in element)), "")
                place = element.get("r") or located.lstrip(ascii_letters) or str(number + 1)
                number = int(place if place.isdecimal() else place.removesuffix(".0"))
                cells: list[Cell] = []
                index = -1
                row = str(number)
                for each in element:
                    reference = each.get("r")
                    # Without a reference it follows the one before.
                    index = index + 1 if reference is None else _index(reference.removesuffix(row))
                    cell = self._cell(each, index)
                    if cell is None:
                        continue
                    if index >= MAX_COLUMNS or number > MAX_ROWS:
                        raise outside_limits(self.name, index, number)
                    cells.extend([None] * (index + 1 - len(cells)))
                    cells[index] = cell
                if cells and element.get("hidden") in _TRUE:
                    self.hidden_rows.add(number)
                if cells:
                    yield number, cells

    def _cell(self, element: Element, index: int) -> Cell:
        value = element.findtext(VALUE_TAG)
        has_formula = element.find(FORMULA_TAG) is not None
        style = element.get("s")
        if value:
            cell = self._value(element.get("t", "n"), style, value)
        elif has_formula:
            cell = None if element.get("t") == "str" else OddCell(OddKind.NO_VALUE, NO_VALUE_TEXT)
        else:
            inline = element.find(INLINE_STRING)
            cell = None if inline is None else _text(inline)
        if cell is not None and style in self.book.struck:
            self.struck[index] += 1
        if cell is not None and value and has_formula:
            self.formulas[index] += 1
        return cell

    def _value(self, kind: str, style: str | None, value: str) -> Cell:
        if kind == "n":
            number = float(value)
            if not number and vanishes(value, number):
                return value
            shown = self.book.formats.get(style)
            epoch = self.book.epoch_1904
            return number if shown is None else shown.cell(number, epoch_1904=epoch)
        if kind == "s":
            return self.book.strings[int(value)]
        if kind == "e":
            return OddCell(OddKind.ERROR, value)
        if kind == "b":
            return OddCell(OddKind.BOOLEAN, "TRUE" if value.strip() in _TRUE else "FALSE")
        return iso_date_cell(value) if kind == "d" else _shown(value)

    def elements(self) -> Iterator[Element]:
        """The rows, each until the next one is asked for."""
        stream = Stream(self.book.archive, self.part)
        builder = TreeBuilder()
        parser = XMLParser(target=builder)
        data: Element | None = None
        while piece := stream.read():
            parser.feed(piece)
            # The builder gives what stands there so far: rows are taken from it piece by piece.
            root: Element | None = builder.close()
            if root is None:
                continue
            data = root.find(DATA_TAG) if data is None else data
            if data is not None:
                is_whole = root[-1] is not data
                rows = data[:] if is_whole else data[:-1]
                for row in rows:
                    yield row
                    stream.end_item()
                del data[: len(rows)]
                if is_whole:
                    return
        parser.close()
        yield from () if data is None else data
