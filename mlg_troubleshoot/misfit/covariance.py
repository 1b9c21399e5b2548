"""Covariance of the rows when nothing is wrong, in a form that is cheap to invert."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from scipy.linalg import solve_triangular

from mlg_troubleshoot.arrays import Array, Mask, Wholes

# Rows further out than this many standard deviations count less, and may be entry errors.
FAR = 3.0


@dataclass(frozen=True)
class NoiseModel:
    """Covariance of the rows: diagonal scatter, common scatter of each tail, bias and slope.

    relative, shape (n,): standard deviation of each row in units of the common one. [1] tails,
    shape (n,): number of the tail of each row. gears, shape (n,): number of the single gear of each
    row. loadings, shape (n, k): bias, slope and small trends, each at one standard deviation in
    units of the common one. [1] floor_in: scatter that every row has at least. [in] gear_ratio:
    scatter between the gears of one tail over the scatter of a row. [1] tail_ratios: ratios of the
    scatter between tails to the scatter of a row that are tried. [1] scale_in: the common standard
    deviation as it was estimated. [in] chain, shape (n,): number of the series in which a
    row follows others, if rows do. time, shape (n,): when, in usual steps of a series. correlation:
    of the own scatter of two rows of a series one usual step apart; rows further apart are less
    alike by a power of it (a process that forgets, Jones 1980). [1]
    """

    relative: Array
    tails: Wholes
    gears: Wholes
    loadings: Array
    floor_in: float
    gear_ratio: float
    tail_ratios: tuple[float, ...]
    scale_in: float
    absorbed: int = 0
    tail_chances: tuple[float, ...] = ()
    chain: Wholes | None = None
    time: Array | None = None
    correlation: float = 0.0
    _roots: dict[float, tuple[Array, float]] = field(
        default_factory=dict, init=False, repr=False, compare=False
    )

    @classmethod
    def white(cls, n: int) -> NoiseModel:
        """Noise of rows that are whitened already: equal, independent and of unit size."""
        none = np.zeros(n, np.int64)
        return cls(np.ones(n), none, none, np.empty((n, 0)), 0.0, 0.0, (0.0,), 1.0)

    @property
    def tail_levels(self) -> list[tuple[float, float]]:
        """Each ratio of the scatter between tails, and the logarithm of its chance beforehand."""
        chances = self.tail_chances or (1.0,) * len(self.tail_ratios)
        return list(zip(self.tail_ratios, np.log(chances).tolist(), strict=True))

    def with_tails(self, ratio: float) -> NoiseModel:
        """The same with one ratio of the scatter between tails."""
        return replace(self, tail_ratios=(ratio,), tail_chances=())

    def floored(self, square: Array) -> Array:
        """Add what no row can be better than to a residual sum of squares."""
        return np.maximum(square, 0.0) + len(self.relative) * self.floor_in**2

    def take(self, rows: Mask) -> NoiseModel:
        """Return the noise of some of the rows."""
        return replace(
            self,
            relative=self.relative[rows],
            tails=self.tails[rows],
            gears=self.gears[rows],
            loadings=self.loadings[rows],
            chain=None if self.chain is None else self.chain[rows],
            time=None if self.time is None else self.time[rows],
        )

    @property
    def worth(self) -> float:
        """Independent rows that would say as much of a constant. [1]"""
        return len(self.relative) * (1.0 - self.correlation) / (1.0 + self.correlation)

    @cached_property
    def _steps(self) -> tuple[Wholes, Wholes, Array]:
        """Rows that follow one of their series, the rows that they follow, and how alike the two
        are.
        """
        if self.chain is None or self.time is None or self.correlation == 0.0:
            return np.empty(0, np.int64), np.empty(0, np.int64), np.empty(0)
        order = np.lexsort((self.time, self.chain))
        follows = np.diff(self.chain[order]) == 0
        row, before = order[1:][follows], order[:-1][follows]
        return row, before, self.correlation ** (self.time[row] - self.time[before])

    def own(self, columns: Array) -> Array:
        """What of some columns is new in each row, over its scatter: independent of the others."""
        row, before, alike = self._steps
        scaled = columns / self.relative[:, None]
        fresh = scaled.copy()
        fresh[row] -= alike[:, None] * scaled[before]
        fresh[row] /= np.sqrt(1.0 - alike**2)[:, None]
        return np.asarray(fresh)

    def _own_precision_times(self, columns: Array) -> Array:
        """Multiply columns by the inverse covariance of the rows' own scatter."""
        row, before, alike = self._steps
        if not len(row):
            return np.asarray(columns / self.relative[:, None] ** 2)
        fresh = self.own(columns)
        fresh[row] /= np.sqrt(1.0 - alike**2)[:, None]
        product = fresh.copy()
        product[before] -= alike[:, None] * fresh[row]
        return np.asarray(product / self.relative[:, None])

    def beside(self, effects_in: Array) -> NoiseModel:
        """Add effects of unknown size, each at one standard deviation."""
        return replace(self, loadings=np.hstack([self.loadings, effects_in / self.scale_in]))

    def share_of(self, effects_in: Array, data: Array) -> Array:
        """What effects of unknown size that are part of this covariance most likely explain of data
        (BLUP). [in]
        """
        product, _log = self.precision_times(data[:, None], self.tail_ratios[-1])
        return np.asarray(effects_in @ (effects_in.T @ product[:, 0]) / self.scale_in**2)

    def own_part(self, data: Array) -> tuple[Array, float]:
        """What each row scatters by itself, all that rows have in common taken out, and the share
        of the rows that is left to tell it. [in, 1]
        """
        if self.correlation:
            held = self.own(self.factors(self.tail_ratios[-1]))
            free = replace(NoiseModel.white(len(data)), loadings=held)
            own, share = free.own_part(self.own(data[:, None])[:, 0])
            return self.relative * own, share
        root, _log = self._root(self.tail_ratios[-1])
        own = data - self.relative**2 * (root.T @ (root @ data))
        return own, float(1.0 - np.mean(self.relative**2 * np.sum(root**2, axis=0)))

    def factors(self, tail_ratio: float) -> Array:
        """Low-rank part of the covariance, shape (n, k). [1]"""
        each = self.gear_ratio * (self.gears[:, None] == np.arange(self.gears.max() + 1))
        if tail_ratio == 0.0:
            return np.hstack([each, self.loadings])
        indicator = (self.tails[:, None] == np.arange(self.tails.max() + 1)).astype(float)
        return np.hstack([tail_ratio * indicator, each, self.loadings])

    def precision_times(self, columns: Array, tail_ratio: float) -> tuple[Array, float]:
        """Multiply columns by the inverse covariance (Woodbury)."""
        root, log_determinant = self._root(tail_ratio)
        return self._own_precision_times(columns) - root.T @ (root @ columns), log_determinant

    def square(self, data: Array, tail_ratio: float) -> Array:
        """Squared length of data sets under the inverse covariance."""
        root, _log = self._root(tail_ratio)
        own, common = self.own(data), root @ data
        return np.asarray(np.einsum("ij,ij->j", own, own) - np.einsum("ij,ij->j", common, common))

    def _root(self, tail_ratio: float) -> tuple[Array, float]:
        """R with V⁻¹ = diag(1 / relative²) − Rᵀ R, and the logarithm of V's determinant."""
        if tail_ratio not in self._roots and tail_ratio > 0.0:
            root, log_determinant = self.tail_root(tail_ratio)
            self._roots[tail_ratio] = np.vstack([self._root(0.0)[0], root]), log_determinant
        elif tail_ratio not in self._roots:
            low = self.factors(0.0)
            scaled = self._own_precision_times(low)
            lower = np.linalg.cholesky(np.eye(low.shape[1]) + low.T @ scaled)
            log_determinant = 2.0 * float(
                np.sum(np.log(np.diag(lower))) + np.sum(np.log(self.relative))
            )
            log_determinant += float(np.sum(np.log1p(-(self._steps[2] ** 2))))
            self._roots[tail_ratio] = solve_triangular(lower, scaled.T, lower=True), log_determinant
        return self._roots[tail_ratio]

    def tail_root(self, tail_ratio: float) -> tuple[Array, float]:
        """E with V⁻¹ = V₀⁻¹ − Eᵀ E, V₀ without scatter between tails, and the logarithm of V's
        determinant.
        """
        log_determinant = self._root(0.0)[1]
        if tail_ratio == 0.0:
            return np.empty((0, len(self.relative))), log_determinant
        indicator = tail_ratio * (self.tails[:, None] == np.arange(self.tails.max() + 1))
        scaled, _log = self.precision_times(indicator, 0.0)
        lower = np.linalg.cholesky(np.eye(indicator.shape[1]) + indicator.T @ scaled)
        log_determinant += 2.0 * float(np.sum(np.log(np.diag(lower))))
        return solve_triangular(lower, scaled.T, lower=True), log_determinant
