"""What has been answered so far, and how a clearance that was typed is judged."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from enum import StrEnum
from types import MappingProxyType

from mlg_troubleshoot.decision.inspection import Outcome, Side
from mlg_troubleshoot.errors import UsageError
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.units import ClearanceConvention, LengthUnit, WrittenLength, parse_length

# Typed values are decimal, limits are binary: a value on a limit is within it.
_EPS_IN = 1e-9
_SMALLEST_SLIP_IN = 0.0001


@dataclass(frozen=True, slots=True)
class JointAnswer:
    """The answer for one joint.

    Parameters
    ----------
    written : WrittenLength or None
        The clearance as typed; None for a joint that was not measured.
    confirmed : bool
        True if a value far beyond the limit was confirmed.
    """

    written: WrittenLength | None
    confirmed: bool = False


NOT_MEASURED = JointAnswer(None)


@dataclass(frozen=True, slots=True)
class Answers:
    """All answers of one inspection; None or a missing joint is still to be asked.

    Parameters
    ----------
    tail_no : str or None
        Tail number.
    side : Side or None
        Which gear.
    unit : LengthUnit or None
        Unit of a number that is typed without one.
    convention : ClearanceConvention or None
        What the readings are readings of.
    record_id : str or None
        Identity of the record, if a flag gave it.
    joints : mapping of int to JointAnswer
        Answers by joint number.
    plunger_in : float or None
        Measured displacement of the plunger at mid-position, over-travel positive. [in]
    margin_in : float or None
        This gear's own margin. [in]
    outcome : Outcome or None
        What the gear did.
    """

    tail_no: str | None = None
    side: Side | None = None
    unit: LengthUnit | None = None
    convention: ClearanceConvention | None = None
    record_id: str | None = None
    joints: Mapping[int, JointAnswer] = field(default_factory=lambda: MappingProxyType({}))
    plunger_in: float | None = None
    margin_in: float | None = None
    outcome: Outcome | None = None

    def with_joint(self, number: int, answer: JointAnswer) -> Answers:
        """Return the answers with one joint answered.

        Parameters
        ----------
        number : int
            Number of the joint.
        answer : JointAnswer
            Its answer.

        Returns
        -------
        Answers
            The new answers.
        """
        return replace(self, joints=MappingProxyType({**self.joints, number: answer}))

    def reading(self, number: int) -> Reading | None:
        """Return the reading of a joint.

        Parameters
        ----------
        number : int
            Number of the joint.

        Returns
        -------
        Reading or None
            The reading; None if it was not measured, or cannot be read yet for want of unit or convention.
        """
        answer = self.joints.get(number)
        if answer is None or answer.written is None or self.convention is None:
            return None
        unit = answer.written.unit or self.unit
        return None if unit is None else Reading(answer.written, unit, self.convention)

    @property
    def radial_in(self) -> dict[int, float]:
        """Radial clearance of each measured joint. [in]"""
        readings = {number: self.reading(number) for number in sorted(self.joints)}
        return {number: reading.radial_in for number, reading in readings.items() if reading is not None}


@dataclass(frozen=True, slots=True)
class Reading:
    """A clearance as typed, with the unit and the convention it is read in.

    Parameters
    ----------
    written : WrittenLength
        The number as typed.
    unit : LengthUnit
        Its unit, written or chosen.
    convention : ClearanceConvention
        What it is a reading of.
    """

    written: WrittenLength
    unit: LengthUnit
    convention: ClearanceConvention

    @property
    def as_read_in(self) -> float:
        """The reading itself. [in]"""
        return self.unit.to_inches(self.written.value)

    @property
    def radial_in(self) -> float:
        """The radial clearance that the model uses. [in]"""
        return self.as_read_in / self.convention.per_radial


class Judgement(StrEnum):
    """What to do with a reading."""

    ACCEPT = "accept"
    CONFIRM = "confirm"
    REFUSE = "refuse"


def judge(reading: Reading, gear: Gear) -> Judgement:
    """Say whether a reading is taken, asked again or refused.

    Parameters
    ----------
    reading : Reading
        The reading.
    gear : Gear
        The gear, which states the two limits of entry.

    Returns
    -------
    Judgement
        REFUSE beyond the hard limit, CONFIRM above the value to be confirmed, else ACCEPT.
    """
    if not reading.radial_in <= gear.hard_limit.value + _EPS_IN:
        return Judgement.REFUSE
    if reading.radial_in > gear.confirm_above.value + _EPS_IN:
        return Judgement.CONFIRM
    return Judgement.ACCEPT


def over_limit(reading: Reading, gear: Gear, number: int) -> bool:
    """Tell whether a reading is over its joint's limit.

    Parameters
    ----------
    reading : Reading
        The reading.
    gear : Gear
        The gear.
    number : int
        Number of the joint.

    Returns
    -------
    bool
        True if the radial clearance is larger than the limit.
    """
    return reading.radial_in > gear.joint(number).limit.value + _EPS_IN


def likely_slips(reading: Reading, gear: Gear) -> tuple[str, ...]:
    """Name the slips that would make a usual value of an unusual one; nothing is applied.

    Parameters
    ----------
    reading : Reading
        A reading that is refused or asked again.
    gear : Gear
        The gear.

    Returns
    -------
    tuple of str
        Suggestions in plain words: another unit, half the value, the decimal point.
    """
    value, usual_in = reading.written.value, gear.confirm_above.value

    def usual(radial_in: float) -> bool:
        return _SMALLEST_SLIP_IN <= radial_in <= usual_in + _EPS_IN

    found = []
    if reading.written.unit is None:
        for unit in (LengthUnit.THOU, LengthUnit.MILLIMETRE):
            other = replace(reading, unit=unit)
            smaller = other.radial_in < reading.radial_in and (unit is LengthUnit.MILLIMETRE or value >= 1.0)
            if smaller and usual(other.radial_in):
                found.append(f"{value:g} {unit.value}? That is {other.as_read_in:.4f} in. Then type the unit.")
    if reading.convention is ClearanceConvention.RADIAL and usual(reading.radial_in / 2):
        found.append("A dial reading or bore minus pin? Then half of it is the radial clearance.")
    if not found and usual(reading.radial_in / 10):
        found.append(f"The decimal point? {value / 10:g} {reading.unit.value} would be a usual value.")
    return tuple(found)


@dataclass(frozen=True, slots=True)
class Preset:
    """What flags already gave; it is not asked again, and `b` still reaches it.

    Parameters
    ----------
    tail_no : str or None
        Tail number.
    side : Side or None
        Which gear.
    unit : LengthUnit or None
        Unit of numbers without one.
    convention : ClearanceConvention or None
        What the readings are readings of.
    record_id : str or None
        Identity of the record.
    values : mapping of int to str
        Clearances as written, by joint number.
    """

    tail_no: str | None = None
    side: Side | None = None
    unit: LengthUnit | None = None
    convention: ClearanceConvention | None = None
    record_id: str | None = None
    values: Mapping[int, str] = field(default_factory=lambda: MappingProxyType({}))

    def joints(self, gear: Gear) -> dict[int, JointAnswer]:
        """Read the clearances.

        Parameters
        ----------
        gear : Gear
            The gear.

        Returns
        -------
        dict of int to JointAnswer
            Answers by joint number.

        Raises
        ------
        UsageError
            If the gear has no such joint, or a value is not a length.
        """
        found = {}
        for number, text in self.values.items():
            if number not in gear.joint_numbers:
                known = ", ".join(map(str, gear.joint_numbers))
                raise UsageError(f"there is no joint {number}", f"The joints of this gear are {known}.")
            found[number] = JointAnswer(parse_length(text))
        return found
