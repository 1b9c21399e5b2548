"""Properties of the solver that hold for every mechanism; what is said of one that is not valid."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from mlg_troubleshoot.errors import MechanismError
from mlg_troubleshoot.gear.gear import Gear, Linkage
from mlg_troubleshoot.gear.linkage import Calibration, LinkageModel, links_from
from mlg_troubleshoot.geometry.kernel import CHUNK, Kernel, numba_is_installed
from mlg_troubleshoot.geometry.mechanism import (
    Crank,
    Dyad,
    Lever,
    Mechanism,
    Output,
    Plane,
    Point,
    Slot,
)
from mlg_troubleshoot.geometry.program import write_program

clearances = arrays(float, 10, elements=st.floats(0, 0.015))
directions = arrays(float, 10, elements=st.floats(-np.pi, np.pi))
# Directions of the joints of the base plane turn with it; those of the hinged plane are seen from
# that plane.
IN_BASE_PLANE = 5


def in_space(
    mechanism: Mechanism, place: dict, name: str, shift: np.ndarray | float = 0.0
) -> np.ndarray:
    """Coordinates of a point in space, shape (..., 3), shifted in its plane or in the plane named
    with it.
    """
    origin, axes = mechanism.frame(mechanism.point(name).plane)
    x, y = place[name]
    return origin + np.multiply.outer(x, axes[0]) + np.multiply.outer(y, axes[1]) + shift


def link_error(linkage: Linkage, kernel: Kernel, n: int = 60) -> float:
    """Largest error of any link or lever length over random clearances and strokes."""
    rng = np.random.default_rng(3)
    mechanism = linkage.mechanism
    stroke = rng.uniform(*linkage.stroke, n)
    links = links_from(rng.uniform(0, 0.015, (n, 10)), rng.uniform(0, 2 * np.pi, (n, 10)))
    place = kernel.positions(stroke, links)
    at_reference = mechanism.reference_in_space

    def virtual(plane: str, *numbers: int) -> np.ndarray:
        _, axes = mechanism.frame(plane)
        x, y = (sum(links[2 * (k - 1) + i] for k in numbers) for i in (0, 1))
        return np.multiply.outer(x, axes[0]) + np.multiply.outer(y, axes[1])

    errors = []
    for a, b, moved_by in (
        ("F", "1", virtual("sidestay", 1)),
        ("3", "5", virtual("sidestay", 3, 5)),
        ("6", "7", virtual("link_assembly", 6, 7)),
        ("9", "10", virtual("link_assembly", 9, 10)),
        *((a, b, 0.0) for a, b in ("E1", "E2", "12", "Q3", "45", "46", "56", "87", "89", "79")),
    ):
        nominal = np.linalg.norm(at_reference(a) - at_reference(b))
        if a == "F":
            nominal = nominal + stroke - mechanism.reference_input
        found = np.linalg.norm(
            in_space(mechanism, place, b) - in_space(mechanism, place, a, moved_by), axis=-1
        )
        errors.append(np.max(np.abs(found - nominal)))
    return float(np.max(errors))


def test_link_and_lever_lengths_survive_solving_on_every_linkage(gear: Gear) -> None:
    errors = [
        link_error(m, model.kernel)
        for m, model in zip(gear.ensemble, gear.ensemble_models, strict=True)
    ]
    assert max(errors) < 1e-12


def test_the_pin_stays_in_its_slot(gear: Gear) -> None:
    rng = np.random.default_rng(5)
    mechanism, n = gear.reference.mechanism, 60
    links = links_from(rng.uniform(0, 0.015, (n, 10)), rng.uniform(0, 2 * np.pi, (n, 10)))
    place = gear.model.kernel.positions(rng.uniform(*gear.reference.stroke, n), links)
    pivot, pin, arm = (
        np.array([mechanism.point(p).x, mechanism.point(p).y]) for p in ("Q", "2", "3")
    )

    def opening(pin_at: np.ndarray, arm_at: np.ndarray) -> np.ndarray:
        to_pin, to_arm = pin_at - pivot, arm_at - pivot
        cross = to_pin[..., 0] * to_arm[..., 1] - to_pin[..., 1] * to_arm[..., 0]
        return np.arctan2(cross, np.sum(to_pin * to_arm, axis=-1))

    found = opening(np.stack(place["2"], -1) + np.stack(links[2:4], -1), np.stack(place["3"], -1))
    assert found == pytest.approx(np.full(n, opening(pin, arm)), abs=1e-12)


def moved(mechanism: Mechanism, turn: float, along: tuple[float, float]) -> Mechanism:
    """The whole mechanism turned and shifted in the base plane."""
    c, s = np.cos(turn), np.sin(turn)
    points = tuple(
        (
            replace(p, x=c * p.x - s * p.y + along[0], y=s * p.x + c * p.y + along[1])
            if p.plane == "sidestay"
            else p
        )
        for p in mechanism.points
    )
    planes = tuple(
        (
            plane
            if plane.parent is None
            else replace(plane, hinge_direction=plane.hinge_direction + turn)
        )
        for plane in mechanism.planes
    )
    return Mechanism(planes, points, mechanism.steps, mechanism.output, mechanism.reference_input)


@given(
    turn=st.floats(-np.pi, np.pi),
    along=st.tuples(st.floats(-20, 20), st.floats(-20, 20)),
    clearance=clearances,
    direction=directions,
)
def test_a_rigid_motion_of_the_whole_mechanism_changes_nothing(
    gear, turn, along, clearance, direction
):
    kernel = Kernel(moved(gear.reference.mechanism, turn, along))
    turned = direction + turn * (np.arange(10) < IN_BASE_PLANE)
    for stroke in gear.reference.stroke:
        before = gear.model.kernel.output(stroke, links_from(clearance, direction))
        assert float(kernel.output(stroke, links_from(clearance, turned))) == pytest.approx(
            float(before), abs=1e-11
        )


def test_a_batch_equals_a_loop(gear: Gear) -> None:
    rng = np.random.default_rng(6)
    clearance, direction = rng.uniform(0, 0.015, (50, 10)), rng.uniform(0, 2 * np.pi, (50, 10))
    batch = gear.model.displacement(links_from(clearance, direction))
    loop = [
        float(gear.model.displacement(links_from(c, d)))
        for c, d in zip(clearance, direction, strict=True)
    ]
    assert batch == pytest.approx(loop, abs=1e-14)


def test_a_batch_in_fixed_directions_equals_the_general_one_across_chunks(gear: Gear) -> None:
    rng = np.random.default_rng(7)
    clearance, direction = rng.uniform(0, 0.015, (CHUNK + 1, 10)), rng.uniform(0, 2 * np.pi, 10)
    batch = gear.model.kernel.batch(gear.reference.stroke[1], clearance.T, direction)
    general = gear.model.kernel.output(gear.reference.stroke[1], links_from(clearance, direction))
    assert batch == pytest.approx(general, abs=1e-14)


@pytest.mark.skipif(not numba_is_installed(), reason="the extra 'fast' is not installed")
def test_the_compiled_loop_equals_numpy_and_gives_nan_at_the_same_samples(gear: Gear) -> None:
    rng = np.random.default_rng(8)
    clearance, direction = rng.uniform(0, 0.015, (10, 2000)), rng.uniform(0, 2 * np.pi, 10)
    clearance[:, ::10] = rng.uniform(0, 2, (10, 200))
    stroke = gear.reference.stroke[1]
    plain = gear.model.kernel.batch(stroke, clearance, direction)
    compiled = gear.model.kernel.batch(stroke, clearance, direction, compiled=True)
    assert 0 < np.isnan(plain).sum() < 200
    assert compiled == pytest.approx(plain, abs=2e-14, nan_ok=True)


@pytest.mark.parametrize("ends", [(3, 5), (6, 7), (9, 10)])
@given(clearance=clearances, direction=directions)
def test_swapping_the_two_ends_of_one_link_changes_nothing(gear, ends, clearance, direction):
    first, second = (end - 1 for end in ends)
    swapped = np.arange(10)
    swapped[[first, second]] = second, first
    before = gear.model.displacement(links_from(clearance, direction))
    after = gear.model.displacement(links_from(clearance[swapped], direction[swapped]))
    assert float(after) == pytest.approx(float(before), abs=1e-13)


def test_swapping_joints_of_different_links_changes_the_result(gear: Gear) -> None:
    clearance = np.zeros((2, 10))
    clearance[0, 0] = clearance[1, 1] = 0.01
    first, second = gear.model.displacement(links_from(clearance, np.zeros(10)))
    assert abs(first - second) > 1e-3


@given(clearance=arrays(float, 10, elements=st.floats(0.001, 0.01)), direction=directions)
def test_opposite_directions_cancel_to_first_order(gear, clearance, direction):
    def remainder(size: float) -> float:
        there = gear.model.displacement(links_from(size * clearance, direction))
        back = gear.model.displacement(links_from(size * clearance, direction + np.pi))
        return float(there + back)

    assert remainder(0.5) == pytest.approx(remainder(1.0) / 4, rel=0.05, abs=2e-6)


def test_a_sample_that_does_not_close_is_nan_and_its_neighbours_are_not(gear: Gear) -> None:
    clearance = np.zeros((3, 10))
    clearance[1, 0] = 30.0
    assert np.isnan(gear.model.displacement(links_from(clearance, np.zeros(10)))).tolist() == [
        False,
        True,
        False,
    ]


def test_numbers_of_the_mechanism_can_differ_row_by_row(gear: Gear) -> None:
    kernel = gear.model.kernel
    nominal = float(kernel.parameters[kernel.parameter_names.index("length.3-5")])
    changed = {"length.3-5": nominal + np.array([0.0, 0.01])}
    moved_by = gear.model.displacement(gear.model.kernel.no_clearance(), changed)
    link = gear.model.displacement(links_from(np.eye(10)[2] * 0.01, np.zeros(10)))
    assert moved_by[0] == 0.0
    assert abs(moved_by[1]) > 0.5 * abs(float(link))


def test_an_unknown_number_of_the_mechanism_is_refused(gear: Gear) -> None:
    with pytest.raises(KeyError, match=r"length\.9-99"):
        gear.model.displacement(gear.model.kernel.no_clearance(), {"length.9-99": 1.0})


PLANES = (Plane("base"),)
POINTS = (
    Point("O", "base", 0.0, 0.0, fixed=True),
    Point("P", "base", 6.0, 0.0, fixed=True, virtual_link=2),
    Point("A", "base", 2.0, 0.0),
    Point("B", "base", 0.0, 45**0.5),
)
STEPS = (Crank("A", "O"), Dyad("B", "A", "P", (1,)))
OUTPUT = Output("angle", "B", "P")


def build(**changes: Any) -> Mechanism:
    parts = {
        "planes": PLANES,
        "points": POINTS,
        "steps": STEPS,
        "output": OUTPUT,
        "reference_input": 0.0,
    }
    return Mechanism(**{**parts, **changes})


def test_a_valid_mechanism_lists_its_virtual_links_in_order() -> None:
    assert build().virtual_links == (1, 2)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"planes": (*PLANES, Plane("up", "above", "O"))}, "'up' is hinged to 'above'"),
        ({"planes": (*PLANES, Plane("up", "base", "nowhere"))}, "'up' is hinged at 'nowhere'"),
        (
            {"planes": (*PLANES, Plane("up", "base", "O"), Plane("high", "up", "P"))},
            "'high' is hinged at 'P'",
        ),
    ],
)
def test_a_mechanism_that_refers_to_what_is_not_there_is_refused_by_name(changes, words):
    with pytest.raises(MechanismError, match=words):
        build(**changes)


def replaced(name: str, **coordinates: float) -> tuple[Point, ...]:
    return tuple(replace(p, **coordinates) if p.name == name else p for p in POINTS)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"points": replaced("A", x=0.0)}, "O-A has no length"),
        ({"points": replaced("B", x=4.0, y=0.0)}, "'B' is in line with 'A' and 'P'"),
        ({"output": Output("position", "B")}, "position of 'B', which is not a slider"),
        (
            {"points": replaced("P", x=0.0), "steps": (STEPS[0], Lever("B", "P", "O"))},
            "P-O has no length",
        ),
        (
            {"points": replaced("P", x=2.0), "steps": (STEPS[0], Slot("B", "P", "A"))},
            "P-A has no length",
        ),
    ],
)
def test_a_mechanism_whose_numbers_make_no_sense_is_refused_by_name(changes, words):
    mechanism = build(**changes)
    with pytest.raises(MechanismError, match=words):
        write_program(mechanism)


def test_a_step_across_planes_that_cannot_cross_them_is_refused() -> None:
    mechanism = build(
        planes=(*PLANES, Plane("up", "base", "O", 0.0, 0.5)),
        points=(*POINTS[:2], replace(POINTS[2], plane="up"), POINTS[3]),
    )
    with pytest.raises(MechanismError, match="'O' is not in the plane 'up'"):
        write_program(mechanism)


def test_a_linkage_that_does_not_close_over_its_stroke_is_refused_with_the_share_that_closes():
    with pytest.raises(MechanismError, match=r"closes over only \d+ % of its stroke"):
        LinkageModel(build(points=replaced("B", x=4.0, y=1.0)), (0.0, 3.0), Calibration())
