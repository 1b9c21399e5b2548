"""Files are written whole or not at all, never over an input, never over a device."""

from __future__ import annotations

import csv
import os
from pathlib import Path

import pytest

from mlg_troubleshoot.errors import OutputError, UsageError
from mlg_troubleshoot.outputs import csv_text, refuse_inputs_as_outputs, write_bytes, write_csv


def test_a_file_under_a_file_cannot_be_written(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("x")
    with pytest.raises(OutputError, match="cannot be written"):
        write_csv(tmp_path / "file" / "o.csv", ["a"], [])


def test_a_write_that_fails_leaves_the_old_file_and_nothing_else(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    target = tmp_path / "kept.toml"
    target.write_text("old")

    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "replace", full)
    with pytest.raises(OutputError, match="No space left"):
        write_bytes(target, b"new")
    assert [p.name for p in tmp_path.iterdir()] == ["kept.toml"]
    assert target.read_text() == "old"


def test_a_folder_that_is_missing_is_made(tmp_path: Path) -> None:
    write_bytes(tmp_path / "a" / "b.csv", b"x")
    assert (tmp_path / "a" / "b.csv").read_bytes() == b"x"


def test_a_new_file_has_what_the_umask_leaves(tmp_path: Path) -> None:
    before = os.umask(0o077)
    try:
        write_bytes(tmp_path / "new", b"x")
    finally:
        os.umask(before)
    assert (tmp_path / "new").stat().st_mode & 0o777 == 0o600


def test_a_replaced_file_keeps_its_mode(tmp_path: Path) -> None:
    (tmp_path / "old").write_text("x")
    (tmp_path / "old").chmod(0o640)
    write_bytes(tmp_path / "old", b"y")
    assert (tmp_path / "old").stat().st_mode & 0o777 == 0o640


def test_a_link_stays_one(tmp_path: Path) -> None:
    (tmp_path / "real").write_text("x")
    (tmp_path / "link").symlink_to("real")
    write_bytes(tmp_path / "link", b"y")
    assert (tmp_path / "link").is_symlink()
    assert (tmp_path / "real").read_bytes() == b"y"


def test_a_pipe_is_refused_and_stays_one(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(OutputError, match="not a file"):
        write_bytes(tmp_path / "pipe", b"x")
    assert (tmp_path / "pipe").is_fifo()


def test_a_folder_is_no_file_to_write(tmp_path: Path) -> None:
    with pytest.raises(OutputError, match="a folder"):
        write_bytes(tmp_path, b"x")


@pytest.mark.parametrize("text", ["=1+1", "+1", "-1", "@SUM(A1)", " =1", "\t=1", "＝1"])
def test_no_text_becomes_a_formula(text: str) -> None:
    ((field,),) = csv.reader([csv_text(["a"], [[text]]).split("\n", 1)[1]])
    assert field.startswith("'")


@pytest.mark.parametrize("separator", [",", ";", "\t"])
def test_no_text_splits_into_a_formula_whatever_the_separator(separator: str) -> None:
    line = csv_text(["a"], [[f"x{separator}=HYPERLINK(1)"]]).splitlines()[1]
    assert list(csv.reader([line], delimiter=separator)) == [[f"x{separator}=HYPERLINK(1)"]]


def test_a_negative_number_stays_a_number() -> None:
    assert csv_text(["a"], [[-0.5]]) == "a\n-0.5\n"


@pytest.mark.parametrize("given", ["in.csv", "link.csv", "hard.csv", "folder/../in.csv"])
def test_an_output_that_is_an_input_is_refused(tmp_path: Path, given: str) -> None:
    (tmp_path / "folder").mkdir()
    (tmp_path / "in.csv").write_text("x")
    (tmp_path / "link.csv").symlink_to("in.csv")
    (tmp_path / "hard.csv").hardlink_to(tmp_path / "in.csv")
    with pytest.raises(UsageError, match=r"--csv .* is one of the inputs"):
        refuse_inputs_as_outputs([tmp_path / "in.csv"], [("--csv", tmp_path / given)])


def test_an_output_in_an_input_folder_is_refused_where_it_is_one_of_its_files(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("x")
    with pytest.raises(UsageError):
        refuse_inputs_as_outputs([tmp_path], [("--csv", tmp_path / "a.csv")])


def test_another_output_is_not_refused(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("x")
    refuse_inputs_as_outputs([tmp_path / "a.csv"], [("--csv", tmp_path / "b.csv"), ("--annotate", None)])
