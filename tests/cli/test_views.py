"""What a person sees: the same facts in 80 columns and in 110."""

from __future__ import annotations

import csv
import re

import pytest

from mlg_troubleshoot.cli import output
from mlg_troubleshoot.cli.views.batch import show_notes
from tests.cli.conftest import FAILURE, FLEET, Run, Table, mlg, row

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


@pytest.fixture(scope="module")
def detailed() -> Run:
    """The failure case with everything that is known."""
    return mlg("check", FAILURE, "--detail")


def at_width(monkeypatch: pytest.MonkeyPatch, width: int, *arguments: object) -> Run:
    monkeypatch.setenv("COLUMNS", str(width))
    return mlg(*arguments)


@pytest.mark.parametrize("width", [80, 110])
def test_the_failure_is_whole_on_a_screen_of_any_width(width, monkeypatch):
    shown = at_width(monkeypatch, width, "check", FAILURE, "--detail").out
    words = " ".join(shown.split())
    for number, name in JOINTS.items():
        assert re.search(rf"#{number} {' .*'.join(name.split())}", words), f"#{number} {name}"
    assert "…" not in shown
    assert max(len(line) for line in shown.splitlines()) <= width
    assert "[!] COULD BE OUTSIDE" in shown


VERDICT_LINE = re.compile(r"[!~?X=] ")


def test_the_failure_fits_a_terminal_of_80_columns_and_24_lines(monkeypatch):
    lines = at_width(monkeypatch, 80, "check", FAILURE).out.splitlines()
    assert len(lines) <= 20
    assert max(map(len, lines)) <= 80
    assert sum(bool(re.match(r"\d+ +#\d+ ", line)) for line in lines) == 3


def test_the_screen_follows_columns_and_is_80_wide_without(monkeypatch: pytest.MonkeyPatch) -> None:
    assert max(map(len, at_width(monkeypatch, 120, "gear").out.splitlines())) > 80
    monkeypatch.delenv("COLUMNS")
    assert max(map(len, mlg("gear").out.splitlines())) <= 80


@pytest.fixture(scope="module")
def fleet() -> Run:
    """The fleet on 80 columns."""
    return mlg("check", FLEET)


def test_a_batch_has_one_line_for_each_gear_with_its_latest_inspection(monkeypatch) -> None:
    shown = at_width(monkeypatch, 100, "check", FLEET).out
    rows = list(csv.DictReader(FLEET.read_text(encoding="utf-8").splitlines()))
    latest = {
        (r["tail_no"], r["side"]): r["inspection_date"]
        for r in sorted(rows, key=lambda r: r["inspection_date"])
    }
    lines = [line for line in shown.splitlines() if VERDICT_LINE.match(line)]
    for (tail, side), day in latest.items():
        assert sum(re.search(rf" {tail} +{side} +{day} ", line) is not None for line in lines) == 1
    assert len(lines) == len(latest)


def test_tail_and_side_are_never_cut_for_width(table, monkeypatch):
    path = table(row(tail_no="N" + "1" * 30, record_id="R" * 30), row(record_id="B", side="RH"))
    shown = at_width(monkeypatch, 80, "check", path).out
    assert f" N{'1' * 30} LH " in shown


def test_the_exit_code_counts_inspections_that_are_not_shown(table: Table) -> None:
    worn = {f"clearance_{n}_in": "0.007" for n in range(1, 6)}
    before = row(record_id="A", inspection_date="2026-01-01", **worn)
    after = row(record_id="B", inspection_date="2026-02-01")
    assert mlg("check", table(before, after)).code == 1


def test_the_worst_gear_of_a_batch_stands_first(table: Table) -> None:
    within, measured = (
        row(record_id="A"),
        row(record_id="B", side="RH", plunger_displacement_in="-0.045"),
    )
    lines = [
        line
        for line in mlg("check", table(within, measured)).out.splitlines()
        if VERDICT_LINE.match(line)
    ]
    assert [line.split()[0] for line in lines] == ["!", "="]
    assert "OUTSIDE MARGIN, MEASURED" in lines[0]


def test_a_gear_of_which_nothing_was_read_has_no_worst_case_in_a_batch(table: Table) -> None:
    blank = {f"clearance_{j}_in": "" for j in range(1, 11)}
    lines = mlg(
        "check", table(row(record_id="A"), row(record_id="B", outcome="FAILED", **blank))
    ).out.splitlines()
    (shown,) = (line for line in lines if VERDICT_LINE.match(line) and " B " in line)
    assert "0.0000" not in shown


def test_a_gear_measured_outside_is_never_shown_as_within(table: Table) -> None:
    shown = mlg("check", table(row(plunger_displacement_in="-0.045"))).out
    assert "[!] OUTSIDE MARGIN, MEASURED" in shown
    assert "WITHIN MARGIN" not in shown


def test_a_batch_counts_its_verdicts(fleet: Run) -> None:
    counts = " ".join(fleet.out.split())
    assert fleet.code == 1
    assert counts.startswith(
        "46 inspections: 6 OUTSIDE MARGIN, MEASURED · 3 COULD BE OUTSIDE · 5 CLOSE TO THE MARGIN"
        " · 1 NOT ENOUGH READ · 9 WITHIN MARGIN, MEASURED · 22 WITHIN MARGIN"
    )


@pytest.mark.parametrize(("unit", "worst"), [("in", "0.0472"), ("thou", "47.2"), ("mm", "1.199")])
def test_lengths_are_shown_in_the_unit_that_was_asked_for(unit: str, worst: str) -> None:
    shown = " ".join(mlg("check", FAILURE, "--show", unit).out.replace("│", " ").split())
    assert f"worst case {worst} of " in shown
    others = {"in", "thou", "mm"} - {unit}
    assert not re.search(rf"\d ({'|'.join(others)})\b", shown)


@pytest.mark.parametrize("source", [FAILURE, FLEET], ids=["one", "batch"])
def test_every_view_says_that_it_is_not_an_approval_and_where_its_geometry_comes_from(source):
    words = " ".join(mlg("check", source).out.split())
    assert "reconstructed from published figures, not drawing data" in words
    assert "not maintenance data" in words
    assert "not an approval for return to service" in words


@pytest.mark.parametrize("read", [True, False])
def test_the_chance_of_lying_within_says_how_unread_joints_count(read, table):
    unread = {} if read else {"clearance_9_in": ""}
    words = " ".join(mlg("check", table(row(**unread)), "--detail").out.split())
    assert "Probability that the worst case is within the margin" in words
    assert ("Joints that were not measured count as 0." in words) is not read


def test_joints_that_act_alike_are_said_where_they_are_named(detailed: Run) -> None:
    assert "Both ends of one link act alike (#3 = #5, #6 = #7, #9 = #10)" in detailed.out


def test_an_unmeasured_joint_is_called_so_and_not_zero(failure: Run) -> None:
    line = next(line for line in failure.out.splitlines() if "#2 locking pin" in line)
    assert "unmeasured" in line


def test_a_failure_within_the_margin_is_not_put_on_the_joints(table: Table) -> None:
    found = mlg(
        "check", table(row(outcome="FAILED", plunger_displacement_in="0.002")), "--json"
    ).one
    assert "Check hydraulics, reversing valve and doors" in found["next_action"]["text"]


def test_a_plunger_outside_its_down_lock_range_is_said_once(table: Table) -> None:
    shown = mlg("check", table(row(plunger_down_lock_in="0.06")))
    assert (shown.out + shown.err).count("Plunger at Down Lock") == 1
    words = " ".join(shown.out.split())
    assert (
        "Plunger at Down Lock 0.0600 in is outside 0.01 to 0.05 in: check the rigging first."
        in words
    )


def test_a_batch_names_the_first_readings_to_check_and_counts_the_others(table: Table) -> None:
    rows = [row(record_id=f"R{n}", tail_no=f"N{n}", clearance_3_in="0.016") for n in range(5)]
    said = mlg("check", table(*rows)).err
    assert "Note: N0 LH: joint 3: 0.016 in radial is above 0.015 in" in said
    assert "Note: 2 more rows have warnings; --json lists all of them." in said


def test_of_many_notes_the_first_and_the_last_are_shown(capsys: pytest.CaptureFixture[str]) -> None:
    show_notes([f"note {n} of a fleet" for n in range(30)])
    said = capsys.readouterr().err
    assert re.findall(r"note (\d+) of", said) == [*map(str, range(8)), *map(str, range(26, 30))]
    assert "18 more notes; --json" in said


def test_a_study_stands_whole_on_80_columns(monkeypatch: pytest.MonkeyPatch) -> None:
    shown = at_width(monkeypatch, 80, "study").out
    assert "…" not in shown
    assert max(map(len, shown.splitlines())) <= 80


def table(width: int, *headings: str, spare: tuple[str, ...] = ()) -> list[str]:
    """Two rows of a table, as they stand on a screen of some width."""
    screen = output.console()
    screen.width = width
    rows = [[f"{heading} one" for heading in headings], ["-"] * len(headings)]
    with screen.capture() as shown:
        output.print_table(screen, headings, rows, spare)
    return shown.get().splitlines()


@pytest.mark.parametrize(
    ("width", "shown"), [(30, ["tail", "date", "next"]), (60, ["tail", "date", "verdict", "next"])]
)
def test_a_narrow_screen_leaves_out_the_first_spare_columns(width: int, shown: list[str]) -> None:
    lines = table(width, "tail", "date", "verdict", "next", spare=("verdict", "date"))
    assert lines[0].split() == shown


def test_a_column_that_says_nothing_is_left_out() -> None:
    screen = output.console()
    with screen.capture() as shown:
        output.print_table(screen, ("tail", "due>", "next"), [("N1", "-", "go on")], ())
    assert shown.get().splitlines()[0].split() == ["tail", "next"]


def test_numbers_stand_to_the_right_of_their_column() -> None:
    screen = output.console()
    with screen.capture() as shown:
        output.print_table(screen, ("tail", "landings>"), [("N1", "7"), ("N2", "1200")])
    assert [line.rstrip() for line in shown.get().splitlines()[1:]] == [
        "N1           7",
        "N2        1200",
    ]
