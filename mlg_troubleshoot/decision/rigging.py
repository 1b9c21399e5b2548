"""What re-rigging alone would do: the plunger's range shifted to the middle, worn joints left as they are."""

from __future__ import annotations

import numpy as np

from mlg_troubleshoot.decision.assessment import Rigging, UncertaintyBudget
from mlg_troubleshoot.decision.belief import normal_cdf
from mlg_troubleshoot.decision.inspection import Inspection
from mlg_troubleshoot.decision.prediction import DIRECTION_SETS, Extension, clearances
from mlg_troubleshoot.gear.adjustment import Adjustment
from mlg_troubleshoot.gear.directions import chance_beyond
from mlg_troubleshoot.gear.gear import Gear


def rigging_alternative(
    gear: Gear,
    inspection: Inspection,
    worst_in: tuple[float, float],
    margin_in: float,
    budget: UncertaintyBudget,
    extension: Extension | None = None,
) -> Rigging:
    """Shift the plunger so that the worst cases of both senses are equally far.

    Re-rigging moves the range of the plunger and cannot narrow it: what remains is half the distance between both
    worst cases. The uncertainties of the decision rule stay as they are.

    Parameters
    ----------
    gear : Gear
        The gear.
    inspection : Inspection
        What was measured; unmeasured joints count as 0.
    worst_in : tuple of float
        Worst cases for over-travel and under-travel, signed. [in]
    margin_in : float
        Allowed displacement. [in]
    budget : UncertaintyBudget
        Standard uncertainties. [in]
    extension : Extension, optional
        An extension of the model.

    Returns
    -------
    Rigging
        The shift and what it leaves. [in, 1]
    """
    over, under = worst_in
    shift, left = -0.5 * (over + under), 0.5 * (over - under)
    parts = (budget.clearances_in, budget.geometry_in, budget.model_in, budget.margin_in)
    u = float(np.sqrt(np.sum(np.square(parts))))
    found = clearances([inspection], gear, np.zeros(len(gear.joints)))
    adjustment = Adjustment(found) if extension is None else extension.adjust([inspection], found)
    offset = np.zeros(1) if adjustment.offset_in is None else adjustment.offset_in
    chance = chance_beyond(
        gear.model,
        adjustment.clearance_in,
        np.array([margin_in]),
        DIRECTION_SETS,
        adjustment.numbers(gear.model),
        offset + shift,
        adjustment.rate_factor,
    )
    within = float(normal_cdf(np.array((margin_in - left) / u)))
    return Rigging(shift, left, within, float(chance[0]))
