"""A failure that something else in the row, or what is kept, seems to settle."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.cli.conftest import Run, Table, mlg, row

TIGHT = {f"clearance_{joint}_in": "0.0005" for joint in range(1, 11)}


@pytest.mark.parametrize(
    ("header", "cell"),
    [
        ("Failed?", "yes"),
        ("Result 2", "FAILED"),
        ("Outcome (cold)", "failed"),
        ("Retracted?", "no"),
    ],
)
def test_a_failure_next_to_a_stated_retraction_is_not_overlooked(table, header, cell):
    found = mlg("check", table(row(**TIGHT, outcome="RETRACTED", **{header: cell})), "--json")
    assert found.code != 0
    assert found.one["verdict"] == "INCOMPLETE"


@pytest.mark.parametrize(
    ("header", "cell"), [("Plunger reading 2", "0,041"), ("play 3 recheck", "0,013")]
)
def test_a_decimal_comma_in_a_column_that_may_be_a_reading_is_asked_about(table, header, cell):
    found = mlg("check", table(row(**TIGHT, outcome="RETRACTED", **{header: cell})), "--json")
    assert (found.code, found.one["verdict"]) == (1, "INCOMPLETE")


def after(folder: Path, table: Table, *commands: tuple[str, ...], **later: str) -> Run:
    """A gear that failed on 4 March, what was done then, and a row of 10 March."""
    store = ("--store", str(folder / "store.sqlite"))
    first = {**TIGHT, "clearance_3_in": "0.0130", "plunger_displacement_in": "0.041"}
    failed = row(record_id="A", inspection_date="2026-03-04", outcome="FAILED", **first)
    mlg("check", table(failed, name="a.csv"), "--keep", *store)
    for command in commands:
        assert mlg("history", *command, *store).code == 0
    second = row(record_id="B", inspection_date="2026-03-10", **TIGHT, **later)
    return mlg("check", table(second, name="b.csv"), "--keep", "--json", *store)


REPAIR = ("repair", "N123", "LH", "--joint", "3", "--date", "2026-03-09")


def test_a_gear_that_was_repaired_by_a_command_is_tried_before_it_is_done(tmp_path, table):
    found = after(tmp_path, table, REPAIR)
    assert (found.code, found.one["next_action"]["action"]) == (1, "READ_PLUNGER")


def test_a_retraction_from_before_the_repair_signs_nothing_off(tmp_path, table):
    old = {"outcome": "RETRACTED", "outcome_date": "2026-03-03"}
    repair = {"restored_joints": "3", "repair_date": "2026-03-09"}
    found = after(tmp_path, table, plunger_displacement_in="0.002", **old, **repair)
    assert (found.code, found.one["next_action"]["action"]) == (1, "RETRACT")


def test_a_gear_that_retracted_after_its_repair_is_done(tmp_path: Path, table: Table) -> None:
    found = after(tmp_path, table, REPAIR, outcome="RETRACTED", plunger_displacement_in="0.002")
    assert (found.code, found.one["next_action"]["action"]) == (0, "DONE")
