"""What a written clearance says of what the gauge showed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.stats import truncnorm

from mlg_troubleshoot.diagnosis import DiagnosisTable
from mlg_troubleshoot.diagnosis.wear import wear_history
from mlg_troubleshoot.diagnosis.written import Written, cut_off, piles, steps_of, written
from mlg_troubleshoot.gear.gear import Gear

from .conftest import fleet

Array = NDArray[np.float64]


def one(low: float, high: float, lower: float = 0.0) -> Written:
    return Written(*(np.array([[value]]) for value in (low, high, lower)))


@pytest.fixture(scope="module")
def table(gear: Gear) -> DiagnosisTable:
    return fleet(gear.model, rows=200)


def with_step(values: Array, step: float) -> Array:
    return np.round(np.rint(values / step) * step, 7)


@pytest.mark.parametrize("low, high", [(0.0, 0.5), (1.0, 3.0), (-4.0, np.inf), (6.0, 7.0)])
def test_moments_are_those_of_a_truncated_normal_distribution(low: float, high: float) -> None:
    mean, variance = one(low, high).moments(np.array([[0.4]]), np.array([[0.25]]))
    law = truncnorm((low - 0.4) / 0.5, (high - 0.4) / 0.5, 0.4, 0.5)
    assert (mean[0, 0], variance[0, 0]) == pytest.approx((law.mean(), law.var()), rel=1e-6)


def test_an_interval_that_is_not_expected_at_all_gives_its_nearer_end() -> None:
    mean, variance = one(50.0, 51.0).moments(np.array([[0.0]]), np.array([[1.0]]))
    assert (mean[0, 0], variance[0, 0]) == pytest.approx((50.0, 0.0), abs=0.05)


def test_a_value_that_smaller_ones_are_written_as_is_a_mixture() -> None:
    rng = np.random.default_rng(3)
    draws = rng.normal(1.0, 0.5, 400_000)
    draws = draws[draws > 0.0]
    here = (draws > 1.2) & (draws < 1.4)
    said = draws[here | ((draws < 1.2) & (rng.random(len(draws)) < 0.3))]
    mean, variance = one(1.2, 1.4, 0.3).moments(np.array([[1.0]]), np.array([[0.25]]))
    assert (mean[0, 0], variance[0, 0]) == pytest.approx((said.mean(), said.var()), rel=0.02)


def with_a_coarse_technician(table: DiagnosisTable) -> tuple[DiagnosisTable, np.ndarray]:
    """Clearances to 0.0001 in, those of the first technician to 0.001 in; his rows."""
    people = table.factors["technician_id"]
    his = people == people[0]
    values = with_step(table.clearance_in, 0.0001)
    values[his] = with_step(values[his], 0.001)
    return replace(table, clearance_in=values), his


def test_each_technician_has_a_step_of_his_own(table: DiagnosisTable) -> None:
    written, coarse = with_a_coarse_technician(table)
    steps = steps_of(written)
    assert set(steps[coarse]) == {0.001}
    assert set(steps[~coarse]) == {0.0001}


def test_only_who_writes_coarse_steps_may_have_cut_digits_off(table: DiagnosisTable) -> None:
    written, coarse = with_a_coarse_technician(table)
    lacks = cut_off(written)
    assert lacks.shape == (len(table), 1)
    assert lacks[:, 0] == pytest.approx(np.where(coarse, 0.0005 * np.sqrt(0.5), 0.0))
    fine = replace(table, clearance_in=with_step(table.clearance_in, 0.0005))
    assert cut_off(fine).shape == (len(table), 0)


def test_zero_is_anything_up_to_half_a_step(table: DiagnosisTable) -> None:
    values = with_step(table.clearance_in, 0.001)
    values[0, 0] = 0.0
    says = written(replace(table, clearance_in=values))
    assert (says.low[0, 0], says.high[0, 0]) == (0.0, pytest.approx(0.0005))


def test_a_reading_below_an_end_is_anything_up_to_it(table: DiagnosisTable) -> None:
    values = with_step(table.clearance_in, 0.0005)
    values[0, 0] = 0.001
    below = np.zeros(values.shape, bool)
    below[0, 0] = True
    says = written(replace(table, clearance_in=values, below=below))
    assert (says.low[0, 0], says.high[0, 0]) == (0.0, 0.002)


def gauged(table: DiagnosisTable, share: float) -> DiagnosisTable:
    """Some of what is below 0.002 in is written so: a limit gauge went in."""
    rng = np.random.default_rng(5)
    values = with_step(rng.gamma(4.0, 0.0006, table.clearance_in.shape), 0.0005)
    return replace(
        table,
        clearance_in=np.where((values < 0.002) & (rng.random(values.shape) < share), 0.002, values),
    )


def test_the_size_of_a_limit_gauge_is_recognised_with_how_often_it_is_written(
    table: DiagnosisTable,
) -> None:
    (pile,) = piles(gauged(table, 0.3))
    assert (pile.value, pile.end) == (pytest.approx(0.002), 0)
    assert pile.lower == pytest.approx(0.3, abs=0.1)


def test_no_limit_gauge_is_seen_where_none_was_used(table: DiagnosisTable) -> None:
    assert piles(gauged(table, 0.0)) == []


def test_no_limit_gauge_is_seen_in_the_multiples_of_a_coarser_step(table: DiagnosisTable) -> None:
    values = with_step(
        np.random.default_rng(0).gamma(2.0, 0.0006, table.clearance_in.shape), 0.0005
    )
    one = table.factors["technician_id"] == "T-1"
    cut = np.where(one[:, None], np.floor(values * 1000.0) / 1000.0, values)
    assert piles(replace(table, clearance_in=cut)) == []


def test_wear_behind_readings_to_a_coarse_step_follows_the_landings_within_it() -> None:
    rng = np.random.default_rng(8)
    gears = np.repeat(np.arange(40), 8)
    kilo = rng.uniform(0.0, 2.4, len(gears))
    level = rng.uniform(0.0003, 0.0012, 40)[gears] + rng.uniform(0.0004, 0.0012, 40)[gears] * kilo
    shown = np.maximum(level + rng.normal(0.0, 0.0002, len(gears)), 0.0)
    values = with_step(shown, 0.002)[:, None]
    says = Written(np.maximum(values - 0.001, 0.0), values + 0.001, np.zeros(values.shape))
    declared = np.full(values.shape, 0.0002**2)
    points = wear_history(values, gears, kilo, declared + 0.002**2 / 12.0)
    whole = wear_history(values, gears, kilo, declared, says)
    off = [np.sqrt(np.mean((h.expected_in[:, 0] - level) ** 2)) for h in (points, whole)]
    assert off[1] < 0.9 * off[0]


def test_a_sheet_that_says_below_an_end_has_no_limit_gauge_at_it(table: DiagnosisTable) -> None:
    said = gauged(table, 0.0)
    below = said.clearance_in < 0.002
    values = np.where(below, 0.001, said.clearance_in)
    assert piles(replace(said, clearance_in=values, below=below)) == []
