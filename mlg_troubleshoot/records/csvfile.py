"""CSV as spreadsheet programs write it: encodings, separators, and rows that do not fit.

What is refused before a packed workbook is parsed: bombs, declared entities, encrypted or broken
archives.
"""

from __future__ import annotations

import codecs
import csv
import io
import itertools
import re
import struct
import zipfile
import zlib
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress

from mlg_troubleshoot.records.cells import (
    COPY_THE_TABLE,
    MAX_COLUMNS,
    MAX_ROWS,
    Cell,
    Cells,
    FileRefusedError,
    NumberedRow,
    Sheet,
    Workbook,
    column_letters,
)

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
    ways = [("utf-8-sig", []), ("cp1252", ["read as Windows-1252 text, because it is not UTF-8"])]
    if data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        ways = [("utf-16", ["read as UTF-16 text"])]
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
        self.delimiter: str = delimiter
        self._budget = _QUOTE_BUDGET

    def rows(self) -> Iterator[NumberedRow]:
        """Split the lines into fields; a quoted field may go on over several lines."""
        text = self._text
        lines = deque(
            (text.replace("\r\n", "\n").replace("\r", "\n") if "\r" in text else text).split("\n")
        )
        delimiter = self.delimiter
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
                self.faulty[number] = FileRefusedError("csv_nul", what, row=number)
            usual = len(fields) or usual
            if "'" in line or '="' in line:
                fields = [_PROTECTED.sub(r"\1\2", field) for field in fields]
            cells: list[Cell] = [
                field if field and not field.isspace() else None for field in fields
            ]
            if not any(cells):
                continue
            if number > MAX_ROWS or (len(cells) > MAX_COLUMNS and any(cells[MAX_COLUMNS:])):
                raise _too_large(f"row {number} has {len(cells)} fields", number)
            yield number, cells

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
            if usual > 2 and lines[more].partition('"')[0].count(self.delimiter) >= usual - 1:
                break
            fields = self._parse(record) if '"' in lines[more] else None
            if fields is not None and usual in (0, len(fields)):
                for _ in range(more + 1):
                    lines.popleft()
                return fields
        # The quotation mark is a stray one: the row is named as faulty and the next line is a row
        # again.
        what = "a quotation mark that is not closed, or stands in the middle of a field"
        self.faulty[number] = FileRefusedError("csv_quote", what, row=number)
        return line.split(self.delimiter)

    def _parse(self, record: str) -> list[str] | None:
        try:
            parsed = list(
                csv.reader(
                    io.StringIO(record, newline=""),
                    delimiter=self.delimiter,
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
    return Workbook("csv", (_CsvSheet(text, delimiter),), notes)


def _find_delimiter(head: str, header_score: Callable[[Cells], int]) -> str:
    """Take the separator under which one of the first rows makes most sense as a header; where
    none does, as in a form, the one that most rows have.
    """
    lines = head.splitlines()[:20]
    scores = dict.fromkeys(_DELIMITERS, 0)
    for each, line in itertools.product(_DELIMITERS, lines):
        if each in line:
            fields = next(csv.reader([line], delimiter=each, skipinitialspace=True), [])
            score = header_score([field or None for field in fields[:MAX_COLUMNS]])
            scores[each] = max(score, scores[each])
    if not any(scores.values()):
        scores = {each: sum(each in line for line in lines) for each in _DELIMITERS}
    return max(scores, key=lambda delimiter: scores[delimiter])


MAX_EXPANDED_BYTES = 200_000_000
MAX_RATIO = 100
MAX_MEMBERS = 5_000
_SMALL_MEMBER_BYTES = 1_000_000
_CHUNK = 1 << 16
_BEFORE_ROOT = re.compile(
    rb"(?:\xef\xbb\xbf|\xff\xfe|\xfe\xff)?(?:\s++|<\?.*?\?>|<!--.*?-->)*+", re.DOTALL
)
# "Strict Open XML", which Excel offers, differs from what openpyxl knows in the names of two
# vocabularies.
_STRICT = (
    (
        b"http://purl.oclc.org/ooxml/spreadsheetml/main",
        b"http://schemas.openxmlformats.org/spreadsheetml/2006/main",
    ),
    (
        b"http://purl.oclc.org/ooxml/officeDocument/relationships",
        b"http://schemas.openxmlformats.org/officeDocument/2006/relationships",
    ),
)
_MAX_STRUCTURE_BYTES = 8_000_000
# A tree is kept until a row or a text is complete, and an empty shell of each until the end of its
# part.
MAX_OPEN_BYTES = 2_000_000
MAX_ITEMS = 1 << 20
# What zipfile, openpyxl, xlrd and the parser of XML raise on damaged bytes: a part or an attribute
# that is missing, a wrong kind of element or value, a place outside the texts or the bytes, XML
# that is not well-formed (a SyntaxError, with lxml or without), a text in no known encoding,
# arithmetic on wrong lengths, unknown compression or encryption, their own checks.
PARSER_ERRORS = (
    ArithmeticError,
    AssertionError,
    AttributeError,
    EOFError,
    LookupError,
    MemoryError,
    NameError,
    OSError,
    RuntimeError,
    SyntaxError,
    TypeError,
    ValueError,
    struct.error,
    zipfile.BadZipFile,
    zlib.error,
)


def damaged(what: str) -> FileRefusedError:
    return FileRefusedError("file_damaged", f"the workbook is cut off or damaged ({what})")


@contextmanager
def damage(what: str) -> Iterator[None]:
    """Turn what a foreign parser raises into a refusal: the one place where that happens."""
    try:
        yield
    except PARSER_ERRORS:
        raise damaged(what) from None


class GuardedZip:
    """A packed workbook, checked before anything in it is parsed.

    parts: by their names, in lower case, with plain slashes.
    """

    def __init__(self, data: bytes) -> None:
        with damage("its list of parts cannot be read"):
            self._zip = zipfile.ZipFile(io.BytesIO(data))
            members = self._zip.infolist()
        if len(members) > MAX_MEMBERS:
            raise too_large(f"{len(members)} parts in one workbook")
        self.parts: dict[str, zipfile.ZipInfo] = {}
        for member in members:
            self.parts.setdefault(member.filename.replace("\\", "/").lstrip("/").lower(), member)
        if any(member.flag_bits & 1 for member in members):
            raise password_protected()
        if sum(member.file_size for member in members) > MAX_EXPANDED_BYTES:
            raise too_large(f"{sum(m.file_size for m in members) / 1e6:.0f} MB when unpacked")
        for member in members:
            if member.file_size > max(_SMALL_MEMBER_BYTES, MAX_RATIO * member.compress_size):
                raise too_large(
                    f"{member.filename} unpacks to"
                    f" {member.file_size / max(member.compress_size, 1):.0f} times its size"
                )
        self._refuse_declarations()

    def _refuse_declarations(self) -> None:
        for name in self.parts:
            # A declaration stands before the first element; UTF-16 is read without its zero bytes.
            head = next(self.chunks(name), b"").replace(b"\0", b"")
            before = _BEFORE_ROOT.match(head)
            rest = head[before.end() if before is not None else 0 :]
            if rest.startswith((b"<!", b"<?")) or (not rest and len(head) >= _CHUNK // 2):
                found = (
                    f"{name} declares a document type or entities, which no spreadsheet program"
                    " writes"
                )
                raise FileRefusedError("xml_declaration", found)

    def _member(self, name: str) -> zipfile.ZipInfo:
        member = self.parts.get(name.lower())
        if member is None:
            raise damaged(f"{name} is missing")
        return member

    def read(self, name: str) -> bytes:
        size = self._member(name).file_size
        if size > _MAX_STRUCTURE_BYTES:
            raise too_large(f"{name} unpacks to {size / 1e6:.0f} MB")
        return b"".join(self.chunks(name))

    def chunks(self, name: str) -> Iterator[bytes]:
        """Unpack a part piece by piece, in the vocabulary that openpyxl knows."""
        member = self._member(name)
        total = 0
        with damage(f"{name} cannot be unpacked"), self._zip.open(member) as part:
            while piece := part.read(_CHUNK):
                for strict, usual in () if total else _STRICT:
                    piece = piece.replace(strict, usual)
                total += len(piece)
                if total > MAX_EXPANDED_BYTES:
                    raise too_large(f"{name} unpacks to more than it claims")
                yield piece


class Stream:
    """A part as a file, refused before the buffer up to the end of a row or a text becomes too
    large.
    """

    def __init__(self, archive: GuardedZip, part: str) -> None:
        self._part = part
        self._chunks = archive.chunks(part)
        self._open = self._items = 0

    def read(self, _size: int = -1) -> bytes:
        piece = next(self._chunks, b"")
        self._open += len(piece)
        if self._open > MAX_OPEN_BYTES:
            raise too_large(
                f"one row or text of {self._part} is longer than {MAX_OPEN_BYTES // 1_000_000} MB"
            )
        return piece

    def end_item(self) -> None:
        self._open = 0
        self._items += 1
        if self._items > MAX_ITEMS:
            raise too_large(f"{self._part} holds more than {MAX_ITEMS} rows or texts")


def too_large(what: str) -> FileRefusedError:
    return FileRefusedError(
        "file_too_large",
        f"the workbook is far too large or packed to look small: {what}",
        f"at most {MAX_EXPANDED_BYTES // 1_000_000} MB unpacked and {MAX_RATIO} times the packed"
        " size",
        COPY_THE_TABLE,
    )


def password_protected() -> FileRefusedError:
    return FileRefusedError("password_protected", "the file is password protected")


def outside_limits(sheet: str | None, column: int, row: int) -> FileRefusedError:
    """Return the refusal of a sheet with something in a cell (its column counted from 0) that no
    table reaches.
    """
    cell = f"{column_letters(column)}{row}"
    return FileRefusedError(
        "cell_outside_limits",
        f"something stands in cell {cell}",
        f"nothing beyond column {column_letters(MAX_COLUMNS - 1)} ({MAX_COLUMNS} columns) and row"
        f" {MAX_ROWS}",
        "Delete the cells far outside the table, or copy the table into a new workbook.",
        sheet=sheet,
        row=row,
        cell=cell,
    )
