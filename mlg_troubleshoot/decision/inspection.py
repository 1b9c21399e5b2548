"""One inspection of one gear, as the decision and the diagnosis need it: radial clearances in
inches.

What other gears of a fleet say of one before anything is read on it: how far they are worn, and
whether loads hold their pins near their worst directions.
"""

from __future__ import annotations

import re
import unicodedata
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import date, datetime, timedelta
from enum import StrEnum
from typing import Any

from mlg_troubleshoot.decision.priors import PRIORS
from mlg_troubleshoot.errors import UsageError
from mlg_troubleshoot.gear.gear import DEFAULT_GAUGE_U_IN
from mlg_troubleshoot.results import Result
from mlg_troubleshoot.units import ClearanceConvention, Length, LengthUnit, Sentence, with_unit


class Side(StrEnum):
    """Which main landing gear: it must be stated."""

    LH = "LH"
    RH = "RH"

    @classmethod
    def spelt(cls, text: str) -> Side | None:
        """Read a side as people write it: ``LH``, ``left``, ``L/H side``, ``port``; None if it is
        not one.
        """
        bare = text.lower().removesuffix("side").removesuffix("gear")
        return _SIDES.get(re.sub(r"[^a-z]", "", bare))

    @classmethod
    def parse(cls, text: str) -> Side:
        """Read a side as people write it, or refuse it."""
        found = cls.spelt(text)
        if found is None:
            raise UsageError(f"side {text!r} is not LH or RH", "Give LH or RH.")
        return found


# The one table of how sides are written, in lower case and letters only: for cells, prompts, flags
# and arguments.
_SIDES = {
    **dict.fromkeys(
        ("l", "lh", "lhs", "left", "lefthand", "port", "lhmlg", "leftmlg", "mlgl", "mlglh"), Side.LH
    ),
    **dict.fromkeys(
        ("r", "rh", "rhs", "right", "righthand", "starboard", "stbd", "rhmlg", "rightmlg"), Side.RH
    ),
    **dict.fromkeys(("mlgr", "mlgrh"), Side.RH),
}


# Cyrillic and Greek letters that look like Latin ones, in lower case, and O for 0.
_LOOK_ALIKE = str.maketrans("авекмнорстухѕіјαβεζηικμνορτυχo", "abekmh0pctyxsijabezhikmn0ptyx0")


def plain_tail(tail: str) -> str:
    """A tail number without what looks alike or is not seen: case, blanks and dashes, O for 0,
    letters of other widths and alphabets, fillers.
    """
    text = unicodedata.normalize("NFKC", tail).casefold()
    return re.sub(r"[\W_\u1160\u115f]+", "", text).translate(_LOOK_ALIKE)


class Outcome(StrEnum):
    """What the gear did."""

    RETRACTED = "RETRACTED"
    FAILED = "FAILED"


class Approach(StrEnum):
    """How the position was approached before the plunger was read."""

    EXTENDING = "EXTENDING"
    RETRACTING = "RETRACTING"


class RiggingCheck(StrEnum):
    """Whether rigging and lock roller were checked; corrected counts as a repair."""

    NO = "no"
    YES = "yes"
    CORRECTED = "corrected"


# How far local time is behind and ahead of UTC at most.
_BEHIND_UTC, _AHEAD_OF_UTC = timedelta(hours=12), timedelta(hours=14)
_DAY = timedelta(days=1)


def _span(moment: date) -> tuple[timedelta, timedelta, bool]:
    """When a moment begins and ends, in UTC if it states a zone, and whether it does."""
    begins = timedelta(days=moment.toordinal())
    if not isinstance(moment, datetime):
        return begins, begins + _DAY, False
    offset = moment.utcoffset()
    clock = timedelta(
        hours=moment.hour,
        minutes=moment.minute,
        seconds=moment.second,
        microseconds=moment.microsecond,
    )
    at = begins + clock - (offset or timedelta())
    return at, at, offset is not None


def surely_later(one: date | None, other: date | None) -> bool:
    """Whether a moment is after another, whatever is not stated: its time within the day, or the
    zone of one where the other states its own. False where either is not known.
    """
    if one is None or other is None:
        return False
    if one.__class__ is other.__class__ is date:
        return one > other
    begins, its_end, has_zone = _span(one)
    other_begins, ends, other_has_zone = _span(other)
    if has_zone and not other_has_zone:
        ends += _BEHIND_UTC
    if other_has_zone and not has_zone:
        begins -= _AHEAD_OF_UTC
    # Two days may touch, two instants may not.
    instants = begins == its_end and other_begins == ends
    return begins > ends if instants else begins >= ends


class FactKind(StrEnum):
    """What was found or done."""

    READING = "reading"
    PLUNGER = "plunger"
    FAILED = "FAILED"
    RETRACTED = "RETRACTED"
    RESTORED = "restored"
    RIGGING = "rigging"


@dataclass(frozen=True, slots=True)
class Fact:
    """One thing that was found or done at a gear.

    value_in: radial clearance of `joint`, or signed displacement of the plunger. [in]
    date: the stated day, with its time if one was stated. record: the visit that states it.
    """

    kind: FactKind
    joint: int | None
    value_in: float | None
    date: date | None
    record: str

    @property
    def words(self) -> Sentence:
        """The fact in words: ``#3 0.0130 in on 2026-01-15 (R1)``."""
        what = f"#{self.joint}" if self.kind is FactKind.READING else self.kind.value
        if self.joint is not None and self.kind is not FactKind.READING:
            what = f"{what} #{self.joint}"
        length = Length(self.value_in, sign=self.kind is FactKind.PLUNGER) if self.value_in else ""
        return Sentence.of("{} {} {}" if length else "{}{} {}", what, length, self.when)

    @property
    def when(self) -> str:
        """Its day and its visit: ``on 2026-01-15 (R1)``."""
        when = "without a date" if self.date is None else f"on {self.date.isoformat()}"
        return f"{when} ({self.record})"


@dataclass(frozen=True, slots=True)
class EnteredClearance:
    """A clearance reading exactly as it was entered, for the report.

    bound: ``<`` or ``>`` where only an end of it was found.
    """

    text: str
    unit: LengthUnit
    bound: str = ""

    def __str__(self) -> str:
        """The reading with its unit, stated once: ``.013 in``, ``13thou``, ``<0.002 in``."""
        return self.bound + with_unit(self.text, self.unit)


@dataclass(frozen=True, slots=True)
class RowSource:
    """Where an inspection came from; `row` counts from 1 with the header, no file stands for
    prompts and flags.
    """

    file: str | None = None
    sheet: str | None = None
    row: int | None = None


@dataclass(frozen=True, slots=True, repr=False, eq=False)
class Inspection(Result):
    """One valid inspection of one gear.

    Parameters
    ----------
    record_id, tail_no : str
        Identity, always text.
    side : Side
        Which gear.
    convention : ClearanceConvention
        How the clearances were taken.
    clearance_in : mapping of int to float
        Clearance by joint number; a joint that is not a key was not measured. Radial, unless it is
        still to be judged by `check`, which takes clearances without `entered` as readings in the
        convention. [in]
    entered : mapping of int to EnteredClearance
        The readings as entered.
    gauge_u_in : float
        Standard uncertainty of one radial clearance. [in]
    gauge_u_is_default : bool
        True if the record does not state the uncertainty.
    gauge_u_by_joint_in : mapping of int to float
        Standard uncertainty of one radial clearance where a joint's differs from `gauge_u_in`. [in]
    readings_in : tuple of float
        Measured plunger displacements at mid-position, over-travel positive. [in]
    plunger_gauge_u_in : float or None
        Declared repeatability of one plunger reading. [in]
    plunger_down_lock_in : float or None
        Measured plunger position at Down Lock. [in]
    margin_in : float or None
        This gear's margin as found at rigging. [in]
    margin_u_in : float
        Standard uncertainty of that margin. [in]
    outcome : Outcome or None
        What the gear did.
    inspection_date : datetime.date or None
        Day of the inspection.
    gear_landings, temperature_c, hydraulic_pressure_psi : float or None
        Landings since overhaul; temperature [°C]; pressure [psi].
    approach : Approach or None
        Approach direction before the plunger reading.
    gauge_id, technician_id : str or None
        Who measured with what.
    axial_float_in : mapping of int to float
        End float of a joint along its pin. [in]
    restored_joints : tuple of int
        Joints that were restored since the failure: their clearances are those after the repair.
    repair_date, plunger_date, outcome_date : datetime.date or None
        When they were restored, the plunger was read and the outcome was seen; a `datetime` states
        the time.
    other_repair : str or None
        What was repaired on `repair_date` other than joints and rigging.
    signed_off : str or None
        Who signed the repair off.
    rigging_checked : RiggingCheck or None
        Whether rigging and lock roller were checked, or corrected on `repair_date`.
    measured_again : tuple of int
        Joints that were measured a second time, with another gauge.
    cannot_reach, no_spare : tuple of int
        Joints that cannot be reached today, and those without a spare part.
    is_left : bool
        True if it was read as left, after another inspection of the same row and the repair of
        their day.
    small_readings_true : bool
        True if somebody confirmed that readings below the play of new parts were read in the stated
        unit.
    unit_question : str
        What must be confirmed about the unit of the readings before this gear can be cleared; empty
        if nothing.
    other_columns : mapping of str to object
        Values of columns of the table that have no field of their own, by column.
    carried : mapping of str to str
        Columns that only travel to the report: work order, manual reference, remarks, unknown
        columns.
    warnings : tuple of str
        What the reader noticed about this row, in plain words.
    source : RowSource
        Where it came from.
    """

    record_id: str
    tail_no: str
    side: Side
    convention: ClearanceConvention
    clearance_in: Mapping[int, float]
    entered: Mapping[int, EnteredClearance] = field(default_factory=dict)
    gauge_u_in: float = DEFAULT_GAUGE_U_IN
    gauge_u_is_default: bool = True
    gauge_u_by_joint_in: Mapping[int, float] = field(default_factory=dict)
    readings_in: tuple[float, ...] = ()
    plunger_gauge_u_in: float | None = None
    plunger_down_lock_in: float | None = None
    margin_in: float | None = None
    margin_u_in: float = 0.0
    outcome: Outcome | None = None
    inspection_date: date | None = None
    gear_landings: float | None = None
    temperature_c: float | None = None
    hydraulic_pressure_psi: float | None = None
    approach: Approach | None = None
    gauge_id: str | None = None
    technician_id: str | None = None
    axial_float_in: Mapping[int, float] = field(default_factory=dict)
    restored_joints: tuple[int, ...] = ()
    repair_date: date | None = None
    plunger_date: date | None = None
    outcome_date: date | None = None
    other_repair: str | None = None
    signed_off: str | None = None
    rigging_checked: RiggingCheck | None = None
    measured_again: tuple[int, ...] = ()
    cannot_reach: tuple[int, ...] = ()
    no_spare: tuple[int, ...] = ()
    is_left: bool = False
    small_readings_true: bool = False
    unit_question: str = ""
    other_columns: Mapping[str, object] = field(default_factory=dict)
    carried: Mapping[str, str] = field(default_factory=dict)
    warnings: tuple[str, ...] = ()
    source: RowSource = RowSource()

    def value(self, column: str) -> Any:
        """What a column of the table says, by the name of its field; None if nothing."""
        return (
            self.other_columns[column]
            if column in self.other_columns
            else getattr(self, column, None)
        )

    @property
    def unit_entered(self) -> LengthUnit | None:
        """The unit of most readings; None without one."""
        units = Counter(entered.unit for entered in self.entered.values())
        return units.most_common(1)[0][0] if units else None

    @property
    def is_repaired(self) -> bool:
        """Whether joints were restored, the rigging set right or something else repaired since the
        failure.
        """
        done = self.restored_joints or self.other_repair
        return bool(done) or self.rigging_checked is RiggingCheck.CORRECTED

    def is_since_repair(self, day: date | None) -> bool | None:
        """Whether what was found on a day of its own, or else in the inspection, is newer than the
        repair; None where nothing says so.

        The inspection of a row that states its repair may hold readings from before and after it:
        its day makes them newer, but never older.
        """
        at = day or self.inspection_date
        if not self.is_repaired or surely_later(at, self.repair_date):
            return True
        if self.is_left and not surely_later(self.repair_date, at):
            return True
        return False if surely_later(self.repair_date, day) else None

    @property
    def standing_readings_in(self) -> tuple[float, ...]:
        """The plunger readings that no repair is surely later than. [in]"""
        return () if self.is_since_repair(self.plunger_date) is False else self.readings_in

    @property
    def is_plunger_in_doubt(self) -> bool:
        """Whether the plunger readings may be older or newer than the repair."""
        return bool(self.readings_in) and self.is_since_repair(self.plunger_date) is None

    @property
    def standing_outcome(self) -> Outcome | None:
        """The outcome that is surely newer than a repair."""
        return self.outcome if self.is_since_repair(self.outcome_date) else None

    @property
    def facts(self) -> tuple[Fact, ...]:
        """What was found and done, as far as no repair of this inspection replaced it."""
        day = self.inspection_date
        plunger = self.plunger_date or day
        found = [
            Fact(FactKind.READING, joint, value, day, self.record_id)
            for joint, value in self.clearance_in.items()
        ]
        found += [
            Fact(FactKind.PLUNGER, None, reading, plunger, self.record_id)
            for reading in self.standing_readings_in
        ]
        if self.outcome is not None and self.is_since_repair(self.outcome_date) is not False:
            at = self.outcome_date or day
            found.append(Fact(FactKind(self.outcome.value), None, None, at, self.record_id))
        found += [
            Fact(FactKind.RESTORED, joint, None, self.repair_date, self.record_id)
            for joint in self.restored_joints
        ]
        if self.rigging_checked not in (None, RiggingCheck.NO):
            at = self.repair_date or day
            found.append(Fact(FactKind.RIGGING, None, None, at, self.record_id))
        return tuple(found)

    @property
    def says_nothing(self) -> bool:
        """Whether nothing was found or done, or may have been: no reading, outcome, repair, check
        or question.
        """
        done = self.restored_joints, self.other_repair, self.signed_off
        found = (self.clearance_in, self.readings_in, self.outcome, *done)
        is_blank = self.rigging_checked is None and self.plunger_down_lock_in is None
        return is_blank and not any(found) and not self.unit_question

    @property
    def measured_displacement_in(self) -> float | None:
        """Mean of the plunger readings that count, over-travel positive; None without one. [in]"""
        readings = self.standing_readings_in
        return sum(readings) / len(readings) if readings else None

    def gauge_u_of(self, joint: int) -> float:
        """Standard uncertainty of the radial clearance of one joint. [in]"""
        return self.gauge_u_by_joint_in.get(joint, self.gauge_u_in)


@dataclass(frozen=True, slots=True)
class InvalidRow:
    """A data row that cannot be judged, with the columns to correct; its problems stand in the list
    of problems.

    Attributes
    ----------
    understood : Inspection or None
        What could be read of it, None if nothing; what it lacks is None there.
    cells : tuple of str
        What a spreadsheet program calls what is to be corrected, as far as it has cells.
    """

    record_id: str | None
    tail_no: str | None
    side: Side | None
    correct: tuple[str, ...]
    warnings: tuple[str, ...] = ()
    source: RowSource = RowSource()
    understood: Inspection | None = None
    cells: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Fleet:
    """What is expected of a gear before anything is read on it.

    Parameters
    ----------
    loaded : float
        Chance that loads hold its pins near their worst directions. [1]
    levels : tuple of float
        Chances of the levels of wear of `belief`; empty if each is as likely. [1]
    text : str
        What was learned and from how many gears, in words; empty if nothing was.
    """

    loaded: float = PRIORS.loaded
    levels: tuple[float, ...] = ()
    text: str = ""
