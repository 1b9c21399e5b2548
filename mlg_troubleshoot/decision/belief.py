"""How worn the unmeasured joints may be, for ranking only: the verdict takes them at their bounds.

No wear rate of this gear is public, so the distribution knows no fleet: a joint's wear, as a share of its limit, is
exponential and cut off at the limit, and one gear's joints share a level of wear that is itself unknown. What was
measured on a gear tells its level, and through it what to expect of the joints not yet measured.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from mlg_troubleshoot.decision.response import Response
from mlg_troubleshoot.gear.directions import random_directions

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


def draw_shares(measured_share: Array, n_unmeasured: int, n: int) -> Array:
    """Draw the wear of the unmeasured joints of one gear, evenly: the same draws at every call.

    Parameters
    ----------
    measured_share : ndarray, shape (n_measured,)
        Measured clearances as shares of their limits. [1]
    n_unmeasured : int
        Number of joints to draw.
    n : int
        Number of draws.

    Returns
    -------
    ndarray, shape (n, n_unmeasured)
        Clearances as shares of their limits, 0 to 1. [1]
    """
    even = _even(n_unmeasured + 1, n)
    steps = np.cumsum(level_weights(measured_share))
    level = _LEVELS[np.minimum(np.searchsorted(steps, even[:, 0]), len(_LEVELS) - 1)][:, None]
    shares: Array = -level * np.log1p(-even[:, 1:] * -np.expm1(-1.0 / level))
    return shares


@lru_cache(maxsize=32)
def _even(dimensions: int, n: int) -> Array:
    points = random_directions(dimensions, n) / (2.0 * np.pi)
    points.flags.writeable = False
    return points


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


def quick_probability(
    linkages: Sequence[Response],
    clearance_in: Array,
    measured: NDArray[np.bool_],
    gauge_u_in: float,
    margin: tuple[float, float],
    residual_u_in: float | None,
) -> Array:
    """Probability that the worst case is within the margin, by the second-order expansion.

    Parameters
    ----------
    linkages : sequence of Response
        Expansions of the ensemble, the reference first.
    clearance_in : ndarray, shape (n, n_joints)
        Clearances. [in]
    measured : ndarray of bool, shape (n_joints,)
        Which of them carry the uncertainty of a reading.
    gauge_u_in : float
        Standard uncertainty of one reading. [in]
    margin : tuple of float
        Margin and its standard uncertainty. [in]
    residual_u_in : float or None
        Standard uncertainty of an extended model; None takes the provisional one. [in]

    Returns
    -------
    ndarray, shape (n,)
        Probabilities, with the uncertainties of the decision rule. [1]
    """
    members = np.array([linkage.magnitude(clearance_in) for linkage in linkages])
    u_geometry = members.std(axis=0, ddof=1) if len(members) > 1 else np.zeros(len(clearance_in))
    u_readings = gauge_u_in * np.sqrt(np.sum((linkages[0].slopes(clearance_in) * measured) ** 2, axis=1))
    u_model = np.maximum(0.003, 0.10 * members[0]) if residual_u_in is None else residual_u_in
    u = np.sqrt(u_readings**2 + u_geometry**2 + u_model**2 + margin[1] ** 2)
    return normal_cdf((margin[0] - members[0]) / u)
