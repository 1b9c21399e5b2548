"""Every answer is saved at once; an interrupted inspection can be resumed; damage is said in plain
words.
"""

from __future__ import annotations

import json
import shutil
import sqlite3
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from time import monotonic

import pytest

from mlg_troubleshoot.cli.check import Flags, Wanted
from mlg_troubleshoot.cli.check_run import Run
from mlg_troubleshoot.cli.options import Tables
from mlg_troubleshoot.cli.prompts import (
    Answers,
    EntryInterruptedError,
    Session,
    SessionFileError,
    SessionStore,
    ask_inspection,
)
from mlg_troubleshoot.cli.prompts.flow import Flow
from mlg_troubleshoot.cli.prompts.store import read_session
from mlg_troubleshoot.decision.inspection import Side
from mlg_troubleshoot.errors import OutputError, UsageError
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.store import Draft, Drafts, Store, StoreError
from mlg_troubleshoot.units import LengthUnit
from mlg_troubleshoot.workflows.check import CheckResult
from tests.prompts.scripted import (
    ENTERS,
    NOON,
    NOTHING,
    PLAY_INCHES,
    RADIAL_INCHES,
    ScriptedTerminal,
    inspect,
    play,
)

TEN = [".004"] * 10
HEADING = ["N123AB", "l", "i", "r"]


def interrupted(
    gear: Gear, store: SessionStore, typed: list[str], preset: Answers = NOTHING, **more
) -> tuple[ScriptedTerminal, EntryInterruptedError]:
    terminal = ScriptedTerminal(typed, more.pop("end", EOFError))
    with pytest.raises(EntryInterruptedError) as caught:
        ask_inspection(gear, terminal, store, preset, now=lambda: NOON, **more)
    return terminal, caught.value


def drafts(store: SessionStore) -> list[Draft]:
    return Drafts(Store(store.place)).newest_first()


def put_raw(store: SessionStore, content: str) -> None:
    """Put a draft into the store past everything that judges it."""
    assert Drafts(Store(store.place)).save(Draft("bad", store.owner, "another", False, content), ())


def latest(store: SessionStore) -> Session:
    session = store.latest()
    assert session is not None
    return session


# Saving.


def test_every_answer_is_on_disk_before_the_next_question(gear: Gear, store: SessionStore) -> None:
    counts = []

    class Watching(ScriptedTerminal):
        def ask(self, prompt: str) -> str:
            session = store.latest()
            counts.append(0 if session is None else len(session.answers.joints))
            return super().ask(prompt)

    ask_inspection(gear, Watching([*HEADING, *TEN, *ENTERS, ""]), store, NOTHING)
    assert counts == [0, 0, 0, 0, *range(10), *[10] * 7]


def test_what_another_user_of_the_store_has_not_finished_is_not_offered(
    gear: Gear, store: SessionStore
) -> None:
    interrupted(gear, replace(store, owner="anna"), [*HEADING, ".004"])
    assert replace(store, owner="ben").latest() is None
    assert latest(replace(store, owner="anna")).answers.radial_in == {1: 0.004}


def test_one_session_is_one_draft(gear: Gear, store: SessionStore) -> None:
    interrupted(gear, store, [*HEADING, *TEN])
    assert len(drafts(store)) == 1


def test_a_draft_is_not_a_record_and_in_no_chain(gear: Gear, store: SessionStore) -> None:
    interrupted(gear, store, [*HEADING, *TEN])
    assert (Store(store.place).all(), Store(store.place).verify()) == ([], (0, None))


def test_a_save_that_fails_leaves_what_was_saved_before_it(gear: Gear, store: SessionStore) -> None:
    interrupted(gear, store, [*HEADING, ".004"])
    before = latest(store)
    with closing(sqlite3.connect(store.place)) as raw, raw:
        raw.execute(
            "CREATE TRIGGER other BEFORE INSERT ON mlg_drafts BEGIN SELECT RAISE(ABORT, 'not"
            " now'); END"
        )
    with pytest.raises(
        OutputError, match=r"answers cannot be saved: .*a trigger that may change records"
    ):
        store.save(replace(before, complete=True))
    assert store.latest() == before


def test_an_answer_does_not_wait_long_for_another_writer(gear: Gear, store: SessionStore) -> None:
    interrupted(gear, store, [*HEADING, ".004"])
    with Store(store.place).transaction(writing=True):
        start = monotonic()
        with pytest.raises(OutputError, match="answers cannot be saved"):
            store.save(latest(store))
    assert monotonic() - start < 20.0


def test_drafts_are_kept_in_a_store_that_was_made_without_them(
    gear: Gear, store: SessionStore
) -> None:
    shutil.copy(Path(__file__).parents[1] / "store" / "data" / "version-1.sqlite", store.place)
    records = Store(store.place).all()
    interrupted(gear, store, [*HEADING, ".004"])
    assert len(drafts(store)) == 1
    assert Store(store.place).all() == records


def test_a_session_reads_back_as_it_was_saved(gear: Gear, store: SessionStore) -> None:
    typed = [
        ".0205",
        "y",
        "s",
        "0.33 mm",
        "b",
        "b",
        "b",
        "b",
        "b",
        "t",
        "n",
        "done",
        "f p -.041 in m .028 in",
    ]
    answers = play(Flow(gear), typed).state.answers
    session = Session("one", gear.id, NOON, answers)
    saved = store.save(session)
    assert read_session(drafts(store)[0]) == saved == replace(session, writer=store.run)


# Stopping.


@pytest.mark.parametrize("end", [EOFError, KeyboardInterrupt])
def test_ctrl_c_and_ctrl_d_say_how_to_resume(
    gear: Gear, store: SessionStore, end: type[BaseException]
) -> None:
    terminal, _ = interrupted(gear, store, [*HEADING, ".004"], end=end)
    assert terminal.screen.rstrip().endswith("Saved. Resume it with:  mlg check --resume")


def test_q_is_the_same_as_ctrl_c(gear: Gear, store: SessionStore) -> None:
    terminal, stopped = interrupted(gear, store, [*HEADING, ".004", "q", "not typed any more"])
    assert "mlg check --resume" in terminal.screen
    assert stopped.session_id == latest(store).id


def test_a_stop_is_a_keyboard_interrupt() -> None:
    assert issubclass(EntryInterruptedError, KeyboardInterrupt)


def test_a_stop_before_the_first_answer_saves_nothing(gear: Gear, store: SessionStore) -> None:
    terminal, stopped = interrupted(gear, store, [])
    assert (stopped.session_id, drafts(store)) == (None, [])
    assert "Nothing was saved." in terminal.screen


# Resuming.


def test_a_resumed_inspection_goes_on_at_the_first_open_joint(
    gear: Gear, store: SessionStore
) -> None:
    interrupted(gear, store, [*HEADING, ".004", ".005"])
    terminal, _ = interrupted(gear, store, [], saved=latest(store))
    assert "joint 3 of 10" in terminal.screen
    assert "joint 1 of 10" not in terminal.screen


def test_a_resumed_inspection_equals_an_uninterrupted_one(
    gear: Gear, store: SessionStore, tmp_path: Path
) -> None:
    interrupted(gear, store, [*HEADING, ".0205", "y", "s", "4 thou"])
    resumed = inspect(gear, store, [*TEN[:7], "f", *ENTERS, ""], saved=latest(store))
    straight = inspect(
        gear,
        SessionStore(tmp_path / "other.sqlite"),
        [*HEADING, ".0205", "y", "s", "4 thou", *TEN[:7], "f", *ENTERS, ""],
    )
    assert resumed == straight


def test_an_upper_end_of_a_reading_outlasts_an_interruption(
    gear: Gear, store: SessionStore
) -> None:
    interrupted(gear, store, [*HEADING, "<.002", "y"])
    resumed = inspect(gear, store, [*TEN[:9], *ENTERS, ""], saved=latest(store))
    assert str(resumed.entered[1]) == "<.002 in"


def test_a_resumed_inspection_stays_one_draft(gear: Gear, store: SessionStore) -> None:
    interrupted(gear, store, [*HEADING, ".004"])
    interrupted(gear, store, [".005"], saved=latest(store))
    assert len(drafts(store)) == 1


def test_an_unfinished_inspection_of_the_same_gear_is_offered_at_the_start(
    gear: Gear, store: SessionStore
) -> None:
    interrupted(gear, store, [*HEADING, ".004"])
    found = inspect(gear, store, ["n123ab", "l", "y", *TEN[:9], *ENTERS, ""])
    assert (found.tail_no, len(found.clearance_in)) == ("N123AB", 10)


def test_an_accepted_offer_leaves_one_draft(gear: Gear, store: SessionStore) -> None:
    interrupted(gear, store, [*HEADING, ".004"])
    interrupted(gear, store, ["N123AB", "l", "y", ".005"])
    assert len(drafts(store)) == 1
    assert len(latest(store).answers.joints) == 2


def test_a_declined_offer_is_not_made_again(gear: Gear, store: SessionStore) -> None:
    interrupted(gear, store, [*HEADING, ".004"])
    interrupted(gear, store, ["N123AB", "l", "n"])
    terminal, _ = interrupted(gear, store, ["N123AB", "l"])
    assert "is unfinished" not in terminal.screen


@pytest.mark.parametrize("heading", [["N123AB", "r"], ["N124AB", "l"]])
def test_an_inspection_of_another_gear_is_not_offered(
    gear: Gear, store: SessionStore, heading: list[str]
) -> None:
    interrupted(gear, store, [*HEADING, ".004"])
    terminal, _ = interrupted(gear, store, heading)
    assert "is unfinished" not in terminal.screen


def test_an_inspection_of_another_gear_type_is_not_offered(gear: Gear, store: SessionStore) -> None:
    interrupted(replace(gear, id="other"), store, [*HEADING, ".004"])
    terminal, _ = interrupted(gear, store, ["N123AB", "l"])
    assert "is unfinished" not in terminal.screen


def test_a_computed_inspection_is_not_unfinished(gear: Gear, store: SessionStore) -> None:
    inspect(gear, store, [*HEADING, *TEN, *ENTERS, ""])
    assert store.latest() is None
    assert store.unfinished(gear.id) == ((), ())


def test_a_computed_inspection_can_still_be_loaded_by_name(gear: Gear, store: SessionStore) -> None:
    inspect(gear, store, [*HEADING, *TEN, *ENTERS, ""])
    session = read_session(drafts(store)[0])
    assert len(inspect(gear, store, [*ENTERS, ""], saved=session).clearance_in) == 10


def test_a_computed_inspection_that_is_taken_up_again_is_unfinished_again(
    gear: Gear, store: SessionStore
) -> None:
    inspect(gear, store, [*HEADING, *TEN, *ENTERS, ""])
    session = read_session(drafts(store)[0])
    interrupted(gear, store, ["10", ".005"], saved=session)
    assert latest(store).answers.radial_in[10] == 0.005


def test_the_latest_session_is_the_one_saved_last(gear: Gear, store: SessionStore) -> None:
    one, two = (
        store.save(Session(name, gear.id, NOON, play(Flow(gear), []).state.answers))
        for name in ("one", "two")
    )
    assert latest(store) == two
    store.save(one)
    assert latest(store) == one


def finish(gear: Gear, store: SessionStore, count: int) -> None:
    answers = play(Flow(gear), TEN).state.answers
    for n in range(count):
        store.finish(Session(f"s{n}", gear.id, NOON, answers))


def test_only_the_last_twenty_computed_inspections_are_kept(
    gear: Gear, store: SessionStore
) -> None:
    finish(gear, store, 23)
    assert {draft.id for draft in drafts(store)} == {f"s{n}" for n in range(3, 23)}


def test_pruning_never_takes_an_unfinished_inspection(gear: Gear, store: SessionStore) -> None:
    interrupted(gear, store, ["N9", "r", "i", "r", ".004"])
    finish(gear, store, 22)
    assert latest(store).answers.tail_no == "N9"


@pytest.mark.parametrize(
    "preset",
    [
        replace(RADIAL_INCHES, tail_no="N9"),
        replace(RADIAL_INCHES, side=Side.RH),
        replace(RADIAL_INCHES, unit=LengthUnit.MILLIMETRE),
        PLAY_INCHES,
    ],
)
def test_a_flag_that_contradicts_the_saved_inspection_is_refused(
    gear: Gear, store: SessionStore, preset: Answers
) -> None:
    interrupted(gear, store, [*HEADING, ".004"])
    with pytest.raises(UsageError, match="the saved inspection has"):
        inspect(gear, store, [], preset, saved=latest(store))


def test_an_inspection_of_another_gear_type_is_not_resumed(gear: Gear, store: SessionStore) -> None:
    interrupted(gear, store, [*HEADING, ".004"])
    with pytest.raises(UsageError, match="hawker-800xp"):
        inspect(replace(gear, id="other"), store, [], saved=latest(store))


# Damage.

_GOOD = {
    "schema_version": 1,
    "id": "bad",
    "gear": "hawker-800xp",
    "started": "2026-03-04T12:00:00",
    "record_id": None,
    "tail_no": "N123AB",
    "side": "LH",
    "unit": "in",
    "convention": "RADIAL",
    "joints": {"1": {"text": ".004", "unit": None, "confirmed": False}},
    "plunger_in": None,
    "margin_in": None,
    "outcome": None,
}


def test_the_undamaged_example_is_read(store: SessionStore) -> None:
    put(store)
    assert read_session(drafts(store)[0]).answers.radial_in == {1: 0.004}


@pytest.mark.parametrize(
    "content",
    [
        "",
        "{",
        "\x01",
        "[]",
        "{}",
        "null",
        "[" * 100_000,
        json.dumps({**_GOOD, "record_id": "x" * 2_000_000}),
        *(
            json.dumps({**_GOOD, **change})
            for change in (
                {"schema_version": 0},
                {"id": "other"},
                {"started": "yesterday"},
                {"started": 5},
                {"side": "left"},
                {"unit": "furlong"},
                {"convention": ["RADIAL"]},
                {"joints": {"one": None}},
                {"joints": {"1": {"text": "abc", "unit": None, "confirmed": False}}},
                {"joints": {"1": {"text": "4 mm", "unit": "in", "confirmed": False}}},
                {"joints": {"1": {"text": 0.004, "unit": None, "confirmed": False}}},
                {"joints": 3},
                {"tail_no": 7},
                {"tail_no": "N1\x1b[31m"},
                {"plunger_in": "wide"},
                {"schema_version": 2, "more": {"verdict": "WITHIN_MARGIN"}},
                {"schema_version": 2, "more": {"margin": 0.03}},
            )
        ),
    ],
)
def test_a_damaged_draft_is_said_with_what_to_do_and_is_not_in_the_way_again(
    store: SessionStore, content: str
) -> None:
    put_raw(store, content)
    with pytest.raises(SessionFileError, match=r"saved inspection bad is damaged") as caught:
        store.latest()
    assert caught.value.remedy.endswith("begin again with mlg check.")
    assert store.latest() is None
    assert drafts(store)[0].content == content[:1_000_000] * (len(content) <= 1_000_000)


def test_a_draft_of_a_million_characters_is_read_and_a_longer_one_is_not(
    store: SessionStore,
) -> None:
    kept = Drafts(Store(store.place))
    for length in (1_000_000, 1_000_001):
        kept.save(Draft(str(length), store.owner, "another", False, "x" * length), ())
    assert [len(draft.content) for draft in kept.newest_first()] == [0, 1_000_000]


def test_a_damaged_draft_does_not_stop_a_new_inspection(gear: Gear, store: SessionStore) -> None:
    put_raw(store, "{")
    terminal = ScriptedTerminal([*HEADING, *TEN, *ENTERS, ""])
    assert len(ask_inspection(gear, terminal, store, NOTHING).inspection.clearance_in) == 10
    assert terminal.screen.count("is damaged") == 1


def put(store: SessionStore, **changes: object) -> None:
    put_raw(store, json.dumps({**_GOOD, **changes}))


@pytest.mark.parametrize("value", [float("inf"), float("nan"), 4.0])
@pytest.mark.parametrize("column", ["plunger_in", "margin_in"])
def test_a_saved_length_that_cannot_be_is_not_taken_up_again(
    gear: Gear, store: SessionStore, column: str, value: float
) -> None:
    put(store, **{column: value})
    terminal, _ = interrupted(gear, store, ["q"], saved=read_session(drafts(store)[0]))
    assert "left out" in terminal.screen
    assert latest(store).answers.more == {}


def test_a_saved_clearance_that_cannot_be_is_asked_again(gear: Gear, store: SessionStore) -> None:
    put(store, joints={"1": {"text": "0.4", "unit": None, "confirmed": True}})
    terminal, _ = interrupted(gear, store, ["q"], saved=read_session(drafts(store)[0]))
    assert "asked again" in terminal.screen
    assert "joint 1 of 10" in terminal.screen


def test_what_an_older_version_saved_is_still_read(store: SessionStore) -> None:
    put(store, plunger_in=0.041, outcome="FAILED")
    assert read_session(drafts(store)[0]).answers.more == {
        "outcome": "FAILED",
        "plunger_displacement": "0.041 in",
    }


def test_what_a_newer_version_saved_is_kept_and_said_to_be_readable_there(
    store: SessionStore,
) -> None:
    put(store, schema_version=3, program="9.1.0", joints="unknown to this one")
    before = drafts(store)
    with pytest.raises(SessionFileError, match=r"was saved by mlg 9\.1\.0") as caught:
        store.latest()
    assert "It is kept: resume it in mlg 9.1.0 or later" in caught.value.remedy
    assert "amaged" not in caught.value.message
    assert drafts(store) == before


def test_two_windows_on_one_entry_keep_the_answers_of_both(gear: Gear, store: SessionStore) -> None:
    interrupted(gear, store, [*HEADING, ".001"])
    other = SessionStore(store.place)
    saved = latest(store)

    class Meanwhile(ScriptedTerminal):
        def ask(self, prompt: str) -> str:
            if not self.keystrokes:
                interrupted(gear, other, [".007"], saved=saved)
            return super().ask(prompt)

    terminal = Meanwhile([".002", ".003"])
    with pytest.raises(EntryInterruptedError):
        ask_inspection(gear, terminal, SessionStore(store.place), NOTHING, saved=saved)
    assert "another window has continued" in terminal.screen
    kept = {tuple(read_session(draft).answers.radial_in.values()) for draft in drafts(store)}
    assert kept == {(0.001, 0.007), (0.001, 0.002, 0.003)}


def test_an_entry_stays_open_until_its_result_was_shown(gear: Gear, store: SessionStore) -> None:
    terminal = ScriptedTerminal([*HEADING, *TEN, *ENTERS, ""])
    entry = ask_inspection(gear, terminal, store, NOTHING, now=lambda: NOON)
    assert latest(store).answers == entry.session.answers


def test_a_finished_entry_is_corrected_from_its_review(gear: Gear, store: SessionStore) -> None:
    terminal = ScriptedTerminal([*HEADING, *TEN, *ENTERS, ""])
    entry = ask_inspection(gear, terminal, store, NOTHING, now=lambda: NOON)
    found = inspect(gear, store, ["3", ".005", ""], saved=entry.session)
    assert (found.clearance_in[3], found.record_id) == (0.005, entry.inspection.record_id)


def test_an_unfinished_entry_is_mentioned_at_the_next_start(
    gear: Gear, store: SessionStore
) -> None:
    interrupted(gear, store, [*HEADING, ".001"])
    terminal, _ = interrupted(gear, store, ["N9"])
    assert "Unfinished: N123AB LH, begun 2026-03-04 12:00, 1 measured." in terminal.screen


def test_without_a_store_no_latest_session_is_found_or_made(store: SessionStore) -> None:
    assert store.latest() is None
    assert not Path(store.place).exists()


def test_a_store_that_cannot_be_written_is_said_once_and_the_inspection_goes_on(
    gear: Gear, tmp_path: Path
) -> None:
    (tmp_path / "file").write_text("")
    terminal = ScriptedTerminal([*HEADING, *TEN, *ENTERS, ""])
    found = ask_inspection(
        gear, terminal, SessionStore(tmp_path / "file" / "store.sqlite"), NOTHING
    )
    assert len(found.inspection.clearance_in) == 10
    assert terminal.screen.count("answers cannot be saved") == 1


def test_a_stop_does_not_promise_a_resume_that_cannot_be(gear: Gear, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    terminal, stopped = interrupted(
        gear, SessionStore(tmp_path / "file" / "store.sqlite"), [*HEADING, ".004"]
    )
    assert stopped.session_id is None
    assert "--resume" not in terminal.screen
    assert "could not be saved" in terminal.screen


def test_an_entry_whose_result_could_not_be_kept_stays_unfinished(
    gear: Gear, store: SessionStore, monkeypatch: pytest.MonkeyPatch
) -> None:
    terminal = ScriptedTerminal([*HEADING, *TEN, *ENTERS, ""])
    monkeypatch.setattr("mlg_troubleshoot.cli.prompts.RichTerminal", lambda: terminal)

    monkeypatch.setattr("mlg_troubleshoot.cli.output.can_ask", lambda: True)

    def refused(_run: Run, _result: CheckResult, _before: object) -> None:
        raise StoreError("kept already with other content", "Give it its own record_id.")

    monkeypatch.setattr(Run, "_keep", refused)
    wanted = Wanted(store=str(store.place), as_json=True)
    with pytest.raises(StoreError):
        Run([], Flags(), Tables(), wanted).run()
    assert len(latest(store).answers.joints) == 10


# A server that cannot be reached for a while.


@pytest.fixture
def server(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> SessionStore:
    """A store on a server that is not there, and a data folder of the user's own."""
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path / "data"))
    return SessionStore("postgresql+psycopg://nobody@127.0.0.1:1/none")


def back_again(server: SessionStore, tmp_path: Path) -> SessionStore:
    """The server is back; here it is a SQLite store addressed as one is."""
    return replace(server, place=f"sqlite:///{tmp_path}/server.sqlite", away="")


def test_while_a_server_is_away_the_answers_are_saved_on_this_machine(
    gear: Gear, server: SessionStore
) -> None:
    terminal, stopped = interrupted(gear, server, [*HEADING, ".004"])
    assert latest(server).answers.radial_in == {1: 0.004}
    assert terminal.screen.count("the server cannot be reached") == 1
    assert stopped.session_id is not None


def test_when_the_server_is_back_the_entry_goes_on_there(
    gear: Gear, server: SessionStore, tmp_path: Path
) -> None:
    interrupted(gear, server, [*HEADING, ".004"])
    there = back_again(server, tmp_path)
    there.save(latest(there))
    assert [len(drafts(there)), len(drafts(replace(server, place=None)))] == [1, 0]


def test_what_was_answered_while_the_server_was_away_is_the_newer(
    gear: Gear, server: SessionStore, tmp_path: Path
) -> None:
    there = back_again(server, tmp_path)
    interrupted(gear, there, [*HEADING, ".004"])
    session = latest(there)
    server.save(replace(session, answers=replace(session.answers, tail_no="N9")))
    assert latest(there).answers.tail_no == "N9"


def test_a_file_that_cannot_be_written_is_not_exchanged_for_another(
    gear: Gear, tmp_path: Path, server: SessionStore
) -> None:
    (tmp_path / "file").write_text("")
    _, stopped = interrupted(
        gear, SessionStore(tmp_path / "file" / "store.sqlite"), [*HEADING, ".004"]
    )
    assert (stopped.session_id, replace(server, place=None).latest()) == (None, None)
