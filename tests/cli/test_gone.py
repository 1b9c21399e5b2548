"""Commands and options: how many, what is gone, and what those of the model say."""

from __future__ import annotations

import csv
import fnmatch
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import pytest

from mlg_troubleshoot.cli.gone import GONE
from mlg_troubleshoot.reporting.figures import MINUS
from tests.cli.conftest import DATA, FLEET, Run, command, mlg


def assert_gone(found: Run, name: str) -> None:
    """One line on stderr, exit code 2."""
    said = f"Error: mlg {name} is gone since 0.2.0: {GONE[name]}.\n"
    assert (found.code, found.out, found.err) == (2, "", said)


@pytest.mark.parametrize("name", GONE)
def test_what_is_gone_says_what_to_use_instead(name: str) -> None:
    assert_gone(mlg(*name.split()), name)


@pytest.mark.parametrize("name", GONE)
def test_what_is_gone_is_found_among_values_and_other_options(name: str) -> None:
    command, *rest = name.split()
    if command.startswith("--"):
        assert_gone(mlg("check", "table.csv", f"{command}=x"), name)
    elif rest and rest[0].startswith("--"):
        assert_gone(mlg(command, "table.csv", f"{rest[0]}=x"), name)
    elif rest:
        assert_gone(mlg(command, "--gear", "mine.toml", *rest, "--json"), name)
    else:
        assert_gone(mlg(command, "--json"), name)


def test_a_name_after_two_dashes_is_a_file() -> None:
    found = mlg("check", "--", "--remember", "doctor")
    assert (found.code, "gone" in found.err) == (3, False)


ALL = 108
BUDGET = {"check": 24, "diagnose": 14, "fleet": 12, "study": 10}


def options_of(found: Any) -> Iterator[str]:
    """The options of a command and of those below it, without ``--help``."""
    yield from (each.name for each in found.params if each.param_type_name == "option")
    for name in found.list_commands(None) if hasattr(found, "list_commands") else ():
        yield from options_of(found.get_command(None, name))


def test_all_commands_have_no_more_options_than_their_budget() -> None:
    assert len([*options_of(command())]) <= ALL


@pytest.mark.parametrize("name", BUDGET)
def test_a_command_has_no_more_options_than_its_budget(name: str) -> None:
    found: Any = command()
    assert len([*options_of(found.get_command(None, name))]) <= BUDGET[name]


def test_the_figure_is_an_svg_with_every_joint(tmp_path: Path) -> None:
    file = tmp_path / "study.svg"
    assert mlg("study", "--figure", file).code == 0
    texts = [each.text for each in ET.parse(file).iter() if each.tag.endswith("text")]
    assert {f"#{joint}" for joint in range(1, 11)} <= set(texts)


def test_screen_json_and_csv_give_the_same_indices(tmp_path, monkeypatch):
    # To compile takes longer than so small a study.
    monkeypatch.setattr("mlg_troubleshoot.paper.study.numba_is_installed", lambda: False)
    file = tmp_path / "study.csv"
    small = ("study", "--design", "lhs", "--size", "10,50,2", "--workers", "1")
    found = mlg(*small, "--json").json["joints"]
    shown = mlg(*small, "--csv", file).out
    with file.open(encoding="utf-8-sig", newline="") as text:
        rows = list(csv.DictReader(text))
    for joint, row in zip(found, rows, strict=True):
        assert float(row["first_order"]) == pytest.approx(joint["first_order"], rel=1e-5)
        assert f"{joint['first_order']:.4f}".replace("-", MINUS) in shown


@pytest.mark.parametrize("size", ["10", "10,50", "ten,50,2", "1,50,2", "10,50,0"])
def test_a_size_that_is_not_one_of_a_design_is_refused(size: str) -> None:
    assert mlg("study", "--design", "lhs", "--size", size).code == 2


def test_the_table_of_a_gear_is_not_written_from_a_design_of_the_paper() -> None:
    run = mlg("study", "--design", "lhs", "--write-table", "--force")
    assert run.code == 2
    assert "standard study" in run.err


@cache
def gear_text() -> str:
    """What ``mlg gear`` shows, white space folded."""
    return " ".join(mlg("gear").out.split())


@pytest.fixture(scope="module")
def verified() -> Run:
    """What ``mlg gear verify`` finds."""
    return mlg("gear", "verify", "--json")


@pytest.mark.parametrize(
    "words",
    [
        "reconstructed from published figures, not drawing data",
        *("assumed", "Linkages in the ensemble: 10", "doors at this position: not stated"),
    ],
)
def test_the_gear_says_where_its_numbers_come_from_and_what_is_not_stated(words: str) -> None:
    assert words in gear_text()


def test_the_gear_as_json_has_ten_joints_with_their_sources() -> None:
    joints = mlg("gear", "--json").json["joints"]
    assert [joint["joint"] for joint in joints] == list(range(1, 11))
    assert all(joint["limit"]["source"] for joint in joints)


def test_every_printed_number_that_should_hold_holds(verified: Run) -> None:
    assert [
        n["quantity"] for n in verified.json["numbers"] if n["should_hold"] and not n["holds"]
    ] == []
    assert verified.code == 0
    assert all(n["section"] and n["status"] for n in verified.json["numbers"])
    assert "not reproduced" in {n["status"] for n in verified.json["numbers"]}


def test_the_statements_of_the_paper_stand_in_gear_verify(verified: Run) -> None:
    statements = verified.json["statements"]
    assert "near the input" in mlg("gear", "verify").out
    assert len(statements) == 10
    assert {statement["outcome"] for statement in statements} >= {"holds", "does not hold"}


def test_the_failure_case_stands_beside_what_the_paper_prints(verified: Run) -> None:
    (number,) = [n for n in verified.json["numbers"] if n["printed"] == "0.0472"]
    assert number["computed"] == pytest.approx(0.0472, abs=2e-4)


def test_the_version_is_that_of_the_package() -> None:
    from importlib.metadata import version

    assert mlg("--version").out == f"mlg {version('mlg-troubleshoot')}\n"


@pytest.mark.parametrize("command", ["check", "diagnose", "template", "gear"])
def test_every_command_shows_an_example(command: str) -> None:
    assert f"mlg {command}" in mlg(command, "--help").out


def test_the_help_of_check_says_what_its_exit_codes_mean() -> None:
    words = " ".join(mlg("check", "--help").out.split())
    assert "0 every gear within margin" in words


NOTE = (DATA / "README.md").read_text(encoding="utf-8")


def test_the_note_names_every_file_and_no_other_one() -> None:
    named = re.findall(r"`([\w*]+\.\w+)`", NOTE.partition("\n**")[0])
    files = {p.name for p in DATA.iterdir() if p.is_file() and not p.name.startswith(".")} - {
        "README.md"
    }
    assert {f for f in files if not any(fnmatch.fnmatch(f, pattern) for pattern in named)} == set()
    assert [pattern for pattern in named if not list(DATA.glob(pattern))] == []


def test_the_batch_is_a_small_fleet_of_all_conventions_and_verdicts(fleet_json: Run) -> None:
    with FLEET.open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) >= 40
    assert len({row["tail_no"] for row in rows}) == 6
    conventions = {row["clearance_convention"] for row in rows}
    assert conventions == {"RADIAL", "DIAMETRAL", "TOTAL_PLAY"}
    verdicts = {i["verdict"] for i in fleet_json.json["inspections"]}
    assert verdicts == {"OUTSIDE_MARGIN", "INCOMPLETE", "WITHIN_MARGIN", "INCONCLUSIVE"}
    assert fleet_json.json["problems"] == []
