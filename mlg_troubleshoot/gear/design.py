"""A linkage as a vector of its free numbers: what a search or a survey moves."""

from __future__ import annotations

from dataclasses import fields, replace
from typing import Any

import numpy as np

from mlg_troubleshoot.arrays import Array
from mlg_troubleshoot.errors import UsageError
from mlg_troubleshoot.gear.gear import Linkage
from mlg_troubleshoot.geometry.mechanism import Crank, Guided, Mechanism, Point, Slider


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
