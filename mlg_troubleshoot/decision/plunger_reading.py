"""A measured plunger displacement compared with the prediction."""

from __future__ import annotations

import math

from mlg_troubleshoot.decision.case import plunger_u
from mlg_troubleshoot.decision.inspection import Inspection
from mlg_troubleshoot.units import SLIPS, ClearanceConvention, Length, LengthUnit, Sentence


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
