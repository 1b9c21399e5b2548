"""The filter and the passage times against closed forms of other libraries."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from mlg_troubleshoot.wear import Samples, WearPath
from mlg_troubleshoot.wear.filtering import Draws, FilterState, follow
from mlg_troubleshoot.wear.model import _Ends
from mlg_troubleshoot.wear.passage import (
    first_passage,
    gamma_passage,
    integrated_passage,
    wiener_passage,
)
from mlg_troubleshoot.wear.paths import Scale, grid_step, lay_out
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
    return Draws(
        np.array([[False]]), **{name: np.array([[v]]) for name, v in (values | changed).items()}
    )


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
def test_the_filter_gives_the_density_of_the_readings_as_one_normal_vector(
    increment_sd: float, wander_sd: float
) -> None:
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


def test_a_wiener_path_passes_when_the_inverse_gaussian_distribution_says() -> None:
    away, drift, sd = (np.full((20_000, 1, 1), v) for v in (0.8, 0.5, 0.6))
    times = wiener_passage(away, drift, sd, np.random.default_rng(1)).ravel()
    mean, shape = 0.8 / 0.5, (0.8 / 0.6) ** 2
    assert stats.kstest(times, stats.invgauss(mean / shape, scale=shape).cdf).pvalue > 0.01


def test_against_its_drift_a_wiener_path_passes_with_the_known_chance() -> None:
    away, drift, sd = (np.full((20_000, 1, 1), v) for v in (0.3, -0.5, 0.6))
    times = wiener_passage(away, drift, sd, np.random.default_rng(1))
    assert np.isfinite(times).mean() == pytest.approx(np.exp(-2.0 * 0.3 * 0.5 / 0.36), abs=0.015)


def test_a_gamma_path_passes_when_the_gamma_distribution_says() -> None:
    shapes = gamma_passage(np.full(20_000, 6.0), np.random.default_rng(1))
    for q in (0.05, 0.5, 0.95):
        # Passed by shape k: a gamma variable of that shape is above 6.
        assert stats.gamma(np.quantile(shapes, q)).sf(6.0) == pytest.approx(q, abs=0.015)


def test_a_wandering_drift_passes_when_fine_simulated_steps_do() -> None:
    away, drift, sd = (np.full((4000, 1, 1), v) for v in (0.8, 0.5, 0.4))
    times = integrated_passage(away, drift, sd, np.random.default_rng(1)).ravel()
    rng, dt = np.random.default_rng(2), 0.01
    rate = 0.5 + 0.4 * np.cumsum(np.sqrt(dt) * rng.standard_normal((4000, 1500)), axis=1)
    over = np.cumsum(rate * dt, axis=1) >= 0.8
    fine = np.where(over.any(axis=1), (np.argmax(over, axis=1) + 1) * dt, np.inf)
    ours, theirs = (np.sort(t)[[200, 2000, 3000]] for t in (times, fine))
    assert ours == pytest.approx(theirs, rel=0.06)


@pytest.mark.parametrize(
    ("values", "step"),
    [([0.9, 0.95, 1.3, 2.0], 0.05), ([0.1, 0.1, 0.2], 0.0), ([0.1234567, 0.98, 2.0 / 3.0], 0.0)],
)
def test_the_resolution_is_the_step_of_the_grid_that_readings_lie_on(
    values: list[float], step: float
) -> None:
    assert grid_step(np.array(values)) == pytest.approx(step)


def test_gamma_increments_scatter_as_simulated_ones_whose_drift_is_not_known() -> None:
    draws = replace(
        parameters(start_sd=0.0, increment_sd=0.6, power=1.0, kept=1.0), gamma=np.array([[True]])
    )
    steps = lay_out([[WearPath("a", [0.0, 2.0], [0.1, 0.0])]], AS_IT_IS)
    _likely, state = follow(steps, replace(draws, reading_sd=1e6 * draws.reading_sd))
    rng = np.random.default_rng(2)
    drift = rng.normal(0.9, 0.3, 400_000)
    moved = drift * 0.36 * rng.standard_gamma(2.0 / 0.36, len(drift))
    assert state.level_var[0, 0] == pytest.approx(np.var(moved), rel=0.01)


def test_level_and_drift_are_sampled_together() -> None:
    one = np.ones((1, 1))
    state = FilterState(one, one, one, 0.8 * one, one)
    ends = _Ends.drawn(parameters(), state, 200_000, np.random.default_rng(1))
    assert np.cov(ends.level.ravel(), ends.drift.ravel()) == pytest.approx(
        np.array([[1.0, 0.8], [0.8, 1.0]]), abs=0.02
    )


def test_beyond_what_any_unit_has_reached_the_pace_is_a_quarter_uncertain() -> None:
    zero, one = np.zeros((1, 1)), np.ones((1, 1))
    sharp = parameters(increment_sd=0.0, power=1.0)
    ends = _Ends.drawn(
        sharp, FilterState(one, one, zero, zero, zero), 50_000, np.random.default_rng(1)
    )
    rng = np.random.default_rng(2)
    found = ends.follow(
        np.array([[1.0, 3.0]]), np.array([0.5]), np.array([0.0]), rng, reading=False
    )
    assert np.std(found[0, 0], axis=0) == pytest.approx([0.0, 0.25 * 2.0], abs=0.01)


def test_a_declared_error_is_scaled_as_the_readings_are() -> None:
    steps = lay_out([[WearPath("a", [1.0], [2.0], reading_u=0.3)]], Scale(1.0, -4.0, 0.0, 0.0))
    assert steps.known_r2[0, 0] == pytest.approx((0.3 / 4.0) ** 2)


def ends(level: float, drift: float, draws: Draws, n: int) -> _Ends:
    """Paths that are known exactly at their last reading, their pace beyond it too."""
    shape = (1, 1, n)
    return _Ends(draws, np.full(shape, level), np.full(shape, drift), np.ones(shape))


@pytest.mark.parametrize(("increment_sd", "wander_sd"), [(0.4, 0.0), (0.0, 0.7), (0.3, 0.5)])
def test_a_path_is_followed_with_the_variance_of_its_increments_and_of_its_wandering_drift(
    increment_sd: float, wander_sd: float
) -> None:
    draws = parameters(increment_sd=increment_sd, wander_sd=wander_sd, power=1.0)
    found = ends(0.3, 0.8, draws, 100_000).follow(
        np.array([[2.5]]), np.array([0.5]), np.array([0.0]), np.random.default_rng(1), reading=False
    )
    assert np.mean(found) == pytest.approx(0.3 + 0.8 * 2.0, abs=0.02)
    assert np.var(found) == pytest.approx(
        increment_sd**2 * 2.0 + wander_sd**2 * 2.0**3 / 3.0, rel=0.02
    )


def test_a_gamma_path_follows_the_moments_of_its_increments_and_the_error_of_a_reading() -> None:
    draws = replace(parameters(increment_sd=0.6, power=1.0), gamma=np.array([[True]]))
    wear, read = (
        ends(0.3, 0.8, draws, 200_000).follow(
            np.array([[2.5]]),
            np.array([0.5]),
            np.array([0.5**2]),
            np.random.default_rng(1),
            reading=reading,
        )
        for reading in (False, True)
    )
    assert np.mean(wear) == pytest.approx(0.3 + 0.8 * 2.0, abs=0.02)
    assert np.var(wear) == pytest.approx(0.8**2 * 0.6**2 * 2.0, rel=0.02)
    assert np.var(read) == pytest.approx(np.var(wear) + 0.5**2, rel=0.02)


def test_what_never_goes_back_has_crossed_its_limit_where_it_stands_above_it() -> None:
    draws = replace(parameters(increment_sd=0.6, power=1.5), gamma=np.array([[True]]))
    level = np.zeros((1, 1, 100_000))
    pace = np.maximum(1.0 + 0.25 * np.random.default_rng(3).standard_normal(level.shape), 0.1)
    paths = _Ends(draws, level, np.full(level.shape, 0.8), pace)
    last, usage = np.array([0.5]), np.array([[0.9, 1.6, 2.5]])
    wear = paths.follow(usage, last, np.array([0.0]), np.random.default_rng(1), reading=False)
    crossed = paths.crossing(np.array([1.2]), last, np.random.default_rng(2))
    for k in range(3):
        assert np.mean(crossed <= usage[0, k]) == pytest.approx(
            np.mean(wear[..., k] >= 1.2), abs=0.015
        )


def test_no_reading_is_better_than_the_rounding_to_its_resolution() -> None:
    member = members(estimate_reading=True, restored=False)[0]
    theta = np.full((1, len(member.names)), -30.0)
    rounding = np.random.default_rng(1).uniform(-0.3, 0.3, 100_000)
    assert member.draws(theta, 0.6).reading_sd[0, 0] == pytest.approx(np.std(rounding), rel=0.01)


def test_quantiles_of_samples_are_those_of_numpy() -> None:
    samples = np.random.default_rng(1).standard_normal((3, 40))
    chances = [0.0, 0.05, 0.5, 0.77, 1.0]
    assert Samples(samples).quantile(chances) == pytest.approx(
        np.quantile(samples, chances, axis=1).T
    )


def test_a_simulated_path_passes_a_limit_between_two_usages_in_proportion_or_never() -> None:
    paths = np.array([[0.0, 5.0, 0.0], [2.0, 6.0, 0.5], [4.0, 7.0, 1.0]])
    passed = first_passage(np.array([0.0, 100.0, 300.0]), paths, 3.0)
    assert passed.tolist() == [200.0, 0.0, np.inf]


def test_a_path_without_a_finite_level_passes_at_the_usage_where_it_is_lost() -> None:
    paths = np.array([[0.0], [1.0], [np.inf]])
    assert first_passage(np.array([0.0, 100.0, 300.0]), paths, 3.0).tolist() == [300.0]
