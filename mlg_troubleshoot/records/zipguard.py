"""What is refused before a packed workbook is parsed: bombs, declared entities, encrypted or broken
archives.
"""

from __future__ import annotations

import io
import re
import struct
import zipfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager

from mlg_troubleshoot.records.cells import LETTERS, MAX_COLUMNS, MAX_ROWS, column_letters
from mlg_troubleshoot.records.source import COPY_THE_TABLE, FileRefusedError

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
    """A packed workbook, checked before anything in it is parsed."""

    def __init__(self, data: bytes) -> None:
        with damage("its list of parts cannot be read"):
            self._zip = zipfile.ZipFile(io.BytesIO(data))
            members = self._zip.infolist()
        if len(members) > MAX_MEMBERS:
            raise too_large(f"{len(members)} parts in one workbook")
        self._members: dict[str, zipfile.ZipInfo] = {}
        for member in members:
            self._members.setdefault(member.filename.replace("\\", "/").lstrip("/").lower(), member)
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
        for name in self._members:
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

    @property
    def names(self) -> frozenset[str]:
        """Names of the parts, in lower case, with plain slashes."""
        return frozenset(self._members)

    def _member(self, name: str) -> zipfile.ZipInfo:
        member = self._members.get(name.lower())
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
        f"nothing beyond column {LETTERS[-1]} ({MAX_COLUMNS} columns) and row {MAX_ROWS}",
        "Delete the cells far outside the table, or copy the table into a new workbook.",
        sheet=sheet,
        row=row,
        cell=cell,
    )
