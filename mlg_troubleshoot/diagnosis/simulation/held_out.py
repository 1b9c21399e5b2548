"""Misfit of rows that were not used for the fit."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mlg_troubleshoot.arrays import Array, Wholes
from mlg_troubleshoot.diagnosis.simulation.runner import least_squares

_FOLDS = 10
# Share of what a cause does that must remain in the rows it is learned from. [1]
_LEARNED = 0.1
# Singular value, in units of the largest, below which rows say nothing about a combination of nuisance parameters.
_KNOWN = 1e-5


def folds_of(row: Wholes, group: Wholes | None, columns: Array, shuffled: Wholes) -> tuple[Wholes, str]:
    """Number the fold in which each reading is held out: whole groups, or rows where a cause acts in one group only."""
    if group is not None and group.max() > 0:
        numbers = (
            np.argsort(np.argsort(shuffled[: group.max() + 1])) if group.max() >= _FOLDS else np.arange(group.max() + 1)
        )
        part = np.asarray(numbers % _FOLDS)[group[row]]
        square = columns**2
        learned = [
            np.sum(square[part != k], axis=0) >= _LEARNED * np.sum(square, axis=0) for k in range(part.max() + 1)
        ]
        if np.all(learned):
            return part, "group"
    return shuffled[row] % min(_FOLDS, len(shuffled)), "row"


def held_out(columns: Array, rest: Array, causes: Sequence[int], nuisance: Sequence[int], part: Wholes) -> Array:
    """Misfit of each reading, fitted on the other folds.

    What only the held-out readings know of the nuisance parameters (the place of their own socket) is fitted there.
    """
    left = rest.copy()
    chosen, free = columns[:, list(causes)], columns[:, list(nuisance)]
    size = np.linalg.norm(free, axis=0)
    free = free / np.where(size > 0.0, size, 1.0)
    for k in np.unique(part):
        test, train = part == k, part != k
        if not train.any():
            continue
        known = unknown = free
        if free.shape[1]:
            values, across = np.linalg.eigh(free[train].T @ free[train])
            told = values > _KNOWN**2 * max(float(values[-1]), 1e-300)
            known, unknown = free @ across[:, told], free @ across[:, ~told]
        both = np.hstack([chosen, known])
        if both.shape[1]:
            left[test] -= both[test] @ least_squares(both[train], rest[train])
        if unknown.shape[1]:
            left[test] -= unknown[test] @ least_squares(unknown[test], left[test])
    return left
