"""Every answer is saved at once; an interrupted inspection can be resumed; damage is said in plain words."""

from __future__ import annotations

import json
import os
import stat
from dataclasses import replace
from pathlib import Path

import pytest

from mlg_troubleshoot.cli.prompts import (
    EntryInterruptedError,
    Preset,
    Session,
    SessionFileError,
    SessionStore,
    ask_inspection,
)
from mlg_troubleshoot.cli.prompts.flow import Flow
from mlg_troubleshoot.cli.prompts.store import state_folder
from mlg_troubleshoot.decision.inspection import Side
from mlg_troubleshoot.errors import OutputError, UsageError
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.units import LengthUnit
from tests.prompts.scripted import NOON, NOTHING, PLAY_INCHES, RADIAL_INCHES, ScriptedTerminal, inspect, play

TEN = [".004"] * 10
HEADING = ["N123AB", "l", "i", "r"]


def interrupted(
    gear: Gear, store: SessionStore, typed: list[str], preset: Preset = NOTHING, **more
) -> tuple[ScriptedTerminal, EntryInterruptedError]:
    terminal = ScriptedTerminal(typed, more.pop("end", EOFError))
    with pytest.raises(EntryInterruptedError) as caught:
        ask_inspection(gear, terminal, store, preset, now=lambda: NOON, **more)
    return terminal, caught.value


def files(store: SessionStore) -> list[Path]:
    return sorted(store.folder.iterdir()) if store.folder.exists() else []


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

    ask_inspection(gear, Watching([*HEADING, *TEN, "", ""]), store, NOTHING)
    assert counts == [0, 0, 0, 0, *range(11), 10]


def test_only_the_owner_can_read_a_session(gear: Gear, store: SessionStore) -> None:
    interrupted(gear, store, HEADING)
    assert stat.S_IMODE(files(store)[0].stat().st_mode) == 0o600
    assert stat.S_IMODE(store.folder.stat().st_mode) == 0o700


def test_one_session_is_one_file(gear: Gear, store: SessionStore) -> None:
    interrupted(gear, store, [*HEADING, *TEN])
    assert len(files(store)) == 1


def test_a_save_that_fails_leaves_the_file_before_it(
    gear: Gear, store: SessionStore, monkeypatch: pytest.MonkeyPatch
) -> None:
    interrupted(gear, store, [*HEADING, ".004"])
    before = latest(store)

    def full(_handle: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(OutputError, match="No space left on device"):
        store.save(replace(before, complete=True))
    assert store.latest() == before
    assert len(files(store)) == 1


def test_a_session_reads_back_as_it_was_saved(gear: Gear, store: SessionStore) -> None:
    typed = [".0205", "y", "s", "0.33 mm", "b", "b", "b", "b", "b", "t", "n", "done", "f p -.041 in m .028 in"]
    answers = play(Flow(gear), typed).state.answers
    session = Session("one", gear.id, NOON, answers)
    store.save(session)
    assert store.load("one") == session


# Stopping.


@pytest.mark.parametrize("end", [EOFError, KeyboardInterrupt])
def test_ctrl_c_and_ctrl_d_say_how_to_resume(gear: Gear, store: SessionStore, end: type[BaseException]) -> None:
    terminal, _ = interrupted(gear, store, [*HEADING, ".004"], end=end)
    assert terminal.screen.rstrip().endswith("Saved. Go on later with:  mlg check --resume")


def test_q_is_the_same_as_ctrl_c(gear: Gear, store: SessionStore) -> None:
    terminal, stopped = interrupted(gear, store, [*HEADING, ".004", "q", "not typed any more"])
    assert "mlg check --resume" in terminal.screen
    assert stopped.session_id == latest(store).id


def test_a_stop_is_a_keyboard_interrupt() -> None:
    assert issubclass(EntryInterruptedError, KeyboardInterrupt)


def test_a_stop_before_the_first_answer_saves_nothing(gear: Gear, store: SessionStore) -> None:
    terminal, stopped = interrupted(gear, store, [])
    assert (stopped.session_id, files(store)) == (None, [])
    assert "Nothing was saved." in terminal.screen


# Resuming.


def test_a_resumed_inspection_goes_on_at_the_first_open_joint(gear: Gear, store: SessionStore) -> None:
    interrupted(gear, store, [*HEADING, ".004", ".005"])
    terminal, _ = interrupted(gear, store, [], saved=latest(store))
    assert "joint 3 of 10" in terminal.screen
    assert "joint 1 of 10" not in terminal.screen


def test_a_resumed_inspection_equals_an_uninterrupted_one(gear: Gear, store: SessionStore, tmp_path: Path) -> None:
    interrupted(gear, store, [*HEADING, ".0205", "y", "s", "4 thou"])
    resumed = inspect(gear, store, [*TEN[:7], "f", "", ""], saved=latest(store))
    straight = inspect(
        gear, SessionStore(tmp_path / "other"), [*HEADING, ".0205", "y", "s", "4 thou", *TEN[:7], "f", "", ""]
    )
    assert resumed == straight


def test_a_resumed_inspection_stays_one_file(gear: Gear, store: SessionStore) -> None:
    interrupted(gear, store, [*HEADING, ".004"])
    interrupted(gear, store, [".005"], saved=latest(store))
    assert len(files(store)) == 1


def test_an_unfinished_inspection_of_the_same_gear_is_offered_at_the_start(gear: Gear, store: SessionStore) -> None:
    interrupted(gear, store, [*HEADING, ".004"])
    found = inspect(gear, store, ["n123ab", "l", "y", *TEN[:9], "", ""])
    assert (found.tail_no, len(found.clearance_in)) == ("N123AB", 10)


def test_an_accepted_offer_leaves_one_file(gear: Gear, store: SessionStore) -> None:
    interrupted(gear, store, [*HEADING, ".004"])
    interrupted(gear, store, ["N123AB", "l", "y", ".005"])
    assert len(files(store)) == 1
    assert len(latest(store).answers.joints) == 2


def test_a_declined_offer_is_not_made_again(gear: Gear, store: SessionStore) -> None:
    interrupted(gear, store, [*HEADING, ".004"])
    interrupted(gear, store, ["N123AB", "l", "n"])
    terminal, _ = interrupted(gear, store, ["N123AB", "l"])
    assert "is unfinished" not in terminal.screen


@pytest.mark.parametrize("heading", [["N123AB", "r"], ["N124AB", "l"]])
def test_an_inspection_of_another_gear_is_not_offered(gear: Gear, store: SessionStore, heading: list[str]) -> None:
    interrupted(gear, store, [*HEADING, ".004"])
    terminal, _ = interrupted(gear, store, heading)
    assert "unfinished" not in terminal.screen


def test_an_inspection_of_another_gear_type_is_not_offered(gear: Gear, store: SessionStore) -> None:
    interrupted(replace(gear, id="other"), store, [*HEADING, ".004"])
    terminal, _ = interrupted(gear, store, ["N123AB", "l"])
    assert "unfinished" not in terminal.screen


def test_a_computed_inspection_is_not_unfinished(gear: Gear, store: SessionStore) -> None:
    inspect(gear, store, [*HEADING, *TEN, "", ""])
    assert store.latest() is None
    assert store.unfinished(gear.id, "N123AB", Side.LH) == (None, ())


def test_a_computed_inspection_can_still_be_loaded_by_name(gear: Gear, store: SessionStore) -> None:
    inspect(gear, store, [*HEADING, *TEN, "", ""])
    session = store.load(files(store)[0].stem)
    assert len(inspect(gear, store, ["", ""], saved=session).clearance_in) == 10


def test_a_computed_inspection_that_is_taken_up_again_is_unfinished_again(gear: Gear, store: SessionStore) -> None:
    inspect(gear, store, [*HEADING, *TEN, "", ""])
    session = store.load(files(store)[0].stem)
    interrupted(gear, store, ["b", ".005"], saved=session)
    assert latest(store).answers.radial_in[10] == 0.005


def test_the_latest_session_is_the_one_saved_last(gear: Gear, store: SessionStore) -> None:
    for name in ("one", "two"):
        store.save(Session(name, gear.id, NOON, play(Flow(gear), []).state.answers))
    os.utime(store.folder / "one.json", ns=(10**18, 2 * 10**18))
    os.utime(store.folder / "two.json", ns=(10**18, 10**18))
    assert latest(store).id == "one"


def finish(gear: Gear, store: SessionStore, count: int) -> None:
    answers = play(Flow(gear), TEN).state.answers
    for n in range(count):
        store.finish(Session(f"s{n}", gear.id, NOON, answers))


def test_only_the_last_twenty_computed_inspections_are_kept(gear: Gear, store: SessionStore) -> None:
    finish(gear, store, 23)
    assert {path.stem for path in files(store)} == {f"s{n}" for n in range(3, 23)}


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
    gear: Gear, store: SessionStore, preset: Preset
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
    "complete": False,
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
    store.folder.mkdir()
    (store.folder / "bad.json").write_text(json.dumps(_GOOD))
    assert store.load("bad").answers.radial_in == {1: 0.004}


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"{",
        b"\xff\xfe\x00",
        b"[]",
        b"{}",
        b"null",
        b"[" * 100_000,
        *(
            json.dumps({**_GOOD, **change}).encode()
            for change in (
                {"schema_version": 2},
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
                {"plunger_in": "0.04"},
                {"outcome": "EXPLODED"},
            )
        ),
    ],
)
def test_a_damaged_file_is_named_with_what_to_do(store: SessionStore, content: bytes) -> None:
    store.folder.mkdir()
    path = store.folder / "bad.json"
    path.write_bytes(content)
    with pytest.raises(SessionFileError, match=r"bad\.json: this saved inspection is damaged") as caught:
        store.latest()
    assert caught.value.remedy == "Delete the file and begin again."


def test_a_damaged_file_does_not_stop_a_new_inspection(gear: Gear, store: SessionStore) -> None:
    store.folder.mkdir()
    (store.folder / "bad.json").write_text("{")
    terminal = ScriptedTerminal([*HEADING, *TEN, "", ""])
    assert len(ask_inspection(gear, terminal, store, NOTHING).clearance_in) == 10
    assert terminal.screen.count("is damaged") == 1


def test_there_is_no_session_of_an_unknown_name(store: SessionStore) -> None:
    with pytest.raises(SessionFileError, match="there is no saved inspection 'nothing'"):
        store.load("nothing")


@pytest.mark.parametrize("name", ["../secret", "/etc/passwd", ""])
def test_a_session_name_is_no_path(store: SessionStore, name: str) -> None:
    with pytest.raises(SessionFileError, match="is not the name of a saved inspection"):
        store.load(name)


def test_without_a_folder_there_is_no_latest_session(store: SessionStore) -> None:
    assert store.latest() is None


def test_a_folder_that_cannot_be_written_is_said_once_and_the_inspection_goes_on(gear: Gear, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    terminal = ScriptedTerminal([*HEADING, *TEN, "", ""])
    found = ask_inspection(gear, terminal, SessionStore(tmp_path / "file" / "state"), NOTHING)
    assert len(found.clearance_in) == 10
    assert terminal.screen.count("answers cannot be saved") == 1


def test_a_stop_does_not_promise_a_resume_that_cannot_be(gear: Gear, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    terminal, stopped = interrupted(gear, SessionStore(tmp_path / "file" / "state"), [*HEADING, ".004"])
    assert stopped.session_id is None
    assert "--resume" not in terminal.screen
    assert "could not be saved" in terminal.screen


# The place.


def test_sessions_live_in_the_state_folder_of_the_desktop_standard() -> None:
    assert state_folder({"XDG_STATE_HOME": "/var/s"}) == Path("/var/s/mlg-troubleshoot")


@pytest.mark.parametrize("variable", [{}, {"XDG_STATE_HOME": ""}, {"XDG_STATE_HOME": "relative"}])
def test_else_they_live_below_the_home_folder(variable: dict[str, str]) -> None:
    folder = state_folder({"HOME": "/home/anna", **variable})
    assert folder == Path("/home/anna/.local/state/mlg-troubleshoot")
