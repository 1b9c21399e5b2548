"""Which joints explain a measured displacement."""

from __future__ import annotations

import pytest

from mlg_troubleshoot.decision.assessment import Posterior
from mlg_troubleshoot.decision.inspection import Outcome, RiggingCheck
from mlg_troubleshoot.decision.prediction import Cases
from mlg_troubleshoot.gear.gear import Gear
from tests.decision.conftest import Judge, belief_of, every_joint, inspected


def explained(gear: Gear, clearance_in: dict[int, float], reading_in: float) -> Posterior:
    return belief_of(Cases.of(gear, [inspected(clearance_in, readings_in=(reading_in,))])).explained


def chance(found: Posterior, joint: int) -> float:
    return next(group.probability for group in found.groups if joint in group.joints)


def test_without_a_plunger_reading_nothing_is_explained(judge: Judge) -> None:
    assert judge({3: 0.013}, advice=True).posterior is None


def test_the_only_unmeasured_link_explains_a_large_displacement(gear: Gear) -> None:
    sound = {j: 0.0005 for j in range(1, 11) if j not in (3, 5)}
    found = explained(gear, sound, 0.028)
    assert found.groups[0].joints == (3, 5)
    assert found.groups[0].probability > 0.5


def test_a_displacement_that_clearances_cannot_reach_is_not_clearance_and_names_no_joint(gear):
    found = explained(gear, every_joint(0.0005), 0.04)
    assert found.not_clearance == pytest.approx(1.0, abs=0.01)
    assert "#" not in found.text


def test_no_displacement_does_not_call_any_joint_worn(gear: Gear) -> None:
    assert explained(gear, {}, 0.0).groups[0].probability < 0.5


def test_a_displacement_raises_the_chance_of_wear(gear: Gear) -> None:
    sound = {j: 0.0005 for j in range(1, 11) if j not in (2, 4)}
    assert chance(explained(gear, sound, 0.025), 2) > 3.0 * chance(explained(gear, sound, 0.0), 2)


def test_a_joint_that_moves_the_plunger_more_explains_a_large_displacement_better(gear):
    sound = {j: 0.0005 for j in range(1, 11) if j not in (2, 8)}
    found = explained(gear, sound, 0.02)
    assert chance(found, 2) > chance(found, 8)


def test_a_joint_read_again_beyond_its_limit_is_worn(gear: Gear) -> None:
    again = inspected({3: 0.013}, readings_in=(0.02,), measured_again=(3,))
    assert chance(belief_of(Cases.of(gear, [again])).explained, 3) > 0.999


@pytest.mark.parametrize("reading_in", [0.01, 0.0335])
@pytest.mark.parametrize("outcome", [None, Outcome.FAILED])
def test_a_reading_over_the_limit_is_as_doubtful_as_for_the_plan(gear, reading_in, outcome):
    read = {1: 0.003, 2: 0.0082, 3: 0.002, 4: 0.0025, 5: 0.003}
    one = Cases.of(gear, [inspected(read, readings_in=(reading_in,), outcome=outcome)])
    assert 0.3 < belief_of(one).worn[1] < 0.8


def test_the_sense_of_the_displacement_tells_little(gear: Gear) -> None:
    sound = {j: 0.0005 for j in range(1, 11) if j != 2}
    assert chance(explained(gear, sound, 0.02), 2) == pytest.approx(
        chance(explained(gear, sound, -0.02), 2), abs=0.1
    )


def test_the_chance_of_the_rigging_is_the_one_that_the_plan_follows(gear: Gear) -> None:
    one = Cases.of(gear, [inspected(every_joint(0.003), readings_in=(0.036,))])
    found = belief_of(one).explained
    assert found is not None
    assert found.not_clearance == belief_of(one).chances[1]


def test_an_unread_joint_is_likelier_worn_on_a_gear_whose_other_joints_are_worn(gear: Gear) -> None:
    young = explained(gear, dict.fromkeys(range(2, 11), 0.0007), 0.004)
    old = explained(gear, dict.fromkeys(range(2, 11), 0.006), 0.004)
    assert chance(old, 1) > 2.0 * chance(young, 1)


@pytest.mark.parametrize("reading_in", [0.12, 0.15])
def test_every_chance_is_a_number_where_nothing_explains_the_reading(gear, reading_in):
    found = explained(gear, every_joint(0.0005), reading_in)
    assert all(0.0 < each.probability < 1.0 for each in found.groups)
    assert found.not_clearance > 0.99


@pytest.mark.parametrize(
    ("looked", "said"),
    [(None, "Rigging or lock roller"), (RiggingCheck.YES, "rigging and lock roller were checked")],
)
def test_a_rigging_that_was_looked_at_is_not_named_again(gear, looked, said):
    row = inspected(every_joint(0.001), readings_in=(0.045,), rigging_checked=looked)
    assert said in belief_of(Cases.of(gear, [row])).explained.text
