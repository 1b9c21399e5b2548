"""The oracle that knows a modification names what is there, and nothing where nothing is."""

from __future__ import annotations

import numpy as np
import pytest

from .modification_ceiling import aircraft, named, right, told

# 134 and 260 rows.
SEED, LARGE = 5_900_001, 5_900_000


def tails(seed: int) -> list[str]:
    return np.unique(told(seed).table.tails).tolist()


def test_of_a_large_fleet_the_oracle_names_the_modified_aircraft() -> None:
    assert right(told(LARGE), may_wander=True) == (True, True)


@pytest.mark.parametrize("case", ["sound", "walk"])
def test_where_no_aircraft_is_modified_it_names_none(case: str) -> None:
    assert not named(told(SEED, case), may_wander=True)


def test_the_noise_that_it_is_told_is_that_of_the_fleet_without_the_step() -> None:
    fleet, sound = told(SEED), told(SEED, "sound")
    assert (fleet.own, fleet.of_gear) == (sound.own, sound.of_gear)
    assert sound.own + sound.of_gear == pytest.approx(float(np.var(sound.misfit)), rel=0.1)


def test_a_step_may_begin_on_each_day_of_an_aircraft() -> None:
    fleet = told(SEED)
    days = [len(set(fleet.table.quantities["day"][fleet.table.tails == t])) for t in tails(SEED)]
    assert [len(steps) for _tail, _bare, steps, _wanders in aircraft(fleet)] == days


def test_aircraft_that_wander_are_likelier_to_wander_than_to_be_as_they_were() -> None:
    _tails, bare, _steps, wanders = zip(*aircraft(told(SEED, "walk")), strict=True)
    assert sum(wanders) > sum(bare)
