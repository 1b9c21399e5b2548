"""Sheets that are left out, tails that look alike and numbers that vanish: each is said."""

from __future__ import annotations

import io

import openpyxl
import pytest

from mlg_troubleshoot.decision.inspection import InvalidRow
from mlg_troubleshoot.errors import ExitCode, UsageError
from mlg_troubleshoot.gear.gear_file import load_gear
from mlg_troubleshoot.records import ReadOptions, ReadResult, read_many
from mlg_troubleshoot.records.annotate import write_template
from mlg_troubleshoot.units import parse_length
from mlg_troubleshoot.workflows.check import check
from tests.cli.conftest import HAND, mlg
from tests.records.reading import Named

HEADER = ["record_id", "tail_no", "side", "clearance_convention"]
HEADER += [f"clearance_{n}_in" for n in range(1, 11)]
GOOD = ["R1", "N1", "LH", "RADIAL", *[0.001] * 10]
WORN = ["R2", "N2", "LH", "RADIAL", *[0.03] * 10]


def workbook(second: list[list[object]], *, hidden: bool = False) -> Named:
    book = openpyxl.Workbook()
    for row in (HEADER, GOOD):
        book.worksheets[0].append(row)
    sheet = book.create_sheet("Other")
    for row in second:
        sheet.append(row)
    if hidden:
        sheet.sheet_state = "hidden"
    data = io.BytesIO()
    book.save(data)
    return Named(data.getvalue(), "t.xlsx")


@pytest.mark.parametrize("sheet", [None, "*"])
@pytest.mark.parametrize(
    ("above", "hidden"),
    [([["Instructions"]], False), ([], True), ([["x"]] * 25, False), ([["instructions:"]], True)],
)
def test_a_sheet_of_inspections_that_is_left_out_is_not_a_success(above, hidden, sheet):
    result = check(workbook([*above, HEADER, WORN], hidden=hidden), advice=False, sheet=sheet)
    assert [j.row.record_id for j in result.judgements] == ["R1"]
    assert result.unread_files == ("t.xlsx, sheet 'Other'",)
    assert result.exit_code is ExitCode.ATTENTION
    assert any("'Other'" in note and "not read" in note for note in result.notes)


@pytest.mark.parametrize("hidden", [False, True])
@pytest.mark.parametrize("rows", [[["LH"], ["RH"]], [["Instructions"], ["Fill in the table."]]])
def test_a_sheet_without_inspections_may_be_left_out(rows, hidden):
    result = check(workbook(rows, hidden=hidden), advice=False)
    assert (result.unread_files, result.exit_code) == ((), ExitCode.FINE)


def test_the_instructions_of_the_template_are_not_inspections(tmp_path) -> None:
    path = tmp_path / "t.xlsx"
    write_template(path, load_gear())
    book = openpyxl.load_workbook(path)
    sheet = book["Inspections"]
    places = {cell.value: cell.column for cell in sheet[1]}
    for name, value in zip(HEADER, GOOD, strict=True):
        sheet.cell(2, places[name]).value = value
    book.save(path)
    assert check(path, advice=False).exit_code is ExitCode.FINE


def tails(one: str, two: str) -> ReadResult:
    text = f"record_id,tail_no,side,clearance_3_in\nR1,{one},LH,0.001\nR2,{two},LH,0.001\n"
    return read_many([Named(text.encode(), "t.csv")], ReadOptions.of(load_gear(), unit=None))


@pytest.mark.parametrize(
    "other",
    [
        *("\uff2e801\uff28\uff2b", "N801\u041d\u041a", "\u039d801HK", "N801\u0397K", "n801hk"),
        *("N801.HK", "N8O1HK", "N\u2011801HK"),
    ],
)
def test_a_tail_that_looks_like_another_is_taken_as_that_and_said(other: str) -> None:
    found = tails("N801HK", other)
    assert any("are taken as one aircraft" in note for note in found.notes)
    assert {row.tail_no for row in found.rows} == {"N801HK"}


@pytest.mark.parametrize("unseen", "\u00ad\ufe0f\u034f\u3164\u200b\u200e\u2060\u115f\U000e0020")
def test_what_nobody_sees_in_a_tail_is_left_out(unseen: str) -> None:
    found = tails("N801HK", f"N801{unseen}HK")
    assert {row.tail_no for row in found.rows} == {"N801HK"}


@pytest.mark.parametrize("number", ["1e-400", "9e-3000", "0.1E-999 in"])
@pytest.mark.parametrize("column", ["clearance_3_in", "plunger_displacement_in", "margin_in"])
def test_a_number_too_small_to_be_held_is_not_a_measured_zero(column: str, number: str) -> None:
    header = [*HEADER[:4], "clearance_5_in", column]
    text = ",".join(header) + f"\nR1,N1,LH,RADIAL,0.001,{number}\n"
    (row,) = read_many([Named(text.encode(), "t.csv")], ReadOptions.of(load_gear())).rows
    assert isinstance(row, InvalidRow)


def test_such_a_number_in_a_workbook_is_not_a_measured_zero(read, package) -> None:
    cells = "".join(
        f'<c r="{c}1" t="inlineStr"><is><t>{name}</t></is></c>'
        for c, name in zip("ABCDE", [*HEADER[:4], "clearance_3_in"], strict=True)
    )
    row = "".join(
        f'<c r="{c}2" t="inlineStr"><is><t>{value}</t></is></c>'
        for c, value in zip("ABCD", GOOD[:4], strict=True)
    )
    data = f'<row r="1">{cells}</row><row r="2">{row}<c r="E2"><v>1e-400</v></c></row>'
    (problem,) = read(package(data), "t.xlsx").problems
    assert (problem.cell, problem.value) == ("E2", "1e-400")


def test_such_a_number_by_hand_is_refused() -> None:
    with pytest.raises(UsageError, match="too small"):
        parse_length("1e-400 in")
    done = mlg(*HAND, "--convention", "RADIAL", "--set", "3=1e-400in")
    assert done.code == ExitCode.USAGE


def test_a_written_zero_is_a_zero() -> None:
    assert [parse_length(text).value for text in ("0", "0.000 in", "0e-400")] == [0.0] * 3
