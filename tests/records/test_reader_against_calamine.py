"""Workbooks as other programs read and write them: calamine and LibreOffice."""

from __future__ import annotations

import datetime
import io
import random
import shutil
import subprocess
import zipfile

import openpyxl
import pytest
import python_calamine

from mlg_troubleshoot.gear.gear_file import load_gear
from mlg_troubleshoot.records import ReadOptions
from mlg_troubleshoot.records.annotate import write_template
from mlg_troubleshoot.records.cells import OddCell
from mlg_troubleshoot.records.read import open_book
from tests.records.reading import read_inspections

MAIN = 'xmlns="http://schemas.openxmlformats.org/spreadsheetml/2006/main"'


def ours(data):
    """Return the cells of the first sheet by row."""
    return {
        number: [c.day if isinstance(c, OddCell) and c.day else c for c in cells]
        for number, cells in open_book(data, "", ReadOptions()).sheets[0].rows()
    }


def theirs(data):
    """Return the same by calamine, blanks as None."""
    sheet = python_calamine.CalamineWorkbook.from_filelike(io.BytesIO(data)).get_sheet_by_index(0)
    rows = {}
    for number, row in enumerate(sheet.to_python(skip_empty_area=False), 1):
        cells = [None if v == "" else float(v) if isinstance(v, int) else v for v in row]
        while cells and cells[-1] is None:
            cells.pop()
        if cells:
            rows[number] = cells
    return rows


def random_rows(seed):
    """Return rows of numbers, texts, dates and gaps."""
    rng = random.Random(seed)
    choices = (
        lambda: None,
        lambda: rng.uniform(-1, 1),
        lambda: float(rng.randrange(1000)),
        lambda: "text & <tags> \"quoted\" 'x' " + str(rng.randrange(9)),
        lambda: "ünï çödé ✓ 漢字",
        lambda: "two\nlines",
        lambda: datetime.date(2026, 1, 1) + datetime.timedelta(days=rng.randrange(900)),
    )
    return [[rng.choice(choices)() for _ in range(rng.randrange(1, 30))] for _ in range(60)]


def test_values_and_places_agree_with_calamine(xlsx):
    for seed in range(5):
        data = xlsx(random_rows(seed))
        assert ours(data) == theirs(data)


@pytest.mark.parametrize(
    "name", [f"{n}.{kind}" for n in ("sample", "template_filled") for kind in ("xlsx", "xls")]
)
def test_files_of_libreoffice_agree_with_calamine(samples, name):
    data = (samples / name).read_bytes()
    mine, other = ours(data), theirs(data)
    for number, row in other.items():
        for index, value in enumerate(row):
            own = mine[number][index]
            # calamine shows an error as a blank; a number shown with zeros is text here.
            if not isinstance(own, OddCell) and not isinstance(value, datetime.datetime):
                assert own == value, (number, index)


def test_a_row_in_an_unusual_spelling_reads_like_a_usual_one(package):
    plain = package(
        '<row r="1"><c r="A1"><v>1</v></c><c r="C1"><v>2.5</v></c></row><row r="2"><c'
        ' r="B2"><v>3</v></c></row>'
    )
    odd = package(
        '<!-- <row r="8"><c r="A8"><v>8</v></c></row><row r="9"><c'
        " r=\"A9\"><v>9</v></c></row> --><row spans='1:3' r='1' ><c  r='A1'\n><v >1</v></c><c"
        " r='C1' cm='1'><v>2.5</v><extLst/></c></row>\n<row><c/><c><v>3</v></c></row>"
    )
    assert ours(plain) == ours(odd) == {1: [1.0, None, 2.5], 2: [None, 3.0]}


def test_a_sheet_with_prefixed_elements_is_read(package):
    xml = (
        "<x:worksheet"
        ' xmlns:x="http://schemas.openxmlformats.org/spreadsheetml/2006/main"><x:sheetData><x:row'
        ' r="1"><x:c r="B1"'
        " t=\"inlineStr\"><x:is><x:r><x:t>a</x:t></x:r><x:r><x:t>b</x:t></x:r><x:rPh sb='0'"
        " eb='1'><x:t>no</x:t></x:rPh></x:is></x:c></x:row></x:sheetData></x:worksheet>"
    )
    assert ours(package(sheet_xml=xml)) == {1: [None, "ab"]}


def test_a_shared_text_in_pieces_is_joined_without_its_pronunciation(package):
    strings = (
        f"<sst {MAIN}><si><t>first_x0041_</t></si><si><r><t>漢</t></r><r><rPr/><t>字</t></r>"
        "<rPh sb='0' eb='1'><t>かんじ</t></rPh></si><si><t/></si></sst>"
    )
    cells = "".join(
        f'<c r="{c}1" t="s"><v>{n}</v></c>' for c, n in (("A", 1), ("B", 0), ("C", 2), ("D", 1))
    )
    assert ours(package(f'<row r="1">{cells}</row>', strings=strings)) == {
        1: ["漢字", "firstA", None, "漢字"]
    }


def test_a_shared_text_that_does_not_exist_makes_the_workbook_damaged(package, read):
    data = package(
        '<row r="1"><c r="A1" t="s"><v>7</v></c></row>',
        strings=f"<sst {MAIN}><si><t>a</t></si></sst>",
    )
    assert [p.code for p in read(data, "t.xlsx").problems] == ["file_damaged"]


def test_a_sheet_in_utf_16_is_read(package):
    xml = (
        '<?xml version="1.0" encoding="UTF-16"?>'
        f"<worksheet {MAIN}>"
        '<sheetData><row r="1"><c r="A1" t="inlineStr">'
        "<is><t>ü</t></is></c></row></sheetData></worksheet>"
    )
    assert ours(package(sheet_xml=xml.encode("utf-16"))) == {1: ["ü"]}


def test_escaped_characters_of_a_text_are_restored(package):
    row = (
        '<row r="1"><c r="A1" t="inlineStr"><is><t>a_x000D_b_x005F_x</t></is></c>'
        '<c r="B1" t="str"><v>&lt;&amp;&#65;</v></c></row>'
    )
    assert ours(package(row)) == {1: ["a\rb_x", "<&A"]}


def test_rows_split_between_pieces_of_the_archive_are_whole(package):
    rows = "".join(
        f'<row r="{n}"><c r="A{n}" t="inlineStr"><is><t>{"x" * 90}ü{n}</t></is></c></row>'
        for n in range(1, 6001)
    )
    found = ours(package(rows))
    assert len(found) == 6000
    assert found[6000] == ["x" * 90 + "ü6000"]


def test_a_workbook_saved_as_strict_open_xml_is_read(xlsx):
    usual = "http://schemas.openxmlformats.org/"
    names = (
        ("spreadsheetml/2006/main", "spreadsheetml/main"),
        ("officeDocument/2006/relationships", "officeDocument/relationships"),
    )
    rows = [["a", 0.5, datetime.date(2026, 3, 4)]]
    buffer = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(xlsx(rows))) as old, zipfile.ZipFile(buffer, "w") as new:
        for name in old.namelist():
            text = old.read(name).decode()
            for known, strict in names:
                text = text.replace(usual + known, "http://purl.oclc.org/ooxml/" + strict)
            new.writestr(name, text)
    assert ours(buffer.getvalue()) == {1: ["a", 0.5, datetime.date(2026, 3, 4)]}


def test_a_style_that_the_library_does_not_know_leaves_the_cells_as_they_are(package):
    styles = (
        f'<styleSheet {MAIN}><fonts><font><color rgb="cornflower"/></font></fonts></styleSheet>'
    )
    assert ours(package('<row r="1"><c r="A1"><v>1</v></c></row>', styles=styles)) == {1: [1.0]}


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
