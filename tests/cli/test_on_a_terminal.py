"""``mlg check`` on a real terminal: questions in, verdict out, and an entry that was broken off."""

from __future__ import annotations

import os
import re
import signal
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from tests.benchmarks.made import write_csv
from tests.cli.conftest import FLEET, ROOT
from tests.keys import interrupt

pexpect = pytest.importorskip("pexpect")
pytestmark = [
    pytest.mark.skipif(sys.platform == "win32", reason="needs a pseudo-terminal"),
    pytest.mark.filterwarnings("ignore:.*multi-threaded:DeprecationWarning"),
]
PROMPT = "> "
FIRST_FIVE = ("0.001", ".001 in", "13 thou", "0.0254 mm", ".007")

Start = Callable[..., "pexpect.spawn"]


@pytest.fixture
def start(tmp_path: Path) -> Iterator[Start]:
    """Start ``mlg`` on a terminal of 80×40, with a home of its own."""
    started = []

    def begin(*arguments: object, cwd: Path | None = None, **more: str) -> pexpect.spawn:
        child = pexpect.spawn(
            sys.executable,
            ["-m", "mlg_troubleshoot", *(str(a) for a in arguments)],
            dimensions=(40, 80),
            env={
                "PATH": os.environ["PATH"],
                "HOME": str(tmp_path),
                "PYTHONPATH": str(ROOT),
                "TERM": "xterm-256color",
                "LANG": "C.UTF-8",
                **more,
            },
            cwd=cwd,
            encoding="utf-8",
            timeout=60,
        )
        child.delaybeforesend = None
        started.append(child)
        return child

    yield begin
    for child in started:
        child.close(force=True)


def answer(child: pexpect.spawn, *answers: str) -> None:
    for text in answers:
        child.expect_exact(PROMPT)
        child.sendline(text)


def finish(child: pexpect.spawn) -> int:
    if child.after is not pexpect.EOF:
        child.expect(pexpect.EOF)
    child.close()
    return int(child.exitstatus)


def test_answers_lead_to_a_verdict_and_the_exit_code(start: Start) -> None:
    child = start("check")
    answer(child, "N123 LH", "in", "radial", "f", "", *FIRST_FIVE, "done", "", "")
    child.expect_exact("COULD BE OUTSIDE")
    answer(child, "")
    assert finish(child) == 1


def test_a_result_that_was_shown_is_kept_while_the_last_question_stands(start: Start) -> None:
    child = start("check", "N77", "RH", "--unit", "in", "--convention", "RADIAL")
    answer(child, "n", "", ".001", "done", "", "")
    child.expect_exact("Enter ends")
    child.kill(signal.SIGHUP)
    child.expect(pexpect.EOF)
    again = start("check", "N77", "RH")
    again.expect_exact("N77 RH")
    answer(again, "")
    assert finish(again) == 1


def test_an_interrupt_says_how_to_go_on_and_exits_130(start: Start) -> None:
    child = start("check")
    answer(child, "N123", "lh")
    child.expect_exact(PROMPT)
    interrupt(child, "Continue it with: mlg check")
    assert finish(child) == 130


def test_a_tail_from_a_flag_that_is_none_is_refused_before_anything_is_asked(start: Start) -> None:
    child = start("check", "--tail", "n/a", "--side", "RH")
    child.expect_exact("'n/a' is not accepted: expected a tail number")
    assert finish(child) == 2


@pytest.mark.parametrize(
    "plain",
    [
        {"TERM": "dumb"},
        pytest.param({"NO_COLOR": "1"}, marks=pytest.mark.slow),
        pytest.param({"MLG_PLAIN": "1"}, marks=pytest.mark.slow),
    ],
)
def test_a_plain_terminal_has_the_same_words_without_colour_and_boxes(start, plain):
    child = start("check", FLEET, **plain)
    child.expect_exact("Model:")
    assert "\x1b" not in child.before
    assert not re.search(r"[─│╭╰━]", child.before)
    finish(child)


def test_a_large_batch_shows_its_progress_unless_it_is_to_be_quiet(start, tmp_path):
    write_csv(tmp_path / "batch.csv", 400, blank=0.05)
    child = start("check", tmp_path / "batch.csv")
    child.expect(r"Judging .*/400")
    child.expect_exact("400 inspections:")
    assert finish(child) == 1
    child = start("check", tmp_path / "batch.csv", "--quiet")
    child.expect(pexpect.EOF)
    assert "Judging" not in child.before


@pytest.mark.slow
def test_a_batch_fits_the_terminal(start: Start) -> None:
    child = start("check", FLEET)
    child.expect_exact("verdict")
    child.expect_exact("Model:")
    plain = [line for line in child.before.splitlines() if "258-" in line]
    assert len(plain) == 12
    finish(child)


@pytest.mark.parametrize("columns", [60, pytest.param(80, marks=pytest.mark.slow)])
def test_a_message_is_folded_between_words(start: Start, tmp_path: Path, columns: int) -> None:
    table = tmp_path / "bad.csv"
    table.write_text("record_id,tail_no,side,clearance_3_in\nR1,N1,middle,many\n")
    child = start("check", "bad.csv", cwd=tmp_path, COLUMNS=str(columns), NO_COLOR="1")
    child.expect(pexpect.EOF)
    lines = child.before.splitlines()
    assert max(map(len, lines)) <= columns
    for whole in ("TOTAL_PLAY", "clearance_convention", "'middle'"):
        assert whole in child.before
