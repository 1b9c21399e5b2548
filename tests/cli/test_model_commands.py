"""``mlg gear``, ``mlg gear verify``, ``mlg --version``, help."""

from __future__ import annotations

import pytest

from tests.cli.conftest import Run, mlg


@pytest.fixture(scope="module")
def gear_text() -> str:
    """What ``mlg gear`` shows, white space folded."""
    return " ".join(mlg("gear").out.split())


@pytest.fixture(scope="module")
def verified() -> Run:
    """What ``mlg gear verify`` finds."""
    return mlg("gear", "verify", "--json")


def test_the_gear_says_where_its_geometry_comes_from(gear_text: str) -> None:
    assert "reconstructed from published figures, not drawing data" in gear_text


def test_the_gear_counts_its_numbers_by_kind(gear_text: str) -> None:
    assert "assumed" in gear_text
    assert "reconstructed" in gear_text
    assert "Linkages in the ensemble: 10" in gear_text


def test_the_gear_shows_what_the_paper_does_not_state_as_not_stated(gear_text: str) -> None:
    assert "doors at this position: not stated" in gear_text


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
