"""A repair that a row states: as found and as left on page 1, and what is kept of it."""

from __future__ import annotations

import re
from pathlib import Path
from tempfile import TemporaryDirectory

import pypdf
import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st

from mlg_troubleshoot.decision.inspection import FactKind
from mlg_troubleshoot.gear.gear_file import load_gear
from mlg_troubleshoot.life.folding import judge_lives, lives
from mlg_troubleshoot.store import Store
from mlg_troubleshoot.workflows.check import check_files, load_index_table
from mlg_troubleshoot.workflows.keep import keep, told_by
from tests.cli.conftest import mlg, row

from .places import table

IDENTITY = {"tail_no": "N1", "side": "LH", "clearance_convention": "TOTAL_PLAY"}
FOUND = IDENTITY | {
    "record_id": "A",
    "inspection_date": "2026-10-10",
    "clearance_1_thou": "8",
    "clearance_3_thou": "26",
    "clearance_5_thou": "14",
    "outcome": "FAILED",
    "plunger_displacement_thou": "46",
}
LEFT = IDENTITY | {
    "record_id": "B",
    "inspection_date": "2026-10-12",
    "clearance_3_thou": "1.5",
    "outcome": "RETRACTED",
    "plunger_displacement_thou": "12",
    "restored_joints": "3 5",
    "repair_date": "2026-10-11",
}
ROWS = [
    ("Repair", "", "restored #3, #5 on 2026-10-11"),
    ("Outcome", "FAILED", "RETRACTED"),
    ("Plunger", "+46 thou", "+12 thou"),
    ("#1", "8 thou", "as found"),
    ("#3", "26 thou (limit 15)", "1.5 thou"),
    ("#5", "14 thou", "restored, not read"),
]
_ROW = re.compile(r'<th scope="row">(.*?)</th><td>(.*?)</td><td>(.*?)</td>')


def written(folder: Path, pattern: str) -> list[tuple[str, ...]]:
    (page,) = folder.glob(f"{pattern}.html")
    text = page.read_text(encoding="utf-8").replace("\u00a0", " ")
    begins = text.find('<table class="compact found-left">')
    return _ROW.findall(text[begins : text.find("</table>", begins)]) if begins >= 0 else []


@pytest.mark.parametrize("kept", [True, False])
def test_a_repaired_gear_is_stated_as_found_and_as_left(tmp_path: Path, *, kept: bool) -> None:
    store = ("--keep", "--store", tmp_path / "s.sqlite") if kept else ()
    asked = ("--report", tmp_path, "-q", "--show", "thou", *store)
    mlg("check", table(tmp_path, FOUND, LEFT), *asked)
    assert written(tmp_path, "mlg-N1-LH-B-*") == ROWS
    assert written(tmp_path, "mlg-N1-LH-A-*") == []
    (pdf,) = tmp_path.glob("mlg-N1-LH-B-*.pdf")
    front = pypdf.PdfReader(pdf).pages[0].extract_text().replace("\u00a0", " ")
    assert "As found" in front
    assert "26 thou (limit 15)" in front


def test_the_page_of_a_life_states_it_as_well(tmp_path: Path) -> None:
    store = ("--store", tmp_path / "s.sqlite")
    mlg("check", table(tmp_path, FOUND, LEFT), "--keep", "-q", *store)
    asked = ("--no-forecast", "--report", tmp_path, "--show", "thou", *store)
    screen = mlg("history", "N1", "LH", *asked)
    assert screen.code == 0
    assert "plunger +46 thou → +12 thou" in " ".join(screen.out.split())
    assert written(tmp_path, "mlg-life-*") == ROWS


def test_repairs_between_which_the_gear_failed_again_are_one(tmp_path: Path) -> None:
    again = IDENTITY | {
        "record_id": "C",
        "inspection_date": "2026-10-13",
        "outcome": "FAILED",
        "clearance_2_thou": "16",
    }
    second = LEFT | {
        "record_id": "D",
        "inspection_date": "2026-10-15",
        "clearance_3_thou": "",
        "restored_joints": "2",
        "repair_date": "2026-10-14",
    }
    first = LEFT | {"outcome": "", "plunger_displacement_thou": ""}
    asked = ("--report", tmp_path, "-q", "--show", "thou")
    mlg("check", table(tmp_path, FOUND, first, again, second), *asked)
    found = {row[0]: row[1:] for row in written(tmp_path, "mlg-N1-LH-D-*")}
    assert found["Outcome"] == ("FAILED", "RETRACTED")
    assert found["Plunger"] == ("+46 thou", "+12 thou")
    assert found["#2"] == ("16 thou (limit 15)", "restored, not read")


FAILED = {"outcome": "FAILED", "plunger_displacement_in": "0.035"}
RESTORED = {"restored_joints": "3", "repair_date": "2026-03-02"}


def visit(name: str, day: str, worn_in: str, **more: str) -> dict[str, str]:
    return row(record_id=name, inspection_date=day, clearance_3_in=worn_in, **more)


@pytest.fixture
def history(tmp_path: Path) -> Path:
    """A failure, its repair, and a row below them that still says what was before."""
    return table(
        tmp_path,
        visit("before", "2026-03-01", "0.0148", **FAILED),
        visit("repair", "2026-03-02", "0.0005", **RESTORED),
        visit("below", "2026-03-02", "0.0005", **FAILED),
        visit("later", "2026-03-09", "0.0005", **FAILED),
    )


def test_a_repair_that_a_row_states_is_kept_once_with_the_row(history, tmp_path):
    place = str(tmp_path / "store.sqlite")
    for _ in range(2):
        mlg("check", history, "--keep", "--store", place)
    (life,) = lives(Store(place)).values()
    assert [(each.day, each.joints) for each in life.repairs] == [("2026-03-02", {3})]


def test_a_rigging_that_a_row_says_was_corrected_is_a_re_rigging(tmp_path: Path) -> None:
    place = str(tmp_path / "store.sqlite")
    rerigged = {"rigging_checked": "corrected", "repair_date": "2026-03-02"}
    file = table(tmp_path, visit("rigged", "2026-03-02", "0.0010", **rerigged))
    mlg("check", file, "--keep", "--store", place)
    (life,) = lives(Store(place)).values()
    assert [(each.day, each.joints) for each in life.repairs] == [("2026-03-02", set())]


HEADERS = (
    "tail_no,side,clearance_convention,J1 (in) as found,J1 (in) as left,inspection_date,"
    "J3 (in) as found,J3 (in) as left,"
    "Plunger (in) as found,Plunger (in) as left,Outcome as found,Outcome as left,restored_joints,"
    "repair_date"
)
READ = st.sampled_from(["", "0.002", "0.012"])
PLUNGER = st.sampled_from(["", "0.008", "0.046"])
TRIED = st.sampled_from(["", "FAILED", "RETRACTED"])
CARD = st.tuples(READ, READ, PLUNGER, PLUNGER, TRIED, TRIED, st.sampled_from(["", "3"]))


def truth(cards: list[tuple[str, ...]]) -> tuple[str, str, bool]:
    """Joint 3, the plunger and whether a failure stands, by the order that the words state."""
    joint = plunger = ""
    failed = repaired = False
    for found, left, plunger_found, plunger_left, tried, tried_left, restored in cards:
        for reading, displacement, outcome, is_left in (
            (found, plunger_found, tried, False),
            (left, plunger_left, tried_left, True),
        ):
            if is_left and restored:
                joint = plunger = ""
                repaired = True
            joint, plunger = reading or joint, displacement or plunger
            if outcome == "FAILED":
                failed, repaired = True, False
            elif outcome and repaired:
                failed = False
    return joint, plunger, failed


@settings(max_examples=60, deadline=None, phases=[Phase.generate])
@given(st.lists(CARD, min_size=1, max_size=3))
def test_what_is_as_left_is_newer_than_what_is_as_found_and_than_the_repair(cards) -> None:
    lines = [
        ",".join(("N1,LH,RADIAL,0.001,0.001", day, *card, day * bool(card[-1])))
        for day, card in ((f"2026-03-0{n}", card) for n, card in enumerate(cards, 1))
    ]
    with TemporaryDirectory() as folder:
        file = Path(folder) / "cards.csv"
        file.write_text("\n".join([HEADERS, *lines, ""]))
        store = Store(Path(folder) / "s.sqlite")
        keep(told_by(check_files([file]).judgements), store)
        gear = load_gear("hawker-800xp")
        for life in judge_lives(lives(store).values(), gear, load_index_table(gear)):
            row = life.state.inspection
            joint, plunger, failed = truth(cards)
            assert row.clearance_in.get(3) == (float(joint) if joint else None)
            if plunger:
                assert set(row.standing_readings_in) == {float(plunger)}
            else:
                assert not any(abs(each) > 0.03 for each in row.standing_readings_in)
            facts = {fact.kind for fact in (*row.facts, *life.state.older)}
            assert (FactKind.FAILED in facts) == failed
            if failed or joint == "0.012" or plunger == "0.046":
                assert not life.now.is_fine
