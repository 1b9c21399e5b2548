"""What the terminal says of the next joint and repair; reports in the unit asked."""

from __future__ import annotations

import re
from html import unescape
from pathlib import Path

import pypdf
import pytest

from tests.cli.conftest import FAILURE, Table, mlg, row

HAND = (
    *("check", "--tail", "N123", "--side", "LH", "--set", "record_id=R1", "--convention", "RADIAL"),
)


def said(*arguments: object) -> str:
    """What a run shows, frames and line ends folded."""
    return " ".join(re.sub(r"[│╭╮╰╯─]", " ", mlg(*arguments).out).split())


FAILED = ("--set", "outcome=FAILED")


@pytest.fixture(scope="module")
def explained() -> str:
    """A gear whose plunger stands off, two joints measured."""
    values = ("2=0.001in", "4=0.001in", "plunger=0.036in")
    return said(*HAND, *(f"--set={each}" for each in values), *FAILED, "--detail")


@pytest.fixture(scope="module")
def failure() -> str:
    """The published failure."""
    return said("check", FAILURE, "--detail")


def test_what_the_plan_expects_stands_below_with_its_minutes_and_its_end(failure: str) -> None:
    assert re.search(r"Expected after that: .* Sign the repair off", failure)


def test_the_quickest_repair_is_shown_with_what_it_leaves() -> None:
    clearances = dict.fromkeys(range(1, 11), 0.001) | {3: 0.013, 5: 0.007}
    flags = (
        flag for joint, value in clearances.items() for flag in ("--set", f"{joint}={value}in")
    )
    shown = said(*HAND, "--detail", *flags)
    assert re.search(
        r"restore kind minutes worst case in within second repair #3, #5 sure \d+ 0\.01\d\d",
        shown,
    )
    assert "A restored joint counts with the radial clearance of a new part, 0.0005 in." in shown


def test_the_joints_that_explain_a_reading_are_given_as_pairs_that_act_alike(explained):
    assert "#3 or #5" in explained


DAY = ("--set", "outcome=FAILED", "--set", "plunger=0.036in")
WORN = tuple(
    flag
    for joint in range(1, 11)
    for flag in ("--set", f"{joint}={0.013 if joint == 3 else 0.001}in")
)


def test_flags_of_the_day_bind_next_and_say_what_stays_open() -> None:
    shown = said(*HAND, *WORN, *DAY, "--set", "no_spare=3")
    assert "OPEN: #3 is over the limit and cannot be restored today." in shown


def test_a_joint_that_a_flag_of_the_day_names_must_exist() -> None:
    run = mlg(*HAND, *WORN, "--set", "cannot_reach=14")
    assert run.code == 2
    assert "--set 'cannot_reach=14'" in run.err


def written(folder: Path) -> str:
    (page,) = folder.glob("*.html")
    body = re.sub(r"<style>.*?</style>", " ", page.read_text(encoding="utf-8"), flags=re.DOTALL)
    return unescape(re.sub(r"<[^>]*>", " ", body)).replace("\u00a0", " ")


def test_a_report_of_a_check_stands_in_the_unit_to_show(tmp_path: Path) -> None:
    gear = (
        *("--tail", "N1", "--side", "LH", "--convention", "RADIAL", "--set", "3=0.013in", "--set"),
        "5=0.007in",
    )
    mlg("check", *gear, "--show", "thou", "--report", tmp_path, "--format", "html")
    assert "47.2 thou" in written(tmp_path)
    assert "0.0472 in" not in written(tmp_path)


def test_each_report_of_a_table_says_what_follows_next(tmp_path: Path, table: Table) -> None:
    blank = {f"clearance_{n}_in": "" for n in range(2, 11)}
    rows = [row(record_id=f"R{n}", tail_no=f"N{n}", outcome="FAILED", **blank) for n in (1, 2)]
    mlg("check", table(*rows), "--report", tmp_path / "out", "--format", "html")
    for page in (tmp_path / "out").glob("mlg-N*.html"):
        assert "IF the plunger is within its margin, THEN" in page.read_text(encoding="utf-8")


def test_a_form_to_fill_in_by_hand_has_the_paper_and_the_unit_asked_for(tmp_path, monkeypatch):
    monkeypatch.setenv("MLG_PAGE", "Letter")
    assert mlg("template", tmp_path / "form.pdf", "--unit", "mm").code == 0
    (page,) = pypdf.PdfReader(tmp_path / "form.pdf").pages
    assert round(page.mediabox.width) == 612
    assert "0.190" in page.extract_text()


def test_a_form_of_an_unknown_kind_is_refused(tmp_path: Path) -> None:
    assert mlg("template", tmp_path / "form.docx").code == 2
