"""The course of the questions: what is asked, what each key does, what is refused."""

from __future__ import annotations

import re
from dataclasses import replace

import pytest

from mlg_troubleshoot.cli.output import to_ascii
from mlg_troubleshoot.cli.prompts import Answers, Session, SessionStore, ask_inspection
from mlg_troubleshoot.cli.prompts.answers import judge, plunger_in
from mlg_troubleshoot.cli.prompts.conversation import Effect, Turn, answer
from mlg_troubleshoot.cli.prompts.flow import Ask, Flow, State
from mlg_troubleshoot.cli.prompts.sketch import sketch
from mlg_troubleshoot.decision.columns import PLUNGER_DISPLACEMENT
from mlg_troubleshoot.decision.inspection import Outcome, RiggingCheck, Side
from mlg_troubleshoot.errors import UsageError
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.geometry.mechanism import Lever, Output, Step
from mlg_troubleshoot.units import ClearanceConvention, LengthUnit
from tests.prompts.scripted import (
    ENTERS,
    NOON,
    NOTHING,
    PLAY_INCHES,
    PLAY_MM,
    RADIAL_INCHES,
    ScriptedTerminal,
    inspect,
    play,
    said,
    shown,
    text_of,
)

TEN = [".004"] * 10


def test_the_tenth_joint_costs_as_many_judgements_as_the_first(
    flow: Flow, monkeypatch: pytest.MonkeyPatch
) -> None:
    calls = []
    name = "mlg_troubleshoot.cli.prompts.flow.judge"
    monkeypatch.setattr(name, lambda *given: calls.append(given) or judge(*given))
    turn, counts = flow.begin(RADIAL_INCHES), []
    for _ in range(10):
        calls.clear()
        turn = answer(flow, turn.state, ".004")
        counts.append(len(calls))
    assert counts == [1] * 10


# The heading.


def test_tail_side_unit_and_convention_are_asked_in_this_order(flow: Flow) -> None:
    asked = [play(flow, ["N1", "l", "i", "r"][:n], Answers()).state.ask for n in range(5)]
    assert asked == [Ask.TAIL, Ask.SIDE, Ask.UNIT, Ask.CONVENTION, Ask.JOINT]


@pytest.mark.parametrize("place", range(4))
def test_no_question_of_the_heading_has_a_default(flow: Flow, place: int) -> None:
    before = play(flow, ["N1", "l", "i", "r"][:place], Answers())
    after = answer(flow, before.state, "")
    assert after.state == before.state
    assert "Enter alone is not an answer" in said(after)


@pytest.mark.parametrize(
    ("typed", "side"),
    [
        ("l", Side.LH),
        ("R", Side.RH),
        ("lh", Side.LH),
        ("right", Side.RH),
        ("port", Side.LH),
        ("L/H", Side.LH),
    ],
)
def test_a_side_is_one_key_or_its_name(flow: Flow, typed: str, side: Side) -> None:
    assert play(flow, ["N1", typed], Answers()).state.answers.side is side


@pytest.mark.parametrize(
    ("typed", "unit"), [("i", "in"), ("t", "thou"), ("m", "mm"), ("mm", "mm"), ("inch", "in")]
)
def test_a_unit_is_one_key_or_its_name(flow: Flow, typed: str, unit: str) -> None:
    assert play(flow, ["N1", "l", typed], Answers()).state.answers.unit == unit


@pytest.mark.parametrize(
    ("typed", "convention"),
    [("r", "RADIAL"), ("d", "DIAMETRAL"), ("t", "TOTAL_PLAY"), ("total play", "TOTAL_PLAY")],
)
def test_a_convention_is_one_key_or_its_name(flow: Flow, typed: str, convention: str) -> None:
    assert play(flow, ["N1", "l", "i", typed], Answers()).state.answers.convention == convention


@pytest.mark.parametrize("typed", ["x", "both", "1"])
def test_anything_else_is_not_a_side(flow: Flow, typed: str) -> None:
    turn = play(flow, ["N1", typed], Answers())
    assert (turn.state.ask, turn.state.answers.side) == (Ask.SIDE, None)


def test_the_question_for_the_convention_warns_of_the_factor_two(flow: Flow) -> None:
    text = shown(flow, play(flow, ["N1", "l", "i"], Answers()).state)
    assert "DIAMETRAL and TOTAL PLAY are twice RADIAL." in text


def test_a_tail_number_stays_as_it_was_typed(flow: Flow) -> None:
    assert play(flow, ["  007 "], Answers()).state.answers.tail_no == "007"


@pytest.mark.parametrize("typed", ["n/a", "unknown", "--"])
def test_a_word_in_place_of_a_tail_number_is_asked_again(flow: Flow, typed: str) -> None:
    turn = play(flow, [typed], Answers())
    assert (turn.state.ask, turn.state.answers.tail_no) == (Ask.TAIL, None)
    assert "Type the tail number" in said(turn)


@pytest.mark.parametrize("missing", ["tail_no", "side", "unit", "convention"])
def test_what_a_flag_gave_is_not_asked(flow: Flow, missing: str) -> None:
    asked = flow.begin(replace(RADIAL_INCHES, **{missing: None})).state.ask
    names = {"tail_no": Ask.TAIL, "side": Ask.SIDE, "unit": Ask.UNIT, "convention": Ask.CONVENTION}
    assert asked is names[missing]


def test_back_reaches_what_a_flag_gave_and_enter_keeps_it(flow: Flow) -> None:
    turn = play(flow, ["b", "b", "b", "b"])
    assert "(Enter keeps N123AB)" in shown(flow, turn.state)
    kept = answer(flow, turn.state, "").state
    assert (kept.ask, kept.at, kept.answers) == (Ask.JOINT, 1, RADIAL_INCHES)


# Joint by joint.


def test_the_critical_joints_are_asked_first(gear: Gear) -> None:
    one_critical = [replace(joint, critical=joint.number == 8) for joint in gear.joints]
    assert Flow(replace(gear, joints=tuple(one_critical))).order == (8, 1, 2, 3, 4, 5, 6, 7, 9, 10)


def test_a_joint_is_asked_with_number_name_place_and_progress(flow: Flow) -> None:
    text = shown(flow, play(flow, [".004", ".004"]).state)
    assert "joint 3 of 10 · ■■□□□□□□□□" in text
    assert "#3  SHORT LINK INNER BEARING" in text
    assert "end of the short link at the release lever" in text
    assert "[3]" in text


def test_the_limit_is_shown_as_it_would_be_read(flow: Flow) -> None:
    text = shown(flow, flow.begin(PLAY_INCHES).state)
    assert "Limit 0.0150 in = 0.381 mm total play (0.0075 in radial)" in text


def test_the_limit_leads_with_the_chosen_unit(flow: Flow) -> None:
    assert "Limit 0.381 mm total play (0.190 mm radial)" in shown(flow, flow.begin(PLAY_MM).state)


@pytest.mark.parametrize(
    ("typed", "radial_in"),
    [
        (".013", 0.013),
        ("0.013 in", 0.013),
        ("13 thou", 0.013),
        ("0.33 mm", 0.33 / 25.4),
        ('.013"', 0.013),
        ("0", 0.0),
    ],
)
def test_numbers_are_read_as_people_write_them(flow: Flow, typed: str, radial_in: float) -> None:
    assert play(flow, [typed]).state.answers.radial_in == {1: pytest.approx(radial_in, abs=1e-15)}


def test_a_unit_in_the_text_wins_over_the_chosen_one(flow: Flow) -> None:
    assert play(flow, ["13 thou"], PLAY_MM).state.answers.radial_in == {1: pytest.approx(0.0065)}


def test_total_play_is_halved_for_the_model(flow: Flow) -> None:
    assert play(flow, [".026"], PLAY_INCHES).state.answers.radial_in == {1: pytest.approx(0.013)}


def test_a_value_is_echoed_as_read_and_as_radial_in_both_units(flow: Flow) -> None:
    told = said(play(flow, [".010"], PLAY_INCHES))
    assert "✓ #1  0.0100 in = 0.254 mm total play → 0.0050 in = 0.127 mm radial" in told


def test_a_radial_value_is_echoed_once(flow: Flow) -> None:
    assert said(play(flow, [".005"])) == " ✓ #1  0.0050 in = 0.127 mm radial"


def test_a_value_over_the_limit_is_said_to_be_so(flow: Flow) -> None:
    assert "OVER THE LIMIT of 0.0075 in radial" in said(play(flow, [".008"]))


def test_a_value_on_the_limit_is_not_over_it(flow: Flow) -> None:
    assert "OVER" not in said(play(flow, [".015"], PLAY_INCHES))


def test_enter_alone_enters_nothing_and_offers_s(flow: Flow) -> None:
    turn = play(flow, [""])
    assert turn.state.answers.joints == {}
    assert (
        said(turn).strip()
        == "Enter alone is not an answer. Type the clearance, or s if it was not measured."
    )


def test_s_leaves_a_joint_unmeasured(flow: Flow) -> None:
    turn = play(flow, ["s"])
    assert (turn.state.joint, turn.state.answers.radial_in) == (2, {})
    assert "not measured" in said(turn)


def test_a_decimal_comma_is_refused_with_the_suggestion(flow: Flow) -> None:
    turn = play(flow, ["0,013"])
    assert turn.state.answers.joints == {}
    assert "enter 0.013" in said(turn)


@pytest.mark.parametrize(
    "typed", ["abc", "1/8", "-.002", "−0.002", ".013 cm", "nan", "1e999", ".0 13", "y", "n"]
)
def test_what_is_not_a_clearance_is_not_taken(flow: Flow, typed: str) -> None:
    turn = play(flow, [typed])
    assert (turn.state.ask, turn.state.answers.joints) == (Ask.JOINT, {})


def test_an_arrow_key_does_not_change_a_number_in_silence(flow: Flow) -> None:
    turn = play(flow, ["0.13\x1b[D0"])
    assert turn.state.answers.joints == {}
    assert "(an arrow?)" in said(turn)


def test_b_goes_back_and_enter_keeps_and_goes_on_where_it_was(flow: Flow) -> None:
    back = play(flow, [".004", ".005", "b", "b"])
    assert back.state.joint == 1
    assert "(Enter keeps .004 in)" in shown(flow, back.state)
    kept = answer(flow, back.state, "")
    assert (kept.state.joint, kept.state.answers.radial_in[1]) == (3, 0.004)


def test_a_new_value_replaces_the_old_one(flow: Flow) -> None:
    assert play(flow, [".004", "b", ".006"]).state.answers.radial_in == {1: 0.006}


def test_enter_keeps_a_joint_that_was_not_measured(flow: Flow) -> None:
    assert play(flow, ["s", "b", ""]).state.joint == 2


def test_a_number_sign_goes_to_any_joint(flow: Flow) -> None:
    assert play(flow, ["#7", ".002"]).state.answers.radial_in == {7: 0.002}


def test_after_a_joint_out_of_turn_the_first_open_one_is_asked(flow: Flow) -> None:
    assert play(flow, [".004", "#7", ".002"]).state.joint == 2


def test_joint_eleven_is_refused(flow: Flow) -> None:
    assert "There is no joint #11" in said(play(flow, ["#11"]))


def test_done_leaves_the_remaining_joints_unmeasured(flow: Flow) -> None:
    turn = play(flow, [".004", ".005", "done"])
    assert turn.state.ask is Ask.MORE
    assert turn.state.answers.radial_in == {1: 0.004, 2: 0.005}
    assert "#3, #4, #5, #6, #7, #8, #9, #10  not measured" in said(turn)


def test_help_says_what_where_and_how(flow: Flow) -> None:
    told = said(play(flow, ["?"], PLAY_INCHES))
    assert "#1 actuator rod end" in told
    assert "Where: rod end of the retraction actuator" in told
    assert "dial indicator" in told


def test_help_names_the_joint_that_acts_alike(flow: Flow) -> None:
    assert "Moves the plunger like #5" in said(play(flow, ["#3", "?"]))


def test_help_at_the_rigging_says_what_each_answer_means(flow: Flow) -> None:
    told = said(answer(flow, State(Ask.STEP, Answers(), "rigging_checked"), "?"))
    assert "g yes: rigging and lock roller were checked and are right" in told
    assert "g corrected: one of them was set right" in told


@pytest.mark.parametrize("place", range(4))
def test_help_keeps_the_question_of_the_heading(flow: Flow, place: int) -> None:
    before = play(flow, ["N1", "l", "i", "r"][:place], Answers())
    turn = answer(flow, before.state, "?")
    assert turn.state == before.state
    assert turn.lines


@pytest.mark.parametrize("place", range(0, 20, 2))
def test_q_stops_at_every_question(flow: Flow, place: int) -> None:
    typed = ["N1", "l", "i", "r", *TEN, *ENTERS][:place]
    assert play(flow, [*typed, "q"], Answers()).effect is Effect.STOP


@pytest.mark.parametrize("place", range(1, 20))
def test_b_leads_to_the_question_before(flow: Flow, place: int) -> None:
    typed = ["N1", "l", "i", "r", *TEN, *ENTERS]
    before, at = (play(flow, typed[:n], Answers()).state for n in (place - 1, place))
    back = answer(flow, at, "b").state
    assert (back.ask, back.at) == (before.ask, before.at)


def test_b_after_a_confirmation_leads_to_the_question_before_in_one_key(flow: Flow) -> None:
    confirmed = play(flow, [*TEN, "p -.3", "y"])
    assert answer(flow, confirmed.state, "b").state.ask is Ask.JOINT


# Values that cannot or can hardly be.


def test_a_value_far_beyond_the_limit_is_asked_again(flow: Flow) -> None:
    turn = play(flow, [".041"], PLAY_INCHES)
    assert turn.state.ask is Ask.CONFIRM
    assert "yes, it is really 0.0410 in = 1.041 mm total play" in shown(flow, turn.state)


def test_a_value_that_need_not_be_confirmed_is_taken_at_once(flow: Flow) -> None:
    assert play(flow, [".015"]).state.answers.radial_in == {1: 0.015}


@pytest.mark.parametrize("confirmation", ["y", "YES", ".0205", "20.5 thou"])
def test_y_or_the_same_value_confirms(flow: Flow, confirmation: str) -> None:
    assert play(flow, [".0205", confirmation]).state.answers.radial_in == {1: pytest.approx(0.0205)}


def test_enter_does_not_confirm(flow: Flow) -> None:
    turn = play(flow, [".0205", ""])
    assert (turn.state.ask, turn.state.answers.joints) == (Ask.CONFIRM, {})


@pytest.mark.parametrize("typed", ["n", "b"])
def test_a_value_that_is_not_confirmed_is_not_taken(flow: Flow, typed: str) -> None:
    turn = play(flow, [".0205", typed])
    assert (turn.state.ask, turn.state.joint, turn.state.answers.joints) == (Ask.JOINT, 1, {})


def test_another_value_replaces_the_one_to_confirm(flow: Flow) -> None:
    assert play(flow, [".0205", ".00205"]).state.answers.radial_in == {1: 0.00205}


def test_another_large_value_is_also_asked_again(flow: Flow) -> None:
    assert play(flow, [".0205", ".0305"]).state.ask is Ask.CONFIRM


def test_a_value_beyond_the_hard_limit_is_refused(flow: Flow) -> None:
    turn = play(flow, [".051"])
    assert (turn.state.ask, turn.state.answers.joints) == (Ask.JOINT, {})
    assert "a clearance from 0 to 0.05 in" in said(turn)


def test_a_value_on_the_hard_limit_is_asked_again_and_not_refused(flow: Flow) -> None:
    assert play(flow, [".05"]).state.ask is Ask.CONFIRM


def test_a_refused_value_cannot_be_confirmed(flow: Flow) -> None:
    assert play(flow, [".051", "y"]).state.answers.joints == {}


@pytest.mark.parametrize(
    ("typed", "suggestion"),
    [
        (".33", "0.33 mm would be 0.01299 in"),
        ("13", "13 thou would be 0.013 in"),
        (".026", "total play (factor 2)"),
        (".13 in", "Is the decimal point misplaced (factor 10)? It would be 0.013 in"),
    ],
)
def test_a_likely_slip_is_suggested(flow: Flow, typed: str, suggestion: str) -> None:
    turn = play(flow, [typed])
    assert suggestion in said(turn) + shown(flow, turn.state)


def test_a_suggestion_is_never_applied(flow: Flow) -> None:
    assert play(flow, [".33"]).state.answers.joints == {}


def test_half_is_not_suggested_for_a_reading_that_is_halved_anyway(flow: Flow) -> None:
    assert "factor 2)" not in shown(flow, play(flow, [".04"], PLAY_INCHES).state)


# A unit or a convention changed afterwards.


def test_a_changed_convention_reads_the_same_numbers_anew(flow: Flow) -> None:
    turn = play(flow, [".004", "b", "b", "d"])
    assert turn.state.answers.radial_in == {1: 0.002}
    assert "now read as diametral" in said(turn)


def test_a_value_that_a_changed_convention_makes_unusual_is_asked_again(flow: Flow) -> None:
    turn = play(flow, [".020", "b", "b", "r"], PLAY_INCHES)
    assert (turn.state.joint, turn.state.answers.joints) == (1, {})
    assert "asked again" in said(turn)


def test_a_confirmed_value_that_doubles_with_the_convention_is_asked_again(flow: Flow) -> None:
    turn = play(flow, [".041", "y", "b", "b", "r"], PLAY_INCHES)
    assert (turn.state.joint, turn.state.answers.joints) == (1, {})


def test_a_changed_unit_asks_what_the_typed_numbers_were(flow: Flow) -> None:
    assert (
        play(
            flow, ["4", "b", "b", "b", "i"], replace(RADIAL_INCHES, unit=LengthUnit.THOU)
        ).state.ask
        is Ask.CONFIRM
    )


def test_typed_numbers_can_keep_their_unit(flow: Flow) -> None:
    typed = [".1", "b", "b", "b", "i", "n", ".004"]
    radial = play(
        flow, typed, replace(RADIAL_INCHES, unit=LengthUnit.MILLIMETRE)
    ).state.answers.radial_in
    assert radial == {1: pytest.approx(0.1 / 25.4), 2: 0.004}


def test_typed_numbers_can_be_read_in_the_new_unit(flow: Flow) -> None:
    typed = [".010", "b", "b", "b", "i", "y"]
    radial = play(
        flow, typed, replace(RADIAL_INCHES, unit=LengthUnit.MILLIMETRE)
    ).state.answers.radial_in
    assert radial == {1: 0.010}


def test_a_number_with_its_own_unit_does_not_raise_the_question(flow: Flow) -> None:
    assert play(flow, ["4 thou", "b", "b", "b", "m"]).state.ask is Ask.JOINT


@pytest.mark.parametrize("tail_no", ["", "  ", "N1\x1b[31m"])
def test_a_tail_number_from_a_flag_must_be_readable(
    gear: Gear, store: SessionStore, tail_no: str
) -> None:
    with pytest.raises(UsageError, match="tail"):
        inspect(gear, store, [], replace(RADIAL_INCHES, tail_no=tail_no))


# The sign-off page.


def test_order_date_landings_technician_and_gauge_are_asked_once_and_reach_the_inspection(
    gear: Gear, store: SessionStore
) -> None:
    typed = ["N1", "l", "i", "r", *TEN, "", "WO-7", "2026-03-01", "2100", "A. Smith", "G-03", ""]
    found = inspect(gear, store, typed)
    assert (found.technician_id, found.carried["work_order"], found.gauge_id) == (
        "A. Smith",
        "WO-7",
        "G-03",
    )
    assert (str(found.inspection_date), found.gear_landings) == ("2026-03-01", 2100.0)


def test_a_date_that_is_not_valid_is_asked_again(flow: Flow) -> None:
    turn = play(flow, [*TEN, "", "", "some day"])
    assert (turn.state.ask, turn.state.at) == (Ask.DETAIL, "inspection_date")
    assert "is not accepted" in said(turn)


def test_a_line_of_the_sign_off_page_is_changed_from_the_review(flow: Flow) -> None:
    turn = play(flow, [*TEN, "", "", "", "", "A. Smith", "", "name", "B. Jones"])
    assert (turn.state.ask, turn.state.answers.more["technician_id"]) == (Ask.REVIEW, "B. Jones")


# Advice.


def test_enter_goes_to_the_joint_that_was_suggested(gear: Gear) -> None:
    flow = Flow(gear, advice=lambda _measured, _left: ("Worth most next.", 5))
    turn = play(flow, [".004"])
    assert "(Enter goes to #5)" in shown(flow, turn.state)
    assert answer(flow, turn.state, "").state.at == 5


def test_b_after_a_jump_leads_back_to_where_one_came_from(flow: Flow) -> None:
    jumped = play(flow, [".004", "#7"])
    assert answer(flow, jumped.state, "b").state.at == 2
    answered = answer(flow, jumped.state, ".002")
    assert answer(flow, answered.state, "b").state.at == 7


def test_advice_is_shown_after_a_critical_joint(gear: Gear) -> None:
    flow = Flow(
        gear, advice=lambda measured, left: (f"Measure #{left[-1]} next: {measured}.", left[-1])
    )
    assert "→ Measure #10 next: {1: 0.004}." in said(play(flow, [".004"]))


def test_no_advice_is_asked_for_after_a_minor_joint(gear: Gear) -> None:
    flow = Flow(gear, advice=lambda _measured, _left: ("Stop.", None))
    assert "Stop." not in said(play(flow, ["#6", ".004"]))


def test_no_advice_is_asked_for_when_no_joint_is_left(gear: Gear) -> None:
    flow = Flow(gear, advice=lambda _measured, _left: ("Stop.", None))
    minor = [text for number in range(6, 11) for text in (f"#{number}", ".004")]
    assert "Stop." not in said(play(flow, [*minor, *[".004"] * 5]))


@pytest.mark.parametrize(("width", "told"), [(80, True), (60, False)])
def test_what_was_typed_stands_where_the_screen_has_room_for_it(
    flow: Flow, width: int, told: bool
) -> None:
    page = text_of(flow.page(play(flow, [*TEN, *ENTERS]).state, width).lines)
    assert ("typed" in page, "short link outer bearing" in page) == (told, True)


# The optional answers.


def test_enter_alone_skips_the_optional_answers(flow: Flow) -> None:
    assert play(flow, [*TEN, *ENTERS]).state.ask is Ask.REVIEW


def test_the_optional_answers_fit_on_one_line(flow: Flow) -> None:
    answers = play(flow, [*TEN, "f p -.041 m .028"]).state.answers
    assert answers.more == {
        "outcome": "FAILED",
        "plunger_displacement": "-.041 in",
        "margin": ".028 in",
    }


@pytest.mark.parametrize(
    ("typed", "stands_in"),
    [
        ("p .041", 0.041),
        ("p +.041", 0.041),
        ("p −41 thou", -0.041),
        ("p ‐.041", -0.041),
        ("p －.041", -0.041),
        ("p=1mm", 1 / 25.4),
        ("plunger 0.1", 0.1),
    ],
)
def test_the_plunger_displacement_is_signed(
    gear: Gear, flow: Flow, typed: str, stands_in: float
) -> None:
    assert plunger_in(play(flow, [*TEN, typed]).state.answers, gear) == pytest.approx(stands_in)


def test_two_plunger_readings_on_one_line_both_count(gear: Gear, flow: Flow) -> None:
    answers = play(flow, [*TEN, "p .041 p .002"]).state.answers
    assert answers.inspection(gear, "R1").readings_in == (0.041, 0.002)


@pytest.mark.parametrize(
    ("typed", "taken"), [("y", "-.3 in"), ("n", None), ("b", None), ("p .04", ".04 in")]
)
def test_a_plunger_farther_off_than_worn_joints_could_push_it_is_asked_again(
    flow: Flow, typed: str, taken: str | None
) -> None:
    asked = play(flow, [*TEN, "p -.3"])
    assert asked.state.ask is Ask.CONFIRM
    assert "farther than all joints at their limits" in shown(flow, asked.state)
    after = answer(flow, asked.state, typed).state
    assert (after.ask, after.answers.more.get("plunger_displacement")) == (Ask.MORE, taken)


def test_enter_does_not_confirm_the_plunger(flow: Flow) -> None:
    assert play(flow, [*TEN, "p .3", ""]).state.ask is Ask.CONFIRM


@pytest.mark.parametrize(
    "typed",
    [
        *("x y", "p", "p 0,041", "p 1/8", "p .6", "m 0", "m -.03", "m .3", "q .04", "p 1e999"),
        *(".04", "m .02 m .03", "r", "p .041 p .6"),
    ],
)
def test_an_optional_answer_that_is_not_understood_changes_nothing(flow: Flow, typed: str) -> None:
    turn = play(flow, [*TEN, "r", f"f {typed}"])
    assert turn.state.answers.more == {"outcome": "RETRACTED"}


@pytest.mark.parametrize(
    ("unit", "reading"),
    [("i", ".004"), ("t", "4"), ("m", ".10")],
    ids=["inches", "thou", "millimetres"],
)
def test_ten_joints_take_at_most_40_keystrokes_beyond_the_numbers(
    gear: Gear, store: SessionStore, unit: str, reading: str
) -> None:
    terminal = ScriptedTerminal(["N123AB", "l", unit, "r", *[reading] * 10, *ENTERS, ""])
    ask_inspection(gear, terminal, store, NOTHING, now=lambda: NOON)
    assert terminal.keystrokes - 10 * len(reading) <= 40


@pytest.mark.parametrize(("unit", "echo"), [("t", "13.0 thou radial"), ("m", "0.330 mm radial")])
def test_thou_and_millimetres_come_back_as_they_were_typed(
    flow: Flow, unit: str, echo: str
) -> None:
    typed = {"t": "13", "m": ".33"}[unit]
    turn = play(flow, ["N1", "l", unit, "r", typed], NOTHING)
    assert said(turn).startswith(f" ✓ #1  {echo}")
    assert " in" not in said(turn).replace(" in radial", "")


def test_x_takes_the_optional_answers_away(flow: Flow) -> None:
    answers = play(flow, [*TEN, "f p .041 m .028", "x"]).state.answers
    assert answers.more == {}


def test_every_optional_answer_is_echoed_as_typed_with_its_unit(flow: Flow) -> None:
    told = said(play(flow, [*TEN, "p -.041 m .71 mm"]))
    assert "plunger -.041 in" in told
    assert "margin .71 mm" in told


# The review.


def test_the_review_shows_every_joint_in_80_columns(flow: Flow) -> None:
    typed = [".0205", "y", "s", "0.330 mm", *[".004"] * 7, "f p -.041 m .028", *ENTERS]
    rows = shown(flow, play(flow, typed, PLAY_INCHES).state).splitlines()
    assert [row.split()[0] for row in rows[4:14]] == [str(n) for n in range(1, 11)]
    assert max(map(len, rows)) <= 80


def test_the_review_fits_on_24_lines(flow: Flow) -> None:
    typed = ["s", *TEN[:9], "f p -.041 m .028", *ENTERS]
    assert len(shown(flow, play(flow, typed, PLAY_INCHES).state).splitlines()) <= 24


def test_a_joint_and_the_echo_before_it_fit_on_24_lines_and_80_columns(flow: Flow) -> None:
    turn = play(flow, [".016", ".016", ".016"], PLAY_INCHES)
    rows = (said(turn) + "\n" + shown(flow, turn.state)).splitlines()
    assert len(rows) <= 24
    assert max(map(len, rows)) <= 80


def test_the_review_marks_a_joint_over_its_limit(flow: Flow) -> None:
    rows = shown(flow, play(flow, [".008", *TEN[:9], ""]).state).splitlines()
    assert [row for row in rows if row.endswith("OVER")] == [
        row for row in rows if row.startswith("  1 ")
    ]


def test_a_joint_number_at_the_review_changes_that_joint_and_returns(flow: Flow) -> None:
    turn = play(flow, [*TEN, *ENTERS, "3", ".006"])
    assert (turn.state.ask, turn.state.answers.radial_in[3]) == (Ask.REVIEW, 0.006)


@pytest.mark.parametrize("typed", ["", "b"])
def test_a_joint_opened_from_the_review_can_be_left_as_it_was(flow: Flow, typed: str) -> None:
    turn = play(flow, [*TEN, *ENTERS, "3", typed])
    assert (turn.state.ask, turn.state.answers.radial_in[3]) == (Ask.REVIEW, 0.004)


def test_a_large_value_typed_from_the_review_is_also_confirmed(flow: Flow) -> None:
    turn = play(flow, [*TEN, *ENTERS, "3", ".0205", "y"])
    assert (turn.state.ask, turn.state.answers.radial_in[3]) == (Ask.REVIEW, 0.0205)


@pytest.mark.parametrize(
    ("word", "typed", "name", "value"),
    [
        ("tail", "N9", "tail_no", "N9"),
        ("side", "r", "side", Side.RH),
        ("reading", "d", "convention", ClearanceConvention.DIAMETRAL),
    ],
)
def test_the_heading_can_be_changed_from_the_review(
    flow: Flow, word: str, typed: str, name: str, value: str
) -> None:
    turn = play(flow, [*TEN, *ENTERS, word, typed])
    assert (turn.state.ask, getattr(turn.state.answers, name)) == (Ask.REVIEW, value)


def test_a_tail_is_not_changed_into_a_word(flow: Flow) -> None:
    turn = play(flow, [*TEN, *ENTERS, "tail", "n/a"])
    before = play(flow, [*TEN, *ENTERS]).state.answers.tail_no
    assert (turn.state.ask, turn.state.answers.tail_no) == (Ask.TAIL, before)


def test_enter_at_the_review_computes(flow: Flow) -> None:
    assert play(flow, [*TEN, *ENTERS, ""]).effect is Effect.COMPUTE


def test_nothing_is_computed_without_a_single_clearance(flow: Flow) -> None:
    turn = play(flow, ["done", *ENTERS, ""])
    assert turn.effect is Effect.NONE
    assert "nothing to compute" in said(turn)


def test_the_review_leads_back_to_the_plunger(flow: Flow) -> None:
    turn = play(flow, ["done", *ENTERS, "", "more", "p .041", ""])
    assert turn.state.ask is Ask.REVIEW
    assert PLUNGER_DISPLACEMENT.name in turn.state.answers.more


def test_a_plunger_reading_alone_is_computed(flow: Flow) -> None:
    turn = play(flow, ["done", "plunger .041", *ENTERS, ""])
    assert turn.effect is Effect.COMPUTE


@pytest.mark.parametrize("typed", ["11", "0", "3 .004", "compute"])
def test_anything_else_at_the_review_computes_nothing(flow: Flow, typed: str) -> None:
    turn = play(flow, [*TEN, *ENTERS, typed])
    assert (turn.state.ask, turn.effect) == (Ask.REVIEW, Effect.NONE)


# An unfinished inspection of the same gear.


def _offering(gear: Gear, **changes: object) -> Flow:
    answers = replace(play(Flow(gear), [".004", ".005"]).state.answers, **changes)
    return Flow(gear, lambda _tail, _side: Session("s1", gear.id, NOON, answers))


def test_an_unfinished_inspection_is_offered_when_tail_and_side_are_known(gear: Gear) -> None:
    flow = _offering(gear)
    state = play(flow, ["N123AB", "l"], Answers()).state
    assert state.ask is Ask.CONFIRM
    assert "begun 2026-03-04 12:00, 2 of 10 joints" in shown(flow, state)


def test_yes_goes_on_at_the_first_open_joint(gear: Gear) -> None:
    turn = play(_offering(gear), ["N123AB", "l", "y"], Answers())
    assert (turn.effect, turn.state.joint, turn.state.answers.radial_in) == (
        Effect.RESUME,
        3,
        {1: 0.004, 2: 0.005},
    )


def test_no_begins_anew_and_puts_the_old_one_away(gear: Gear) -> None:
    turn = play(_offering(gear), ["N123AB", "l", "n"], Answers())
    assert (turn.effect, turn.state.ask, turn.state.answers.joints) == (
        Effect.PUT_AWAY,
        Ask.UNIT,
        {},
    )


def test_enter_does_not_choose(gear: Gear) -> None:
    assert play(_offering(gear), ["N123AB", "l", ""], Answers()).state.ask is Ask.CONFIRM


def test_an_unfinished_inspection_in_another_convention_is_not_offered_but_named(
    gear: Gear,
) -> None:
    turn = _offering(gear).begin(PLAY_INCHES)
    assert turn.state.ask is Ask.JOINT
    assert "not offered: 2 of 10 joints measured, in inches, read as radial" in said(turn)


# The whole.


def test_the_inspection_holds_radial_clearances_and_what_was_entered(
    gear: Gear, store: SessionStore
) -> None:
    typed = ["N123AB", "l", "t", "d", "26", "s", "0.33 mm", "done", "f p -41 m 28", *ENTERS, ""]
    found = inspect(gear, store, typed)
    assert found.clearance_in == {1: pytest.approx(0.013), 3: pytest.approx(0.165 / 25.4)}
    assert {n: (e.text, e.unit) for n, e in found.entered.items()} == {
        1: ("26", "thou"),
        3: ("0.33 mm", "mm"),
    }
    assert (found.tail_no, found.side, found.convention) == ("N123AB", "LH", "DIAMETRAL")
    assert (found.outcome, found.readings_in, found.margin_in) == (Outcome.FAILED, (-0.041,), 0.028)


def test_a_record_id_is_made_of_tail_side_and_time(gear: Gear, store: SessionStore) -> None:
    assert (
        inspect(gear, store, [*TEN, *ENTERS, ""], RADIAL_INCHES).record_id
        == "N123AB-LH-20260304-120000"
    )


def test_a_record_id_from_a_flag_is_kept(gear: Gear, store: SessionStore) -> None:
    preset = replace(RADIAL_INCHES, record_id="WO-7")
    assert inspect(gear, store, [*TEN, *ENTERS, ""], preset).record_id == "WO-7"


def test_the_day_of_the_inspection_is_the_day_it_was_begun(gear: Gear, store: SessionStore) -> None:
    assert inspect(gear, store, [*TEN, *ENTERS, ""], RADIAL_INCHES).inspection_date == NOON.date()


def test_a_confirmed_value_travels_as_a_warning(gear: Gear, store: SessionStore) -> None:
    found = inspect(gear, store, [".0205", "y", *TEN[:9], *ENTERS, ""], RADIAL_INCHES)
    judged, asked = found.warnings
    assert judged.startswith(
        "joint 1: .0205 in is 0.0205 in radial, above 0.015 in: check the reading."
    )
    assert asked == "asked again and confirmed: #1"


def test_ten_joints_in_inches_take_70_keystrokes_with_the_enters(
    gear: Gear, store: SessionStore
) -> None:
    terminal = ScriptedTerminal(["N123AB", "l", "i", "t", *TEN, *ENTERS, ""])
    ask_inspection(gear, terminal, store, Answers())
    assert terminal.keystrokes == 70


def test_ten_joints_in_thou_take_40_keystrokes_with_the_enters(
    gear: Gear, store: SessionStore
) -> None:
    terminal = ScriptedTerminal(["N123AB", "l", "t", "t", *["4"] * 10, *ENTERS, ""])
    ask_inspection(gear, terminal, store, Answers())
    assert terminal.keystrokes == 40


# The sketch.


@pytest.mark.parametrize("number", range(1, 11))
def test_the_sketch_marks_the_current_joint_only(gear: Gear, number: int) -> None:
    text = text_of(sketch(gear, number, 80))
    assert re.findall(r"\[(\d+)\]", text) == [str(number)]
    assert sorted(map(int, re.findall(r"\((\d+)\)", text))) == [
        n for n in range(1, 11) if n != number
    ]


@pytest.mark.parametrize("number", range(1, 11))
def test_the_arrow_points_at_the_current_joint(gear: Gear, number: int) -> None:
    rows = text_of(sketch(gear, number, 80)).splitlines()
    at = next(i for i, row in enumerate(rows) if "▲" in row)
    start = rows[at - 1].index(f"[{number}]")
    assert start <= rows[at].index("▲") < start + len(f"[{number}]")


@pytest.mark.parametrize("width", [120, 80, 60, 50, 44, 30, 12, 1])
def test_the_sketch_never_is_wider_than_the_terminal(gear: Gear, width: int) -> None:
    assert max(map(len, text_of(sketch(gear, 4, width)).splitlines()), default=0) <= width


def _first_joints(gear: Gear, count: int, steps: tuple[Step, ...]) -> Gear:
    """The gear cut off after its first joints."""
    whole = gear.reference.mechanism
    needed = {"F", "E", "Q", *(str(n) for n in range(1, count + 1))}
    points = tuple(point for point in whole.points if point.name in needed)
    cut = replace(
        whole,
        planes=whole.planes[:1],
        points=points,
        steps=steps,
        output=Output("position", steps[-1].joint),
    )
    return replace(
        gear, reference=replace(gear.reference, mechanism=cut), joints=gear.joints[:count]
    )


def test_a_mechanism_that_branches_is_shown_as_a_row_of_joints(gear: Gear) -> None:
    steps = gear.reference.mechanism.steps
    branched = (*steps[:2], Lever("3", "Q", "1", (2,)), steps[3])
    assert "(1)······(2)······[3]" in text_of(sketch(_first_joints(gear, 5, branched), 3, 80))


def test_a_linkage_that_ends_in_a_rocker_is_drawn_to_its_pivot(gear: Gear) -> None:
    text = text_of(sketch(_first_joints(gear, 5, gear.reference.mechanism.steps[:4]), 5, 80))
    assert "(3)──────[5]══════(4)" in text


def test_ascii_keeps_the_columns(gear: Gear) -> None:
    text = text_of(sketch(gear, 4, 80))
    plain = to_ascii(text.replace("\n", ""))
    assert plain.isascii()
    assert len(plain) == len(text.replace("\n", ""))
    assert "?" not in plain


INCHES_AS_MILLIMETRES = (
    ".011",
    ".009",
    ".0115",
    ".010",
    ".011",
    ".009",
    ".0105",
    ".010",
    ".011",
    ".009",
)


def in_millimetres(flow: Flow, *more: str) -> Turn:
    """Readings in inches of a gear whose joints are all worn out, typed where millimetres were
    chosen.
    """
    return play(
        flow,
        [*INCHES_AS_MILLIMETRES, *ENTERS, "", *more],
        replace(RADIAL_INCHES, unit=LengthUnit.MILLIMETRE),
    )


def test_readings_that_look_like_another_unit_are_asked_about_before_they_are_computed(
    flow: Flow,
) -> None:
    turn = in_millimetres(flow)
    assert turn.state.ask is Ask.CONFIRM
    assert "inches, not in millimetres" in shown(flow, turn.state)


def test_a_yes_takes_the_readings_in_their_unit(flow: Flow, gear: Gear) -> None:
    turn = in_millimetres(flow, "y")
    assert turn.effect is Effect.COMPUTE
    assert turn.state.answers.inspection(gear, "R1").unit_question == ""


def test_b_after_a_yes_does_not_ask_about_the_unit_again(flow: Flow) -> None:
    assert answer(flow, in_millimetres(flow, "y").state, "b").state.ask is not Ask.CONFIRM


def test_a_no_goes_back_to_the_table(flow: Flow) -> None:
    assert in_millimetres(flow, "n").state.ask is Ask.REVIEW


def test_enter_alone_does_not_confirm_the_unit(flow: Flow) -> None:
    assert in_millimetres(flow, "").state.ask is Ask.CONFIRM


def test_another_unit_takes_the_confirmation_back(flow: Flow) -> None:
    turn = in_millimetres(flow, "y")
    for typed in ("unit", "t", "y"):
        turn = answer(flow, turn.state, typed)
    assert "small_readings_true" not in turn.state.answers.more


def test_a_small_reading_is_asked_again(flow: Flow) -> None:
    turn = play(flow, [".004"], replace(RADIAL_INCHES, unit=LengthUnit.MILLIMETRE))
    assert turn.state.ask is Ask.CONFIRM
    assert "less than new parts have" in shown(flow, turn.state)


def test_an_upper_end_of_a_reading_is_not_said_to_be_less_than_new_parts(flow: Flow) -> None:
    turn = play(flow, ["<0.002"], RADIAL_INCHES)
    assert turn.state.ask is Ask.CONFIRM
    assert "the upper end of what was found" in shown(flow, turn.state)


def test_an_upper_end_of_a_reading_is_the_same_reading_as_in_a_file(flow: Flow) -> None:
    read = play(flow, ["<0.002", "y", *TEN[1:]]).state.answers.inspection(flow.gear, "R1")
    assert (read.clearance_in[1], str(read.entered[1])) == (0.002, "<0.002 in")
    assert "joint 1: <0.002 is counted as 0.002, its upper end" in read.warnings


def test_no_flag_is_named_at_a_prompt(flow: Flow) -> None:
    turn = play(flow, [".004"], replace(RADIAL_INCHES, unit=LengthUnit.MILLIMETRE))
    assert "--" not in shown(flow, turn.state)


def test_joints_restored_at_the_prompt_make_what_was_typed_before_older(flow: Flow) -> None:
    before = play(flow, [*TEN, "f p .041", "n 3 5"]).state.answers.inspection(flow.gear, "R1")
    after = play(flow, [*TEN, "f", "n 3 5", "p .002", "r"]).state.answers.inspection(
        flow.gear, "R1"
    )
    assert before.restored_joints == (3, 5)
    assert (before.standing_outcome, before.standing_readings_in) == (None, ())
    assert (after.standing_outcome, len(after.standing_readings_in)) == (Outcome.RETRACTED, 1)


def test_the_day_is_taken_on_one_line(flow: Flow) -> None:
    answers = play(flow, [*TEN, "c 4, w 3 a 5", "g yes"]).state.answers
    read = answers.inspection(flow.gear, "R1")
    assert (read.cannot_reach, read.no_spare) == ((4,), (3,))
    assert read.measured_again == (5,)
    assert read.rigging_checked is RiggingCheck.YES


def test_one_limit_of_the_day_is_lifted_and_the_others_stand(flow: Flow) -> None:
    answers = play(flow, [*TEN, "c 4, w 3", "w none"]).state.answers
    read = answers.inspection(flow.gear, "R1")
    assert (read.cannot_reach, read.no_spare) == ((4,), ())


def test_a_joint_that_does_not_exist_is_not_taken_as_restored(flow: Flow) -> None:
    turn = play(flow, [*TEN, "n 3 14"])
    assert "restored_joints" not in turn.state.answers.more
