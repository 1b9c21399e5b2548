"""The README's test command passes however it is started, and whatever its user has set up."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
ON_A_TERMINAL = (
    "tests/cli/test_on_a_terminal.py::test_an_interrupt_says_how_to_go_on_and_exits_130",
    "tests/prompts/test_one_gear.py::test_answers_that_cannot_be_saved_are_said_once",
)
WHAT_A_USER_SETS = (
    "tests/cli/test_views.py::test_the_screen_follows_columns_and_is_80_wide_without",
    "tests/cli/test_streams.py::test_without_a_terminal_neither_colour_nor_progress_bar_is_written",
    "tests/cli/test_exit_codes.py::test_an_interrupt_exits_130",
    "tests/test_outputs.py::test_a_new_file_has_what_the_umask_leaves[18-420]",
)
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(sys.platform == "win32", reason="needs signals and a shell of POSIX"),
]


def started(before: str, tests: tuple[str, ...], **environment: str) -> None:
    """Run tests in a pytest that a shell starts after some commands, without a terminal."""
    line = f'{before}; exec "$0" -m pytest -n 0 -q -p no:cacheprovider "$@"'
    done = subprocess.run(
        ["/bin/sh", "-c", line, sys.executable, *tests],
        cwd=ROOT,
        env={"PATH": os.environ["PATH"], **environment},
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout
    assert f"{len(tests)} passed" in done.stdout


def test_in_the_background_and_under_nohup_where_signals_are_ignored() -> None:
    started("trap '' INT HUP", ON_A_TERMINAL, LANG="C")


def test_with_the_settings_of_a_user() -> None:
    narrow = {
        "COLUMNS": "40",
        "LINES": "10",
        "FORCE_COLOR": "1",
        "PYTHONUTF8": "0",
        "LC_ALL": "POSIX",
    }
    started(
        "umask 077",
        WHAT_A_USER_SETS,
        MLG_SHOW="mm",
        MLG_PAGE="Letter",
        TZ="Pacific/Auckland",
        **narrow,
    )
