"""How each joint of each gear wore: the clearance to expect at every inspection, from all that was read of that gear.

A joint's clearance grows in proportion to landings, from a level and at a rate that differ from gear to gear about
those of the fleet (a linear mixed model). On top it scatters in proportion to its size, and readings have errors,
perhaps smaller than declared. All of these are estimated together by expectation maximisation (Laird and Ware 1982).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_ROUNDS = 25
# The split between errors of reading and scatter of wear is left alone until the lines have settled.
_SETTLED = 3
# A gear's joint scatters as if it were worn at least this share of the fleet's mean. [1]
_LEAST_LEVEL = 0.25
# No joint is tighter than this for the purpose. [in]
_TIGHT_IN = 1e-5
# Scatter of wear about its line at the start, as a share of the level. [1]
_SCATTER = 0.15
# Rows of gears with three readings or more that are needed to tell errors of reading from scatter of wear.
_LEAST_ROWS = 20
# No reading is exact. [in²]
_LEAST_READING_IN2 = 1e-12
# A row further out than this many standard deviations counts less.
_FAR = 3.0


@dataclass(frozen=True)
class WearHistory:
    """One joint's expected clearance in each row, and the variances about it.

    Parameters
    ----------
    expected_in : ndarray, shape (n,)
        Expected clearance. [in]
    unsure_in2 : ndarray, shape (n,)
        Variance of the expectation. [in²]
    scatter_in2 : ndarray, shape (n,)
        Variance of the true clearance about it. [in²]
    reading_in2 : ndarray, shape (n,)
        Variance of a reading about the true clearance. [in²]
    """

    expected_in: Array
    unsure_in2: Array
    scatter_in2: Array
    reading_in2: Array


def landings_of(landings: Array | None, gears: NDArray[np.intp]) -> tuple[Array, NDArray[np.bool_]]:
    """Fill gaps in the landings by the mean of the gear's other inspections, else of the fleet.

    Parameters
    ----------
    landings : ndarray, shape (n,), or None
        Landings, NaN where unknown.
    gears : ndarray of int, shape (n,)
        Number of the gear of each row.

    Returns
    -------
    kilo : ndarray, shape (n,)
        Thousands of landings; 0 if none is known.
    known : ndarray of bool, shape (n,)
        Rows that wear may be learned from: those with landings, or all of them if none has any.
    """
    if landings is None or not np.isfinite(landings).any():
        return np.zeros(len(gears)), np.ones(len(gears), bool)
    known = np.isfinite(landings)
    count = np.bincount(gears[known], minlength=gears.max() + 1)
    total = np.bincount(gears[known], landings[known], minlength=gears.max() + 1)
    mean = np.where(count > 0, total / np.maximum(count, 1), np.mean(landings[known]))
    return np.where(known, landings, mean[gears]) / 1000.0, known


def joint_history(
    reading_in: Array, gears: NDArray[np.intp], kilo: Array, landed: NDArray[np.bool_], u_in: Array
) -> WearHistory | None:
    """Expect one joint's clearance in each row, readings rounded to the steps that they show.

    Parameters
    ----------
    reading_in : ndarray, shape (n,)
        Readings of the joint, NaN where it was not read. [in]
    gears : ndarray of int, shape (n,)
        Number of the gear of each row, from 0.
    kilo : ndarray, shape (n,)
        Thousands of landings.
    landed : ndarray of bool, shape (n,)
        Rows that wear may be learned from.
    u_in : ndarray, shape (n,)
        Declared standard deviation of a reading. [in]

    Returns
    -------
    WearHistory or None
        Expectation and variances; None where no wear was ever read.
    """
    known = np.isfinite(reading_in)
    if not np.any(reading_in[known] > 0.0):
        return None
    rounded = _resolution(reading_in[known]) ** 2 / 12.0
    told = np.where(landed, reading_in, np.nan) if np.any(known & landed) else reading_in
    history = wear_history(told, gears, kilo, u_in**2 + rounded)
    return replace(history, reading_in2=np.maximum(history.reading_in2, rounded))


def _resolution(values: Array) -> float:
    """Step of the readings: the least difference between them, 0 if they lie on no grid. [in]"""
    unique = np.unique(np.round(values, 7))
    if len(unique) < 3:
        return 0.0
    step = float(np.min(np.diff(unique)))
    on_grid = np.abs(unique / step - np.round(unique / step)) < 0.02
    return step if step >= 1e-4 and bool(np.mean(on_grid) > 0.9) else 0.0


def wear_history(reading_in: Array, gears: NDArray[np.intp], kilo: Array, reading_in2: Array) -> WearHistory:
    """Expect one joint's clearance in each row from what was read of its gear and of the fleet.

    Parameters
    ----------
    reading_in : ndarray, shape (n,)
        Readings of the joint, NaN where it was not read. [in]
    gears : ndarray of int, shape (n,)
        Number of the gear of each row, from 0.
    kilo : ndarray, shape (n,)
        Thousands of landings.
    reading_in2 : ndarray, shape (n,)
        Declared variance of a reading. [in²]

    Returns
    -------
    WearHistory
        Expectation and variances.
    """
    known = np.isfinite(reading_in)
    gear, x, y = gears[known], kilo[known], reading_in[known]
    declared = np.maximum(reading_in2[known], _LEAST_READING_IN2)
    many = np.bincount(gear, minlength=gears.max() + 1)[gear] >= 3
    fleet, spread = _fleet(x, y)
    least = max(_LEAST_LEVEL * float(np.mean(y)), _TIGHT_IN)
    least_spread = 1e-6 * spread
    level = np.maximum(fleet[0] + fleet[1] * x, least)
    scatter, share, far = _SCATTER**2, 1.0, np.ones(len(y))
    lines, unsure = np.empty((0, 2)), np.empty((0, 2, 2))
    # Gears of which this joint was never read say nothing about the fleet.
    seen = np.unique(gear)
    for step in range(_ROUNDS):
        variance = share * declared + scatter * level**2
        lines, unsure = _lines(gear, gears.max() + 1, x, y, far / variance, fleet, spread)
        fleet = lines[seen].mean(axis=0)
        apart = lines[seen] - fleet
        spread = (unsure[seen].sum(axis=0) + apart.T @ apart) / len(seen) + least_spread
        fitted = lines[gear, 0] + lines[gear, 1] * x
        square = (y - fitted) ** 2 + _variance(unsure, gear, x)
        far = np.minimum(1.0, _FAR * np.sqrt(variance / np.maximum(square, 1e-30)))
        square = square * far**2
        if many.sum() >= _LEAST_ROWS:
            worn = scatter * level[many] ** 2
            read = share * declared[many]
            part = worn / (worn + read)
            scatter = float(np.mean((part**2 * square[many] + part * read) / level[many] ** 2))
            if step >= _SETTLED:
                error = np.mean(((1.0 - part) ** 2 * square[many] + (1.0 - part) * worn) / declared[many])
                share = min(float(error), 1.0)
        level = np.maximum(fitted, least)
    expected = lines[gears, 0] + lines[gears, 1] * kilo
    return WearHistory(
        np.maximum(expected, 0.0),
        _variance(unsure, gears, kilo),
        scatter * np.maximum(expected, least) ** 2,
        share * reading_in2,
    )


def _fleet(x: Array, y: Array) -> tuple[Array, Array]:
    """Line through all readings, and how widely levels and rates of single gears may lie about it."""
    sloped = np.ptp(x) > 0.0
    line = np.polyfit(x, y, 1)[::-1] if sloped else np.array([np.mean(y), 0.0])
    rest = max(float(np.var(y - line[0] - line[1] * x)), 1e-12)
    return line, np.diag([rest, rest / float(np.var(x)) if sloped else 1e-30])


def _lines(
    gear: NDArray[np.intp], count: int, x: Array, y: Array, weight: Array, fleet: Array, spread: Array
) -> tuple[Array, Array]:
    """Level and rate of each gear drawn to the fleet's, (count, 2), and their covariances, (count, 2, 2)."""

    def total(values: Array) -> Array:
        return np.bincount(gear, weight * values, minlength=count).astype(float)

    prior = np.linalg.inv(spread)
    precision = np.empty((count, 2, 2))
    precision[:, 0, 0] = total(np.ones_like(x)) + prior[0, 0]
    precision[:, 0, 1] = precision[:, 1, 0] = total(x) + prior[0, 1]
    precision[:, 1, 1] = total(x * x) + prior[1, 1]
    unsure = np.linalg.inv(precision)
    right = np.column_stack([total(y), total(x * y)]) + prior @ fleet
    lines: Array = np.einsum("gij,gj->gi", unsure, right)
    return lines, np.asarray(unsure, float)


def _variance(unsure: Array, gear: NDArray[np.intp], x: Array) -> Array:
    """Variance of each row's expectation by its gear's level and rate. [in²]"""
    own = unsure[gear]
    return np.asarray(own[:, 0, 0] + 2.0 * x * own[:, 0, 1] + x * x * own[:, 1, 1])
