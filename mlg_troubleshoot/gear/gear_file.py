"""Gear files: a gear type as TOML, with a source for every number. A gear file is data: nothing in
it is run.
"""

from __future__ import annotations

import hashlib
import json
from copy import deepcopy
from functools import lru_cache
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np

from mlg_troubleshoot.datafile import DataTable, read_toml
from mlg_troubleshoot.errors import GearFileError, UsageError
from mlg_troubleshoot.gear.cycle import RetractionCycle, Stage, ValveState
from mlg_troubleshoot.gear.gear import Area, Discrepancies, Gear, Linkage, TiltedLink
from mlg_troubleshoot.gear.joints import JointSpec
from mlg_troubleshoot.gear.model import Calibration
from mlg_troubleshoot.gear.sources import Source, Sourced, SourceKind
from mlg_troubleshoot.geometry.mechanism import (
    Crank,
    Dyad,
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

DEFAULT_GEAR = "hawker-800xp"
_DATA = Path(str(files("mlg_troubleshoot.gear"))) / "data"
# Nothing of a landing gear is longer, and no angle needs more than two turns; far beyond, formulas
# overflow.
_LENGTH, _ANGLE = {"least": -1e4, "most": 1e4}, {"least": -720.0, "most": 720.0}
_LARGEST = {"in": 1e4, "min": 1e5, "landings": 1e6, "1": 0.5}
# What a gear file need not state, and what stands for it.
_UNSTATED = {
    "restore_min": 120.0,
    "read_min": 12.0,
    "horizon_landings": 20_000.0,
    "accepted_chance": 0.05,
    "second_repair_chance": 0.02,
    "minutes": 30.0,
    "retraction_min": 15.0,
}
_GEOMETRY_KEYS = ("input", "planes", "points", "steps", "output", "calibration")


def shipped_gears() -> tuple[str, ...]:
    """Return the names of the gears that ship with the program, for :func:`load_gear`."""
    names = {p.stem for p in _DATA.glob("*.toml")}
    return tuple(sorted(n for n in names if not n.endswith(("-ensemble", "-targets"))))


def load_gear(name_or_path: str | Path = DEFAULT_GEAR) -> Gear:
    """Load a gear by its shipped name or from a gear file; a file is read anew each time.

    Parameters
    ----------
    name_or_path : str or Path
        ``hawker-800xp``, or the path of a TOML file.

    Returns
    -------
    Gear
        The gear, checked and assembled.

    Raises
    ------
    UsageError
        If there is no such gear.
    GearFileError
        If the file is not valid; the message names the place.
    MechanismError
        If the linkage cannot be assembled.
    """
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
    table = read_toml(path)
    if table.whole("schema") != 1:
        raise table.fail("schema", "1")
    sources = _sources(table.table("sources"))
    numbers = _Numbers(sources)
    reference = _linkage(table, "A", numbers)
    members: dict[str, dict[str, Any]] = {}
    ensemble_path = path
    if table.has("ensemble"):
        ensemble_path = table.sibling("ensemble", "")
        members = _members(table.values, ensemble_path)
    calibration, down_lock_range = _calibration(table, numbers)
    entry = table.table("entry")
    table.skip(*_GEOMETRY_KEYS)
    (plunger_reading,) = _not_needed(table, "plunger", numbers, read_min="min")
    second_repair, retraction = _not_needed(
        table, "repair", numbers, second_repair_chance="1", retraction_min="min"
    )
    (rigging_check,) = _not_needed(table, "rigging_check", numbers, minutes="min")
    horizon, accepted = _not_needed(
        table, "forecast", numbers, horizon_landings="landings", accepted_chance="1"
    )
    indices_file = table.sibling("indices", f"{path.stem}-indices.json")
    gear = Gear(
        id=table.name("id"),
        name=table.name("name"),
        provenance=table.text("provenance"),
        reference=reference,
        ensemble=(
            reference,
            *(_linkage(DataTable(m, ensemble_path), n, None) for n, m in members.items()),
        ),
        joints=tuple(_joint(t, numbers) for t in table.tables("joints")),
        areas=tuple(_area(t, numbers) for t in table.tables("areas")),
        plunger_reading=plunger_reading,
        rigging_check=rigging_check,
        retraction=retraction,
        second_repair_chance=second_repair,
        horizon=horizon,
        accepted_chance=accepted,
        calibration=calibration,
        margin=numbers.only(table.table("margin"), "in"),
        bearing_span=numbers.only(table.table("bearing_span"), "in"),
        hard_limit=numbers.read(entry, "hard_limit", "in"),
        confirm_above=numbers.read(entry, "confirm_above", "in"),
        down_lock_range=down_lock_range,
        discrepancies=_discrepancies(table, reference.mechanism, numbers),
        cycle=_cycle(table.table("cycle")) if table.has("cycle") else None,
        numbers=tuple(numbers.found),
        geometry_sha256=_sha256({k: table.values.get(k) for k in _GEOMETRY_KEYS}),
        ensemble_sha256=_sha256(
            {n: {k: m.get(k) for k in _GEOMETRY_KEYS} for n, m in members.items()}
        ),
        path=path,
        indices_file=indices_file,
        files=tuple(
            dict.fromkeys(
                (path, ensemble_path, indices_file, path.with_name(f"{path.stem}-targets.toml"))
            )
        ),
    )
    entry.finish()
    table.finish()
    _check_joints(gear, path)
    return gear


def _sha256(value: Any) -> str:
    return hashlib.sha256(json.dumps(value, sort_keys=True).encode()).hexdigest()


class _Numbers:
    """Reads numbers with their sources and remembers them all."""

    def __init__(self, sources: dict[str, Source]) -> None:
        self.sources = sources
        self.found: list[Sourced] = []

    def source(self, table: DataTable, key: str = "source") -> Source:
        name = table.text(key)
        if name not in self.sources:
            raise table.fail(key, f"one of the sources {', '.join(self.sources)}")
        return self.sources[name]

    def add(self, value: float, unit: str, source: Source) -> Sourced:
        number = Sourced(value, unit, source.kind, source.text)
        self.found.append(number)
        return number

    def read(
        self,
        table: DataTable,
        key: str,
        unit: str,
        source_key: str = "source",
        *,
        or_zero: bool = False,
    ) -> Sourced:
        """Read a number that cannot be negative."""
        number = table.positive(key, or_zero=or_zero, most=_LARGEST[unit])
        return self.add(number, unit, self.source(table, source_key))

    def or_assumed(
        self, table: DataTable, key: str, unit: str = "min", source_key: str = "source"
    ) -> Sourced:
        """Read a number that a gear file need not state: it is then assumed, and says so."""
        if table.has(key):
            return self.read(table, key, unit, source_key)
        shown = f"{_UNSTATED[key]:g}{'' if unit == '1' else f' {unit}'}"
        text = f"Not stated in the gear file: {shown} is assumed by the authors of this tool."
        return self.add(_UNSTATED[key], unit, Source("unstated", SourceKind.ASSUMED, text))

    def only(self, table: DataTable, unit: str) -> Sourced:
        """Read a table that holds one value and its source, and nothing else."""
        number = self.read(table, "value", unit)
        table.finish()
        return number


def _sources(table: DataTable) -> dict[str, Source]:
    sources = {}
    for name in table.names:
        entry = table.table(name)
        kind = SourceKind(entry.one_of("kind", tuple(SourceKind)))
        sources[name] = Source(name, kind, entry.text("text"))
        entry.finish()
    return sources


def _linkage(table: DataTable, name: str, numbers: _Numbers | None) -> Linkage:
    """Read the mechanism; numbers of the reference are remembered with their sources."""

    def sourced(entry: DataTable, *values: tuple[float, str]) -> None:
        if numbers is not None:
            source = numbers.source(entry)
            for value, unit in values:
                numbers.add(value, unit, source)
        elif entry.has("source"):
            entry.text("source")

    drive = table.table("input")
    stroke, reference = drive.pair("range", **_LENGTH), drive.number("reference", **_LENGTH)
    if stroke[0] == stroke[1]:
        raise drive.fail("range", "two different numbers")
    drive.text("name")
    sourced(drive, (stroke[0], "in"), (stroke[1], "in"), (reference, "in"))
    drive.finish()
    planes = []
    for entry in table.tables("planes"):
        if entry.has("parent"):
            direction, dihedral = (
                entry.number("hinge_direction_deg", **_ANGLE),
                entry.number("dihedral_deg", **_ANGLE),
            )
            names = entry.name("name"), entry.name("parent"), entry.name("hinge_point")
            planes.append(Plane(*names, float(np.radians(direction)), float(np.radians(dihedral))))
            sourced(entry, (direction, "deg"), (dihedral, "deg"))
        else:
            planes.append(Plane(entry.name("name")))
        entry.finish()
    points = []
    for entry in table.tables("points"):
        x, y = entry.pair("at", **_LENGTH)
        link = entry.whole("virtual_link", least=1, most=999) if entry.has("virtual_link") else None
        points.append(
            Point(entry.name("name"), entry.name("plane"), x, y, entry.flag("fixed"), link)
        )
        sourced(entry, (x, "in"), (y, "in"))
        entry.finish()
    steps = []
    for entry in table.tables("steps"):
        step = _step(entry)
        steps.append(step)
        sourced(entry, *([(entry.number("axis_deg"), "deg")] if isinstance(step, Slider) else []))
        entry.finish()
    read = table.table("output")
    kind = read.text("kind")
    if kind not in ("position", "angle"):
        raise read.fail("kind", "position or angle")
    pivot = read.name("pivot") if read.has("pivot") else ""
    output = Output("position" if kind == "position" else "angle", read.name("joint"), pivot)
    read.finish()
    mechanism = Mechanism(tuple(planes), tuple(points), tuple(steps), output, reference)
    return Linkage(name, mechanism, stroke)


def _step(t: DataTable) -> Step:
    joint, links = t.name("joint"), t.wholes("virtual_links")
    if not all(1 <= link <= 999 for link in links):
        raise t.fail("virtual_links", "whole numbers from 1 to 999")
    match t.text("type"):
        case "crank":
            return Crank(joint, t.name("pivot"), links)
        case "dyad":
            return Dyad(
                joint, t.name("upstream"), t.name("downstream"), _sign(t), links, t.flag("driven")
            )
        case "lever":
            return Lever(joint, t.name("pivot"), t.name("follows"), links)
        case "slot":
            return Slot(joint, t.name("pivot"), t.name("pin"), links)
        case "slider":
            return Slider(
                joint,
                t.name("upstream"),
                float(np.radians(t.number("axis_deg", **_ANGLE))),
                _sign(t),
                links,
            )
        case _:
            raise t.fail("type", "crank, dyad, lever, slot or slider")


def _sign(table: DataTable) -> float:
    sign = table.number("sign")
    if sign not in (1.0, -1.0):
        raise table.fail("sign", "+1 or -1")
    return sign


def _members(raw: dict[str, Any], path: Path) -> dict[str, dict[str, Any]]:
    """Each member of the ensemble as a full description: the reference with its own numbers in
    place.
    """
    table = read_toml(path)
    table.text("source")
    members = table.table("members")
    full = {}
    for name in members.names:
        member = members.table(name)
        new: dict[str, Any] = deepcopy({k: raw.get(k) for k in _GEOMETRY_KEYS})
        new["input"].update(range=list(member.pair("range")), reference=member.number("reference"))
        points = member.table("points")
        for point in points.names:
            _entry(new["points"], "name", point, points)["at"] = list(points.pair(point))
        for part, key in (("planes", "name"), ("steps", "joint")):
            changes = (
                member.table(part) if member.has(part) or part == "steps" else DataTable({}, path)
            )
            for name_of in changes.names:
                change = changes.table(name_of)
                _entry(new[part], key, name_of, changes).update(
                    {k: change.number(k) for k in change.names}
                )
        member.finish()
        full[name] = new
    table.finish()
    return full


def _entry(entries: list[dict[str, Any]], key: str, value: str, table: DataTable) -> dict[str, Any]:
    for entry in entries:
        if entry.get(key) == value:
            return entry
    raise table.fail(value, f"a {key} of the gear file")


def _calibration(table: DataTable, numbers: _Numbers) -> tuple[Calibration, tuple[float, float]]:
    if not table.has("calibration"):
        return Calibration(), (-np.inf, np.inf)
    entry = table.table("calibration")
    down_lock = numbers.add(entry.number("down_lock", **_LENGTH), "in", numbers.source(entry))
    found = Calibration(down_lock.value, numbers.read(entry, "travel", "in").value)
    allowed = entry.rising("down_lock_range", **_LENGTH)
    for end in allowed:
        numbers.add(end, "in", numbers.source(entry))
    entry.finish()
    return found, allowed


def _joint(t: DataTable, numbers: _Numbers) -> JointSpec:
    joint = JointSpec(
        number=t.whole("number", least=1, most=999),
        point=t.name("point", str(t.whole("number"))),
        name=t.name("name"),
        location=t.text("location"),
        limit=numbers.read(t, "limit", "in", "limit_source"),
        new_part=numbers.read(t, "new_part", "in", "new_part_source", or_zero=True),
        access=numbers.read(t, "access_min", "min", "access_source"),
        restore=numbers.or_assumed(t, "restore_min", source_key="restore_source"),
        area=t.name("area"),
        critical=t.flag("critical"),
    )
    t.finish()
    return joint


def _not_needed(table: DataTable, name: str, numbers: _Numbers, **units: str) -> list[Sourced]:
    """Read a table of numbers that a gear file need not have."""
    entry = table.table(name) if table.has(name) else DataTable({}, Path())
    read = [numbers.or_assumed(entry, key, unit) for key, unit in units.items()]
    entry.finish()
    return read


def _area(t: DataTable, numbers: _Numbers) -> Area:
    area = Area(
        t.name("name"), t.text("description"), numbers.read(t, "access_min", "min", or_zero=True)
    )
    t.finish()
    return area


def _discrepancies(table: DataTable, mechanism: Mechanism, numbers: _Numbers) -> Discrepancies:
    if not table.has("diagnosis"):
        return Discrepancies()
    entry = table.table("diagnosis")
    numbers.source(entry)
    known = write_program(mechanism).parameters
    found = Discrepancies(
        elastic=entry.texts("elastic") if entry.has("elastic") else (),
        wear_shift=entry.text("wear_shift") if entry.has("wear_shift") else None,
        contact=entry.pairs("contact"),
        tilt=tuple(TiltedLink(t.text("length"), t.wholes("floats")) for t in entry.tables("tilt")),
    )
    used = (
        *found.elastic,
        *(t.length for t in found.tilt),
        *((found.wear_shift,) if found.wear_shift else ()),
    )
    for name in used:
        if name not in known:
            raise entry.fail(
                "elastic, tilt or wear_shift", f"a number of the linkage instead of {name!r}"
            )
    entry.finish()
    return found


def _cycle(t: DataTable) -> RetractionCycle:
    cycle = RetractionCycle(
        stages=tuple(
            Stage(s.text("name"), s.text("meaning"), s.text("plunger")) for s in t.tables("stages")
        ),
        release=t.texts("release"),
        retraction_order=t.texts("retraction_order"),
        extension_order=t.texts("extension_order"),
        valve=tuple(
            ValveState(v.text("plunger"), v.text("flow"), v.text("stage"), v.text("result"))
            for v in t.tables("valve")
        ),
        beyond=t.text("beyond"),
        short=t.text("short"),
        within=t.text("within"),
        source=t.text("source"),
    )
    t.finish()
    return cycle


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
