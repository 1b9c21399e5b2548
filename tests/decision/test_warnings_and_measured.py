"""What is laid over every verdict: limits, a failure that clearances do not explain, a measured
plunger.
"""

from __future__ import annotations

import math

import pytest

from mlg_troubleshoot.decision.assessment import Verdict
from mlg_troubleshoot.decision.case import plunger_u
from mlg_troubleshoot.decision.inspection import EnteredClearance, Outcome, RiggingCheck
from mlg_troubleshoot.decision.plan import Action, Basis, End
from mlg_troubleshoot.decision.plunger_reading import disagreement
from mlg_troubleshoot.decision.ranking import Listed
from mlg_troubleshoot.units import ClearanceConvention, LengthUnit
from tests.decision.conftest import Judge, every_joint, inspected

NOT_EXPLAINED = (
    "Joint clearances do not explain this failure: check hydraulics, reversing valve, doors."
)


def said(warnings: tuple[str, ...], words: str) -> bool:
    return any(words in warning for warning in warnings)


def test_a_margin_larger_than_that_of_the_gear_file_is_said_with_both(judge: Judge) -> None:
    found = judge(every_joint(0.004), margin_in=0.15)
    assert said(
        found.warnings,
        "margin of 0.1500 in stated for this gear is larger than that of the gear file (0.0300 in)",
    )


@pytest.mark.parametrize("margin_in", [None, 0.028, 0.03, 0.762 / 25.4])
def test_a_margin_up_to_that_of_the_gear_file_is_taken_without_a_word(
    judge: Judge, margin_in: float | None
) -> None:
    assert not said(judge(every_joint(0.004), margin_in=margin_in).warnings, "margin of")


@pytest.mark.parametrize("base", [0.0, 0.002, 0.006])
def test_a_joint_above_its_limit_is_rejected_to_the_manual_whatever_the_verdict(
    judge: Judge, base: float
) -> None:
    found = judge(every_joint(base, j7=0.008))
    assert said(
        found.warnings, "#7 bellcrank input joint: 0.0080 in radial is above its limit of 0.0075 in"
    )
    assert said(found.warnings, "reject to the manual")
    assert 7 in found.next_action.joints


@pytest.mark.parametrize(("c3", "asked"), [(0.0075, True), (0.0074, False)])
def test_limits_in_place_of_readings_are_asked_about(judge: Judge, c3: float, asked: bool) -> None:
    found = judge(every_joint(0.0075, j3=c3))
    assert said(found.warnings, "limits were written in place of readings") is asked


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
def test_one_value_in_five_joints_or_more_is_asked_about(
    judge: Judge, clearances: dict[int, float], asked: bool
) -> None:
    said_so = "Every clearance is 0.0020 in, hardly a reading of each joint"
    assert said(judge(clearances).warnings, said_so) is asked


def test_the_limit_is_said_to_be_assumed(judge: Judge) -> None:
    assert said(judge(every_joint(0.0, j7=0.008)).warnings, "(assumed)")


def test_a_joint_above_its_limit_does_not_change_the_verdict(judge: Judge) -> None:
    assert judge(every_joint(0.0, j7=0.008)).verdict is Verdict.WITHIN_MARGIN


def test_a_joint_at_its_limit_is_not_above_it_even_if_read_in_millimetres(judge: Judge) -> None:
    found = judge(every_joint(0.0, j7=0.1905 / 25.4))
    assert not any(joint.over_limit for joint in found.joints)


@pytest.mark.parametrize("unit", [LengthUnit.INCH, LengthUnit.THOU, LengthUnit.MILLIMETRE])
def test_a_plunger_at_its_margin_is_not_beyond_it_in_any_unit(
    judge: Judge, unit: LengthUnit
) -> None:
    typed = {"in": 0.03, "thou": 30.0, "mm": 0.762}[unit.value]
    found = judge(every_joint(0.004), readings_in=(unit.to_inches(typed),))
    assert found.basis is Basis.PREDICTED


def test_a_failure_within_the_margin_is_not_explained_by_clearances(judge: Judge) -> None:
    found = judge(every_joint(0.001), outcome=Outcome.FAILED, readings_in=(0.002,))
    assert found.verdict is Verdict.WITHIN_MARGIN
    assert found.next_action.text == NOT_EXPLAINED
    assert "Joint clearances do not explain this failure" in found.headline


def test_a_failure_within_the_margin_is_not_explained_even_with_a_joint_above_its_limit(
    judge: Judge,
) -> None:
    assert judge(every_joint(0.001, j7=0.008), outcome=Outcome.FAILED).end is End.NOT_EXPLAINED


def test_a_failure_outside_the_margin_is_not_said_to_be_unexplained(judge: Judge) -> None:
    assert NOT_EXPLAINED not in judge({3: 0.013, 5: 0.007}, outcome=Outcome.FAILED).headline


def test_within_is_said_not_to_be_a_release(judge: Judge) -> None:
    assert "not a release" in judge(every_joint(0.001)).headline


def test_outside_is_said_as_could_and_never_as_will_with_both_numbers(judge: Judge) -> None:
    headline = judge(every_joint(0.0, j3=0.013, j5=0.007)).headline
    assert headline.startswith("Clearances could push the plunger outside its margin")
    assert "worst case 0.0472 in, chance with random directions 25 %" in headline
    assert "will" not in headline.split()


def test_incomplete_names_the_joints_that_are_not_measured(judge: Judge) -> None:
    headline = judge(dict.fromkeys((1, 2, 4, 5, 6, 7, 8, 9), 0.001)).headline
    assert headline.startswith("Cannot clear: not measured #3, #10 ")


def test_a_measured_displacement_within_the_margin_is_said_quietly(judge: Judge) -> None:
    statement = judge(every_joint(0.001), readings_in=(0.012,)).measured_statement
    assert (
        statement
        == "Measured: the plunger stands 0.0120 in beyond mid-position, within its margin of"
        " 0.0300 in."
    )


def test_without_a_reading_nothing_is_said_about_a_measurement(judge: Judge) -> None:
    assert judge(every_joint(0.001)).measured_statement is None


def test_the_measured_displacement_is_the_mean_of_the_readings(judge: Judge) -> None:
    assert judge(
        {}, readings_in=(0.01, 0.02, 0.06)
    ).inspection.measured_displacement_in == pytest.approx(0.03)


@pytest.mark.parametrize(
    ("apart", "flagged"), [(1.99, False), (2.01, True), (-1.99, False), (-2.01, True)]
)
def test_measured_and_predicted_differ_from_two_combined_standard_uncertainties_on(
    apart: float, flagged: bool
) -> None:
    u = math.hypot(0.004, 0.003)
    reading = inspected({}, readings_in=(0.02 + apart * u,), plunger_gauge_u_in=0.003)
    assert (disagreement(reading, 0.02, -0.02, 0.004) is not None) == flagged


def test_a_reading_inside_the_bounds_is_said_to_be_possible() -> None:
    text = disagreement(inspected({}, readings_in=(0.0,)), 0.05, -0.05, 0.004)
    assert text is not None
    assert "the clearances need not be taken up in the worst direction" in text


def test_a_reading_beyond_the_bounds_is_said_to_be_impossible_with_its_possible_causes() -> None:
    text = disagreement(inspected({}, readings_in=(0.09,)), 0.05, -0.05, 0.004)
    assert text is not None
    assert "beyond what the entered clearances can do in any direction" in text
    for cause in ("wrong unit or convention", "an unmeasured joint", "rigging", "plunger gauge"):
        assert cause in text


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
    factor: float, entry: dict[str, object], words: str, sense: float
) -> None:
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
    off: float, suggested: bool
) -> None:
    text = disagreement(inspected({}, readings_in=(0.02 * 10.0 * off,)), 0.02, -0.02, 0.001)
    assert text is not None
    assert ("a misplaced decimal point" in text) == suggested


@pytest.mark.parametrize("factor", [25.4, 10.0, 2.0])
def test_a_displacement_below_the_bound_suggests_no_entry_error(factor: float) -> None:
    text = disagreement(
        inspected({}, readings_in=(0.1 / factor,), **AS_TOTAL_PLAY), 0.1, -0.1, 0.001
    )
    assert text is not None
    assert "entry error" not in text


def test_a_suggested_slip_is_never_applied(judge: Judge) -> None:
    plain, read = judge(every_joint(0.001)), judge(every_joint(0.001), readings_in=(0.1321,))
    assert said(read.warnings, "decimal point")
    assert read.predicted_displacement_in == plain.predicted_displacement_in


@pytest.mark.parametrize(
    ("declared", "readings", "expected"),
    [(None, 1, 0.002), (None, 4, 0.001), (0.003, 4, 0.0015)],
)
def test_the_mean_of_repeat_readings_is_better_than_one(
    declared: float | None, readings: int, expected: float
) -> None:
    found = plunger_u(inspected({}, readings_in=(0.01,) * readings, plunger_gauge_u_in=declared))
    assert found == pytest.approx(expected)


def test_a_default_gauge_uncertainty_is_shown_as_a_default(judge: Judge) -> None:
    assert said(judge(every_joint(0.001), gauge_u_is_default=True).warnings, "taken as the default")
    assert not said(judge(every_joint(0.001)).warnings, "default")


@pytest.mark.parametrize(
    ("down_lock", "warned"), [(0.009, True), (0.01, False), (0.05, False), (0.051, True)]
)
def test_a_down_lock_position_outside_the_technical_order_is_a_matter_of_rigging(
    judge: Judge, down_lock: float, warned: bool
) -> None:
    assert (
        said(
            judge(every_joint(0.001), plunger_down_lock_in=down_lock).warnings, "check the rigging"
        )
        == warned
    )


def test_a_failed_gear_without_a_plunger_reading_is_asked_for_one(judge: Judge) -> None:
    asked = judge(every_joint(0.001), outcome=Outcome.FAILED)
    read = judge(every_joint(0.001), outcome=Outcome.FAILED, readings_in=(0.01,))
    assert asked.next_action.action is Action.READ_PLUNGER
    assert read.next_action.action is not Action.READ_PLUNGER


def test_what_the_reader_noticed_stays_with_the_judgement(judge: Judge) -> None:
    assert (
        judge(every_joint(0.001), warnings=("joint 3 above 0.015 in",)).warnings[0]
        == "joint 3 above 0.015 in"
    )


@pytest.mark.parametrize("readings", [(0.045, -0.045), (0.045, 0.001), (0.060, 0.001, 0.001)])
def test_of_plunger_readings_that_disagree_over_the_margin_the_worst_stands(
    judge: Judge, readings: tuple[float, ...]
) -> None:
    found = judge(every_joint(0.0012), readings_in=readings)
    assert (found.verdict, found.basis) == (Verdict.OUTSIDE_MARGIN, Basis.MEASURED)
    assert f"the plunger stands {max(readings):.4f} in beyond" in found.headline


@pytest.mark.parametrize(
    ("readings", "u_in"),
    [
        ((0.12, -0.12), 0.05),
        ((0.0899, 0.0, 0.0), 0.05),
        ((0.0899, 0.0, 0.0), None),
        ((0.0299,), 0.05),
        ((0.03,), 0.002),
        ((0.0305, 0.029), None),
    ],
)
def test_an_uncertainty_never_clears_what_a_reading_does_not(
    judge: Judge, readings: tuple[float, ...], u_in: float | None
) -> None:
    found = judge(every_joint(0.0003), readings_in=readings, plunger_gauge_u_in=u_in)
    assert found.verdict is not Verdict.WITHIN_MARGIN


def test_a_plunger_reading_that_may_be_beyond_its_margin_is_said_and_taken_again(
    judge: Judge,
) -> None:
    once = judge(every_joint(0.0003), readings_in=(0.029,))
    assert once.verdict is Verdict.INCONCLUSIVE
    assert "which two standard uncertainties of 0.0020 in bring beyond" in once.headline
    assert once.next_action.action is Action.READ_PLUNGER
    twice = judge(every_joint(0.0003), readings_in=(0.029, 0.029))
    assert (twice.next_action.action, twice.end) == (Action.CONTINUE, End.TOO_CLOSE)


def test_a_displacement_is_not_called_beyond_the_clearances_where_none_was_entered(
    judge: Judge,
) -> None:
    said = [" ".join(judge(read, readings_in=(0.036,)).warnings) for read in ({}, {3: 0.001})]
    assert ["what the entered clearances can do" in each for each in said] == [False, True]


@pytest.mark.parametrize("rigging", [None, RiggingCheck.YES])
def test_a_plunger_out_of_its_position_at_down_lock_needs_its_rigging_checked(
    judge: Judge, rigging: RiggingCheck | None
) -> None:
    found = judge(every_joint(0.0003), plunger_down_lock_in=0.2, rigging_checked=rigging)
    assert found.next_action.action is Action.CHECK_RIGGING
    assert not Listed.of(found).is_fine
