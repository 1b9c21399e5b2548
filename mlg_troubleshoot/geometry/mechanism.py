"""A mechanism as data: planes, points, and the order in which its joints are located.

A mechanism is given at one *reference* position of its input. Link lengths, lever ratios and the
transfers between planes follow from the coordinates there, so a user writes coordinates and nothing else.
This module knows no aircraft; a joint's clearance is a *virtual link* with a number (section 3.2).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from mlg_troubleshoot.errors import MechanismError
from mlg_troubleshoot.geometry.vectors import rotation

Vector = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Plane:
    """A plane in which joints move.

    Parameters
    ----------
    name : str
        Its name.
    parent : str or None
        The plane it is hinged to; None for the base plane, whose axes are x and y.
    hinge_point : str
        Point of the parent plane, its reference position being this plane's origin.
    hinge_direction : float
        Direction of the hinge line in the parent plane, this plane's first axis. [rad]
    dihedral : float
        Angle by which this plane is turned about the hinge line out of its parent. [rad]
    """

    name: str
    parent: str | None = None
    hinge_point: str = ""
    hinge_direction: float = 0.0
    dihedral: float = 0.0


@dataclass(frozen=True, slots=True)
class Point:
    """A joint or a fixed pivot at the reference position.

    Parameters
    ----------
    name : str
        Its name.
    plane : str
        The plane it moves in.
    x, y : float
        Coordinates in that plane. [in]
    fixed : bool
        True for a pivot fixed to the aircraft.
    virtual_link : int or None
        Number of the virtual link that displaces this fixed pivot (A* of Fig. 8a).
    """

    name: str
    plane: str
    x: float
    y: float
    fixed: bool = False
    virtual_link: int | None = None


@dataclass(frozen=True, slots=True)
class Crank:
    """The driven crank: its angle is the input.

    Parameters
    ----------
    joint, pivot : str
        The joint located and the fixed pivot it turns about.
    virtual_links : tuple of int
        Virtual links that displace the crank.
    """

    joint: str
    pivot: str
    virtual_links: tuple[int, ...] = ()


@dataclass(frozen=True, slots=True)
class Dyad:
    """Two links that meet in a joint: the triangle A, B, C of section 3.1.

    Parameters
    ----------
    joint : str
        The joint located.
    upstream, downstream : str
        The joints at the other ends; the downstream one is a fixed pivot or located before.
    sign : float
        +1 if the joint lies to the left of the line from upstream to downstream, else −1. [1]
    virtual_links : tuple of int
        Virtual links at the two ends of the upstream link: both displace it in parallel (A**, Fig. 8b).
    driven : bool
        True if the upstream link is the actuator whose length is the input.
    """

    joint: str
    upstream: str
    downstream: str
    sign: float
    virtual_links: tuple[int, ...] = ()
    driven: bool = False


@dataclass(frozen=True, slots=True)
class Lever:
    """A rigid link of three joints, the middle one fixed (Fig. 9c): one joint follows another.

    Parameters
    ----------
    joint, pivot, follows : str
        The joint located, the fixed pivot, and the joint of the same lever that is already located.
    virtual_links : tuple of int
        Virtual links that displace the joint.
    """

    joint: str
    pivot: str
    follows: str
    virtual_links: tuple[int, ...] = ()


@dataclass(frozen=True, slots=True)
class Slot:
    """A lever that a pin turns in a radial slot: the pin sets the lever's direction only.

    Parameters
    ----------
    joint, pivot, pin : str
        The joint on the lever's other arm, the fixed pivot, and the pin.
    virtual_links : tuple of int
        Virtual links that displace the pin in the slot.
    """

    joint: str
    pivot: str
    pin: str
    virtual_links: tuple[int, ...] = ()


@dataclass(frozen=True, slots=True)
class Slider:
    """A link whose far end slides on an axis.

    Parameters
    ----------
    joint, upstream : str
        The sliding joint and the joint at the other end of its link.
    axis : float
        Direction of the axis in the joint's plane; the axis passes through the joint's reference position. [rad]
    sign : float
        +1 if the joint lies ahead, along the axis, of the foot of the upstream joint, else −1. [1]
    virtual_links : tuple of int
        Virtual links at the two ends of the link.
    """

    joint: str
    upstream: str
    axis: float
    sign: float
    virtual_links: tuple[int, ...] = ()


Step = Crank | Dyad | Lever | Slot | Slider


@dataclass(frozen=True, slots=True)
class Output:
    """What the mechanism is for.

    Parameters
    ----------
    kind : {'position', 'angle'}
        Position of a slider along its axis from its reference [in], or direction of a joint from a pivot [rad].
    joint : str
        The joint.
    pivot : str
        The pivot, for an angle.
    """

    kind: Literal["position", "angle"]
    joint: str
    pivot: str = ""


@dataclass(frozen=True, slots=True)
class Mechanism:
    """Planes, points and steps of one mechanism at its reference position.

    Parameters
    ----------
    planes : tuple of Plane
        Planes, parents first.
    points : tuple of Point
        Every joint and fixed pivot.
    steps : tuple
        Steps in the order of the mechanism, from the input to the output.
    output : Output
        What is read.
    reference_input : float
        Input at which the points are given. [in or rad]

    Attributes
    ----------
    virtual_links : tuple of int
        Numbers of all virtual links, in order.

    Raises
    ------
    MechanismError
        If a plane, point, step or the output refers to what is not there, a point is located never or twice,
        or a virtual link is used twice.
    """

    planes: tuple[Plane, ...]
    points: tuple[Point, ...]
    steps: tuple[Step, ...]
    output: Output
    reference_input: float
    virtual_links: tuple[int, ...] = field(init=False)

    def __post_init__(self) -> None:
        names = [point.name for point in self.points]
        self._check_planes_and_points(names)
        known = {point.name for point in self.points if point.fixed}
        used = [point.virtual_link for point in self.points if point.virtual_link is not None]
        for step in self.steps:
            for needed in _needs(step):
                if needed not in known:
                    raise MechanismError(
                        f"Step {step.joint!r} needs {needed!r}, which is neither fixed nor located before it."
                    )
            if step.joint not in names:
                raise MechanismError(f"Step {step.joint!r} locates a point that has no coordinates.")
            if step.joint in known:
                raise MechanismError(f"Step {step.joint!r} locates a point that is fixed or located before it.")
            known.add(step.joint)
            used += step.virtual_links
        if len(set(used)) != len(used):
            raise MechanismError(f"A virtual link is used twice: {sorted(used)}.")
        self._check_all_known(names, known)
        object.__setattr__(self, "virtual_links", tuple(sorted(used)))

    def _check_planes_and_points(self, names: list[str]) -> None:
        planes: set[str] = set()
        for plane in self.planes:
            if plane.parent is not None:
                if plane.parent not in planes:
                    raise MechanismError(f"Plane {plane.name!r} is hinged to {plane.parent!r}, not defined before it.")
                if plane.hinge_point not in names:
                    raise MechanismError(
                        f"Plane {plane.name!r} is hinged at {plane.hinge_point!r}, which has no coordinates."
                    )
            planes.add(plane.name)
        for name in names:
            if names.count(name) > 1:
                raise MechanismError(f"Point {name!r} is defined {names.count(name)} times.")
        for point in self.points:
            if point.plane not in planes:
                raise MechanismError(f"Point {point.name!r} lies in plane {point.plane!r}, which is not defined.")

    def _check_all_known(self, names: list[str], known: set[str]) -> None:
        for name in names:
            if name not in known:
                raise MechanismError(f"Point {name!r} is neither fixed nor located by a step.")
        if self.output.joint not in known:
            raise MechanismError(f"The output reads {self.output.joint!r}, which no step locates.")
        if self.output.kind == "angle" and self.output.pivot not in known:
            raise MechanismError(f"The output is an angle about {self.output.pivot!r}, which no step locates.")

    def point(self, name: str) -> Point:
        """Return the point of that name.

        Parameters
        ----------
        name : str
            Name of a joint or pivot.

        Returns
        -------
        Point
            The point at its reference position.
        """
        return next(point for point in self.points if point.name == name)

    def step(self, joint: str) -> Step | None:
        """Return the step that locates a joint, or None for a fixed pivot.

        Parameters
        ----------
        joint : str
            Name of the joint.

        Returns
        -------
        Step or None
            Its step.
        """
        return next((step for step in self.steps if step.joint == joint), None)

    def frame(self, plane: str) -> tuple[Vector, Vector]:
        """Origin and axes of a plane in space.

        Parameters
        ----------
        plane : str
            Name of the plane.

        Returns
        -------
        origin : ndarray, shape (3,)
            Origin. [in]
        axes : ndarray, shape (3, 3)
            Rows are the two axes in the plane and its normal. [1]
        """
        found = next(p for p in self.planes if p.name == plane)
        if found.parent is None:
            return np.zeros(3), np.eye(3)
        origin, axes = self.frame(found.parent)
        hinge = self.point(found.hinge_point)
        if hinge.plane != found.parent:
            raise MechanismError(f"Plane {plane!r} is hinged at {hinge.name!r}, which is not in {found.parent!r}.")
        first = np.cos(found.hinge_direction) * axes[0] + np.sin(found.hinge_direction) * axes[1]
        flat = -np.sin(found.hinge_direction) * axes[0] + np.cos(found.hinge_direction) * axes[1]
        second = rotation(first, found.dihedral) @ flat
        new = np.vstack([first, second, np.cross(first, second)])
        return origin + hinge.x * axes[0] + hinge.y * axes[1], new

    def reference_in_space(self, name: str) -> Vector:
        """Reference position of a point in space.

        Parameters
        ----------
        name : str
            Name of the point.

        Returns
        -------
        ndarray, shape (3,)
            Coordinates in the frame of the base plane. [in]
        """
        point = self.point(name)
        origin, axes = self.frame(point.plane)
        place: Vector = origin + point.x * axes[0] + point.y * axes[1]
        return place


def _needs(step: Step) -> tuple[str, ...]:
    match step:
        case Crank():
            return (step.pivot,)
        case Dyad():
            return (step.upstream, step.downstream)
        case Lever():
            return (step.pivot, step.follows)
        case Slot():
            return (step.pivot, step.pin)
        case Slider():
            return (step.upstream,)
