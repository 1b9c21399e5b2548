"""``mlg.toml``: what is shown and how unknown headers are read is remembered, never what could turn
a verdict.
"""

from __future__ import annotations

import csv
import re
import shutil
from pathlib import Path

import pytest

from tests.cli.conftest import DATA, FAILURE, ROOT, Table, mlg, row

FAILED = row(plunger_displacement_in="0.0500", outcome="FAILED")


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


def test_the_page_of_a_flag_wins_over_the_one_that_is_remembered(here: Path) -> None:
    (here / "mlg.toml").write_text('page = "Letter"', encoding="utf-8")
    mlg("check", FAILURE, "--report", here, "--format", "html", "--page", "A4")
    (page,) = here.glob("*.html")
    assert re.findall(r"size: (A4|Letter)", page.read_text(encoding="utf-8")) == ["A4"]


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


def test_what_is_remembered_stays_beside_what_is_remembered_later(here: Path, table: Table) -> None:
    path = table(row(clearance_3_in=None, **{"Spiel Drei": "0.002"}))
    mlg(
        "check",
        path,
        "--map",
        "Spiel Drei=clearance_3",
        "--unit",
        "in",
        "--show",
        "thou",
        "--remember",
    )
    mlg("check", FAILURE, "--page", "Letter", "--remember")
    said = mlg("check", path, "--unit", "in").err
    assert "lengths shown in thou, page Letter, header 'Spiel Drei' read as clearance_3" in said


def test_a_remembered_header_may_be_missing(here: Path, table: Table) -> None:
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


def test_no_setting_turns_a_measured_failure_into_a_verdict_within_margin(
    here: Path, table: Table
) -> None:
    (here / "mlg.toml").write_text(
        '[headers]\n"plunger_displacement_in" = "carry"\n"outcome" = "carry"\n'
    )
    assert mlg("check", table(FAILED), "-q").code == 2


@pytest.mark.parametrize(
    ("header", "column"),
    [
        ("outcome", "carry"),
        ("Outcome", "remarks"),
        ("plunger_displacement_in", "carry"),
        ("plunger displacement 2 [mm]", "work_order"),
        ("margin_in", "carry"),
        ("margin_u_in", "carry"),
        ("gauge_u_in", "carry"),
        ("gauge_u_3_in", "remarks"),
        ("plunger_gauge_u_in", "carry"),
        ("clearance_3_in", "clearance_4"),
        ("Joint 3", "carry"),
        ("clearance_3_in", "clearance_3"),
        ("side", "carry"),
        ("A/C Reg", "gauge_id"),
        ("clearance_convention", "carry"),
        ("unit", "carry"),
        ("record_id", "carry"),
        ("remarks", "carry"),
        # In doubt, and so a problem that is said; passed over it would be none.
        ("Joint 3 wear", "carry"),
        ("Joint 3 wear", "remarks"),
        ("margn_in", "carry"),
    ],
)
def test_no_other_meaning_is_remembered_for_a_header_that_is_understood(
    header: str, column: str, here: Path, table: Table
) -> None:
    (here / "mlg.toml").write_text(f'[headers]\n"{header}" = "{column}"\n', encoding="utf-8")
    found = mlg("check", table(row()), "-q")
    assert (found.code, found.out) == (2, "")
    assert f"mlg.toml: headers: {header!r} = {column!r} is never remembered" in found.err
    assert f'--map "{header}={column}"' in found.err


def test_what_a_header_in_doubt_means_is_remembered(here: Path, table: Table) -> None:
    (here / "mlg.toml").write_text('[headers]\n"Joint 3 wear" = "clearance_3"\n', encoding="utf-8")
    path = table(row(clearance_3_in=None, **{"Joint 3 wear": "0.002"}))
    assert mlg("check", path, "--unit", "in", "--json").one["joints"][2]["clearance_in"] == 0.002


def test_another_meaning_for_a_header_that_is_understood_is_not_kept(
    here: Path, table: Table
) -> None:
    found = mlg("check", table(FAILED), "--map", "outcome=carry", "--remember")
    assert found.code == 2
    assert not (here / "mlg.toml").exists()


def test_the_gear_says_which_headers_are_understood(
    here: Path, table: Table, tmp_path: Path
) -> None:
    shipped = ROOT / "mlg_troubleshoot" / "gear" / "data"
    for file in shipped.glob("hawker*"):
        shutil.copy(file, tmp_path)
    gear = tmp_path / "hawker-800xp.toml"
    gear.write_text(gear.read_text(encoding="utf-8").replace('"plunger pin"', '"spool fork"'))
    (here / "mlg.toml").write_text(
        '[headers]\n"Joint 10 spool fork" = "remarks"\n', encoding="utf-8"
    )
    assert mlg("check", table(row()), "-q", "--gear", gear).code == 2


def test_a_column_by_its_letter_is_not_remembered_from_another_table(
    here: Path, table: Table
) -> None:
    letter = chr(ord("A") + list(FAILED).index("plunger_displacement_in"))
    (here / "mlg.toml").write_text(f'[headers]\n"{letter}" = "carry"\n', encoding="utf-8")
    assert mlg("check", table(FAILED), "--json").one["verdict"] == "OUTSIDE_MARGIN"


def test_a_mapping_by_flag_wins_over_one_that_is_remembered(here: Path, table: Table) -> None:
    (here / "mlg.toml").write_text('[headers]\n"Spiel Drei" = "clearance_4"', encoding="utf-8")
    path = table(row(clearance_3_in=None, **{"Spiel Drei": "0.002"}))
    with path.open(encoding="utf-8") as file:
        letter = chr(ord("A") + next(csv.reader(file)).index("Spiel Drei"))
    found = mlg("check", path, "--map", f"{letter}=clearance_3_in", "--json")
    assert found.one["joints"][2]["clearance_in"] == 0.002


def test_what_was_remembered_is_said_whatever_quiet_asks_for(here: Path) -> None:
    (here / "mlg.toml").write_text('show = "mm"', encoding="utf-8")
    assert "remembered in mlg.toml: lengths shown in mm" in mlg("check", FAILURE, "-q").err


def test_a_setting_that_changes_nothing_is_not_said(here: Path) -> None:
    (here / "mlg.toml").write_text('show = "in"\npage = "A4"', encoding="utf-8")
    assert "mlg.toml" not in mlg("check", FAILURE, "-q").err


def test_what_was_remembered_stands_in_the_json_of_a_check(here: Path, table: Table) -> None:
    (here / "mlg.toml").write_text('[headers]\n"Spiel Drei" = "clearance_3"', encoding="utf-8")
    path = table(row(clearance_3_in=None, **{"Spiel Drei": "0.002"}))
    found = mlg("check", path, "--unit", "in", "--json", "-q").json
    assert "remembered in mlg.toml: header 'Spiel Drei' read as clearance_3" in found["warnings"]


def test_what_was_remembered_stands_in_the_json_of_a_diagnosis(here: Path) -> None:
    (here / "mlg.toml").write_text('[headers]\n"Spiel Drei" = "clearance_3"', encoding="utf-8")
    found = mlg("diagnose", DATA / "measured_pressure.csv", "--json", "-q").json
    assert "remembered in mlg.toml: header 'Spiel Drei' read as clearance_3" in found["warnings"]


@pytest.mark.parametrize(
    "command",
    [
        ("check", FAILURE, "-q", "--format", "html"),
        ("diagnose", DATA / "measured_pressure.csv", "-q"),
        ("fleet", "-q"),
    ],
    ids=lambda command: command[0],
)
def test_what_was_remembered_stands_in_every_report(
    command: tuple[object, ...], here: Path
) -> None:
    (here / "mlg.toml").write_text('show = "mm"', encoding="utf-8")
    mlg(*command, "--report", here)
    (page,) = here.glob("*.html")
    assert "remembered in mlg.toml: lengths shown in mm" in page.read_text(encoding="utf-8")
