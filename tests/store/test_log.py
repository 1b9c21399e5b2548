"""The log: who recorded what when, moves, merged stores, and stores that 0.2.0 made."""

from __future__ import annotations

import shutil
import sqlite3
from contextlib import closing
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import pytest

from mlg_troubleshoot.life.folding import lives
from mlg_troubleshoot.store import Store
from mlg_troubleshoot.store import database as log
from tests.cli.conftest import Run, mlg, row

from .places import table

OLD = Path(__file__).parent / "data" / "every-kind-0.2.0.sqlite"


def keep(store: Path, *rows: dict[str, str]) -> Run:
    return mlg("check", table(store.parent, *rows), "--keep", "--store", store)


def visit(name: str, day: str, **more: str) -> dict[str, str]:
    return row(record_id=name, inspection_date=day, **more)


@pytest.fixture
def store(tmp_path: Path) -> Path:
    return tmp_path / "store.sqlite"


@pytest.fixture
def of_0_2_0(store: Path) -> Path:
    shutil.copy(OLD, store)
    return store


def fleet(store: Path) -> dict[str, Any]:
    found = mlg("fleet", "--json", "--no-forecast", "--store", store).json["gears"]
    return {f"{gear['tail_no']} {gear['side']}": gear for gear in found}


def test_a_record_says_when_and_by_whom_it_was_recorded(store, monkeypatch):
    monkeypatch.setenv("MLG_BY", "J. Smith")
    keep(store, visit("R1", "2026-01-01"))
    (record,) = Store(store).all()
    assert record.recorded_by == "J. Smith"
    at = datetime.fromisoformat(record.recorded_at)
    assert at.tzinfo is not None
    assert abs((datetime.now(UTC) - at).total_seconds()) < 60.0


def test_without_a_name_the_login_recorded_it(store: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("USER", "hangar3")
    monkeypatch.delenv("MLG_BY", raising=False)
    keep(store, visit("R1", "2026-01-01"))
    assert Store(store).all()[0].recorded_by == "hangar3"


def test_a_clock_that_ran_backwards_is_named(store: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for year in (2027, 2026):
        stamp = {"recorded_by": "x", "recorded_at": f"{year}-01-01T08:00:00+00:00", "origin": ""}
        monkeypatch.setattr(log, "_stamp", lambda stamp=stamp: stamp)
        keep(store, visit(f"R{year}", "2026-01-01"))
    said = mlg("history", "verify", "--store", store).out
    assert "The clock ran backwards: record 2 was recorded at 2026-01-01T08:00:00+00:00" in said


def test_a_moved_inspection_is_one_inspection_of_the_other_gear(store: Path) -> None:
    keep(store, visit("R1", "2026-01-01", tail_no="N61W", clearance_3_in="0.0121"))
    why = ("--why", "wrong tail", "--store", store)
    assert mlg("history", "move", "R1", "N16W", "RH", *why).code == 0
    assert set(fleet(store)) == {"N16W RH"}
    (gone, came) = (lives(Store(store))[key] for key in (("N61W", "LH"), ("N16W", "RH")))
    assert (len(gone.inspections), len(came.inspections)) == (0, 1)
    assert came.inspections[0].inspection.clearance_in[3] == 0.0121


def test_what_was_amended_elsewhere_keeps_its_name_where_it_is_moved_back(store: Path) -> None:
    keep(store, visit("R1", "2026-01-01", clearance_3_in="0.0121"))
    more = ("--store", store)
    for done in (
        ("move", "R1", "N123", "RH", "--why", "wrong side"),
        ("amend", "R1", "6=0.0121in"),
        ("move", "R1", "N123", "LH", "--why", "the first was right"),
    ):
        assert mlg("history", *done, *more).code == 0
    (life,) = [each for each in lives(Store(store)).values() if each.inspections]
    assert [each.kept.record_id for each in life.inspections] == ["R1"]


def test_an_inspection_is_not_moved_to_its_own_gear(store: Path) -> None:
    keep(store, visit("R1", "2026-01-01"))
    moved = mlg("history", "move", "R1", "N123", "LH", "--why", "x", "--store", store)
    assert moved.code == 2
    assert "is of N123 LH already" in moved.err


# Two stores of one fleet.


def exported(store: Path) -> Path:
    file = store.with_suffix(".jsonl")
    assert mlg("history", "export", file, "--store", store, "--force").code == 0
    return file


def imported(into: Path, *stores: Path) -> Path:
    for store in stores:
        assert mlg("history", "import", exported(store), "--store", into).code == 0
    return into


@pytest.fixture
def two_stores(tmp_path: Path) -> tuple[Path, Path]:
    """One table kept in both; then each records, corrects and voids on its own."""
    first, second = tmp_path / "a.sqlite", tmp_path / "b.sqlite"
    both = [visit(f"R{n}", f"2026-01-0{n}", outcome="FAILED") for n in range(1, 5)]
    for store in (first, second):
        keep(store, *both)
    keep(first, visit("A1", "2026-02-01", tail_no="NA"))
    mlg("history", "repair", "N123", "LH", "--joint", "3", "--date", "2026-02-01", "--store", first)
    mlg("history", "void", "R1", "--why", "twice", "--store", second)
    keep(second, visit("B1", "2026-02-03", outcome="RETRACTED"))
    assert mlg("history", "amend", "R2", "3=0.0121in", "--store", second).code == 0
    return first, second


def test_a_merged_record_keeps_its_hash_its_clock_and_its_writer(two_stores):
    first, second = two_stores
    there = {r.key: (r.recorded_at, r.recorded_by) for r in Store(second).all()}
    imported(first, second)
    merged = [record for record in Store(first).all() if record.origin]
    assert {r.key: (r.recorded_at, r.recorded_by) for r in merged} == there


# Stores of 0.2.0.


def test_a_store_of_0_2_0_is_read_as_it_is(of_0_2_0: Path) -> None:
    before = of_0_2_0.read_bytes()
    found = fleet(of_0_2_0)
    assert set(found) == {"N1 LH", "N2 RH", "N3 LH"}
    assert found["N3 LH"]["verdict"] != "WITHIN_MARGIN"
    assert of_0_2_0.read_bytes() == before


def test_a_store_of_0_2_0_is_written_forward_and_loses_nothing(of_0_2_0: Path) -> None:
    before = {(r.seq, r.kind, r.digest) for r in Store(of_0_2_0).all()}
    keep(of_0_2_0, visit("R1", "2026-03-01", tail_no="N1"))
    store = Store(of_0_2_0)
    assert before < {(r.seq, r.kind, r.digest) for r in store.all()}
    assert store.verify() == (len(before) + 1, None)
    assert store.all()[-1].recorded_at


def test_a_store_of_0_2_0_that_was_changed_is_not_written_forward(of_0_2_0: Path) -> None:
    with closing(sqlite3.connect(of_0_2_0)) as raw, raw:
        raw.execute("DROP TRIGGER mlg_no_update")
        raw.execute("UPDATE mlg_records SET day = '2026-01-11' WHERE seq = 11")
    kept = keep(of_0_2_0, visit("R1", "2026-03-01", tail_no="N1"))
    assert kept.code == 5
    assert "the chain does not fit at record 11" in kept.err


def test_a_repair_that_0_2_0_kept_beside_its_inspection_is_one(of_0_2_0: Path) -> None:
    life = lives(Store(of_0_2_0))["N1", "LH"]
    assert [(each.day, each.joints) for each in life.repairs] == [("2026-01-12", {3})]
