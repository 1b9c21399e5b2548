"""What may stand in a gear file: points, links, what drives them, joints, and a source for every
number.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal

import msgspec
import numpy as np
from msgspec import Meta

from mlg_troubleshoot.datafile import JsonSibling, Name, RefusedValueError, Sibling, Table
from mlg_troubleshoot.gear.gear import Discrepancies, RetractionCycle, Source

# Nothing of a landing gear is longer, and no angle needs more than two turns; far beyond, formulas
# overflow.
Coordinate = Annotated[float, Meta(ge=-10_000, le=10_000)]
Length = Annotated[float, Meta(gt=0, le=10_000)]
Angle = Annotated[float, Meta(ge=-720, le=720)]
Minutes = Annotated[float, Meta(gt=0, le=100_000)]
Chance = Annotated[float, Meta(gt=0, le=0.5)]
Place = tuple[Coordinate, Coordinate]
Places = dict[Name, Place]
Ends = Annotated[tuple[Name, ...], Meta(min_length=2)]
# A line that moves: the point where it starts, and the one that it leads to or its direction. [deg]
MovingLine = tuple[Name, Name | Angle]


class SourcedTable(Table, kw_only=True):
    """A table whose numbers come from its source, if it names none from that of the file; what
    comes from elsewhere stands in ``source_of``.
    """

    source: Name | None = None
    source_of: dict[Name, Name] = msgspec.field(default_factory=dict)

    def __post_init__(self) -> None:
        points = {*getattr(self, "ground", ()), *getattr(self, "moving", ())}
        if not self.source_of.keys() <= {*self.__struct_fields__, *points}:
            raise RefusedValueError("source_of", "the keys of numbers that stand here")


class PlaneTable(SourcedTable, kw_only=True):
    """A plane hinged to another one, to the base plane if none is named, and its points."""

    hinge_point: Name
    hinge_direction_deg: Angle
    dihedral_deg: Angle
    parent: Name | None = None
    ground: Places = msgspec.field(default_factory=dict)
    moving: Places = msgspec.field(default_factory=dict)


class InputTable(SourcedTable, kw_only=True):
    """What moves the linkage from start to end, where clearances act: a crank by an angle in
    degrees, or an actuator by a length in inches. Points are given at the input ``drawn_at``.
    """

    travel: Place
    drawn_at: Coordinate = 0.0
    crank: Name | None = None
    actuator: Name | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        if (self.crank is None) == (self.actuator is None):
            raise RefusedValueError("crank", "the name of a link here or in actuator, not in both")
        if self.travel[0] == self.travel[1]:
            raise RefusedValueError("travel", "two different numbers")

    def in_units(self, value: float) -> float:
        """An input of the file as the mechanism takes it. [in or rad]"""
        return float(np.radians(value)) if self.crank else value


class OutputTable(Table):
    """What the linkage is for: the angle of a link, or the position of a point on its guide."""

    angle_of: Name | None = None
    position_of: Name | None = None

    def __post_init__(self) -> None:
        if (self.angle_of is None) == (self.position_of is None):
            raise RefusedValueError("angle_of", "a link here or a point in position_of, not both")


class CalibrationTable(SourcedTable, kw_only=True):
    """The plunger at Down Lock and its travel, in inches."""

    down_lock: Coordinate
    travel: Length
    down_lock_range: Place

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.down_lock_range[0] > self.down_lock_range[1]:
            raise RefusedValueError("down_lock_range", "two numbers, the smaller one first")


class JointTable(SourcedTable, kw_only=True):
    """A point with clearance; lengths are radial, in inches, times in minutes."""

    limit: Length
    name: Name | None = None
    location: str | None = None
    new_part: Annotated[float, Meta(ge=0, le=1e4)] | None = None
    area: Name | None = None
    access_min: Minutes | None = None
    restore_min: Minutes | None = None
    critical: bool = False


class AreaTable(SourcedTable, kw_only=True):
    """An area that is opened once for all joints in it."""

    description: str
    access_min: Annotated[float, Meta(ge=0, le=1e5)]


class WorkshopTable(SourcedTable, kw_only=True):
    """What a workshop decides, and need not state."""

    read_plunger_min: Minutes | None = None
    check_rigging_min: Minutes | None = None
    trial_retraction_min: Minutes | None = None
    second_repair_chance: Chance | None = None
    horizon_landings: Annotated[float, Meta(gt=0, le=1e6)] | None = None
    accepted_chance: Chance | None = None


class HowTable(SourcedTable, kw_only=True):
    """How each action is done: where, with what, from which datum, which way is plus, what is
    safe; one instruction per text.
    """

    read_plunger: tuple[str, ...] = ()
    check_rigging: tuple[str, ...] = ()
    trial_retraction: tuple[str, ...] = ()
    measure: tuple[str, ...] = ()
    restore: tuple[str, ...] = ()


class GearFile(SourcedTable, kw_only=True):
    """A gear file: a linkage in one position, in inches, its joints, and where numbers come from.

    The base plane holds ``ground`` and ``moving``. Numbers name their source by its key.
    """

    schema: Literal[2]
    name: Name
    source: Name
    sources: dict[Name, Source]
    ground: Places
    moving: Places
    links: dict[Name, Ends]
    input: InputTable
    output: OutputTable
    joints: dict[Name, JointTable]
    margin: Length
    id: Name | None = None
    provenance: str | None = None
    plane: Name = "base"
    planes: dict[Name, PlaneTable] = msgspec.field(default_factory=dict)
    guides_deg: dict[Name, Angle] = msgspec.field(default_factory=dict)
    guides: dict[Name, tuple[MovingLine, ...]] = msgspec.field(default_factory=dict)
    slots: dict[Name, Name] = msgspec.field(default_factory=dict)
    calibration: CalibrationTable | None = None
    bearing_span: Length | None = None
    hard_limit: Length | None = None
    confirm_above: Length | None = None
    areas: dict[Name, AreaTable] = msgspec.field(default_factory=dict)
    workshop: WorkshopTable = msgspec.field(default_factory=WorkshopTable)
    how: HowTable = msgspec.field(default_factory=HowTable)
    diagnosis: Discrepancies = msgspec.field(default_factory=Discrepancies)
    cycle: RetractionCycle | None = None
    ensemble: Sibling | None = None
    indices: JsonSibling | None = None

    @property
    def in_planes(self) -> dict[str, PlaneTable | GearFile]:
        """What holds the points of each plane, the base plane first."""
        return {self.plane: self, **self.planes}


class EnsembleFile(Table):
    """Further linkages that reproduce the published numbers, each by the values of the gear file
    that differ.
    """

    source: str
    members: dict[Name, dict[str, Any]]
