"""Outcomes and readings under headers that are not understood: asked about, never passed over."""

from __future__ import annotations

import pytest

from mlg_troubleshoot.decision.assessment import Judgement, Verdict
from mlg_troubleshoot.decision.inspection import Inspection, InvalidRow, Outcome
from mlg_troubleshoot.gear.gear_file import load_gear
from mlg_troubleshoot.records import ReadOptions, ReadResult, read_many
from mlg_troubleshoot.workflows.check import check
from tests.records.reading import Named

GEAR = load_gear()
ALL = ["record_id", "tail_no", "side", "clearance_convention"]
ALL += [f"clearance_{n}_in" for n in range(1, 11)]
GOOD = ["R1", "N1", "LH", "RADIAL", *["0.001"] * 10]
# Headers of a column that asks what the gear did, and what a yes to it means.
NEGATED = (
    *("not_retracted", "Not retracted", "Not-retracted", "Not\u2010retracted", "NOT RETRACTED?"),
    *("not retracted (y/n)", "Not_retracted_y_n", "Failed?", "failed_(y/n)", "Gear failed [Y/N]"),
)
AFFIRMED = ("retracted", "Retracted?", "gear_retracted", "retracted (y/n)", "Retracted yes/no")
# Headers of a column that only travels to the report, whatever is in it.
CARRIED = (
    *("Result 2026", "Retraction 1", "Result (2nd try)", "status 2", "remarks", "Ergebnis 3"),
    *("Joint 6 status", "col7", "2"),
)
PLUNGER = (
    *("Plunger reading 1", "Plunger displ.", "RV plunger", "plunger 1st", "plunger pos.", "RV 1"),
    *("Plunger mid-position", "plunger_mm_read", "Plunger (measured)", "reversing valve", "Plgr"),
)
JOINTS = (
    *("6 extension lever end (in)", "play 6 (in)", "radial 6 (in)", "extension lever end"),
    *("play 6", "6 play", "reading 6", "value 6", "c6 measured", "gap #6", "pos 6", "Spiel 6"),
    *("6a", "Lever end 6", "bellcrank", "wear 6 thou", "total play 6", "6 found", ""),
)
MARGINS = (
    *("Margin of gear", "allowed displacement in", "rig margin", "Margin as rigged", "MARGIN 2"),
    *("Allowable travel (thou)", "permitted travel", "tolerance in", "Marginal travel allowed"),
)


def judged(headers: list[str], cells: list[str], **declared: object) -> Judgement:
    text = ",".join([*ALL, *headers]) + "\n" + ",".join([*GOOD, *cells]) + "\n"
    result = check(Named(text.encode(), "t.csv"), advice=False, **declared)
    (judgement,) = result.judgements
    return judgement


def read(headers: list[str], rows: list[list[str]]) -> ReadResult:
    lines = [",".join(headers), *(",".join(row) for row in rows)]
    return read_many([Named("\n".join(lines).encode(), "t.csv")], ReadOptions.of(GEAR))


@pytest.mark.parametrize("answer", ["yes", "TRUE", "1", "y"])
@pytest.mark.parametrize("header", [*NEGATED, *AFFIRMED])
def test_a_question_is_answered_as_it_was_asked(header: str, answer: str) -> None:
    (row,) = read([*ALL, header], [[*GOOD, answer]]).rows
    assert isinstance(row, Inspection)
    assert row.outcome is (Outcome.FAILED if header in NEGATED else Outcome.RETRACTED)


@pytest.mark.parametrize("header", ["Retracts OK?", "no retraction", "hyd failure", "2 failed"])
@pytest.mark.parametrize("answer", ["yes", "N", "1", "TRUE"])
def test_an_answer_under_a_question_that_is_not_understood_stops_the_row(
    header: str, answer: str
) -> None:
    assert judged([header], [answer]).verdict is Verdict.INVALID


@pytest.mark.parametrize("word", ["FAILED", "fail", "failed!", "did not retract", "NOT OK"])
@pytest.mark.parametrize("header", CARRIED)
def test_a_failure_is_seen_whatever_the_header_is(header: str, word: str) -> None:
    (row,) = read([*ALL, header], [[*GOOD, word]]).rows
    assert isinstance(row, InvalidRow)


@pytest.mark.parametrize("value", ["0.06", "0.06 in", "1.5 mm"])
@pytest.mark.parametrize("header", PLUNGER[:-1])
def test_a_number_that_may_be_of_the_plunger_is_asked_about(header: str, value: str) -> None:
    assert judged([header], [value]).verdict is not Verdict.WITHIN_MARGIN


@pytest.mark.parametrize("value", ["0.0121", "0.0121 in", "12.1 thou", "0.31"])
@pytest.mark.parametrize("header", JOINTS)
def test_a_number_that_may_be_a_clearance_is_asked_about(header: str, value: str) -> None:
    assert judged([header], [value]).verdict is not Verdict.WITHIN_MARGIN


@pytest.mark.parametrize("value", ["0.005", "5 thou", "0.12 mm"])
@pytest.mark.parametrize("header", MARGINS)
def test_a_number_that_may_be_the_margin_of_the_gear_is_asked_about(
    header: str, value: str
) -> None:
    assert judged([header], [value]).verdict is not Verdict.WITHIN_MARGIN


@pytest.mark.parametrize("header", ["Plunger reading 1", "play 6", "rig margin"])
def test_carry_answers_the_question(header: str) -> None:
    asked = judged([header], ["0.0121"])
    assert asked.verdict is Verdict.INCOMPLETE
    assert f'"{header}=carry"' in asked.row.unit_question
    declared = {"column_map": {header: "carry"}}
    assert judged([header], ["0.0121"], **declared).verdict is Verdict.WITHIN_MARGIN


@pytest.mark.parametrize(
    ("header", "value"),
    [
        ("limit 6 (in)", "0.0075"),
        ("Limit", "0.0075"),
        ("cycles", "12"),
        ("week 3", "17"),
        ("mod 2", "1"),
        ("OAT", "21.5"),
        ("joint 6 part no", "9"),
        ("plunger s/n", ""),
    ],
)
def test_other_numbers_are_carried(header: str, value: str) -> None:
    assert judged([header], [value]).verdict is Verdict.WITHIN_MARGIN


def test_a_second_column_of_numbers_in_a_list_of_joints_is_asked_about() -> None:
    header = [*ALL[:4], "joint", "clearance_in", "found"]
    rows = [[*GOOD[:4], str(n), "0.001", "0.0121"] for n in range(1, 11)]
    (row,) = read(header, rows).rows
    assert isinstance(row, Inspection)
    assert '--map "found=' in row.unit_question
