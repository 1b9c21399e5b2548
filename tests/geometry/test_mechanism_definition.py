"""A mechanism exists only when it is valid; what is wrong is said with the names involved."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from mlg_troubleshoot.errors import MechanismError
from mlg_troubleshoot.gear.linkage import Calibration, LinkageModel
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
