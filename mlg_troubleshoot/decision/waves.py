"""Densities of sums of clearances, as series of their characteristic functions.

Pins rest in one of two ways: in uniformly random directions, or near their worst directions where
loads hold them there.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from mlg_troubleshoot.arrays import Array
from mlg_troubleshoot.decision.priors import PRIORS

# Half the range of displacements that a sum may have, the frequencies and the places of its
# density. [in, 1/in, in]
HALF_IN = 0.18
_TERMS = 104
_PLACES = 577
FREQUENCIES = np.pi * np.arange(1, _TERMS + 1) / HALF_IN
# Lanczos factors: without them a series that ends rings far from a narrow peak, where all that is
# left of a gear whose plunger is far out may stand. [1]
SMOOTHED = np.sinc(np.arange(1, _TERMS + 1) / (_TERMS + 1))
AT_IN = np.linspace(-HALF_IN, HALF_IN, _PLACES)
STEP_IN = AT_IN[1] - AT_IN[0]
_COSINES = np.cos(FREQUENCIES[:, None] * AT_IN)
_SINES = np.sin(FREQUENCIES[:, None] * AT_IN)


@lru_cache(maxsize=1)
def _bessel_table() -> Array:
    # A quarter of a turn says all, and with 100 points as much as a double can hold.
    turns = 1j * np.sin((np.arange(100) + 0.5) * np.pi / 200)
    steps = np.exp(np.arange(0.0, 4.0, 0.05)[:, None] * turns)
    begins = np.exp(np.arange(0.0, 260.0, 4.0)[:, None] * turns)
    return np.asarray((begins @ steps.T).real.ravel() / len(turns))


def _random(turns: Array) -> Array:
    """J₀ from a table. [1]"""
    table = _bessel_table()
    return np.interp(turns, np.arange(len(table)) * 0.05, table)


def _held(turns: Array) -> Array:
    mean, spread = PRIORS.cosine
    return np.asarray(np.exp(1j * mean * turns - 0.5 * (spread * turns) ** 2))


@dataclass(frozen=True, slots=True)
class Pins:
    """How pins rest.

    Attributes
    ----------
    waves : callable
        Characteristic function of a clearance, by frequency times what it can move. [1]
    sense : float
        Chance of the sense of a displacement. [1]
    cosine : float
        Cosine of the angle from the worst direction, root mean square. [1]
    """

    waves: Callable[[Array], Array]
    sense: float
    cosine: float


RANDOM = Pins(_random, 1.0, float(np.sqrt(0.5)))
HELD = Pins(_held, 0.5, float(np.hypot(*PRIORS.cosine)))


def density(waves: Array) -> Array:
    """Density of sums at `AT_IN`, times half its range, one row per characteristic function. [1]"""
    found = 0.5 + waves.real @ _COSINES
    return np.maximum(found + waves.imag @ _SINES if np.iscomplexobj(waves) else found, 0.0)


def blur(u_in: Array | float) -> Array:
    return np.asarray(np.exp(-0.5 * (np.asarray(u_in)[..., None] * FREQUENCIES) ** 2))


def inside(waves: Array, bound_in: Array) -> Array:
    """Chance that a sum is within ± a bound, from its characteristic function. [1]"""
    added = np.sum(waves.real * np.sin(FREQUENCIES * bound_in[:, None]) / FREQUENCIES, axis=-1)
    return np.asarray(np.clip((bound_in + 2.0 * added) / HALF_IN, 0.0, 1.0))
