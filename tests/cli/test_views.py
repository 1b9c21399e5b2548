"""What a person sees: the same facts in 80 columns and in 110."""

from __future__ import annotations

import re

import pytest
from rich.console import Console

from mlg_troubleshoot.cli import output
from tests.cli.conftest import FAILURE, FLEET, Run, Table, mlg, row

WIDTHS = pytest.mark.parametrize("width", [80, 110])
JOINTS = {
    1: "actuator rod end",
    2: "locking pin",
    3: "short link inner bearing",
    4: "locking lever pivot",
    5: "short link outer bearing",
    6: "extension lever end",
    7: "bellcrank input joint",
    8: "bellcrank pivot",
    9: "bellcrank output joint",
    10: "plunger pin",
}


@pytest.fixture
def shown(monkeypatch: pytest.MonkeyPatch, width: int) -> Run:
    """The failure case on a terminal of that width."""
    return at_width(monkeypatch, width, "check", FAILURE)


def at_width(monkeypatch: pytest.MonkeyPatch, width: int, *arguments: object) -> Run:
    def console(*, to_stderr: bool = False) -> Console:
        return Console(stderr=to_stderr, highlight=False, width=width, force_terminal=False)

    monkeypatch.setattr(output, "console", console)
    return mlg(*arguments)


@WIDTHS
def test_every_joint_is_named(shown: Run, width: int) -> None:
    words = " ".join(shown.out.split())
    for number, name in JOINTS.items():
        assert re.search(rf"#{number} {' .*'.join(name.split())}", words), f"#{number} {name}"


@WIDTHS
def test_no_heading_is_cut_off(shown: Run, width: int) -> None:
    assert "…" not in shown.out


@WIDTHS
def test_no_line_is_wider_than_the_terminal(shown: Run, width: int) -> None:
    assert max(len(line) for line in shown.out.splitlines()) <= width


@WIDTHS
def test_the_verdict_stands_in_words_with_a_mark_that_needs_no_colour(shown: Run, width: int) -> None:
    assert "[!] OUTSIDE MARGIN" in shown.out


@WIDTHS
def test_a_batch_has_one_line_for_each_gear(width: int, monkeypatch: pytest.MonkeyPatch) -> None:
    lines = at_width(monkeypatch, width, "check", FLEET).out.splitlines()
    verdicts = [line for line in lines if re.match(r"[!~?X=] ", line)]
    assert len(verdicts) == len(FLEET.read_text(encoding="utf-8").splitlines()) - 1


def test_the_worst_gear_of_a_batch_stands_first(fleet_json: Run) -> None:
    worst = min(
        (i for i in fleet_json.json["inspections"] if i["verdict"] == "OUTSIDE_MARGIN"), key=lambda i: i["remaining_in"]
    )
    first = next(line for line in mlg("check", FLEET).out.splitlines() if line.startswith("!"))
    assert worst["record_id"] in first.split()


def test_a_batch_counts_its_verdicts() -> None:
    counts = mlg("check", FLEET).out.splitlines()[0]
    assert counts == "46 inspections: 8 outside margin · 9 incomplete · 22 within margin · 7 inconclusive"


@pytest.mark.parametrize("source", [FAILURE, FLEET], ids=["one", "batch"])
def test_the_provenance_travels_into_every_view(source: object) -> None:
    assert "reconstructed from published figures, not drawing data" in " ".join(mlg("check", source).out.split())


@pytest.mark.parametrize("source", [FAILURE, FLEET], ids=["one", "batch"])
def test_every_view_says_that_it_is_no_approval(source: object) -> None:
    words = " ".join(mlg("check", source).out.split())
    assert "not maintenance data" in words
    assert "not an approval for return to service" in words


def test_joints_that_act_alike_are_said_where_they_are_named(failure: Run) -> None:
    assert "Both ends of one link act alike (#3 = #5, #6 = #7, #9 = #10)" in failure.out


def test_an_unmeasured_joint_is_called_so_and_not_zero(failure: Run) -> None:
    line = next(line for line in failure.out.splitlines() if "#2 locking pin" in line)
    assert "unmeasured" in line


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"clearance_3_in": "0.013"}, "restore #3"),
        ({"clearance_4_in": ""}, "measure #4"),
        ({"side": ""}, "correct: side"),
        ({"outcome": "FAILED"}, "not the joints: look elsewhere"),
        ({}, "continue fault isolation"),
    ],
)
def test_a_line_of_a_batch_ends_with_its_next_action(changes: dict[str, str], said: str, table: Table) -> None:
    second = row(**{"record_id": "B", "side": "RH", **changes})
    lines = mlg("check", table(row(record_id="A"), second)).out.splitlines()
    assert next(line for line in lines if " B " in line).rstrip().endswith(said)


def test_a_failure_within_the_margin_is_not_put_on_the_joints(table: Table) -> None:
    found = mlg("check", table(row(outcome="FAILED")), "--json").one
    assert "check hydraulics, reversing valve, doors" in found["next_action"]["text"]


def test_a_batch_says_first_which_gears_were_measured_outside_their_margin(table: Table) -> None:
    within = row(record_id="R1", plunger_displacement_in="0.01")
    outside = row(record_id="R2", plunger_displacement_in="-0.045")
    lines = mlg("check", table(within, outside)).out.splitlines()
    assert lines[1] == "MEASURED outside their margin, whatever is predicted: R2."


def test_a_batch_without_such_a_gear_does_not_speak_of_it(table: Table) -> None:
    assert "MEASURED" not in mlg("check", table(row(record_id="R1"), row(record_id="R2"))).out


@WIDTHS
def test_a_repair_says_what_a_restored_joint_counts_with(shown: Run, width: int) -> None:
    assert "A restored joint counts with the 0.0005 in radial of a new part." in shown.out


def test_a_plunger_outside_its_down_lock_range_is_said_once(table: Table) -> None:
    shown = mlg("check", table(row(plunger_down_lock_in="0.06")))
    assert (shown.out + shown.err).count("Down Lock") == 1
    assert "Plunger at Down Lock 0.0600 in is outside 0.01 to 0.05 in: check the rigging first." in shown.out


def test_no_chance_passes_one_by_rounding(table: Table) -> None:
    tight = {f"clearance_{n}_in": "0.0005" for n in range(1, 11)}
    found = mlg("check", table(row(**tight, tail_no="7", plunger_displacement_in="-0.04")), "--json")
    assert found.json["inspections"][0]["posterior"]["no_joint_worn"] <= 1.0
