"""A table whose cells were corrected comes back: what is kept already stands once, and the table is
settled as a whole.
"""

from __future__ import annotations

import csv
from collections.abc import Callable
from pathlib import Path

import pytest

from mlg_troubleshoot.life.folding import lives
from mlg_troubleshoot.store import Store
from tests.cli.conftest import Run, mlg, row

from .places import table

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
            writer = csv.DictWriter(
                file, fieldnames=list(dict.fromkeys(c for r in rows for c in r))
            )
            writer.writeheader()
            writer.writerows(rows)
        return mlg("check", tmp_path / "table.csv", "--keep")

    return kept


def counting() -> list[str]:
    events = mlg("history", "N1", "LH", "--json", "--no-forecast").json["events"]
    return sorted(event["record_id"] for event in events if event["verdict"])


def test_a_table_that_says_what_a_record_was_amended_to_is_known(keep: Keep) -> None:
    keep()
    assert "correction of B (N1 LH)" in mlg("history", "amend", "B", "3=0.002in").err
    assert "0 inspections kept" in keep(B={CLEARANCE: "0.002"}).err


@pytest.mark.parametrize(("day", "said"), [("2026-02-31", "no date"), ("2025-02-01",) * 2])
def test_a_row_whose_date_was_corrected_is_not_kept_a_second_time(keep, day, said):
    keep(B={DAY: day})
    assert f"kept already with other content: B (N1 LH {said})" in keep().err


@pytest.mark.parametrize("times", [1, 2])
def test_once_the_record_is_corrected_the_table_is_known(keep, tmp_path, times):
    keep(B={DAY: "2026-02-31"})
    for _ in range(times):
        for cells in ({"B": {CLEARANCE: "0.002"}}, {}):
            keep(**cells)
            settle(tmp_path, "--amend")
    assert "0 inspections kept" in keep().err
    assert counting() == [*OF_ROWS]


def test_an_id_that_is_used_on_another_day_is_another_inspection(keep: Keep) -> None:
    keep()
    assert "1 inspection kept" in keep(B={DAY: "2026-02-09", CLEARANCE: "0.002"}).err


# A table that comes back is settled as a whole.


def settle(folder: Path, *flags: str) -> Run:
    return mlg("check", folder / "table.csv", "--keep", *flags)


def third_joint(folder: Path) -> dict[str, float]:
    (life,) = lives(Store(folder / "store.sqlite")).values()
    return {
        kept.record.record_id: kept.inspection.clearance_in[3]
        for kept in sorted(life.inspections, key=lambda kept: kept.record.record_id)
    }


def test_the_cells_that_were_changed_are_named(keep: Keep) -> None:
    keep(A={"outcome": ""})
    refused = keep(A={"outcome": ""}, B={CLEARANCE: "0.0031"}, C={"outcome": "FAILED"}).err
    assert "kept already with other content: B (N1 LH 2026-02-01)" in refused
    assert "Settle the table as a whole" in " ".join(refused.split())
    assert "B (N1 LH 2026-02-01): #3 was 0.001 in, the table says 0.0031 in" in refused
    assert "C (N1 LH 2026-03-01): outcome was blank, the table says FAILED" in refused
    assert "--amend takes what it says, --keep-old leaves what is kept" in " ".join(refused.split())


def test_amend_takes_what_the_table_says(keep: Keep, tmp_path: Path) -> None:
    keep()
    keep(B={CLEARANCE: "0.002"}, C={CLEARANCE: "0.003"})
    assert "2 inspections kept" in settle(tmp_path, "--amend").err
    assert third_joint(tmp_path) == {"A": 0.001, "B": 0.002, "C": 0.003}
    assert "0 inspections kept" in settle(tmp_path).err


def test_keep_old_leaves_what_is_kept_and_what_stands_of_it(keep: Keep, tmp_path: Path) -> None:
    keep(C={CLEARANCE: "0.0121"})
    keep()
    settled = settle(tmp_path, "--keep-old")
    assert (settled.code, "0 inspections kept" in settled.err) == (1, True)
    assert third_joint(tmp_path) == {"A": 0.001, "B": 0.001, "C": 0.0121}


def test_amended_back_and_forth_is_what_it_was(keep: Keep, tmp_path: Path) -> None:
    keep()
    before = mlg("fleet", "--json", "--no-forecast").json
    for worn in ("0.0121", "0.001"):
        keep(B={CLEARANCE: worn})
        settle(tmp_path, "--amend")
    assert mlg("fleet", "--json", "--no-forecast").json == before


def unnamed(folder: Path, *clearances: str, name: str = "table.csv") -> Path:
    rows = [
        row(record_id=None, tail_no=f"N{n}", **{DAY: "2026-01-01", CLEARANCE: worn})
        for n, worn in enumerate(clearances)
        if worn
    ]
    return table(folder, *rows, name=name)


@pytest.fixture
def without_ids(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("MLG_STORE", str(tmp_path / "store.sqlite"))
    mlg("check", unnamed(tmp_path, "0.0011", "0.0012", "0.0013"), "--keep")
    return tmp_path


@pytest.mark.parametrize("name", ["table.csv", "renamed.csv"])
def test_a_table_without_ids_that_was_sorted_or_renamed_is_known(without_ids, name):
    rows = (unnamed(without_ids, "0.0011", "0.0012", "0.0013", name=name)).read_text().splitlines()
    (without_ids / name).write_text("\n".join([rows[0], *rows[:0:-1]]) + "\n")
    said = mlg("check", without_ids / name, "--keep").err
    assert "0 inspections kept" in said
    assert "3 known already" in said


def test_the_last_digits_of_a_double_are_no_change(without_ids: Path) -> None:
    again = unnamed(without_ids, "0.0011", "0.0012000000000000001", "0.0013", name="saved.csv")
    assert "3 known already" in mlg("check", again, "--keep").err


def test_a_changed_cell_of_a_table_without_ids_is_named_and_amended(without_ids: Path) -> None:
    changed = unnamed(without_ids, "0.0011", "0.0099", "0.0013")
    assert "#3 was 0.0012 in, the table says 0.0099 in" in mlg("check", changed, "--keep").err
    mlg("check", changed, "--keep", "--amend")
    assert len(mlg("fleet", "--json", "--no-forecast").json["gears"]) == 3
    assert "0 inspections kept" in mlg("check", changed, "--keep").err


def test_a_row_that_vanished_is_named(without_ids: Path) -> None:
    shorter = unnamed(without_ids, "0.0011", "", "0.0013")
    said = " ".join(mlg("check", shorter, "--keep").err.split())
    assert "no longer in it" in said
    assert "(N1 LH 2026-01-01)" in said
    assert "(N0 LH" not in said
