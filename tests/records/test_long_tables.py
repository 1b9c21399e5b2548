"""Tables of one joint a row, and many files at once."""

from __future__ import annotations

import io

import pytest

from mlg_troubleshoot.decision.inspection import Inspection, InvalidRow
from mlg_troubleshoot.records import ReadOptions, read_many
from tests.cli.conftest import mlg
from tests.records.reading import read_inspections

HEADER = ("record_id", "tail_no", "side", "clearance_convention", "joint", "clearance_in")
ROWS = [
    ("R1", "N1", "LH", "RADIAL", 3, 0.013),
    ("R2", "N2", "RH", "RADIAL", 3, 0.001),
    ("R1", "N1", "LH", "RADIAL", 5, 0.007),
]


def test_rows_of_one_record_are_one_inspection(read, table):
    result = read(table(HEADER, ROWS))
    assert not result.problems
    assert [(r.record_id, dict(r.clearance_in), r.source.row) for r in result.rows] == [
        ("R1", {3: 0.013, 5: 0.007}, 2),
        ("R2", {3: 0.001}, 3),
    ]
    assert any("long layout" in note for note in result.notes)


@pytest.mark.parametrize("joint", ["3", "#3", "J3", "Joint 3", "joint no. 3", "3 "])
def test_a_joint_is_named_as_people_write_it(read, table, joint):
    assert dict(
        read(table(HEADER, [("R1", "N1", "LH", "RADIAL", joint, 0.013)])).rows[0].clearance_in
    ) == {3: 0.013}


def test_long_and_wide_tables_give_the_same_inspection(read, table):
    long = read(table(HEADER, [ROWS[0], ROWS[2]])).rows[0]
    wide = read(
        table((*HEADER[:4], "clearance_3_in", "clearance_5_in"), [(*ROWS[0][:4], 0.013, 0.007)])
    ).rows[0]
    assert (long.clearance_in, long.entered, long.convention) == (
        wide.clearance_in,
        wide.entered,
        wide.convention,
    )


@pytest.mark.parametrize("joint", [11, "short", None, 0, 3.5])
def test_an_unknown_joint_makes_its_record_invalid(read, table, joint):
    result = read(table(HEADER, [*ROWS, ("R1", "N1", "LH", "RADIAL", joint, 0.002)]))
    (problem,) = result.problems
    assert problem.cell == "E5"
    assert [type(row) for row in result.rows] == [InvalidRow, Inspection]


def test_a_bad_clearance_is_named_at_its_own_row(read, table):
    result = read(table(HEADER, [*ROWS, ("R1", "N1", "LH", "RADIAL", 7, -0.1)]))
    (problem,) = result.problems
    assert (problem.row, problem.cell, problem.column) == (5, "F5", "clearance_in")


def test_a_joint_given_twice_with_different_readings_is_an_error(read, table):
    result = read(table(HEADER, [*ROWS, ("R1", "N1", "LH", "RADIAL", 5, 0.001)]))
    assert [(p.code, p.cell) for p in result.problems] == [("joint_twice", "F5")]


def test_a_joint_given_twice_with_the_same_reading_is_a_warning(read, table):
    result = read(table(HEADER, [*ROWS, ROWS[2]]))
    assert not result.problems
    assert any("twice" in warning for warning in result.rows[0].warnings)


def test_rows_of_a_record_that_contradict_each_other_are_an_error(read, table):
    result = read(table(HEADER, [*ROWS, ("R1", "N9", "LH", "RADIAL", 7, 0.001)]))
    assert [(p.code, p.cell, p.value) for p in result.problems] == [
        ("record_contradicts", "B5", "N9")
    ]
    assert isinstance(result.rows[0], InvalidRow)


@pytest.mark.parametrize("header", ["remarks", "Bushing seen"])
def test_what_is_only_carried_of_the_rows_of_a_record_is_carried_of_each(read, table, header):
    said = ("bushing 4 cracked", "greased", "bushing 4 cracked")
    rows = [("R1", "N1", "LH", "RADIAL", 3 + n, 0.013, text) for n, text in enumerate(said)]
    (row,) = read(table((*HEADER, header), rows)).rows
    assert row.carried == {header: "bushing 4 cracked; greased"}
    rows[1] = (*rows[1][:6], "stuck")
    (row,) = read(table((*HEADER, header), rows)).rows
    assert f'--map "{header}=outcome"' in row.unit_question


def test_what_a_record_says_only_once_holds_for_all_its_rows(read, table):
    rows = [("R1", "N1", "LH", "RADIAL", 3, 0.013), ("R1", None, None, None, 5, 0.007)]
    result = read(table(HEADER, rows))
    assert not result.problems
    assert dict(result.rows[0].clearance_in) == {3: 0.013, 5: 0.007}


def test_a_row_without_a_record_id_is_reported_on_its_own(read, table):
    result = read(table(HEADER, [*ROWS, (None, "N1", "LH", "RADIAL", 7, 0.001)]))
    assert [(p.code, p.cell) for p in result.problems] == [("record_id_missing", "A5")]
    assert len(result.rows) == 3


def test_a_long_header_without_a_unit_is_reported_once(read, table):
    result = read(table((*HEADER[:5], "Clearance"), ROWS))
    assert [(p.code, p.cell) for p in result.problems] == [("unit_missing", "F1")]
    assert dict(read(table((*HEADER[:5], "Clearance"), ROWS), unit="in").rows[0].clearance_in) == {
        3: 0.013,
        5: 0.007,
    }


def test_axial_floats_are_also_read_in_a_long_table(read, table):
    header = (*HEADER, "axial_float_mm")
    rows = [(*ROWS[0], 0.1), (*ROWS[2], None)]
    assert dict(read(table(header, rows)).rows[0].axial_float_in) == {3: pytest.approx(0.1 / 25.4)}


def test_without_record_ids_the_rows_of_one_gear_and_day_are_one_inspection(read, table):
    rows = [
        ("N1", "LH", "RADIAL", 3, 0.013),
        ("", "", "", 5, 0.007),
        ("N1", "RH", "RADIAL", 3, 0.001),
        ("N1", "LH", "RADIAL", 7, 0.002),
    ]
    result = read(table(HEADER[1:], rows))
    assert not result.problems
    found = [(row.side, dict(row.clearance_in)) for row in result.rows]
    assert found == [("LH", {3: 0.013, 5: 0.007, 7: 0.002}), ("RH", {3: 0.001})]


def test_a_row_whose_unit_is_not_known_is_asked_for_that_unit_alone(read, table):
    header = (*HEADER[:5], "clearance", "unit")
    rows = [
        ("R1", "N1", "LH", "RADIAL", 3, 0.33, "mm"),
        ("R2", "N1", "RH", "RADIAL", 3, 0.33, "cm"),
    ]
    assert [p.cell for p in read(table(header, rows)).problems] == ["G3"]


OF_EACH_FILE = "record_id,tail_no,side,clearance_convention,clearance_3_in\n"


@pytest.fixture
def folder(tmp_path):
    """Return a folder with two tables, a broken one and a lock file."""
    (tmp_path / "a.csv").write_text(OF_EACH_FILE + "A1,N1,LH,RADIAL,0.013\n")
    (tmp_path / "b.csv").write_text(OF_EACH_FILE + "B1,N1,LH,RADIAL,0.013\nB2,N1,LH,RADIAL,-1\n")
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
    (folder / "a.csv").write_text(OF_EACH_FILE + "B1,N2,RH,RADIAL,0.001\n")
    result = read_many([folder / "a.csv", folder / "b.csv"], ReadOptions())
    assert not [p for p in result.problems if p.code == "record_id_duplicate"]
    assert result.rows[0].clearance_in == {3: 0.001}


def test_a_stream_of_a_workbook_or_of_csv_is_told_by_its_bytes(xlsx):
    for data in (xlsx(), (OF_EACH_FILE + "R1,N100AB,LH,RADIAL,0.013\n").encode()):
        result = read_inspections(io.BytesIO(data), ReadOptions(), name="-")
        assert result.rows[0].record_id == "R1"


def test_a_workbook_under_a_text_file_s_name_is_read(xlsx, read):
    result = read(xlsx(), "t.csv")
    assert len(result.inspections) == 1


def test_each_file_is_identified_by_its_hash(folder):
    import hashlib

    (file,) = read_inspections(folder / "a.csv", ReadOptions()).files
    assert file.sha256 == hashlib.sha256((folder / "a.csv").read_bytes()).hexdigest()


def test_an_open_file_is_called_by_its_name(folder):
    with (folder / "a.csv").open("rb") as file:
        assert read_many([file], ReadOptions()).files[0].name == str(folder / "a.csv")


def test_what_is_not_read_of_a_folder_is_named(folder):
    (folder / "old").mkdir()
    (folder / "old" / "e.csv").write_text(OF_EACH_FILE + "E1,N1,LH,RADIAL,0.013\n")
    (folder / "pictures").mkdir()
    for name in ("b.bak", "c.csv.gz", "d.dat", ".e.csv"):
        (folder / name).write_text("")
    notes = [note for note in read_many([folder], ReadOptions()).unread if "not read" in note]
    assert notes == [f"{folder}: not read of it: b.bak, c.csv.gz, d.dat, notes.md, old"]
