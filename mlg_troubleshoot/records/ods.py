"""OpenDocument spreadsheets (.ods), read row by row.

Python-calamine gives an error value and a formula without a result as a blank cell, and FALSE,
where it is a number shown so, as 0: "not measured" and a clearance of 0 that nobody measured.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from xml.etree.ElementTree import Element, iterparse

from mlg_troubleshoot.records.cells import (
    MAX_COLUMNS,
    MAX_ROWS,
    NO_VALUE_TEXT,
    Cell,
    OddCell,
    OddKind,
    has_words,
    iso_date_cell,
    show_number,
)
from mlg_troubleshoot.records.source import MergedRange, NumberedRow, Sheet, Workbook
from mlg_troubleshoot.records.zipguard import (
    GuardedZip,
    Stream,
    damage,
    outside_limits,
    password_protected,
)

_CONTENT = "content.xml"
_PADDED = re.compile(r"0\d+", re.ASCII)
_NUMBER = re.compile(r"[+-]?\d[\d.,]*(?:[eE][+-]?\d+)?%?", re.ASCII)
_ERROR_TEXT = re.compile(r"#[A-Z/0-9!?]+|Err:\d+")
_OASIS = "urn:oasis:names:tc:opendocument:xmlns:"
_OFFICE, _STYLE, _TABLE, _TEXT = (
    f"{{{_OASIS}{name}:1.0}}" for name in ("office", "style", "table", "text")
)
_EXTENDED = "{urn:org:documentfoundation:names:experimental:calc:xmlns:calcext:1.0}"
_BREAKS = {f"{_TEXT}tab": "\t", f"{_TEXT}line-break": "\n"}


def ods_book(data: bytes) -> Workbook:
    archive = GuardedZip(data)
    names = archive.names
    manifest = archive.read("meta-inf/manifest.xml") if "meta-inf/manifest.xml" in names else b""
    if b"encryption-data" in manifest or "encrypted-package" in names:
        raise password_protected()
    hidden: set[str] = set()
    found: list[tuple[str, str]] = []
    for event, element in _elements(archive):
        if event == "start" and element.tag == f"{_TABLE}table":
            found.append((element.get(f"{_TABLE}name", ""), element.get(f"{_TABLE}style-name", "")))
        elif event == "end" and element.tag == f"{_STYLE}style":
            shown = element.find(f"{_STYLE}table-properties")
            if shown is not None and shown.get(f"{_TABLE}display") == "false":
                hidden.add(element.get(f"{_STYLE}name", ""))
    sheets = [
        _OdsSheet(archive, index, name, style in hidden)
        for index, (name, style) in enumerate(found)
    ]
    return Workbook("ods", sheets)


def _elements(archive: GuardedZip) -> Iterator[tuple[str, Element]]:
    """Walk over the content; rows and styles are complete at their end and cleared after it."""
    stream = Stream(archive, _CONTENT)
    with damage(f"{_CONTENT} is not well-formed"):
        for event, element in iterparse(stream, ("start", "end")):
            yield event, element
            if event == "end" and element.tag in (f"{_TABLE}table-row", f"{_STYLE}style"):
                element.clear()
                stream.end_item()


class _OdsSheet(Sheet):
    def __init__(self, archive: GuardedZip, index: int, name: str, hidden: bool) -> None:
        super().__init__(name, hidden=hidden)
        self._zip = archive
        self._index = index
        self._merged: list[MergedRange] = []

    def merged(self) -> Sequence[MergedRange]:
        """Return those of the rows read so far; more are added as more are read."""
        return self._merged

    def _read(self) -> Iterator[NumberedRow]:
        self._merged.clear()
        table = -1
        last = 0
        with damage(f"sheet {self.name!r} cannot be read"):
            for event, element in _elements(self._zip):
                if event == "start":
                    table += element.tag == f"{_TABLE}table"
                elif table == self._index and element.tag == f"{_TABLE}table-row":
                    row = last + 1
                    last = last + _count(element, "rows-repeated")
                    cells = self._cells(element, row)
                    if not any(cell is not None for cell in cells):
                        continue
                    if last > MAX_ROWS:
                        raise outside_limits(self.name, 0, last)
                    for number in range(row, last + 1):
                        if element.get(f"{_TABLE}visibility", "visible") != "visible":
                            self.facts.hidden_rows.add(number)
                        yield number, cells

    def _cells(self, element: Element, row: int) -> list[Cell]:
        cells: list[Cell] = []
        column = 0
        for each in element:
            if each.tag not in (f"{_TABLE}table-cell", f"{_TABLE}covered-table-cell"):
                continue
            first = column
            column = column + _count(each, "columns-repeated")
            across = _count(each, "columns-spanned")
            down = _count(each, "rows-spanned")
            if across > 1 or down > 1:
                self._merged.append((row, first, row + down - 1, first + across - 1))
            cell = _value(each)
            if cell is not None:
                if column > MAX_COLUMNS or row > MAX_ROWS:
                    raise outside_limits(self.name, column - 1, row)
                cells += [None] * (first - len(cells)) + [cell] * (column - first)
                if f"{_TABLE}formula" in each.attrib:
                    self.facts.formulas[first] += 1
        return cells


def _count(element: Element, name: str) -> int:
    """Return a count that an attribute states; 1 if it states none."""
    text = element.get(f"{_TABLE}number-{name}", "1")
    if not (text.isascii() and text.isdigit() and len(text) <= 7):
        raise ValueError(text)
    return max(int(text), 1)


def _written(element: Element) -> str:
    """Return the text of a paragraph: what a file writes as elements are blanks, tabs and line
    breaks.
    """
    pieces = [element.text or ""]
    for part in element:
        if part.tag == f"{_TEXT}s":
            pieces.append(" " * min(int(part.get(f"{_TEXT}c", "1")), 1000))
        elif part.tag != f"{_OFFICE}annotation":
            pieces.append(_BREAKS.get(part.tag) or _written(part))
        pieces.append(part.tail or "")
    return "".join(pieces)


def _value(element: Element) -> Cell:  # noqa: PLR0911 - one return for each kind of cell
    shown = "\n".join(_written(paragraph) for paragraph in element.iterfind(f"{_TEXT}p"))
    kind = element.get(f"{_OFFICE}value-type")
    formula = f"{_TABLE}formula" in element.attrib
    if element.get(f"{_EXTENDED}value-type") == "error" or (
        formula and _ERROR_TEXT.fullmatch(shown)
    ):
        return OddCell(OddKind.ERROR, shown or "error")
    if kind in ("float", "percentage", "currency"):
        number = float(element.attrib[f"{_OFFICE}value"])
        if shown in ("TRUE", "FALSE"):
            return OddCell(OddKind.BOOLEAN, shown)
        if _PADDED.fullmatch(shown) and float(shown) == number:
            return OddCell(OddKind.PADDED, shown, None, number)
        words = _NUMBER.sub("", shown, count=1)
        if not has_words(words):
            return number
        # The number that is shown may be rounded, and have a comma.
        text = _NUMBER.sub(show_number(number), shown, count=1)
        return OddCell(OddKind.WORDED, text, None, number)
    if kind == "date":
        return iso_date_cell(element.get(f"{_OFFICE}date-value", ""))
    if kind == "time":
        return OddCell(OddKind.DATE, shown or "a time")
    if kind == "boolean":
        return OddCell(OddKind.BOOLEAN, element.get(f"{_OFFICE}boolean-value", "").upper())
    if kind is None and formula and not shown:
        return OddCell(OddKind.NO_VALUE, NO_VALUE_TEXT)
    text = shown or element.get(f"{_OFFICE}string-value", "")
    return text if text and not text.isspace() else None
