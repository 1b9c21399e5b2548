"""What 0.2.0 had and this version has not says what to use instead."""

from __future__ import annotations

import pytest

from mlg_troubleshoot.cli.gone import GONE
from tests.cli.conftest import Run, mlg


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
