"""Covariance of the rows when nothing is wrong, in a form that is cheap to invert."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from typing import Any

import numpy as np
from scipy.linalg import solve_triangular
from scipy.sparse import csr_array

from mlg_troubleshoot.arrays import Array, Mask, Wholes
from mlg_troubleshoot.misfit.columns import ColumnBlock, EffectColumns

# Sums over the rows of each group of one kind, and over all rows: R with V⁻¹ = P − Rᵀ R, P the
# inverse of what each row scatters by itself; the logarithm of V's determinant.
_Root = tuple[tuple[csr_array, ...], Array, float]

# Computing only: rows times gears up to which a table is small.
_SMALL = 100_000
# Rows further out than this many standard deviations count less, and may be entry errors.
FAR = 3.0


@dataclass(frozen=True)
class NoiseModel:
    """Covariance of the rows: diagonal scatter, common scatter of each tail, bias and slope.

    Attributes
    ----------
    relative : ndarray, shape (n,)
        Standard deviation of each row in units of the common one. [1]
    tails, gears : ndarray of int, shape (n,)
        Number of the tail, and of the single gear, of each row.
    loadings : ndarray, shape (n, k)
        Bias, slope and small trends, each at one standard deviation in units of the common one. [1]
    floor_in : float
        Scatter that every row has at least. [in]
    gear_ratio : float
        Scatter between the gears of one tail over the scatter of a row. [1]
    tail_ratios : tuple of float
        Ratios of the scatter between tails to the scatter of a row that are tried. [1]
    scale_in : float
        The common standard deviation as it was estimated. [in]
    absorbed : int
        How many of the first loadings are nuisance parameters; each takes as much as one row tells.
    tail_chances : tuple of float
        Probability of each of the `tail_ratios` beforehand; alike if empty. [1]
    chain : ndarray of int, shape (n,), optional
        Number of the series in which a row follows others.
    time : ndarray, shape (n,), optional
        When each row was taken, in usual steps of a series.
    correlation : float
        Of the own scatter of two rows of a series one usual step apart; rows further apart are less
        alike by a power of it (a process that forgets, Jones 1980). [1]
    of_gear : ndarray, shape (n,), optional
        Further scatter that the rows of a gear have in common, each row in its own measure. [1]
    of_tail : ndarray, shape (n, k), optional
        Further scatter that the rows of a tail have in common, column by column and independent of
        each other, each row in its own measure. [1]
    far_out : ndarray, shape (n,), optional
        How many times wider a row's scatter was made, because it lies so much further out than
        `FAR` standard deviations. [1]
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
    of_gear: Array | None = None
    of_tail: Array | None = None
    far_out: Array | None = None
    _roots: dict[float, _Root] = field(default_factory=dict, init=False, repr=False, compare=False)

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

    @property
    def distance(self) -> Array:
        """How far out the rows lie whose scatter was made wider, over what it was; 0 for others."""
        if self.far_out is None:
            return np.zeros(len(self.relative))
        return np.where(self.far_out > 1.0, FAR * self.far_out, 0.0)

    def floored(self, square: Array) -> Array:
        """Add what no row can be better than to a residual sum of squares."""
        return np.maximum(square, 0.0) + len(self.relative) * self.floor_in**2

    def take(self, rows: Mask) -> NoiseModel:
        """Return the noise of some of the rows."""
        every = {f.name: getattr(self, f.name) for f in fields(self)}
        own: dict[str, Any] = {k: v[rows] for k, v in every.items() if isinstance(v, np.ndarray)}
        return replace(self, **own)

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
        row = order[1:][follows]
        before = order[:-1][follows]
        return row, before, self.correlation ** (self.time[row] - self.time[before])

    def own(self, columns: Array) -> Array:
        """What of some columns is new in each row, over its scatter: independent of the others."""
        row, before, alike = self._steps
        scaled = columns / self.relative[:, None]
        fresh = scaled.copy()
        fresh[row] -= alike[:, None] * scaled[before]
        fresh[row] /= np.sqrt(1.0 - alike**2)[:, None]
        return fresh

    def _own_precision_times(self, columns: Array) -> Array:
        """Multiply columns by the inverse covariance of the rows' own scatter."""
        row, before, alike = self._steps
        if not len(row):
            return columns / self.relative[:, None] ** 2
        fresh = self.own(columns)
        fresh[row] /= np.sqrt(1.0 - alike**2)[:, None]
        product = fresh.copy()
        product[before] -= alike[:, None] * fresh[row]
        return product / self.relative[:, None]

    def with_effects(self, effects_in: Array) -> NoiseModel:
        """Add effects of unknown size, each at one standard deviation."""
        return replace(self, loadings=np.hstack([self.loadings, effects_in / self.scale_in]))

    def with_tails_apart(self, scatter_in: Array) -> NoiseModel:
        """Add what the rows of each tail have in common, (n, k), at one standard deviation."""
        return replace(self, of_tail=scatter_in / self.scale_in)

    def share_of(self, effects_in: Array, data: Array) -> Array:
        """What effects of unknown size that are part of this covariance most likely explain of data
        (BLUP). [in]
        """
        product, _log = self.precision_times(data[:, None], self.tail_ratios[-1])
        return effects_in @ (effects_in.T @ product[:, 0]) / self.scale_in**2

    def share_of_groups(self, scatter_in: Array, group: Wholes, data: Array) -> Array:
        """The same of what the rows of each group scatter alike, each in its own measure. [in]"""
        product, _log = self.precision_times(data[:, None], self.tail_ratios[-1])
        pull = np.bincount(group, scatter_in * product[:, 0])
        return scatter_in * pull[group] / self.scale_in**2

    def own_part(self, data: Array) -> tuple[Array, float]:
        """What each row scatters by itself, all that rows have in common taken out, and the share
        of the rows that is left to tell it. [in, 1]
        """
        if self.correlation:
            held = self.own(self.factors(self.tail_ratios[-1]))
            free = replace(NoiseModel.white(len(data)), loadings=held)
            own, share = free.own_part(self.own(data[:, None])[:, 0])
            return self.relative * own, share
        groups, low, _log = self._root(self.tail_ratios[-1])
        taken = sum(root.power(2).sum(axis=0) for root in groups) + np.sum(low**2, axis=0)
        own = data - self.relative**2 * self._in_common(data, self.tail_ratios[-1])
        return own, float(1.0 - np.mean(self.relative**2 * taken))

    def factors(self, tail_ratio: float) -> Array:
        """Low-rank part of the covariance, shape (n, k). [1]"""
        each = [
            scatter[:, None] * (group[:, None] == np.arange(group.max() + 1))
            for group, scatter in self._groups(tail_ratio)
        ]
        return np.hstack([*each, self.loadings])

    def _groups(self, tail_ratio: float) -> list[tuple[Wholes, Array]]:
        """Group of each row and what rows of one have in common, gears first. [1]"""
        one = np.ones(len(self.relative))
        found = [(self.gears, self.gear_ratio * one)]
        if self.of_gear is not None:
            found.append((self.gears, self.of_gear))
        if self.of_tail is not None:
            found.extend((self.tails, scatter) for scatter in self.of_tail.T)
        found.append((self.tails, tail_ratio * one))
        return [(group, scatter) for group, scatter in found if scatter.any()]

    def precision_times(self, columns: Array, tail_ratio: float) -> tuple[Array, float]:
        """Multiply columns by the inverse covariance (Woodbury)."""
        product = self._own_precision_times(columns) - self._in_common(columns, tail_ratio)
        return product, self._root(tail_ratio)[2]

    def _in_common(self, columns: Array, tail_ratio: float) -> Array:
        """What rows have in common, taken off their own part by the inverse covariance."""
        groups, low, _log = self._root(tail_ratio)
        found = low.T @ (low @ columns)
        for root in groups:
            found += root.T @ (root @ columns)
        return found

    def square(self, data: Array, tail_ratio: float) -> Array:
        """Squared length of data sets under the inverse covariance."""
        groups, low, _log = self._root(tail_ratio)
        own = self.own(data)
        parts = (low @ data, *(root @ data for root in groups))
        common = np.sum([np.einsum("ij,ij->j", part, part) for part in parts], axis=0)
        return np.asarray(np.einsum("ij,ij->j", own, own) - common)

    def squares(self, columns: EffectColumns) -> Array:
        """The same of many columns, for each ratio of the scatter between tails, (levels, p)."""
        roots = [self._root(ratio) for ratio in self.tail_ratios]
        fixed = 0 if self._small or not self._nested else len(self._groups(0.0))

        def of_block(block: ColumnBlock) -> Array:
            if self.correlation or isinstance(block, np.ndarray):
                written = block if isinstance(block, np.ndarray) else block.toarray()
                own = np.sum(self.own(written) ** 2, axis=0)
            else:
                own = np.asarray(self.relative**-2.0 @ (block * block))
            for root in roots[0][0][:fixed]:
                own = own - _all_squares((root,), block)
            further = [(*groups[fixed:], low) for groups, low, _log in roots]
            return np.array([own - _all_squares(parts, block) for parts in further])

        return columns.sums(of_block)

    @cached_property
    def _nested(self) -> bool:
        """True if the rows of a gear are of one tail, and none follows another: then what each
        group has in common is taken out by sums over its rows.
        """
        if self.correlation:
            return False
        most = np.zeros(self.gears.max() + 1, np.int64)
        np.maximum.at(most, self.gears, self.tails)
        return bool(np.all(most[self.gears] == self.tails))

    @property
    def _small(self) -> bool:
        """True if sums over groups are soonest had with all rows written out."""
        return bool(len(self.relative) * (self.gears.max() + 1) <= _SMALL)

    def _root(self, tail_ratio: float) -> _Root:
        if tail_ratio in self._roots:
            return self._roots[tail_ratio]
        log_determinant = 2.0 * float(np.sum(np.log(self.relative)))
        log_determinant += float(np.sum(np.log1p(-(self._steps[2] ** 2))))
        groups: list[csr_array] = []
        low = self.loadings if self._nested else self.factors(tail_ratio)

        def beside_groups(columns: Array) -> Array:
            product = self._own_precision_times(columns)
            for root in groups:
                product -= root.T @ (root @ columns)
            return product

        for group, scatter in self._groups(tail_ratio) if self._nested else ():
            # Of gears within tails no two groups of one kind share a row: one column holds all.
            weighted = beside_groups(scatter[:, None])[:, 0]
            inner = 1.0 + np.bincount(group, scatter * weighted)
            log_determinant += float(np.sum(np.log(inner)))
            begins = np.r_[0, np.cumsum(np.bincount(group))]
            rows = np.argsort(group, kind="stable")
            values = (weighted / np.sqrt(inner)[group])[rows]
            groups.append(csr_array((values, rows, begins), (len(inner), len(group))))
        weighted = beside_groups(low)
        lower = np.linalg.cholesky(np.eye(low.shape[1]) + low.T @ weighted)
        log_determinant += 2.0 * float(np.sum(np.log(np.diag(lower))))
        root = np.asarray(solve_triangular(lower, weighted.T, lower=True))
        if self._small:
            root = np.vstack([root, *(own.toarray() for own in groups)])
            groups = []
        self._roots[tail_ratio] = tuple(groups), root, log_determinant
        return self._roots[tail_ratio]


def _all_squares(roots: Sequence[Any], block: ColumnBlock) -> Array:
    """Sum of squares of all that roots make of each column."""
    found = np.zeros(block.shape[1])
    for root in roots:
        product = root @ block
        found += (product * product).sum(axis=0)
    return found
