"""Cells that decide about a gear: what everyone reads is read, what nobody can read stops the
row.
"""

from __future__ import annotations

import pytest

from mlg_troubleshoot.decision.inspection import Inspection, InvalidRow, Outcome
from mlg_troubleshoot.records import ReadOptions, read_many

HEALTHY = {f"clearance_{n}_in": "0.001" for n in range(1, 11)}


def table(tmp_path, **columns):
    """Write one sound row with further columns."""
    row = {
        "record_id": "R1",
        "tail_no": "N1",
        "side": "LH",
        "clearance_convention": "RADIAL",
        **HEALTHY,
        **columns,
    }
    file = tmp_path / "t.csv"
    file.write_text("\n".join((",".join(row), ",".join(map(str, row.values())))) + "\n")
    return file


def one(tmp_path, gear, **columns):
    (row,) = read_many([table(tmp_path, **columns)], ReadOptions.of(gear)).rows
    return row


WORDS = {
    Outcome.FAILED: (
        *("fail", "FAIL", "Failed", "Failed to retract", "NG", "n.g.", "did not retract"),
    ),
    Outcome.RETRACTED: ("pass", "OK", "ok", "Passed", "RETRACTED", "retracts"),
}


@pytest.mark.parametrize("header", ["Gear result", "Retraction result", "outcome", "Retracted?"])
@pytest.mark.parametrize("outcome", WORDS)
def test_words_for_what_the_gear_did_are_read(tmp_path, gear, header, outcome):
    for word in WORDS[outcome]:
        assert one(tmp_path, gear, **{header: word}).outcome is outcome, word


@pytest.mark.parametrize("header", ["Gear result", "outcome"])
@pytest.mark.parametrize("word", ["no", "yes"])
def test_yes_and_no_under_a_header_that_asks_nothing_stop_the_row(tmp_path, gear, header, word):
    assert isinstance(one(tmp_path, gear, **{header: word}), InvalidRow)


@pytest.mark.parametrize(
    ("convention", "stated", "taken"), [("TOTAL_PLAY", 0.0373, True), ("RADIAL", 0.0373, False)]
)
def test_the_limit_of_a_gauge_uncertainty_counts_on_its_radial_value(
    tmp_path, gear, convention, stated, taken
):
    row = one(tmp_path, gear, clearance_convention=convention, gauge_u_in=stated)
    assert isinstance(row, Inspection) is taken
    assert not taken or row.gauge_u_in == pytest.approx(stated / 2)


def test_without_a_convention_a_gauge_uncertainty_may_be_one_of_total_play(tmp_path, gear):
    read = read_many(
        [table(tmp_path, clearance_convention="", gauge_u_in=0.0373)], ReadOptions.of(gear)
    )
    assert [problem.column for problem in read.problems] == ["clearance_convention"]


@pytest.mark.parametrize(
    "header", ["Plunger (in)", "plunger_in", "plunger reading [in]", "Measured plunger (in)"]
)
def test_usual_headers_of_a_plunger_reading_are_understood(tmp_path, gear, header):
    assert one(tmp_path, gear, **{header: "0.045"}).readings_in == (0.045,)


@pytest.mark.parametrize(
    ("header", "word", "column"),
    [
        ("Reading", "diametral", "clearance_convention"),
        ("Reading", "total play", "clearance_convention"),
        ("u/m", "mm", "unit"),
        ("u/m", "mils", "unit"),
    ],
)
def test_a_column_that_contradicts_the_convention_or_the_unit_is_asked_about(
    tmp_path, gear, header, word, column
):
    row = one(tmp_path, gear, **{header: word})
    assert f"{header}={column}" in row.unit_question


@pytest.mark.parametrize(("header", "word"), [("u/m", "inches"), ("Reading", "Radial")])
def test_a_column_that_agrees_with_unit_or_convention_is_only_carried(tmp_path, gear, header, word):
    assert one(tmp_path, gear, **{header: word}).carried[header] == word


@pytest.mark.parametrize("word", ["?", "-", "n/a", "N/A", "unknown", "TBD"])
def test_gears_that_nobody_can_name_are_not_one_gear(tmp_path, word):
    read = read_many([table(tmp_path, tail_no=word)], ReadOptions())
    assert not read.inspections
    assert [(problem.cell, problem.value) for problem in read.problems] == [("B2", word)]


def test_a_tail_may_begin_with_such_a_word(tmp_path):
    read = read_many([table(tmp_path, tail_no="NA-1")], ReadOptions())
    assert read.inspections[0].tail_no == "NA-1"
