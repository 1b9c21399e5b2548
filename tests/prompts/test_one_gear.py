"""One gear at the prompts, from the tail number to the verdict."""

from __future__ import annotations

import textwrap
from collections.abc import Callable
from datetime import date, timedelta

import pytest

from mlg_troubleshoot.life.folding import GearLife
from tests.prompts.scripted import Sit, StoppedError

HEAD = ("N1 LH", "thou", "play")
TEN = ("8", "11", "6", "6", "4", "3", "3", "3", "3", "3")
END = ("J. Smith", "G-03")
Life = Callable[..., GearLife]


def gear(*typed: str) -> tuple[str, ...]:
    """A whole entry whose middle is given."""
    return (*HEAD, *typed, *END)


def failed(*joints: str) -> tuple[str, ...]:
    return gear("f", "46", *joints)


def test_the_questions_come_in_this_order(sit: Sit) -> None:
    asked = sit(*failed("8", "done"), "").prompts
    begins = ("Tail number", "Unit", "A clearance", "Did it retract?", "Plunger", "#3", "#5")
    for prompt, begin in zip(asked, (*begins, "Measured by", "Gauge"), strict=False):
        assert prompt.startswith(begin)


def test_a_gear_takes_few_keys_and_questions_beyond_its_readings(sit: Sit) -> None:
    terminal = sit(*failed(*TEN), "")
    readings = ("46", *TEN)
    assert terminal.keys - sum(len(each) + 1 for each in readings) <= 34
    assert len(terminal.prompts) - 10 <= 9


def test_the_second_gear_of_a_day_takes_enter_for_what_is_known(sit: Sit) -> None:
    sit(*failed("done"), "")
    terminal = sit("N125TL RH", "", "f", "", "done", "", "", "")
    assert terminal.keys <= 24
    assert "Readings are thou, total play (Enter: yes" in terminal.screen
    assert "Measured by (Enter: J. Smith)" in terminal.screen


def test_joints_are_asked_for_in_the_order_of_next_and_show_their_limit_as_read(sit: Sit) -> None:
    terminal = sit(*failed("8", "11", "26", "done"), "")
    joints = [prompt for prompt in terminal.prompts if prompt.startswith("#")]
    assert joints[0].startswith("#3 short link inner bearing, limit 15.0 thou")
    assert joints[1].startswith("#5")
    assert "✓ #3 8 thou total play\n" in terminal.screen
    assert "Over the limit of 15.0 thou (assumed): look up the manual's." in terminal.screen


def test_what_is_not_read_is_kept_as_not_read(sit: Sit, life: Life) -> None:
    sit(*gear("n", "", "8", "", "done"), "")
    found = life().inspections[-1].inspection
    assert (found.outcome, found.readings_in) == (None, ())
    assert list(found.clearance_in.values()) == [0.004]


def test_readings_keep_the_unit_that_they_were_typed_in(sit: Sit, life: Life) -> None:
    sit(*gear("f", "1.1 mm", "0.013 in", "0.2 mm", "9", "done"), "")
    found = life().inspections[-1].inspection
    assert {str(each) for each in found.entered.values()} == {"0.013 in", "0.2 mm", "9 thou"}
    assert found.readings_in == pytest.approx((0.0433,), abs=1e-4)


def test_a_unit_of_one_inspection_is_said_and_not_offered_next(sit: Sit) -> None:
    assert "before:" not in sit(*failed("done"), "").screen
    screen = sit("N2 LH", "mm radial", "r", "", "done", "", "", "").screen
    assert "Readings are in mm, radial (for this inspection, before: thou, total play)." in screen
    assert "Readings are in thou, total play." in sit("N2 LH", "").screen
    with pytest.raises(StoppedError, match="Readings are thou, total play"):
        sit("N3 LH")


@pytest.mark.parametrize(
    "typed",
    [
        ("unit mm", "r", "", "done", "", ""),
        ("", "r", "", "unit mm", "done", "", ""),
        ("", "r", "", "done", "", "", "unit mm"),
    ],
)
def test_a_unit_that_is_stated_by_its_word_is_offered_next(sit: Sit, typed) -> None:
    sit(*failed("done"), "")
    screen = sit("N2 LH", *typed, "gear", "N3 LH").screen
    assert "Readings are mm, total play (Enter: yes" in screen


@pytest.mark.parametrize(
    ("typed", "offered"),
    [
        (("r", "", "name F. Kern", "done", ""), "J. Smith"),
        (("date yesterday", "r", "", "done", "F. Kern", ""), "J. Smith"),
        (("r", "", "done", "F. Kern", ""), "F. Kern"),
    ],
)
def test_the_name_of_a_colleague_is_of_one_gear_and_not_offered_next(sit, life, typed, offered):
    sit(*failed("done"), "")
    sit("N2 LH", "", *typed, "#3 8", "")
    visits = [visit.inspection.technician_id for visit in life(tail="N2").inspections]
    assert visits == ["F. Kern", "F. Kern"]
    assert f"Measured by (Enter: {offered})" in sit("N3 LH", "", "r", "", "done", "", "").screen


def test_enter_alone_does_not_confirm_an_unusual_reading(sit: Sit, life: Life) -> None:
    sit(*gear("f", "", "90", "", "9", "done"), "")
    assert life().inspections[-1].inspection.clearance_in == {3: 0.0045}


def test_a_word_that_is_no_outcome_is_refused_with_what_is_expected_and_asked_again(
    sit: Sit,
) -> None:
    screen = sit(*gear("total", "f", "", "3 x", "done"), "").screen
    refused = "'total' is not accepted: expected r (retracted), f (failed) or n (not tried). Did it"
    assert refused in " ".join(screen.split())
    assert "Several joints: #3 13 #7 9." in screen


@pytest.mark.parametrize(
    ("typed", "read"),
    [("2 27", {2: 0.0135}), ("#2 is 27", {2: 0.0135}), ("2 .9", {}), ("2 8", {})],
)
def test_a_joint_and_its_reading_are_taken_where_nothing_else_can_be_meant(sit, life, typed, read):
    screen = sit(*gear("f", "46", "11", typed, "done"), "").screen
    assert life().inspections[-1].inspection.clearance_in == {3: 0.0055} | read
    refused = f"✗ {typed!r} may be {typed.replace(' ', '')}, or joint 2. Type #{typed} for that."
    assert (refused in screen) == (not read)


@pytest.mark.parametrize("typed", ["plunger 41; 22", "p 0.041 in p 22", "p 41"])
def test_every_plunger_reading_counts_at_any_question(sit: Sit, life: Life, typed: str) -> None:
    sit(*gear("f", "", typed, *["p 22"] * (typed == "p 41"), "done"), "")
    assert life().inspections[-1].inspection.readings_in == (0.041, 0.022)


WORDS = (
    *("date 2026-11-20", "landings 4000", "margin 28", "temperature 21", "pressure 3000"),
    *("cannot reach 3 5", "no spare 3", "rigging yes", "order WO-17", "remarks oil seen"),
)


@pytest.mark.parametrize("question", [3, 8])
def test_words_are_understood_at_every_question(sit: Sit, life: Life, question: int) -> None:
    answers = [*HEAD, "f", "46", "8", "done", *END]
    sit(*answers[:question], *WORDS, *answers[question:], "")
    found = life().inspections[-1].inspection
    assert (found.outcome, found.readings_in) == ("FAILED", (0.046,))
    assert str(found.inspection_date) == "2026-11-20"
    assert (found.gear_landings, found.margin_in) == (4000, pytest.approx(0.028))
    assert (found.temperature_c, found.hydraulic_pressure_psi) == (21, 3000)
    assert (found.cannot_reach, found.no_spare) == ((3, 5), (3,))
    assert (found.rigging_checked, found.carried["work_order"]) == ("yes", "WO-17")
    assert found.carried["remarks"] == "oil seen"


def test_a_reading_counts_where_a_name_is_asked_for_and_an_initial_is_of_a_name(sit, life) -> None:
    typed = ("p 40", "F. Kern", "#3 8", "gauge 0.5", "n", "gauge P. 7 .5 thou")
    screen = sit("order WO-17", *gear("f", "", "done")[:-2], *typed, "").screen
    assert "✗ '0.5' has no unit. Type gauge 0.5 thou, or gauge 0.5 in." in screen
    assert "✓ gauge P. 7, standard uncertainty of the gauge .5 thou total play" in screen
    found = life().inspections[-1].inspection
    assert (found.readings_in, found.clearance_in) == ((0.04,), {3: 0.004})
    assert (found.technician_id, found.gauge_id) == ("F. Kern", "P. 7")
    assert found.gauge_u_in == 0.00025
    assert found.carried["work_order"] == "WO-17"


def test_of_a_line_only_what_is_wrong_is_refused_and_asked_for(sit: Sit, life: Life) -> None:
    line = "#1 2 #2 0,15 landings x p 40 p 41 x #4 3 p 42"
    terminal = sit(*gear("f", "", line, "4", "done"), "")
    for said in ("#2 '0,15 thou' is", "Landings since overhaul 'x' is", "Plunger displacement '41"):
        assert f"✗ {said}" in terminal.screen
    assert terminal.prompts[6].startswith("#2 ")
    found = life().inspections[-1].inspection
    assert found.clearance_in == {1: 0.001, 4: 0.0015, 2: 0.002}
    assert found.readings_in == (0.04, 0.042)


def test_a_day_without_a_year_is_the_last_such_day(sit: Sit, life: Life) -> None:
    day = date.today() - timedelta(days=200)
    sit(*gear(f"date {day:%d %b}", "f", "46", "done"), "")
    assert life().inspections[-1].inspection.inspection_date == day


def test_a_fraction_is_refused_with_its_value(sit: Sit) -> None:
    screen = sit(*gear("f", "1/64", "46", "1/64", "8 1/2", "8", "done"), "").screen
    assert "1/64 in = 15.6 thou" in screen
    assert "Fractions are not read: write 8.5." in screen


def test_a_reading_that_can_hardly_be_is_confirmed_or_typed_again(sit, life, capsys) -> None:
    screen = sit(*gear("f", "46", "85", "8.5", "<2", "y", "done"), "").screen
    assert "Is the decimal point misplaced (factor 10)? It would be 8.5 thou" in screen
    found = life().inspections[-1].inspection
    assert sorted(map(str, found.entered.values())) == ["8.5 thou", "<2 thou"]
    sit("N2 LH", "", "f", "46", "#2 90", "y", "done", "", "", "")
    assert "joint 2: 90 thou total play is above 30 thou: " in capsys.readouterr().out


@pytest.mark.parametrize(
    ("typed", "said", "again"),
    [
        ("460", "at most", ("n",)),
        ("0.046", "was it read in inches, not in thou?", ()),
        ("0.046", "was it read in inches, not in thou?", ("u",)),
    ],
)
def test_a_plunger_that_can_hardly_be_is_asked_for_again(sit, life, typed, said, again):
    terminal = sit(*gear("f", typed, *again, "46", "done"), "")
    assert said in terminal.screen
    assert life().inspections[-1].inspection.readings_in == (0.046,)


UNDONE = {
    "#3 9": "#3 9 thou, 8 thou again",
    "#3 none": "#3 none, 8 thou again",
    "p 41": "plunger displacement 46 thou; 41 thou, 46 thou again",
    "plunger none": "plunger displacement none, 46 thou again",
    "r": "outcome RETRACTED, FAILED again",
    "#5 2 landings 4000": "#5 2 thou, landings since overhaul 4000",
    "done": "#5 none, #2 none, #4 none, #1 none, #6 none, #7 none, #8 none, #9 none, #10 none",
}


@pytest.mark.parametrize("line", UNDONE)
def test_undo_says_what_it_takes_back_and_brings_back_what_was_there(sit, life, line) -> None:
    terminal = sit(*gear("f", "46", "8", line, "u", "#4 3", "done"), "")
    assert f"– undone: {UNDONE[line]}\n" in terminal.screen
    found = life().inspections[-1].inspection
    assert (found.outcome, found.readings_in) == ("FAILED", (0.046,))
    assert (found.clearance_in, found.gear_landings) == ({3: 0.004, 4: 0.0015}, None)


@pytest.mark.parametrize("line", ["p none", "plunger none"])
def test_a_plunger_that_was_not_read_is_taken_out_and_said(sit, life, line) -> None:
    screen = sit(*gear("f", "46; 41", "8", line, "done"), "").screen
    assert "✓ plunger displacement none, was 46 thou; 41 thou" in screen
    assert life().inspections[-1].inspection.readings_in == ()


@pytest.mark.parametrize("again", ["u", "n"])
def test_undo_at_a_doubt_takes_the_doubted_answer_back_and_no_good_one(sit, life, again) -> None:
    doubted = ("85", "landings 4000", again, "9", "p 460", again)
    terminal = sit(*gear("f", "46", "8", *doubted, "done"), "")
    assert "– undone: #5 85" in terminal.screen
    found = life().inspections[-1].inspection
    assert (found.clearance_in, found.readings_in) == ({3: 0.004, 5: 0.0045}, (0.046,))
    assert found.gear_landings == 4000


@pytest.mark.parametrize("line", ["p 44", "f p 44", "#4 3 p 44", "landings 4000 p 44"])
def test_words_are_understood_where_side_unit_and_convention_are_asked_for(sit, life, line) -> None:
    for question in range(1, 4):
        answers = [f"N{question}", "LH", "thou", "play"]
        answers.insert(question, line)
        sit(*answers, *["f"] * (line[0] != "f"), "done", *END, "")
        assert life(tail=f"N{question}").inspections[-1].inspection.readings_in == (0.044,)


@pytest.mark.parametrize("doubted", ["85", "p 460", "#4 85"])
def test_words_are_understood_at_a_doubt(sit, life, doubted) -> None:
    typed = ("f", "", doubted, "landings 4000", "p 44", "#4 3", *["y"] * (doubted == "85"))
    sit(*gear(*typed, "done"), "")
    found = life().inspections[-1].inspection
    assert (found.readings_in, found.gear_landings) == ((0.044,), 4000)


def test_a_joint_is_named_to_jump_to_it_or_to_give_its_reading(sit: Sit, life: Life) -> None:
    sit(*gear("f", "46", "#9", "5", "#10 7", "done"), "")
    assert life().inspections[-1].inspection.clearance_in == {9: 0.0025, 10: 0.0035}


@pytest.mark.parametrize(
    ("typed", "asked"),
    [
        (("14", "#3 25", "#10 3"), ["#3", "#5", "#5", "#5"]),
        (("14", "#3", "#10", "3", "25", "4"), ["#3", "#5", "#3", "#10", "#3", "#5", "#2"]),
    ],
)
def test_a_joint_that_waits_is_asked_for_after_the_others(sit: Sit, typed, asked) -> None:
    terminal = sit(*gear("f", "46", *typed, "done"), "")
    joints = [prompt.split()[0] for prompt in terminal.prompts if prompt.startswith("#")]
    assert joints == asked
    assert "✓ #3 25 thou total play, was 14 thou" in terminal.screen


def test_a_joint_prompt_says_what_enter_does_and_what_ends_the_joints(sit: Sit) -> None:
    terminal = sit(*gear("f", "46", "#1 none", "14", "#3 none", "done"), "")
    assert all("(Enter: not read; done)" in p for p in terminal.prompts if p.startswith("#"))
    for said in ("✓ #1 none\n", "✓ #3 none, was 14 thou"):
        assert said in terminal.screen


def test_a_unit_is_understood_where_a_name_is_asked_for_and_done_is_no_name(sit, life) -> None:
    typed = ("f", "done", "8", "done", "unit mm", "done", "convention play", "G-03", "", "")
    sit("unit thou", "N1 LH", "", "play", *typed)
    found = life().inspections[-1].inspection
    assert (found.readings_in, found.clearance_in) == ((), {3: 0.004})
    assert (found.technician_id, found.gauge_id) == (None, "G-03")


@pytest.mark.parametrize("typed", [("unit mm", "0.2"), ("unit mm #5 0.2",), ("#5 0.2 unit mm",)])
def test_a_unit_is_changed_at_any_question_for_what_is_typed_from_there_on(sit, life, typed):
    screen = sit(*gear("f", "46", "8", *typed, "done"), "").screen
    assert "Readings are in mm, total play (before: thou, total play); what was typed" in screen
    found = life().inspections[-1].inspection
    assert {n: str(each) for n, each in found.entered.items()} == {3: "8 thou", 5: "0.2 mm"}
    assert found.readings_in == (0.046,)


def test_a_convention_is_not_changed_below_readings_of_another(sit: Sit, life: Life) -> None:
    typed = ("convention radial", "8", "convention play", "u", "convention play", "9", "done")
    screen = sit(*gear("f", "46", *typed), "").screen
    assert "✗ #3 8 thou was read as radial. u takes it back" in screen
    assert life().inspections[-1].inspection.clearance_in == {3: 0.0045}


@pytest.mark.parametrize(
    ("typed", "read"),
    [(("#3", ""), {3: 0.004}), (("#3", "none"), {}), (("#5", ""), {3: 0.004})],
)
def test_enter_keeps_a_reading_and_none_clears_it(sit: Sit, life: Life, typed, read) -> None:
    terminal = sit(*gear("f", "46", "8", *typed, "done"), "")
    assert any("(Enter: 8 thou" in each for each in terminal.prompts) == (typed[0] == "#3")
    assert life().inspections[-1].inspection.clearance_in == read


def test_readings_of_another_unit_are_asked_about_before_they_are_judged(sit, life):
    tight = ["0.4"] * 10
    terminal = sit(*gear("f", "46", *[each for x in tight for each in (x, "y")]), "y", "")
    assert "y = it is right; or type it again" in terminal.screen
    assert life().inspections[-1].inspection.small_readings_true


@pytest.mark.parametrize(
    ("again", "read"),
    [(("#3 13",), (0.0065, (0.041,))), (("p 46", "y"), (0.0002, (0.046,)))],
)
def test_what_is_unusual_is_typed_again_in_its_place(sit, life, again, read):
    tight = ["0.4", "y"] * 2
    sit(*gear("f", "41", *tight, "done"), *again, "")
    found = life().inspections[-1].inspection
    assert (pytest.approx(found.clearance_in[3]), found.readings_in) == read


@pytest.mark.parametrize(
    ("typed", "said"),
    [
        ("thou total", "thou, total play"),
        ("mils TOTAL_PLAY", "thou, total play"),
        ("dial mm", "mm, total play"),
        ("inches bore", "in, diametral"),
    ],
)
def test_units_and_conventions_are_understood_as_people_say_them(sit, typed, said):
    assert f"Readings are in {said}." in sit("N1 LH", typed, "f", "", "done", *END, "").screen


def test_help_is_of_the_question_and_lists_the_words(sit: Sit) -> None:
    screen = sit(*gear("f", "?", "46", "?", "done"), "").screen
    assert "with the Down Lock released" in screen
    assert "Make the gear safe as the maintenance manual says" in screen
    assert screen.count("restored 3 5 on 25 Nov") == 2


def test_help_leaves_the_question_on_a_screen_of_24_rows(sit: Sit, begun) -> None:
    begun(*failed("8", "done"))
    asked = ("?", "thou, play", "?", "f", "?", "46", "?", "done", "?", "A", "?", "G", "")
    screens = [sit("N1 LH", "?", "").screen, sit("N2 LH", *asked).screen]
    for shown in (part for screen in screens for part in screen.split(" > ?\n")[1:]):
        lines = shown.partition(" > ")[0].splitlines()
        assert sum(len(textwrap.wrap(line, 80)) for line in lines) <= 23
        assert "side RH" in shown


@pytest.mark.parametrize("end", [EOFError, KeyboardInterrupt])
def test_an_entry_that_is_stopped_goes_on_where_it_stopped(sit, life, end):
    with pytest.raises(StoppedError):
        sit(*HEAD, "f", "46", "8", end=end)
    terminal = sit("", "11", "done", *END, "")
    assert "Tail number (Enter: N1 LH)" in terminal.screen
    assert len(terminal.prompts) == 6
    assert life().inspections[-1].inspection.clearance_in == {3: 0.004, 5: 0.0055}


def test_an_unfinished_entry_is_continued_by_its_tail_and_begun_anew_by_a_word(sit, life):
    with pytest.raises(StoppedError):
        sit(*HEAD, "f", "46", "8")
    screen = sit("N1 LH", "new", "thou", "play", "n", "", "9", "done", *END, "").screen
    assert ": tail N1, side LH, " in screen
    assert life().inspections[-1].inspection.outcome is None


def test_an_entry_is_begun_anew_before_its_side_is_known(sit: Sit, life: Life) -> None:
    sit("N1", "new", "LH", *failed("8", "done")[1:], "")
    assert life().inspections[-1].inspection.clearance_in == {3: 0.004}


def test_a_start_at_which_nothing_was_typed_leaves_nothing(sit: Sit) -> None:
    for _ in range(2):
        with pytest.raises(StoppedError, match="Nothing was typed"):
            sit()


def test_answers_that_cannot_be_saved_are_said_once(sit, monkeypatch):
    from mlg_troubleshoot.errors import OutputError
    from mlg_troubleshoot.store import Drafts

    def full(*_: object) -> bool:
        raise OutputError("no space left", "Make room.")

    monkeypatch.setattr(Drafts, "save", full)
    assert sit(*failed("done"), "").screen.count("Answers cannot be saved") == 1
