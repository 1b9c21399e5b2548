"""Equations 3 to 6 of the paper (section 3.1), and that the solver's in-plane formulas are the same
equations.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from mlg_troubleshoot.geometry.kernel import Kernel
from mlg_troubleshoot.geometry.mechanism import Dyad, Mechanism, Output, Plane, Point

from .vectors import locate_joint

coordinate = st.floats(-10, 10)
vector = st.tuples(coordinate, coordinate, coordinate).map(np.array)
angle = st.floats(-math.pi, math.pi)


def unit(v: np.ndarray) -> np.ndarray:
    assume(np.linalg.norm(v) > 0.1)
    return v / np.linalg.norm(v)


@given(a=vector, b=vector, normal=vector, ca=st.floats(0.5, 20), bc=st.floats(0.5, 20))
def test_the_located_joint_is_at_both_link_lengths_in_the_plane_to_the_left(a, b, normal, ca, bc):
    ab = b - a
    distance = np.linalg.norm(ab)
    assume(abs(ca - bc) + 0.01 < distance < ca + bc - 0.01)
    across = np.cross(unit(ab), normal)
    omega = unit(np.cross(across, ab))
    c = locate_joint(a, b, ca, bc, omega)
    assert np.linalg.norm(c - a) == pytest.approx(ca)
    assert np.linalg.norm(c - b) == pytest.approx(bc)
    assert omega @ (c - a) == pytest.approx(0.0, abs=1e-9)
    assert omega @ np.cross(ab, c - a) > 0


def test_links_that_do_not_reach_each_other_locate_no_joint() -> None:
    assert np.all(np.isnan(locate_joint([0, 0, 0], [10, 0, 0], 4, 5, [0, 0, 1])))


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


def test_the_left_of_a_line_is_where_its_normal_turns_it() -> None:
    assert locate_joint([0, 0, 0], [5, 0, 0], 3, 4, [0, 0, 1]) == pytest.approx([1.8, 2.4, 0.0])
