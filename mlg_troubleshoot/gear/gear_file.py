"""Gear files: a gear type as TOML, with a source for every number. A gear file is data: nothing in
it is run.
"""

from __future__ import annotations

import hashlib
from functools import lru_cache
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from mlg_troubleshoot.datafile import DataFile, decode, read_toml, walk
from mlg_troubleshoot.errors import GearFileError, UsageError
from mlg_troubleshoot.gear import DEFAULT_GEAR
from mlg_troubleshoot.gear.assembly import Assembly, guides_of
from mlg_troubleshoot.gear.gear import (
    ASSUMED,
    DATA,
    Area,
    Discrepancies,
    Gear,
    JointSpec,
    Linkage,
    Source,
    Sourced,
    SourceKind,
)
from mlg_troubleshoot.gear.gear_tables import (
    CalibrationTable,
    EnsembleFile,
    GearFile,
    HowTable,
    SourcedTable,
)
from mlg_troubleshoot.gear.linkage import Calibration
from mlg_troubleshoot.geometry.mechanism import Mechanism
from mlg_troubleshoot.geometry.program import write_program

_OLD = 'docs/how-to/own-gear.md, "Gear files of 0.2.0", shows the old and the new way to write it.'
# What a workshop need not state, by the names of a gear: the key and its unit.
_WORKSHOP = {
    "plunger_reading": ("read_plunger_min", "min"),
    "rigging_check": ("check_rigging_min", "min"),
    "retraction": ("trial_retraction_min", "min"),
    "second_repair_chance": ("second_repair_chance", "1"),
    "horizon": ("horizon_landings", "landings"),
    "accepted_chance": ("accepted_chance", "1"),
}


def shipped_gears() -> tuple[str, ...]:
    """Return the names of the gears that ship with the program, the default one first, for
    :func:`load_gear`.
    """
    names = {p.stem for p in DATA.glob("*.toml")}
    gears = (n for n in names if not n.endswith(("-ensemble", "-targets", "assumed")))
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
    return _read(DATA / f"{name}.toml")


def read_gear_file(path: Path) -> DataFile[GearFile]:
    """Read a gear file, its sources checked; one of 0.2.0 is refused."""
    values = read_toml(path, dict[str, Any]).values
    if values.get("schema") == 1:
        raise GearFileError(f"{path.name}: is written as 0.2.0 read it (schema = 1)", _OLD)
    file = DataFile(path, values, decode(path, values, GearFile))
    for place, value in walk(values):
        named = "source_of" in place[-2:-1] or place[-1:] == ("source",)
        if named and place[0] != "cycle" and value not in file.content.sources:
            raise file.fail(place, f"one of the sources {', '.join(file.content.sources)}")
    return file


def _read(path: Path) -> Gear:
    file = read_gear_file(path)
    form = file.content
    numbers = _Numbers(form)
    _add_geometry(form, numbers)
    surely = {SourceKind.MEASURED, SourceKind.TECHNICAL_ORDER}
    linkage_known = {number.kind for number in numbers.found} <= surely
    reference = _linkage(file, "A")
    ensemble_path = path if form.ensemble is None else path.with_name(form.ensemble)
    members = () if form.ensemble is None else _members(file, ensemble_path)
    calibration, down_lock_range = _calibration(form.calibration, numbers)
    indices_file = path.with_name(form.indices or f"{path.stem}-indices.json")
    largest = max(joint.limit for joint in form.joints.values())
    areas = [
        Area(name, area.description, numbers.of(area, "access_min", "min"))
        for name, area in form.areas.items()
    ] or [Area("all", "the linkage", numbers.assumed(0.0, "min"))]
    return Gear(
        id=form.id or form.name,
        name=form.name,
        provenance=form.provenance or form.sources[form.source].text.strip().partition("\n")[0],
        reference=reference,
        ensemble=(reference, *members),
        joints=tuple(
            _joint(file, reference.mechanism, number, areas, numbers)
            for number in range(1, len(form.joints) + 1)
        ),
        areas=tuple(areas),
        **{name: numbers.of(form.workshop, key, unit) for name, (key, unit) in _WORKSHOP.items()},
        calibration=calibration,
        margin=numbers.of(form, "margin", "in"),
        bearing_span=numbers.of(form, "bearing_span", "in"),
        hard_limit=numbers.of(form, "hard_limit", "in", largest),
        confirm_above=numbers.of(form, "confirm_above", "in", largest),
        down_lock_range=down_lock_range,
        how=_how(form.how, numbers),
        discrepancies=_discrepancies(file, reference.mechanism),
        cycle=form.cycle,
        numbers=tuple(numbers.found),
        linkage_known=linkage_known,
        geometry_sha256=_sha256(_geometry(reference), calibration, down_lock_range),
        ensemble_sha256=_sha256(*map(_geometry, members)),
        path=path,
        indices_file=indices_file,
        files=tuple(
            dict.fromkeys(
                (path, ensemble_path, indices_file, path.with_name(f"{path.stem}-targets.toml"))
            )
        ),
    )


def _how(table: HowTable, numbers: _Numbers) -> dict[str, tuple[str, ...]]:
    """How each action is done; an assumed text says so."""
    texts = msgspec.structs.asdict(table)
    how = {}
    for name in ("read_plunger", "check_rigging", "trial_retraction", "measure", "restore"):
        said = texts[name]
        is_assumed = numbers.source(table, name).kind is SourceKind.ASSUMED
        marked = ("Assumed text: follow the manual.",) if said and is_assumed else ()
        how[name] = (*said, *marked)
    return how


def _linkage(file: DataFile[GearFile], name: str) -> Linkage:
    drive = file.content.input
    start, end = map(drive.in_units, drive.travel)
    return Linkage(name, Assembly(file).mechanism(), (start, end))


def _geometry(linkage: Linkage) -> tuple[object, ...]:
    m = linkage.mechanism
    return m.planes, m.points, m.steps, m.output, m.reference_input, linkage.stroke


def _sha256(*parts: object) -> str:
    return hashlib.sha256(msgspec.json.encode(parts, order="deterministic")).hexdigest()


class _Numbers:
    """Gathers numbers with their sources."""

    def __init__(self, form: GearFile) -> None:
        self.form = form
        self.found: list[Sourced] = []

    def add(self, value: float, unit: str, source: Source) -> Sourced:
        number = Sourced(float(value), unit, source.kind, source.text)
        self.found.append(number)
        return number

    def assumed(self, value: float, unit: str) -> Sourced:
        """Add a number that a gear file need not state, and does not: it says so."""
        shown = f"{value:g}{'' if unit == '1' else f' {unit}'}"
        text = f"Not stated in the gear file: {shown} is assumed by the authors of this tool."
        return self.add(value, unit, Source(kind=SourceKind.ASSUMED, text=text))

    def source(self, table: SourcedTable, key: str = "") -> Source:
        own = table.source or self.form.source
        return self.form.sources[table.source_of.get(key, own)]

    def of(self, table: SourcedTable, key: str, unit: str, size: float = 1.0) -> Sourced:
        """Add the number of a table, or what is assumed for it, a multiple of a size."""
        value = getattr(table, key)
        if value is None:
            return self.assumed(ASSUMED[key] * size, unit)
        return self.add(value, unit, self.source(table, key))


def _add_geometry(form: GearFile, numbers: _Numbers) -> None:
    """Add the numbers of a linkage with their sources."""
    drive = form.input
    for value in (*drive.travel, drive.drawn_at):
        numbers.add(value, "deg" if drive.crank else "in", numbers.source(drive))
    for plane in form.planes.values():
        for key in ("hinge_direction_deg", "dihedral_deg"):
            numbers.of(plane, key, "deg")
    for table in form.in_planes.values():
        for name, at in (table.ground | table.moving).items():
            source = numbers.source(table, name)
            for value in at:
                numbers.add(value, "in", source)
            for _, to in guides_of(form, name) if name in table.moving else ():
                if isinstance(to, float):
                    numbers.add(to, "deg", source)


def _members(file: DataFile[GearFile], path: Path) -> tuple[Linkage, ...]:
    """The members of the ensemble: the reference with their own values in place."""
    read = read_toml(path, EnsembleFile)
    known = {place for place, _ in walk(file.values)}
    linkages = []
    for name, changes in read.content.members.items():
        for place, _ in walk(changes):
            if place not in known:
                raise read.fail(("members", name, *place), "a key of the gear file")
        values = with_changes(file.values, changes)
        member = path.with_name(f"{path.name}, member {name}")
        content = decode(member, values, GearFile)
        linkages.append(_linkage(DataFile(member, values, content), name))
    return tuple(linkages)


def with_changes(values: dict[str, Any], changes: dict[str, Any]) -> dict[str, Any]:
    """Values with other ones in place, table by table."""
    tables = {
        key: with_changes(values[key], part)
        for key, part in changes.items()
        if isinstance(part, dict) and isinstance(values.get(key), dict)
    }
    return {**values, **changes, **tables}


def _calibration(
    table: CalibrationTable | None, numbers: _Numbers
) -> tuple[Calibration, tuple[float, float]]:
    if table is None:
        return Calibration(), (-np.inf, np.inf)
    numbers.of(table, "down_lock", "in")
    numbers.of(table, "travel", "in")
    for value in table.down_lock_range:
        numbers.add(value, "in", numbers.source(table, "down_lock_range"))
    return Calibration(table.down_lock, table.travel), table.down_lock_range


def _joint(
    file: DataFile[GearFile],
    mechanism: Mechanism,
    number: int,
    areas: list[Area],
    numbers: _Numbers,
) -> JointSpec:
    point = list(file.content.joints)[number - 1]
    alike = next((group for group in mechanism.alike if number in group), ())
    form = file.content
    joint = form.joints[point]
    known = [area.name for area in areas]
    area = joint.area or known[0]
    if area not in known:
        raise file.fail(("joints", point, "area"), f"one of the areas {', '.join(known)}")
    links = " and ".join(link for link, ends in form.links.items() if point in ends)
    return JointSpec(
        number=number,
        point=point,
        name=joint.name or point,
        location=joint.location or f"pin of {links}",
        limit=numbers.of(joint, "limit", "in"),
        new_part=numbers.of(joint, "new_part", "in"),
        access=numbers.of(joint, "access_min", "min"),
        restore=numbers.of(joint, "restore_min", "min"),
        area=area,
        critical=joint.critical,
        acts_like=tuple(n for n in alike if n != number),
    )


def _discrepancies(file: DataFile[GearFile], mechanism: Mechanism) -> Discrepancies:
    found = file.content.diagnosis
    known = write_program(mechanism).parameters
    for name in (*found.elastic, *(t.length for t in found.tilt), found.wear_shift or ""):
        if name and name not in known:
            place = ("diagnosis", "elastic, tilt or wear_shift")
            raise file.fail(place, f"a number of the linkage instead of {name!r}")
    return found
