"""The store: nothing lost, nothing twice, nothing changed unseen."""

from __future__ import annotations

import json
import sqlite3
from collections.abc import Iterator
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import pytest

from mlg_troubleshoot.decision.inspection import Outcome, Side
from mlg_troubleshoot.store import (
    Record,
    RecordKind,
    Store,
    StoreError,
    inspection_from,
    inspection_record,
)
from mlg_troubleshoot.workflows.keep import Told

from . import places

OLD = Path(__file__).parent / "data"


@pytest.fixture
def place(tmp_path: Path) -> Path:
    return tmp_path / "folder" / "store.sqlite"


@pytest.fixture
def store(place: Path) -> Store:
    found = Store(place)
    found.add(places.records(1, 6))
    return found


def kept_inspections(store: Store) -> list[Record]:
    return [record for record in store.all() if record.kind is RecordKind.INSPECTION]


def test_an_inspection_comes_back_as_it_was_kept(store: Store) -> None:
    assert inspection_from(kept_inspections(store)[2]) == places.inspection(3)


def test_the_same_inspection_twice_is_one_in_one_call_too(store: Store) -> None:
    again = store.add([*places.records(1, 8), *places.records(1, 8)])
    assert (again.new, again.known) == (4, 24)


def test_the_records_of_one_side_are_asked_for_without_those_of_the_other(store: Store) -> None:
    store.add([inspection_record(replace(places.inspection(1), side=Side.RH))])
    assert {record.side for record in store.of_gears([("N1", "LH"), ("N1", "RH")])} == {"LH", "RH"}
    assert {record.side for record in store.of_gears([("N1", "LH")])} == {"LH"}


def test_while_one_writes_no_other_begins_to(store: Store) -> None:
    with (
        store.transaction(writing=True),
        pytest.raises(StoreError, match="locked"),
        Store(store.place, patience_s=0).transaction(writing=True),
    ):
        pass


def test_the_same_identity_with_other_content_is_refused_and_nothing_of_the_call_is_kept(store):
    other = [*places.records(20, 22), inspection_record(places.inspection(3, clearance_in=0.009))]
    with pytest.raises(StoreError, match=r"R3 \(N3 LH 2026-01-04\).*nothing of this was kept"):
        store.add(other)
    assert len(store.all()) == 10


def test_an_empty_file_is_an_empty_store(tmp_path: Path) -> None:
    (tmp_path / "empty").touch()
    assert Store(tmp_path / "empty").all() == []
    Store(tmp_path / "empty").add(places.records(1, 2))
    assert len(Store(tmp_path / "empty").all()) == 2


def test_reading_makes_no_file(place: Path) -> None:
    assert Store(place).gears() == []
    assert not place.exists()


@pytest.mark.parametrize(
    "change", ["UPDATE mlg_records SET side = 'RH'", "DELETE FROM mlg_records"]
)
def test_the_database_itself_refuses_to_change_a_record(store, place, change):
    with (
        closing(sqlite3.connect(place)) as raw,
        raw,
        pytest.raises(sqlite3.IntegrityError, match="only ever added"),
    ):
        raw.execute(change)


COLUMNS = (
    *("seq", "kind", "record_id", "tail_no", "side", "day", "identity", "body", "hash"),
    *("recorded_at", "recorded_by", "origin"),
)


def forged(place: Path, column: str, seq: int) -> Iterator[object]:
    """Values with one byte changed, at the first, a middle and the last place."""
    with closing(sqlite3.connect(place)) as raw, raw:
        (value,) = raw.execute(f"SELECT {column} FROM mlg_records WHERE seq = ?", (seq,)).fetchone()
    if isinstance(value, int):
        yield value + 100
        return
    if value == "":
        yield "x"
        return
    as_bytes = value.encode() if isinstance(value, str) else value
    for at in {0, len(as_bytes) // 2, len(as_bytes) - 1}:
        changed = as_bytes[:at] + bytes([as_bytes[at] ^ 1]) + as_bytes[at + 1 :]
        yield changed.decode() if isinstance(value, str) else changed
    if isinstance(value, str):
        # No text at all, and a text with a byte that is not text.
        yield b"\xff" + as_bytes


@pytest.mark.parametrize("column", COLUMNS)
def test_a_changed_byte_in_any_field_is_found_and_its_record_named(store, place, column):
    for value in list(forged(place, column, 4)):
        with closing(sqlite3.connect(place)) as raw, raw:
            raw.execute("DROP TRIGGER IF EXISTS mlg_no_update")
            (before,) = raw.execute(f"SELECT {column} FROM mlg_records WHERE seq = 4").fetchone()
            raw.execute(f"UPDATE mlg_records SET {column} = ? WHERE seq = 4", (value,))
        _count, broken = store.verify()
        assert broken is not None
        # A record that was put elsewhere leaves a gap where it stood.
        assert broken.seq == (5 if column == "seq" else 4), value
        with closing(sqlite3.connect(place)) as raw, raw:
            at = value if column == "seq" else 4
            raw.execute(f"UPDATE mlg_records SET {column} = ? WHERE seq = ?", (before, at))
    assert store.verify() == (10, None)


def test_an_exported_chain_comes_back_whole(store: Store, tmp_path: Path) -> None:
    other = Store(tmp_path / "other.sqlite")
    assert other.restore(store.export(), "chain").new == 10
    assert list(other.export()) == list(store.export())
    assert other.verify() == (10, None)


def test_an_export_says_each_records_kind_and_content(store: Store) -> None:
    first = json.loads(next(iter(store.export())))
    assert first["kind"] == "inspection"
    assert first["content"]["inspection"]["clearance_in"] == {"3": 0.002, "10": 0.001}


def test_the_rest_of_a_chain_is_added_to_its_beginning(store: Store, tmp_path: Path) -> None:
    beginning = Store(tmp_path / "other.sqlite")
    beginning.restore(list(store.export())[:4], "chain")
    assert beginning.restore(store.export(), "chain").new == 6


@pytest.mark.parametrize(
    "version", sorted(OLD.glob("version-*.sqlite")), ids=lambda path: path.stem
)
def test_a_store_of_each_schema_version_can_be_read_and_added_to(version, tmp_path):
    copied = tmp_path / "store.sqlite"
    copied.write_bytes(version.read_bytes())
    store = Store(copied)
    assert inspection_from(kept_inspections(store)[0]) == places.inspection(1)
    assert store.add(places.records(1, 5)).new == 2
    assert store.verify() == (8, None)


@pytest.mark.parametrize(
    ("written", "instead"), [('"day":"2026-01-04"', '"day":"2026-01-05"'), ("größer", "kleiner")]
)
def test_an_export_whose_columns_or_content_alone_were_changed_is_refused(
    store, tmp_path, written, instead
):
    told = [json.dumps(part)[1:-1] if part.isalpha() else part for part in (written, instead)]
    lines = [
        line.replace(*told, 1) if line.startswith('{"body"') else line for line in store.export()
    ]
    assert lines != list(store.export())
    with pytest.raises(StoreError, match="line"):
        Store(tmp_path / "other.sqlite").restore(lines, "chain")


@pytest.mark.parametrize(
    "found",
    [
        {"readings_in": (0.01,)},
        {"axial_float_in": {3: 0.02}},
        {"gauge_u_by_joint_in": {3: 0.001}},
        {"margin_in": 0.04},
        {"outcome": Outcome.FAILED},
        {"carried": {}},
    ],
)
def test_what_was_found_otherwise_is_another_inspection_and_comes_back_so(found, place):
    kept, other = places.inspection(2), replace(places.inspection(2), **found)
    one, two = (Told.of(inspection_record(each)) for each in (kept, other))
    assert one.content != two.content
    Store(place).add([inspection_record(other)])
    assert inspection_from(kept_inspections(Store(place))[0]) == other
