"""Gear files: a gear type as TOML, with a source for every number. A gear file is data: nothing in
it is run.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from copy import deepcopy
from functools import lru_cache
from importlib.resources import files
from pathlib import Path
from typing import Annotated, Any, Literal

import msgspec
import numpy as np
from msgspec import Meta

from mlg_troubleshoot.datafile import (
    DataFile,
    Name,
    Number,
    Pair,
    RefusedValueError,
    Sibling,
    Table,
    decode,
    read_toml,
    walk,
)
from mlg_troubleshoot.errors import GearFileError, UsageError
from mlg_troubleshoot.gear import DEFAULT_GEAR
from mlg_troubleshoot.gear.gear import (
    Area,
    Discrepancies,
    Gear,
    JointSpec,
    Linkage,
    RetractionCycle,
    Source,
    Sourced,
    SourceKind,
)
from mlg_troubleshoot.gear.model import Calibration
from mlg_troubleshoot.geometry.mechanism import (
    Crank,
    Dyad,
    Guided,
    Lever,
    Mechanism,
    Output,
    Plane,
    Point,
    Slider,
    Slot,
    Step,
)
from mlg_troubleshoot.geometry.program import write_program

_DATA = Path(str(files("mlg_troubleshoot.gear"))) / "data"
# What a gear file need not state and what is assumed for it, by the names of a gear: its table and
# key, the number and its unit.
_ASSUMED = {
    "plunger_reading": ("plunger", "read_min", 12.0, "min"),
    "rigging_check": ("rigging_check", "minutes", 30.0, "min"),
    "retraction": ("repair", "retraction_min", 15.0, "min"),
    "second_repair_chance": ("repair", "second_repair_chance", 0.02, "1"),
    "horizon": ("forecast", "horizon_landings", 20_000.0, "landings"),
    "accepted_chance": ("forecast", "accepted_chance", 0.05, "1"),
}
_RESTORE_MIN = 120.0

# Nothing of a landing gear is longer, and no angle needs more than two turns; far beyond, formulas
# overflow.
Coordinate = Annotated[float, Meta(ge=-10_000, le=10_000)]
Length = Annotated[float, Meta(gt=0, le=10_000)]
Angle = Annotated[float, Meta(ge=-720, le=720)]
Minutes = Annotated[float, Meta(gt=0, le=100_000)]
LinkNumber = Annotated[int, Meta(ge=1, le=999)]


def _need_source(table: Table, key: str, *numbers: float | None) -> None:
    if getattr(table, key) is None and any(number is not None for number in numbers):
        raise RefusedValueError(key, "a text")


class InputTable(Table):
    """The input of a linkage, in inches or radians."""

    name: str
    range: tuple[Coordinate, Coordinate]
    reference: Coordinate
    source: str

    def __post_init__(self) -> None:
        if self.range[0] == self.range[1]:
            raise RefusedValueError("range", "two different numbers")


class PlaneTable(Table):
    """A plane; one with a parent is hinged to it."""

    name: Name
    parent: Name | None = None
    hinge_point: Name | None = None
    hinge_direction_deg: Angle | None = None
    dihedral_deg: Angle | None = None
    source: str | None = None

    def __post_init__(self) -> None:
        for key, expected in (
            ("hinge_point", "the name of a point"),
            ("hinge_direction_deg", "a number"),
            ("dihedral_deg", "a number"),
            ("source", "a text"),
        ):
            if (getattr(self, key) is None) != (self.parent is None):
                raise RefusedValueError(key, expected if self.parent else "it with a parent only")

    def plane(self) -> Plane:
        direction = self.hinge_direction_deg or 0.0
        dihedral = self.dihedral_deg or 0.0
        turned = float(np.radians(direction)), float(np.radians(dihedral))
        return Plane(self.name, self.parent, self.hinge_point or "", *turned)


class PointTable(Table):
    """A point of a linkage, in inches."""

    name: Name
    plane: Name
    at: tuple[Coordinate, Coordinate]
    source: str
    fixed: bool = False
    virtual_link: LinkNumber | None = None


class StepTable(Table, tag_field="type"):
    """How a joint is located; virtual_links: those of the joints at both ends."""

    joint: Name
    source: str
    virtual_links: tuple[LinkNumber, ...] = ()


class CrankTable(StepTable, tag="crank", kw_only=True):
    pivot: Name


class LeverTable(StepTable, tag="lever", kw_only=True):
    pivot: Name
    follows: Name


class SlotTable(StepTable, tag="slot", kw_only=True):
    pivot: Name
    pin: Name


class SignedTable(StepTable, kw_only=True):
    """A step with two solutions, of which the sign takes one."""

    upstream: Name
    sign: Number

    def __post_init__(self) -> None:
        if self.sign not in (1.0, -1.0):
            raise RefusedValueError("sign", "+1 or -1")


class DyadTable(SignedTable, tag="dyad", kw_only=True):
    downstream: Name
    driven: bool = False


class SliderTable(SignedTable, tag="slider", kw_only=True):
    axis_deg: Angle


class GuideTable(StepTable, tag="guide", kw_only=True):
    upstream: Name
    line: tuple[Name, Name | Angle]
    across: Name | Angle | None = None
    driven: bool = False

    def __post_init__(self) -> None:
        if self.driven and self.across is not None:
            raise RefusedValueError("across", "no second line of a driven point")


class OutputTable(Table):
    """What a linkage is for."""

    kind: Literal["position", "angle"]
    joint: Name
    pivot: Name | None = None


class CalibrationTable(Table):
    """The plunger at Down Lock and its travel, in inches."""

    down_lock: Coordinate
    travel: Length
    down_lock_range: tuple[Coordinate, Coordinate]
    source: str

    def __post_init__(self) -> None:
        if self.down_lock_range[0] > self.down_lock_range[1]:
            raise RefusedValueError("down_lock_range", "two numbers, the smaller one first")


class GeometryTable(Table):
    """What the hash of a geometry is made of."""

    input: InputTable
    planes: tuple[PlaneTable, ...]
    points: tuple[PointTable, ...]
    steps: tuple[CrankTable | DyadTable | LeverTable | SlotTable | SliderTable | GuideTable, ...]
    output: OutputTable
    calibration: CalibrationTable | None = None


class LengthTable(Table):
    """One length with its source, in inches."""

    value: Length
    source: str


class EntryTable(Table):
    """Radial clearances that no reading may exceed, and above which it is asked again."""

    hard_limit: Length
    confirm_above: Length
    source: str


class WorkshopTable(Table):
    """What a workshop decides, and need not state; a number that is stated has a source."""

    def __post_init__(self) -> None:
        numbers = (name for name in self.__struct_fields__ if name != "source")
        _need_source(self, "source", *(getattr(self, name) for name in numbers))


class PlungerTable(WorkshopTable):
    """How long it takes to read the plunger."""

    read_min: Minutes | None = None
    source: str | None = None


class RiggingCheckTable(WorkshopTable):
    """How long it takes to check rigging and lock roller."""

    minutes: Minutes | None = None
    source: str | None = None


class RepairTable(WorkshopTable):
    """Which chance of a second repair is accepted, and how long a trial retraction takes."""

    second_repair_chance: Annotated[float, Meta(gt=0, le=0.5)] | None = None
    retraction_min: Minutes | None = None
    source: str | None = None


class ForecastTable(WorkshopTable):
    """How far forecasts look ahead, and which chance is accepted."""

    horizon_landings: Annotated[float, Meta(gt=0, le=1e6)] | None = None
    accepted_chance: Annotated[float, Meta(gt=0, le=0.5)] | None = None
    source: str | None = None


class JointTable(Table):
    """A joint; lengths are radial, in inches, times in minutes."""

    number: LinkNumber
    name: Name
    location: str
    limit: Length
    limit_source: str
    new_part: Annotated[float, Meta(ge=0, le=1e4)]
    new_part_source: str
    access_min: Minutes
    access_source: str
    area: Name
    restore_min: Minutes | None = None
    restore_source: str | None = None
    point: Name | None = None
    critical: bool = False

    def __post_init__(self) -> None:
        _need_source(self, "restore_source", self.restore_min)


class AreaTable(Table):
    """An area that is opened once for all joints in it."""

    name: Name
    description: str
    access_min: Annotated[float, Meta(ge=0, le=1e5)]
    source: str


class DiscrepancyTable(Discrepancies, kw_only=True):
    """Where a diagnosis may change the model, with the source of that."""

    source: str


class GearFile(GeometryTable, kw_only=True):
    """A gear file: numbers name their source by its key in ``sources``."""

    schema: Literal[1]
    id: Name
    name: Name
    provenance: str
    sources: dict[Name, Source]
    margin: LengthTable
    bearing_span: LengthTable
    entry: EntryTable
    joints: tuple[JointTable, ...]
    areas: tuple[AreaTable, ...]
    ensemble: Sibling | None = None
    indices: Sibling | None = None
    plunger: PlungerTable = PlungerTable()
    rigging_check: RiggingCheckTable = RiggingCheckTable()
    repair: RepairTable = RepairTable()
    forecast: ForecastTable = ForecastTable()
    diagnosis: DiscrepancyTable | None = None
    cycle: RetractionCycle | None = None


class MemberTable(Table):
    """A linkage of the ensemble, by the numbers in which it differs from the gear file."""

    range: Pair
    reference: Number
    points: dict[Name, Pair]
    steps: dict[Name, dict[Name, Number]]
    planes: dict[Name, dict[Name, Number]] = msgspec.field(default_factory=dict)


class EnsembleFile(Table):
    """Further linkages that reproduce the published numbers."""

    source: str
    members: dict[Name, MemberTable]


_GEOMETRY_KEYS = ("input", "planes", "points", "steps", "output", "calibration")
_STEPS: dict[type[StepTable], type[Step]] = {
    CrankTable: Crank,
    DyadTable: Dyad,
    LeverTable: Lever,
    SlotTable: Slot,
    SliderTable: Slider,
    GuideTable: Guided,
}


def shipped_gears() -> tuple[str, ...]:
    """Return the names of the gears that ship with the program, the default one first, for
    :func:`load_gear`.
    """
    names = {p.stem for p in _DATA.glob("*.toml")}
    gears = (n for n in names if not n.endswith(("-ensemble", "-targets")))
    return tuple(sorted(gears, key=lambda name: (name != DEFAULT_GEAR, name)))


def load_gear(name_or_path: str | Path | Gear = DEFAULT_GEAR) -> Gear:
    """Load a gear by its shipped name or from a gear file; a file is read anew each time.

    Parameters
    ----------
    name_or_path : str, Path or Gear
        ``hawker-800xp``, or the path of a TOML file; a gear is returned as it is.

    Returns
    -------
    Gear
        The gear, checked and assembled.

    Raises
    ------
    UsageError
        If the gear is not known.
    GearFileError
        If the file is not valid; the message names the place.
    MechanismError
        If the linkage cannot be assembled.
    """
    if isinstance(name_or_path, Gear):
        return name_or_path
    text = str(name_or_path)
    if text in shipped_gears():
        return _shipped(text)
    path = Path(text)
    if not path.exists():
        raise UsageError(
            f"there is no gear {text!r}",
            f"Give one of {', '.join(shipped_gears())}, or the path of a gear file.",
        )
    return _read(path)


@lru_cache(maxsize=8)
def _shipped(name: str) -> Gear:
    return _read(_DATA / f"{name}.toml")


def _read(path: Path) -> Gear:
    file = read_toml(path, GearFile)
    _check_sources(file)
    found = file.content
    numbers = _Numbers(found.sources)
    _add_numbers(found, numbers)
    surely = {SourceKind.MEASURED, SourceKind.TECHNICAL_ORDER}
    linkage_known = {number.kind for number in numbers.found} <= surely
    reference = linkage_of(found, "A")
    members: dict[str, dict[str, Any]] = {}
    ensemble_path = path
    if found.ensemble is not None:
        ensemble_path = path.with_name(found.ensemble)
        members = _members(file.values, ensemble_path)
    calibration, down_lock_range = _calibration(found.calibration, numbers)
    entry = found.entry
    indices_file = path.with_name(found.indices or f"{path.stem}-indices.json")
    gear = Gear(
        id=found.id,
        name=found.name,
        provenance=found.provenance,
        reference=reference,
        ensemble=(
            reference,
            *(
                linkage_of(decode(ensemble_path, member, GeometryTable), name)
                for name, member in members.items()
            ),
        ),
        joints=tuple(_joint(joint, numbers) for joint in found.joints),
        areas=tuple(
            Area(a.name, a.description, numbers.add(a.access_min, "min", a.source))
            for a in found.areas
        ),
        **_of_the_workshop(found, numbers),
        calibration=calibration,
        margin=numbers.add(found.margin.value, "in", found.margin.source),
        bearing_span=numbers.add(found.bearing_span.value, "in", found.bearing_span.source),
        hard_limit=numbers.add(entry.hard_limit, "in", entry.source),
        confirm_above=numbers.add(entry.confirm_above, "in", entry.source),
        down_lock_range=down_lock_range,
        discrepancies=_discrepancies(file, reference.mechanism),
        cycle=found.cycle,
        numbers=tuple(numbers.found),
        linkage_known=linkage_known,
        geometry_sha256=_sha256({k: file.values.get(k) for k in _GEOMETRY_KEYS}),
        ensemble_sha256=_sha256(members),
        path=path,
        indices_file=indices_file,
        files=tuple(
            dict.fromkeys(
                (path, ensemble_path, indices_file, path.with_name(f"{path.stem}-targets.toml"))
            )
        ),
    )
    _check_joints(gear, path)
    return gear


def _of_the_workshop(found: GearFile, numbers: _Numbers) -> dict[str, Sourced]:
    """What a workshop decides, by the names of a gear; what the file does not state is assumed."""
    read = {name: (getattr(found, table), *rest) for name, (table, *rest) in _ASSUMED.items()}
    return {
        name: numbers.or_assumed(getattr(table, key), table.source, assumed, unit)
        for name, (table, key, assumed, unit) in read.items()
    }


def _sha256(value: Any) -> str:
    return hashlib.sha256(json.dumps(value, sort_keys=True).encode()).hexdigest()


def _check_sources(file: DataFile[GearFile]) -> None:
    """Refuse a source that is not described; that of the cycle stands in words."""
    known = file.content.sources
    for place, value in walk(file.values):
        names_one = str(place[-1:]).endswith("source',)") and place[0] != "cycle"
        if names_one and value not in known:
            raise file.fail(place, f"one of the sources {', '.join(known)}")


class _Numbers:
    """Gathers numbers with their sources."""

    def __init__(self, sources: dict[str, Source]) -> None:
        self.sources = sources
        self.found: list[Sourced] = []

    def add(self, value: float, unit: str, source: str | Source) -> Sourced:
        known = source if isinstance(source, Source) else self.sources[source]
        number = Sourced(float(value), unit, known.kind, known.text)
        self.found.append(number)
        return number

    def or_assumed(
        self, value: float | None, source: str | None, assumed: float, unit: str
    ) -> Sourced:
        """Add a number that a gear file need not state: it is then assumed, and says so."""
        if value is not None and source is not None:
            return self.add(value, unit, source)
        shown = f"{assumed:g}{'' if unit == '1' else f' {unit}'}"
        text = f"Not stated in the gear file: {shown} is assumed by the authors of this tool."
        return self.add(assumed, unit, Source(kind=SourceKind.ASSUMED, text=text))


def _add_numbers(table: GeometryTable, numbers: _Numbers) -> None:
    """Add the numbers of a linkage with their sources."""
    for value in (*table.input.range, table.input.reference):
        numbers.add(value, "in", table.input.source)
    for plane in table.planes:
        for angle in (plane.hinge_direction_deg, plane.dihedral_deg):
            if angle is not None and plane.source is not None:
                numbers.add(angle, "deg", plane.source)
    for point in table.points:
        for value in point.at:
            numbers.add(value, "in", point.source)
    for step in table.steps:
        if isinstance(step, SliderTable):
            numbers.add(step.axis_deg, "deg", step.source)
        if isinstance(step, GuideTable):
            for to in (step.line[1], step.across):
                if isinstance(to, float):
                    numbers.add(to, "deg", step.source)


def linkage_of(table: GeometryTable, name: str) -> Linkage:
    """The linkage that the tables of a gear file describe."""
    drive = table.input
    points = (
        Point(each.name, each.plane, *each.at, each.fixed, each.virtual_link)
        for each in table.points
    )
    read = table.output
    mechanism = Mechanism(
        tuple(plane.plane() for plane in table.planes),
        tuple(points),
        tuple(map(_step, table.steps)),
        Output(read.kind, read.joint, read.pivot or ""),
        drive.reference,
    )
    return Linkage(name, mechanism, drive.range)


def _step(table: StepTable) -> Step:
    values = msgspec.structs.asdict(table)
    del values["source"]
    if isinstance(table, SliderTable):
        values["axis"] = float(np.radians(values.pop("axis_deg")))
    if isinstance(table, GuideTable):
        start, to = table.line
        values.update(line=(start, _towards(to)), across=_towards(table.across))
    return _STEPS[type(table)](**values)


def _towards(to: str | float | None) -> Any:
    """A point that a line leads to, or its direction. [rad]"""
    return float(np.radians(to)) if isinstance(to, float) else to


def _members(raw: dict[str, Any], path: Path) -> dict[str, dict[str, Any]]:
    """Each member of the ensemble as a full description: the reference with its own numbers in
    place.
    """
    file = read_toml(path, EnsembleFile)
    full = {}
    for name, member in file.content.members.items():
        geometry = {key: raw.get(key) for key in _GEOMETRY_KEYS}
        new: dict[str, Any] = deepcopy(geometry)
        new["input"].update(range=list(member.range), reference=member.reference)
        changes: dict[str, Mapping[str, Mapping[str, object]]] = {
            "points": {point: {"at": list(at)} for point, at in member.points.items()},
            "planes": member.planes,
            "steps": member.steps,
        }
        for part, of_names in changes.items():
            key = "joint" if part == "steps" else "name"
            entries = {entry.get(key): entry for entry in new[part]}
            for name_of, change in of_names.items():
                if name_of not in entries:
                    place = ("members", name, part, name_of)
                    raise file.fail(place, f"a {key} of the gear file")
                entries[name_of].update(change)
        full[name] = new
    return full


def _calibration(
    table: CalibrationTable | None, numbers: _Numbers
) -> tuple[Calibration, tuple[float, float]]:
    if table is None:
        return Calibration(), (-np.inf, np.inf)
    for value in (table.down_lock, table.travel, *table.down_lock_range):
        numbers.add(value, "in", table.source)
    return Calibration(table.down_lock, table.travel), table.down_lock_range


def _joint(table: JointTable, numbers: _Numbers) -> JointSpec:
    return JointSpec(
        number=table.number,
        point=table.point or str(table.number),
        name=table.name,
        location=table.location,
        limit=numbers.add(table.limit, "in", table.limit_source),
        new_part=numbers.add(table.new_part, "in", table.new_part_source),
        access=numbers.add(table.access_min, "min", table.access_source),
        restore=numbers.or_assumed(table.restore_min, table.restore_source, _RESTORE_MIN, "min"),
        area=table.area,
        critical=table.critical,
    )


def _discrepancies(file: DataFile[GearFile], mechanism: Mechanism) -> Discrepancies:
    found = file.content.diagnosis
    if found is None:
        return Discrepancies()
    known = write_program(mechanism).parameters
    for name in (*found.elastic, *(t.length for t in found.tilt), found.wear_shift or ""):
        if name and name not in known:
            place = ("diagnosis", "elastic, tilt or wear_shift")
            raise file.fail(place, f"a number of the linkage instead of {name!r}")
    return found


def _check_joints(gear: Gear, path: Path) -> None:
    links = gear.reference.mechanism.virtual_links
    if tuple(sorted(gear.joint_numbers)) != links or gear.joint_numbers != links:
        raise GearFileError(
            f"{path.name}: joints {list(gear.joint_numbers)} and virtual links {list(links)}"
            " differ",
            "Describe each virtual link of the steps as one joint, in ascending order.",
        )
    areas = {area.name for area in gear.areas}
    points = {point.name for point in gear.reference.mechanism.points}
    for joint in gear.joints:
        if joint.point not in points:
            raise GearFileError(
                f"{path.name}: joint {joint.number} is at point {joint.point!r}, which has no"
                " coordinates",
                "Name one of the points of the linkage.",
            )
        if joint.area not in areas:
            raise GearFileError(
                f"{path.name}: joint {joint.number} lies in area {joint.area!r}, which is not"
                " described",
                f"Use one of {', '.join(sorted(areas))}, or add the area.",
            )
