"""What the day allows: joints out of reach, missing spares."""

from __future__ import annotations

from datetime import datetime

import pytest

from mlg_troubleshoot.decision.assessment import Action, End
from mlg_troubleshoot.decision.inspection import Outcome
from tests.decision.conftest import Judge, every_joint

FAILED = {"outcome": Outcome.FAILED, "readings_in": (0.036,), "plunger_gauge_u_in": 0.001}
BUT_FOUR = {n: 0.001 for n in range(1, 11) if n != 4}
SIDESTAY, LINKS = (1, 2, 3, 4, 5), (6, 7, 8, 9, 10)


def asked(found: object) -> set[int]:
    return {n for step in found.plan.steps for n in step.joints}  # type: ignore[attr-defined]


@pytest.mark.parametrize("more", [{}, FAILED])
@pytest.mark.parametrize("out_of_reach", [(4,), SIDESTAY, LINKS])
def test_no_plan_asks_for_what_cannot_be_reached(judge, more, out_of_reach):
    found = judge({3: 0.002} if 3 not in out_of_reach else {}, **more, cannot_reach=out_of_reach)
    assert not asked(found) & set(out_of_reach)


def test_what_cannot_be_reached_is_named_on_a_gear_that_is_cleared_without_it(judge: Judge) -> None:
    but_eight = {n: 0.0005 for n in range(1, 11) if n != 8}
    found = judge(but_eight, cannot_reach=(8,))
    assert found.end is End.WITHIN
    assert "#8 cannot be reached" in (found.plan.open_question or "")


def test_sound_joints_are_not_restored_for_one_that_cannot_be_reached(judge: Judge) -> None:
    found = judge(BUT_FOUR, **FAILED, cannot_reach=(4,))
    assert Action.RESTORE not in {step.action for step in found.plan.steps}


def test_a_joint_over_its_limit_is_restored_although_an_area_is_shut(judge: Judge) -> None:
    found = judge(dict.fromkeys(SIDESTAY, 0.0003) | {3: 0.0148}, **FAILED, cannot_reach=LINKS)
    assert (found.next_action.action, found.next_action.joints) == (Action.RESTORE, (3,))
    assert found.plan.steps[1].action is Action.READ_PLUNGER


def test_a_joint_without_a_spare_is_not_restored(judge: Judge) -> None:
    found = judge(every_joint(0.001, j3=0.013), **FAILED, no_spare=(3,))
    assert 3 not in asked(found)
    assert "#3 is over the limit and cannot be restored today" in (found.plan.open_question or "")


def test_unread_joints_are_not_mentioned_before_the_plan_ends(judge: Judge) -> None:
    assert judge({3: 0.002}).plan.open_question is None


@pytest.mark.parametrize(
    "been",
    [
        {"outcome": Outcome.RETRACTED},
        {"restored_joints": (5,), "repair_date": datetime(2026, 3, 2, 9)},
        {
            "restored_joints": (5,),
            "repair_date": datetime(2026, 3, 2, 9),
            "outcome": Outcome.FAILED,
        },
    ],
)
def test_no_gear_is_done_while_a_joint_over_its_limit_waits_for_its_spare(judge, been):
    found = judge(every_joint(0.0005, j3=0.009), **been, no_spare=(3,), measured_again=(3,))
    assert found.next_action.text.startswith("Stop for today: #3 must be restored but cannot be.")
    assert found.plan.open_question == "#3 is over the limit and cannot be restored today."


def test_no_joint_is_read_where_the_one_that_explains_it_waits_for_its_spare(judge: Judge) -> None:
    read = dict.fromkeys(SIDESTAY, 0.0003) | {3: 0.0148}
    assert judge(read, **FAILED).next_action.action is Action.RESTORE
    waits = judge(read, **FAILED, no_spare=(3,))
    assert [step.action for step in waits.plan.steps] == [Action.CONTINUE]
    assert waits.next_action.text.startswith("Stop for today: #3 must be restored but cannot be.")
    assert "#3 is over the limit and cannot be restored today" in (waits.plan.open_question or "")


def test_joints_are_read_where_the_one_without_a_spare_does_not_explain_it(judge: Judge) -> None:
    read = {8: 0.0085} | dict.fromkeys((6, 7, 9, 10), 0.001)
    waits = judge(read, **FAILED, no_spare=(8,))
    assert waits.next_action.action is Action.MEASURE
    assert waits.next_action.joints == judge(read, **FAILED).next_action.joints


def test_a_reading_in_doubt_is_taken_again_before_the_day_ends_for_want_of_a_spare(judge):
    failed = {"outcome": Outcome.FAILED, "readings_in": (0.036,), "no_spare": (3,)}
    assert judge(every_joint(0.002, j3=0.009), **failed).next_action.action is Action.MEASURE_AGAIN


def test_what_has_a_spare_is_restored_today(judge: Judge) -> None:
    again = {"measured_again": (3, 9)}
    found = judge(every_joint(0.0005, j3=0.0145, j9=0.009), **FAILED, **again, no_spare=(9,))
    steps = [(step.action, step.joints) for step in found.plan.steps]
    assert steps == [(Action.RESTORE, (3,)), (Action.CONTINUE, ())]


def test_no_plunger_is_expected_to_be_read_while_a_joint_waits_for_its_spare(judge: Judge) -> None:
    read = {1: 0.0021, 3: 0.0026, 4: 0.0002, 5: 0.0045, 6: 0.011}
    read |= {7: 0.0037, 8: 0.0044, 9: 0.0007, 10: 0.0021}
    found = judge(read, outcome=Outcome.FAILED, readings_in=(0.0429,), no_spare=(6,))
    assert [(step.action, step.joints) for step in found.plan.steps] == [
        (Action.MEASURE, (2,)),
        (Action.RESTORE, (2,)),
        (Action.CONTINUE, ()),
    ]
    assert found.plan.steps[-1].text.startswith("Stop for today: #6 must be restored")


def test_a_stop_that_the_day_forces_is_called_one_in_brief(judge: Judge) -> None:
    found = judge(every_joint(0.002, j3=0.0148), **FAILED, no_spare=(3,))
    assert found.next_action.text.startswith("Stop for today")
    assert found.in_brief == "Stop for today: hand over what stays open"
