"""Repair sets."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mlg_troubleshoot.decision import planner as repair
from mlg_troubleshoot.decision.assessment import RepairKind, RepairSet
from mlg_troubleshoot.decision.inspection import Inspection
from mlg_troubleshoot.decision.prediction import Cases, Prediction, predict
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.gear.linkage import worst_case
from tests.decision.conftest import every_joint, inspected

# The failure with the other joints in good condition.
FULL_FAILURE = every_joint(0.001, j3=0.013, j5=0.007)
MARGIN_IN = 0.03


def sure_sets(cases: Cases, upper: Prediction) -> tuple[RepairSet, ...]:
    """Sets that hold in the worst case."""
    sure = repair.sure_sets(cases, upper, np.array([0])).values()
    offered = [(RepairKind.SURE, members, None) for members in sure]
    return repair.repair_sets(cases, [repair.Course(repair.CONFIRM, offered, None)])[0]


def repair_sets(
    gear: Gear, inspection: Inspection, margin_in: float = MARGIN_IN
) -> tuple[RepairSet, ...]:
    """Repair sets of one gear."""
    cases = Cases.of(gear, [replace(inspection, margin_in=margin_in)])
    upper = cases.predict_bounds()[1]
    return sure_sets(cases, upper)


def probabilities_after(gear: Gear, *repairs: tuple[int, ...]) -> np.ndarray:
    """Probability that the failed gear is within its margin after each of these repairs."""
    n = len(repairs)
    rows = np.array(
        [
            [0.0005 if j in restored else FULL_FAILURE[j] for j in range(1, 11)]
            for restored in repairs
        ]
    )
    found = predict(gear, [inspected({})] * n, rows, np.ones((n, 10), bool), np.full(n, 0.0005))
    return found.probability_within(np.full(n, MARGIN_IN), np.zeros(n))


def test_only_what_is_measured_and_worn_beyond_a_new_part_can_be_restored_with_a_gain(gear):
    new = gear.new_parts_in
    read = {1: new[0], 2: new[1] + 5e-5, 3: new[2] + 2e-4, 4: 0.5 * new[3]}
    assert Cases.of(gear, [inspected(read)]).removable[0].tolist() == [n == 3 for n in range(1, 11)]


def test_restoring_joint_three_alone_is_too_close_and_three_and_five_clear_the_failure(gear, judge):
    assert 0.90 <= probabilities_after(gear, (3,))[0] < 0.95
    assert probabilities_after(gear, (3, 5))[0] >= 0.95
    sets = judge(FULL_FAILURE).repair_sets
    assert sets is not None
    assert sets[0].joints == (3, 5)


@pytest.fixture(scope="module")
def sets_of_failure(gear: Gear) -> tuple[tuple[int, ...], ...]:
    return tuple(s.joints for s in repair_sets(gear, inspected(FULL_FAILURE), MARGIN_IN))


def test_every_repair_set_reaches_95_percent_and_contains_no_joint_too_many(gear, sets_of_failure):
    assert probabilities_after(gear, *sets_of_failure).min() >= 0.95
    # Joint 3 is over its limit and must be in every set.
    smaller = [
        tuple(j for j in joints if j != spare)
        for joints in sets_of_failure
        for spare in joints
        if spare != 3
    ]
    # The expansion finds what suffices to half a thou of the exact worst case.
    assert probabilities_after(gear, *smaller).max() < 0.955


def test_a_joint_over_its_limit_is_in_every_repair_set_even_where_it_moves_the_plunger_little(gear):
    found = repair_sets(
        gear, inspected(every_joint(0.001, j3=0.0074, j5=0.0074, j7=0.008)), MARGIN_IN
    )
    assert found
    assert all(7 in s.joints for s in found)


def test_a_restored_joint_has_the_clearance_of_a_new_part(gear: Gear) -> None:
    best = next(
        s for s in repair_sets(gear, inspected(FULL_FAILURE), MARGIN_IN) if s.joints == (3, 5)
    )
    row = np.array([[0.0005 if j in (3, 5) else 0.001 for j in range(1, 11)]])
    assert best.predicted_displacement_in == pytest.approx(
        worst_case(gear.model, row).magnitude_in[0], abs=1e-12
    )


@pytest.mark.parametrize(
    ("read", "margin_in"),
    [
        (dict.fromkeys(range(1, 6), 0.0006), MARGIN_IN),
        (every_joint(0.001), MARGIN_IN),
        (every_joint(0.005), 0.004),
    ],
    ids=["no repair needed", "within", "no set suffices"],
)
def test_a_gear_that_needs_no_repair_or_that_none_helps_has_no_repair_set(gear, read, margin_in):
    assert repair_sets(gear, inspected(read), margin_in) == ()


def test_only_measured_joints_are_proposed_for_repair(gear: Gear) -> None:
    read = {1: 0.0, 2: 0.005, 3: 0.013, 4: 0.0, 5: 0.007, 6: 0.0, 7: 0.0, 8: 0.0}
    found = repair_sets(gear, inspected(read), MARGIN_IN)
    assert found
    assert {j for s in found for j in s.joints} <= {2, 3, 5}


@pytest.mark.parametrize("unread", [(6, 7), (2,), (8, 9, 10), (1, 2, 4)])
def test_the_search_knows_what_every_set_leaves_with_unread_joints_at_their_limit(gear, unread):
    joints = every_joint(0.001, j1=0.004, j3=0.009, j4=0.005, j5=0.006)
    cases = Cases.of(
        gear,
        [inspected({j: value for j, value in joints.items() if j not in unread}, margin_in=0.045)],
    )
    found = repair.Sets(cases, cases.predict_bounds()[1], 0)
    now, n = cases.filled(gear.limits_in)[0], len(found.members)
    rows = np.where(found.members, np.minimum(0.0005, now), now)
    exact = predict(
        gear, cases.inspections * n, rows, np.repeat(cases.measured, n, axis=0), np.full(n, 0.0005)
    )
    slack = 0.045 - exact.displacement_in - 1.645 * exact.standard_uncertainty(np.zeros(n))
    assert n >= 63
    assert found.slack_in == pytest.approx(slack, abs=0.0005)


def test_the_search_knows_what_restoring_takes_from_the_uncertainty_of_coarse_readings(gear):
    joints = every_joint(0.003, j1=0.004, j3=0.009, j4=0.005, j5=0.006)
    cases = Cases.of(gear, [inspected(joints, margin_in=0.045, gauge_u_in=0.003)])
    found = repair.Sets(cases, cases.predict_bounds()[1], 0)
    rows = np.where(found.members, 0.0005, cases.clearance_in)
    n = len(rows)
    exact = predict(gear, cases.inspections * n, rows, np.ones(rows.shape, bool), np.full(n, 0.003))
    slack = 0.045 - exact.displacement_in - 1.645 * exact.standard_uncertainty(np.zeros(n))
    assert found.slack_in == pytest.approx(slack, abs=0.0005)


def test_a_set_that_only_just_suffices_is_found(gear: Gear) -> None:
    read = {
        1: 0.0042,
        2: 0.0094,
        3: 0.0031,
        5: 0.0081,
        6: 0.0029,
        7: 0.009,
        8: 0.0022,
        9: 0.0084,
        10: 0.0081,
    }
    restored = np.array([[0.0005 if j in read else 0.0075 for j in range(1, 11)]])
    measured = np.array([[j in read for j in range(1, 11)]])
    exact = predict(gear, [inspected({})], restored, measured, np.array([0.0005]))
    margin_in = 0.028
    assert 0.95 < exact.probability_within(np.array([margin_in]), np.zeros(1))[0] < 0.96
    assert [found.joints for found in repair_sets(gear, inspected(read), margin_in)] == [
        tuple(read)
    ]


def test_a_set_that_the_exact_prediction_does_not_confirm_is_not_offered(gear, monkeypatch):
    cases = Cases.of(gear, [inspected(FULL_FAILURE)])

    def alone(sets: repair.Sets, least_in: float) -> int:
        # A search that holds joint 3 alone to suffice, which leaves less than 95 %.
        return int(np.argmax(sets.members.sum(axis=1) == 1))

    monkeypatch.setattr(repair.Sets, "quickest", alone)
    upper = cases.predict(cases.filled(gear.limits_in))
    assert sure_sets(cases, upper) == ()
