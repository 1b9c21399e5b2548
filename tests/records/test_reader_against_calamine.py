"""The readers of workbooks against python-calamine, and against what may come inside a package."""

from __future__ import annotations

import datetime
import io
import random
import zipfile

import pytest
import python_calamine

from mlg_troubleshoot.records import ReadOptions
from mlg_troubleshoot.records.cells import OddCell
from mlg_troubleshoot.records.read import open_book

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
