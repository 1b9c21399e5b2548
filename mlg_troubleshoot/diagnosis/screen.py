"""How much better each candidate explains the misfit than nothing does, and how much of that is chance."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mlg_troubleshoot.diagnosis.covariance import NoiseModel

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Gain:
    """Gain in log-likelihood of each candidate over the null, profiled over scale and tail scatter.

    Parameters
    ----------
    gain : ndarray, shape (n_candidates, n_sets)
        Gain in log-likelihood. [1]
    null : ndarray, shape (n_sets,)
        Log-likelihood of the null. [1]
    """

    gain: Array
    null: Array


class Screen:
    """Candidates against data under one noise model; the products are computed once for all data sets.

    Parameters
    ----------
    noise : NoiseModel
        The noise.
    columns : ndarray, shape (n, n_candidates)
        Effect of each candidate per unit of its parameter. [in / unit]
    signs : ndarray, shape (n_candidates,)
        Sign that the parameter may have: +1, −1, or 0 for both.
    fixed : ndarray, shape (n, k), optional
        Columns that are always fitted: causes named already.
    """

    def __init__(self, noise: NoiseModel, columns: Array, signs: Array, fixed: Array | None = None) -> None:
        self.noise = noise
        self.columns = columns
        self.signs = signs
        self.fixed = np.empty((len(columns), 0)) if fixed is None else fixed
        self._parts = [self._part(ratio) for ratio in noise.tail_ratios]

    def _part(self, ratio: float) -> tuple[Array, Array, Array, float]:
        """V⁻¹ X, squared length of each column and projector of the fixed columns at one tail ratio."""
        product, log_determinant = self.noise.precision_times(np.hstack([self.columns, self.fixed]), ratio)
        weighted, held = product[:, : self.columns.shape[1]], product[:, self.columns.shape[1] :]
        if held.shape[1]:
            inner = np.linalg.pinv(self.fixed.T @ held)
            weighted = weighted - held @ (inner @ (self.fixed.T @ weighted))
        square = np.einsum("ij,ij->j", self.columns, weighted)
        return weighted, square, held, log_determinant

    def _base(self, data: Array, index: int) -> tuple[Array, Array]:
        """Residual sum of squares without candidates, and the products with each of them."""
        weighted, _square, held, _log = self._parts[index]
        rest = self.noise.square(data, self.noise.tail_ratios[index])
        if held.shape[1]:
            inner = np.linalg.pinv(self.fixed.T @ held)
            along = held.T @ data
            rest = rest - np.einsum("ij,ij->j", along, inner @ along)
        return self.noise.floored(rest), weighted.T @ data

    def run(self, data: Array) -> Gain:
        """Compute the gains for one or many data sets.

        Parameters
        ----------
        data : ndarray, shape (n, n_sets)
            Misfits. [in]

        Returns
        -------
        Gain
            Gains of all candidates in all sets.
        """
        n = len(data)
        best = np.full((self.columns.shape[1], data.shape[1]), -np.inf)
        null = np.full(data.shape[1], -np.inf)
        for index in range(len(self._parts)):
            rest, along = self._base(data, index)
            _weighted, square, _held, log_determinant = self._parts[index]
            flat = -0.5 * n * np.log(rest / n) - 0.5 * log_determinant
            null = np.maximum(null, flat)
            usable = square > 1e-9 * np.einsum("ij,ij->j", self.columns, self.columns)
            drop = np.where(usable, 1.0, 0.0)[:, None] * along**2 / np.where(usable, square, 1.0)[:, None]
            allowed = (self.signs[:, None] == 0) | (np.sign(along) == self.signs[:, None])
            drop = np.where(allowed, drop, 0.0)
            left = np.maximum(rest - drop, 1e-12 * rest)
            best = np.maximum(best, -0.5 * n * np.log(left / n) - 0.5 * log_determinant)
        return Gain(best - null, null)

    def pairs(self, data: Array, pool: Array) -> Array:
        """Gain in log-likelihood of each candidate together with each of a few partners.

        Parameters
        ----------
        data : ndarray, shape (n,)
            Misfit. [in]
        pool : ndarray of int, shape (n_pool,)
            The partners.

        Returns
        -------
        ndarray, shape (n_candidates, n_pool)
            Gain over the null, profiled over scale and tail scatter; −inf where the two are alike, or one of them
            would have the wrong sign. [1]
        """
        n = len(data)
        best = np.full((self.columns.shape[1], len(pool)), -np.inf)
        null = -np.inf
        for index in range(len(self._parts)):
            rest, along = self._base(data[:, None], index)
            weighted, square, _held, log_determinant = self._parts[index]
            null = max(null, float(-0.5 * n * np.log(rest[0] / n) - 0.5 * log_determinant))
            cross = self.columns.T @ weighted[:, pool]
            own = np.maximum(square, 1e-300)
            apart = square[:, None] * own[pool] - cross**2
            clear = apart > 1e-3 * own[:, None] * own[pool]
            # Least squares for both at once; a pair one of which would have the wrong sign is no pair.
            apart = np.where(clear, apart, 1.0)
            value = (along * own[pool] - cross * along[pool, 0]) / apart
            partner = (along[pool, 0] * own[:, None] - cross * along) / apart
            clear &= (self.signs[:, None] == 0) | (np.sign(value) == self.signs[:, None])
            clear &= (self.signs[pool] == 0) | (np.sign(partner) == self.signs[pool])
            explained = value * along + partner * along[pool, 0]
            remaining = np.maximum(rest[0] - np.where(clear, explained, 0.0), 1e-12 * rest[0])
            likelihood = -0.5 * n * np.log(remaining / n) - 0.5 * log_determinant
            best = np.maximum(best, np.where(clear, likelihood, -np.inf))
        return np.asarray(best - null)

    def tail_ratio(self, data: Array) -> tuple[float, float]:
        """Most likely scatter between tails and common scale of one data set, candidates left out.

        Parameters
        ----------
        data : ndarray, shape (n,)
            Misfit. [in]

        Returns
        -------
        ratio : float
            Scatter between tails over scatter of a row. [1]
        scale : float
            Common standard deviation. [in]
        """
        n = len(data)
        likelihood, scales = [], []
        for index in range(len(self._parts)):
            rest, _along = self._base(data[:, None], index)
            scales.append(float(np.sqrt(rest[0] / n)))
            likelihood.append(-0.5 * n * np.log(rest[0] / n) - 0.5 * self._parts[index][3])
        most = int(np.argmax(likelihood))
        return self.noise.tail_ratios[most], scales[most]


@dataclass(frozen=True)
class Fit:
    """Least-squares fit of some columns under the noise model.

    Parameters
    ----------
    values : ndarray, shape (k,)
        Parameters.
    errors : ndarray, shape (k,)
        Their standard errors.
    log_likelihood : float
        Profiled over scale and tail scatter. [1]
    tail_ratio, scale : float
        Scatter between tails over scatter of a row [1], common standard deviation [in].
    """

    values: Array
    errors: Array
    log_likelihood: float
    tail_ratio: float
    scale: float


def fit(noise: NoiseModel, columns: Array, data: Array) -> Fit:
    """Fit columns to one data set, scale and tail scatter included.

    Parameters
    ----------
    noise : NoiseModel
        The noise.
    columns : ndarray, shape (n, k)
        Effects per unit of the parameters.
    data : ndarray, shape (n,)
        Misfit. [in]

    Returns
    -------
    Fit
        The most likely fit.
    """
    n, k = columns.shape
    best: Fit | None = None
    for ratio in noise.tail_ratios:
        product, log_determinant = noise.precision_times(np.column_stack([columns, data]), ratio)
        inner = columns.T @ product[:, :k]
        inverse = np.linalg.pinv(inner)
        values = inverse @ (columns.T @ product[:, k])
        rest = float(noise.floored(data @ product[:, k] - values @ inner @ values))
        likelihood = -0.5 * n * np.log(rest / n) - 0.5 * log_determinant
        if best is None or likelihood > best.log_likelihood:
            scale = np.sqrt(rest / max(n - k, 1))
            best = Fit(values, scale * np.sqrt(np.diag(inverse)), float(likelihood), ratio, float(scale))
    if best is None:
        raise ValueError("no tail ratio to try")
    return best
