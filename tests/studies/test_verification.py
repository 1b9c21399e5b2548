"""Printed numbers beside computed ones."""

from __future__ import annotations

from pathlib import Path

import pytest

from mlg_troubleshoot.errors import GearFileError
from mlg_troubleshoot.gear.gear import Gear
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
