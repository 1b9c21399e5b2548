"""Entries that are interrupted at random moments: no answer is lost or asked again.

``python -m tests.prompts.test_interruptions 200`` says how many were; a second number is the seed.
"""

from __future__ import annotations

import os
import random
import signal
import sys
import tempfile
import time
from dataclasses import dataclass, field
from pathlib import Path

import pytest

from mlg_troubleshoot.gear.gear_file import load_gear
from mlg_troubleshoot.life.folding import lives
from mlg_troubleshoot.life.state import state_now
from mlg_troubleshoot.store import Store
from tests.cli.conftest import mlg

pexpect = pytest.importorskip("pexpect")
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(sys.platform == "win32", reason="needs a pseudo-terminal"),
    pytest.mark.filterwarnings("ignore:.*multi-threaded:DeprecationWarning"),
]
_ROOT = Path(__file__).parents[2]
_ENDS = (signal.SIGKILL, signal.SIGHUP, signal.SIGINT)
# Every question by the beginning of its prompt, and what is typed there.
_ANSWERS = {
    "Tail number": "N{gear}",
    "Side": "LH",
    "Unit": "thou",
    "Readings are": "",
    "A clearance": "play",
    "Did it retract": "f",
    "Plunger": "4{digit}",
    **{f"#{n} ": f"{n + 2}" for n in range(1, 11)},
    "Measured by": "A. Smith",
    "Gauge": "G-7",
}
_RESULT = "Enter ends"


@dataclass
class Trial:
    """Gears that are entered one after the other while the program is interrupted."""

    home: Path
    chance: random.Random
    gear: int = 1
    interruptions: int = 0
    acknowledged: set[str] = field(default_factory=set)
    asked_again: list[str] = field(default_factory=list)
    ended: dict[int, str] = field(default_factory=dict)

    @property
    def store(self) -> Path:
        return self.home / "store.sqlite"

    def start(self, *arguments: str) -> pexpect.spawn:
        child = pexpect.spawn(
            sys.executable,
            ["-m", "mlg_troubleshoot", "check", "--store", str(self.store), *arguments],
            dimensions=(24, 80),
            env={
                "PATH": os.environ["PATH"],
                "HOME": str(self.home),
                "PYTHONPATH": str(_ROOT),
                "LANG": "C.UTF-8",
                "TERM": "xterm",
                "NO_COLOR": "1",
            },
            encoding="utf-8",
            timeout=60,
        )
        child.delaybeforesend = None
        # A loaded machine takes its time to end a process.
        child.ptyproc.delayafterterminate = 2.0
        return child

    def asked(self, child: pexpect.spawn) -> str | None:
        """The question that stands at the prompt; None after the end."""
        if child.expect_exact([" > ", pexpect.EOF]) == 1:
            return None
        prompt = child.before.rpartition("\n")[2].strip()
        if _RESULT in prompt:
            return _RESULT
        return next(each for each in _ANSWERS if f"{prompt} ".startswith(each))

    def run(self) -> None:
        """One start of the program, and its end at a random moment."""
        child = self.start(*(f"N{self.gear}", "LH") if self.acknowledged else ())
        pending = ""
        for _ in range(self.chance.randint(1, 6)):
            question = self.asked(child)
            if question is not None and pending:
                self.acknowledged.add(pending)
            if question is None or question == _RESULT:
                self.ended[self.gear] = child.before
                self.next_gear(child)
                return
            if question in self.acknowledged:
                self.asked_again.append(f"N{self.gear}: {question}")
            pending = question
            child.sendline(_ANSWERS[question].format(gear=self.gear, digit=self.gear % 10))
        time.sleep(self.chance.choice((0.0, 0.002, 0.01, 0.05, 0.2)))
        child.kill(self.chance.choice(_ENDS))
        # Ctrl-C between a prompt and the wait for a key is seen with the next key only.
        child.expect([pexpect.EOF, pexpect.TIMEOUT], timeout=5)
        child.close(force=True)
        self.interruptions += 1

    def next_gear(self, child: pexpect.spawn) -> None:
        if child.isalive():
            child.kill(self.chance.choice(_ENDS))
            self.interruptions += 1
        child.close(force=True)
        self.acknowledged.clear()
        self.gear += 1

    def missing(self) -> list[str]:
        """What the store lacks of the gears whose result was shown."""
        kept = lives(Store(self.store))
        lost = []
        for gear in range(1, self.gear):
            life = kept.get((f"N{gear}", "LH"))
            found = None if life is None else life.inspections[-1].inspection
            if (
                found is None
                or len(found.clearance_in) != 10
                or any(str(found.entered[n]) != f"{n + 2} thou" for n in range(1, 11))
                or found.outcome != "FAILED"
                or abs(found.readings_in[0] - 0.040 - 0.001 * (gear % 10)) > 1e-9
                or found.technician_id != "A. Smith"
            ):
                lost.append(f"N{gear}: {found}, after {self.ended[gear][-600:]!r}")
        return lost


def interrupted(home: Path, count: int, seed: int = 1) -> Trial:
    trial = Trial(home, random.Random(seed))
    while trial.interruptions < count:
        trial.run()
    return trial


def test_two_hundred_interruptions_lose_no_answer(tmp_path: Path) -> None:
    trial = interrupted(tmp_path, 200)
    assert trial.asked_again == []
    assert trial.missing() == []


# What is typed at a second visit.
_SECOND = ("restored 3 5", "", "4", "5")


@pytest.mark.parametrize("end", _ENDS)
@pytest.mark.parametrize("place", range(len(_SECOND) + 1))
def test_a_second_visit_loses_no_answer_at_any_question(end, place, tmp_path):
    trial = Trial(tmp_path, random.Random(1))
    entered = [f"--set={n}={n + 2}thou" for n in range(1, 11)]
    gear = ("--tail", "N1", "--side", "LH")
    mlg("check", *gear, "--convention", "TOTAL_PLAY", *entered, "--keep", "--store", trial.store)
    child = trial.start(*gear, "--unit", "thou", "--convention", "TOTAL_PLAY")
    for text in _SECOND[:place]:
        child.expect_exact(" > ")
        child.sendline(text)
    child.expect_exact(" > ")
    child.kill(end)
    child.expect([pexpect.EOF, pexpect.TIMEOUT], timeout=5)
    child.close(force=True)
    child = trial.start("N1", "LH")
    for text in _SECOND[place:]:
        child.expect_exact(" > ")
        child.sendline(text)
    child.expect_exact("Enter ends > ")
    child.close(force=True)
    visits = lives(Store(trial.store))["N1", "LH"].visits
    found = state_now(visits, load_gear())
    assert found is not None
    assert [str(found.inspection.entered[n]) for n in (3, 4, 5)] == ["4 thou", "6thou", "5 thou"]
    assert sorted(visit.inspection.restored_joints for visit in visits) == [(), (), (3, 5)]


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as folder:
        done = interrupted(Path(folder), *map(int, sys.argv[1:]))
        print(
            f"{done.interruptions} interruptions, {done.gear - 1} gears; asked again:"
            f" {done.asked_again or 'none'}; missing: {done.missing() or 'none'}"
        )
