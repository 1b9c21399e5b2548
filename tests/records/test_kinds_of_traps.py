"""Cells that show something else than they hold: marks, strokes, percents, units of formats."""

from __future__ import annotations

import datetime
import io
from collections.abc import Callable
from pathlib import Path

import openpyxl
import pytest
from openpyxl.cell.rich_text import CellRichText, TextBlock
from openpyxl.cell.text import InlineFont
from openpyxl.styles import Font
from openpyxl.worksheet.worksheet import Worksheet

from mlg_troubleshoot.decision.inspection import Inspection, InvalidRow
from mlg_troubleshoot.gear.gear_file import load_gear
from mlg_troubleshoot.records import ReadOptions, ReadResult, read_many
from mlg_troubleshoot.records.cells import NumberFormat, OddCell, OddKind
from tests.records.reading import Named, only

HEADER = ["record_id", "tail_no", "side", "clearance_convention", "clearance_3_in"]
HEADER += ["inspection_date", "gear_landings", "remarks"]
OPTIONS = ReadOptions.of(load_gear())
ROW = ["R1", "N801HK", "LH", "RADIAL", 0.009, "2026-01-15", 1200, "worn"]


def written(change: Callable[[Worksheet], object], *rows: list[object]) -> ReadResult:
    book = openpyxl.Workbook()
    sheet = book.worksheets[0]
    for row in (HEADER, *(rows or [ROW])):
        sheet.append(row)
    change(sheet)
    data = io.BytesIO()
    book.save(data)
    return read_many([Named(data.getvalue(), "t.xlsx")], OPTIONS)


def lines(*rows: str, header: str = ",".join(HEADER)) -> ReadResult:
    return read_many([Named("\n".join([header, *rows]).encode(), "t.csv")], OPTIONS)


@pytest.mark.parametrize(("cell", "text"), [("B2", "N801HK"), ("E2", "0.009"), ("H2", "worn")])
def test_the_mark_of_a_footnote_is_no_digit(cell: str, text: str) -> None:
    mark = TextBlock(InlineFont(vertAlign="superscript"), "1")

    def change(sheet: Worksheet) -> None:
        sheet[cell] = CellRichText(text, mark)

    (row,) = written(change).rows
    assert isinstance(row, Inspection)
    assert (row.tail_no, row.clearance_in[3], row.carried["remarks"]) == ("N801HK", 0.009, "worn")


@pytest.mark.parametrize("cells", [["E2"], ["B2", "E2"], [f"{c}2" for c in "ABCDEFGH"]])
def test_cells_that_are_struck_through_are_said(cells: list[str]) -> None:
    def change(sheet: Worksheet) -> None:
        for cell in cells:
            sheet[cell].font = Font(strike=True)

    (note,) = written(change).notes
    assert "cells that are struck through were also read: column" in note
    assert all(f"{cell[0]} (1)" in note for cell in cells)


@pytest.mark.parametrize("shown", ["0%", "0.00%", '0.0"%"', '0.00" ‰"'])
def test_a_reading_that_is_shown_in_percent_is_a_cell_to_correct(shown: str) -> None:
    def change(sheet: Worksheet) -> None:
        sheet["E2"].number_format = shown

    found = written(change)
    assert [problem.cell for problem in found.problems] == ["E2"]
    assert isinstance(found.rows[0], InvalidRow)


@pytest.mark.parametrize(
    ("number", "shown"), [(801, '"N"000"HK"'), (100000, "0.00E+00"), (7, '"R"0'), (5, '0" LH"')]
)
@pytest.mark.parametrize("cell", ["A2", "B2"])
def test_a_name_that_is_shown_otherwise_than_it_is_stored_is_refused(cell, number, shown):
    def change(sheet: Worksheet) -> None:
        sheet[cell] = number
        sheet[cell].number_format = shown

    (problem,) = written(change).problems
    assert (problem.cell, problem.code) == (cell, "number_shown_otherwise")


@pytest.mark.parametrize("shown", ["0.00E+00", "##0.0E+0", "General", "0.0"])
def test_a_reading_is_taken_as_it_is_stored(shown: str) -> None:
    def change(sheet: Worksheet) -> None:
        sheet["E2"].number_format = shown

    (row,) = written(change).rows
    assert isinstance(row, Inspection)
    assert row.clearance_in[3] == 0.009


@pytest.mark.parametrize("tail", ['"=""N801HK"""', "'N801HK", '="N801HK"', "N801HK"])
def test_what_protects_a_text_from_a_spreadsheet_program_is_not_part_of_it(tail: str) -> None:
    (row,) = lines(f"R1,{tail},LH,RADIAL,'0.009,2026-01-15,1200,it's worn").rows
    assert isinstance(row, Inspection)
    assert (row.tail_no, row.clearance_in[3]) == ("N801HK", 0.009)
    assert row.carried["remarks"] == "it's worn"


@pytest.mark.parametrize("text", ["1.200", "12.000", "1,200", "1200.5", 1200.5])
def test_landings_are_whole(text: object) -> None:
    quoted = f'"{text}"'
    (problem,) = lines(f"R1,N1,LH,RADIAL,0.009,2026-01-15,{quoted},").problems
    assert (problem.cell, problem.code) == ("G2", "ambiguous_number")


def test_a_row_behind_the_sign_of_a_comment_is_set_aside_and_named() -> None:
    rows = ["A1,N1,LH,RADIAL,0.001,,,", "# second hangar", "#A2,N2,LH,RADIAL,0.001,,,"]
    found = lines(*rows)
    assert [row.record_id for row in found.rows] == ["A1"]
    assert "row 4 '#A2'" in " ".join(found.unread)
    found = lines(*rows, "#A3,N3,LH,RADIAL,0.029,,,")
    assert isinstance(found.rows[-1], InvalidRow)


def test_ids_may_begin_with_the_sign_of_a_comment() -> None:
    found = lines("#1,N1,LH,RADIAL,0.001,,,", "#2,N2,LH,RADIAL,0.001,,,")
    assert [row.record_id for row in found.rows] == ["#1", "#2"]


def test_blanks_in_front_of_quotes_are_read() -> None:
    header = ", ".join(f'"{name}"' for name in HEADER)
    (row,) = lines(
        '"R1", "N1", "LH", "RADIAL", "0.009", "2026-01-15", "1200", "a, b"', header=header
    ).rows
    assert isinstance(row, Inspection)
    assert row.carried["remarks"] == "a, b"


def test_days_that_a_program_may_have_swapped_are_noted() -> None:
    def rows(*days: object) -> list[list[object]]:
        return [[f"R{n}", f"N{n}", *ROW[2:5], day, *ROW[6:]] for n, day in enumerate(days)]

    swapped = rows(datetime.date(2026, 3, 2), "25/02/2026", datetime.date(2026, 11, 5))
    assert "may have been swapped" in " ".join(written(lambda _: None, *swapped).notes)
    right = rows(datetime.date(2026, 3, 2), "25/02/2026", datetime.date(2026, 3, 25))
    assert "may have been swapped" not in " ".join(written(lambda _: None, *right).notes)


def test_a_day_without_dashes_is_a_day() -> None:
    (row,) = lines("R1,N1,LH,RADIAL,0.009,20260115,1200,").rows
    assert isinstance(row, Inspection)
    assert str(row.inspection_date) == "2026-01-15"


@pytest.mark.parametrize("header", ["Result", "Test result", "Ergebnis"])
def test_a_result_that_may_be_of_the_inspection_is_asked_about(header: str) -> None:
    head = ",".join([*HEADER, header])
    found = lines("R1,N1,LH,RADIAL,0.009,,,,FAIL", "R2,N2,LH,RADIAL,0.001,,,,OK", header=head)
    assert all(isinstance(each, Inspection) for each in found.rows)
    assert [bool(each.unit_question) for each in found.rows] == [True, False]
    assert found.rows[1].outcome is None


FORMATTED_HEADER = (
    *("record_id", "tail_no", "side", "clearance_convention", "clearance_3_thou", "clearance_5"),
    *("temperature_c", "gear_landings", "work_order"),
)
FORMATTED_ROW = ("R1", "N1", "LH", "RADIAL", 0.5, 0.33, 10, 1200, 12)


@pytest.fixture
def formatted(read, xlsx):
    """Read one row with the formats of some of its cells."""

    def run(header=FORMATTED_HEADER, row=FORMATTED_ROW, options=None, **formats):
        def change(book):
            for column, code in formats.items():
                book.worksheets[0][f"{column}2"].number_format = code

        return read(xlsx((header, row), change), "t.xlsx", **(options or {"unit": "thou"}))

    return run


MILLIMETRES = [
    *('0.00" mm"', "0.00\\ \\m\\m", "0.00[$ mm]", "0.00[$mm-409]", 'General" mm"'),
    *('0.00" mm";-0.00" mm"', '0.00" mm";;"nil"', '0.00" mm";@', '[Red]0.0_)" mm"'),
    '0.00" millimetres"',
]


@pytest.mark.parametrize("code", MILLIMETRES)
def test_a_number_shown_in_millimetres_under_a_header_in_thou_is_refused(formatted, code):
    result = formatted(E=code)
    problem = only(result)
    assert (problem.code, problem.cell) == ("unit_contradiction", "E2")
    assert isinstance(result.rows[0], InvalidRow)


def test_the_problem_shows_the_cell_as_it_is_seen_and_says_what_to_do(formatted):
    problem = only(formatted(E='0.00" mm"'))
    assert problem.value == "0.5 mm"
    assert "number format of the cell says mm, the column says thou" in problem.remedy
    assert "19.685 (thou)" in problem.remedy
    assert "format the cell as a plain number" in problem.remedy


@pytest.mark.parametrize("code", ['0.000" in"', '0.000\\"', "0.000''", "0.000[$ inch]"])
def test_a_number_shown_in_inches_under_a_header_in_millimetres_is_refused(formatted, code):
    header = (*FORMATTED_HEADER[:4], "clearance_3_mm", *FORMATTED_HEADER[5:])
    assert only(formatted(header, E=code)).code == "unit_contradiction"


@pytest.mark.parametrize("code", MILLIMETRES)
def test_under_a_header_without_a_unit_the_unit_of_the_format_is_the_unit(formatted, code):
    (row,) = formatted(F=code).rows
    assert row.clearance_in[5] == pytest.approx(0.33 / 25.4)


def test_the_unit_of_the_format_that_the_header_states_is_read(formatted):
    result = formatted(E='0.0" thou"')
    assert not result.problems
    assert result.rows[0].clearance_in[3] == 0.0005


def test_the_stored_number_is_read_and_not_the_one_that_is_shown(formatted):
    row = (*FORMATTED_ROW[:5], 0.3456, *FORMATTED_ROW[6:])
    (read,) = formatted(row=row, F='0" mm"').rows
    assert read.clearance_in[5] == 0.3456 / 25.4


@pytest.mark.parametrize("code", ['0.00" furlongs"', '[<1]0.00" mm";0.00" in"', '"unread"'])
def test_words_that_are_not_a_unit_are_refused_like_words_in_the_cell(formatted, code):
    problem = only(formatted(F=code))
    assert (problem.code, problem.cell) == ("not_a_length", "F2")


PLAIN = [
    *("0.000", "#,##0.00", "0.00E+00", '_-* #,##0.00_-;-* #,##0.00_-;_-* "-"??_-;_-@_-'),
    *("[Red]0.0;[Blue]-0.0", "# ?/?", "0.00_)", "@", "0.000;-0.000;0.000;@"),
]


@pytest.mark.parametrize("code", PLAIN)
def test_a_format_without_words_changes_nothing(formatted, code):
    result = formatted(E=code, F=code)
    assert not result.problems
    assert result.rows[0].clearance_in == {3: 0.0005, 5: 0.00033}


def test_a_zero_that_its_format_shows_as_a_word_is_not_a_measured_zero(formatted):
    row = (*FORMATTED_ROW[:5], 0, *FORMATTED_ROW[6:])
    assert only(formatted(row=row, F='0.00;-0.00;"not read"')).value == "not read"


def test_a_negative_length_in_a_section_of_its_own_keeps_unit_and_sign(formatted):
    header = (*FORMATTED_HEADER[:8], "plunger_displacement")
    row = (*FORMATTED_ROW[:8], -0.5)
    (read,) = formatted(header, row, I='0.00" mm";[Red]-0.00" mm"').rows
    assert read.readings_in == (pytest.approx(-0.5 / 25.4),)


def test_a_temperature_shown_in_another_unit_is_a_problem(formatted):
    problem = only(formatted(G='0" °F"'))
    assert (problem.column, problem.value) == ("temperature_c", "10 °F")


@pytest.mark.parametrize(("column", "code"), [("G", '0.0" °C"'), ("H", '#,##0" landings"')])
def test_numbers_shown_in_the_unit_of_their_column_are_read(formatted, column, code):
    result = formatted(**{column: code})
    assert not result.problems
    assert (result.rows[0].temperature_c, result.rows[0].gear_landings) == (10.0, 1200.0)


def test_words_around_a_number_that_is_a_text_change_nothing(formatted):
    (row,) = formatted(I='"WO-"0').rows
    assert row.carried["work_order"] == "12"


def test_readings_of_a_joint_in_two_units_contradict_each_other(read, xlsx):
    def change(book):
        book.worksheets[0]["F2"].number_format = '0.0" mm"'

    header = ("record_id", "tail_no", "side", "clearance_convention", "joint", "clearance")
    rows = [("R1", "N1", "LH", "RADIAL", 3, 0.5), ("R1", "N1", "LH", "RADIAL", 3, 0.5)]
    result = read(xlsx((header, *rows), change), "t.xlsx", unit="thou")
    assert only(result).code == "joint_twice"


def test_a_joint_whose_number_is_shown_with_words_is_that_joint(read, xlsx):
    def change(book):
        book.worksheets[0]["E2"].number_format = '"Joint "0'

    header = ("record_id", "tail_no", "side", "clearance_convention", "joint", "clearance_in")
    result = read(xlsx((header, ("R1", "N1", "LH", "RADIAL", 3, 0.005)), change), "t.xlsx")
    assert result.rows[0].clearance_in == {3: 0.005}


@pytest.mark.parametrize("suffix", ["xlsx", "xls"])
def test_units_of_formats_are_seen_in_workbooks_of_libreoffice(read, samples: Path, suffix):
    result = read((samples / f"formats.{suffix}").read_bytes(), f"t.{suffix}")
    assert [(p.code, p.cell, p.value) for p in result.problems] == [
        ("unit_contradiction", "E2", "0.5 mm"),
        ("unit_contradiction", "F2", "0.33 mm"),
        ("not_a_number", "H2", "10 °F"),
    ]
    good = result.rows[1]
    assert isinstance(good, Inspection)
    assert good.clearance_in == {3: 0.0005, 5: 0.0033, 7: pytest.approx(0.25 / 25.4)}
    assert (good.gear_landings, good.carried) == (1200.0, {"work_order": "12"})


def test_which_of_two_units_in_sections_is_meant_is_not_guessed() -> None:
    shown = NumberFormat.of('0.0 "in";0.0 "mm"')
    assert shown is not None
    cell = shown.cell(-1.5, epoch_1904=False)
    assert isinstance(cell, OddCell)
    assert cell.text == "-1.5 in or -1.5 mm"


def test_a_number_that_is_shown_with_two_digits_is_read_with_its_zero() -> None:
    shown = NumberFormat.of("00")
    assert shown is not None
    assert shown.cell(7.0, epoch_1904=False) == OddCell(OddKind.PADDED, "07", None, 7.0)
