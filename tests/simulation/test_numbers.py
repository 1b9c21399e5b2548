"""Numbers of a diagnosis of a simulation against what statistics says of them."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pytest

from mlg_troubleshoot.diagnosis import SimulationDiagnosis, Suspect, Verdict, diagnose_simulation

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
