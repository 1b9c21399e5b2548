from __future__ import annotations

from collections.abc import Callable
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
