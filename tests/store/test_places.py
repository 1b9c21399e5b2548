"""Where a store may be, how it is named without its password, and what verify says of it."""

from __future__ import annotations

import os
import sqlite3
from contextlib import closing
from pathlib import Path

import pytest

from mlg_troubleshoot.errors import UsageError
from mlg_troubleshoot.store import Store, StoreError
from tests.cli.conftest import FAILURE, Run, mlg, row

from . import places

OLD = Path(__file__).parent / "data" / "version-1.sqlite"
ID = 0x6D6C6731
AWAY = "127.0.0.1:1/mlg"


@pytest.fixture
def place(tmp_path: Path) -> Path:
    Store(tmp_path / "store.sqlite").add(places.records(1, 4))
    return tmp_path / "store.sqlite"


def keep(folder: Path, where: object) -> Run:
    return mlg("check", places.table(folder, row()), "--keep", "--store", where)


@pytest.mark.parametrize(
    "where",
    [
        *("", "  ", ":memory:", "sqlite://", "sqlite:///", "sqlite:///:memory:"),
        *("sqlite:///x?mode=memory", "sqlite://host/x"),
    ],
)
def test_a_place_where_nothing_would_stay_is_refused(tmp_path: Path, where: str) -> None:
    run = keep(tmp_path, where)
    assert run.code == 2
    assert "nothing would be kept" in run.err
    with pytest.raises(UsageError, match="nothing would be kept"):
        Store(f"{where}\0")


@pytest.mark.parametrize("command", [("history",), ("history", "verify"), ("fleet",)])
def test_a_pipe_is_not_a_store(tmp_path: Path, command: tuple[str, ...]) -> None:
    os.mkfifo(tmp_path / "pipe")
    run = mlg(*command, "--store", tmp_path / "pipe")
    assert run.code == 2
    assert "not a file" in run.err


@pytest.mark.parametrize("where", ["/dev/null", "/dev/zero", "/"])
def test_a_device_or_a_folder_is_not_a_store(tmp_path: Path, where: str) -> None:
    assert keep(tmp_path, where).code == 2


def test_the_home_folder_is_found_behind_quotes(tmp_path, monkeypatch):
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    monkeypatch.chdir(tmp_path)
    assert keep(tmp_path, "~/store.sqlite").code == 0
    assert (tmp_path / "home" / "store.sqlite").exists()
    assert not (tmp_path / "~").exists()


def test_a_url_of_a_file_is_that_file_and_reading_at_that_of_no_file_makes_none(tmp_path, place):
    assert Store(f"sqlite:///{place}").file == place
    assert Store(f"sqlite:///{place}").verify() == (6, None)
    assert Store(f"sqlite:///{tmp_path}/none.sqlite").gears() == []
    assert not (tmp_path / "none.sqlite").exists()


# Another program's files.


def application_id(path: Path) -> int:
    with closing(sqlite3.connect(path)) as raw, raw:
        return int(raw.execute("PRAGMA application_id").fetchone()[0])


def test_a_store_is_marked_one_of_before_by_the_first_that_is_kept(tmp_path, place):
    assert application_id(place) == ID
    copied = tmp_path / "store.sqlite"
    copied.write_bytes(OLD.read_bytes())
    assert application_id(copied) == 0
    assert mlg("history", "verify", "--store", copied).code == 0
    assert application_id(copied) == 0
    assert keep(tmp_path, copied).code == 0
    assert application_id(copied) == ID


@pytest.mark.parametrize("command", ["history", "keep", "verify"])
@pytest.mark.parametrize(("marked", "table"), [(0, True), (252006674, True), (252006674, False)])
def test_the_database_of_another_program_is_not_taken_as_a_store(tmp_path, command, marked, table):
    other = tmp_path / "other.sqlite"
    with closing(sqlite3.connect(other)) as raw, raw:
        if table:
            raw.execute("CREATE TABLE accounts (name TEXT)")
        raw.execute(f"PRAGMA application_id = {marked}")
    before = other.read_bytes()
    runs = {"history": ("history",), "verify": ("history", "verify")}
    run = keep(tmp_path, other) if command == "keep" else mlg(*runs[command], "--store", other)
    assert run.code == 5
    assert "a database of another program" in run.err
    assert "What to do: Give --store the name of a new file" in run.err
    assert other.read_bytes() == before


def test_a_file_that_is_not_a_database_is_refused_with_what_to_give(tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("notes " * 500, encoding="utf-8")
    run = keep(tmp_path, tmp_path / "notes.txt")
    assert run.code == 5
    assert "Give --store the name of a new file" in run.err


# What verify finds beside the chain.


def changed(place: Path, *statements: str) -> None:
    with closing(sqlite3.connect(place)) as raw, raw:
        for statement in statements:
            raw.execute(statement)


NO_DELETE = "CREATE TRIGGER mlg_no_delete BEFORE DELETE ON mlg_records BEGIN SELECT 1; END"


@pytest.mark.parametrize(
    ("statements", "named"),
    [
        (("DROP TRIGGER mlg_no_update",), "the trigger mlg_no_update was dropped or changed"),
        (
            ("DROP TRIGGER mlg_no_delete", NO_DELETE),
            "the trigger mlg_no_delete was dropped or changed",
        ),
        (("CREATE TABLE accounts (name TEXT)",), "the table 'accounts' is not one of a store"),
        (("CREATE VIEW seen AS SELECT 1",), "the view 'seen' is not one of a store"),
        (
            ("CREATE TRIGGER quiet AFTER INSERT ON mlg_meta BEGIN SELECT 1; END",),
            "the trigger 'quiet' is not one of a store",
        ),
    ],
)
def test_what_a_store_should_have_and_has_not_is_named(place, statements, named):
    changed(place, *statements)
    run = mlg("history", "verify", "--store", place)
    assert run.code == 1
    assert named in run.out


ENDLESS = (
    "CREATE VIEW mlg_records AS WITH RECURSIVE n(seq) AS (SELECT 1 UNION ALL SELECT seq + 1 FROM n)"
    " SELECT n.seq, o.* FROM n, mlg_old AS o"
)


def test_a_view_in_place_of_a_table_is_refused_and_not_computed(place: Path) -> None:
    changed(place, "ALTER TABLE mlg_records RENAME TO mlg_old", ENDLESS)
    run = mlg("history", "--store", place)
    assert run.code == 5
    assert "a view in place of a table" in run.err


def test_nothing_is_kept_where_a_trigger_would_take_the_records_away(place: Path) -> None:
    taker = "CREATE TRIGGER t AFTER INSERT ON mlg_records BEGIN DELETE FROM mlg_records; END"
    changed(place, "DROP TRIGGER mlg_no_delete", taker)
    before = place.read_bytes()
    run = mlg("history", "void", "R1", "--why", "x", "--store", place)
    assert run.code == 5
    assert "mlg history verify" in run.err
    assert place.read_bytes() == before


def last_hash(place: Path) -> str:
    return Store(place).all()[-1].digest


def test_verify_prints_the_last_hash_and_the_count(place: Path) -> None:
    run = mlg("history", "verify", "--store", place)
    assert (run.code, run.out.count("\n")) == (0, 2)
    assert run.out == f"6 records fit the chain.\nThe last hash is {last_hash(place)}\n"


def test_a_hash_with_records_after_it_is_as_expected_and_they_are_counted(place: Path) -> None:
    noted = last_hash(place)
    run = mlg("history", "verify", "--store", place, "--expect", noted)
    assert run.code == 0
    assert "The expected hash is the last one." in run.out
    Store(place).add(places.records(4, 6))
    run = mlg("history", "verify", "--store", place, "--expect", noted.upper())
    assert run.code == 0
    assert "The expected hash is that of record 6; 4 were added since." in run.out


def test_records_taken_away_from_the_end_are_found_by_the_hash_noted_before(place: Path) -> None:
    noted = last_hash(place)
    changed(place, "DROP TRIGGER mlg_no_delete", "DELETE FROM mlg_records WHERE seq > 4")
    run = mlg("history", "verify", "--store", place, "--expect", noted)
    assert run.code == 1
    assert "4 records fit the chain." in run.out
    assert "The expected hash is not in the chain" in run.out
    # The same of an older copy in place of the store, and of a store that is gone.
    gone = place.with_name("gone.sqlite")
    for at, hash_ in ((place, "0" * 64), (gone, noted)):
        assert mlg("history", "verify", "--store", at, "--expect", hash_).code == 1


@pytest.mark.parametrize("noted", ["", "abc", "x" * 64])
def test_what_is_not_a_hash_cannot_be_expected(place: Path, noted: str) -> None:
    assert mlg("history", "verify", "--store", place, "--expect", noted).code == 2


# Passwords.


@pytest.mark.parametrize(
    "url",
    [
        f"postgresql+psycopg://anna:S3cret9@{AWAY}",
        f"postgresql+psycopg://anna@{AWAY}?password=S3cret9",
        f"postgresql+psycopg://anna@{AWAY}?sslpassword=S3cret9",
        f"postgresql+nosuch://anna:S3cret9@{AWAY}",
        f"mysql://anna:S3cret9@{AWAY}",
        "postgresql+psycopg://anna:S3cret9@127.0.0.1:notaport/mlg",
        f"postgresql+psycopg://anna:x@S3cret9@{AWAY}",
        f"postgresql+psycopg://anna:x/S3cret9@{AWAY}",
        "postgresql+psycopg://anna:S3cret9",
        f"sqlite://anna:S3cret9@{AWAY}",
    ],
)
def test_a_password_is_never_shown(tmp_path: Path, url: str) -> None:
    for run in (
        keep(tmp_path, url),
        mlg("history", "--store", url),
        mlg("history", "amend", "R1", "landings=1", "--store", url),
    ):
        assert run.code in (2, 5)
        assert "S3cret9" not in run.out + run.err
        assert "***" in run.err


def test_who_and_where_a_store_is_stays_readable_and_its_passwords_are_masked() -> None:
    store = Store(f"postgresql+psycopg://anna:S3cret9@{AWAY}?password=0ther")
    assert store._at.masked("no S3cret9 and no 0ther here") == "no *** and no *** here"
    shown = Store(f"postgresql+psycopg://anna:S3cret9@{AWAY}?sslmode=require&password=x").place
    assert shown == f"postgresql+psycopg://anna:***@{AWAY}?password=***&sslmode=require"


def test_a_server_that_cannot_be_reached_is_not_a_usage_error() -> None:
    with pytest.raises(StoreError):
        Store(f"postgresql+psycopg://anna@{AWAY}", patience_s=1).gears()


@pytest.mark.parametrize(
    "given", ["postgresql+psycopg:/a:SECRET9@h/x", "postgresql:a:SECRET9@h/x", "a:SECRET9@h"]
)
def test_a_url_without_its_slashes_is_refused_and_not_shown(given: str, tmp_path: Path) -> None:
    run = mlg("check", FAILURE, "-q", "--keep", "--store", given)
    assert run.code == 2
    assert "SECRET9" not in run.out + run.err
