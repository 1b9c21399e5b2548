"""After a repair: what is older than it counts no more, and the plan comes to DONE."""

from __future__ import annotations

from datetime import date, datetime

import pytest

from mlg_troubleshoot.decision.assessment import Action, Basis, End, Verdict
from mlg_troubleshoot.decision.inspection import Outcome, RiggingCheck, surely_later
from tests.decision.conftest import Judge, every_joint

EARLY, MORNING, NOON = (datetime(2026, 3, 4, hour, 0) for hour in (7, 8, 12))
UTC_17, TOKYO_17 = map(datetime.fromisoformat, ("2026-03-05T17:00Z", "2026-03-05T17:30+09:00"))
REPAIRED = {
    "outcome": Outcome.FAILED,
    "readings_in": (0.041,),
    "restored_joints": (3, 5),
    "repair_date": MORNING,
}
RESTORED = every_joint(0.002, j3=0.0005, j5=0.0005)


def test_what_stands_beside_a_repair_is_older_and_the_plunger_is_read_next(judge: Judge) -> None:
    found = judge(RESTORED, **REPAIRED)
    assert [step.action for step in found.plan.steps] == [
        Action.READ_PLUNGER,
        Action.RETRACT,
        Action.DONE,
    ]


def test_an_old_reading_is_no_longer_the_measured_displacement(judge: Judge) -> None:
    found = judge(RESTORED, **REPAIRED | {"plunger_date": EARLY})
    assert found.inspection.measured_displacement_in is None


def test_a_reading_beyond_the_margin_that_may_be_newer_stands_and_is_taken_again(judge):
    found = judge(RESTORED, **REPAIRED)
    assert (found.verdict, found.basis) == (Verdict.OUTSIDE_MARGIN, Basis.MEASURED)
    assert found.next_action.action is Action.READ_PLUNGER


def test_a_reading_within_the_margin_that_may_be_older_excuses_nothing(judge: Judge) -> None:
    found = judge(RESTORED, **REPAIRED | {"readings_in": (0.002,)})
    assert found.next_action.action is Action.READ_PLUNGER


@pytest.mark.parametrize("outcome", [None, Outcome.RETRACTED, Outcome.FAILED])
def test_a_plunger_beyond_its_margin_after_the_repair_is_never_signed_off(judge, outcome):
    after = {"readings_in": (0.06,), "plunger_date": NOON}
    tried = {"outcome": outcome, "outcome_date": NOON}
    steps = judge(RESTORED, **REPAIRED | after | tried).plan.steps
    first = (Action.READ_PLUNGER, Action.CHECK_RIGGING, Action.MEASURE, Action.RESTORE)
    assert steps[0].action in first


def test_a_plunger_beyond_its_margin_before_the_repair_is_read_again_without_a_failure(judge):
    found = judge(RESTORED, **REPAIRED | {"outcome": None, "plunger_date": EARLY})
    assert [step.action for step in found.plan.steps][:2] == [Action.READ_PLUNGER, Action.RETRACT]


def test_a_plunger_read_within_its_margin_after_the_repair_leads_to_the_retraction(judge):
    found = judge(RESTORED, **REPAIRED | {"readings_in": (0.002,), "plunger_date": NOON})
    assert found.next_action.action is Action.RETRACT


def test_a_gear_that_fails_again_after_the_repair_with_its_plunger_within_has_another_cause(judge):
    again = {"outcome_date": NOON, "readings_in": (0.002,), "plunger_date": NOON}
    assert judge(RESTORED, **REPAIRED | again).end is End.NOT_EXPLAINED


def test_a_failure_that_may_be_older_than_the_repair_is_asked_about(judge: Judge) -> None:
    found = judge(RESTORED, **REPAIRED)
    assert any("FAILED may be older or newer than the repair" in w for w in found.warnings)
    assert found.headline.endswith("The gear FAILED.")


@pytest.mark.parametrize(
    ("one", "other", "later"),
    [
        (NOON, MORNING, True),
        (MORNING, NOON, False),
        (date(2026, 3, 5), MORNING, True),
        (date(2026, 3, 4), MORNING, False),
        (NOON, None, False),
        (UTC_17, TOKYO_17, True),
        (TOKYO_17, UTC_17, False),
        (datetime(2026, 3, 6, 20), TOKYO_17, True),
        (datetime(2026, 3, 5, 22), TOKYO_17, False),
    ],
)
def test_one_day_is_later_only_with_both_times_and_zones_count(one, other, later):
    assert surely_later(one, other) is later


def test_a_rigging_set_right_counts_as_a_repair(judge: Judge) -> None:
    right = {"rigging_checked": RiggingCheck.CORRECTED, "repair_date": MORNING}
    found = judge(every_joint(0.002), outcome=Outcome.FAILED, readings_in=(0.06,), **right)
    assert found.next_action.action is Action.READ_PLUNGER


def test_a_blank_outcome_is_not_a_complaint(judge: Judge) -> None:
    found = judge(every_joint(0.0003, j10=0.0148))
    assert [(s.action, s.joints) for s in found.plan.steps] == [
        (Action.RESTORE, (10,)),
        (Action.DONE, ()),
    ]


def test_a_rigging_that_was_looked_at_is_not_checked_again(judge: Judge) -> None:
    found = judge(
        every_joint(0.002),
        outcome=Outcome.FAILED,
        readings_in=(0.085,),
        rigging_checked=RiggingCheck.YES,
    )
    assert [step.action for step in found.plan.steps] == [Action.CONTINUE]


def test_sound_joints_are_not_restored_while_the_rigging_is_likelier(judge: Judge) -> None:
    found = judge(every_joint(0.003), outcome=Outcome.FAILED, readings_in=(0.036,))
    assert found.next_action.action is Action.CHECK_RIGGING


def test_a_plunger_at_the_edge_of_its_margin_is_read_again_once(judge: Judge) -> None:
    once = judge({}, outcome=Outcome.FAILED, readings_in=(0.0305,))
    twice = judge({}, outcome=Outcome.FAILED, readings_in=(0.0305, 0.0305))
    assert once.next_action.action is Action.READ_PLUNGER
    assert twice.next_action.action is Action.MEASURE


def test_a_repair_is_to_be_tried_where_fewer_joints_likely_hold(judge: Judge) -> None:
    found = judge(every_joint(0.003, j3=0.014), outcome=Outcome.FAILED, readings_in=(0.036,))
    sets = {s.kind: s for s in found.repair_sets or ()}
    assert found.next_action.joints == sets["try"].joints == (3,)
    assert len(sets["sure"].joints) > 1
    assert (sets["try"].second_repair_probability or 0.0) <= 0.02


def test_a_default_plunger_uncertainty_is_announced(judge: Judge) -> None:
    default = judge(every_joint(0.001), readings_in=(0.01,)).warnings
    stated = judge(every_joint(0.001), readings_in=(0.01,), plunger_gauge_u_in=0.001).warnings
    words = "plunger reading not stated: 0.0020 in"
    assert any(words in w for w in default)
    assert not any(words in w for w in stated)
