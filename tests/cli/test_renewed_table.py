"""A table of indices follows the geometry of its gear."""

from __future__ import annotations

import re
import warnings
from pathlib import Path

import pytest

from mlg_troubleshoot.gear.gear_file import load_gear
from mlg_troubleshoot.workflows.check import next_joint
from mlg_troubleshoot.workflows.index_tables import load_index_table
from tests.cli.conftest import FAILURE, mlg


@pytest.fixture
def gear(tmp_path: Path) -> Path:
    """A shipped gear file as one's own, with its table."""
    shipped = load_gear("four-bar-three-pins")
    for file in (shipped.path, shipped.indices_file):
        (tmp_path / file.name).write_bytes(file.read_bytes())
    return tmp_path / shipped.path.name


def test_an_edited_gear_is_checked_at_once_and_its_renewed_table_is_named(gear: Path) -> None:
    gear.write_text(re.sub(r"3\.0,\s+0\.0", "3.001, 0.0", gear.read_text("utf-8")), "utf-8")
    hand = ("--set", "1=0.004in", "--tail", "N1", "--side", "LH", "--convention", "radial")
    found = mlg("check", *hand, "--gear", gear)
    assert found.code in (0, 1)
    assert "was computed for another geometry" in found.err
    assert "computed again" in found.err
    assert "computed again" not in mlg("check", *hand, "--gear", gear).err


def test_from_python_the_table_of_an_edited_gear_is_renewed(gear: Path) -> None:
    loaded = load_gear(gear)
    loaded.indices_file.unlink()
    with pytest.warns(UserWarning, match="is missing. It was computed again"):
        table = load_index_table(loaded)
    assert table.gear.geometry_sha256 == loaded.geometry_sha256


def test_from_python_a_renewed_table_is_warned_of(gear: Path) -> None:
    loaded = load_gear(gear)
    loaded.indices_file.unlink()
    with pytest.warns(UserWarning, match="is missing. It was computed again"):
        next_joint(loaded, {1: 0.001})
    with warnings.catch_warnings(action="error"):
        next_joint(loaded, {1: 0.001})


def test_a_file_that_is_not_a_table_is_not_replaced_by_one(gear: Path) -> None:
    table = load_gear(gear).indices_file
    table.write_text('{"mine": 1}')
    found = mlg("check", FAILURE, "--gear", gear)
    assert found.code == 2
    assert table.read_text() == '{"mine": 1}'
