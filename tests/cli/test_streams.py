"""stdout carries results, stderr messages; a reader that goes away does not stop the work."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import pytest

from tests.cli.conftest import FAILURE, FLEET, Run, Table, mlg, row

COMMAND = (sys.executable, "-m", "mlg_troubleshoot")
needs_posix = pytest.mark.skipif(sys.platform == "win32", reason="needs pipes of POSIX")


def test_json_is_all_of_stdout(failure_json: Run) -> None:
    assert json.loads(failure_json.out)["schema_version"] == 1


def test_problems_do_not_stand_on_stdout(table: Table) -> None:
    found = mlg("check", table(row(side="")))
    assert "problem" not in found.out
    assert "1 problem in the input" in found.err


def test_reports_are_announced_on_stderr(tmp_path: Path) -> None:
    found = mlg("check", FAILURE, "--format", "html", "--report", tmp_path)
    assert "Report:" in found.err
    assert "Report:" not in found.out


def test_quiet_leaves_stderr_empty(tmp_path: Path) -> None:
    assert mlg("check", FAILURE, "--format", "html", "--report", tmp_path, "--quiet").err == ""


def test_without_a_terminal_neither_colour_nor_progress_bar_is_written(failure: Run) -> None:
    assert "\x1b" not in failure.out + failure.err


def test_json_holds_no_number_that_is_not_one(fleet_json: Run) -> None:
    assert not {"NaN", "Infinity"} & set(fleet_json.out.replace(",", " ").replace("]", " ").split())


def closed_after_one_line(arguments: Sequence[object]) -> tuple[int, str]:
    """Run a command whose reader takes one line and goes away."""
    process = subprocess.Popen(
        [*COMMAND, *(str(a) for a in arguments)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        bufsize=0,
    )
    assert process.stdout is not None
    assert process.stderr is not None
    process.stdout.close()
    with process.stderr:
        said = process.stderr.read().decode()
    return process.wait(), said


@needs_posix
@pytest.mark.parametrize(
    ("arguments", "code"),
    [(("check", FLEET), 1), (("check", FAILURE, "--json"), 1), (("gear",), 0)],
    ids=["text", "json", "gear"],
)
def test_a_closed_pipe_is_not_an_error_and_keeps_the_exit_code(
    arguments: tuple[object, ...], code: int
) -> None:
    assert closed_after_one_line(arguments) == (code, "")


@needs_posix
def test_a_closed_pipe_does_not_lose_the_verdicts_that_go_to_a_file(tmp_path: Path) -> None:
    closed_after_one_line(("check", FAILURE, "--csv", tmp_path / "out.csv"))
    assert "OUTSIDE_MARGIN" in (tmp_path / "out.csv").read_text(encoding="utf-8")


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full")
@pytest.mark.parametrize("more", [(), ("--json",)], ids=["text", "json"])
def test_a_full_disk_behind_stdout_exits_5(more: tuple[str, ...]) -> None:
    with Path("/dev/full").open("wb") as full:
        done = subprocess.run(
            [*COMMAND, "check", str(FAILURE), *more],
            stdout=full,
            stderr=subprocess.PIPE,
            check=False,
        )
    assert done.returncode == 5
    assert b"cannot be written: No space left on device" in done.stderr
