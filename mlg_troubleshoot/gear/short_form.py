"""A gear from nothing: points, links and joints in the terms of the field, as a full gear file.

A point is located by what it stands on, in this order: a driven crank; an actuator along a
guide; two guides (dyad RPP); a guide and a link (RRP); a rigid link of which two points are
located; a slot; two links (RRR). So the order is not stated.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

import msgspec
import numpy as np
from msgspec import Meta

from mlg_troubleshoot.datafile import DataFile, Name, RefusedValueError, Table, decode, read_toml
from mlg_troubleshoot.errors import GearFileError
from mlg_troubleshoot.gear.gear import Source, SourceKind
from mlg_troubleshoot.gear.gear_file import Angle, Coordinate, GearFile, Length, linkage_of
from mlg_troubleshoot.gear.model import Calibration, LinkageModel

Place = tuple[Coordinate, Coordinate]
Ends = Annotated[tuple[Name, ...], Meta(min_length=2)]
# A line that moves: the point where it starts, and the one that it leads to or its direction. [deg]
MovingLine = tuple[Name, Name | Angle]
# What a gear file must state and a short form does not: changed there by who knows better.
_ASSUMED = "Not stated in the short form: assumed by the authors of this tool."
_PLANE = "base"
# A reading above twice the largest limit is asked again, one above five times is refused. [1]
_CONFIRM_ABOVE = 2
_HARD_LIMIT = 5
# How far the end of an actuator may be drawn off its guide. [in]
_IN_LINE = 1e-6


class DriveTable(Table):
    """What moves the linkage, and how far from the position that is drawn: a crank by an angle in
    degrees, or an actuator by a length in inches.
    """

    travel: Place
    crank: Name | None = None
    actuator: Name | None = None

    def __post_init__(self) -> None:
        if (self.crank is None) == (self.actuator is None):
            raise RefusedValueError("crank", "the name of a link here or in actuator, not in both")
        if self.travel[0] == self.travel[1]:
            raise RefusedValueError("travel", "two different numbers")

    @property
    def stroke(self) -> list[float]:
        """The input from start to end. [in or rad]"""
        return [float(np.radians(end)) if self.crank else end for end in self.travel]


class ReadTable(Table):
    """What the linkage is for: the angle of a link, or the position of a point on its guide."""

    angle_of: Name | None = None
    position_of: Name | None = None

    def __post_init__(self) -> None:
        if (self.angle_of is None) == (self.position_of is None):
            raise RefusedValueError("angle_of", "a link here or a point in position_of, not both")


class ShortForm(Table):
    """A planar linkage at one position, in inches: which points are on the ground, which move, and
    which links join them. Joints are the points with clearance, with their radial limits.
    """

    name: Name
    ground: dict[Name, Place]
    moving: dict[Name, Place]
    links: dict[Name, Ends]
    input: DriveTable
    output: ReadTable
    joints: dict[Name, Length]
    margin: Length
    source: Source
    guides_deg: dict[Name, Angle] = msgspec.field(default_factory=dict)
    guides: dict[Name, tuple[MovingLine, ...]] = msgspec.field(default_factory=dict)
    slots: dict[Name, Name] = msgspec.field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class NewGear:
    """A short form as it was understood.

    Attributes
    ----------
    values : dict
        The full gear file.
    steps : tuple of str
        How each point is located, in words.
    assumed : tuple of str
        What the short form does not state, in words.
    """

    values: dict[str, Any]
    steps: tuple[str, ...]
    assumed: tuple[str, ...]

    def closes(self) -> None:
        """Raise `MechanismError` if the linkage does not close over its travel."""
        table = decode(Path("gear file"), self.values, GearFile)
        linkage = linkage_of(table, "A")
        LinkageModel(linkage.mechanism, linkage.stroke, Calibration())


def read_short_form(file: Path) -> NewGear:
    """Read a short form; `GearFileError` with file, key and value if something is wrong or
    missing.
    """
    return _Builder(read_toml(file, ShortForm, "Give the path of a short form.")).gear()


def short_form(values: Mapping[str, Any], name: str = "short form") -> NewGear:
    """Return a short form that is given as values; `name` stands for the file in errors."""
    path = Path(name)
    raw = dict(values)
    file = DataFile(path, raw, decode(path, raw, ShortForm))
    return _Builder(file).gear()


@dataclass(slots=True)
class _Builder:
    """Locates the points of a short form one after the other."""

    file: DataFile[ShortForm]
    form: ShortForm = field(init=False)
    steps: dict[str, dict[str, Any]] = field(default_factory=dict)
    words: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.form = self.file.content
        self._check_names()

    def gear(self) -> NewGear:
        form = self.form
        while True:
            found = [p for p in form.moving if p not in self.steps and self._locate(p)]
            if not found:
                break
        for point in form.moving:
            if point not in self.steps:
                raise GearFileError(
                    f"{self.file.path.name}: moving.{point}: nothing locates this point: it is on"
                    f" {', '.join(self._links_of(point)) or 'no link'}",
                    "Add what is missing: a second link to a located point, or a guide in"
                    " guides_deg. Located are "
                    f"{', '.join([*form.ground, *self.steps])}.",
                )
        fixed_links = {p: self._place_clearance(n, p) for n, p in enumerate(form.joints, start=1)}
        return NewGear(self._values(fixed_links), tuple(self.words), self._assumed())

    def _check_names(self) -> None:
        form = self.form
        points = form.ground | form.moving
        named = [
            *(
                (("links", link, i), p)
                for link, ends in form.links.items()
                for i, p in enumerate(ends)
            ),
            *((("slots", link), pin) for link, pin in form.slots.items()),
            *((("joints", point), point) for point in form.joints),
            *(
                (("guides", point, i), end)
                for point, lines in form.guides.items()
                for i, line in enumerate(lines)
                for end in _points_of(line)
            ),
        ]
        for place, point in named:
            if point not in points:
                raise self.file.fail(place, f"one of the points {', '.join(points)}")
        for point in form.ground:
            if point in form.moving:
                raise self.file.fail(("moving", point), "a point that is not on the ground as well")
        for table, point in [
            *(("guides_deg", p) for p in form.guides_deg),
            *(("guides", p) for p in form.guides),
        ]:
            if point not in form.moving or len(self._lines(point)) > 2:
                raise self.file.fail((table, point), "a moving point with at most two guides")
        drive = form.input
        read = form.output
        links = [
            *((("slots", link), link) for link in form.slots),
            *((("input", key), getattr(drive, key)) for key in ("crank", "actuator")),
            (("output", "angle_of"), read.angle_of),
        ]
        for place, link in links:
            if link is not None and link not in form.links:
                raise self.file.fail(place, f"one of the links {', '.join(form.links)}")
        driven = drive.crank or drive.actuator or ""
        on_ground = sum(p in form.ground for p in form.links[driven])
        if len(form.links[driven]) != 2 or (drive.crank and on_ground != 1):
            expected = "one point on the ground and one that moves" if drive.crank else "two points"
            raise self.file.fail(("links", driven), expected)
        guided = form.guides_deg | form.guides
        if read.position_of is not None and read.position_of not in guided:
            expected = f"a point with a guide: {', '.join(guided) or 'no point has one'}"
            raise self.file.fail(("output", "position_of"), expected)
        if not form.joints:
            raise self.file.fail(("joints",), "at least one point with its limit in inches")

    def _links_of(self, point: str) -> list[str]:
        return [link for link, ends in self.form.links.items() if point in ends]

    def _located(self, link: str, point: str) -> list[str]:
        """The other points of a link that are located, those on the ground first."""
        ground = self.form.ground
        located = {*ground, *self.steps} - {point}
        ends = [p for p in self.form.links[link] if p in located]
        return sorted(ends, key=lambda p: p not in ground)

    def _locate(self, point: str) -> bool:
        """Locate a point by the links that it is on, if enough of their points are located."""
        form = self.form
        reach = {
            link: ends for link in self._links_of(point) if (ends := self._located(link, point))
        }
        rigid = [x for x in reach if len(reach[x]) > 1 and x != form.input.actuator]
        slotted = [x for x in reach if x in form.slots and self._is_known(form.slots[x])]
        if form.input.crank in reach:
            (pivot,) = reach[form.input.crank]
            self._add(
                point,
                "crank",
                f"{form.input.crank} about {pivot}, turned by the input",
                pivot=pivot,
            )
        elif self._is_guided(point, reach):
            self._guide(point, reach)
        elif rigid:
            pivot, follows, *_ = reach[rigid[0]]
            words = f"rigid on {rigid[0]} with {pivot} and {follows}"
            self._add(point, "lever", words, pivot=pivot, follows=follows)
        elif slotted:
            link = slotted[0]
            pin = form.slots[slotted[0]]
            words = f"{link} about {reach[link][0]}, turned by pin {pin} in its slot"
            self._add(point, "slot", words, pivot=reach[link][0], pin=pin)
        elif len(reach) > 1:
            self._dyad(point, reach)
        return point in self.steps

    def _is_known(self, point: str) -> bool:
        return point in self.form.ground or point in self.steps

    def _line_words(self, line: MovingLine) -> str:
        start, to = line
        if isinstance(to, str):
            return f"guide from {start} to {to}"
        return f"guide at {to:g}°" + ("" if start in self.form.ground else f" through {start}")

    def _lines(self, point: str) -> list[MovingLine]:
        """The guides of a point, one that stands still as a line from a point on the ground."""
        moving = self.form.guides.get(point, ())
        axis = self.form.guides_deg.get(point)
        if axis is None:
            return [*moving]
        ground = next(iter(self.form.ground))
        return [(ground, axis), *moving]

    def _is_guided(self, point: str, reach: Mapping[str, list[str]]) -> bool:
        lines = self._lines(point)
        is_held = len(lines) == 2 or (len(lines) == 1 and bool(reach))
        return is_held and all(self._is_known(end) for line in lines for end in _points_of(line))

    def _guide(self, point: str, reach: Mapping[str, list[str]]) -> None:
        lines = self._lines(point)
        actuator = self.form.input.actuator
        if actuator is not None and actuator in reach:
            self._push(point, actuator, reach)
            return
        if len(lines) == 2:
            first, (upstream, across) = lines
            words = f"dyad RPP: {self._line_words(first)}, {self._line_words(lines[1])}"
            self._add(point, "guide", words, upstream=upstream, line=list(first), across=across)
            return
        link, (end, *_) = next(iter(reach.items()))
        if point in self.form.guides:
            words = f"dyad RRP: {link} from {end}, {self._line_words(lines[0])}"
            self._add(point, "guide", words, upstream=end, line=list(lines[0]))
            return
        axis = self.form.guides_deg[point]
        along = self._from(end, point, axis)
        words = f"dyad RRP: {link} from {end}, guide at {axis:g}°"
        sign = 1 if along.real >= 0.0 else -1
        self._add(point, "slider", words, upstream=end, axis_deg=axis, sign=sign)

    def _from(self, start: str, end: str, axis_deg: float) -> complex:
        """Vector between two points, its real part along an axis. [in]"""
        arm = self._at(end) - self._at(start)
        return complex(arm * np.exp(-1j * np.radians(axis_deg)))

    def _push(self, point: str, actuator: str, reach: Mapping[str, list[str]]) -> None:
        """Locate the end of an actuator that its guide keeps in line with its other end."""
        base = reach[actuator][0]
        axis = self.form.guides_deg.get(point)
        if axis is None or point in self.form.guides or base not in self.form.ground:
            expected = f"one guide, in guides_deg, and {base} on the ground: {actuator} pushes it"
            raise self.file.fail(("moving", point), expected)
        arm = self._from(base, point, axis)
        if abs(arm - abs(arm)) > _IN_LINE:
            expected = f"the direction from {base} to {point}: {actuator} pushes along it"
            raise self.file.fail(("guides_deg", point), expected)
        words = f"{actuator} from {base} at {axis:g}°, extended by the input"
        self._add(point, "guide", words, upstream=base, line=[base, axis], driven=True)

    def _dyad(self, point: str, reach: Mapping[str, list[str]]) -> None:
        """The link that carries further points, or else the one on the ground, is the downstream
        one: the joint's place is its place, and clearance displaces the other.
        """
        drive = self.form.input.actuator

        def downstream_last(link: str) -> tuple[bool, bool, bool]:
            ground = reach[link][0] in self.form.ground
            return link != drive, len(self.form.links[link]) > 2, ground

        first, second = sorted(list(reach)[:2], key=downstream_last)
        upstream = reach[first][0]
        downstream = reach[second][0]
        base = self._at(downstream) - self._at(upstream)
        arm = self._at(point) - self._at(upstream)
        side = (base.conjugate() * arm).imag
        if abs(side) <= 1e-9 * abs(base) * abs(arm):
            expected = f"a place off the line from {upstream} to {downstream}: in line it may snap"
            raise self.file.fail(("moving", point), f"{expected} to either side")
        words = f"dyad RRR: {first} from {upstream}, {second} from {downstream}"
        ends = {"upstream": upstream, "downstream": downstream, "sign": 1 if side > 0.0 else -1}
        self._add(point, "dyad", words, **ends, driven=first == drive)

    def _at(self, point: str) -> complex:
        return complex(*(self.form.ground | self.form.moving)[point])

    def _add(self, point: str, kind: str, words: str, **ends: Any) -> None:
        self.steps[point] = {"type": kind, "joint": point, **ends, "source": "given"}
        self.words.append(f"{point}: {words}")

    def _place_clearance(self, number: int, point: str) -> int | None:
        """Put the virtual link of a joint where it displaces the right link; return its number if
        that is the pivot on the ground.
        """
        if point in self.form.ground:
            return number
        own = self.steps[point]
        users = (
            step for step in self.steps.values() if point in (step.get("upstream"), step.get("pin"))
        )
        user = next(users, None)
        step = own if own["type"] in ("dyad", "slider", "guide") else user or own
        if step["type"] == "slot" and step is own:
            raise self.file.fail(
                ("joints", point), "a joint that a link starts from: nothing is pinned to it"
            )
        step.setdefault("virtual_links", []).append(number)
        return None

    def _values(self, fixed_links: Mapping[str, int | None]) -> dict[str, Any]:
        form = self.form
        largest = max(form.joints.values())
        points = [
            {"name": p, "plane": _PLANE, "at": list(at), "fixed": p in form.ground}
            | ({"virtual_link": number} if (number := fixed_links.get(p)) else {})
            | {"source": "given"}
            for p, at in (form.ground | form.moving).items()
        ]
        return {
            "schema": 1,
            "id": form.name,
            "name": form.name,
            "provenance": form.source.text.strip().partition("\n")[0],
            "sources": {
                "given": msgspec.to_builtins(form.source),
                "assumed": {"kind": str(SourceKind.ASSUMED), "text": _ASSUMED},
            },
            "margin": {"value": form.margin, "source": "given"},
            "bearing_span": {"value": 1.0, "source": "assumed"},
            "entry": {
                "hard_limit": _HARD_LIMIT * largest,
                "confirm_above": _CONFIRM_ABOVE * largest,
                "source": "assumed",
            },
            "input": {
                "name": f"{form.input.crank or form.input.actuator} from the position drawn",
                "range": form.input.stroke,
                "reference": 0.0,
                "source": "given",
            },
            "output": self._output(),
            "planes": [{"name": _PLANE}],
            "points": points,
            "steps": list(self.steps.values()),
            "areas": [
                {
                    "name": "all",
                    "description": "the linkage",
                    "access_min": 0.0,
                    "source": "assumed",
                }
            ],
            "joints": list(self._joints()),
        }

    def _output(self) -> dict[str, str]:
        read = self.form.output
        if read.angle_of is None:
            return {"kind": "position", "joint": str(read.position_of)}
        # From the pivot on the ground, if the link has one, to a point that moves.
        pivot, joint, *_ = sorted(
            self.form.links[read.angle_of], key=lambda p: p not in self.form.ground
        )
        return {"kind": "angle", "joint": joint, "pivot": pivot}

    def _joints(self) -> Iterator[dict[str, Any]]:
        for number, (point, limit) in enumerate(self.form.joints.items(), start=1):
            links = " and ".join(self._links_of(point))
            yield {
                "number": number,
                "point": point,
                "name": point,
                "location": f"pin of {links}",
                "area": "all",
                "critical": False,
                "limit": limit,
                "limit_source": "given",
                "new_part": 0.0,
                "new_part_source": "assumed",
                "access_min": 10.0,
                "access_source": "assumed",
            }

    def _assumed(self) -> tuple[str, ...]:
        largest = max(self.form.joints.values())
        return (
            "new parts without clearance; 10 min to reach each joint",
            f"a reading above {_CONFIRM_ABOVE * largest:g} in is asked again, one above"
            f" {_HARD_LIMIT * largest:g} in is refused",
            "end float tilts over 1 in",
        )


def _points_of(line: MovingLine) -> list[str]:
    return [end for end in line if isinstance(end, str)]
