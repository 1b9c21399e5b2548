"""Healthy fleets of other shapes than the simulator's: nothing is named that is not there."""

from __future__ import annotations

from dataclasses import replace

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


@pytest.mark.parametrize("column", ["gauge_id", "technician_id", "tail_no"])
def test_readers_and_aircraft_that_all_differ_a_little_are_no_cause(column: str, gear: Gear) -> None:
    count = 0
    for seed in SEEDS:
        rng = np.random.default_rng(seed)
        factors = {
            "tail_no": np.array([f"N{k % 24:03d}" for k in range(2 * ROWS)]),
            "gauge_id": rng.choice([f"G-{k}" for k in range(6)], 2 * ROWS),
            "technician_id": rng.choice([f"T-{k}" for k in range(10)], 2 * ROWS),
            "side": rng.choice(["LH", "RH"], 2 * ROWS),
        }
        levels, place = np.unique(factors[column], return_inverse=True)
        habit = rng.normal(0.0, 0.0005, len(levels))[place]
        table = fleet(gear.model, lambda _t, _o, h=habit: h, rows=2 * ROWS, seed=seed, factors=factors)
        count += diagnose(gear.model, table, gear.discrepancies, permutations=199).verdict != "NONE"
    assert count <= 2


def test_gears_that_wear_from_different_levels_at_different_rates_are_no_cause(gear: Gear) -> None:
    count = 0
    for seed in SEEDS:
        rng = np.random.default_rng(seed)
        rows, gears = 480, np.arange(480) % 60
        day = np.sort(rng.uniform(0.0, 730.0, rows))
        kilo = rng.uniform(0.1, 3.0, 60)[gears] + day / 730.0 * rng.uniform(0.5, 2.0, 60)[gears]
        rate = rng.lognormal(np.log(0.0007), 0.5, (60, 10))
        true_in = 0.0008 + rate[gears] * kilo[:, None]
        table = fleet(
            gear.model,
            rows=rows,
            seed=seed,
            clearance_in=true_in,
            quantities={"gear_landings": 1000.0 * kilo, "day": day},
            factors={"tail_no": np.array([f"N{g // 2:03d}" for g in gears]), "side": np.array(["LH", "RH"])[gears % 2]},
            gauge_u_in=np.full(rows, DEFAULT_GAUGE_U_IN),
        )
        read_in = np.round((true_in + rng.normal(0.0, 0.0002, true_in.shape)) / 0.0005) * 0.0005
        read = replace(table, clearance_in=np.maximum(read_in, 0.0))
        count += diagnose(gear.model, read, gear.discrepancies, permutations=199).verdict != "NONE"
    assert count <= 2
