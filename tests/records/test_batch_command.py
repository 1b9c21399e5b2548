"""``mlg check`` on batches: nothing lost, every bad cell named, and every form of output agrees."""

from __future__ import annotations

import csv
import io
import json
import random
import zipfile
from collections import Counter
from dataclasses import dataclass, field

import openpyxl
import pytest

from mlg_troubleshoot.records.cells import LETTERS
from tests.cli.conftest import mlg

COLUMNS = (
    *("record_id", "tail_no", "side", "clearance_convention"),
    *(f"clearance_{n}_in" for n in range(1, 11)),
    *("inspection_date", "gear_landings", "temperature_c", "margin_in", "plunger_displacement_in", "outcome", "remarks"),
)
ROWS = 2000
SHARE = 0.03
# What people leave in a cell, by column; a row with a bad cell of the second group can still be judged.
SPOILING = {
    "tail_no": (None, "#N/A"),
    "side": ("left", None, "XX", 5, "#REF!"),
    "clearance_convention": ("CLEAR", None, 3),
    "clearance": (-0.001, 0.33, 9, "0,013", "n/a", "1/8", "0.3 mm", "−0.002", "nan", "-", "?", "#DIV/0!"),
    "margin_in": (-0.03, "x", 0.7),
}
HARMLESS = {
    "inspection_date": ("03/04/2026", 46085, "soon"),
    "gear_landings": (-5, "many"),
    "temperature_c": (200, "warm"),
    "outcome": ("MAYBE", 1),
}


@dataclass
class Fleet:
    """A table with known bad cells."""

    rows: list[list[object]]
    bad: dict[str, object] = field(default_factory=dict)
    spoilt: set[int] = field(default_factory=set)


def kind_of(column: str) -> str:
    return "clearance" if column.startswith("clearance_") and column != "clearance_convention" else column


def make_fleet(seed: int) -> Fleet:
    """Draw 2,000 sound rows and spoil 3 % of the cells that can be bad."""
    rng = random.Random(seed)
    fleet = Fleet([list(COLUMNS)])
    for n in range(ROWS):
        row: list[object] = [f"R{n:05d}", f"{n % 200:03d}", rng.choice(("LH", "RH")), "TOTAL_PLAY"]
        row += [None if rng.random() < 0.05 else round(rng.uniform(0.0, 0.012), 4) for _ in range(10)]
        row += ["2026-03-04", n, 18.5, 0.03, round(rng.uniform(-0.02, 0.04), 4), rng.choice(("FAILED", None)), "ok, 1/8 turn"]
        row[6] = 0.004
        for index, column in enumerate(COLUMNS):
            choices = SPOILING.get(kind_of(column)) or HARMLESS.get(kind_of(column))
            if choices and rng.random() < SHARE:
                row[index] = rng.choice(choices)
                fleet.bad[f"{LETTERS[index]}{n + 2}"] = row[index]
                if kind_of(column) in SPOILING:
                    fleet.spoilt.add(n + 2)
        fleet.rows.append(row)
    return fleet


def by_openpyxl(fleet: Fleet) -> bytes:
    """Write the fleet with openpyxl, error values as errors."""
    book = openpyxl.Workbook()
    sheet = book.worksheets[0]
    sheet.title = "Inspections"
    for row in fleet.rows:
        sheet.append(row)
    buffer = io.BytesIO()
    book.save(buffer)
    return buffer.getvalue()


MAIN = "http://schemas.openxmlformats.org/spreadsheetml/2006/main"
OFFICE = "http://schemas.openxmlformats.org/officeDocument/2006/relationships"
PACKAGE = "http://schemas.openxmlformats.org/package/2006"
WORKBOOK_TYPE = "application/vnd.openxmlformats-officedocument.spreadsheetml"


def by_hand(fleet: Fleet) -> bytes:
    """Write the fleet as the XML that Excel writes: shared strings, error cells, blank cells with a style."""
    strings: dict[str, int] = {}
    lines = []
    for number, row in enumerate(fleet.rows, 1):
        cells = []
        for index, value in enumerate(row):
            place = f'r="{LETTERS[index]}{number}"'
            if value is None:
                cells.append(f'<c {place} s="0"/>')
            elif not isinstance(value, str):
                cells.append(f"<c {place}><v>{value}</v></c>")
            elif value.startswith("#"):
                cells.append(f'<c {place} t="e"><v>{value}</v></c>')
            else:
                cells.append(f'<c {place} t="s"><v>{strings.setdefault(value, len(strings))}</v></c>')
        lines.append(f'<row r="{number}" spans="1:{len(row)}">{"".join(cells)}</row>')
    parts = {
        "[Content_Types].xml": f'<Types xmlns="{PACKAGE}/content-types">'
        '<Default Extension="rels" ContentType="application/vnd.openxmlformats-package.relationships+xml"/>'
        '<Default Extension="xml" ContentType="application/xml"/>'
        f'<Override PartName="/xl/workbook.xml" ContentType="{WORKBOOK_TYPE}.sheet.main+xml"/>'
        f'<Override PartName="/xl/worksheets/sheet1.xml" ContentType="{WORKBOOK_TYPE}.worksheet+xml"/>'
        f'<Override PartName="/xl/sharedStrings.xml" ContentType="{WORKBOOK_TYPE}.sharedStrings+xml"/></Types>',
        "_rels/.rels": f'<Relationships xmlns="{PACKAGE}/relationships"><Relationship Id="rId1" '
        f'Type="{OFFICE}/officeDocument" Target="xl/workbook.xml"/></Relationships>',
        "xl/workbook.xml": f'<workbook xmlns="{MAIN}" xmlns:r="{OFFICE}"><sheets>'
        '<sheet name="Inspections" sheetId="1" r:id="rId1"/></sheets></workbook>',
        "xl/_rels/workbook.xml.rels": f'<Relationships xmlns="{PACKAGE}/relationships">'
        f'<Relationship Id="rId1" Type="{OFFICE}/worksheet" Target="worksheets/sheet1.xml"/>'
        f'<Relationship Id="rId2" Type="{OFFICE}/sharedStrings" Target="sharedStrings.xml"/></Relationships>',
        "xl/worksheets/sheet1.xml": f'<worksheet xmlns="{MAIN}"><sheetData>{"".join(lines)}</sheetData></worksheet>',
        "xl/sharedStrings.xml": f'<sst xmlns="{MAIN}">'
        + "".join(f"<si><t>{text}</t></si>" for text in strings)
        + "</sst>",
    }
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, text in parts.items():
            archive.writestr(name, text)
    return buffer.getvalue()


WRITERS = {"openpyxl": by_openpyxl, "XML by hand": by_hand}


@pytest.fixture(scope="module", params=WRITERS)
def checked(request, tmp_path_factory):
    """Check a workbook of 2,000 rows, 3 % of its cells bad, through the command."""
    fleet = make_fleet(seed=5)
    path = tmp_path_factory.mktemp("fleet") / "fleet.xlsx"
    path.write_bytes(WRITERS[request.param](fleet))
    return fleet, mlg("check", path, "--json").json


def test_every_bad_cell_is_named_and_no_good_one(checked):
    fleet, found = checked
    assert Counter(p["cell"] for p in found["problems"]) == Counter(list(fleet.bad))


def test_every_bad_cell_is_named_with_its_sheet_and_row_and_a_remedy(checked):
    _, found = checked
    for problem in found["problems"]:
        assert problem["sheet"] == "Inspections"
        assert problem["cell"].endswith(str(problem["row"]))
        assert problem["expected"]
        assert problem["remedy"]


def test_every_bad_cell_is_named_with_its_value(checked):
    fleet, found = checked
    for problem in found["problems"]:
        value = fleet.bad[problem["cell"]]
        assert (problem["value"] or "") == ("" if value is None else str(value)), problem


def test_rows_in_are_rows_judged_and_rows_reported(checked):
    fleet, found = checked
    verdicts = [i["verdict"] for i in found["inspections"]]
    assert [i["record_id"] for i in found["inspections"]] == [row[0] for row in fleet.rows[1:]]
    assert {n for n, verdict in enumerate(verdicts, 2) if verdict == "INVALID"} == fleet.spoilt
    assert sum(v != "INVALID" for v in verdicts) + len(fleet.spoilt) == ROWS
