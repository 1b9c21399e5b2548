"""The plan: its first step is the one next action, and it comes to an end."""

from __future__ import annotations

import math

import pytest

from mlg_troubleshoot.decision.assessment import Verdict
from mlg_troubleshoot.decision.case import Cases, predict_batch
from mlg_troubleshoot.decision.inspection import Outcome, RiggingCheck
from mlg_troubleshoot.decision.judge_rows import assess
from mlg_troubleshoot.decision.plan import Action, Basis, End
from mlg_troubleshoot.decision.plunger_reading import compare
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.indices.index_table import IndexTable
from mlg_troubleshoot.reporting.json_form import check_as_json
from tests.decision.conftest import Judge, every_joint, inspected


def test_a_gear_that_failed_has_its_plunger_read_first(gear: Gear, judge: Judge) -> None:
    first = judge({3: 0.013, 5: 0.007}, outcome=Outcome.FAILED).next_action
    assert (first.action, first.joints, first.minutes) == (
        Action.READ_PLUNGER,
        (),
        gear.plunger_reading.value,
    )


def test_a_plunger_measured_beyond_its_margin_is_outside_whatever_is_predicted(
    judge: Judge,
) -> None:
    found = judge(every_joint(0.001), readings_in=(0.060,))
    assert (found.verdict, found.basis) == (Verdict.OUTSIDE_MARGIN, Basis.MEASURED)
    assert found.headline.startswith(
        "MEASURED: the plunger stands 0.0600 in beyond mid-position, outside"
    )
    assert found.probability_within_margin is not None
    assert found.probability_within_margin > 0.95


def test_what_the_joints_explain_and_what_they_cannot_add_up_to_what_was_measured(
    judge: Judge,
) -> None:
    found = judge(every_joint(0.001), readings_in=(-0.060,))
    assert found.explained_at_most_in == pytest.approx(-(found.under_travel_in or 0.0))
    assert found.explained_at_most_in + (found.unexplained_in or 0.0) == pytest.approx(0.060)
    most, rest = found.explained_at_most_in, found.unexplained_in or 0.0
    assert f"explain at most {most:.4f} in of it; {rest:.4f} in has another cause" in found.headline


def test_an_unmeasured_joint_may_explain_a_displacement_up_to_its_limit(judge: Judge) -> None:
    found = judge(every_joint(0.001) | {}, readings_in=(0.030,))
    some = judge(dict.fromkeys(range(1, 9), 0.001), readings_in=(0.030,))
    assert (found.explained_at_most_in or 0.0) < (some.explained_at_most_in or 0.0)
    assert some.explained_at_most_in == pytest.approx(min(0.030, some.predicted_upper_in or 0.0))


@pytest.mark.parametrize(("third", "condition"), [(None, True), (0.016, False)])
def test_what_only_joints_that_were_not_read_could_do_is_said_with_that_condition(
    third: float | None, condition: bool, judge: Judge
) -> None:
    read = {1: 0.0035, 2: 0.004} | ({} if third is None else {3: third})
    found = judge(read, readings_in=(0.045,))
    assert "Joint clearances can explain all of it" in found.headline
    assert ("if joints that were not read are worn" in found.headline) is condition


def test_without_a_reading_nothing_is_explained(judge: Judge) -> None:
    found = judge(every_joint(0.001))
    assert (found.explained_at_most_in, found.unexplained_in) == (None, None)


def test_a_displacement_beyond_what_the_joints_explain_is_not_explained(judge: Judge) -> None:
    found = judge(every_joint(0.001), readings_in=(0.060,))
    assert [step.action for step in found.plan.steps] == [Action.CHECK_RIGGING, Action.CONTINUE]
    assert found.end is End.NOT_EXPLAINED


def test_a_joint_over_its_limit_is_restored_before_a_displacement_counts_as_unexplained(
    judge: Judge,
) -> None:
    found = judge(every_joint(0.0003, j7=0.0148), readings_in=(0.060,))
    assert [(step.action, step.joints) for step in found.plan.steps] == [
        (Action.RESTORE, (7,)),
        (Action.CHECK_RIGGING, ()),
        (Action.CONTINUE, ()),
    ]


def test_a_plan_ends_in_going_on_without_minutes(judge: Judge) -> None:
    for clearance in (0.001, 0.002, 0.003):
        last = judge(every_joint(clearance)).plan.steps[-1]
        assert (last.action, last.minutes) == (Action.CONTINUE, 0.0)


def test_the_next_action_of_the_json_is_the_first_step_of_its_plan(
    gear: Gear, judge: Judge
) -> None:
    form = check_as_json(gear, [judge({3: 0.013})], [], [])["inspections"][0]
    assert form["next_action"] == form["plan"][0]
    assert form["end"] in set(End)


def test_joints_are_measured_again_where_a_better_gauge_likely_settles_the_verdict(
    judge: Judge,
) -> None:
    found = judge(every_joint(0.0020))
    assert found.verdict is Verdict.INCONCLUSIVE
    first = found.next_action
    assert (first.action, first.joints, first.gauge_u_needed_in) == (
        Action.MEASURE_AGAIN,
        (2, 4, 3, 5, 1),
        0.0003,
    )
    assert found.end is End.WITHIN


def test_far_from_both_verdicts_nothing_is_measured_again(judge: Judge) -> None:
    found = judge(every_joint(0.0022))
    assert (found.verdict, found.next_action.action, found.end) == (
        Verdict.INCONCLUSIVE,
        Action.CONTINUE,
        End.TOO_CLOSE,
    )


def test_a_joint_whose_own_uncertainty_is_stated_is_not_measured_again(
    gear: Gear, table: IndexTable
) -> None:
    read = inspected(every_joint(0.0020), gauge_u_by_joint_in=dict.fromkeys(range(1, 11), 0.0005))
    (found,) = assess([read], gear, table)
    assert found.next_action.action is Action.CONTINUE


def test_before_any_reading_one_joint_is_expected_to_be_restored(judge: Judge) -> None:
    steps = judge({}, outcome=Outcome.FAILED).plan.steps
    (restored,) = (step for step in steps if step.action is Action.RESTORE)
    assert len(restored.joints) == 1


def test_an_area_counts_once_and_again_after_a_repair_closed_it(judge: Judge) -> None:
    steps = judge({3: 0.013, 5: 0.007}, outcome=Outcome.FAILED).plan.steps
    # Sidestay 15 min with two joints of 10 min, still open for two restorations of 120 min each.
    assert [step.minutes for step in steps[:3]] == [12.0, 35.0, 240.0]


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
    assert compare(cases, predict_batch(cases).upper).clears == [clears]


@pytest.mark.parametrize(("apart", "explained"), [(1.9, True), (2.1, False)])
def test_the_joints_explain_a_displacement_up_to_two_standard_uncertainties_beyond_their_worst_case(
    gear: Gear, judge: Judge, apart: float, explained: bool
) -> None:
    found = judge(every_joint(0.0005))
    u_in = math.hypot(found.standard_uncertainty_in or 0.0, 0.002)
    read = inspected(
        every_joint(0.0005), readings_in=((found.over_travel_in or 0.0) + apart * u_in,)
    )
    cases = Cases.of(gear, [read])
    assert compare(cases, predict_batch(cases).upper).explained == [explained]


def test_what_may_be_found_within_its_limit_is_read_before_a_sound_joint_is_restored(
    judge: Judge,
) -> None:
    found = judge({3: 0.013, 5: 0.007}, readings_in=(0.041,), outcome=Outcome.FAILED)
    first = found.plan.steps[0]
    # Without them #5 would be restored as well, within its limit.
    assert (first.action, first.joints) == (Action.MEASURE, (2, 4))


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


def test_a_failure_that_clearances_hardly_cause_is_expected_to_have_another_cause(
    judge: Judge,
) -> None:
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


def test_no_better_gauge_is_asked_for_than_is_needed(judge: Judge) -> None:
    coarse = judge(every_joint(0.0018), gauge_u_in=0.001).next_action
    fine = judge(every_joint(0.0020), gauge_u_in=0.0005).next_action
    assert coarse.action is fine.action is Action.MEASURE_AGAIN
    assert (coarse.gauge_u_needed_in or 0.0) > (fine.gauge_u_needed_in or 0.0)


def test_a_joint_at_its_limit_is_not_restored_even_if_read_in_millimetres(judge: Judge) -> None:
    at_limit = judge(every_joint(0.0005, j7=0.1905 / 25.4))
    assert Action.RESTORE not in [step.action for step in at_limit.plan.steps]
    assert at_limit.end is End.WITHIN


def test_what_tells_least_is_left_for_a_second_round_of_readings(judge: Judge) -> None:
    rounds = [
        step.joints for step in judge(dict.fromkeys(range(1, 6), 0.0015)).plan.steps if step.joints
    ]
    assert [set(joints) for joints in rounds] == [{6, 9, 10}, {7, 8}]


def test_reading_in_an_area_that_the_repair_opens_anyway_costs_the_reading_alone(
    judge: Judge,
) -> None:
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


def test_a_reading_in_doubt_of_a_joint_that_hardly_moves_the_plunger_waits_for_the_others(
    judge: Judge,
) -> None:
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


def test_reading_ends_where_the_gear_will_be_too_close_anyway(judge: Judge) -> None:
    close, open_still = (judge(dict.fromkeys(range(1, 8), c)) for c in (0.0022, 0.0019))
    assert (close.verdict, close.end) == (Verdict.INCOMPLETE, End.TOO_CLOSE)
    assert close.next_action.action is Action.CONTINUE
    assert open_still.next_action.action is Action.MEASURE


def test_the_expected_repair_says_which_joint_nobody_has_read(judge: Judge) -> None:
    found = judge({3: 0.013, 5: 0.007}, outcome=Outcome.FAILED)
    (repair,) = [step for step in found.plan.steps if step.action is Action.RESTORE]
    assert repair.joints == (3, 2)
    assert repair.text == "Restore #3 and what the readings find worn, perhaps #2."


def test_joints_are_expected_to_be_the_cause_where_the_rigging_is_found_right(
    judge: Judge,
) -> None:
    found = judge(every_joint(0.0045), readings_in=(0.036,), outcome=Outcome.FAILED)
    assert [step.action for step in found.plan.steps][:2] == [Action.CHECK_RIGGING, Action.RESTORE]
    assert found.end is End.DONE
