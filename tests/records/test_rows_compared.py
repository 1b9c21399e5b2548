"""Rows compared with each other: copies, landings that fall, tails that look alike."""

from __future__ import annotations

import pytest

HEADER = (
    "record_id",
    "tail_no",
    "side",
    "clearance_convention",
    *(f"clearance_{n}_in" for n in range(1, 6)),
)
LEFT = (0.0012, 0.0035, 0.0061, 0.0020, 0.0044)


def warnings(result):
    """Return the warnings by record."""
    return {row.record_id: row.warnings for row in result.rows if row.warnings}


COPIED = "all clearances are those of row 2 of "


def again(read, table, second, first=LEFT, dates=("2026-03-02", "2026-05-02"), **more):
    """Return what is said of the second of two inspections of a gear."""
    header = (*HEADER, "inspection_date", *more)
    rows = [
        ("A", "N1", "LH", "RADIAL", *first, dates[0], *more.values()),
        ("B", "N1", "LH", "RADIAL", *second, dates[1], *more.values()),
    ]
    return " ".join(warnings(read(table(header, rows))).get("B", ()))


def test_a_sheet_copied_from_an_earlier_one_is_asked_about(read, table):
    said = again(read, table, LEFT)
    assert COPIED in said
    assert said.endswith("copied from that sheet?")


def test_an_inspection_under_a_second_record_id_is_asked_about(read, table):
    said = again(read, table, LEFT, dates=("2026-03-02", "2026-03-02"))
    assert said.endswith("the same inspection, entered twice?")


@pytest.mark.parametrize(
    ("second", "more"),
    [
        ((*LEFT[:4], LEFT[4] + 0.0001), {}),
        ((*LEFT[:4], ""), {"first": (*LEFT[:4], "")}),
        (LEFT, {"restored_joints": "6", "repair_date": "2026-03-01"}),
    ],
    ids=["one differs", "four", "after a repair"],
)
def test_rows_that_may_well_be_alike_are_not_asked_about(read, table, second, more):
    assert "all clearances" not in again(read, table, second, **more)


@pytest.mark.parametrize(("gears", "more"), [(9, "1 more place;"), (10, "2 more places;")])
def test_landings_that_fall_in_many_gears_are_counted_beyond_the_eighth_and_noted_in_each(
    read, table, gears, more
):
    header = (*HEADER, "inspection_date", "gear_landings")
    rows = [
        (f"{n}-{k}", f"N{n}", "LH", "RADIAL", *LEFT[:4], LEFT[4] + 0.0001 * k, date, landings)
        for n in range(gears)
        for k, (date, landings) in enumerate((("2026-03-02", 900), ("2026-05-02", 90)))
    ]
    result = read(table(header, rows))
    said = [note for note in result.notes if "andings" in note]
    assert [("never fall" in note) for note in said] == [True] * 8 + [False]
    assert said[-1].startswith(f"Landings fall at {more}")
    assert sum("never fall" in " ".join(found) for found in warnings(result).values()) == len(rows)


@pytest.mark.parametrize(("tail", "notes"), [("N1O3", 1), ("n-103", 1), ("N1C3", 0)])
def test_tails_that_may_be_one_aircraft_are_named_with_their_rows(read, table, tail, notes):
    header = ("record_id", "tail_no", "side", "clearance_convention", "clearance_3_in")
    rows = [("R1", "N103", "LH", "RADIAL", 0.003), ("R2", tail, "LH", "RADIAL", 0.003)]
    said = f"'N103' (row 2 of t.csv) and {tail!r} (row 3 of t.csv) are taken as one"
    result = read(table(header, rows), "t.csv")
    assert sum(said in note for note in result.notes) == notes
