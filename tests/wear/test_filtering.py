"""The filter and the passage times against closed forms of other libraries."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from mlg_troubleshoot.wear import Samples, WearPath, first_passage
from mlg_troubleshoot.wear.model import (
    Draws,
    FilterState,
    Scale,
    _Ends,
    _Streams,
    follow,
    grid_step,
    lay_out,
)
from mlg_troubleshoot.wear.posterior import members

AS_IT_IS = Scale(usage=1.0, value=1.0, start=0.0, resolution=0.0)
FIRST, SECOND = [0.2, 0.5, 0.9], [0.3, 0.4]
READ = np.array([0.35, 0.5, 1.1, 0.4, 0.45])


def parameters(**changed: float) -> Draws:
    values = {
        "start": 0.1,
        "start_sd": 0.2,
        "drift": 0.9,
        "drift_sd": 0.3,
        "increment_sd": 0.0,
        "wander_sd": 0.0,
        "reading_sd": 0.1,
        "power": 1.3,
        "kept": 0.6,
    }
    return Draws(**{name: np.array([[v]]) for name, v in (values | changed).items()})


def dense(increment_sd: float, wander_sd: float) -> float:
    """Log density of the readings written down as one normal vector, both paths of the unit
    together.

    To the error of a reading the filter adds a thousandth of the whole rise.
    """
    c = np.array(FIRST + SECOND) ** 1.3
    path = np.array([0, 0, 0, 1, 1])
    same = path[:, None] == path
    low, high = np.minimum.outer(c, c), np.maximum.outer(c, c)
    cov = same * (0.2**2 + increment_sd**2 * low + wander_sd**2 * low**2 * (3.0 * high - low) / 6.0)
    cov = cov + 0.3**2 * np.where(same, 1.0, 0.6) * np.outer(c, c) + (0.1**2 + 0.001**2) * np.eye(5)
    return float(stats.multivariate_normal(0.1 + 0.9 * c, cov).logpdf(READ))


@pytest.mark.parametrize(
    ("increment_sd", "wander_sd"), [(0.4, 0.0), (0.0, 0.7)], ids=["wiener", "integrated"]
)
def test_the_filter_gives_the_density_of_the_readings_as_one_normal_vector(increment_sd, wander_sd):
    paths = [WearPath("a", FIRST, READ[:3]), WearPath("a", SECOND, READ[3:])]
    found, _state = follow(
        lay_out([paths], AS_IT_IS), parameters(increment_sd=increment_sd, wander_sd=wander_sd)
    )
    assert found[0, 0] == pytest.approx(dense(increment_sd, wander_sd), abs=1e-9)


def test_a_longer_unit_beside_it_changes_nothing_for_a_unit() -> None:
    short, long = [WearPath("a", [0.5], [0.6])], [WearPath("b", FIRST, READ[:3])]
    draws = parameters(increment_sd=0.4)
    alone = follow(lay_out([short], AS_IT_IS), draws)[0][0, 0]
    assert follow(lay_out([short, long], AS_IT_IS), draws)[0][0, 0] == pytest.approx(
        alone, abs=1e-12
    )


def test_units_that_were_read_at_the_same_usages_are_filtered_as_each_alone() -> None:
    units = [
        [WearPath("a", FIRST, read[:3]), WearPath("a", SECOND, read[3:])]
        for read in (READ, READ[::-1])
    ]
    draws = parameters(increment_sd=0.4)
    both, state = follow(lay_out([*units, [WearPath("b", [0.5], [0.6])]], AS_IT_IS), draws)
    for place, unit in enumerate(units):
        alone, own = follow(lay_out([unit], AS_IT_IS), draws)
        assert both[:, [place]] == pytest.approx(alone, abs=1e-12)
        assert state.take(np.array([place])) == own


@pytest.mark.parametrize(
    ("values", "step"),
    [([0.9, 0.95, 1.3], 0.05), ([0.1, 0.1, 0.2], 0.0), ([0.1234567, 0.98, 2.0 / 3.0], 0.0)],
)
def test_the_resolution_is_the_step_of_the_grid_that_readings_lie_on(values, step):
    assert grid_step(np.array(values)) == pytest.approx(step)


def test_level_and_drift_are_sampled_together() -> None:
    one = np.ones((1, 1))
    state = FilterState(one, one, one, 0.8 * one, one)
    ends = _Ends.drawn(parameters(), state, 200_000, _Streams(1))
    assert np.cov(ends.level.ravel(), ends.drift.ravel()) == pytest.approx(
        np.array([[1.0, 0.8], [0.8, 1.0]]), abs=0.02
    )


def test_beyond_what_any_unit_has_reached_the_pace_is_a_quarter_uncertain() -> None:
    zero, one = np.zeros((1, 1)), np.ones((1, 1))
    sharp = parameters(increment_sd=0.0, power=1.0)
    ends = _Ends.drawn(sharp, FilterState(one, one, zero, zero, zero), 50_000, _Streams(1))
    found = ends.follow(
        np.array([[1.0, 3.0]]), np.array([0.5]), np.array([0.0]), _Streams(2), reading=False
    )
    assert [*map(np.std, found)] == pytest.approx([0.0, 0.25 * 2.0], abs=0.01)


def test_a_declared_error_is_scaled_as_the_readings_are() -> None:
    steps = lay_out([[WearPath("a", [1.0], [2.0], reading_u=0.3)]], Scale(1.0, -4.0, 0.0, 0.0))
    assert steps.known_r2[0, 0] == pytest.approx((0.3 / 4.0) ** 2)


def ends(level: float, drift: float, draws: Draws, n: int) -> _Ends:
    """Paths that are known exactly at their last reading, their pace beyond it too."""
    shape = (1, 1, n)
    return _Ends(draws, np.full(shape, level), np.full(shape, drift), np.ones(shape))


@pytest.mark.parametrize(("increment_sd", "wander_sd"), [(0.4, 0.0), (0.0, 0.7), (0.3, 0.5)])
def test_a_path_is_followed_with_the_variance_of_its_increments_and_of_its_wandering_drift(
    increment_sd, wander_sd
):
    draws = parameters(increment_sd=increment_sd, wander_sd=wander_sd, power=1.0)
    [found] = ends(0.3, 0.8, draws, 100_000).follow(
        np.array([[2.5]]), np.array([0.5]), np.array([0.0]), _Streams(1), reading=False
    )
    assert np.mean(found) == pytest.approx(0.3 + 0.8 * 2.0, abs=0.02)
    assert np.var(found) == pytest.approx(
        increment_sd**2 * 2.0 + wander_sd**2 * 2.0**3 / 3.0, rel=0.02
    )


def test_no_reading_is_better_than_the_rounding_to_its_resolution() -> None:
    member = members(estimate_reading=True, restored=False)[0]
    theta = np.full((1, len(member.names)), -30.0)
    rounding = np.random.default_rng(1).uniform(-0.3, 0.3, 100_000)
    assert member.draws(theta, 0.6).reading_sd[0, 0] == pytest.approx(np.std(rounding), rel=0.01)


def test_a_quantile_is_the_sample_that_is_nearest_to_it() -> None:
    samples = Samples(np.random.default_rng(1).permutation(np.arange(41.0)).reshape(1, 41))
    assert samples.quantile([0.0, 0.05, 0.5, 0.77, 1.0]).tolist() == [[0.0, 2.0, 20.0, 31.0, 40.0]]


def test_a_simulated_path_passes_a_limit_between_two_usages_in_proportion_or_never() -> None:
    paths = np.array([[0.0, 5.0, 0.0], [2.0, 6.0, 0.5], [4.0, 7.0, 1.0]])
    passed = first_passage(np.array([0.0, 100.0, 300.0]), paths, 3.0)
    assert passed.tolist() == [200.0, 0.0, np.inf]


def test_a_path_without_a_finite_level_passes_at_the_usage_where_it_is_lost() -> None:
    paths = np.array([[0.0], [1.0], [np.inf]])
    assert first_passage(np.array([0.0, 100.0, 300.0]), paths, 3.0).tolist() == [300.0]
