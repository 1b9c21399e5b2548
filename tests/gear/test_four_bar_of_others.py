"""The shipped four-bar linkage with three loose pins against the 21 states of another program.

Source: siconos-tutorials (Apache-2.0), `FourBarLinkageWith3clearance/FourBarClearance.ref`: a
dynamic simulation, not a measurement. Its offsets overshoot the clearance by up to 2e-7.
"""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest

from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.gear.gear_file import load_gear
from mlg_troubleshoot.gear.linkage import Calibration, LinkageModel, worst_case

HERE = Path(__file__).parent
CLEARANCE, OVERSHOOT = 0.005, 2.1e-7
STATES = [
    {name: float(value) for name, value in row.items()}
    for row in csv.DictReader((HERE / "data" / "four-bar-three-pins.csv").read_text().splitlines())
]
REFERENCE_RAD = STATES[14]["crank_rad"]


@pytest.fixture(scope="module")
def gear() -> Gear:
    return load_gear("four-bar-three-pins")


def model_at(gear: Gear, crank_rad: float) -> LinkageModel:
    """The linkage with the crank at an angle in place of mid-position."""
    there = crank_rad - REFERENCE_RAD
    return LinkageModel(gear.reference.mechanism, (there - 0.01, there), Calibration())


def test_the_simulated_offsets_at_the_pins_give_the_simulated_rocker_angle(gear: Gear) -> None:
    assert len(STATES) == 21
    for state in STATES:
        links = [state[f"{pin}_{axis}"] for pin in "abd" for axis in "xy"]
        model = model_at(gear, state["crank_rad"])
        found = float(model.mid + model.displacement(links))
        assert found == pytest.approx(state["rocker_rad"], abs=5e-15)


@pytest.mark.parametrize(
    ("row", "nominal", "deviation", "low", "high"),
    [
        (1, 1.311013, -5.6411, -7.4000, 7.3751),
        (9, 1.687698, 7.8082, -9.3580, 9.3039),
        (14, 1.155374, -13.1819, -13.7887, 13.6198),
    ],
)
def test_nominal_angle_deviation_and_bound_are_the_published_ones(
    gear, row, nominal, deviation, low, high
):
    model = model_at(gear, STATES[row]["crank_rad"])
    worst = worst_case(model, np.full((1, 3), CLEARANCE))
    assert model.mid == pytest.approx(nominal, abs=5e-7)
    assert 1e3 * (STATES[row]["rocker_rad"] - model.mid) == pytest.approx(deviation, abs=5e-5)
    assert 1e3 * worst.under_in[0] == pytest.approx(low, abs=3e-4)
    assert 1e3 * worst.over_in[0] == pytest.approx(high, abs=3e-4)


def test_every_simulated_state_lies_within_the_worst_case(gear: Gear) -> None:
    for state in STATES:
        model = model_at(gear, state["crank_rad"])
        worst = worst_case(model, np.full((1, 3), CLEARANCE + OVERSHOOT))
        moved = state["rocker_rad"] - model.mid
        assert worst.under_in[0] <= moved <= worst.over_in[0]
