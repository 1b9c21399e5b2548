"""Indices of any response by sampling: Saltelli's and Jansen's estimators on scrambled Sobol
points.

The intervals come from independent scrambles of the points, because neighbouring Sobol points are
not independent and a bootstrap over them is many times too wide.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.random import Generator

from mlg_troubleshoot.arrays import Array, count_failed
from mlg_troubleshoot.indices.chaos import ChaosFit, chaos_indices
from mlg_troubleshoot.indices.estimators import Estimate, Indices, student_half, without_numbers
from mlg_troubleshoot.indices.inputs import Response

# Independent scrambles of the Sobol points: their spread gives the interval. [1]
SCRAMBLES = 8
# Points evaluated at once, and the power of two that the first estimate begins with. [1]
_ROWS = 1 << 14
_FIRST_POWER = 8


def saltelli_indices(  # noqa: PLR0913 - what is asked, where it stops, what a first attempt by another route hands on
    response: Response,
    n: int,
    rng: Generator,
    seed: int,
    accuracy: float = 1e-3,
    most: int = 1 << 24,
    groups: tuple[tuple[int, ...], ...] | None = None,
    progress: Callable[[int, float], None] | None = None,
    note: str = "",
    used: int = 0,
) -> Indices:
    """Compute indices with more and more points until every interval is as narrow as wanted."""
    from scipy.stats import qmc

    sets = tuple((i,) for i in range(n)) if groups is None else groups
    children = rng.spawn(SCRAMBLES)
    power = _FIRST_POWER
    streams = [qmc.Sobol(2 * n, scramble=True, rng=child) for child in children]
    sums = [_Sums(len(sets)) for _ in children]
    found: Indices | None = None
    while True:
        try:
            for stream, total in zip(streams, sums, strict=True):
                for a, b in _continued(stream, power):
                    used += total.add(response, a, b, sets)
        except KeyboardInterrupt:
            if found is None:
                raise
            stopped = f"interrupted at intervals of ± {found.half_width:.2g}"
            return replace(found, note=f"{note}; {stopped}" if note else stopped)
        failed = sum(total.failed for total in sums)
        design = f"Saltelli and Jansen on {SCRAMBLES} scrambles of 2^{power} Sobol points"
        if failed:
            return without_numbers(design, seed, len(sets), used, failed=failed)
        found = _pooled(sums, design, seed, used, note)
        if progress is not None:
            progress(used, found.half_width)
        if found.half_width <= accuracy or not np.isfinite(found.half_width):
            return found
        if 2 * used > most:
            short = f"stopped at {used} evaluations with intervals of ± {found.half_width:.2g}"
            return _pooled(sums, design, seed, used, f"{note}; {short}" if note else short)
        power += 1


def _continued(stream: Any, power: int) -> Iterator[tuple[Array, Array]]:
    """Further Sobol points of a scramble, in both halves of the variables."""
    wanted = 1 << power
    while stream.num_generated < wanted:
        points = stream.random(min(_ROWS, wanted - stream.num_generated))
        first, second = np.split(points, 2, axis=1)
        yield first, second


class _Sums:
    def __init__(self, n: int) -> None:
        self.count = 0
        self.failed = 0
        self.shift: float | None = None
        self.total = 0.0
        self.squares = 0.0
        self.partial = np.zeros(n)
        self.total_partial = np.zeros(n)

    def add(
        self, response: Response, a: Array, b: Array, groups: tuple[tuple[int, ...], ...]
    ) -> int:
        count = len(a)
        ya = response(a)
        yb = response(b)
        self.failed += count_failed(ya) + count_failed(yb)
        if self.shift is None:
            # Moments about a value near the mean lose no digits.
            self.shift = float(np.mean(np.concatenate([ya, yb])))
        ya = ya - self.shift
        yb = yb - self.shift
        self.total += float(ya.sum() + yb.sum())
        self.squares += float((ya**2).sum() + (yb**2).sum())
        for i, group in enumerate(groups):
            mixed = a.copy()
            mixed[:, list(group)] = b[:, list(group)]
            ym = response(mixed)
            self.failed += count_failed(ym)
            ym = ym - self.shift
            self.partial[i] += float((yb * (ym - ya)).sum())
            self.total_partial[i] += float(((ya - ym) ** 2).sum()) / 2.0
        self.count += count
        return count * (2 + len(groups))

    def moments(self) -> tuple[float, float]:
        values = 2 * self.count
        mean = self.total / values
        variance = self.squares / values - mean**2
        return mean + (self.shift or 0.0), variance


def _pooled(sums: list[_Sums], design: str, seed: int, used: int, note: str) -> Indices:
    moments = np.array([each.moments() for each in sums])
    variance = moments[:, 1]
    if np.any(variance <= 0.0):
        note = "the response does not vary"
        n = len(sums[0].partial)
        mean = moments[0, 0]
        return without_numbers(design, seed, n, used, note, mean=mean, variance=0.0)
    counts = np.array([[each.count] for each in sums])

    def estimate(partial_variances: list[Array]) -> Estimate:
        indices = np.array(partial_variances) / counts / variance[:, None]
        scatter = indices.std(axis=0, ddof=1)
        return indices.mean(axis=0), student_half(scatter, len(sums))

    first = estimate([each.partial for each in sums])
    total = estimate([each.total_partial for each in sums])
    mean = float(moments[:, 0].mean())
    mean_variance = float(variance.mean())
    return Indices.around(design, seed, first, total, mean, mean_variance, used, 0, note)


def fast_indices(
    response: Response,
    n: int,
    rng: Generator,
    seed: int,
    accuracy: float = 1e-3,
    most: int = 1 << 24,
    progress: Callable[[int, float], None] | None = None,
) -> tuple[Indices, ChaosFit | None]:
    """Compute indices by polynomial chaos, or by sampling where the response is not smooth: there
    is then no fit.
    """
    found, fit = chaos_indices(response, n, rng, seed, accuracy, most=min(2048, most))
    if fit is None and not found.failed:
        found = saltelli_indices(
            response, n, rng, seed, accuracy, most, None, progress, found.note, found.evaluations
        )
    return found, fit
