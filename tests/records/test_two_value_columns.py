"""Numbers next to joints in more than one column: what was found is read, nothing is dropped
without a word, and what cannot be decided is refused with the columns named.
"""

from __future__ import annotations

import io
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import openpyxl
import pytest

from mlg_troubleshoot.decision.inspection import Inspection
from mlg_troubleshoot.errors import ExitCode
from mlg_troubleshoot.gear.gear_file import load_gear
from mlg_troubleshoot.records import ReadOptions, ReadResult, read_many
from mlg_troubleshoot.units import LengthUnit
from mlg_troubleshoot.workflows.check import check
from tests.cli.conftest import mlg
from tests.records.drawn_sheets import KINDS, drawn
from tests.records.reading import Named

GEAR = load_gear()
OPTIONS = ReadOptions.of(GEAR)
# Each layout twice.
SEEDS = range(2 * len(KINDS))


def workbook(lines: Sequence[Sequence[object]]) -> Named:
    book = openpyxl.Workbook()
    for line in lines:
        book.worksheets[0].append(list(line))
    data = io.BytesIO()
    book.save(data)
    return Named(data.getvalue(), "form.xlsx")


def found_in(result: ReadResult) -> list[tuple[str, dict[int, float]]]:
    """The readings of every visit, by side."""
    rows = [row for row in result.rows if isinstance(row, Inspection) and not row.unit_question]
    visits = [
        (str(row.side), {n: round(value, 6) for n, value in row.clearance_in.items()})
        for row in rows
    ]
    return sorted(visits, key=str)


@pytest.mark.parametrize(
    "seed",
    [pytest.param(n, marks=pytest.mark.slow if n < len(KINDS) else ()) for n in SEEDS],
    ids=lambda seed: f"{drawn(seed).layout} {seed}",
)
def test_what_was_found_is_read_at_every_visit_or_refused_and_no_worn_gear_exits_0(
    seed: int,
) -> None:
    sheet = drawn(seed)
    found = check(Named(sheet.workbook(), "t.xlsx"), advice=False)
    if sheet.can_be_read:
        assert found.problems == ()
        assert found_in(found.read) == sorted(sheet.visits, key=str)
    else:
        assert found_in(found.read) == []
    is_worn = any(max(values.values()) > 0.02 for _, values in sheet.visits)
    assert (found.exit_code is not ExitCode.FINE) or not (is_worn or not sheet.can_be_read)


@pytest.mark.parametrize(
    ("headings", "said"),
    [
        (("new part", "found"), '"J3 (in) found" clearance_3_in'),
        (("new part", "found"), 'carried to the report: "J3 (in) new part"'),
        (("Drawing max", "as found", "as left"), '"J3 (in) as left" clearance_3_in'),
        (("LH", "RH"), '"J3 (in) RH" clearance_3_in'),
    ],
)
def test_the_columns_that_are_read_are_said(headings: tuple[str, ...], said: str) -> None:
    lines = [["Tail", "N1"], ["Side", "LH"], ["Convention", "RADIAL"], ["Item", *headings]]
    lines += [[f"J{n} (in)", *[0.001] * len(headings)] for n in (3, 5)]
    lines = [line for line in lines if line[0] != "Side" or headings[0] != "LH"]
    result = read_many([workbook(lines)], OPTIONS)
    assert said in " ".join(result.notes)


def test_the_columns_are_named_with_the_remedy() -> None:
    lines = [["Tail", "N1"], ["Side", "LH"], ["Convention", "RADIAL"]]
    lines += [["J3 (in)", 0.001, "ok", 0.013], ["J5 (in)", 0.001]]
    three, five = read_many([workbook(lines)], ReadOptions.of(GEAR)).problems
    assert (three.code, three.cell, five.cell) == ("header_duplicate", "D4", "D5")
    assert "B4 'J3 (in)' is one already" in three.expected
    assert "--map D=carry" in three.remedy
    options = ReadOptions.of(GEAR, column_map={"D": "carry"})
    (row,) = read_many([workbook(lines)], options).inspections
    assert dict(row.clearance_in) == {3: 0.001, 5: 0.001}


def test_visits_are_told_apart_where_every_other_column_is_mapped() -> None:
    text = b"Kennz.,Seite,#3 as found (in),#3 as left (in)\nN1,LH,0.013,0.001\n"
    names = {"Kennz.": "tail_no", "Seite": "side"}
    options = ReadOptions.of(GEAR, column_map=names, convention="RADIAL")
    result = read_many([Named(text, "t.csv")], options)
    assert found_in(result) == [("LH", {3: 0.001}), ("LH", {3: 0.013})]


def test_readings_in_front_of_the_joints_are_a_column_and_numbers_of_lines_are_not() -> None:
    lines = [[1, "Tail", "N1"], [2, "Side", "LH"], [3, "Convention", "RADIAL"]]
    joints = [[4, "J3 (in)", 0.001], [5, "J5 (in)", 0.001]]
    options = ReadOptions.of(GEAR)
    assert read_many([workbook([*lines, *joints])], options).problems == ()
    joints = [["0.013 in", "J3 (in)", 0.001], [0.021, "J5 (in)", 0.001]]
    found = read_many([workbook([*lines, *joints])], options).problems
    assert {(problem.code, problem.cell) for problem in found} == {
        ("header_duplicate", "C4"),
        ("header_duplicate", "C5"),
    }


def test_words_next_to_a_reading_are_not_a_second_column() -> None:
    lines = [["Tail", "N1"], ["Side", "LH"], ["Convention", "RADIAL"]]
    lines += [["J3 (in)", 0.001, "ok"], ["J5 (in)", 0.001, "bush no. 2"]]
    read = read_many([workbook(lines)], ReadOptions.of(GEAR))
    assert (len(read.inspections), read.problems) == (1, ())


def test_what_was_not_measured_is_not_taken_from_the_column_of_limits() -> None:
    lines = [["Tail", "N1"], ["Side", "LH"], ["Convention", "RADIAL"], ["", "limit", "found"]]
    lines += [["J3 (in)", 0.0075, 0.001], ["J5 (in)", 0.0075, None], ["Plunger (in)", 0.03, None]]
    (row,) = read_many([workbook(lines)], OPTIONS).rows
    assert isinstance(row, Inspection)
    assert (dict(row.clearance_in), row.readings_in) == ({3: 0.001}, ())


def test_a_line_that_is_not_understood_is_asked_about() -> None:
    lines = [["Tail", "N1"], ["Side", "LH"], ["Convention", "RADIAL"], ["J3 (in)", 0.001]]
    for line in (["Spiel 6", 0.0121], ["Eingefahren", "nein"]):
        (row,) = read_many([workbook([*lines, line])], OPTIONS).rows
        assert isinstance(row, Inspection)
        assert line[0] in row.unit_question


def test_numbers_of_joints_below_a_heading_are_joints() -> None:
    lines = [["Tail", "N1"], ["Side", "LH"], ["Convention", "RADIAL"], ["Unit", "in"]]
    lines += [["Joint", "limit", "found"], [3, 0.0075, 0.001], [5, 0.0075, 0.002]]
    (row,) = read_many([workbook(lines)], OPTIONS).rows
    assert isinstance(row, Inspection)
    assert dict(row.clearance_in) == {3: 0.001, 5: 0.002}


@pytest.mark.parametrize(
    "headings", [("max", "found"), ("old", "new"), ("", "limit"), ("LH", "RH")]
)
def test_what_may_be_a_reading_is_not_taken_for_a_limit(headings: tuple[str, str]) -> None:
    lines = [["Tail", "N1"], ["Side", "LH"], ["Convention", "RADIAL"], ["Item", *headings]]
    lines += [[f"J{n} (in)", 0.001, 0.001] for n in (3, 5)]
    found = read_many([workbook(lines)], OPTIONS)
    assert {problem.code for problem in found.problems} == {"header_doubtful"}
    assert not found.inspections


def test_days_and_sides_of_a_visit_are_its_own() -> None:
    head = ["record_id", "tail", "convention", "J3 LH (in)", "J3 RH (in)"]
    rows = [head, ["R1", "N1", "RADIAL", 0.001, 0.002], ["R2", "N2", "RADIAL", None, 0.003]]
    found = read_many([workbook(rows)], OPTIONS)
    assert [(row.record_id, row.side) for row in found.rows] == [
        ("R1 LH", "LH"),
        ("R1 RH", "RH"),
        ("R2 RH", "RH"),
    ]
    head = ["tail", "side", "convention", "joint", "15 Jan 2025 (in)", "2026-01-15 (in)"]
    rows = [head, ["N1", "LH", "RADIAL", 3, 0.001, 0.002]]
    found = read_many([workbook(rows)], OPTIONS)
    days = [str(row.inspection_date) for row in found.rows if isinstance(row, Inspection)]
    assert days == ["2025-01-15", "2026-01-15"]


@pytest.mark.parametrize("months", [("Jan", "Feb"), ("January 2026", "March 2026")])
def test_months_above_readings_are_visits_without_a_day(months: tuple[str, str]) -> None:
    who = ["N1", "LH", "RADIAL"]
    long = [["tail", "side", "convention", "joint", *months], [*who, 3, 0.001, 0.002]]
    wide = [["tail", "side", "convention", *(f"J3 {each}" for each in months)]]
    wide.append([*who, 0.001, 0.002])
    form = [["Tail", "N1"], ["Side", "LH"], ["Convention", "RADIAL"], ["Item", *months]]
    form += [["J3", 0.001, 0.002], ["J5", 0.001, 0.002]]
    for lines in (long, wide, form):
        found = read_many([workbook(lines)], replace(OPTIONS, unit=LengthUnit.INCH))
        assert [row.clearance_in[3] for row in found.inspections] == [0.001, 0.002]
        assert {(p.code, p.value) for p in found.problems} == {
            ("date_invalid", each.lower()) for each in months
        }


def test_sides_in_the_headings_of_a_table_with_sides_are_refused() -> None:
    head = ["tail", "side", "convention", "J3 LH (in)", "J3 RH (in)"]
    found = read_many([workbook([head, ["N1", "LH", "RADIAL", 0.001, 0.029]])], OPTIONS)
    assert {problem.code for problem in found.problems} == {"header_doubtful"}


def test_a_plunger_whose_visit_is_not_said_is_refused() -> None:
    head = ["tail", "convention", "J3 LH (in)", "J3 RH (in)", "plunger_displacement_in"]
    found = read_many([workbook([head, ["N1", "RADIAL", 0.001, 0.002, 0.06]])], OPTIONS)
    assert [problem.code for problem in found.problems] == ["visit_missing"]
    assert not found.inspections


def test_a_workbook_with_several_visits_in_a_row_is_not_annotated(tmp_path: Path) -> None:
    file = tmp_path / "t.xlsx"
    head = ["tail", "convention", "J3 LH (in)", "J3 RH (in)"]
    file.write_bytes(workbook([head, ["N1", "RADIAL", 0.001, 0.029]]).getvalue())
    done = mlg("check", file, "--annotate", tmp_path / "out.xlsx")
    assert done.code == ExitCode.NOT_WRITTEN
    assert "Give each visit a row" in done.err


@pytest.mark.parametrize("line", [["Outcome", "FAILED"], ["Plunger displacement (in)", 0.0748]])
@pytest.mark.parametrize("label", ["Outcome", "Result 2"])
@pytest.mark.parametrize("at", [3, 4, 99])
def test_what_stands_once_beside_columns_that_are_not_read_counts(line, label, at):
    lines = [["Joint", "New part (in)", "Found (in)"], *([n, 0.0005, 0.001] for n in range(1, 11))]
    who = [["Tail", "N1"], ["Side", "LH"], ["Unit", "in"], ["Convention", "RADIAL"]]
    who.insert(at, [label if line[0] == "Outcome" else line[0], line[1]])
    result = check(workbook([*lines, [], *who]), advice=False)
    assert result.exit_code is not ExitCode.FINE


@pytest.mark.parametrize(
    ("at", "line"),
    [
        (3, ["Plunger (in)", None, 0.06]),
        (3, [None, "Result: FAILED"]),
        (4, [None, "Spiel 6", 0.031]),
        (5, ["Joint 7: 0.03 in"]),
        (6, [None, "Slop", None, None, "0.031"]),
        (7, [None, "Plunger displacement (in)", None, None, 0.06]),
        (8, ["The gear did not retract"]),
        (8, [None, None, "plunger 1.5 mm"]),
        (8, [None, "Outcome", "Plunger: 0.06"]),
    ],
)
def test_what_stands_anywhere_in_a_form_is_read_or_asked_about(at, line):
    lines = [[None, "Tail", "N1"], [None, "Side", "LH"], [None, "Convention", "RADIAL"]]
    lines += [[None, "Unit", "in"], [], [None, "Item", "limit", "found", "Dev"]]
    lines += [[None, f"J{n} (in)", 0.0075, 0.001, 0.0] for n in (3, 5)]
    (without,) = read_many([workbook(lines)], OPTIONS).inspections
    assert (dict(without.clearance_in), without.unit_question) == ({3: 0.001, 5: 0.001}, "")
    result = read_many([workbook([*lines[:at], line, *lines[at:]])], OPTIONS)
    (row,) = result.rows
    if isinstance(row, Inspection):
        assert row.unit_question or row.readings_in or row.clearance_in[7] == 0.03


def test_two_forms_next_to_each_other_are_two_inspections() -> None:
    said = (("Tail", "N1", "N2"), ("Side", "LH", "RH"), ("Convention", "RADIAL", "RADIAL"))
    lines = [
        [label, one, None, label, two] for label, one, two in (*said, ("J3 (in)", 0.001, 0.029))
    ]
    found = read_many([workbook(lines)], OPTIONS)
    assert found.problems == ()
    assert [(row.tail_no, row.side, row.clearance_in[3]) for row in found.inspections] == [
        ("N1", "LH", 0.001),
        ("N2", "RH", 0.029),
    ]


AS_FOUND, AS_LEFT = ("LH", {3: 0.001}), ("LH", {3: 0.002})


@pytest.mark.parametrize(
    ("side", "headers", "visits"),
    [
        ("LH", ("J3 found (in)", "J3 left (in)"), [AS_FOUND, AS_LEFT]),
        ("LH", ("J3 left (in)", "J3 before (in)"), [AS_FOUND, AS_LEFT]),
        (None, ("J3 found LH (in)", "J3 left LH (in)"), [AS_FOUND, AS_LEFT]),
        (None, ("J3 left (in)", "J3 right (in)"), [AS_FOUND, ("RH", {3: 0.002})]),
        (None, ("J3 L/H (in)",), [AS_FOUND]),
        (None, ("Left hand J3 (in)", "Right hand J3 (in)"), [AS_FOUND, ("RH", {3: 0.002})]),
        (None, ("J3 left gear (in)",), [AS_FOUND]),
        ("LH", ("J3 LH side (in)",), [AS_FOUND]),
        ("LH", ("J3 port (in)",), [AS_FOUND]),
        ("LH", ("J3 left (in)",), []),
        (None, ("J3 left (in)",), []),
        ("RH", ("J3 LH (in)",), []),
        ("LH", ("J3 left (in)", "J3 right (in)"), []),
    ],
)
def test_left_is_a_side_or_what_was_left_as_the_headings_next_to_it_say(
    side: str | None, headers: tuple[str, ...], visits: list[object]
) -> None:
    said = ["Side"] if side else []
    rows = [["Tail", "Convention", *said, *headers], ["N1", "RADIAL", *[side] * len(said)]]
    rows[1] += [0.001, 0.002][: len(headers)]
    found = read_many([workbook(rows)], OPTIONS)
    assert found_in(found) == visits
    assert bool(found.problems) is not bool(visits)


@pytest.mark.parametrize(("header", "value"), [("Landings left", 50), ("Margin left (in)", 0.9)])
def test_what_remains_is_not_what_was_left(header: str, value: float) -> None:
    rows = [["Tail", "Convention", "Side", "J3 found (in)", "J3 left (in)", header]]
    found = read_many([workbook([*rows, ["N1", "RADIAL", "LH", 0.001, 0.002, value]])], OPTIONS)
    assert [(row.gear_landings, row.margin_in) for row in found.inspections] == [(None, None)] * 2
