"""``mlg gear survey ask``: the readings of a survey typed at the line, each kept at once."""

from __future__ import annotations

import csv
import os
import sys
from collections.abc import Iterable
from pathlib import Path

import pytest

from mlg_troubleshoot.cli.prompts import Line
from mlg_troubleshoot.cli.survey_prompts import ask_survey
from mlg_troubleshoot.errors import UsageError
from mlg_troubleshoot.gear.gear_file import load_gear
from mlg_troubleshoot.records.survey_table import read_survey, write_survey_template
from mlg_troubleshoot.surveying.readings import ReadingKind, SurveyedLinkage, SurveyReading
from tests.cli.conftest import ROOT, mlg
from tests.keys import interrupt

pexpect = pytest.importorskip("pexpect")
FOUR_BAR = ROOT / "tests" / "geometry" / "data" / "four-bar.toml"
PLAN = [
    SurveyReading(ReadingKind.DISTANCE, "O2", "A"),
    SurveyReading(ReadingKind.DISTANCE, "A", "B"),
    SurveyReading(ReadingKind.PLUNGER, u=0.02, extension=0.4, is_angle=True, driven_in="rad"),
]


class Typed:
    """A terminal on which the answers are typed in turn; what was said is kept."""

    width = 80

    def __init__(self, *answers: str) -> None:
        self.answers, self.said = list(answers), ""

    def say(self, lines: Iterable[Line]) -> None:
        self.said += "".join(f"{each.text}\n" for each in lines)

    def ask(self, prompt: str) -> str:
        self.said += prompt
        return self.answers.pop(0)


@pytest.fixture
def file(tmp_path: Path) -> Path:
    write_survey_template(
        tmp_path / "s.csv", SurveyedLinkage(load_gear(FOUR_BAR)), [(r, True) for r in PLAN]
    )
    return tmp_path / "s.csv"


def typed(file: Path, *answers: str) -> tuple[Typed, bool, dict[int | None, float]]:
    terminal, gear = Typed(*answers), load_gear(FOUR_BAR)
    ended = ask_survey(file, gear, terminal)
    return terminal, ended, {r.row: r.value for r in read_survey(file, SurveyedLinkage(gear))[0]}


def test_each_reading_is_asked_for_in_words_and_kept_with_its_unit(file: Path) -> None:
    terminal, ended, values = typed(file, "53.34 mm", "7150 thou", "-12.5")
    assert ended
    assert values == pytest.approx({2: 2.1, 3: 7.15, 4: -0.218166}, rel=1e-5)
    assert "2 of 3: distance A to B" in terminal.said
    assert "3 of 3: plunger at extension 0.4" in terminal.said


def test_a_reading_can_be_skipped_and_gone_back_to(file: Path) -> None:
    _, _, values = typed(file, "", "7.15", "b", "b", "2.1", "7.2", "done")
    assert values == pytest.approx({2: 2.1, 3: 7.2})


@pytest.mark.parametrize("answer", ["two", "-2.1", "2.1 kg", "900", "2.1 deg"])
def test_what_is_not_such_a_reading_is_asked_again_and_not_kept(file: Path, answer: str) -> None:
    terminal, _, values = typed(file, answer, "done")
    assert "expected" in terminal.said
    assert values == {}
    assert terminal.said.count(" in > ") == 2


def test_a_question_mark_says_what_can_be_typed(file: Path) -> None:
    terminal, _, values = typed(file, "?", "done")
    assert "A number such as 7.15 or 181.6 mm, in in where it has no unit." in terminal.said
    assert values == {}


def test_a_later_run_goes_on_at_the_first_reading_that_lacks(file: Path) -> None:
    assert typed(file, "2.1", "q")[1:] == (False, {2: 2.1})
    terminal, _, values = typed(file, "7.15", "done")
    assert "1 of 3" not in terminal.said
    assert values == {2: 2.1, 3: 7.15}


def test_a_table_that_is_not_a_template_is_left_alone(tmp_path: Path) -> None:
    (tmp_path / "s.csv").write_text("a;b\n1;2\n")
    with pytest.raises(UsageError):
        typed(tmp_path / "s.csv", "1")
    assert (tmp_path / "s.csv").read_text() == "a;b\n1;2\n"


def test_without_a_terminal_a_template_is_asked_for(tmp_path: Path) -> None:
    run = mlg("gear", "survey", "ask", tmp_path / "s.csv")
    assert (run.code, "mlg gear survey template" in run.err) == (2, True)


@pytest.mark.skipif(sys.platform == "win32", reason="needs a pseudo-terminal")
@pytest.mark.filterwarnings("ignore:.*multi-threaded:DeprecationWarning")
def test_an_interrupt_at_the_line_loses_nothing_and_says_how_to_go_on(tmp_path: Path) -> None:
    environment = {
        "PATH": os.environ["PATH"],
        "HOME": str(tmp_path),
        "PYTHONPATH": str(ROOT),
        "TERM": "dumb",
    }
    command = ["-m", "mlg_troubleshoot", "gear", "--gear", str(FOUR_BAR), "survey", "ask", "s.csv"]
    child = pexpect.spawn(
        sys.executable, command, env=environment, cwd=tmp_path, encoding="utf-8", timeout=60
    )
    child.expect_exact("> ")
    child.sendline("1.5")
    child.expect_exact("2 of")
    child.expect_exact("> ")
    interrupt(child, r"mlg gear survey ask s\.csv")
    child.expect(pexpect.EOF)
    child.close()
    assert child.exitstatus == 130
    with (tmp_path / "s.csv").open(newline="") as kept:
        assert next(row["value_in"] or row["value_deg"] for row in csv.DictReader(kept)) == "1.5"
