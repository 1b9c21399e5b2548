"""What a store or an export holds is judged as a cell would be, whenever it is read."""

from __future__ import annotations

import json
import os
import sqlite3
import time
import tracemalloc
import zlib
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from mlg_troubleshoot.gear.gear_file import load_gear
from mlg_troubleshoot.store import (
    Record,
    RecordKind,
    Store,
    StoreError,
    database,
    inspection_record,
    packed,
)
from mlg_troubleshoot.workflows.keep import KeptGate
from tests.cli.conftest import Run, mlg, row

from . import places

SOUND = inspection_record(places.inspection(1))


def with_field(**fields: object) -> dict[str, Any]:
    return {"inspection": {**SOUND.body["inspection"], **fields}}


WRONG_INSPECTIONS = {
    "no inspection": {"x": 1},
    "a list": [1],
    "an unknown column": with_field(colour="red"),
    "a clearance below zero": with_field(clearance_in={"3": -5.0}),
    "a clearance beyond any": with_field(clearance_in={"3": 1e300}),
    "a clearance that is not a number": with_field(clearance_in={"3": "thick"}),
    "clearances as a list": with_field(clearance_in=[0.001]),
    "a joint that the gear has not": with_field(clearance_in={"99": 0.001}),
    "landings beyond any": with_field(gear_landings=1e308),
    "landings as a text": with_field(gear_landings="x"),
    "landings as a list": with_field(gear_landings=[1]),
    "a whole number of 400 digits": with_field(gear_landings=10**400),
    "another side than its record": with_field(side="RH"),
    "a side that is not valid": with_field(side="XX"),
    "a side that is half a character": with_field(side="\ud800"),
    "a convention that is not valid": with_field(convention="GUESSED"),
    "a day that is not valid": with_field(inspection_date="9999-99-99"),
    "a margin of zero": with_field(margin_in=0.0),
    "an uncertainty of zero": with_field(gauge_u_by_joint_in={"3": 0.0}),
    "a reading that no cell may hold": with_field(readings_in=[0.51]),
    "a number as a text": with_field(gear_landings="400"),
    "another day than its record": with_field(inspection_date="2026-01-03"),
    "an entry without a unit": with_field(entered={"3": ["4"]}),
    "an entry with an end that is not valid": with_field(entered={"3": ["4", "thou", "~"]}),
    "a source that is not valid": with_field(source=["file"]),
    "remarks that are not text": with_field(carried={"remarks": 3}),
    "no tail": {
        "inspection": {k: v for k, v in SOUND.body["inspection"].items() if k != "tail_no"}
    },
}
OTHERS: dict[str, tuple[RecordKind, Any]] = {
    "a correction of nothing": (RecordKind.CORRECTION, with_field()),
    "an assessment without a result": (RecordKind.ASSESSMENT, {"verdict": "WITHIN_MARGIN"}),
    "a repair without joints": (RecordKind.REPAIR, {"landings": None}),
    "a repair of a joint that is not valid": (
        RecordKind.REPAIR,
        {"joints": [99], "landings": None},
    ),
    "a repair of a joint that is true": (RecordKind.REPAIR, {"joints": [True], "landings": None}),
    "a repair at endless landings": (RecordKind.REPAIR, {"joints": [3], "landings": 1e308}),
    "a re-rigging at endless landings": (RecordKind.RERIG, {"landings": 1e308}),
    "a void of nothing": (RecordKind.VOID, {"why": "x"}),
    "an outcome without a joint": (RecordKind.OUTCOME, {"of": "0" * 64, "found": "x"}),
}
EVIL = {
    **{name: (RecordKind.INSPECTION, body) for name, body in WRONG_INSPECTIONS.items()},
    **OTHERS,
}


def evil(name: str) -> Record:
    kind, body = EVIL[name]
    return replace(SOUND, kind=kind, packed=packed(body), identity=(name,))


@pytest.fixture
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A store in which a gear has been kept soundly."""
    monkeypatch.setenv("MLG_STORE", str(tmp_path / "store.sqlite"))
    Store(tmp_path / "store.sqlite").add(places.records(1, 4))
    return tmp_path / "store.sqlite"


# Whatever is wrong with it, an inspection goes through the same gate: two of them every day.
EVERY_DAY = {*OTHERS, "a list", "a clearance below zero"}


each_day = pytest.mark.parametrize(
    "name", [pytest.param(n, marks=() if n in EVERY_DAY else pytest.mark.slow) for n in EVIL]
)


@each_day
def test_wrong_content_that_stands_in_a_store_ends_no_command_with_an_internal_error(
    tmp_path, place, name
):
    Store(place).add([evil(name)])
    day = ("--date", "2026-02-01")
    for command in (
        ("history",),
        ("history", "N1", "LH", "--no-forecast"),
        ("history", "N1", "LH", "--no-forecast", "--json"),
        ("fleet", "--no-forecast"),
        ("history", "move", "R2", "N9", "LH", "--why", "x"),
        ("history", "repair", "N1", "LH", "--joint", "3", *day),
        ("history", "export", tmp_path / "chain.jsonl"),
        ("check", places.table(tmp_path, row(tail_no="N1")), "--keep", "--report", tmp_path / "r"),
    ):
        run = mlg(*command)
        assert run.code in (0, 1, 5), (command, run.err)
        assert run.code != 5 or "mlg history verify" in run.err, (command, run.err)


@each_day
def test_a_record_that_cannot_be_read_is_not_imported_named_by_verify_and_put_aside_by_voiding_it(
    tmp_path, place, name
):
    Store(place).add([evil(name)])
    new = ("--store", tmp_path / "new.sqlite")
    (tmp_path / "evil.jsonl").write_text("".join(Store(place).export()), encoding="utf-8")
    run = mlg("history", "import", tmp_path / "evil.jsonl", *new)
    assert (run.code, "evil.jsonl, line 7" in run.err) == (5, True), run.err
    run = mlg("history", "verify")
    assert (run.code, "record 7 (" in run.out) == (1, True)
    digest = Store(place).all()[-1].digest
    assert mlg("history", "void", digest[:10], "--why", "not ours").code == 0
    assert mlg("history", "N1", "LH", "--no-forecast").code == 0
    assert mlg("history", "verify").code == 0
    assert mlg("history", "export", tmp_path / "chain.jsonl").code == 0
    assert mlg("history", "import", tmp_path / "chain.jsonl", *new).code == 0


def test_the_record_and_its_column_are_named_and_nothing_is_added_or_exported(place, tmp_path):
    Store(place).add([evil("a clearance below zero")])
    run = mlg("history", "N1", "LH", "--no-forecast")
    assert run.code == 5
    assert "record 7 (inspection 'R1'" in run.err
    assert "column 'clearance_in, joint 3': -5.0 is not a number from 0 to 0.05" in run.err
    assert "Run: mlg history verify" in run.err
    run = mlg("history", "repair", "N1", "LH", "--joint", "3", "--date", "2026-02-01")
    assert (run.code, len(Store(place).all())) == (5, 7)
    assert mlg("history", "export", tmp_path / "chain.jsonl").code == 5
    assert not (tmp_path / "chain.jsonl").exists()


def test_every_kind_of_record_that_the_program_keeps_is_read_again(tmp_path, place):
    table = places.table(
        tmp_path,
        row(
            record_id="W1",
            plunger_displacement_in="0.021",
            margin_in="0.031",
            outcome="RETRACTED",
            approach="EXTENDING",
            inspection_date="2025-03-03",
            gear_landings="800",
            temperature_c="-12",
            hydraulic_pressure_psi="1500",
            gauge_id="G-1",
            technician_id="T-2",
            remarks="größer <b>",
            gauge_u_in="0.0004",
            gauge_u_3_in="0.0002",
            clearance_7_in="<0.002",
            axial_float_4_in="0.01",
        ),
    )
    assert mlg("check", table, "--keep").code == 0
    done = ("--joint", "3", "--date", "2025-04-01", "--landings", "805")
    mlg("history", "repair", "N123", "LH", *done)
    mlg("history", "amend", "W1", "landings=810")
    mlg("history", "void", "R2", "--why", "another aircraft")
    kept = {record.kind for record in Store(place).all()}
    assert kept >= {RecordKind.REPAIR, RecordKind.CORRECTION, RecordKind.VOID}
    assert mlg("history", "verify").code == 0


def tampered(place: Path, change: str, *values: object) -> None:
    with closing(sqlite3.connect(place)) as raw, raw:
        raw.execute("DROP TRIGGER IF EXISTS mlg_no_update")
        raw.execute("DROP TRIGGER IF EXISTS mlg_no_delete")
        raw.execute(change, values)


COMMANDS: list[tuple[object, ...]] = [
    ("history",),
    ("history", "N1", "LH", "--no-forecast"),
    ("fleet", "--no-forecast"),
    ("history", "void", "R2", "--why", "x"),
    ("history", "move", "R2", "N9", "LH", "--why", "x"),
    ("history", "repair", "N1", "LH", "--joint", "3", "--date", "2026-02-01"),
]
READ_WRONGLY: dict[str, tuple[str, tuple[object, ...]]] = {
    "a kind that is not valid": ("UPDATE mlg_records SET kind = 'inspektion' WHERE seq = 1", ()),
    "a body that is not valid": ("UPDATE mlg_records SET body = ? WHERE seq = 1", (b"\x00\x01",)),
    "a body that is a number": ("UPDATE mlg_records SET body = 99999999999 WHERE seq = 1", ()),
    "a body that is a text": ("UPDATE mlg_records SET body = 'text' WHERE seq = 1", ()),
    "a tail that is not text": ("UPDATE mlg_records SET tail_no = ? WHERE seq = 1", (b"\x8c",)),
    "a hash that is a number": ("UPDATE mlg_records SET hash = 99999999999 WHERE seq = 1", ()),
}
NOT_A_CHAIN: dict[str, tuple[str, tuple[object, ...]]] = {
    "a middle record is gone": ("DELETE FROM mlg_records WHERE seq = 3", ()),
    "the first record is gone": ("DELETE FROM mlg_records WHERE seq = 1", ()),
    "a hash was changed": ("UPDATE mlg_records SET hash = ? WHERE seq = 3", (b"\x00" * 32,)),
    "a content was changed": ("UPDATE mlg_records SET record_id = 'R9' WHERE seq = 3", ()),
}
BROKEN = {**READ_WRONGLY, **NOT_A_CHAIN}


@pytest.mark.parametrize("command", COMMANDS, ids=lambda command: " ".join(map(str, command)))
@pytest.mark.parametrize("change", READ_WRONGLY)
def test_a_record_that_cannot_be_read_is_named_with_what_to_do(place, change, command):
    tampered(place, READ_WRONGLY[change][0], *READ_WRONGLY[change][1])
    run = mlg(*command)
    # Whoever does not read the record cannot be hindered by it, unless the chain is written to.
    assert run.code in (0, 5), run.err
    assert run.code == 0 or ("record 1" in run.err and "mlg history verify" in run.err), run.err
    with closing(sqlite3.connect(place)) as raw:
        assert len(raw.execute("SELECT seq FROM mlg_records").fetchall()) == 6


@pytest.mark.parametrize("change", BROKEN)
def test_a_chain_that_does_not_fit_is_found_nothing_is_kept_on_it_and_it_is_not_exported(
    tmp_path, place, change
):
    statement, values = BROKEN[change]
    tampered(place, statement, *values)
    assert mlg("history", "verify").code == 1
    run = mlg("history", "export", tmp_path / "chain.jsonl")
    assert (run.code, (tmp_path / "chain.jsonl").exists()) == (5, False)
    run = mlg("check", places.table(tmp_path, row()), "--keep")
    assert run.code == 5
    assert "mlg history verify" in run.err


def test_of_a_long_chain_the_newest_records_are_walked_before_another_is_added(place, monkeypatch):
    monkeypatch.setattr("mlg_troubleshoot.store.database._NEWEST", 2)
    tampered(place, "UPDATE mlg_records SET record_id = 'R9' WHERE seq = 3")
    assert Store(place).add(places.records(7, 8)).new == 2
    tampered(place, "UPDATE mlg_records SET record_id = 'R9' WHERE seq = 7")
    with pytest.raises(StoreError, match="does not fit at record 7"):
        Store(place).add(places.records(8, 9))


def test_of_a_long_chain_an_old_record_that_was_taken_away_is_missed_by_the_count(
    place, monkeypatch
):
    monkeypatch.setattr("mlg_troubleshoot.store.database._NEWEST", 2)
    tampered(place, "DELETE FROM mlg_records WHERE seq = ?", 2)
    with pytest.raises(StoreError, match="it holds 5 records, and the last one is number 6"):
        Store(place).add(places.records(7, 8))


def bomb(megabytes: int) -> bytes:
    press = zlib.compressobj(9, zdict=database._OFTEN)
    spaces = b"".join(press.compress(b" " * 1_000_000) for _ in range(megabytes))
    return press.compress(b'{"x":"') + spaces + press.compress(b'"}') + press.flush()


def test_a_record_that_unpacks_to_more_than_a_megabyte_is_refused_before_it_is_unpacked(place):
    Store(place).add([replace(SOUND, packed=bomb(100), identity=("bomb",))])
    run, _seconds, peak_mb = measured("history", "N1", "LH", "--no-forecast")
    assert run.code == 5
    assert "record 7" in run.err
    assert "more than 1000000 bytes" in run.err
    assert peak_mb < 50


def test_a_record_that_could_not_be_read_again_is_not_kept(tmp_path: Path, place: Path) -> None:
    long = places.table(tmp_path, row(**{f"note {n}": "ü" * 6_000 for n in range(40)}))
    run = mlg("check", long, "--keep")
    assert run.code == 5
    assert "cannot be kept, at most 1000000" in run.err
    assert len(Store(place).all()) == 6


def test_a_packed_record_of_more_than_a_megabyte_is_not_fetched(place: Path) -> None:
    tampered(place, "UPDATE mlg_records SET body = zeroblob(100000000) WHERE seq = 1")
    run, _seconds, peak_mb = measured("history", "N1", "LH", "--no-forecast")
    assert run.code == 5
    assert "record 1, column 'body' cannot be read: too large" in run.err
    assert peak_mb < 50


@pytest.mark.parametrize("column", ["day", "recorded_at"])
def test_a_record_whose_moment_is_not_one_is_named(place: Path, column: str) -> None:
    tampered(place, f"UPDATE mlg_records SET {column} = '2026-13-01' WHERE seq = 1")
    run = mlg("history", "N1", "LH", "--no-forecast")
    assert run.code == 5
    assert f"record 1, column {column!r} cannot be read: '2026-13-01'" in run.err
    assert mlg("history", "verify").code == 1


@pytest.mark.parametrize("version", ["abc", -3, 0, 99])
def test_a_schema_version_that_is_not_valid_is_named(place: Path, version: object) -> None:
    tampered(place, "UPDATE mlg_meta SET schema_version = ?", version)
    run = mlg("history")
    assert run.code == 5
    assert f"has schema version {version!r}, and this program knows 2" in run.err


def measured(*arguments: object) -> tuple[Run, float, float]:
    """A run, its time [s] and the most memory that it took [MB]."""
    tracemalloc.start()
    try:
        begun = time.monotonic()
        run = mlg(*arguments)
        return run, time.monotonic() - begun, tracemalloc.get_traced_memory()[1] / 1e6
    finally:
        tracemalloc.stop()


def imported(file: Path) -> tuple[Run, float, float]:
    return measured("history", "import", file, "--store", file.with_name("new.sqlite"))


def test_a_pipe_a_device_or_a_folder_is_not_imported_nor_waited_for(tmp_path: Path) -> None:
    for device in ("/dev/zero", "/dev/null", "/"):
        run = mlg("history", "import", device, "--store", tmp_path / "new.sqlite")
        assert run.code == 2
    os.mkfifo(tmp_path / "chain.jsonl")
    run, seconds, _peak_mb = imported(tmp_path / "chain.jsonl")
    assert run.code == 2
    assert "is not a regular file" in run.err
    assert seconds < 10


def sparse(path: Path) -> None:
    with path.open("wb") as file:
        file.truncate(3_000_000_000)


def one_long_line(path: Path) -> None:
    path.write_text('{"seq":' + "9" * 100_000_000, encoding="utf-8")


def zeros_of_allowed_size(path: Path) -> None:
    with path.open("wb") as file:
        file.truncate(100_000_000)


def deep(path: Path) -> None:
    path.write_text("[" * 3_000_000, encoding="utf-8")


@pytest.mark.parametrize(
    "written", [sparse, one_long_line, zeros_of_allowed_size, deep], ids=lambda f: f.__name__
)
def test_what_is_too_large_to_import_is_refused_in_little_time_and_memory(tmp_path, written):
    written(tmp_path / "chain.jsonl")
    run, seconds, peak_mb = imported(tmp_path / "chain.jsonl")
    assert run.code in (2, 5), run.err
    assert seconds < 10
    assert peak_mb < 300


def test_an_import_of_too_many_records_is_refused(tmp_path, place, monkeypatch):
    monkeypatch.setattr("mlg_troubleshoot.store.database._MOST_IMPORTED", 5)
    with pytest.raises(StoreError, match="line 6: at most 5 records"):
        Store(tmp_path / "new.sqlite").restore(Store(place).export(), "chain")


def test_a_refused_import_makes_no_store(tmp_path: Path) -> None:
    (tmp_path / "chain.jsonl").write_text("{}\n", encoding="utf-8")
    imported(tmp_path / "chain.jsonl")
    assert not (tmp_path / "new.sqlite").exists()


def test_a_body_that_a_record_says_and_does_not_hold_is_refused(tmp_path, place):
    lines = list(Store(place).export())
    first = json.loads(lines[0])
    lines[0] = json.dumps({**first, "seq": 1.0}) + "\n"
    with pytest.raises(StoreError, match="line 1 is not an exported record: seq"):
        Store(tmp_path / "new.sqlite", judge=KeptGate(load_gear())).restore(lines, "chain")
