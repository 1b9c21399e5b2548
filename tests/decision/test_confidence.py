"""The number of the probability against Monte Carlo, and what re-rigging alone would do."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import norm

from mlg_troubleshoot.decision.prediction import Cases, exact_chance
from mlg_troubleshoot.gear.linkage import worst_case
from tests.decision.conftest import Judge, Shifted, every_joint, inspected


@pytest.mark.parametrize("clearance_in", [0.0014, 0.0018, 0.0025])
def test_curvature_moves_the_probability_by_less_than_one_percent(judge, gear, clearance_in):
    found = judge(every_joint(clearance_in), gauge_u_in=0.0005)
    half = 0.0005 * np.random.default_rng(5).standard_normal((2000, 10))
    drawn = worst_case(gear.model, np.abs(clearance_in + np.vstack([half, -half])))
    worst = np.maximum(drawn.over_in, -drawn.under_in)
    budget = found.budget
    rest = np.sqrt(budget.geometry_in**2 + budget.model_in**2)
    share = norm.cdf((found.margin_in - worst) / rest).mean()
    assert share == pytest.approx(found.probability_within_margin, abs=0.012)


def test_advice_does_not_change_the_verdict_or_its_probability(judge: Judge) -> None:
    plain, advised = judge(every_joint(0.002)), judge(every_joint(0.002), advice=True)
    assert (plain.verdict, plain.probability_within_margin) == (
        advised.verdict,
        advised.probability_within_margin,
    )


@pytest.mark.parametrize(("shift_in", "chance"), [(-0.02, 0.0), (0.02, 1.0)])
def test_re_rigging_takes_back_what_shifts_the_plunger_already(gear, shift_in, chance):
    one = Cases.of(gear, [inspected(every_joint(0.0))], Shifted(0.02))
    assert exact_chance(one, one.filled(0.0), shift_in) == [chance]


def test_re_rigging_leaves_half_of_the_range_between_both_worst_cases(gear, judge):
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
