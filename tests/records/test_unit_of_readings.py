"""Readings too small for their unit: not judged, or asked about, whatever way they come in."""

from __future__ import annotations

from dataclasses import replace

import pytest

from mlg_troubleshoot import check
from mlg_troubleshoot.decision.assessment import Action, Verdict
from mlg_troubleshoot.decision.inspection import Inspection, InvalidRow, Side
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.records import ReadOptions, read_many
from mlg_troubleshoot.records.gate import judge_row
from mlg_troubleshoot.units import ClearanceConvention, LengthUnit
from tests.cli.conftest import mlg

# A worn gear in radial inches, as in the review: declared as millimetres it passed as WITHIN.
WORN_IN = (0.004, 0.009, 0.013, 0.002, 0.007, 0.003, 0.004, 0.001, 0.002, 0.003)
# Every joint worn beyond its limit: as millimetres each reading looks like that of a new part.
ALL_WORN_OUT_IN = (0.011, 0.009, 0.0115, 0.010, 0.011, 0.009, 0.0105, 0.010, 0.011, 0.009)
NEW_IN = (0.0005, 0.0004, 0.0006, 0.0005, 0.0007, 0.0005, 0.0004, 0.0006, 0.0005, 0.0005)
UNITS = tuple(LengthUnit)
TOO_SMALL = [
    (LengthUnit.INCH, LengthUnit.MILLIMETRE),
    (LengthUnit.INCH, LengthUnit.THOU),
    (LengthUnit.MILLIMETRE, LengthUnit.THOU),
]
TOO_LARGE = [(declared, read) for read, declared in TOO_SMALL]


def judged(gear: Gear, radial_in, read_in: LengthUnit, declared: LengthUnit, **more):
    """Judge a row of readings that were read in one unit and declared in another."""
    values = {
        "record_id": "R1",
        "tail_no": "N1",
        "side": "LH",
        "clearance_convention": "RADIAL",
        **{
            f"clearance_{n}_{declared}": read_in.from_inches(value)
            for n, value in enumerate(radial_in, 1)
        },
    }
    options = {name: more.pop(name) for name in ("small_readings_true",) if more.get(name) is True}
    return judge_row({**values, **more}, ReadOptions.of(gear, **options))


@pytest.mark.parametrize(("read_in", "declared"), TOO_SMALL)
def test_a_worn_gear_read_in_a_larger_unit_is_not_judged(gear, read_in, declared):
    row, (problem,) = judged(gear, WORN_IN, read_in, declared)
    assert isinstance(row, InvalidRow)
    assert problem.code == "readings_too_small"
    assert f"read in {read_in.words}" in problem.remedy
    assert f"not in {declared.words}" in problem.remedy
    assert "small_readings_true" in problem.remedy


@pytest.mark.parametrize("answer", ["no", "perhaps"])
def test_an_answer_that_confirms_nothing_leaves_the_row_invalid(gear, answer):
    row, problems = judged(
        gear, WORN_IN, LengthUnit.INCH, LengthUnit.MILLIMETRE, small_readings_true=answer
    )
    assert isinstance(row, InvalidRow)
    assert "small_readings_true" in " ".join(f"{p.column} {p.remedy}" for p in problems)


def test_the_refusal_names_a_cell_of_a_small_reading(gear, tmp_path):
    file = tmp_path / "t.csv"
    file.write_text(
        "record_id,tail_no,side,clearance_convention,clearance_1_mm,clearance_2_mm,clearance_3_mm\n"
        "R1,N1,LH,RADIAL,0.013,0.004,0.002\n"
    )
    (problem,) = read_many([file], ReadOptions.of(gear)).problems
    assert (problem.cell, problem.column, problem.value) == ("F2", "clearance_2_mm", "0.004")


@pytest.mark.parametrize(
    "confirmed", [{"small_readings_true": "yes"}, {"small_readings_true": True}]
)
def test_confirmed_small_readings_are_judged(gear, confirmed):
    row, problems = judged(gear, WORN_IN, LengthUnit.INCH, LengthUnit.MILLIMETRE, **confirmed)
    assert isinstance(row, Inspection)
    assert not problems
    assert not row.unit_question
    assert check(row, gear).verdict is Verdict.WITHIN_MARGIN


def test_who_can_be_asked_has_the_row_of_too_small_readings_with_its_question(gear):
    values = {f"clearance_{n}_mm": 0.004 for n in range(1, 11)}
    heading = {"record_id": "R1", "tail_no": "N1", "side": "LH", "clearance_convention": "RADIAL"}
    row, problems = judge_row({**heading, **values}, replace(ReadOptions.of(gear), asks=True))
    assert not problems
    assert row.unit_question.startswith("10 of 10 readings")


@pytest.mark.parametrize("unit", UNITS)
def test_new_parts_in_their_own_unit_are_judged_without_a_question(gear, unit):
    row, problems = judged(gear, NEW_IN, unit, unit)
    assert not problems
    assert row.unit_question == ""
    assert not [warning for warning in row.warnings if "play of new parts" in warning]


def test_of_a_doubtful_row_only_the_readings_below_a_new_part_are_named(gear):
    row, _ = judged(gear, (0.0004, 0.0004, 0.0006), *2 * [LengthUnit.MILLIMETRE])
    assert row.unit_question.startswith("2 of 3 readings (#1, #2) are below the play of new parts")


def test_the_play_of_new_parts_is_stated_in_the_convention_of_the_row(gear):
    diametral = [2 * value for value in (0.0004, 0.0004, 0.0004)]
    row, _ = judged(
        gear,
        diametral,
        *2 * [LengthUnit.MILLIMETRE],
        clearance_convention=ClearanceConvention.DIAMETRAL.value,
    )
    assert "below the play of new parts (0.0254 mm diametral)" in row.unit_question


@pytest.mark.parametrize(("read_in", "declared"), TOO_LARGE)
def test_a_worn_gear_read_in_a_smaller_unit_is_not_judged(gear, read_in, declared):
    row, _ = judged(gear, WORN_IN, read_in, declared)
    assert isinstance(row, InvalidRow)


def test_readings_that_may_be_of_new_parts_or_of_another_unit_do_not_clear_the_gear(gear):
    row, problems = judged(gear, ALL_WORN_OUT_IN, LengthUnit.INCH, LengthUnit.MILLIMETRE)
    assert not problems
    found = check(row, gear)
    assert found.verdict is Verdict.INCOMPLETE
    assert found.next_action.action is Action.CORRECT
    assert "inches" in found.headline


def test_one_small_reading_among_others_is_a_warning_that_says_the_same(gear):
    row, problems = judged(
        gear, (0.002, 0.002, 0.0001, 0.002, 0.002), LengthUnit.MILLIMETRE, LengthUnit.MILLIMETRE
    )
    assert not problems
    (warning,) = [text for text in row.warnings if "play of new parts" in text]
    assert "#3" in warning
    assert "was it read in inches, not in millimetres?" in warning
    assert "small_readings_true" in warning


def in_two_units(gear: Gear, third: str, value: float):
    """Judge ten readings in inches, but the third under a header in another unit."""
    values = {f"clearance_{n}_in": 0.001 for n in range(1, 11) if n != 3}
    named = {"record_id": "R", "tail_no": "N", "side": "LH", "clearance_convention": "RADIAL"}
    return judge_row({**named, **values, third: value}, ReadOptions.of(gear))[0]


@pytest.mark.parametrize(
    ("third", "value", "verdict"),
    [
        ("clearance_3_mm", 0.013, Verdict.INCOMPLETE),
        ("clearance_3_thou", 0.013, Verdict.INCOMPLETE),
        ("clearance_3_mm", 0.033, Verdict.WITHIN_MARGIN),
    ],
)
def test_inches_under_the_one_header_in_a_smaller_unit_do_not_clear_the_gear(
    gear, third, value, verdict
):
    row = in_two_units(gear, third, value)
    assert check(row, gear).verdict is verdict
    asked = any("read in inches" in text for text in row.warnings)
    assert asked is (verdict is Verdict.INCOMPLETE)


@pytest.mark.parametrize("declared", [LengthUnit.THOU, LengthUnit.MILLIMETRE])
def test_two_readings_are_too_few_to_refuse_a_row_but_do_not_clear_it(gear, declared):
    row, _ = judged(gear, (0.013, 0.004, *[0.0] * 8), LengthUnit.INCH, declared)
    assert check(row, gear).verdict is Verdict.INCOMPLETE


INCH, THOU, MILLIMETRE = LengthUnit.INCH, LengthUnit.THOU, LengthUnit.MILLIMETRE
ASKED = ("were they read in", "(#3) is above the limit: was it read", "radial clearance (factor 2)")


@pytest.mark.parametrize(
    ("radial_in", "read_in", "declared", "more", "asked"),
    [
        (NEW_IN, MILLIMETRE, INCH, {}, "millimetres, not in inches"),
        ([0.0125] * 10, MILLIMETRE, MILLIMETRE, {}, "were they read in thou,"),
        (ALL_WORN_OUT_IN, THOU, THOU, {}, ""),
        ((0.003, 0.003, 0.025), INCH, INCH, {}, ASKED[1]),
        ((0.003, 0.003, 0.025), INCH, INCH, {"measured_again": "3"}, ""),
        ((0.003, 0.003, 0.025), INCH, INCH, {"gauge_u_3_in": "0.0003"}, ""),
        (NEW_IN, INCH, INCH, {"clearance_convention": "TOTAL_PLAY"}, ASKED[2]),
    ],
)
def test_readings_that_another_unit_or_convention_explains_are_asked_about(
    gear, radial_in, read_in, declared, more, asked
):
    row, problems = judged(gear, radial_in, read_in, declared, **more)
    assert not problems
    said = " ".join(row.warnings)
    assert asked in said
    assert asked or not any(words in said for words in ASKED)


def test_flags_refuse_small_readings_until_they_are_confirmed():
    given = [f"--set={n}={value}" for n, value in enumerate(WORN_IN, 1)]
    flags = ("check", "--tail", "N1", "--side", "LH", "--convention", "RADIAL", "--unit", "mm")
    run = mlg(*flags, *given)
    assert run.code == 2
    assert "were they read in inches, not in millimetres?" in " ".join(run.err.split())
    run = mlg(*flags, *given, "--set", "small_readings_true=yes", "--json")
    assert run.one["verdict"] == "WITHIN_MARGIN"


def test_python_asks_about_small_readings_in_inches(gear):
    small = Inspection(
        record_id="R1",
        tail_no="N1",
        side=Side.LH,
        convention=ClearanceConvention.RADIAL,
        clearance_in={
            n: LengthUnit.MILLIMETRE.to_inches(value) for n, value in enumerate(WORN_IN, 1)
        },
    )
    # In inches no larger unit explains them: they are judged, and asked about.
    assert any("below the play of new parts" in warning for warning in check(small, gear).warnings)


# Half of the readings are above new parts: in inches, the joints are worn out on average.
HALF_ABOVE = (0.0162, 0.0016, 0.0004, 0.0088, 0.0114, 0.0074, 0.0046, 0.0051, 0.0193, 0.0089)


def test_inches_of_a_worn_gear_in_millimetres_do_not_clear_it_although_some_are_above_new_parts(
    gear,
):
    row, _ = judged(gear, HALF_ABOVE, LengthUnit.INCH, LengthUnit.MILLIMETRE)
    assert not isinstance(row, Inspection) or check(row, gear).verdict is Verdict.INCOMPLETE


@pytest.mark.parametrize(
    ("column", "value", "unit"),
    [
        ("plunger_displacement_mm", 0.045, "inches"),
        ("plunger_displacement_mm", 0.09, "inches"),
        ("plunger_displacement_mm", -0.5, "inches"),
        ("plunger_displacement_thou", 0.045, "inches"),
        ("plunger_displacement_thou", 1.143, "millimetres"),
    ],
)
def test_a_plunger_reading_that_another_unit_puts_outside_is_asked_about(gear, column, value, unit):
    row, _ = judged(gear, [0.0012] * 10, LengthUnit.INCH, LengthUnit.INCH, **{column: value})
    found = check(row, gear)
    assert found.verdict is Verdict.INCOMPLETE
    assert f"was it read in {unit}" in found.headline


@pytest.mark.parametrize(
    ("column", "value"), [("plunger_displacement_mm", 0.51), ("plunger_displacement_in", 0.0018)]
)
def test_a_plunger_reading_that_no_other_unit_explains_is_not_asked_about(gear, column, value):
    row, _ = judged(gear, [0.0012] * 10, LengthUnit.INCH, LengthUnit.INCH, **{column: value})
    assert row.unit_question == ""
