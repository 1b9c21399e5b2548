"""Indices by scipy on scrambled Sobol points, with intervals from independent scrambles."""

from __future__ import annotations

import numpy as np
import pytest

from mlg_troubleshoot.indices.estimators import student_half
from mlg_troubleshoot.indices.inputs import Response
from mlg_troubleshoot.indices.sampled import sampled_indices
from mlg_troubleshoot.indices.tensor import TensorIndices

from .conftest import Oracle


@pytest.mark.parametrize("name", ["ishigami", "sobol_g"])
def test_analytic_indices_are_met_within_0_002(request: pytest.FixtureRequest, name: str) -> None:
    oracle: Oracle = request.getfixturevalue(name)
    found = sampled_indices(oracle.function, oracle.n, np.random.default_rng(1), 1)
    assert np.abs(found.first_order - oracle.first_order).max() < 0.002
    assert np.abs(found.total_order - oracle.total_order).max() < 0.002


@pytest.mark.parametrize(("count", "quantile"), [(2, 12.7062), (5, 2.7764), (10, 2.2622)])
def test_a_mean_has_as_many_degrees_of_freedom_as_values_but_one(
    count: int, quantile: float
) -> None:
    # Table of Student's distribution, 97.5 %.
    assert student_half(np.ones(1), count) == pytest.approx(quantile / np.sqrt(count), rel=1e-4)


def test_95_percent_intervals_hold_the_exact_index_about_as_often(
    on_cube: Response, exact: TensorIndices
) -> None:
    inside = []
    for seed in range(6):
        found = sampled_indices(on_cube, 10, np.random.default_rng(seed), seed)
        low, high = found.first_order_interval.T
        inside += ((low <= exact.first_order) & (exact.first_order <= high)).tolist()
    assert 0.85 <= np.mean(inside) <= 1.0


def test_a_failed_sample_makes_the_indices_undefined_and_is_counted(on_cube: Response) -> None:
    def failing(unit: np.ndarray) -> np.ndarray:
        return np.where(unit[:, 3] > 0.99, np.nan, on_cube(unit))

    found = sampled_indices(failing, 10, np.random.default_rng(0), 0)
    assert found.failed > 0
    assert np.all(np.isnan(found.total_order))


def test_a_response_that_does_not_vary_has_no_indices() -> None:
    found = sampled_indices(lambda unit: np.full(len(unit), 3.0), 4, np.random.default_rng(0), 0)
    assert np.all(np.isnan(found.first_order))
    assert found.note == "the response does not vary"
