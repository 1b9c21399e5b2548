"""A slider-crank with a loose guide against states of another program.

Source: siconos-tutorials (Apache-2.0), `SliderCrank`, after Flores, Leine and Glocker 2010,
10.1007/s11044-009-9178-y: every twentieth of 2,001 states of a dynamic simulation, and the one with
the largest deviation. Lengths in metres; the offset is that of the slider across its guide.
"""

from __future__ import annotations

import csv
import math
from pathlib import Path

import numpy as np
import pytest
import tomli_w

from mlg_troubleshoot.gear.gear_file import load_gear
from mlg_troubleshoot.gear.linkage import Calibration, LinkageModel, worst_case

CRANK, ROD, CLEARANCE = 0.153, 0.306, 0.001
FILE = Path(__file__).parent / "data" / "slider-crank-loose-guide.csv"
STATES = [
    {name: float(value) for name, value in row.items()}
    for row in csv.DictReader(FILE.read_text().splitlines())
]
DRAWN = 0.7
FORM = {
    "name": "slider-crank",
    "margin": 0.001,
    "schema": 2,
    "source": "siconos",
    "sources": {"siconos": {"kind": "assumed", "text": "siconos-tutorials, SliderCrank"}},
    "ground": {"O": [0.0, 0.0]},
    "moving": {
        "A": [CRANK * math.cos(DRAWN), CRANK * math.sin(DRAWN)],
        "C": [CRANK * math.cos(DRAWN) + math.sqrt(ROD**2 - (CRANK * math.sin(DRAWN)) ** 2), 0.0],
    },
    "links": {"crank": ["O", "A"], "rod": ["A", "C"]},
    "guides_deg": {"C": 0.0},
    "input": {"crank": "crank", "travel": [-10.0, 0.0]},
    "output": {"position_of": "C"},
    "joints": {"C": {"limit": CLEARANCE}},
}


@pytest.fixture(scope="module")
def model(tmp_path_factory: pytest.TempPathFactory) -> LinkageModel:
    file = tmp_path_factory.mktemp("gear") / "slider-crank.toml"
    file.write_text(tomli_w.dumps(FORM))
    return load_gear(file).model


def slider(model: LinkageModel, crank_rad: float, offset: float | np.ndarray) -> np.ndarray:
    """Place of the slider: an offset of the guide one way moves the rod as the crank's pin the
    other way.
    """
    offset = np.asarray(offset)
    place = model.kernel.positions(crank_rad - DRAWN, [0.0 * offset, -offset])["C"][0]
    return np.asarray(place)


def moved(model: LinkageModel, state: dict[str, float]) -> float:
    """How far the simulated slider stands from where it would without clearance."""
    simulated = CRANK * math.cos(state["crank_rad"]) + ROD * math.cos(state["rod_rad"])
    return simulated - float(slider(model, state["crank_rad"], 0.0))


def test_the_simulated_offset_of_the_guide_gives_the_simulated_slider(model: LinkageModel) -> None:
    assert len(STATES) == 102
    for state in STATES:
        simulated = CRANK * math.cos(state["crank_rad"]) + ROD * math.cos(state["rod_rad"])
        found = float(slider(model, state["crank_rad"], state["offset_m"]))
        assert found == pytest.approx(simulated, abs=1e-15)


def test_the_largest_deviation_is_the_published_one(model: LinkageModel) -> None:
    assert 1e3 * max(abs(moved(model, state)) for state in STATES) == pytest.approx(
        0.577965, abs=5e-7
    )


def test_every_simulated_state_lies_within_what_all_offsets_give(model: LinkageModel) -> None:
    offsets = np.linspace(-CLEARANCE, CLEARANCE, 2001)
    for state in STATES:
        reached = slider(model, state["crank_rad"], offsets)
        reached -= float(slider(model, state["crank_rad"], 0.0))
        assert reached.min() - 1e-9 <= moved(model, state) <= reached.max() + 1e-9


def test_near_dead_centre_the_farthest_slider_is_not_at_an_end_of_the_offset(model):
    angle, offsets = 0.003, np.linspace(-CLEARANCE, CLEARANCE, 2001)
    reached = slider(model, angle, offsets)
    assert reached.max() > max(reached[0], reached[-1])
    assert offsets[reached.argmax()] == pytest.approx(CRANK * math.sin(angle), abs=2e-6)


def test_every_simulated_state_lies_within_the_worst_case(model: LinkageModel) -> None:
    for state in STATES:
        there = state["crank_rad"] - DRAWN
        at = LinkageModel(model.mechanism, (there - 0.01, there), Calibration())
        worst = worst_case(at, np.array([[CLEARANCE]]))
        assert worst.under_in[0] <= moved(model, state) <= worst.over_in[0]
