"""A gear that is known: what is kept of it, what NEXT asks for, and the way to DONE."""

from __future__ import annotations

import re
import webbrowser
from collections.abc import Callable
from dataclasses import replace
from datetime import date, datetime, timedelta, tzinfo
from pathlib import Path

import pytest

from mlg_troubleshoot.cli.check import Flags
from mlg_troubleshoot.decision.inspection import Inspection, Outcome
from mlg_troubleshoot.life.folding import GearLife
from mlg_troubleshoot.store import Store
from tests.cli.conftest import mlg
from tests.prompts.scripted import Sit, sitting
from tests.prompts.test_one_gear import TEN, failed, gear

Life = Callable[..., GearLife]
Now = Callable[..., Inspection]
Begun = Callable[..., None]
NEAR = failed("8", "11", "15.6", "6", "14", "done")
LIMIT = failed("8", "11", "26", "6", "14", "done")


def next_of(screen: str) -> str:
    return next(line for line in screen.splitlines() if line.startswith("NEXT"))


def test_a_known_gear_is_shown_with_the_next_that_stood_when_it_was_left(sit, capsys):
    sit(*failed(*TEN), "")
    left = capsys.readouterr().out
    sit("N1 LH", "")
    assert next_of(capsys.readouterr().out) == next_of(left)


def test_a_tail_is_known_under_each_of_its_spellings(sit: Sit, begun: Begun, life: Life) -> None:
    begun(*failed("8", "done"))
    sit("n-1 left", "p 40", "")
    assert [kept.inspection.readings_in for kept in life().inspections] == [(0.046,), (0.04,)]


def test_a_gear_that_is_opened_and_left_with_an_interrupt_was_not_lost(sit, begun, capsys):
    begun(*failed("8", "done"))
    screen = sit("N1 LH", end=KeyboardInterrupt).screen + capsys.readouterr().out
    assert "Nothing" not in screen
    assert not re.search(r"\d:\d\d:\d\d", screen)


def test_help_at_a_result_says_how_next_is_done(sit, begun):
    begun(*failed("8", "done"))
    assert "Release the hydraulic pressure" in sit("N1 LH", "?", "").screen


def test_what_is_read_where_next_asks_what_was_restored_is_of_the_new_joints(sit, life):
    sit(*LIMIT, "")
    screen = sit("N1 LH", "y", "#2 4", "2", "", "").screen
    repaired, after = (kept.inspection for kept in life().inspections[-2:])
    assert (repaired.restored_joints, repaired.clearance_in) == ((2,), {})
    assert after.clearance_in == {2: 0.002}, screen


def test_what_cannot_be_reached_changes_next_at_once(sit, capsys):
    sit(*LIMIT, "no spare 2", "cannot reach 5", "")
    said = capsys.readouterr().out
    assert [line.startswith("OPEN") for line in said.splitlines()].count(True) == 2


def test_what_is_open_on_the_other_side_is_said(sit, begun, capsys):
    begun(*failed("8", "done"))
    sit("N1 RH", "", "r", "", "done", "", "", "")
    sit("N1 RH", "")
    assert "Open on N1 LH:" in capsys.readouterr().err


def test_y_asks_only_for_what_next_asks_with_the_last_reading_beside(sit, begun):
    begun(*NEAR)
    terminal = sit("N1 LH", "y", "15.4", "")
    assert [prompt[:2] for prompt in terminal.prompts] == ["Ta", "En", "#2", "En"]
    assert f"last 15.6 thou on {date.today().isoformat()}" in terminal.prompts[2]


def test_enter_is_no_second_reading(sit: Sit, begun: Begun, now: Now) -> None:
    begun(*NEAR)
    sit("N1 LH", "y", "", "")
    found = now()
    assert (found.measured_again, found.clearance_in[2]) == ((), 0.0078)


def test_five_visits_lead_to_done_with_few_keys(sit, now, store, capsys):
    keys = sit(*LIMIT, "").keys
    readings = sum(len(each) + 1 for each in ("46", "8", "11", "26", "6", "14"))
    for typed in (("y", "", "", "4", "4"), ("y", "12"), ("y", "r")):
        keys += sit("N1 LH", *typed, "").keys - len("N1 LH\n")
    readings += sum(len(each) + 1 for each in ("4", "4", "12"))
    assert keys - readings <= 80
    found = now()
    assert 2 in found.restored_joints
    assert (found.outcome, found.standing_readings_in) == ("RETRACTED", (0.012,))
    assert "NEXT: Sign the repair off" in capsys.readouterr().out
    # On 80 columns too.
    assert "thou Sign the repair off" in mlg("fleet", "--store", store).out


def test_a_repair_waits_for_its_sign_off_whatever_else_is_typed(sit, begun, store, capsys):
    begun(*LIMIT)
    typed = ("restored 3", "", "", "sign off Kern", "y", "", "", "4", "y", "12", "y", "r")
    screen = sit("N1 LH", *typed, "#7 4", "").screen
    assert "  NEXT was: restore #2, #5.\n" in screen
    assert "✗ No repair can be signed off yet." in screen
    assert "NEXT: Sign the repair off" in next_of(capsys.readouterr().out[-900:])
    screen = sit("N1 LH", "n", "y", "sign off by A. Jones", "y", "").screen
    assert "Signed off by > " in screen
    assert "✓ signed off A. Jones\nd = details" in screen
    assert screen.count("✗ NEXT stays as it is.") == 2
    assert "NEXT: Nothing is required." in next_of(capsys.readouterr().out[-900:])
    log = mlg("history", "N1", "LH", "--store", store).out
    assert "signed off by A. Jones" in log


def test_a_repair_is_signed_off_where_the_chance_keeps_the_gear_close_to_its_margin(sit, capsys):
    """Joints at their limits but the restored one: the chance stays a little above 5 %."""
    read = "#1 8 #2 11 #3 26 #4 6 #5 14 #6 7.5 #7 7 #8 9 #9 10 #10 8"
    sit(*failed(read), "restored 3", "", "1", "p 17", "r", "")
    out = capsys.readouterr().out
    assert "CLOSE TO THE MARGIN" in out
    assert "NEXT: Sign the repair off" in next_of(out[-900:])
    sit("N1 LH", "sign off A. Jones", "")
    assert next_of(capsys.readouterr().out[-900:]).startswith("NEXT: Nothing is required.")


def test_what_was_repaired_elsewhere_ends_a_failure_once_the_gear_retracts(sit, capsys, store):
    """The plunger reads within its margin, and the gear failed: the selector valve leaked."""
    sit(*gear("f", "8", "#1 8 #2 8 #3 8 #4 6 #5 8 #6 7 #7 7 #8 9 #9 7 #10 8"), "")
    assert "Check hydraulics" in capsys.readouterr().out
    screen = sit("N1 LH", "repaired 3", "repaired selector valve on today", "").screen
    assert "✗ '3' names no part." in screen
    assert f"✓ other repair selector valve, repair date {date.today()}" in screen
    assert "Read the plunger displacement" in next_of(capsys.readouterr().out[-900:])
    sit("N1 LH", "p 8", "r", "")
    assert "NEXT: Sign the repair off" in capsys.readouterr().out[-900:]
    sit("N1 LH", "y", "A. Jones", "")
    assert "WITHIN MARGIN" in capsys.readouterr().out[-1200:]
    log = mlg("history", "N1", "LH", "--store", store).out
    assert "repaired selector valve" in log


def test_a_repair_without_a_failure_waits_for_its_sign_off_as_well(sit, capsys):
    sit(*gear("r", "4", "#3 18", "done"), "")
    sit("N1 LH", "restored 3", "", "", "")
    for typed in ("p 3", "#3 1"):
        capsys.readouterr()
        sit("N1 LH", typed, "")
        assert "NEXT: Sign the repair off" in next_of(capsys.readouterr().out[-450:])
    sit("N1 LH", "sign off A. Jones", "")
    assert next_of(capsys.readouterr().out[-450:]).startswith("NEXT: Nothing is required.")


def test_a_gauge_and_a_name_of_another_sitting_are_of_what_is_read_there(sit, begun, life):
    begun(*failed("8", "11", "done"))
    sit("N1 LH", "gauge G-07 0.4 thou", "name A. Jones", "#5 9", "")
    first, last = (visit.inspection for visit in life().visits)
    assert (first.gauge_id, first.technician_id) == ("G-03", "J. Smith")
    assert (last.gauge_id, last.technician_id) == ("G-07", "A. Jones")
    assert last.gauge_u_in == pytest.approx(0.0002)


def test_a_first_entry_that_began_with_a_repair_is_taken_back_whole(sit, life):
    typed = gear("restored 3", "f", "46", "#5 9", "done")
    sit(*typed, "u", "G-04", "", "")
    repair, found = (visit.inspection for visit in life().visits)
    assert (repair.restored_joints, found.gauge_id) == ((3,), "G-04")


def test_who_measured_what_stands_is_said_where_several_did(sit, begun, now):
    begun(*failed("8", "11", "done"))
    sit("N1 LH", "name A. Jones", "#5 9", "p 40", "")
    assert now().technician_id == "J. Smith (#3); A. Jones (#5, plunger)"


def test_a_colleague_who_did_not_read_the_gear_is_not_named_unasked(sit, begun, life):
    begun(*failed("8", "done"))
    sit("N2 LH", "", "r", "", "done", "A. Jones", "G-7", "")
    screen = sit("N1 LH", "#5 9", "F. Kern", "", "#3 7", "r", "").screen
    assert screen.count("Measured by (Enter: A. Jones)") == screen.count("(Enter: G-7)") == 1
    rows = [visit.inspection for visit in life().inspections[-3:]]
    assert [row.technician_id for row in rows] == ["F. Kern"] * 3


def test_a_day_or_a_name_is_not_changed_below_what_was_found(sit, life):
    typed = ("f", "", "#3 22", "name Pat Lee", "name Kim Roe", "date today", "done", "same")
    screen = sit("date yesterday", *gear(*typed)[:-2], "").screen
    assert "✗ Technician Pat Lee is that of what was typed before." in screen
    assert "✗ Date 20" in screen
    assert life().inspections[-1].inspection.technician_id == "Pat Lee"


def test_where_nothing_is_required_there_are_no_minutes_and_nothing_was_done(sit, capsys):
    screen = sit(*gear("r", "", "8", "11", "13", "6", "14", "done"), "").screen
    assert "y = I did NEXT" not in screen
    out = capsys.readouterr().out
    assert next_of(out).startswith("NEXT: Nothing is required. To show")
    assert "Expected after that" not in out


def test_a_failure_after_the_repair_on_its_day_counts(sit, begun, life, capsys):
    begun(*LIMIT)
    sit("N1 LH", "restored 2", "", "4", "")
    sit("N1 LH", "f p 40", "")
    said = capsys.readouterr().out
    assert "than the repair" not in said
    assert "OUTSIDE MARGIN, MEASURED" in said[said.rindex("N1 LH") :]


def test_last_weeks_forms_give_last_weeks_days(sit: Sit, life: Life, now: Now) -> None:
    head, rest = LIMIT[:3], LIMIT[3:]
    sit(*head, "date 2026-11-20", *rest, "")
    sit("N1 LH", "date 2026-11-25", "restored 2", "", "4", "p 12", "")
    days = [str(visit.at) for visit in life().visits]
    assert days == ["2026-11-20", *["2026-11-25"] * 3]
    assert now().standing_readings_in == (0.012,)
    assert now().clearance_in[2] == 0.002


def test_what_is_typed_before_and_after_a_repair_in_one_entry_stands_so(sit, life, now):
    asked = ("8", "11", "26", "restored 2", "p 12", "#2 4", "r", "#4 6", "done")
    screen = sit(*failed(*asked), "p 12", "#2 4", "").screen
    for refused in ("plunger displacement 46 thou", "#2 26 thou", "outcome FAILED"):
        assert f"{refused} was typed before the repair".lower() in screen.lower()
    found = [visit.inspection for visit in life().visits]
    assert [row.clearance_in for row in found[:3]] == [
        {3: 0.004, 5: 0.0055, 2: 0.013},
        {},
        {4: 0.003},
    ]
    assert [row.restored_joints for row in found] == [(), (2,), (), (), ()]
    assert (now().clearance_in[2], now().standing_readings_in) == (0.002, (0.012,))


# One day of a gear, as it is found and as it stands on the forms.
DAY = (
    failed("8", "11", "26", "6", "14", "done"),
    ("y", "", "", "4", "4"),
    ("p 12",),
    ("f p 40",),
    ("rigging corrected", "", "p 9"),
    ("r",),
)


def test_a_day_typed_live_and_typed_later_from_paper_is_one_log(tmp_path, monkeypatch):
    logs = []
    for late in (False, True):
        store = tmp_path / f"{late}.sqlite"
        sit = sitting(store, monkeypatch)
        today = date.today()
        if late:
            monkeypatch.setattr("mlg_troubleshoot.cli.prompts.entry.datetime", _Tomorrow)
        said = [f"date {today}"] * late
        first, *rest = DAY
        sit(*first[:3], *said, *first[3:], *(line for visit in rest for line in visit), "")
        logs.append([replace(r, recorded_at="", digest="") for r in Store(store).all()])
    assert logs[0] == logs[1]


class _Tomorrow(datetime):
    @classmethod
    def now(cls, tz: tzinfo | None = None) -> datetime:
        return datetime.now(tz) + timedelta(days=1)


@pytest.mark.parametrize(
    ("line", "undone"),
    [
        ("p 36", "plunger +36 thou"),
        ("r", "RETRACTED"),
        ("#3 9", "#3 9 thou"),
        ("rigging yes", "rigging checked"),
    ],
)
def test_an_undo_says_what_it_will_take_back(sit, begun, now, line, undone):
    begun(*failed("8", "done"))
    before = now()
    assert f"u = undo {undone}" in sit("N1 LH", line, "u", "").screen
    for field in ("readings_in", "outcome", "clearance_in", "rigging_checked"):
        assert getattr(now(), field) == getattr(before, field)


CORRECTIONS = {
    "plunger none": "correction of plunger displacement",
    "#3 none": "correction of #3",
    "landings 4000": "correction of landings since overhaul",
    "side RH landings 4000": "move to N1 RH",
}


@pytest.mark.parametrize("line", CORRECTIONS)
def test_an_undo_of_a_correction_brings_back_exactly_what_was_there(sit, begun, life, line, capsys):
    begun(*gear("f", "46; 41", "8", "done"))
    before = facts(life())
    asked = ["y"] * line.startswith("side")
    screen = sit("N1 LH", line, *asked, "u", "").screen
    assert ("side RH: what was typed for N1 LH moves there." in screen) == bool(asked)
    assert f"u = undo the {CORRECTIONS[line]}" in screen
    assert f"Undone: the {CORRECTIONS[line]}." in capsys.readouterr().err
    assert facts(life()) == before


def test_a_plunger_that_was_none_is_taken_out_of_the_visit_that_has_it(sit, begun, now, capsys):
    begun(*gear("f", "46; 41", "8", "done"))
    sit("N1 LH", "#5 7", "p none", "")
    assert now().readings_in == ()
    assert "Not changed" not in capsys.readouterr().err


def test_an_undo_of_a_doubted_reading_takes_back_no_visit_and_drops_nothing_else(sit, begun, now):
    begun(*failed("8", "done"))
    sit("N1 LH", "p 40", "#2 85 p 460 #3 9", "u", "u", "")
    assert (now().clearance_in, now().readings_in) == ({3: 0.0045}, (0.046, 0.04))


def test_undo_goes_back_visit_by_visit_to_the_beginning_of_the_sitting(sit, begun, life, capsys):
    begun(*LIMIT)
    sit("N1 LH", "p 40", "")
    sit("N1 LH", "restored 2", "", "4", "u", "u", "u", "")
    last = life().inspections[-1]
    said = " ".join(capsys.readouterr().err.split())
    assert f"mlg history void {last.kept.record_id} --why TEXT" in said
    assert life().repairs == ()
    assert last.inspection.readings_in == (0.04,)


def test_undo_of_a_first_entry_asks_again_from_its_last_answer(sit, life, now):
    screen = sit(
        *failed("8", "11", "done"), "u", "u", "u", "u", "7", "done", "", "", "x", ""
    ).screen
    assert "u = undo the last answer" in screen
    assert "– undone: gauge G-03\nGauge" in screen
    assert len(life().inspections) == 1
    assert now().clearance_in == {3: 0.004, 5: 0.0035}


def meanwhile(other: Callable[[], object], line: str) -> Callable[[], str]:
    """Type a line after something else happened in another window."""

    def first() -> str:
        other()
        return line

    return first


def facts(life: GearLife) -> list[tuple[object, ...]]:
    """What each visit of a gear says, in the order of the log."""
    return [
        (row.outcome, row.readings_in, dict(row.clearance_in))
        for row in (visit.inspection for visit in life.visits)
    ]


def test_two_first_visits_begun_in_two_windows_are_two_visits(sit, life, now):
    anna = ("radial", "f", "46", "#3 13", "done", "Anna", "", "")
    bert = ("N1 LH", "thou", "radial", "r", "8", "#5 4", "done", "Bert", "", "")
    sit("N1 LH", meanwhile(lambda: sit(*bert), "thou"), *anna)
    assert sorted(facts(life()), key=str) == [
        (Outcome.FAILED, (0.046,), {3: 0.013}),
        (Outcome.RETRACTED, (0.008,), {5: 0.004}),
    ]
    assert (now().outcome, now().readings_in) == (Outcome.FAILED, (0.008, 0.046))
    assert now().clearance_in == {3: 0.013, 5: 0.004}


@pytest.mark.parametrize(
    ("place", "typed"), [(1, ("#3 9", "p 50")), (2, ("p 50", "#3 9")), (3, ("#3 9", "p 50"))]
)
def test_two_windows_open_on_one_gear_lose_nothing_and_count_nothing_twice(
    sit, begun, life, now, place, typed
):
    begun(*failed("8", "done"))
    before = facts(life())
    lines = ["N1 LH", typed[0], "#1 2", "#4 3"]
    lines[place] = meanwhile(lambda: sit("N1 LH", typed[1], "#2 5", ""), lines[place])
    sit(*lines, "")
    after = facts(life())
    assert [each for each in after if each in before] == before
    told = [(j, v) for _, _, read in after if read for j, v in read.items()]
    own = {1: 0.001, 2: 0.0025, 3: 0.0045, 4: 0.0015}
    assert sorted(pair for pair in told if pair in own.items()) == sorted(own.items())
    assert sum(read == (0.05,) for _, read, _ in after) == 1
    assert {j: now().clearance_in[j] for j in own} == own
    assert now().readings_in == (0.046, 0.05)
    assert now().outcome is Outcome.FAILED


def test_a_new_inspection_of_a_known_gear_is_a_second_one(sit, begun, life):
    begun(*failed("8", "done"))
    terminal = sit("N1 LH", "new", "", "n", "", "#3", "9", "done", "", "", "")
    assert len(life().inspections) == 2
    assert any("last 8 thou on" in prompt for prompt in terminal.prompts)


def test_a_reading_that_was_none_is_taken_out_of_the_visit_that_has_it(
    sit, begun, now, capsys
) -> None:
    begun(*failed("8", "11", "done"))
    sit("N1 LH", "p 40", "#3 none", "")
    assert now().clearance_in == {5: 0.0055}
    assert "Not changed" not in capsys.readouterr().err


def test_a_reading_tighter_than_the_last_is_asked_about(sit: Sit, begun: Begun) -> None:
    begun(*LIMIT)
    screen = sit("N1 LH", "#2 6", "y", "").screen
    assert "#2 6 thou is tighter than 26 thou on" in screen


def test_a_word_that_nobody_knows_changes_nothing(sit: Sit, begun: Begun, life: Life) -> None:
    begun(*failed("8", "done"))
    records = len(life().entries)
    screen = sit("N1 LH", "46", "x", "plumger 4", "s", "n 3", "?", "").screen
    assert screen.count("is not understood") + screen.count("✗") >= 4
    assert len(life().entries) == records


def test_a_report_is_written_where_it_says_and_one_that_cannot_be_ends_nothing(
    sit: Sit, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture
) -> None:
    monkeypatch.chdir(tmp_path)
    opened: list[str] = []
    monkeypatch.setattr(webbrowser, "open", opened.append)
    sit(*failed("8", "done"), "report", "open", "")
    assert "Report: report" in capsys.readouterr().err
    (report,) = (tmp_path / "report").glob("*.html")
    assert opened == [report.as_uri()]
    assert report.name.count("N1-LH") == 1
    for file in (tmp_path / "report").iterdir():
        file.unlink()
    (tmp_path / "report").rmdir()
    (tmp_path / "report").write_text("in the way")
    sit("N1 LH", "report", "d", "")
    assert "No report was written" in capsys.readouterr().err


def test_another_gear_follows_without_a_new_start(sit: Sit, life: Life) -> None:
    sit(*failed("8", "done"), "gear", "N2 LH", "", "f", "", "9", "done", "", "", "")
    assert life().key == ("N1", "LH")
    assert life(tail="N2").key == ("N2", "LH")


def test_a_unit_changed_at_a_result_is_that_of_all_that_is_shown_and_typed_next(
    sit, begun, life, capsys
):
    begun(*failed("8", "done"))
    sit("N1 LH", "unit mm", "d", "#5 0.3", "p 1.1", "")
    assert " of 0.762 mm" in capsys.readouterr().out.rpartition("N1 LH")[2]
    found = [visit.inspection for visit in life().inspections]
    assert str(found[1].entered[5]) == "0.3 mm"
    assert found[2].readings_in == pytest.approx((1.1 / 25.4,))


def test_records_without_a_clearance_are_shown_in_the_unit_that_is_typed(sit, store) -> None:
    assert "u = undo plunger +41 thou" in sit(*gear("f", "46", "done"), "p 41", "").screen
    for command in ("history", "fleet"):
        assert "measured +46.0 of 30.0 thou" in mlg(command, "--store", store).out
    assert "plunger +46 thou" in mlg("history", "N1", "--store", store).out


def test_what_only_a_table_said_of_a_gear_stands(sit: Sit, now: Now, tmp_path: Path) -> None:
    table = tmp_path / "one.csv"
    table.write_text(
        "record_id,tail_no,side,clearance_convention,clearance_1_in,clearance_3_in,margin_in,"
        "no_spare,gauge_u_in,inspection_date\n"
        "R1,N1,LH,RADIAL,.004,.009,.028,4,.0004,2026-03-01\n"
    )
    mlg("check", table, "--keep", "--store", tmp_path / "store.sqlite")
    sit("p 36 thou", "", flags=Flags(tail="N1", side="LH"))
    found = now()
    assert (found.clearance_in, found.gauge_u_of(3)) == ({1: 0.004, 3: 0.009}, 0.0004)
    assert (found.margin_in, found.no_spare, found.readings_in) == (0.028, (4,), (0.036,))


def test_readings_of_another_convention_are_shown_in_that_of_today(sit, begun, life, capsys):
    begun(*failed("8", "done"))
    sit("N1 LH", "convention radial", "d", "")
    assert re.search(r"#3 short link inner bearing +4.0 +7.5 ", capsys.readouterr().out)
    sit("N1 LH", "new", "convention radial", "f", "", "#5 5", "done", "", "", "")
    sit("N1 LH", "#5 4", "")
    assert str(life().inspections[-1].inspection.entered[5]) == "4 thou"


@pytest.mark.parametrize(
    ("typed", "gear"),
    [
        (("#5 7", "p 38", "side RH"), ("RH", "N1")),
        (("#5 7", "#3 4", "tail N2", "y"), ("LH", "N2")),
        (("#5 7", "y", "tail N2", "9", "done"), ("LH", "N2")),
    ],
)
def test_a_corrected_tail_or_side_is_that_of_all_that_was_typed_here(
    sit, begun, life, gear, typed, capsys
):
    begun(*failed("8", "done"))
    sit("N1 LH", *typed, "")
    assert (len(life(*gear).inspections), len(life().inspections)) == (2, 1)
    said = f" entries from N1 LH to {gear[1]} {gear[0]}."
    assert said in capsys.readouterr().err


def test_an_undo_takes_a_corrected_side_back(sit, begun, life, capsys):
    begun(*failed("8", "done"))
    screen = sit("N1 LH", "#5 7", "p 38", "side RH", "u", "").screen
    assert "u = undo the move to N1 RH" in screen
    assert "Undone: the move to N1 RH." in capsys.readouterr().err
    assert len(life().inspections) == 3
