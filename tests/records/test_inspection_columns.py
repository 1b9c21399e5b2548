"""Each column of the inspection table: what is read, what is an error, and what an error does to
its row.
"""

from __future__ import annotations

import datetime
from dataclasses import replace

import pytest

from mlg_troubleshoot.decision.columns import COLUMNS
from mlg_troubleshoot.decision.inspection import Approach, Inspection, InvalidRow, Outcome, Side
from mlg_troubleshoot.records import ReadOptions
from mlg_troubleshoot.records.values import read_value
from mlg_troubleshoot.units import ClearanceConvention, LengthUnit
from tests.records.reading import GOOD, HEADER, only


def inspection(result):
    """Return the only row of a result, which must be valid and without a problem."""
    assert not result.problems, result.problems
    (row,) = result.rows
    assert isinstance(row, Inspection)
    return row


def with_column(table, name, value):
    """Return the good row with one more column."""
    return table((*HEADER, name), [(*GOOD, value)])


def test_a_canonical_table_is_read_without_a_note(read, table):
    result = read(table())
    row = inspection(result)
    assert (row.record_id, row.tail_no, row.side) == ("R1", "N100AB", Side.LH)
    assert row.convention is ClearanceConvention.RADIAL
    assert row.clearance_in == {3: 0.013, 5: 0.007}
    assert result.notes == ()


@pytest.mark.parametrize("convention", ["DIAMETRAL", "TOTAL_PLAY", "total play", "Total-Play"])
def test_a_reading_across_the_joint_is_halved(read, table, convention):
    row = inspection(read(table(rows=[("R1", "N1", "LH", convention, 0.026, 0.014)])))
    assert row.clearance_in == {3: 0.013, 5: 0.007}


def test_the_readings_are_kept_as_entered_with_their_units_in_the_order_of_the_joints(read, table):
    header = (*HEADER[:4], "clearance_5_in", "clearance_3_mm")
    row = inspection(read(table(header, [(*GOOD[:4], ".0070", "0.330")])))
    assert [*row.clearance_in] == [3, 5]
    assert (row.entered[3].text, row.entered[3].unit) == ("0.330", LengthUnit.MILLIMETRE)
    assert (row.entered[5].text, row.entered[5].unit) == (".0070", LengthUnit.INCH)


@pytest.mark.parametrize(
    ("changes", "code", "cell", "remedy"),
    [
        ({"record_id": None}, "record_id_missing", "A2", ""),
        ({"record_id": '"R1\nx"'}, "text_control_character", "A2", ""),
        ({"tail_no": None}, "tail_no_missing", "B2", ""),
        ({"side": None}, "side_missing", "C2", ""),
        *(
            ({"side": text}, "side_unknown", "C2", "LH or RH")
            for text in ("both", "1", "L/R", "lr")
        ),
        ({"clearance_convention": None}, "convention_missing", "D2", ""),
        ({"clearance_convention": "CLEAR"}, "convention_unknown", "D2", ""),
        ({"clearance_3_in": "13 thou"}, "unit_contradiction", "E2", "enter 0.013 (in)"),
        (
            {"clearance_convention": "TOTAL_PLAY", "clearance_3_in": 0.66},
            "clearance_out_of_range",
            "E2",
            "0.66 mm would be",
        ),
        ({"unit": "mm"}, "unit_contradiction", "G2", ""),
    ],
)
def test_a_cell_that_decides_is_refused_at_its_place(read, table, changes, code, cell, remedy):
    cells = dict(zip(HEADER, GOOD, strict=True)) | changes
    result = read(table(tuple(cells), [tuple(cells.values())]))
    problem = only(result)
    assert (problem.code, problem.cell) == (code, cell)
    assert remedy in problem.remedy
    assert isinstance(result.rows[0], InvalidRow)


@pytest.mark.parametrize(
    ("side", "texts"),
    [
        (Side.LH, ("L", "L/H", "l.h.", "Left", "LEFT HAND", "Port", "LH side", "left gear", "L H")),
        (Side.RH, ("R", "R/H", "Right", "Stbd", "starboard", "RH MLG", "right-hand", " rh ")),
    ],
)
def test_the_usual_spellings_of_a_side_are_read(read, table, side, texts):
    for text in texts:
        assert inspection(read(table(rows=[("R1", "N1", text, *GOOD[3:])]))).side is side, text


@pytest.mark.parametrize(
    ("column", "choice"),
    [(column, choice) for column in COLUMNS for choice in column.choices or ()],
    ids=lambda value: getattr(value, "name", str(value)),
)
@pytest.mark.parametrize("written", [str.upper, str.lower, str.title])
def test_a_word_of_a_few_is_read_in_upper_and_lower_case(column, choice, written):
    assert read_value(column, written(choice.value)) is choice


def test_a_missing_convention_is_an_error_of_each_row(read, table):
    header = [h for h in HEADER if h != "clearance_convention"]
    result = read(
        table(header, [("R1", "N1", "LH", 0.013, 0.007), ("R2", "N1", "LH", 0.013, 0.007)])
    )
    assert [(p.code, p.row, p.column) for p in result.problems] == [
        ("convention_missing", 2, "clearance_convention"),
        ("convention_missing", 3, "clearance_convention"),
    ]
    assert all(
        isinstance(row, InvalidRow) and row.correct == ("clearance_convention",)
        for row in result.rows
    )


def test_the_declared_convention_serves_rows_without_one(read, table):
    result = read(table(rows=[("R1", "N1", "LH", None, 0.026, 0.014)]), convention="TOTAL_PLAY")
    assert inspection(result).clearance_in == {3: 0.013, 5: 0.007}


def test_a_convention_in_the_row_goes_before_the_declared_one(read, table):
    assert (
        inspection(read(table(), convention="TOTAL_PLAY")).convention is ClearanceConvention.RADIAL
    )


@pytest.mark.parametrize(("convention", "largest"), [("RADIAL", 0.05), ("DIAMETRAL", 0.1)])
def test_the_hard_range_is_in_the_radial_clearance(read, table, convention, largest):
    rows = [
        ("R1", "N1", "LH", convention, largest, 0),
        ("R2", "N1", "LH", convention, largest + 0.0001, 0),
    ]
    result = read(table(rows=rows))
    assert (only(result).code, only(result).cell) == ("clearance_out_of_range", "E3")


@pytest.mark.parametrize(
    ("value", "words", "units"),
    [
        (0.33, "factor 25.4", ["millimetres"]),
        (13, "factor 1000", ["thou"]),
        (0.13, "factor 10", None),
        (0.022, "factor 2)", None),
        (0.0151, "joint 3: 0.0151 in", None),
    ],
)
def test_the_slip_that_explains_a_value_is_suggested_and_not_applied(
    read, table, value, words, units
):
    result = read(table(rows=[(*GOOD[:4], value, 0.007)]))
    said = [p.remedy for p in result.problems] + [w for row in result.rows for w in row.warnings]
    assert any(words in text for text in said), said
    assert len(said) == 1
    assert not any(dict(r.clearance_in).get(3) == 0.013 for r in result.inspections)
    named = [unit for unit in ("thou", "millimetres") if f"read in {unit}" in said[0]]
    assert units is None or named == units


def test_every_bad_cell_of_a_row_is_reported_once_in_the_order_of_the_table(read, table):
    result = read(table((*HEADER, "outcome"), [("R1", None, "x", "RADIAL", "a", -1, "maybe")]))
    assert [p.cell for p in result.problems] == ["B2", "C2", "E2", "F2", "G2"]
    assert result.rows[0].correct == (
        "tail_no",
        "side",
        "clearance_3_in",
        "clearance_5_in",
        "outcome",
    )


def test_margin_and_its_uncertainty_are_read_in_their_units(read, table):
    text = table((*HEADER, "margin_mm", "margin_u_thou"), [(*GOOD, 0.762, 2)])
    row = inspection(read(text))
    assert row.margin_in == pytest.approx(0.03)
    assert row.margin_u_in == pytest.approx(0.002)


BAD_OPTIONAL = [
    ("inspection_date", "2026-02-30"),
    ("gear_landings", -1),
    ("gear_landings", "many"),
    ("gear_landings", "1,250x"),
    ("temperature_c", 61),
    ("temperature_c", -60.5),
    ("hydraulic_pressure_psi", 4001),
    ("hydraulic_pressure_psi", "nan"),
    ("approach", "SIDEWAYS"),
    ("axial_float_3_in", -0.01),
    ("plunger_down_lock_in", 3),
]
BAD_DECISIVE = [
    ("gauge_u_in", -0.0005),
    ("gauge_u_in", 0.5),
    ("gauge_u_3_in", 0),
    ("gauge_u_3_in", 0.5),
    ("plunger_gauge_u_in", "x"),
    ("plunger_displacement_in", 1.2),
    ("plunger_displacement_in", "?"),
    ("plunger_displacement_in", "0.O5"),
    ("outcome", "MAYBE"),
    ("outcome", "FAILD"),
    ("margin_in", -0.03),
    ("margin_in", 0),
    ("margin_in", "x"),
    ("margin_u_in", -1),
]


@pytest.mark.parametrize(("name", "value"), BAD_OPTIONAL)
def test_a_bad_optional_cell_is_reported_and_reads_as_absent(read, table, name, value):
    result = read(
        with_column(table, name, value)
        if "," not in str(value)
        else table((*HEADER, name), [(*GOOD, f'"{value}"')])
    )
    problem = only(result)
    assert (problem.column, problem.cell, problem.row) == (name, "G2", 2)
    assert result.rows == read(table()).rows


@pytest.mark.parametrize(("name", "value"), BAD_DECISIVE)
def test_a_row_with_an_unreadable_cell_that_decides_is_invalid(read, table, name, value):
    result = read(with_column(table, name, value))
    assert only(result).column == name
    assert isinstance(result.rows[0], InvalidRow)
    assert result.rows[0].correct == (name,)


RANGES = [
    ("gauge_u_in", 0, 0.02),
    ("gauge_u_3_in", None, 0.02),
    ("plunger_gauge_u_in", 0, 0.05),
    ("plunger_displacement_in", -0.5, 0.5),
    ("plunger_down_lock_in", -0.2, 0.2),
    ("axial_float_3_in", 0, 0.5),
    ("margin_in", None, 0.2),
    ("margin_u_in", 0, 0.1),
    ("temperature_c", -60, 60),
    ("hydraulic_pressure_psi", 0, 4000),
    ("gear_landings", 0, 1_000_000),
]


@pytest.mark.parametrize(("name", "low", "high"), RANGES)
def test_a_range_holds_its_ends_and_nothing_beyond(read, table, name, low, high):
    beyond = 1e-5 * high
    for end, out in ((low, -beyond), (high, beyond)):
        if end is not None:
            inspection(read(with_column(table, name, end)))
            assert only(read(with_column(table, name, f"{end + out:.9g}"))).column == name


@pytest.mark.parametrize(
    ("convention", "column", "words"),
    [
        ("RADIAL", "clearance_9_in", "from 0 to 0.05 in"),
        ("DIAMETRAL", "clearance_9_in", "from 0 to 0.1 in"),
        ("TOTAL_PLAY", "clearance_9_mm", "from 0 to 2.54 mm"),
    ],
)
@pytest.mark.parametrize("value", ["x", 999])
def test_what_a_clearance_may_be_is_said_in_its_own_unit_and_convention(
    read, table, convention, column, words, value
):
    text = table((*HEADER[:4], column), [(*GOOD[:3], convention, value)])
    assert only(read(text)).expected == f"a clearance {words}"


def test_the_optional_columns_are_read(read, table):
    extra = {
        "inspection_date": "2026-03-04T10:15",
        "gear_landings": 1234,
        "temperature_c": "-12.5 °C",
        "hydraulic_pressure_psi": "3000 psi",
        "approach": "extending",
        "gauge_id": "007",
        "technician_id": "T-1",
        "outcome": "Failed",
        "plunger_down_lock_in": 0.03,
        "plunger_gauge_u_in": 0.001,
        "axial_float_3_in": 0.004,
        "work_order": "WO-7",
        "tool box": "red",
    }
    result = read(table((*HEADER, *extra), [(*GOOD, *extra.values())]))
    row = inspection(result)
    assert row.inspection_date == datetime.date(2026, 3, 4)
    assert (row.gear_landings, row.temperature_c, row.hydraulic_pressure_psi) == (1234, -12.5, 3000)
    assert (row.approach, row.outcome) == (Approach.EXTENDING, Outcome.FAILED)
    assert (row.gauge_id, row.technician_id) == ("007", "T-1")
    assert (row.plunger_down_lock_in, row.plunger_gauge_u_in) == (0.03, 0.001)
    assert dict(row.axial_float_in) == {3: 0.004}
    assert row.carried == {"work_order": "WO-7", "tool box": "red"}
    assert any('carried to the report: "tool box"' in note for note in result.notes)


def test_plunger_readings_keep_their_sign_and_their_order(read, table):
    header = (
        *HEADER,
        "plunger_displacement_2_in",
        "plunger_displacement_in",
        "plunger_displacement_3_mm",
    )
    row = inspection(read(table(header, [(*GOOD, -0.02, "-0.01", 0.254)])))
    assert row.readings_in == (-0.01, -0.02, pytest.approx(0.01))


@pytest.mark.parametrize(("convention", "expected"), [("RADIAL", 0.001), ("TOTAL_PLAY", 0.0005)])
def test_the_gauge_uncertainty_is_in_the_convention_of_the_reading(
    read, table, convention, expected
):
    text = table((*HEADER, "gauge_u_in"), [("R1", "N1", "LH", convention, 0.013, 0.007, 0.001)])
    row = inspection(read(text))
    assert row.gauge_u_in == expected
    assert not row.gauge_u_is_default


@pytest.mark.parametrize(("convention", "expected"), [("RADIAL", 0.001), ("DIAMETRAL", 0.0005)])
def test_a_joint_may_have_an_uncertainty_of_its_own(read, table, convention, expected):
    header = (*HEADER, "gauge_u_in", "gauge_u_3_thou", "gauge_u_5_in")
    row = inspection(
        read(table(header, [("R1", "N1", "LH", convention, 0.013, 0.007, 0.002, 1, None)]))
    )
    assert (row.gauge_u_of(3), row.gauge_u_of(5)) == (
        pytest.approx(expected),
        pytest.approx(2 * expected),
    )


def test_an_uncertainty_of_a_joint_without_a_reading_is_ignored_with_a_note(read, table):
    row = inspection(
        read(table((*HEADER, "gauge_u_3_in", "gauge_u_9_in"), [(*GOOD, 0.001, 0.001)]))
    )
    assert row.gauge_u_by_joint_in == {3: 0.001}
    assert [w for w in row.warnings if "#9 is not used" in w] == list(row.warnings)


@pytest.mark.parametrize("convention", ["RADIAL", "TOTAL_PLAY"])
def test_the_default_uncertainty_is_radial_whatever_the_convention(read, table, convention):
    row = inspection(read(table(rows=[("R1", "N1", "LH", convention, 0.013, 0.007)])))
    assert (row.gauge_u_in, row.gauge_u_is_default) == (0.0005, True)


def test_without_a_column_of_ids_each_row_is_named_after_file_row_and_content(read, table):
    text = table(HEADER[1:], [GOOD[1:], GOOD[1:], ("N2", *GOOD[2:])])
    result = read(text, name="folder/hangar.csv")
    first, second, third = result.inspections
    assert first.record_id.startswith("hangar-2-")
    assert second.record_id.startswith("hangar-3-")
    assert first.record_id[-8:] == second.record_id[-8:] != third.record_id[-8:]
    assert [n for n in result.notes if "no record_id" in n] == list(result.notes)
    assert first.record_id == read(text, name="other/hangar.csv").inspections[0].record_id


def test_a_row_without_any_clearance_is_read_with_a_warning(read, table):
    row = inspection(read(table(rows=[(*GOOD[:4], None, None)])))
    assert row.clearance_in == {}
    assert any("no joint was measured" in warning for warning in row.warnings)


@pytest.mark.parametrize(
    "text", ["n/a?", "?", "x", "0.01-0.02", "~0.013", "0.013 cm", "0.0.13", "0.013 in in"]
)
def test_a_text_that_is_not_a_length_is_an_error_that_says_how_to_leave_a_joint_out(
    read, xlsx, text
):
    def change(book):
        book.worksheets[0]["E2"] = text

    problem = only(read(xlsx(change=change), "t.xlsx"))
    assert (problem.cell, problem.value) == ("E2", text)
    assert "leave it blank" in problem.remedy


def test_a_number_with_a_comma_that_may_be_a_thousand_is_refused(read, table):
    result = read(table((*HEADER, "gear_landings"), [(*GOOD, "1,250")], sep=";"))
    assert only(result).code == "ambiguous_number"


def test_a_unit_column_serves_headers_without_a_unit(read, table):
    header = (*(h.removesuffix("_in") for h in HEADER), "unit")
    rows = [(*GOOD, "in"), ("R2", *GOOD[1:4], 0.3302, 0.1778, "mm")]
    result = read(table(header, rows))
    assert not result.problems
    assert [r.clearance_in[3] for r in result.inspections] == [0.013, pytest.approx(0.013)]


@pytest.mark.parametrize(
    "header", [HEADER, ("ID", "Tail", "SIDE", "Convention", "Joint 3 (in)", "J5 [in]")]
)
def test_a_header_repeated_in_any_words_is_skipped_and_said(read, table, header):
    result = read(table(rows=[GOOD, header, ("R2", *GOOD[1:]), header, ("R3", *GOOD[1:])]))
    assert [row.record_id for row in result.inspections] == ["R1", "R2", "R3"]
    assert any("2 repeated header rows" in note for note in result.notes)


def test_rows_and_problems_come_in_the_order_of_the_file(read, table):
    rows = [
        (f"R{i}", "N1", "LH", "RADIAL", -1 if i % 3 == 0 else 0.001, 0.002) for i in range(1, 30)
    ]
    result = read(table(rows=rows))
    assert [row.source.row for row in result.rows] == list(range(2, 31))
    assert [p.row for p in result.problems] == [i + 1 for i in range(3, 30, 3)]


@pytest.mark.parametrize("number", [20260304123456789, 1234567890123456])
def test_a_number_whose_digits_are_lost_is_not_an_identity(read, xlsx, number):
    def change(book):
        book.worksheets[0]["A2"] = number

    assert only(read(xlsx(change=change), "t.xlsx")).code == "number_lost_digits"


def test_progress_is_told_file_by_file(table):
    import io

    from mlg_troubleshoot.records import ReadOptions, read_many

    texts = [table(rows=[(f"R{i}", *GOOD[1:]) for i in range(rows)]) for rows in (2, 3)]
    told: list[int] = []
    read_many(
        [io.BytesIO(text.encode()) for text in texts],
        ReadOptions(),
        progress=lambda done, _: told.append(done),
    )
    assert told == [2, 5]


def test_a_row_repeated_in_a_table_that_lacks_its_convention_is_not_a_contradiction(read, table):
    header = [h for h in HEADER if h != "clearance_convention"]
    row = ("R1", "N1", "LH", 0.013, 0.007)
    assert {p.code for p in read(table(header, [row, row])).problems} == {"convention_missing"}


def test_a_table_of_clearances_alone_is_told_which_columns_it_lacks(read):
    result = read("J1 (in);J2 (in)\n0,013;0,010\n", convention="RADIAL")
    assert [(p.code, p.column) for p in result.problems] == [
        ("column_missing", "tail_no"),
        ("column_missing", "side"),
    ]
    assert result.rows[0].correct == ("tail_no", "side")


def test_a_value_in_a_message_is_cut_and_cannot_steer_a_terminal(read, table):
    problem = only(read(table(rows=[(*GOOD[:4], "\x1b[31m" + "9" * 5000, 0.007)])))
    assert problem.value.startswith("\\x1b[31m999")
    assert len(problem.value) < 400


def test_a_margin_of_nothing_is_not_a_slip_of_the_decimal_point(read, table):
    assert "slipped" not in only(read(with_column(table, "margin_in", 0))).remedy


def test_a_header_with_nothing_below_it_does_not_contradict_the_unit_of_the_row(read, table):
    header = (*HEADER[:4], "unit", "clearance_3_in", "clearance_5")
    row = inspection(read(table(header, [(*GOOD[:4], "mm", None, 0.127)])))
    assert row.clearance_in == {5: pytest.approx(0.005)}


@pytest.mark.parametrize(("value", "codes"), [(0.08, 1), (0.12, 2)])
def test_without_its_convention_a_reading_may_be_as_large_as_total_play(read, table, value, codes):
    found = read(table(rows=[("R1", "N1", "LH", None, value, 0.007)])).problems
    assert [p.code for p in found] == ["convention_missing", "clearance_out_of_range"][:codes]


def test_a_limit_is_met_in_millimetres_whatever_a_computer_makes_of_them(read, table):
    header = (*HEADER[:4], "clearance_3_mm", "clearance_5_mm")
    result = read(table(header, [(*GOOD[:4], 0.1905, 0.1)]), clearance_hard_max_in=0.0075)
    assert 0.1905 / 25.4 > 0.0075
    assert not result.problems


def test_one_id_with_two_plunger_readings_is_two_inspections(read, table):
    header = (*HEADER, "plunger_displacement_in")
    result = read(table(header, [(*GOOD, 0.01), (*GOOD, 0.02)]))
    assert {p.code for p in result.problems} == {"record_id_duplicate"}
    assert not read(table(header, [(*GOOD, 0.01), (*GOOD, 0.01)])).problems


def test_what_is_confirmed_is_what_the_gear_file_says(gear):
    other = replace(gear, confirm_above=replace(gear.confirm_above, value=0.01))
    assert ReadOptions.of(other).clearance_confirm_above_in == 0.01
