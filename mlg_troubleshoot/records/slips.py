"""Slips that would explain a value: suggested, never applied."""

from __future__ import annotations

from mlg_troubleshoot.units import MM_PER_IN, SLIPS, THOU_PER_IN, ClearanceConvention, LengthUnit

_SMALLEST_IN = 0.0001


def scale_slip(
    value_in: float,
    unit: LengthUnit,
    convention: ClearanceConvention,
    plausible_max_in: float,
    *,
    halves: bool = True,
) -> str:
    """Name the slip of unit, decimal point or convention that would bring a value into the usual
    range.
    """
    entered = unit.from_inches(value_in * convention.per_radial)
    found: list[str] = []
    if (
        unit is LengthUnit.INCH
        and entered >= 1.0
        and _usual(value_in / THOU_PER_IN, plausible_max_in)
    ):
        found.append(
            f"{entered:.4g} thou would be {entered / THOU_PER_IN:.4g} in: was it read in thou"
            " (factor 1000)?"
        )
    if unit is LengthUnit.INCH and _usual(value_in / MM_PER_IN, plausible_max_in):
        found.append(
            f"{entered:.4g} mm would be {entered / MM_PER_IN:.4g} in: was it read in millimetres"
            " (factor 25.4)?"
        )
    if (
        unit is LengthUnit.MILLIMETRE
        and entered >= 1.0
        and _usual(value_in * MM_PER_IN / THOU_PER_IN, plausible_max_in)
    ):
        inches = entered / THOU_PER_IN
        found.append(
            f"{entered:.4g} thou would be {inches * MM_PER_IN:.4g} mm: was it read in thou?"
        )
    if (
        halves
        and convention is ClearanceConvention.RADIAL
        and _usual(value_in / SLIPS["convention"].factor, plausible_max_in)
    ):
        found.append(
            "Is it a diametral clearance or total play (factor 2)? Then say so in"
            " clearance_convention."
        )
    ten = SLIPS["point"].factor
    if _usual(value_in / ten, plausible_max_in):
        found.append(
            f"Has the decimal point slipped (factor {ten:g})? It would be {entered / ten:.4g}"
            f" {unit.value}."
        )
    return " ".join(found)


def _usual(value_in: float, plausible_max_in: float) -> bool:
    return _SMALLEST_IN <= value_in <= plausible_max_in
