"""Files are written whole or not at all, and replace another only if they are asked to."""

from __future__ import annotations

import contextlib
import csv
import io
import os
import sqlite3
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mlg_troubleshoot.errors import OutputError, UsageError
from mlg_troubleshoot.outputs import claim_outputs, csv_lines, harmless, write_bytes


def test_a_write_that_fails_leaves_the_old_file_and_nothing_else(tmp_path, monkeypatch):
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


@pytest.mark.parametrize(("mask", "mode"), [(0o077, 0o600), (0o022, 0o644)])
def test_a_new_file_has_what_the_umask_leaves(mask: int, mode: int, tmp_path: Path) -> None:
    before = os.umask(mask)
    try:
        write_bytes(tmp_path / "new", b"x")
    finally:
        os.umask(before)
    assert (tmp_path / "new").stat().st_mode & 0o777 == mode


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


def test_a_folder_is_not_a_file_to_write(tmp_path: Path) -> None:
    with pytest.raises(OutputError, match="a folder"):
        write_bytes(tmp_path, b"x")


SEPARATORS = (",", ";", "\t", "|")
SIGNS = "=+-@＝＋－＠"
# Whatever a field may begin with before its formula.
BEFORE = " \u00a0'\"" + "".join(SEPARATORS) + "\r\n\f"


def fields(text: str, separator: str) -> list[str]:
    """Every field of a CSV as a program reads it that takes it to have this separator."""
    with io.StringIO(text, newline="") as file:
        return [field for row in csv.reader(file, delimiter=separator) for field in row]


@pytest.mark.parametrize("separator", [";", "\t", "|", ';"', "; ", "\r\n", "|\f"])
@pytest.mark.parametrize("sign", SIGNS)
def test_no_text_splits_into_a_formula_whatever_the_separator(separator: str, sign: str) -> None:
    text = csv_lines([["a", "b"], ["R2", f"x{separator}{sign}HYPERLINK(1)"]])
    for read_with in SEPARATORS:
        for field in fields(text, read_with):
            assert not field.strip(' \f"').startswith(tuple(SIGNS))


@given(
    rows=st.lists(
        st.lists(
            st.text(st.sampled_from(BEFORE + SIGNS + "x1()"), max_size=12) | st.just(-0.5),
            min_size=1,
            max_size=4,
        )
    )
)
@settings(max_examples=400, deadline=None)
def test_no_field_starts_with_a_formula_sign_whichever_separator_it_is_read_with(rows):
    text = csv_lines([["id"], *(["R1", *row] for row in rows)])
    for separator in SEPARATORS:
        for field in fields(text, separator):
            assert field == "-0.5" or not field.strip(' \u00a0\f"').startswith(tuple(SIGNS))


@given(text=st.text(st.sampled_from(BEFORE + SIGNS + "x1"), max_size=12))
def test_what_was_made_harmless_is_not_changed_again(text: str) -> None:
    assert harmless(harmless(text)) == harmless(text)


def test_a_text_without_a_formula_is_read_back_as_it_was() -> None:
    text = 'N123; LH | a-b, "c" = 1\n2'
    assert fields(csv_lines([["a"], [text]]), ",") == ["a", text]


def test_a_negative_number_stays_a_number() -> None:
    assert csv_lines([["a"], [-0.5]]) == "a\n-0.5\n"


@pytest.mark.parametrize(
    "name", ["in.csv", "link.csv", "hard.csv", "folder/../in.csv", "no/../in.csv", "./in.csv"]
)
def test_an_output_that_is_an_input_is_refused(tmp_path: Path, name: str) -> None:
    (tmp_path / "folder").mkdir()
    (tmp_path / "in.csv").write_text("x")
    (tmp_path / "link.csv").symlink_to("in.csv")
    (tmp_path / "hard.csv").hardlink_to(tmp_path / "in.csv")
    with pytest.raises(UsageError, match=r"--csv .* is one of the inputs"):
        claim_outputs([tmp_path / "in.csv"], [("--csv", f"{tmp_path}/{name}")], force=True)


def test_an_output_in_an_input_folder_is_refused_where_it_is_one_of_its_files(tmp_path):
    (tmp_path / "a.csv").write_text("x")
    with pytest.raises(UsageError, match=r"a\.csv\): nothing was read and nothing written$"):
        claim_outputs([tmp_path], [("--csv", tmp_path / "a.csv")], force=True)


def test_another_output_is_not_refused(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("x")
    outputs = [("--csv", tmp_path / "b.csv"), ("--annotate", None)]
    claim_outputs([tmp_path / "a.csv"], outputs)


def test_a_database_is_not_replaced_with_force_either(tmp_path: Path) -> None:
    with contextlib.closing(sqlite3.connect(tmp_path / "any")) as database:
        database.execute("CREATE TABLE kept (x)")
    with pytest.raises(UsageError, match="is a database") as refused:
        claim_outputs([], [("--csv", tmp_path / "any")], force=True)
    assert "--force" not in refused.value.remedy
