"""The user's own workbook with bad cells marked, and text files for other programs."""

from __future__ import annotations

import datetime
import io
import zipfile

import openpyxl
import pytest
from openpyxl.comments import Comment
from openpyxl.formatting.rule import CellIsRule
from openpyxl.styles import Font, PatternFill
from openpyxl.worksheet.datavalidation import DataValidation

from mlg_troubleshoot.errors import OutputError, UsageError
from mlg_troubleshoot.records import ReadOptions
from mlg_troubleshoot.records.annotate import annotate_workbook
from tests.records.conftest import rows_xml
from tests.records.reading import read_inspections

HEADER = (
    *("record_id", "tail_no", "side", "clearance_convention", "clearance_3_in", "clearance_5_in"),
    "inspection_date",
)
ROWS = [
    ("R1", "N1", "LH", "RADIAL", 0.013, 0.007, datetime.date(2026, 3, 4)),
    ("R2", "N1", "LH", "RADIAL", -1, 0.007, datetime.date(2026, 3, 5)),
    ("R3", "N1", "LH", "RADIAL", 0.33, "x", None),
]


@pytest.fixture
def book(tmp_path, xlsx):
    """Write a workbook with formats, comments, rules and a second sheet."""

    def change(book):
        sheet = book.worksheets[0]
        sheet["A1"].font = Font(bold=True, color="FF0000FF")
        sheet["E2"].fill = PatternFill("solid", fgColor="FF00FF00")
        sheet["E3"].comment = Comment("measured twice", "me")
        sheet.column_dimensions["A"].width = 33
        sheet.row_dimensions[3].hidden = True
        sheet.auto_filter.ref = "A1:G4"
        sheet.freeze_panes = "B2"
        rule = DataValidation("list", formula1='"LH,RH"')
        sheet.add_data_validation(rule)
        rule.add("C2:C9")
        sheet.conditional_formatting.add(
            "E2:F4", CellIsRule(operator="greaterThan", formula=["0.01"])
        )
        other = book.create_sheet("Notes")
        other["B2"] = "=SUM(Inspections!E2:F2)"
        other.merge_cells("C1:D2")
        book.defined_names["limit"] = openpyxl.workbook.defined_name.DefinedName(
            "limit", attr_text="Notes!$B$2"
        )

    path = tmp_path / "in.xlsx"
    path.write_bytes(xlsx([HEADER, *ROWS], change))
    return path


@pytest.fixture
def annotated(tmp_path, book):
    """Annotate the workbook with two verdict columns."""
    result = read_inspections(book, ReadOptions())
    verdicts = {
        row.source: {
            "verdict": "INVALID" if row.source.row != 2 else "OUTSIDE_MARGIN",
            "predicted_in": 0.0472 if row.source.row == 2 else None,
        }
        for row in result.rows
    }
    annotate_workbook(book, tmp_path / "out.xlsx", result, verdicts)
    return openpyxl.load_workbook(tmp_path / "out.xlsx")


def test_bad_cells_are_filled_and_commented_with_the_problem(annotated):
    sheet = annotated["Inspections"]
    marked = [
        c.coordinate for row in sheet.iter_rows() for c in row if c.fill.fgColor.rgb == "FFFFB3B3"
    ]
    assert marked == ["E3", "E4", "F4"]
    assert "25.4" in sheet["E4"].comment.text


def test_a_comment_of_the_user_is_kept_before_the_problem(annotated):
    assert annotated["Inspections"]["E3"].comment.text.startswith("measured twice\n")


def test_verdict_columns_stand_behind_the_table(annotated):
    sheet = annotated["Inspections"]
    assert [c.value for c in sheet["H"]] == ["verdict", "OUTSIDE_MARGIN", "INVALID", "INVALID"]
    assert [c.value for c in sheet["I"]] == ["predicted_in", 0.0472, None, None]


def fills(sheet, column):
    return [cell.fill.fgColor.rgb for cell in sheet[column]][1:]


def test_a_verdict_can_be_told_by_its_colour(tmp_path, xlsx):
    source, out = tmp_path / "in.xlsx", tmp_path / "out.xlsx"
    source.write_bytes(xlsx([HEADER, *[(f"R{n}", *ROWS[0][1:]) for n in range(3)]]))
    result = read_inspections(source, ReadOptions())
    said = ("WITHIN_MARGIN", "INCONCLUSIVE", "OUTSIDE_MARGIN")
    annotate_workbook(
        source,
        out,
        result,
        {r.source: {"verdict": v} for r, v in zip(result.rows, said, strict=True)},
    )
    assert len(set(fills(openpyxl.load_workbook(out)["Inspections"], "H"))) == 3


def test_everything_else_is_as_it_was(annotated, book):
    before, after = openpyxl.load_workbook(book), annotated
    assert before.sheetnames == after.sheetnames
    for old, new in zip(before, after, strict=True):
        for row in old.iter_rows():
            for cell in row:
                twin = new[cell.coordinate]
                assert (twin.value, twin.number_format, repr(twin.font)) == (
                    cell.value,
                    cell.number_format,
                    repr(cell.font),
                )
                if cell.coordinate not in ("E3", "E4", "F4"):
                    assert repr(twin.fill) == repr(cell.fill)
        assert old.merged_cells.ranges == new.merged_cells.ranges
        assert old.freeze_panes == new.freeze_panes
        assert old.auto_filter.ref == new.auto_filter.ref
        assert {k: d.width for k, d in old.column_dimensions.items()} == {
            k: d.width for k, d in new.column_dimensions.items() if k < "H"
        }
        assert [k for k, d in old.row_dimensions.items() if d.hidden] == [
            k for k, d in new.row_dimensions.items() if d.hidden
        ]
        assert len(old.data_validations.dataValidation) == len(new.data_validations.dataValidation)
        assert len(old.conditional_formatting) == len(new.conditional_formatting)
    assert set(before.defined_names) == set(after.defined_names)


def test_the_source_is_not_changed(book, tmp_path):
    before = book.read_bytes()
    annotate_workbook(book, tmp_path / "o.xlsx", read_inspections(book, ReadOptions()), {})
    assert book.read_bytes() == before


def test_an_annotated_workbook_reads_like_its_source_once_its_formulas_are_calculated(
    samples, tmp_path
):
    source, out = samples / "sample.xlsx", tmp_path / "out.xlsx"
    first = read_inspections(source, ReadOptions())
    annotate_workbook(source, out, first, {r.source: {"verdict": "x"} for r in first.rows})
    second = read_inspections(out, ReadOptions())
    uncalculated = [p for p in second.problems if p.code == "formula_without_value"]
    assert "Open the file in a spreadsheet program" in uncalculated[0].remedy
    others = {(p.code, p.cell, p.value) for p in second.problems if p not in uncalculated}
    assert others < {(p.code, p.cell, p.value) for p in first.problems}
    assert openpyxl.load_workbook(out).calculation.fullCalcOnLoad


def test_a_problem_of_a_header_is_marked_at_the_header(tmp_path, xlsx):
    source, out = tmp_path / "in.xlsx", tmp_path / "out.xlsx"
    source.write_bytes(xlsx([(*HEADER[:5], "Play 5", "x"), (*ROWS[0][:6], None)]))
    annotate_workbook(source, out, read_inspections(source, ReadOptions()), {})
    assert openpyxl.load_workbook(out)["Inspections"]["F1"].comment is None
    source.write_bytes(xlsx([(*HEADER[:5], "Play J5", "x"), (*ROWS[0][:6], None)]))
    annotate_workbook(source, out, read_inspections(source, ReadOptions()), {})
    assert "--map" in openpyxl.load_workbook(out)["Inspections"]["F1"].comment.text


def test_macros_are_kept_in_a_macro_workbook(tmp_path, xlsx):
    source, out = tmp_path / "in.xlsm", tmp_path / "out.xlsm"
    source.write_bytes(xlsx([HEADER, *ROWS]))
    with zipfile.ZipFile(source, "a") as archive:
        archive.writestr("xl/vbaProject.bin", b"\xd0\xcf\x11\xe0macro")
    annotate_workbook(source, out, read_inspections(source, ReadOptions()), {})
    assert zipfile.ZipFile(out).read("xl/vbaProject.bin") == b"\xd0\xcf\x11\xe0macro"


def test_a_form_gets_its_verdict_beside_it(tmp_path):
    from mlg_troubleshoot.gear.gear_file import load_gear
    from mlg_troubleshoot.records.annotate import write_template

    path, out = tmp_path / "t.xlsx", tmp_path / "o.xlsx"
    write_template(path, load_gear())
    book = openpyxl.load_workbook(path)
    for cell, value in zip(
        ("B4", "B5", "B6", "B7", "B8", "B11"),
        ("F1", "N1", "LH", "RADIAL", "in", 0.013),
        strict=True,
    ):
        book["Form"][cell] = value
    book.save(path)
    result = read_inspections(path, ReadOptions())
    annotate_workbook(path, out, result, {result.rows[0].source: {"verdict": "WITHIN_MARGIN"}})
    sheet = openpyxl.load_workbook(out)["Form"]
    assert (sheet["D4"].value, sheet["E4"].value) == ("verdict", "WITHIN_MARGIN")


def test_the_workbook_itself_is_never_overwritten(book):
    with pytest.raises(UsageError, match="the workbook itself"):
        annotate_workbook(book, book, read_inspections(book, ReadOptions()), {})


def test_a_csv_file_cannot_be_annotated(tmp_path):
    source = tmp_path / "t.csv"
    source.write_text("a,b\n")
    with pytest.raises(UsageError, match="cannot be annotated"):
        annotate_workbook(source, tmp_path / "o.xlsx", read_inspections(source, ReadOptions()), {})


def test_a_workbook_that_the_library_cannot_write_again_is_an_output_error(book, tmp_path):
    hidden = openpyxl.load_workbook(book)
    for sheet in hidden:
        sheet.sheet_state = "veryHidden"
    parts = io.BytesIO()
    hidden.worksheets[0].sheet_state = "visible"
    hidden.save(parts)
    with zipfile.ZipFile(parts) as visible, zipfile.ZipFile(tmp_path / "hidden.xlsx", "w") as file:
        for name in visible.namelist():
            file.writestr(name, visible.read(name).replace(b'state="visible"', b'state="hidden"'))
    source = tmp_path / "hidden.xlsx"
    with pytest.raises(OutputError, match="cannot be copied"):
        annotate_workbook(source, tmp_path / "o.xlsx", read_inspections(source, ReadOptions()), {})
    assert not (tmp_path / "o.xlsx").exists()


def test_a_link_that_leads_nowhere_is_an_output_error(book, tmp_path):
    source = tmp_path / "linked.xlsx"
    link = b'<hyperlinks><hyperlink ref="nowhere"/></hyperlinks><pageMargins'
    with zipfile.ZipFile(book) as whole, zipfile.ZipFile(source, "w") as file:
        for name in whole.namelist():
            file.writestr(name, whole.read(name).replace(b"<pageMargins", link, 1))
    with pytest.raises(OutputError, match="cannot be copied"):
        annotate_workbook(source, tmp_path / "o.xlsx", read_inspections(source, ReadOptions()), {})


@pytest.mark.parametrize(
    "after",
    [
        "<mergeCells><mergeCell ref='A1:XFD1048576'/></mergeCells>",
        '<mergeCells count="1"><mergeCell ref="B2:XFD1048576"/></mergeCells>',
        '<hyperlinks><hyperlink ref="A1:XFD1048576" location="Inspections!A1"/></hyperlinks>',
        '<hyperlinks><hyperlink ref="A:XFD" location="Inspections!A1"/></hyperlinks>',
    ],
)
def test_a_range_over_a_whole_sheet_is_refused_before_it_costs_memory(tmp_path, package, after):
    path = tmp_path / "t.xlsx"
    path.write_bytes(package(after=after))
    result = read_inspections(path, ReadOptions())
    with pytest.raises(OutputError, match="merged cells and links"):
        annotate_workbook(path, tmp_path / "o.xlsx", result, {})


def test_an_empty_cell_far_outside_does_not_cost_memory(tmp_path, package):
    path, out = tmp_path / "t.xlsx", tmp_path / "o.xlsx"
    far = '<row r="1048576"><c r="XFD1048576" s="0"/></row>'
    path.write_bytes(package(rows_xml([HEADER, ROWS[0][:6]]) + far))
    result = read_inspections(path, ReadOptions())
    annotate_workbook(path, out, result, {result.rows[0].source: {"verdict": "x"}})
    assert openpyxl.load_workbook(out).worksheets[0]["H1"].value == "verdict"


def test_a_workbook_that_was_replaced_after_it_was_judged_is_refused(tmp_path, xlsx):
    path, out = tmp_path / "t.xlsx", tmp_path / "o.xlsx"
    path.write_bytes(xlsx())
    result = read_inspections(path, ReadOptions())
    path.write_bytes(xlsx(change=lambda book: book.worksheets[0].insert_rows(2)))
    with pytest.raises(OutputError, match="no longer the workbook that was judged"):
        annotate_workbook(path, out, result, {})
    assert not out.exists()
