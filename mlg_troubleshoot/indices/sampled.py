"""Indices of any response by :func:`scipy.stats.sobol_indices`, where a tensor has too many points.

The intervals come from independent scrambles of the Sobol points: neighbouring points are not
independent, and a bootstrap over them is many times too wide.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.random import Generator

from mlg_troubleshoot.arrays import Array, count_failed
from mlg_troubleshoot.indices.estimators import Indices, student_half, without_numbers
from mlg_troubleshoot.indices.inputs import Response

# Independent scrambles: their spread gives the interval. [1]
SCRAMBLES = 8
# Points of each: errors of the shipped gear's indices are below 0.001. [1]
POINTS = 1 << 12


def sampled_indices(response: Response, n: int, rng: Generator, seed: int) -> Indices:
    """Estimate indices of a response to n variables of the unit cube."""
    from scipy.stats import sobol_indices, uniform

    cube: list[Any] = [uniform()] * n
    values: list[Array] = []

    def evaluate(unit: Array) -> Array:
        values.append(response(np.ascontiguousarray(unit.T)))
        return values[-1][None, :]

    with np.errstate(divide="ignore", invalid="ignore"):
        found = [
            sobol_indices(func=evaluate, n=POINTS, dists=cube, rng=scramble)
            for scramble in rng.spawn(SCRAMBLES)
        ]
    design = f"scipy.stats.sobol_indices on {SCRAMBLES} scrambles of {POINTS} Sobol points"
    every = np.concatenate(values)
    failed = count_failed(every)
    mean = float(every.mean())
    if failed or np.ptp(every) == 0.0:
        note = "the response does not vary"
        return without_numbers(design, seed, n, every.size, note, failed=failed, mean=mean)
    first = np.array([each.first_order for each in found])
    total = np.array([each.total_order for each in found])
    halves = [student_half(part.std(axis=0, ddof=1), SCRAMBLES) for part in (first, total)]
    estimates = (first.mean(axis=0), halves[0]), (total.mean(axis=0), halves[1])
    return Indices.around(design, seed, *estimates, mean, float(every.var()), every.size, failed)
