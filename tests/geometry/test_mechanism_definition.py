"""A mechanism exists only when it is valid; what is wrong is said with the names involved."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from mlg_troubleshoot.errors import MechanismError
from mlg_troubleshoot.gear.model import Calibration, LinkageModel
from mlg_troubleshoot.geometry.mechanism import (
    Crank,
    Dyad,
    Lever,
    Mechanism,
    Output,
    Plane,
    Point,
    Slider,
    Slot,
)
from mlg_troubleshoot.geometry.program import write_program

PLANES = (Plane("base"),)
POINTS = (
    Point("O", "base", 0.0, 0.0, fixed=True),
    Point("P", "base", 6.0, 0.0, fixed=True, virtual_link=2),
    Point("A", "base", 2.0, 0.0),
    Point("B", "base", 0.0, 45**0.5),
)
STEPS = (Crank("A", "O"), Dyad("B", "A", "P", 1.0, (1,)))
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
        ({"points": (*POINTS, Point("A", "base", 1.0, 1.0))}, "'A' is defined 2 times"),
        ({"points": (*POINTS[:3], Point("B", "other", 0.0, 6.7))}, "'B' lies in plane 'other'"),
        ({"points": POINTS[:3]}, "'B' locates a point that has no coordinates"),
        ({"points": (*POINTS, Point("C", "base", 1.0, 1.0))}, "'C' is neither fixed nor located"),
        ({"planes": (*PLANES, Plane("up", "above", "O"))}, "'up' is hinged to 'above'"),
        ({"planes": (*PLANES, Plane("up", "base", "nowhere"))}, "'up' is hinged at 'nowhere'"),
        ({"steps": STEPS[::-1]}, "'B' needs 'A'"),
        (
            {"steps": (*STEPS, Crank("A", "O"))},
            "'A' locates a point that is fixed or located before",
        ),
        ({"steps": (*STEPS[:1], Dyad("B", "A", "P", 1.0, (2,)))}, "virtual link is used twice"),
        ({"output": Output("angle", "C", "P")}, "reads 'C'"),
        ({"output": Output("angle", "B")}, "an angle about ''"),
    ],
)
def test_a_mechanism_that_refers_to_what_is_not_there_is_refused_by_name(
    changes: dict[str, Any], words: str
) -> None:
    with pytest.raises(MechanismError, match=words):
        build(**changes)


def replaced(name: str, **coordinates: float) -> tuple[Point, ...]:
    return tuple(replace(p, **coordinates) if p.name == name else p for p in POINTS)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"points": replaced("A", x=0.0)}, "O-A has no length"),
        ({"steps": (*STEPS[:1], Dyad("B", "A", "P", -1.0, (1,)))}, "'B' has the sign -1"),
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
def test_a_mechanism_whose_numbers_make_no_sense_is_refused_by_name(
    changes: dict[str, Any], words: str
) -> None:
    mechanism = build(**changes)
    with pytest.raises(MechanismError, match=words):
        write_program(mechanism)


def test_a_slider_on_the_wrong_side_of_its_sign_is_refused() -> None:
    mechanism = build(
        steps=(STEPS[0], Slider("B", "A", 0.0, 1.0)), output=Output("position", "B"), points=POINTS
    )
    with pytest.raises(MechanismError, match="'B' has the sign"):
        write_program(mechanism)


def test_a_step_across_planes_that_cannot_cross_them_is_refused() -> None:
    mechanism = build(
        planes=(*PLANES, Plane("up", "base", "O", 0.0, 0.5)),
        points=(*POINTS[:2], replace(POINTS[2], plane="up"), POINTS[3]),
    )
    with pytest.raises(MechanismError, match="'O' is not in the plane 'up'"):
        write_program(mechanism)


def test_a_plane_hinged_at_a_point_of_another_plane_is_refused() -> None:
    mechanism = build(planes=(*PLANES, Plane("up", "base", "O"), Plane("high", "up", "P")))
    with pytest.raises(MechanismError, match="'high' is hinged at 'P'"):
        mechanism.frame("high")


def test_a_linkage_that_does_not_close_over_its_stroke_is_refused_with_the_share_that_closes() -> (
    None
):
    with pytest.raises(MechanismError, match=r"closes over only \d+ % of its stroke"):
        LinkageModel(build(points=replaced("B", x=4.0, y=1.0)), (0.0, 3.0), Calibration())
