"""Densities of sums of clearances in random directions, as series of their characteristic
functions.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from mlg_troubleshoot.arrays import Array

# Half the range of displacements that a sum may have, the frequencies and the places of its
# density. [in, 1/in, in]
HALF_IN, _TERMS, _PLACES = 0.18, 104, 145
FREQUENCIES = np.pi * np.arange(1, _TERMS + 1) / HALF_IN
AT_IN = np.linspace(-HALF_IN, HALF_IN, _PLACES)
STEP_IN = AT_IN[1] - AT_IN[0]
COSINES = np.cos(FREQUENCIES[:, None] * AT_IN)


@lru_cache(maxsize=1)
def _bessel_table() -> Array:
    turns = (np.arange(512) + 0.5) * np.pi / 512
    return np.asarray(np.mean(np.cos(np.arange(0.0, 260.0, 0.05)[:, None] * np.sin(turns)), axis=1))


def bessel(z: Array) -> Array:
    """J₀ from a table. [1]"""
    table = _bessel_table()
    return np.asarray(np.interp(z, np.arange(len(table)) * 0.05, table))


def blur(u_in: Array | float) -> Array:
    return np.asarray(np.exp(-0.5 * (np.asarray(u_in)[..., None] * FREQUENCIES) ** 2))


def inside(waves: Array, bound_in: Array) -> Array:
    """Chance that a sum is within ± a bound, from its characteristic function. [1]"""
    added = np.sum(waves * np.sin(FREQUENCIES * bound_in[:, None]) / FREQUENCIES, axis=-1)
    return np.asarray(np.clip((bound_in + 2.0 * added) / HALF_IN, 0.0, 1.0))
