"""No output replaces an input: refused with exit code 2 before anything is read."""

from __future__ import annotations

import os
import shutil
import stat
import sys
from pathlib import Path

import pytest

from tests.cli.conftest import DATA, FAILURE, ROOT, Run, mlg

GEAR = ROOT / "mlg_troubleshoot" / "gear" / "data"
posix = pytest.mark.skipif(sys.platform == "win32", reason="needs links and modes of POSIX")


@pytest.fixture
def measured(tmp_path: Path) -> Path:
    """A table that somebody measured."""
    return Path(shutil.copy(FAILURE, tmp_path / "in.csv"))


@pytest.fixture
def own_gear(tmp_path: Path) -> Path:
    """A gear file with what goes with it."""
    for source in GEAR.glob("hawker*"):
        shutil.copy(source, tmp_path / source.name)
    return Path(shutil.copy(GEAR / "hawker-800xp.toml", tmp_path / "mine.toml"))


def kept(found: Run, path: Path, before: bytes, option: str) -> None:
    assert found.code == 2, found.err
    assert f"{option} " in found.err
    assert "is one of the inputs" in found.err
    assert path.read_bytes() == before
    assert found.out == ""


@pytest.mark.parametrize("option", ["--csv", "--annotate"])
def test_a_check_does_not_replace_its_table(option: str, measured: Path) -> None:
    before = measured.read_bytes()
    kept(mlg("check", measured, option, measured), measured, before, option)


def test_a_table_in_a_folder_is_not_replaced(measured: Path) -> None:
    before = measured.read_bytes()
    kept(mlg("check", measured.parent, "--csv", measured), measured, before, "--csv")


def test_a_table_that_a_pattern_names_is_not_replaced(measured: Path) -> None:
    before = measured.read_bytes()
    kept(mlg("check", measured.parent / "i*.csv", "--csv", measured), measured, before, "--csv")


@posix
@pytest.mark.parametrize("link", [os.symlink, os.link], ids=["symbolic", "hard"])
def test_a_table_behind_a_link_is_not_replaced(link, measured: Path) -> None:
    other = measured.with_name("other.csv")
    link(measured, other)
    before = measured.read_bytes()
    kept(mlg("check", measured, "--csv", other), measured, before, "--csv")


def test_a_diagnosis_does_not_replace_its_table(tmp_path: Path) -> None:
    path = Path(shutil.copy(DATA / "measured_pressure.csv", tmp_path / "m.csv"))
    before = path.read_bytes()
    kept(mlg("diagnose", path, "--write-extension", path), path, before, "--write-extension")


@pytest.mark.parametrize("flag", ["--extension", "--causes"])
def test_a_file_that_a_check_reads_beside_the_table_is_not_replaced(flag: str, measured: Path) -> None:
    other = measured.with_name("other.toml")
    other.write_text("what was found", encoding="utf-8")
    kept(mlg("check", measured, flag, other, "--csv", other), other, b"what was found", "--csv")


@pytest.mark.parametrize(
    ("command", "name"),
    [
        (("check", FAILURE, "--csv"), "mine.toml"),
        (("study", "--csv"), "hawker-800xp-ensemble.toml"),
        (("study", "--state"), "hawker-800xp-indices.json"),
        (("diagnose", FAILURE, "--write-extension"), "mine-targets.toml"),
    ],
)
def test_no_file_of_a_gear_is_replaced(command: tuple[object, ...], name: str, own_gear: Path) -> None:
    path = own_gear.with_name(name)
    path.touch()
    before = path.read_bytes()
    kept(mlg(*command, path, "--gear", own_gear), path, before, str(command[-1]))


def test_a_reconstruction_does_not_replace_its_targets(own_gear: Path) -> None:
    path = own_gear.with_name("hawker-800xp-targets.toml")
    before = path.read_bytes()
    found = mlg("gear", "--gear", own_gear, "reconstruct", "--targets", path, "--out", path)
    kept(found, path, before, "--out")


def test_a_study_does_not_replace_the_measured_table(measured: Path) -> None:
    before = measured.read_bytes()
    kept(mlg("study", "--given", measured, "--csv", measured), measured, before, "--csv")


def test_a_study_may_write_its_table_again_but_not_over_the_gear(own_gear: Path) -> None:
    text = own_gear.read_text(encoding="utf-8").replace('"hawker-800xp-indices.json"', '"mine.toml"')
    own_gear.write_text(text, encoding="utf-8")
    kept(mlg("study", "--gear", own_gear, "--write-table"), own_gear, text.encode(), "--write-table")


def test_a_report_does_not_replace_an_input_of_its_name(measured: Path) -> None:
    table = measured.rename(measured.with_suffix(".html"))
    before = table.read_bytes()
    kept(mlg("check", table, "--report", table.parent), table, before, "--report")


def test_reports_may_stand_beside_their_table(measured: Path) -> None:
    assert mlg("check", measured, "--report", measured.parent, "--format", "html").code == 1


@posix
def test_a_special_file_is_not_replaced(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe.csv"
    os.mkfifo(pipe)
    found = mlg("check", FAILURE, "--csv", pipe)
    assert found.code == 5
    assert "a device, a pipe or a socket" in found.err
    assert stat.S_ISFIFO(pipe.stat().st_mode)


@posix
@pytest.mark.parametrize("old", [False, True], ids=["new", "old"])
def test_an_output_respects_the_umask_and_the_mode_of_the_old_file(old: bool, tmp_path: Path) -> None:
    path = tmp_path / "out.csv"
    if old:
        path.touch(mode=0o640)
    before = os.umask(0o077)
    try:
        mlg("check", FAILURE, "--csv", path)
    finally:
        os.umask(before)
    assert stat.S_IMODE(path.stat().st_mode) == (0o640 if old else 0o600)


@pytest.mark.parametrize("command", ["check", "diagnose"])
def test_the_help_of_causes_says_that_the_file_is_run(command: str) -> None:
    assert "Runs this file" in " ".join(mlg(command, "--help").out.replace("│", " ").split())
