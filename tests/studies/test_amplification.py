"""Amplification index method, section 3.3."""

from __future__ import annotations

import numpy as np
import pytest

from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.indices.index_table import Amplification, amplification, csc

# Largest stage-wise indices of the ten linkages, found by their authors with other code.
KNOWN = {
    "A": [0.8399, 1.4883, 5.6385, 5.6385, 5.6385, 1.4815, 1.4815, 1.2817, 1.055, 1.055],
    "B": [0.8401, 1.4879, 5.7135, 5.7135, 5.7135, 1.181, 1.181, 1.0728, 1.0225, 1.0225],
    "C": [0.8399, 1.488, 6.3291, 6.3291, 6.3291, 1.0885, 1.0885, 1.1361, 1.3095, 1.3095],
    "D": [0.84, 1.488, 6.0396, 6.0396, 6.0396, 1.0786, 1.0786, 1.837, 1.1099, 1.1099],
}


@pytest.fixture(scope="module")
def growth(gear: Gear) -> Amplification:
    return amplification(gear)


@pytest.mark.parametrize("name", list(KNOWN))
def test_the_largest_stage_wise_indices_are_the_known_ones(gear: Gear, name: str) -> None:
    place = [linkage.name for linkage in gear.ensemble].index(name)
    found = amplification(gear, gear.ensemble_models[place]).max_stage
    assert found == pytest.approx(KNOWN[name], abs=1e-4)


def test_eq_9_is_the_size_of_the_gradient_where_the_output_turns_the_other_way(gear: Gear) -> None:
    linkage = next(model for model in gear.ensemble_models if model.rate < 0.0)
    found = amplification(gear, linkage)
    assert np.delete(found.local_plunger, [3, 7]) == pytest.approx(
        np.delete(found.exact, [3, 7]), rel=1e-7
    )


def test_eq_9_misses_a_moving_pivot_by_less_than_a_twentieth(growth: Amplification) -> None:
    assert growth.local_plunger[[3, 7]] == pytest.approx(growth.exact[[3, 7]], rel=0.05)
    assert np.all(np.abs(growth.local_plunger[[3, 7]] - growth.exact[[3, 7]]) > 0.01)


def test_the_stage_of_a_current_clearance_is_the_cosecant_of_the_angle_between_the_links(
    gear, growth
):
    place = {p.name: np.array([p.x, p.y]) for p in gear.reference.mechanism.points}
    expected = csc(place["5"] - place["3"], place["4"] - place["5"])
    assert growth.local_stage[2] == pytest.approx(float(expected), rel=1e-9)


def test_the_stage_of_the_locking_pin_is_the_ratio_of_the_release_levers_arms(gear, growth):
    place = {p.name: np.array([p.x, p.y]) for p in gear.reference.mechanism.points}
    ratio = np.linalg.norm(place["3"] - place["Q"]) / np.linalg.norm(place["2"] - place["Q"])
    assert growth.local_stage[1] == pytest.approx(ratio, rel=1e-9)


def test_both_ends_of_a_link_have_one_index(growth: Amplification) -> None:
    assert growth.stage[2] == pytest.approx(growth.stage[4])
    assert growth.exact[5] == pytest.approx(growth.exact[6])


def test_shares_add_up_to_one(gear: Gear, growth: Amplification) -> None:
    assert growth.shares(growth.exact, gear.limits_in).sum() == pytest.approx(1.0)
