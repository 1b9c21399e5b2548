"""The failure that the paper validates its model with (section 4.4), through every way in."""

from __future__ import annotations

from pathlib import Path

import openpyxl
import pytest

from tests.cli.conftest import DATA, FAILURE, HAND, Run, Table, mlg, ranked, row

BLANK = {f"clearance_{n}_in": "" for n in range(1, 11)}


def test_it_is_predicted_at_0_0472_in(failure_json: Run) -> None:
    assert failure_json.one["predicted_displacement_in"] == pytest.approx(0.0472, abs=2e-4)


def test_it_is_outside_the_margin(failure_json: Run) -> None:
    assert failure_json.one["verdict"] == "OUTSIDE_MARGIN"


def test_it_exits_1(failure: Run) -> None:
    assert failure.code == 1


def test_joints_3_and_5_are_on_top_by_contribution(failure_json: Run) -> None:
    contributions = {j["joint"]: j["contribution_in"] or 0.0 for j in failure_json.one["joints"]}
    assert sorted(contributions, key=contributions.__getitem__, reverse=True)[:2] == [3, 5]


def test_joints_3_and_5_are_on_top_of_the_ranking(failure_json: Run) -> None:
    assert list(ranked(failure_json.one)[:2]) == [3, 5]


def test_the_eight_joints_that_the_paper_does_not_give_are_unmeasured(failure_json: Run) -> None:
    unmeasured = [j["joint"] for j in failure_json.one["joints"] if j["clearance_in"] is None]
    assert unmeasured == [1, 2, 4, 6, 7, 8, 9, 10]


def test_the_bound_and_the_chance_with_random_directions_stand_together(failure: Run) -> None:
    shown = " ".join(failure.out.replace("│", "").split())
    assert "worst case 0.0472 of 0.0300 in, chance 2" in shown


def test_the_workbook_says_what_the_csv_says(failure_json: Run) -> None:
    assert (
        mlg("check", DATA / "failure_case.xlsx", "--json").json["inspections"]
        == failure_json.json["inspections"]
    )


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
def test_on_the_command_line_every_unit_and_convention_gives_the_same(
    readings: tuple[str, ...], failure_json: Run
) -> None:
    found = mlg(*HAND, "--set", "outcome=FAILED", *readings, "--json")
    expected = failure_json.one
    assert found.code == 1
    assert found.one["verdict"] == expected["verdict"]
    assert found.one["predicted_displacement_in"] == pytest.approx(
        expected["predicted_displacement_in"], abs=1e-12
    )


@pytest.mark.parametrize(
    ("changes", "unit"),
    [
        (
            {
                "clearance_convention": "TOTAL_PLAY",
                "clearance_3_in": "0.026",
                "clearance_5_in": "0.014",
            },
            "in",
        ),
        ({"clearance_3_in": "0.3302", "clearance_5_in": "0.1778"}, "mm"),
        ({"clearance_3_in": "13", "clearance_5_in": "7"}, "thou"),
    ],
    ids=["total play", "millimetres", "thou"],
)
def test_in_a_table_every_unit_and_convention_gives_the_same(
    changes: dict[str, str], unit: str, table: Table, failure_json: Run
) -> None:
    cells = {
        column.replace("_in", f"_{unit}"): value
        for column, value in row(**(BLANK | changes)).items()
    }
    cells["outcome"] = "FAILED"
    found = mlg("check", table(cells), "--json").one
    assert found["verdict"] == "OUTSIDE_MARGIN"
    expected = failure_json.one["predicted_displacement_in"]
    assert found["predicted_displacement_in"] == pytest.approx(expected, abs=1e-12)


def test_without_a_unit_it_is_refused() -> None:
    found = mlg(*HAND, "--convention", "RADIAL", "--set", "3=0.013", "--set", "5=0.007")
    assert (found.code, found.out) == (2, "")
    assert "The unit is missing" in found.err


def test_without_a_convention_it_is_refused() -> None:
    found = mlg(*HAND, "--set", "3=0.013in", "--set", "5=0.007in")
    assert (found.code, found.out) == (2, "")
    assert "--convention" in found.err


def test_a_table_without_a_unit_is_refused(table: Table) -> None:
    cells = {column.removesuffix("_in"): value for column, value in row().items()}
    found = mlg("check", table(cells), "--json")
    assert found.code == 3
    assert [i["verdict"] for i in found.json["inspections"]] == ["INVALID"]


def test_a_table_without_a_convention_is_refused(table: Table) -> None:
    found = mlg("check", table(row(clearance_convention=None)), "--json")
    assert found.code == 3
    assert [i["verdict"] for i in found.json["inspections"]] == ["INVALID"]


def test_the_unit_of_a_table_can_be_declared(table: Table) -> None:
    cells = {column.removesuffix("_in"): value for column, value in row().items()}
    assert mlg("check", table(cells), "--unit", "in", "--json").one["verdict"] == "WITHIN_MARGIN"


def test_the_convention_of_a_table_can_be_declared(table: Table) -> None:
    path = table(row(clearance_convention=None))
    assert mlg("check", path, "--convention", "RADIAL", "--json").one["verdict"] == "WITHIN_MARGIN"


def test_the_factor_2_of_the_convention_changes_the_verdict(table: Table) -> None:
    path = table(
        row(clearance_convention=None, **{f"clearance_{n}_in": "0.004" for n in range(1, 6)})
    )
    verdicts = [
        mlg("check", path, "--convention", c, "--json").one["verdict"]
        for c in ("RADIAL", "TOTAL_PLAY")
    ]
    assert verdicts == ["OUTSIDE_MARGIN", "WITHIN_MARGIN"]


def test_standard_input_reads_the_csv(failure_json: Run) -> None:
    found = mlg("check", "-", "--json", stdin=FAILURE.read_bytes())
    assert found.json["inspections"] == failure_json.json["inspections"]


def test_standard_input_reads_the_workbook(failure_json: Run) -> None:
    found = mlg("check", "-", "--json", stdin=(DATA / "failure_case.xlsx").read_bytes())
    assert found.json["inspections"] == failure_json.json["inspections"]


def test_the_shipped_files_carry_the_two_published_clearances_and_no_other() -> None:
    sheet = openpyxl.load_workbook(Path(DATA / "failure_case.xlsx")).worksheets[0]
    header, *rows = [[cell.value for cell in cells] for cells in sheet.iter_rows()]
    (cells,) = [dict(zip(header, values, strict=True)) for values in rows]
    assert {
        n: cells[f"clearance_{n}_in"]
        for n in range(1, 11)
        if cells[f"clearance_{n}_in"] is not None
    } == {
        3: 0.013,
        5: 0.007,
    }
