"""Numbers of a diagnosis of a simulation against what statistics says of them."""

from __future__ import annotations

from collections.abc import Mapping
from types import SimpleNamespace

import numpy as np
import pytest

from mlg_troubleshoot.diagnosis import SimulationDiagnosis, Suspect, Verdict, diagnose_simulation
from mlg_troubleshoot.misfit.beliefs import Beliefs
from mlg_troubleshoot.misfit.covariance import FAR, NoiseModel
from mlg_troubleshoot.misfit.explanation import Context, Effects, Key
from mlg_troubleshoot.misfit.linearised import Study
from mlg_troubleshoot.misfit.posterior import posterior
from mlg_troubleshoot.misfit.runner import Runner
from mlg_troubleshoot.misfit.scatter import Readings

X = np.linspace(-1.0, 1.0, 60)
SCATTER = 0.02


def straight(p: Mapping[str, float]) -> np.ndarray:
    return (p["level"] + p["rate"] * X + p["bend"] * X**2)[:, None]


def diagnosed(rate: float, seed: int, trial: float = 0.1) -> SimulationDiagnosis:
    """Diagnose 60 readings of a line of this rate, which should be 1."""
    read = straight({"level": 0.3, "rate": rate, "bend": 0.0})
    read = read + SCATTER * np.random.default_rng(seed).standard_normal(read.shape)
    suspects = [Suspect("rate", 1.0, trial), Suspect("bend", 0.0, trial)]
    return diagnose_simulation(straight, read, suspects, [Suspect("level", 0.0, 0.1)])


@pytest.mark.slow
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
        found = diagnose_simulation(powers, read, suspects)
        said.append({cause.name: cause.value for cause in found.also_possible})
    assert said[0].keys() == {"square", "power"}
    assert said[1] == pytest.approx(said[0], rel=1e-6)


@pytest.mark.slow
def test_the_smallest_effect_is_found_four_times_in_five() -> None:
    smallest = np.mean([diagnosed(1.0, seed).smallest_detectable_rms for seed in range(5)])
    said = [
        diagnosed(1.0 + smallest / np.sqrt(np.mean(X**2)), seed).verdict for seed in range(100, 150)
    ]
    assert 0.68 < np.mean([verdict is not Verdict.NONE for verdict in said]) < 0.92


def test_sensitivities_are_those_in_the_middle_of_a_change() -> None:
    runner = Runner(
        lambda p: np.array([[p["size"] ** 2]] * 3), np.ones((3, 1)), [Suspect("size", 1.0, 0.5)]
    )
    found = runner.sensitivities(runner.nominal, np.ones(3), [0])
    assert found == pytest.approx(np.full((3, 1), 2.0 * 0.5))


def test_the_robust_scatter_is_the_standard_deviation_of_normal_readings() -> None:
    data = 0.7 * np.random.default_rng(1).standard_normal(20_000)
    everything = np.arange(20_000)
    found = Readings(everything, [everything], None, None).scale_of(data, 1.0)
    assert np.median(found) == pytest.approx(0.7, rel=0.015)


def test_nuisance_parameters_take_readings_away_and_say_nothing_else() -> None:
    rng, n = np.random.default_rng(2), 30
    free, columns, data = rng.standard_normal((n, 2)), rng.standard_normal((n, 3)), 1.0 + X[:n]
    names: list[Key | None] = [(name, None) for name in "abc"]
    listed = Effects.free(columns, names, -1.0, 0.8)
    everything = np.arange(n)
    noise, _unit = Readings(everything, [everything], None, None).noise(np.ones(n), free)
    # The same in the 28 directions in which no nuisance parameter moves a reading.
    rest = np.linalg.svd(free)[0][:, 2:].T
    fewer = Effects.free(rest @ columns, names, -1.0, 0.8)
    for shift in (0.0, 50.0):
        whole = posterior(
            noise, data + free @ [shift, -shift], listed, [Context.none(n)], Beliefs()
        )
        left = posterior(
            NoiseModel.white(n - 2), rest @ data, fewer, [Context.none(n - 2)], Beliefs()
        )
        assert whole.names == pytest.approx(left.names, abs=1e-4)


def test_scatter_between_groups_is_small_beforehand_and_may_be_large() -> None:
    row = np.arange(40)
    noise, _unit = Readings(row, [row], row % 4, None).noise(np.ones(40), np.empty((40, 0)))
    chance = dict(zip(noise.tail_ratios, noise.tail_chances, strict=True))
    assert sum(chance.values()) == pytest.approx(1.0)
    assert sum(p for ratio, p in chance.items() if ratio < 0.5) > 0.9
    assert 0.0 < sum(p for ratio, p in chance.items() if ratio > 3.0) < 0.01


@pytest.mark.slow
def test_the_residual_of_noise_has_a_p_value_that_is_seldom_small() -> None:
    small = [diagnosed(1.0, seed).remainder_p < 0.05 for seed in range(60)]
    assert np.mean(small) <= 0.12


def test_a_change_larger_than_is_stated_to_be_plausible_is_less_probable() -> None:
    read = straight({"level": 0.3, "rate": 1.03, "bend": 0.0})
    read = read + SCATTER * np.random.default_rng(5).standard_normal(read.shape)

    def chance(prior_sd: float) -> float:
        suspects = [Suspect("rate", 1.0, 0.1, prior_sd=prior_sd), Suspect("bend", 0.0, 0.1)]
        found = diagnose_simulation(straight, read, suspects, [Suspect("level", 0.0, 0.1)])
        return sum(c.probability for c in (*found.causes, *found.also_possible) if c.name == "rate")

    assert chance(0.03) > 0.99
    assert chance(0.001) < 0.5


def test_probabilities_of_nothing_and_of_what_is_unlisted_say_which_verdict_it_is() -> None:
    sound, wrong = diagnosed(1.0, 1), diagnosed(1.2, 1)
    assert sound.verdict is Verdict.NONE
    assert sound.p_nothing > 0.5 > wrong.p_nothing
    bent = straight({"level": 0.3, "rate": 1.0, "bend": 0.0}) + 0.2 * np.sin(9.0 * X)[:, None]
    noisy = bent + SCATTER * np.random.default_rng(3).standard_normal(bent.shape)
    suspects = [Suspect("rate", 1.0, 0.1), Suspect("bend", 0.0, 0.1)]
    found = diagnose_simulation(straight, noisy, suspects, [Suspect("level", 0.0, 0.1)])
    assert (found.verdict, found.named) == (Verdict.UNLISTED, ())
    assert found.p_unlisted > 0.99 > 10.0 * wrong.p_unlisted


@pytest.mark.slow
def test_of_suspects_named_at_nine_in_ten_nine_in_ten_are_wrong() -> None:
    right = []
    for seed in range(40):
        rng = np.random.default_rng([77, seed])
        noise, x = 0.02 * rng.standard_normal(60), rng.uniform(-1.0, 1.0, (4, 60))
        true = np.where(rng.random(4) < 0.17, 0.01 * rng.standard_normal(4), 0.0)

        def predict(p: Mapping[str, float], x: np.ndarray = x) -> np.ndarray:
            return np.array([p[name] for name in "abcd"]) @ x

        suspects = [Suspect(name, 0.0, 0.01, prior_sd=0.01) for name in "abcd"]
        found = diagnose_simulation(
            predict, predict(dict(zip("abcd", true, strict=True))) + noise, suspects
        )
        right += [true["abcd".index(cause.name)] != 0.0 for cause in found.causes]
    assert len(right) >= 5
    assert np.mean(right) >= 0.8


def test_a_reading_is_far_by_what_is_usual_of_its_output() -> None:
    outputs = (np.arange(10), np.arange(10, 20))
    relative = np.repeat([1.0, 4.0], 10)
    rest = np.zeros(20)
    rest[[0, 10]] = 1.2 * FAR
    far = Study._far(SimpleNamespace(outputs=outputs), rest, relative)
    assert np.flatnonzero(far).tolist() == [0]


@pytest.mark.parametrize(("grows", "ratio"), [(True, (5.0, 30.0)), (False, (0.99, 1.01))])
def test_scatter_grows_with_the_prediction_where_the_residuals_say_so(
    grows: bool, ratio: tuple[float, float]
) -> None:
    steps, row = np.linspace(0.1, 10.0, 120), np.arange(120)
    noise = np.random.default_rng(9).uniform(-1.0, 1.0, 120) * (steps if grows else 1.0)
    scale = Readings(row, [row], None, None, predicted=steps).scale_of(noise, 1.0)
    assert ratio[0] < scale[-1] / scale[0] < ratio[1]


def test_a_bend_is_not_taken_for_scatter_that_grows() -> None:
    steps, row = np.linspace(0.1, 10.0, 120), np.arange(120)
    noise = 0.1 * np.random.default_rng(9).uniform(-1.0, 1.0, 120) + 0.05 * steps**2
    scale = Readings(row, [row], None, None, predicted=steps).scale_of(noise, 1.0)
    assert np.median(scale[-9:]) < 2.0 * np.median(scale[:9])
