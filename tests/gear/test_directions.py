"""Directions of the virtual links: worst directions joint by joint, and uniformly random ones."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.optimize import differential_evolution
from scipy.stats import qmc

from mlg_troubleshoot.gear import DEFAULT_GEAR
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.gear.gear_file import load_gear, shipped_gears
from mlg_troubleshoot.gear.linkage import (
    LinkageModel,
    chance_beyond,
    links_from,
    random_directions,
    worst_case,
)

FAILURE = np.array([[0, 0, 0.013, 0, 0.007, 0, 0, 0, 0, 0]])
MARGIN_IN = 0.03
clearances = arrays(float, 10, elements=st.floats(0, 0.0075))


def best_by_differential_evolution(
    model: LinkageModel, clearance: np.ndarray, sense: float
) -> float:
    """The largest displacement over all directions and the whole stroke, by scipy."""

    def lost(points: np.ndarray) -> np.ndarray:
        directions = points[:-1].T
        links = links_from(np.broadcast_to(clearance, directions.shape), directions)
        tight = model.kernel.output(points[-1], model.kernel.no_clearance())
        moved = sense * model.rate * (model.kernel.output(points[-1], links) - tight)
        return np.where(np.isfinite(moved), -moved, 1e3)

    found = differential_evolution(
        lost,
        [[-np.pi, np.pi]] * len(clearance) + [sorted(model.stroke)],
        popsize=12,
        maxiter=300,
        tol=1e-10,
        atol=1e-12,
        polish=False,
        vectorized=True,
        updating="deferred",
        rng=np.random.default_rng(0),
    )
    return -float(found.fun)


@pytest.mark.parametrize("sense", [1.0, -1.0])
@pytest.mark.parametrize(
    ("name", "members", "short_by"),
    [
        *((name, slice(1), 4e-4) for name in shipped_gears()),
        pytest.param(DEFAULT_GEAR, slice(1, None), 3e-3, marks=pytest.mark.slow),
    ],
)
def test_a_global_search_of_directions_and_stroke_finds_hardly_more_than_the_rule(
    name, members, short_by, sense
):
    known = load_gear(name)
    for model in known.ensemble_models[members]:
        worst = worst_case(model, known.limits_in)
        found = (sense * (worst.over_in if sense > 0 else worst.under_in))[0]
        best = best_by_differential_evolution(model, known.limits_in, sense)
        assert 0.0 <= best - found <= short_by * best


@given(clearance=clearances, direction=arrays(float, 10, elements=st.floats(-np.pi, np.pi)))
def test_no_other_directions_go_beyond_the_worst_ones_by_more_than_that(gear, clearance, direction):
    worst = worst_case(gear.model, clearance)
    # The mechanism closes to rounding only, and clearances of a rounding error are drawn as well.
    assert worst.under_in[0] <= 1e-12
    assert worst.over_in[0] >= -1e-12
    moved = float(gear.model.displacement(links_from(clearance, direction)))
    assert worst.under_in[0] * 1.0004 - 1e-9 <= moved <= worst.over_in[0] * 1.0004 + 1e-9


def test_the_reported_directions_give_the_reported_displacements(gear: Gear) -> None:
    clearance = np.random.default_rng(11).uniform(0, 0.0075, (20, 10))
    worst = worst_case(gear.model, clearance)
    over = gear.model.displacement(links_from(clearance, worst.over_directions))
    under = gear.model.displacement(links_from(clearance, worst.under_directions))
    assert over == pytest.approx(worst.over_in, abs=1e-14)
    assert under == pytest.approx(worst.under_in, abs=1e-14)


def test_the_larger_sense_governs(gear: Gear) -> None:
    worst = worst_case(gear.model, FAILURE)
    assert worst.magnitude_in[0] == worst.over_in[0] > -worst.under_in[0]
    assert np.array_equal(worst.governing_directions, worst.over_directions)
    # Both senses of a linkage whose output is read the other way round.
    turned = type(worst)(
        -worst.under_in, -worst.over_in, worst.under_directions, worst.over_directions
    )
    assert turned.magnitude_in[0] == worst.over_in[0]
    assert np.array_equal(turned.governing_directions, worst.over_directions)


def test_directions_are_chosen_from_the_most_remote_joint_to_the_nearest(gear: Gear) -> None:
    """Each joint's direction is the best one while all joints nearer to the input have no clearance
    yet.
    """
    clearance = np.full(10, 0.0075)
    chosen = worst_case(gear.model, clearance).over_directions[0]
    turns = np.linspace(0, 2 * np.pi, 721)
    for j in range(10):
        partly = np.where(np.arange(10) >= j, clearance, 0.0)
        tried = np.tile(chosen, (len(turns), 1))
        tried[:, j] = turns
        best = gear.model.displacement(links_from(partly, tried)).max()
        assert float(gear.model.displacement(links_from(partly, chosen))) >= best - 1e-9


def test_each_gear_of_a_batch_gets_the_directions_of_its_own_clearances(gear: Gear) -> None:
    clearance = np.random.default_rng(12).uniform(0, 0.0075, (600, 10))
    batch = worst_case(gear.model, clearance)
    for i in (0, 511, 512, 599):
        alone = worst_case(gear.model, clearance[i])
        assert (alone.over_in[0], alone.under_in[0]) == pytest.approx(
            (batch.over_in[i], batch.under_in[i]), abs=1e-14
        )


def test_a_joint_without_clearance_still_has_the_direction_in_which_it_would_act(gear):
    worst = worst_case(gear.model, np.zeros(10))
    tiny = gear.model.displacement(links_from(np.eye(10) * 1e-5, worst.over_directions))
    assert tiny / 1e-5 == pytest.approx(gear.model.plunger_amplification(), rel=1e-3)


def test_without_clearance_nothing_moves_and_what_does_not_close_is_beyond_every_margin(gear):
    still = worst_case(gear.model, np.zeros(10))
    assert (still.over_in[0], still.under_in[0]) == pytest.approx((0.0, 0.0), abs=1e-15)
    worst = worst_case(gear.model, np.array([[0.005] * 10, [0.05] * 10]))
    assert np.isnan(worst.magnitude_in).tolist() == [False, True]
    clearance = np.zeros((2, 10))
    clearance[1, 0] = 100.0
    chance = chance_beyond(gear.model, clearance, np.array([MARGIN_IN, 1e9]), 64)
    assert chance.tolist() == [0.0, 1.0]


def test_the_failure_case_exceeds_its_margin_in_a_quarter_of_random_directions(gear: Gear) -> None:
    assert chance_beyond(gear.model, FAILURE, np.array([MARGIN_IN]), 4096)[0] == pytest.approx(
        0.25, abs=0.01
    )


def test_with_two_worn_joints_the_chance_is_what_their_two_angles_give(gear: Gear) -> None:
    # Both ends of one link act along one line: the sum of two vectors, integrated over both angles.
    turns = 2 * np.pi * (np.arange(400) + 0.5) / 400
    directions = np.zeros((400, 400, 10))
    directions[:, :, 2], directions[:, :, 4] = np.meshgrid(turns, turns)
    moved = gear.model.displacement(links_from(FAILURE[0], directions))
    chance = chance_beyond(gear.model, FAILURE, np.array([MARGIN_IN]), 4096)[0]
    assert chance == pytest.approx(np.mean(np.abs(moved) > MARGIN_IN), abs=0.003)


@pytest.mark.parametrize("offset_in", [0.012, -0.012])
def test_what_moves_the_plunger_besides_is_added_with_its_sign(gear, offset_in):
    moved = gear.model.displacement(links_from(FAILURE, random_directions(10, 64))) + offset_in
    chance = chance_beyond(
        gear.model, FAILURE, np.array([MARGIN_IN]), 64, offset_in=np.array([offset_in])
    )[0]
    assert chance == np.mean(np.abs(moved) > MARGIN_IN)


@pytest.fixture(scope="module")
def worn_gears() -> np.ndarray:
    """Gears with clearances spread evenly over 0 to 0.0075 in."""
    return 0.0075 * qmc.Sobol(10, seed=13).random(1024)


def test_gears_worn_up_to_the_limit_exceed_in_five_percent_of_random_directions(gear, worn_gears):
    chance = chance_beyond(gear.model, worn_gears, np.full(len(worn_gears), MARGIN_IN), 512)
    assert chance.mean() == pytest.approx(0.05, abs=0.005)


def test_gears_worn_up_to_the_limit_exceed_with_worst_directions_in_97_percent(gear, worn_gears):
    beyond = worst_case(gear.model, worn_gears).magnitude_in > MARGIN_IN
    assert beyond.mean() == pytest.approx(0.97, abs=0.015)


def test_random_directions_lie_on_the_circle_and_are_the_same_at_every_call() -> None:
    turns = random_directions(10, 1000)
    assert np.array_equal(turns, random_directions(10, 1000))
    assert turns.min() >= 0.0
    assert turns.max() < 2 * np.pi


def test_random_directions_are_spread_more_evenly_than_plain_monte_carlo() -> None:
    lattice = qmc.discrepancy(random_directions(10, 1024) / (2 * np.pi), method="WD")
    rng = np.random.default_rng(14)
    plain = [qmc.discrepancy(rng.random((1024, 10)), method="WD") for _ in range(5)]
    assert lattice < 0.5 * min(plain)


def test_every_pair_of_random_directions_is_spread_evenly() -> None:
    turns = random_directions(10, 4096) / (2 * np.pi)
    worst = 0.0
    for i in range(10):
        for j in range(i):
            counts, _, _ = np.histogram2d(turns[:, i], turns[:, j], bins=8, range=[[0, 1], [0, 1]])
            worst = max(worst, np.abs(counts / 64 - 1).max())
    # A plain sample is off by four standard deviations of 1/8 in the worst of 2,880 cells.
    assert worst < 0.35
