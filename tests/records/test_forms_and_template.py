"""The template workbook and vertical forms: filled in, they read back."""

from __future__ import annotations

import io
import re

import openpyxl
import pytest

from mlg_troubleshoot.decision.inspection import Inspection, InvalidRow
from mlg_troubleshoot.errors import OutputError
from mlg_troubleshoot.gear.gear_file import load_gear
from mlg_troubleshoot.records import ReadOptions
from mlg_troubleshoot.records.annotate import annotate_workbook, write_template
from mlg_troubleshoot.records.headers import Joints
from mlg_troubleshoot.units import LengthUnit
from tests.cli.conftest import mlg
from tests.gear.own import own_gear
from tests.records.reading import read_inspections

GEAR = load_gear()
FILLED = {
    "Record id": "F1",
    "Tail no": "007",
    "Side": "RH",
    "Clearance convention": "TOTAL_PLAY",
    "Unit": "mm",
    "Clearance #3": 0.6604,
    "Clearance #5": "0.3556",
    "Plunger displacement 2": -0.254,
    "Margin": 0.762,
    "Remarks": "=not a formula",
}


@pytest.fixture
def template(tmp_path):
    """Write the template and return its path."""
    path = tmp_path / "template.xlsx"
    write_template(path, GEAR)
    return path


def fill_form(sheet, values):
    """Fill in the lines of a form by their labels."""
    for row in sheet.iter_rows(min_row=1, max_col=2):
        if row[0].value in values:
            row[1].value = values[row[0].value]
            if isinstance(row[1].value, str):
                row[1].data_type = "s"


def fill_table(sheet, row, values):
    """Fill in a row of the table by its headers."""
    for cell in sheet[1]:
        if cell.value in values:
            sheet.cell(row, cell.column).value = values[cell.value]


@pytest.mark.parametrize("chosen", [{}, {"Unit": "mm", "Clearance convention": "RADIAL"}])
def test_of_an_untouched_template_it_is_said_that_there_is_nothing_in_it(template, chosen):
    book = openpyxl.load_workbook(template)
    assert book.active is book["Inspections"]
    fill_form(book["Form"], chosen)
    book.save(template)
    result = read_inspections(template, ReadOptions())
    assert [p.code for p in result.problems] == ["no_rows"]
    assert result.rows == ()


def test_every_header_of_the_template_is_canonical(template):
    book = openpyxl.load_workbook(template)
    fill_table(
        book["Inspections"],
        2,
        {"record_id": "R1", "tail_no": "1", "side": "LH", "clearance_convention": "RADIAL"},
    )
    book.save(template)
    result = read_inspections(template, ReadOptions())
    assert not result.problems
    assert not [note for note in result.notes if "read as" in note or "unknown column" in note]
    (layout,) = result.layouts
    assert all(column.read_as == column.header for column in layout.columns)
    assert {f"clearance_{n}_in" for n in range(1, 11)} <= {
        column.header for column in layout.columns
    }


@pytest.mark.parametrize("unit", list(LengthUnit))
def test_a_filled_in_table_reads_back_in_its_unit(tmp_path, unit):
    path = tmp_path / "t.xlsx"
    write_template(path, GEAR, unit=unit)
    book = openpyxl.load_workbook(path)
    values = {"record_id": "R1", "tail_no": "007", "side": "LH", "clearance_convention": "RADIAL"}
    values[f"clearance_3_{unit.value}"] = unit.from_inches(0.013)
    fill_table(book["Inspections"], 2, values)
    book.save(path)
    result = read_inspections(path, ReadOptions())
    assert not result.problems
    assert result.rows[0].clearance_in == {3: pytest.approx(0.013)}


def test_a_filled_in_form_reads_back(template):
    book = openpyxl.load_workbook(template)
    fill_form(book["Form"], FILLED)
    book.save(template)
    result = read_inspections(template, ReadOptions())
    assert not result.problems
    (row,) = result.rows
    assert isinstance(row, Inspection)
    assert (row.record_id, row.tail_no) == ("F1", "007")
    assert row.clearance_in == {3: pytest.approx(0.013), 5: pytest.approx(0.007)}
    assert row.readings_in == (pytest.approx(-0.01),)
    assert row.margin_in == pytest.approx(0.03)
    assert row.carried == {"remarks": "=not a formula"}
    assert row.source.sheet == "Form"


def test_a_joint_over_its_limit_is_marked_in_its_line_of_the_form(template, tmp_path):
    book = openpyxl.load_workbook(template)
    fill_form(book["Form"], FILLED)
    book.save(template)
    result, out = read_inspections(template, ReadOptions()), tmp_path / "out.xlsx"
    of = result.rows[0].source
    annotate_workbook(template, out, result, {of: {"verdict": "OUTSIDE_MARGIN"}}, {of: {3: 0.0075}})
    marked = [
        c
        for c in openpyxl.load_workbook(out)["Form"]["B"]
        if c.comment and "over the limit" in c.comment.text
    ]
    assert [cell.value for cell in marked] == [FILLED["Clearance #3"]]


def test_many_copies_of_the_form_are_many_inspections_and_an_untouched_one_is_not(template):
    book = openpyxl.load_workbook(template)
    for number in range(3):
        copy = book.copy_worksheet(book["Form"])
        copy.title = f"Form {number + 2}"
        fill_form(copy, {**FILLED, "Record id": f"F{number}"})
    fill_table(
        book["Inspections"],
        2,
        {
            "record_id": "R1",
            "tail_no": "1",
            "side": "LH",
            "clearance_convention": "RADIAL",
            "clearance_3_in": 0.001,
        },
    )
    book.save(template)
    result = read_inspections(template, ReadOptions())
    assert not result.problems
    assert [row.record_id for row in result.rows] == ["R1", "F0", "F1", "F2"]


def test_a_bad_value_of_a_form_is_named_at_its_cell(template):
    book = openpyxl.load_workbook(template)
    fill_form(book["Form"], {**FILLED, "Clearance #3": -1, "Side": None})
    book.save(template)
    result = read_inspections(template, ReadOptions())
    assert [(p.sheet, p.column, p.cell, p.value) for p in result.problems] == [
        ("Form", "Side", "B6", None),
        ("Form", "Clearance #3", "B11", "-1"),
    ]
    assert isinstance(result.rows[0], InvalidRow)


def test_a_form_that_is_partly_filled_in_is_an_inspection_with_problems(template):
    book = openpyxl.load_workbook(template)
    fill_form(book["Form"], {"Clearance #3": 0.013})
    book.save(template)
    result = read_inspections(template, ReadOptions())
    assert len(result.rows) == 1
    assert {p.code for p in result.problems} == {
        "record_id_missing",
        "tail_no_missing",
        "side_missing",
        "convention_missing",
        "unit_missing",
    }


def test_a_form_of_another_maker_is_read_and_its_labels_shown(read):
    book = openpyxl.Workbook()
    sheet = book.worksheets[0]
    lines = [
        ("Inspection sheet", None),
        ("Record No.:", "R1"),
        ("Tail number:", "N1"),
        ("Side:", "LH"),
    ]
    lines += [
        ("Convention:", "DIAMETRAL"),
        ("Joint 3 (in):", 0.026),
        ("Joint 5 (in):", 0.014),
        ("Signature", None),
    ]
    for row, (label, value) in enumerate(lines, 1):
        sheet.cell(row, 2, label)
        sheet.merge_cells(start_row=row, end_row=row, start_column=2, end_column=3)
        sheet.cell(row, 4, value)
    buffer = io.BytesIO()
    book.save(buffer)
    result = read(buffer.getvalue(), "f.xlsx")
    assert not result.problems
    assert result.rows[0].clearance_in == {3: 0.013, 5: 0.007}
    assert any('"Joint 3 (in):" clearance_3_in' in note for note in result.notes)


@pytest.mark.parametrize(("separator", "mark"), [(",", "."), (";", ","), (";", "."), ("\t", ".")])
def test_a_form_is_read_from_csv_with_its_joints_below_the_plunger(separator, mark):
    said = ("Tail,N1", "Side,LH", "Convention,radial", "Unit,mm", "Outcome,FAILED", "Plunger,1.04")
    joints = ("Joint,Found (mm)", *(f"{joint},0.{joint}5" for joint in range(1, 6)))
    rows = [line.split(",") for line in (*said, *joints)]
    text = "\n".join(separator.join(cell.replace(".", mark) for cell in row) for row in rows)
    (row,) = read_inspections(io.BytesIO(text.encode()), ReadOptions()).rows
    assert isinstance(row, Inspection)
    assert row.measured_displacement_in == pytest.approx(1.04 / 25.4)
    assert row.clearance_in == pytest.approx({n: (n / 10 + 0.05) / 25.4 for n in range(1, 6)})


def test_a_form_of_two_gears_side_by_side_is_two_inspections(read, xlsx):
    lines = [("Tail", "N1", "N2"), ("Side", "LH", "RH"), ("J3 (in)", 0.001, 0.013)]
    result = read(xlsx(lines), "f.xlsx", convention="RADIAL")
    assert [(row.tail_no, row.side, dict(row.clearance_in)) for row in result.rows] == [
        ("N1", "LH", {3: 0.001}),
        ("N2", "RH", {3: 0.013}),
    ]


def test_a_form_filled_in_over_its_hints_says_where_its_values_are_missing(read, template):
    book = openpyxl.load_workbook(template)
    for row, value in ((4, "X1"), (5, "N1"), (6, "LH"), (7, "RADIAL"), (8, "in"), (11, 0.003)):
        book["Form"].cell(row, 3, value)
    buffer = io.BytesIO()
    book.save(buffer)
    result = read(buffer.getvalue(), "f.xlsx")
    assert not result.inspections
    assert {"tail_no_missing", "side_missing"} <= {problem.code for problem in result.problems}
    assert {"B5", "B6"} <= {problem.cell for problem in result.problems}


def test_the_template_has_lists_of_choices_and_explains_each_column(template):
    sheet = openpyxl.load_workbook(template)["Inspections"]
    choices = {
        rule.formula1 for rule in sheet.data_validations.dataValidation if rule.type == "list"
    }
    assert {
        '"LH,RH"',
        '"RADIAL,DIAMETRAL,TOTAL_PLAY"',
        '"EXTENDING,RETRACTING"',
        '"RETRACTED,FAILED"',
    } <= choices
    assert all(cell.comment is not None for cell in sheet[1])
    assert GEAR.joint(3).location in next(
        c.comment.text for c in sheet[1] if c.value == "clearance_3_in"
    )
    assert sheet.freeze_panes == "D2"


@pytest.mark.parametrize("name", ["Instructions", "Form"])
def test_every_line_of_the_template_is_as_high_as_its_text(template, name):
    sheet = openpyxl.load_workbook(template)[name]
    low = [
        cell.coordinate
        for row in sheet.iter_rows(min_row=4)
        for cell in row
        if isinstance(cell.value, str)
        and len(cell.value) > 1.5 * sheet.column_dimensions[cell.column_letter].width
        and (sheet.row_dimensions[cell.row].height or 0) < 30
    ]
    assert low == []


def test_identities_of_the_template_are_text_cells(template):
    sheet = openpyxl.load_workbook(template)["Inspections"]
    formats = {sheet.cell(1, c.column).value: c.number_format for c in sheet[2]}
    assert all(formats[name] == "@" for name in ("record_id", "tail_no", "gauge_id", "work_order"))


def test_the_template_holds_no_formula(template):
    book = openpyxl.load_workbook(template)
    assert not [c for sheet in book for row in sheet.iter_rows() for c in row if c.data_type == "f"]


def test_a_template_that_cannot_be_written_is_an_output_error(tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(OutputError, match="cannot be written"):
        write_template(tmp_path / "file" / "t.xlsx", GEAR)


def headers_and_comments(path):
    sheet = openpyxl.load_workbook(path)["Inspections"]
    return {cell.value: cell.comment.text for cell in sheet[1]}


def test_a_template_says_the_numbers_of_its_gear(tmp_path):
    gear = own_gear(
        tmp_path,
        ("\nmargin = 0.03", "\nmargin = 0.05"),
        ("down_lock_range = [0.01, 0.05]", "down_lock_range = [0.02, 0.04]"),
    )
    assert mlg("template", tmp_path / "t.xlsx", "--columns", "all", "--gear", gear).code == 0
    explained = headers_and_comments(tmp_path / "t.xlsx")
    assert "Blank: 0.0500 in." in explained["margin_in"]
    assert "0.0200 in to 0.0400 in is allowed" in explained["plunger_down_lock_in"]
    assert f"Limit: {GEAR.joint(3).limit.value:.4f} in radial." in explained["clearance_3_in"]


def test_a_template_in_millimetres_explains_in_millimetres(tmp_path):
    write_template(tmp_path / "t.xlsx", GEAR, unit=LengthUnit.MILLIMETRE)
    explained = headers_and_comments(tmp_path / "t.xlsx")
    assert "Blank: 0.762 mm." in explained["margin_mm"]
    assert "Blank: 0.013 mm radial is assumed." in explained["gauge_u_mm"]


@pytest.mark.parametrize("unit", list(LengthUnit))
def test_the_workbook_has_the_columns_that_people_fill_in_and_reads_back(tmp_path, unit):
    path = tmp_path / "t.xlsx"
    assert mlg("template", path, "--unit", unit.value).code == 0
    book = openpyxl.load_workbook(path)
    headers = [cell.value for cell in book["Inspections"][1]]
    assert len(headers) == 16
    assert f"#3 short link inner bearing, {unit.value}" in headers
    values = {"tail_no": "007", "side": "LH", "clearance_convention": "TOTAL_PLAY"}
    values[f"#3 short link inner bearing, {unit.value}"] = unit.from_inches(0.026)
    fill_table(book["Inspections"], 2, values)
    book.save(path)
    found = mlg("check", path, "--json").one
    assert found["joints"][2]["clearance_in"] == pytest.approx(0.013)


def test_a_template_for_a_convention_says_its_limits_in_it_and_states_it(tmp_path):
    path = tmp_path / "t.xlsx"
    mlg("template", path, "--unit", "thou", "--convention", "TOTAL_PLAY")
    limit = f"Limit: {GEAR.joint(3).limit.value * 2000:.1f} thou total play."
    (said,) = (text for name, text in headers_and_comments(path).items() if name.startswith("#3 "))
    assert limit in said
    book = openpyxl.load_workbook(path)
    form = {label: (value, hint) for label, value, hint in book["Form"].values}
    assert limit in form["Clearance #3"][1]
    assert (form["Clearance convention"][0], form["Unit"][0]) == ("TOTAL_PLAY", "thou")
    # What nobody filled in is no inspection, and headers of the program's own need no note.
    fill_table(book["Inspections"], 2, {"tail_no": "N1", "side": "LH"})
    book["Inspections"]["F2"] = 9
    book.save(path)
    read = read_inspections(path, ReadOptions(joints=Joints.of(GEAR)))
    assert (read.problems, len(read.rows), read.rows[0].clearance_in) == ((), 1, {3: 0.0045})
    assert not re.search("each header was read as|set aside", " ".join(read.notes))
