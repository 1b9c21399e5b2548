"""Old Excel workbooks (.xls), read by xlrd behind a guard.

Python-calamine, ten times faster, gives an error value as a blank cell, which would be "not
measured", and ends the process on some damaged files. Xlrd does not tell which values are results
of formulas.
"""

from __future__ import annotations

import io
from collections.abc import Iterator, Sequence
from functools import lru_cache

import xlrd

from mlg_troubleshoot.records.cells import (
    COPY_THE_TABLE,
    MACROS,
    MAX_COLUMNS,
    MAX_ROWS,
    Cell,
    FileRefusedError,
    MergedRange,
    NumberedRow,
    NumberFormat,
    OddCell,
    OddKind,
    Sheet,
    Workbook,
    date_cell,
)
from mlg_troubleshoot.records.csvfile import damage, damaged, outside_limits, password_protected

MAX_BYTES = 20_000_000
_UTF16 = "utf-16-le"


def xls_book(data: bytes) -> Workbook:
    if "EncryptedPackage".encode(_UTF16) in data:
        raise password_protected()
    if len(data) > MAX_BYTES:
        found = f"an .xls workbook of {len(data) / 1e6:.0f} MB"
        expected = f"at most {MAX_BYTES // 1_000_000} MB"
        raise FileRefusedError("file_too_large", found, expected, COPY_THE_TABLE)
    return Workbook("xls", _sheets(data), [MACROS] if "_VBA_PROJECT".encode(_UTF16) in data else [])


def _sheets(data: bytes) -> list[_XlsSheet]:
    try:
        with damage("its records are incomplete"):
            log = io.StringIO()
            book = xlrd.open_workbook(file_contents=data, formatting_info=True, logfile=log)
    except xlrd.XLRDError as error:
        if "encrypted" in str(error).lower():
            raise password_protected() from None
        if "find workbook" in str(error).lower():
            raise FileRefusedError(
                "file_kind", "an old Office file that is not a workbook"
            ) from None
        raise damaged("its records cannot be read") from None
    except xlrd.compdoc.CompDocError:
        raise damaged("its records are incomplete") from None
    return [_XlsSheet(book, sheet) for sheet in book.sheets()]


class _XlsSheet(Sheet):
    def __init__(self, book: xlrd.Book, sheet: xlrd.sheet.Sheet) -> None:
        super().__init__(sheet.name, hidden=bool(sheet.visibility))
        self._book = book
        self._sheet = sheet
        self._epoch_1904 = bool(book.datemode)

    @property
    def merged(self) -> Sequence[MergedRange]:
        return [
            (top + 1, left, bottom, right - 1)
            for top, bottom, left, right in self._sheet.merged_cells
        ]

    def rows(self) -> Iterator[NumberedRow]:
        sheet = self._sheet
        for place in range(sheet.nrows):
            cells = [self._cell(place, column) for column in range(sheet.row_len(place))]
            while cells and cells[-1] is None:
                cells.pop()
            if not cells:
                continue
            if place >= MAX_ROWS or len(cells) > MAX_COLUMNS:
                raise outside_limits(self.name, len(cells) - 1, place + 1)
            info = sheet.rowinfo_map.get(place)
            if info is not None and info.hidden:
                self.hidden_rows.add(place + 1)
            yield place + 1, cells

    def _cell(self, row: int, column: int) -> Cell:
        kind = self._sheet.cell_type(row, column)
        value = self._sheet.cell_value(row, column)
        if kind in (xlrd.XL_CELL_EMPTY, xlrd.XL_CELL_BLANK):
            return None
        if kind == xlrd.XL_CELL_TEXT:
            return value if value and not value.isspace() else None
        if kind == xlrd.XL_CELL_ERROR:
            return OddCell(OddKind.ERROR, xlrd.error_text_from_code.get(value, "#ERROR!"))
        if kind == xlrd.XL_CELL_BOOLEAN:
            return OddCell(OddKind.BOOLEAN, "TRUE" if value else "FALSE")
        number = float(value)
        if kind == xlrd.XL_CELL_DATE:
            return date_cell(number, epoch_1904=self._epoch_1904)
        shown = self._format(row, column)
        return number if shown is None else shown.cell(number, epoch_1904=self._epoch_1904)

    def _format(self, row: int, column: int) -> NumberFormat | None:
        index = self._sheet.cell_xf_index(row, column)
        if index is None or index >= len(self._book.xf_list):
            return None
        known = self._book.format_map.get(self._book.xf_list[index].format_key)
        return None if known is None else _read_format(known.format_str)


_read_format = lru_cache(1000)(NumberFormat.of)
