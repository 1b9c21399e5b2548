"""A form or a list of joints with numbers in two columns: never one of them without a word.

Sheets are drawn: what stands next to each joint, under which headings, how the numbers are written.
"""

from __future__ import annotations

import io
import random
from collections.abc import Sequence

import openpyxl
import pytest

from mlg_troubleshoot.decision.assessment import Verdict
from mlg_troubleshoot.gear.gear_file import load_gear
from mlg_troubleshoot.records import ReadOptions, read_many
from mlg_troubleshoot.workflows.check import check
from tests.records.reading import Named

GEAR = load_gear()
CORNERS = ("Item", "Location", "Pos.", "No.", "Bearing", "Joint", "Jt", "", None)
HEADINGS = (
    ("new part", "found"),
    ("Drawing max", "Found today"),
    ("nominal", "actual"),
    ("last year", "today"),
    ("LH", "RH"),
    ("limit", "measured"),
    ("2024-01-15", "2025-01-15", "2026-01-15"),
    ("Trial1", "Trial2", "Trial3"),
    (None, None),
)
LABELS = ("#{n} {name}", "Joint {n}", "J{n}", "Jt {n}", "Clearance {n}")
WRITTEN = (float, str, "{:.4f} in".format, "{:.4f}\xa0in".format)
SHEETS = 60


def drawn(seed: int) -> list[list[object]]:
    """A sheet whose gear is outside by one of its columns, and within by the others."""
    rng = random.Random(seed)
    headings = rng.choice(HEADINGS)
    outside = rng.randrange(1, len(headings))
    write = rng.choice(WRITTEN)
    label = rng.choice(LABELS)
    lines: list[list[object]] = [["Tail number", "N801HK"], ["Side", "LH"]]
    lines += [["Convention", "RADIAL"], ["Unit", "in"]]
    rng.shuffle(lines)
    if rng.random() < 0.5:
        lines.insert(0, ["Main landing gear link inspection"])
    corner = rng.choice(CORNERS)
    lines += [[], [corner, *headings]] * (corner is not None)
    # A column between that holds words only.
    words = rng.random() < 0.3
    for joint in GEAR.joints:
        worn = 0.029 if joint.number in (3, 5) else 0.003
        values = [write(worn if i == outside else 0.001) for i in range(len(headings))]
        if words:
            values.insert(1, "ok")
        lines.append([label.format(n=joint.number, name=joint.name), *values])
    return lines


def workbook(lines: Sequence[Sequence[object]]) -> Named:
    book = openpyxl.Workbook()
    for line in lines:
        book.worksheets[0].append(list(line))
    data = io.BytesIO()
    book.save(data)
    return Named(data.getvalue(), "form.xlsx")


@pytest.mark.parametrize("seed", range(SHEETS))
def test_no_drawn_sheet_with_two_columns_of_numbers_is_within(seed: int) -> None:
    result = check(workbook(drawn(seed)), advice=False)
    assert result.counts[Verdict.WITHIN_MARGIN] == 0
    assert result.exit_code
    assert result.problems


def test_the_columns_are_named_with_the_remedy() -> None:
    lines = [["Tail", "N1"], ["Side", "LH"], ["J3 (in)", 0.001, "ok", 0.013], ["J5 (in)", 0.001]]
    (problem,) = read_many([workbook(lines)], ReadOptions.of(GEAR)).problems
    assert problem.code == "form_columns"
    assert "columns B, D" in str(problem.value)
    assert "Delete the columns" in problem.remedy


def test_readings_in_front_of_the_joints_are_a_column_and_numbers_of_lines_are_not() -> None:
    lines = [[1, "Tail", "N1"], [2, "Side", "LH"], [3, "Convention", "RADIAL"]]
    joints = [[4, "J3 (in)", 0.001], [5, "J5 (in)", 0.001]]
    options = ReadOptions.of(GEAR)
    assert read_many([workbook([*lines, *joints])], options).problems == ()
    joints = [["0.013 in", "J3 (in)", 0.001], [0.021, "J5 (in)", 0.001]]
    (problem,) = read_many([workbook([*lines, *joints])], options).problems
    assert "columns A, C" in str(problem.value)


def test_words_next_to_a_reading_are_not_a_second_column() -> None:
    lines = [["Tail", "N1"], ["Side", "LH"], ["Convention", "RADIAL"]]
    lines += [["J3 (in)", 0.001, "ok"], ["J5 (in)", 0.001, "bush no. 2"]]
    read = read_many([workbook(lines)], ReadOptions.of(GEAR))
    assert (len(read.inspections), read.problems) == (1, ())
