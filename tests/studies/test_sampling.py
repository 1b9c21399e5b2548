"""Saltelli's and Jansen's estimators on scrambled Sobol points."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.indices.estimators import Indices, student_half
from mlg_troubleshoot.indices.inputs import Inputs, Response, joint_groups, with_random_directions
from mlg_troubleshoot.indices.saltelli import fast_indices, saltelli_indices
from mlg_troubleshoot.indices.tensor import TensorIndices

from .conftest import Oracle


@pytest.mark.parametrize("name", ["ishigami", "sobol_g"])
@pytest.mark.parametrize("route", [lambda *asked: fast_indices(*asked)[0], saltelli_indices])
def test_analytic_indices_are_met_within_0_002(
    request: pytest.FixtureRequest,
    name: str,
    route: Callable[..., Indices],
) -> None:
    oracle: Oracle = request.getfixturevalue(name)
    found = route(oracle.function, oracle.n, np.random.default_rng(1), 1)
    assert np.abs(found.first_order - oracle.first_order).max() < 0.002
    assert np.abs(found.total_order - oracle.total_order).max() < 0.002


@pytest.mark.parametrize(("count", "quantile"), [(2, 12.7062), (5, 2.7764), (10, 2.2622)])
def test_a_mean_has_as_many_degrees_of_freedom_as_values_but_one(
    count: int, quantile: float
) -> None:
    # Table of Student's distribution, 97.5 %.
    assert student_half(np.ones(1), count) == pytest.approx(quantile / np.sqrt(count), rel=1e-4)


def test_sampling_stops_by_itself_at_the_accuracy(on_cube: Response) -> None:
    coarse = saltelli_indices(on_cube, 10, np.random.default_rng(0), 0, accuracy=0.02)
    fine = saltelli_indices(on_cube, 10, np.random.default_rng(0), 0, accuracy=0.001)
    assert coarse.half_width <= 0.02
    assert fine.half_width <= 0.001
    assert coarse.evaluations < fine.evaluations


def test_a_limit_of_evaluations_is_kept_and_said(on_cube: Response) -> None:
    found = saltelli_indices(on_cube, 10, np.random.default_rng(0), 0, accuracy=1e-9, most=60_000)
    assert found.evaluations <= 60_000
    assert "stopped at" in found.note


def test_95_percent_intervals_hold_the_exact_index_about_as_often(
    on_cube: Response, exact: TensorIndices
) -> None:
    inside = total = 0
    for seed in range(12):
        found = saltelli_indices(on_cube, 10, np.random.default_rng(seed), seed, accuracy=0.02)
        low, high = found.first_order_interval.T
        inside += int(np.count_nonzero((low <= exact.first_order) & (exact.first_order <= high)))
        total += 10
    assert 0.85 <= inside / total <= 1.0


def test_intervals_are_not_wider_than_the_errors_warrant(
    on_cube: Response, exact: TensorIndices
) -> None:
    errors, widths = [], []
    for seed in range(8):
        found = saltelli_indices(on_cube, 10, np.random.default_rng(seed), seed, accuracy=0.02)
        errors.append(np.abs(found.total_order - exact.total_order))
        widths.append(np.diff(found.total_order_interval, axis=1)[:, 0] / 2)
    assert np.mean(widths) < 6.0 * np.mean(errors)


def test_with_random_directions_each_joint_counts_with_its_direction(gear: Gear) -> None:
    cube = with_random_directions(gear.model, Inputs(gear.limits_in))
    found = saltelli_indices(
        cube, 20, np.random.default_rng(0), 0, accuracy=0.01, groups=joint_groups(10)
    )
    linear = gear.model.plunger_amplification() ** 2
    assert found.first_order == pytest.approx(linear / linear.sum(), abs=0.01)


def test_a_failed_sample_makes_the_indices_undefined_and_is_counted(on_cube: Response) -> None:
    def failing(unit: np.ndarray) -> np.ndarray:
        return np.where(unit[:, 3] > 0.99, np.nan, on_cube(unit))

    found = saltelli_indices(failing, 10, np.random.default_rng(0), 0)
    assert found.failed > 0
    assert np.all(np.isnan(found.total_order))


def test_progress_is_told_and_an_interruption_leaves_what_is_done(on_cube: Response) -> None:
    calls = []

    def interrupted(unit: np.ndarray) -> np.ndarray:
        if calls:
            raise KeyboardInterrupt
        return on_cube(unit)

    found = saltelli_indices(
        interrupted,
        10,
        np.random.default_rng(0),
        0,
        1e-9,
        progress=lambda done, width: calls.append((done, width)),
    )
    assert "interrupted" in found.note
    assert np.all(np.isfinite(found.first_order))
