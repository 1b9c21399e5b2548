"""One next action, repair sets and allowances."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mlg_troubleshoot.decision.assess import AssessOptions, allowance
from mlg_troubleshoot.decision.assessment import Action, Verdict
from mlg_troubleshoot.decision.inspection import Outcome
from mlg_troubleshoot.decision.next_action import next_to_measure
from mlg_troubleshoot.decision.prediction import predict
from mlg_troubleshoot.decision.repair import access_minutes, repair_sets
from mlg_troubleshoot.gear.directions import worst_case
from mlg_troubleshoot.gear.gear import Gear
from tests.decision.conftest import Judge, every_joint, inspected

FAILURE = {3: 0.013, 5: 0.007}
# The failure with the other joints in good condition.
FULL_FAILURE = every_joint(0.001, j3=0.013, j5=0.007)
MARGIN_IN = 0.03


def probabilities_after(gear: Gear, *repairs: tuple[int, ...]) -> np.ndarray:
    """Probability that the failed gear is within its margin after each of these repairs."""
    n = len(repairs)
    rows = np.array([[0.0005 if j in restored else FULL_FAILURE[j] for j in range(1, 11)] for restored in repairs])
    found = predict(gear, [inspected({})] * n, rows, np.ones((n, 10), bool), np.full(n, 0.0005))
    return found.probability_within(np.full(n, MARGIN_IN), np.zeros(n))


def test_outside_after_a_failure_is_rectified_in_order_of_rank(judge: Judge) -> None:
    action = judge(every_joint(0.005), outcome=Outcome.FAILED).next_action
    assert (action.action, action.joints[:4]) == (Action.RESTORE, (2, 4, 3, 5))


def test_outside_with_a_joint_over_its_limit_is_rectified(judge: Judge) -> None:
    assert judge(FULL_FAILURE).next_action.action is Action.RESTORE


def test_outside_without_failure_or_limit_could_contribute_and_is_inspected_in_order(judge: Judge) -> None:
    action = judge(every_joint(0.003)).next_action
    assert (action.action, action.joints) == (Action.MEASURE, (2, 4, 3))
    assert action.text == "Clearances could contribute. Inspect in this order: #2, #4, #3."


def test_incomplete_measures_the_missing_critical_joint_first(judge: Judge) -> None:
    action = judge(dict.fromkeys((2, 3, 4, 5), 0.001)).next_action
    assert (action.action, action.joints) == (Action.MEASURE, (1,))
    assert action.text == "Cannot clear. Measure #1 actuator rod end next."


def test_among_missing_joints_the_one_that_removes_most_variance_per_minute_is_next(gear: Gear, judge: Judge) -> None:
    action = judge({1: 0.001}).next_action
    worth = {j: gear.model.plunger_amplification()[j - 1] ** 2 / gear.joint(j).access.value for j in (2, 3, 4, 5)}
    assert action.joints == (max(worth, key=lambda j: worth[j]),)


def test_a_missing_critical_joint_is_measured_before_one_that_would_tell_more(gear: Gear, judge: Judge) -> None:
    findings = [
        replace(finding, plunger_amplification=100.0) if finding.joint == 9 else finding
        for finding in judge(dict.fromkeys((2, 3, 4, 5), 0.001)).joints
    ]
    assert next_to_measure(gear, findings) == 1


def test_within_continues_fault_isolation(judge: Judge) -> None:
    action = judge(every_joint(0.001)).next_action
    assert (action.action, action.joints) == (Action.CONTINUE, ())


def test_inconclusive_measures_again_more_precisely(judge: Judge) -> None:
    found = judge(every_joint(0.002))
    assert found.verdict is Verdict.INCONCLUSIVE
    assert found.next_action.action is Action.MEASURE
    assert found.next_action.text == "Too close. Measure #3 short link inner bearing again, more precisely."


def test_every_joint_over_its_limit_is_restored_in_order_of_rank(judge: Judge) -> None:
    action = judge(every_joint(0.0, j9=0.008, j6=0.008)).next_action
    assert (action.action, action.joints) == (Action.RESTORE, (9, 6))


def test_restoring_joint_three_alone_is_too_close(gear: Gear) -> None:
    assert 0.76 <= probabilities_after(gear, (3,))[0] <= 0.91


def test_restoring_joints_three_and_five_clears_the_failure(gear: Gear, judge: Judge) -> None:
    assert probabilities_after(gear, (3, 5))[0] >= 0.95
    sets = judge(FULL_FAILURE, AssessOptions(repairs=True)).repair_sets
    assert sets is not None
    assert sets[0].joints == (3, 5)


def test_the_next_action_is_the_first_repair_set(judge: Judge) -> None:
    action = judge(FULL_FAILURE, AssessOptions(repairs=True), outcome=Outcome.FAILED).next_action
    assert (action.action, action.joints) == (Action.RESTORE, (3, 5))


def test_the_text_says_that_unmeasured_joints_were_counted_as_zero(judge: Judge) -> None:
    text = judge(FAILURE, AssessOptions(repairs=True)).next_action.text
    assert "#1, #2, #4, #6, #7, #8, #9, #10 not measured and counted as 0" in text
    assert "counted as 0" not in judge(FULL_FAILURE, AssessOptions(repairs=True)).next_action.text


@pytest.fixture(scope="module")
def sets_of_failure(gear: Gear) -> tuple[tuple[int, ...], ...]:
    return tuple(s.joints for s in repair_sets(gear, inspected(FULL_FAILURE), MARGIN_IN))


def test_every_repair_set_reaches_95_percent(gear: Gear, sets_of_failure: tuple[tuple[int, ...], ...]) -> None:
    assert probabilities_after(gear, *sets_of_failure).min() >= 0.95


def test_no_repair_set_contains_a_joint_too_many(gear: Gear, sets_of_failure: tuple[tuple[int, ...], ...]) -> None:
    # Joint 3 is over its limit and must be in every set.
    smaller = [tuple(j for j in joints if j != spare) for joints in sets_of_failure for spare in joints if spare != 3]
    assert probabilities_after(gear, *smaller).max() < 0.95


def test_a_joint_over_its_limit_is_in_every_repair_set_even_where_it_moves_the_plunger_little(gear: Gear) -> None:
    found = repair_sets(gear, inspected(every_joint(0.001, j3=0.0074, j5=0.0074, j7=0.008)), MARGIN_IN)
    assert found
    assert all(7 in s.joints for s in found)


def test_repair_sets_come_by_access_time_and_then_by_size(gear: Gear) -> None:
    found = repair_sets(gear, inspected(every_joint(0.005)), MARGIN_IN)
    keys = [(s.access_minutes, len(s.joints)) for s in found]
    assert keys == sorted(keys)
    assert len(found) > 1


def test_opening_an_area_counts_once(gear: Gear) -> None:
    # Sidestay 15 min, #3 and #5 8 min each; link assembly 20 min, #6 6 min.
    assert access_minutes(gear, (3,)) == 23
    assert access_minutes(gear, (3, 5)) == 31
    assert access_minutes(gear, (3, 5, 6)) == 57


def test_a_restored_joint_has_the_clearance_of_a_new_part(gear: Gear) -> None:
    best = next(s for s in repair_sets(gear, inspected(FULL_FAILURE), MARGIN_IN) if s.joints == (3, 5))
    row = np.array([[0.0005 if j in (3, 5) else 0.001 for j in range(1, 11)]])
    assert best.predicted_displacement_in == pytest.approx(worst_case(gear.model, row).magnitude_in[0], abs=1e-12)


def test_where_nothing_need_be_restored_there_is_no_repair_set(gear: Gear) -> None:
    assert repair_sets(gear, inspected(dict.fromkeys(range(1, 6), 0.002)), MARGIN_IN) == ()


def test_where_no_set_is_sufficient_there_is_no_repair_set(gear: Gear) -> None:
    assert repair_sets(gear, inspected(every_joint(0.005)), 0.004) == ()


def test_only_measured_joints_are_proposed_for_repair(gear: Gear) -> None:
    found = repair_sets(gear, inspected(FAILURE | {2: 0.005}), MARGIN_IN)
    assert {j for s in found for j in s.joints} <= {2, 3, 5}


def test_repair_sets_are_absent_unless_asked_for(judge: Judge) -> None:
    assert judge(FULL_FAILURE).repair_sets is None


def test_a_gear_within_its_margin_has_no_repair_sets(judge: Judge) -> None:
    assert judge(every_joint(0.001), AssessOptions(repairs=True)).repair_sets == ()


def test_a_joint_worn_by_its_allowance_brings_the_worst_case_to_the_margin(gear: Gear) -> None:
    clearance = every_joint(0.001)
    found = allowance(gear, inspected(clearance), MARGIN_IN)
    for joint in (1, 2, 3, 4, 5, 9):
        worn = clearance | {joint: clearance[joint] + found[joint]}
        row = np.array([[worn[j] for j in range(1, 11)]])
        assert worst_case(gear.model, row).magnitude_in[0] == pytest.approx(MARGIN_IN, abs=2e-6)


def test_an_allowance_is_at_most_the_hard_limit_of_a_reading(gear: Gear) -> None:
    found = allowance(gear, inspected(every_joint(0.0)), MARGIN_IN)
    assert found[6] == pytest.approx(gear.hard_limit.value, abs=1e-6)


def test_a_joint_with_more_amplification_has_less_allowance(gear: Gear) -> None:
    found = allowance(gear, inspected(every_joint(0.001)), MARGIN_IN)
    assert found[2] < found[1] < found[6]


def test_beyond_the_margin_there_is_no_allowance(judge: Judge) -> None:
    found = judge(FAILURE, AssessOptions(allowances=True))
    assert {finding.allowance_in for finding in found.joints} == {None}


def test_an_unmeasured_joint_has_no_allowance(judge: Judge) -> None:
    found = judge({3: 0.001}, AssessOptions(allowances=True))
    assert [f.joint for f in found.joints if f.allowance_in is not None] == [3]
