"""Old Excel workbooks (.xls): values by python-calamine, and what it hides by a scan of the records.

The compiled reader turns error values into blanks and may die on a damaged file, so it runs in a process of
its own with a time limit, and the errors, formulas and hidden rows are looked up in the file itself.
"""

from __future__ import annotations

import json
import struct
import subprocess
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

from mlg_troubleshoot.records.cells import LETTERS, MAX_COLUMNS, MAX_ROWS, Cell, OddCell, OddKind, column_letters
from mlg_troubleshoot.records.model import FileRefusedError
from mlg_troubleshoot.records.ole import OleFile
from mlg_troubleshoot.records.source import MergedRange, NumberedRow, SheetFacts
from mlg_troubleshoot.records.zipguard import damaged

_TIME_LIMIT_S = 60.0
_ERRORS = {0x00: "#NULL!", 0x07: "#DIV/0!", 0x0F: "#VALUE!", 0x17: "#REF!", 0x1D: "#NAME?", 0x24: "#NUM!", 0x2A: "#N/A"}
_BOF, _EOF, _FILEPASS, _BOUNDSHEET = 0x0809, 0x000A, 0x002F, 0x0085
_FORMULA, _BOOLERR, _ROW = 0x0006, 0x0205, 0x0208
# The reader runs in its own process: nothing but the standard library and calamine is loaded there.
_CHILD = """
import io, json, sys, datetime
try:
    import resource
    resource.setrlimit(resource.RLIMIT_AS, (1500000000, 1500000000))
except (ImportError, ValueError, OSError):
    pass
import python_calamine
def plain(v):
    if v is None or v == "":
        return None
    if isinstance(v, bool):
        return {"b": v}
    if isinstance(v, (int, float)):
        return float(v)
    if isinstance(v, str):
        return v
    if isinstance(v, datetime.date):
        return {"d": v.isoformat()[:10]}
    return {"t": str(v)}
book = python_calamine.CalamineWorkbook.from_filelike(io.BytesIO(sys.stdin.buffer.read()))
out = []
for meta in book.sheets_metadata:
    if meta.typ != python_calamine.SheetTypeEnum.WorkSheet:
        continue
    sheet = book.get_sheet_by_name(meta.name)
    rows = sheet.to_python(skip_empty_area=False)
    merged = [(a[0] + 1, a[1], b[0] + 1, b[1]) for a, b in (sheet.merged_cell_ranges or [])]
    out.append([meta.name, meta.visible != python_calamine.SheetVisibleEnum.Visible,
                [[i, [plain(v) for v in r]] for i, r in enumerate(rows, 1) if any(v != "" for v in r)], merged])
sys.stdout.write(json.dumps(out))
"""


@dataclass(slots=True)
class _Hidden:
    """What the values do not tell about one sheet."""

    errors: dict[tuple[int, int], str] = field(default_factory=dict)
    formulas: dict[int, int] = field(default_factory=dict)
    rows: set[int] = field(default_factory=set)
    last_row: int = 0
    last_column: int = 0


class XlsFile:
    """An old Excel workbook.

    Parameters
    ----------
    data : bytes
        The file.

    Raises
    ------
    FileRefusedError
        If it is damaged, password protected or something else.
    """

    kind = "xls"
    delimiter: str | None = None

    def __init__(self, data: bytes) -> None:
        ole = OleFile(data)
        self.notes: list[str] = []
        if "encryptedpackage" in ole.streams:
            raise _password()
        name = next((n for n in ("workbook", "book") if n in ole.streams), None)
        if name is None:
            raise FileRefusedError(
                "file_kind",
                "an old Office file that is no workbook",
                "an .xlsx workbook or a CSV file",
                "Save the table as .xlsx or as CSV (UTF-8) and read that.",
            )
        if "_vba_project" in ole.streams:
            self.notes.append("the workbook holds macros: they are ignored, the values are read")
        hidden = _scan(ole.stream(name))
        self.sheets = tuple(
            XlsSheet(sheet, is_hidden, rows, merged, hidden.get(sheet, _Hidden()))
            for sheet, is_hidden, rows, merged in _values(data)
        )


def _password() -> FileRefusedError:
    return FileRefusedError(
        "password_protected",
        "the file is password protected",
        "a workbook without a password",
        "Save a copy without the password and read the copy.",
    )


def _records(stream: bytes, at: int) -> Iterator[tuple[int, bytes]]:
    while at + 4 <= len(stream):
        kind, size = struct.unpack_from("<HH", stream, at)
        yield kind, stream[at + 4 : at + 4 + size]
        at += 4 + size


def _scan(stream: bytes) -> dict[str, _Hidden]:
    """Look up errors, formulas, hidden rows and the extent of each sheet in the records of the file."""
    starts: dict[str, int] = {}
    try:
        for kind, body in _records(stream, 0):
            if kind == _FILEPASS:
                raise _password()
            if kind == _BOUNDSHEET:
                (start,) = struct.unpack_from("<I", body)
                wide = body[7] & 1
                text = body[8 : 8 + body[6] * (2 if wide else 1)]
                starts[text.decode("utf-16-le" if wide else "latin-1")] = start
            elif kind == _EOF:
                break
        return {name: _scan_sheet(stream, start) for name, start in starts.items()}
    except (struct.error, IndexError, UnicodeDecodeError):
        raise damaged("its records are incomplete") from None


def _scan_sheet(stream: bytes, start: int) -> _Hidden:
    found = _Hidden()
    depth = 0
    for kind, body in _records(stream, start):
        if kind == _BOF:
            depth += 1
        elif kind == _EOF:
            depth -= 1
            if depth <= 0:
                break
        elif kind == _ROW and body[12] & 0x20:
            found.rows.add(struct.unpack_from("<H", body)[0] + 1)
        elif kind in (_BOOLERR, _FORMULA):
            row, column = struct.unpack_from("<HH", body)
            if kind == _BOOLERR:
                error = body[6] if body[7] else None
            else:
                found.formulas[column] = found.formulas.get(column, 0) + 1
                error = body[8] if body[6] == 2 and body[12:14] == b"\xff\xff" else None
            if error is not None:
                found.errors[row + 1, column] = _ERRORS.get(error, "#ERROR!")
        if kind in (0x0203, 0x027E, 0x00FD, 0x0204, _BOOLERR, _FORMULA):
            row, column = struct.unpack_from("<HH", body)
            found.last_row = max(found.last_row, row + 1)
            found.last_column = max(found.last_column, column)
    return found


def _values(data: bytes) -> list[tuple[str, bool, list[NumberedRow], list[MergedRange]]]:
    try:
        done = subprocess.run(
            [sys.executable, "-c", _CHILD], input=data, capture_output=True, timeout=_TIME_LIMIT_S, check=False
        )
    except subprocess.TimeoutExpired:
        raise damaged(f"it took more than {_TIME_LIMIT_S:.0f} seconds to read") from None
    if done.returncode != 0:
        raise damaged("its values cannot be read")
    sheets: list[tuple[str, bool, list[NumberedRow], list[MergedRange]]] = []
    for name, hidden, rows, merged in json.loads(done.stdout):
        cells: list[NumberedRow] = [(int(number), [_cell(v) for v in row]) for number, row in rows]
        sheets.append((name, bool(hidden), cells, [(a, b, c, d) for a, b, c, d in merged]))
    return sheets


def _cell(value: str | float | dict[str, str | bool] | None) -> Cell:
    if isinstance(value, dict):
        if "b" in value:
            return OddCell(OddKind.BOOLEAN, "TRUE" if value["b"] else "FALSE")
        if "d" in value:
            from datetime import date

            day = date.fromisoformat(str(value["d"]))
            return OddCell(OddKind.DATE, day.isoformat(), day)
        return OddCell(OddKind.DATE, str(value["t"]))
    if isinstance(value, str) and value.isspace():
        return None
    return value


class XlsSheet:
    """One worksheet.

    Parameters
    ----------
    name : str
        Its name.
    hidden : bool
        True if it is hidden.
    rows : list of tuple
        Its rows with their numbers.
    merged : list of tuple
        Its merged ranges.
    unseen : _Hidden
        What the values do not tell.
    """

    def __init__(
        self, name: str, hidden: bool, rows: list[NumberedRow], merged: list[MergedRange], unseen: _Hidden
    ) -> None:
        self.name: str | None = name
        self.hidden = hidden
        self.facts = SheetFacts()
        self._rows = rows
        self._merged = merged
        self._unseen = unseen

    def merged(self) -> Sequence[MergedRange]:
        """Return merged ranges as first row, first column, last row, last column (rows from 1, columns from 0)."""
        return self._merged

    def rows(self) -> Iterator[NumberedRow]:
        """Read the rows that are not blank, with their numbers counted from 1.

        Yields
        ------
        tuple
            Number and cells of the next row.

        Raises
        ------
        FileRefusedError
            If a cell stands outside the allowed range.
        """
        unseen = self._unseen
        if unseen.last_row > MAX_ROWS or unseen.last_column >= MAX_COLUMNS:
            cell = f"{column_letters(unseen.last_column)}{unseen.last_row}"
            raise FileRefusedError(
                "cell_outside_limits",
                f"the table reaches to cell {cell}",
                f"nothing beyond column {LETTERS[-1]} ({MAX_COLUMNS} columns) and row {MAX_ROWS}",
                "Delete what stands far outside the table, or copy the table into a new workbook.",
                sheet=self.name,
                cell=cell,
            )
        self.facts.formulas.update(unseen.formulas)
        errors: dict[int, list[tuple[int, str]]] = {}
        for (row, column), text in unseen.errors.items():
            errors.setdefault(row, []).append((column, text))
        present = {number for number, _ in self._rows}
        extra: list[NumberedRow] = [(number, []) for number in errors if number not in present]
        for number, cells in sorted([*self._rows, *extra], key=lambda row: row[0]):
            filled = list(cells)
            for column, text in errors.get(number, ()):
                filled.extend([None] * (column + 1 - len(filled)))
                filled[column] = OddCell(OddKind.ERROR, text)
            if number in unseen.rows:
                self.facts.hidden_rows.add(number)
            yield number, filled
