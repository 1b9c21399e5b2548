"""README.md: its commands work, its sessions and pictures are what the program makes today."""

from __future__ import annotations

import doctest
import re
import subprocess
import tomllib
from pathlib import Path
from urllib.parse import unquote

import pytest

from tests import readme_examples
from tests.readme_examples import PICTURES, README, ROOT, Session

TEXT = README.read_text(encoding="utf-8")
CHECK_COMMAND = (
    "python3 -m venv .venv && .venv/bin/pip install -q . && "
    ".venv/bin/mlg check inspection_data/failure_case.csv --report report"
)
TEST_COMMAND = "python3 -m venv .venv && .venv/bin/pip install -q -e '.[dev]' && .venv/bin/python -m pytest"
SESSIONS = [session for _match, session in readme_examples.sessions(TEXT)]
NUMBER = re.compile(r"-?\d+\.\d+")
OUT_OF_DATE = "run: python tests/readme_examples.py"


def test_the_first_command_stands_there_exactly() -> None:
    assert f"```sh\n{CHECK_COMMAND}\n```" in TEXT


def test_the_test_command_stands_directly_under_its_mark() -> None:
    assert f"<!-- test command -->\n```sh\n{TEST_COMMAND}\n```" in TEXT


def test_continuous_integration_takes_the_test_command_from_here() -> None:
    script = (ROOT / ".ci" / "run").read_text(encoding="utf-8")
    (line,) = [line for line in script.splitlines() if line.startswith("test_command=")]
    found = subprocess.run(
        ["bash", "-c", f'{line}\nprintf %s "$test_command"'], cwd=ROOT, capture_output=True, text=True, check=True
    )
    assert found.stdout == TEST_COMMAND


def test_exit_code_1_is_explained_beside_the_command() -> None:
    after = TEXT.partition(CHECK_COMMAND)[2][:200]
    assert 'exit code 1. That is no error: it means "not within margin"' in after


@pytest.mark.parametrize("session", SESSIONS, ids=[s.commands[0].split("|")[0].strip()[:50] for s in SESSIONS])
def test_a_session_prints_today_what_stands_there(session: Session, tmp_path: Path) -> None:
    assert readme_examples.run(session.commands, tmp_path).written() == session.written(), OUT_OF_DATE


def test_there_are_sessions() -> None:
    assert len(SESSIONS) > 5


@pytest.mark.parametrize("block", re.findall(r"^```pycon\n(.*?)^```$", TEXT, re.DOTALL | re.MULTILINE))
def test_the_python_examples_are_true(block: str) -> None:
    example = doctest.DocTestParser().get_doctest(block, {}, "README.md", str(README), 0)
    assert example.examples
    assert doctest.DocTestRunner(verbose=False).run(example).failed == 0


@pytest.mark.parametrize("name", ["linkage.svg", "plunger.svg"])
def test_a_picture_is_what_the_program_draws_today(name: str) -> None:
    shipped, drawn = (PICTURES / name).read_text(encoding="utf-8"), readme_examples.pictures()[name]
    assert NUMBER.sub("#", shipped) == NUMBER.sub("#", drawn), OUT_OF_DATE
    # Other processors round the last digit otherwise.
    assert [float(n) for n in NUMBER.findall(shipped)] == pytest.approx(
        [float(n) for n in NUMBER.findall(drawn)], abs=0.02
    ), OUT_OF_DATE


def test_a_picture_says_where_the_geometry_comes_from() -> None:
    assert "reconstructed from published figures, not drawing data" in (PICTURES / "linkage.svg").read_text("utf-8")


def anchors() -> set[str]:
    headings = re.findall(r"^#+ (.*)$", TEXT, re.MULTILINE)
    return {"#" + re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


@pytest.mark.parametrize("target", sorted(set(re.findall(r"\]\(([^)]+)\)", TEXT))))
def test_every_link_leads_somewhere(target: str) -> None:
    assert target in anchors() or (ROOT / unquote(target)).exists()


def test_every_script_that_is_named_exists() -> None:
    scripts = set(re.findall(r"python ((?:\w+/)+\w+\.py)", TEXT))
    assert scripts
    assert [s for s in scripts if not (ROOT / s).is_file()] == []


def test_the_python_version_is_that_of_the_project() -> None:
    wanted = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["requires-python"]
    assert f"Python {wanted.removeprefix('>=')} or later" in TEXT


@pytest.mark.parametrize(
    "said",
    [
        "does not replace the maintenance manual's limits",
        "not an approval for return to service",
        "The geometry is synthetic",
        "The published failure was fitted",
        "The worst case is a bound",
        "Both ends of one link act alike",
        "In-plane joint clearance only",
    ],
)
def test_what_the_program_cannot_say_is_said(said: str) -> None:
    assert said in " ".join(TEXT.split())


def test_every_room_of_the_package_is_named() -> None:
    rooms = {p.name for p in (ROOT / "mlg_troubleshoot").iterdir() if p.is_dir() and not p.name.startswith("_")}
    assert {room for room in rooms if f"`{room}/`" not in TEXT} == set()
