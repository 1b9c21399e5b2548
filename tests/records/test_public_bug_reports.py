"""What public reports say other readers of spreadsheets get wrong: read, or refused in words."""

from __future__ import annotations

import re

import pytest

from mlg_troubleshoot.decision.inspection import Inspection, InvalidRow
from tests.records.conftest import rows_xml
from tests.records.reading import GOOD, HEADER

HEAD = ",".join(HEADER)
WIDE = "R1,N100AB,LH,RADIAL,{}"
LONG = "record_id,tail_no,side,clearance_convention,joint,qualifier,clearance_in\n"
FORM = "Tail: N1,Side: LH,\nConvention: RADIAL,,\n{}1,0.005,0.001\n3,0.0075,0.022\n"
HEADED = "Joint,Limit,Found (in)\n"
MERGED = '<mergeCells><mergeCell ref="{}"/></mergeCells>'
RUNS = "<si><r><t>{}</t></r><r><rPr><strike/></rPr><t>{}</t></r><r><t>{}</t></r></si>"


@pytest.mark.parametrize(
    ("report", "text", "bad"),
    [
        ("pandas 14124", f"{HEAD}\n{WIDE.format('0.003,0.002,')}\n", []),
        ("pandas 50304", f"{HEAD}\n{WIDE.format('0.003,0.002,0.021')}\n", ["row_field_count"]),
        ("pandas 64821", f"{HEAD}\n{WIDE.format('0.003,0.002')} ,\n", []),
        ("pandas 17869", f"{HEAD}\n{WIDE.format('0.0_03,0.002')}\n", ["not_a_length"]),
        ("pandas 40583", f"{HEAD}\n{WIDE.format('#0.003,0.002')}\n", ["not_a_length"]),
        ("readr 1413", f"{HEAD}\n{WIDE.format(chr(34) + '0,3' + chr(34))},\n", ["decimal_comma"]),
        ("dmm_util 26", f"{HEAD}\n{WIDE.format('9.9e+37,OL')}\n", ["clearance_out_of_range"]),
        ("CleverCSV 35", f"at,{HEAD}\n10:43:05,{WIDE.format('0.003,0.002')}\n", []),
        ("OpenRefine 423", f"{HEAD}\n5E1,5E2,LH,RADIAL,0.003,0.002\n", []),
        ("vincentlaucsb 151", f'{HEAD}\n{WIDE.format("0.003,")}""', []),
    ],
)
def test_a_row_of_text_is_whole_or_named(read, report, text, bad):
    result = read(text)
    (row,) = result.rows
    assert [problem.code for problem in result.problems][:1] == bad
    assert isinstance(row, InvalidRow if bad else Inspection)


@pytest.mark.parametrize("above", [">", "≥", "greater than"])
def test_above_in_a_column_of_its_own_is_asked_about(read, above):
    # bcgov/wqbc 69: the letter of a result beside its number.
    (row,) = read(f"{LONG}R1,N1,LH,RADIAL,3,{above},0.005\nR1,N1,LH,RADIAL,5,,0.002\n").rows
    assert "write > in front of its number" in row.unit_question


def test_rows_without_a_number_stand_where_their_cells_do(read, package):
    # readxl 671, office-kit/xlsx 158: a row may leave its number to its cells.
    data = rows_xml([HEADER, GOOD]).replace('<row r="2">', "<row>")
    result = read(package(re.sub(r'r="(\w)2"', r'r="\g<1>9"', data)), "t.xlsx")
    assert [row.source.row for row in result.inspections] == [9]


@pytest.mark.parametrize("runs", [("0.0", "0", "21"), ("0.02", "1", ""), ("", "0.001", "0.021")])
def test_a_number_of_which_a_part_is_struck_through_is_not_read(read, package, runs):
    # spreadsheet-cfml 57.
    data = rows_xml([HEADER, GOOD]).replace("<v>0.013</v>", "<v>0</v>")
    data = data.replace('<c r="E2">', '<c r="E2" t="s">')
    (problem,) = read(package(data, strings=_strings(RUNS.format(*runs))), "t.xlsx").problems
    assert (problem.cell, problem.value) == ("E2", "{}~~{}~~{}".format(*runs))


def _strings(items: str) -> str:
    space = "http://schemas.openxmlformats.org/spreadsheetml/2006/main"
    return f'<sst xmlns="{space}">{items}</sst>'


@pytest.mark.parametrize("cells", ["E2:F2", "E2:E3"])
def test_a_reading_that_is_merged_over_others_is_said(read, package, cells):
    # readxl 220: the first cell alone is filled.
    other = ["R2", "N2", "LH", "RADIAL", None, 0.001]
    rows = [HEADER, [*GOOD[:5], None], other]
    result = read(package(rows_xml(rows), after=MERGED.format(cells)), "t.xlsx")
    assert any("1 reading merged over cells read as blank: E2" in note for note in result.notes)


@pytest.mark.parametrize("name", ["N100AB Total", "Group 3 average", "LH max"])
def test_a_subtotal_below_its_group_is_set_aside(read, name):
    # CrestApps.Core 160.
    group = f"{WIDE.format('0.003,0.002')}\n{name},,,,0.003,0.002\n"
    result = read(f"{HEAD}\n{group}Grand total,,,,0.003,0.002\n")
    assert [row.record_id for row in result.rows] == ["R1"]
    assert any("2 rows set aside" in note for note in result.notes)


def test_each_table_on_a_sheet_is_read_by_its_own_header(read):
    # Chicago/clear-water 26: three sheets with a second header, its columns in another order.
    other = "tail_no,side,clearance_convention,record_id,clearance_5_mm,clearance_3_mm"
    rows = f"{WIDE.format('0.003,0.002')}\n{other}\nN2,RH,RADIAL,R1,-1,0.33\n{HEAD}\n"
    result = read(f"{HEAD}\n{rows}R1,N3,LH,RADIAL,0.004,0.001\n")
    assert [row.source.row for row in result.rows] == [2, 4, 6]
    assert dict(result.rows[1].understood.clearance_in) == {3: pytest.approx(0.33 / 25.4)}
    found = {(problem.code, problem.cell) for problem in result.problems}
    again = {("record_id_duplicate", cell) for cell in ("A2", "D4", "A6")}
    assert found == {("clearance_negative", "E4"), *again}


@pytest.mark.parametrize("joint", ["#3 short link inner bearing", "3 Short link inner", "03"])
def test_a_joint_is_named_by_its_number_and_its_name(read, joint):
    (row,) = read(f"{LONG}R1,N1,LH,RADIAL,{joint},,0.013\n").rows
    assert dict(row.clearance_in) == {3: 0.013}


@pytest.mark.parametrize("joint", ["#3 short link outer bearing", "-3", "3/5", "3 mm", "3 or 5"])
def test_a_joint_that_is_named_in_two_ways_is_refused(read, joint):
    (problem,) = read(f"{LONG}R1,N1,LH,RADIAL,{joint},,0.013\n").problems
    assert problem.code == "joint_unknown"


@pytest.mark.parametrize(
    "plunger", ["Plunger displacement (in),{},", "Plunger displacement (in),,{}"]
)
def test_a_form_says_its_unit_above_the_readings_and_its_plunger_above_that(read, plunger):
    (row,) = read(FORM.format(plunger.format(0.046) + "\n" + HEADED)).rows
    assert (row.tail_no, row.side, row.unit_question) == ("N1", "LH", "")
    assert (dict(row.clearance_in), row.readings_in) == ({1: 0.001, 3: 0.022}, (0.046,))


@pytest.mark.parametrize(
    ("line", "filled"),
    [
        ("Plunger displacement: 0.046 in", "readings_in"),
        ("Outcome: FAILED", "outcome"),
        ("Result: FAILED", "unit_question"),
        ("The gear did not retract", "unit_question"),
        ("Joint 5: 0.3 mm", "entered"),
    ],
)
def test_a_line_in_one_cell_is_read(read, line, filled):
    (row,) = read(FORM.format(f"{line}\n{HEADED}")).rows
    without = read(FORM.format(HEADED)).rows[0]
    assert getattr(row, filled) != getattr(without, filled)


def test_a_line_in_one_cell_says_where_it_is_wrong(read):
    (problem,) = read(FORM.format(HEADED).replace("Side: LH", "Side: up")).problems
    assert (problem.cell, problem.value) == ("B1", "up")


@pytest.mark.parametrize("label", ["Joint 3 (mm)", "clearance_3_mm"])
def test_a_unit_below_a_header_that_states_another_one_is_refused(read, label):
    head = HEAD.replace("clearance_3_in", label).replace("_5_in", "_5")
    (problem, *_) = read(f"{head}\n,,,,in,in\n{WIDE.format('0.003,0.002')}\n").problems
    assert (problem.code, problem.cell) == ("header_doubtful", "E2")
