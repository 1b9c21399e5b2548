"""How many options the commands have: a budget that may only fall."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest

from tests.cli.conftest import command

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
