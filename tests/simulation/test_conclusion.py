"""What is said of a posterior, on posteriors that are written by hand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

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
