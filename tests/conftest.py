"""What all tests share: a start as at a prompt, the shipped gear with its table, steady settings
for properties.
"""

from __future__ import annotations

# ruff: noqa: E402 - what is imported after the first lines is to be kept compiled, or each worker
# compiles all tests and hypothesis, and each ``mlg`` that a test starts the package.
import gc
import os
import sys

os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
sys.dont_write_bytecode = False

import signal
from collections.abc import Iterator

import pytest
from hypothesis import settings

from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.gear.gear_file import load_gear
from mlg_troubleshoot.indices.index_table import IndexTable, read_index_table

settings.register_profile(
    "everyday", deadline=None, max_examples=40, derandomize=True, database=None
)
settings.load_profile("everyday")


def pytest_collection_finish() -> None:
    """What was collected stays to the end: no garbage collection looks through it again."""
    gc.freeze()


# What a user may have set that the program, or what it shows its pages with, reads.
OF_THE_USER = (
    *("MLG_STORE", "MLG_GEAR", "MLG_UNIT", "MLG_CONVENTION", "MLG_SHOW", "MLG_PAGE", "MLG_DEBUG"),
    *("SOURCE_DATE_EPOCH", "XDG_CONFIG_HOME", "XDG_DATA_HOME", "XDG_CACHE_HOME", "COLUMNS"),
    *("LINES", "TERMINAL_WIDTH", "NO_COLOR", "FORCE_COLOR", "TTY_COMPATIBLE", "TTY_INTERACTIVE"),
    *("PYTHONIOENCODING", "PYTHONUTF8", "PYTHONWARNINGS", "PYTHONOPTIMIZE"),
)


@pytest.fixture(scope="session", autouse=True)
def as_at_a_prompt(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """However pytest was started: tests, and the programs that they start, find what a new user has
    at a prompt.
    """
    ignored = [
        number
        for number in (signal.SIGINT, getattr(signal, "SIGHUP", signal.SIGINT))
        if signal.getsignal(number) is signal.SIG_IGN
    ]
    for number in ignored:
        # Unlike a signal that is ignored, a handler is not inherited; one that does nothing goes on
        # ignoring.
        signal.signal(number, lambda *_: None)
    umask = os.umask(0o022)
    with pytest.MonkeyPatch.context() as patch:
        for name in OF_THE_USER:
            patch.delenv(name, raising=False)
        patch.setenv("HOME", str(tmp_path_factory.mktemp("home")))
        yield
    os.umask(umask)
    for number in ignored:
        signal.signal(number, signal.SIG_IGN)


@pytest.fixture(scope="session")
def gear() -> Gear:
    """The Hawker 800XP gear as it ships."""
    return load_gear()


@pytest.fixture(scope="session")
def table(gear: Gear) -> IndexTable:
    """Its precomputed table of indices."""
    return read_index_table(gear)
