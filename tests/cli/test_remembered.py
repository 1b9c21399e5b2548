"""``mlg.toml``: what is shown and how headers are read is remembered, never what could turn a verdict."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.cli.conftest import FAILURE, Table, mlg, row


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A working folder and a configuration of its own."""
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "config"))
    (tmp_path / "work").mkdir()
    monkeypatch.chdir(tmp_path / "work")
    return tmp_path / "work"


def test_the_unit_to_show_is_remembered_and_its_use_is_said(here: Path) -> None:
    mlg("check", FAILURE, "--show", "mm", "--remember")
    found = mlg("check", FAILURE)
    assert "1.199 mm" in found.out
    assert "remembered in mlg.toml: lengths shown in mm" in found.err


def test_a_report_says_which_remembered_settings_shaped_it(here: Path) -> None:
    mlg("check", FAILURE, "--show", "mm", "--remember")
    mlg("check", FAILURE, "--report", here, "--format", "html")
    (page,) = here.glob("*.html")
    assert "remembered in mlg.toml: lengths shown in mm" in page.read_text(encoding="utf-8")


def test_a_flag_wins_over_what_is_remembered(here: Path) -> None:
    (here / "mlg.toml").write_text('show = "mm"', encoding="utf-8")
    assert "0.0472 in" in mlg("check", FAILURE, "--show", "in").out


def test_the_working_folder_wins_over_the_configuration_of_the_user(here: Path) -> None:
    own = here.parent / "config" / "mlg-troubleshoot"
    own.mkdir(parents=True)
    (own / "mlg.toml").write_text('show = "thou"', encoding="utf-8")
    assert "47.2 thou" in mlg("check", FAILURE).out
    (here / "mlg.toml").write_text('show = "mm"', encoding="utf-8")
    assert "1.199 mm" in mlg("check", FAILURE).out


def test_how_a_header_is_read_is_remembered_and_said(here: Path, table: Table) -> None:
    path = table(row(clearance_3_in=None, **{"Spiel Drei": "0.002"}))
    mlg("check", path, "--map", "Spiel Drei=clearance_3", "--unit", "in", "--remember")
    found = mlg("check", path, "--unit", "in", "--json")
    assert found.one["joints"][2]["clearance_in"] == 0.002
    assert "header 'Spiel Drei' read as clearance_3" in found.err


def test_a_remembered_header_that_is_not_there_is_no_problem(here: Path, table: Table) -> None:
    (here / "mlg.toml").write_text('[headers]\n"Spiel Drei" = "clearance_3"', encoding="utf-8")
    assert mlg("check", table(row()), "--json").json["problems"] == []


@pytest.mark.parametrize(
    "text",
    [
        'unit = "mm"',
        'convention = "RADIAL"',
        'side = "LH"',
        "margin_in = 0.05",
        'show = "furlong"',
        'page = "A5"',
        "show = 3",
        "show = [",
        "headers = 3",
        "[headers]\nx = 3",
        '[headers]\nx = "clearance_3_mm"',
        '[headers]\nx = "margin"',
        '[headers]\n"\\u001b[31m" = "tail_no"',
        "x = " + "[" * 5000,
    ],
)
def test_what_may_not_be_remembered_is_refused_with_words(text: str, here: Path) -> None:
    (here / "mlg.toml").write_text(text, encoding="utf-8")
    found = mlg("check", FAILURE)
    assert (found.code, found.out) == (2, "")
    assert "mlg.toml" in found.err
    assert "What to do:" in found.err


def test_a_unit_of_entry_given_by_a_mapping_is_not_remembered(here: Path) -> None:
    found = mlg("check", FAILURE, "--map", "x=clearance_4_mm", "--remember")
    assert found.code == 2
    assert not (here / "mlg.toml").exists()


def test_a_diagnosis_that_cannot_be_concluded_writes_its_reason_as_json() -> None:
    found = mlg("diagnose", FAILURE, "--json")
    assert found.code == 3
    assert found.json["verdict"] is None
    assert "no row has a measured plunger displacement" in found.json["reason"]


def test_a_format_without_a_report_is_said() -> None:
    assert "without --report DIR none is written" in mlg("check", FAILURE, "--format", "html").err
