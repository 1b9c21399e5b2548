"""Healthy fleets of other shapes than the simulator's: nothing is named that is not there."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from mlg_troubleshoot.diagnosis import diagnose
from mlg_troubleshoot.diagnosis.table import DiagnosisTable
from mlg_troubleshoot.gear.gear import Gear

from .conftest import fleet

ROWS, DEFAULT_GAUGE_U_IN = 200, 0.0005
# A fleet every day; more of them, with the alarms that chance allows, in the slow part.
FEW, MANY = (range(41_200, 41_201), 0), (range(41_200, 41_220), 3)
every_day_and_slow = pytest.mark.parametrize(
    ("seeds", "allowed"),
    [pytest.param(*FEW, id="few"), pytest.param(*MANY, id="many", marks=pytest.mark.slow)],
)


def alarms(gear: Gear, draw: Callable[[int], DiagnosisTable], seeds: range) -> int:
    """Healthy fleets in which something is found."""
    tables = map(draw, seeds)
    return sum(diagnose(gear.model, t, gear.discrepancies).verdict != "NONE" for t in tables)


def read_exactly(gear: Gear, seed: int, high_in: float | None) -> DiagnosisTable:
    """Exact clearances, drawn evenly up to the highest or by wear; their uncertainty is the
    default.
    """
    columns = {"gauge_u_in": np.full(ROWS, DEFAULT_GAUGE_U_IN)}
    if high_in is not None:
        columns["clearance_in"] = np.random.default_rng(seed).uniform(0.0, high_in, (ROWS, 10))
    return fleet(gear.model, seed=seed, rows=ROWS, **columns)


def test_a_model_that_is_right_to_the_last_digit_has_no_cause(gear: Gear) -> None:
    exact = fleet(gear.model, noise_in=0.0)
    assert diagnose(gear.model, exact, gear.discrepancies).verdict == "NONE"


@every_day_and_slow
@pytest.mark.parametrize("high_in", [0.005, pytest.param(0.010, marks=pytest.mark.slow)])
def test_clearances_drawn_evenly_and_read_exactly_are_not_a_cause(high_in, seeds, allowed, gear):
    assert alarms(gear, lambda seed: read_exactly(gear, seed, high_in), seeds) <= allowed


@every_day_and_slow
def test_small_clearances_read_better_than_declared_are_not_a_cause(seeds, allowed, gear):
    assert alarms(gear, lambda seed: read_exactly(gear, seed, None), seeds) <= allowed


def habits(gear: Gear, seed: int, column: str) -> DiagnosisTable:
    """Every level of a column reads off a little."""
    rng = np.random.default_rng(seed)
    factors = {
        "tail_no": np.array([f"N{k % 24:03d}" for k in range(2 * ROWS)]),
        "gauge_id": rng.choice([f"G-{k}" for k in range(6)], 2 * ROWS),
        "technician_id": rng.choice([f"T-{k}" for k in range(10)], 2 * ROWS),
        "side": rng.choice(["LH", "RH"], 2 * ROWS),
    }
    levels, place = np.unique(factors[column], return_inverse=True)
    habit = rng.normal(0.0, 0.0005, len(levels))[place]
    return fleet(gear.model, lambda _t, _o: habit, rows=2 * ROWS, seed=seed, factors=factors)


@pytest.mark.slow
@every_day_and_slow
@pytest.mark.parametrize("column", ["gauge_id", "technician_id", "tail_no"])
def test_readers_and_aircraft_that_all_differ_a_little_are_not_a_cause(
    column, seeds, allowed, gear
):
    assert alarms(gear, lambda seed: habits(gear, seed, column), seeds) <= allowed


def worn_apart(gear: Gear, seed: int) -> DiagnosisTable:
    """Every gear has a level and a rate of wear of its own, and readings are rounded to half a
    thousandth.
    """
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
        factors={
            "tail_no": np.array([f"N{g // 2:03d}" for g in gears]),
            "side": np.array(["LH", "RH"])[gears % 2],
        },
        gauge_u_in=np.full(rows, DEFAULT_GAUGE_U_IN),
    )
    read_in = np.round((true_in + rng.normal(0.0, 0.0002, true_in.shape)) / 0.0005) * 0.0005
    return replace(table, clearance_in=np.maximum(read_in, 0.0))


@pytest.mark.slow
@every_day_and_slow
def test_gears_that_wear_from_different_levels_at_different_rates_are_not_a_cause(
    seeds, allowed, gear
):
    assert alarms(gear, lambda seed: worn_apart(gear, seed), seeds) <= allowed
