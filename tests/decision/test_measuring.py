"""Which joint to measure next, and when to stop."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.stats import norm

from mlg_troubleshoot.arrays import Array
from mlg_troubleshoot.decision.assessment import Verdict, minutes_of
from mlg_troubleshoot.decision.belief import SHARES, WEAR, given_readings
from mlg_troubleshoot.decision.inspection import Outcome
from mlg_troubleshoot.decision.prediction import (
    DIRECTION_SETS,
    Cases,
    Response,
    chance_at,
    expand,
    responses,
)
from mlg_troubleshoot.decision.priors import PRIORS
from mlg_troubleshoot.decision.verdict_rule import normal_cdf, tabled_normal_cdf
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.gear.linkage import links_from, random_directions, worst_case
from tests.decision.conftest import Judge, belief_of, every_joint, inspected


def levels_of(gear: Gear, clearance_in: dict[int, float]) -> Array:
    return given_readings(Cases.of(gear, [inspected(clearance_in)]))[0][0]


def test_the_second_order_worst_case_is_within_one_percent_up_to_the_limit(gear: Gear) -> None:
    clearance = np.random.default_rng(4).uniform(0.0, 0.0075, (200, 10))
    exact = worst_case(gear.model, clearance)
    over, under = responses(gear)[0].worst(clearance)
    assert np.max(np.abs(over / exact.over_in - 1.0)) < 0.01
    assert np.max(np.abs(under / exact.under_in - 1.0)) < 0.01


def to_second_order(response: Response, links: Array) -> Array:
    return np.asarray(
        links @ response.gradient + 0.5 * np.sum((links @ response.curvature) * links, axis=-1)
    )


def test_the_second_order_displacement_follows_the_linkage_in_any_direction(gear: Gear) -> None:
    rng = np.random.default_rng(5)
    links = links_from(rng.uniform(0.0, 0.0075, (200, 10)), rng.uniform(0.0, 6.28, (200, 10)))
    exact = gear.model.displacement(links)
    found = to_second_order(expand(gear.model), np.array(links).T)
    assert np.max(np.abs(found - exact)) < 2e-4


def test_the_quick_chance_with_random_directions_is_the_share_of_displacements_beyond_the_margin(
    gear: Gear,
) -> None:
    clearance = np.array([[0.0] * 2 + [0.015] + [0.0] * 7, [0.0075] * 10])
    links = np.array(links_from(clearance[:, None, :], random_directions(10, DIRECTION_SETS)))
    response = responses(gear)[0]
    share = [np.mean(np.abs(to_second_order(response, links[:, k].T)) > 0.03) for k in range(2)]
    cases = Cases.of(gear, [inspected({}), inspected({})])
    assert chance_at(cases, clearance) == pytest.approx(np.array(share), abs=1e-12)


def test_a_gear_whose_measured_joints_are_worn_is_expected_to_be_worn_elsewhere(gear: Gear) -> None:
    worn, tight = (levels_of(gear, dict.fromkeys((1, 2, 3), c)) for c in (0.0068, 0.0007))
    assert worn @ WEAR @ SHARES > 1.5 * tight @ WEAR @ SHARES


def test_readings_unlike_each_other_speak_for_joints_that_each_have_their_own_level(gear):
    alike, unlike = (
        levels_of(gear, dict(enumerate(read, 1)))
        for read in ((0.0006,) * 6, (0.0002, 0.007, 0.0003, 0.0068, 0.0001, 0.006))
    )
    assert alike[-1] < 1.0 - PRIORS.alike < unlike[-1]


def doubt(gear: Gear, clearance_in: dict[int, float], joint: int, **more: Any) -> float:
    """Chance that a joint that reads over its limit is within it."""
    belief = belief_of(Cases.of(gear, [inspected(clearance_in, **more)]))
    return float(1.0 - belief.worn[joint - 1])


def test_a_plunger_that_needs_the_worn_joint_confirms_its_reading(gear: Gear) -> None:
    read = every_joint(0.0015, j3=0.0095)
    alone, needed = (
        doubt(gear, read, 3, outcome=Outcome.FAILED, readings_in=at) for at in ((), (0.032,))
    )
    assert needed < alone - 0.05


def test_a_reading_little_over_its_limit_is_in_doubt(gear: Gear) -> None:
    worn = dict.fromkeys(range(1, 11), 0.004)
    assert doubt(gear, worn | {2: 0.0078}, 2) > 0.3
    assert doubt(gear, worn | {2: 0.0078}, 2) > 2.0 * doubt(gear, worn | {2: 0.0095}, 2)


def test_twice_a_usual_clearance_may_be_the_total_play(gear: Gear) -> None:
    among_worn = doubt(gear, every_joint(0.005) | {3: 0.012}, 3)
    among_tight = doubt(gear, every_joint(0.0005) | {3: 0.012}, 3)
    assert among_worn > 0.05
    assert among_tight < 0.01


def test_a_joint_that_was_measured_again_with_a_good_gauge_is_not_in_doubt(gear: Gear) -> None:
    read = every_joint(0.004) | {2: 0.0085}
    assert doubt(gear, read, 2, gauge_u_by_joint_in={2: 0.0003}) < 0.01


def test_the_table_of_the_normal_distribution_is_exact_to_a_millionth() -> None:
    z = np.random.default_rng(1).normal(0.0, 2.0, 500)
    assert tabled_normal_cdf(z) == pytest.approx(norm.cdf(z), abs=1e-6)


def test_the_normal_distribution_is_that_of_scipy() -> None:
    z = np.random.default_rng(1).normal(0.0, 2.0, 500)
    assert normal_cdf(z) == pytest.approx(norm.cdf(z), abs=1e-14)


def test_an_area_that_is_open_costs_no_minutes_again(gear: Gear) -> None:
    third, fifth, sixth = np.eye(10, dtype=bool)[[2, 4, 5]]
    assert minutes_of(gear, fifth, np.zeros(10, bool))[0] == 23
    assert minutes_of(gear, fifth, third)[0] == 8
    assert minutes_of(gear, sixth, third)[0] == 26


def test_an_expectation_never_becomes_a_verdict(judge: Judge) -> None:
    assert judge(dict.fromkeys((2, 3, 4, 5), 0.0002)).verdict is Verdict.INCOMPLETE


@pytest.mark.parametrize("sense", [1.0, -1.0])
def test_slopes_are_those_of_the_sense_that_governs(gear: Gear, sense: float) -> None:
    start, step = np.full(10, 0.005), 1e-5 * np.eye(10)
    reference = responses(gear)[0]
    bent = sense * reference.sense(start) * reference.worst_curvature
    response = replace(reference, worst_curvature=bent)
    assert response.sense(start) == sense
    after, before = (np.array(response.worst(at)) for at in (start + step, start - step))
    sizes = [np.maximum(over, -under) for over, under in (after, before)]
    numeric = (sizes[0] - sizes[1]) / 2e-5
    assert response.slopes(start) == pytest.approx(numeric, rel=1e-6)
