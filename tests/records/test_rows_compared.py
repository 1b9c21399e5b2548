"""Rows that are alike, and sheets as people write them."""

from __future__ import annotations

from pathlib import Path

import pytest

from mlg_troubleshoot.records import ReadOptions, read_many
from mlg_troubleshoot.units import ClearanceConvention

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


@pytest.mark.parametrize(("gears", "more"), [(8, 0), (9, 1), (10, 2)])
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
    assert sum("never fall" in note for note in result.notes) == 8
    assert any(note.startswith(f"{more} more of these") for note in result.notes) == (more > 0)
    assert sum("never fall" in " ".join(found) for found in warnings(result).values()) == len(rows)


@pytest.mark.parametrize(("tail", "notes"), [("N1O3", 1), ("n-103", 1), ("N1C3", 0)])
def test_tails_that_may_be_one_aircraft_are_named_with_their_rows(read, table, tail, notes):
    header = ("record_id", "tail_no", "side", "clearance_convention", "clearance_3_in")
    rows = [("R1", "N103", "LH", "RADIAL", 0.003), ("R2", tail, "LH", "RADIAL", 0.003)]
    said = f"'N103' (row 2 of t.csv) and {tail!r} (row 3 of t.csv) are taken as one"
    result = read(table(header, rows), "t.csv")
    assert sum(said in note for note in result.notes) == notes


SHEETS = Path(__file__).parent / "samples" / "sheets"
# File, rows that can be judged, cells that are named, rows set aside.
EXPECTED = [
    ("01_hangar_list.csv", 3, ["F5"], 0),
    ("02_with_totals.csv", 2, ["E7"], 5),
    ("03_semicolons.csv", 2, ["E4"], 0),
    ("04_numbered.csv", 3, ["D5"], 0),
    ("05_units_row.csv", 2, ["F5"], 0),
    ("06_long_list.csv", 1, ["D6"], 0),
    ("07_units_in_cells.csv", 2, ["D4"], 0),
    ("08_two_pages.csv", 3, ["B8"], 2),
    ("09_notes_below.csv", 3, ["C4"], 3),
    ("10_tabs.txt", 2, ["C4"], 0),
    ("11_windows.csv", 2, ["C4"], 0),
    ("12_status_columns.csv", 2, ["C6", "I5"], 0),
    ("13_grouped.csv", 3, ["D6"], 3),
]


def sheet(name):
    return read_many([SHEETS / name], ReadOptions(convention=ClearanceConvention.RADIAL))


def test_every_sheet_is_expected_to_give_something():
    assert sorted(name for name, *_ in EXPECTED) == sorted(path.name for path in SHEETS.iterdir())


@pytest.mark.parametrize(("name", "good", "cells", "aside"), EXPECTED)
def test_each_good_row_is_read_and_each_bad_cell_named(name, good, cells, aside):
    result = sheet(name)
    assert len(result.inspections) == good
    assert sorted(p.cell for p in result.problems) == cells
    assert f"{aside} row" in " ".join(result.notes) or not aside
    assert len(result.notes) <= 3


def test_the_first_sheet_is_understood_as_it_was_meant():
    result = sheet("01_hangar_list.csv")
    first = result.inspections[0]
    assert (first.tail_no, first.side, str(first.inspection_date)) == ("258401", "LH", "2025-01-14")
    assert first.clearance_in == pytest.approx({1: 0.003, 2: 0.002, 3: 0.013, 5: 0.007})
    assert first.record_id.startswith("01_hangar_list-2-")
    (said,) = (note for note in result.notes if "not measured" in note)
    assert "3 cells with" in said


@pytest.mark.parametrize("side", ["LH", "L"])
def test_a_row_with_a_tail_a_side_and_a_clearance_is_never_set_aside(side, table, read):
    header = (
        *("record_id", "tail_no", "side", "clearance_convention", "clearance_3_in"),
        "clearance_5_in",
    )
    rows = [
        ("Total", "N1", side, "RADIAL", 0.013, 0.007),
        ("R2", "Average", side, "RADIAL", 0.013, ""),
    ]
    assert len(read(table(header, rows)).inspections) == 2
