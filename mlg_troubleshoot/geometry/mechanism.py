"""A mechanism as data: planes, points, and the order in which its joints are located.

A mechanism is given at one *reference* position of its input. Link lengths, lever ratios and the
transfers between planes follow from the coordinates there, so a user writes coordinates and nothing
else. This module knows no aircraft; a joint's clearance is a *virtual link* with a number (section
3.2).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np

from mlg_troubleshoot.arrays import Array
from mlg_troubleshoot.errors import MechanismError


@dataclass(frozen=True, slots=True)
class Plane:
    """A plane in which joints move.

    parent: the plane it is hinged to; None for the base plane, whose axes are x and y.
    hinge_point: point of the parent plane, its reference position being this plane's origin.
    hinge_direction: direction of the hinge line in the parent plane, this plane's first axis. [rad]
    dihedral: angle by which this plane is turned about the hinge line out of its parent. [rad]
    """

    name: str
    parent: str | None = None
    hinge_point: str = ""
    hinge_direction: float = 0.0
    dihedral: float = 0.0


@dataclass(frozen=True, slots=True)
class Point:
    """A joint or a fixed pivot at the reference position.

    plane: the plane it moves in.
    x, y: coordinates in that plane. [in]
    fixed: true for a pivot fixed to the aircraft.
    virtual_link: number of the virtual link that displaces this fixed pivot (A* of Fig. 8a).
    """

    json_names = "plane at_in fixed"
    name: str
    plane: str
    x: float
    y: float
    fixed: bool = False
    virtual_link: int | None = None

    @property
    def at_in(self) -> tuple[float, float]:
        """Its coordinates. [in]"""
        return self.x, self.y


@dataclass(frozen=True, slots=True)
class Crank:
    """The driven crank: its angle is the input."""

    joint: str
    pivot: str
    virtual_links: tuple[int, ...] = ()


@dataclass(frozen=True, slots=True)
class Dyad:
    """Two links that meet in a joint: the triangle A, B, C of section 3.1.

    Attributes
    ----------
    joint : str
        The joint.
    upstream, downstream : str
        The joints at the other ends; the downstream one is a fixed pivot or located before.
    virtual_links : tuple of int
        Virtual links at the two ends of the upstream link: both displace it in parallel (A**, Fig.
        8b).
    driven : bool
        Whether the upstream link is the actuator whose length is the input.
    """

    joint: str
    upstream: str
    downstream: str
    virtual_links: tuple[int, ...] = ()
    driven: bool = False


@dataclass(frozen=True, slots=True)
class Lever:
    """A rigid link of three joints, the middle one fixed (Fig. 9c): `joint` follows one that is
    already located.
    """

    joint: str
    pivot: str
    follows: str
    virtual_links: tuple[int, ...] = ()


@dataclass(frozen=True, slots=True)
class Slot:
    """A lever that a pin turns in a radial slot: the pin sets the direction of its other arm, to
    `joint`, only.
    """

    joint: str
    pivot: str
    pin: str
    virtual_links: tuple[int, ...] = ()


@dataclass(frozen=True, slots=True)
class Slider:
    """A link whose far end slides on an axis.

    axis: direction of the axis in the joint's plane; the axis passes through the joint's reference
    position. [rad]
    """

    joint: str
    upstream: str
    axis: float
    virtual_links: tuple[int, ...] = ()


# A point of the mechanism that a line leads to, or the direction that it keeps. [rad]
Towards = str | float


@dataclass(frozen=True, slots=True)
class Guided:
    """A joint on a line that starts at a point of the mechanism, at the distance from it that the
    coordinates give.

    Attributes
    ----------
    across
        Direction of a second line that starts at `upstream`: the joint is where both meet (dyad
        RPP). None for the end of a link from `upstream`, on the side where the coordinates put it
        (RRP).
    virtual_links
        They displace that second line, or that link.
    driven : bool
        True if the joint is the end of an actuator along the line, whose extension is the input;
        virtual links then displace the joint.
    """

    joint: str
    upstream: str
    line: tuple[str, Towards]
    across: Towards | None = None
    virtual_links: tuple[int, ...] = ()
    driven: bool = False


Step = Crank | Dyad | Lever | Slot | Slider | Guided


@dataclass(frozen=True, slots=True)
class Output:
    """What the mechanism is for.

    kind: position of a slider along its axis from its reference [in], or direction of a joint from
    a pivot [rad]. pivot: the pivot, for an angle.
    """

    kind: Literal["position", "angle"]
    joint: str
    pivot: str = ""


@dataclass(frozen=True, slots=True)
class Mechanism:
    """Planes, points and steps of one mechanism at its reference position, each step after those
    that it needs.

    Attributes
    ----------
    planes : tuple of Plane
        Parents first.
    points : tuple of Point
        Where the joints and fixed points are.
    steps : tuple of Step
        In the order of the mechanism, from the input to the output.
    reference_input : float
        Input at which the points are given. [in or rad]
    virtual_links : tuple of int
        Numbers of all virtual links, in order.

    Raises
    ------
    MechanismError
        If a plane is hinged to what is not there.
    """

    planes: tuple[Plane, ...]
    points: tuple[Point, ...]
    steps: tuple[Step, ...]
    output: Output
    reference_input: float
    virtual_links: tuple[int, ...] = field(init=False)

    def __post_init__(self) -> None:
        points = {(point.name, point.plane) for point in self.points}
        planes: set[str] = set()
        for plane in self.planes:
            if plane.parent is not None:
                hinged = f"Plane {plane.name!r} is hinged"
                if plane.parent not in planes:
                    raise MechanismError(f"{hinged} to {plane.parent!r}, not defined before it.")
                if (plane.hinge_point, plane.parent) not in points:
                    where = f"which is not a point of {plane.parent!r}"
                    raise MechanismError(f"{hinged} at {plane.hinge_point!r}, {where}.")
            planes.add(plane.name)
        used = [point.virtual_link for point in self.points if point.virtual_link is not None]
        used += [number for step in self.steps for number in step.virtual_links]
        object.__setattr__(self, "virtual_links", tuple(sorted(used)))

    def point(self, name: str) -> Point:
        return next(point for point in self.points if point.name == name)

    def step(self, joint: str) -> Step | None:
        return next((step for step in self.steps if step.joint == joint), None)

    @property
    def alike(self) -> tuple[tuple[int, ...], ...]:
        """Virtual links that displace the same link, together, and the others each alone, in
        order.
        """
        ends = {
            number: tuple(sorted(step.virtual_links))
            for step in self.steps
            for number in step.virtual_links
        }
        groups = (ends.get(number, (number,)) for number in self.virtual_links)
        return tuple(dict.fromkeys(groups))

    def frame(self, plane: str) -> tuple[Array, Array]:
        """Origin and axes of a plane in space.

        A plane is turned about its hinge line, which lies in its parent: Rodrigues' bracket of Eq.
        6 maps what is normal to the axis to cos δ of itself and sin δ of the third direction.
        Coordinates and angles may be arrays, for a batch of linkages; their axes then come first.

        Returns origin, shape (..., 3): origin. [in]
        Returns axes, shape (..., 3, 3): rows are the two axes in the plane and its normal. [1]
        """
        found = next(p for p in self.planes if p.name == plane)
        if found.parent is None:
            return np.zeros(3), np.eye(3)
        _, axes = self.frame(found.parent)
        x = axes[..., 0, :]
        y = axes[..., 1, :]
        normal = axes[..., 2, :]
        cosine = _column(np.cos(found.hinge_direction))
        sine = _column(np.sin(found.hinge_direction))
        turned = _column(np.cos(found.dihedral))
        tilted = _column(np.sin(found.dihedral))
        first = cosine * x + sine * y
        flat = cosine * y - sine * x
        new = np.broadcast_arrays(
            first, turned * flat + tilted * normal, turned * normal - tilted * flat
        )
        return self.reference_in_space(found.hinge_point), np.stack(new, axis=-2)

    def reference_in_space(self, name: str) -> Array:
        """Reference position of a point in the frame of the base plane, shape (..., 3). [in]"""
        point = self.point(name)
        origin, axes = self.frame(point.plane)
        place = origin + _column(point.x) * axes[..., 0, :] + _column(point.y) * axes[..., 1, :]
        return np.asarray(place)

    def seen_in_plane(self, plane: str, start: str, end: str) -> tuple[Any, Any]:
        """Vector from one reference position to another, along the two axes of a plane. [in]"""
        _, axes = self.frame(plane)
        across = self.reference_in_space(end) - self.reference_in_space(start)
        first = (across * axes[..., 0, :]).sum(axis=-1)
        return first, (across * axes[..., 1, :]).sum(axis=-1)

    def side(self, step: Dyad | Slider) -> Any:
        """How far the coordinates put a joint to the left of the line from upstream to downstream,
        or ahead of the upstream joint along its axis: the sign of this names one of two solutions.
        """
        plane = self.point(step.joint).plane
        arm = self.seen_in_plane(plane, step.upstream, step.joint)
        if isinstance(step, Slider):
            return np.cos(step.axis) * arm[0] + np.sin(step.axis) * arm[1]
        base = self.seen_in_plane(plane, step.upstream, step.downstream)
        return base[0] * arm[1] - base[1] * arm[0]


def _column(value: Any) -> Array:
    return np.asarray(value)[..., None]


def needs(step: Step) -> tuple[str, ...]:
    """The points that a step locates its joint from, the one that drives it first."""
    match step:
        case Crank():
            return (step.pivot,)
        case Dyad():
            return (step.upstream, step.downstream)
        case Lever():
            return (step.follows, step.pivot)
        case Slot():
            return (step.pin, step.pivot)
        case Slider():
            return (step.upstream,)
        case Guided():
            ends = (step.upstream, *step.line, step.across)
            return tuple(end for end in ends if isinstance(end, str))
