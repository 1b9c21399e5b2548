"""What a shop wants otherwise comes from environment variables, a colleague's headers from a
file.
"""

from __future__ import annotations

import csv
import re
from pathlib import Path

import pytest

from tests.cli.conftest import DATA, FAILURE, ROOT, Table, mlg, row

GERMAN = row(clearance_3_in=None, **{"Spiel Drei": "0.002"})


def test_the_environment_says_the_unit_to_show(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MLG_SHOW", "mm")
    assert "1.199 of" in mlg("check", FAILURE).out
    assert "0.0472 of" in mlg("check", FAILURE, "--show", "in").out


def test_a_fleet_is_shown_in_the_unit_of_its_entries_else_in_that_of_the_environment(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    store = ("--store", tmp_path / "store.sqlite")
    gear = ("check", "--tail", "N1", "--side", "LH", "--convention", "RADIAL", "--keep", *store)
    monkeypatch.setenv("MLG_UNIT", "thou")
    assert "+12.0 of 30.0 thou" in mlg(*gear, "--set", "plunger=12").out
    assert "+12.0 of 30.0 thou" in mlg("fleet", *store).out
    mlg(*gear, "--set", "3=0.1mm", "--set", "5=0.1mm")
    assert "of 0.762 mm" in mlg("fleet", *store).out


def test_the_environment_says_the_paper(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    for size in ("Letter", "A4", ""):
        monkeypatch.setenv("MLG_PAGE", size)
        mlg("check", FAILURE, "--report", tmp_path / f"of{size}", "--format", "html")
        (page,) = (tmp_path / f"of{size}").glob("*.html")
        assert re.findall(r"size: (A4|Letter)", page.read_text(encoding="utf-8")) == [size or "A4"]


def test_the_environment_says_unit_and_convention_of_tables(monkeypatch, table):
    bare = {"clearance_3_in": None, "clearance_convention": None, "Joint 3": "0.1"}
    monkeypatch.setenv("MLG_UNIT", "mm")
    monkeypatch.setenv("MLG_CONVENTION", "TOTAL_PLAY")
    found = mlg("check", table(row(**bare)), "--json")
    assert found.one["joints"][2]["clearance_in"] == pytest.approx(0.1 / 25.4 / 2)
    assert "MLG_UNIT=mm" in found.err
    assert "MLG_CONVENTION=TOTAL_PLAY" in found.err


def test_the_environment_says_the_gear(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MLG_GEAR", str(ROOT / "tests" / "geometry" / "data" / "four-bar.toml"))
    assert mlg("gear", "--json").json["id"] != "hawker-800xp"


@pytest.mark.parametrize(
    "name", ["MLG_SHOW", "MLG_PAGE", "MLG_UNIT", "MLG_CONVENTION", "MLG_GEAR", "MLG_STORE"]
)
def test_every_variable_is_named_in_the_help_and_refused_with_its_value(
    name: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    assert name in mlg("check", "--help").out
    monkeypatch.setenv(name, str(tmp_path) if name == "MLG_STORE" else "furlong")
    found = mlg("check", FAILURE, "--keep")
    assert found.code == 2
    assert "furlong" in found.err or str(tmp_path) in found.err


@pytest.mark.parametrize("value", ["", "yesterday"])
@pytest.mark.parametrize("command", [["fleet"], ["check", FAILURE, "--keep"]])
def test_a_date_of_the_sources_that_is_not_valid_is_refused(command, value, monkeypatch):
    monkeypatch.setenv("SOURCE_DATE_EPOCH", value)
    found = mlg(*command)
    assert (found.code, repr(value) in found.err) == (2, True)


def test_a_file_says_how_headers_are_read(table: Table, tmp_path: Path) -> None:
    headers = tmp_path / "headers.toml"
    headers.write_text(
        '[headers]\n"Spiel Drei" = "clearance_3_in"\n"Spiel Vier" = "clearance_4"', "utf-8"
    )
    found = mlg("check", table(GERMAN), "--map", headers, "--json")
    assert found.one["joints"][2]["clearance_in"] == 0.002
    assert found.json["problems"] == []


def test_a_mapping_by_flag_wins_over_that_of_a_file(table: Table, tmp_path: Path) -> None:
    headers = tmp_path / "headers.toml"
    headers.write_text('[headers]\n"Spiel Drei" = "clearance_4_in"', encoding="utf-8")
    path = table(GERMAN)
    with path.open(encoding="utf-8") as file:
        letter = chr(ord("A") + next(csv.reader(file)).index("Spiel Drei"))
    found = mlg("check", path, "--map", headers, "--map", f"{letter}=clearance_3_in", "--json")
    assert found.one["joints"][2]["clearance_in"] == 0.002


def test_a_column_by_its_letter_is_not_named_by_a_file(table: Table, tmp_path: Path) -> None:
    failed = row(plunger_displacement_in="0.0500", outcome="FAILED")
    letter = chr(ord("A") + list(failed).index("plunger_displacement_in"))
    (tmp_path / "headers.toml").write_text(f'[headers]\n"{letter}" = "carry"\n', encoding="utf-8")
    found = mlg("check", table(failed), "--map", tmp_path / "headers.toml", "--json")
    assert found.one["verdict"] == "OUTSIDE_MARGIN"


@pytest.mark.parametrize(
    "text", ['show = "mm"', "headers = 3", "[headers]\nx = 3", "[", "x = " + "[" * 5000, "", None]
)
def test_a_file_of_headers_that_is_not_one_is_refused_with_words(text, tmp_path):
    headers = tmp_path / "headers.toml"
    if text is not None:
        headers.write_text(text, encoding="utf-8")
    found = mlg("check", FAILURE, "--map", headers)
    assert (found.code, found.out) == (2, "")
    assert "headers.toml" in found.err


def test_a_file_that_lies_in_the_folder_changes_nothing(tmp_path, monkeypatch):
    (tmp_path / "mlg.toml").write_text('show = "mm"\n[headers]\noutcome = "carry"', "utf-8")
    before = mlg("check", DATA / "fleet_batch.csv", "-q")
    monkeypatch.chdir(tmp_path)
    assert mlg("check", DATA / "fleet_batch.csv", "-q") == before
