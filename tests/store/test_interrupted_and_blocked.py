"""Interrupts, locks and clocks, and several writers at once."""

from __future__ import annotations

import random
import signal
import subprocess
import sys
import time
from collections import Counter
from datetime import date
from pathlib import Path

import pytest
import sqlalchemy as sql

from mlg_troubleshoot.cli.prompts.saved import SavedEntries
from mlg_troubleshoot.records import rows
from mlg_troubleshoot.store import Draft, Drafts, Store, StoreError
from mlg_troubleshoot.store.database import _ADVISORY_LOCK
from tests.cli.conftest import mlg, row

from . import places


def test_an_interrupt_within_a_transaction_ends_it_and_keeps_nothing(tmp_path: Path) -> None:
    store = Store(tmp_path / "store.sqlite")
    every = list(places.records(1, 3))
    before = signal.getsignal(signal.SIGINT)
    with pytest.raises(KeyboardInterrupt), store.transaction(writing=True) as connection:
        store._prepare(connection, writing=True)
        signal.raise_signal(signal.SIGINT)
    assert store.all() == []
    assert store.add(every).new == len(every)
    assert signal.getsignal(signal.SIGINT) is before


ENDED = """
import os, signal, sys
import mlg_troubleshoot.cli.app as command
from mlg_troubleshoot.cli import main
from mlg_troubleshoot.outputs import whole_file

def app(**_named):
    with whole_file(sys.argv[1]) as write:
        write(b"half")
        os.kill(os.getpid(), signal.SIGTERM)
        write(b"more")

command.app = app
main()
"""


def test_a_file_that_is_half_written_goes_with_a_command_that_is_ended(tmp_path: Path) -> None:
    out = tmp_path / "out.csv"
    ran = subprocess.run([sys.executable, "-c", ENDED, out], check=False)
    assert ran.returncode == 128 + signal.SIGTERM
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    "given", ["host=hangar password=kite7", "dbname=mlg user=anna password = 'kite7'"]
)
def test_a_connection_string_is_not_a_file_and_its_password_is_not_shown(
    given, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    ran = mlg("check", places.table(tmp_path, row()), "--keep", "--store", given)
    assert ran.code == 2
    assert "kite7" not in ran.out + ran.err
    assert [file.name for file in tmp_path.iterdir()] == ["table.csv"]


def test_drafts_have_an_owner_where_the_environment_names_none(tmp_path, monkeypatch):
    for name in ("USER", "USERNAME", "LOGNAME", "LNAME"):
        monkeypatch.delenv(name, raising=False)
    assert SavedEntries(tmp_path / "store.sqlite").owner


def test_a_clock_at_the_end_of_all_days_ends_no_command(tmp_path, monkeypatch):
    class LastDay(date):
        @classmethod
        def today(cls) -> date:
            return date.max

    monkeypatch.setattr(rows, "date", LastDay)
    assert mlg("check", places.table(tmp_path, row(inspection_date="2026-01-01"))).code == 0


@pytest.mark.slow
def test_a_lock_that_somebody_holds_on_a_server_is_waited_for_no_longer_than_patience() -> None:
    locks = {
        f"SELECT pg_advisory_lock({_ADVISORY_LOCK})": lambda store: store.add(places.records(2, 3)),
        "LOCK TABLE mlg_records": Store.all,
    }
    with places.server() as url:
        Store(url).add(places.records(1, 2))
        engine = sql.create_engine(url, poolclass=sql.NullPool)
        for lock, ask in locks.items():
            with engine.connect() as other:
                other.exec_driver_sql(lock)
                began = time.monotonic()
                with pytest.raises(StoreError, match="lock timeout"):
                    ask(Store(url, patience_s=1))
                assert time.monotonic() - began < 20.0


ROOT = Path(__file__).parents[2]


def writer(place: object, first: int, last: int, *most: object) -> subprocess.Popen[str]:
    command = [sys.executable, "-m", "tests.store.writer", *map(str, (place, first, last, *most))]
    return subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, text=True)


def at_once(place: object, count: int) -> Store:
    """Let writers keep at once, each its own records and all of them the first ten."""
    running = [writer(place, 100 * n, 100 * n + 50) for n in range(1, count)] + [
        writer(place, 1, 51)
    ]
    again = writer(place, 1, 51)
    for process in (*running, again):
        said, _ = process.communicate(timeout=500)
        assert process.returncode == 0, said
    return Store(str(place))


@pytest.mark.slow
def test_four_writers_at_once_lose_nothing(tmp_path: Path) -> None:
    assert at_once(tmp_path / "store.sqlite", 4).verify() == (4 * 100, None)


@pytest.mark.slow
def test_a_full_disk_leaves_the_old_store_whole_and_says_so(tmp_path: Path) -> None:
    store = Store(tmp_path / "store.sqlite")
    store.add(places.records(1, 20))
    size = (tmp_path / "store.sqlite").stat().st_size
    full = writer(tmp_path / "store.sqlite", 100, 1500, size + 20_000)
    said, _ = full.communicate(timeout=500)
    assert full.returncode == 5, said
    assert "nothing was kept" in said
    assert store.verify() == (38, None)


@pytest.mark.slow
def test_a_writer_killed_at_any_moment_loses_nothing_that_it_said_was_kept(tmp_path: Path) -> None:
    rng, blocks, step = random.Random(5), 10, 40
    ends = Counter[int]()
    for n in range(40):
        place = tmp_path / f"{n}.sqlite"
        with writer(place, 1, 1 + blocks * step, 0, step) as process:
            assert process.stdout is not None
            # Somewhere within the block after one that was kept, or before the first one.
            said = [process.stdout.readline() for _ in range(1 + rng.randrange(blocks))]
            time.sleep(rng.expovariate(1 / 0.02))
            process.kill()
            said += process.stdout.readlines()
        count, broken = Store(place).verify()
        assert broken is None
        assert count % (2 * step) == 0
        kept = count // (2 * step)
        assert kept >= len(said) - 1
        ends[kept] += 1
        Store(place).add(places.records(1, 1 + blocks * step))
        assert Store(place).verify() == (2 * blocks * step, None)
    assert len(ends) > 3, f"every kill came at one moment: {ends}"


@pytest.mark.slow
def test_a_server_keeps_what_eight_writers_bring_at_once_and_a_role_may_only_insert_and_read():
    with places.server() as url:
        store = at_once(url, 8)
        assert store.verify() == (8 * 100, None)
        with sql.create_engine(url, poolclass=sql.NullPool).begin() as owner:
            for line in (
                "CREATE ROLE mechanic LOGIN",
                "GRANT SELECT, INSERT ON mlg_records TO mechanic",
                "GRANT SELECT ON mlg_meta TO mechanic",
                "GRANT SELECT, INSERT, DELETE ON mlg_drafts TO mechanic",
            ):
                owner.exec_driver_sql(line)
        mechanic = Store(url.replace("mlg@", "mechanic@"))
        assert mechanic.add(places.records(2000, 2003)).new == 6
        assert mechanic.verify() == (806, None)
        drafts = Drafts(mechanic)
        assert [
            drafts.save(Draft("one", "anna", "w", False, text), ("w",))
            for text in ("first", "then")
        ] == [True] * 2
        assert [draft.content for draft in drafts.newest_first("anna")] == ["then"]
        with (
            sql.create_engine(
                url.replace("mlg@", "mechanic@"), poolclass=sql.NullPool
            ).begin() as other,
            pytest.raises(sql.exc.ProgrammingError, match="permission denied"),
        ):
            other.exec_driver_sql("UPDATE mlg_records SET side = 'RH'")
        with sql.create_engine(url, poolclass=sql.NullPool).begin() as owner:
            owner.exec_driver_sql("UPDATE mlg_records SET day = '2026-01-31' WHERE seq = 7")
        _count, broken = store.verify()
        assert broken is not None
        assert broken.seq == 7


def test_a_server_that_does_not_answer_is_said() -> None:
    pytest.importorskip("psycopg")
    with pytest.raises(StoreError, match="nothing was kept"):
        Store("postgresql+psycopg://mlg@127.0.0.1:1/none").gears()
