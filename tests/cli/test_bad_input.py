"""Bad input: exit 2 or 3, a message that says what to do, never a traceback; good rows still
work.
"""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from tests.cli.conftest import FAILURE, HAND, Run, Table, mlg, row

ONE_VALUE = (*HAND, "--convention", "RADIAL", "--set")


def refused(found: Run, code: int, *said: str) -> None:
    """Nothing on stdout, a message with a remedy on stderr, no traceback."""
    assert (found.code, found.out) == (code, "")
    assert "Traceback" not in found.err
    assert "What to do:" in found.err
    for words in said:
        assert words in found.err


def test_nothing_in_says_what_to_pass() -> None:
    refused(mlg("check"), 2, "nothing to check", "--set COLUMN=VALUE", "standard input")


def test_a_file_that_is_not_there_is_named(tmp_path: Path) -> None:
    refused(mlg("check", tmp_path / "lost.csv"), 3, "lost.csv", "there is no such file")


@pytest.mark.parametrize("name", ["table.csv", "table.xlsx"])
def test_a_file_of_no_bytes_is_called_empty(name: str, tmp_path: Path) -> None:
    (tmp_path / name).touch()
    refused(mlg("check", tmp_path / name), 3, name, "the file is empty", "No row could be judged.")


@pytest.mark.parametrize(
    ("column", "value", "said"),
    [
        ("clearance_3_in", "worn", "worn"),
        ("clearance_3_in", "0.33", "millimetres (factor 25.4)"),
        ("clearance_3_in", "0,013", "--decimal-comma"),
        ("side", "", "LH or RH"),
        ("margin_in", "0", "margin"),
    ],
)
def test_a_bad_cell_makes_its_row_invalid_and_says_why_and_good_rows_survive(
    column, value, said, table
):
    bad = row(**{"record_id": "B", "tail_no": "N9", column: value})
    found = mlg("check", table(row(record_id="A"), bad, row(record_id="C", side="RH")), "--json")
    assert found.code == 1
    verdicts = [i["verdict"] for i in found.json["inspections"]]
    assert verdicts == ["WITHIN_MARGIN", "INVALID", "WITHIN_MARGIN"]
    (problem,) = found.json["problems"]
    assert problem["column"] == column
    assert said in json.dumps(problem, ensure_ascii=False)


def test_a_problem_is_one_line_of_a_file_however_long_it_is(table: Table) -> None:
    found = mlg("check", table(row(clearance_3_in="worn" * 40)))
    assert sum("worn" in line for line in found.err.splitlines()) == 1


@pytest.mark.parametrize(
    ("value", "said"),
    [
        ("3=worn", "for example 0.013 in, 13 thou"),
        ("3=-0.001in", "less than zero"),
        ("3=nan", "Enter a number"),
        ("3=0,013in", "decimal point"),
        ("3=0.33in", "a clearance from 0 to 0.05 in"),
        ("3=1/64in", "Fractions"),
        ("3", "is not COLUMN=VALUE"),
        ("3=0.001in=x", "0.001in=x"),
        ("plunger=0.041", "unit is missing"),
        ("plunger=4in", "plunger displacement from -0.5 to 0.5 in"),
        ("outcome=PERHAPS", "RETRACTED or FAILED"),
        ("margin=0in", "a margin above 0"),
        ("11=0.001in", "has no joint 11"),
        ("3=", "is not COLUMN=VALUE"),
    ],
)
def test_a_bad_value_on_the_command_line_is_refused_with_its_option(value: str, said: str) -> None:
    refused(mlg(*ONE_VALUE, value), 2, f"--set {value!r}", said)


def test_a_joint_given_twice_is_refused() -> None:
    for again in ("3=0.002in", "#3=0.002in", "clearance_3=0.002in"):
        refused(mlg(*ONE_VALUE, "3=0.001in", "--set", again), 2, "clearance_3 twice")


@pytest.mark.parametrize(
    ("name", "near"), [("outcom", "outcome"), ("plungr", "plunger"), ("clearance3x", "clearance_3")]
)
def test_a_name_that_is_not_a_column_is_refused_with_the_nearest(name: str, near: str) -> None:
    found = mlg(*ONE_VALUE, "3=0.001in", "--set", f"{name}=1")
    refused(found, 2, f"{name!r} is not a column", near)


@pytest.mark.parametrize(
    ("pair", "key", "value"),
    [
        ("plunger=0.012in", "measured_displacement_in", 0.012),
        ("plunger_displacement_mm=0.3", "measured_displacement_in", 0.3 / 25.4),
        ("Plunger displacement=12thou", "measured_displacement_in", 0.012),
        ("plunger_2=12thou", "measured_displacement_in", 0.012),
        ("margin=0.028in", "margin_in", 0.028),
        ("p=12thou", "measured_displacement_in", 0.012),
        ("outcome=f", "outcome", "FAILED"),
        ("record_id=mine", "record_id", "mine"),
    ],
)
def test_every_column_is_set_by_its_name_or_a_short_one(pair: str, key: str, value: object) -> None:
    found = mlg(*HAND[:5], *ONE_VALUE[-3:], "3=0.001in", "--set", pair, "--json")
    assert found.one[key] == (pytest.approx(value) if isinstance(value, float) else value)


def test_a_convention_is_understood_in_the_words_of_the_prompts() -> None:
    found = mlg(*HAND, "--convention", "play", "--set", "3=27thou", "--json")
    (read,) = (j["clearance_in"] for j in found.one["joints"] if j["joint"] == 3)
    assert read == pytest.approx(0.0135)


@pytest.mark.parametrize("restored", ["restored=3,5", "restored_joints=3 5"])
def test_what_was_restored_is_set_as_well(restored: str) -> None:
    day = ("repair_date=2026-03-04", "landings=4000", "date=2026-03-05", "rigging=yes")
    more = (restored, *day, "temperature=20", "pressure=3000")
    found = mlg(*ONE_VALUE, "3=0.001in", *(f"--set={pair}" for pair in more), "--json")
    assert found.json["problems"] == []


def test_an_empty_tail_number_is_refused() -> None:
    found = mlg(
        "check", "--tail", " ", "--side", "LH", "--convention", "RADIAL", "--set", "3=0.001in"
    )
    refused(found, 2, "--tail", "a tail number (text)")


@pytest.mark.parametrize(
    ("option", "value", "said"),
    [
        ("--side", "BOTH", "LH or RH"),
        ("--convention", "RADIALLY", "RADIAL"),
        ("--unit", "furlong", "in, thou or mm"),
        ("--gear", "a380", "there is no gear 'a380'"),
    ],
)
def test_a_bad_option_is_refused_with_what_is_allowed(option: str, value: str, said: str) -> None:
    refused(mlg(*ONE_VALUE, "3=0.001in", option, value), 2, said)


def test_values_by_hand_beside_a_file_are_refused() -> None:
    refused(
        mlg("check", FAILURE, "--set", "3=0.001in"),
        2,
        "Give either a FILE or the values of one gear.",
    )


def test_a_mapping_without_a_column_is_refused() -> None:
    refused(mlg("check", FAILURE, "--map", "Spiel 3"), 2, "HEADER=COLUMN")


def test_annotating_standard_input_is_refused_before_anything_is_shown(tmp_path: Path) -> None:
    found = mlg("check", "-", "--annotate", tmp_path / "out.xlsx", stdin=FAILURE.read_bytes())
    refused(found, 2, "--annotate needs exactly one workbook")


def test_an_extension_that_is_not_there_is_refused(tmp_path: Path) -> None:
    refused(mlg("check", FAILURE, "--extension", tmp_path / "lost.toml"), 2, "lost.toml")


def test_a_gear_file_that_is_not_toml_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "gear.toml"
    path.write_text("[[points", encoding="utf-8")
    refused(mlg("check", FAILURE, "--gear", path), 2, "gear.toml", "cannot be read as TOML")
