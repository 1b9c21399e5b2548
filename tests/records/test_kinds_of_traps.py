"""Kinds of traps that sheets of fleets showed, each with siblings: never another number or another
aircraft without a word.
"""

from __future__ import annotations

import datetime
import io
from collections.abc import Callable

import openpyxl
import pytest
from openpyxl.cell.rich_text import CellRichText, TextBlock
from openpyxl.cell.text import InlineFont
from openpyxl.styles import Font
from openpyxl.worksheet.worksheet import Worksheet

from mlg_troubleshoot.decision.inspection import Inspection, InvalidRow
from mlg_troubleshoot.gear.gear_file import load_gear
from mlg_troubleshoot.records import ReadOptions, ReadResult, read_many
from tests.records.reading import Named

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
