"""Points, angles and rotations in space: Eqs. 3 to 6 of the paper (section 3.1), and the solver."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from numpy.typing import ArrayLike, NDArray

from mlg_troubleshoot.geometry.kernel import Kernel
from mlg_troubleshoot.geometry.mechanism import Dyad, Mechanism, Output, Plane, Point

Vector = NDArray[np.float64]


def angle_from_sides(ab: ArrayLike, ca: ArrayLike, bc: ArrayLike) -> Vector:
    """Angle CAB of a triangle from its three sides, by the second law of cosines (Eq. 3).

    ab, ca, bc: lengths of the sides AB, CA and BC. [in]
    Returns: angle CAB; NaN where the sides make no triangle. [rad]
    """
    ab, ca, bc = np.asarray(ab, float), np.asarray(ca, float), np.asarray(bc, float)
    with np.errstate(invalid="ignore"):
        angle: Vector = np.arccos((ab**2 + ca**2 - bc**2) / (2 * ab * ca))
    return angle


def skew(normal: ArrayLike) -> Vector:
    """Skew-symmetric matrix of a vector: ``skew(a) @ b`` is the cross product a × b (Eqs. 4 and 5).

    normal, shape (3,): unit normal of a plane. [1]
    Returns, shape (3, 3): the matrix. [1]
    """
    w1, w2, w3 = np.asarray(normal, float)
    return np.array([[0.0, -w3, w2], [w3, 0.0, -w1], [-w2, w1, 0.0]])


def rotation(normal: ArrayLike, angle: float) -> Vector:
    """Rotation about an axis by Rodrigues' formula, the bracket of Eq. 6.

    normal, shape (3,): unit vector along the axis. [1]
    angle: angle of the rotation, right-handed about the axis. [rad]
    Returns, shape (3, 3): the rotation matrix. [1]
    """
    w = skew(normal)
    matrix: Vector = np.eye(3) + w * np.sin(angle) + w @ w * (1.0 - np.cos(angle))
    return matrix


def locate_joint(a: ArrayLike, b: ArrayLike, ca: float, bc: float, normal: ArrayLike) -> Vector:
    """Coordinates of joint C of two links CA and BC, from joints A and B and their plane (Eq. 6).

    a, b, shape (3,): joints A and B. [in] ca, bc: lengths of the links CA and BC. [in] normal,
    shape (3,): unit normal of the plane, on the side about which AB turns to the left onto AC. [1]
    Returns, shape (3,): joint C; NaN if the links do not reach each other. [in]
    """
    start = np.asarray(a, float)
    ab = np.asarray(b, float) - start
    distance = float(np.linalg.norm(ab))
    angle = float(angle_from_sides(distance, ca, bc))
    located: Vector = start + ca / distance * (rotation(normal, angle) @ ab)
    return located


coordinate = st.floats(-10, 10)
vector = st.tuples(coordinate, coordinate, coordinate).map(np.array)
angle = st.floats(-math.pi, math.pi)


@given(
    a=st.tuples(coordinate, coordinate),
    b=st.tuples(coordinate, coordinate),
    c=st.tuples(coordinate, coordinate),
    shift=st.tuples(st.floats(-0.05, 0.05), st.floats(-0.05, 0.05)),
    direction=angle,
    dihedral=angle,
)
def test_the_solver_locates_a_dyad_where_equation_six_does(a, b, c, shift, direction, dihedral):
    ab, ac = np.subtract(b, a), np.subtract(c, a)
    cross = float(ab[0] * ac[1] - ab[1] * ac[0])
    assume(
        abs(cross) > 1.0 and np.linalg.norm(ac) > 0.5 and np.linalg.norm(np.subtract(c, b)) > 0.5
    )
    sign = math.copysign(1.0, cross)
    mechanism = Mechanism(
        (Plane("base"), Plane("tilted", "base", "hinge", direction, dihedral)),
        (
            Point("hinge", "base", 1.0, 2.0, fixed=True),
            Point("A", "tilted", *a, fixed=True, virtual_link=1),
            Point("B", "tilted", *b, fixed=True),
            Point("C", "tilted", *c),
        ),
        (Dyad("C", "A", "B"),),
        Output("angle", "C", "B"),
        0.0,
    )
    kernel = Kernel(mechanism)
    x, y = kernel.positions(0.0, list(shift))["C"]
    origin, axes = mechanism.frame("tilted")
    in_space = origin + float(x) * axes[0] + float(y) * axes[1]
    moved_a = mechanism.reference_in_space("A") + shift[0] * axes[0] + shift[1] * axes[1]
    lengths = float(np.linalg.norm(ac)), float(np.linalg.norm(np.subtract(c, b)))
    expected = locate_joint(moved_a, mechanism.reference_in_space("B"), *lengths, sign * axes[2])
    assert in_space == pytest.approx(expected, abs=1e-7, nan_ok=True)
