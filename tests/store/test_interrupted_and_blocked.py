"""What ends a command while it writes, and what keeps it waiting."""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from datetime import date
from pathlib import Path

import pytest
import sqlalchemy as sql

from mlg_troubleshoot.cli.prompts.visit import SavedEntries
from mlg_troubleshoot.records import rows
from mlg_troubleshoot.store import Store, StoreError
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
    given: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
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
