"""Polynomial chaos with its check, and the fall back to sampling."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from mlg_troubleshoot.indices.chaos import chaos_indices, legendre_terms, total_degree
from mlg_troubleshoot.indices.inputs import Response, beyond_margin
from mlg_troubleshoot.indices.saltelli import fast_indices
from mlg_troubleshoot.indices.tensor import TensorIndices, tensor_indices


def _rng(seed: int = 0) -> np.random.Generator:
    return np.random.default_rng(seed)


@pytest.mark.parametrize("seed", range(10))
def test_512_solutions_give_every_index_of_the_linkage_to_1e_3(
    on_cube: Response, exact: TensorIndices, seed: int
) -> None:
    found, fit = chaos_indices(on_cube, 10, _rng(seed), seed)
    assert fit is not None
    assert found.evaluations <= 512
    assert np.abs(found.first_order - exact.first_order).max() < 1e-3
    assert np.abs(found.total_order - exact.total_order).max() < 1e-3


def test_95_percent_intervals_hold_the_exact_index_as_often(
    on_cube: Response, exact: TensorIndices
) -> None:
    inside = []
    for seed in range(40):
        found, _ = chaos_indices(on_cube, 10, _rng(seed), seed)
        low, high = found.first_order_interval.T
        inside.append((low <= exact.first_order) & (exact.first_order <= high))
    assert np.mean(inside) >= 0.95


CLIPPED: dict[str, Callable[[Response], Response]] = {
    "cut off above the margin": lambda f: lambda u: np.minimum(f(u), 0.03),
    "only beyond the margin": lambda f: lambda u: np.maximum(f(u), 0.03),
    "cut off in the middle": lambda f: lambda u: np.maximum(f(u), 0.045),
    "seen only in a corner": lambda f: lambda u: np.maximum(f(u), 0.095),
    "a step": lambda f: beyond_margin(f, 0.05),
}


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("kind", list(CLIPPED))
def test_a_kinked_response_does_not_fool_the_fast_route(
    on_cube: Response, kind: str, seed: int
) -> None:
    found, fit = chaos_indices(CLIPPED[kind](on_cube), 10, _rng(seed), seed)
    assert fit is None
    assert np.all(np.isnan(found.first_order))
    assert "not smooth" in found.note


def test_a_kink_that_only_the_farthest_corner_shows_is_found(on_cube: Response) -> None:
    inside = on_cube(_rng(5).random((2000, 10)))
    assert inside.max() < 0.1 < float(on_cube(np.ones((1, 10)))[0])
    _, fit = chaos_indices(
        lambda u: on_cube(u) + 50.0 * np.maximum(on_cube(u) - 0.1, 0.0), 10, _rng(), 0
    )
    assert fit is None


def test_a_ripple_that_vanishes_at_every_corner_is_found(on_cube: Response) -> None:
    _, fit = chaos_indices(
        lambda u: on_cube(u) + 0.0003 * np.sin(14.0 * np.pi * u[:, 0]), 10, _rng(), 0
    )
    assert fit is None


def test_a_refused_response_is_sampled_and_the_note_says_so(on_cube: Response) -> None:
    def kinked(unit: np.ndarray) -> np.ndarray:
        return np.maximum(on_cube(unit), 0.045)

    found, _ = fast_indices(kinked, 10, _rng(), 0, accuracy=0.01)
    reference = tensor_indices(kinked, np.ones(10), order=4)
    assert "not smooth" in found.note
    assert "Saltelli" in found.design
    assert np.abs(found.first_order - reference.first_order).max() < 0.01


def test_a_response_that_does_not_vary_is_not_given_indices() -> None:
    found, fit = chaos_indices(lambda u: np.full(len(u), 3.0), 4, _rng(), 0)
    assert fit is None
    assert np.all(np.isnan(found.first_order))


def test_samples_that_fail_are_counted_and_make_the_indices_undefined(on_cube: Response) -> None:
    def failing(unit: np.ndarray) -> np.ndarray:
        return np.where(unit[:, 0] > 0.9, np.nan, on_cube(unit))

    found, _ = fast_indices(failing, 10, _rng(), 0)
    assert found.failed > 0
    assert np.all(np.isnan(found.first_order))
    assert "do not close" in found.note


def test_the_polynomials_are_orthonormal() -> None:
    points, weights = np.polynomial.legendre.leggauss(6)
    grid = np.stack(
        np.meshgrid((points + 1) / 2, (points + 1) / 2, indexing="ij"), axis=-1
    ).reshape(-1, 2)
    weight = np.outer(weights, weights).ravel() / 4.0
    terms = legendre_terms(grid, total_degree(2, 4))
    assert terms.T @ (weight[:, None] * terms) == pytest.approx(np.eye(terms.shape[1]), abs=1e-12)


def test_second_order_indices_of_a_product_are_exact() -> None:
    found, _ = chaos_indices(lambda u: u[:, 0] * u[:, 1] + u[:, 2], 3, _rng(), 0)
    assert found.second_order is not None
    # V = 7/144 for the product, of which 1/144 is its interaction, and 12/144 for the sum's last
    # term.
    assert found.second_order[0, 1] == pytest.approx(1.0 / 19.0, abs=1e-9)


def test_swapping_two_joints_swaps_their_indices(on_cube: Response) -> None:
    order = [1, 0, *range(2, 10)]
    plain, _ = chaos_indices(on_cube, 10, _rng(), 0)
    swapped, _ = chaos_indices(lambda u: on_cube(u[:, order]), 10, _rng(), 0)
    assert swapped.first_order == pytest.approx(plain.first_order[order], abs=2e-4)


def test_a_seed_gives_the_same_bits_again(on_cube: Response) -> None:
    first, _ = chaos_indices(on_cube, 10, _rng(7), 7)
    again, _ = chaos_indices(on_cube, 10, _rng(7), 7)
    other, _ = chaos_indices(on_cube, 10, _rng(8), 8)
    assert np.array_equal(first.first_order, again.first_order)
    assert not np.array_equal(first.first_order, other.first_order)
