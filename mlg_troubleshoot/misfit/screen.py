"""How much better each candidate explains the misfit than nothing does, and how much of that is
chance.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from mlg_troubleshoot.arrays import Array, Places
from mlg_troubleshoot.misfit.covariance import NoiseModel


class Screen:
    """Candidates against data under one noise model; the products are computed once for all data
    sets.

    noise: the noise. columns, shape (n, n_candidates): effect of each candidate per unit of its
    parameter. [in / unit] signs, shape (n_candidates,): sign that the parameter may have: +1, −1,
    or 0 for both. fixed, shape (n, k): columns that are always fitted: causes named already. exact,
    shape (n_candidates,): the only value that a parameter can have, NaN where it is free.
    """

    def __init__(
        self,
        noise: NoiseModel,
        columns: Array,
        signs: Array,
        fixed: Array | None = None,
        exact: Array | None = None,
    ) -> None:
        self.noise = noise
        self.columns = columns
        self.signs = signs
        self.exact = np.full(len(signs), np.nan) if exact is None else exact
        self.length = np.einsum("ij,ij->j", columns, columns)
        self._weighted = noise.precision_times(columns, 0.0)[0]
        self._parts = [self._part(ratio, fixed) for ratio in noise.tail_ratios]

    def _part(self, ratio: float, fixed: Array | None) -> tuple[Array, Array, Array, float]:
        """A with V⁻¹ − V⁻¹ F (Fᵀ V⁻¹ F)⁻¹ Fᵀ V⁻¹ = V₀⁻¹ − Aᵀ A, A X, squared length of each column,
        and log |V|.

        V₀ has no scatter between tails; F are the fixed columns. A has few rows, so that a further
        ratio costs little.
        """
        root, log_determinant = self.noise.tail_root(ratio)
        if fixed is not None and fixed.shape[1]:
            fixed = fixed / np.maximum(np.linalg.norm(fixed, axis=0), 1e-300)
            held, _log = self.noise.precision_times(fixed, ratio)
            values, vectors = np.linalg.eigh(fixed.T @ held)
            kept = values > 1e-14 * values[-1]
            root = np.vstack([root, (held @ (vectors[:, kept] / np.sqrt(values[kept]))).T])
        along = root @ self.columns
        square = np.einsum("ij,ij->j", self.columns, self._weighted) - np.einsum(
            "ij,ij->j", along, along
        )
        return root, along, square, log_determinant

    def _levels(
        self, data: Array, which: Places | slice = slice(None)
    ) -> Iterator[tuple[Array, Array, Array, Callable[..., Array]]]:
        """For each tail ratio: residual sums of squares without candidates, the products and
        squared lengths of the candidates, and the log-likelihood when something is taken off those
        sums.
        """
        n = len(data)
        plain, products = self.noise.square(data, 0.0), self._weighted[:, which].T @ data
        for root, along, square, log_determinant in self._parts:
            common = root @ data
            rest = self.noise.floored(plain - np.einsum("ij,ij->j", common, common))

            def likelihood(
                drop: Array | float = 0.0, rest: Array = rest, log: float = log_determinant
            ) -> Array:
                return np.asarray(
                    -0.5 * n * np.log(np.maximum(rest - drop, 1e-12 * rest) / n) - 0.5 * log
                )

            yield rest, products - along[:, which].T @ common, square[which], likelihood

    def explained(self, data: Array) -> tuple[Array, Array]:
        """What each candidate takes off the residual sum of squares of each data set, and that sum
        without any, where nothing scatters between tails.
        """
        rest, along, square, _likelihood = next(self._levels(data))
        return self._drop(along, square), rest

    def run(self, data: Array) -> tuple[Array, Array]:
        """Gain in log-likelihood of candidates over the null, shape (n_candidates, n_sets), and the
        null's. [1]
        """
        best = np.full((self.columns.shape[1], data.shape[1]), -np.inf)
        null = np.full(data.shape[1], -np.inf)
        for _rest, along, square, likelihood in self._levels(data):
            null = np.maximum(null, likelihood())
            best = np.maximum(best, likelihood(self._drop(along, square)))
        return best - null, null

    def largest(self, data: Array, penalty: Array) -> Array:
        """Largest gain less its penalty over all candidates, for each of many data sets: what
        chance makes of it.
        """
        kept = np.flatnonzero(np.isfinite(penalty))
        kept = kept[np.argsort(penalty[kept], kind="stable")]
        null = np.full(data.shape[1], -np.inf)
        best = null[None].copy()
        if not len(kept):
            return np.asarray(best[0])
        # Of candidates with the same penalty only the one that explains most counts.
        values, starts = np.unique(penalty[kept], return_index=True)
        for _rest, along, square, likelihood in self._levels(data, kept):
            null = np.maximum(null, likelihood())
            most = np.maximum.reduceat(self._drop(along, square, kept), starts)
            best = np.maximum(best, likelihood(most) - values[:, None])
        return np.asarray(best.max(axis=0) - null)

    def _drop(self, along: Array, square: Array, which: Places | slice = slice(None)) -> Array:
        """What each candidate takes off the residual sum of squares, from its products with the
        data.
        """
        signs, only = self.signs[which], self.exact[which]
        usable = square > 1e-9 * self.length[which]
        one = np.flatnonzero(signs)
        along[one] = np.maximum(along[one] * signs[one, None], 0.0)
        drop = along * along
        drop *= np.where(usable, 1.0 / np.where(usable, square, 1.0), 0.0)[:, None]
        fixed = np.flatnonzero(np.isfinite(only))
        value = (only * np.where(signs, signs, 1))[fixed, None]
        drop[fixed] = np.maximum(2.0 * value * along[fixed] - value**2 * square[fixed, None], 0.0)
        return np.asarray(drop)

    def pairs(self, data: Array, pool: Places) -> Array:
        """Gain in log-likelihood of each candidate together with each of a few partners."""
        best, null = np.full((self.columns.shape[1], len(pool)), -np.inf), -np.inf
        levels = zip(self._parts, self._levels(data[:, None]), strict=True)
        for (_root, low, _square, _log), (_rest, along, square, likelihood) in levels:
            null = max(null, float(likelihood()[0]))
            cross = self.columns.T @ self._weighted[:, pool] - low.T @ low[:, pool]
            own = np.maximum(square, 1e-300)
            apart = square[:, None] * own[pool] - cross**2
            clear = apart > 1e-3 * own[:, None] * own[pool]
            # Least squares for both at once; a pair is refused if one of them would have the wrong
            # sign.
            apart = np.where(clear, apart, 1.0)
            value = (along * own[pool] - cross * along[pool, 0]) / apart
            partner = (along[pool, 0] * own[:, None] - cross * along) / apart
            clear &= (self.signs[:, None] == 0) | (np.sign(value) == self.signs[:, None])
            clear &= (self.signs[pool] == 0) | (np.sign(partner) == self.signs[pool])
            explained = np.where(clear, value * along + partner * along[pool, 0], 0.0)
            best = np.maximum(best, np.where(clear, likelihood(explained), -np.inf))
        return np.asarray(best - null)

    def tail_ratio(self, data: Array) -> tuple[float, float]:
        """Most likely scatter between tails and common scale of one data set, candidates left
        out.
        """
        found = [
            (float(likelihood()[0]), float(rest[0]))
            for rest, _a, _s, likelihood in self._levels(data[:, None])
        ]
        most = max(range(len(found)), key=lambda k: found[k][0])
        return self.noise.tail_ratios[most], float(np.sqrt(found[most][1] / len(data)))


@dataclass(frozen=True)
class Fit:
    """Least-squares fit of some columns under the noise model.

    values, shape (k,): parameters. errors, shape (k,): their standard errors. log_likelihood:
    profiled over scale and tail scatter. [1] tail_ratio, scale: scatter between tails over scatter
    of a row [1], common standard deviation [in].
    """

    values: Array
    errors: Array
    log_likelihood: float
    tail_ratio: float
    scale: float


def shrunk(
    noise: NoiseModel, free: Array, columns: Array, covariance: Array, data: Array
) -> tuple[Array, Array]:
    """Fit free columns, and columns whose values are known beforehand to a covariance: values, and
    their covariance.
    """
    both = np.hstack([free, columns])
    scale = noise.scale_in
    product, _log = noise.precision_times(np.column_stack([both, data]), noise.tail_ratios[-1])
    inner = both.T @ product[:, :-1] / scale**2
    k = free.shape[1]
    inner[k:, k:] += np.linalg.inv(covariance)
    inverse = np.linalg.pinv(inner)
    return inverse @ (both.T @ product[:, -1]) / scale**2, np.asarray(inverse, float)


def fit(noise: NoiseModel, columns: Array, data: Array) -> Fit:
    """Fit columns to one data set, scale and tail scatter included."""
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
            errors = scale * np.sqrt(np.maximum(np.diag(inverse), 0.0))
            best = Fit(values, errors, float(likelihood), ratio, float(scale))
    if best is None:
        raise ValueError("no tail ratio to try")
    return best
