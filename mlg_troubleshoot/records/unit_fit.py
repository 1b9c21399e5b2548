"""Readings whose size fits another unit better: a pin hardly has less play than in new parts.

A row is compared with the play of new parts that the gear file states, by the mean ratio of its
non-zero readings. What each number costs and catches: `python -m tests.records.unit_confusions`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum

from mlg_troubleshoot.decision.inspection import EnteredClearance
from mlg_troubleshoot.gear.gear import ROUNDING_IN
from mlg_troubleshoot.records.model import ReadOptions
from mlg_troubleshoot.units import (
    MM_PER_IN,
    SLIPS,
    THOU_PER_IN,
    ClearanceConvention,
    Length,
    LengthUnit,
    Sentence,
)

# Below this ratio to new parts a reading is clearly too small. Inches taken for millimetres stay
# below it unless the joints are worn beyond their limits on average (0.6 x 25.4 x 0.0005 in =
# 0.0076 in). A row whose mean lies between this and new parts may be of a new gear, or of a gear
# with its joints worn out on average that was read in another unit: it is asked about.
_TOO_SMALL = 0.6
# Fewer readings than this do not show what the others of the row were read in.
_FEWEST = 3
# A plunger reading of this size or less would be that of a failure in a larger unit: 0.06 mm is
# 0.0025 in, and 0.06 in is twice the margin. [in]
_PLUNGER_NEAR_ZERO_IN = 0.0025
# No reading of a clearance is smaller. [in]
_SMALLEST_IN = 0.0001
CONFIRM_SMALL = (
    "Correct the unit, or confirm the readings: --small-readings-true, or yes in a column"
    " small_readings_true."
)


class UnitFit(StrEnum):
    """How the readings of a row fit the unit that is stated."""

    FITS = "fits"
    LARGE = "large"
    DOUBTFUL = "doubtful"
    TOO_SMALL = "too small"

    @property
    def severity(self) -> int:
        """How much it matters: the order of the names."""
        return list(UnitFit).index(self)


@dataclass(frozen=True, slots=True)
class RowUnit:
    """How the readings of a row fit their unit, the joints whose readings do not, and what to ask
    about them.
    """

    scale: UnitFit = UnitFit.FITS
    joints: tuple[int, ...] = ()
    question: str = ""


def judge_unit(
    radial_in: Mapping[int, float],
    entered: Mapping[int, EnteredClearance],
    convention: ClearanceConvention,
    options: ReadOptions,
) -> RowUnit:
    """Judge whether the readings of a row can have been read in the unit that is stated. [in]"""
    read = {
        joint: value
        for joint, value in radial_in.items()
        if value > 0.0 and options.new_part_in.get(joint, 0.0) > 0.0
    }
    units = {joint: entered[joint].unit for joint in read}
    fits = [
        _judge_stated(
            {joint: value for joint, value in read.items() if units[joint] is unit},
            unit,
            [other for other in units.values() if other.per_inch < unit.per_inch],
            convention,
            options,
            several=len(radial_in) >= _FEWEST,
        )
        for unit in dict.fromkeys(units.values())
    ]
    return max(fits, key=lambda fit: (fit.scale.severity, len(fit.joints)), default=RowUnit())


def _judge_stated(
    read: Mapping[int, float],
    stated: LengthUnit,
    larger: Sequence[LengthUnit],
    convention: ClearanceConvention,
    options: ReadOptions,
    *,
    several: bool,
) -> RowUnit:
    """Judge the readings of a row that state one unit; others of the row state larger ones. [in]

    several: True if the row has enough readings, zeros included, to be asked about as a whole.
    """
    ratios = {joint: value / options.new_part_in[joint] for joint, value in read.items()}
    mean = sum(ratios.values()) / len(ratios)
    enough = len(read) >= _FEWEST
    small = tuple(joint for joint, ratio in ratios.items() if ratio < _TOO_SMALL)
    scale = UnitFit.FITS
    if stated is LengthUnit.INCH:
        # No unit is larger: single readings say nothing, a row of them may be of another
        # convention.
        small = small if enough and mean < _TOO_SMALL else ()
    elif mean < _TOO_SMALL:
        scale = UnitFit.TOO_SMALL if enough else UnitFit.DOUBTFUL
    elif any(_plausible(tuple(read), read, stated, unit, options) for unit in larger):
        scale = UnitFit.DOUBTFUL
        small = tuple(read)
    elif several and mean < 1.0 - ROUNDING_IN:
        scale = UnitFit.DOUBTFUL
        small = tuple(joint for joint, ratio in ratios.items() if ratio < 1.0)
    if small:
        return RowUnit(scale, small, _small_question(small, read, stated, convention, options))
    over = tuple(joint for joint, value in read.items() if value > options.limit_in[joint])
    mostly_over = sum(read.values()) > sum(options.limit_in[joint] for joint in read)
    if stated is not LengthUnit.THOU and enough and mostly_over:
        return RowUnit(UnitFit.LARGE, over, _large_question(over, read, stated, convention))
    return RowUnit()


def plunger_question(displacement_in: float, stated: LengthUnit, options: ReadOptions) -> str:
    """Ask about a plunger reading near zero that would be outside the margin in a larger unit.
    [in]
    """
    if not 0.0 < abs(displacement_in) <= _PLUNGER_NEAR_ZERO_IN:
        return ""
    number = stated.from_inches(displacement_in)
    others = [
        unit.words
        for unit in LengthUnit
        if unit.per_inch < stated.per_inch
        and options.margin_in < abs(unit.to_inches(number)) <= options.plunger_hard_max_in
    ]
    if not others:
        return ""
    confirm = "" if options.asks else f" {CONFIRM_SMALL}"
    read = f"read in {' or '.join(others)}, not in {stated.words}"
    return Sentence.of(
        "the plunger reading of {} {} is {}: was it {}?{}",
        f"{number:g}",
        stated,
        Length(displacement_in),
        read,
        confirm,
    )


def _small_question(
    joints: tuple[int, ...],
    read: Mapping[int, float],
    stated: LengthUnit,
    convention: ClearanceConvention,
    options: ReadOptions,
) -> str:
    new_in = options.new_part_in[joints[0]] * convention.per_radial
    below = all(read[joint] < options.new_part_in[joint] for joint in joints)
    said = (
        f"{_readings(joints, read)} {'below' if below else 'near'} the play of new parts "
        f"({stated.from_inches(new_in):.4g} {stated}{_kind(convention)})"
    )
    larger = [unit for unit in LengthUnit if unit.per_inch < stated.per_inch]
    others = [unit for unit in larger if _plausible(joints, read, stated, unit, options)] or larger
    if others:
        names = " or ".join(unit.words for unit in others)
        confirm = "" if options.asks else f" {CONFIRM_SMALL}"
        return f"{said}: {_asked(joints)} read in {names}, not in {stated.words}?{confirm}"
    factor = (
        ""
        if convention is ClearanceConvention.RADIAL
        else ", or is it a radial clearance (factor 2)"
    )
    return f"{said}: is the decimal point misplaced{factor}?"


def _large_question(
    joints: tuple[int, ...],
    read: Mapping[int, float],
    stated: LengthUnit,
    convention: ClearanceConvention,
) -> str:
    other = LengthUnit.MILLIMETRE if stated is LengthUnit.INCH else LengthUnit.THOU
    factor = " Or is it a diametral clearance or total play, not radial (factor 2)?"
    return (
        f"{_readings(joints, read)} above the limit: {_asked(joints)} read in {other.words}, not in"
        f" {stated.words}?{factor if convention is ClearanceConvention.RADIAL else ''}"
    )


def _plausible(
    joints: tuple[int, ...],
    read: Mapping[int, float],
    stated: LengthUnit,
    other: LengthUnit,
    options: ReadOptions,
) -> bool:
    """Whether the readings would be those of a gear, had they been read in the other unit."""
    mean_in = other.to_inches(
        stated.from_inches(sum(read[joint] for joint in joints) / len(joints))
    )
    return (
        options.new_part_in[joints[0]] * _TOO_SMALL <= mean_in <= options.clearance_confirm_above_in
    )


def _readings(joints: tuple[int, ...], read: Mapping[int, float]) -> str:
    named = ", ".join(f"#{joint}" for joint in joints)
    if len(read) == 1:
        return f"the reading of joint {joints[0]} is"
    return f"{len(joints)} of {len(read)} readings ({named}) {'are' if len(joints) > 1 else 'is'}"


def _asked(joints: tuple[int, ...]) -> str:
    return "were they" if len(joints) > 1 else "was it"


def _kind(convention: ClearanceConvention) -> str:
    return f" {convention.value.lower().replace('_', ' ')}"


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
            f"Is the decimal point misplaced (factor {ten:g})? It would be {entered / ten:.4g}"
            f" {unit.value}."
        )
    return " ".join(found)


def _usual(value_in: float, plausible_max_in: float) -> bool:
    return _SMALLEST_IN <= value_in <= plausible_max_in
