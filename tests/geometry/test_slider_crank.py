"""An offset slider-crank, written as a gear file, against its textbook formula."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mlg_troubleshoot.gear.gear_file import load_gear
from mlg_troubleshoot.gear.linkage import LinkageModel, worst_case
from mlg_troubleshoot.geometry.kernel import Kernel
from mlg_troubleshoot.geometry.mechanism import Crank, Mechanism, Output, Plane, Point, Slider

CRANK, ROD, OFFSET = 2.0, 5.0, 1.0


@pytest.fixture(scope="module")
def model() -> LinkageModel:
    return load_gear(Path(__file__).parent / "data" / "slider-crank.toml").model


def slider(angle: float, rod: float = ROD) -> float:
    """Position of the slider from its place at crank angle 0: the textbook formula."""
    at_zero = CRANK + math.sqrt(ROD**2 - OFFSET**2)
    return (
        CRANK * math.cos(angle)
        + math.sqrt(rod**2 - (CRANK * math.sin(angle) + OFFSET) ** 2)
        - at_zero
    )


@given(angle=st.floats(-math.pi, math.pi))
def test_the_slider_follows_the_textbook_formula(model: LinkageModel, angle: float) -> None:
    found = float(model.kernel.output(angle, model.kernel.no_clearance()))
    assert found == pytest.approx(slider(angle), abs=1e-13)


def test_the_worst_case_is_a_rod_longer_or_shorter_by_all_clearances(model: LinkageModel) -> None:
    clearance = np.array([[0.004, 0.01, 0.006]])
    worst = worst_case(model, clearance)
    exact = [slider(1.0, ROD + sense * clearance.sum()) - slider(1.0) for sense in (1, -1)]
    assert (worst.over_in[0], worst.under_in[0]) == pytest.approx(exact, rel=1e-5)


def test_the_amplification_is_the_secant_of_the_rod_to_the_axis(model: LinkageModel) -> None:
    inclination = math.asin((CRANK * math.sin(1.0) + OFFSET) / ROD)
    assert model.plunger_amplification() == pytest.approx(np.full(3, 1 / math.cos(inclination)))


def test_a_rod_that_is_too_short_gives_not_a_number(model: LinkageModel) -> None:
    assert math.isnan(model.kernel.output(1.0, [0.0, 3.0, 0.0, 0.0, 0.0, 0.0]))


def test_a_rod_out_of_the_plane_of_its_slider_keeps_its_length() -> None:
    tilt = 0.6
    mechanism = Mechanism(
        planes=(Plane("base"), Plane("tilted", "base", "H", 0.0, tilt)),
        points=(
            Point("O", "base", 0.0, 0.0, fixed=True),
            Point("H", "base", 3.0, 0.0, fixed=True),
            Point("A", "base", 1.0, 0.0),
            Point("B", "tilted", 1.0, 0.5),
        ),
        steps=(Crank("A", "O"), Slider("B", "A", 0.0)),
        output=Output("position", "B"),
        reference_input=0.0,
    )
    angle = np.linspace(-0.5, 0.5, 7)
    found = Kernel(mechanism).positions(angle, [])
    u, v = found["B"]
    apart = (3.0 + u - np.cos(angle), v * np.cos(tilt) - np.sin(angle), v * np.sin(tilt))
    assert np.sqrt(sum(side**2 for side in apart)) == pytest.approx(np.full(7, np.hypot(3.0, 0.5)))


def test_a_plane_is_turned_out_of_its_parent_by_the_right_hand() -> None:
    planes = (Plane("base"), Plane("tilted", "base", "H", 0.0, 0.6))
    points = (Point("H", "base", 3.0, 0.0, fixed=True), Point("K", "tilted", 0.0, 1.0, fixed=True))
    mechanism = Mechanism(planes, points, (), Output("angle", "K", "H"), 0.0)
    assert mechanism.reference_in_space("K") == pytest.approx([3.0, np.cos(0.6), np.sin(0.6)])
