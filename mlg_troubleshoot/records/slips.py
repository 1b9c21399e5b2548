"""Slips that would explain a value: suggested, never applied."""

from __future__ import annotations

from mlg_troubleshoot.units import MM_PER_IN, THOU_PER_IN, ClearanceConvention, LengthUnit

_SMALLEST_IN = 0.0001


def scale_slip(
    value_in: float,
    unit: LengthUnit,
    convention: ClearanceConvention,
    plausible_max_in: float,
    *,
    halves: bool = True,
) -> str:
    """Name the slip of unit, decimal point or convention that would bring a value into the usual range.

    Parameters
    ----------
    value_in : float
        Radial clearance, or another length, as it was understood. [in]
    unit : LengthUnit
        Unit it was read in.
    convention : ClearanceConvention
        Convention it was read in.
    plausible_max_in : float
        Largest value that is usual. [in]
    halves : bool, optional
        False for a length that has no convention.

    Returns
    -------
    str
        The suggestion in plain words; empty if no slip explains the value.
    """
    entered = unit.from_inches(value_in * convention.per_radial)
    found: list[str] = []
    if unit is LengthUnit.INCH and entered >= 1.0 and _usual(value_in / THOU_PER_IN, plausible_max_in):
        found.append(f"{entered:.4g} thou would be {entered / THOU_PER_IN:.4g} in: was it read in thou (factor 1000)?")
    if unit is LengthUnit.INCH and _usual(value_in / MM_PER_IN, plausible_max_in):
        found.append(
            f"{entered:.4g} mm would be {entered / MM_PER_IN:.4g} in: was it read in millimetres (factor 25.4)?"
        )
    if (
        unit is LengthUnit.MILLIMETRE
        and entered >= 1.0
        and _usual(value_in * MM_PER_IN / THOU_PER_IN, plausible_max_in)
    ):
        inches = entered / THOU_PER_IN
        found.append(f"{entered:.4g} thou would be {inches * MM_PER_IN:.4g} mm: was it read in thou?")
    if halves and convention is ClearanceConvention.RADIAL and _usual(value_in / 2.0, plausible_max_in):
        found.append("Is it a diametral clearance or total play (factor 2)? Then say so in clearance_convention.")
    if _usual(value_in / 10.0, plausible_max_in):
        found.append(f"Has the decimal point slipped (factor 10)? It would be {entered / 10.0:.4g} {unit.value}.")
    return " ".join(found)


def _usual(value_in: float, plausible_max_in: float) -> bool:
    return _SMALLEST_IN <= value_in <= plausible_max_in
