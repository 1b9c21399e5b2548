"""From points and links to a mechanism: how each point is located, and which link its clearance
displaces.

A point is located by what it stands on, in this order: a driven crank; an actuator along a
guide; two guides (dyad RPP); a guide and a link (RRP); a rigid link of which two points are
located; a slot; two links (RRR). So a gear file states neither order nor branches.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from mlg_troubleshoot.datafile import DataFile
from mlg_troubleshoot.errors import GearFileError
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
