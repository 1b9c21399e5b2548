"""Any terminal and any pipe: what a stream cannot show is shown as what it can; no character ends a
run.
"""

from __future__ import annotations

import io
import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from mlg_troubleshoot.cli import output
from mlg_troubleshoot.json_form import as_text
from tests.cli.conftest import DATA, FAILURE, FLEET, ROOT

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
# Every command once, every stream several times; the whole table runs with the long tests.
EVERYDAY = [
    ("check help", "ascii"),
    ("check", "cp1252"),
    ("batch", "cp437"),
    ("check json", "ascii"),
    ("refused", "cp1252"),
    ("gear", "C"),
]
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
