"""A table whose cells were corrected comes back: what is kept already stands once, and a record is
corrected with the table itself.
"""

from __future__ import annotations

import csv
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.cli.conftest import Run, mlg, row

Keep = Callable[..., Run]
OF_ROWS = ("A", "B", "C")
CLEARANCE = "clearance_3_in"
DAY = "inspection_date"


@pytest.fixture
def keep(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Keep:
    """Keep a table of three inspections, some of whose cells are given."""
    monkeypatch.setenv("MLG_STORE", str(tmp_path / "store.sqlite"))

    def kept(**cells: dict[str, str]) -> Run:
        rows = [
            row(record_id=name, tail_no="N1", **{DAY: f"2026-0{n}-01"}, **cells.get(name, {}))
            if DAY not in cells.get(name, {})
            else row(record_id=name, tail_no="N1", **cells[name])
            for n, name in enumerate(OF_ROWS, 1)
        ]
        with (tmp_path / "table.csv").open("w", newline="", encoding="utf-8") as file:
            writer = csv.DictWriter(file, fieldnames=list(rows[0]))
            writer.writeheader()
            writer.writerows(rows)
        return mlg("check", tmp_path / "table.csv", "--keep")

    return kept


def correct(folder: Path, record: str) -> Run:
    return mlg("history", "correct", record, folder / "table.csv")


def counting() -> list[str]:
    events = mlg("history", "N1", "LH", "--json", "--no-forecast").json["events"]
    return sorted(event["record_id"] for event in events if event["verdict"])


def test_the_row_of_a_table_with_its_id_corrects_a_record(keep: Keep, tmp_path: Path) -> None:
    keep()
    keep(B={CLEARANCE: "0.002"})
    assert "correction of B (N1 LH)" in correct(tmp_path, "B").err
    assert "0 inspections kept" in keep(B={CLEARANCE: "0.002"}).err


def test_the_refusal_of_a_changed_row_says_that_the_table_itself_will_do(keep: Keep) -> None:
    keep()
    refused = keep(B={CLEARANCE: "0.002"}).err
    assert "kept already with other content: B (N1 LH 2026-02-01)" in refused
    assert "FILE may be this table" in refused


def test_what_is_wrong_with_other_rows_of_the_table_is_not_said(keep: Keep, tmp_path: Path) -> None:
    keep()
    keep(B={CLEARANCE: "0.002"}, C={CLEARANCE: "many"})
    assert "problem" not in correct(tmp_path, "B").err


def test_what_is_wrong_with_the_row_itself_is(keep: Keep, tmp_path: Path) -> None:
    keep()
    keep(B={CLEARANCE: "many"})
    refused = correct(tmp_path, "B")
    assert "found 'many'" in refused.err
    assert "needs one valid inspection B of N1 LH, and the file has 0" in refused.err


def test_a_row_whose_bad_date_was_corrected_is_not_kept_a_second_time(keep: Keep) -> None:
    keep(B={DAY: "2026-02-31"})
    assert "kept already with other content: B (N1 LH no date)" in keep().err


def test_nor_one_whose_date_was_another(keep: Keep) -> None:
    keep(B={DAY: "2025-02-01"})
    assert "kept already with other content: B (N1 LH 2025-02-01)" in keep().err


@pytest.mark.parametrize("times", [1, 2])
def test_once_the_record_is_corrected_the_table_is_known(
    keep: Keep, tmp_path: Path, times: int
) -> None:
    keep(B={DAY: "2026-02-31"})
    for _ in range(times):
        keep(B={CLEARANCE: "0.002"})
        correct(tmp_path, "B")
        keep()
        correct(tmp_path, "B")
    assert "0 inspections kept" in keep().err
    assert counting() == [*OF_ROWS]


def test_an_id_that_is_used_on_another_day_is_another_inspection(keep: Keep) -> None:
    keep()
    assert "1 inspection kept" in keep(B={DAY: "2026-02-09", CLEARANCE: "0.002"}).err
