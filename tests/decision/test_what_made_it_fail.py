"""What is believed of a gear that failed: its joints, its rigging, or everything else."""

from __future__ import annotations

from datetime import datetime
from typing import Any

import numpy as np
import pytest

from mlg_troubleshoot.decision.assessment import RepairKind, RepairSet
from mlg_troubleshoot.decision.case import Cases
from mlg_troubleshoot.decision.causes import Causes, believed
from mlg_troubleshoot.decision.fleet import Fleet
from mlg_troubleshoot.decision.inspection import Outcome, RiggingCheck
from mlg_troubleshoot.decision.priors import PRIORS
from mlg_troubleshoot.decision.wear_levels import DENSITIES, PRIOR_OF_LEVELS, SHARES, level_chances
from mlg_troubleshoot.gear.gear import Gear
from tests.decision.conftest import every_joint, inspected

WORN = every_joint(0.004)
# The third reading may be the total play: with a probability of about 5 %.
IN_DOUBT = {2: 0.0017, 3: 0.0115, 5: 0.0038}


def causes_of(gear: Gear, clearance_in: dict[int, float], **more: Any) -> Causes:
    return believed(Cases.of(gear, [inspected(clearance_in, **more)]))


def test_a_rigging_that_was_looked_at_is_rarely_the_cause(gear: Gear) -> None:
    odds = []
    for looked in (None, RiggingCheck.YES):
        found = causes_of(gear, WORN, readings_in=(0.036,), rigging_checked=looked)
        odds.append(float(found.rigging[0] / found.joints[0]))
    assert odds[1] == pytest.approx(0.03 * odds[0])


def test_the_joints_explain_a_reading_at_their_worst_directions_though_no_random_ones_would(
    gear: Gear,
) -> None:
    worst_in = float(0.94 * gear.model.plunger_amplification() @ np.full(10, 0.004))
    found = causes_of(gear, WORN, readings_in=(worst_in,), rigging_checked=RiggingCheck.YES)
    assert found.loaded[0] > 0.8
    assert found.joints[0] > 0.7


def test_a_joint_that_was_read_twice_is_known_to_be_worn_or_not(gear: Gear) -> None:
    found = causes_of(gear, {3: 0.013, 5: 0.001}, readings_in=(0.036,), measured_again=(3,))
    assert found.worn[0, [2, 4]].tolist() == pytest.approx([1.0, 0.0])
    assert ((found.worn[0, [0, 6]] > 0.0) & (found.worn[0, [0, 6]] < 1.0)).all()


def test_gears_with_other_joints_unread_are_believed_as_each_alone(gear: Gear) -> None:
    rows = [
        inspected({j: v for j, v in WORN.items() if j not in left}, readings_in=readings)
        for left in ((), (2,), (3, 7))
        for readings in ((), (0.03,))
    ]
    together = believed(Cases.of(gear, rows))
    for place, row in enumerate(rows):
        alone = believed(Cases.of(gear, [row]))
        for name in ("worn", "levels", "exceeds", "joints"):
            np.testing.assert_allclose(
                getattr(together, name)[place], getattr(alone, name)[0], rtol=1e-9
            )


def test_how_likely_an_unread_joint_is_worn_is_what_drawn_gears_with_its_reading_say(
    gear: Gear,
) -> None:
    read = {joint: 0.002 for joint in range(1, 11) if joint not in (2, 3, 4, 5)}
    case = Cases.of(gear, [inspected(read, readings_in=(0.045,))], fleet=Fleet(loaded=0.0))
    rng = np.random.default_rng(11)
    n = 2_000_000
    level = rng.choice(len(PRIOR_OF_LEVELS), n, p=level_chances(case)[0])
    clearance = np.full((n, 10), 0.002)
    for place in range(1, 5):
        places = np.sum(rng.random(n)[:, None] > np.cumsum(DENSITIES, axis=1)[level], axis=1)
        clearance[:, place] = SHARES[np.minimum(places, len(SHARES) - 1)] * gear.limits_in[place]
    turned = gear.model.plunger_amplification() * np.cos(rng.uniform(0.0, 2.0 * np.pi, (n, 10)))
    stands = np.sum(clearance * turned, axis=1) + rng.normal(0.0, PRIORS.linkage_u_in, n)
    near = np.abs(np.abs(stands) - 0.045) < 0.001
    drawn = np.mean(clearance[near][:, 1:5] > gear.limits_in[1:5], axis=0)
    np.testing.assert_allclose(believed(case).worn[0, 1:5], drawn, atol=0.03)


def test_a_large_displacement_says_that_unread_joints_are_worn_more(gear: Gear) -> None:
    little, much = (
        float(causes_of(gear, {9: 0.001}, readings_in=(x,)).mean_in[0, 2]) for x in (0.002, 0.05)
    )
    assert much > 1.3 * little


def test_a_second_repair_is_not_surer_than_sure_where_nothing_is_restored(gear: Gear) -> None:
    worst_in = float(0.94 * gear.model.plunger_amplification() @ np.full(10, 0.006))
    found = causes_of(gear, every_joint(0.006), readings_in=(worst_in,))
    assert found.second_repair(0, np.zeros((1, 10), bool))[0] == pytest.approx(1.0, abs=0.01)


def test_new_joints_throughout_need_no_second_repair_where_the_plunger_was_not_read(
    gear: Gear,
) -> None:
    found = causes_of(gear, every_joint(0.004))
    assert found.second_repair(0, np.ones((1, 10), bool))[0] < 0.005


def test_a_second_repair_is_likelier_after_one_that_rests_on_a_reading_in_doubt(gear: Gear) -> None:
    only = np.eye(10, dtype=bool)[[2]]
    once, twice = (
        causes_of(gear, IN_DOUBT, readings_in=(0.034,), measured_again=again).second_repair(0, only)
        for again in ((), (3,))
    )
    assert once[0] > 1.2 * twice[0]


def test_of_a_gear_of_which_nothing_was_read_the_joints_are_the_cause_as_often_as_usual(
    gear: Gear,
) -> None:
    found = believed(Cases.of(gear, [inspected({})]))
    assert found.before_plunger[0] == pytest.approx(PRIORS.joints_for_one_elsewhere, rel=0.01)


def test_the_joints_of_a_gear_read_as_new_are_rarely_the_cause(gear: Gear) -> None:
    found = believed(Cases.of(gear, [inspected(every_joint(0.001))]))
    assert found.before_plunger[0] < 0.1


def test_a_gear_that_failed_before_its_repair_has_the_chance_of_a_second_one(gear: Gear) -> None:
    asked = RepairSet((3,), 0.02, 0.97, 10.0, 10.0, RepairKind.SURE)
    repaired = {"restored_joints": (7,), "repair_date": datetime(2026, 3, 4, 8, 0)}
    chances = []
    for outcome in (Outcome.FAILED, None):
        found = causes_of(gear, WORN, outcome=outcome, **repaired)
        ((said,),) = found.with_chances([(asked,)])
        chances.append(said.second_repair_probability is not None)
    assert chances == [True, False]


def test_the_same_plunger_reading_is_the_joints_rather_than_the_rigging_where_one_was_read_worn(
    gear: Gear,
) -> None:
    at_rest = {"readings_in": (0.036,)}
    worn = causes_of(gear, {2: 0.011, 9: 0.001}, **at_rest)
    sound = causes_of(gear, {2: 0.001, 9: 0.001}, **at_rest)
    assert worn.rigging[0] < 0.3 * sound.rigging[0]


def test_a_worn_joint_that_hardly_moves_the_plunger_speaks_against_the_rigging_all_the_same(
    gear: Gear,
) -> None:
    # A rigging goes wrong at work on the gear, at which what is over its limit is restored.
    worn, sound = (
        causes_of(gear, every_joint(0.0015, j6=worn), readings_in=(0.036,), measured_again=(6,))
        for worn in (0.011, 0.0015)
    )
    assert worn.rigging[0] / worn.joints[0] < 0.1 * sound.rigging[0] / sound.joints[0]


def test_the_joints_are_weighed_by_a_reading_once_only(gear: Gear) -> None:
    """By gears drawn here: how many of those that leave the margin stand beyond 0.055 in."""
    rng = np.random.default_rng(7)
    n = 400_000
    levels = np.geomspace(*PRIORS.levels, 6)
    chances = np.geomspace(*PRIORS.worn_out, 6)
    alike = rng.random(n) < PRIORS.alike
    common = rng.integers(6, size=n)
    moved = PRIORS.linkage_u_in * rng.normal(size=n)
    for amplification in gear.model.plunger_amplification():
        place = np.where(alike, common, rng.integers(6, size=n))
        level = levels[place]
        share = -level * np.log1p(-rng.random(n) * -np.expm1(-1.0 / level))
        share = np.where(rng.random(n) < chances[place], rng.uniform(1.0, 2.0, n), share)
        moved += amplification * 0.0075 * share * np.cos(rng.uniform(0.0, 2.0 * np.pi, n))
    beyond = [np.mean(np.abs(np.abs(moved) - x) < 0.001) for x in (0.035, 0.055)]
    odds = []
    for x in (0.035, 0.055):
        found = believed(Cases.of(gear, [inspected({}, readings_in=(x,))], fleet=Fleet(0.0)))
        odds.append(float(found.joints[0] / found.rigging[0] * found.by_rigging[0]))
    assert odds[1] / odds[0] == pytest.approx(beyond[1] / beyond[0], rel=0.1)


def test_loaded_pins_scatter_by_their_angle() -> None:
    angles = np.random.default_rng(1).normal(0.0, np.radians(PRIORS.scatter_deg), 200_000)
    assert PRIORS.cosine == pytest.approx((np.cos(angles).mean(), np.cos(angles).std()), abs=2e-3)
