"""What is laid over every verdict: limits, a failure that clearances do not explain, a measured
plunger.
"""

from __future__ import annotations

import pytest

from mlg_troubleshoot.decision.assessment import Action, Basis, End, Verdict
from mlg_troubleshoot.decision.inspection import EnteredClearance, Outcome, RiggingCheck
from mlg_troubleshoot.decision.judge_rows import Listed
from mlg_troubleshoot.decision.prediction import disagreement, plunger_u
from mlg_troubleshoot.units import ClearanceConvention, LengthUnit
from tests.decision.conftest import Judge, every_joint, inspected


def said(warnings: tuple[str, ...], words: str) -> bool:
    return any(words in warning for warning in warnings)


def test_a_margin_larger_than_that_of_the_gear_file_is_said_with_both(judge: Judge) -> None:
    found = judge(every_joint(0.004), margin_in=0.15)
    assert said(
        found.warnings,
        "margin of 0.1500 in stated for this gear is larger than that of the gear file (0.0300 in)",
    )


@pytest.mark.parametrize("margin_in", [None, 0.028, 0.03, 0.762 / 25.4])
def test_a_margin_up_to_that_of_the_gear_file_is_taken_without_a_word(judge, margin_in):
    assert not said(judge(every_joint(0.004), margin_in=margin_in).warnings, "margin of")


@pytest.mark.parametrize(("c3", "asked"), [(0.0075, True), (0.0074, False)])
def test_limits_in_place_of_readings_are_asked_about(judge: Judge, c3: float, asked: bool) -> None:
    found = judge(every_joint(0.0075, j3=c3))
    assert said(found.warnings, "limits written in place of readings") is asked


@pytest.mark.parametrize(
    ("clearances", "asked"),
    [
        (every_joint(0.002), True),
        (every_joint(0.002, j3=0.0025), False),
        (every_joint(0.0), False),
        (every_joint(0.0075), False),
        (dict.fromkeys(range(1, 6), 0.002), True),
        (dict.fromkeys(range(1, 5), 0.002), False),
    ],
)
def test_one_value_in_five_joints_or_more_is_asked_about(judge, clearances, asked):
    said_so = "Every clearance is 0.0020 in, hardly a reading of each joint"
    assert said(judge(clearances).warnings, said_so) is asked


@pytest.mark.parametrize("unit", [LengthUnit.INCH, LengthUnit.THOU, LengthUnit.MILLIMETRE])
def test_a_plunger_at_its_margin_is_not_beyond_it_in_any_unit(judge, unit):
    typed = {"in": 0.03, "thou": 30.0, "mm": 0.762}[unit.value]
    found = judge(every_joint(0.004), readings_in=(unit.to_inches(typed),))
    assert found.basis is Basis.PREDICTED


@pytest.mark.parametrize(
    ("clearances", "explained"),
    [(every_joint(0.001, j7=0.008), False), ({3: 0.013, 5: 0.007}, True)],
)
def test_a_failure_within_the_margin_is_not_explained_even_with_a_joint_above_its_limit(
    judge, clearances, explained
):
    found = judge(clearances, outcome=Outcome.FAILED)
    assert (found.end is End.NOT_EXPLAINED) is not explained
    told = [step.text for step in found.plan.steps]
    said = "IF the plunger reads within its margin, THEN check hydraulics"
    assert any(said in text for text in told) is not explained


def test_the_measured_displacement_is_the_mean_of_the_readings(judge: Judge) -> None:
    assert judge(
        {}, readings_in=(0.01, 0.02, 0.06)
    ).inspection.measured_displacement_in == pytest.approx(0.03)


IN_MILLIMETRES = {"entered": {3: EnteredClearance("0.005", LengthUnit.MILLIMETRE)}}
AS_TOTAL_PLAY = {"convention": ClearanceConvention.TOTAL_PLAY}


@pytest.mark.parametrize(
    ("factor", "entry", "words"),
    [
        (25.4, IN_MILLIMETRES, "inches read as millimetres (factor 25.4)"),
        (10.0, {}, "a misplaced decimal point (factor 10)"),
        (2.0, AS_TOTAL_PLAY, "a radial clearance read as diametral or total play (factor 2)"),
    ],
)
@pytest.mark.parametrize("sense", [1.0, -1.0])
def test_an_entry_error_that_made_the_clearances_too_small_is_suggested(
    factor, entry, words, sense
):
    text = disagreement(
        inspected({}, readings_in=(sense * 0.02 * factor,), **entry), 0.02, -0.02, 0.001
    )
    assert text is not None
    assert text.endswith(f"An entry error that would explain it: {words}.")


@pytest.mark.parametrize("factor", [25.4, 2.0])
def test_an_entry_error_that_this_entry_cannot_have_is_not_suggested(factor: float) -> None:
    text = disagreement(inspected({}, readings_in=(0.02 * factor,)), 0.02, -0.02, 0.001)
    assert text is not None
    assert "entry error" not in text


@pytest.mark.parametrize(
    ("off", "suggested"), [(0.96, True), (1.04, True), (0.9, False), (1.1, False)]
)
def test_an_entry_error_is_suggested_where_it_explains_the_displacement_to_a_twentieth(
    off, suggested
):
    text = disagreement(inspected({}, readings_in=(0.02 * 10.0 * off,)), 0.02, -0.02, 0.001)
    assert text is not None
    assert ("a misplaced decimal point" in text) == suggested


def test_a_suggested_slip_is_never_applied(judge: Judge) -> None:
    plain, read = judge(every_joint(0.001)), judge(every_joint(0.001), readings_in=(0.1321,))
    assert said(read.warnings, "decimal point")
    assert read.predicted_displacement_in == plain.predicted_displacement_in


@pytest.mark.parametrize(
    ("declared", "readings", "expected"), [(None, 1, 0.002), (None, 4, 0.001), (0.003, 4, 0.0015)]
)
def test_the_mean_of_repeat_readings_is_better_than_one(declared, readings, expected):
    found = plunger_u(inspected({}, readings_in=(0.01,) * readings, plunger_gauge_u_in=declared))
    assert found == pytest.approx(expected)


def test_a_default_gauge_uncertainty_is_shown_as_a_default(judge: Judge) -> None:
    assert said(judge(every_joint(0.001), gauge_u_is_default=True).warnings, "taken as the default")
    assert not said(judge(every_joint(0.001)).warnings, "default")


@pytest.mark.parametrize(
    ("down_lock", "warned"), [(0.009, True), (0.01, False), (0.05, False), (0.051, True)]
)
def test_a_down_lock_position_outside_the_technical_order_is_a_matter_of_rigging(
    judge, down_lock, warned
):
    assert (
        said(
            judge(every_joint(0.001), plunger_down_lock_in=down_lock).warnings, "check the rigging"
        )
        == warned
    )


@pytest.mark.parametrize(
    ("readings", "u_in"),
    [
        ((0.12, -0.12), 0.05),
        ((0.0899, 0.0, 0.0), 0.05),
        ((0.0899, 0.0, 0.0), None),
        ((0.0299,), 0.05),
        ((0.03,), 0.002),
        ((0.0305, 0.029), None),
        ((0.029, -0.029), None),
        ((0.0, 0.0, 0.028), None),
    ],
)
def test_an_uncertainty_never_clears_what_a_reading_does_not(judge, readings, u_in):
    found = judge(every_joint(0.0003), readings_in=readings, plunger_gauge_u_in=u_in)
    assert found.verdict is not Verdict.WITHIN_MARGIN


@pytest.mark.parametrize(("second_in", "differ"), [(-0.02, True), (0.014, True), (0.015, False)])
def test_plunger_readings_that_differ_are_said_and_the_farthest_counts(judge, second_in, differ):
    found = judge(every_joint(0.0003), readings_in=(0.02, second_in))
    assert bool(said(found.warnings, "the farthest counts")) is differ
    assert ("0.0200" in str(found.headline)) is differ


def test_a_displacement_is_not_called_beyond_the_clearances_where_none_was_entered(judge):
    said = [" ".join(judge(read, readings_in=(0.036,)).warnings) for read in ({}, {3: 0.001})]
    assert ["what the entered clearances can do" in each for each in said] == [False, True]


@pytest.mark.parametrize("rigging", [None, RiggingCheck.YES])
def test_a_plunger_out_of_its_position_at_down_lock_needs_its_rigging_checked(judge, rigging):
    found = judge(every_joint(0.0003), plunger_down_lock_in=0.2, rigging_checked=rigging)
    assert found.next_action.action is Action.CHECK_RIGGING
    assert not Listed.of(found).is_fine
