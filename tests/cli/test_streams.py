"""Streams: what stands on which, closed, full and plain ones."""

from __future__ import annotations

import io
import json
import os
import shlex
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import pytest

from mlg_troubleshoot.cli import output
from mlg_troubleshoot.json_form import as_text
from tests.cli.conftest import DATA, FAILURE, FLEET, ROOT, Run, Table, mlg, row
from tests.gear.own import own_gear

COMMAND = (sys.executable, "-m", "mlg_troubleshoot")
needs_posix = pytest.mark.skipif(sys.platform == "win32", reason="needs pipes of POSIX")


def test_json_is_all_of_stdout(failure_json: Run) -> None:
    assert json.loads(failure_json.out)["schema_version"] == 2


def test_problems_do_not_stand_on_stdout(table: Table) -> None:
    found = mlg("check", table(row(side="")))
    assert "problem" not in found.out
    assert "1 problem in the input" in found.err


def test_reports_are_announced_on_stderr(tmp_path: Path) -> None:
    found = mlg("check", FAILURE, "--format", "html", "--report", tmp_path)
    assert "Report:" in found.err
    assert "Report:" not in found.out
    assert found.err.count("Not kept: --keep adds these inspections to the records.") == 1


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
    [
        pytest.param(("check", FLEET, "--quiet"), 1, id="text"),
        pytest.param(("check", FAILURE, "--json"), 1, id="json", marks=pytest.mark.slow),
        pytest.param(("gear",), 0, id="gear", marks=pytest.mark.slow),
    ],
)
def test_a_closed_pipe_is_not_an_error_and_keeps_the_exit_code(arguments, code):
    assert closed_after_one_line(arguments) == (code, "")


@needs_posix
def test_a_closed_pipe_does_not_lose_the_verdicts_that_go_to_a_file(tmp_path: Path) -> None:
    closed_after_one_line(("check", FAILURE, "--csv", tmp_path / "out.csv"))
    assert "OUTSIDE_MARGIN" in (tmp_path / "out.csv").read_text(encoding="utf-8")


def in_a_shell(line: str, folder: Path) -> tuple[int, str, str]:
    """Run a line of a shell in which ``mlg`` stands for the program."""
    program = " ".join(map(shlex.quote, COMMAND))
    done = subprocess.run(
        ["/bin/sh", "-c", line.replace("mlg", program).replace("FILE", shlex.quote(str(FAILURE)))],
        cwd=folder,
        env={**os.environ, "PYTHONPATH": str(ROOT), "MLG_STORE": "kept.sqlite"},
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        check=False,
    )
    return done.returncode, done.stdout, done.stderr


@needs_posix
@pytest.mark.parametrize(
    ("line", "code", "words"),
    [
        ("mlg check FILE 2>&-", 1, ""),
        pytest.param("mlg check nope.csv 2>&-", 3, "", marks=pytest.mark.slow),
        pytest.param("mlg check - <&-", 3, "the file is empty", marks=pytest.mark.slow),
        pytest.param("mlg check <&-", 2, "nothing to check", marks=pytest.mark.slow),
        ("mlg check FILE >&-", 5, "standard output is closed"),
        pytest.param(
            "mlg template new.xlsx >&-", 5, "standard output is closed", marks=pytest.mark.slow
        ),
        pytest.param("mlg check FILE <&- >&- 2>&-", 5, "", marks=pytest.mark.slow),
        pytest.param(
            "mlg check FILE --keep --report r --format html <&- 2>&-", 1, "", marks=pytest.mark.slow
        ),
        ("ulimit -n 5; mlg check FILE --report r", 5, "ulimit -n 256"),
        pytest.param(
            "ulimit -n 8; mlg check FILE --report r", 5, "ulimit -n 256", marks=pytest.mark.slow
        ),
    ],
)
def test_a_stream_or_a_file_that_cannot_be_opened_ends_no_run_without_words(
    line, code, words, tmp_path
):
    found, _, err = in_a_shell(line, tmp_path)
    assert (found, "Internal error" in err, words in err) == (code, False, True)


@needs_posix
def test_no_file_takes_the_place_of_a_closed_stream(tmp_path: Path) -> None:
    line = "mlg check FILE --keep --csv out.csv <&- 2>&-"
    assert in_a_shell(line, tmp_path)[0] == 1
    assert in_a_shell("mlg history verify", tmp_path)[0] == 0
    assert (tmp_path / "out.csv").read_text("utf-8").startswith("record_id,")


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs a device that is full")
@pytest.mark.parametrize(
    ("line", "code", "words"),
    [
        pytest.param("mlg check FILE 2>/dev/full", 1, "", marks=pytest.mark.slow),
        pytest.param("mlg check nope.csv 2>/dev/full", 5, "", marks=pytest.mark.slow),
        ("mlg check FILE >/dev/full", 5, "cannot be written: No space left on device"),
        pytest.param(
            "mlg check FILE --json >/dev/full",
            5,
            "cannot be written: No space left on device",
            marks=pytest.mark.slow,
        ),
    ],
)
def test_a_full_stream_ends_as_documented(line: str, code: int, words: str, tmp_path: Path) -> None:
    found, _, err = in_a_shell(line, tmp_path)
    assert (found, words in err) == (code, True)


def test_a_gear_file_with_a_name_that_no_file_can_have_ends_with_words(tmp_path: Path) -> None:
    gear = own_gear(tmp_path, ("hawker-800xp-indices.json", "x" * 300))
    found = mlg("check", FAILURE, "--gear", gear)
    assert (found.code, "expected the name of a .json file" in found.err) == (2, True)


STORE = ROOT / "tests" / "store" / "data" / "version-1.sqlite"
COMMANDS = {
    "help": (("--help",), 0),
    "check help": (("check", "--help-all"), 0),
    "check": (("check", str(FAILURE), "--detail"), 1),
    "batch": (("check", str(FLEET)), 1),
    "check json": (("check", str(FAILURE), "--json"), 1),
    "refused": (("check", "Größe.csv"), 3),
    "gear": (("gear",), 0),
    "verify": (("gear", "verify"), 0),
    "template": (("template", "neu–1.xlsx"), 0),
    "study": (("study", "--design", "lhs", "--size", "2,20,2"), 0),
    "history": (("history", "--store", str(STORE)), 0),
    "fleet": (("fleet", "--no-forecast", "--store", str(STORE)), 0),
    "diagnose": (("diagnose", str(DATA / "measured_pressure.csv")), 1),
}
STREAMS = {
    "cp1252": {"PYTHONIOENCODING": "cp1252"},
    "cp437": {"PYTHONIOENCODING": "cp437"},
    "ascii": {"PYTHONIOENCODING": "ascii"},
    "C": {"LC_ALL": "C"},
}
# Each stream once; the whole table runs with the long tests.
EVERYDAY = [("check help", "ascii"), ("check", "cp1252"), ("batch", "cp437"), ("refused", "C")]
ALL = [
    (command, stream)
    for command in COMMANDS
    for stream in STREAMS
    if (command, stream) not in EVERYDAY
]


def run(command: str, stream: str, folder: Path) -> tuple[int, bytes, bytes]:
    environment = {
        "PATH": os.environ["PATH"],
        "HOME": str(folder),
        "PYTHONPATH": str(ROOT),
        **STREAMS[stream],
    }
    arguments, _code = COMMANDS[command]
    done = subprocess.run(
        [sys.executable, "-m", "mlg_troubleshoot", *arguments],
        cwd=folder,
        env=environment,
        capture_output=True,
        check=False,
    )
    return done.returncode, done.stdout, done.stderr


def as_documented(command: str, stream: str, folder: Path) -> None:
    code, out, err = run(command, stream, folder)
    assert code == COMMANDS[command][1], err
    assert b"Traceback" not in err
    assert b"Internal error" not in err
    if stream != "C":
        (out + err).decode(stream)


@pytest.mark.parametrize(("command", "stream"), EVERYDAY, ids=lambda each: each)
def test_a_command_ends_as_documented_on_a_plain_stream(command, stream, tmp_path):
    as_documented(command, stream, tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize(("command", "stream"), ALL, ids=lambda each: each)
def test_every_command_ends_as_documented_on_every_stream(command, stream, tmp_path):
    as_documented(command, stream, tmp_path)


@pytest.mark.parametrize(
    "write", [output.write_json, lambda found: output.write_pieces([as_text(found)])]
)
def test_json_holds_every_character_on_a_stream_that_cannot(write, monkeypatch):
    plain = io.TextIOWrapper(io.BytesIO(), encoding="ascii", write_through=True)
    monkeypatch.setattr(sys, "stdout", plain)
    write({"tail": "Größe–1\udcff"})
    assert json.loads(plain.buffer.getvalue()) == {"tail": "Größe–1\udcff"}
