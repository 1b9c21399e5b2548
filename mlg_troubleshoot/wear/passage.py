"""First passages: when wear crosses a limit for the first time, by process and along simulated
paths.
"""

from __future__ import annotations

import numpy as np

from mlg_troubleshoot.arrays import Array

# Where an integrated Wiener path is looked at, in multiples of the time that it would need about.
# [1]
_GRID = np.concatenate([[0.0], np.geomspace(0.02, 40.0, 44)])


def first_passage(at: Array, paths: Array, limit: float) -> Array:
    """Find where each simulated path first passes a limit; between two usages it is interpolated.

    Parameters
    ----------
    at : ndarray, shape (m,)
        Ascending usages. [usage]
    paths : ndarray, shape (m, n_samples)
        The wear of each path at these usages. [value]
    limit : float
        The limit. [value]

    Returns
    -------
    ndarray, shape (n_samples,)
        Usage of each first passage, infinite beyond the last usage. [usage]
    """
    over = paths > limit
    k = np.argmax(over, axis=0)
    before = np.maximum(k - 1, 0)
    sample = np.arange(paths.shape[1])
    high, low = paths[k, sample], paths[before, sample]
    with np.errstate(invalid="ignore"):
        rise = np.where(high > low, high - low, 1.0)
        share = np.where(np.isfinite(high), (limit - low) / rise, 1.0)
    passed = at[before] + share * (at[k] - at[before])
    return np.where(over.any(axis=0), np.where(k == 0, 0.0, passed), np.inf)


def wiener_passage(away: Array, drift: Array, sd: Array, rng: np.random.Generator) -> Array:
    """First passage of a Wiener process with drift: inverse Gaussian, sampled after Michael,
    Schucany and Haas (1976).

    Against its drift it passes with probability exp(2 drift away / sd²) only, and then as if the
    drift were turned.
    """
    speed = np.maximum(np.abs(drift), 1e-9)
    mean = away / speed
    phi = rng.standard_normal(away.shape) ** 2 * sd * sd / (away * speed)
    short = mean / (1.0 + phi / 2.0 + np.sqrt(phi + phi * phi / 4.0))
    time = np.where(
        rng.uniform(size=away.shape) * (mean + short) <= mean, short, mean * (mean / short)
    )
    against = (drift < 0.0) & (
        rng.uniform(size=away.shape) > np.exp(-2.0 * speed * away / np.maximum(sd, 1e-9) ** 2)
    )
    return np.where(against, np.inf, time)


def integrated_passage(away: Array, drift: Array, sd: Array, rng: np.random.Generator) -> Array:
    """First passage when the drift itself wanders: paths on a grid, the same for every unit, scaled
    to each.
    """
    draws, _units, repeats = away.shape
    gap = np.diff(_GRID)
    one, two = rng.standard_normal((2, draws, 1, repeats, len(gap)))
    slope = np.cumsum(np.sqrt(gap) * one, axis=-1)
    begins = np.concatenate([np.zeros_like(slope[..., :1]), slope[..., :-1]], axis=-1)
    area = np.cumsum(begins * gap + gap**1.5 * (one / 2.0 + two / np.sqrt(12.0)), axis=-1)
    scale = away / (np.maximum(drift, 0.0) + (sd * sd * away) ** (1.0 / 3.0))
    rate, rough = drift * scale, sd * scale**1.5
    time, below, found = (
        np.full(away.shape, np.inf),
        np.zeros(away.shape),
        np.zeros(away.shape, bool),
    )
    for k in range(len(gap)):
        level = rate * _GRID[k + 1] + rough * area[..., k]
        new = (level >= away) & ~found
        part = (away[new] - below[new]) / (level[new] - below[new])
        time[new] = scale[new] * (_GRID[k] + part * gap[k])
        found |= new
        below = level
    return time


def gamma_passage(away: Array, rng: np.random.Generator) -> Array:
    """Shape at which a gamma process of scale 1 passes ``away``: its distribution inverted by
    bisection.

    The quantile of a gamma distribution is taken after Wilson and Hilferty (1931).
    """
    z = rng.standard_normal(away.shape)
    low, high = np.zeros(away.shape), away + 6.0 * np.sqrt(away) + 20.0
    for _ in range(40):
        middle = (low + high) / 2.0
        shape = np.maximum(middle, 1e-9)
        over = (
            shape * np.maximum(1.0 - 1.0 / (9.0 * shape) + z / (3.0 * np.sqrt(shape)), 0.0) ** 3
            >= away
        )
        low, high = np.where(over, low, middle), np.where(over, middle, high)
    return (low + high) / 2.0
