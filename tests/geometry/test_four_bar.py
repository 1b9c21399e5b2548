"""A four-bar linkage, written as a gear file: the engine knows no aircraft.

Numbers of the linkage 6-2-7-9 (ground, crank, coupler, rocker) at a crank angle of 30°.
"""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.gear.gear_file import load_gear
from mlg_troubleshoot.gear.linkage import LinkageModel, links_from, worst_case

CRANK_RAD = math.pi / 6
COUPLER, ROCKER = 7.0, 9.0
CLEARANCE = 0.01
# The exact worst directions make the coupler longer or shorter by all four clearances.
WORST_OVER_RAD, WORST_UNDER_RAD = 0.0093404444, -0.0093194819


@pytest.fixture(scope="module")
def four_bar() -> Gear:
    return load_gear(Path(__file__).parent / "data" / "four-bar.toml")


@pytest.fixture(scope="module")
def model(four_bar: Gear) -> LinkageModel:
    return four_bar.model


def angles_deg(model: LinkageModel, sign: float) -> tuple[float, float]:
    """Angles of coupler and rocker at the published crank angle."""
    numbers = model.numbers({"sign.B": sign})
    place = model.kernel.positions(CRANK_RAD, model.kernel.no_clearance(), numbers)
    (ax, ay), (bx, by), (ox, oy) = place["A"], place["B"], place["O4"]
    return math.degrees(math.atan2(by - ay, bx - ax)), math.degrees(math.atan2(by - oy, bx - ox))


def rocker_turn(model: LinkageModel, coupler: float) -> float:
    turned = model.kernel.output(
        CRANK_RAD, model.kernel.no_clearance(), model.numbers({"length.A-B": coupler})
    ) - model.kernel.output(CRANK_RAD, model.kernel.no_clearance())
    return float(turned)


def test_the_open_linkage_has_the_published_angles(model: LinkageModel) -> None:
    assert angles_deg(model, +1.0) == pytest.approx((88.8372413003, 117.2860678604), abs=1e-9)


def test_the_crossed_linkage_has_the_published_angles(model: LinkageModel) -> None:
    assert angles_deg(model, -1.0) == pytest.approx((-115.2108121643, -143.6596387244), abs=1e-9)


def test_equal_clearances_at_the_four_joints_contribute_equally(model: LinkageModel) -> None:
    # Ting and Zhu (2000).
    assert model.plunger_amplification() == pytest.approx(np.full(4, 0.2332436), abs=5e-8)


def test_the_contribution_is_one_over_rocker_times_sine_of_the_transmission_angle(model):
    coupler, rocker = np.radians(angles_deg(model, +1.0))
    assert model.plunger_amplification() == pytest.approx(
        np.full(4, 1 / (ROCKER * math.sin(rocker - coupler)))
    )


@pytest.mark.parametrize("sense", [1.0, -1.0])
def test_clearances_all_along_the_final_coupler_act_as_a_longer_or_shorter_coupler(model, sense):
    longer = COUPLER + sense * 4 * CLEARANCE
    place = model.kernel.positions(
        CRANK_RAD, model.kernel.no_clearance(), model.numbers({"length.A-B": longer})
    )
    along = math.atan2(place["B"][1] - place["A"][1], place["B"][0] - place["A"][0])
    # Joints 1 to 3 push the coupler's upstream end forward; joint 4 is the pivot it is pushed
    # against.
    directions = np.array([along, along, along, along + math.pi]) + (math.pi if sense < 0 else 0.0)
    moved = model.displacement(links_from(np.full(4, CLEARANCE), directions))
    assert float(moved) == pytest.approx(rocker_turn(model, longer), abs=1e-14)


def test_the_sequential_rule_comes_within_twenty_in_a_million_of_the_exact_worst_case(model):
    worst = worst_case(model, np.full((1, 4), CLEARANCE))
    assert (worst.over_in[0], worst.under_in[0]) == pytest.approx(
        (WORST_OVER_RAD, WORST_UNDER_RAD), rel=2e-5
    )


def test_no_directions_go_beyond_the_exact_worst_case(model: LinkageModel) -> None:
    directions = np.random.default_rng(4).uniform(0, 2 * np.pi, (2000, 4))
    moved = model.displacement(links_from(np.full((2000, 4), CLEARANCE), directions))
    assert WORST_UNDER_RAD < moved.min() < moved.max() < WORST_OVER_RAD
