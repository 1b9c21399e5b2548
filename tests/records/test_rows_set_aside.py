"""Words of statistics count in the place of a name, and no row that is set aside hides a
finding.
"""

from __future__ import annotations

import io

import openpyxl
import pytest

from mlg_troubleshoot.decision.inspection import Inspection, InvalidRow
from mlg_troubleshoot.gear.gear_file import load_gear
from mlg_troubleshoot.records import ReadOptions, ReadResult, read_many
from mlg_troubleshoot.units import ClearanceConvention
from tests.cli.conftest import mlg
from tests.records.reading import Named

OPTIONS = ReadOptions.of(load_gear(), convention=ClearanceConvention.RADIAL)
LONG = "who,record_id,tail_no,side,joint,clearance_in\n"
WIDE = "tail_no,clearance_3_in,clearance_5_in,plunger_displacement_in,outcome\n"
# As people are called, and rows of a table.
WORDS = (
    *("Max", "Min", "Page", "Key", "Std", "Total", "Sum", "Mean", "Average", "Count", "Limit"),
    *("Median", "End", "Date", "Name", "Note", "Legend", "Stamp", "Nil"),
)


def read(text: str, name: str = "t.csv") -> ReadResult:
    return read_many([Named(text.encode(), name)], OPTIONS)


@pytest.mark.parametrize("word", WORDS)
@pytest.mark.parametrize("name", ["{}", "{} Meier", "{}-1"])
def test_a_reading_counts_whoever_took_it(word: str, name: str) -> None:
    person = name.format(word)
    (row,) = read(f"{LONG}Anna,R1,N1,LH,3,0.001\n{person},R1,,,6,0.0121\n").rows
    assert isinstance(row, Inspection)
    assert dict(row.clearance_in) == {3: 0.001, 6: 0.0121}


def test_a_reading_counts_whoever_took_it_in_merged_cells() -> None:
    book = openpyxl.Workbook()
    sheet = book.worksheets[0]
    sheet.title = "LH"
    for row in (
        ["who", "record_id", "tail_no", "joint", "clearance_in"],
        ["Anna", "R1", "N1", 1, 0.001],
        ["Max", "R1", None, 4, 0.0333],
    ):
        sheet.append(row)
    sheet.merge_cells("C2:C3")
    data = io.BytesIO()
    book.save(data)
    (row,) = read_many([Named(data.getvalue(), "t.xlsx")], OPTIONS).rows
    assert isinstance(row, Inspection)
    assert row.clearance_in[4] == 0.0333


@pytest.mark.parametrize("word", WORDS)
def test_a_tail_that_begins_like_a_statistic_is_a_gear(word: str) -> None:
    (row,) = read(f"{WIDE}{word}-1,0.013,0.002,,\n", "fleet LH.csv").rows
    assert row.tail_no == f"{word}-1"
    assert isinstance(row, Inspection)


@pytest.mark.parametrize(
    "name", ["Max", "Average:", "Grand Total", "N801HK Average", "Ø", "Mittelwert", "UCL"]
)
def test_a_statistic_in_the_place_of_a_tail_is_set_aside_and_named(name: str) -> None:
    found = read(f"{WIDE}N1,0.001,0.002,,\n{name},0.001,0.0075,,\n", "fleet LH.csv")
    assert [row.tail_no for row in found.rows] == ["N1"]
    (said,) = found.unread
    assert f"row 3 {name!r}" in said


@pytest.mark.parametrize("cells", ["0.0076,,,", ",0.2,,", ",,0.031,", ",,-0.06,", ",,,FAILED"])
@pytest.mark.parametrize("word", ["Max", "Limit", "Total"])
def test_a_statistic_that_no_row_bears_out_is_a_row_to_correct(word: str, cells: str) -> None:
    found = read(f"{WIDE}N1,0.001,0.002,0.001,\n{word},{cells}\n", "fleet LH.csv")
    assert [type(row) for row in found.rows] == [Inspection, InvalidRow]
    (problem,) = found.problems
    assert (problem.code, problem.row) == ("row_aside", 3)


def test_the_maximum_of_a_gear_over_its_limit_is_a_statistic() -> None:
    found = read(f"{WIDE}N1,0.013,0.002,,\nN2,0.001,0.001,,\nMax,0.013,0.002,,\n", "LH.csv")
    assert [row.tail_no for row in found.rows] == ["N1", "N2"]
    assert found.problems == ()


@pytest.mark.parametrize(
    "words", ["joint 3 read 0.013", "#6 12.1 thou", "plunger 1.5 mm", "Clearance of 5: .014"]
)
@pytest.mark.parametrize("table", [f"{LONG}Anna,R1,N1,LH,3,0.001", f"{WIDE}N1,0.001,0.002,,"])
def test_a_reading_in_words_below_the_table_is_a_row_to_correct(table: str, words: str) -> None:
    commas = "," * table.partition("\n")[0].count(",")
    for line in (f"Remark: {words}{commas}", f"Remark,{words}{commas[1:]}"):
        found = read(f"{table}\n{line}\n", "LH.csv")
        assert [type(row) for row in found.rows] == [Inspection, InvalidRow]
        assert found.problems


def test_a_joint_and_its_reading_are_never_set_aside() -> None:
    found = read(f"{LONG}Anna,R1,N1,LH,3,0.001\n,Remark,,,6,0.0070\n")
    assert [type(row) for row in found.rows] == [Inspection, InvalidRow]


@pytest.mark.parametrize(
    "name",
    [
        *("Signed: J. Smith 12.03.2026", "Notes: gauge 7 at 21.5 C", "Signed: J. Smith", "Page 7"),
        *("Key", "-----"),
    ],
)
def test_words_without_a_reading_are_set_aside(name: str) -> None:
    found = read(f"{WIDE}N1,0.001,0.002,,\n{name},,,,\n", "fleet LH.csv")
    assert [row.tail_no for row in found.rows] == ["N1"]
    assert len(found.unread) == 1


@pytest.mark.parametrize(("cells", "code"), [("0.001", 0), ("0.0121", 1)])
def test_what_was_set_aside_is_said_by_a_quiet_check_and_decides_its_exit_code(
    tmp_path, cells, code
):
    header = "tail_no," + ",".join(f"clearance_{n}_in" for n in range(1, 11))
    file = tmp_path / "LH.csv"
    good = ",".join(["0.001"] * 10)
    file.write_text(f"{header}\nN1,{good}\nMax,{','.join([cells] * 10)}\n")
    done = mlg("check", str(file), "--convention", "RADIAL", "-q")
    assert done.code == code
    assert "'Max'" in done.err


@pytest.mark.parametrize(
    "above",
    [
        "A/C Reg,Posn,Jt 3 clr (in),Result\nN2,LH,0.012,\n",
        "tail_no,side,plunger_displacement_thou\nN2,LH,60\n",
        "N2,LH,0.002,0.06\n",
        "Plunger displacement (in),0.060\n",
        "Outcome,FAILED\n",
        "Plunger: 0.060\n",
        "The gear of N2 did not retract on 3 May\n",
    ],
)
def test_a_finding_above_the_header_is_a_row_to_correct(above: str) -> None:
    found = read(f"{above}{WIDE}N1,0.001,0.002,,\n", "LH.csv")
    assert [type(row) for row in found.rows] == [InvalidRow, Inspection]
    assert {problem.code for problem in found.problems} == {"row_above"}


@pytest.mark.parametrize(
    "above",
    ["Inspection of 2026-03-04,,0.5", "outcome: RETRACTED or FAILED", "#3 (in)", "Limit,0.0075"],
)
def test_a_title_above_the_header_is_no_finding(above: str) -> None:
    found = read(f"{above}\n{WIDE}N1,0.001,0.002,,\n", "LH.csv")
    assert [type(row) for row in found.rows] == [Inspection]


def test_a_failure_in_words_below_the_table_is_a_row_to_correct_unless_a_row_says_it() -> None:
    line = "Note: failed to retract on 3 May,,,,\n"
    for outcome, kinds in (("", [Inspection, InvalidRow]), ("FAILED", [Inspection])):
        found = read(f"{WIDE}N1,0.001,0.002,,{outcome}\n{line}", "LH.csv")
        assert [type(row) for row in found.rows] == kinds


@pytest.mark.parametrize("words", ["plunger 1.5 mm", "joint 3 read 0.013", "Result: FAILED"])
def test_words_behind_the_last_column_of_a_table_are_asked_about(words: str) -> None:
    book = openpyxl.Workbook()
    sheet = book.worksheets[0]
    sheet.title = "LH"
    sheet.append(["tail_no", "clearance_3_in", "clearance_5_in"])
    sheet.append(["N1", 0.001, 0.001, None, words])
    data = io.BytesIO()
    book.save(data)
    (row,) = read_many([Named(data.getvalue(), "t.xlsx")], OPTIONS).inspections
    assert words in row.unit_question
