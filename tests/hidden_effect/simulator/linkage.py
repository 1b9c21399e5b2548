"""The down-lock release linkage as a closed 3-D chain, solved by Newton's method on its constraint
equations.

Fifteen unknowns (seven joints in their planes and the plunger's travel) against fifteen constraints
(eleven distances between points in space and the angles of four levers). Every distance, every
fixed pivot and every out-of-plane offset may differ from row to row, so that stretched, heated and
tilted parts enter where they are, not as a correction to the result.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: Distances in the order of the constraint equations; the angles of the four levers come after
#: them.
LENGTHS = ("E1", "E2", "F1", "Q3", "45", "46", "35", "67", "87", "89", "910")
_LENGTH_INDEX = {name: index for index, name in enumerate(LENGTHS)}
_ANGLES = len(LENGTHS)
_PLUNGER = 14
_UNKNOWNS = 15
_START_MIN_STEPS = 60
_TOLERANCE_IN = 1e-12
_MAX_ITERATIONS = 25


class ClosureError(ValueError):
    """The linkage cannot be assembled with the given lengths and clearances."""


@dataclass(frozen=True, slots=True)
class Geometry:
    """Drawing data of one linkage in space."""

    name: str  # Letter of the linkage
    # Fixed points F, E, Q, 4, 8 and 10 (the plunger's mid-position), each (3,) [in].
    fixed: dict[str, Array]
    start: Array  # Unknowns at mid-position, (15,) [in]
    lengths: Array  # Nominal distances in the order of ``LENGTHS``, (11,) [in]
    # Angle from the first to the last arm of crank, slotted lever, locking lever and bellcrank,
    # (4,) [rad].
    arm_angles: Array
    arms: Array  # Nominal length of the first arm of each, (4,) [in]
    along: Array  # Axes of the link-assembly plane, it and the next, (3,)
    across: Array
    eight: Array  # Joint 8 in the link-assembly plane, (2,) [in]
    axis: Array  # Direction of the plunger, (3,)
    # In-plane direction of the locking lever that sinks when the lever tilts, (2,).
    tilt_direction: Array
    stroke: float  # Release stroke of the actuator [in]
    rate: float  # Calibrated plunger reading for each inch of the mechanism's plunger travel
    angles: Array  # Over-travel directions in the limit of small clearances, (10,) [rad]


@dataclass(slots=True)
class Build:
    """The parts of n assembled gears, each with its own sizes."""

    geometry: Geometry  # Drawing data
    lengths: Array  # Distances in the order of ``LENGTHS``, (n, 11) [in]
    spread: Array  # Strain of the airframe between the fixed points, about joint 4, (n,)
    # Offset of one end of links 3-5, 6-7 and 9-10 square to the line between their pins, (n, 3)
    # [in].
    link_offset: Array
    lever_tilt: Array  # Tangent of the locking lever's tilt, (n,)
    twist: Array  # Added to the angle between the locking lever's arms, (n,) [rad]

    @classmethod
    def nominal(cls, geometry: Geometry, rows: int) -> Build:
        """Gears exactly as drawn."""
        return cls(
            geometry,
            np.repeat(geometry.lengths[None, :], rows, axis=0),
            np.zeros(rows),
            np.zeros((rows, 3)),
            np.zeros(rows),
            np.zeros(rows),
        )

    def length(self, name: str) -> Array:
        """Distance of one name, as a view that can be changed, (n,) [in]."""
        return self.lengths[:, _LENGTH_INDEX[name]]


def _flat(point: list[float]) -> Array:
    return np.array([point[0], point[1], 0.0])


def _turn(vectors: Array, angle: Array) -> Array:
    cosine, sine = np.cos(angle), np.sin(angle)
    x, y = vectors[..., 0], vectors[..., 1]
    return np.stack([cosine * x - sine * y, sine * x + cosine * y], axis=-1)


class _Equations:
    """Residuals and derivatives of the closure for one batch of builds and clearances.

    A rigid lever is held by two lengths and the angle between its arms; three lengths would leave
    it loose to first order where its arms are in line.
    """

    def __init__(self, build: Build, clearances: Array) -> None:
        geometry = build.geometry
        self.build = build
        self.geometry = geometry
        grown = 1.0 + build.spread[:, None]
        self.at = {name: point[None, :] * grown for name, point in geometry.fixed.items()}
        self.plane = np.stack([geometry.along, geometry.across])
        self.origin = self.at["8"] - geometry.eight @ self.plane
        self.clearance = clearances
        self.spatial = clearances[:, 5:, :] @ self.plane
        lean = (np.sqrt(1.0 + build.lever_tilt**2) - 1.0)[:, None, None]
        direction = geometry.tilt_direction
        self.lever = np.eye(2) + lean * np.outer(direction, direction)
        self.angles = geometry.arm_angles[None, :] + np.stack(
            [
                np.zeros_like(build.twist),
                np.zeros_like(build.twist),
                build.twist,
                np.zeros_like(build.twist),
            ],
            axis=1,
        )

    def _in_lever(self, vectors: Array) -> Array:
        """Vectors of the sidestay plane as they lie in the tilted lever, (n, m, 2) [in]."""
        return vectors @ self.lever

    def vectors(self, unknown: Array) -> Array:
        """End-to-end vectors of the eleven distances, (n, 11, 3) [in]."""
        at, c, s = self.at, self.clearance, self.spatial
        d = np.zeros((unknown.shape[0], len(LENGTHS), 3))
        p1, p2, p3, p5, p6 = (unknown[:, 2 * i : 2 * i + 2] for i in range(5))
        d[:, 0, :2] = p1 - at["E"][:, :2]
        d[:, 1, :2] = p2 - at["E"][:, :2]
        d[:, 2, :2] = p1 - c[:, 0] - at["F"][:, :2]
        d[:, 3, :2] = p3 - at["Q"][:, :2]
        pivot = at["4"][:, :2] + c[:, 3]
        d[:, 4, :2] = p5 - pivot
        d[:, 5, :2] = p6 - pivot
        d[:, 4:6, :2] = self._in_lever(d[:, 4:6, :2])
        d[:, 6, :2] = p5 - p3 - c[:, 2] - c[:, 4]
        p7 = self.origin + unknown[:, 10:12] @ self.plane
        p9 = self.origin + unknown[:, 12:14] @ self.plane
        d[:, 7] = p7 - s[:, 0] - s[:, 1]
        d[:, 7, :2] -= p6
        pivot = at["8"] + s[:, 2]
        d[:, 8] = p7 - pivot
        d[:, 9] = p9 - pivot
        p10 = at["10"] + unknown[:, 14:] * self.geometry.axis
        d[:, 10] = p10 - p9 - s[:, 3] - s[:, 4]
        return d

    def arms(self, unknown: Array, vectors: Array) -> tuple[Array, Array]:
        """Arms of crank, slotted lever, locking lever and bellcrank in their planes, each (n, 4, 2)
        [in].
        """
        pin = unknown[:, 2:4] + self.clearance[:, 1] - self.at["Q"][:, :2]
        eight = self.geometry.eight + self.clearance[:, 7]
        first = np.stack(
            [vectors[:, 0, :2], pin, vectors[:, 4, :2], unknown[:, 10:12] - eight], axis=1
        )
        last = np.stack(
            [vectors[:, 1, :2], vectors[:, 3, :2], vectors[:, 5, :2], unknown[:, 12:14] - eight],
            axis=1,
        )
        return _turn(first, self.angles), last

    def residual(self, unknown: Array, vectors: Array) -> Array:
        """Closure errors, (n, 15) [in]."""
        lengths = self.build.lengths
        error = np.empty((unknown.shape[0], _UNKNOWNS))
        squares = np.einsum("nij,nij->ni", vectors, vectors)
        squares[:, (6, 7, 10)] += self.build.link_offset**2
        error[:, :_ANGLES] = (squares - lengths**2) / (2.0 * lengths)
        turned, arm = self.arms(unknown, vectors)
        cross = turned[..., 0] * arm[..., 1] - turned[..., 1] * arm[..., 0]
        error[:, _ANGLES:] = cross / self.geometry.arms
        return error

    def slopes(self, unknown: Array, vectors: Array) -> tuple[Array, Array, Array]:
        """Derivatives of the distances by their end vectors and of the angles by their two arms."""
        unit = vectors / self.build.lengths[:, :, None]
        unit[:, 4:6, :2] = self._in_lever(unit[:, 4:6, :2])
        turned, arm = self.arms(unknown, vectors)
        scale = self.geometry.arms[:, None]
        by_last = np.stack([-turned[..., 1], turned[..., 0]], axis=-1) / scale
        by_first = _turn(np.stack([arm[..., 1], -arm[..., 0]], axis=-1), -self.angles) / scale
        by_last[:, 2:3] = self._in_lever(by_last[:, 2:3])
        by_first[:, 2:3] = self._in_lever(by_first[:, 2:3])
        return unit, by_first, by_last

    def jacobian(self, unknown: Array, vectors: Array) -> Array:
        """Derivatives of the closure errors by the unknowns, (n, 15, 15) [-]."""
        unit, by_first, by_last = self.slopes(unknown, vectors)
        plane = unit @ self.plane.T
        j = np.zeros((unknown.shape[0], _UNKNOWNS, _UNKNOWNS))
        one, two, three, five, six, seven, nine = (slice(2 * i, 2 * i + 2) for i in range(7))
        j[:, 0, one] = unit[:, 0, :2]
        j[:, 1, two] = unit[:, 1, :2]
        j[:, 2, one] = unit[:, 2, :2]
        j[:, 3, three] = unit[:, 3, :2]
        j[:, 4, five] = unit[:, 4, :2]
        j[:, 5, six] = unit[:, 5, :2]
        j[:, 6, three] = -unit[:, 6, :2]
        j[:, 6, five] = unit[:, 6, :2]
        j[:, 7, six] = -unit[:, 7, :2]
        j[:, 7, seven] = plane[:, 7]
        j[:, 8, seven] = plane[:, 8]
        j[:, 9, nine] = plane[:, 9]
        j[:, 10, nine] = -plane[:, 10]
        j[:, 10, _PLUNGER] = unit[:, 10] @ self.geometry.axis
        for lever, (first, last) in enumerate(
            ((one, two), (two, three), (five, six), (seven, nine))
        ):
            j[:, _ANGLES + lever, first] = by_first[:, lever]
            j[:, _ANGLES + lever, last] = by_last[:, lever]
        return j

    def solve(self, start: Array) -> Array:
        """Close every row by Newton's method, (n, 15) [in]; NaN where the linkage does not
        close.
        """
        unknown = start.copy()
        with np.errstate(all="ignore"):
            for _ in range(_MAX_ITERATIONS):
                vectors = self.vectors(unknown)
                error = self.residual(unknown, vectors)
                worst = np.abs(error).max(axis=1)
                if not (worst > _TOLERANCE_IN).any():
                    break
                step = np.linalg.solve(self.jacobian(unknown, vectors), error[:, :, None])[:, :, 0]
                unknown -= step
            open_rows = ~(np.abs(self.residual(unknown, self.vectors(unknown))).max(axis=1) < 1e-10)
        unknown[open_rows] = np.nan
        return unknown

    def plunger_gradient(self, unknown: Array) -> Array:
        """Derivative of the plunger's travel by each clearance vector, (n, 10, 2) [-]."""
        vectors = self.vectors(unknown)
        selected = np.zeros((unknown.shape[0], _UNKNOWNS, 1))
        selected[:, _PLUNGER] = 1.0
        weight = np.linalg.solve(self.jacobian(unknown, vectors).transpose(0, 2, 1), selected)[
            :, :, 0
        ]
        unit, by_first, by_last = self.slopes(unknown, vectors)
        unit *= weight[:, :_ANGLES, None]
        by_first *= weight[:, _ANGLES:, None]
        by_last *= weight[:, _ANGLES:, None]
        plane = unit @ self.plane.T
        gradient = np.empty((unknown.shape[0], 10, 2))
        gradient[:, 0] = unit[:, 2, :2]
        gradient[:, 1] = -by_first[:, 1]
        gradient[:, 2] = gradient[:, 4] = unit[:, 6, :2]
        gradient[:, 3] = unit[:, 4, :2] + unit[:, 5, :2] + by_first[:, 2] + by_last[:, 2]
        gradient[:, 5] = gradient[:, 6] = plane[:, 7]
        gradient[:, 7] = plane[:, 8] + plane[:, 9] + by_first[:, 3] + by_last[:, 3]
        gradient[:, 8] = gradient[:, 9] = plane[:, 10]
        return gradient


def clearance_vectors(sizes: Array, angles: Array) -> Array:
    """Virtual links from their lengths and directions, (n, 10, 2) [in]."""
    return np.stack([sizes * np.cos(angles), sizes * np.sin(angles)], axis=-1)


def close(build: Build, clearances: Array, start: Array | None = None) -> Array:
    """Assemble the linkage with the given virtual links, (n, 10, 2) [in]: its positions, (n, 15)
    [in], NaN in a row that does not close.
    """
    if start is None:
        start = np.repeat(build.geometry.start[None, :], clearances.shape[0], axis=0)
    return _Equations(build, clearances).solve(start)


def closure_error(build: Build, clearances: Array, unknown: Array) -> Array:
    """Largest closure error of every row, (n,) [in]."""
    equations = _Equations(build, clearances)
    worst: Array = np.abs(equations.residual(unknown, equations.vectors(unknown))).max(axis=1)
    return worst


def reading(build: Build, unknown: Array) -> Array:
    """Calibrated plunger displacement from the nominal mid-position, (n,) [in]."""
    return build.geometry.rate * unknown[:, _PLUNGER]


def plunger_gradient(build: Build, clearances: Array, unknown: Array) -> Array:
    """Derivative of the calibrated displacement by every virtual link, (n, 10, 2)."""
    return build.geometry.rate * _Equations(build, clearances).plunger_gradient(unknown)


def worst_directions(build: Build, sizes: Array, rounds: int = 2) -> tuple[Array, Array]:
    """Directions of the virtual links that push the plunger furthest into over-travel.

    At the maximum every virtual link points along the plunger's derivative by that link. The
    directions are laid along it, the linkage is closed again, and so on; each round shrinks the
    error by a factor of the order of clearance over link length.

    Returns angles: Directions, (n, 10) [rad]; unknown: Positions with the last directions, (n, 15)
    [in].
    """
    angles = np.repeat(build.geometry.angles[None, :], sizes.shape[0], axis=0)
    vectors = clearance_vectors(sizes, angles)
    unknown = close(build, vectors)
    for _ in range(rounds):
        gradient = plunger_gradient(build, vectors, unknown)
        angles = np.arctan2(gradient[..., 1], gradient[..., 0])
        vectors = clearance_vectors(sizes, angles)
        unknown = close(build, vectors, unknown)
    return angles, unknown


def _distances(points: dict[str, Array]) -> Array:
    pairs = ("E 1", "E 2", "F 1", "Q 3", "4 5", "4 6", "3 5", "6 7", "8 7", "8 9", "9 10")
    ends = [pair.split() for pair in pairs]
    return np.array([np.linalg.norm(points[a] - points[b]) for a, b in ends])


def _arm_angles(mid: dict[str, list[float]]) -> tuple[Array, Array]:
    """Angle between the arms of each lever in its plane, and the length of its first arm."""
    angles, lengths = [], []
    for pivot, first, last in (("E", "1", "2"), ("Q", "2", "3"), ("4", "5", "6"), ("8", "7", "9")):
        one, two = (np.array(mid[end]) - np.array(mid[pivot]) for end in (first, last))
        angles.append(np.arctan2(two[1], two[0]) - np.arctan2(one[1], one[0]))
        lengths.append(np.linalg.norm(one))
    return np.array(angles), np.array(lengths)


def _travel_rate(geometry: Geometry) -> float:
    """Rate that makes the travel from the lowest reading of the release to mid-position 0.45 in."""
    build = Build.nominal(geometry, 1)
    unknown = geometry.start[None, :].copy()
    none = np.zeros((1, 10, 2))
    strokes = np.linspace(0.0, geometry.stroke, _START_MIN_STEPS + 1)
    travel = [0.0]
    for stroke in strokes[1:]:
        build.length("F1")[:] = geometry.lengths[2] - stroke
        unknown = close(build, none, unknown)
        travel.append(float(unknown[0, _PLUNGER]))
    values = np.array(travel)
    if not np.isfinite(values).all():
        raise ClosureError(f"Linkage {geometry.name} does not close over its release stroke.")
    sign = 1.0 if values[-1] < 0.0 else -1.0
    lowest = int(np.argmin(sign * values))
    near = slice(max(lowest - 2, 0), lowest + 3)
    fit = np.polynomial.Polynomial.fit(
        strokes[near], sign * values[near], min(4, len(values[near]) - 1)
    )
    fine = fit(np.linspace(strokes[near][0], strokes[near][-1], 4001))
    return float(sign * 0.45 / -fine.min())


def names() -> tuple[str, ...]:
    """Letters of the stored linkages."""
    return tuple(_stored())


@lru_cache(maxsize=1)
def _stored() -> dict[str, dict[str, Any]]:
    text = Path(__file__).with_name("coordinates.json").read_text(encoding="utf-8")
    stored: dict[str, dict[str, Any]] = json.loads(text)["linkages"]
    return stored


def _between(one: Any, other: Any, share: float) -> Any:
    if isinstance(one, dict):
        return {
            key: _between(value, other[key], share) for key, value in one.items() if key in other
        }
    if isinstance(one, list):
        return [_between(a, b, share) for a, b in zip(one, other, strict=True)]
    return one + share * (other - one) if isinstance(one, float) else one


def _drawing(name: str) -> dict[str, Any]:
    letters, _, share = name.partition(":")
    if not share:
        return _stored()[name]
    one, other = letters.split("-")
    blend: dict[str, Any] = _between(_stored()[one], _stored()[other], float(share))
    return blend


@lru_cache(maxsize=64)
def load(name: str = "A") -> Geometry:
    """Drawing data of one stored linkage, or of one between two, calibrated."""
    data = _drawing(name)
    mid = data["mid_position_in"]
    tau, delta, beta = (
        np.radians(data[k]) for k in ("tau_deg", "dihedral_deg", "plunger_axis_deg")
    )
    along = np.array([np.cos(tau), np.sin(tau), 0.0])
    across = np.array([-np.cos(delta) * np.sin(tau), np.cos(delta) * np.cos(tau), np.sin(delta)])
    plane = np.stack([along, across])
    hinge = _flat(mid["6"])
    fixed = {key: _flat(mid[key]) for key in ("F", "E", "Q", "4")}
    moving = {key: _flat(mid[key]) for key in ("1", "2", "3", "5", "6")}
    fixed |= {key: hinge + np.array(mid[key]) @ plane for key in ("8", "10")}
    moving |= {key: hinge + np.array(mid[key]) @ plane for key in ("7", "9")}
    arm_angles, arms = _arm_angles(mid)
    bisector = moving["5"] / np.linalg.norm(moving["5"]) + moving["6"] / np.linalg.norm(moving["6"])
    start = np.array([x for key in ("1", "2", "3", "5", "6", "7", "9") for x in mid[key]] + [0.0])
    draft = Geometry(
        name=name,
        fixed=fixed,
        start=start,
        lengths=_distances(fixed | moving),
        arm_angles=arm_angles,
        arms=arms,
        along=along,
        across=across,
        eight=np.array(mid["8"]),
        axis=np.cos(beta) * along + np.sin(beta) * across,
        tilt_direction=bisector[:2] / np.linalg.norm(bisector[:2]),
        stroke=float(data["release_stroke_in"]),
        rate=1.0,
        angles=np.zeros(10),
    )
    rate = _travel_rate(draft)
    build = Build.nominal(draft, 1)
    gradient = rate * plunger_gradient(build, np.zeros((1, 10, 2)), start[None, :])[0]
    return Geometry(
        **{
            field: getattr(draft, field)
            for field in draft.__slots__
            if field not in ("rate", "angles")
        },
        rate=rate,
        angles=np.arctan2(gradient[:, 1], gradient[:, 0]),
    )
