"""The traps of real spreadsheets, each made as the world makes it; the number is the trap's."""

from __future__ import annotations

import datetime
import io
import struct
import time
import zipfile

import openpyxl
import pytest

from mlg_troubleshoot.decision.inspection import Inspection, InvalidRow
from mlg_troubleshoot.records.cells import MAX_COLUMNS, column_letters
from tests.machine import SLOWER
from tests.records.reading import GOOD, HEADER, only


def with_cell(**cells):
    """Return a change of a workbook that sets cells of its first sheet."""

    def change(book):
        for place, value in cells.items():
            book.worksheets[0][place] = value

    return change


def clearances(result):
    """Return the clearances of the first row, which must be valid."""
    assert not result.problems, result.problems
    row = result.rows[0]
    assert isinstance(row, Inspection)
    return dict(row.clearance_in)


# 1 and 2: formulas


def test_01_a_formula_that_was_never_calculated_is_an_error(read, xlsx):
    problem = only(read(xlsx(change=with_cell(E2="=0.026/2")), "t.xlsx"))
    assert (problem.code, problem.sheet, problem.cell) == (
        "formula_without_value",
        "Inspections",
        "E2",
    )
    assert "save" in problem.remedy


def test_01_a_formula_in_another_producer_s_spelling_without_a_value_is_an_error(read, package):
    cells = '<c r="E2"><f t="shared" ref="E2:E9" si="0">A9</f></c><c r="F2"><v>0.007</v></c>'
    assert only(read(package(_rows_with(cells)), "t.xlsx")).code == "formula_without_value"


def test_02_a_formula_with_its_last_value_is_read_and_said(read, package):
    cells = '<c r="E2"><f>0.026/2</f><v>0.013</v></c><c r="F2"><f>1/2</f><v>0.007</v></c>'
    data = _rows_with(cells)
    result = read(package(data), "t.xlsx")
    assert clearances(result) == {3: 0.013, 5: 0.007}
    assert any("formula" in note and "E (1)" in note for note in result.notes)


def _rows_with(cells, ids="R1 N100AB LH RADIAL"):
    header = "".join(
        f'<c r="{c}1" t="inlineStr"><is><t>{h}</t></is></c>'
        for c, h in zip("ABCDEF", HEADER, strict=True)
    )
    texts = "".join(
        f'<c r="{c}2" t="inlineStr"><is><t>{v}</t></is></c>'
        for c, v in zip("ABCD", ids.split(), strict=True)
    )
    return f'<row r="1">{header}</row><row r="2">{texts}{cells}</row>'


# 3: error values


@pytest.mark.parametrize("error", ["#N/A", "#DIV/0!", "#REF!", "#VALUE!"])
def test_03_an_error_value_is_an_error_and_not_an_unmeasured_joint(read, package, error):
    result = read(
        package(_rows_with(f'<c r="E2" t="e"><v>{error}</v></c><c r="F2"><v>0.007</v></c>')),
        "t.xlsx",
    )
    problem = only(result)
    assert (problem.code, problem.cell, problem.value) == ("cell_error", "E2", error)
    assert isinstance(result.rows[0], InvalidRow)


# 4 to 8: numbers as people write them


@pytest.mark.parametrize(
    ("value", "code", "shown", "remedies"),
    [
        ("0,013", "decimal_comma", "0,013", ("0.013",)),
        ("1/8", "fraction", "1/8", ()),
        (datetime.date(2026, 8, 1), "cell_is_date", "2026-08-01", ()),
        (0.33, "clearance_out_of_range", "0.33", ("25.4", "millimetres")),
        ("0.33 mm", "unit_contradiction", "0.33 mm", ("0.0129",)),
        ("13 thou", "unit_contradiction", "13 thou", ("0.013",)),
        (-0.002, "clearance_negative", "-0.002", ()),
        *(
            (text, "clearance_negative", text, ())
            for text in ("-0.002", "\u22120.002", "\u20130.002", " - 0.002")
        ),
        *(
            (text, "not_finite", text, ())
            for text in ("NaN", "-inf", "Infinity", "1e309", "1.#QNAN")
        ),
    ],
)
def test_04_to_20_a_number_that_cannot_be_a_clearance_is_refused(
    read, xlsx, value, code, shown, remedies
):
    problem = only(read(xlsx(change=with_cell(E2=value)), "t.xlsx"))
    assert (problem.code, problem.cell, problem.value) == (code, "E2", shown)
    assert all(words in problem.remedy for words in remedies)


def test_04_a_declared_decimal_comma_is_read(read, xlsx):
    result = read(xlsx(change=with_cell(E2="0,013")), "t.xlsx", decimal_comma=True)
    assert clearances(result)[3] == 0.013


@pytest.mark.parametrize(
    "text",
    [
        *('.013"', "0.013 in", "0.013\u00a0in", "\u202f0.013\u202finch ", "+0.013", "13e-3"),
        "\ufeff0.013",
    ],
)
def test_05_06_inches_as_people_write_them_are_read(read, xlsx, text):
    assert clearances(read(xlsx(change=with_cell(E2=text)), "t.xlsx"))[3] == pytest.approx(
        0.013, abs=1e-15
    )


@pytest.mark.parametrize(
    ("text", "inches"), [("13 thou", 0.013), ("0.33 mm", 0.33 / 25.4), ("13 mil", 0.013)]
)
def test_07_under_a_header_without_a_unit_that_of_the_cell_goes_before_the_declared_one(
    read, xlsx, text, inches
):
    rows = [[h.removesuffix("_in") for h in HEADER], [*GOOD[:4], text, '.007"']]
    for declared in ({}, {"unit": "in"}):
        found = clearances(read(xlsx(rows), "t.xlsx", **declared))
        assert found == {3: pytest.approx(inches), 5: 0.007}


# 9 to 11: units


def test_09_a_slip_to_the_play_of_a_new_part_is_suggested(read, table):
    row = read(table(rows=[(*GOOD[:4], 0.0254, 0.007)])).rows[0]
    assert any("0.001 in: was it read in millimetres" in warning for warning in row.warnings)


def test_10_a_header_without_a_unit_is_refused(read, table):
    header = [h.removesuffix("_in") for h in HEADER]
    result = read(table(header, [(f"R{i}", *GOOD[1:]) for i in range(50)]))
    assert [p.code for p in result.problems] == ["unit_missing", "unit_missing"]
    assert [p.cell for p in result.problems] == ["E1", "F1"]
    assert sum(isinstance(row, InvalidRow) for row in result.rows) == 50
    assert result.rows[0].correct == ("clearance_3", "clearance_5")


def test_10_the_declared_unit_serves_a_header_without_one(read, table):
    header = [h.removesuffix("_in") for h in HEADER]
    assert clearances(read(table(header), unit="in")) == {3: 0.013, 5: 0.007}


# 12 to 15: headers


def two_rows(book):
    sheet = book.worksheets[0]
    sheet.merge_cells("E1:F1")


def test_12_a_merged_header_of_two_rows_is_read_as_one(read, xlsx):
    rows = [
        ["record_id", "tail_no", "side", "clearance_convention", "Clearance (in)", None],
        [None, None, None, None, "J3", "J5"],
        GOOD,
    ]
    result = read(xlsx(rows, two_rows), "t.xlsx")
    assert clearances(result) == {3: 0.013, 5: 0.007}
    assert result.rows[0].source.row == 3


def test_12_both_rows_of_a_merged_header_count_though_the_upper_one_names_the_convention(
    read, xlsx
):
    def merge(book):
        sheet = book.worksheets[0]
        for cells in ("A1:A2", "B1:B2", "C1:G1"):
            sheet.merge_cells(cells)

    rows = [
        ["Aircraft", "Side", "Clearance [mm] radial"],
        [None, None, *(f"Joint {joint}" for joint in range(1, 6))],
        ["N1", "LH", 0.33, 0.18, 0.2, 0.2, 0.2],
    ]
    result = read(xlsx(rows, merge), "t.xlsx", convention="RADIAL")
    assert [p.cell for p in result.problems] == ["C2", "D2", "E2", "F2", "G2"]
    assert {p.code for p in result.problems} == {"header_doubtful"}


def test_12_a_merged_record_name_is_of_one_inspection_only_in_a_long_table(read, xlsx):
    def merge(book):
        book.worksheets[0].merge_cells("A2:A3")

    header = ["record_id", "tail_no", "side", "clearance_convention", "joint", "clearance_in"]
    rows = [header, ["R1", *GOOD[1:4], 3, 0.013], [None, *GOOD[1:4], 5, 0.007]]
    result = read(xlsx(rows, merge), "t.xlsx")
    assert [dict(row.clearance_in) for row in result.inspections] == [{3: 0.013, 5: 0.007}]
    wide = read(xlsx([HEADER, GOOD, [None, *GOOD[1:]]], merge), "t.xlsx")
    assert [row.record_id for row in wide.rows] == ["R1", None]


def test_12_a_merged_cell_at_the_end_of_a_row_is_read_for_each_row(read, xlsx):
    def merge(book):
        book.worksheets[0].merge_cells("G2:G3")

    rows = [[*HEADER, "technician_id"], [*GOOD, "T1"], ["R2", *GOOD[1:]]]
    result = read(xlsx(rows, merge), "t.xlsx")
    assert [row.technician_id for row in result.inspections] == ["T1", "T1"]


def test_12_an_unknown_header_of_two_rows_is_an_error_and_its_second_row_no_inspection(read, xlsx):
    rows = [["Identity", None, None, None, "Wear", None], ["a", "b", "c", "d", "e", "f"], GOOD]
    result = read(xlsx(rows, two_rows), "t.xlsx")
    assert only(result).code == "header_missing"
    assert not result.rows


def test_12_a_row_of_units_below_the_header_is_read(read, xlsx):
    rows = [
        ["record_id", "tail_no", "side", "clearance_convention", "Joint 3", "Joint 5"],
        [None] * 4 + ["mm", "mm"],
        (*GOOD[:4], 0.33, 0.1778),
    ]
    assert clearances(read(xlsx(rows), "t.xlsx")) == {
        3: pytest.approx(0.33 / 25.4),
        5: pytest.approx(0.007),
    }


@pytest.mark.parametrize("again", [0.001, None])
def test_13_neither_of_two_columns_of_one_header_is_read(read, table, again):
    header = (*HEADER, "clearance_3_in")
    result = read(table(header, [(*GOOD, again)]))
    problem = only(result)
    assert (problem.code, problem.cell, problem.row) == ("header_duplicate", "G1", 1)
    assert isinstance(result.rows[0], InvalidRow)


def test_13_one_joint_in_two_units_is_also_a_duplicate(read, table):
    result = read(table((*HEADER, "clearance_3_mm"), [(*GOOD, 0.33)]))
    assert only(result).code == "header_duplicate"


def test_14_a_header_further_down_is_found_and_said(read, xlsx):
    rows = [["Main landing gear"], [], ["Printed", "2026-03-04"], HEADER, GOOD]
    result = read(xlsx(rows), "t.xlsx")
    assert result.rows[0].source.row == 5
    assert any("header is in row 4" in note for note in result.notes)


def test_14_a_header_below_row_20_is_not_searched_for(read, xlsx):
    rows = [["title"], *([["text"]] * 20), HEADER, GOOD]
    assert only(read(xlsx(rows), "t.xlsx")).code == "header_missing"


def test_15_a_joint_that_the_gear_does_not_have_is_an_error_with_the_nearest_name(read, table):
    result = read(table((*HEADER[:5], "clearance_11_in")))
    problem = only(result)
    assert (problem.code, problem.cell, problem.value) == ("joint_unknown", "F1", "clearance_11_in")
    assert "clearance_1" in problem.remedy
    assert isinstance(result.rows[0], InvalidRow)


def test_15_a_clearance_without_its_joint_is_an_error(read, table):
    assert only(read(table((*HEADER[:5], "clearance_in")))).code == "joint_missing"


def test_15_a_table_without_any_clearance_is_an_error(read, table):
    result = read(table(HEADER[:4], [GOOD[:4]]))
    assert [p.code for p in result.problems] == ["column_missing"]


@pytest.mark.parametrize("header", ["clerance_3_in", "clearence_3_in"])
def test_15_an_entry_error_in_a_header_is_refused_with_the_nearest_name(read, table, header):
    result = read(table((*HEADER[:4], header, "clearance_5_in")))
    problem = only(result)
    assert problem.code == "header_doubtful"
    assert "clearance_3_in" in problem.remedy
    assert "--map" in problem.remedy


# 16 to 20: blanks, zeros, impossible numbers


def test_16_blank_rows_inside_are_skipped_and_the_row_numbers_kept(read, xlsx):
    result = read(
        xlsx([HEADER, GOOD, [], ["  ", None, ""], ("R2", *GOOD[1:4], -1, 0.007)]), "t.xlsx"
    )
    assert [row.source.row for row in result.rows] == [2, 5]
    assert only(result).cell == "E5"


@pytest.mark.parametrize(("cell", "read_as"), [(None, {3: 0.013}), (0, {3: 0.013, 5: 0.0})])
def test_17_18_blank_is_not_measured_and_zero_is_a_measured_zero(read, table, cell, read_as):
    assert clearances(read(table(rows=[(*GOOD[:5], cell)]))) == read_as


def test_18_a_row_of_zeros_is_read_with_a_warning(read, table):
    result = read(table(rows=[(*GOOD[:4], 0, "0.000")]))
    assert clearances(result) == {3: 0.0, 5: 0.0}
    assert any("every clearance is 0" in warning for warning in result.rows[0].warnings)


@pytest.mark.parametrize(
    ("number", "code"),
    [*((text, "not_finite") for text in ("NaN", "1e309", "INF")), ("1e-400", "not_a_length")],
)
def test_20_a_number_cell_that_is_not_finite_or_too_small_to_be_held_is_an_error(
    read, package, number, code
):
    result = read(
        package(_rows_with(f'<c r="E2"><v>{number}</v></c><c r="F2"><v>0.007</v></c>')), "t.xlsx"
    )
    assert only(result).code == code


# 21 to 25: identities, texts and dates


def test_21_the_same_record_twice_is_read_with_a_warning(read, table):
    result = read(table(rows=[GOOD, GOOD]))
    assert not result.problems
    assert len(result.inspections) == 2
    assert "the same inspection as row 2" in result.rows[1].warnings[0]
    assert result.rows[0].warnings == ()


def test_21_two_different_records_under_one_id_are_errors(read, table):
    result = read(table(rows=[GOOD, (*GOOD[:5], 0.001), ("R2", *GOOD[1:])]))
    assert [(p.code, p.cell, p.value) for p in result.problems] == [
        ("record_id_duplicate", "A2", "R1"),
        ("record_id_duplicate", "A3", "R1"),
    ]
    assert [type(row) for row in result.rows] == [InvalidRow, InvalidRow, Inspection]


@pytest.mark.parametrize(
    ("number_format", "tail"), [("000", "007"), ("General", "7")], ids=["zeros", "plain"]
)
def test_22_a_tail_number_stored_as_a_number_is_the_text_that_is_shown(
    read, xlsx, number_format, tail
):
    def change(book):
        book.worksheets[0]["B2"] = 7
        book.worksheets[0]["B2"].number_format = number_format

    assert read(xlsx(change=change), "t.xlsx").rows[0].tail_no == tail


@pytest.mark.parametrize("tail", ["007", "NA", "None", "NULL", "nan", "TRUE"])
def test_22_23_a_tail_number_that_looks_like_nothing_or_a_number_is_text(read, table, tail):
    assert read(table(rows=[("R1", tail, *GOOD[2:])])).rows[0].tail_no == tail


def test_24_a_work_order_that_looks_like_a_number_is_text(read, table, xlsx):
    header = (*HEADER, "work_order")
    assert read(table(header, [(*GOOD, "1E5")])).rows[0].carried["work_order"] == "1E5"
    assert read(xlsx([header, (*GOOD, "1E5")]), "t.xlsx").rows[0].carried["work_order"] == "1E5"


# 26: dates as numbers


@pytest.mark.parametrize(
    "number_format", ["yyyy-mm-dd", "d. mmm yyyy", "[$-409]mmmm d, yyyy;@", "dd/mm/yy hh:mm"]
)
def test_26_a_number_formatted_as_a_date_is_a_date(read, xlsx, number_format):
    def change(book):
        book.worksheets[0]["G2"] = 46085
        book.worksheets[0]["G2"].number_format = number_format

    result = read(xlsx([(*HEADER, "inspection_date"), GOOD], change), "t.xlsx")
    assert result.rows[0].inspection_date == datetime.date(2026, 3, 4)


@pytest.mark.parametrize(("flag", "serial"), [("0", 46085), ("1", 44623), ("true", 44623)])
def test_26_a_date_of_either_system_is_the_same_day(read, package, flag, serial):
    main = "http://schemas.openxmlformats.org/spreadsheetml/2006/main"
    styles = (
        f'<styleSheet xmlns="{main}"><cellXfs><xf numFmtId="0"/><xf'
        ' numFmtId="14"/></cellXfs></styleSheet>'
    )
    data = _rows_with('<c r="E2"><v>0.013</v></c>' + f'<c r="G2" s="1"><v>{serial}</v></c>')
    data = data.replace(
        "</row>", '<c r="G1" t="inlineStr"><is><t>inspection_date</t></is></c></row>', 1
    )
    result = read(
        package(data, styles=styles, book_pr=f'<workbookPr date1904="{flag}"/>'), "t.xlsx"
    )
    assert result.rows[0].inspection_date == datetime.date(2026, 3, 4)


def test_26_a_day_before_march_1900_is_refused(read, xlsx):
    def change(book):
        book.worksheets[0]["G2"] = 12
        book.worksheets[0]["G2"].number_format = "yyyy-mm-dd"

    problem = only(read(xlsx([(*HEADER, "inspection_date"), GOOD], change), "t.xlsx"))
    assert (problem.code, problem.value) == ("date_out_of_range", "12 shown as a date or time")


# 27 to 30: what is shown and what is hidden


def _second_sheet(book, rows=(HEADER, ("X1", *GOOD[1:])), title="Other"):
    sheet = book.create_sheet(title)
    for row in rows:
        sheet.append(list(row))


def test_28_a_hidden_first_sheet_is_not_read(read, xlsx):
    def change(book):
        _second_sheet(book)
        book.worksheets[0].sheet_state = "hidden"
        book.active = 1

    result = read(xlsx(change=change), "t.xlsx")
    assert [row.record_id for row in result.rows] == ["X1"]
    assert any("hidden" in note and "Inspections" in note for note in result.notes)


@pytest.mark.parametrize("state", ["hidden", "veryHidden"])
def test_28_inspections_on_a_hidden_sheet_alone_are_an_error_until_it_is_named(read, xlsx, state):
    def change(book):
        _second_sheet(book, [["Cover"]])
        book.worksheets[0].sheet_state = state
        book.active = 1

    problem = only(read(xlsx(change=change), "t.xlsx"))
    assert (problem.code, problem.sheet) == ("sheet_hidden", "Inspections")
    assert len(read(xlsx(change=change), "t.xlsx", sheet="Inspections").inspections) == 1


def test_29_several_sheets_with_inspections_are_an_error_that_lists_them(read, xlsx):
    result = read(xlsx(change=_second_sheet), "t.xlsx")
    assert only(result).code == "sheet_several"
    assert "'Inspections', 'Other'" in only(result).value
    assert "--sheet" in only(result).remedy
    assert not result.rows


def test_29_a_sheet_of_instructions_is_not_a_candidate_even_with_an_example(read, xlsx):
    def change(book):
        _second_sheet(
            book, [["Instructions"], ["Fill in like this:"], HEADER, ("X1", *GOOD[1:])], "How to"
        )

    assert [r.record_id for r in read(xlsx(change=change), "t.xlsx").rows] == ["R1"]


@pytest.mark.parametrize(("sheet", "records"), [("Other", ["X1"]), ("*", ["R1", "X1"])])
def test_29_the_named_sheet_or_every_sheet_is_read(read, xlsx, sheet, records):
    result = read(xlsx(change=_second_sheet), "t.xlsx", sheet=sheet)
    assert [row.record_id for row in result.rows] == records


def test_29_a_sheet_that_does_not_exist_is_an_error_that_lists_the_others(read, xlsx):
    problem = only(read(xlsx(), "t.xlsx", sheet="March"))
    assert problem.code == "sheet_unknown"
    assert "'Inspections'" in problem.expected


# 31 to 35: text files


@pytest.mark.parametrize(("encoding", "name"), [("cp1252", "Windows-1252"), ("utf-16", "UTF-16")])
def test_32_another_encoding_is_detected_and_said(read, table, encoding, name):
    result = read(table((*HEADER, "remarks"), [(*GOOD, "Bolzen geprüft")]).encode(encoding))
    assert result.rows[0].carried["remarks"] == "Bolzen geprüft"
    assert any(name in note for note in result.notes)


def test_33_semicolons_with_decimal_commas_are_read(read, table):
    assert clearances(read(table(rows=[(*GOOD[:4], "0,013", "0,010")], sep=";"))) == {
        3: 0.013,
        5: 0.010,
    }


def test_34_decimal_commas_in_a_comma_file_are_a_field_count_error(read, table):
    result = read(table(rows=[(*GOOD[:4], "0,013", "0,010"), ("R2", *GOOD[1:])]))
    problem = only(result)
    assert (problem.code, problem.row) == ("row_field_count", 2)
    assert "8 fields" in problem.value
    assert "comma" in problem.remedy
    assert [type(row) for row in result.rows] == [InvalidRow, Inspection]


@pytest.mark.parametrize("line", ["R2,N1,LH,RADIAL,0.013", "R2,N1,LH,RADIAL,0.013,0.007,9"])
def test_35_a_ragged_row_is_an_error_with_its_row_and_the_others_are_read(read, table, line):
    result = read(table() + line + "\n" + "R3,N1,LH,RADIAL,0.013,0.007\n")
    assert (only(result).code, only(result).row) == ("row_field_count", 3)
    assert len(result.inspections) == 2


def test_35_a_zero_character_is_an_error_with_its_row(read, table):
    result = read(table(rows=[GOOD, ("R\0002", *GOOD[1:]), ("R3", *GOOD[1:])]))
    assert (only(result).code, only(result).row) == ("csv_nul", 3)
    assert [type(row) for row in result.rows] == [Inspection, InvalidRow, Inspection]


@pytest.mark.parametrize(
    "change",
    [
        lambda text: b"\xef\xbb\xbf" + text.encode(),
        lambda text: text.replace(",", "\t"),
        lambda text: text.replace("0.007\n", "0.007,,\n"),
    ],
    ids=["byte order mark", "tabs", "empty fields at the end"],
)
def test_31_33_35_what_is_not_part_of_the_table_changes_nothing(read, table, change):
    result = read(change(table()))
    assert clearances(result) == {3: 0.013, 5: 0.007}
    assert not any("byte" in note for note in result.notes)


@pytest.mark.parametrize("line", ["sep=;\n", '"sep=;"\r\n', "SEP=;\r\n"])
def test_35_a_sep_line_is_accepted(read, table, line):
    result = read(line + table(sep=";"))
    assert clearances(result) == {3: 0.013, 5: 0.007}
    assert result.rows[0].source.row == 2


def test_35_a_quotation_mark_that_is_not_closed_loses_no_row(read, table):
    text = (
        table()
        + '"R2,N1,LH,RADIAL,0.013,0.007\nR3,N1,LH,RADIAL,0.013,0.007\nR4,N1,LH,RADIAL,0.013,0.007\n'
    )
    result = read(text)
    assert (only(result).code, only(result).row) == ("csv_quote", 3)
    assert [row.record_id for row in result.inspections] == ["R1", "R3", "R4"]


def test_35_two_stray_quotation_marks_do_not_swallow_the_rows_between_them(read, table):
    text = (
        table()
        + '"R2,N1,LH,RADIAL,0.013,0.007\nR3,N1,LH,RADIAL,0.013,0.007\nR4,N1,LH,RADIAL,0.013,"\n'
    )
    result = read(text)
    assert [row.source.row for row in result.rows] == [2, 3, 4, 5]
    assert [row.record_id for row in result.inspections] == ["R1", "R3"]


def test_35_a_quoted_field_of_two_lines_is_one_field(read, table):
    text = table((*HEADER, "remarks"), [(*GOOD, '"a\nb, c"'), ("R2", *GOOD[1:], "x")])
    result = read(text)
    assert result.rows[0].carried["remarks"] == "a\nb, c"
    assert [row.source.row for row in result.rows] == [2, 3]


# 36 to 40: what is refused before it is parsed


def test_36_a_cell_far_outside_is_refused(read, xlsx):
    problem = only(read(xlsx(change=with_cell(XFD1048576=1)), "t.xlsx"))
    assert (problem.code, problem.cell, problem.sheet) == (
        "cell_outside_limits",
        "XFD1048576",
        "Inspections",
    )


def test_36_the_last_allowed_column_is_read(read, xlsx):
    result = read(
        xlsx(
            change=with_cell(
                **{
                    f"{column_letters(MAX_COLUMNS - 1)}1": "note",
                    f"{column_letters(MAX_COLUMNS - 1)}2": "x",
                }
            )
        ),
        "t.xlsx",
    )
    assert result.rows[0].carried == {"note": "x"}


def test_36_an_empty_formatted_cell_far_outside_is_not_an_error(read, package):
    data = _rows_with('<c r="E2"><v>0.013</v></c><c r="F2"><v>0.007</v></c><c r="XFD2" s="0"/>')
    result = read(
        package(data + '<row r="1048576" hidden="1"><c r="A1048576" s="0"/></row>'), "t.xlsx"
    )
    assert clearances(result) == {3: 0.013, 5: 0.007}


def test_37_a_zip_bomb_is_refused_at_once(read, package):
    bomb = package(sheet_xml=b"<worksheet>" + b" " * 150_000_000)
    assert len(bomb) < 1_000_000
    start = time.process_time()
    problem = only(read(bomb, "t.xlsx"))
    assert problem.code == "file_too_large"
    assert time.process_time() - start < 2 * SLOWER


def test_37_a_workbook_that_lies_about_its_size_is_refused(read, package):
    bomb = package(sheet_xml=b"<worksheet>" + b" " * 220_000_000)
    sizes = struct.pack("<I", 220_000_011)
    assert bomb.count(sizes) == 2
    lying = bomb.replace(sizes, struct.pack("<I", 5000))
    assert only(read(lying, "t.xlsx")).code in ("file_too_large", "file_damaged")


def test_37_a_workbook_that_declares_too_large_a_size_is_refused_before_it_is_unpacked(
    read, package
):
    data = package(parts={"xl/media/big.bin": b"x" * 3_000_000}, compression=zipfile.ZIP_STORED)
    size = struct.pack("<I", 3_000_000)
    # The last one stands in the list of parts: the unpacked size, which here is 83 times the packed
    # one.
    at = data.rfind(size)
    lying = data[:at] + struct.pack("<I", 250_000_000) + data[at + 4 :]
    problem = only(read(lying, "t.xlsx"))
    assert (problem.code, "250 MB" in problem.value) == ("file_too_large", True)


TYPE = '<!DOCTYPE x [<!ENTITY a "0.013">]>'
BOMB = '<!DOCTYPE x [<!ENTITY a "aaaa"><!ENTITY b "&a;&a;&a;">]><sst><si><t>&b;</t></si></sst>'


@pytest.mark.parametrize(
    "parts",
    [
        {"prolog": f'<?xml version="1.0"?>{TYPE}'},
        {"prolog": '<?xml version="1.0"?><!DOCTYPE worksheet SYSTEM "http://example.com/x.dtd">'},
        {"prolog": f'<?xml version="1.0"?><!-- {"a" * 70_000} -->{TYPE}'},
        {"strings": BOMB},
        {
            "sheet_xml": f'<?xml version="1.0" encoding="UTF-16"?>{TYPE}<worksheet/>'.encode(
                "utf-16"
            )
        },
    ],
    ids=["entity", "elsewhere", "behind a long comment", "shared strings", "UTF-16"],
)
def test_38_a_document_type_is_refused(read, package, parts):
    result = read(package(**parts), "t.xlsx")
    assert only(result).code == "xml_declaration"
    assert not result.rows


@pytest.mark.parametrize("reference", ["A1:XFD1048576", "A1", "A1:B1", "nonsense"])
def test_39_a_lying_dimension_is_ignored(read, package, reference):
    assert clearances(read(package(before=f'<dimension ref="{reference}"/>'), "t.xlsx")) == {
        3: 0.013,
        5: 0.007,
    }


def test_40_a_password_protected_workbook_is_named_as_such(read, xlsx):
    msoffcrypto = pytest.importorskip("msoffcrypto.format.ooxml")
    locked = io.BytesIO()
    msoffcrypto.OOXMLFile(io.BytesIO(xlsx())).encrypt("secret", locked)
    problem = only(read(locked.getvalue(), "t.xlsx"))
    assert problem.code == "password_protected"
    assert "copy without" in problem.remedy


def test_40_a_workbook_in_an_encrypted_archive_is_named_as_such(read, package):
    data = bytearray(package())
    at = -1
    while (at := data.find(b"PK\x01\x02", at + 1)) >= 0:
        data[at + 8] |= 1
    assert only(read(bytes(data), "t.xlsx")).code == "password_protected"


# 41 to 44: kinds of file


def test_41_macros_are_ignored_and_said(read, package):
    result = read(package(parts={"xl/vbaProject.bin": b"\xd0\xcf\x11\xe0"}), "t.xlsm")
    assert clearances(result) == {3: 0.013, 5: 0.007}
    assert any("macros" in note and "ignored" in note for note in result.notes)


@pytest.mark.parametrize("name", ["sample.xls", "sample.xlsx"])
def test_42_files_written_by_libreoffice_are_read(read, samples, name):
    result = read((samples / name).read_bytes(), name)
    assert [(r.record_id, r.tail_no) for r in result.inspections] == [("R1", "007"), ("R4", "N3")]
    assert dict(result.rows[0].clearance_in) == {3: 0.013, 5: 0.0065}
    assert result.rows[0].inspection_date == datetime.date(2026, 3, 4)
    assert [(p.cell, p.code) for p in result.problems] == [
        ("H2", "cell_error"),
        ("E3", "cell_error"),
        ("F3", "cell_error"),
        ("E4", "decimal_comma"),
        ("F4", "cell_is_boolean"),
        ("G4", "date_serial"),
    ]
    assert any("hidden sheets were not read: 'Old'" in note for note in result.notes)
    assert any("1 hidden or filtered row" in note for note in result.notes)


def test_42_results_of_formulas_are_counted_where_the_file_marks_them(read, samples):
    data = (samples / "sample.xlsx").read_bytes()
    (told,) = (note for note in read(data, "t.xlsx").notes if "formulas" in note)
    assert told.endswith("column E (1), F (3), H (2)")


@pytest.mark.parametrize(
    ("data", "code", "words"),
    [
        (b"record_id,tail_no\nR1,N1\n", "file_kind", "text file"),
        (b"<html><table><tr><td>record_id</td></tr></table></html>", "file_kind", "web page"),
        (b"\xef\xbb\xbf\r\n<!DOCTYPE html><html></html>", "file_kind", "web page"),
        (b"", "file_empty", "empty"),
        (b"\r\n  ", "file_empty", "nothing but blanks"),
        (b"%PDF-1.7 ...", "file_kind", "PDF"),
        (b"\x89PNG\r\n\x1a\n", "file_kind", "picture"),
        (b"PK\x03\x04" + b"\0" * 40, "file_damaged", "cut off"),
    ],
)
def test_43_another_kind_of_file_under_a_workbook_s_name_is_named_in_plain_words(
    read, data, code, words
):
    problem = only(read(data, "t.xlsx"))
    assert problem.code == code
    assert words in problem.value


@pytest.mark.parametrize("keep", [0.05, 0.5, 0.9, 0.999])
def test_43_a_truncated_workbook_is_named_as_cut_off(read, xlsx, keep):
    data = xlsx()
    problem = only(read(data[: int(len(data) * keep)], "t.xlsx"))
    assert problem.code == "file_damaged"
    assert "cut off" in problem.value


@pytest.mark.parametrize("name", ["t.xlsx", "t.csv", "t"])
@pytest.mark.parametrize(
    ("part", "words"),
    [
        ("word/document.xml", "text document"),
        ("xl/workbook.bin", "xlsb"),
        ("Index/Document.iwa", "Apple Numbers"),
        ("table.csv", "packed folder"),
    ],
)
def test_43_a_package_of_another_program_is_named_in_plain_words(read, part, words, name):
    data = io.BytesIO()
    with zipfile.ZipFile(data, "w") as package:
        package.writestr(part, b"x")
    problem = only(read(data.getvalue(), name))
    assert problem.code == "file_kind"
    assert words in problem.value
    assert "Save it as .xlsx" in problem.remedy


def test_43_bytes_that_are_not_text_are_refused(read):
    assert only(read(bytes(range(256)) * 8, "t.csv")).code == "not_a_table"


def test_44_a_text_in_an_annotated_workbook_is_not_a_formula(tmp_path, read, xlsx):
    from mlg_troubleshoot.records import ReadOptions
    from mlg_troubleshoot.records.annotate import annotate_workbook
    from tests.records.reading import read_inspections

    source, out = tmp_path / "in.xlsx", tmp_path / "out.xlsx"
    source.write_bytes(xlsx())
    result = read_inspections(source, ReadOptions())
    annotate_workbook(source, out, result, {result.rows[0].source: {"=verdict": "=1+1"}})
    sheet = openpyxl.load_workbook(out)["Inspections"]
    assert (sheet["G1"].value, sheet["G1"].data_type) == ("=verdict", "s")
    assert (sheet["G2"].value, sheet["G2"].data_type) == ("=1+1", "s")


@pytest.mark.parametrize(
    "text", ["N/A", "n/a", "-", "\u2014", "NM", "nil", "not measured", "none", " Not Measured "]
)
def test_46_a_word_for_not_measured_is_a_joint_without_a_reading(read, xlsx, text):
    def change(book):
        book.worksheets[0]["E2"] = text

    result = read(xlsx(change=change), "t.xlsx")
    assert not result.problems
    assert result.rows[0].clearance_in == {5: 0.007}
    assert any("1 cell with" in note and "not measured" in note for note in result.notes)


@pytest.mark.parametrize("column", ["margin_in", "tail_no", "side"])
def test_46_no_word_leaves_out_a_margin_or_an_identity(read, table, column):
    cells = dict(zip(HEADER, GOOD, strict=True)) | {column: "-"}
    result = read(table(tuple(cells), [tuple(cells.values())]))
    assert result.problems or result.rows[0].tail_no == "-"


@pytest.mark.parametrize(
    ("header", "column"),
    [
        ("Aircraft", "tail_no"),
        ("A/C Reg", "tail_no"),
        ("Posn", "side"),
        ("Position", "side"),
        ("Jt 3 clr (thou)", "clearance_3_thou"),
        ("Insp Date", "inspection_date"),
    ],
)
def test_47_the_usual_headers_are_read_with_one_note_for_all(read, table, header, column):
    good = dict(zip(HEADER, GOOD, strict=True)) | {
        "inspection_date": "2026-03-04",
        "Jt 7 clr (thou)": 2,
    }
    renamed = {
        (
            header
            if name == column or (column.startswith(name[:11]) and name[:11] == "clearance_3")
            else name
        ): v
        for name, v in good.items()
    }
    result = read(table(tuple(renamed), [tuple(renamed.values())]))
    assert not result.problems
    (note,) = result.notes
    assert f'"{header}" {column}' in note
    assert "clearance_7_thou" in note


def test_47_a_column_with_the_plain_name_goes_before_an_alias(read, table):
    result = read(table((*HEADER, "Aircraft", "Position"), [(*GOOD, "Hawker 800XP", "hangar 3")]))
    assert not result.problems
    assert (result.rows[0].tail_no, result.rows[0].side) == ("N100AB", "LH")
    assert result.rows[0].carried == {"Aircraft": "Hawker 800XP", "Position": "hangar 3"}


@pytest.mark.parametrize(
    "word",
    ["Total", "TOTALS:", "Average", "Signed: J. Smith", "end of list", "Checked by", "Subtotal N1"],
)
def test_50_a_row_of_totals_or_a_signature_is_set_aside(read, table, word):
    rows = [GOOD, (word, None, None, None, 0.02, 0.03), ("R2", *GOOD[1:])]
    result = read(table(rows=rows))
    assert [row.source.row for row in result.rows] == [2, 4]
    assert not result.problems
    assert any(f"1 row set aside by name: row 3 {word!r}" in note for note in result.notes)


def test_50_a_row_of_a_gear_is_not_a_totals_row_however_its_record_is_called(read, table):
    result = read(table(rows=[GOOD, ("Page 7", *GOOD[1:4], None, None)]))
    assert [row.record_id for row in result.rows] == ["R1", "Page 7"]


def test_50_any_other_row_without_a_tail_stays_an_error(read, table):
    assert len(read(table(rows=[GOOD, ("R2", None, None, None, 0.02, 0.03)])).problems) == 3


def test_51_record_ids_that_look_like_joints_leave_a_table_a_table(read, table):
    ids = ["#1", "#2", "#3", '"J1,J2"', "J4"]
    result = read(table(rows=[(record, *GOOD[1:]) for record in ids]))
    assert [row.record_id for row in result.inspections] == ["#1", "#2", "#3", "J1,J2", "J4"]
