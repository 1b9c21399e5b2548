"""The plan: its first step is the one next action, and it comes to an end."""

from __future__ import annotations

import math
from typing import Any

import pytest

from mlg_troubleshoot.decision.assessment import Action, Basis, End, Verdict
from mlg_troubleshoot.decision.inspection import Outcome, RiggingCheck
from mlg_troubleshoot.decision.prediction import Cases
from mlg_troubleshoot.gear.gear import Gear
from tests.decision.conftest import Judge, every_joint, inspected


def test_a_gear_that_failed_has_its_plunger_read_first(gear: Gear, judge: Judge) -> None:
    first = judge({3: 0.013, 5: 0.007}, outcome=Outcome.FAILED).next_action
    assert (first.action, first.joints, first.minutes) == (
        Action.READ_PLUNGER,
        (),
        gear.plunger_reading.value,
    )


def test_an_unmeasured_joint_may_explain_a_displacement_up_to_its_limit(judge: Judge) -> None:
    found = judge(every_joint(0.001) | {}, readings_in=(0.030,))
    some = judge(dict.fromkeys(range(1, 9), 0.001), readings_in=(0.030,))
    assert (found.explained_at_most_in or 0.0) < (some.explained_at_most_in or 0.0)
    assert some.explained_at_most_in == pytest.approx(min(0.030, some.predicted_upper_in or 0.0))


def test_what_is_explained_and_what_is_not_are_the_measured_displacement(judge: Judge) -> None:
    found = judge(every_joint(0.001), readings_in=(-0.048, -0.044))
    assert found.explained_at_most_in is not None and found.unexplained_in is not None
    assert found.explained_at_most_in + found.unexplained_in == pytest.approx(0.046)


def test_before_any_reading_one_joint_is_expected_to_be_restored(judge: Judge) -> None:
    steps = judge({}, outcome=Outcome.FAILED).plan.steps
    (restored,) = (step for step in steps if step.action is Action.RESTORE)
    assert len(restored.joints) == 1


def test_an_area_counts_once_and_again_after_a_repair_closed_it(judge: Judge) -> None:
    steps = judge({3: 0.013, 5: 0.007}, outcome=Outcome.FAILED).plan.steps
    # Sidestay 15 min with two joints of 25 min, still open for two restorations of 120 min each.
    assert [step.minutes for step in steps[:3]] == [12.0, 40.0, 240.0]


@pytest.mark.parametrize(
    ("read", "known", "place", "then"),
    [
        ({3: 0.013, 5: 0.007}, {}, 1, {"readings_in": (0.042,)}),
        (every_joint(0.0045), {}, 0, {"readings_in": (0.012,)}),
        (every_joint(0.0045), {"readings_in": (0.036,)}, 0, {"rigging_checked": RiggingCheck.YES}),
    ],
)
def test_what_follows_an_outcome_is_what_comes_next_once_it_is_entered(
    judge: Judge, read: dict[int, float], known: Any, place: int, then: Any
) -> None:
    plan = judge(read, outcome=Outcome.FAILED, **known).plan
    entered = judge(read, outcome=Outcome.FAILED, **known | then).next_action
    assert (plan.then[place].action, plan.then[place].joints) == (entered.action, entered.joints)
    # What is expected is that a reading is beyond the margin, and the rigging right.
    if then != {"readings_in": (0.012,)}:
        assert plan.steps[1].text == entered.text


def test_a_gear_that_retracts_has_only_the_joint_over_its_limit_restored(judge: Judge) -> None:
    found = judge(every_joint(0.0003, j7=0.0148), outcome=Outcome.RETRACTED)
    assert (found.next_action.action, found.next_action.joints) == (Action.RESTORE, (7,))
    assert found.end is End.DONE


@pytest.mark.parametrize(("apart", "clears"), [(1.9, False), (2.1, True)])
def test_a_reading_clears_a_gear_from_two_standard_uncertainties_within_its_margin_on(
    gear: Gear, apart: float, clears: bool
) -> None:
    u_in = math.hypot(0.002, 0.002)
    cases = Cases.of(gear, [inspected({}, readings_in=(apart * u_in - 0.03,), margin_u_in=0.002)])
    assert cases.clears_margin == [clears]


def test_a_failure_that_clearances_likely_caused_is_expected_to_be_repaired(judge: Judge) -> None:
    read = every_joint(0.001, j3=0.0148)
    found = judge(read, outcome=Outcome.FAILED, measured_again=(3,))
    assert 0.05 < (found.probability_exceed_random_directions or 0.0) < 0.5
    assert [step.action for step in found.plan.steps] == [
        Action.READ_PLUNGER,
        Action.RESTORE,
        Action.READ_PLUNGER,
        Action.RETRACT,
        Action.DONE,
    ]
    assert (3 in found.plan.steps[1].joints, found.end) == (True, End.DONE)


def test_a_failure_that_clearances_hardly_cause_is_expected_to_have_another_cause(judge):
    found = judge(every_joint(0.0035), outcome=Outcome.FAILED)
    assert found.verdict is Verdict.OUTSIDE_MARGIN
    assert (found.probability_exceed_random_directions or 0.0) < 0.05
    assert ([step.action for step in found.plan.steps], found.end) == (
        [Action.READ_PLUNGER, Action.CONTINUE],
        End.NOT_EXPLAINED,
    )


@pytest.mark.parametrize(
    ("outcome", "first", "end"),
    [
        (Outcome.FAILED, Action.CHECK_RIGGING, End.DONE),
        (None, Action.CONTINUE, End.OUTSIDE_NO_COMPLAINT),
        (Outcome.RETRACTED, Action.CONTINUE, End.OUTSIDE_NO_COMPLAINT),
    ],
)
def test_a_plunger_beyond_its_margin_is_a_complaint_only_of_a_gear_that_failed(
    judge: Judge, outcome: Outcome | None, first: Action, end: End
) -> None:
    found = judge(every_joint(0.004), readings_in=(0.035,), outcome=outcome)
    assert (found.verdict, found.basis) == (Verdict.OUTSIDE_MARGIN, Basis.MEASURED)
    assert (found.next_action.action, found.end) == (first, end)


@pytest.mark.parametrize(
    ("readings_in", "outcome", "first"),
    [
        ((0.040, 0.004), Outcome.RETRACTED, Action.READ_PLUNGER),
        ((0.046, 0.004), Outcome.FAILED, Action.READ_PLUNGER),
        ((0.040, 0.004, 0.005), Outcome.RETRACTED, Action.CONTINUE),
    ],
)
def test_of_two_plunger_readings_at_odds_a_third_shows_which_was_a_slip(
    judge: Judge,
    readings_in: tuple[float, ...],
    outcome: Outcome,
    first: Action,
) -> None:
    found = judge(every_joint(0.004), readings_in=readings_in, outcome=outcome).next_action
    assert (found.action, found.required) == (first, True)


def test_reading_in_an_area_that_the_repair_opens_anyway_costs_the_reading_alone(judge):
    read = every_joint(0.005, j3=0.0079)
    del read[4]
    failed = {"outcome": Outcome.FAILED, "measured_again": (3,)}
    next_action = judge(read, readings_in=(0.031, 0.031), **failed).next_action
    # Joint 3 is over its limit: the sidestay, in which #4 is read, will be opened in any case. To
    # open it for the reading alone takes longer than the reading saves.
    assert (next_action.action, next_action.joints) == (Action.MEASURE, (4,))


def test_a_reading_in_doubt_is_taken_again_before_the_rigging_is_checked(judge: Judge) -> None:
    read = every_joint(0.0015, j1=0.004, j2=0.0045, j3=0.009, j4=0.005, j5=0.0055)
    doubtful, confirmed = (
        judge(read, readings_in=(0.036,), outcome=Outcome.FAILED, measured_again=again)
        for again in ((), (3,))
    )
    # It is needed whatever the cause, and with #3 worn hardly any chance is left to the rigging.
    assert [step.action for step in doubtful.plan.steps][:2] == [
        Action.MEASURE_AGAIN,
        Action.RESTORE,
    ]
    assert confirmed.next_action.action is Action.RESTORE


def test_a_reading_in_doubt_of_a_joint_that_hardly_moves_the_plunger_waits_for_the_others(judge):
    read = {8: 0.0085} | dict.fromkeys((6, 7, 9, 10), 0.001)
    steps = judge(read, readings_in=(0.036,), outcome=Outcome.FAILED).plan.steps
    assert (steps[0].action, 8 in steps[0].joints) == (Action.MEASURE, False)


def test_a_rigging_that_is_likely_wrong_is_checked_before_a_joint_that_hardly_matters_is_restored(
    judge: Judge,
) -> None:
    failed = {"outcome": Outcome.FAILED, "measured_again": (8,)}
    found = judge(every_joint(0.001, j8=0.013), readings_in=(0.036,), **failed)
    # The repair would be followed by a reading of the plunger in vain.
    assert [step.action for step in found.plan.steps] == [
        Action.CHECK_RIGGING,
        Action.RESTORE,
        Action.CONTINUE,
    ]


def test_no_joint_is_read_that_could_not_spare_the_sound_ones(judge: Judge) -> None:
    read = every_joint(0.001, j4=0.0074, j5=0.0074)
    some = {n: value for n, value in read.items() if n not in (6, 7, 9, 10)}
    failed = {"outcome": Outcome.FAILED, "rigging_checked": RiggingCheck.YES}
    # All four of the link assembly, worn to twice their limits, move it less than is needed.
    found = judge(some, readings_in=(0.047, 0.047), **failed)
    assert found.next_action.action is Action.RESTORE


def test_joints_are_expected_to_be_the_cause_where_the_rigging_is_found_right(judge: Judge) -> None:
    found = judge(every_joint(0.0045), readings_in=(0.036,), outcome=Outcome.FAILED)
    assert [step.action for step in found.plan.steps][:2] == [Action.CHECK_RIGGING, Action.RESTORE]
    assert found.end is End.DONE
