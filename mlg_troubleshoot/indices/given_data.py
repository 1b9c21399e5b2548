"""First-order indices from measured inspections: no design, only what was found.

A joint's clearances are cut into classes of equal count; the variance of the class means is Eq. 1's
numerator. Differs from the paper: the share that class means vary by chance is subtracted, else a
few dozen inspections would give every joint a large index.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.random import Generator

from mlg_troubleshoot.arrays import Array, Wholes
from mlg_troubleshoot.errors import InconclusiveDataError

# Inspections below which no index is estimated. [1]
_FEWEST = 20


@dataclass(frozen=True, slots=True)
class GivenDataIndices:
    """First-order indices of observed data.

    first_order, shape (n_joints,): indices; NaN for a joint with fewer than 20 rows or no
    variation. [1] interval, shape (n_joints, 2): 95 % intervals by resampling rows. [1]
    """

    first_order: Array
    interval: Array
    rows: Wholes


@dataclass(frozen=True, slots=True)
class GivenDataResult:
    """First-order indices of measured inspections; used are valid rows that have a measured
    displacement.
    """

    file: str
    rows_read: int
    rows_used: int
    indices: GivenDataIndices


def given_data_indices(
    clearance_in: Array, displacement_in: Array, rng: Generator, resamples: int = 500
) -> GivenDataIndices:
    """Estimate first-order indices from inspections.

    clearance_in, shape (n_rows, n_joints): measured clearances, NaN where not measured. [in]
    displacement_in, shape (n_rows,): measured plunger displacements, NaN where not measured. [in]
    Raises `InconclusiveDataError` if fewer than 20 rows have a displacement.
    """
    measured = np.isfinite(displacement_in)
    if np.count_nonzero(measured) < _FEWEST:
        raise InconclusiveDataError(
            f"{np.count_nonzero(measured)} inspections have a measured displacement",
            f"Indices from data need at least {_FEWEST}.",
        )
    n = clearance_in.shape[1]
    first = np.full(n, np.nan)
    bounds = np.full((n, 2), np.nan)
    rows = np.zeros(n, dtype=np.int64)
    for j in range(n):
        usable = measured & np.isfinite(clearance_in[:, j])
        x = clearance_in[usable, j]
        y = displacement_in[usable]
        rows[j] = len(x)
        if len(x) < _FEWEST or np.ptp(x) == 0.0 or np.ptp(y) == 0.0:
            continue
        classes = round(len(x) ** (1.0 / 3.0) * 1.5)
        classes = max(2, min(20, classes))
        first[j] = _share(x, y, classes)
        chosen = rng.integers(0, len(x), (resamples, len(x)))
        spread = np.array([_share(x[pick], y[pick], classes) for pick in chosen])
        # The resampled indices are centred on the estimate: repeated rows make class means too
        # different.
        deviation = np.percentile(spread - np.mean(spread), [2.5, 97.5])
        bounds[j] = first[j] + deviation
    return GivenDataIndices(first, bounds, rows)


def _share(x: Array, y: Array, classes: int) -> float:
    order = np.argsort(x, kind="stable")
    variance = float(y.var(ddof=1))
    if variance == 0.0:
        return float("nan")
    between = within = 0.0
    mean = float(y.mean())
    for part in np.array_split(y[order], classes):
        between += len(part) * (float(part.mean()) - mean) ** 2
        within += float(((part - part.mean()) ** 2).sum())
    noise = within / (len(y) - classes) * (classes - 1)
    return (between - noise) / ((len(y) - 1) * variance)
