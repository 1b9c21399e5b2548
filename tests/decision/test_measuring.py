"""Which joint to measure next, and when to stop."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import norm

from mlg_troubleshoot.decision.assessment import Assessment, MeasuringAdvice, Verdict
from mlg_troubleshoot.decision.case import Cases
from mlg_troubleshoot.decision.judge_rows import assess
from mlg_troubleshoot.decision.next_joint import (
    COST_OF_WRONG_WITHIN,
    advise,
    decision_risk,
    enough,
    outlook,
)
from mlg_troubleshoot.decision.plan import minutes_to_measure
from mlg_troubleshoot.decision.prediction import predict
from mlg_troubleshoot.decision.second_order import expand, responses
from mlg_troubleshoot.decision.wear_levels import (
    level_likelihood,
    level_weights,
    moments,
    normal_cdf,
    quantiles,
    tabled_normal_cdf,
    uncertainty_parts,
)
from mlg_troubleshoot.gear.directions import random_directions, worst_case
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.gear.model import links_from
from mlg_troubleshoot.indices.index_table import IndexTable
from tests.decision.conftest import Judge, every_joint, inspected

MARGIN_IN = 0.03


def advised(
    gear: Gear, clearance_in: dict[int, float], margin_in: float = MARGIN_IN
) -> MeasuringAdvice:
    return advise(Cases.of(gear, [inspected(clearance_in, margin_in=margin_in)]))


def test_the_second_order_worst_case_is_within_one_percent_up_to_the_limit(gear: Gear) -> None:
    clearance = np.random.default_rng(4).uniform(0.0, 0.0075, (200, 10))
    exact = worst_case(gear.model, clearance)
    over, under = responses(gear)[0].worst(clearance)
    assert np.max(np.abs(over / exact.over_in - 1.0)) < 0.01
    assert np.max(np.abs(under / exact.under_in - 1.0)) < 0.01


def test_the_second_order_displacement_follows_the_linkage_in_any_direction(gear: Gear) -> None:
    rng = np.random.default_rng(5)
    links = links_from(rng.uniform(0.0, 0.0075, (200, 10)), rng.uniform(0.0, 6.28, (200, 10)))
    exact = gear.model.displacement(links)
    found = expand(gear.model).displacement(np.array(links).T)
    assert np.max(np.abs(found - exact)) < 2e-4


def test_an_anchored_expansion_is_exact_for_its_gear(gear: Gear) -> None:
    clearance = np.array([every_joint(0.004)[j] for j in range(1, 11)])
    exact = worst_case(gear.model, clearance[None, :])
    anchored = responses(gear)[0].anchored(
        clearance, float(exact.over_in[0]), float(exact.under_in[0])
    )
    assert anchored.worst(clearance) == pytest.approx(
        (exact.over_in[0], exact.under_in[0]), abs=1e-15
    )


def test_the_quick_uncertainty_agrees_with_the_rule(gear: Gear) -> None:
    clearance = np.random.default_rng(6).uniform(0.0, 0.004, (50, 10))
    exact = predict(
        gear, [inspected({})] * 50, clearance, np.ones((50, 10), bool), np.full(50, 0.0005)
    )
    worst, _slopes, u = uncertainty_parts(responses(gear), clearance, 0.0005, 0.001)
    wanted = np.sqrt(exact.u_clearances_in**2 + exact.u_geometry_in**2 + 0.001**2)
    assert worst == pytest.approx(exact.displacement_in, rel=0.005)
    assert u == pytest.approx(wanted, rel=0.03)


def test_the_quick_chance_with_random_directions_is_the_share_of_displacements_beyond_the_margin(
    gear: Gear,
) -> None:
    response, clearance = (
        responses(gear)[0],
        np.array([[0.0] * 2 + [0.015] + [0.0] * 7, [0.0075] * 10]),
    )
    links = np.array(links_from(clearance[:, None, :], random_directions(10, 512)))
    share = [np.mean(np.abs(response.displacement(links[:, k].T)) > 0.03) for k in range(2)]
    assert response.chance_beyond(clearance, np.full(2, 0.03), 512) == pytest.approx(
        np.array(share), abs=1e-12
    )


def test_the_minutes_of_a_reading_are_those_in_an_area_that_is_open_already(gear: Gear) -> None:
    closed = {w.joint: w.minutes for w in outlook(Cases.of(gear, [inspected({})])).worth}
    opened = {w.joint: w.minutes for w in outlook(Cases.of(gear, [inspected({4: 0.001})])).worth}
    (area,) = (area for area in gear.areas if area.name == gear.joint(4).area)
    assert closed[2] - opened[2] == area.access.value
    assert closed[9] == opened[9]


def test_a_wrong_within_costs_nineteen_times_a_wrong_outside() -> None:
    assert pytest.approx(19.0) == COST_OF_WRONG_WITHIN
    assert decision_risk(1.0 - 1e-3) == pytest.approx(0.019)
    assert decision_risk(1e-3) == pytest.approx(1e-3)


def test_the_risk_is_greatest_at_the_conformance_probability() -> None:
    p = np.linspace(0.0, 1.0, 2001)
    assert p[np.argmax(decision_risk(p))] == pytest.approx(0.95)


def test_wear_stays_between_nothing_and_the_limit() -> None:
    shares = quantiles(50)
    assert shares.min() >= 0.0
    assert shares.max() <= 1.0


def test_the_quantiles_have_the_moments_of_their_level() -> None:
    shares = quantiles(4000)
    mean, variance = moments()
    assert shares.mean(axis=1) == pytest.approx(mean, rel=2e-3)
    assert shares.var(axis=1) == pytest.approx(variance, rel=1e-2)


def test_the_density_of_each_level_integrates_to_one() -> None:
    share = (np.arange(20_000) + 0.5) / 20_000
    assert level_likelihood(share).mean(axis=0) == pytest.approx(1.0, rel=1e-4)


def test_a_gear_whose_measured_joints_are_worn_is_expected_to_be_worn_elsewhere() -> None:
    mean, _variance = moments()
    assert level_weights(np.full(3, 0.9)) @ mean > 2.0 * level_weights(np.full(3, 0.1)) @ mean


def test_the_table_of_the_normal_distribution_is_exact_to_a_millionth() -> None:
    z = np.random.default_rng(1).normal(0.0, 2.0, 500)
    assert tabled_normal_cdf(z) == pytest.approx(normal_cdf(z), abs=1e-6)


def test_the_chance_of_being_within_agrees_with_drawing_gears(gear: Gear) -> None:
    # Gears drawn level by level, each judged by the exact prediction.
    measured = {3: 0.003, 5: 0.003}
    within = outlook(Cases.of(gear, [inspected(measured)])).within
    rng = np.random.default_rng(9)
    shares = quantiles(400)
    weights = level_weights(np.array([0.003, 0.003]) / 0.0075)
    level = rng.choice(len(weights), 400, p=weights)
    clearance = 0.0075 * np.array([rng.choice(shares[k], 10) for k in level])
    clearance[:, 2], clearance[:, 4] = 0.003, 0.003
    exact = predict(
        gear, [inspected({})] * 400, clearance, np.ones((400, 10), bool), np.full(400, 0.0005)
    )
    p = exact.probability_within(np.full(400, MARGIN_IN), np.zeros(400))
    assert within == pytest.approx(p.mean(), abs=3.0 * p.std() / 20.0)


def test_the_normal_distribution_has_its_known_values() -> None:
    assert normal_cdf(np.array([0.0, 1.6448536, -1.6448536])) == pytest.approx(
        [0.5, 0.95, 0.05], abs=1e-7
    )


def test_an_area_that_is_open_costs_no_minutes_again(gear: Gear) -> None:
    assert minutes_to_measure(gear, [5]) == 23
    assert minutes_to_measure(gear, [5], frozenset({gear.joint(3).area})) == 8
    assert minutes_to_measure(gear, [6], frozenset({gear.joint(3).area})) == 26


def test_missing_critical_joints_stand_before_all_others(gear: Gear) -> None:
    worth = outlook(Cases.of(gear, [inspected({3: 0.001, 9: 0.001})])).worth
    assert {w.joint for w in worth[:4]} == {1, 2, 4, 5}


def test_the_next_joint_is_worth_most_per_minute_of_access(gear: Gear) -> None:
    worth = [w for w in outlook(Cases.of(gear, [inspected({9: 0.0005})])).worth if w.critical]
    assert worth[0].risk_drop > 0.0
    assert worth[0].risk_drop / worth[0].minutes == max(w.risk_drop / w.minutes for w in worth)
    # The variance alone would choose another joint.
    assert worth[0].joint != max(worth, key=lambda w: w.variance_in2 / w.minutes).joint


def test_a_reading_that_is_worth_more_may_still_come_later_because_of_its_access(
    gear: Gear,
) -> None:
    critical = dict.fromkeys(range(1, 6), 0.0017)
    worth = {w.joint: w for w in outlook(Cases.of(gear, [inspected(critical)])).worth}
    assert worth[8].risk_drop > worth[6].risk_drop
    assert list(worth).index(6) < list(worth).index(8)


def test_where_no_single_reading_has_a_value_the_variance_per_minute_decides(gear: Gear) -> None:
    # Two badly worn ends: no single reading can make WITHIN the better answer again.
    worth = [
        w for w in outlook(Cases.of(gear, [inspected({3: 0.0074, 5: 0.0074})])).worth if w.critical
    ]
    assert {w.risk_drop for w in worth} == {0.0}
    assert worth[0].variance_in2 / worth[0].minutes == max(
        w.variance_in2 / w.minutes for w in worth
    )


def test_both_ends_of_one_link_are_worth_the_same(gear: Gear) -> None:
    worth = {w.joint: w for w in outlook(Cases.of(gear, [inspected({1: 0.001, 2: 0.001})])).worth}
    assert worth[3].risk_drop == pytest.approx(worth[5].risk_drop, rel=1e-3)
    assert worth[9].variance_in2 == pytest.approx(worth[10].variance_in2, rel=1e-3)


def test_a_reading_is_never_worth_less_than_nothing(gear: Gear) -> None:
    for measured in ({}, {2: 0.002}, {2: 0.007, 4: 0.006}):
        assert min(w.risk_drop for w in outlook(Cases.of(gear, [inspected(measured)])).worth) >= 0.0


def test_outside_already_one_may_stop(gear: Gear) -> None:
    found = advised(gear, {3: 0.013, 5: 0.007})
    assert (found.stop, found.verdict) == (True, Verdict.OUTSIDE_MARGIN)
    assert "does not change the verdict" in found.text


def test_measuring_goes_on_while_the_verdict_is_open(gear: Gear) -> None:
    assert not advised(gear, {3: 0.001, 5: 0.001}).stop


def test_where_one_may_stop_no_reading_up_to_the_limit_changes_the_verdict(
    gear: Gear, judge: Judge
) -> None:
    start = {3: 0.006, 5: 0.006, 2: 0.006}
    assert advised(gear, start).stop
    rng = np.random.default_rng(8)
    for _ in range(5):
        rest = {j: float(rng.uniform(0.0, 0.0075)) for j in range(1, 11) if j not in start}
        assert judge(start | rest).verdict is Verdict.OUTSIDE_MARGIN


def test_with_every_joint_measured_one_may_stop(gear: Gear) -> None:
    found = advised(gear, every_joint(0.0005))
    assert (found.stop, found.verdict, found.joint) == (True, Verdict.WITHIN_MARGIN, None)


def test_the_gear_is_expected_within_before_it_is_certain(gear: Gear) -> None:
    found = advised(gear, dict.fromkeys(range(1, 6), 0.001))
    assert not found.stop
    assert found.expected is Verdict.WITHIN_MARGIN
    assert "To be certain, measure" in found.text


def test_one_may_stop_within_although_light_joints_are_unmeasured(gear: Gear) -> None:
    found = advised(gear, dict.fromkeys(range(1, 9), 0.0))
    assert (found.stop, found.verdict, found.joint) == (True, Verdict.WITHIN_MARGIN, 9)


def test_an_expectation_is_enough_where_being_wrong_costs_as_little_either_way() -> None:
    assert enough(0.025) is Verdict.OUTSIDE_MARGIN
    assert enough(0.026) is None
    assert enough(0.9986) is None
    assert enough(0.9987) is Verdict.WITHIN_MARGIN


def test_measuring_on_is_not_worth_it_where_the_verdict_will_be_too_close_anyway() -> None:
    assert enough(0.5, too_close=0.9) is Verdict.INCONCLUSIVE
    assert enough(0.5, too_close=0.89) is None


def test_an_expectation_of_either_side_goes_before_too_close() -> None:
    assert enough(0.01, too_close=0.95) is Verdict.OUTSIDE_MARGIN


def test_the_chance_of_being_too_close_is_that_of_gears_drawn_from_the_same_distribution(
    gear: Gear,
) -> None:
    measured = dict.fromkeys(range(1, 6), 0.0024)
    limits, rng = gear.limits_in, np.random.default_rng(12)
    shares = np.array([measured[j] for j in measured]) / limits[:5]
    level = rng.choice(24, p=level_weights(shares), size=3000)
    drawn = quantiles(400)[level[:, None], rng.integers(0, 400, (3000, 5))] * limits[5:]
    clearance = np.column_stack([np.tile([0.0024] * 5, (3000, 1)), drawn])
    found = predict(
        gear,
        [inspected(measured)] * 3000,
        clearance,
        np.ones((3000, 10), bool),
        np.full(3000, 0.0005),
    )
    p = found.probability_within(np.full(3000, MARGIN_IN), np.zeros(3000))
    truth = np.mean((p > 0.05) & (p < 0.95))
    assert outlook(Cases.of(gear, [inspected(measured)])).too_close == pytest.approx(
        truth, abs=0.05
    )


def test_a_gear_that_no_further_joint_will_settle_is_told_to_measure_the_plunger(
    gear: Gear,
) -> None:
    found = advised(gear, dict.fromkeys(range(1, 6), 0.0022))
    assert found.expected is Verdict.INCONCLUSIVE
    assert "Measure the plunger displacement at mid-position" in found.text


def test_a_plunger_that_was_measured_is_not_asked_for_again(gear: Gear) -> None:
    read = replace(inspected(dict.fromkeys(range(1, 6), 0.0022)), readings_in=(0.02,))
    assert "Measure the plunger" not in advise(Cases.of(gear, [read])).text


def test_an_expectation_never_becomes_a_verdict(judge: Judge) -> None:
    assert judge(dict.fromkeys((2, 3, 4, 5), 0.0002)).verdict is Verdict.INCOMPLETE


def test_an_inconclusive_gear_that_precision_cannot_settle_is_told_so(gear: Gear) -> None:
    found = advise(Cases.of(gear, [inspected(every_joint(0.0022), gauge_u_in=0.0001)]))
    assert (found.stop, found.verdict) == (True, Verdict.INCONCLUSIVE)
    assert "do not settle it" in found.text


def test_an_inconclusive_gear_that_precision_may_settle_is_told_so(gear: Gear) -> None:
    found = advised(gear, every_joint(0.0021))
    assert (found.stop, found.verdict) == (False, Verdict.INCONCLUSIVE)
    assert "may still settle it" in found.text


def test_the_quick_spread_over_the_linkages_is_that_of_the_rule(gear: Gear) -> None:
    clearance = np.random.default_rng(6).uniform(0.0, 0.004, (50, 10))
    exact = predict(gear, [inspected({})] * 50, clearance, np.ones((50, 10), bool), np.zeros(50))
    quick = uncertainty_parts(responses(gear), clearance, 0.0, 0.0)[2]
    assert np.median(quick / exact.u_geometry_in) == pytest.approx(1.0, abs=0.02)


@pytest.mark.parametrize("under_in", [-0.02, -0.04])
def test_slopes_are_those_of_the_sense_that_governs(gear: Gear, under_in: float) -> None:
    start, step = np.full(10, 0.005), 1e-5 * np.eye(10)
    response = responses(gear)[0].anchored(start, 0.03, under_in)
    numeric = (response.magnitude(start + step) - response.magnitude(start - step)) / 2e-5
    assert response.slopes(start) == pytest.approx(numeric, rel=1e-6)


def test_the_variance_that_a_reading_removes_is_that_of_its_joint_s_wear_through_its_amplification(
    gear: Gear,
) -> None:
    chance, (mean, variance) = level_weights(np.array([0.003 / gear.limits_in[1]])), moments()
    share = chance @ (variance + mean**2) - (chance @ mean) ** 2
    moved = gear.model.plunger_amplification() ** 2 * gear.limits_in**2 * share
    for worth in outlook(Cases.of(gear, [inspected({2: 0.003})])).worth:
        assert worth.variance_in2 == pytest.approx(
            moved[gear.joint_numbers.index(worth.joint)], rel=0.2
        )


@pytest.mark.parametrize("gauge_u_in", [0.0001, 0.0005])
def test_precision_may_settle_what_two_standard_uncertainties_would_move_out_of_doubt(
    gear: Gear, table: IndexTable, gauge_u_in: float
) -> None:
    said = []
    for clearance_in in np.arange(0.00180, 0.0027, 0.00005):
        row = inspected(every_joint(float(clearance_in)), gauge_u_in=gauge_u_in)
        (found,) = assess([row], gear, table)
        assert isinstance(found, Assessment)
        assert found.budget is not None
        rest = np.hypot(found.budget.geometry_in, found.budget.model_in)
        left = MARGIN_IN - (found.predicted_displacement_in or 0.0)
        near, far = norm.cdf((left + np.array([2.0, -2.0]) * found.budget.clearances_in) / rest)
        if found.verdict is Verdict.INCONCLUSIVE and min(abs(near - 0.95), abs(far - 0.05)) > 0.02:
            said.append(near > 0.95 or far < 0.05)
            assert advise(Cases.of(gear, [row])).stop != said[-1]
    assert True in said
    assert gauge_u_in > 0.0004 or False in said


def test_the_advice_is_the_same_at_every_call(gear: Gear) -> None:
    assert advised(gear, {3: 0.002}) == advised(gear, {3: 0.002})


def test_with_advice_the_next_action_is_the_same(judge: Judge) -> None:
    measured = {3: 0.001, 5: 0.001}
    assert judge(measured, advice=True).next_action == judge(measured).next_action


def test_a_critical_joint_is_next_even_where_another_would_tell_more(gear: Gear) -> None:
    joints = tuple(replace(joint, critical=joint.number == 9) for joint in gear.joints)
    worth = outlook(Cases.of(replace(gear, joints=joints), [inspected({})])).worth
    assert worth[0].joint == 9
    assert worth[0].variance_in2 / worth[0].minutes < worth[1].variance_in2 / worth[1].minutes


def test_the_advice_knows_the_own_uncertainty_of_a_joint(gear: Gear, table: IndexTable) -> None:
    read = inspected(every_joint(0.0015), gauge_u_by_joint_in={5: 0.004})
    (judged,) = assess([read], gear, table)
    assert isinstance(judged, Assessment)
    assert advise(Cases.of(gear, [read])).expected_within == pytest.approx(
        judged.probability_within_margin, abs=1e-12
    )


def test_a_coarse_reading_leaves_more_levels_of_displacement_open(gear: Gear) -> None:
    measured = {3: 0.004, 5: 0.004}
    fine, coarse = (
        outlook(Cases.of(gear, [inspected(measured, gauge_u_by_joint_in={5: u})]))
        for u in (0.0005, 0.01)
    )
    assert abs(coarse.within - 0.5) < abs(fine.within - 0.5)
