"""Several files, folders and patterns in one call."""

from __future__ import annotations

import io

import pytest

from mlg_troubleshoot.records import ReadOptions, read_many
from tests.cli.conftest import mlg
from tests.records.reading import read_inspections

HEADER = "record_id,tail_no,side,clearance_convention,clearance_3_in\n"


@pytest.fixture
def folder(tmp_path):
    """Return a folder with two tables, a broken one and a lock file."""
    (tmp_path / "a.csv").write_text(HEADER + "A1,N1,LH,RADIAL,0.013\n")
    (tmp_path / "b.csv").write_text(HEADER + "B1,N1,LH,RADIAL,0.013\nB2,N1,LH,RADIAL,-1\n")
    (tmp_path / "c.xlsx").write_bytes(b"")
    (tmp_path / "~$d.xlsx").write_bytes(b"lock")
    (tmp_path / "notes.md").write_text("no table")
    return tmp_path


def test_a_folder_stands_for_the_tables_in_it(folder):
    result = read_many([folder], ReadOptions())
    assert [row.record_id for row in result.rows] == ["A1", "B1", "B2"]
    assert [file.kind for file in result.files] == ["csv", "csv", "unreadable"]


def test_a_list_of_verdicts_in_a_folder_is_not_read_as_a_table(folder):
    assert mlg("check", folder / "a.csv", "--csv", folder / "out.csv").code == 1
    (folder / "out.csv").rename(folder / "verdicts of May.csv")
    assert len(read_many([folder], ReadOptions()).rows) == 3


def test_a_file_that_cannot_be_read_is_a_problem_and_the_others_still_work(folder):
    result = read_many([folder / "c.xlsx", folder / "none.csv", folder / "a.csv"], ReadOptions())
    assert [(p.code, p.file) for p in result.problems] == [
        ("file_empty", str(folder / "c.xlsx")),
        ("file_not_found", str(folder / "none.csv")),
    ]
    assert len(result.inspections) == 1


def test_a_pattern_stands_for_what_it_matches(folder):
    result = read_many([str(folder / "*.csv")], ReadOptions())
    assert [row.record_id for row in result.rows] == ["A1", "B1", "B2"]


def test_a_pattern_or_a_folder_without_tables_is_a_problem(folder):
    (folder / "empty").mkdir()
    for source in (str(folder / "*.tsv"), folder / "empty"):
        problems = read_many([source], ReadOptions()).problems
        assert [p.code for p in problems] == ["file_not_found"]


def test_problems_and_rows_name_their_file(folder):
    result = read_many([folder / "a.csv", folder / "b.csv"], ReadOptions())
    assert result.problems[0].file == str(folder / "b.csv")
    assert [row.source.file for row in result.rows] == [
        str(folder / n) for n in ("a.csv", "b.csv", "b.csv")
    ]


def test_ids_are_unique_within_a_file_only(folder):
    (folder / "a.csv").write_text(HEADER + "B1,N2,RH,RADIAL,0.001\n")
    result = read_many([folder / "a.csv", folder / "b.csv"], ReadOptions())
    assert not [p for p in result.problems if p.code == "record_id_duplicate"]
    assert result.rows[0].clearance_in == {3: 0.001}


def test_a_stream_of_a_workbook_or_of_csv_is_told_by_its_bytes(xlsx):
    for data in (xlsx(), (HEADER + "R1,N100AB,LH,RADIAL,0.013\n").encode()):
        result = read_inspections(io.BytesIO(data), ReadOptions(), name="-")
        assert result.rows[0].record_id == "R1"


def test_a_workbook_under_a_text_file_s_name_is_read_and_said(xlsx, read):
    result = read(xlsx(), "t.csv")
    assert len(result.inspections) == 1
    assert any("kind xlsx" in note for note in result.notes)


def test_each_file_is_identified_by_its_hash(folder):
    import hashlib

    (file,) = read_inspections(folder / "a.csv", ReadOptions()).files
    assert file.sha256 == hashlib.sha256((folder / "a.csv").read_bytes()).hexdigest()


def test_an_open_file_is_called_by_its_name(folder):
    with (folder / "a.csv").open("rb") as file:
        assert read_many([file], ReadOptions()).files[0].name == str(folder / "a.csv")


def test_folders_in_a_folder_that_hold_tables_are_named(folder):
    (folder / "old").mkdir()
    (folder / "old" / "e.csv").write_text(HEADER + "E1,N1,LH,RADIAL,0.013\n")
    (folder / "pictures").mkdir()
    (note,) = [note for note in read_many([folder], ReadOptions()).unread if "not read" in note]
    assert note.endswith("folders in it were not read: old")
