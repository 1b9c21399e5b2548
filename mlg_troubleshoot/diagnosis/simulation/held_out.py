"""Misfit of rows that were not used for the fit."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mlg_troubleshoot.arrays import Array, Wholes
from mlg_troubleshoot.diagnosis.simulation.runner import least_squares

# Singular value, in units of the largest, below which rows say nothing about a combination of nuisance parameters.
_KNOWN = 1e-5


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
