"""The columns of an inspection table, by their canonical names."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

from mlg_troubleshoot.units import LengthUnit


class Kind(StrEnum):
    """What a column holds; the value is the canonical name without number and unit."""

    RECORD_ID = "record_id"
    TAIL_NO = "tail_no"
    SIDE = "side"
    CONVENTION = "clearance_convention"
    UNIT = "unit"
    JOINT = "joint"
    CLEARANCE = "clearance"
    AXIAL_FLOAT = "axial_float"
    GAUGE_U = "gauge_u"
    PLUNGER_GAUGE_U = "plunger_gauge_u"
    PLUNGER_DOWN_LOCK = "plunger_down_lock"
    ACTUATOR_EXTENSION = "actuator_extension"
    PLUNGER_POSITION = "plunger_position"
    PLUNGER_DISPLACEMENT = "plunger_displacement"
    MARGIN = "margin"
    MARGIN_U = "margin_u"
    DATE = "inspection_date"
    LANDINGS = "gear_landings"
    TEMPERATURE = "temperature_c"
    PRESSURE = "hydraulic_pressure_psi"
    APPROACH = "approach"
    GAUGE_ID = "gauge_id"
    TECHNICIAN_ID = "technician_id"
    OUTCOME = "outcome"
    SMALL_READINGS_TRUE = "small_readings_true"
    RESTORED_JOINTS = "restored_joints"
    REPAIR_DATE = "repair_date"
    PLUNGER_DATE = "plunger_date"
    OUTCOME_DATE = "outcome_date"
    RIGGING_CHECKED = "rigging_checked"
    CANNOT_REACH = "cannot_reach"
    NO_SPARE = "no_spare"
    OPEN_AREAS = "open_areas"
    MINUTES_AVAILABLE = "minutes_available"
    WORK_ORDER = "work_order"
    MANUAL_REF = "manual_ref"
    MANUAL_REV = "manual_rev"
    REMARKS = "remarks"


# Largest magnitude that can be meant, in inches; beyond it the unit or the point is wrong.
LENGTH_RANGE_IN: dict[Kind, tuple[float, float]] = {
    Kind.AXIAL_FLOAT: (0.0, 0.5),
    Kind.GAUGE_U: (0.0, 0.02),
    Kind.PLUNGER_GAUGE_U: (0.0, 0.05),
    Kind.PLUNGER_DOWN_LOCK: (-0.2, 0.2),
    Kind.ACTUATOR_EXTENSION: (0.0, 5.0),
    Kind.PLUNGER_POSITION: (-2.0, 2.0),
    Kind.MARGIN: (0.0, 0.2),
    Kind.MARGIN_U: (0.0, 0.1),
}
# The gear says how large clearances and plunger displacements can be.
LENGTHS = frozenset((*LENGTH_RANGE_IN, Kind.CLEARANCE, Kind.PLUNGER_DISPLACEMENT))
# A reading along the stroke: neither is of use without the other.
ALONG = (Kind.ACTUATOR_EXTENSION, Kind.PLUNGER_POSITION)
PER_JOINT = frozenset({Kind.CLEARANCE, Kind.AXIAL_FLOAT})
NUMBERED = PER_JOINT | {Kind.GAUGE_U, Kind.PLUNGER_DISPLACEMENT}
REQUIRED = (Kind.TAIL_NO, Kind.SIDE)
IDENTITY = (Kind.RECORD_ID, *REQUIRED)
# A mistake in one of these changes a verdict, so the whole row is not judged.
VERDICT_BEARING = frozenset(
    (
        *(
            *IDENTITY,
            Kind.CONVENTION,
            Kind.UNIT,
            Kind.JOINT,
            Kind.CLEARANCE,
            Kind.SMALL_READINGS_TRUE,
            Kind.RESTORED_JOINTS,
            Kind.RIGGING_CHECKED,
        ),
        *(
            Kind.OUTCOME,
            Kind.PLUNGER_DISPLACEMENT,
            Kind.MARGIN,
            Kind.MARGIN_U,
            Kind.GAUGE_U,
            Kind.PLUNGER_GAUGE_U,
        ),
    )
)
CARRIED = (Kind.WORK_ORDER, Kind.MANUAL_REF, Kind.MANUAL_REV, Kind.REMARKS)


@dataclass(frozen=True, slots=True)
class Field:
    kind: Kind
    number: int | None = None
    unit: LengthUnit | None = None

    @property
    def name(self) -> str:
        """Canonical name, for example ``clearance_3_mm``."""
        parts = [self.kind.value]
        if self.number is not None and not (
            self.kind is Kind.PLUNGER_DISPLACEMENT and self.number == 1
        ):
            parts.append(str(self.number))
        if self.unit is not None:
            parts.append(self.unit.value)
        return "_".join(parts)

    @property
    def label(self) -> str:
        """The label of its line in the template's form, for example ``Clearance #3`` or ``Tail
        no``.
        """
        words = self.kind.value.replace("_", " ")
        if self.kind is Kind.PLUNGER_DISPLACEMENT and self.number not in (None, 1):
            words += f" {self.number}"
        elif self.number is not None and self.kind is not Kind.PLUNGER_DISPLACEMENT:
            words += f" #{self.number}"
        return words[:1].upper() + words[1:]

    @property
    def quantity(self) -> tuple[Kind, int | None]:
        """What it is a reading of, whatever the unit: two columns of one quantity are
        duplicates.
        """
        return (self.kind, self.number)
