"""Many writers, a writer that is killed, a disk that is full, a server."""

from __future__ import annotations

import random
import subprocess
import sys
import time
from collections import Counter
from pathlib import Path

import pytest
import sqlalchemy as sql

from mlg_troubleshoot.store import Draft, Drafts, Store, StoreError

from . import places

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
