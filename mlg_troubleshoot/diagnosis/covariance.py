"""Covariance of the rows when nothing is wrong, in a form that is cheap to invert."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular

Array = NDArray[np.float64]


@dataclass(frozen=True)
class NoiseModel:
    """Covariance of the rows: diagonal scatter, common scatter of each tail, bias and slope.

    Parameters
    ----------
    relative : ndarray, shape (n,)
        Standard deviation of each row in units of the common one. [1]
    tails : ndarray of int, shape (n,)
        Number of the tail of each row.
    gears : ndarray of int, shape (n,)
        Number of the single gear of each row.
    loadings : ndarray, shape (n, k)
        Bias, slope and small trends, each at one standard deviation in units of the common one. [1]
    floor_in : float
        Scatter that every row has at least. [in]
    gear_ratio : float
        Scatter between the gears of one tail over the scatter of a row. [1]
    tail_ratios : tuple of float
        Ratios of the scatter between tails to the scatter of a row that are tried. [1]
    """

    relative: Array
    tails: NDArray[np.int64]
    gears: NDArray[np.int64]
    loadings: Array
    floor_in: float
    gear_ratio: float
    tail_ratios: tuple[float, ...]
    _roots: dict[float, tuple[Array, float]] = field(default_factory=dict, init=False, repr=False, compare=False)

    def floored(self, square: Array) -> Array:
        """Add what no row can be better than to a residual sum of squares.

        Parameters
        ----------
        square : ndarray
            Residual sums of squares. [in²]

        Returns
        -------
        ndarray
            With the least scatter of every row. [in²]
        """
        return np.maximum(square, 0.0) + len(self.relative) * self.floor_in**2

    def take(self, rows: NDArray[np.bool_]) -> NoiseModel:
        """Return the noise of some of the rows.

        Parameters
        ----------
        rows : ndarray of bool, shape (n,)
            The rows.

        Returns
        -------
        NoiseModel
            Their noise.
        """
        return NoiseModel(
            self.relative[rows],
            self.tails[rows],
            self.gears[rows],
            self.loadings[rows],
            self.floor_in,
            self.gear_ratio,
            self.tail_ratios,
        )

    def factors(self, tail_ratio: float) -> Array:
        """Low-rank part of the covariance, shape (n, k). [1]"""
        each = self.gear_ratio * (self.gears[:, None] == np.arange(self.gears.max() + 1))
        if tail_ratio == 0.0:
            return np.hstack([each, self.loadings])
        indicator = (self.tails[:, None] == np.arange(self.tails.max() + 1)).astype(float)
        return np.hstack([tail_ratio * indicator, each, self.loadings])

    def precision_times(self, columns: Array, tail_ratio: float) -> tuple[Array, float]:
        """Multiply columns by the inverse covariance (Woodbury).

        Parameters
        ----------
        columns : ndarray, shape (n, k)
            Columns.
        tail_ratio : float
            Scatter between tails over scatter of a row. [1]

        Returns
        -------
        product : ndarray, shape (n, k)
            V⁻¹ times the columns, V in units of the common variance.
        log_determinant : float
            Logarithm of the determinant of V. [1]
        """
        root, log_determinant = self._root(tail_ratio)
        return columns / self.relative[:, None] ** 2 - root.T @ (root @ columns), log_determinant

    def square(self, data: Array, tail_ratio: float) -> Array:
        """Squared length of data sets under the inverse covariance.

        Parameters
        ----------
        data : ndarray, shape (n, n_sets)
            Data sets. [in]
        tail_ratio : float
            Scatter between tails over scatter of a row. [1]

        Returns
        -------
        ndarray, shape (n_sets,)
            Squared lengths. [in²]
        """
        root, _log = self._root(tail_ratio)
        own, common = data / self.relative[:, None], root @ data
        return np.asarray(np.einsum("ij,ij->j", own, own) - np.einsum("ij,ij->j", common, common))

    def _root(self, tail_ratio: float) -> tuple[Array, float]:
        """R with V⁻¹ = diag(1 / relative²) − Rᵀ R, and the logarithm of V's determinant."""
        if tail_ratio not in self._roots:
            low = self.factors(tail_ratio)
            scaled = low / self.relative[:, None] ** 2
            lower = np.linalg.cholesky(np.eye(low.shape[1]) + low.T @ scaled)
            log_determinant = 2.0 * float(np.sum(np.log(np.diag(lower))) + np.sum(np.log(self.relative)))
            self._roots[tail_ratio] = solve_triangular(lower, scaled.T, lower=True), log_determinant
        return self._roots[tail_ratio]

    def draw(self, residuals: Array, tail_ratio: float, scale: float, n: int, rng: np.random.Generator) -> Array:
        """Draw data sets in which nothing is wrong.

        Parameters
        ----------
        residuals : ndarray, shape (m,)
            Standardised residuals to draw from, so that heavy tails stay. [1]
        tail_ratio : float
            Scatter between tails over scatter of a row. [1]
        scale : float
            Common standard deviation. [in]
        n : int
            Number of data sets.
        rng : numpy.random.Generator
            Source of randomness.

        Returns
        -------
        ndarray, shape (n_rows, n)
            The data sets. [in]
        """
        rows = len(self.relative)
        drawn = rng.choice(residuals, size=(rows, n)) * rng.choice([-1.0, 1.0], size=(rows, n))
        low = self.factors(tail_ratio)
        common = low @ rng.standard_normal((low.shape[1], n))
        return np.asarray(scale * (self.relative[:, None] * drawn + common))
