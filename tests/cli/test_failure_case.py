"""The failure that the paper validates its model with (section 4.4), through every way in."""

from __future__ import annotations

from pathlib import Path

import openpyxl
import pytest

from tests.cli.conftest import DATA, FAILURE, HAND, Run, Table, mlg, ranked, row


def test_it_is_outside_as_the_paper_says(failure: Run, failure_json: Run) -> None:
    found = failure_json.one
    assert found["predicted_displacement_in"] == pytest.approx(0.0472, abs=2e-4)
    assert (found["verdict"], failure.code) == ("OUTSIDE_MARGIN", 1)


def test_joints_3_and_5_are_on_top_and_the_eight_others_unmeasured(failure_json: Run) -> None:
    found = failure_json.one
    contributions = {j["joint"]: j["contribution_in"] or 0.0 for j in found["joints"]}
    assert sorted(contributions, key=contributions.__getitem__, reverse=True)[:2] == [3, 5]
    assert list(ranked(found)[:2]) == [3, 5]
    unmeasured = [j["joint"] for j in found["joints"] if j["clearance_in"] is None]
    assert unmeasured == [1, 2, 4, 6, 7, 8, 9, 10]


def test_the_bound_and_the_chance_with_random_directions_stand_together(failure: Run) -> None:
    shown = " ".join(failure.out.replace("│", "").split())
    assert "worst case 0.0472 of 0.0300 in, chance 2" in shown


@pytest.mark.parametrize(
    "readings",
    [
        ("--convention", "RADIAL", "--set", "3=0.013in", "--set", "5=0.007in"),
        ("--convention", "RADIAL", "--unit", "in", "--set", "3=.013", "--set", "5=.007"),
        ("--convention", "RADIAL", "--set", "3=13 thou", "--set", "5=7 thou"),
        ("--convention", "TOTAL_PLAY", "--set", "3=0.026in", "--set", "5=0.014in"),
        ("--convention", "DIAMETRAL", "--set", "3=0.026in", "--set", "5=0.014in"),
        ("--convention", "RADIAL", "--set", "3=0.3302mm", "--set", "5=0.1778mm"),
        ("--convention", "TOTAL_PLAY", "--unit", "mm", "--set", "3=0.6604", "--set", "5=0.3556"),
    ],
    ids=lambda readings: " ".join(readings[1:]),
)
def test_on_the_command_line_every_unit_and_convention_gives_the_same(readings, failure_json):
    found = mlg(*HAND, "--set", "outcome=FAILED", *readings, "--json")
    expected = failure_json.one
    assert found.code == 1
    assert found.one["verdict"] == expected["verdict"]
    assert found.one["predicted_displacement_in"] == pytest.approx(
        expected["predicted_displacement_in"], abs=1e-12
    )


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("--convention", "RADIAL", "--set", "3=0.013"), "The unit is missing"),
        (("--set", "3=0.013in"), "--convention"),
    ],
)
def test_by_hand_it_is_refused_without_unit_or_convention(arguments, said):
    found = mlg(*HAND, *arguments)
    assert (found.code, found.out, said in found.err) == (2, "", True)


def test_the_factor_2_of_the_convention_changes_the_verdict(table: Table) -> None:
    path = table(
        row(clearance_convention=None, **{f"clearance_{n}_in": "0.004" for n in range(1, 6)})
    )
    verdicts = [
        mlg("check", path, "--convention", c, "--json").one["verdict"]
        for c in ("RADIAL", "TOTAL_PLAY")
    ]
    assert verdicts == ["OUTSIDE_MARGIN", "WITHIN_MARGIN"]


@pytest.mark.parametrize("file", [FAILURE, FAILURE.with_suffix(".xlsx")], ids=["csv", "xlsx"])
def test_file_and_standard_input_say_the_same(file: Path, failure_json: Run) -> None:
    expected = failure_json.json["inspections"]
    assert mlg("check", "-", "--json", stdin=file.read_bytes()).json["inspections"] == expected
    assert mlg("check", file, "--json").json["inspections"] == expected


def test_the_shipped_files_carry_the_two_published_clearances_and_no_other() -> None:
    sheet = openpyxl.load_workbook(Path(DATA / "failure_case.xlsx")).worksheets[0]
    header, *rows = [[cell.value for cell in cells] for cells in sheet.iter_rows()]
    (cells,) = [dict(zip(header, values, strict=True)) for values in rows]
    assert {
        n: cells[f"clearance_{n}_in"]
        for n in range(1, 11)
        if cells[f"clearance_{n}_in"] is not None
    } == {3: 0.013, 5: 0.007}
