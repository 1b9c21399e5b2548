"""The number of the probability checked by Monte Carlo, and what re-rigging alone would do."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import norm

from mlg_troubleshoot.decision.case import Cases, exact_chance
from mlg_troubleshoot.decision.judge_rows import assess
from mlg_troubleshoot.decision.monte_carlo import check_probability
from mlg_troubleshoot.decision.sentences import confidence_words, rigging_sentence
from mlg_troubleshoot.gear.directions import worst_case
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.gear.model import links_from
from mlg_troubleshoot.indices.index_table import IndexTable
from mlg_troubleshoot.reporting.json_form import check_as_json
from tests.decision.conftest import Judge, Shifted, every_joint, inspected


@pytest.mark.parametrize("clearance_in", [0.0, 0.0014, 0.0016, 0.002, 0.0025, 0.003, 0.004])
@pytest.mark.parametrize("gauge_u_in", [0.0005, 0.002])
def test_curvature_moves_the_probability_by_less_than_one_percent(
    judge: Judge, clearance_in: float, gauge_u_in: float
) -> None:
    checked = judge(every_joint(clearance_in), advice=True, gauge_u_in=gauge_u_in).confidence
    assert checked is not None
    assert abs(checked.monte_carlo - checked.analytic) < 0.01


def test_the_analytic_value_is_the_probability_of_the_contract(judge: Judge) -> None:
    found = judge(every_joint(0.002), advice=True)
    assert found.confidence is not None
    assert found.confidence.analytic == pytest.approx(found.probability_within_margin, abs=1e-12)


def test_advice_does_not_change_the_verdict_or_its_probability(judge: Judge) -> None:
    plain, advised = judge(every_joint(0.002)), judge(every_joint(0.002), advice=True)
    assert (plain.verdict, plain.probability_within_margin) == (
        advised.verdict,
        advised.probability_within_margin,
    )


def test_the_error_of_one_monte_carlo_value_is_the_scatter_of_many(
    gear: Gear, judge: Judge
) -> None:
    found = judge(every_joint(0.002), gauge_u_in=0.004)
    one = Cases.of(gear, [found.inspection])
    assert found.budget is not None
    worst = found.over_travel_in or 0.0, found.under_travel_in or 0.0
    many = [
        check_probability(one, worst, found.budget, np.random.default_rng(seed))
        for seed in range(150)
    ]
    scatter = float(np.std([c.monte_carlo for c in many], ddof=1))
    assert scatter == pytest.approx(np.mean([c.standard_error for c in many]), rel=0.2)


def test_a_worse_gauge_is_in_the_monte_carlo_value(judge: Judge) -> None:
    fine = judge(every_joint(0.0015), advice=True, gauge_u_in=0.0001).confidence
    coarse = judge(every_joint(0.0015), advice=True, gauge_u_in=0.002).confidence
    assert fine is not None
    assert coarse is not None
    assert coarse.monte_carlo < fine.monte_carlo - 0.02


def test_the_own_uncertainty_of_a_joint_is_in_the_monte_carlo_value(
    gear: Gear, table: IndexTable, judge: Judge
) -> None:
    read = inspected(every_joint(0.0015), gauge_u_by_joint_in={5: 0.004})
    (own,) = assess([read], gear, table, advice=True)
    checked, plain = own.confidence, judge(every_joint(0.0015), advice=True).confidence
    assert checked is not None
    assert plain is not None
    assert checked.monte_carlo < plain.monte_carlo - 0.02
    assert abs(checked.monte_carlo - checked.analytic) < 0.01


def test_the_uncertainty_of_the_margin_is_in_the_monte_carlo_value(judge: Judge) -> None:
    sure = judge(every_joint(0.0015), advice=True).confidence
    unsure = judge(every_joint(0.0015), advice=True, margin_u_in=0.01).confidence
    assert sure is not None
    assert unsure is not None
    assert unsure.monte_carlo < sure.monte_carlo - 0.02
    assert abs(unsure.monte_carlo - unsure.analytic) < 0.01


@pytest.mark.parametrize(("shift_in", "chance"), [(-0.02, 0.0), (0.02, 1.0)])
def test_re_rigging_takes_back_what_shifts_the_plunger_already(
    gear: Gear, shift_in: float, chance: float
) -> None:
    one = Cases.of(gear, [inspected(every_joint(0.0))], Shifted(0.02))
    assert exact_chance(one, one.filled(0.0), shift_in) == [chance]


def test_the_monte_carlo_value_differs_from_the_linear_one_by_what_reading_errors_do(
    gear: Gear, judge: Judge
) -> None:
    found = judge(every_joint(0.001), advice=True, gauge_u_in=0.004)
    errors = 0.004 * np.random.default_rng(8).standard_normal((1500, 10))
    errors, start = np.vstack([errors, -errors]), np.full(10, 0.001)
    steps = 1e-5 * np.eye(10)
    slopes = (
        worst_case(gear.model, start + steps).over_in
        - worst_case(gear.model, start - steps).over_in
    ) / 2e-5
    links = np.array(
        links_from(start + errors, worst_case(gear.model, start[None]).over_directions)
    )
    assert found.budget is not None
    assert found.confidence is not None
    rest = np.hypot(found.budget.geometry_in, found.budget.model_in)
    level = found.predicted_displacement_in or 0.0
    curved, linear = gear.model.displacement(list(links)), level + errors @ slopes
    under = worst_case(gear.model, start[None]).under_directions
    curved = np.maximum(curved, -gear.model.displacement(links_from(start + errors, under)))
    moved = norm.cdf((0.03 - curved) / rest) - norm.cdf((0.03 - linear) / rest)
    assert found.confidence.monte_carlo - found.confidence.analytic == pytest.approx(
        np.mean(moved), abs=0.001
    )


def test_the_error_stands_beside_the_probability(judge: Judge) -> None:
    assert "±" in confidence_words(judge(every_joint(0.002), advice=True).confidence)
    assert confidence_words(None) == ""


def test_re_rigging_leaves_half_of_the_range_between_both_worst_cases(
    gear: Gear, judge: Judge
) -> None:
    found = judge(every_joint(0.004), advice=True).rigging
    exact = worst_case(gear.model, np.full((1, 10), 0.004))
    assert found is not None
    assert found.predicted_displacement_in == pytest.approx(
        0.5 * (exact.over_in[0] - exact.under_in[0]), abs=1e-12
    )
    assert exact.over_in[0] + found.shift_in == pytest.approx(
        -(exact.under_in[0] + found.shift_in), abs=1e-12
    )


def test_re_rigging_cannot_clear_the_published_failure(judge: Judge) -> None:
    found = judge({3: 0.013, 5: 0.007}, advice=True).rigging
    assert found is not None
    assert found.probability_within_margin < 0.05
    assert 0.2 < found.probability_exceed_random_directions < 0.3


def test_a_gear_within_its_margin_has_no_rigging_alternative(judge: Judge) -> None:
    assert judge(every_joint(0.001), advice=True).rigging is None


def test_the_sentence_on_re_rigging_says_that_the_joints_stay_worn(judge: Judge) -> None:
    found = judge({3: 0.013, 5: 0.007}, advice=True).rigging
    assert found is not None
    assert rigging_sentence(found).endswith("the joints stay worn.")


def test_the_seed_decides_the_draws_and_stands_in_the_json(gear: Gear, table: IndexTable) -> None:
    one, again, other = (
        assess(
            [inspected(every_joint(0.002), gauge_u_in=0.002)], gear, table, advice=True, seed=seed
        )[0]
        for seed in (4, 4, 5)
    )
    assert one == again
    assert one != other
    assert check_as_json(gear, [one], [], [], 4)["seed"] == 4
