"""Effects column by column; in a large table those that act in few rows are kept by these rows
alone.

A table of ten thousand rows has thousands of effects that act in one aircraft each; written out
they would fill the memory.

Covariance of the rows when nothing is wrong, in a form that is cheap to invert.

    V(r) = B (I + F S(r)² Fᵀ) Bᵀ                                                          (M2)

in units of the common scatter: B what each row scatters by itself, a diagonal or, along a series, a
process that forgets; F what rows have in common, over B: groups and loadings. S(r) is 1 but for the
tails T, whose ratio r is one of a few; G is F without them. With C Cᵀ = I + Gᵀ G, P = G C⁻ᵀ,
M = Pᵀ T, Q = T − P M, D Dᵀ = I + r² Tᵀ Q and R = r D⁻¹ (Woodbury, twice):
V⁻¹ = B⁻ᵀ (I − P Pᵀ − Q Rᵀ R Qᵀ) B⁻¹. P and Q are not written out: G and T are short.

Columns fitted to data under a noise model, freely and with what is known of them beforehand; and
what a fit explains of held-out rows.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Any

import numpy as np

from mlg_troubleshoot.arrays import Array, Mask, Places, Wholes

# Computing only: rows from which a table is large; a column that acts in fewer than one row of so
# many is kept by these rows; columns that are worked out together.
_LARGE = 1_000
_FEW = 5
_AT_ONCE = 1_000


@dataclass(frozen=True)
class EffectColumns:
    """Some columns of n rows each, p in all.

    Attributes
    ----------
    parts : sequence of ndarray or csc_array
        Those that are written out, shape (n, f); in a large table also those that act in few rows,
        shape (n, p - f).
    at : ndarray of int, shape (p,)
        Place of each column among the two, those that are written out first.
    """

    parts: Sequence[Any]
    at: Places

    @staticmethod
    def of(columns: Array | EffectColumns) -> EffectColumns:
        """Columns that are written out, or kept so already."""
        if isinstance(columns, EffectColumns):
            return columns
        return EffectColumns([columns], np.arange(columns.shape[1]))

    @staticmethod
    def made(n: int, columns: Iterable[Array]) -> EffectColumns:
        """Columns as they come, each kept as is shorter."""
        full: list[Array] = []
        few: list[tuple[Array, Places]] = []
        is_short: list[bool] = []
        for column in columns:
            rows = np.flatnonzero(column)
            short = n > _LARGE and _FEW * len(rows) < n
            is_short.append(short)
            if short:
                few.append((column[rows], rows))
            else:
                full.append(column)
        written = np.column_stack([np.empty((n, 0)), *full])
        if not few:
            return EffectColumns.of(written)
        from scipy.sparse import csc_array

        ends = np.cumsum([0, *(len(rows) for _values, rows in few)])
        values, rows = (np.concatenate(own) for own in zip(*few, strict=True))
        short_ones = csc_array((values, rows, ends), (n, len(few)))
        return EffectColumns([written, short_ones], _places_of(is_short))

    @staticmethod
    def joined(parts: Sequence[EffectColumns]) -> EffectColumns:
        """All columns of several, one after the other."""
        is_short = [own >= part.parts[0].shape[1] for part in parts for own in part.at.tolist()]
        full = np.hstack([part.parts[0] for part in parts])
        few = [own for part in parts for own in part.parts[1:]]
        if not few:
            return EffectColumns.of(full)
        from scipy.sparse import hstack

        return EffectColumns([full, hstack(few, "csc")], _places_of(is_short))

    @property
    def n(self) -> int:
        """Number of rows."""
        return len(self.parts[0])

    @property
    def p(self) -> int:
        """Number of columns."""
        return len(self.at)

    def take(self, wanted: Sequence[int] | Places) -> Array:
        """Some of the columns written out, shape (n, k)."""
        at = self.at[np.asarray(wanted, np.intp)]
        full, *few = self.parts
        if not few:
            return np.asarray(full[:, at])
        f = full.shape[1]
        found = np.empty((self.n, len(at)))
        found[:, at < f] = full[:, at[at < f]]
        found[:, at >= f] = few[0][:, at[at >= f] - f].toarray()
        return found

    def onto(self, rows: Any) -> Array:
        """Products of all columns with some vectors, shape (k, n): (k, p)."""
        full, *few = (rows @ part for part in self.parts)
        short = [own.toarray() if hasattr(own, "toarray") else own for own in few]
        return np.hstack([full, *short])[:, self.at] if few else np.asarray(full)

    def scaled(self, weight: Array) -> EffectColumns:
        """All columns, each row so many times."""
        full, *few = self.parts
        short = [own.multiply(weight[:, None]).tocsc() for own in few]
        return EffectColumns([full * weight[:, None], *short], self.at)

    def times(self, values: Array) -> Array:
        """Sums of all columns, each so many times, (p,) or (p, k): (n,) or (n, k)."""
        placed = np.empty(values.shape)
        placed[self.at] = values
        own = np.split(placed, [self.parts[0].shape[1]])
        return np.asarray(sum(part @ v for part, v in zip(self.parts, own, strict=False)))

    def squared_onto(self, weight: Array) -> Array:
        """Sum of the squares of each column, each row so many times, shape (p,)."""
        full, *few = self.parts
        squares: list[Array] = [np.einsum("n,nk,nk->k", weight, full, full)]
        squares += [weight @ own.power(2) for own in few]
        return np.asarray(np.concatenate(squares)[self.at])

    @property
    def squares(self) -> Array:
        """Sum of squares of each column, shape (p,)."""
        return self.squared_onto(np.ones(self.n))

    @property
    def acting(self) -> Array:
        """Root mean square of each column over the rows in which it acts, shape (p,)."""
        full, *few = self.parts
        rows = [np.count_nonzero(full, axis=0), *(np.diff(own.indptr) for own in few)]
        return np.asarray(np.sqrt(self.squares / np.maximum(np.concatenate(rows)[self.at], 1)))


def _places_of(is_short: Sequence[bool]) -> Places:
    """Places of columns, those that are written out first."""
    return np.argsort(np.argsort(is_short, kind="stable"))


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

    def take(self, rows: Mask) -> NoiseModel:
        """Return the noise of some of the rows."""
        every = {f.name: getattr(self, f.name) for f in fields(self)}
        own: dict[str, Any] = {k: v[rows] for k, v in every.items() if isinstance(v, np.ndarray)}
        return replace(self, **own)

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
        """What of some columns is new in each row, over its scatter: B⁻¹ x."""
        row, before, alike = self._steps
        scaled = columns / self.relative[:, None]
        fresh = scaled.copy()
        fresh[row] -= alike[:, None] * scaled[before]
        fresh[row] /= np.sqrt(1.0 - alike**2)[:, None]
        return fresh

    def _back(self, fresh: Array) -> Array:
        """Multiply by B⁻ᵀ, shape (..., n, k)."""
        row, before, alike = self._steps
        fresh = fresh.copy()
        fresh[..., row, :] /= np.sqrt(1.0 - alike**2)[:, None]
        product = fresh.copy()
        product[..., before, :] -= alike[:, None] * fresh[..., row, :]
        return product / self.relative[:, None]

    def with_effects(self, effects_in: Array) -> NoiseModel:
        """Add effects of unknown size, each at one standard deviation."""
        return replace(self, loadings=np.hstack([self.loadings, effects_in / self.scale_in]))

    def share_of(self, effects_in: Array, data: Array) -> Array:
        """What effects of unknown size that are part of this covariance most likely explain of data
        (BLUP). [in]
        """
        product = self.precision_times(data[:, None])
        return effects_in @ (effects_in.T @ product[:, 0]) / self.scale_in**2

    def share_of_groups(self, scatter_in: Array, group: Wholes, data: Array) -> Array:
        """BLUP of what the rows of each group scatter alike, each in its own measure. [in]"""
        product = self.precision_times(data[:, None])
        pull = np.bincount(group, scatter_in * product[:, 0])
        return scatter_in * pull[group] / self.scale_in**2

    def own_part(self, data: Array) -> tuple[Array, float]:
        """What each row scatters by itself, all that rows have in common taken out, and the share
        of the rows that is left to tell it. [in, 1]
        """
        joint, _root, _between, roots, _log = self._common
        common, apart = self._low(joint.take(joint.at).T)
        low = np.vstack([common, roots[-1] @ apart])
        own = self.own(data[:, None])[:, 0]
        left = own - low.T @ (low @ own)
        return self.relative * left, float(1.0 - np.mean(np.sum(low**2, axis=0)))

    @cached_property
    def _common(self) -> tuple[EffectColumns, Array, Array, Array, Array]:
        """F and T over the scatter of each row, C⁻¹, M, R of each ratio of the scatter between
        tails, (levels, t, t), and log |V|.
        """
        n = len(self.relative)
        kinds = [(self.gears, np.full(n, self.gear_ratio))]
        kinds += [] if self.of_gear is None else [(self.gears, self.of_gear)]
        kinds += [] if self.of_tail is None else [(self.tails, own) for own in self.of_tail.T]
        kinds = [(group, scatter) for group, scatter in kinds if scatter.any()]
        t = (int(self.tails.max()) + 1) * any(self.tail_ratios)
        kinds += [(self.tails, np.ones(n))] * bool(t)
        if self.correlation or n <= _LARGE:
            each = [own[:, None] * np.eye(group.max() + 1)[group] for group, own in kinds]
            joint = EffectColumns.of(self.own(np.hstack([self.loadings, *each])))
        else:
            from scipy.sparse import csc_array, hstack

            groups = [csc_array((own, (np.arange(n), group))) for group, own in kinds]
            parts = [self.loadings, hstack([csc_array((n, 0)), *groups], "csc")]
            places = np.arange(sum(part.shape[1] for part in parts))
            joint = EffectColumns(parts, places).scaled(1.0 / self.relative)
        inner = np.vstack([joint.onto(part.T) for part in joint.parts])
        c = joint.p - t
        lower = np.linalg.cholesky(np.eye(c) + inner[:c, :c])
        root = np.linalg.inv(lower)
        between = root @ inner[:c, c:]
        ratios = np.array(self.tail_ratios)[:, None, None]
        apart = inner[c:, c:] - between.T @ between
        tails = np.linalg.cholesky(np.eye(t) + ratios**2 * apart)
        log = 2.0 * np.log(np.diagonal(tails, axis1=1, axis2=2)).sum(axis=1)
        log += 2.0 * np.sum(np.log(np.diagonal(lower))) + 2.0 * np.sum(np.log(self.relative))
        log += np.sum(np.log1p(-(self._steps[2] ** 2)))
        return joint, root, between, np.linalg.inv(tails) * ratios, log

    def _low(self, inner: Array) -> tuple[Array, Array]:
        """Pᵀ x and Qᵀ x of columns by their products with F and T, (c + t, k)."""
        _joint, root, between, _roots, _log = self._common
        low = root @ inner[: len(root)]
        return low, inner[len(root) :] - between.T @ low

    def each_precision_times(
        self, columns: Array, levels: slice = slice(None)
    ) -> tuple[Array, Array]:
        """Columns times V⁻¹, (levels, n, k), and log |V|, (levels,), of each ratio or of some."""
        joint, root, between, roots, log = self._common
        roots = roots[levels]
        own = self.own(columns)
        low, apart = self._low(joint.onto(own.T).T)
        bent = roots.swapaxes(1, 2) @ (roots @ apart)
        common = root.T @ (low - between @ bent)
        each = [joint.times(part) for part in np.concatenate([common, bent], axis=1)]
        return self._back(own - np.array(each)), log[levels]

    def precision_times(self, columns: Array) -> Array:
        """Columns times V⁻¹ of the last ratio."""
        (product,), _log = self.each_precision_times(columns, slice(-1, None))
        return np.asarray(product)

    def products(self, columns: Array) -> Array:
        """Products of some columns with each other under V⁻¹, of the last ratio, shape (k, k)."""
        own = self.own(columns)
        low, apart = self._low(self._common[0].onto(own.T).T)
        both = np.vstack([low, self._common[3][-1] @ apart])
        return np.asarray(own.T @ own - both.T @ both)

    def squares(self, columns: EffectColumns) -> Array:
        """Squared length of many columns, for each ratio of the scatter between tails, (levels,
        p).
        """
        joint, _root, _between, roots, _log = self._common
        if self.correlation:
            columns = EffectColumns.of(self.own(columns.take(np.arange(columns.p))))
            scale = np.ones(len(self.relative))
        else:
            scale = 1.0 / self.relative
        joint = joint.scaled(scale)
        common = []
        # All at once would fill the memory.
        for part in columns.parts:
            for start in range(0, part.shape[1], _AT_ONCE):
                low, apart = self._low(joint.onto(part.T[start : start + _AT_ONCE]).T)
                common.append(np.sum(low**2, axis=0) + np.sum((roots @ apart) ** 2, axis=1))
        whole = np.hstack([np.empty((len(roots), 0)), *common])
        return np.asarray(columns.squared_onto(scale**2) - whole[:, columns.at])


@dataclass(frozen=True)
class Fit:
    """Least-squares fit of some columns under the noise model.

    Attributes
    ----------
    values, errors : ndarray, shape (k,)
        Parameters, and their standard errors.
    log_likelihood : float
        Profiled over scale and scatter between tails. [1]
    noise : NoiseModel
        The noise with the scatter between tails that is likeliest.
    scale : float
        Common standard deviation. [in]
    """

    values: Array
    errors: Array
    log_likelihood: float
    noise: NoiseModel
    scale: float

    @property
    def half_width(self) -> Array:
        """Half the 95 % interval of each parameter, by Student's t of the rows that are left."""
        from scipy.special import stdtrit

        noise = self.noise
        # Rows that are alike say as much of a constant as so many independent ones.
        worth = len(noise.relative) * (1.0 - noise.correlation) / (1.0 + noise.correlation)
        rows = worth - noise.absorbed - len(self.values)
        return self.errors * stdtrit(max(rows, 1.0), 0.975)


def shrunk(
    noise: NoiseModel, free: Array, columns: Array, covariance: Array, data: Array
) -> tuple[Array, Array]:
    """Fit free columns, and columns whose values are known beforehand to a covariance: values, and
    their covariance.
    """
    both = np.hstack([free, columns])
    scale = noise.scale_in
    inner = noise.products(np.column_stack([both, data])) / scale**2
    along = inner[:-1, -1]
    inner = inner[:-1, :-1]
    k = free.shape[1]
    inner[k:, k:] += np.linalg.inv(covariance)
    inverse = np.linalg.pinv(inner)
    return inverse @ along, np.asarray(inverse, float)


def fit(noise: NoiseModel, columns: Array, data: Array) -> Fit:
    """Fit columns to one data set, scale and tail scatter included."""
    n = len(data) - noise.absorbed
    k = columns.shape[1]
    best: Fit | None = None
    every, determinants = noise.each_precision_times(np.column_stack([columns, data]))
    levels = zip(noise.tail_levels, every, determinants.tolist(), strict=True)
    for (ratio, chance), product, log_determinant in levels:
        inner = columns.T @ product[:, :k]
        inverse = np.linalg.pinv(inner)
        values = inverse @ (columns.T @ product[:, k])
        square = float(data @ product[:, k] - values @ inner @ values)
        rest = max(square, 0.0) + len(data) * noise.floor_in**2
        likelihood = chance - 0.5 * n * np.log(rest / n) - 0.5 * log_determinant
        if best is None or likelihood > best.log_likelihood:
            scale = np.sqrt(rest / max(n - k, 1))
            errors = scale * np.sqrt(np.maximum(np.diag(inverse), 0.0))
            best = Fit(values, errors, float(likelihood), noise.with_tails(ratio), float(scale))
    if best is None:
        raise ValueError("no tail ratio to try")
    return best


_FOLDS = 10
# Share of what a cause does that must remain in the rows it is learned from. [1]
_LEARNED = 0.1


def folds_of(
    row: Wholes, group: Wholes | None, columns: Array, shuffled: Wholes
) -> tuple[Wholes, str]:
    """Number the fold in which each reading is held out: whole groups, or rows where a cause acts
    in one group only.
    """
    if group is not None and group.max() > 0:
        numbers = np.argsort(np.argsort(shuffled[: group.max() + 1]))
        part = np.asarray(numbers % _FOLDS)[group[row]]
        square = columns**2
        least = _LEARNED * np.sum(square, axis=0)
        learnt = [np.sum(square[part != k], axis=0) for k in range(part.max() + 1)]
        if np.all(learnt >= least):
            return part, "group"
    return shuffled[row] % min(_FOLDS, len(shuffled)), "row"


def blocks_of(chain: Wholes, time: Array) -> Wholes:
    """Number the fold in which each row is held out with those that it follows: whole series where
    there are as many as folds, else as many stretches of all series together.
    """
    many = int(chain.max()) + 1
    if many >= _FOLDS:
        return chain % _FOLDS
    place = np.empty(len(chain), np.int64)
    place[np.lexsort((time, chain))] = np.arange(len(chain))
    return place * _FOLDS // len(chain)


def likelier(noise: NoiseModel, before: Array, after: Array, fold: Wholes) -> bool:
    """Tell whether the residual of held-out rows is likelier after than before, what a fold has in
    common being noise.

    Far readings decide no more than others: where noise is estimated they scatter more.
    """
    left = np.column_stack([before, after])
    parts = [noise.take(fold == k).products(left[fold == k]) for k in np.unique(fold)]
    square = np.diag(np.sum(parts, axis=0))
    return bool(square[1] < square[0])


def held_out_part(
    noise: NoiseModel,
    columns: Array,
    data: Array,
    fold: Wholes,
    known: tuple[Array, Array] | None = None,
) -> Array:
    """What a model explains of each row that was fitted to the rows of the other folds alone. [in]

    known: further effects, shape (n, k), and the covariance of their sizes that is known
    beforehand.
    """
    explained = np.zeros(len(data))
    for k in np.unique(fold):
        train = fold != k
        test = fold == k
        used = np.any(columns[train] != 0.0, axis=0)
        held = columns[:, used]
        part = noise.take(train)
        if not train.any():
            continue
        if known is not None:
            values, _covariance = shrunk(part, held[train], known[0][train], known[1], data[train])
            explained[test] = np.hstack([held, known[0]])[test] @ values
        elif used.any():
            explained[test] = held[test] @ fit(part, held[train], data[train]).values
    return explained
