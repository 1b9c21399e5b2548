"""Words of steps and chances: no false certainty, and a verb for each subject."""

from __future__ import annotations

import pytest

from mlg_troubleshoot.decision.inspection import Outcome
from mlg_troubleshoot.decision.sentences import percent
from tests.decision.conftest import every_joint


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
def test_a_probability_is_written_as_a_percentage_that_is_not_a_false_certainty(share, written):
    assert percent(share) == written


@pytest.mark.parametrize(
    ("worn", "beginning"),
    [
        ({"j3": 0.0148}, "IF #3 is restored, THEN "),
        ({"j2": 0.0148, "j3": 0.0148}, "IF #2, #3 are restored, THEN "),
    ],
)
def test_what_follows_a_repair_is_a_sentence_for_one_joint_and_for_several(judge, worn, beginning):
    read = every_joint(0.0005, **worn)
    found = judge(read, advice=True, outcome=Outcome.RETRACTED)
    assert [each.text.startswith(beginning) for each in found.plan.then] == [True]
