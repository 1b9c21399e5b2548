"""A failure that something else in the row, or what is kept, seems to settle."""

from __future__ import annotations

import pytest

from tests.cli.conftest import mlg, row

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
