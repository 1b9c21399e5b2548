"""The verdict table: the first match wins, from the probability that the worst case is within the
margin.
"""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import norm

from mlg_troubleshoot.decision.assessment import Assessment, Rejected, Verdict
from mlg_troubleshoot.decision.inspection import Inspection, InvalidRow, Outcome, Side
from mlg_troubleshoot.decision.judge_rows import assess
from mlg_troubleshoot.decision.prediction import Cases
from mlg_troubleshoot.decision.verdict_rule import verdict, zone
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.indices.index_table import IndexTable
from tests.decision.conftest import Judge, every_joint, inspected

FAILURE = {3: 0.013, 5: 0.007}
probability = st.floats(0, 1)


@pytest.mark.parametrize(
    ("p", "expected"),
    [
        (0.0, Verdict.OUTSIDE_MARGIN),
        (0.05, Verdict.OUTSIDE_MARGIN),
        (0.0501, Verdict.INCONCLUSIVE),
        (0.9499, Verdict.INCONCLUSIVE),
        (0.95, Verdict.WITHIN_MARGIN),
        (1.0, Verdict.WITHIN_MARGIN),
    ],
)
def test_the_limits_of_the_zones_are_5_and_95_percent_and_belong_to_the_clear_verdicts(p, expected):
    assert zone(p) is expected


@given(p_lower=st.floats(0, 0.05), p_upper=probability, missing=st.booleans())
def test_outside_comes_first_even_with_critical_joints_missing(p_lower, p_upper, missing):
    assert verdict(p_lower, p_upper, critical_missing=missing) is Verdict.OUTSIDE_MARGIN


@given(p_lower=st.floats(0.06, 1), p_upper=probability)
def test_a_missing_critical_joint_is_incomplete_whatever_the_rest_says(p_lower, p_upper):
    assert verdict(p_lower, p_upper, critical_missing=True) is Verdict.INCOMPLETE


@given(p_lower=st.floats(0.06, 1), p_upper=probability)
def test_verdicts_that_differ_between_zero_and_the_bound_are_incomplete(p_lower, p_upper):
    found = verdict(p_lower, p_upper, critical_missing=False)
    assert (found is Verdict.INCOMPLETE) == (zone(p_lower) is not zone(p_upper))


def test_the_published_failure_is_outside_with_eight_joints_not_measured(judge: Judge) -> None:
    found = judge(FAILURE)
    assert (found.verdict, found.margin_in) == (Verdict.OUTSIDE_MARGIN, 0.03)
    senses = found.over_travel_in, found.under_travel_in
    assert senses == pytest.approx((0.04722, -0.04286), abs=5e-6)
    assert found.predicted_displacement_in == found.over_travel_in
    assert found.remaining_in == pytest.approx(0.03 - 0.04722, abs=5e-6)


@pytest.mark.parametrize(
    ("read", "expected"),
    [
        *(
            ({j: 0.0 for j in range(1, 11) if j != lost}, Verdict.INCOMPLETE)
            for lost in range(1, 6)
        ),
        (dict.fromkeys(range(1, 10), 0.0), Verdict.WITHIN_MARGIN),
        (dict.fromkeys(range(1, 6), 0.002), Verdict.INCOMPLETE),
        (every_joint(0.001), Verdict.WITHIN_MARGIN),
        (every_joint(0.002), Verdict.INCONCLUSIVE),
    ],
)
def test_joints_one_to_five_must_be_read_and_others_where_their_limit_changes_the_verdict(
    judge, read, expected
):
    found = judge(read)
    assert found.verdict is expected
    if len(read) == 10:
        assert found.predicted_upper_in == found.predicted_displacement_in


def test_unmeasured_joints_count_as_zero_in_the_prediction_and_as_their_limit_in_the_upper_one(
    judge,
):
    found = judge(dict.fromkeys(range(1, 10), 0.001))
    at_zero, at_limit = judge(every_joint(0.001, j10=0.0)), judge(every_joint(0.001, j10=0.0075))
    assert found.predicted_displacement_in == pytest.approx(
        at_zero.predicted_displacement_in, abs=1e-15
    )
    assert found.predicted_upper_in == pytest.approx(at_limit.predicted_displacement_in, abs=1e-15)


def test_this_gears_own_margin_takes_the_place_of_the_published_one(judge: Judge) -> None:
    found = judge(FAILURE | dict.fromkeys((1, 2, 4, 6, 7, 8, 9, 10), 0.0), margin_in=0.08)
    assert (found.margin_in, found.verdict) == (0.08, Verdict.WITHIN_MARGIN)


def test_an_invalid_row_is_rejected_with_what_to_correct(gear: Gear, table: IndexTable) -> None:
    row = InvalidRow("R1", "258401", Side.LH, ("clearance_3_in", "side"))
    (found,) = assess([row], gear, table)
    assert isinstance(found, Rejected)
    assert found.verdict is Verdict.INVALID
    assert found.next_action.text == "CANNOT BE JUDGED. Correct: clearance_3_in, side."


def test_a_batch_judges_each_gear_as_if_it_were_alone(gear, table, judge):
    cases = [every_joint(0.001), FAILURE, every_joint(0.002), {1: 0.001}, every_joint(0.05)]
    batch = assess([inspected(case) for case in cases], gear, table, advice=True)
    for found, case in zip(batch, cases, strict=True):
        assert isinstance(found, Assessment)
        alone = judge(case, advice=True)
        assert (found.verdict, found.plan) == (alone.verdict, alone.plan)
        assert found.probability_within_margin == pytest.approx(
            alone.probability_within_margin, abs=1e-12
        )


def test_gears_of_which_the_same_is_known_are_judged_once(gear, table, monkeypatch):
    judged: list[int] = []
    of = Cases.of

    def counted(gear: Gear, rows: Sequence[Inspection], **declared: object) -> Cases:
        judged.append(len(rows))
        return of(gear, rows, **declared)

    monkeypatch.setattr(Cases, "of", counted)
    rows = [replace(inspected(FAILURE), tail_no=f"N{n}") for n in range(5)]
    rows.append(inspected({1: 0.001}))
    found = assess(rows, gear, table)
    assert judged[0] == 2
    assert [f.row.tail_no for f in found] == ["N0", "N1", "N2", "N3", "N4", "258401"]
    assert found[5].headline != found[0].headline


def test_a_gear_that_does_not_close_is_outside_with_its_numbers_absent_and_a_warning(judge):
    found = judge(every_joint(0.05))
    assert found.verdict is Verdict.OUTSIDE_MARGIN
    numbers = (
        *(found.predicted_displacement_in, found.over_travel_in, found.under_travel_in),
        *(found.predicted_upper_in, found.remaining_in, found.standard_uncertainty_in),
        *(found.probability_exceed_random_directions, found.geometry_spread_in, found.budget),
    )
    assert set(numbers) == {None}
    assert any("does not close" in warning for warning in found.warnings)


def test_where_only_some_linkages_of_the_ensemble_close_the_uncertainty_is_absent_and_said(judge):
    found = judge(every_joint(0.03))
    assert found.verdict is Verdict.OUTSIDE_MARGIN
    assert found.predicted_displacement_in is not None
    assert (found.standard_uncertainty_in, found.geometry_spread_in, found.budget) == (
        None,
        None,
        None,
    )
    assert any("linkages of the ensemble do not close" in warning for warning in found.warnings)


@pytest.mark.parametrize("clearance", [0.0, 0.001, 0.03, 0.05])
def test_no_clearance_gives_json_that_is_not_json(judge, clearance):
    json.dumps(judge(every_joint(clearance)).to_dict(), allow_nan=False)


def test_the_probability_is_the_normal_one_of_prediction_and_uncertainty(judge: Judge) -> None:
    found = judge(every_joint(0.002))
    z = (found.margin_in - (found.predicted_displacement_in or math.nan)) / (
        found.standard_uncertainty_in or math.nan
    )
    assert found.probability_within_margin == pytest.approx(norm.cdf(z), abs=1e-12)


def test_a_failed_outcome_does_not_change_the_verdict(judge: Judge) -> None:
    for case in (every_joint(0.001), every_joint(0.002), FAILURE):
        assert judge(case, outcome=Outcome.FAILED).verdict is judge(case).verdict
