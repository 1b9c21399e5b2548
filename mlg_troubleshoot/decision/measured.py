"""A measured plunger displacement beside the prediction."""

from __future__ import annotations

import math

from mlg_troubleshoot.decision.inspection import Inspection
from mlg_troubleshoot.decision.prediction import DEFAULT_PLUNGER_U_IN
from mlg_troubleshoot.units import MM_PER_IN


def reading_uncertainty(inspection: Inspection) -> tuple[float, str]:
    """Standard uncertainty of the mean plunger reading, and where it comes from.

    Parameters
    ----------
    inspection : Inspection
        An inspection with at least one reading.

    Returns
    -------
    u_in : float
        Standard uncertainty of the mean. [in]
    source : str
        ``declared`` or ``default``.
    """
    n = len(inspection.readings_in)
    if inspection.plunger_gauge_u_in is not None:
        return inspection.plunger_gauge_u_in / math.sqrt(n), "declared"
    return DEFAULT_PLUNGER_U_IN / math.sqrt(n), "default"


def outside(inspection: Inspection, margin_in: float) -> bool:
    """Tell whether the plunger was measured outside its margin.

    Parameters
    ----------
    inspection : Inspection
        The inspection.
    margin_in : float
        Allowed displacement. [in]

    Returns
    -------
    bool
        False if nothing was measured.
    """
    measured = inspection.measured_displacement_in
    return measured is not None and abs(measured) > margin_in


def statement(inspection: Inspection, margin_in: float) -> str | None:
    """Say in its own words what the measured displacement says.

    Parameters
    ----------
    inspection : Inspection
        The inspection.
    margin_in : float
        Allowed displacement. [in]

    Returns
    -------
    str or None
        The statement; None if nothing was measured.
    """
    measured = inspection.measured_displacement_in
    if measured is None:
        return None
    sense = "beyond" if measured > 0 else "short of"
    if outside(inspection, margin_in):
        return (
            f"MEASURED: the plunger stands {abs(measured):.4f} in {sense} mid-position, outside its margin of "
            f"{margin_in:.4f} in. This is a measurement and holds whatever the prediction says."
        )
    return (
        f"Measured: the plunger stands {abs(measured):.4f} in {sense} mid-position, within its margin of "
        f"{margin_in:.4f} in."
    )


def disagreement(inspection: Inspection, over_in: float, under_in: float, standard_uncertainty_in: float) -> str | None:
    """Flag a measured displacement that differs from the prediction by more than two standard uncertainties.

    Parameters
    ----------
    inspection : Inspection
        The inspection.
    over_in, under_in : float
        Signed worst case of each sense. [in]
    standard_uncertainty_in : float
        Of the prediction. [in]

    Returns
    -------
    str or None
        What differs and what would explain it; None if nothing does.
    """
    measured = inspection.measured_displacement_in
    if measured is None:
        return None
    u = math.hypot(standard_uncertainty_in, reading_uncertainty(inspection)[0])
    if abs(measured - over_in) <= 2.0 * u:
        return None
    differs = (
        f"Measured {measured:+.4f} in differs from the predicted over-travel {over_in:+.4f} in by more than two "
        f"combined standard uncertainties ({2 * u:.4f} in)."
    )
    if under_in - 2.0 * u <= measured < over_in:
        slip = _slip(measured, over_in, u)
        return (
            f"{differs} It lies inside the worst-case bounds, so it is possible: the clearances need not be taken "
            f"up in the worst direction.{slip}"
        )
    return (
        f"{differs} It is beyond what the entered clearances can do in any direction. Look for: a clearance read "
        f"smaller than it is or entered with the wrong unit or convention, an unmeasured joint, a part outside "
        f"the listed joints, a changed rigging, the plunger gauge.{_slip(measured, over_in, u)}"
    )


def _slip(measured: float, predicted: float, u: float) -> str:
    """Name a slip of the entry that would make the two agree; it is suggested, never applied."""
    if predicted <= 0.0 or measured <= 0.0:
        return ""
    for factor, words in (
        (MM_PER_IN, "millimetres entered as inches, or the reverse"),
        (10.0, "a decimal point in the wrong place"),
        (2.0, "diametral or total play entered as radial, or the reverse"),
    ):
        for value in (factor, 1.0 / factor):
            if abs(measured - predicted * value) <= max(u, 0.05 * abs(measured)):
                return f" A slip that would explain it: {words} (factor {factor:g})."
    return ""
