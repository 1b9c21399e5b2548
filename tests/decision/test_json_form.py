"""The JSON contract of ``mlg check --json``: its keys, and null without a number."""

from __future__ import annotations

import pandas as pd
import pytest

from mlg_troubleshoot.decision.inspection import InvalidRow, Outcome, Side
from mlg_troubleshoot.decision.judge_rows import assess
from mlg_troubleshoot.errors import Problem
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.indices.index_table import IndexTable
from mlg_troubleshoot.workflows.check import CheckResult, check
from tests.decision.conftest import Judge, every_joint

INSPECTION = {
    *("record_id", "tail_no", "side", "verdict", "predicted_displacement_in", "over_travel_in"),
    *("under_travel_in", "predicted_upper_in", "margin_in", "remaining_in"),
    *("standard_uncertainty_in", "probability_within_margin"),
    *("probability_exceed_random_directions", "measured_displacement_in", "geometry_spread_in"),
    *("joints", "next_action", "repair_sets", "warnings"),
}
JOINT = {
    *("joint", "name", "clearance_in", "over_limit", "contribution_in", "first_order"),
    *("total_order", "plunger_amplification", "rank"),
}
PROBLEM = Problem(
    "negative", "a.csv", None, 2, "clearance_3_in", "F2", "-1", "0 or more", "Correct the cell."
)


@pytest.fixture
def form(gear: Gear, table: IndexTable, judge: Judge) -> dict:
    rejected = assess([InvalidRow("R2", None, Side.RH, ("tail_no",), ("noticed",))], gear, table)
    judged = judge({3: 0.013, 5: 0.007}, readings_in=(0.041,))
    return CheckResult(
        gear=gear, judgements=(judged, *rejected), problems=(PROBLEM,), notes=("a note",)
    ).to_dict()


def test_the_top_level_has_every_key_of_the_contract(form: dict) -> None:
    assert form.keys() >= {"schema_version", "gear", "inspections", "problems"}
    assert form["schema_version"] == 2


def test_the_gear_carries_its_provenance_and_hash(form: dict, gear: Gear) -> None:
    assert form["gear"] == {
        "id": "hawker-800xp",
        "geometry_sha256": gear.geometry_sha256,
        "provenance": "reconstructed from published figures, not drawing data",
    }


@pytest.mark.parametrize("row", [0, 1], ids=["judged", "rejected"])
def test_every_inspection_has_every_key_of_the_contract(form: dict, row: int) -> None:
    assert form["inspections"][row].keys() >= INSPECTION


@pytest.mark.parametrize("row", [0, 1], ids=["judged", "rejected"])
def test_every_joint_has_every_key_of_the_contract(form: dict, row: int) -> None:
    joints = form["inspections"][row]["joints"]
    assert [joint["joint"] for joint in joints] == list(range(1, 11))
    assert all(joint.keys() >= JOINT for joint in joints)


def test_a_repair_set_has_its_seven_keys(judge: Judge) -> None:
    keys = {
        *("joints", "predicted_displacement_in", "probability_within_margin", "access_minutes"),
        *("minutes", "kind", "second_repair_probability"),
    }
    row = judge(every_joint(0.004)).to_dict()
    assert row["repair_sets"][0].keys() == keys


def test_the_numbers_of_an_invalid_row_are_null(form: dict) -> None:
    row = form["inspections"][1]
    assert row["verdict"] == "INVALID"
    assert {
        row[key] for key in INSPECTION if key.endswith("_in") or key.startswith("probability")
    } == {None}
    assert {
        value
        for joint in row["joints"]
        for key, value in joint.items()
        if key not in {"joint", "name"}
    } == {None}


def test_the_identity_of_an_invalid_row_is_given_as_far_as_it_could_be_read(form: dict) -> None:
    row = form["inspections"][1]
    assert (row["record_id"], row["tail_no"], row["side"]) == ("R2", None, "RH")
    assert (row["warnings"], row["standing"]) == (["noticed"], [])


def test_what_an_invalid_row_says_that_the_gear_did_is_given() -> None:
    row = {"tail_no": "N1", "side": "LH", "clearance_3_in": -1.0, "outcome": "FAILED"}
    said = check(row | {"inspection_date": "2026-03-04", "clearance_convention": "RADIAL"})
    (found,) = said.to_dict()["inspections"]
    assert (found["verdict"], found["outcome"]) == ("INVALID", "FAILED")
    assert found["inspection_date"] == "2026-03-04"


def test_a_clearance_that_was_not_measured_is_null_and_one_measured_as_zero_is_zero(judge):
    joints = judge({3: 0.0}).to_dict()["joints"]
    assert (joints[2]["clearance_in"], joints[3]["clearance_in"]) == (0.0, None)


def test_numbers_are_not_rounded(form: dict, judge: Judge) -> None:
    exact = judge({3: 0.013, 5: 0.007}).predicted_displacement_in
    assert form["inspections"][0]["predicted_displacement_in"] == exact


def test_a_problem_has_its_nine_keys_in_order(form: dict) -> None:
    keys = ["code", "file", "sheet", "row", "column", "cell", "value", "expected", "remedy"]
    assert [list(problem) for problem in form["problems"]] == [keys]


def test_a_row_of_a_table_says_what_follows_next_as_a_gear_alone_does() -> None:
    row = {"tail_no": "N1", "side": "LH", "clearance_3_in": 0.013, "outcome": "FAILED"}
    declared = row | {"clearance_convention": "RADIAL", "record_id": "R1"}
    table = pd.DataFrame([declared, declared | {"tail_no": "N2", "record_id": "R2"}])
    alone, *batch = (each.plan.then for t in (table[:1], table) for each in check(t).judgements)
    assert len(alone) == 2
    assert batch == [alone, alone]


def test_what_was_not_asked_for_is_null(form: dict) -> None:
    assert form["inspections"][0]["posterior"] is None
    assert form["inspections"][1]["posterior"] is None


def test_with_advice_the_posterior_names_groups(judge: Judge) -> None:
    failed = {"readings_in": (0.041,), "outcome": Outcome.FAILED}
    row = judge({3: 0.01, 5: 0.007}, advice=True, **failed).to_dict()
    assert row["posterior"]["groups"][0]["joints"] == [3, 5]
