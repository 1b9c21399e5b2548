"""Effects column by column; in a large table those that act in few rows are kept by these rows
alone.

A table of ten thousand rows has thousands of effects that act in one aircraft each; written out
they would fill the memory.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.sparse import csc_array, hstack

from mlg_troubleshoot.arrays import Array, Places

# Computing only: rows from which a table is large; a column that acts in fewer than one row of so
# many is kept by these rows.
_LARGE = 1_000
_FEW = 5


@dataclass(frozen=True)
class EffectColumns:
    """Some columns of n rows each, p in all.

    Attributes
    ----------
    full : ndarray, shape (n, f)
        Those that are written out.
    few : csc_array, shape (n, p - f)
        Those that act in few rows.
    at : ndarray of int, shape (p,)
        Place of each column among the two, those that are written out first.
    """

    full: Array
    few: csc_array
    at: Places

    @staticmethod
    def of(columns: Array | EffectColumns) -> EffectColumns:
        """Columns that are written out, or kept so already."""
        if isinstance(columns, EffectColumns):
            return columns
        n, p = columns.shape
        return EffectColumns(columns, csc_array((n, 0)), np.arange(p))

    @staticmethod
    def made(n: int, columns: Iterable[Array]) -> EffectColumns:
        """Columns as they come, each kept as is shorter."""
        full: list[Array] = []
        few: list[tuple[Places, Array]] = []
        places: list[int] = []
        for column in columns:
            rows = np.flatnonzero(column)
            short = n > _LARGE and _FEW * len(rows) < n
            places.append(-len(few) - 1 if short else len(full))
            if short:
                few.append((rows, column[rows]))
            else:
                full.append(column)
        at = np.array(places, np.intp)
        at = np.where(at < 0, len(full) - 1 - at, at)
        ends = np.cumsum([0, *(len(rows) for rows, _values in few)])
        rows = np.concatenate([np.empty(0, np.intp), *(rows for rows, _values in few)])
        values = np.concatenate([np.empty(0), *(values for _rows, values in few)])
        written = np.column_stack([np.empty((n, 0)), *full])
        return EffectColumns(written, csc_array((values, rows, ends), (n, len(few))), at)

    @staticmethod
    def joined(parts: Sequence[EffectColumns]) -> EffectColumns:
        """All columns of several, one after the other."""
        f = sum(part.full.shape[1] for part in parts)
        begin = [0, f]
        at = []
        for part in parts:
            own = part.full.shape[1]
            at.append(np.where(part.at < own, part.at + begin[0], part.at - own + begin[1]))
            begin[0] += own
            begin[1] += part.few.shape[1]
        few = csc_array(hstack([part.few for part in parts]))
        return EffectColumns(np.hstack([part.full for part in parts]), few, np.concatenate(at))

    @property
    def p(self) -> int:
        """Number of columns."""
        return len(self.at)

    def take(self, wanted: Sequence[int] | Places) -> Array:
        """Some of the columns written out, shape (n, k)."""
        at = self.at[np.asarray(wanted, np.intp)]
        f = self.full.shape[1]
        if not self.few.shape[1]:
            return self.full[:, at]
        found = np.empty((len(self.full), len(at)))
        found[:, at < f] = self.full[:, at[at < f]]
        found[:, at >= f] = self.few[:, at[at >= f] - f].toarray()
        return found

    def onto(self, rows: Array) -> Array:
        """Products of all columns with some vectors, shape (k, n): (k, p)."""
        if not self.few.shape[1]:
            return rows @ self.full
        return np.hstack([rows @ self.full, rows @ self.few])[:, self.at]

    def times(self, values: Array) -> Array:
        """Sum of all columns, each so many times, shape (n,)."""
        placed = np.empty(self.p)
        placed[self.at] = values
        f = self.full.shape[1]
        return np.asarray(self.full @ placed[:f] + self.few @ placed[f:])

    def squared_onto(self, weight: Array) -> Array:
        """Sum of the squares of each column, each row so many times, shape (p,)."""
        squares = [weight @ self.full**2, weight @ self.few.power(2)]
        return np.asarray(np.concatenate(squares)[self.at])

    @property
    def squares(self) -> Array:
        """Sum of squares of each column, shape (p,)."""
        return self.squared_onto(np.ones(len(self.full)))

    @property
    def acting(self) -> Array:
        """Root mean square of each column over the rows in which it acts, shape (p,)."""
        written = np.count_nonzero(self.full, axis=0)
        rows = np.concatenate([written, np.diff(self.few.indptr)])[self.at]
        return np.asarray(np.sqrt(self.squares / np.maximum(rows, 1)))
