"""Printed numbers beside computed ones, and the amplification index method of section 3.3."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from mlg_troubleshoot.errors import GearFileError
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.indices.index_table import Amplification, amplification
from mlg_troubleshoot.paper.verification import Computed, load_targets, targets_file, verify
from mlg_troubleshoot.workflows.check import load_index_table


@pytest.fixture(scope="module")
def rows(gear: Gear) -> tuple[Computed, ...]:
    return verify(gear)


def _changed(gear: Gear, tmp_path: Path, old: str, new: str) -> Path:
    text = targets_file(gear).read_text(encoding="utf-8")
    assert old in text
    path = tmp_path / "targets.toml"
    path.write_text(text.replace(old, new, 1), encoding="utf-8")
    return path


def test_what_is_known_not_to_hold_does_not(rows: tuple[Computed, ...]) -> None:
    assert [row.target.quantity for row in rows if row.holds and not row.target.expected] == []


def test_interaction_near_the_input_exceeds_the_largest_of_the_others_by_what_is_said(gear, rows):
    row = next(row for row in rows if row.target.measure == "interaction_order")
    table = load_index_table(gear)
    interaction = {j.joint: j.total_order - j.first_order for j in table.joints}
    near = [interaction.pop(number) for number in row.target.joints]
    assert row.computed == pytest.approx(min(near) - max(interaction.values()), rel=1e-9)


def test_a_number_that_is_off_is_said_not_to_hold(gear: Gear, tmp_path: Path) -> None:
    path = _changed(gear, tmp_path, "value = 0.0472", "value = 0.0572")
    row = verify(gear, path)[0]
    assert (row.holds, row.status, row.target.expected) == (False, "not reproduced", True)


def test_an_unknown_measure_is_named_with_the_known_ones(gear: Gear, tmp_path: Path) -> None:
    path = _changed(gear, tmp_path, 'measure = "worst_displacement"', 'measure = "worst"')
    with pytest.raises(GearFileError, match="'worst'") as caught:
        verify(gear, path)
    assert "worst_displacement" in caught.value.remedy


def test_a_joint_that_the_gear_does_not_have_is_named(gear: Gear, tmp_path: Path) -> None:
    path = _changed(gear, tmp_path, "{ 3 = 0.013", "{ 13 = 0.013")
    with pytest.raises(GearFileError, match="no joint 13"):
        verify(gear, path)


def test_a_gear_without_targets_is_told_so(tmp_path: Path) -> None:
    with pytest.raises(GearFileError, match="no printed numbers"):
        load_targets(tmp_path / "none.toml")


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
    first = place["5"] - place["3"]
    second = place["4"] - place["5"]
    cosine = first @ second / np.linalg.norm(first) / np.linalg.norm(second)
    assert growth.local_stage[2] == pytest.approx(1.0 / np.sqrt(1.0 - cosine**2), rel=1e-9)


def test_the_stage_of_the_locking_pin_is_the_ratio_of_the_release_levers_arms(gear, growth):
    place = {p.name: np.array([p.x, p.y]) for p in gear.reference.mechanism.points}
    ratio = np.linalg.norm(place["3"] - place["Q"]) / np.linalg.norm(place["2"] - place["Q"])
    assert growth.local_stage[1] == pytest.approx(ratio, rel=1e-9)


def test_both_ends_of_a_link_have_one_index(growth: Amplification) -> None:
    assert growth.stage[2] == pytest.approx(growth.stage[4])
    assert growth.exact[5] == pytest.approx(growth.exact[6])


def test_shares_add_up_to_one(gear: Gear, growth: Amplification) -> None:
    assert growth.shares(growth.exact, gear.limits_in).sum() == pytest.approx(1.0)
