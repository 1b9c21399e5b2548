"""How worn the unmeasured joints may be, for ranking only: the verdict takes them at their bounds.

No wear rate of this gear is public, so the distribution knows no fleet: a joint's wear, as a share of its limit, is
exponential and cut off at the limit, and one gear's joints share a level of wear that is itself unknown. What was
measured on a gear tells its level, and through it what to expect of the joints not yet measured.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from mlg_troubleshoot.decision.response import Response

Array = NDArray[np.float64]

_LEVELS = np.geomspace(0.05, 5.0, 24)


def level_weights(measured_share: Array) -> Array:
    """Chances of the levels of wear of one gear, given what was measured on it.

    Parameters
    ----------
    measured_share : ndarray, shape (n_measured,)
        Measured clearances as shares of their limits; more than 1 counts as 1. [1]

    Returns
    -------
    ndarray, shape (n_levels,)
        Chances, summing to 1. [1]
    """
    log_norm = np.log(_LEVELS) + np.log1p(-np.exp(-1.0 / _LEVELS))
    log_weight = -np.minimum(measured_share, 1.0).sum() / _LEVELS - len(measured_share) * log_norm
    weight = np.exp(log_weight - log_weight.max())
    chances: Array = weight / weight.sum()
    return chances


def moments() -> tuple[Array, Array]:
    """Mean and variance of a joint's wear at each level.

    Returns
    -------
    mean : ndarray, shape (n_levels,)
        Means as shares of the limit. [1]
    variance : ndarray, shape (n_levels,)
        Variances. [1]
    """
    cut = np.exp(-1.0 / _LEVELS)
    mean = _LEVELS - cut / (1.0 - cut)
    square = (2.0 * _LEVELS**2 - cut * (1.0 + 2.0 * _LEVELS + 2.0 * _LEVELS**2)) / (1.0 - cut)
    return mean, square - mean**2


def quantiles(n: int) -> Array:
    """Wear at evenly spaced chances, for each level.

    Parameters
    ----------
    n : int
        Number of quantiles.

    Returns
    -------
    ndarray, shape (n_levels, n)
        Shares of the limit, each as likely as the others of its level. [1]
    """
    chance = (np.arange(n) + 0.5) / n
    level = _LEVELS[:, None]
    shares: Array = -level * np.log1p(chance * np.expm1(-1.0 / level))
    return shares


def level_likelihood(share: Array) -> Array:
    """Density of a joint's wear at each level.

    Parameters
    ----------
    share : ndarray, shape (n,)
        Shares of the limit. [1]

    Returns
    -------
    ndarray, shape (n, n_levels)
        Densities. [1]
    """
    density: Array = np.exp(-share[:, None] / _LEVELS) / (_LEVELS * -np.expm1(-1.0 / _LEVELS))
    return density


def normal_cdf(z: Array) -> Array:
    """Standard normal distribution.

    Parameters
    ----------
    z : ndarray
        Standard scores. [1]

    Returns
    -------
    ndarray
        Probabilities. [1]
    """
    flat = [0.5 * math.erfc(-value / math.sqrt(2.0)) for value in np.ravel(z).tolist()]
    return np.reshape(np.array(flat), np.shape(z))


def tabled_normal_cdf(z: Array) -> Array:
    """Standard normal distribution from a table, for many values at once.

    Parameters
    ----------
    z : ndarray
        Standard scores. [1]

    Returns
    -------
    ndarray
        Probabilities, within 1e-6. [1]
    """
    return np.interp(z, _SCORES, _TABLE)


_SCORES = np.linspace(-8.0, 8.0, 6401)
_TABLE = normal_cdf(_SCORES)


def uncertainty_parts(
    linkages: Sequence[Response], clearance_in: Array, gauge_u_in: float, margin_u_in: float
) -> tuple[Array, Array, Array]:
    """Worst case by the second-order expansion, its slopes, and its uncertainty without that of the model.

    Parameters
    ----------
    linkages : sequence of Response
        Expansions of the ensemble, the reference first.
    clearance_in : ndarray, shape (n, n_joints)
        Clearances, all of them read. [in]
    gauge_u_in : float
        Standard uncertainty of one reading. [in]
    margin_u_in : float
        Standard uncertainty of the margin. [in]

    Returns
    -------
    worst : ndarray, shape (n,)
        Worst displacement. [in]
    slopes : ndarray, shape (n, n_joints)
        Its slopes. [1]
    u : ndarray, shape (n,)
        Readings, geometry and margin together. [in]
    """
    members = np.array([linkage.magnitude(clearance_in) for linkage in linkages])
    u_geometry = members.std(axis=0, ddof=1) if len(members) > 1 else np.zeros(len(clearance_in))
    slopes = linkages[0].slopes(clearance_in)
    u_readings = gauge_u_in * np.sqrt(np.sum(slopes**2, axis=1))
    return members[0], slopes, np.sqrt(u_readings**2 + u_geometry**2 + margin_u_in**2)
