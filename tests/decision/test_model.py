"""What is believed of a gear that failed, against plain draws from docs/reference/models.md.

Nothing of `decision.belief` is used to draw: the equations stand here a second time, term by term.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise

import numpy as np
import pytest

from mlg_troubleshoot.arrays import Array
from mlg_troubleshoot.decision.inspection import Outcome
from mlg_troubleshoot.decision.prediction import Cases, responses
from mlg_troubleshoot.decision.priors import PRIORS
from mlg_troubleshoot.gear.gear import Gear
from tests.decision.conftest import belief_of, inspected

PLUNGER_U_IN, GAUGE_U_IN, MARGIN_IN = 0.002, 0.0005, 0.030
# Centres of fifty cells of wear, from nothing to twice the limit. [1]
CENTRES = (np.arange(50) + 0.5) * 0.04


def wear_by_level() -> Array:
    """(2), chance of each cell: the six common levels, then each joint its own."""
    found = []
    for level, worn_out in zip(
        np.geomspace(*PRIORS.levels, 6), np.geomspace(*PRIORS.worn_out, 6), strict=True
    ):
        usual = np.where(CENTRES < 1.0, np.exp(-CENTRES / level), 0.0)
        beyond = np.where(CENTRES > 1.0, 1.0, 0.0)
        found.append((1.0 - worn_out) * usual / usual.sum() + worn_out * beyond / beyond.sum())
    return np.array([*found, np.mean(found, axis=0)])


@dataclass(frozen=True)
class Truth:
    """Chances of the causes, of worn joints, and of a second repair once each set is new."""

    causes: Array
    worn: Array
    second: Array
    effective: float


def drawn_shares(rng: np.random.Generator, gear: Gear, read: Mapping[int, float], n: int) -> Array:
    """(1) to (3), of readings within their limit."""
    wear = wear_by_level()
    prior = np.append(np.full(6, PRIORS.alike / 6), 1.0 - PRIORS.alike)
    # Each cell in forty parts.
    fine = (np.arange(2000) + 0.5) / 1000
    given = {}
    for joint, clearance in read.items():
        off = (fine * gear.joint(joint).limit.value - clearance) / GAUGE_U_IN
        given[joint] = np.repeat(wear, 40, axis=1) * np.exp(-0.5 * off**2)
    likely = prior * np.prod([each.sum(axis=1) for each in given.values()], axis=0)
    level = rng.choice(7, n, p=likely / likely.sum())
    share = np.empty((n, len(gear.joints)))
    for k in range(7):
        of = level == k
        cells = rng.choice(50, (int(of.sum()), share.shape[1]), p=wear[k])
        share[of] = 0.04 * (cells + rng.random(cells.shape))
        for joint, each in given.items():
            chance = each[k] / each[k].sum()
            share[of, joint - 1] = rng.choice(fine, int(of.sum()), p=chance)
    return share


def drawn_pins(rng: np.random.Generator, joints: int, held: Array, sign: Array) -> Array:
    """(4), the cosines of gears whose held pins rest with one sign."""
    n = len(held)
    free = np.cos(2.0 * np.pi * rng.random((n, joints)))
    mean, spread = PRIORS.cosine
    loaded = sign[:, None] * (mean + spread * rng.standard_normal((n, joints)))
    return np.where(held[:, None], loaded, free)


@lru_cache(maxsize=1)
def usual_chances(gear: Gear) -> tuple[Array, float]:
    """How often a gear of which nothing is known leaves its margin, with free and with held pins;
    how rarely work on it leaves every worn joint. [1]
    """
    rng = np.random.default_rng(77)
    n = 200_000
    share = drawn_shares(rng, gear, {}, n)
    response = responses(gear)[0]
    reach = response.amplification * gear.limits_in * share
    out = []
    for held in (False, True):
        x = (reach * drawn_pins(rng, 10, np.full(n, held), rng.choice([-1.0, 1.0], n))).sum(axis=1)
        x += PRIORS.linkage_u_in * rng.standard_normal(n)
        out.append(np.mean(np.abs(x) > MARGIN_IN))
    return np.array(out), float(np.mean(PRIORS.overlooked ** (share > 1.0).sum(axis=1)))


def simulated(
    gear: Gear, read: Mapping[int, float], y: float, sets: Array, n: int, seed: int
) -> Truth:
    """Draw everything, and weigh each draw by the reading of the plunger (5) to (8)."""
    rng = np.random.default_rng(seed)
    response = responses(gear)[0]
    reach = response.amplification * gear.limits_in
    second = np.diag(response.curvature).reshape(-1, 2).sum(axis=1) / 4.0 * gear.limits_in**2
    share = drawn_shares(rng, gear, read, n)
    held = rng.random(n) < PRIORS.loaded
    sign = rng.choice([-1.0, 1.0], n)
    moved = reach * share * drawn_pins(rng, 10, held, sign)
    x = moved.sum(axis=1) + np.where(held, 0.0, share**2 @ second)
    x += PRIORS.linkage_u_in * rng.standard_normal(n)
    likely = np.exp(-0.5 * ((y - x) / PLUNGER_U_IN) ** 2)
    often, overlooked = usual_chances(gear)
    often = np.where(held, often[1], often[0])
    out = np.abs(x) > MARGIN_IN
    of_joints = likely * out / often
    of_else = likely * ~out / (1.0 - often) / PRIORS.joints_for_one_elsewhere
    even = 1.0 / (1.0 + (y / (PRIORS.offset * MARGIN_IN)) ** 8)
    from scipy.stats import norm

    width = 2.0 * (PRIORS.offset - 1.0) * MARGIN_IN
    density = even * norm.cdf((abs(y) - MARGIN_IN) / PLUNGER_U_IN) / width
    left = PRIORS.overlooked ** (share > 1.0).sum(axis=1) / overlooked
    of_rigging = left * density * PLUNGER_U_IN * np.sqrt(2.0 * np.pi)
    of_rigging /= PRIORS.joints_for_one_misrigged
    weight = of_joints + of_else + of_rigging
    fresh = response.amplification * gear.new_parts_in * drawn_pins(rng, 10, held, sign)
    stays = np.abs(x[:, None] - (moved - fresh) @ sets.T.astype(float)) > MARGIN_IN
    causes = np.array([of_joints.sum(), of_rigging.sum(), of_else.sum()]) / weight.sum()
    return Truth(
        causes,
        weight @ (share > 1.0) / weight.sum(),
        of_joints @ stays / of_joints.sum(),
        float(of_joints.sum() ** 2 / np.sum(of_joints**2)),
    )


def believed(gear: Gear, read: Mapping[int, float], y: float, sets: Array) -> Truth:
    row = inspected(
        dict(read),
        readings_in=(y,),
        outcome=Outcome.FAILED,
        plunger_gauge_u_in=PLUNGER_U_IN,
        gauge_u_in=GAUGE_U_IN,
    )
    found = belief_of(Cases.of(gear, [row]))
    return Truth(
        np.array(found.chances),
        found.worn,
        np.array([found.second_repair(one) for one in sets]),
        np.inf,
    )


def some_sets(worn: Array) -> Array:
    """Sets of joints that a plan may restore: the likeliest alone, and the two likeliest."""
    order = np.argsort(-worn)
    sets = np.zeros((2, len(worn)), bool)
    sets[0, order[0]] = True
    sets[1, order[:2]] = True
    return sets


@pytest.mark.parametrize(
    ("read", "y"),
    [
        ({2: 0.0018, 3: 0.0011}, -0.0254),
        ({}, 0.0245),
        pytest.param({1: 0.005, 4: 0.0015}, 0.0511, marks=pytest.mark.slow),
        pytest.param({}, -0.0447, marks=pytest.mark.slow),
        ({3: 0.004, 4: 0.0013, 5: 0.0021}, 0.036),
    ],
)
def test_belief_is_what_plain_draws_of_the_model_say(gear, read, y):
    sets = some_sets(believed(gear, read, y, np.zeros((1, 10), bool)).worn)
    truth = simulated(gear, read, y, sets, 200_000, 9)
    found = believed(gear, read, y, sets)
    error = 3.0 / np.sqrt(truth.effective)
    assert found.causes == pytest.approx(truth.causes, abs=0.02 + error)
    assert found.worn == pytest.approx(truth.worn, abs=0.02 + error)
    assert found.second == pytest.approx(truth.second, abs=0.02 + error)


def drawn_gears(gear: Gear, n: int, seed: int) -> list[tuple[dict[int, float], float, int, Array]]:
    """Failed gears of the model: readings of some joints within their limits, the plunger's, the
    cause, and which joints are worn.
    """
    rng = np.random.default_rng(seed)
    often, overlooked = usual_chances(gear)
    response = responses(gear)[0]
    second = np.diag(response.curvature).reshape(-1, 2).sum(axis=1) / 4.0 * gear.limits_in**2
    total = 400 * n
    share = drawn_shares(rng, gear, {}, total)
    held = rng.random(total) < PRIORS.loaded
    cosines = drawn_pins(rng, 10, held, rng.choice([-1.0, 1.0], total))
    x = (response.amplification * gear.limits_in * share * cosines).sum(axis=1)
    x += np.where(held, 0.0, share**2 @ second) + PRIORS.linkage_u_in * rng.standard_normal(total)
    often = np.where(held, often[1], often[0])
    out = np.abs(x) > MARGIN_IN
    left = PRIORS.overlooked ** (share > 1.0).sum(axis=1) / overlooked
    weights = np.array(
        [
            out / often,
            left / PRIORS.joints_for_one_misrigged,
            ~out / (1.0 - often) / PRIORS.joints_for_one_elsewhere,
        ]
    )
    chosen = rng.choice(3 * total, 3 * n, p=weights.ravel() / weights.sum(), replace=False)
    found = []
    for cause, place in zip(*np.divmod(chosen, total), strict=True):
        joints = rng.permutation(10)[: rng.choice([0, 2, 5])]
        if (share[place, joints] > 0.9).any():
            continue
        at = x[place]
        if cause == 1:
            width = PRIORS.offset * MARGIN_IN
            at = rng.choice([-1.0, 1.0]) * rng.uniform(MARGIN_IN, width)
        clearance = share[place, joints] * gear.limits_in[joints]
        seen = np.abs(clearance + GAUGE_U_IN * rng.standard_normal(len(joints)))
        read = {int(j) + 1: float(each) for j, each in zip(joints, seen, strict=True)}
        y = float(at + PLUNGER_U_IN * rng.standard_normal())
        found.append((read, y, int(cause), share[place] > 1.0))
    return found[:n]


@pytest.mark.slow
def test_two_hundred_drawn_gears_are_believed_as_plain_draws_say(gear: Gear) -> None:
    beyond = []
    for read, y, _cause, _worn in drawn_gears(gear, 200, 5):
        sets = some_sets(believed(gear, read, y, np.zeros((1, 10), bool)).worn)
        truth, found = simulated(gear, read, y, sets, 200_000, 9), believed(gear, read, y, sets)
        error = 0.02 + 3.0 / np.sqrt(truth.effective)
        apart = [
            np.abs(found.causes - truth.causes).max(),
            np.abs(found.worn - truth.worn).max(),
            np.abs(found.second - truth.second).max() * (truth.causes[0] > 0.05),
        ]
        beyond += [(read, y, apart)] if max(apart) > error else []
    assert beyond == []


@pytest.mark.slow
def test_what_is_stated_happens_as_often(gear: Gear) -> None:
    stated, happened = [], []
    for read, y, cause, worn in drawn_gears(gear, 1500, 6):
        found = believed(gear, read, y, np.zeros((1, 10), bool))
        stated += [*found.causes, *found.worn]
        happened += [*(np.arange(3) == cause), *worn]
    chance, came = np.array(stated), np.array(happened, float)
    for low, high in pairwise((0.0, 0.02, 0.05, 0.1, 0.2, 0.35, 0.5, 0.65, 0.8, 0.9, 1.0)):
        some = (chance >= low) & (chance < high)
        spread = np.sqrt(np.sum(chance[some] * (1.0 - chance[some])))
        assert abs(came[some].sum() - chance[some].sum()) <= 3.5 * spread + 0.01 * some.sum()
