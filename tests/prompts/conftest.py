from __future__ import annotations

from pathlib import Path

import pytest

from mlg_troubleshoot.life.folding import GearLife, life_of
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
