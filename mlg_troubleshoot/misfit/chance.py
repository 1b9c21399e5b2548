"""How likely a statistic is if nothing is wrong, from the largest of all candidates in data sets
drawn so.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from mlg_troubleshoot.arrays import Array

# Draws beyond an observed statistic from which they are counted.
_TAIL = 10
# Standard errors by which an estimate falls short once in five. [1]
_SHORT = 0.84


@dataclass(frozen=True)
class Chance:
    """Largest statistic of each of many null simulations: the error rate holds for all that is
    tried.
    """

    largest: Array

    def surprise(self, observed: ArrayLike) -> Array:
        """Minus the logarithm of the chance of as much; beyond the draws by the exponential tail of
        the largest.
        """
        seen = np.asarray(observed, float)
        count = np.sum(self.largest >= seen[..., None], axis=-1)
        counted = np.log1p(len(self.largest)) - np.log1p(count)
        if len(self.largest) < _TAIL * 4 or np.all(count >= _TAIL):
            return np.asarray(counted)
        bar, over = self._tail
        return np.asarray(np.where(count >= _TAIL, counted, np.log(10.0) + (seen - bar) / over))

    @property
    def _tail(self) -> tuple[float, float]:
        """What one in ten of the draws exceeds, and by how much on average."""
        bar = float(np.quantile(self.largest, 0.9))
        return bar, max(float(np.mean(self.largest[self.largest >= bar] - bar)), 1e-300)

    def of(self, observed: float) -> float:
        """Chance of as much. [1]"""
        return float(np.exp(-self.surprise(observed)))

    def bar(self, chance: float) -> float:
        """Statistic of this chance."""
        if len(self.largest) < _TAIL * 4 or chance * len(self.largest) >= _TAIL:
            return float(np.quantile(self.largest, 1.0 - chance))
        bar, over = self._tail
        return bar - over * float(np.log(10.0 * chance))


def smallest_rms(bar: float, scatter: float, n: int) -> float:
    """Root mean square over n rows of an effect whose squared t clears a bar with 80 % power. [unit
    of scatter]
    """
    return float(scatter * (np.sqrt(max(bar, 0.0)) + _SHORT) / np.sqrt(n))
