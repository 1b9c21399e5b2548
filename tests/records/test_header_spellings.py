"""Headers as people write them: understood and said, or doubtful and asked for, never guessed."""

from __future__ import annotations

import pytest

from mlg_troubleshoot.decision.inspection import Inspection, InvalidRow
from mlg_troubleshoot.errors import UsageError
from mlg_troubleshoot.records.headers import Joints

HEADER = ("record_id", "tail_no", "side", "clearance_convention")
GOOD = ("R1", "N1", "LH", "RADIAL")

UNDERSTOOD = {
    "Joint 3 (in)": ("in", 0.013),
    "J3 [mm]": ("mm", 0.3302),
    "Clearance #3 – short link inner (in)": ("in", 0.013),
    "Clearance #3: short link inner bearing [in]": ("in", 0.013),
    "Joint 3 short link inner bearing joint (in)": ("in", 0.013),
    "CLEARANCE 3 IN": ("in", 0.013),
    "Joint No. 3 (thou)": ("thou", 13),
    "Joint 3 in mm": ("mm", 0.3302),
    'J3 (")': ("in", 0.013),
    "#3 (in)": ("in", 0.013),
    "J3\u00a0(in) *": ("in", 0.013),
}


@pytest.mark.parametrize("header", UNDERSTOOD)
def test_a_close_variant_is_understood_and_the_mapping_shown(read, xlsx, header):
    unit, value = UNDERSTOOD[header]
    result = read(xlsx([(*HEADER, header), (*GOOD, value)]), "t.xlsx")
    assert result.rows[0].clearance_in[3] == pytest.approx(0.013)
    assert any(f'" clearance_3_{unit}' in note for note in result.notes)


DOUBTFUL = [
    *("Clearance #3 – short link outer (in)", "J3 (cm)", "Clearance 3 (in/mm)"),
    *("Clearance 3 (in) mm", "Joint 3 limit (in)", "Joint 3 old (in)", "J3 radial (in)"),
    *("Play J3 (in)", "Joint 3/5 (in)", "clearance_3_in_old"),
]


@pytest.mark.parametrize("header", DOUBTFUL)
def test_a_doubtful_header_is_refused_with_a_hint_to_map_it(read, table, header):
    result = read(table((*HEADER, "clearance_1_in", header), [(*GOOD, 0.001, 0.013)]))
    (problem,) = result.problems
    assert (problem.code, problem.row, problem.cell, problem.value) == (
        "header_doubtful",
        1,
        "F1",
        header,
    )
    assert "--map" in problem.remedy
    assert isinstance(result.rows[0], InvalidRow)
    assert result.rows[0].correct == (header,)


@pytest.mark.parametrize("header", ["Joint three (in)", "3 (in)", "3", "Short link inner (in)"])
@pytest.mark.parametrize("outcome", ["", "RETRACTED"])
def test_what_may_be_a_clearance_is_asked_about_and_refused_where_no_other_is(
    read, table, header, outcome
):
    cells = (*GOOD, outcome, 0.001, 13)
    result = read(table((*HEADER, "outcome", "clearance_1_in", header), [cells]))
    assert f'"{header}=clearance_' in result.rows[0].unit_question
    result = read(table((*HEADER, "outcome", "remarks", header), [cells]))
    assert [(p.code, p.cell) for p in result.problems] == [("header_doubtful", "G1")]
    assert f'"{header}=clearance_' in result.problems[0].remedy
    assert isinstance(result.rows[0], InvalidRow)


def test_a_row_with_nothing_under_a_doubtful_header_is_still_read(read, table):
    result = read(
        table(
            (*HEADER, "clearance_1_in", "Play J3"),
            [(*GOOD, 0.001, None), ("R2", *GOOD[1:], 0.001, 0.013)],
        )
    )
    assert [type(row) for row in result.rows] == [Inspection, InvalidRow]


@pytest.mark.parametrize("key", ["Play J3", "  play  j3 ", "F"])
def test_a_mapped_header_is_read_as_the_caller_says(read, table, key):
    text = table((*HEADER, "clearance_1_in", "Play J3"), [(*GOOD, 0.001, 0.33)])
    result = read(text, column_map={key: "clearance_3_mm"})
    assert not result.problems
    assert result.rows[0].clearance_in[3] == pytest.approx(0.33 / 25.4)
    assert any('"Play J3" clearance_3_mm' in note for note in result.notes)
    result = read(text, column_map={key: "carry"})
    assert result.rows[0].clearance_in == {1: 0.001}
    assert result.rows[0].carried == {"Play J3": "0.33"}


def test_mapping_to_a_column_that_does_not_exist_is_a_usage_error(read, table):
    with pytest.raises(UsageError, match="clearance_42_in"):
        read(
            table((*HEADER, "clearance_1_in", "x"), [(*GOOD, 0.001, 1)]),
            column_map={"x": "clearance_42_in"},
        )


def test_mapping_a_header_that_is_not_there_is_a_problem(read, table):
    result = read(
        table((*HEADER, "clearance_1_in"), [(*GOOD, 0.001)]),
        column_map={"Spiel 3": "clearance_3_mm"},
    )
    assert [(p.code, p.value) for p in result.problems] == [("map_header_unknown", "Spiel 3")]


@pytest.mark.parametrize(
    ("headers", "cells", "carried"),
    [
        (("Stroke (mm)",), (17,), {"Stroke (mm)": "17"}),
        (("Joint 3 remarks",), ("worn",), {"Joint 3 remarks": "worn"}),
        (("Remarks", "Comments"), ("a", "b"), {"remarks": "a", "Comments": "b"}),
        (("remarks", "remarks"), ("a", "b"), {"remarks": "a", "remarks (again)": "b"}),
    ],
)
def test_a_column_that_no_one_knows_is_kept_and_named(read, table, headers, cells, carried):
    result = read(table((*HEADER, "clearance_3_in", *headers), [(*GOOD, 0.013, *cells)]))
    assert not result.problems
    assert result.rows[0].carried == carried
    if "Stroke (mm)" in headers:
        assert any('carried to the report: "Stroke (mm)"' in note for note in result.notes)


@pytest.mark.parametrize(
    ("header", "known"),
    [
        ("Clearance #3 – drag strut knuckle (in)", [False, True]),
        ("Clearance #2 – locking pin (in)", [True, False]),
    ],
)
def test_the_names_of_the_joints_are_those_of_the_gear_that_is_given(read, table, header, known):
    text = table((*HEADER, header), [(*GOOD, 0.013)])
    other = Joints(names=("", "torque link", "drag strut knuckle"))
    assert [not read(text, **more).problems for more in ({}, {"joints": other})] == known


def test_a_misspelt_optional_column_is_kept_and_its_likely_name_given(read, table):
    result = read(table((*HEADER, "clearance_3_in", "temprature_c"), [(*GOOD, 0.013, 20)]))
    assert not result.problems
    assert any("temperature_c" in note and "--map" in note for note in result.notes)
