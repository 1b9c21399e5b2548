"""How good the number of the probability is: the linear rule against Monte Carlo with the curved response.

The decision rule propagates the errors of the readings linearly. The worst case is convex in the clearances and the
larger of two senses, so the exact probability differs. Its Monte Carlo value averages, over errors of the readings,
the normal probability of the other uncertainties; the same draws with the linear response serve as a control whose
mean is known, so that only the difference carries an error.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mlg_troubleshoot.decision.assessment import Confidence, UncertaintyBudget
from mlg_troubleshoot.decision.belief import normal_cdf
from mlg_troubleshoot.decision.inspection import Inspection
from mlg_troubleshoot.decision.prediction import clearances
from mlg_troubleshoot.decision.response import responses
from mlg_troubleshoot.gear.gear import Gear

Array = NDArray[np.float64]

_DRAWS = 4096


def check_probability(
    gear: Gear,
    inspection: Inspection,
    worst_in: tuple[float, float],
    margin_in: float,
    budget: UncertaintyBudget,
    rng: np.random.Generator,
) -> Confidence:
    """Recompute the probability of being within the margin by Monte Carlo.

    Parameters
    ----------
    gear : Gear
        The gear.
    inspection : Inspection
        What was measured; unmeasured joints count as 0.
    worst_in : tuple of float
        Exact worst cases for over-travel and under-travel. [in]
    margin_in : float
        Allowed displacement. [in]
    budget : UncertaintyBudget
        Standard uncertainties of the analytic probability. [in]
    rng : numpy.random.Generator
        Source of the draws.

    Returns
    -------
    Confidence
        Both probabilities and the error of the second. [1]
    """
    found = clearances([inspection], gear, np.full(len(gear.joints), np.nan))[0]
    start = np.nan_to_num(found)
    response = responses(gear)[0].anchored(start, *worst_in)
    half = inspection.gauge_u_in * rng.standard_normal((_DRAWS // 2, len(start)))
    errors = np.vstack([half, -half]) * np.isfinite(found)
    centre, slopes = float(response.magnitude(start)), response.slopes(start)
    u_rest = float(np.sqrt(budget.geometry_in**2 + budget.model_in**2 + budget.margin_in**2))
    u_readings = inspection.gauge_u_in * float(np.sqrt(np.sum(slopes[np.isfinite(found)] ** 2)))
    curved = normal_cdf((margin_in - response.magnitude(start + errors)) / u_rest)
    linear = normal_cdf((margin_in - centre - errors @ slopes) / u_rest)
    known = float(normal_cdf(np.array((margin_in - centre) / np.hypot(u_rest, u_readings))))
    total = np.hypot(u_rest, budget.clearances_in)
    analytic = float(normal_cdf(np.array((margin_in - centre) / total)))
    # Draws in pairs of opposite errors: one pair is one independent value.
    difference = (curved - linear).reshape(2, -1).mean(axis=0)
    error = float(difference.std(ddof=1) / np.sqrt(len(difference)))
    shifted = known + float(difference.mean())
    return Confidence(analytic, float(np.clip(shifted, 0.0, 1.0)), error, _DRAWS)
