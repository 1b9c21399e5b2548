"""The words of each verdict, what colour they have, and what a gear without a complaint is told."""

from __future__ import annotations

import io
import re
from datetime import datetime
from typing import Any

import numpy as np
import pytest

from mlg_troubleshoot.cli.output import DataConsole
from mlg_troubleshoot.cli.views import one_gear
from mlg_troubleshoot.decision.assessment import (
    Action,
    Assessment,
    Basis,
    End,
    Verdict,
    VerdictTone,
)
from mlg_troubleshoot.decision.inspection import Inspection, Outcome, RiggingCheck
from mlg_troubleshoot.decision.judge_rows import Listed, assess
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.indices.index_table import IndexTable
from mlg_troubleshoot.units import LengthUnit, said_in
from tests.decision.conftest import Judge, Shifted, every_joint, inspected

RETRACTED, FAILED = {"outcome": Outcome.RETRACTED}, {"outcome": Outcome.FAILED}
RED, AMBER, GREEN = VerdictTone
THIRD = every_joint(0.0025)
PAPER = every_joint(0.0, j3=0.013, j5=0.007)


@pytest.mark.parametrize(
    ("read", "more", "headline", "tone"),
    [
        (THIRD, RETRACTED | {"readings_in": (0.046,)},
         "OUTSIDE MARGIN, MEASURED +46.0 of 30.0 thou.", RED),
        (THIRD, RETRACTED | {"readings_in": (0.008,)},
         "WITHIN MARGIN, MEASURED +8.0 of 30.0 thou. Worst directions could reach", GREEN),
        (PAPER, {}, "COULD BE OUTSIDE: worst case 47.2 of 30.0 thou, chance 25 %.", RED),
        (every_joint(0.004), {}, "COULD BE OUTSIDE: worst case 54", AMBER),
        ({3: 0.001}, {}, "NOT ENOUGH READ: #1, #2, #4, #5, #6, #7, #8, #9, #10 not", AMBER),
        (every_joint(0.001), {}, "WITHIN MARGIN, even in the worst directions: 13", GREEN),
        (every_joint(0.001), FAILED, "WITHIN MARGIN, even in the worst directions: 13", RED),
        (every_joint(0.002), {}, "CLOSE TO THE MARGIN: worst case 2", AMBER),
        (every_joint(0.05), {}, "COULD BE OUTSIDE: the linkage does not close", RED),
    ],
)  # fmt: skip
def test_each_verdict_has_its_words_and_its_colour(judge, read, more, headline, tone):
    found = judge(read, **more)
    assert said_in(found.headline, LengthUnit.THOU).startswith(headline)
    assert found.tone is tone


def test_a_gear_that_its_reading_clears_states_the_chance_by_which_it_is_cleared(judge: Judge):
    found = judge({3: 0.006, 5: 0.004}, readings_in=(0.01,))
    assert found.title == "WITHIN MARGIN, MEASURED"
    assert found.headline.endswith("in from the joints that were read, chance < 0.1 %.")
    assert found.probability_exceed_random_directions == 0.0


@pytest.mark.parametrize(
    ("more", "within"),
    [
        ({"readings_in": (0.0259,)}, True),
        ({"readings_in": (0.0261,)}, False),
        ({"readings_in": (0.01, 0.0301)}, False),
        ({"readings_in": (0.008,), "outcome": Outcome.FAILED}, False),
        ({"readings_in": (0.008,), "unit_question": "read in inches?"}, False),
        ({"readings_in": (0.008,), "plunger_down_lock_in": 0.2}, False),
        ({"readings_in": (0.008,), "outcome": Outcome.FAILED,
          "outcome_date": datetime(2026, 3, 2, 8), "plunger_date": datetime(2026, 3, 2, 9)}, True),
        ({"readings_in": (0.008,), "outcome": Outcome.FAILED,
          "outcome_date": datetime(2026, 3, 2, 9), "plunger_date": datetime(2026, 3, 2, 9)}, False),
        ({}, False),
    ],
)  # fmt: skip
def test_a_gear_is_within_by_a_reading_that_is_clear_and_newer_than_any_failure(
    judge, more, within
):
    found = judge(THIRD, **more)
    assert ((found.verdict, found.basis) == (Verdict.WITHIN_MARGIN, Basis.MEASURED)) is within


def test_a_gear_measured_within_that_may_leave_its_margin_in_other_directions_is_close(judge):
    found = judge(PAPER, readings_in=(0.008,), **RETRACTED)
    assert (found.verdict, found.basis) == (Verdict.INCONCLUSIVE, Basis.PREDICTED)
    assert found.probability_exceed_random_directions > 0.05


@pytest.mark.parametrize("outcome", [None, Outcome.RETRACTED])
@pytest.mark.parametrize("read", [{}, {3: 0.002}, THIRD, every_joint(0.004), every_joint(0.0075)])
def test_without_a_complaint_nothing_is_required_and_one_reading_ends_it(judge, read, outcome):
    asked = judge(read, outcome=outcome)
    assert (asked.next_action.action, asked.next_action.required) == (Action.READ_PLUNGER, False)
    assert asked.next_action.text == (
        "Nothing is required. To show that the gear is within its margin, read the plunger"
        " (12 min)."
    )
    within, beyond = (judge(read, outcome=outcome, readings_in=(y,)) for y in (0.008, 0.046))
    if within.verdict is Verdict.WITHIN_MARGIN:
        assert (within.next_action.action, within.end) == (Action.DONE, End.DONE)
    assert not within.next_action.required
    assert (beyond.next_action.action, beyond.end) == (Action.CONTINUE, End.OUTSIDE_NO_COMPLAINT)


def test_only_joints_over_their_limits_are_restored_without_a_complaint(judge: Judge) -> None:
    found = judge(every_joint(0.004, j7=0.0148), **RETRACTED)
    assert [(s.action, s.joints, s.required) for s in found.plan.steps] == [
        (Action.RESTORE, (7,), True),
        (Action.READ_PLUNGER, (), False),
        (Action.DONE, (), False),
    ]
    assert found.tone is RED
    assert not Listed.of(found).is_fine


@pytest.mark.parametrize(
    ("third", "more", "first"),
    [
        (0.0078, {}, Action.MEASURE_AGAIN),
        (0.0086, {}, Action.RESTORE),
        (0.0078, {"measured_again": (3,)}, Action.RESTORE),
        (0.0130, {"gauge_u_in": 0.004}, Action.RESTORE),
        (0.0074, {}, Action.READ_PLUNGER),
    ],
)
def test_a_joint_is_measured_again_only_near_its_limit_and_once(judge, third, more, first):
    found = judge(every_joint(0.003, j3=third), **RETRACTED, **more).next_action
    assert found.action is first
    assert ("with another gauge" in found.text) is (first is Action.MEASURE_AGAIN)


def test_the_joints_that_were_not_read_are_one_sentence_of_done(judge: Judge) -> None:
    read = dict.fromkeys(range(1, 6), 0.001)
    found = judge(read, readings_in=(0.003,), **RETRACTED)
    assert "Five joints were not read: read them if the manual asks for every limit." in (
        found.next_action.text
    )
    assert found.plan.open_question is None


def test_a_limit_that_is_assumed_is_said_to_be(judge: Judge) -> None:
    warnings = judge(every_joint(0.0, j7=0.00754)).warnings
    assert any(
        "0.00754 in radial is over its limit of 0.00750 in, an assumed limit: look up the"
        " manual's." in said
        for said in warnings
    )


def test_a_reading_is_flagged_only_where_no_direction_of_the_joints_explains_it(judge):
    inside, beyond = (judge(THIRD, readings_in=(y,)).warnings for y in (-0.02, 0.09))
    assert not any("beyond what the entered clearances" in said for said in inside)
    assert any("beyond what the entered clearances" in said for said in beyond)


@pytest.mark.parametrize("action", list(Action))
def test_each_action_that_is_work_says_how(judge: Judge, action: Action) -> None:
    cases = [
        judge({}, **FAILED),
        judge({}, readings_in=(0.04,), **FAILED),
        judge(every_joint(0.001), readings_in=(0.04,), **FAILED),
        judge(every_joint(0.001, j3=0.0148), **RETRACTED),
        judge(every_joint(0.001, j3=0.0078), **RETRACTED),
    ]
    steps = [step for found in cases for step in found.plan.steps if step.action is action]
    idle = (Action.CONTINUE, Action.DONE, Action.CORRECT)
    assert all(bool(step.how) is (action not in idle) for step in steps)
    assert steps or action in (Action.CORRECT,)


@pytest.mark.parametrize("approval", ["", "approved by J. Smith on 2026-03-02: trial 7"])
def test_only_an_approved_extension_relaxes_a_verdict(judge: Judge, approval: str) -> None:
    extension = Shifted(shift_in=0.0, residual_u_in=1e-5, approval=approval)
    found = judge(every_joint(0.0021), extension=extension, gauge_u_in=1e-4)
    assert judge(every_joint(0.0021), gauge_u_in=1e-4).verdict is Verdict.INCONCLUSIVE
    assert found.verdict is (Verdict.WITHIN_MARGIN if approval else Verdict.INCONCLUSIVE)
    assert ("With the extension, approved by J. Smith" in found.headline) is bool(approval)


def drawn_states(n: int, seed: int) -> list[Inspection]:
    """Gears in every state that a plan may meet."""
    rng = np.random.default_rng(seed)
    rows = []
    for k in range(n):
        wear = 0.0075 * rng.triangular(0.0, 0.0, 1.0, 10)
        if rng.random() < 0.5:
            wear[rng.integers(10)] *= rng.uniform(1.0, 4.0)
        read = rng.permutation(10)[: rng.choice([0, 2, 5, 10])]
        more: dict[str, Any] = {"outcome": rng.choice([None, *Outcome])}
        if rng.random() < 0.6:
            more["readings_in"] = tuple(rng.normal(0.0, 0.025, rng.integers(1, 3)).tolist())
        if rng.random() < 0.2:
            restored = tuple(int(j) + 1 for j in read[:2])
            more |= {"restored_joints": restored, "repair_date": datetime(2026, 3, 2, 8)}
            more |= {"plunger_date": datetime(2026, 3, 2, int(rng.integers(6, 11)))}
            more |= {"outcome_date": datetime(2026, 3, 2, int(rng.integers(6, 11)))}
        if rng.random() < 0.2:
            more["rigging_checked"] = list(RiggingCheck)[rng.integers(len(RiggingCheck))]
        if rng.random() < 0.1:
            more["no_spare"] = (int(rng.integers(1, 11)),)
        if rng.random() < 0.1:
            more["cannot_reach"] = (int(rng.integers(1, 11)),)
        clearances = {int(j) + 1: float(wear[j]) for j in read}
        rows.append(inspected(clearances, record_id=f"R{k}", **more))
    return rows


def judged(gear: Gear, table: IndexTable, n: int, *, advice: bool = False) -> list[Assessment]:
    found = assess(drawn_states(n, 60), gear, table, advice=advice)
    return [a for a in found if isinstance(a, Assessment)]


# Pairs of words that no screen may hold together.
CONTRADICTIONS = (
    (r"OUTSIDE MARGIN, MEASURED", r"WITHIN MARGIN|sign it off|Nothing is required"),
    (r"WITHIN MARGIN, MEASURED", r"COULD BE OUTSIDE|CLOSE TO THE MARGIN|engineering"),
    (r"Nothing is required", r"Over the limit|The gear FAILED|: Restore|Refer the gear"),
    (r"do not explain", r"[Jj]oint clearances (can )?explain|points to wear|likely worn"),
    (r"NEXT: Sign the repair", r"Over the limit|The gear FAILED|COULD BE|OUTSIDE"),
    (r"Probably no joint is beyond its limit", r"Over the limit"),
    (r"rigging was checked|rigging and lock roller were checked", r"NEXT[^:]*: Check rigging"),
    (r"not joint clearance, likely moved", r"NEXT[^:]*: Measure"),
    (r"perhaps|what the readings find", r""),
)


def screen(a: Assessment, gear: Gear) -> str:
    """Everything that one gear's screen says with all its details."""
    said = io.StringIO()
    one_gear.show(a, gear, DataConsole(file=said, width=110), detail=True)
    return " ".join(said.getvalue().split())


@pytest.mark.parametrize("n", [50, pytest.param(2000, marks=pytest.mark.slow)])
def test_no_two_sentences_of_one_screen_contradict_each_other(gear, table, n):
    for a in judged(gear, table, n, advice=True):
        text = screen(a, gear)
        for one, other in CONTRADICTIONS:
            assert not (re.search(one, text) and re.search(other, text)), text
        done = a.next_action.action is Action.DONE
        assert not done or (a.tone is GREEN), text
        assert Listed.of(a).is_fine <= (a.tone is GREEN)


@pytest.mark.parametrize("n", [200, pytest.param(2000, marks=pytest.mark.slow)])
def test_instructions_are_short_and_single(gear: Gear, table: IndexTable, n: int) -> None:
    for a in judged(gear, table, n):
        for step in a.plan.steps:
            for sentence in re.split(r"(?<=[.:?]) ", f"{step.text} {step.how}"):
                assert len(sentence.split()) <= 20, sentence
        for sentence in re.split(r"(?<=[.:?]) ", a.headline):
            assert len(sentence.split()) <= 25, sentence
