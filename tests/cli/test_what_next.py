"""What the terminal says about the next joint, the repair, re-rigging and the joints that explain a
reading.
"""

from __future__ import annotations

import re

import pytest

from tests.cli.conftest import FAILURE, mlg

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
        r"restore kind minutes worst case in within second repair #3 and #5 sure \d+ 0\.01\d\d",
        shown,
    )
    assert "A restored joint counts with the radial clearance of a new part, 0.0005 in." in shown


def test_re_rigging_alone_is_shown_with_the_risk_that_stays(failure: str) -> None:
    assert re.search(r"Re-rigging alone, .*, would leave a worst case of 0\.0450 in", failure)


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
