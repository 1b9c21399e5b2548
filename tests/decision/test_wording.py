"""A probability is never rounded to a certainty; a gear without a fault is not sent to look for
one.
"""

from __future__ import annotations

import pytest

from mlg_troubleshoot.decision.assessment import Verdict
from mlg_troubleshoot.decision.inspection import Outcome
from mlg_troubleshoot.decision.sentences import percent
from tests.decision.conftest import Judge, every_joint


@pytest.mark.parametrize(
    ("share", "written"),
    [
        (0.0, "0 %"),
        (1e-9, "< 0.1 %"),
        (0.0017, "0.2 %"),
        (0.0249, "2.5 %"),
        (0.2466, "25 %"),
        (0.9849, "98.5 %"),
        (0.9992, "> 99.9 %"),
        (0.99991, "> 99.9 %"),
        (1.0, "100 %"),
    ],
)
def test_a_probability_is_written_as_a_percentage_that_is_not_a_false_certainty(
    share: float, written: str
) -> None:
    assert percent(share) == written


def test_a_gear_that_retracted_with_every_joint_within_needs_no_further_action_on_the_joints(
    judge: Judge,
) -> None:
    found = judge(every_joint(0.0005), outcome=Outcome.RETRACTED)
    done = (
        "Joints are within limits. No further action on the joints; this is not a release to"
        " service."
    )
    assert (found.verdict, found.next_action.text) == (Verdict.WITHIN_MARGIN, done)


def test_the_headline_does_not_repeat_the_next_step(judge: Judge) -> None:
    found = judge(every_joint(0.0005), outcome=Outcome.RETRACTED)
    assert found.headline.endswith("Every joint was measured and is within its limit.")
    assert "No further action" not in found.headline


@pytest.mark.parametrize("more", [{}, {"outcome": Outcome.FAILED}])
def test_fault_isolation_goes_on_where_the_gear_did_not_retract(
    more: dict[str, Outcome], judge: Judge
) -> None:
    assert "No further action" not in judge(every_joint(0.0005), **more).next_action.text


def test_fault_isolation_goes_on_where_a_joint_was_not_read(judge: Judge) -> None:
    read = {number: value for number, value in every_joint(0.0005).items() if number != 10}
    assert "No further action" not in judge(read, outcome=Outcome.RETRACTED).next_action.text


def test_the_headline_of_a_repaired_gear_sends_nobody_to_fault_isolation(judge: Judge) -> None:
    plain, repaired = (
        judge(every_joint(0.0005), **more).headline for more in ({}, {"restored_joints": (3,)})
    )
    assert plain.endswith("Continue fault isolation; not a release.")
    assert repaired.endswith("Not a release.")
