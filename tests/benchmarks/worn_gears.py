"""A fleet of worn gears from code that shares nothing with the product, for the benchmarks of the
decision.

The linkage is the independent simulator's: a closed chain in space solved by Newton's method. Wear
is drawn here, as the priors of the product describe it in words, by other code; what a technician
reads is drawn from it.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

sys.path.insert(0, str(Path(__file__).parents[2]))

from tests.hidden_effect.simulator.linkage import (
    Build,
    clearance_vectors,
    close,
    load,
    plunger_gradient,
    reading,
)

Array = NDArray[np.float64]

LIMIT_IN = 0.0075
GAUGE_U_IN = 0.0005
#: Joints that no plunger reading can distinguish.
GROUPS = ((1,), (2,), (3, 5), (4,), (6, 7), (8,), (9, 10))


@dataclass(frozen=True, slots=True)
class Fleet:
    """Worn gears: what is true and what was read."""

    true_in: Array  # Radial clearances, (n, 10) [in]
    read_in: Array  # What the gauge read, not below zero, (n, 10) [in]
    plunger_in: Array  # What the plunger gauge read at mid-position, (n,) [in]
    # True where something other than clearance moved the plunger, (n,).
    other_cause: NDArray[np.bool_]


def displacement(true_in: Array, angles: Array, linkage: str = "A") -> Array:
    """Plunger displacement of each gear with the given directions, (n,) [in]."""
    geometry = load(linkage)
    build = Build.nominal(geometry, len(true_in))
    zero = Build.nominal(geometry, 1)
    at_rest = reading(zero, close(zero, np.zeros((1, 10, 2))))[0]
    return reading(build, close(build, clearance_vectors(true_in, angles))) - at_rest


def worst(true_in: Array, linkage: str = "A") -> Array:
    """Worst displacement of each gear, the larger of both senses in magnitude, (n,) [in]."""
    geometry = load(linkage)
    build = Build.nominal(geometry, len(true_in))
    zero = Build.nominal(geometry, 1)
    at_rest = reading(zero, close(zero, np.zeros((1, 10, 2))))[0]
    largest = np.zeros(len(true_in))
    for turn in (0.0, np.pi):
        angles = np.repeat(geometry.angles[None, :] + turn, len(true_in), axis=0)
        vectors = clearance_vectors(true_in, angles)
        unknown = close(build, vectors)
        for _ in range(2):
            slope = plunger_gradient(build, vectors, unknown)
            angles = np.arctan2(slope[..., 1], slope[..., 0]) + turn
            vectors = clearance_vectors(true_in, angles)
            unknown = close(build, vectors, unknown)
        largest = np.maximum(largest, np.abs(reading(build, unknown) - at_rest))
    return largest


def explained_fleet(n: int, rng: np.random.Generator) -> Fleet:
    """Draw gears whose plunger was read: wear by link or pivot, random directions, now and then
    another cause.
    """
    share = rng.triangular(0.0, 0.0, 1.0, (n, 10))
    for group in GROUPS:
        for joint in group:
            hit = rng.random(n) < 0.05 / len(group)
            share[hit, joint - 1] = rng.uniform(1.0, 2.0, int(hit.sum()))
    true_in = LIMIT_IN * share
    moved = displacement(true_in, rng.uniform(0.0, 2.0 * np.pi, (n, 10)))
    # The uncertainty that the decision rule declares for the model, until measured data supply a
    # better one.
    moved = moved + rng.normal(size=n) * np.maximum(0.003, 0.10 * np.abs(moved))
    elsewhere = rng.random(n) < 0.05
    plunger = (
        moved + np.where(elsewhere, rng.normal(0.0, 0.06, n), 0.0) + rng.normal(0.0, GAUGE_U_IN, n)
    )
    return Fleet(true_in, readings(true_in, rng), plunger, elsewhere)


def readings(true_in: Array, rng: np.random.Generator) -> Array:
    """What a gauge reads of these clearances: normal errors, never below zero, (n, 10) [in]."""
    return np.maximum(true_in + rng.normal(0.0, GAUGE_U_IN, true_in.shape), 0.0)
