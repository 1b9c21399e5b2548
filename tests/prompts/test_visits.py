"""The second visit to a gear: it goes on with what is kept, to the end."""

from __future__ import annotations

from collections.abc import Callable
from datetime import date, datetime, timedelta
from functools import partial
from itertools import count
from pathlib import Path

import pytest

from mlg_troubleshoot.cli.by_hand import continued
from mlg_troubleshoot.cli.check import Flags, Wanted
from mlg_troubleshoot.cli.check_run import Run
from mlg_troubleshoot.cli.options import Tables
from mlg_troubleshoot.cli.prompts import (
    EntryInterruptedError,
    SessionStore,
    ask_inspection,
    last_visit,
)
from mlg_troubleshoot.cli.prompts.answers import JointAnswer, parse_reading
from mlg_troubleshoot.decision.inspection import Side
from mlg_troubleshoot.decision.plan import Action
from mlg_troubleshoot.gear.gear_file import load_gear
from mlg_troubleshoot.life.folding import GearLife, life_of
from mlg_troubleshoot.life.judged import judge_lives
from mlg_troubleshoot.store import RecordKind, Store
from mlg_troubleshoot.workflows.index_tables import load_index_table
from tests.cli.conftest import mlg
from tests.prompts.scripted import ENTERS, ScriptedTerminal

GEAR = ("N1", "l")
PLAY = ("8", "9", "18", "10", "11", "3", "3", "3", "3", "3")
FIRST = (*GEAR, "t", "t", *PLAY, "f", *ENTERS, "")
SOUND = (*GEAR, "t", "t", *["5"] * 10, "f", *ENTERS, "")

Visit = Callable[..., ScriptedTerminal]


@pytest.fixture
def visit(store: SessionStore, monkeypatch: pytest.MonkeyPatch) -> Visit:
    """One run of ``mlg check`` on a terminal, ended with Enter; the screen is returned. A visit
    begins at least a second after the one before: nobody types faster.
    """
    visits = count()

    def one(*typed: str, resume: bool = False, flags: Flags | None = None) -> ScriptedTerminal:
        terminal = ScriptedTerminal([*typed, ""])
        later = timedelta(seconds=next(visits))
        asked = partial(ask_inspection, now=lambda: datetime.now() + later)
        monkeypatch.setattr("mlg_troubleshoot.cli.prompts.ask_inspection", asked)
        monkeypatch.setattr("mlg_troubleshoot.cli.prompts.RichTerminal", lambda: terminal)
        monkeypatch.setattr("mlg_troubleshoot.cli.output.can_ask", lambda: True)
        wanted = Wanted(store=str(store.place), resume=resume)
        Run([], flags or Flags(), Tables(), wanted).run()
        return terminal

    return one


def broken_off(visit: Visit, *typed: str) -> None:
    """A visit that Ctrl-C ends after the given lines."""

    class Stopped(ScriptedTerminal):
        def ask(self, prompt: str) -> str:
            if len(self._typed) == 1:
                raise KeyboardInterrupt
            return super().ask(prompt)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("tests.prompts.test_visits.ScriptedTerminal", Stopped)
        with pytest.raises(EntryInterruptedError):
            visit(*typed)


def next_of(screen: str) -> list[str]:
    """What a visit that is opened says of the verdict and NEXT."""
    return [line for line in screen.splitlines() if "NEXT:" in line or "Last verdict" in line]


def life(store: SessionStore) -> GearLife:
    return life_of(Store(store.place), "N1", "LH")


def test_a_gear_that_was_seen_before_shows_its_verdict_next_and_readings_with_their_day(
    visit: Visit,
) -> None:
    visit(*FIRST)
    screen = visit(*GEAR).screen
    today = date.today().isoformat()
    assert f"N1 LH, last inspected {today}" in screen
    assert "Last verdict: OUTSIDE MARGIN" in screen
    assert "NEXT: Read the plunger" in screen
    assert f"#3 18 thou, {today}" in screen


def test_a_second_visit_asks_only_for_what_next_asked(visit: Visit, store: SessionStore) -> None:
    visit(*FIRST)
    screen = visit(*GEAR, "y", "36").screen
    assert screen.count(" > ") == len((*GEAR, "y", "36", ""))
    assert life(store).inspections[-1].inspection.readings_in == (0.036,)


def test_readings_of_an_earlier_visit_stand_without_being_typed_again(
    visit: Visit, store: SessionStore
) -> None:
    visit(*FIRST)
    before = life(store).inspections[-1].inspection
    visit(*GEAR, "y", "36")
    after = life(store).inspections[-1].inspection
    assert (after.clearance_in, after.entered) == (before.clearance_in, before.entered)


def test_an_upper_end_of_an_earlier_visit_stands_as_it_was_read(
    visit: Visit, store: SessionStore
) -> None:
    visit(*GEAR, "t", "t", "<2", "y", *PLAY[1:], "f", *ENTERS, "")
    visit(*GEAR, "y", "36")
    assert str(life(store).inspections[-1].inspection.entered[1]) == "<2 thou"


def test_a_margin_larger_than_that_of_the_gear_file_is_said_with_the_verdict(
    visit: Visit, capsys: pytest.CaptureFixture
) -> None:
    visit(*GEAR, "t", "t", *["4"] * 10, "m 150", *ENTERS, "")
    screen = " ".join(capsys.readouterr().out.split())
    assert "larger than that of the gear file (30.0 thou)" in screen


def test_a_continued_inspection_is_one_inspection_and_the_former_stays_in_the_chain(
    visit: Visit, store: SessionStore
) -> None:
    visit(*FIRST)
    visit(*GEAR, "y", "36")
    kinds = [r.kind for r in life(store).records if r.kind is not RecordKind.ASSESSMENT]
    assert kinds == [RecordKind.INSPECTION, RecordKind.CORRECTION]
    assert len(life(store).inspections) == 1


def test_what_only_a_table_said_of_a_continued_inspection_stands(
    visit: Visit, store: SessionStore, tmp_path: Path
) -> None:
    table = tmp_path / "one.csv"
    table.write_text(
        "record_id,tail_no,side,clearance_convention,clearance_1_in,clearance_3_in,temperature_c,"
        "remarks,gauge_u_in,inspection_date\n"
        "R1,N1,LH,RADIAL,.004,.009,21,oil seen,.0004,2026-03-01\n"
    )
    mlg("check", table, "--keep", "--store", store.place)
    visit(*GEAR, "p 36 thou")
    found = life(store).inspections[-1].inspection
    assert (found.record_id, found.temperature_c, found.carried["remarks"]) == (
        "R1",
        21.0,
        "oil seen",
    )
    assert (found.gauge_u_in, found.readings_in) == (0.0004, (0.036,))


def test_a_new_inspection_is_one_key_away(visit: Visit, store: SessionStore) -> None:
    visit(*FIRST)
    visit(*GEAR, "n", "t", "t", *["4"] * 10, *ENTERS, "")
    assert len(life(store).inspections) == 2


def test_the_last_answer_is_taken_back_by_a_record_that_is_appended(
    visit: Visit, store: SessionStore
) -> None:
    visit(*FIRST)
    visit(*GEAR, "y", "36")
    records = len(life(store).records)
    visit(*GEAR, "u")
    assert life(store).inspections[-1].inspection.readings_in == ()
    assert len(life(store).records) > records


def test_an_outcome_is_taken_back(visit: Visit, store: SessionStore) -> None:
    visit(*FIRST)
    visit(*GEAR, "retracted")
    assert life(store).inspections[-1].inspection.outcome == "RETRACTED"
    visit(*GEAR, "u")
    assert life(store).inspections[-1].inspection.outcome == "FAILED"


def test_a_second_undo_goes_one_change_further_back(visit: Visit, store: SessionStore) -> None:
    visit(*FIRST)
    visit(*GEAR, "y", "36")
    visit(*GEAR, "retracted")
    visit(*GEAR, "u")
    visit(*GEAR, "u")
    found = life(store).inspections[-1].inspection
    assert (found.outcome, found.readings_in) == ("FAILED", ())


def test_the_unit_stays_where_the_undone_answer_was_the_first_reading(visit: Visit) -> None:
    visit(*GEAR, "m", "d", "done", "f", *ENTERS, "")
    screen = visit(*GEAR, "y", "m", "1.1", "u", "y", "s").screen
    assert screen.count("Unit of your readings?") == 1


def test_what_stays_open_stands_with_next_at_the_second_visit(visit: Visit) -> None:
    visit(*GEAR, "t", "t", *PLAY, "f p 36 w 3 a 3", *ENTERS, "")
    screen = visit(*GEAR, "").screen
    assert "NEXT: Stop for today" in screen
    assert "OPEN: #3 is over the limit and cannot be restored today." in screen


def test_a_stop_that_the_day_forced_says_how_the_day_is_changed(visit: Visit) -> None:
    visit(*GEAR, "t", "t", *PLAY, "f p 36 w 3 a 3", *ENTERS, "")
    screen = visit(*GEAR, "").screen
    assert "w none = spare at hand" in screen.replace("\u00a0", " ")
    assert "c none" not in screen.replace("\u00a0", " ")


def test_nothing_is_left_to_undo_once_all_changes_are(visit: Visit, store: SessionStore) -> None:
    visit(*FIRST)
    visit(*GEAR, "y", "36")
    visit(*GEAR, "u")
    assert "undo" not in visit(*GEAR, "").screen


def test_a_repair_is_recorded_and_taken_back_with_its_record(
    visit: Visit, store: SessionStore
) -> None:
    visit(*FIRST)
    visit(*GEAR, "n 3 5", "3", "3")
    (repair,) = life(store).repairs
    assert repair.joints == {3, 5}
    visit(*GEAR, "u")
    assert life(store).repairs == ()
    assert life(store).inspections[-1].inspection.clearance_in[3] == 0.009


@pytest.mark.parametrize("repair", [("n 3 5", "3", "3"), ("g corrected",)])
def test_a_repair_that_is_taken_back_does_not_count_in_the_verdict_then(
    visit: Visit, store: SessionStore, repair: tuple[str, ...]
) -> None:
    visit(*FIRST)
    visit(*GEAR, "y", "36")
    before = visit(*GEAR).screen
    visit(*GEAR, *repair)
    screen = visit(*GEAR, "u").screen
    assert next_of(visit(*GEAR).screen) == next_of(before)
    assert "what is older does not count" not in screen


def test_a_repair_is_taken_back_after_what_was_answered_since(
    visit: Visit, store: SessionStore
) -> None:
    visit(*FIRST)
    visit(*GEAR, "n 3 5", "3", "3")
    visit(*GEAR, "p 4")
    visit(*GEAR, "u")
    assert len(life(store).repairs) == 1
    visit(*GEAR, "u")
    assert life(store).repairs == ()


def test_a_repair_is_taken_back_after_a_re_rigging_was(visit: Visit, store: SessionStore) -> None:
    visit(*FIRST)
    visit(*GEAR, "n 3", "3")
    visit(*GEAR, "g corrected")
    visit(*GEAR, "u")
    visit(*GEAR, "u")
    assert life(store).repairs == ()


def test_a_second_repair_leaves_the_record_of_the_first(visit: Visit, store: SessionStore) -> None:
    visit(*FIRST)
    visit(*GEAR, "n 3", "3")
    visit(*GEAR, "n 5", "3")
    assert [repair.joints for repair in life(store).repairs] == [{3}, {5}]


def test_a_re_rigging_after_a_repair_asks_for_no_clearance_again(visit: Visit) -> None:
    visit(*FIRST)
    visit(*GEAR, "n 3", "3")
    assert "SHORT LINK INNER BEARING" not in visit(*GEAR, "g corrected").screen


def test_a_re_rigging_after_a_repair_is_taken_back_alone(visit: Visit, store: SessionStore) -> None:
    visit(*FIRST)
    visit(*GEAR, "n 3", "3")
    visit(*GEAR, "g corrected")
    assert [r.joints for r in life(store).repairs][-2:] == [{3}, set()]
    visit(*GEAR, "u")
    assert [r.joints for r in life(store).repairs] == [{3}]


def test_a_repair_that_was_recorded_elsewhere_opens_its_joints(
    visit: Visit, store: SessionStore
) -> None:
    visit(*FIRST)
    day = date.today().isoformat()
    mlg("history", "repair", "N1", "LH", "--joint", "3", "--date", day, "--store", store.place)
    screen = visit(*GEAR, "y", "3").screen
    assert "Restored since, as the records say: #3" in screen
    assert life(store).inspections[-1].inspection.clearance_in[3] == 0.0015


def test_a_stale_window_leaves_out_nothing_that_another_one_entered(
    visit: Visit, store: SessionStore, capsys: pytest.CaptureFixture
) -> None:
    gear = load_gear()
    find = partial(last_visit, Store(store.place), gear, "N1", Side.LH)
    visit(*SOUND)
    begun = find()
    # Another window goes on meanwhile, and reads the plunger beyond its margin.
    visit(*GEAR, "y", "36")
    newest = find()
    assert begun is not None
    assert newest is not None
    ended = begun.answers.with_joint(1, JointAnswer(parse_reading("6 thou")))
    read = ended.inspection(gear, begun.record.record_id)
    found, before = continued(read, ended, newest, gear)
    assert before is newest
    assert found.readings_in == (0.036,)
    assert found.clearance_in[1] == pytest.approx(0.003)
    assert "was changed meanwhile" in capsys.readouterr().err


def test_two_entries_of_one_gear_begun_in_one_second_are_both_kept(
    store: SessionStore, monkeypatch: pytest.MonkeyPatch
) -> None:
    second = datetime(2026, 3, 4, 8, 0)
    asked = partial(ask_inspection, now=lambda: second)
    monkeypatch.setattr("mlg_troubleshoot.cli.output.can_ask", lambda: True)
    for clearance, begins in (("1", ()), ("2", ("n",))):
        typed = [*GEAR, *begins, "t", "t", *[clearance] * 10, "f", *ENTERS, "", ""]
        terminal = ScriptedTerminal(typed)
        monkeypatch.setattr("mlg_troubleshoot.cli.prompts.ask_inspection", asked)
        monkeypatch.setattr("mlg_troubleshoot.cli.prompts.RichTerminal", lambda t=terminal: t)
        Run([], Flags(), Tables(), Wanted(store=str(store.place))).run()
    assert len(life(store).inspections) == 2


def test_an_entry_broken_off_at_an_offer_leaves_no_empty_draft(
    visit: Visit, store: SessionStore
) -> None:
    broken_off(visit, *GEAR, "t", "t", "8", "9")
    broken_off(visit, *GEAR)
    session = store.latest()
    assert session is not None
    assert len(session.answers.joints) == 2
    assert len(store._newest_first()) == 1


def test_an_entry_without_a_reading_does_not_stand_before_one_with_readings(
    visit: Visit, store: SessionStore
) -> None:
    broken_off(visit, *GEAR, "t", "t", "8", "9")
    broken_off(visit, "N2", "l")
    session = store.latest()
    assert session is not None
    assert session.answers.tail_no == "N1"


def test_enter_at_the_tail_number_goes_on_with_the_unfinished_entry(
    visit: Visit, store: SessionStore
) -> None:
    broken_off(visit, *GEAR, "t", "t", *PLAY[:9])
    visit("", PLAY[9], "f", *ENTERS, "")
    assert len(life(store).inspections[-1].inspection.clearance_in) == 10


def test_resume_lists_the_unfinished_entries_of_other_gears(
    visit: Visit, store: SessionStore
) -> None:
    broken_off(visit, *GEAR, "t", "t", "8")
    broken_off(visit, "N2", "r", "t", "t", "8")
    flags = Flags(tail="N1", side="LH")
    screen = visit(*PLAY[1:], *ENTERS, "", resume=True, flags=flags).screen
    assert "Unfinished: N2 RH" in screen
    assert len(life(store).inspections) == 1


def test_resume_of_a_named_gear_finds_its_entry_that_has_no_reading_yet(
    visit: Visit, store: SessionStore
) -> None:
    broken_off(visit, "N2", "r", "t", "t", "8")
    broken_off(visit, "N1")
    flags = Flags(tail="N1", side="LH")
    visit("t", "t", *PLAY, *ENTERS, "", resume=True, flags=flags)
    assert len(life(store).inspections) == 1


def test_a_resumed_visit_asks_for_nothing_that_it_knows(visit: Visit, store: SessionStore) -> None:
    broken_off(visit, *GEAR, "t", "t", *PLAY, "f", "", "WO-7", "")
    screen = visit("2100", "", "", "", resume=True).screen
    assert "Work order" not in screen
    found = life(store).inspections[-1].inspection
    assert (found.carried["work_order"], found.gear_landings) == ("WO-7", 2100.0)


def test_a_continued_entry_that_was_broken_off_goes_on_where_it_stood(
    visit: Visit, store: SessionStore
) -> None:
    visit(*FIRST)
    broken_off(visit, *GEAR, "n 3 5", "4")
    visit("3", resume=True)
    found = life(store).inspections[-1].inspection
    assert (found.clearance_in[3], found.clearance_in[5]) == (0.002, 0.0015)


def test_two_entries_that_go_on_with_one_inspection_are_both_kept(
    visit: Visit, store: SessionStore
) -> None:
    visit(*FIRST)
    broken_off(visit, *GEAR, "n 3", "4")
    visit(*GEAR, "n", *("t", "t"), *["4"] * 10, *ENTERS, "")
    assert len(life(store).inspections) == 2


def test_the_word_today_is_a_date(visit: Visit, store: SessionStore) -> None:
    visit(*GEAR, "t", "t", *PLAY, "", "", "today", "", "", "", "")
    assert life(store).inspections[-1].inspection.inspection_date == date.today()


def test_a_date_with_one_reading_is_taken(visit: Visit, store: SessionStore) -> None:
    visit(*GEAR, "t", "t", *PLAY, "", "", "31/10/26", "", "", "", "")
    assert life(store).inspections[-1].inspection.inspection_date == date(2026, 10, 31)


def test_q_after_a_result_ends_as_enter_does(visit: Visit, store: SessionStore) -> None:
    visit(*FIRST, "q")
    assert len(life(store).inspections) == 1


def test_one_inspection_is_said_to_be_one(visit: Visit, capsys: pytest.CaptureFixture) -> None:
    visit(*FIRST)
    assert "1 inspection kept" in capsys.readouterr().err


def test_a_gear_is_followed_over_four_visits_to_done_with_half_the_keys(
    visit: Visit, store: SessionStore
) -> None:
    visits = (
        FIRST,
        (*GEAR, "y", "36"),
        (*GEAR, "y", "18", "y", "", "3", "3"),
        (*GEAR, "y", "4", "y", "r"),
    )
    keys = sum(visit(*typed).keystrokes for typed in visits)
    gear = load_gear()
    (judged,) = judge_lives([life(store)], gear, load_index_table(gear))
    assert judged.now is not None
    assert judged.now.plan.steps[0].action is Action.DONE
    # 261 keys where each visit types all that is known again, with the prompts that asked for no
    # landings.
    assert keys <= 261 / 2


@pytest.mark.parametrize(
    ("corrected", "gear"), [(("side", "r"), "N1 RH"), (("tail", "N2"), "N2 LH")]
)
def test_a_corrected_tail_or_side_moves_the_inspection(
    visit: Visit, store: SessionStore, corrected: tuple[str, ...], gear: str
) -> None:
    visit(*FIRST)
    visit(*GEAR, "c", *corrected, "")
    fleet = mlg("fleet", "--json", "--no-forecast", "--store", store.place).json["gears"]
    assert [f"{each['tail_no']} {each['side']}" for each in fleet] == [gear]


def test_a_visit_that_changes_nothing_appends_nothing(visit: Visit, store: SessionStore) -> None:
    visit(*FIRST)
    records = len(life(store).records)
    visit(*GEAR, "c", "")
    assert len(life(store).records) == records


@pytest.mark.parametrize("typed", ["8,5", "abc"])
def test_what_is_said_of_a_reading_at_a_prompt_is_not_about_files(visit: Visit, typed: str) -> None:
    screen = visit(*GEAR, "t", "t", typed, *PLAY, *ENTERS, "").screen
    assert "is not accepted" in screen
    assert "--decimal-comma" not in screen
    assert "leave it blank" not in screen


def test_done_of_a_gear_that_needed_no_repair_speaks_of_none(visit: Visit) -> None:
    screen = visit(*GEAR, "t", "t", *["3"] * 10, "r", *ENTERS, "").screen
    assert "DONE. r writes the report to sign." in screen


def test_done_is_said_with_the_report_one_key_away(visit: Visit, store: SessionStore) -> None:
    visit(*FIRST)
    visit(*GEAR, "y", "36")
    visit(*GEAR, "y", "18", "y", "", "3", "3")
    screen = visit(*GEAR, "y", "4", "y", "r").screen
    assert "DONE. The repair is in the records. r writes the report to sign." in screen
    assert life(store).repairs


def test_what_fails_again_on_the_day_of_its_repair_is_outside(
    visit: Visit, capsys: pytest.CaptureFixture
) -> None:
    visit(*FIRST)
    visit(*GEAR, "y", "36")
    visit(*GEAR, "y", "18", "y", "", "3", "3")
    capsys.readouterr()
    visit(*GEAR, "n", "t", "t", *PLAY, "f p 40", *ENTERS, "")
    shown = capsys.readouterr().out
    assert "OUTSIDE MARGIN, MEASURED" in shown
    assert "40.0 thou beyond" in shown
    assert "Read the plunger" not in shown.partition("NEXT")[2].partition("Expected")[0]


def test_joints_restored_after_a_plunger_beyond_its_margin_leave_it_to_be_read(
    visit: Visit, capsys: pytest.CaptureFixture
) -> None:
    visit(*GEAR, "t", "t", *["1"] * 10, "p 60", "n 6", *ENTERS, "")
    shown = capsys.readouterr().out
    assert "NEXT (12 min): Read the plunger" in shown
    assert "sign it off" not in shown.partition("Expected")[0]


def test_next_of_an_earlier_visit_is_said_in_the_unit_of_its_readings(visit: Visit) -> None:
    visit(*SOUND)
    visit(*GEAR, "y", "36")
    assert "The plunger is +36.0 thou off." in visit(*GEAR).screen


def test_a_result_of_the_prompts_names_no_column_of_a_file(
    visit: Visit, capsys: pytest.CaptureFixture
) -> None:
    visit(*SOUND)
    screen = visit(*GEAR, "y", "36", "n 3", "3").screen
    shown = screen + capsys.readouterr().out
    assert "Check rigging and lock roller" in shown
    assert "is older than the repair and does not count" in shown
    for column in ("rigging_checked", "outcome_date", "plunger_date"):
        assert column not in shown


def test_of_a_gear_of_which_only_the_failure_is_known_the_plunger_is_read_first(
    visit: Visit,
) -> None:
    screen = visit(*GEAR, "t", "t", "done", "f", *ENTERS, "").screen
    assert "y = I did NEXT" in screen
    assert "NEXT: Read the plunger" in visit(*GEAR).screen


def test_the_unit_that_was_chosen_before_any_clearance_is_not_asked_again(
    visit: Visit, store: SessionStore
) -> None:
    screen = visit(*GEAR, "t", "t", "done", "f", *ENTERS, "", "y", "36").screen
    assert screen.count("Unit > ") == 1
    assert life(store).inspections[-1].inspection.readings_in == (0.036,)


@pytest.mark.parametrize("did", [("y", ".0310"), ("y", ".0280"), ("p .0280",)])
def test_a_second_reading_of_the_plunger_stands_with_the_first(
    visit: Visit, store: SessionStore, did: tuple[str, ...]
) -> None:
    visit(*GEAR, "i", "t", *[".005"] * 10, "f p .0310", *ENTERS, "")
    assert "once more: it is too close to its margin" in visit(*GEAR).screen
    visit(*GEAR, *did)
    second = float(did[-1].removeprefix("p "))
    assert life(store).inspections[-1].inspection.readings_in == (0.031, second)
    assert "once more" not in visit(*GEAR).screen


def test_a_reading_of_the_plunger_that_is_corrected_takes_the_place_of_both(
    visit: Visit, store: SessionStore
) -> None:
    visit(*GEAR, "i", "t", *[".005"] * 10, "f p .0310", *ENTERS, "")
    visit(*GEAR, "y", ".0280")
    visit(*GEAR, "c", "more", "p .0400", "", "")
    assert life(store).inspections[-1].inspection.readings_in == (0.04,)


def test_the_history_of_a_gear_reads_like_a_log_book(visit: Visit, store: SessionStore) -> None:
    sign_off = ("", "", "", "4000", "J. Smith", "G1", "")
    visit(*GEAR, "t", "t", "8", "11", "26", "6", "14", "done", "f p 46", *sign_off)
    visit(*GEAR, "n 3 5", "1.5", "1")
    visit(*GEAR, "p 12")
    visit(*GEAR, "y", "r")
    kept = ("--no-forecast", "--store", str(store.place), "--show", "thou")
    by = "total play, measured by J. Smith"
    told = mlg("history", "N1", "LH", "--json", *kept).json["events"]
    assert [event["text"] for event in told if event["kind"] != "verdict"] == [
        *("FAILED", "plunger +0.046 in", f"#3 26 thou (limit 15), {by}"),
        *(f"#{n} {thou} thou, {by}" for n, thou in ((1, 8), (2, 11), (4, 6), (5, 14))),
        *("restored #3, #5", f"#3 1.5 thou, {by}", f"#5 1 thou, {by}"),
        *("plunger +0.012 in", "RETRACTED"),
    ]
    shown = mlg("history", "N1", "LH", *kept).out
    assert "plunger +46 thou" in shown
    assert "correct" not in shown


def test_only_what_is_changed_by_hand_is_called_a_correction(
    visit: Visit, store: SessionStore
) -> None:
    visit(*FIRST)
    visit(*GEAR, "c", "3", "2.6", "", "")
    told = mlg("history", "N1", "LH", "--json", "--no-forecast", "--store", str(store.place)).json
    corrections = [event["text"] for event in told["events"] if event["kind"] == "correction"]
    assert corrections == ["correction: #3 18 thou → 2.6 thou"]
