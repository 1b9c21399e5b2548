"""How worn the unmeasured joints may be, for ranking only: the verdict takes them at their bounds.

No wear rate of this gear is public, so the distribution knows no fleet: a joint's wear, as a share
of its limit, is exponential and cut off at the limit, and one gear's joints share a level of wear
that is itself unknown. What was measured on a gear tells its level, and through it what to expect
of the joints not yet measured.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from mlg_troubleshoot.arrays import Array, Places
from mlg_troubleshoot.decision.second_order import Response

# Mean wear of a gear's joints as a share of their limit, before it is cut off at the limit. [1]
_LEVELS = np.geomspace(0.05, 5.0, 24)


def level_weights(measured_share: Array) -> Array:
    """Chances of the levels of wear of one gear, given what was measured on it. [1]"""
    total = np.array([np.minimum(measured_share, 1.0).sum()])
    return np.asarray(level_chances(total, np.array([len(measured_share)]))[0])


def level_chances(total_share: Array, count: Places) -> Array:
    """The same for many gears, from the sum of the shares of each and their number: shape (n,
    n_levels).
    """
    log_norm = np.log(_LEVELS) + np.log1p(-np.exp(-1.0 / _LEVELS))
    log_weight = -total_share[:, None] / _LEVELS - count[:, None] * log_norm
    weight = np.exp(log_weight - log_weight.max(axis=1, keepdims=True))
    return np.asarray(weight / weight.sum(axis=1, keepdims=True))


def moments() -> tuple[Array, Array]:
    """Mean and variance of a joint's wear at each level. [1]"""
    cut = np.exp(-1.0 / _LEVELS)
    mean = _LEVELS - cut / (1.0 - cut)
    square = (2.0 * _LEVELS**2 - cut * (1.0 + 2.0 * _LEVELS + 2.0 * _LEVELS**2)) / (1.0 - cut)
    return mean, square - mean**2


def quantiles(n: int) -> Array:
    """Wear at evenly spaced chances, for each level. [1]"""
    chance = (np.arange(n) + 0.5) / n
    level = _LEVELS[:, None]
    return -level * np.log1p(chance * np.expm1(-1.0 / level))


def level_likelihood(share: Array) -> Array:
    """Density of a joint's wear at each level. [1]"""
    return np.exp(-share[:, None] / _LEVELS) / (_LEVELS * -np.expm1(-1.0 / _LEVELS))


def normal_cdf(z: Array) -> Array:
    """Standard normal distribution. [1]"""
    # Not scipy's: a check of one gear would wait for its import longer than for the verdict.
    flat = [0.5 * math.erfc(-value / math.sqrt(2.0)) for value in np.ravel(z).tolist()]
    return np.reshape(np.array(flat), np.shape(z))


def tabled_normal_cdf(z: Array) -> Array:
    """Standard normal distribution from a table, for many values at once. [1]"""
    return np.interp(z, _SCORES, _TABLE)


_SCORES = np.linspace(-8.0, 8.0, 6401)
_TABLE = normal_cdf(_SCORES)


def uncertainty_parts(
    linkages: Sequence[Response], clearance_in: Array, gauge_u_in: Array | float, margin_u_in: float
) -> tuple[Array, Array, Array]:
    """Worst case by the second-order expansion, its slopes, and its uncertainty without that of the
    model. [in]
    """
    members = np.array([linkage.magnitude(clearance_in) for linkage in linkages])
    u_geometry = members.std(axis=0, ddof=1) if len(members) > 1 else np.zeros(len(clearance_in))
    slopes = linkages[0].slopes(clearance_in)
    u_readings = np.sqrt(np.sum((gauge_u_in * slopes) ** 2, axis=1))
    return members[0], slopes, np.sqrt(u_readings**2 + u_geometry**2 + margin_u_in**2)
