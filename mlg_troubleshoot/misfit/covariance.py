"""Covariance of the rows when nothing is wrong, in a form that is cheap to invert."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Any

import numpy as np
from scipy.sparse import csr_array

from mlg_troubleshoot.arrays import Array, Mask, Wholes
from mlg_troubleshoot.misfit.columns import ColumnBlock, EffectColumns

# Sums over the rows of each group, shape (groups, n).
_Sums = csr_array | Array

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
        inverse = self._inverse
        last = inverse.at(-1)
        low = last.root[0] @ (inverse.low.T - (last.across[0] @ inverse.tails))
        taken = np.sum(low**2, axis=0) + sum(_squared(root).sum(axis=0) for root in inverse.fixed)
        taken = taken + last.weight[0] @ _squared(inverse.tails)
        own = self.relative**2 * self._times(data[:, None], last)[0, :, 0]
        return own, float(1.0 - np.mean(self.relative**2 * taken))

    def factors(self, tail_ratio: float) -> Array:
        """Low-rank part of the covariance, shape (n, k). [1]"""
        kinds = [*self._groups, (self.tails, np.full(len(self.relative), tail_ratio))]
        each = [
            scatter[:, None] * (group[:, None] == np.arange(group.max() + 1))
            for group, scatter in kinds
            if scatter.any()
        ]
        return np.hstack([*each, self.loadings])

    @property
    def _groups(self) -> list[tuple[Wholes, Array]]:
        """Group of each row and what rows of one have in common, whatever tails scatter alike,
        gears first. [1]
        """
        found = [(self.gears, np.full(len(self.relative), self.gear_ratio))]
        if self.of_gear is not None:
            found.append((self.gears, self.of_gear))
        if self.of_tail is not None:
            found.extend((self.tails, scatter) for scatter in self.of_tail.T)
        return [(group, scatter) for group, scatter in found if scatter.any()]

    def precision_times(self, columns: Array, tail_ratio: float) -> tuple[Array, float]:
        """Multiply columns by the inverse covariance with one ratio of the scatter between tails;
        the logarithm of the covariance's determinant.
        """
        level = self._inverse.at(self.tail_ratios.index(tail_ratio))
        return self._times(columns, level)[0], float(level.log_determinant[0])

    def each_precision_times(self, columns: Array) -> tuple[Array, Array]:
        """The same with each ratio, shapes (levels, n, k) and (levels,)."""
        levels = self._inverse.levels
        return self._times(columns, levels), levels.log_determinant

    def _times(self, columns: Array, levels: _Levels) -> Array:
        """Multiply columns by the inverse covariance of some levels, (levels, n, k)."""
        inverse = self._inverse
        product = self._beside_tails(columns, inverse.fixed)
        of_tails = inverse.tails @ columns
        bent = levels.root @ (inverse.low.T @ columns - levels.across @ of_tails)
        sizes = levels.root.swapaxes(1, 2) @ bent
        in_tails = levels.weight[:, :, None] * (of_tails - inverse.low_of_tails @ sizes)
        return np.array(
            [
                product - inverse.low @ own - inverse.tails.T @ alike
                for own, alike in zip(sizes, in_tails, strict=True)
            ]
        )

    def _beside_tails(self, columns: Array, fixed: Sequence[_Sums]) -> Array:
        """Multiply columns by the inverse covariance of what rows scatter by themselves, and in
        common with a group.
        """
        product = self._own_precision_times(columns)
        for root in fixed:
            product -= root.T @ (root @ columns)
        return product

    def square(self, data: Array, tail_ratio: float) -> Array:
        """Squared length of data sets under the inverse covariance."""
        each: Array = self._squares(data)[self.tail_ratios.index(tail_ratio)]
        return each

    def squares(self, columns: EffectColumns) -> Array:
        """The same of many columns, for each ratio of the scatter between tails, (levels, p)."""
        return columns.sums(self._squares)

    def _squares(self, block: ColumnBlock) -> Array:
        if self.correlation or isinstance(block, np.ndarray):
            written = block if isinstance(block, np.ndarray) else block.toarray()
            own = np.sum(self.own(written) ** 2, axis=0)
        else:
            own = np.asarray(self.relative**-2.0 @ (block * block))
        inverse = self._inverse
        levels = inverse.levels
        for root in inverse.fixed:
            own = own - _squared(root @ block).sum(axis=0)
        of_tails = _written_out(inverse.tails @ block)
        bent = levels.root @ (inverse.low.T @ block - levels.across @ of_tails)
        return np.asarray(own - levels.weight @ of_tails**2 - np.sum(bent**2, axis=1))

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

    @cached_property
    def _inverse(self) -> _Inverse:
        ratios = np.array(self.tail_ratios)
        alike = any(self.tail_ratios)
        log = 2.0 * float(np.sum(np.log(self.relative)))
        log += float(np.sum(np.log1p(-(self._steps[2] ** 2))))
        fixed: list[_Sums] = []
        tails: _Sums = np.empty((0, len(self.relative)))
        low = self.loadings if self._nested else self.factors(float(alike))
        # How much larger the loadings are in each level.
        scale = np.ones((len(ratios), low.shape[1]))
        if self._nested:
            for group, scatter in self._groups:
                # Of gears within tails no two groups of one kind share a row: one column holds all.
                weighted = self._beside_tails(scatter[:, None], fixed)[:, 0]
                inner = 1.0 + np.bincount(group, scatter * weighted)
                log += float(np.sum(np.log(inner)))
                fixed.append(_sums(group, weighted / np.sqrt(inner)[group]))
            if alike:
                one = np.ones((len(self.relative), 1))
                tails = _sums(self.tails, self._beside_tails(one, fixed)[:, 0])
        elif alike:
            end = low.shape[1] - self.loadings.shape[1]
            scale[:, end - self.tails.max() - 1 : end] = ratios[:, None]
        if self._small:
            fixed = [np.vstack([_written_out(root) for root in fixed])] if fixed else []
            tails = _written_out(tails)
        total = np.asarray(tails.sum(axis=1))
        inner = 1.0 + ratios[:, None] ** 2 * total
        weight = ratios[:, None] ** 2 / inner
        beside = self._beside_tails(low, fixed)
        low_of_tails = np.asarray(tails @ low)
        across = low_of_tails.T * weight[:, None, :]
        pairs = low.T @ beside - across @ low_of_tails
        lower = np.linalg.cholesky(
            np.eye(low.shape[1]) + scale[:, :, None] * pairs * scale[:, None, :]
        )
        determinant = np.log(inner).sum(axis=1)
        determinant += 2.0 * np.log(np.diagonal(lower, axis1=1, axis2=2)).sum(axis=1)
        root = np.linalg.inv(lower) * scale[:, None, :]
        levels = _Levels(weight, across, root, log + determinant)
        return _Inverse(tuple(fixed), tails, beside, low_of_tails, levels)


@dataclass(frozen=True)
class _Levels:
    """What the inverse covariances of some ratios of the scatter between tails do not share.

    Attributes
    ----------
    weight : ndarray, shape (levels, tails)
        What is taken off for each tail, times its sums.
    across : ndarray, shape (levels, k, tails)
        That of the loadings.
    root : ndarray, shape (levels, k, k)
        Root of the covariance of the sizes of the loadings.
    log_determinant : ndarray, shape (levels,)
        Logarithm of the covariance's determinant.
    """

    weight: Array
    across: Array
    root: Array
    log_determinant: Array


@dataclass(frozen=True)
class _Inverse:
    """Inverse covariances of all ratios of the scatter between tails (Woodbury).

    With P the inverse of what rows scatter beside tails and loadings L, T the sums of P over each
    tail, f its weight and S S' the covariance of the loadings' sizes:
    V⁻¹ = P − T'f T − (P L − T'f T L) S S' (P L − T'f T L)'.

    Attributes
    ----------
    fixed : tuple of _Sums
        Roots of what P takes off for groups.
    tails : _Sums
        T.
    low : ndarray, shape (n, k)
        P L.
    low_of_tails : ndarray, shape (tails, k)
        T L.
    levels : _Levels
        What depends on the ratio.
    """

    fixed: tuple[_Sums, ...]
    tails: _Sums
    low: Array
    low_of_tails: Array
    levels: _Levels

    def at(self, level: int) -> _Levels:
        """One of the levels."""
        each = (self.levels.weight, self.levels.across, self.levels.root)
        one = [values[[level]] for values in (*each, self.levels.log_determinant)]
        return _Levels(*one)


def _sums(group: Wholes, values: Array) -> csr_array:
    """Sums over the rows of each group, each row so many times."""
    begins = np.r_[0, np.cumsum(np.bincount(group))]
    rows = np.argsort(group, kind="stable")
    return csr_array((values[rows], rows, begins), (len(begins) - 1, len(group)))


def _squared(values: Any) -> Any:
    return values * values


def _written_out(values: Any) -> Array:
    return values if isinstance(values, np.ndarray) else np.asarray(values.toarray())
