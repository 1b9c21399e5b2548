"""Displacements of worn gears from code that shares nothing with the product, for the benchmarks of
the decision.

The linkage is the independent simulator's: a closed chain in space solved by Newton's method.
"""

from __future__ import annotations

import sys
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
#: Joints that no plunger reading can distinguish.
GROUPS = ((1,), (2,), (3, 5), (4,), (6, 7), (8,), (9, 10))


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
