"""The oracle of the departures' fleets, and its committed result."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.polynomial.hermite_e import hermegauss

from tests.hidden_effect import calibration, departures
from tests.hidden_effect.departures_ceiling import (
    OTHERS,
    RESULT,
    beside_linkage,
    directions,
    marginal,
    markdown,
    summarise,
)

COMMITTED: dict[str, Any] = json.loads(RESULT.read_text(encoding="utf-8"))
DEPARTED: dict[str, Any] = json.loads(calibration.RESULT.read_text(encoding="utf-8"))


def test_the_figures_show_what_the_oracle_reaches() -> None:
    figures = (Path(__file__).parents[2] / "docs/reference/figures.md").read_text(encoding="utf-8")
    assert all(table in figures for table in markdown(COMMITTED))


def test_the_program_is_nowhere_better_than_the_oracle() -> None:
    lines, told = DEPARTED["rates"], COMMITTED["linkage"]["all"]["first"]
    assert (
        lines["another linkage, one cause, S = 15: named, with geometry or without"]["low"]
        <= told["rate"]
    )
    told = COMMITTED["directions"]["one scale, and one joint's direction"]["beats"]
    line = "load directions, spread 40°: named or in the set, where a regression beats one scale"
    assert lines[line]["low"] <= told["rate"]


def test_the_mean_over_angles_is_that_of_a_fine_grid() -> None:
    along, square, spread = (
        np.array([30.0, -12.0]),
        np.array([[400.0, 150.0], [150.0, 300.0]]),
        np.radians(40.0),
    )
    at, weight = hermegauss(80)
    loss = 1.0 - np.cos(
        spread * np.stack(np.meshgrid(at, at, indexing="ij"), axis=-1).reshape(-1, 2)
    )
    likelihood = np.exp(loss @ along - 0.5 * np.einsum("ij,ij->i", loss @ square, loss))
    grid = float(np.log(likelihood @ np.outer(weight, weight).ravel() / weight.sum() ** 2))
    found = [marginal(along, square, spread, np.random.default_rng(seed)) for seed in range(4)]
    assert np.mean(found) == pytest.approx(grid, abs=0.15)


@pytest.mark.slow
def test_an_error_of_the_rate_is_swallowed_by_the_linkage_and_a_gauge_is_not() -> None:
    place = list(departures.simulator.CATALOGUE).index
    rate, gauge = (
        beside_linkage(("linkage, one cause", place(name), 6_200_000 + place(name)))
        for name in ("calibration_rate", "gauge_bias")
    )
    assert rate["left, spread"] < 0.2 * rate["left, linkage"] and rate["spread"] < 2.5
    assert gauge["left, spread"] > 0.8 * gauge["left, linkage"] and gauge["spread"] > 50.0


@pytest.mark.slow
def test_directions_lead_in_their_own_fleet_and_what_else_is_hidden_in_the_others() -> None:
    found = directions(("loads:40", 5, 6_200_005))
    assert min(found["directions"].values()) > 0.0
    assert all(found[name][name] < 0.0 for name in OTHERS)


def test_directions_are_named_where_they_lead_by_more_than_in_other_fleets() -> None:
    def record(own: float, other: float, beats: bool) -> dict[str, Any]:
        lead = dict.fromkeys(OTHERS, other)
        return {
            "directions": dict.fromkeys(OTHERS, own),
            "beats": beats,
            **dict.fromkeys(OTHERS, lead),
        }

    linkage = {"cause": "gauge_bias", "left, spread": 10.0, "spread": 3.0, "linkage": 1.0}
    found = summarise(
        [linkage], [record(3.0, 0.5, True), record(1.0, 2.0, True), record(0.0, -1.0, False)]
    )
    assert found["directions"]["one scale"]["least"] == [2.0]
    assert found["directions"]["one scale"]["beats"]["rate"] == 0.5
    assert found["directions"]["one scale"]["all"]["n"] == 3
    assert (
        found["linkage"]["gauge_bias"]["clear"]["rate"],
        found["linkage"]["all"]["known"]["rate"],
    ) == (1.0, 0.0)
