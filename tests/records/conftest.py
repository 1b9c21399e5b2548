"""Tables made as the world makes them: CSV bytes, openpyxl workbooks and hand-built packages."""

from __future__ import annotations

import io
import zipfile
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import openpyxl
import pytest

from mlg_troubleshoot.gear.gear_file import load_gear
from mlg_troubleshoot.records import ReadOptions, ReadResult
from mlg_troubleshoot.records.headers import Joints
from mlg_troubleshoot.units import ClearanceConvention, LengthUnit
from tests.records.reading import GOOD, HEADER, read_inspections

_MAIN = "http://schemas.openxmlformats.org/spreadsheetml/2006/main"
_REL = "http://schemas.openxmlformats.org/officeDocument/2006/relationships"
_PACKAGE = "http://schemas.openxmlformats.org/package/2006/"


@pytest.fixture
def read() -> Callable[..., ReadResult]:
    """Read bytes or text as a file of a given name."""

    def run(data: bytes | str, name: str = "t.csv", **options: Any) -> ReadResult:
        for key, kind in (("unit", LengthUnit), ("convention", ClearanceConvention)):
            if isinstance(options.get(key), str):
                options[key] = kind(options[key])
        raw = data.encode() if isinstance(data, str) else data
        known = {"joints": Joints.of(load_gear()), **options}
        return read_inspections(io.BytesIO(raw), ReadOptions(**known), name=name)

    return run


@pytest.fixture
def table() -> Callable[..., str]:
    """Write one good row, or one with some cells replaced, as CSV with canonical headers."""

    def run(
        header: Sequence[str] = HEADER, rows: Sequence[Sequence[object]] = (GOOD,), sep: str = ","
    ) -> str:
        lines = [
            sep.join(header),
            *(sep.join("" if c is None else str(c) for c in row) for row in rows),
        ]
        return "\n".join(lines) + "\n"

    return run


@pytest.fixture
def xlsx() -> Callable[..., bytes]:
    """Write rows with openpyxl; a callable may change the workbook before it is saved."""

    def run(
        rows: Sequence[Sequence[object]] = (HEADER, GOOD),
        change: Callable[[openpyxl.Workbook], object] | None = None,
        title: str = "Inspections",
    ) -> bytes:
        book = openpyxl.Workbook()
        sheet = book.worksheets[0]
        sheet.title = title
        for row in rows:
            sheet.append(list(row))
        if change is not None:
            change(book)
        buffer = io.BytesIO()
        book.save(buffer)
        return buffer.getvalue()

    return run


def cell_xml(reference: str, value: object) -> str:
    """Write one cell as Excel does: text inline, numbers plain."""
    if isinstance(value, str):
        return f'<c r="{reference}" t="inlineStr"><is><t>{value}</t></is></c>'
    return f'<c r="{reference}"><v>{value}</v></c>'


def rows_xml(rows: Sequence[Sequence[object]]) -> str:
    """Write rows as the content of sheetData."""
    return "".join(
        f'<row r="{n}">'
        + "".join(cell_xml(f"{chr(65 + i)}{n}", v) for i, v in enumerate(row) if v is not None)
        + "</row>"
        for n, row in enumerate(rows, 1)
    )


@pytest.fixture
def package() -> Callable[..., bytes]:
    """Build a workbook by hand from the XML of one sheet."""

    def run(
        sheet_data: str | None = None,
        *,
        before: str = "",
        after: str = "",
        prolog: str = '<?xml version="1.0" encoding="UTF-8" standalone="yes"?>',
        book_pr: str = "",
        styles: str | None = None,
        strings: str | None = None,
        parts: Mapping[str, bytes | str] | None = None,
        sheet_xml: str | bytes | None = None,
        compression: int = zipfile.ZIP_DEFLATED,
    ) -> bytes:
        data = rows_xml([HEADER, GOOD]) if sheet_data is None else sheet_data
        sheet: str | bytes = sheet_xml or (
            f"{prolog}<worksheet"
            f' xmlns="{_MAIN}">{before}<sheetData>{data}</sheetData>{after}</worksheet>'
        )
        relations = (
            f'<Relationship Id="rId1" Type="{_REL}/worksheet" Target="worksheets/sheet1.xml"/>'
        )
        if styles is not None:
            relations += f'<Relationship Id="rId2" Type="{_REL}/styles" Target="styles.xml"/>'
        if strings is not None:
            relations += (
                f'<Relationship Id="rId3" Type="{_REL}/sharedStrings"'
                ' Target="/xl/sharedStrings.xml"/>'
            )
        content: dict[str, bytes | str] = {
            "[Content_Types].xml": (
                f'<Types xmlns="{_PACKAGE}content-types"><Override PartName="/xl/workbook.xml" '
                'ContentType="application/vnd.openxmlformats-officedocument.spreadsheetml.sheet.main+xml"/></Types>'
            ),
            "_rels/.rels": (
                f'<Relationships xmlns="{_PACKAGE}relationships"><Relationship Id="rId1" '
                f'Type="{_REL}/officeDocument" Target="xl/workbook.xml"/></Relationships>'
            ),
            "xl/workbook.xml": (
                f'<workbook xmlns="{_MAIN}" xmlns:r="{_REL}">{book_pr}<sheets>'
                '<sheet name="Inspections" sheetId="1" r:id="rId1"/></sheets></workbook>'
            ),
            "xl/_rels/workbook.xml.rels": (
                f'<Relationships xmlns="{_PACKAGE}relationships">{relations}</Relationships>'
            ),
            "xl/worksheets/sheet1.xml": sheet,
        }
        if styles is not None:
            content["xl/styles.xml"] = styles
        if strings is not None:
            content["xl/sharedStrings.xml"] = strings
        content.update(parts or {})
        buffer = io.BytesIO()
        with zipfile.ZipFile(buffer, "w", compression) as archive:
            for part, text in content.items():
                archive.writestr(part, text)
        return buffer.getvalue()

    return run


@pytest.fixture
def samples() -> Path:
    """Return the folder of files that LibreOffice wrote."""
    return Path(__file__).parent / "samples"
