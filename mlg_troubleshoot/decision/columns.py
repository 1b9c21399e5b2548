"""The columns of an inspection table: all that is known of each stands in its one entry.

Readers, template, form, prompts, the gate of kept records, the store, the covariates of a
diagnosis and docs/reference/columns.md are made from this table. A new column is one entry.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from functools import cached_property

from mlg_troubleshoot.decision.inspection import Approach, Outcome, RiggingCheck, Side
from mlg_troubleshoot.units import UNIT_SPELLINGS, ClearanceConvention, LengthUnit


class Holds(StrEnum):
    """What the cells of a column hold, and so how they are read."""

    TEXT = "text"
    LENGTH = "length"
    NUMBER = "number"
    CHOICE = "choice"
    YES_NO = "yes or no"
    DATE = "date"
    MOMENT = "date and time"
    JOINTS = "joints"


class Need(StrEnum):
    """Whether a row needs a value in the column."""

    REQUIRED = "Required"
    OPTIONAL = "Optional"
    OTHERWISE = "see the meaning"


def _joined(words: tuple[str, ...]) -> str:
    return " or ".join(filter(None, (", ".join(words[:-1]), words[-1])))


@dataclass(frozen=True, kw_only=True, eq=False)
class Column:
    """One column: its name without number and unit, and everything that is known of it.

    Attributes
    ----------
    name : str
        The name.
    holds : Holds
        Kind of value.
    meaning : str
        One sentence or two; in braces its own numbers and those of the gear (`template`).
    need : Need
        Whether it must be there.
    spellings : str
        Headers as people write them, separated by ``|``.
    low, high : float
        What can be meant, no limit where the gear says it. [in, or the column's unit]
    above_zero : bool
        Zero is not a value.
    scales : bool
        Its bound is that of the radial value.
    unit : str
        Unit of a number.
    choices : type of StrEnum, optional
        The words that it takes.
    spelt : callable, optional
        Other ways to write them.
    hints : mapping of str to str
        Words that are refused, and the choice that may be meant.
    expected : str
        What a refusal asks for; made from the range where it is empty.
    fills : str, optional
        The field of an inspection.
    joint_fills : str
        The same for the columns of single joints.
    needs_joint : bool
        Its header names a joint.
    copies : int
        Columns of repeat readings in the template.
    bears_verdict : bool
        A mistake in it changes a verdict, so the row is not judged.
    carried : bool
        It travels to the report unread.
    blank_by_word : bool
        A word such as ``n/a`` says that nothing was measured.
    covariate : int
        Place among the covariates of a diagnosis, from 1; 0 for any other column.
    words : str
        What the column is about, in a sentence.
    in_template : bool
        It stands in the workbook and in its form.
    """

    name: str
    holds: Holds
    meaning: str = ""
    need: Need = Need.OPTIONAL
    spellings: str = ""
    low: float = 0.0
    high: float = math.inf
    above_zero: bool = False
    scales: bool = False
    unit: str = ""
    choices: type[StrEnum] | None = None
    spelt: Callable[[str], StrEnum | None] | None = None
    hints: Mapping[str, str] = field(default_factory=dict)
    expected: str = ""
    fills: str | None = None
    joint_fills: str = ""
    needs_joint: bool = False
    copies: int = 1
    bears_verdict: bool = False
    carried: bool = False
    blank_by_word: bool = True
    covariate: int = 0
    words: str = ""
    in_template: bool = True

    def header(self, number: int | None = None, unit: LengthUnit | None = None) -> str:
        """Canonical header, for example ``clearance_3_mm``."""
        is_first = self.copies > 1 and number == 1
        shown = None if number is None or is_first else str(number)
        return "_".join(filter(None, (self.name, shown, unit)))

    def is_above_zero(self, number: int | None) -> bool:
        """Whether zero is not a value; the gauge of a single joint is never without uncertainty."""
        return self.above_zero or (self is GAUGE_U and number is not None)

    @cached_property
    def is_length(self) -> bool:
        return self.holds is Holds.LENGTH

    @cached_property
    def is_numbered(self) -> bool:
        """Whether its header may hold a number, of a joint or of a repeat reading."""
        return bool(self.joint_fills) or self.copies > 1

    @cached_property
    def signed(self) -> bool:
        return self.low < 0.0

    @cached_property
    def plain(self) -> str:
        """The name in words, as it stands in messages."""
        return self.name.replace("_", " ")

    @cached_property
    def filled(self) -> str:
        """Name of its value in an inspection, in a kept record and in Python."""
        return self.fills or (f"{self.name}_in" if self.is_length else self.name)

    @cached_property
    def variable(self) -> str:
        """Name of the covariate in a diagnosis."""
        if self.holds is Holds.DATE:
            return "day"
        return self.name if self.needs_joint else self.filled

    @property
    def said(self) -> str:
        """What the column is about, in a sentence."""
        return self.words or self.plain

    @cached_property
    def asked(self) -> str:
        """What a refusal of a cell that is not a length asks for."""
        words = tuple(self.words_taken)
        usual = _joined(words) if words else f"{self.plain} ({self.holds})"
        if self.carried:
            usual = "text"
        if self.holds is Holds.NUMBER:
            usual = f"{self.plain} from {{low:g}} to {{high:g}} {self.unit}".rstrip()
        return (self.expected or usual).format(low=self.low, high=self.high)

    @cached_property
    def words_taken(self) -> Mapping[str, StrEnum]:
        """The choices, by their words."""
        return {choice.value: choice for choice in self.choices or ()}

    def explained(self, **numbers: str) -> str:
        """The meaning with its numbers; those of the gear are given."""
        text = self.meaning.format(low=self.low, high=self.high, **numbers)
        return text if self.need is Need.OTHERWISE else f"{self.need}. {text}"


def _convention_hints() -> dict[str, str]:
    return {
        **dict.fromkeys(("radius", "rad", "offset"), "RADIAL"),
        **dict.fromkeys(("dia", "diameter", "diametrical", "bore"), "DIAMETRAL"),
        **dict.fromkeys(("play", "total", "tir", "dial"), "TOTAL_PLAY"),
    }


RECORD_ID = Column(
    name="record_id",
    holds=Holds.TEXT,
    meaning="Your own unique name of this inspection; else made from file, row and content.",
    expected="a record id (unique text)",
    spellings=(
        "id|insp no|insp id|record|record no|record nr|record number|inspection id|inspection no"
        "|inspection number"
    ),
    bears_verdict=True,
    blank_by_word=False,
)
TAIL_NO = Column(
    name="tail_no",
    holds=Holds.TEXT,
    need=Need.REQUIRED,
    meaning="Tail number, kept as text.",
    expected="a tail number (text)",
    spellings=(
        "aircraft|aircraft no|aircraft number|aircraft reg|reg|reg no|registration no|tail"
        "|tail number|tail nr|tail #|a c|a c reg|a c registration|a c tail no|aircraft tail"
        "|aircraft tail no|aircraft registration|registration"
    ),
    words="tail",
    bears_verdict=True,
    blank_by_word=False,
    covariate=1,
)
SIDE = Column(
    name="side",
    holds=Holds.CHOICE,
    need=Need.REQUIRED,
    meaning="LH or RH; the side has no default.",
    choices=Side,
    spelt=Side.spelt,
    spellings=(
        "posn|position|gear position|gear posn|l r|gear side|lh rh|side lh rh|gear side lh rh"
    ),
    bears_verdict=True,
    blank_by_word=False,
    covariate=2,
)
CONVENTION = Column(
    name="clearance_convention",
    holds=Holds.CHOICE,
    need=Need.REQUIRED,
    meaning=" ".join(f"{c.value}: {c.meaning}." for c in ClearanceConvention),
    choices=ClearanceConvention,
    hints=_convention_hints(),
    spellings="convention|clearance type convention|convention of the clearances",
    fills="convention",
    bears_verdict=True,
    blank_by_word=False,
)
UNIT = Column(
    name="unit",
    holds=Holds.CHOICE,
    need=Need.OTHERWISE,
    meaning="Unit of every length on this sheet: in, thou or mm.",
    choices=LengthUnit,
    spelt=lambda text: UNIT_SPELLINGS.get(text.lower()),
    spellings="units|length unit|clearance unit|unit of the clearances|unit of the lengths",
    bears_verdict=True,
    blank_by_word=False,
)
JOINT = Column(
    name="joint",
    holds=Holds.TEXT,
    need=Need.OTHERWISE,
    meaning="In a long table, where one row is one reading: the joint that was read.",
    spellings="joint no|joint nr|joint number|jt|jt no|joint #",
    bears_verdict=True,
    blank_by_word=False,
    in_template=False,
)
CLEARANCE = Column(
    name="clearance",
    holds=Holds.LENGTH,
    need=Need.OTHERWISE,
    meaning=(
        "Clearance. Leave blank if it was not measured; 0 means measured and found to be zero."
    ),
    expected="a clearance",
    scales=True,
    joint_fills="clearance_in",
    needs_joint=True,
    bears_verdict=True,
)
DATE = Column(
    name="inspection_date",
    holds=Holds.DATE,
    meaning="Year-month-day, for example 2026-03-04.",
    spellings="insp date|inspected on|date inspected|date measured|date|date of inspection",
    words="date",
    covariate=9,
)
OUTCOME = Column(
    name="outcome",
    holds=Holds.CHOICE,
    meaning="What the gear did: RETRACTED or FAILED.",
    choices=Outcome,
    spellings=(
        "retraction result|retraction|retracted|gear retracted|failed"
        "|gear failed|failed to retract|did it retract|did the gear retract|failure"
        "|retraction failed|not retracted|retraction ok|retraction outcome|retraction test"
        "|gear result"
    ),
    bears_verdict=True,
)
LANDINGS = Column(
    name="gear_landings",
    holds=Holds.NUMBER,
    meaning="Landings since overhaul, 0 or more.",
    high=1_000_000,
    unit="landings",
    expected="landings since overhaul, {low:g} or more",
    spellings=(
        "ldgs|landings since o h|landings|landings since overhaul|gear landings since overhaul"
    ),
    words="landings since overhaul",
    covariate=8,
)
GAUGE_U = Column(
    name="gauge_u",
    holds=Holds.LENGTH,
    meaning="Standard uncertainty of one reading, as read. Blank: {gauge_u} radial is assumed.",
    high=0.02,
    scales=True,
    joint_fills="gauge_u_by_joint_in",
    words="standard uncertainty of the gauge",
    spellings="gauge uncertainty|standard uncertainty of one reading",
    bears_verdict=True,
)
PLUNGER_DISPLACEMENT = Column(
    name="plunger_displacement",
    holds=Holds.LENGTH,
    meaning=(
        "Measured change of the plunger position at mid-position, over-travel positive,"
        " under-travel negative. Repeat readings have their own columns."
    ),
    low=-math.inf,
    fills="readings_in",
    copies=3,
    spellings=(
        "plunger displacement at mid position|measured plunger displacement|plunger"
        "|plunger reading|measured plunger|plunger measured|plunger travel|plunger offset"
        "|plunger disp"
    ),
    bears_verdict=True,
)
MARGIN = Column(
    name="margin",
    holds=Holds.LENGTH,
    meaning="This gear's margin as found at rigging. Blank: {margin}.",
    high=0.2,
    above_zero=True,
    spellings="plunger margin|margin found at rigging|margin as found at rigging",
    bears_verdict=True,
    blank_by_word=False,
)
MARGIN_U = Column(
    name="margin_u",
    holds=Holds.LENGTH,
    meaning="Standard uncertainty of that margin. Blank: 0.",
    high=0.1,
    spellings="margin uncertainty|standard uncertainty of the margin",
    bears_verdict=True,
    blank_by_word=False,
)
SMALL_READINGS_TRUE = Column(
    name="small_readings_true",
    holds=Holds.YES_NO,
    meaning="Yes: readings below the play of new parts were checked, and their unit is right.",
    bears_verdict=True,
    blank_by_word=False,
    in_template=False,
)
TEMPERATURE = Column(
    name="temperature_c",
    holds=Holds.NUMBER,
    meaning="Temperature in degrees Celsius, {low:g} to {high:g}.",
    low=-60,
    high=60,
    unit="°C",
    expected="a temperature from {low:g} to {high:g} degrees Celsius",
    spellings="temp c",
    words="temperature",
    covariate=6,
)
PRESSURE = Column(
    name="hydraulic_pressure_psi",
    holds=Holds.NUMBER,
    meaning="Hydraulic pressure in psi, {low:g} to {high:g}.",
    high=4000,
    unit="psi",
    expected="a pressure from {low:g} to {high:g} psi",
    spellings="pressure psi",
    words="hydraulic pressure",
    covariate=7,
)
APPROACH = Column(
    name="approach",
    holds=Holds.CHOICE,
    meaning="How the position was approached before the reading: EXTENDING or RETRACTING.",
    choices=Approach,
    hints={
        **dict.fromkeys(("extend", "ext"), "EXTENDING"),
        **dict.fromkeys(("retract", "ret"), "RETRACTING"),
    },
    spellings="approach direction",
    covariate=5,
)
GAUGE_ID = Column(
    name="gauge_id",
    holds=Holds.TEXT,
    meaning="The gauge set that was used.",
    expected="a gauge id (text)",
    spellings="gauge id no|gauge s n|gauge|gauge no|gauge number|gauge set",
    words="gauge",
    blank_by_word=False,
    covariate=3,
)
TECHNICIAN_ID = Column(
    name="technician_id",
    holds=Holds.TEXT,
    meaning="Who measured.",
    expected="a technician id (text)",
    spellings=(
        "tech|mechanic|inspector|inspected by|technician|technician no|technician number"
        "|measured by"
    ),
    words="technician",
    blank_by_word=False,
    covariate=4,
)
WORK_ORDER = Column(
    name="work_order",
    holds=Holds.TEXT,
    meaning="Goes to the report unchanged.",
    spellings="wo|work order no|work order number|w o",
    carried=True,
    blank_by_word=False,
)
REMARKS = Column(
    name="remarks",
    holds=Holds.TEXT,
    meaning="Goes to the report unchanged.",
    spellings="remark|comment|comments|notes",
    carried=True,
    blank_by_word=False,
)
AXIAL_FLOAT = Column(
    name="axial_float",
    holds=Holds.LENGTH,
    meaning="End float of the joint along its pin.",
    high=0.5,
    joint_fills="axial_float_in",
    needs_joint=True,
    words="end float",
)

# What was repaired, and what the day allows.
RESTORED_JOINTS = Column(
    name="restored_joints",
    holds=Holds.JOINTS,
    meaning=(
        "Joints restored since the failure, for example 3 5. Their clearances in this row are those"
        " after the repair; outcome and plunger reading count where the repair is not surely later."
    ),
    bears_verdict=True,
)
MEASURED_AGAIN = Column(
    name="measured_again",
    holds=Holds.JOINTS,
    meaning="Joints that were measured a second time, with another gauge, for example 3.",
)
RIGGING_CHECKED = Column(
    name="rigging_checked",
    holds=Holds.CHOICE,
    meaning="Rigging and lock roller: no, yes (checked) or corrected.",
    choices=RiggingCheck,
    spelt=lambda text: {"y": RiggingCheck.YES, "n": RiggingCheck.NO}.get(text.lower()),
    bears_verdict=True,
    blank_by_word=False,
)
OTHER_REPAIR = Column(
    name="other_repair",
    holds=Holds.TEXT,
    meaning="What was repaired other than joints and rigging, for example the selector valve.",
    bears_verdict=True,
    blank_by_word=False,
    in_template=False,
)
SIGNED_OFF = Column(
    name="signed_off",
    holds=Holds.TEXT,
    meaning="Who signed the repair off in the aircraft's records.",
    blank_by_word=False,
    in_template=False,
)
OF_THE_DAY: tuple[Column, ...] = (
    RESTORED_JOINTS,
    Column(
        name="repair_date",
        holds=Holds.MOMENT,
        meaning="When they were restored: year-month-day, with the time if known.",
    ),
    Column(
        name="plunger_date",
        holds=Holds.MOMENT,
        meaning="When the plunger was read, if that was after the repair.",
    ),
    Column(
        name="outcome_date",
        holds=Holds.MOMENT,
        meaning="When the outcome was seen, if that was after the repair.",
    ),
    RIGGING_CHECKED,
    MEASURED_AGAIN,
    Column(
        name="cannot_reach",
        holds=Holds.JOINTS,
        meaning="Joints that cannot be reached today, for example 4.",
    ),
    Column(
        name="no_spare",
        holds=Holds.JOINTS,
        meaning="Joints without a spare part today.",
    ),
)

# In the order of the template.
COLUMNS: tuple[Column, ...] = (
    RECORD_ID,
    TAIL_NO,
    SIDE,
    CONVENTION,
    UNIT,
    JOINT,
    CLEARANCE,
    DATE,
    OUTCOME,
    LANDINGS,
    GAUGE_U,
    PLUNGER_DISPLACEMENT,
    Column(
        name="plunger_down_lock",
        holds=Holds.LENGTH,
        meaning="Measured plunger position at Down Lock; {down_lock} is allowed.",
        low=-0.2,
        high=0.2,
        spellings="plunger at down lock|plunger position at down lock",
    ),
    Column(
        name="plunger_gauge_u",
        holds=Holds.LENGTH,
        meaning="Repeatability of one plunger reading.",
        high=0.05,
        spellings="plunger gauge uncertainty|repeatability of the plunger reading",
        bears_verdict=True,
    ),
    MARGIN,
    MARGIN_U,
    SMALL_READINGS_TRUE,
    TEMPERATURE,
    PRESSURE,
    APPROACH,
    GAUGE_ID,
    TECHNICIAN_ID,
    WORK_ORDER,
    Column(
        name="manual_ref",
        holds=Holds.TEXT,
        meaning="Manual reference; goes to the report unchanged.",
        spellings="manual reference",
        carried=True,
        blank_by_word=False,
    ),
    Column(
        name="manual_rev",
        holds=Holds.TEXT,
        meaning="Manual revision; goes to the report unchanged.",
        spellings="manual revision",
        carried=True,
        blank_by_word=False,
    ),
    REMARKS,
    *OF_THE_DAY,
    OTHER_REPAIR,
    SIGNED_OFF,
    AXIAL_FLOAT,
)
BY_NAME: Mapping[str, Column] = {column.name: column for column in COLUMNS}
COVARIATES: tuple[Column, ...] = tuple(
    sorted((column for column in COLUMNS if column.covariate), key=lambda c: c.covariate)
)
IDENTITY = (RECORD_ID, TAIL_NO, SIDE)
