from __future__ import annotations

from pathlib import Path

import pytest

from mlg_troubleshoot.cli.prompts import SessionStore
from mlg_troubleshoot.cli.prompts.flow import Flow
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.gear.gear_file import load_gear


@pytest.fixture(scope="session")
def gear() -> Gear:
    return load_gear()


@pytest.fixture
def flow(gear: Gear) -> Flow:
    return Flow(gear)


@pytest.fixture
def store(tmp_path: Path) -> SessionStore:
    return SessionStore(tmp_path / "store.sqlite")
