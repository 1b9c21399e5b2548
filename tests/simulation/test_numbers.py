"""Numbers of a diagnosis of a simulation against what statistics says of them."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pytest

from mlg_troubleshoot.diagnosis import SimulationDiagnosis, Suspect, Verdict, diagnose_simulation
from mlg_troubleshoot.misfit import scatter
from mlg_troubleshoot.misfit.runner import Runner
from mlg_troubleshoot.misfit.search import RULED_OUT

X = np.linspace(-1.0, 1.0, 60)
SCATTER = 0.02


def straight(p: Mapping[str, float]) -> np.ndarray:
    return (p["level"] + p["rate"] * X + p["bend"] * X**2)[:, None]


def diagnosed(rate: float, seed: int, trial: float = 0.1) -> SimulationDiagnosis:
    """Diagnose 60 readings of a line of this rate, which should be 1."""
    read = straight({"level": 0.3, "rate": rate, "bend": 0.0})
    read = read + SCATTER * np.random.default_rng(seed).standard_normal(read.shape)
    suspects = [Suspect("rate", 1.0, trial), Suspect("bend", 0.0, trial)]
    return diagnose_simulation(
        straight, read, suspects, [Suspect("level", 0.0, 0.1)], permutations=199
    )


def test_intervals_hold_the_true_value_nineteen_times_in_twenty() -> None:
    held = []
    for seed in range(40):
        (cause,) = diagnosed(1.2, seed).causes
        held.append(cause.interval[0] <= 1.2 <= cause.interval[1])
    assert np.mean(held) >= 0.85


def test_the_change_by_which_an_effect_is_computed_decides_nothing() -> None:
    coarse, fine = (diagnosed(1.2, 3, trial).causes[0] for trial in (0.1, 0.002))
    assert (fine.value, *fine.interval) == pytest.approx((coarse.value, *coarse.interval), rel=1e-3)


def test_nor_does_it_decide_the_value_of_a_rival() -> None:
    def powers(p: Mapping[str, float]) -> np.ndarray:
        return np.asarray(p["square"] * (X + 1.0) ** 2 + p["power"] * (X + 1.0) ** 2.2)[:, None]

    read, said = 0.5 * (X + 1.0) ** 2.2 + np.random.default_rng(12).standard_normal(60), []
    for trial in (0.1, 0.01):
        suspects = [Suspect("square", 0.0, trial), Suspect("power", 0.0, trial)]
        found = diagnose_simulation(powers, read, suspects, permutations=199)
        said.append({cause.name: cause.value for cause in found.also_possible})
    assert said[0].keys() == {"square", "power"}
    assert said[1] == pytest.approx(said[0], rel=1e-6)


def test_the_smallest_effect_is_found_four_times_in_five() -> None:
    smallest = np.mean([diagnosed(1.0, seed).smallest_detectable_rms for seed in range(5)])
    said = [
        diagnosed(1.0 + smallest / np.sqrt(np.mean(X**2)), seed).verdict for seed in range(100, 150)
    ]
    assert 0.68 < np.mean([verdict is not Verdict.NONE for verdict in said]) < 0.92


def test_a_rival_falls_behind_by_odds_of_a_hundred() -> None:
    assert np.exp(RULED_OUT) > 100.0


def test_sensitivities_are_those_in_the_middle_of_a_change() -> None:
    runner = Runner(
        lambda p: np.array([[p["size"] ** 2]] * 3), np.ones((3, 1)), [Suspect("size", 1.0, 0.5)]
    )
    found = runner.sensitivities(runner.nominal, np.ones(3), [0])
    assert found == pytest.approx(np.full((3, 1), 2.0 * 0.5))


def test_the_robust_scatter_is_the_standard_deviation_of_normal_readings() -> None:
    data = 0.7 * np.random.default_rng(1).standard_normal(20_000)
    found = scatter.robust_scale(np.empty((20_000, 0)), data, None, [np.arange(20_000)])
    assert np.median(found) == pytest.approx(0.7, rel=0.015)


def test_whitened_readings_are_equal_and_independent() -> None:
    rng = np.random.default_rng(1)
    scale, factor = np.full(30, 0.4), rng.standard_normal((15, 3))
    row, outputs = np.repeat(np.arange(15), 2), [np.arange(0, 30, 2), np.arange(1, 30, 2)]
    own = np.zeros((30, 6))
    for k, index in enumerate(outputs):
        own[index, 3 * k : 3 * k + 3] = factor[row[index]]
    covariance = 0.4**2 * (np.eye(30) + own @ own.T)
    white = scatter.build_whitener(scale, outputs, row, factor)
    assert white(white(covariance).T) == pytest.approx(np.eye(30), abs=1e-9)
    assert white.log_determinant == pytest.approx(np.linalg.slogdet(covariance)[1])


def test_scatter_between_groups_may_be_as_large_as_any_that_is_likely() -> None:
    row, group = np.arange(40), np.arange(40) % 4
    data = np.random.default_rng(1).standard_normal(40)
    ratios = scatter.group_ratios(np.ones(40), [row], row, group, np.ones((40, 1)), data)
    drawn = np.hypot(ratios.mean, ratios.beyond(20_000, np.random.default_rng(2)))
    assert ratios.chance.sum() == pytest.approx(1.0)
    assert drawn.max() > 3.0 * ratios.mean
