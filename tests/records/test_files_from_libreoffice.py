"""Workbooks that LibreOffice wrote: samples every day, and fresh conversions in the slow part."""

from __future__ import annotations

import shutil
import subprocess

import openpyxl
import pytest

from mlg_troubleshoot.gear.gear_file import load_gear
from mlg_troubleshoot.records import ReadOptions
from mlg_troubleshoot.records.annotate import write_template
from tests.records.reading import read_inspections


def fill(path):
    """Write the template with one row of the table and one form filled in."""
    write_template(path, load_gear())
    book = openpyxl.load_workbook(path)
    sheet = book["Inspections"]
    values = {
        "record_id": "R1",
        "tail_no": "007",
        "side": "LH",
        "clearance_convention": "TOTAL_PLAY",
    }
    values |= {"clearance_3_in": 0.026, "clearance_5_in": 0.014, "work_order": "1E5"}
    for cell in sheet[1]:
        if cell.value in values:
            sheet.cell(2, cell.column).value = values[cell.value]
        if cell.value == "clearance_7_in":
            sheet.cell(2, cell.column).value = "=0.002*2"
    form = {
        "Record id": "F1",
        "Tail no": "N2",
        "Side": "RH",
        "Clearance convention": "RADIAL",
        "Unit": "mm",
    }
    form["Clearance #3"] = 0.3302
    for row in book["Form"].iter_rows(max_col=2):
        if row[0].value in form:
            row[1].value = form[row[0].value]
    book.save(path)


def check(path):
    """Compare what was read with what was filled in."""
    result = read_inspections(path, ReadOptions())
    assert not result.problems
    table, form = result.inspections
    assert (table.record_id, table.tail_no, table.carried) == ("R1", "007", {"work_order": "1E5"})
    assert dict(table.clearance_in) == {3: 0.013, 5: 0.007, 7: 0.002}
    assert (form.record_id, form.source.sheet) == ("F1", "Form")
    assert dict(form.clearance_in) == {3: pytest.approx(0.013)}
    assert any("formula" in note for note in result.notes) == (path.suffix != ".xls")


@pytest.mark.parametrize("suffix", ["xlsx", "xls"])
def test_the_template_saved_by_libreoffice_reads_back(samples, suffix):
    check(samples / f"template_filled.{suffix}")


@pytest.fixture(params=["xlsx", "xls"])
def merged(request, samples):
    """Tails and dates that are merged over the rows of both gears; below them one is missing."""
    return read_inspections(samples / f"merged.{request.param}", ReadOptions())


def test_a_cell_that_is_merged_over_rows_says_the_same_of_each(merged):
    said = [(row.tail_no, row.side) for row in merged.inspections]
    assert said == [(f"N{n}", side) for n in range(101, 201) for side in ("LH", "RH")]
    assert {str(row.inspection_date) for row in merged.inspections} == {"2026-03-01"}
    assert any("200 blank cells merged with one above" in note for note in merged.notes)


def test_a_blank_cell_below_merged_ones_stays_blank(merged):
    assert [problem.cell for problem in merged.problems] == ["A202"]


def test_a_reading_that_is_merged_over_rows_is_that_of_the_first(merged):
    first, second, *_ = merged.inspections
    assert (first.clearance_in[3], 3 in second.clearance_in) == (0.005, False)


@pytest.mark.parametrize(
    ("data", "name", "what"),
    [
        (b"mimetypeapplication/vnd.oasis.opendocument.spreadsheet", "t", "OpenDocument"),
        (b"", "t.ods", "OpenDocument"),
        (b"", "t.numbers", "Apple Numbers"),
        (b"", "t.docx", "text document"),
        (b"", "t.zip", "packed folder"),
    ],
)
def test_another_packed_file_is_named_and_says_what_to_do(read, data, name, what):
    (problem,) = read(b"PK\x03\x04" + data, name).problems
    assert problem.code == "file_kind"
    assert what in problem.value
    assert problem.remedy == "Save it as .xlsx or .csv and read that."


def test_a_password_protected_old_workbook_is_named_as_such(samples, read):
    data = bytearray((samples / "sample.xls").read_bytes())
    start = data.find(b"\x09\x08\x10\x00\x00\x06\x05\x00")
    data[start + 20 : start + 22] = b"\x2f\x00"
    assert [p.code for p in read(bytes(data), "t.xls").problems] == ["password_protected"]


@pytest.mark.parametrize("keep", [600, 3000, 6000])
def test_a_truncated_old_workbook_is_named_as_damaged(samples, read, keep):
    result = read((samples / "sample.xls").read_bytes()[:keep], "t.xls")
    assert [p.code for p in result.problems] == ["file_damaged"]


def test_an_old_office_file_that_is_not_a_workbook_is_refused(samples, read):
    data = (samples / "sample.xls").read_bytes()
    renamed = data.replace("Workbook".encode("utf-16-le"), "WordDoc1".encode("utf-16-le"))
    assert [p.code for p in read(renamed, "t.doc").problems] == ["file_kind"]


def convert(path, kind, folder):
    """Convert a file with LibreOffice and return the new file."""
    office = shutil.which("soffice")
    if office is None:
        pytest.skip("LibreOffice is not installed")
    profile = f"-env:UserInstallation=file://{folder}/profile"
    subprocess.run(
        [office, profile, "--headless", "--convert-to", kind, "--outdir", str(folder), str(path)],
        check=True,
        capture_output=True,
        timeout=120,
    )
    return folder / f"{path.stem}.{kind.partition(':')[0]}"


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["xlsx", "xls"])
def test_the_template_passes_through_libreoffice_unharmed(tmp_path, kind):
    source = tmp_path / "filled.xlsx"
    fill(source)
    out = tmp_path / "out"
    out.mkdir()
    check(convert(source, kind, out))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("charset", "separator", "note"),
    [("76", "44", None), ("1", "59", "Windows-1252"), ("65535", "9", "UTF-16")],
)
def test_csv_written_by_libreoffice_is_read(tmp_path, xlsx, charset, separator, note):
    source = tmp_path / "t.xlsx"
    rows = [
        ("record_id", "tail_no", "side", "clearance_convention", "clearance_3_in", "remarks"),
        ("R1", "007", "LH", "RADIAL", 0.013, 'geprüft, "gut"\nzwei Zeilen'),
    ]
    source.write_bytes(xlsx(rows))
    path = convert(source, f"csv:Text - txt - csv (StarCalc):{separator},34,{charset},1", tmp_path)
    result = read_inspections(path, ReadOptions())
    assert not result.problems
    assert result.rows[0].tail_no == "007"
    assert result.rows[0].carried["remarks"] == 'geprüft, "gut"\nzwei Zeilen'
    assert any(note in n for n in result.notes) if note else not result.notes


@pytest.mark.slow
def test_libreoffice_opens_an_annotated_workbook_and_calculates_it(tmp_path, samples):
    from mlg_troubleshoot.records.annotate import annotate_workbook

    out = tmp_path / "annotated.xlsx"
    result = read_inspections(samples / "sample.xlsx", ReadOptions())
    annotate_workbook(
        samples / "sample.xlsx", out, result, {r.source: {"verdict": "=1+1"} for r in result.rows}
    )
    folder = tmp_path / "again"
    folder.mkdir()
    sheet = openpyxl.load_workbook(convert(out, "xlsx", folder))["Inspections"]
    assert sheet["I2"].value == "=1+1"
    assert sheet["I2"].data_type == "s"
    assert "expected" in sheet["E4"].comment.text
