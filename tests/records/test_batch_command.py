"""``mlg check`` on batches: nothing lost, every bad cell named, and every form of output agrees."""

from __future__ import annotations

import csv
import io
import json
import random
import zipfile

import openpyxl
import pytest

from mlg_troubleshoot.json_form import plain
from mlg_troubleshoot.workflows.check import (
    CheckOptions,
    check_files,
    json_around,
    json_lines,
)
from tests.cli.conftest import FLEET, mlg

HEADER = (
    "record_id",
    "tail_no",
    "side",
    "clearance_convention",
    *(f"clearance_{n}_in" for n in range(1, 11)),
)


def sound(record_id: str, **changes: object) -> list[object]:
    """Return a row of a gear that is well within its margin, with some cells changed."""
    cells = {**dict.fromkeys(HEADER, 0.0005), "record_id": record_id, "tail_no": "N1", "side": "LH"}
    cells["clearance_convention"] = "RADIAL"
    return list({**cells, **changes}.values())


def workbook(path, *sheets):
    """Write a workbook, each sheet a name and its rows."""
    book = openpyxl.Workbook()
    book.remove(book.worksheets[0])
    for name, rows in sheets:
        sheet = book.create_sheet(name)
        for row in rows:
            sheet.append(row)
    book.save(path)
    return path


def as_csv(*rows):
    """Write rows as CSV."""
    buffer = io.StringIO()
    csv.writer(buffer).writerows(rows)
    return buffer.getvalue()


@pytest.fixture
def mixed(tmp_path):
    """Write a workbook with a good row, a worn one, two bad cells in one row, and a joint over its
    limit.
    """
    rows = [
        HEADER,
        sound("GOOD"),
        sound("WORN", **{f"clearance_{n}_in": 0.007 for n in range(1, 11)}),
        sound("BAD", side="both", clearance_3_in="n/a?"),
        sound("OVER", clearance_10_in=0.012),
    ]
    return workbook(tmp_path / "mixed.xlsx", ("Inspections", rows))


def records(run):
    return [i["record_id"] for i in run.json["inspections"]]


def test_joints_over_their_limit_are_counted_over_the_batch(mixed):
    assert "Joints over their limit (number of gears): #10 (1)." in mlg("check", mixed).out


def test_each_problem_is_told_with_place_value_and_remedy(mixed):
    said = mlg("check", mixed).err
    assert "2 problems in the input:" in said
    place = "mixed.xlsx, sheet 'Inspections', cell C4, column 'side': found 'both'"
    for words in (place, "Enter LH or RH", "cell G4", "'n/a?'"):
        assert words in said


def test_the_csv_says_the_same_as_the_json(mixed, tmp_path):
    out = tmp_path / "out.csv"
    run = mlg("check", mixed, "--csv", out, "--json")
    with out.open(newline="", encoding="utf-8") as file:
        lines = list(csv.DictReader(file))
    for line, inspection in zip(lines, run.json["inspections"], strict=True):
        number = inspection["predicted_displacement_in"]
        assert (line["record_id"], line["verdict"]) == (
            inspection["record_id"],
            inspection["verdict"],
        )
        assert line["predicted_displacement_in"] == ("" if number is None else repr(number))


def test_the_annotated_workbook_marks_bad_cells_and_joints_over_their_limit_beside_each_verdict(
    mixed, tmp_path
):
    out = tmp_path / "out.xlsx"
    assert "lacks" not in mlg("check", mixed, "--annotate", out).err
    sheet = openpyxl.load_workbook(out).worksheets[0]
    assert [cell.coordinate for row in sheet.iter_rows() for cell in row if cell.comment] == [
        "C4",
        "G4",
        "N5",
    ]
    assert "over the limit of joint 10, 0.0075 in radial" in sheet["N5"].comment.text
    assert sheet["N5"].fill != sheet["M5"].fill
    column = next(cell.column for cell in sheet[1] if cell.value == "verdict")
    assert [sheet.cell(row, column).value for row in range(2, 6)] == [
        *("WITHIN_MARGIN", "OUTSIDE_MARGIN"),
        *("INVALID", "WITHIN_MARGIN"),
    ]


def test_what_the_annotated_workbook_lacks_is_said(mixed, tmp_path):
    with zipfile.ZipFile(mixed, "a") as archive:
        archive.writestr("xl/ctrlProps/ctrlProp1.xml", "<formControlPr/>")
        archive.writestr("xl/media/image1.png", b"picture")
    run = mlg("check", mixed, "--annotate", tmp_path / "out.xlsx")
    for what in ("form controls", "pictures"):
        assert f"the annotated copy lacks 1 of the {what} of the workbook" in run.err


def test_a_workbook_that_was_refused_is_not_annotated_and_leaves_with_nothing_judged(tmp_path):
    path = workbook(tmp_path / "other.xlsx", ("Prices", [("bolt", 3), ("nut", 4)]))
    run = mlg("check", path, "--annotate", tmp_path / "out.xlsx")
    assert run.code == 3
    assert "was not written" in run.err
    assert not (tmp_path / "out.xlsx").exists()


def test_a_workbook_that_cannot_be_copied_is_an_output_error_and_the_results_still_come(
    mixed, tmp_path
):
    with zipfile.ZipFile(mixed) as old:
        parts = {name: old.read(name) for name in old.namelist()}
    parts["xl/styles.xml"] = parts["xl/styles.xml"].replace(
        b"<font>", b'<font><color rgb="cornflower"/>', 1
    )
    with zipfile.ZipFile(mixed, "w") as new:
        for name, data in parts.items():
            new.writestr(name, data)
    run = mlg("check", mixed, "--annotate", tmp_path / "out.xlsx")
    assert run.code == 5
    assert "4 inspections" in run.out
    assert "cannot be copied" in run.err


def test_several_files_a_pattern_and_a_folder_are_one_batch_each(tmp_path):
    for name in ("a", "b"):
        (tmp_path / f"{name}.csv").write_text(as_csv(HEADER, sound(name)))
    workbook(tmp_path / "c.xlsx", ("Inspections", [HEADER, sound("c")]))
    assert records(mlg("check", tmp_path / "b.csv", tmp_path / "c.xlsx", "--json")) == ["b", "c"]
    assert records(mlg("check", tmp_path / "*.csv", "--json")) == ["a", "b"]
    assert records(mlg("check", tmp_path, "--json")) == ["a", "b", "c"]


def test_a_row_is_judged_alike_alone_and_in_a_batch(tmp_path):
    rng = random.Random(9)
    rows = [
        sound(
            f"R{n}",
            **{
                f"clearance_{j}_in": None if rng.random() < 0.1 else round(rng.uniform(0, 0.01), 4)
                for j in range(1, 11)
            },
        )
        for n in range(12)
    ]
    path = tmp_path / "all.csv"
    path.write_text(as_csv(HEADER, *rows))
    batch = mlg("check", path, "--json").json["inspections"]
    for n in (0, 5, 11):
        (tmp_path / "one.csv").write_text(as_csv(HEADER, rows[n]))
        (alone,) = mlg("check", tmp_path / "one.csv", "--json").json["inspections"]
        # What is worked out for a single inspection only is null or empty in a batch.
        alike = [key for key in alone if key not in ("joints", "then")]
        in_both = [key for key in alike if batch[n][key] is not None]
        assert twelve_digits([alone[k] for k in in_both]) == twelve_digits(
            [batch[n][k] for k in in_both]
        )
        for one, same in zip(alone["joints"], batch[n]["joints"], strict=True):
            assert twelve_digits(one) == twelve_digits(same)


def twelve_digits(values):
    """Numbers as far as the order in which they were added does not change them."""
    return json.loads(json.dumps(values), parse_float=lambda text: float(f"{float(text):.12g}"))


def test_a_text_in_the_results_never_becomes_a_formula(tmp_path):
    (tmp_path / "in.csv").write_text(as_csv(HEADER, sound("=cmd()", tail_no="+1")))
    mlg("check", tmp_path / "in.csv", "--csv", tmp_path / "out.csv")
    line = (tmp_path / "out.csv").read_text().splitlines()[1]
    assert line.startswith("'=cmd(),'+1,")


def test_the_json_of_a_batch_written_in_pieces_is_the_whole_form(gear, mixed):
    result = check_files([mixed], CheckOptions())
    begin, end = json_around(result)
    blocks = [json_lines(result.judgements[at : at + 2]) for at in (0, 2)]
    assert len(result.judgements) == 4
    assert json.loads(begin + ",\n".join(blocks) + end) == plain(result)


def test_reports_of_a_table_that_is_too_long_are_refused_before_it_is_judged(tmp_path, monkeypatch):
    monkeypatch.setattr("mlg_troubleshoot.cli.check_run._MOST_REPORTS", 45)
    run = mlg("check", FLEET, "--report", tmp_path / "out")
    assert (run.code, run.out) == (2, "")
    assert "--report of 46 inspections" in run.err
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("most", "option", "code"), [((99, 1), "--json", 2), ((99, 1), "--csv", 1)]
)
@pytest.mark.parametrize("of_one_row_each", [False, True])
def test_more_failed_gears_than_there_is_time_to_plan_are_refused(
    tmp_path, monkeypatch, most, option, code, of_one_row_each
):
    monkeypatch.setattr("mlg_troubleshoot.workflows.check._MOST_PLANNED", most)
    file = FLEET
    if of_one_row_each:
        file = tmp_path / "failed.csv"
        rows = "".join(f"N{n},LH,RADIAL,FAILED,0.004\n" for n in range(3))
        file.write_text(f"tail_no,side,clearance_convention,outcome,clearance_3_in\n{rows}")
    run = mlg("check", file, option, *([tmp_path / "out.csv"] if option == "--csv" else ()))
    assert run.code == code
    refused = "at most 1 are planned at once with what follows NEXT; nothing was judged"
    assert (refused in run.err) == (code == 2)
    assert not run.out or code == 1
