"""Which joints explain a measured displacement."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mlg_troubleshoot.decision.assessment import Posterior
from mlg_troubleshoot.decision.belief import Belief, explain
from mlg_troubleshoot.decision.inspection import Outcome, RiggingCheck
from mlg_troubleshoot.decision.prediction import Cases
from mlg_troubleshoot.gear.gear import Gear
from tests.benchmarks import worn_gears
from tests.decision.conftest import Judge, every_joint, inspected


def explained(gear: Gear, clearance_in: dict[int, float], reading_in: float) -> Posterior:
    return explain(Belief(Cases.of(gear, [inspected(clearance_in, readings_in=(reading_in,))])))


def chance(found: Posterior, joint: int) -> float:
    return next(group.probability for group in found.groups if joint in group.joints)


def test_without_a_plunger_reading_nothing_is_explained(judge: Judge) -> None:
    assert judge({3: 0.013}, advice=True).posterior is None


def test_the_only_unmeasured_link_explains_a_large_displacement(gear: Gear) -> None:
    sound = {j: 0.0005 for j in range(1, 11) if j not in (3, 5)}
    found = explained(gear, sound, 0.028)
    assert found.groups[0].joints == (3, 5)
    assert found.called_worn == ((3, 5),)


def test_a_displacement_that_clearances_cannot_reach_is_not_clearance_and_names_no_joint(gear):
    found = explained(gear, every_joint(0.0005), 0.04)
    assert found.not_clearance == pytest.approx(1.0, abs=0.01)
    assert "#" not in found.text


def test_no_displacement_does_not_call_any_joint_worn(gear: Gear) -> None:
    assert explained(gear, {}, 0.0).called_worn == ()


def test_a_displacement_raises_the_chance_of_wear(gear: Gear) -> None:
    sound = {j: 0.0005 for j in range(1, 11) if j not in (2, 4)}
    assert chance(explained(gear, sound, 0.025), 2) > 3.0 * chance(explained(gear, sound, 0.0), 2)


def test_a_joint_that_moves_the_plunger_more_explains_a_large_displacement_better(gear):
    sound = {j: 0.0005 for j in range(1, 11) if j not in (2, 8)}
    found = explained(gear, sound, 0.02)
    assert chance(found, 2) > chance(found, 8)


def test_a_joint_read_again_beyond_its_limit_is_worn(gear: Gear) -> None:
    again = inspected({3: 0.013}, readings_in=(0.02,), measured_again=(3,))
    assert chance(explain(Belief(Cases.of(gear, [again]))), 3) > 0.999


@pytest.mark.parametrize("reading_in", [0.01, 0.0335])
@pytest.mark.parametrize("outcome", [None, Outcome.FAILED])
def test_a_reading_over_the_limit_is_as_doubtful_as_for_the_plan(gear, reading_in, outcome):
    read = {1: 0.003, 2: 0.0082, 3: 0.002, 4: 0.0025, 5: 0.003}
    one = Cases.of(gear, [inspected(read, readings_in=(reading_in,), outcome=outcome)])
    worn = explain(Belief(one)).intervals[1].worn
    assert 0.3 < worn < 0.8
    assert worn == Belief(one).worn[1]


def test_the_interval_of_a_measured_joint_is_its_reading_with_its_uncertainty(gear: Gear) -> None:
    found = explained(gear, every_joint(0.004), 0.0).intervals[5]
    assert (found.low_in, found.high_in) == pytest.approx(
        (0.004 - 1.645 * 0.0005, 0.004 + 1.645 * 0.0005), abs=1e-4
    )


def test_no_joint_is_taken_to_be_worn_beyond_twice_its_limit(gear: Gear) -> None:
    # Three times its limit would explain the reading better.
    found = explained(gear, {j: 0.0005 for j in range(1, 11) if j != 2}, 0.035).intervals[1]
    assert gear.joint(2).limit.value < found.high_in <= 2.0 * gear.joint(2).limit.value


def test_the_two_ends_of_an_unmeasured_link_get_the_same_interval(gear: Gear) -> None:
    sound = {j: 0.0005 for j in range(1, 11) if j not in (3, 5)}
    one, other = (explained(gear, sound, 0.01).intervals[j - 1] for j in (3, 5))
    assert one.median_in == pytest.approx(other.median_in, rel=0.2)


def test_the_sense_of_the_displacement_tells_little(gear: Gear) -> None:
    sound = {j: 0.0005 for j in range(1, 11) if j != 2}
    assert chance(explained(gear, sound, 0.02), 2) == pytest.approx(
        chance(explained(gear, sound, -0.02), 2), abs=0.1
    )


@pytest.mark.slow
def test_ninety_percent_intervals_cover_the_clearances_of_a_simulated_fleet(gear: Gear) -> None:
    rng = np.random.default_rng(11)
    fleet = worn_gears.explained_fleet(120, rng)
    inside = []
    for row in range(120):
        read = {j: float(fleet.read_in[row, j - 1]) for j in range(1, 11) if rng.random() < 0.5}
        found = explained(gear, read, float(fleet.plunger_in[row]))
        inside += [
            i.low_in <= fleet.true_in[row, i.joint - 1] <= i.high_in
            for i in found.intervals
            if i.joint not in read
        ]
    # Their wear is drawn from another distribution than the program's.
    assert 0.86 < np.mean(inside) < 0.96


def test_the_seed_decides_the_draws(gear: Gear) -> None:
    first, again = (explained(gear, {}, 0.02) for _ in range(2))
    assert first == replace(again)


def test_the_chance_of_the_rigging_is_the_one_that_the_plan_follows(gear: Gear) -> None:
    one = Cases.of(gear, [inspected(every_joint(0.003), readings_in=(0.036,))])
    found = explain(Belief(one))
    assert found is not None
    assert found.not_clearance == Belief(one).chances[1]


def test_an_unread_joint_is_likelier_worn_on_a_gear_whose_other_joints_are_worn(gear: Gear) -> None:
    young = explained(gear, dict.fromkeys(range(2, 11), 0.0007), 0.004)
    old = explained(gear, dict.fromkeys(range(2, 11), 0.006), 0.004)
    assert chance(old, 1) > 2.0 * chance(young, 1)


def test_a_coarse_reading_of_one_joint_leaves_its_clearance_open(gear: Gear) -> None:
    read = inspected(every_joint(0.004), readings_in=(0.02,), gauge_u_by_joint_in={5: 0.002})
    found = explain(Belief(Cases.of(gear, [read])))
    assert found is not None
    width = {each.joint: each.high_in - each.low_in for each in found.intervals}
    assert width[5] > 2.0 * width[3]


def test_every_interval_is_a_number_where_nothing_explains_the_reading(gear: Gear) -> None:
    found = explained(gear, every_joint(0.0005), 0.12)
    assert all(0.0 <= each.low_in <= each.median_in <= each.high_in for each in found.intervals)


@pytest.mark.parametrize(
    ("looked", "said"),
    [(None, "Rigging or lock roller"), (RiggingCheck.YES, "rigging and lock roller were checked")],
)
def test_a_rigging_that_was_looked_at_is_not_named_again(gear, looked, said):
    row = inspected(every_joint(0.001), readings_in=(0.045,), rigging_checked=looked)
    assert said in explain(Belief(Cases.of(gear, [row]))).text
