"""The questions on a real pseudo-terminal of 80×24."""

from __future__ import annotations

import os
import re
import shlex
import signal
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from mlg_troubleshoot.cli.output import speaks_utf8
from mlg_troubleshoot.cli.prompts.lines import line
from mlg_troubleshoot.cli.prompts.terminal import RichTerminal
from tests.keys import interrupt
from tests.prompts.scripted import ENTERS

pexpect = pytest.importorskip("pexpect")

pytestmark = [
    pytest.mark.skipif(sys.platform == "win32", reason="needs a pseudo-terminal"),
    pytest.mark.filterwarnings("ignore:.*multi-threaded:DeprecationWarning"),
]

_ROOT = Path(__file__).parents[2]
_RUNNER = """
import sys
from mlg_troubleshoot.cli.output import prepare_streams
from mlg_troubleshoot.cli.prompts import Answers, RichTerminal, SessionStore, ask_inspection
from mlg_troubleshoot.gear.gear_file import load_gear
prepare_streams()
store = SessionStore()
saved = store.latest() if "--resume" in sys.argv else None
try:
    found = ask_inspection(load_gear(), RichTerminal(), store, Answers(), saved=saved).inspection
except KeyboardInterrupt:
    sys.exit(130)
read = {n: round(c, 6) for n, c in found.clearance_in.items()}
print("RESULT", found.tail_no, found.side.value, read)
"""
_HEADING = ("N123AB", "l", "i", "r")
_PROMPT = "> "

Start = Callable[..., "pexpect.spawn"]


@pytest.fixture
def start(tmp_path: Path) -> Iterator[Start]:
    """Start the questions in a terminal; the environment is made of what the test gives."""
    started = []

    def begin(*arguments: str, stdout: Path | None = None, **environment: str):
        command = [sys.executable, "-c", _RUNNER, *arguments]
        line = shlex.join(command) + (f" > {shlex.quote(str(stdout))}" if stdout else "")
        variables = {
            "PATH": os.environ["PATH"],
            "HOME": str(tmp_path),
            "PYTHONPATH": str(_ROOT),
            "TERM": "xterm-256color",
            "LANG": "C.UTF-8",
            **environment,
        }
        child = pexpect.spawn(
            "/bin/sh",
            ["-c", f"exec {line}"],
            dimensions=(24, 80),
            env=variables,
            encoding="utf-8",
            codec_errors="replace",
            timeout=60,
        )
        child.delaybeforesend = None
        child.ptyproc.delayafterclose = child.ptyproc.delayafterterminate = 0.01
        started.append(child)
        return child

    yield begin
    for child in started:
        if child.isalive():
            child.kill(signal.SIGKILL)
        child.close(force=True)


def type_lines(child, *lines: str) -> str:
    """Type lines, each after its prompt; everything shown on the way is returned."""
    seen = ""
    for text in lines:
        child.expect_exact(_PROMPT)
        seen += child.before + child.after
        child.sendline(text)
    return seen


def exit_code(child) -> int:
    child.expect(pexpect.EOF)
    child.close()
    return child.exitstatus


def without_colour(text: str) -> str:
    return re.sub(r"\x1b\[[0-9;]*m", "", text)


def test_ten_joints_are_typed_and_the_result_comes_out(start: Start) -> None:
    child = start()
    type_lines(child, *_HEADING, *[".004"] * 10, *ENTERS, "")
    child.expect_exact("RESULT N123AB LH {1: 0.004, 2: 0.004, 3: 0.004,")
    assert exit_code(child) == 0


def test_back_skip_and_a_wrong_value_work_as_typed(start: Start) -> None:
    child = start()
    seen = type_lines(
        child,
        *_HEADING,
        ".004",
        "b",
        ".005",
        "s",
        "0,013",
        "",
        "0.33",
        ".0205",
        "y",
        "done",
        *ENTERS,
        "",
    )
    child.expect_exact("RESULT N123AB LH {1: 0.005, 3: 0.0205}")
    text = " ".join(without_colour(seen).split())
    assert "enter 0.013" in text
    assert "Enter alone is not an answer" in text
    assert "0.33 mm would be 0.01299 in" in text
    assert "yes, it is really 0.0205 in = 0.521 mm radial" in text


def test_ctrl_c_saves_and_resume_goes_on(start: Start) -> None:
    child = start()
    type_lines(child, *_HEADING, ".004", ".005")
    child.expect_exact(_PROMPT)
    interrupt(child, "mlg check --resume")
    assert exit_code(child) == 130
    child = start("--resume")
    child.expect_exact("joint 3 of 10")
    type_lines(child, ".006", "done", *ENTERS, "")
    child.expect_exact("RESULT N123AB LH {1: 0.004, 2: 0.005, 3: 0.006}")


def test_ctrl_d_also_saves(start: Start) -> None:
    child = start()
    type_lines(child, *_HEADING, ".004")
    child.expect_exact(_PROMPT)
    child.sendeof()
    child.expect_exact("mlg check --resume")
    assert exit_code(child) == 130


def test_a_killed_terminal_loses_no_answer(start: Start) -> None:
    child = start()
    type_lines(child, *_HEADING, ".004", ".005")
    child.expect_exact("joint 3 of 10")
    child.kill(signal.SIGKILL)
    child.expect(pexpect.EOF)
    child = start("--resume")
    child.expect_exact("joint 3 of 10")


@pytest.mark.parametrize(
    ("typed", "kept", "end", "left"),
    [
        ((".004", "s"), "1 of 10 joints measured, 1 marked not measured", signal.SIGHUP, 6),
        ((".004", ".0205"), "1 of 10 joints measured", signal.SIGKILL, 6),
        ((".004", "done", "f p .041"), "outcome FAILED", signal.SIGHUP, 6),
        ((".004", "done", "", "WO-7", "2026-03-01"), "WO-7", signal.SIGKILL, 3),
        ((".004", "done", *ENTERS[:5], "G-03"), "G-03", signal.SIGHUP, 0),
    ],
    ids=["joint", "confirmation", "optional answers", "sign-off", "review"],
)
def test_no_question_loses_an_answer(
    start: Start, typed: tuple[str, ...], kept: str, end: int, left: int
) -> None:
    child = start()
    type_lines(child, *_HEADING, *typed)
    child.expect_exact(_PROMPT)
    child.kill(end)
    child.expect(pexpect.EOF)
    child = start("--resume")
    seen = type_lines(child, *["done"] * ("done" not in typed), *ENTERS[:left], "q")
    assert kept in " ".join(without_colour(seen).split())


# Every question in turn: ten joints, the optional answers, and who measured with what on which day.
EVERY = (
    *(f".00{10 + n}" for n in range(10)),
    "f p .041",
    "",
    "WO-7",
    "2026-03-01",
    "2100",
    "A. Smith",
    "G-12",
)


@pytest.mark.slow
@pytest.mark.parametrize("end", [signal.SIGKILL, signal.SIGHUP], ids=["kill", "hang-up"])
@pytest.mark.parametrize("place", range(1, len(EVERY) + 1))
def test_every_question_can_be_the_last_one_before_a_break(
    start: Start, end: int, place: int
) -> None:
    child = start()
    type_lines(child, *_HEADING, *EVERY[:place])
    child.expect_exact(_PROMPT)
    child.kill(end)
    child.expect(pexpect.EOF)
    child = start("--resume")
    seen = " ".join(without_colour(type_lines(child, *EVERY[place:], "q")).split())
    for kept in (
        f"{min(place, 10)} of 10 joints measured",
        "outcome FAILED",
        "A. Smith",
        "WO-7",
        "G-12",
        "2026-03-01",
    ):
        assert kept in seen


def test_a_typing_slip_is_taken_back_with_the_backspace_key(start: Start) -> None:
    child = start()
    type_lines(child, *_HEADING, ".009\x7f4", "done", *ENTERS, "")
    child.expect_exact("RESULT N123AB LH {1: 0.004}")


def test_the_arrow_keys_move_in_what_was_typed(start: Start) -> None:
    child = start()
    type_lines(child, *_HEADING, ".04\x1b[D0", "done", *ENTERS, "")
    child.expect_exact("RESULT N123AB LH {1: 0.004}")


def test_without_line_editing_an_arrow_key_is_refused(start: Start, tmp_path: Path) -> None:
    child = start(stdout=tmp_path / "out.txt")
    type_lines(child, *_HEADING, "0.13\x1b[D0")
    child.expect_exact("(an arrow?)")


@pytest.mark.parametrize("errors", ["strict", "surrogateescape"])
def test_bytes_that_are_not_text_are_refused(start: Start, errors: str) -> None:
    child = start(PYTHONIOENCODING=f"utf-8:{errors}")
    child.expect_exact(_PROMPT)
    os.write(child.fileno(), b"N\xff\xfe1\n")
    child.expect_exact("Type the line again")


def test_a_resized_terminal_gets_lines_that_fit(start: Start) -> None:
    columns = 40
    child = start()
    type_lines(child, *_HEADING)
    child.expect_exact(_PROMPT)
    child.setwinsize(24, columns)
    child.sendline(".004")
    # The line editor may draw its prompt again for the new size before the answer is read.
    child.expect_exact("joint 2 of 10")
    shown = child.before + child.after
    child.expect_exact(_PROMPT)
    rows = without_colour(shown + child.before).splitlines()
    assert max(map(len, rows)) <= columns


def test_a_resize_while_typing_loses_nothing(start: Start) -> None:
    child = start()
    type_lines(child, *_HEADING)
    child.expect_exact(_PROMPT)
    child.send(".00")
    child.setwinsize(30, 100)
    child.sendline("4")
    type_lines(child, "done", *ENTERS, "")
    child.expect_exact("RESULT N123AB LH {1: 0.004}")


def test_colours_are_used_in_a_terminal_that_has_them(start: Start) -> None:
    assert "\x1b[" in type_lines(start(), *_HEADING, ".008", "q")


@pytest.mark.parametrize("variable", [{"NO_COLOR": "1"}, {"TERM": "dumb"}])
def test_without_colour_no_escape_is_written(start: Start, variable: dict[str, str]) -> None:
    seen = type_lines(start(**variable), *_HEADING, ".008", "q")
    assert "OVER THE LIMIT" in seen
    assert "\x1b" not in seen


def test_without_utf8_everything_is_ascii(start: Start) -> None:
    seen = type_lines(
        start(LANG="xx.ISO-8859-1"), *_HEADING, ".008", "?", "s", "done", "?", *ENTERS, "?", "q"
    )
    assert "[1]======(2)" in without_colour(seen)
    assert seen.isascii()


def test_with_utf8_the_sketch_is_drawn_in_lines(start: Start) -> None:
    assert "══════(2)" in type_lines(start(), *_HEADING, "q")


def test_a_tail_number_in_other_letters_survives_a_terminal_without_utf8(start: Start) -> None:
    child = start(LANG="C")
    type_lines(child, "ЯК-40", *_HEADING[1:], "q")
    child.expect_exact("mlg check --resume")


def test_standard_output_holds_the_result_only(start: Start, tmp_path: Path) -> None:
    out = tmp_path / "out.txt"
    child = start(stdout=out)
    type_lines(child, *_HEADING, ".004", "done", *ENTERS, "")
    assert exit_code(child) == 0
    assert out.read_text() == "RESULT N123AB LH {1: 0.004}\n"


def test_no_line_is_wider_than_the_terminal(start: Start) -> None:
    seen = type_lines(
        start(), *_HEADING, "?", ".013", *[".004"] * 9, "?", "f p -.041 m .028", *ENTERS, "?", "q"
    )
    assert max(map(len, without_colour(seen).splitlines())) <= 80


def test_control_characters_never_reach_the_terminal(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("NO_COLOR", "1")
    RichTerminal().say((line("N1\x1b[31m\x07"),))
    assert capsys.readouterr().err == " N1‹U+001B›[31m‹U+0007›\n"


@pytest.mark.parametrize(
    ("environment", "spoken"),
    [
        ({"LANG": "en_US.UTF-8"}, True),
        ({"LANG": "C.utf8"}, True),
        ({"LANG": "de_DE.ISO-8859-1"}, False),
        ({"LANG": "C"}, False),
        ({}, False),
        ({"LANG": "en_US.UTF-8", "LC_ALL": "C"}, False),
        ({"LANG": "C", "LC_CTYPE": "C.UTF-8"}, False),
        ({"LANG": "de_DE.UTF-8", "LC_CTYPE": "C.UTF-8"}, True),
        ({"LC_CTYPE": "UTF-8"}, True),
        ({"LANG": "C", "LC_CTYPE": "en_US.UTF-8"}, True),
        ({"LANG": "en_US.UTF-8", "LC_CTYPE": "POSIX"}, False),
    ],
)
def test_the_locale_says_whether_utf8_is_spoken(
    environment: dict[str, str], spoken: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("LANG", "LC_CTYPE", "LC_ALL"):
        monkeypatch.delenv(name, raising=False)
    for name, value in environment.items():
        monkeypatch.setenv(name, value)
    assert speaks_utf8() is spoken
