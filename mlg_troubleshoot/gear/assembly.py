"""From points and links to a mechanism: how each point is located, and which link its clearance
displaces.

A point is located by what it stands on, in this order: a driven crank; an actuator along a
guide; two guides (dyad RPP); a guide and a link (RRP); a rigid link of which two points are
located; a slot; two links (RRR). So a gear file states neither order nor branches.

A linkage as a vector of its free numbers: what a search or a survey moves.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, replace
from typing import Any

import numpy as np

from mlg_troubleshoot.arrays import Array
from mlg_troubleshoot.datafile import DataFile
from mlg_troubleshoot.errors import GearFileError, UsageError
from mlg_troubleshoot.gear.gear import Linkage
from mlg_troubleshoot.gear.gear_tables import GearFile, MovingLine
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
    Towards,
)

# How far the end of an actuator may be drawn off its guide. [in]
_IN_LINE = 1e-6


def points_of(line: MovingLine) -> list[str]:
    return [end for end in line if isinstance(end, str)]


def guides_of(form: GearFile, point: str) -> list[MovingLine]:
    """The guides of a point, one that stands still as a line from a point on its plane's ground."""
    moving = form.guides.get(point, ())
    if point not in form.guides_deg:
        return [*moving]
    own = next(plane for plane in form.in_planes.values() if point in plane.moving)
    return [(next(iter(own.ground or form.ground)), form.guides_deg[point]), *moving]


class Assembly:
    """Locates the points of a gear file one after the other; `GearFileError` with the place of what
    is wrong.
    """

    def __init__(self, file: DataFile[GearFile]) -> None:
        self.file = file
        self.form = file.content
        planes = self.form.in_planes.values()
        names = [name for plane in planes for name in (*plane.ground, *plane.moving)]
        for name in names:
            if names.count(name) > 1:
                raise file.fail(("moving", name), "a point that has one place only")
        self.ground = {name for plane in planes for name in plane.ground}
        self.places = {name: at for p in planes for name, at in (p.ground | p.moving).items()}
        self.moving = [name for plane in planes for name in plane.moving]
        self.steps: dict[str, Step] = {}
        self.known = {*self.ground}

    def mechanism(self) -> Mechanism:
        form = self.form
        self._check_names()
        while [p for p in self.moving if p not in self.steps and self._locate(p)]:
            pass
        for point in self.moving:
            if point not in self.steps:
                raise GearFileError(
                    f"{self.file.path.name}: moving.{point}: nothing locates this point: it is on"
                    f" {', '.join(self._links_of(point)) or 'no link'}",
                    "Add what is missing: a second link to a located point, or a guide in"
                    f" guides_deg. Located are {', '.join([*form.ground, *self.steps])}.",
                )
        numbers = {point: n for n, point in enumerate(form.joints, start=1)}
        for point, number in numbers.items():
            if point in self.steps:
                self._place_clearance(number, point)
        points = (
            Point(name, plane, *at, fixed, numbers.get(name) if fixed else None)
            for plane, table in form.in_planes.items()
            for fixed, places in ((True, table.ground), (False, table.moving))
            for name, at in places.items()
        )
        hinged = (
            Plane(
                name,
                table.parent or form.plane,
                table.hinge_point,
                float(np.radians(table.hinge_direction_deg)),
                float(np.radians(table.dihedral_deg)),
            )
            for name, table in form.planes.items()
        )
        return Mechanism(
            (Plane(form.plane), *hinged),
            tuple(points),
            tuple(self.steps.values()),
            self._output(),
            form.input.in_units(form.input.drawn_at),
        )

    def _output(self) -> Output:
        read = self.form.output
        if read.angle_of is None:
            return Output("position", str(read.position_of))
        # From the pivot on the ground, if the link has one, to a point that moves.
        pivot, joint, *_ = sorted(self.form.links[read.angle_of], key=self._moves)
        return Output("angle", joint, pivot)

    def _check_names(self) -> None:
        form = self.form
        named = [
            *((("links", link, i), p) for link, x in form.links.items() for i, p in enumerate(x)),
            *((("slots", link), pin) for link, pin in form.slots.items()),
            *((("joints", point), point) for point in form.joints),
            *(
                (("guides", point, i), end)
                for point, lines in form.guides.items()
                for i, line in enumerate(lines)
                for end in points_of(line)
            ),
        ]
        for place, point in named:
            if point not in self.places:
                raise self.file.fail(place, f"one of the points {', '.join(self.places)}")
        for table in ("guides_deg", "guides"):
            for point in getattr(form, table):
                if point not in self.moving or len(guides_of(form, point)) > 2:
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
        on_ground = sum(p in self.ground for p in form.links[driven])
        if len(form.links[driven]) != 2 or (drive.crank and on_ground != 1):
            expected = "one point on the ground and one that moves" if drive.crank else "two points"
            raise self.file.fail(("links", driven), expected)
        if not form.joints:
            raise self.file.fail(("joints",), "at least one point with its limit")

    def _moves(self, point: str) -> bool:
        return point not in self.ground

    def _links_of(self, point: str) -> list[str]:
        return [link for link, ends in self.form.links.items() if point in ends]

    def _located(self, link: str, point: str) -> list[str]:
        """The other points of a link that are located, those on the ground first."""
        ends = [p for p in self.form.links[link] if p != point and p in self.known]
        return sorted(ends, key=self._moves)

    def _locate(self, point: str) -> bool:
        """Locate a point by the links that it is on, if enough of their points are located."""
        form = self.form
        drive = form.input
        reach = {
            link: ends for link in self._links_of(point) if (ends := self._located(link, point))
        }
        guides = guides_of(form, point)
        is_guided = len(guides) == 2 or (len(guides) == 1 and bool(reach))
        rigid = [x for x in reach if len(reach[x]) > 1 and x != drive.actuator]
        slotted = [x for x in reach if x in form.slots and form.slots[x] in self.known]
        step: Step | None = None
        if drive.crank in reach:
            step = Crank(point, reach[drive.crank][0])
        elif is_guided and all(end in self.known for line in guides for end in points_of(line)):
            step = self._guided(point, guides, reach)
        elif rigid:
            pivot, follows, *_ = reach[rigid[0]]
            step = Lever(point, pivot, follows)
        elif slotted:
            step = Slot(point, reach[slotted[0]][0], form.slots[slotted[0]])
        elif len(reach) > 1:
            step = self._dyad(point, reach)
        if step is not None:
            self.steps[point] = step
            self.known.add(point)
        return step is not None

    def _guided(
        self, point: str, guides: list[MovingLine], reach: Mapping[str, list[str]]
    ) -> Guided | Slider:
        form = self.form
        actuator = form.input.actuator
        if actuator is not None and actuator in reach:
            return self._pushed(point, actuator, reach[actuator][0])
        first = _line(guides[0])
        if len(guides) == 2:
            upstream, across = _line(guides[1])
            return Guided(point, upstream, first, across)
        upstream = next(iter(reach.values()))[0]
        if point in form.guides:
            return Guided(point, upstream, first)
        return Slider(point, upstream, float(np.radians(form.guides_deg[point])))

    def _pushed(self, point: str, actuator: str, base: str) -> Guided:
        """The end of an actuator that its guide keeps in line with its other end."""
        form = self.form
        if point not in form.guides_deg or point in form.guides or base not in self.ground:
            expected = f"one guide, in guides_deg, and {base} on the ground: {actuator} pushes it"
            raise self.file.fail(("moving", point), expected)
        axis = float(np.radians(form.guides_deg[point]))
        arm = complex(*self.places[point]) - complex(*self.places[base])
        if abs(arm - abs(arm) * np.exp(1j * axis)) > _IN_LINE:
            expected = f"the direction from {base} to {point}: {actuator} pushes along it"
            raise self.file.fail(("guides_deg", point), expected)
        return Guided(point, base, (base, axis), driven=True)

    def _dyad(self, point: str, reach: Mapping[str, list[str]]) -> Dyad:
        """The link that carries further points, or else the one on the ground, is the downstream
        one: the joint's place is its place, and clearance displaces the other.
        """
        drive = self.form.input.actuator

        def downstream_last(link: str) -> tuple[bool, bool, bool]:
            return link != drive, len(self.form.links[link]) > 2, reach[link][0] in self.ground

        first, second = sorted(list(reach)[:2], key=downstream_last)
        return Dyad(point, reach[first][0], reach[second][0], driven=first == drive)

    def _place_clearance(self, number: int, point: str) -> None:
        """Put the virtual link of a joint where it displaces the right link."""
        own = self.steps[point]
        users = (
            step
            for step in self.steps.values()
            if point in (getattr(step, "upstream", None), getattr(step, "pin", None))
        )
        step = own if isinstance(own, Dyad | Slider | Guided) else next(users, own)
        if isinstance(step, Slot) and step is own:
            expected = "a joint that a link starts from: nothing is pinned to it"
            raise self.file.fail(("joints", point), expected)
        self.steps[step.joint] = replace(step, virtual_links=(*step.virtual_links, number))


def _line(line: MovingLine) -> tuple[str, Towards]:
    """A line with its direction, if it keeps one, as the mechanism takes it. [rad]"""
    start, to = line
    return start, to if isinstance(to, str) else float(np.radians(to))


class DesignSpace:
    """The design variables of a linkage's topology: coordinates, angles of planes, slider axes, the
    extension.

    Moving and turning everything together changes nothing, so one pivot of the base plane is held,
    and with it the direction to another of its points. The extension is the input from Down Lock to
    the reference position.

    given: the linkage whose topology, held pivot and other end of the stroke are kept.
    """

    def __init__(self, given: Linkage) -> None:
        self.given = given
        self.mechanism = m = given.mechanism
        for step in m.steps:
            if isinstance(step, Guided):
                raise UsageError(
                    f"the guide of {step.joint} moves with the mechanism",
                    "A linkage can be searched or surveyed only if its guides stand still.",
                )
        base = [p for p in m.points if p.plane == m.planes[0].name]
        pivots = (p for p in base if p.fixed and p.virtual_link is not None)
        self.held = next(pivots, base[0])
        others = [p for p in base if p is not self.held and _distance(p, self.held) > 0.0]
        level = (
            [p for p in others if p.y == self.held.y and not p.fixed]
            or [p for p in others if p.fixed]
            or others
        )
        self.guide = level[0]
        ends = (self.held.name, self.guide.name)
        self.points = tuple(p.name for p in m.points if p.name not in ends)
        self.planes = tuple(p.name for p in m.planes if p.parent is not None)
        self.sliders = tuple(s.joint for s in m.steps if isinstance(s, Slider))
        self.moves_reference = m.reference_input != given.stroke[0]
        self.names = (
            f"{self.guide.name}.r",
            *(f"{p}.{axis}" for p in self.points for axis in "xy"),
            *(f"{p}.{angle}" for p in self.planes for angle in ("direction", "dihedral")),
            *(f"{s}.axis" for s in self.sliders),
            *(("extension",) if self.moves_reference else ()),
        )

    def vector(self, linkage: Linkage) -> Array:
        """The variables of a linkage of this topology, as it would stand with the held pivot in its
        place.
        """
        m = linkage.mechanism
        held = m.point(self.held.name)
        guide = m.point(self.guide.name)
        base = m.planes[0].name
        back = _direction(self.held, self.guide) - _direction(held, guide)
        is_elsewhere = back or (held.x, held.y) != (self.held.x, self.held.y)
        place = complex(self.held.x, self.held.y)
        values: list[float] = [_distance(guide, held)]
        for point in map(m.point, self.points):
            x = point.x
            y = point.y
            if point.plane == base and is_elsewhere:
                arm = complex(x - held.x, y - held.y)
                turned = arm * np.exp(1j * back)
                moved = turned + place
                x = moved.real
                y = moved.imag
            values += [x, y]
        for plane in m.planes:
            if plane.parent is not None:
                values += [
                    plane.hinge_direction + (back if plane.parent == base else 0.0),
                    plane.dihedral,
                ]
        values += [
            s.axis + (back if m.point(s.joint).plane == base else 0.0)
            for s in m.steps
            if isinstance(s, Slider)
        ]
        if self.moves_reference:
            values.append(m.reference_input - linkage.stroke[0])
        return np.array(values)

    def assembled(self, vectors: Any) -> Mechanism:
        """The mechanism of a vector, or of a batch, shape (..., n_variables): its coordinates are
        then arrays.

        Every branch sign is as the coordinates have it.
        """
        columns = np.moveaxis(np.asarray(vectors, float), -1, 0)
        x = dict(zip(self.names, columns, strict=True))
        turn = _direction(self.held, self.guide)
        reach = x[f"{self.guide.name}.r"]
        places = {p: {"x": x[f"{p}.x"], "y": x[f"{p}.y"]} for p in self.points}
        places[self.guide.name] = {
            "x": self.held.x + reach * np.cos(turn),
            "y": self.held.y + reach * np.sin(turn),
        }
        m = self.mechanism
        return replace(
            m,
            points=tuple(replace(p, **places.get(p.name, {})) for p in m.points),
            planes=tuple(
                (
                    replace(
                        p,
                        hinge_direction=x[f"{p.name}.direction"],
                        dihedral=x[f"{p.name}.dihedral"],
                    )
                    if p.name in self.planes
                    else p
                )
                for p in m.planes
            ),
            steps=tuple(
                replace(s, axis=x[f"{s.joint}.axis"]) if isinstance(s, Slider) else s
                for s in m.steps
            ),
            reference_input=(
                self.given.stroke[0] + x["extension"] if self.moves_reference else m.reference_input
            ),
        )

    def linkage(self, vector: Array, name: str = "N") -> Linkage:
        """The linkage of one vector, in plain numbers."""
        m = self.assembled(vector)
        points, planes, steps = (
            tuple(map(_plain, parts)) for parts in (m.points, m.planes, m.steps)
        )
        plain = replace(
            m, points=points, planes=planes, steps=steps, reference_input=float(m.reference_input)
        )
        low, high = self.given.stroke
        return Linkage(
            name, plain, (low, high + plain.reference_input - self.mechanism.reference_input)
        )


def _plain(part: Any) -> Any:
    """A part of a mechanism with a number in place of each array of one."""
    values = {field.name: getattr(part, field.name) for field in fields(part)}
    numbers = {
        name: v.item() for name, v in values.items() if isinstance(v, np.ndarray | np.generic)
    }
    return replace(part, **numbers)


def _distance(a: Point, b: Point) -> float:
    return float(np.hypot(a.x - b.x, a.y - b.y))


def _direction(start: Point, end: Point) -> float:
    """Angle of a line from the horizontal axis of its plane. [rad]"""
    return float(np.arctan2(end.y - start.y, end.x - start.x))


def member_values(linkage: Linkage) -> dict[str, Any]:
    """A linkage as a member of an ensemble file."""
    m = linkage.mechanism
    is_crank = any(isinstance(step, Crank) for step in m.steps)
    start, end, drawn_at = (
        float(np.degrees(value)) if is_crank else value
        for value in (*linkage.stroke, m.reference_input)
    )

    def points(plane: str) -> dict[str, Any]:
        placed: dict[str, Any] = {}
        for p in m.points:
            if p.plane == plane:
                placed.setdefault("ground" if p.fixed else "moving", {})[p.name] = [p.x, p.y]
        return placed

    base, *hinged = m.planes
    values: dict[str, Any] = {
        "input": {"travel": [start, end], **({"drawn_at": drawn_at} if drawn_at else {})},
        "guides_deg": {
            s.joint: float(np.degrees(s.axis)) for s in m.steps if isinstance(s, Slider)
        },
        **points(base.name),
        "planes": {
            p.name: {
                "hinge_direction_deg": float(np.degrees(p.hinge_direction)),
                "dihedral_deg": float(np.degrees(p.dihedral)),
                **points(p.name),
            }
            for p in hinged
        },
    }
    return {key: part for key, part in values.items() if part}
