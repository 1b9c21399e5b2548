"""Dates that can be read in one way only, and readings that state an end."""

from __future__ import annotations

from datetime import date, timedelta
from pathlib import Path

import pandas as pd
import pytest

from mlg_troubleshoot.decision.inspection import Inspection
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.records import ReadOptions, ReadResult, read_many
from mlg_troubleshoot.records.values import CellFaultError, DateOrder, read_date
from mlg_troubleshoot.store.inspections import inspection_from, inspection_record
from mlg_troubleshoot.units import ClearanceConvention
from tests.cli.conftest import mlg

HEADER = "record_id,tail_no,side,clearance_convention,clearance_3_in,inspection_date"


def column(tmp_path, *texts):
    file = tmp_path / "t.csv"
    rows = [f'R{n},N{n},LH,RADIAL,0.002,"{text}"' for n, text in enumerate(texts)]
    file.write_text("\n".join((HEADER, *rows)) + "\n")
    return file


def days(tmp_path, *texts, **options):
    read = read_many([column(tmp_path, *texts)], ReadOptions(**options))
    assert all(isinstance(row, Inspection) for row in read.rows)
    return [row.inspection_date for row in read.rows], read


@pytest.mark.parametrize(
    ("text", "day"),
    [
        ("1950-12-31", date(1950, 12, 31)),
        ("2100-12-31", date(2100, 12, 31)),
        ("2026-03-04", date(2026, 3, 4)),
        ("2026/03/04", date(2026, 3, 4)),
        *((t, date(2025, 1, 14)) for t in ("14-Jan-25", "14 Jan 2025", "14 January 2025")),
        *((t, date(2025, 1, 14)) for t in ("Jan 14, 2025", "14.jan.2025", "14Jan2025")),
        ("31/12/2025", date(2025, 12, 31)),
        ("12/31/2025", date(2025, 12, 31)),
        ("25.01.24", date(2024, 1, 25)),
        ("05/05/2024", date(2024, 5, 5)),
        ("31/12/2025 10:30", date(2025, 12, 31)),
    ],
)
def test_a_date_that_can_be_read_in_one_way_only_is_read(text, day):
    assert read_date(text) == day


@pytest.mark.parametrize(
    ("text", "order", "code"),
    [
        ("1949-12-31", None, "date_out_of_range"),
        ("2101-12-31", None, "date_out_of_range"),
        *((text, None, "date_invalid") for text in ("31/02/2026", "13.13.2025", "13.1.4")),
        *((text, None, "date_invalid") for text in ("31 Feb 2025", "14 Jon 2025", "Jan 2025")),
        ("2026-02-30", None, "date_invalid"),
        ("25/01/2024", DateOrder.MDY, "date_invalid"),
        *(
            (text, None, "date_ambiguous")
            for text in ("03/04/2026", "3.4.26", "01-02-03", "24/01/25")
        ),
    ],
)
def test_a_date_that_is_no_day_or_may_be_several_is_refused(text, order, code):
    with pytest.raises(CellFaultError) as fault:
        read_date(text, order) if order else read_date(text)
    assert fault.value.code == code
    assert bool(fault.value.days) is (code == "date_ambiguous")


@pytest.mark.parametrize(
    ("order", "day"),
    [("dmy", date(2003, 2, 1)), ("mdy", date(2003, 1, 2)), ("ymd", date(2001, 2, 3))],
)
def test_a_stated_order_settles_a_date(order, day):
    assert read_date("01-02-03", DateOrder(order)) == day


def test_one_date_of_a_column_settles_the_others(tmp_path):
    found, read = days(tmp_path, "03/04/2024", "13/01/2024", "2024-06-07")
    assert found == [date(2024, 4, 3), date(2024, 1, 13), date(2024, 6, 7)]
    assert not read.problems
    assert any("dates are read as day-month-year" in note for note in read.notes)


def test_dates_that_no_other_date_settles_are_refused_by_cell(tmp_path):
    found, read = days(tmp_path, "03/04/2024", "05/06/2024")
    assert found == [None, None]
    assert [(p.cell, p.code) for p in read.problems] == [
        ("F2", "date_ambiguous"),
        ("F3", "date_ambiguous"),
    ]


def test_a_column_of_two_orders_settles_nothing(tmp_path):
    found, read = days(tmp_path, "13/01/2024", "01/13/2024", "03/04/2024")
    assert found == [date(2024, 1, 13), date(2024, 1, 13), None]
    assert [p.cell for p in read.problems] == ["F4"]


def test_the_columns_of_two_files_are_judged_apart(tmp_path):
    (tmp_path / "other").mkdir()
    clear, open_ = column(tmp_path, "13/01/2024"), column(tmp_path / "other", "03/04/2024")
    read = read_many([clear, open_], ReadOptions())
    assert [p.code for p in read.problems] == ["date_ambiguous"]


def test_a_long_table_settles_its_dates_as_a_wide_one(tmp_path):
    file = tmp_path / "long.csv"
    file.write_text(
        "record_id,tail_no,side,clearance_convention,joint,clearance_in,inspection_date\n"
        "R1,N1,LH,RADIAL,3,0.002,03/04/2024\nR1,N1,LH,RADIAL,5,0.002,03/04/2024\nR2,N2,LH,RADIAL,3,0.002,13/01/2024\n"
    )
    read = read_many([file], ReadOptions())
    assert [row.inspection_date for row in read.inspections] == [
        date(2024, 4, 3),
        date(2024, 1, 13),
    ]


def test_the_flag_settles_a_column_and_knows_three_orders(tmp_path):
    run = mlg("check", column(tmp_path, "03/04/2024"), "--dates", "mdy", "--json")
    assert not run.json["problems"]
    run = mlg("check", column(tmp_path, "03/04/2024"), "--dates", "dym")
    assert run.code == 2
    assert "dmy, mdy or ymd" in run.err


def test_a_date_after_tomorrow_is_refused(tmp_path):
    found, read = days(tmp_path, (date.today() + timedelta(days=2)).isoformat())
    assert found == [None]
    assert [p.code for p in read.problems] == ["date_in_the_future"]


def test_a_date_of_tomorrow_is_read_since_it_is_tomorrow_somewhere(tmp_path):
    tomorrow = date.today() + timedelta(days=1)
    assert days(tmp_path, tomorrow.isoformat())[0] == [tomorrow]


def read(gear: Gear, cell: str, convention: str = "RADIAL") -> ReadResult:
    row = {"tail_no": "N1", "side": "LH", "clearance_3_in": cell}
    options = ReadOptions.of(gear, convention=ClearanceConvention(convention))
    return read_many([pd.DataFrame([row])], options)


def inspection(gear: Gear, cell: str, convention: str = "RADIAL") -> Inspection:
    (found,) = read(gear, cell, convention).inspections
    return found


@pytest.mark.parametrize(
    "cell", ["<0.002", "< .002", "<=0.002 in", "≤0.002", "<0.002 in", "no-go 0.002", "No go 0.002"]
)
def test_a_reading_below_an_end_is_counted_at_that_end(gear: Gear, cell: str) -> None:
    assert inspection(gear, cell).clearance_in == {3: pytest.approx(0.002)}


def test_an_end_is_converted_like_any_reading_said_and_kept(gear: Gear) -> None:
    found = inspection(gear, "<0.004", "TOTAL_PLAY")
    assert found.clearance_in == {3: pytest.approx(0.002)}
    assert "joint 3: <0.004 is counted as 0.004, its upper end" in found.warnings
    assert inspection_from(inspection_record(found)).entered[3].bound == "<"


def test_a_reading_is_written_with_its_end_and_its_unit_once(gear: Gear) -> None:
    written = [str(inspection(gear, cell).entered[3]) for cell in ("<0.002", "<0.002in", ".013")]
    assert written == ["<0.002 in", "<0.002in", ".013 in"]


def test_a_warning_states_the_unit_of_a_reading_once(gear: Gear) -> None:
    warnings = inspection(gear, "0.016in").warnings
    assert any("joint 3: 0.016in radial is above" in warning for warning in warnings)


@pytest.mark.parametrize("cell", [">0.0075", ">0.012", "> .012 in", "≥0.012", "go 0.012"])
def test_a_reading_above_the_limit_is_over_it(gear: Gear, cell: str) -> None:
    assert gear.joints[2].is_over_limit(inspection(gear, cell).clearance_in[3])


def test_a_reading_above_less_than_the_limit_is_not_measured(gear: Gear) -> None:
    found = inspection(gear, ">0.002")
    assert (found.clearance_in, found.warnings[0]) == (
        {},
        "joint 3: >0.002 may be anything above it: counted as not measured",
    )


@pytest.mark.parametrize("cell", ["go", "no-go", "<", "<0.002 to 0.003", "<-0.002", "<0"])
def test_words_without_a_size_are_refused(gear: Gear, cell: str) -> None:
    assert [p.column for p in read(gear, cell).problems] == ["clearance_3_in"]


def test_an_end_of_any_other_number_is_refused(gear: Gear) -> None:
    row = {"tail_no": "N1", "side": "LH", "clearance_3_in": 0.002, "margin_in": "<0.03"}
    options = ReadOptions.of(gear, convention=ClearanceConvention.RADIAL)
    assert [p.column for p in read_many([pd.DataFrame([row])], options).problems] == ["margin_in"]


def test_a_flag_states_an_end(tmp_path: Path) -> None:
    said = mlg(
        *("check", "--set", "3=<0.002in", "--tail", "N1", "--side", "LH"),
        *("--convention", "RADIAL", "--json"),
    ).json
    (joint,) = (j for j in said["inspections"][0]["joints"] if j["joint"] == 3)
    assert joint["clearance_in"] == pytest.approx(0.002)
