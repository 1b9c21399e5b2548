"""What else a check writes: every row once, the verdicts as CSV, the annotated workbook, reports,
the template.
"""

from __future__ import annotations

import csv
from collections.abc import Sequence
from pathlib import Path

import pytest

from tests.cli.conftest import FAILURE, FLEET, HAND, Table, mlg, row

VERDICTS = {"WITHIN_MARGIN", "OUTSIDE_MARGIN", "INCONCLUSIVE", "INCOMPLETE", "INVALID"}


def data_rows(path: Path) -> list[dict[str, str]]:
    with path.open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def test_every_data_row_stands_exactly_once_even_if_it_is_bad(table: Table) -> None:
    rows = [
        row(record_id="A", side=""),
        row(record_id="B", clearance_3_in="worn"),
        row(record_id=""),
        row(),
    ]
    found = mlg("check", table(*rows), "--json").json["inspections"]
    assert [i["record_id"] for i in found] == ["A", "B", None, "R1"]


def test_a_gears_own_margin_decides_about_it(table: Table) -> None:
    found = [mlg("check", table(row(margin_in=margin)), "--json").one for margin in ("", "0.005")]
    assert [i["margin_in"] for i in found] == [0.03, 0.005]
    assert [i["verdict"] for i in found] == ["WITHIN_MARGIN", "OUTSIDE_MARGIN"]


def test_a_margin_can_be_given_by_hand() -> None:
    found = mlg(
        *HAND, "--convention", "RADIAL", "--set", "3=0.001in", "--set", "margin=0.028in", "--json"
    )
    assert found.one["margin_in"] == 0.028


def test_every_gear_of_a_batch_has_its_repair_sets(table: Table) -> None:
    path = table(row(clearance_3_in="0.013"), row(record_id="R2"))
    worn, sound = mlg("check", path, "--json").json["inspections"]
    assert worn["repair_sets"][0]["joints"] == [3]
    assert sound["repair_sets"] == []


def test_json_and_csv_have_each_row_once_in_its_order(tmp_path: Path) -> None:
    shown = mlg("check", FLEET, "--json", "--csv", tmp_path / "out.csv").json["inspections"]
    found = data_rows(tmp_path / "out.csv")
    records = [cells["record_id"] for cells in data_rows(FLEET)]
    assert [cells["record_id"] for cells in found] == records
    assert [inspection["record_id"] for inspection in shown] == records
    assert {cells["verdict"] for cells in found} <= VERDICTS


@pytest.fixture(scope="module")
def reports(tmp_path_factory: pytest.TempPathFactory) -> Sequence[Path]:
    """The reports of the failure case, in a folder that is made for them."""
    folder = tmp_path_factory.mktemp("reports") / "new" / "folder"
    mlg("check", FAILURE, "--report", folder)
    return sorted(folder.iterdir())


def test_a_report_is_one_html_and_one_pdf(reports: Sequence[Path]) -> None:
    assert [path.suffix for path in reports] == [".html", ".pdf"]


@pytest.mark.parametrize("kind", ["html", "pdf"])
def test_one_format_can_be_chosen(kind: str, tmp_path: Path) -> None:
    mlg("check", FAILURE, "--format", kind, "--report", tmp_path)
    assert [path.suffix for path in tmp_path.iterdir()] == [f".{kind}"]


def test_a_batch_has_a_report_for_each_judged_gear_and_a_summary(table, tmp_path):
    path = table(row(record_id="A"), row(record_id="B", side=""), row(record_id="C", side="RH"))
    mlg("check", path, "--format", "html", "--report", tmp_path / "out")
    assert len(list((tmp_path / "out").iterdir())) == 3


def test_no_displacement_is_minus_zero(table: Table) -> None:
    nothing = {f"clearance_{n}_in": "" for n in range(1, 11)}
    found = mlg("check", table(row(**nothing, plunger_displacement_in="0")), "--json").out
    assert '"predicted_displacement_in"' in found
    assert "-0.0" not in found
