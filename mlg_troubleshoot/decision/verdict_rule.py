"""The verdict under measurement uncertainty (after JCGM 106 and ISO 14253-1, conformance
probability 95 %).
"""

from __future__ import annotations

import math
from statistics import NormalDist

import numpy as np

from mlg_troubleshoot.arrays import Array
from mlg_troubleshoot.decision.assessment import Basis, Verdict

# Conformance probability of a verdict (JCGM 106). [1]
CONFORMANCE = 0.95
# Standard score of the conformance probability. [1]
SCORE = NormalDist().inv_cdf(CONFORMANCE)


def normal_cdf(z: Array) -> Array:
    """Standard normal distribution. [1]"""
    # Not scipy's: a check of one gear would wait for its import longer than for the verdict.
    flat = [0.5 * math.erfc(-value / math.sqrt(2.0)) for value in np.ravel(z).tolist()]
    return np.reshape(np.array(flat), np.shape(z))


_SCORES = np.linspace(-8, 8, 6401)
_TABLE = normal_cdf(_SCORES)


def tabled_normal_cdf(z: Array) -> Array:
    """Standard normal distribution from a table, for many values at once. [1]"""
    return np.interp(z, _SCORES, _TABLE)


def zone(probability: float) -> Verdict:
    """Classify a probability of being within the margin."""
    if probability <= 1.0 - CONFORMANCE:
        return Verdict.OUTSIDE_MARGIN
    return Verdict.WITHIN_MARGIN if probability >= CONFORMANCE else Verdict.INCONCLUSIVE


def verdict(p_lower: float, p_upper: float, *, critical_missing: bool) -> Verdict:
    """Apply the rule to what is predicted; the first match wins."""
    lower = zone(p_lower)
    upper = zone(p_upper)
    if lower is Verdict.OUTSIDE_MARGIN:
        return Verdict.OUTSIDE_MARGIN
    if critical_missing or lower is not upper:
        return Verdict.INCOMPLETE
    return lower


def with_reading(
    predicted: Verdict, *, beyond: bool, clears: bool, unsettled: bool, chance: float
) -> tuple[Verdict, Basis]:
    """Apply the rule to the plunger that was read; what is predicted stands where it decides
    nothing.

    beyond: a reading is beyond the margin. clears: every reading is within it, the mean also by
    two standard uncertainties, and no failure is as new. unsettled: it is read, or was found at
    Down Lock, such that nothing is cleared. chance: of leaving the margin with random directions;
    NaN where the linkage does not close. [1]
    """
    if beyond:
        return Verdict.OUTSIDE_MARGIN, Basis.MEASURED
    if clears and chance <= 1.0 - CONFORMANCE:
        return Verdict.WITHIN_MARGIN, Basis.MEASURED
    if clears or (unsettled and predicted is Verdict.WITHIN_MARGIN):
        return Verdict.INCONCLUSIVE, Basis.PREDICTED
    return predicted, Basis.PREDICTED
