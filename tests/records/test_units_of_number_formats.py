"""A unit that only the number format of a cell shows counts like a unit written in the cell."""

from __future__ import annotations

from pathlib import Path

import pytest

from mlg_troubleshoot.decision.inspection import Inspection, InvalidRow
from mlg_troubleshoot.records.cells import NumberFormat, OddCell, OddKind

HEADER = (
    *("record_id", "tail_no", "side", "clearance_convention", "clearance_3_thou", "clearance_5"),
    *("temperature_c", "gear_landings", "work_order"),
)
ROW = ("R1", "N1", "LH", "RADIAL", 0.5, 0.33, 10, 1200, 12)


@pytest.fixture
def formatted(read, xlsx):
    """Read one row with the formats of some of its cells."""

    def run(header=HEADER, row=ROW, options=None, **formats):
        def change(book):
            for column, code in formats.items():
                book.worksheets[0][f"{column}2"].number_format = code

        return read(xlsx((header, row), change), "t.xlsx", **(options or {"unit": "thou"}))

    return run


def only(result):
    (problem,) = result.problems
    return problem


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
    header = (*HEADER[:4], "clearance_3_mm", *HEADER[5:])
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
    row = (*ROW[:5], 0.3456, *ROW[6:])
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
    row = (*ROW[:5], 0, *ROW[6:])
    assert only(formatted(row=row, F='0.00;-0.00;"not read"')).value == "not read"


def test_a_negative_length_in_a_section_of_its_own_keeps_unit_and_sign(formatted):
    header = (*HEADER[:8], "plunger_displacement")
    row = (*ROW[:8], -0.5)
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
