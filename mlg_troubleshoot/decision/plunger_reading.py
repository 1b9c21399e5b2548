"""A measured plunger displacement compared with the prediction."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from mlg_troubleshoot.arrays import Array, Mask
from mlg_troubleshoot.decision.case import Cases, plunger_u
from mlg_troubleshoot.decision.inspection import Inspection
from mlg_troubleshoot.decision.prediction import Prediction
from mlg_troubleshoot.units import SLIPS, ClearanceConvention, Length, LengthUnit, Sentence


@dataclass(frozen=True, slots=True, eq=False)
class Compared:
    """Measured displacements of n gears compared with what the joints can explain, unmeasured
    joints at their limit.

    Attributes
    ----------
    beyond, clears, unsettled : ndarray of bool, shape (n,)
        Measured beyond the margin; within it by two standard uncertainties; within it by less.
    explained : ndarray of bool, shape (n,)
        False where the displacement is beyond what the joints can explain by two standard
        uncertainties.
    explained_at_most_in, unexplained_in : ndarray, shape (n,)
        What of it they explain at most, and what they cannot; NaN without a reading. [in]
    """

    beyond: Mask
    clears: Mask
    unsettled: Mask
    explained: Mask
    explained_at_most_in: Array
    unexplained_in: Array


def compare(cases: Cases, upper: Prediction) -> Compared:
    """Split each measured displacement into what the joints can explain at most and the rest."""
    size = np.abs(cases.plunger_in)
    bound = np.maximum(
        np.where(cases.plunger_in > 0.0, upper.worst.over_in, -upper.worst.under_in), 0.0
    )
    at_most = np.where(np.isfinite(bound), np.minimum(size, bound), size)
    u = np.hypot(cases.plunger_u_in, upper.standard_uncertainty(np.zeros(len(cases))))
    beyond = cases.beyond_margin
    clears = size + 2.0 * np.hypot(cases.plunger_u_in, cases.margin_u_in) <= cases.margin_in
    return Compared(
        beyond=beyond,
        clears=clears,
        unsettled=np.isfinite(size) & ~beyond & ~clears,
        explained=~(size > at_most + 2.0 * u),
        explained_at_most_in=at_most,
        unexplained_in=size - at_most,
    )


def disagreement(
    inspection: Inspection, over_in: float, under_in: float, standard_uncertainty_in: float
) -> str | None:
    """Flag a measured displacement that is beyond both worst cases by more than two standard
    uncertainties.
    """
    measured = inspection.measured_displacement_in
    if measured is None:
        return None
    u = math.hypot(standard_uncertainty_in, plunger_u(inspection))
    if under_in - 2.0 * u <= measured <= over_in + 2.0 * u:
        return None
    return Sentence.of(
        "Measured {} is beyond what the entered clearances can do in any direction ({} to {})."
        " Look for a clearance entered too small, an unmeasured joint, the rigging, the plunger"
        " gauge.{}",
        Length(measured, sign=True),
        Length(under_in, sign=True, named=False),
        Length(over_in, sign=True),
        _entry_error(inspection, abs(measured), over_in if measured > 0.0 else -under_in, u),
    )


def _entry_error(inspection: Inspection, measured: float, bound: float, u: float) -> str:
    """Name an error of entry that made the clearances, and so the bound, too small: suggested,
    never applied.
    """
    possible = {
        "unit": any(
            reading.unit is LengthUnit.MILLIMETRE for reading in inspection.entered.values()
        ),
        "point": True,
        "convention": inspection.convention is not ClearanceConvention.RADIAL,
    }
    for name, slip in SLIPS.items():
        if (
            possible[name]
            and bound > 0.0
            and abs(measured - bound * slip.factor) <= max(u, 0.05 * measured)
        ):
            return (
                f" An entry error that would explain it: {slip.too_small} (factor {slip.factor:g})."
            )
    return ""
