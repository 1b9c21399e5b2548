"""Slips that the gear's other inspections give away: suggested, never applied."""

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
RIGHT = (0.0050, 0.0011, 0.0015, 0.0062, 0.0012)


def history(odd, side="LH"):
    """Return rows of one aircraft with an odd one in the middle."""
    rows = []
    for n in range(5):
        wear = 1 + 0.02 * n
        rows.append((f"L{n}", "N1", "LH", "RADIAL", *(round(c * wear, 5) for c in LEFT)))
        rows.append((f"R{n}", "N1", "RH", "RADIAL", *(round(c * wear, 5) for c in RIGHT)))
    rows[5:5] = [("ODD", "N1", side, "RADIAL", *odd)]
    return rows


def warnings(result):
    """Return the warnings by record."""
    return {row.record_id: row.warnings for row in result.rows if row.warnings}


def test_a_steady_history_raises_no_warning(read, table):
    odd = tuple(round(1.03 * c, 5) for c in LEFT)
    assert warnings(read(table(HEADER, history(odd)))) == {}


@pytest.mark.parametrize(
    ("odd", "words"),
    [
        (tuple(2 * c for c in LEFT), "factor 2"),
        ((LEFT[0], LEFT[1], LEFT[3], LEFT[2], LEFT[4]), "joints 3 and 4"),
        (RIGHT, "fit the RH gear"),
        ((*LEFT[:3], LEFT[3] * 10, LEFT[4]), "joint 4 is 10 times"),
        ((LEFT[0] * 25.4, *LEFT[1:]), "factor 25.4"),
    ],
)
def test_the_slip_that_explains_a_jump_is_suggested(read, table, odd, words):
    result = read(table(HEADER, history(odd)))
    found = warnings(result)
    assert not result.problems
    assert any(words in text for text in found["ODD"]), found
    row = next(r for r in result.rows if r.record_id == "ODD")
    assert tuple(row.clearance_in.values()) == pytest.approx(odd)


def test_a_slip_beside_a_slip_in_another_joint_is_suggested(read, table):
    rows = [("ODD", "N1", "LH", "RADIAL", *LEFT[:4], LEFT[4] * 10)]
    rows.append(("NEXT", "N1", "LH", "RADIAL", *LEFT[:3], LEFT[3] * 10, LEFT[4]))
    rows.extend((f"L{n}", "N1", "LH", "RADIAL", *LEFT) for n in range(4))
    found = warnings(read(table(HEADER, rows)))
    assert any("joint 5 is 10 times" in text for text in found["ODD"]), found


def test_only_the_odd_row_is_warned_of(read, table):
    assert set(warnings(read(table(HEADER, history(RIGHT))))) == {"ODD"}


def test_a_jump_that_no_slip_explains_is_not_called_a_slip(read, table):
    odd = (0.0012, 0.0035, 0.0141, 0.0020, 0.0144)
    assert warnings(read(table(HEADER, history(odd)))) == {}


def test_two_readings_that_were_exchanged_are_seen_although_they_wore_on(read, table):
    usual = (0.0012, 0.0035, 0.0105, 0.0020, 0.0044)
    rows = [(f"L{n}", "N1", "LH", "RADIAL", *usual) for n in range(5)]
    rows[2:2] = [("ODD", "N1", "LH", "RADIAL", 0.0012, 0.0035, 0.0022, 0.0118, 0.0044)]
    assert "joints 3 and 4" in warnings(read(table(HEADER, rows)))["ODD"][0]


@pytest.mark.parametrize("odd", [RIGHT[:2], tuple(2.1 * c for c in LEFT[:2])])
def test_two_joints_alone_tell_neither_side_nor_factor(read, table, odd):
    rows = [(*row[:4], *row[4:6]) for row in history((*odd, 0.0, 0.0, 0.0))]
    said = warnings(read(table(HEADER[:6], rows))).get("ODD", ())
    assert not any("side" in text or "all clearances" in text for text in said)
