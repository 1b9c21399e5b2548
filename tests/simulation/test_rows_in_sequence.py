"""Rows that follow each other: correlated scatter, by series and in time."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache

import numpy as np
import pytest

from mlg_troubleshoot.diagnosis import SimulationDiagnosis, Suspect, Verdict, diagnose_simulation
from mlg_troubleshoot.errors import UsageError
from mlg_troubleshoot.misfit.columns import EffectColumns, NoiseModel

N = 120
T = np.linspace(0.0, 1.0, N)


def drifting(n: int, correlation: float, rng: np.random.Generator) -> np.ndarray:
    """Scatter of unit size in which each row remembers the one before it (AR(1))."""
    fresh, rows = rng.standard_normal(n), np.empty(n)
    rows[0] = fresh[0]
    for k in range(1, n):
        rows[k] = correlation * rows[k - 1] + np.sqrt(1.0 - correlation**2) * fresh[k]
    return rows


def line(p: Mapping[str, float]) -> np.ndarray:
    return (p["level"] + p["rate"] * T + p["wave"] * np.sin(20.0 * T))[:, None]


SUSPECTS = [Suspect("rate", 1.0, 0.1), Suspect("wave", 0.0, 0.1)]
LEVEL = [Suspect("level", 0.0, 0.1)]


def readings(seed: int, correlation: float, rate: float) -> np.ndarray:
    scatter = 0.1 * drifting(N, correlation, np.random.default_rng([35, seed]))
    return np.asarray(line({"level": 0.0, "rate": rate, "wave": 0.0})[:, 0] + scatter)


@cache
def diagnosed(
    seed: int, correlation: float, rate: float = 1.0, stated: bool = True
) -> SimulationDiagnosis:
    read = readings(seed, correlation, rate)
    return diagnose_simulation(line, read, SUSPECTS, LEVEL, series=np.zeros(N) if stated else None)


def covariance(noise: NoiseModel) -> np.ndarray:
    """Covariance that the docstring states, written out element by element."""
    assert noise.chain is not None
    assert noise.time is not None
    apart = np.abs(noise.time[:, None] - noise.time)
    same = noise.chain[:, None] == noise.chain
    own = np.where(same, noise.correlation**apart, 0.0) * np.outer(noise.relative, noise.relative)
    return np.asarray(own + noise.loadings @ noise.loadings.T)


@pytest.fixture
def noise() -> NoiseModel:
    rng, n = np.random.default_rng(3), 9
    return NoiseModel(
        relative=rng.uniform(0.5, 2.0, n),
        tails=np.zeros(n, np.int64),
        gears=np.zeros(n, np.int64),
        loadings=rng.standard_normal((n, 2)),
        floor_in=0.0,
        gear_ratio=0.0,
        tail_ratios=(0.0,),
        scale_in=1.0,
        chain=np.array([0, 0, 1, 1, 0, 1, 1, 0, 2]),
        time=np.array([0.0, 2.5, 1.0, 0.0, 1.0, 4.0, 2.0, 3.0, 0.0]),
        correlation=0.6,
    )


def test_the_inverse_of_a_correlated_covariance_is_its_inverse(noise: NoiseModel) -> None:
    (inverse,), (log_determinant,) = noise.each_precision_times(np.eye(9))
    assert inverse @ covariance(noise) == pytest.approx(np.eye(9), abs=1e-9)
    assert log_determinant == pytest.approx(np.linalg.slogdet(covariance(noise))[1])


def test_the_length_of_data_is_that_under_the_inverse(noise: NoiseModel) -> None:
    data = np.random.default_rng(4).standard_normal((9, 3))
    expected = np.einsum("ij,ij->j", data, np.linalg.solve(covariance(noise), data))
    assert np.diag(noise.products(data)) == pytest.approx(expected)
    assert noise.squares(EffectColumns.of(data))[0] == pytest.approx(expected)


def test_what_is_new_in_each_row_is_independent_and_of_unit_size(noise: NoiseModel) -> None:
    root = noise.own(np.eye(9))
    alone = covariance(noise) - noise.loadings @ noise.loadings.T
    assert root @ alone @ root.T == pytest.approx(np.eye(9), abs=1e-9)


@pytest.mark.slow
def test_rows_that_remember_each_other_name_nothing_where_nothing_is_wrong() -> None:
    named = [diagnosed(seed, 0.7).verdict is Verdict.NAMED for seed in range(15)]
    assert not any(named)


@pytest.mark.slow
def test_intervals_of_correlated_rows_hold_the_true_value() -> None:
    held = []
    for seed in range(20):
        held += [c.interval[0] <= 2.0 <= c.interval[1] for c in diagnosed(seed, 0.7, 2.0).causes]
    assert len(held) >= 15
    assert np.mean(held) >= 0.85


@pytest.mark.slow
def test_without_series_the_result_says_that_rows_follow_each_other() -> None:
    blind, told, white = (
        diagnosed(1, 0.7, 2.0, stated=False),
        diagnosed(1, 0.7, 2.0),
        diagnosed(1, 0),
    )
    assert (blind.in_sequence, told.in_sequence, white.in_sequence) == (True, False, False)
    assert "series=" in blind.notes[0]
    assert told.notes == white.notes == ()


def test_stretches_of_a_series_are_held_out_together() -> None:
    assert diagnosed(1, 0.7, 2.0).gain.held_out_by == "block"


@pytest.mark.slow
def test_a_smooth_discrepancy_of_a_series_stays_unlisted() -> None:
    scatter = 0.02 * np.random.default_rng(5).standard_normal(N)
    read = line({"level": 0.0, "rate": 1.0, "wave": 0.0})[:, 0] + 0.3 * np.cos(9.0 * T**2) + scatter
    found = diagnose_simulation(line, read, SUSPECTS, LEVEL, series=np.zeros(N))
    assert (found.verdict, found.named) == (Verdict.UNLISTED, ())


def test_dates_in_any_order_give_what_the_rows_in_order_give() -> None:
    order = np.random.default_rng(6).permutation(N)
    read, plain = readings(1, 0.7, 2.0), diagnosed(1, 0.7, 2.0)
    dates = np.datetime64("2026-03-01T00:00") + np.arange(N) * np.timedelta64(1, "h")
    mixed = diagnose_simulation(
        lambda p: line(p)[order], read[order], SUSPECTS, LEVEL,
        series=np.zeros(N), time=dates[order],
    )  # fmt: skip
    assert mixed.correlation == pytest.approx(plain.correlation, abs=0.05)
    assert mixed.causes[0].value == pytest.approx(plain.causes[0].value, rel=0.02)


@pytest.mark.parametrize(
    ("given", "says"),
    [
        ({"time": np.arange(N)}, "without series"),
        ({"series": np.zeros(3)}, "series has shape"),
        ({"series": np.zeros(N), "time": np.zeros(N)}, "same time"),
        ({"series": np.zeros(N), "time": np.full(N, np.nan)}, "not finite"),
    ],
)
def test_series_and_times_that_say_nothing_are_refused(given, says):
    with pytest.raises(UsageError) as caught:
        diagnose_simulation(line, T, SUSPECTS, LEVEL, **given)  # type: ignore[arg-type]
    assert says in caught.value.message
