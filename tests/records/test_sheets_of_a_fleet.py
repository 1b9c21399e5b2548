"""Sheets as fleets keep them: the side in the name of a sheet or a file, in a column Gear, or said
once; equal problems as one; names that are nearly right.
"""

from __future__ import annotations

import io

import openpyxl
import pytest

from mlg_troubleshoot.decision.inspection import Side
from mlg_troubleshoot.errors import UsageError, grouped
from mlg_troubleshoot.records import ReadOptions, ReadResult, read_many
from mlg_troubleshoot.units import ClearanceConvention
from tests.records.reading import Named

HEADER = ["tail_no", "clearance_3_in", "clearance_5_in"]
ROWS = [["N1", 0.003, 0.002], ["N2", 0.004, 0.003]]


def csv(name: str, header: list[str], *rows: list[object]) -> Named:
    lines = [",".join(map(str, row)) for row in (header, *rows)]
    return Named("\n".join(lines).encode(), name)


def read(source: io.BytesIO, **declared: object) -> ReadResult:
    given = {"convention": ClearanceConvention.RADIAL, **declared}
    return read_many([source], ReadOptions(**given))


def sides(result: ReadResult) -> list[Side | None]:
    return [row.side for row in result.rows]


def test_sheets_named_lh_and_rh_say_the_side() -> None:
    book = openpyxl.Workbook()
    for place, name in enumerate(("LH", "RH")):
        sheet = book.create_sheet(name, place)
        for row in (HEADER, *ROWS):
            sheet.append(row)
    del book["Sheet"]
    data = io.BytesIO()
    book.save(data)
    result = read(Named(data.getvalue(), "fleet.xlsx"), sheet="*")
    assert (sides(result), result.problems) == ([Side.LH] * 2 + [Side.RH] * 2, ())


@pytest.mark.parametrize(("name", "side"), [("RH.csv", Side.RH), ("2026 gears LH.csv", Side.LH)])
def test_a_file_named_after_a_side_says_it(name: str, side: Side) -> None:
    result = read(csv(name, HEADER, *ROWS))
    assert sides(result) == [side] * 2
    assert f"every row is {side}, as the name of the file says" in " ".join(result.notes)


@pytest.mark.parametrize("name", ["what is left.csv", "airport.csv", "LH and RH.csv"])
def test_a_name_that_does_not_say_a_side_says_none(name: str) -> None:
    assert sides(read(csv(name, HEADER, *ROWS))) == [None, None]


def test_a_side_may_be_declared_for_a_file() -> None:
    assert sides(read(csv("t.csv", HEADER, *ROWS), side=Side.RH)) == [Side.RH] * 2


def test_a_column_of_sides_wins_over_what_is_declared() -> None:
    rows = [["N1", 0.003, 0.002, "LH"], ["N2", 0.004, 0.003, "R"]]
    result = read(csv("t.csv", [*HEADER, "side"], *rows), side=Side.RH)
    assert sides(result) == [Side.LH, Side.RH]


def test_a_column_gear_that_holds_sides_is_the_column_of_sides() -> None:
    rows = [["N1", 0.003, 0.002, "L"], ["N2", 0.004, 0.003, "R"]]
    assert sides(read(csv("t.csv", [*HEADER, "Gear"], *rows))) == [Side.LH, Side.RH]


def test_a_column_gear_that_holds_something_else_is_not() -> None:
    rows = [["N1", 0.003, 0.002, "L"], ["N2", 0.004, 0.003, "S/N 17"]]
    assert sides(read(csv("t.csv", [*HEADER, "Gear"], *rows))) == [None, None]


def test_a_column_gear_may_be_carried_all_the_same() -> None:
    rows = [["N1", 0.003, 0.002, "L"], ["N2", 0.004, 0.003, "R"]]
    found = read(csv("t.csv", [*HEADER, "Gear"], *rows), column_map={"Gear": "carry"})
    assert sides(found) == [None, None]


def test_sixty_equal_problems_are_one() -> None:
    rows = [[f"N{n}", 0.003, 0.002, "LH"] for n in range(60)]
    problems = read(csv("t.csv", [*HEADER, "side"], *rows), convention=None).problems
    (group,) = grouped(problems)
    assert (len(problems), group.where) == (60, "rows 2–61")


def test_problems_that_differ_stay_apart() -> None:
    rows = [["N1", "worn", 0.002, "LH"], ["N2", 0.004, -0.003, "LH"]]
    problems = read(csv("t.csv", [*HEADER, "side"], *rows)).problems
    assert [group.where for group in grouped(problems)] == ["cell B2", "cell C3"]


def test_a_row_to_correct_names_its_cells() -> None:
    rows = [["N1", "worn", -0.002, "LH"], ["N2", 0.004, 0.003, "LH"]]
    result = read(csv("t.csv", [*HEADER, "side"], *rows))
    assert result.rows[0].cells == ("B2", "C2")


@pytest.mark.parametrize(
    ("typed", "meant"),
    [("plunjer_disp", "plunger_displacement"), ("clearence_4_mm", "clearance_4_mm")],
)
def test_a_column_that_is_not_one_brings_the_nearest(typed: str, meant: str) -> None:
    with pytest.raises(UsageError) as refused:
        read(csv("t.csv", HEADER, *ROWS), column_map={"clearance_3_in": typed})
    assert meant in refused.value.remedy


def test_a_header_that_is_not_in_the_table_brings_the_nearest() -> None:
    result = read(csv("t.csv", [*HEADER, "Spiel 4"], *ROWS), column_map={"Spiel": "clearance_4_in"})
    (problem,) = (p for p in result.problems if p.code == "map_header_unknown")
    assert "Spiel 4" in problem.remedy.partition("nearest are:")[2]
