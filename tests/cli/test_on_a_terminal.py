"""``mlg check`` on a real terminal: questions in, verdict out, and an entry that was broken off."""

from __future__ import annotations

import os
import re
import signal
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from tests.benchmarks.bench_check import write_inspections
from tests.cli.conftest import FLEET, ROOT
from tests.keys import interrupt
from tests.prompts.scripted import ENTERS

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
    answer(child, "N123", "l", "i", "r", *FIRST_FIVE, "done", "f", *ENTERS, "")
    child.expect_exact("#3 short link inner")
    child.expect_exact("COULD BE OUTSIDE")
    answer(child, "")
    assert finish(child) == 1


def test_a_shown_result_is_reported_and_corrected_and_shown_in_the_unit_of_entry(
    start: Start, tmp_path: Path
) -> None:
    child = start(
        "check",
        "--tail",
        "N77",
        "--side",
        "RH",
        "--unit",
        "thou",
        "--convention",
        "RADIAL",
        cwd=tmp_path,
    )
    answer(child, "13", "done", *ENTERS, "")
    child.expect_exact(" thou")
    child.expect_exact("butes")
    answer(child, "c")
    child.expect_exact("check before computing")
    answer(child, "1", "1", "", "r")
    child.expect_exact("Report: report")
    answer(child, "")
    assert finish(child) == 1
    (page,) = (tmp_path / "report").glob("*.html")
    assert re.search(r"\d thou", page.read_text(encoding="utf-8"))
    again = start("check", "--resume")
    again.expect_exact("there is no unfinished entry")


def test_a_result_that_was_shown_is_kept_while_the_last_question_stands(start: Start) -> None:
    child = start(
        "check", "--tail", "N77", "--side", "RH", "--unit", "in", "--convention", "RADIAL"
    )
    answer(child, ".001", "done", *ENTERS, "")
    child.expect_exact("Enter = done")
    child.kill(signal.SIGHUP)
    child.expect(pexpect.EOF)
    again = start("check", "--tail", "N77", "--side", "RH")
    again.expect_exact("N77 RH, last inspected")
    again.expect_exact(PROMPT)
    interrupt(again)
    finish(again)


def test_an_interrupt_says_how_to_go_on_and_exits_130(start: Start) -> None:
    child = start("check")
    answer(child, "N123", "l")
    child.expect_exact(PROMPT)
    interrupt(child, "mlg check --resume")
    assert finish(child) == 130


def test_an_interrupted_entry_goes_on_where_it_stopped(start: Start) -> None:
    child = start("check")
    answer(child, "N123", "l", "i", "r", "0.001")
    child.expect_exact("joint 2 of 10")
    interrupt(child)
    finish(child)
    again = start("check", "--resume")
    again.expect_exact("joint 2 of 10")
    interrupt(again)
    assert finish(again) == 130


def test_flags_answer_questions_beforehand(start: Start) -> None:
    child = start(
        "check", "--tail", "N77", "--side", "RH", "--unit", "thou", "--convention", "TOTAL_PLAY"
    )
    child.expect_exact("N77 RH")
    child.expect_exact("joint 1 of 10")
    interrupt(child)
    assert finish(child) == 130


def test_a_tail_from_a_flag_that_is_none_is_refused_before_anything_is_asked(start: Start) -> None:
    child = start("check", "--tail", "n/a", "--side", "RH")
    child.expect_exact("--tail 'n/a': expected a tail number")
    assert finish(child) == 2


def test_a_joint_that_was_just_skipped_is_not_asked_for_next(start: Start) -> None:
    child = start(
        "check", "--tail", "N77", "--side", "RH", "--unit", "in", "--convention", "RADIAL"
    )
    answer(child, ".001", ".001", ".001", ".001", "s")
    child.expect_exact("joint 6 of 10")
    assert "Most useful next reading: #5" not in child.before
    interrupt(child)
    finish(child)


def test_a_large_batch_shows_its_progress(start: Start, tmp_path: Path) -> None:
    write_inspections(tmp_path / "batch.csv", 1000)
    child = start("check", tmp_path / "batch.csv")
    child.expect(r"Judging .*/1000")
    child.expect_exact("1000 inspections:")
    assert finish(child) == 1


def test_a_batch_fits_the_terminal(start: Start) -> None:
    child = start("check", FLEET)
    child.expect_exact("verdict")
    child.expect_exact("Model:")
    plain = [line for line in child.before.splitlines() if "258-" in line]
    assert len(plain) == 12
    finish(child)
