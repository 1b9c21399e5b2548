"""What re-rigging alone would do: the plunger's range shifted to the middle, worn joints left as they are."""

from __future__ import annotations

import numpy as np

from mlg_troubleshoot.decision.assessment import Rigging, UncertaintyBudget
from mlg_troubleshoot.decision.case import Cases, exact_chance
from mlg_troubleshoot.decision.wear_levels import normal_cdf


def rigging_alternative(one: Cases, worst_in: tuple[float, float], budget: UncertaintyBudget) -> Rigging:
    """Shift the plunger so that the worst cases of both senses are equally far.

    Re-rigging moves the range of the plunger and cannot narrow it: what remains is half the distance between both
    worst cases. The uncertainties of the decision rule stay as they are.
    """
    over, under = worst_in
    shift, left = -0.5 * (over + under), 0.5 * (over - under)
    parts = (budget.clearances_in, budget.geometry_in, budget.model_in, budget.margin_in)
    u = float(np.sqrt(np.sum(np.square(parts))))
    chance = exact_chance(one, one.filled(0.0), shift)
    within = float(normal_cdf((one.margin_in - left) / u)[0])
    return Rigging(shift, left, within, float(chance[0]))
