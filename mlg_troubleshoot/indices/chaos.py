"""Polynomial chaos by least squares: the fast route for a smooth response, with a check that it is
smooth.

The response is fitted by orthonormal Legendre polynomials of the unit cube; Eqs. 1 and 2 are then
sums of squared coefficients. Points that took no part in the fit, and corners of the range, say
whether to trust it: a clipped or otherwise kinked response is handed to
:mod:`~mlg_troubleshoot.indices.saltelli`.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from itertools import combinations_with_replacement

import numpy as np
from numpy.random import Generator

from mlg_troubleshoot.arrays import Array, Wholes, count_failed
from mlg_troubleshoot.indices.estimators import Indices, without_numbers
from mlg_troubleshoot.indices.inputs import Response

# Points held out inside the range and at its corners to judge an expansion by. [1]
_HELD_OUT = 48
_CORNERS = 16
# Terms of an expansion at most, and points for each term at least. [1]
_MOST_TERMS = 500
_PER_TERM = 1.3
# A fit that follows the inside of the range but misses a corner by more than this share of the
# standard deviation has met a kink.
_CORNER_MISS = 0.1


@dataclass(frozen=True, slots=True)
class ChaosFit:
    """A polynomial of the unit cube with orthonormal terms.

    exponents, shape (n_terms, n): degrees of each term in each variable, the constant first.
    residual: mean square of the held-out residuals over the variance. [1]
    corner_miss: largest residual at corners of the range over the standard deviation. [1]
    """

    exponents: Wholes
    coefficients: Array
    residual: float
    corner_miss: float
    trained_on: int

    @property
    def variance(self) -> float:
        return float(np.sum(self.coefficients[1:] ** 2))

    def closed(self, group: tuple[int, ...]) -> float:
        """Closed index of a group: what it explains alone, interactions within it included."""
        others = np.delete(self.exponents, list(group), axis=1)
        outside = others.sum(axis=1)
        squares = self.coefficients[1:] ** 2
        return float(squares[outside[1:] == 0].sum() / self.variance)

    def index_error(self, accuracy_of: Array) -> Array:
        """Error of indices from what the polynomial leaves out.

        Returns, shape (n,): bound of the omitted share, and twice the effect of its aliasing on the
        coefficients.
          [1]
        """
        level = np.clip(accuracy_of, self.residual, 1.0)
        free = max(self.trained_on - len(self.coefficients), 1)
        return self.residual + 4.0 * np.sqrt(level * self.residual / free)


def chaos_indices(
    response: Response, n: int, rng: Generator, seed: int, accuracy: float = 1e-3, most: int = 2048
) -> tuple[Indices, ChaosFit | None]:
    """Compute indices by polynomial chaos, with as few evaluations as the accuracy needs."""
    some_corners = rng.integers(0, 2, (_CORNERS - 2, n))
    corners = np.concatenate([np.zeros((1, n)), np.ones((1, n)), some_corners])
    held = _latin(rng, _HELD_OUT, n)
    checks = np.concatenate([held, corners])
    # Points of the first fit: enough for the second degree, or for a good one where variables are
    # few.
    count = max(128, 2 * len(total_degree(n, 2)))
    points = _latin(rng, count, n)
    values = response(np.concatenate([checks, points]))
    check_values = values[: len(checks)]
    values = values[len(checks) :]
    best: ChaosFit | None = None
    while True:
        used = len(check_values) + len(values)
        failed = count_failed(check_values) + count_failed(values)
        design = (
            f"polynomial chaos, {len(values)} points for the fit and {len(checks)} for its check"
        )
        if failed:
            return without_numbers(design, seed, n, used, failed=failed), None
        before = np.inf if best is None else best.residual
        best = _best_fit(points, values, checks, check_values, best)
        if best is not None:
            found = _indices(best, design, seed, used, float(best.coefficients[0]))
            if found.half_width <= accuracy and best.corner_miss <= _CORNER_MISS:
                return found, best
        gains = best is None or best.residual < 0.5 * before
        if not gains or used + len(values) > most:
            residual = "undefined" if best is None else f"{best.residual:.2g} of the variance"
            note = f"not smooth: a polynomial leaves {residual} unexplained"
            mean = float(values.mean())
            return without_numbers(design, seed, n, used, note, mean=mean), None
        more = _latin(rng, len(values), n)
        points = np.concatenate([points, more])
        values = np.concatenate([values, response(more)])


def _latin(rng: Generator, count: int, n: int) -> Array:
    strata = np.tile(np.arange(count), (n, 1))
    places = rng.permuted(strata, axis=1).T
    return (places + rng.random((count, n))) / count


def _best_fit(
    points: Array, values: Array, checks: Array, check_values: Array, found: ChaosFit | None
) -> ChaosFit | None:
    """Try degrees upward as long as the held-out residual falls."""
    n = points.shape[1]
    spread = float(np.concatenate([values, check_values[:_HELD_OUT]]).var())
    if spread <= 1e-24 * float(np.mean(values)) ** 2 or spread == 0.0:
        return None
    last = np.inf if found is None else found.residual
    for degree in range(2, 21):
        exponents = total_degree(n, degree)
        if len(exponents) * _PER_TERM > len(points) or len(exponents) > _MOST_TERMS:
            break
        matrix = legendre_terms(points, exponents)
        gram = matrix.T @ matrix
        right = matrix.T @ values
        try:
            coefficients = np.linalg.solve(gram, right)
        except np.linalg.LinAlgError:
            break
        misses = check_values - legendre_terms(checks, exponents) @ coefficients
        residual = float(np.mean(misses[:_HELD_OUT] ** 2)) / spread
        if residual < last:
            at_corners = np.abs(misses[_HELD_OUT:])
            corner = float(at_corners.max()) / np.sqrt(spread)
            found = ChaosFit(
                exponents, np.asarray(coefficients, float), residual, corner, len(points)
            )
            last = residual
            if residual < 1e-10:
                break
        elif residual > 4.0 * last and degree > 4:
            break
    return found


def _indices(fit: ChaosFit, design: str, seed: int, used: int, mean: float) -> Indices:
    squares = fit.coefficients[1:] ** 2
    present = fit.exponents[1:] > 0
    order = present.sum(axis=1)
    variance = fit.variance
    first = squares[order == 1] @ present[order == 1] / variance
    total = squares @ present / variance
    pairs = present[order == 2].astype(float)
    second = pairs.T @ (squares[order == 2][:, None] * pairs) / variance
    np.fill_diagonal(second, 0.0)
    estimates = (first, fit.index_error(first)), (total, fit.index_error(total))
    return Indices.around(design, seed, *estimates, mean, variance, used, 0, "", second)


@lru_cache(maxsize=64)
def total_degree(n: int, degree: int) -> Wholes:
    """Exponents of all polynomials up to a total degree, shape (n_terms, n), the constant first.
    [1]
    """
    chosen = (
        c for total in range(degree + 1) for c in combinations_with_replacement(range(n), total)
    )
    counts = [np.bincount(np.array(c, int), minlength=n) for c in chosen]
    exponents = np.array(counts, np.int64)
    exponents.flags.writeable = False
    return exponents


def legendre_terms(unit: Array, exponents: Wholes) -> Array:
    """Orthonormal Legendre polynomials at points of the unit cube, shape (n_points, n_terms).
    [1]
    """
    degree = int(exponents.max(initial=0))
    values = np.polynomial.legendre.legvander(2.0 * unit.T - 1.0, degree)
    values *= np.sqrt(2.0 * np.arange(degree + 1) + 1.0)
    matrix = np.ones((len(unit), len(exponents)))
    for own, powers in zip(values, exponents.T, strict=True):
        matrix *= own[:, powers]
    return matrix
