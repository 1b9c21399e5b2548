"""Reports as witnesses: a log that no longer holds what a report was made from is found by it."""

from __future__ import annotations

import random
import shutil
import sqlite3
from collections.abc import Callable
from pathlib import Path

import pytest

from mlg_troubleshoot.errors import UsageError
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.store import Store
from mlg_troubleshoot.workflows.witness import Standing, compare_report
from tests.cli.conftest import mlg

from .test_history_commands import keep, visit

ALL_READ = {f"clearance_{n}_in": "0.0010" for n in range(1, 11) if n != 3}
Tamper = Callable[[sqlite3.Connection, random.Random, int], None]


@pytest.fixture(scope="module")
def kept(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Six records of two gears, and reports of each kind that were made of them."""
    folder = tmp_path_factory.mktemp("witness")
    file = folder / "store.sqlite"
    rows = [visit(n, 0.001 + 0.006 * n, side, **ALL_READ) for n in range(3) for side in ("A", "B")]
    asked = ("--store", str(file), "-q", "--report", str(folder / "check"))
    assert keep(folder, *rows, more=asked).code == 1
    for command in (("history", "A", "LH"), ("fleet", "--no-forecast")):
        shown = mlg(*command, "--store", file, "-q", "--report", folder / command[0])
        assert shown.code == 0, shown.err
    return folder


def reports(folder: Path) -> list[Path]:
    found = sorted(folder.glob("*/*.html")) + sorted(folder.glob("*/*.pdf"))
    assert {path.parent.name for path in found} == {"check", "history", "fleet"}
    return found


def verified(store: Path, report: Path) -> tuple[int, str]:
    shown = mlg("history", "verify", "--report", report, "--store", store)
    return shown.code, shown.out.partition(":")[0]


def test_every_report_of_a_log_that_did_not_change_holds(kept: Path) -> None:
    assert {verified(kept / "store.sqlite", each) for each in reports(kept)} == {(0, "HOLDS")}


def test_a_report_prints_its_record_the_head_of_the_log_and_the_count(kept: Path) -> None:
    count, head = Store(kept / "store.sqlite").head()
    (page,) = (kept / "history").glob("*.html")
    text = page.read_text(encoding="utf-8")
    newest = Store(kept / "store.sqlite").of_gears([("A", "LH")])[-1]
    assert f"{count}\u00a0records, the last sha256 {head}" in text
    assert f"sha256 {newest.digest}" in text


def test_a_fact_that_was_added_since_makes_reports_of_its_gear_stale(kept, tmp_path):
    store = tmp_path / "store.sqlite"
    shutil.copy(kept / "store.sqlite", store)
    assert keep(tmp_path, visit(9, 0.014, "A", **ALL_READ), more=("--store", str(store))).code == 1
    (own,) = (kept / "history").glob("*.html")
    said = mlg("history", "verify", "--report", own, "--store", store)
    assert said.code == 1
    assert said.out.startswith(f"STALE: {own}\nA LH: 1 record added since\n")
    standing = {each.name[4]: verified(store, each)[1] for each in (kept / "check").glob("mlg-N*")}
    assert set(standing.values()) <= {"HOLDS", "STALE"}


def test_a_verdict_that_is_another_one_today_is_said(kept, gear, monkeypatch):
    from mlg_troubleshoot.workflows import witness

    (own,) = (kept / "history").glob("*.pdf")
    printed = witness.read_witness(own)
    (own_gear,) = printed.gears
    other = type(own_gear)(own_gear.tail_no, own_gear.side, own_gear.record, "WITHIN_MARGIN")
    monkeypatch.setattr(
        witness,
        "read_witness",
        lambda _file: type(printed)(
            printed.count, printed.head, "0.0.1", printed.geometry, (other,)
        ),
    )
    found = compare_report(Store(kept / "store.sqlite"), gear, own)
    assert found.standing is Standing.STALE
    said = "the verdict was WITHIN_MARGIN, it is OUTSIDE_MARGIN today (program 0.0.1"
    assert said in found.why[0]


def _forget(connection: sqlite3.Connection) -> None:
    for change in ("update", "delete"):
        connection.execute(f"DROP TRIGGER mlg_no_{change}")


def _cut_back(connection: sqlite3.Connection, _draw: random.Random, seq: int) -> None:
    connection.execute("DELETE FROM mlg_records WHERE seq >= ?", (seq,))


def _take_one(connection: sqlite3.Connection, _draw: random.Random, seq: int) -> None:
    connection.execute("DELETE FROM mlg_records WHERE seq = ?", (seq,))


def _change_one(connection: sqlite3.Connection, draw: random.Random, seq: int) -> None:
    column = draw.choice(["record_id", "tail_no", "side", "day", "body", "hash", "identity"])
    ((value,),) = connection.execute(f"SELECT {column} FROM mlg_records WHERE seq = ?", (seq,))
    at = draw.randrange(len(value))
    piece = value[at : at + 1]
    other = b"\x00" if isinstance(piece, bytes) else "x"
    other = other if other != piece else type(piece)(b"\x01" if other == b"\x00" else "y")
    changed = value[:at] + other + value[at + 1 :]
    connection.execute(f"UPDATE mlg_records SET {column} = ? WHERE seq = ?", (changed, seq))


TAMPERS: tuple[Tamper, ...] = (_cut_back, _take_one, _change_one)


@pytest.mark.parametrize("times", [8, pytest.param(120, marks=pytest.mark.slow)])
@pytest.mark.parametrize("tamper", TAMPERS)
def test_a_log_that_was_cut_back_or_changed_is_found_by_any_report(
    kept, tmp_path, gear, tamper, times
):
    draw = random.Random(f"{tamper.__name__} {times}")
    some = reports(kept)
    count = Store(kept / "store.sqlite").head()[0]
    for n in range(times):
        store = tmp_path / f"{n}.sqlite"
        shutil.copy(kept / "store.sqlite", store)
        with sqlite3.connect(store) as connection:
            _forget(connection)
            tamper(connection, draw, draw.randint(1, count))
        connection.close()
        found = compare_report(Store(store), gear, draw.choice(some))
        assert found.standing is Standing.VIOLATED
        assert found.why


def test_a_log_that_was_written_anew_without_its_last_record_is_found(kept, tmp_path, gear):
    whole = Store(kept / "store.sqlite").all()
    for n in range(len(whole)):
        anew = Store(tmp_path / f"{n}.sqlite")
        anew.add([record for place, record in enumerate(whole) if place != n])
        assert anew.verify()[1] is None
        for each in reports(kept):
            found = compare_report(anew, gear, each)
            assert found.standing is Standing.VIOLATED
            assert "does not hold that one" in found.why[0]


@pytest.mark.parametrize("text", ["", "mlgwitness", "mlgwitness00ff", "mlgwitness789c"])
def test_a_file_that_states_no_log_is_refused(kept: Path, tmp_path: Path, text: str) -> None:
    page = tmp_path / "page.html"
    page.write_text(text)
    shown = mlg("history", "verify", "--report", page, "--store", kept / "store.sqlite")
    assert shown.code == 2
    assert "states no log" in shown.err


def test_a_report_of_what_was_not_kept_states_no_log(tmp_path: Path, gear: Gear) -> None:
    from tests.cli.conftest import ROOT

    assert mlg("check", ROOT / "inspection_data/failure_case.csv", "--report", tmp_path).code == 1
    for page in tmp_path.iterdir():
        with pytest.raises(UsageError, match="states no log"):
            compare_report(Store(tmp_path / "none.sqlite"), gear, page)
