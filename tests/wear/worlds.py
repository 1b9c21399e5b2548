"""Fleets whose parts wear as a known process says, from a generator that shares no code with the
product.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
KINDS = ("wiener", "integrated", "gamma", "power")


@dataclass(frozen=True, slots=True)
class Life:
    """What was read of one stretch of a part's life between restorations."""

    unit: str
    usage: Array
    read: Array


def _wear(kind: str, pace: float, grid: Array, rng: np.random.Generator) -> Array:
    """Wear above the start along a grid of usage in [0, 3], about 1 at usage 1 for a part of mean
    pace.
    """
    step = np.diff(grid)
    if kind == "power":
        step = np.diff(grid**1.35)
    if kind in {"wiener", "power"}:
        rise = pace * step + 0.12 * np.sqrt(step) * rng.standard_normal(len(step))
    elif kind == "integrated":
        drift = pace + 0.35 * np.concatenate(
            [[0.0], np.cumsum(np.sqrt(step) * rng.standard_normal(len(step)))[:-1]]
        )
        rise = drift * step
    else:
        rise = rng.gamma(step * 40.0, pace / 40.0)
    return np.concatenate([[0.0], np.cumsum(rise)])


def fleet(
    kind: str,
    rng: np.random.Generator,
    *,
    parts: int = 60,
    visits: int = 7,
    noise: float = 0.05,
    resolution: float = 0.02,
    restored: float = 0.35,
    start: float = 0.3,
) -> list[list[Life]]:
    """Lives of many parts; a share of them was restored once. Usage runs to about 1.5, the grid to
    3.
    """
    parts_lives = []
    for number in range(parts):
        pace = float(np.exp(0.3 * rng.standard_normal()))
        lives = []
        for _ in range(1 + (rng.uniform() < restored)):
            grid = np.linspace(0.0, 3.0, 601)
            true = start + 0.05 * rng.standard_normal() + _wear(kind, pace, grid, rng)
            usage = np.sort(rng.uniform(0.02, 1.5, visits))
            read = np.interp(usage, grid, true) + noise * rng.standard_normal(visits)
            lives.append(Life(f"part {number}", usage, np.round(read / resolution) * resolution))
        parts_lives.append(lives)
    return parts_lives
