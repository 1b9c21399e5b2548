"""A sheet declared in another unit than its gauge's does not pass; a sound one is not stopped."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from tests.records.unit_confusions import (
    Judged,
    Sheet,
    examples,
    judge,
    plausible,
    sound_sheets,
    unit_confusions,
)

FULL = pytest.mark.slow
NEW = Sheet("new", ("0.5",) * 10, "thou", "thou", "RADIAL", "RADIAL", "header")


@pytest.fixture(scope="module", params=[15, pytest.param(600, marks=FULL)])
def confused(request: pytest.FixtureRequest) -> Sequence[Judged]:
    """Gears in all six wrong units, but for sheets that could as well be sound ones."""
    judged = judge(unit_confusions(request.param, np.random.default_rng(29)))
    return [row for row in judged if not plausible(row.sheet)]


@pytest.fixture(scope="module", params=[100, pytest.param(3000, marks=FULL)])
def sound(request: pytest.FixtureRequest) -> Sequence[Judged]:
    """Gears from new to worn out in the unit of their gauge."""
    return judge(sound_sheets(request.param, np.random.default_rng(30)))


def test_no_sheet_in_a_wrong_unit_is_within_margin(confused: Sequence[Judged]) -> None:
    passed = [row for row in confused if row.within]
    assert not passed, examples("within margin", passed, 2)


def test_sheets_in_a_wrong_unit_are_not_judged_or_warned_of(confused: Sequence[Judged]) -> None:
    missed = [row for row in confused if not row.caught]
    assert len(missed) <= 0.01 * len(confused), examples("not caught", missed, 2)


def test_sheets_in_their_right_unit_are_not_stopped(sound: Sequence[Judged]) -> None:
    stopped = [row for row in sound if row.stopped]
    assert len(stopped) <= 0.003 * len(sound), examples("stopped", stopped, 10)


def test_a_sheet_of_a_new_gear_is_plausible_in_its_unit_only() -> None:
    assert plausible(NEW)
    assert not any(plausible(replace(NEW, declared_unit=unit)) for unit in ("in", "mm"))


def test_a_sheet_of_zeros_is_the_same_in_every_unit() -> None:
    zeros = replace(NEW, numbers=("0.0",) * 10)
    assert all(plausible(replace(zeros, declared_unit=unit)) for unit in ("in", "thou", "mm"))
