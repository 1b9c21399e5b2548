"""A file that was given and not read never leaves with exit code 0, and the result counts it."""

from __future__ import annotations

import os
import shutil
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.cli.conftest import DATA, Table, mlg, row

KINDS: dict[str, Callable[[Path], object]] = {
    "missing": Path,
    "empty": lambda path: path.touch(),
    "blank": lambda path: path.write_text("\n \n", "utf-8"),
    "damaged": lambda path: path.write_bytes(b"PK\x03\x04 no workbook"),
    "without a header": lambda path: path.write_text("1,2\n3,4\n", "utf-8"),
    "binary": lambda path: path.write_bytes(bytes(range(256))),
    "a dangling link": lambda path: path.symlink_to("nowhere.csv"),
    "a pipe": os.mkfifo,
    "a folder": Path.mkdir,
}
pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="needs links and pipes")


@pytest.fixture(params=KINDS)
def bad(request: pytest.FixtureRequest, tmp_path: Path) -> Path:
    """A file that cannot be read, in a folder of its own."""
    (tmp_path / "given").mkdir()
    path = tmp_path / "given" / "second.csv"
    KINDS[request.param](path)
    return path


def test_a_check_of_a_good_file_and_one_that_cannot_be_read_exits_1(bad, table):
    good = table(row())
    assert mlg("check", good).code == 0
    found = mlg("check", good, bad, "-q")
    assert found.code == 1
    assert "Files given and not read (1): " in " ".join(found.out.split())
    assert mlg("check", good, bad, "--json").code == 1


def test_in_a_folder_as_well(bad: Path, table: Table) -> None:
    shutil.copy(table(row(), row(record_id="R2", tail_no="N2")), bad.with_name("first.csv"))
    found = mlg("check", bad.parent)
    is_there = bad.exists() or bad.is_symlink()
    assert (found.code, "Files given and not read (1): " in found.out) == (is_there, is_there)


def test_a_diagnosis_of_a_good_file_and_one_that_cannot_be_read_exits_1(tmp_path: Path) -> None:
    good = DATA / "measured_nothing_wrong.csv"
    assert mlg("diagnose", good).code == 0
    found = mlg("diagnose", good, tmp_path / "missing.csv")
    assert found.code == 1
    assert "Files given and not read (1): " in " ".join(found.out.split())


def test_a_file_alone_that_cannot_be_read_exits_3(bad: Path) -> None:
    assert mlg("check", bad).code == 3


def test_causes_without_their_extension_are_refused(table: Table) -> None:
    found = mlg("check", table(row()), "--causes", "nope.py")
    assert (found.code, "--causes was given without" in found.err) == (2, True)


def test_the_lock_file_of_an_open_workbook_is_named(tmp_path: Path) -> None:
    (tmp_path / "~$fleet.xlsx").write_text("J. Smith")
    run = mlg("check", tmp_path / "~$fleet.xlsx")
    assert run.code == 2
    assert f"Give the workbook: {tmp_path / 'fleet.xlsx'}" in run.err


def test_a_store_that_cannot_be_made_has_a_remedy_for_a_technician(table: Table) -> None:
    run = mlg("check", table(row()), "--keep", "--store", "/proc/1/s.sqlite")
    assert run.code == 5
    assert "nothing was kept" in run.err
    assert "://" not in run.err
