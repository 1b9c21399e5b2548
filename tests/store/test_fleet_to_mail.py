"""``mlg fleet`` as it is asked and passed on: chosen gears, CSV, pages and plots."""

from __future__ import annotations

import csv
import json
import re
import shutil
from pathlib import Path

import pytest

from tests.cli.conftest import mlg

from .test_history_commands import keep, visit

ALL_READ = {f"clearance_{n}_in": "0.0010" for n in range(1, 11) if n != 3}


@pytest.fixture(scope="module")
def store(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """One gear that wears within its margin, one that is outside it, one of another aircraft."""
    folder = tmp_path_factory.mktemp("fleet")
    file = folder / "store.sqlite"
    rows = [
        *(visit(n, 0.0010 + 0.0004 * n, **ALL_READ) for n in range(3)),
        *(visit(n, 0.0020 + 0.0060 * n, side="RH", **ALL_READ) for n in range(3)),
        *(visit(n, 0.0010, "N777", **ALL_READ) for n in range(3)),
    ]
    assert keep(folder, *rows, more=("--store", str(file), "-q")).code == 1
    return file


def gears(store: Path, *more: str) -> list[dict[str, object]]:
    found = mlg("fleet", "--store", store, "--json", "-q", *more)
    assert found.code == 0
    return list(json.loads(found.out)["gears"])


@pytest.mark.parametrize("command", ["fleet", "history"])
def test_an_empty_store_says_how_to_keep_inspections(tmp_path: Path, command: str) -> None:
    found = mlg(command, "--store", tmp_path / "none.sqlite")
    assert found.out.startswith("No records in ")
    assert " ".join(found.out.split()).endswith("Keep inspections with: mlg check FILE --keep")


def test_the_csv_holds_what_the_json_holds(store: Path, tmp_path: Path) -> None:
    out = tmp_path / "due.csv"
    found = gears(store, "--csv", str(out))
    with out.open(encoding="utf-8", newline="") as lines:
        rows = list(csv.DictReader(lines))
    assert [row["next_action"] for row in rows] == [gear["next_action"] for gear in found]
    assert [float(row["margin_in"]) for row in rows] == [gear["margin_in"] for gear in found]


def test_minutes_and_parts_are_summed_over_the_fleet(store: Path) -> None:
    shown = mlg("fleet", "--store", store, "--json", "-q", "--no-forecast")
    told = json.loads(shown.out)
    minutes = sum(gear["minutes"] for gear in told["gears"])
    assert minutes > 0
    assert f"{minutes:.0f} min" in told["work"]
    assert [gear["restore"] for gear in told["gears"] if gear["restore"]] == [[3]]
    assert "(number of gears): #3 (1)." in told["work"]


def test_a_plan_from_before_a_repair_is_not_work_that_is_left(store: Path, tmp_path: Path) -> None:
    repaired = tmp_path / "repaired.sqlite"
    shutil.copy(store, repaired)
    repair = ("--joint", "3", "--date", "2026-06-30", "--store", repaired)
    assert mlg("history", "repair", "N123", "RH", *repair).code == 0
    (gear,) = (
        g for g in gears(repaired, "--no-forecast") if (g["tail_no"], g["side"]) == ("N123", "RH")
    )
    assert 3 not in gear["restore"]
    assert gear["verdict"] != "WITHIN_MARGIN"


def test_gears_without_work_are_not_counted_as_having_some(store: Path) -> None:
    shown = mlg("fleet", "--store", store, "--json", "-q", "--no-forecast")
    listed = json.loads(shown.out)
    waiting = sum(gear["minutes"] > 0 for gear in listed["gears"])
    assert waiting < len(listed["gears"])
    assert f"on {waiting} of {len(listed['gears'])} gears" in listed["work"]


def test_the_action_has_the_same_words_on_screen_in_json_and_on_paper(store, tmp_path, monkeypatch):
    monkeypatch.setenv("COLUMNS", "200")
    screen = mlg("fleet", "--store", store, "-q", "--no-forecast", "--report", tmp_path).out
    page = (tmp_path / "fleet.html").read_text(encoding="utf-8")
    for gear in gears(store, "--no-forecast"):
        assert str(gear["next_action"]) in screen
        assert str(gear["next_action"]) in re.sub(r"\s+", " ", page)


def test_no_reason_is_cut_on_a_narrow_screen(store: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "60")
    screen = mlg("fleet", "--store", store, "-q", "--no-forecast").out
    assert "…" not in screen
    for gear in gears(store, "--no-forecast"):
        assert all(word in screen for word in str(gear["why"]).split())


def test_the_page_of_a_gear_plots_each_joint_with_limit_and_forecast(store, tmp_path):
    assert mlg("history", "N777", "LH", "--store", store, "--report", tmp_path).code == 0
    (file,) = tmp_path.glob("*.html")
    page = file.read_text(encoding="utf-8")
    (drawn,) = re.findall(r'<svg[^>]*aria-label="Clearance of each joint.*?</svg>', page, re.DOTALL)
    assert drawn.count("<polygon") == 10
    assert "#10 plunger pin" in drawn


def test_the_page_of_a_fleet_may_run_its_own_script_alone(store: Path, tmp_path: Path) -> None:
    mlg("fleet", "--store", store, "-q", "--no-forecast", "--report", tmp_path)
    page = (tmp_path / "fleet.html").read_text(encoding="utf-8")
    assert re.search(r"default-src 'none'; script-src 'sha256-[\w+/]{43}='; style-src", page)
    assert page.count("<script>") == 1
    assert "src=" not in page


def test_a_joint_without_landings_is_not_called_unread(tmp_path: Path) -> None:
    file = tmp_path / "store.sqlite"
    undated = visit(1, 0.001, **ALL_READ)
    undated["gear_landings"] = ""
    keep(tmp_path, undated, more=("--store", str(file), "-q"))
    shown = " ".join(mlg("history", "N123", "LH", "--store", file).out.split())
    assert "Never read" not in shown
    assert "Not read since" not in shown
    assert "Read, but without landings (gear_landings), so no forecast: #1, #2, #3" in shown
