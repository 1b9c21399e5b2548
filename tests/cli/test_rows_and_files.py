"""What else a check writes: every row once, the verdicts as CSV, the annotated workbook, reports,
the template.
"""

from __future__ import annotations

import pytest

from tests.cli.conftest import FAILURE, Table, mlg, row


def test_every_data_row_stands_exactly_once_even_if_it_is_bad(table: Table) -> None:
    rows = [
        row(record_id="A", side=""),
        row(record_id="B", clearance_3_in="worn"),
        row(record_id=""),
        row(),
    ]
    found = mlg("check", table(*rows), "--json").json["inspections"]
    assert [i["record_id"] for i in found] == ["A", "B", None, "R1"]


def test_every_gear_of_a_batch_has_its_repair_sets(table: Table) -> None:
    path = table(row(clearance_3_in="0.013"), row(record_id="R2"))
    worn, sound = mlg("check", path, "--json").json["inspections"]
    assert worn["repair_sets"][0]["joints"] == [3]
    assert sound["repair_sets"] == []


@pytest.mark.parametrize("chosen", [("html",), ("pdf",), ("html", "pdf")])
def test_a_report_has_the_formats_that_are_chosen(chosen, tmp_path):
    formats = [word for each in chosen for word in ("--format", each)] if len(chosen) < 2 else ()
    mlg("check", FAILURE, *formats, "--report", tmp_path / "new" / "folder")
    assert {path.suffix[1:] for path in (tmp_path / "new" / "folder").iterdir()} == {*chosen}


def test_no_displacement_is_minus_zero(table: Table) -> None:
    nothing = {f"clearance_{n}_in": "" for n in range(1, 11)}
    found = mlg("check", table(row(**nothing, plunger_displacement_in="0")), "--json").out
    assert '"predicted_displacement_in"' in found
    assert "-0.0" not in found
