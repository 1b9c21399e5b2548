"""Numbers of a diagnosis of a simulation against statistics, and what is concluded from them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest

from mlg_troubleshoot.diagnosis import SimulationDiagnosis, Suspect, Verdict, diagnose_simulation
from mlg_troubleshoot.misfit.beliefs import Beliefs
from mlg_troubleshoot.misfit.posterior import (
    UNLISTED,
    Context,
    Effects,
    Explanation,
    Key,
    MisfitPosterior,
)
from mlg_troubleshoot.misfit.simulation_result import Conclusion, MisfitVerdict

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


A: Key = ("a", None)
B: Key = ("b", None)
C: Key = ("c", None)
SHAPE: Key = (UNLISTED, "load")
NAMES = (A, B, C, SHAPE)
N = 8
APART = np.eye(N)[:, : len(NAMES)]
# The second effect has the direction of the first.
LOOK_ALIKE = np.column_stack([APART[:, 0], APART[:, 0], APART[:, 2], APART[:, 3]])


def concluded(
    sets: dict[tuple[Key, ...], float],
    columns: np.ndarray[tuple[int, ...], np.dtype[np.float64]] = APART,
    never: frozenset[Key] = frozenset(),
    firm: frozenset[Key] = frozenset(),
    log_prior_of_a: float = -2.0,
) -> Conclusion:
    """Conclude from the probability of each set of names."""
    together = {frozenset(names): p for names, p in sets.items()}
    names = {n: sum(p for own, p in together.items() if n in own) for n in NAMES}
    effects = Effects.free(columns, list(NAMES), -2.0, 1.0)
    effects = replace(
        effects,
        listed=np.array([True, True, True, False]),
        log_prior=np.array([log_prior_of_a, -2.0, -2.0, -2.0]),
    )
    order = sorted(sets, key=lambda own: -sets[own])
    likeliest = tuple(
        Explanation(0, tuple(NAMES.index(n) for n in own), np.log(sets[own]), np.ones(len(own)))
        for own in order
    )
    of_effect = np.array([names[n] for n in NAMES])
    found = MisfitPosterior(
        effects,
        (Context.none(N),),
        likeliest,
        {n: names[n] for n in sorted(names, key=lambda n: -names[n]) if names[n] > 0.0},
        together,
        of_effect,
        of_effect,
        together.get(frozenset(), 0.0),
        names[SHAPE],
        np.zeros(N),
        0.0,
    )
    return Conclusion(found, Beliefs(), never, firm)


@pytest.mark.parametrize(
    ("sets", "verdict"),
    [
        ({(): 0.6, (A,): 0.4}, MisfitVerdict.NONE),
        ({(A,): 0.95, (): 0.05}, MisfitVerdict.NAMED),
        ({(A,): 0.6, (B,): 0.4}, MisfitVerdict.AMBIGUOUS),
        ({(SHAPE,): 0.6, (A,): 0.4}, MisfitVerdict.UNLISTED),
        ({(SHAPE, A): 0.6, (A,): 0.4}, MisfitVerdict.UNLISTED),
        ({(): 0.49, (SHAPE,): 0.44, (A,): 0.04, (B,): 0.03}, MisfitVerdict.UNLISTED),
        ({(): 0.49, (SHAPE,): 0.24, (A,): 0.14, (B,): 0.13}, MisfitVerdict.AMBIGUOUS),
        ({(SHAPE, A): 0.4, (A,): 0.6}, MisfitVerdict.NAMED),
    ],
)
def test_the_verdict_is_what_is_likelier_than_not(sets, verdict):
    assert concluded(sets).verdict is verdict


def test_a_name_that_only_stands_for_another_is_not_said() -> None:
    assert concluded({(A,): 0.95, (): 0.05}, never=frozenset({A})).sure == ()


def test_all_that_is_sure_is_said_the_likeliest_first() -> None:
    assert concluded({(A, B): 0.91, (B,): 0.09}).sure == (B, A)


def test_look_alikes_are_said_as_a_set_whatever_is_believed_beforehand() -> None:
    found = concluded({(A,): 0.95, (B,): 0.05}, LOOK_ALIKE, log_prior_of_a=-1.0)
    assert (found.sure, found.open_beside(())) == ((), (A, B))


def test_a_look_alike_that_the_data_speak_against_leaves_a_name_alone() -> None:
    assert concluded({(A,): 0.995, (B,): 0.005}, LOOK_ALIKE).sure == (A,)


def test_effects_that_only_share_a_part_are_not_look_alikes() -> None:
    related = np.column_stack([APART[:, 0], APART[:, 0] + APART[:, 1], APART[:, 2:]])
    assert concluded({(A,): 0.95, (B,): 0.05}, related, log_prior_of_a=-1.0).sure == (A,)


def test_a_sure_name_is_said_beside_an_unlisted_effect_only_if_its_form_is_not_in_doubt() -> None:
    sets = {(SHAPE, A): 0.95, (A,): 0.05}
    firm = concluded(sets, firm=frozenset({A}))
    assert (firm.verdict, firm.said) == (MisfitVerdict.NAMED, (A,))
    in_doubt = concluded(sets)
    assert (in_doubt.verdict, in_doubt.said) == (MisfitVerdict.UNLISTED, ())


def test_a_further_cause_that_is_likelier_than_not_is_left_open_beside_a_name() -> None:
    assert concluded({(A, B): 0.7, (A,): 0.3}).open_beside((A,)) == (B,)


def test_a_further_cause_that_is_unlikely_is_not_left_open() -> None:
    assert concluded({(A, B): 0.3, (A,): 0.7}).open_beside((A,)) == ()


def test_the_open_set_is_the_fewest_names_of_which_one_acts_as_surely_as_a_name() -> None:
    assert concluded({(A,): 0.5, (B,): 0.45, (C,): 0.05}).open_beside(()) == (A, B)


def test_the_explanation_that_is_shown_has_all_that_is_said() -> None:
    sets = {(B,): 0.3, (A, B): 0.26, (A, C): 0.44}
    assert concluded(sets).reported((A, B)).members == (0, 1)
