"""What a fleet and a life say of a gear: worked out from what stands, never recalled."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from mlg_troubleshoot.decision.assessment import Action, Assessment
from mlg_troubleshoot.decision.inspection import Inspection
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.life.folding import TodaysVerdict, judge_lives, lives
from mlg_troubleshoot.store import Store
from mlg_troubleshoot.workflows.check import CheckOptions, check_files, load_index_table
from mlg_troubleshoot.workflows.history import show_fleet
from mlg_troubleshoot.workflows.keep import keep as keep_told
from mlg_troubleshoot.workflows.keep import told_by
from tests.cli.conftest import Run, mlg, row
from tests.decision.test_headlines import drawn_states
from tests.gear.own import own_gear

from .places import table

SOUND = {f"clearance_{n}_in": "0.0011" for n in range(1, 11)}
MARGIN = "\nmargin = 0.03"
FAR = {"plunger_displacement_in": "0.06"}


@pytest.fixture
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("MLG_STORE", str(tmp_path / "store.sqlite"))
    return tmp_path


def visit(name: str, day: str, **more: str) -> dict[str, str]:
    return row(**{"record_id": name, "tail_no": "N1", "inspection_date": day, **SOUND, **more})


def keep(folder: Path, *rows: dict[str, str], gear: Path | None = None) -> Run:
    more = () if gear is None else ("--gear", gear)
    return mlg("check", table(folder, *rows), "--keep", *more)


def line(gear: Path | None = None) -> Any:
    more = () if gear is None else ("--gear", gear)
    (found,) = mlg("fleet", "--json", "--no-forecast", *more).json["gears"]
    return found


def events() -> list[dict[str, Any]]:
    found: list[dict[str, Any]] = mlg("history", "N1", "LH", "--json", "--no-forecast").json[
        "events"
    ]
    return found


def test_a_repair_that_is_void_hides_nothing(place: Path) -> None:
    keep(place, visit("R0", "2026-01-01"))
    mlg("history", "repair", "N1", "LH", "--joint", "6", "--date", "2026-01-08")
    keep(place, visit("R1", "2026-01-05", **FAR))
    (repair,) = (each for each in events() if each["kind"] == "restored")
    mlg("history", "void", repair["hash"], "--why", "wrong gear")
    assert line()["verdict"] == "OUTSIDE_MARGIN"
    assert [each["counts"] for each in events() if each["kind"] in ("restored", "void")] == [0, 1]


def test_a_corrected_margin_of_the_gear_file_corrects_the_fleet(place: Path) -> None:
    wide = own_gear(place, (MARGIN, MARGIN.replace("0.03", "0.07")))
    worn = dict.fromkeys(SOUND, "0.004")
    keep(place, visit("R1", "2026-01-01", **worn), gear=wide)
    assert line(wide)["verdict"] == "WITHIN_MARGIN"
    assert line()["verdict"] == "OUTSIDE_MARGIN"


def test_a_corrected_date_puts_no_verdict_on_another_inspection(place: Path) -> None:
    first = visit("R1", "2026-01-04", gear_landings="100")
    keep(place, first)
    keep(place, visit("R1", "2026-02-04", gear_landings="900", **FAR))
    wrong = next(each for each in events() if each["date"] == "2026-01-04")
    values = ("date=2026-02-03", "landings=899")
    assert mlg("history", "amend", wrong["hash"], *values).code == 0
    assert line()["verdict"] == "OUTSIDE_MARGIN"
    said = {each["gear_landings"]: each["verdict"] for each in events() if each["verdict"]}
    assert said == {899.0: "WITHIN_MARGIN", 900.0: "OUTSIDE_MARGIN"}


def test_nothing_is_written_beside_the_store(place: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(place / "cache"))
    keep(place, visit("R1", "2026-01-04", gear_landings="100"))
    assert mlg("fleet").code == 0
    assert not (place / "cache" / "mlg").exists()


def test_of_two_inspections_of_one_day_the_worse_is_the_line_of_the_fleet(place: Path) -> None:
    keep(place, visit("R1", "2026-01-05", **FAR), visit("R2", "2026-01-05"))
    assert line()["verdict"] == "OUTSIDE_MARGIN"


def entered(state: Inspection, name: str) -> dict[str, str]:
    """A row that says what is known of a gear in some state."""
    more = {
        "outcome": state.outcome or "",
        "rigging_checked": state.rigging_checked or "",
        **{f"clearance_{n}_in": "" for n in range(1, 11)},
        **{f"clearance_{n}_in": repr(read) for n, read in state.clearance_in.items()},
    }
    for column, reading in zip(
        ("plunger_displacement_in", "plunger_displacement_2_in"), state.readings_in, strict=False
    ):
        more[column] = repr(reading)
    for column in ("restored_joints", "cannot_reach", "no_spare"):
        more[column] = " ".join(map(str, getattr(state, column)))
    for column in ("repair_date", "plunger_date", "outcome_date"):
        when = getattr(state, column)
        more[column] = when.isoformat(" ", "minutes") if when else ""
    return row(record_id=name, tail_no=name, inspection_date="2026-03-03", **more)


def told(found: TodaysVerdict | Assessment) -> tuple[Any, ...]:
    """NEXT, what the plan restores, and its minutes."""
    if isinstance(found, TodaysVerdict):
        return found.next_action, found.restore, round(found.minutes, 6)
    steps = found.plan.steps
    parts = tuple(n for s in steps if s.action is Action.RESTORE for n in s.joints)
    return found.in_brief, parts, round(sum(step.minutes for step in steps), 6)


@pytest.mark.parametrize("n", [60, pytest.param(500, marks=pytest.mark.slow)])
def test_a_gear_that_is_opened_again_gets_the_same_next(gear: Gear, place: Path, n: int) -> None:
    states = [s for s in drawn_states(n + n // 10, 71) if not s.says_nothing][:n]
    assert len(states) == n
    file = table(place, *(entered(state, f"N{k}") for k, state in enumerate(states)))
    store = Store(place / "store.sqlite")

    def checked(known: Store | None) -> dict[str, tuple[Any, ...]]:
        found = check_files([file], CheckOptions(advice=False), store=known).judgements
        return {a.inspection.tail_no: told(a) for a in found if isinstance(a, Assessment)}

    alone = checked(None)
    assert len(alone) == n
    keep_told(told_by(check_files([file], CheckOptions(advice=False)).judgements), store)
    kept = judge_lives(lives(store).values(), gear, load_index_table(gear))
    assert {life.key[0]: told(life.now) for life in kept} == alone
    # The fleet that is kept teaches a check, a list of the fleet and a life the same.
    shown = show_fleet(store, gear, ahead=False)
    assert {line.key[0]: told(line.now) for line in shown.lines} == checked(store)
