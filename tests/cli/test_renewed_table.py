"""A table of indices follows the geometry of its gear, and a gear file makes no files."""

from __future__ import annotations

import re
import warnings
from pathlib import Path

import pytest

from mlg_troubleshoot.gear.gear_file import load_gear
from mlg_troubleshoot.workflows.check import check, load_index_table
from tests.cli.conftest import FAILURE, mlg
from tests.decision.conftest import inspected


@pytest.fixture
def gear(tmp_path: Path) -> Path:
    """A shipped gear file as one's own, with its table."""
    shipped = load_gear("four-bar-three-pins")
    for file in (shipped.path, shipped.indices_file):
        (tmp_path / file.name).write_bytes(file.read_bytes())
    return tmp_path / shipped.path.name


def kept(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir()}


HAND = ("--set", "1=0.004in", "--tail", "N1", "--side", "LH", "--convention", "radial")


def test_the_table_of_an_edited_gear_is_computed_and_not_written(gear: Path) -> None:
    gear.write_text(gear.read_text("utf-8").replace("D = [3, 0]", "D = [3.001, 0]"), "utf-8")
    before = kept(gear.parent)
    found = mlg("check", *HAND, "--gear", gear)
    assert found.code in (0, 1)
    said = " ".join(found.err.split())
    assert re.search(r"was computed for another geometry: \w{16}, not \w{16}\b", said)
    assert said.count("It was computed for this run. mlg study --write-table keeps it.") == 1
    assert kept(gear.parent) == before


def test_a_table_that_is_asked_for_is_written_and_then_read(gear: Path) -> None:
    load_gear(gear).indices_file.unlink()
    assert mlg("study", "--gear", gear, "--write-table", "--design", "tensor").code == 0
    assert "computed" not in mlg("check", *HAND, "--gear", gear).err


def test_from_python_a_table_that_is_computed_is_warned_of_once(gear: Path) -> None:
    gear.write_text(gear.read_text("utf-8").replace("D = [3, 0]", "D = [3.002, 0]"), "utf-8")
    loaded = load_gear(gear)
    with pytest.warns(UserWarning, match="It was computed for this run"):
        table = load_index_table(loaded)
    assert table.gear.geometry_sha256 == loaded.geometry_sha256
    with warnings.catch_warnings(action="error"):
        check(inspected({1: 0.001}), load_gear(gear))


@pytest.mark.parametrize("command", [("check", *HAND), ("study", "--write-table", "--force")])
def test_a_file_that_is_not_a_table_is_not_replaced_by_one(command, gear):
    table = load_gear(gear).indices_file
    table.write_text('{"mine": 1}')
    assert mlg(*command, "--gear", gear).code == 2
    assert table.read_text() == '{"mine": 1}'


@pytest.mark.parametrize("exists", [True, False])
def test_a_table_is_never_written_through_a_link(exists: bool, gear: Path) -> None:
    table = load_gear(gear).indices_file
    target = gear.parent / "elsewhere.json"
    if exists:
        table.rename(target)
    else:
        table.unlink()
    table.symlink_to(target)
    before = kept(gear.parent) if exists else {}
    found = mlg("study", "--gear", gear, "--write-table", "--force")
    assert found.code == 2
    assert "is a link" in found.err
    assert target.exists() == exists
    assert not exists or kept(gear.parent) == before


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("\nlimit = 0.0075", "\nlimit = 0.2"),
        ("\nmargin = 0.03", "\nmargin = 2.0"),
    ],
)
def test_a_valid_gear_file_never_ends_in_an_internal_error(old, new, tmp_path):
    for file in load_gear().path.parent.glob("hawker*.toml"):
        (tmp_path / file.name).write_bytes(file.read_bytes())
    gear = tmp_path / "hawker-800xp.toml"
    text = gear.read_text("utf-8").replace(old, new)
    gear.write_text(text.replace("hard_limit = 0.050", "hard_limit = 1.0"), "utf-8")
    before = kept(tmp_path)
    for form in ((), ("--json",)):
        found = mlg("check", FAILURE, "--gear", gear, *form)
        assert found.code == 1, found.err
        assert "RuntimeWarning" not in found.err
        assert not re.search(r"\bnan\b", found.out, re.IGNORECASE)
    assert kept(tmp_path) == before


def test_a_table_with_unknown_indices_is_refused_with_the_reason(tmp_path: Path) -> None:
    for file in load_gear().path.parent.glob("hawker*.toml"):
        (tmp_path / file.name).write_bytes(file.read_bytes())
    gear = tmp_path / "hawker-800xp.toml"
    gear.write_text(gear.read_text("utf-8").replace("\nlimit = 0.0075", "\nlimit = 0.015"), "utf-8")
    found = mlg("study", "--gear", gear, "--write-table")
    assert found.code == 2
    assert "do not close at these limits" in found.err
