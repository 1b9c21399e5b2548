from __future__ import annotations

import sqlite3
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import pytest

from mlg_troubleshoot.decision.inspection import Inspection
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.life.folding import GearLife, life_of
from mlg_troubleshoot.life.state import state_now
from mlg_troubleshoot.store import Store
from tests.prompts.scripted import Sit, sitting


@pytest.fixture
def store(tmp_path: Path) -> Path:
    return tmp_path / "store.sqlite"


@pytest.fixture
def sit(store: Path, monkeypatch: pytest.MonkeyPatch) -> Sit:
    return sitting(store, monkeypatch)


_BEGUN: dict[tuple[str, ...], bytes] = {}


@pytest.fixture
def begun(sit: Sit, store: Path) -> Callable[..., None]:
    """Type a first visit, once for all tests of a worker."""

    def of(*typed: str) -> None:
        if typed in _BEGUN:
            store.write_bytes(_BEGUN[typed])
            return
        sit(*typed, "")
        with closing(sqlite3.connect(store)) as kept:
            _BEGUN[typed] = kept.serialize()

    return of


@pytest.fixture
def life(store: Path):
    def of(side: str = "LH", tail: str = "N1") -> GearLife:
        return life_of(Store(store), tail, side)

    return of


@pytest.fixture
def now(life: Callable[..., GearLife], gear: Gear):
    """What stands of a gear after all of its visits."""

    def of(side: str = "LH", tail: str = "N1") -> Inspection:
        found = state_now(life(side, tail).visits, gear)
        assert found is not None
        return found.inspection

    return of
