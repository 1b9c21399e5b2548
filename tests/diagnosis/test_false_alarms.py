"""Healthy fleets of other shapes than the simulator's: nothing is named that is not there."""

from __future__ import annotations

import numpy as np
import pytest

from mlg_troubleshoot.diagnosis import diagnose
from mlg_troubleshoot.gear.gear import Gear

from .conftest import fleet

ROWS, DEFAULT_GAUGE_U_IN = 200, 0.0005
SEEDS = range(41_200, 41_210)


def alarms(gear: Gear, noise_in: float, high_in: float | None) -> int:
    """Healthy fleets of ten in which something is found, clearances exact, their uncertainty the default."""
    count = 0
    for seed in SEEDS:
        columns = {"gauge_u_in": np.full(ROWS, DEFAULT_GAUGE_U_IN)}
        if high_in is not None:
            columns["clearance_in"] = np.random.default_rng(seed).uniform(0.0, high_in, (ROWS, 10))
        table = fleet(gear.model, noise_in=noise_in, seed=seed, rows=ROWS, **columns)
        count += diagnose(gear.model, table, gear.discrepancies, permutations=199).verdict != "NONE"
    return count


def test_a_model_that_is_right_to_the_last_digit_has_no_cause(gear: Gear) -> None:
    exact = fleet(gear.model, noise_in=0.0)
    assert diagnose(gear.model, exact, gear.discrepancies, permutations=99).verdict == "NONE"


@pytest.mark.parametrize("high_in", [0.005, 0.010])
def test_clearances_drawn_evenly_and_read_exactly_are_no_cause(high_in: float, gear: Gear) -> None:
    assert alarms(gear, 0.0015, high_in) <= 1


def test_small_clearances_read_better_than_declared_are_no_cause(gear: Gear) -> None:
    assert alarms(gear, 0.0015, None) <= 1
