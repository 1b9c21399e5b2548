"""Effects column by column, in blocks: those that act in few rows are kept by these rows alone.

A table of ten thousand rows has thousands of effects that act in one aircraft each; written out
they would fill the memory.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.sparse import csc_array

from mlg_troubleshoot.arrays import Array, Places

ColumnBlock = Array | csc_array
# Computing only: numbers from which a block is large; a column that acts in fewer than one row of
# so many is kept by these rows.
_LARGE = 200_000
_FEW = 5
# Columns that are written out together.
_AT_ONCE = 64


@dataclass(frozen=True)
class EffectColumns:
    """Some columns of n rows each, p in all.

    Attributes
    ----------
    n : int
        Number of rows.
    blocks : tuple of (ndarray, ColumnBlock)
        Places of k of the columns, shape (k,), and these columns, shape (n, k).
    """

    n: int
    blocks: tuple[tuple[Places, ColumnBlock], ...]

    @staticmethod
    def of(columns: Array | EffectColumns) -> EffectColumns:
        """Columns that are written out, or kept so already."""
        if isinstance(columns, EffectColumns):
            return columns
        return EffectColumns(len(columns), ((np.arange(columns.shape[1]), columns),))

    @staticmethod
    def made(n: int, columns: Iterable[Array]) -> EffectColumns:
        """Columns as they come, each kept as is shorter."""
        full: list[Array] = []
        few: list[tuple[Places, Array]] = []
        places: tuple[list[int], list[int]] = ([], [])
        blocks: list[tuple[Places, ColumnBlock]] = []

        def written_out() -> None:
            blocks.append((np.array(places[0]), np.column_stack(full)))
            places[0].clear()
            full.clear()

        for place, column in enumerate(columns):
            rows = np.flatnonzero(column)
            short = _FEW * len(rows) < n and n * (place + 1) > _LARGE
            places[short].append(place)
            if short:
                few.append((rows, column[rows]))
            else:
                full.append(column)
            if len(full) == _AT_ONCE:
                written_out()
        if full:
            written_out()
        if few:
            ends = np.cumsum([0, *(len(rows) for rows, _values in few)])
            rows, values = (np.concatenate(part) for part in zip(*few, strict=True))
            blocks.append((np.array(places[1]), csc_array((values, rows, ends), (n, len(few)))))
        return EffectColumns(n, tuple(blocks))

    @staticmethod
    def joined(parts: Sequence[EffectColumns]) -> EffectColumns:
        """All columns of several, one after the other."""
        begins = np.cumsum([0, *(part.p for part in parts)])
        blocks = [
            (begin + places, block)
            for begin, part in zip(begins, parts, strict=False)
            for places, block in part.blocks
        ]
        n = parts[0].n
        if n * begins[-1] <= _LARGE:
            return EffectColumns.of(np.hstack([part.take(np.arange(part.p)) for part in parts]))
        return EffectColumns(n, tuple(blocks))

    @property
    def p(self) -> int:
        """Number of columns."""
        return sum(len(places) for places, _block in self.blocks)

    def take(self, wanted: Sequence[int] | Places) -> Array:
        """Some of the columns written out, shape (n, k)."""
        wanted = np.asarray(wanted, np.intp)
        found = np.empty((self.n, len(wanted)))
        for places, block in self.blocks:
            at = np.searchsorted(places, wanted)
            here = np.append(places, -1)[at] == wanted
            if here.any():
                some = block[:, at[here]]
                found[:, here] = some if isinstance(some, np.ndarray) else some.toarray()
        return found

    def some(self, wanted: Places) -> EffectColumns:
        """Some of the columns, in their order."""
        blocks = []
        for places, block in self.blocks:
            kept = np.isin(places, wanted)
            some = block if kept.all() else block[:, kept]
            blocks.append((np.searchsorted(wanted, places[kept]), some))
        return EffectColumns(self.n, tuple(blocks))

    def onto(self, rows: Array) -> Array:
        """Products of all columns with some vectors, shape (k, n): (k, p)."""
        found = np.empty((len(rows), self.p))
        for places, block in self.blocks:
            found[:, places] = rows @ block
        return found

    def times(self, values: Array) -> Array:
        """Sum of all columns, each so many times, shape (n,)."""
        found = np.zeros(self.n)
        for places, block in self.blocks:
            found += block @ values[places]
        return found

    def sums(self, of_block: Callable[[ColumnBlock], Array]) -> Array:
        """A number of each column, asked for some columns at a time, shape (..., p)."""
        found = [
            (places[k : k + _AT_ONCE], of_block(block[:, k : k + _AT_ONCE]))
            for places, block in self.blocks
            for k in range(0, len(places), _AT_ONCE)
        ]
        if not found:
            return of_block(np.empty((self.n, 0)))
        every = np.empty((*found[0][1].shape[:-1], self.p))
        for places, values in found:
            every[..., places] = values
        return every

    @property
    def squares(self) -> Array:
        """Sum of squares of each column, shape (p,)."""
        return self.sums(lambda block: np.asarray((block * block).sum(axis=0)))

    @property
    def acting(self) -> Array:
        """Root mean square of each column over the rows in which it acts, shape (p,)."""
        rows = self.sums(_rows_of)
        return np.sqrt(self.squares / np.maximum(rows, 1.0))


def _rows_of(block: ColumnBlock) -> Array:
    """Number of rows in which each column acts."""
    if isinstance(block, np.ndarray):
        return np.asarray(np.count_nonzero(block, axis=0), float)
    return np.asarray(np.diff(block.indptr), float)
