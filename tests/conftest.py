"""What all tests share: the shipped gear with its table, and steady settings for properties."""

from __future__ import annotations

import pytest
from hypothesis import settings

from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.gear.gear_file import load_gear
from mlg_troubleshoot.studies.index_table import IndexTable, load_index_table

settings.register_profile("everyday", deadline=None, max_examples=40, derandomize=True, database=None)
settings.load_profile("everyday")


@pytest.fixture(scope="session")
def gear() -> Gear:
    """The Hawker 800XP gear as it ships."""
    return load_gear()


@pytest.fixture(scope="session")
def table(gear: Gear) -> IndexTable:
    """Its precomputed table of indices."""
    return load_index_table(gear)
