"""How good the number of the probability is: the linear rule against Monte Carlo with the curved
response.

The decision rule propagates the errors of the readings linearly. The worst case is convex in the
clearances and the larger of two senses, so the exact probability differs. Its Monte Carlo value
averages, over errors of the readings, the normal probability of the other uncertainties; the same
draws with the linear response serve as a control whose mean is known, so that only the difference
carries an error.
"""

from __future__ import annotations

import numpy as np

from mlg_troubleshoot.decision.assessment import Confidence, UncertaintyBudget
from mlg_troubleshoot.decision.case import Cases
from mlg_troubleshoot.decision.second_order import responses
from mlg_troubleshoot.decision.verdict_rule import normal_cdf

# Draws of the readings' errors. [1]
_DRAWS = 4096


def check_probability(
    one: Cases, worst_in: tuple[float, float], budget: UncertaintyBudget, rng: np.random.Generator
) -> Confidence:
    """Recompute the probability of being within the margin by Monte Carlo."""
    start = one.filled(0.0)[0]
    margin_in = float(one.margin_in[0])
    gauge_u_in = one.gauge_u_in[0] * one.measured[0]
    response = responses(one.gear)[0].anchored(start, *worst_in)
    half = gauge_u_in * rng.standard_normal((_DRAWS // 2, len(start)))
    errors = np.vstack([half, -half])
    centre = float(response.magnitude(start))
    slopes = response.slopes(start)
    u_rest = float(np.sqrt(budget.geometry_in**2 + budget.model_in**2 + budget.margin_in**2))
    u_readings = float(np.sqrt(np.sum((gauge_u_in * slopes) ** 2)))
    curved = normal_cdf((margin_in - response.magnitude(start + errors)) / u_rest)
    linear = normal_cdf((margin_in - centre - errors @ slopes) / u_rest)
    known = float(normal_cdf(np.array((margin_in - centre) / np.hypot(u_rest, u_readings))))
    analytic = float(normal_cdf(np.array((margin_in - centre) / budget.combined_in)))
    # Draws in pairs of opposite errors: one pair is one independent value.
    difference = (curved - linear).reshape(2, -1).mean(axis=0)
    error = float(difference.std(ddof=1) / np.sqrt(len(difference)))
    shifted = known + float(difference.mean())
    return Confidence(analytic, float(np.clip(shifted, 0.0, 1.0)), error, _DRAWS)
