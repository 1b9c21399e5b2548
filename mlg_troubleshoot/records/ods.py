"""OpenDocument spreadsheets (.ods), read row by row."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from xml.parsers import expat

from mlg_troubleshoot.records.cells import (
    LETTERS,
    MAX_COLUMNS,
    MAX_ROWS,
    NO_VALUE_TEXT,
    Cell,
    OddCell,
    OddKind,
    column_letters,
    iso_date_cell,
)
from mlg_troubleshoot.records.model import FileRefusedError
from mlg_troubleshoot.records.source import MergedRange, NumberedRow, SheetFacts
from mlg_troubleshoot.records.xmlparts import new_parser
from mlg_troubleshoot.records.zipguard import GuardedZip, damaged

_CONTENT = "content.xml"
_PADDED = re.compile(r"0\d+", re.ASCII)
_ERROR_TEXT = re.compile(r"#[A-Z/0-9!?]+|Err:\d+")


class OdsFile:
    """An OpenDocument spreadsheet.

    Parameters
    ----------
    data : bytes
        The file.

    Raises
    ------
    FileRefusedError
        If it is damaged, dangerous or password protected.
    """

    kind = "ods"
    delimiter: str | None = None

    def __init__(self, data: bytes) -> None:
        self._zip = GuardedZip(data)
        self.notes: list[str] = []
        names = self._zip.names
        manifest = self._zip.read("meta-inf/manifest.xml") if "meta-inf/manifest.xml" in names else b""
        if b"encryption-data" in manifest or "encrypted-package" in names:
            raise FileRefusedError(
                "password_protected",
                "the file is password protected",
                "a spreadsheet without a password",
                "Save a copy without the password and read the copy.",
            )
        self._finder = _TableFinder()
        for _ in _parse(self._zip, self._finder):
            pass
        self.sheets = tuple(
            OdsSheet(self._zip, index, name, hidden) for index, (name, hidden) in enumerate(self._finder.tables())
        )


def _parse(archive: GuardedZip, handler: _TableFinder | _RowBuilder) -> Iterator[None]:
    """Feed the content to a handler, pausing after each piece."""
    parser = new_parser(handler.start, handler.end, handler.text)
    try:
        for chunk in archive.chunks(_CONTENT):
            parser.Parse(chunk, False)
            yield
        parser.Parse(b"", True)
        yield
    except (expat.ExpatError, ValueError, LookupError):
        raise damaged(f"{_CONTENT} is not well-formed") from None


class _TableFinder:
    """Finds the names of the tables and which of them are hidden."""

    def __init__(self) -> None:
        self._hidden_styles: set[str] = set()
        self._style = ""
        self._found: list[tuple[str, str]] = []

    def start(self, name: str, attributes: dict[str, str]) -> None:
        """Take the start of an element."""
        if name == "style:style":
            self._style = attributes.get("style:name", "")
        elif name == "style:table-properties" and attributes.get("table:display") == "false":
            self._hidden_styles.add(self._style)
        elif name == "table:table":
            self._found.append((attributes.get("table:name", ""), attributes.get("table:style-name", "")))

    def end(self, _: str) -> None:
        """Take the end of an element."""

    def text(self, _: str) -> None:
        """Take text."""

    def tables(self) -> list[tuple[str, bool]]:
        """Return name and hiddenness of each table."""
        return [(name, style in self._hidden_styles) for name, style in self._found]


class OdsSheet:
    """One table of the spreadsheet.

    Parameters
    ----------
    archive : GuardedZip
        The file.
    index : int
        Which table.
    name : str
        Its name.
    hidden : bool
        True if it is hidden.
    """

    def __init__(self, archive: GuardedZip, index: int, name: str, hidden: bool) -> None:
        self.name: str | None = name
        self.hidden = hidden
        self.facts = SheetFacts()
        self._zip = archive
        self._index = index
        self._merged: list[MergedRange] = []

    def merged(self) -> Sequence[MergedRange]:
        """Return the merged ranges of the rows read so far (rows from 1, columns from 0)."""
        return tuple(self._merged)

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
        self.facts.__init__()  # type: ignore[misc]
        self._merged.clear()
        builder = _RowBuilder(self._index, self.name or "", self.facts, self._merged)
        for _ in _parse(self._zip, builder):
            yield from builder.taken()


@dataclass(slots=True)
class _CellState:
    """What is known of the cell that is being read."""

    attributes: dict[str, str]
    repeat: int
    paragraphs: list[list[str]] = field(default_factory=list)


class _RowBuilder:
    """Builds the rows of one table from the elements of the content."""

    def __init__(self, index: int, sheet: str, facts: SheetFacts, merged: list[MergedRange]) -> None:
        self._wanted = index
        self._table = -1
        self._sheet = sheet
        self._facts = facts
        self._merged = merged
        self._ready: list[NumberedRow] = []
        self._row = 0
        self._repeat = 1
        self._hidden = False
        self._cells: list[Cell] = []
        self._column = 0
        self._cell: _CellState | None = None
        self._skip = 0
        self._in_paragraph = False

    def taken(self) -> list[NumberedRow]:
        """Return the rows that are complete."""
        ready, self._ready = self._ready, []
        return ready

    def start(self, name: str, attributes: dict[str, str]) -> None:
        """Take the start of an element."""
        if name == "table:table":
            self._table += 1
        if self._table != self._wanted:
            return
        if self._skip or name == "office:annotation":
            self._skip += 1
        elif name == "table:table-row":
            self._row += 1
            self._repeat = _count(attributes, "table:number-rows-repeated")
            self._hidden = attributes.get("table:visibility", "visible") != "visible"
            self._cells = []
            self._column = 0
        elif name in ("table:table-cell", "table:covered-table-cell"):
            self._cell = _CellState(attributes, _count(attributes, "table:number-columns-repeated"))
            self._note_merged(attributes)
        elif self._cell is not None:
            self._start_text(name, attributes, self._cell)

    def _start_text(self, name: str, attributes: dict[str, str], cell: _CellState) -> None:
        if name == "text:p":
            cell.paragraphs.append([])
            self._in_paragraph = True
        elif self._in_paragraph and cell.paragraphs:
            if name == "text:s":
                cell.paragraphs[-1].append(" " * min(_count(attributes, "text:c"), 1000))
            elif name in ("text:tab", "text:line-break"):
                cell.paragraphs[-1].append("\t" if name == "text:tab" else "\n")

    def _note_merged(self, attributes: dict[str, str]) -> None:
        across = _count(attributes, "table:number-columns-spanned")
        down = _count(attributes, "table:number-rows-spanned")
        if across > 1 or down > 1:
            self._merged.append((self._row, self._column, self._row + down - 1, self._column + across - 1))

    def text(self, data: str) -> None:
        """Take text."""
        if self._cell is not None and self._in_paragraph and not self._skip and self._cell.paragraphs:
            self._cell.paragraphs[-1].append(data)

    def end(self, name: str) -> None:
        """Take the end of an element."""
        if self._table != self._wanted:
            return
        if self._skip:
            self._skip -= 1
        elif name == "text:p":
            self._in_paragraph = False
        elif name in ("table:table-cell", "table:covered-table-cell") and self._cell is not None:
            self._end_cell(self._cell)
            self._cell = None
        elif name == "table:table-row":
            self._end_row()

    def _end_cell(self, state: _CellState) -> None:
        cell = _value(state)
        if cell is not None:
            last = self._column + state.repeat
            if last > MAX_COLUMNS or self._row > MAX_ROWS:
                raise self._outside(last - 1, self._row)
            self._cells.extend([None] * (self._column - len(self._cells)))
            self._cells.extend([cell] * state.repeat)
            if "table:formula" in state.attributes:
                self._facts.formulas[self._column] += 1
        self._column += state.repeat

    def _end_row(self) -> None:
        if any(cell is not None for cell in self._cells):
            last = self._row + self._repeat - 1
            if last > MAX_ROWS:
                raise self._outside(0, last)
            for number in range(self._row, last + 1):
                if self._hidden:
                    self._facts.hidden_rows.add(number)
                self._ready.append((number, self._cells))
        self._row += self._repeat - 1

    def _outside(self, column: int, row: int) -> FileRefusedError:
        cell = f"{column_letters(column)}{row}"
        return FileRefusedError(
            "cell_outside_limits",
            f"something stands in cell {cell}",
            f"nothing beyond column {LETTERS[-1]} ({MAX_COLUMNS} columns) and row {MAX_ROWS}",
            "Delete what stands far outside the table, or copy the table into a new spreadsheet.",
            sheet=self._sheet,
            row=row,
            cell=cell,
        )


def _count(attributes: dict[str, str], name: str) -> int:
    """Return a count that an attribute states; 1 if it states none."""
    text = attributes.get(name, "1")
    if not (text.isascii() and text.isdigit() and len(text) <= 7):
        raise ValueError(text)
    return max(int(text), 1)


def _value(state: _CellState) -> Cell:  # noqa: PLR0911 - one return for each kind of cell
    """Return the value of a cell."""
    attributes = state.attributes
    shown = "\n".join("".join(pieces) for pieces in state.paragraphs)
    kind = attributes.get("office:value-type")
    formula = "table:formula" in attributes
    if attributes.get("calcext:value-type") == "error" or (formula and _ERROR_TEXT.fullmatch(shown)):
        return OddCell(OddKind.ERROR, shown or "error")
    if kind in ("float", "percentage", "currency"):
        number = float(attributes["office:value"])
        if shown in ("TRUE", "FALSE"):
            return OddCell(OddKind.BOOLEAN, shown)
        if _PADDED.fullmatch(shown) and float(shown) == number:
            return OddCell(OddKind.PADDED, shown, None, number)
        return number
    if kind == "date":
        return iso_date_cell(attributes.get("office:date-value", ""))
    if kind == "time":
        return OddCell(OddKind.DATE, shown or "a time")
    if kind == "boolean":
        return OddCell(OddKind.BOOLEAN, attributes.get("office:boolean-value", "").upper())
    if kind is None and formula and not shown:
        return OddCell(OddKind.NO_VALUE, NO_VALUE_TEXT)
    text = shown or attributes.get("office:string-value", "")
    return text if text and not text.isspace() else None
