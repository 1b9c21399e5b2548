"""A side, a day, a number and an id are the same wherever they are typed."""

from __future__ import annotations

import re
from datetime import date, timedelta
from pathlib import Path

import pytest

from mlg_troubleshoot import records
from mlg_troubleshoot.decision.inspection import Side
from mlg_troubleshoot.errors import UsageError
from mlg_troubleshoot.life.folding import life_of
from mlg_troubleshoot.store import Record, Store
from tests.cli.conftest import Run, mlg, row

from . import places

BY_HAND = ("check", "--tail", "N1", "--convention", "RADIAL", "--set", "3=0.001in", "-q", "--keep")
# How a side is spelt is read in one place: tests/records/test_inspection_columns.py has them all.
SPELLINGS = ["LH", "Left side", "port"]
REPAIR = ("history", "repair", "N1", "LH", "--joint", "3")


@pytest.fixture
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("MLG_STORE", str(tmp_path / "store.sqlite"))
    Store().add(places.records(1, 2))
    return tmp_path / "store.sqlite"


def last(place: Path) -> Record:
    return Store(place).all()[-1]


@pytest.mark.parametrize("side", SPELLINGS)
def test_a_side_is_the_same_gear_in_a_flag_and_as_an_argument(place: Path, side: str) -> None:
    assert mlg(*BY_HAND, "--side", side).code in (0, 1)
    assert last(place).side == "LH"
    told = mlg("history", "N1", side, "--no-forecast", "--json").json["events"]
    assert len({event["hash"] for event in told}) == 2
    assert mlg("history", "repair", "N1", side, "--joint", "3", "--date", "2026-02-01").code == 0
    assert life_of(Store(place), "N1", side).key == ("N1", "LH")


@pytest.mark.parametrize("side", ["XX", "middle", "", "\udcff"])
def test_what_is_not_a_side_is_refused_wherever_it_is_typed(place: Path, side: str) -> None:
    for command in (
        (*BY_HAND, "--side", side),
        ("history", "N1", side),
        ("history", "repair", "N1", side, "--joint", "3", "--date", "2026-02-01"),
    ):
        assert mlg(*command).code == 2


def test_a_side_from_python_is_refused_with_the_same_words() -> None:
    with pytest.raises(UsageError, match="side 'XX' is not LH or RH"):
        Side.parse("XX")


def test_a_record_id_that_was_made_by_flags_says_tail_side_and_day(place: Path) -> None:
    mlg(*BY_HAND, "--side", "left")
    assert re.fullmatch(r"N1-LH-\d{8}", last(place).record_id)


@pytest.mark.parametrize(
    "day", ["2026-03-04", "20260304", "4-Mar-2026", "4 Mar 2026", "March 4, 2026"]
)
def test_a_day_is_written_as_in_a_cell(place: Path, day: str) -> None:
    assert mlg(*REPAIR, "--date", day).code == 0
    assert last(place).day == "2026-03-04"


def refused(*more: object, command: tuple[str, ...] = REPAIR) -> Run:
    run = mlg(*command, *more)
    assert run.code == 2, run.err
    assert len(Store().all()) == 2
    return run


@pytest.mark.parametrize(
    "day",
    [
        *("9999-12-31", "0001-01-01", "1949-12-31", "2026-02-30", "03/04/2026", "n/a", ""),
        "4 Mar 1026",
    ],
)
def test_a_day_that_cannot_be_meant_is_refused(place: Path, day: str) -> None:
    assert f"--date {day!r}" in refused("--date", day).err


def test_work_can_be_dated_until_tomorrow_and_not_later(place: Path) -> None:
    today = date.today()
    assert "not after" in refused("--date", (today + timedelta(days=2)).isoformat()).err
    assert mlg(*REPAIR, "--date", (today + timedelta(days=1)).isoformat()).code == 0


@pytest.mark.parametrize("landings", ["inf", "-inf", "nan", "1e400", "1e308", "-1", "many", "1,5"])
def test_landings_that_cannot_be_meant_are_refused(place: Path, landings: str) -> None:
    assert (
        f"--landings '{landings}'" in refused("--date", "2026-02-01", f"--landings={landings}").err
    )


def test_landings_are_kept_as_a_number(place: Path) -> None:
    mlg(*REPAIR, "--date", "2026-02-01", "--landings", "805")
    assert last(place).body == {"joints": [3], "landings": 805.0, "work_order": None}


@pytest.mark.parametrize(
    "command",
    [
        ("history", "\udcff", "LH"),
        ("history", "\udcff"),
        ("history", "repair", "\udcff", "LH", "--joint", "3", "--date", "2026-02-01"),
        (*REPAIR, "--date", "2026-02-01", "--work-order", "\udcff"),
        ("history", "void", "R1", "--why", "\udcff"),
        ("history", "void", "\udcff", "--why", "x"),
    ],
)
def test_what_is_not_utf8_is_refused_as_usage(place: Path, command: tuple[str, ...]) -> None:
    refused(command=command)


# The same inspection from another file.


def kept(folder: Path, name: str, *rows: dict[str, str]) -> str:
    run = mlg("check", places.table(folder, *rows, name=name), "--keep")
    assert run.code in (0, 1), run.err
    return run.err


ROWS = [row(record_id=f"W{n}", tail_no="N7", inspection_date="2025-03-03") for n in range(3)]
NAMELESS = [
    {k: v for k, v in each.items() if k != "record_id"} | {"tail_no": f"N{n}"}
    for n, each in enumerate(ROWS)
]


@pytest.mark.parametrize("rows", [ROWS, NAMELESS], ids=["with ids", "with made ids"])
def test_the_same_inspections_from_another_file_add_nothing(tmp_path, place, rows):
    files = [places.table(tmp_path, *rows, name=name) for name in ("one.csv", "other.csv")]
    of_both = mlg("check", *files, "--keep").err
    assert "3 inspections kept" in of_both
    assert ", 3 known already" in of_both
    assert ", 3 known already" in kept(tmp_path, "renamed.csv", *rows)


def test_the_same_reading_written_in_another_unit_is_the_same_inspection(tmp_path, place):
    kept(tmp_path, "one.csv", ROWS[0])
    in_thou = {**ROWS[0], "clearance_3_thou": "1"}
    assert in_thou.pop("clearance_3_in") == "0.001"
    assert ", 1 known already" in kept(tmp_path, "other.csv", in_thou)


def test_bodies_of_records_are_those_of_earlier_versions(tmp_path: Path) -> None:
    (tmp_path / "old.sqlite").write_bytes(
        (Path(__file__).parent / "data" / "version-1.sqlite").read_bytes()
    )
    Store(tmp_path / "new.sqlite").add(places.records(1, 4))
    old, new = (Store(tmp_path / f"{name}.sqlite").all() for name in ("old", "new"))
    assert [record.content for record in old] == [record.content for record in new]


def test_two_entries_of_one_gear_within_a_second_are_both_kept(place, monkeypatch):
    made = "N1-LH-20260201"
    monkeypatch.setattr(records, "made_record_id", lambda *_entry: made)
    for value in ("0.001in", "0.002in", "0.003in", "0.002in"):
        assert mlg(*BY_HAND, "--side", "LH", "--set", f"4={value}").code in (0, 1)
    ids = [kept.record.record_id for kept in life_of(Store(place), "N1", "LH").inspections]
    assert [each for each in ids if each.startswith(made)] == [made, f"{made}-2", f"{made}-3"]


def test_an_id_that_was_typed_stays_as_it_is(place: Path) -> None:
    typed = (*BY_HAND, "--side", "LH", "--set", "record_id=mine")
    assert mlg(*typed, "--set", "4=0.001in").code in (0, 1)
    refused = mlg(*typed, "--set", "4=0.002in")
    assert refused.code == 5
    assert "kept already with other content" in refused.err


@pytest.mark.parametrize("tail", ["n1", "N-1", "n 1"])
def test_a_tail_is_found_in_any_capitals_blanks_and_dashes(place: Path, tail: str) -> None:
    shown = mlg("history", tail, "LH", "--no-forecast", "--json")
    assert shown.json["tail_no"] == "N1"
    assert mlg("history", "repair", tail, "LH", "--joint", "3", "--date", "2026-02-01").code == 0
    assert last(place).tail_no == "N1"
