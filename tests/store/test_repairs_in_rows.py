"""A repair that a row states: what it does to the rows below it, and what is kept of it."""

from __future__ import annotations

from pathlib import Path

import pytest

from mlg_troubleshoot.life.folding import lives
from mlg_troubleshoot.store import Store
from tests.cli.conftest import mlg, row

from .places import table

FAILED = {"outcome": "FAILED", "plunger_displacement_in": "0.035"}
RESTORED = {"restored_joints": "3", "repair_date": "2026-03-02"}


def visit(name: str, day: str, worn_in: str, **more: str) -> dict[str, str]:
    return row(record_id=name, inspection_date=day, clearance_3_in=worn_in, **more)


@pytest.fixture
def history(tmp_path: Path) -> Path:
    """A failure, its repair, and a row below them that still says what was before."""
    return table(
        tmp_path,
        visit("before", "2026-03-01", "0.0148", **FAILED),
        visit("repair", "2026-03-02", "0.0005", **RESTORED),
        visit("below", "2026-03-02", "0.0005", **FAILED),
        visit("later", "2026-03-09", "0.0005", **FAILED),
    )


def test_a_repair_that_a_row_states_is_kept_once_with_the_row(history, tmp_path):
    place = str(tmp_path / "store.sqlite")
    for _ in range(2):
        mlg("check", history, "--keep", "--store", place)
    (life,) = lives(Store(place)).values()
    assert [(each.day, each.joints) for each in life.repairs] == [("2026-03-02", {3})]


def test_a_rigging_that_a_row_says_was_corrected_is_a_re_rigging(tmp_path: Path) -> None:
    place = str(tmp_path / "store.sqlite")
    rerigged = {"rigging_checked": "corrected", "repair_date": "2026-03-02"}
    file = table(tmp_path, visit("rigged", "2026-03-02", "0.0010", **rerigged))
    mlg("check", file, "--keep", "--store", place)
    (life,) = lives(Store(place)).values()
    assert [(each.day, each.joints) for each in life.repairs] == [("2026-03-02", set())]
