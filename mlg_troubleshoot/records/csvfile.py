"""CSV as spreadsheet programs write it: encodings, separators, and rows that do not fit."""

from __future__ import annotations

import codecs
import csv
import io
import re
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import suppress

from mlg_troubleshoot.records.cells import MAX_COLUMNS, MAX_ROWS, Cell, Cells
from mlg_troubleshoot.records.source import FileRefusedError, NumberedRow, Sheet, Workbook

# A quoted field may be as long as a line; the module's own limit would make it a fault.
csv.field_size_limit(1_000_000)
_DELIMITERS = (",", ";", "\t", "|")
_SEP_LINE = re.compile(r'\s*"?sep=(.)"?\s*(?:\r\n|\r|\n)', re.IGNORECASE)
# What keeps a spreadsheet program from taking a text for a number.
_PROTECTED = re.compile(r"""\A\s*(?:="([^"]*)"|'(?=\w)([^']*))\s*\Z""")
_CONTROL = re.compile(r"[\x01-\x08\x0b\x0e-\x1f]")
_MAX_FIELD_LINES = 50
_MAX_BYTES = 25_000_000
_MAX_LINES = 500_000
_MAX_LINE_CHARACTERS = 1_000_000
_MAX_FIELDS = 20_000
# How many characters may be joined in the search for the ends of quoted fields before every open
# quote is a stray one.
_QUOTE_BUDGET = 20_000_000


def decode(data: bytes) -> tuple[str, list[str]]:
    """Decode a text file: UTF-8, UTF-16 or Windows-1252."""
    head = data[:4096]
    ways = [("utf-8-sig", []), ("cp1252", ["read as Windows-1252 text, because it is not UTF-8"])]
    if data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        ways = [("utf-16", ["read as UTF-16 text"])]
    elif len(data) >= 4:
        even = head[0::2].count(0)
        odd = head[1::2].count(0)
        for order, own, other in (("little", odd, even), ("big", even, odd)):
            if own > len(head) * 0.3 and other < len(head) * 0.05:
                note = f"read as UTF-16 text ({order}-endian, without a byte order mark)"
                ways = [(f"utf-16-{order[0]}e", [note])]
    for encoding, notes in ways:
        with suppress(UnicodeDecodeError):
            return data.decode(encoding), notes
    raise not_text()


def _too_large(what: str, row: int | None = None) -> FileRefusedError:
    limits = (
        f"at most {_MAX_BYTES // 1_000_000} MB, {MAX_ROWS} rows, {MAX_COLUMNS} columns and"
        f" {_MAX_LINE_CHARACTERS} characters per line"
    )
    return FileRefusedError("file_too_large", what, limits, row=row)


def not_text() -> FileRefusedError:
    return FileRefusedError("not_a_table", "the file is neither text nor a spreadsheet")


class _CsvSheet(Sheet):
    def __init__(self, text: str, delimiter: str) -> None:
        super().__init__()
        self._text = text
        self._delimiter = delimiter
        self._budget = _QUOTE_BUDGET

    def rows(self) -> Iterator[NumberedRow]:
        for number, fields in enumerate(self._records(), 1):
            cells: list[Cell] = [
                field if field and not field.isspace() else None for field in fields
            ]
            if not any(cells):
                continue
            if number > MAX_ROWS or (len(cells) > MAX_COLUMNS and any(cells[MAX_COLUMNS:])):
                raise _too_large(f"row {number} has {len(cells)} fields", number)
            yield number, cells

    def _records(self) -> Iterator[list[str]]:
        """Split the lines into fields; a quoted field may go on over several lines."""
        text = self._text
        lines = deque(
            (text.replace("\r\n", "\n").replace("\r", "\n") if "\r" in text else text).split("\n")
        )
        delimiter = self._delimiter
        usual = 0
        number = 0
        while lines:
            line = lines.popleft()
            number += 1
            if len(line) > _MAX_LINE_CHARACTERS or line.count(delimiter) > _MAX_FIELDS:
                raise _too_large(
                    f"line {number} has {len(line)} characters and {line.count(delimiter)}"
                    " separators"
                )
            if '"' not in line:
                fields = line.split(delimiter) if line else []
            else:
                fields = self._quoted(line, lines, usual, number)
            if "\0" in line:
                what = "a zero character: the file is damaged there"
                self.facts.faulty[number] = FileRefusedError("csv_nul", what, row=number)
            usual = len(fields) or usual
            if "'" in line or '="' in line:
                fields = [_PROTECTED.sub(r"\1\2", field) for field in fields]
            yield fields

    def _quoted(self, line: str, lines: deque[str], usual: int, number: int) -> list[str]:
        fields = self._parse(line)
        if fields is not None:
            return fields
        record = line
        for more in range(min(_MAX_FIELD_LINES, len(lines))):
            record += "\n" + lines[more]
            self._budget -= len(record)
            if self._budget < 0 or len(record) > _MAX_LINE_CHARACTERS:
                break
            # A line inside the quotation marks with as many separators as a row is a row that they
            # would swallow.
            if usual > 2 and lines[more].partition('"')[0].count(self._delimiter) >= usual - 1:
                break
            fields = self._parse(record) if '"' in lines[more] else None
            if fields is not None and usual in (0, len(fields)):
                for _ in range(more + 1):
                    lines.popleft()
                return fields
        # The quotation mark is a stray one: the row is named as faulty and the next line is a row
        # again.
        what = "a quotation mark that is not closed, or stands in the middle of a field"
        self.facts.faulty[number] = FileRefusedError("csv_quote", what, row=number)
        return line.split(self._delimiter)

    def _parse(self, record: str) -> list[str] | None:
        try:
            parsed = list(
                csv.reader(
                    io.StringIO(record, newline=""),
                    delimiter=self._delimiter,
                    skipinitialspace=True,
                    strict=True,
                )
            )
        except csv.Error:
            return None
        return parsed[0] if len(parsed) == 1 else None


def csv_book(data: bytes, header_score: Callable[[Cells], int]) -> Workbook:
    if len(data) > _MAX_BYTES:
        raise _too_large(f"a text of {len(data) / 1e6:.0f} MB")
    lines = data.count(b"\n") or data.count(b"\r")
    if lines > _MAX_LINES:
        raise _too_large(f"{lines} lines")
    text, notes = decode(data)
    head = text[:65536]
    strange = len(_CONTROL.findall(head)) + head.count("\0")
    if strange > 20 and strange > len(head) * 0.02:
        raise not_text()
    match = _SEP_LINE.match(text)
    if match is None:
        delimiter = _find_delimiter(head, header_score)
    else:
        delimiter = match[1]
        text = text[match.end() :]
        notes.append(
            f"the first line names the separator {delimiter!r} and is not counted as a row"
        )
    return Workbook("csv", (_CsvSheet(text, delimiter),), notes, delimiter)


def _find_delimiter(head: str, header_score: Callable[[Cells], int]) -> str:
    """Take the separator under which one of the first rows makes most sense as a header."""
    lines = head.splitlines()[:20]

    def best_score(delimiter: str) -> int:
        rows = (
            next(csv.reader([line], delimiter=delimiter, skipinitialspace=True), [])
            for line in lines
            if delimiter in line
        )
        return max(
            (header_score([f or None for f in fields[:MAX_COLUMNS]]) for fields in rows), default=0
        )

    return max(_DELIMITERS, key=best_score)
