"""Nothing is lost and nothing passes unseen: cells, rows, sheets, tails and numbers."""

from __future__ import annotations

import csv
import datetime
import io
import random
import re
from dataclasses import replace

import openpyxl
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from mlg_troubleshoot.decision.inspection import Inspection, InvalidRow
from mlg_troubleshoot.errors import ExitCode, UsageError
from mlg_troubleshoot.gear.gear_file import load_gear
from mlg_troubleshoot.records import ReadOptions, ReadResult, read_many
from mlg_troubleshoot.records.annotate import write_template
from mlg_troubleshoot.units import ClearanceConvention, LengthUnit, parse_length
from mlg_troubleshoot.workflows.check import check
from tests.cli.conftest import HAND, mlg
from tests.records.reading import Named, read_inspections

HEADER = (
    "record_id",
    "tail_no",
    "side",
    "clearance_convention",
    *(f"clearance_{n}_in" for n in range(1, 11)),
    "inspection_date",
    "gear_landings",
    "margin_in",
    "outcome",
    "remarks",
)
# Bad values by column; True if the row can still be judged.
BAD = {
    "tail_no": (None,),
    "side": ("both", None, "XX", 5),
    "clearance_convention": ("CLEAR", None, 3),
    "clearance": (
        *(-0.001, 0.33, 9, "0,013", "n/a?", "1/8", "0.3 mm", "\u22120.002", "nan"),
        *(datetime.date(2026, 8, 1), True),
    ),
    "inspection_date": ("03/04/2026", 46085, "soon"),
    "gear_landings": (-5, "many"),
    "margin_in": (-0.03, "x", 0.7),
    "outcome": ("MAYBE", 1),
}
HARMLESS = {"inspection_date", "gear_landings"}


def make(rows, share, seed):
    """Return a table, the places of its bad cells and the rows that they spoil."""
    rng = random.Random(seed)
    table, bad, spoilt = [HEADER], set(), set()
    for n in range(rows):
        row = [
            f"R{n:05d}",
            f"N{n % 90:03d}",
            rng.choice(("LH", "RH")),
            rng.choice(("RADIAL", "TOTAL_PLAY")),
        ]
        row += [rng.choice((None, 0, round(rng.uniform(0, 0.012), 4))) for _ in range(10)]
        row += [
            datetime.date(2026, 1, 1) + datetime.timedelta(days=n % 300),
            n,
            0.03,
            rng.choice(("FAILED", None)),
            "=x",
        ]
        row[5] = 0.004
        for index, name in enumerate(HEADER):
            kind = (
                "clearance"
                if name.startswith("clearance_") and name != "clearance_convention"
                else name
            )
            if kind in BAD and rng.random() < share:
                row[index] = rng.choice(BAD[kind])
                bad.add((n + 2, name))
                if kind not in HARMLESS:
                    spoilt.add(n + 2)
        table.append(row)
    return table, bad, spoilt


def no_formulas(book):
    """Keep texts that begin with = as texts."""
    for row in book.worksheets[0].iter_rows():
        for cell in row:
            if cell.data_type == "f":
                cell.data_type = "s"


@pytest.mark.parametrize(("rows", "share", "seed"), [(400, 0.03, 1), (40, 0.4, 2)])
def test_exactly_the_bad_cells_of_a_workbook_are_named_with_place_and_remedy(
    read, xlsx, rows, share, seed
):
    table, bad, spoilt = make(rows, share, seed)
    result = read(xlsx(table, no_formulas), "t.xlsx")
    assert sorted((p.row, p.column) for p in result.problems) == sorted(bad)
    assert {row.source.row for row in result.rows if isinstance(row, InvalidRow)} == spoilt
    assert [row.source.row for row in result.rows] == list(range(2, rows + 2))
    for problem in result.problems:
        assert (problem.file, problem.sheet) == ("t.xlsx", "Inspections")
        assert problem.cell is not None
        assert problem.cell.endswith(str(problem.row))
        assert problem.expected
        assert problem.remedy.endswith((".", "?"))


def test_csv_and_workbook_give_the_same_inspections(read, xlsx):
    table, _, _ = make(120, 0.0, 4)
    lines = [",".join("" if c is None else str(c) for c in row) for row in table]
    from_csv = read("\n".join(lines), "t.csv")
    from_xlsx = read(xlsx(table, no_formulas), "t.xlsx")
    assert not from_csv.problems
    assert not from_xlsx.problems
    for one, other in zip(from_csv.rows, from_xlsx.rows, strict=True):
        assert replace(one, source=other.source, entered=other.entered) == other


ANY_CELL = st.one_of(
    st.none(),
    st.floats(allow_nan=True, allow_infinity=True),
    st.floats(0, 0.06),
    st.integers(-5, 50),
    st.sampled_from(
        (
            *("LH", "RH", "RADIAL", "0,013", "1/8", ".013", "13 thou", "0.33 mm", '"', "''", "=1"),
            *("\0", "–0.1", "NA"),
        )
    ),
    st.text(max_size=12),
)


@settings(max_examples=150, deadline=None)
@example(rows=[[None, "LH"]], sep=",")
@example(rows=[[None, None, None, 0.0], [None, None, None, "RADIAL"]], sep=",")
@given(
    rows=st.lists(st.lists(ANY_CELL, min_size=1, max_size=8), max_size=6),
    sep=st.sampled_from((",", ";", "\t")),
)
def test_no_table_of_any_cells_loses_a_row_or_ends_in_an_exception(rows, sep):
    header = (
        *("record_id", "tail_no", "side", "clearance_convention", "clearance_3_in", "margin_in"),
        "remarks",
    )
    buffer = io.StringIO()
    writer = csv.writer(buffer, delimiter=sep, lineterminator="\n")
    writer.writerow(header)
    for row in rows:
        writer.writerow(
            ["" if c is None else str(c).replace("\n", " ").replace("\r", " ") for c in row]
        )
    result = read_inspections(
        io.BytesIO(buffer.getvalue().encode("utf-8", "replace")), ReadOptions()
    )
    # A convention alone is a line of a template that nobody filled in.
    filled = sum(
        any(c is not None and str(c).strip() and (i, c) != (3, "RADIAL") for i, c in enumerate(row))
        for row in rows
    )
    if result.layouts:
        aside = sum(
            int(n) for note in result.notes for n in re.findall(r"(\d+) rows? set aside", note)
        )
        assert len(result.rows) + aside == filled
    assert all(isinstance(row, Inspection | InvalidRow) for row in result.rows)
    reported = {p.row for p in result.problems}
    assert all(row.source.row in reported for row in result.rows if isinstance(row, InvalidRow))


@settings(max_examples=80, deadline=None)
@given(cells=st.lists(ANY_CELL, min_size=1, max_size=9))
def test_no_header_of_any_cells_ends_in_an_exception(cells):
    text = ",".join(
        ["record_id", "tail_no", "side", *('"' + str(c).replace('"', "") + '"' for c in cells)]
    )
    result = read_inspections(
        io.BytesIO((text + "\nR1,N1,LH,0.1\n").encode("utf-8", "replace")), ReadOptions()
    )
    assert result.rows or result.problems


@settings(max_examples=100, deadline=None)
@given(
    value=st.floats(0, 0.0499, allow_subnormal=False),
    unit=st.sampled_from(("in", "thou", "mm")),
    convention=st.sampled_from(("RADIAL", "DIAMETRAL", "TOTAL_PLAY")),
)
def test_one_clearance_in_any_unit_and_convention_is_the_same(value, unit, convention):
    entered = LengthUnit(unit).from_inches(value * ClearanceConvention(convention).per_radial)
    text = (
        f"record_id,tail_no,side,clearance_convention,clearance_3_{unit}\n"
        f"R1,N1,LH,{convention},{entered!r}\n"
    )
    result = read_inspections(io.BytesIO(text.encode()), ReadOptions())
    assert result.inspections[0].clearance_in[3] == pytest.approx(value, rel=1e-12, abs=1e-18)


SHEET_HEADER = ["record_id", "tail_no", "side", "clearance_convention"]
SHEET_HEADER += [f"clearance_{n}_in" for n in range(1, 11)]
GOOD = ["R1", "N1", "LH", "RADIAL", *[0.001] * 10]
WORN = ["R2", "N2", "LH", "RADIAL", *[0.03] * 10]


def workbook(second: list[list[object]], *, hidden: bool = False) -> Named:
    book = openpyxl.Workbook()
    for row in (SHEET_HEADER, GOOD):
        book.worksheets[0].append(row)
    sheet = book.create_sheet("Other")
    for row in second:
        sheet.append(row)
    if hidden:
        sheet.sheet_state = "hidden"
    data = io.BytesIO()
    book.save(data)
    return Named(data.getvalue(), "t.xlsx")


@pytest.mark.parametrize("sheet", [None, "*"])
@pytest.mark.parametrize(
    ("above", "hidden"),
    [([["Instructions"]], False), ([], True), ([["x"]] * 25, False), ([["instructions:"]], True)],
)
def test_a_sheet_of_inspections_that_is_left_out_is_not_a_success(above, hidden, sheet):
    result = check(workbook([*above, SHEET_HEADER, WORN], hidden=hidden), advice=False, sheet=sheet)
    assert [j.row.record_id for j in result.judgements] == ["R1"]
    assert result.unread_files == ("t.xlsx, sheet 'Other'",)
    assert result.exit_code is ExitCode.ATTENTION
    assert any("'Other'" in note and "not read" in note for note in result.notes)


@pytest.mark.parametrize("hidden", [False, True])
@pytest.mark.parametrize("rows", [[["LH"], ["RH"]], [["Instructions"], ["Fill in the table."]]])
def test_a_sheet_without_inspections_may_be_left_out(rows, hidden):
    result = check(workbook(rows, hidden=hidden), advice=False)
    assert (result.unread_files, result.exit_code) == ((), ExitCode.FINE)
    if hidden or rows[0] == ["LH"]:
        kind = "hidden sheets were" if hidden else "no header of inspections,"
        assert any(f"{kind} not read" in note and "'Other'" in note for note in result.notes)


def test_the_instructions_of_the_template_are_not_inspections(tmp_path) -> None:
    path = tmp_path / "t.xlsx"
    write_template(path, load_gear())
    book = openpyxl.load_workbook(path)
    sheet = book["Inspections"]
    places = {cell.value: cell.column for cell in sheet[1]}
    for name, value in zip(SHEET_HEADER, GOOD, strict=True):
        sheet.cell(2, places[name]).value = value
    book.save(path)
    assert check(path, advice=False).exit_code is ExitCode.FINE


def tails(one: str, two: str) -> ReadResult:
    text = f"record_id,tail_no,side,clearance_3_in\nR1,{one},LH,0.001\nR2,{two},LH,0.001\n"
    return read_many([Named(text.encode(), "t.csv")], ReadOptions.of(load_gear(), unit=None))


@pytest.mark.parametrize(
    "other",
    [
        *("\uff2e801\uff28\uff2b", "N801\u041d\u041a", "\u039d801HK", "N801\u0397K", "n801hk"),
        *("N801.HK", "N8O1HK", "N\u2011801HK"),
    ],
)
def test_a_tail_that_looks_like_another_is_taken_as_that_and_said(other: str) -> None:
    found = tails("N801HK", other)
    assert any("are taken as one aircraft" in note for note in found.notes)
    assert {row.tail_no for row in found.rows} == {"N801HK"}


@pytest.mark.parametrize("unseen", "\u00ad\ufe0f\u034f\u3164\u200b\u200e\u2060\u115f\U000e0020")
def test_what_nobody_sees_in_a_tail_is_left_out(unseen: str) -> None:
    found = tails("N801HK", f"N801{unseen}HK")
    assert {row.tail_no for row in found.rows} == {"N801HK"}


@pytest.mark.parametrize("number", ["1e-400", "9e-3000", "0.1E-999 in"])
@pytest.mark.parametrize("column", ["clearance_3_in", "plunger_displacement_in", "margin_in"])
def test_a_number_too_small_to_be_held_is_not_a_measured_zero(column: str, number: str) -> None:
    header = [*SHEET_HEADER[:4], "clearance_5_in", column]
    text = ",".join(header) + f"\nR1,N1,LH,RADIAL,0.001,{number}\n"
    (row,) = read_many([Named(text.encode(), "t.csv")], ReadOptions.of(load_gear())).rows
    assert isinstance(row, InvalidRow)


def test_such_a_number_by_hand_is_refused() -> None:
    with pytest.raises(UsageError, match="too small"):
        parse_length("1e-400 in")
    done = mlg(*HAND, "--convention", "RADIAL", "--set", "3=1e-400in")
    assert done.code == ExitCode.USAGE


def test_a_written_zero_is_a_zero() -> None:
    assert [parse_length(text).value for text in ("0", "0.000 in", "0e-400")] == [0.0] * 3
