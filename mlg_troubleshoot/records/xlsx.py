"""Workbooks of Excel and LibreOffice (.xlsx, .xlsm), read row by row.

Rows written in the ordinary way are taken apart by one regular expression, which is as fast as a compiled
reader; everything else goes through an XML parser. Unlike the compiled readers this one keeps what a blank
would hide: error values, formulas that were never calculated, hidden rows, the exact cell of every value.
"""

from __future__ import annotations

import codecs
import posixpath
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from xml.parsers import expat

from mlg_troubleshoot.records.cells import (
    COLUMN_INDEX,
    LETTERS,
    MAX_COLUMNS,
    MAX_ROWS,
    NO_VALUE_TEXT,
    Cell,
    OddCell,
    OddKind,
    column_index,
    column_letters,
    date_cell,
    is_date_format,
    iso_date_cell,
    padding_width,
    show_number,
)
from mlg_troubleshoot.records.model import FileRefusedError
from mlg_troubleshoot.records.source import MergedRange, NumberedRow, SheetFacts
from mlg_troubleshoot.records.xmlparts import local, new_parser, parse_part
from mlg_troubleshoot.records.zipguard import GuardedZip, damaged

_ESCAPED = re.compile(r"_x([0-9A-Fa-f]{4})_")

_CELL = (
    r'<c r="(?P<col>[A-Z]{1,3})%s"(?: s="(?P<style>\d+)")?(?: t="(?P<type>[a-zA-Z]+)")?'
    r"(?: ?/>|>(?P<formula><f>[^<]*</f>)?"
    r'(?:<v>(?P<value>[^<&]*)</v>|<is><t(?: xml:space="preserve")?>(?P<text>[^<&]*)</t></is>)?</c>)'
)
_UNNAMED = re.sub(r"\(\?P<\w+>", "(?:", _CELL)
_ROW = re.compile(
    r'\s*<row r="(?P<row>\d{1,7})"(?P<attributes>[^>/]*)>(?P<cells>(?:' + _UNNAMED % "(?P=row)" + r")*)</row>"
)
_CELLS = re.compile(re.sub(r"\?P<\w+>", "", _CELL) % r"\d+")
_HIDDEN = re.compile(r'\bhidden="(?:1|true)"')
_MERGE = re.compile(r'<(?:\w+:)?mergeCell\s[^>]*?ref="([A-Z]{1,3})(\d{1,7}):([A-Z]{1,3})(\d{1,7})"')
_REFERENCE = re.compile(r"([A-Za-z]{1,3})(\d{1,7})")
_SHEET_DATA = "<sheetData>"


@dataclass(slots=True)
class _Shared:
    """What all sheets of a workbook have in common."""

    strings: list[str | None] = field(default_factory=list)
    # Styles that show a number as something else: a date (0) or with leading zeros (their number).
    odd_styles: dict[str, int] = field(default_factory=dict)
    epoch_1904: bool = False


def _unescape(text: str) -> str:
    return _ESCAPED.sub(lambda m: chr(int(m[1], 16)), text) if "_x" in text else text


def _as_text(text: str) -> str | None:
    return text if text and not text.isspace() else None


class XlsxFile:
    """A workbook in Office Open XML.

    Parameters
    ----------
    data : bytes
        The file.

    Raises
    ------
    FileRefusedError
        If it is damaged, dangerous or no workbook.
    """

    delimiter: str | None = None

    def __init__(self, data: bytes) -> None:
        self._zip = GuardedZip(data)
        self.notes: list[str] = []
        book = self._workbook_part()
        if book.endswith(".bin"):
            raise FileRefusedError(
                "file_kind",
                "a binary workbook (.xlsb)",
                "an .xlsx workbook or a CSV file",
                "Save it as .xlsx and read the copy.",
            )
        self.kind = "xlsx"
        if any(name.endswith("vbaproject.bin") for name in self._zip.names):
            self.kind = "xlsm"
            self.notes.append("the workbook holds macros: they are ignored, the values are read")
        self._folder = posixpath.dirname(book)
        self._targets = self._relations(book)
        self._shared = _Shared()
        self._loaded = False
        self._entries: list[tuple[str, str, bool]] = []
        parse_part(book, self._zip.read(book), self._book_element)
        self.sheets: tuple[XlsxSheet, ...] = tuple(
            XlsxSheet(name, self._targets[rid][1], hidden, self)
            for name, rid, hidden in self._entries
            if rid in self._targets and self._targets[rid][0].endswith("/worksheet")
        )

    def _workbook_part(self) -> str:
        targets: list[str] = []

        def element(name: str, attributes: dict[str, str]) -> None:
            if local(name) == "Relationship" and attributes.get("Type", "").endswith("/officeDocument"):
                targets.append(attributes.get("Target", "").lstrip("/").lower())

        if "_rels/.rels" in self._zip.names:
            parse_part("_rels/.rels", self._zip.read("_rels/.rels"), element)
        found = targets[0] if targets else "xl/workbook.xml"
        if found not in self._zip.names:
            raise damaged("it holds no workbook")
        if posixpath.basename(found).startswith("document") or "presentation" in found:
            raise FileRefusedError(
                "file_kind", "a text document or presentation", "an .xlsx workbook or a CSV file", "Read the workbook."
            )
        return found

    def _relations(self, book: str) -> dict[str, tuple[str, str]]:
        part = posixpath.join(self._folder, "_rels", posixpath.basename(book) + ".rels")
        found: dict[str, tuple[str, str]] = {}

        def element(name: str, attributes: dict[str, str]) -> None:
            if local(name) == "Relationship":
                target = attributes.get("Target", "").replace("\\", "/")
                path = target.lstrip("/") if target.startswith("/") else posixpath.join(self._folder, target)
                found[attributes.get("Id", "")] = (
                    attributes.get("Type", ""),
                    posixpath.normpath(path).lower(),
                )

        parse_part(part, self._zip.read(part), element)
        return found

    def _book_element(self, name: str, attributes: dict[str, str]) -> None:
        kind = local(name)
        if kind == "workbookPr":
            self._shared.epoch_1904 = attributes.get("date1904") in ("1", "true", "on")
        elif kind == "sheet":
            rid = next((value for key, value in attributes.items() if local(key) == "id" and ":" in key), "")
            hidden = attributes.get("state", "visible") != "visible"
            self._entries.append((attributes.get("name", ""), rid, hidden))

    def _part(self, kind: str) -> str | None:
        return next((path for typ, path in self._targets.values() if typ.endswith("/" + kind)), None)

    def load(self) -> tuple[GuardedZip, _Shared]:
        """Return the archive and what its sheets share, read when first needed."""
        if not self._loaded:
            strings, styles = self._part("sharedStrings"), self._part("styles")
            if strings is not None and strings in self._zip.names:
                self._load_strings(strings)
            if styles is not None and styles in self._zip.names:
                self._load_styles(styles)
            self._loaded = True
        return self._zip, self._shared

    def _load_strings(self, part: str) -> None:
        strings = self._shared.strings
        pieces: list[str] = []
        inside = False
        phonetic = 0

        def start(name: str, _: dict[str, str]) -> None:
            nonlocal inside, phonetic
            kind = local(name)
            if kind == "si":
                pieces.clear()
            elif kind == "rPh":
                phonetic += 1
            elif kind == "t":
                inside = not phonetic

        def end(name: str) -> None:
            nonlocal inside, phonetic
            kind = local(name)
            if kind == "si":
                strings.append(_as_text(_unescape("".join(pieces))))
            elif kind == "rPh":
                phonetic -= 1
            elif kind == "t":
                inside = False

        def text(data: str) -> None:
            if inside:
                pieces.append(data)

        parser = new_parser(start, end, text)
        try:
            for chunk in self._zip.chunks(part):
                parser.Parse(chunk, False)
            parser.Parse(b"", True)
        except (expat.ExpatError, ValueError, LookupError):
            raise damaged(f"{part} is not well-formed") from None

    def _load_styles(self, part: str) -> None:
        codes: dict[str, str] = {}
        styles: list[str] = []
        inside = False

        def start(name: str, attributes: dict[str, str]) -> None:
            nonlocal inside
            kind = local(name)
            if kind == "numFmt":
                codes[attributes.get("numFmtId", "")] = attributes.get("formatCode", "")
            elif kind == "cellXfs":
                inside = True
            elif kind == "xf" and inside:
                styles.append(attributes.get("numFmtId", "0"))

        def end(name: str) -> None:
            nonlocal inside
            if local(name) == "cellXfs":
                inside = False

        parse_part(part, self._zip.read(part), start, end)
        for index, format_id in enumerate(styles):
            code = codes.get(format_id)
            number = int(format_id) if format_id.isascii() and format_id.isdigit() and len(format_id) < 6 else 0
            if is_date_format(number, code):
                self._shared.odd_styles[str(index)] = 0
            elif padding_width(code):
                self._shared.odd_styles[str(index)] = padding_width(code)


class XlsxSheet:
    """One worksheet.

    Parameters
    ----------
    name : str
        Its name.
    part : str
        Its part in the archive.
    hidden : bool
        True if it is hidden.
    book : XlsxFile
        Its workbook.
    """

    def __init__(self, name: str, part: str, hidden: bool, book: XlsxFile) -> None:
        self.name: str | None = name
        self.hidden = hidden
        self.facts = SheetFacts()
        self.part = part
        self._book = book

    def merged(self) -> Sequence[MergedRange]:
        """Return merged ranges as first row, first column, last row, last column (rows from 1, columns from 0).

        Returns
        -------
        sequence of tuple of int
            The ranges.
        """
        archive, _ = self._book.load()
        found: list[MergedRange] = []
        tail = ""
        for chunk in archive.chunks(self.part):
            piece = tail + chunk.decode("latin-1")
            found += [(int(m[2]), column_index(m[1]), int(m[4]), column_index(m[3])) for m in _MERGE.finditer(piece)]
            tail = piece[piece.rfind("<") :] if piece.rfind("<") > piece.rfind(">") else ""
        return found

    def rows(self) -> Iterator[NumberedRow]:
        """Read the rows that are not blank, with their numbers counted from 1.

        Yields
        ------
        tuple
            Number and cells of the next row.

        Raises
        ------
        FileRefusedError
            If the sheet is damaged or has a cell outside the allowed range.
        """
        archive, shared = self._book.load()
        self.facts.__init__()  # type: ignore[misc]
        yield from _SheetReader(self.name or "", shared, self.facts).read(archive.chunks(self.part))


class _SheetReader:
    """Reads one worksheet from the pieces of its XML."""

    def __init__(self, sheet: str, shared: _Shared, facts: SheetFacts) -> None:
        self._sheet = sheet
        self._shared = shared
        self._facts = facts
        self._parser = new_parser(self._start, self._end, self._text)
        self._ready: list[NumberedRow] = []
        self._path: list[str] = []
        self._row = 0
        self._cells: list[Cell] = []
        self._row_hidden = False
        self._column = -1
        self._type = ""
        self._style = ""
        self._value: list[str] = []
        self._strings: list[str] = []
        self._has_formula = False
        self._capture: list[str] | None = None

    def read(self, chunks: Iterator[bytes]) -> Iterator[NumberedRow]:
        """Yield the rows that are not blank."""
        try:
            first = next(chunks, b"")
            if first.startswith((codecs.BOM_UTF16_BE, codecs.BOM_UTF16_LE)) or _other_encoding(first):
                yield from self._read_slowly(first, chunks)
            else:
                yield from self._read_quickly(first.removeprefix(codecs.BOM_UTF8), chunks)
        except (expat.ExpatError, UnicodeDecodeError, ValueError, LookupError):
            raise damaged(f"the XML of sheet {self._sheet!r} is not well-formed") from None

    def _read_slowly(self, first: bytes, chunks: Iterator[bytes]) -> Iterator[NumberedRow]:
        self._parser.Parse(first, False)
        yield from self._taken()
        for chunk in chunks:
            self._parser.Parse(chunk, False)
            yield from self._taken()
        self._parser.Parse(b"", True)
        yield from self._taken()

    def _taken(self) -> list[NumberedRow]:
        ready, self._ready = self._ready, []
        return ready

    def _read_quickly(self, first: bytes, chunks: Iterator[bytes]) -> Iterator[NumberedRow]:
        decoder = codecs.getincrementaldecoder("utf-8")()
        buffer = decoder.decode(first)
        quick = False
        at = buffer.find(_SHEET_DATA)
        if at >= 0:
            at += len(_SHEET_DATA)
            self._parser.Parse(buffer[:at], False)
            # Only if the parser agrees that this is where the rows begin may rows bypass it.
            quick = self._between_rows()
            buffer = buffer[at:]
        while True:
            if quick:
                position = 0
                while (match := _ROW.match(buffer, position)) is not None:
                    row = self._quick_row(match)
                    if row is not None:
                        yield row
                    position = match.end()
                buffer = buffer[position:]
                cut = buffer.find("</row>")
                if cut >= 0:
                    odd = buffer[: cut + 6]
                    self._parser.Parse(odd, False)
                    yield from self._taken()
                    buffer = buffer[cut + 6 :]
                    quick = "<!" not in odd and "<?" not in odd and self._between_rows()
                    continue
                quick = "</sheetData>" not in buffer
                if not quick:
                    continue
            else:
                self._parser.Parse(buffer, False)
                yield from self._taken()
                buffer = ""
            chunk = next(chunks, None)
            if chunk is None:
                break
            buffer += decoder.decode(chunk)
        self._parser.Parse(buffer + decoder.decode(b"", final=True), True)
        yield from self._taken()

    def _between_rows(self) -> bool:
        return self._path == ["worksheet", "sheetData"]

    def _quick_row(  # noqa: PLR0912 - two million cells pass here, calls would cost more than branches
        self, match: re.Match[str]
    ) -> NumberedRow | None:
        number = int(match["row"])
        self._row = number
        shared = self._shared
        strings, odd_styles = shared.strings, shared.odd_styles
        cells: list[Cell] = []
        count = 0
        full = False
        for letters, style, kind, formula, value, text in _CELLS.findall(match["cells"]):
            cell: Cell
            if kind == "s" and value:
                cell = strings[int(value)]
            elif value and (not kind or kind == "n") and not (style and style in odd_styles):
                cell = float(value)
            elif text:
                cell = _as_text(_unescape(text))
            elif value or formula:
                cell = self._special(kind, style, value, bool(formula))
            else:
                continue
            if cell is None:
                continue
            index = COLUMN_INDEX.get(letters)
            if index is None or number > MAX_ROWS:
                raise self._outside(letters, number)
            if formula and not _never_calculated(cell):
                self._facts.formulas[index] += 1
            full = True
            if index == count:
                cells.append(cell)
                count += 1
            elif index > count:
                cells.extend([None] * (index - count))
                cells.append(cell)
                count = index + 1
            else:
                cells[index] = cell
        if not full:
            return None
        attributes = match["attributes"]
        if attributes and _HIDDEN.search(attributes):
            self._facts.hidden_rows.add(number)
        return number, cells

    def _special(  # noqa: PLR0911 - one return for each kind of cell
        self, kind: str, style: str, value: str, formula: bool
    ) -> Cell:
        """Return a cell that is not simply a number or a shared text."""
        if not value:
            if formula and kind != "str":
                return OddCell(OddKind.NO_VALUE, NO_VALUE_TEXT)
            return None
        if kind == "s":
            return self._shared.strings[int(value)]
        if kind == "e":
            return OddCell(OddKind.ERROR, value)
        if kind == "b":
            return OddCell(OddKind.BOOLEAN, "TRUE" if value.strip() in ("1", "true") else "FALSE")
        if kind == "d":
            return iso_date_cell(value)
        if kind in ("", "n"):
            number = float(value)
            width = self._shared.odd_styles.get(style)
            if width is None or not abs(number) < 1e15:
                return number
            if width == 0:
                return date_cell(number, epoch_1904=self._shared.epoch_1904)
            return OddCell(OddKind.PADDED, show_number(number).zfill(width), None, number)
        return _as_text(_unescape(value))

    def _outside(self, letters: str, row: int) -> FileRefusedError:
        return FileRefusedError(
            "cell_outside_limits",
            f"something stands in cell {letters}{row}",
            f"nothing beyond column {LETTERS[-1]} ({MAX_COLUMNS} columns) and row {MAX_ROWS}",
            "Delete what stands far outside the table, or copy the table into a new workbook.",
            sheet=self._sheet,
            row=row,
            cell=f"{letters}{row}",
        )

    def _start(self, name: str, attributes: dict[str, str]) -> None:
        kind = local(name)
        self._path.append(kind)
        depth = len(self._path)
        if depth == 4 and kind == "c" and self._path[2] == "row" and self._path[1] == "sheetData":
            self._start_cell(attributes)
        elif depth == 3 and kind == "row" and self._path[1] == "sheetData":
            self._row = int(attributes["r"]) if "r" in attributes else self._row + 1
            self._cells = []
            self._column = -1
            self._row_hidden = attributes.get("hidden") in ("1", "true")
        elif depth == 3 and kind == "col" and attributes.get("hidden") in ("1", "true"):
            self._facts.hidden_columns.append((int(attributes["min"]) - 1, int(attributes["max"]) - 1))
        elif depth > 4 and self._path[1] == "sheetData":
            if kind == "v" and depth == 5:
                self._capture = self._value
            elif kind == "f" and depth == 5:
                self._has_formula = True
            elif kind == "t" and "rPh" not in self._path:
                self._capture = self._strings

    def _start_cell(self, attributes: dict[str, str]) -> None:
        reference = attributes.get("r")
        if reference is None:
            self._column += 1
        else:
            match = _REFERENCE.fullmatch(reference)
            if match is None or int(match[2]) != self._row:
                raise damaged(f"cell {reference!r} of sheet {self._sheet!r} stands in row {self._row}")
            self._column = column_index(match[1])
        self._type = attributes.get("t", "")
        self._style = attributes.get("s", "")
        self._has_formula = False
        self._value.clear()
        self._strings.clear()

    def _text(self, data: str) -> None:
        if self._capture is not None:
            self._capture.append(data)

    def _end(self, _: str) -> None:
        kind = self._path.pop()
        depth = len(self._path)
        if depth == 3 and kind == "c" and self._path[1] == "sheetData":
            self._end_cell()
        elif depth == 2 and kind == "row" and self._path[1] == "sheetData":
            if any(cell is not None for cell in self._cells):
                if self._row_hidden:
                    self._facts.hidden_rows.add(self._row)
                self._ready.append((self._row, self._cells))
        elif kind in ("v", "t"):
            self._capture = None

    def _end_cell(self) -> None:
        value = "".join(self._value)
        cell: Cell
        if self._strings:
            cell = _as_text(_unescape("".join(self._strings)))
        elif value or self._has_formula:
            cell = self._special(self._type, self._style, value, self._has_formula)
        else:
            return
        if cell is None:
            return
        if self._column >= MAX_COLUMNS or self._row > MAX_ROWS:
            raise self._outside(column_letters(self._column), self._row)
        if self._has_formula and not _never_calculated(cell):
            self._facts.formulas[self._column] += 1
        missing = self._column + 1 - len(self._cells)
        if missing > 0:
            self._cells.extend([None] * missing)
        self._cells[self._column] = cell


def _never_calculated(cell: Cell) -> bool:
    return isinstance(cell, OddCell) and cell.kind is OddKind.NO_VALUE


def _other_encoding(first: bytes) -> bool:
    match = re.match(rb"""\s*<\?xml[^>]*?encoding=["']([A-Za-z0-9._\-]+)["']""", first)
    return match is not None and match[1].lower() not in (b"utf-8", b"utf8", b"us-ascii", b"ascii")
