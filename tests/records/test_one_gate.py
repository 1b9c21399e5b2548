"""One value, four ways in: a cell, a flag, a prompt answer and Python give one result, one warning
and one refusal.
"""

from __future__ import annotations

import io
import math
import re
from dataclasses import dataclass, replace

import pytest

from mlg_troubleshoot import Inspection, Side, TroubleshootError, check
from mlg_troubleshoot.cli.check import Flags
from mlg_troubleshoot.cli.check_run import from_flags
from mlg_troubleshoot.cli.prompts.entry import Entry
from mlg_troubleshoot.errors import UsageError
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.records import ReadOptions, judge_again
from mlg_troubleshoot.units import ClearanceConvention as Convention
from mlg_troubleshoot.units import LengthUnit
from mlg_troubleshoot.workflows.check import CheckOptions
from tests.records.reading import read_inspections

VALUES = (
    *("0", "0.0", ".013", "0.013", "0.013 in", "13 thou", "0.33 mm", '.007"', "0.381 mm"),
    *("15 thou", "0.015", "0.0151", "0.02in", "0.05", "0.0501", "0.33", "13", "1.3e-2", "+0.004"),
    *("-0.013", "\u22120.013", "0,013", "1/64", "nan", "inf", "1e309", "0.013 cm", "x", "0.0.13"),
    *("50 thou", "51 thou", "1.27 mm"),
)
# The advice of a remedy that a prompt leaves out: it is for the cells of a file.
FILE_ADVICE = re.compile(r",? or (?:pass --decimal-comma|leave it blank[^.]*)")
MARGINS = ("0.03", "0.2in", "0.3in", "0", "-0.03", "0.762 mm")
# The same as numbers in inches, as Python has them.
NUMBERS = (
    *(0.0, 0.0001, 0.004, 0.007, 0.0075, 0.01, 0.013, 0.33 / 25.4, 0.381 / 25.4, 0.015, 0.0151),
    *(0.02, 0.05, 0.0501, 0.1, 0.33, 0.5, 1.0, 13.0, 1e6, -0.0001, -0.013, math.nan, math.inf),
)
MARGIN_NUMBERS = (0.03, 0.2, 0.3, 0.0, -0.03, 0.762 / 25.4)


@dataclass(frozen=True)
class Found:
    """What came of a value: its radial inches, the margin and the warnings, or the words of the
    refusal.
    """

    radial_in: float | None = None
    margin_in: float | None = None
    warnings: tuple[str, ...] = ()
    refused: str = ""


def by_cell(gear: Gear, value: object, margin: str, convention: Convention) -> Found:
    name = "margin" if isinstance(value, str) else "margin_in"
    clearance = "clearance_3" if isinstance(value, str) else "clearance_3_in"
    quoted = str(value).replace(chr(34), chr(34) * 4)
    text = f"record_id\ttail_no\tside\t{clearance}\t{name}\nR1\tN1\tLH\t{quoted}"
    if '"' in str(value):
        text = text.replace(
            str(value).replace('"', '""""'), f'"{str(value).replace(chr(34), chr(34) * 2)}"'
        )
    data = io.BytesIO(f"{text}\t{margin}\n".encode())
    options = ReadOptions.of(gear, unit=LengthUnit.INCH, convention=convention)
    result = read_inspections(data, options, name="t.csv")
    (row,) = result.rows
    if isinstance(row, Inspection):
        return Found(row.clearance_in[3], row.margin_in, row.warnings)
    return Found(refused=" ".join(f"{p.expected} {p.remedy}" for p in result.problems))


def by_flag(gear: Gear, value: str, margin: str, convention: Convention) -> Found:
    flags = Flags([f"3={value}", "record_id=R1", f"margin={margin}"], "N1", "LH")
    asked = CheckOptions(unit=LengthUnit.INCH, convention=convention)
    try:
        row = from_flags(flags, asked)
    except UsageError as error:
        return Found(refused=words(error))
    return Found(row.clearance_in[3], row.margin_in, row.warnings)


def words(error: TroubleshootError) -> str:
    """Return a refusal as expectation and remedy, without the name of what was refused."""
    expected = [
        part.partition("expected ")[2]
        for part in re.split(r"; (?=--|clearance|margin)", error.message)
    ]
    return " ".join([*expected, error.remedy])


def by_prompt(gear: Gear, value: str, margin: str, convention: Convention) -> Found:
    head = {"tail_no": "N1", "side": "LH", "unit": "in", "clearance_convention": convention.value}
    entry = Entry.new(gear, head)
    refused = []
    warned = False
    for name, text in (("clearance_3", value), ("margin", margin)):
        try:
            said = entry.judge(gear, name, text).warnings
        except UsageError as error:
            # A prompt says besides how another joint or unit is named.
            refused.append(words(error).removesuffix(" Several joints: #3 13 #7 9."))
            continue
        warned = warned or (name == "clearance_3" and bool(said))
        entry.give(name, f"{text} in" if text[-1:].isdigit() or text[-1:] == "." else text)
    if refused:
        return Found(refused=" ".join(refused))
    row = entry.inspection(gear)
    assert warned == bool(row.warnings)
    return Found(row.clearance_in[3], row.margin_in, row.warnings)


def by_python(gear: Gear, value: float, margin: float, convention: Convention) -> Found:
    given = Inspection("R1", "N1", Side.LH, convention, {3: value}, margin_in=margin)
    try:
        found = check(given, gear, advice=False)
    except TroubleshootError as error:
        return Found(refused=words(error))
    assert found.margin_in == margin
    row = judge_again(given, ReadOptions.of(gear))
    assert set(row.warnings) <= set(found.warnings)
    assert found.inspection.clearance_in == row.clearance_in
    return Found(row.clearance_in[3], row.margin_in, row.warnings)


def said(found: Found) -> set[str]:
    return set(FILE_ADVICE.sub("", found.refused).replace(".", "").split())


@pytest.mark.parametrize("value", VALUES)
def test_a_value_gives_the_same_as_a_cell_a_flag_and_a_prompt_answer(gear, value):
    # Each value in two conventions, and every margin for several values.
    for n, convention in enumerate((Convention.RADIAL, Convention.TOTAL_PLAY), VALUES.index(value)):
        given = value, MARGINS[n % len(MARGINS)], convention
        cell = by_cell(gear, *given)
        for other in (by_flag(gear, *given), by_prompt(gear, *given)):
            assert replace(other, refused="") == replace(cell, refused="")
            assert said(other) == said(cell)


@pytest.mark.parametrize("value", NUMBERS)
def test_a_number_gives_the_same_in_python_as_the_other_ways(gear, value):
    # Each number in one convention with one margin, and all of these for several numbers.
    n = NUMBERS.index(value)
    convention = [*Convention][n % len(Convention)]
    margin = MARGIN_NUMBERS[n // len(Convention) % len(MARGIN_NUMBERS)]
    python = by_python(gear, value, margin, convention)
    written = repr(value), repr(margin), convention
    others = (
        by_cell(gear, value, repr(margin), convention),
        by_flag(gear, *written),
        by_prompt(gear, *written),
    )
    for other in others:
        assert replace(python, refused="") == replace(other, refused="")
        assert said(python) == said(other)


def test_the_list_holds_values_that_are_taken_warned_of_and_refused(gear: Gear) -> None:
    found = [by_cell(gear, value, "0.03", Convention.RADIAL) for value in VALUES]
    assert sum(bool(f.refused) for f in found) >= 10
    assert sum(bool(f.warnings) for f in found) >= 4
    assert sum(f.radial_in is not None and not f.warnings for f in found) >= 10


def test_an_inspection_that_was_judged_is_not_halved_again(gear: Gear) -> None:
    options = ReadOptions.of(gear)
    given = Inspection(
        "R1",
        "N1",
        Side.LH,
        Convention.TOTAL_PLAY,
        {3: 0.026},
        gauge_u_in=0.002,
        gauge_u_by_joint_in={3: 0.001},
    )
    once = judge_again(given, options)
    assert (once.clearance_in, once.gauge_u_in, once.gauge_u_of(3)) == ({3: 0.013}, 0.001, 0.0005)
    assert judge_again(once, options) == once


@pytest.mark.parametrize("joint", [11, 0, -1, "3", 3.5])
def test_a_joint_that_the_gear_lacks_is_refused_in_python(gear: Gear, joint: object) -> None:
    with pytest.raises(TroubleshootError, match="a joint from 1 to 10"):
        check(Inspection("R1", "N1", Side.LH, Convention.RADIAL, {joint: 0.01}), gear)  # type: ignore[dict-item]


@pytest.mark.parametrize(
    ("name", "value", "words"),
    [
        ("tail_no", " ", "^tail_no: expected a tail number"),
        ("side", "UP", "^side: 'UP': expected LH or RH"),
        ("margin_in", 0.3, "a margin above 0 and up to 0.2 in"),
        ("readings_in", (0.02, 0.6), "plunger displacement from -0.5 to 0.5 in"),
        ("temperature_c", 61, "^temperature_c: '61': expected a temperature from -60 to 60"),
        ("gauge_u_by_joint_in", {3: 0.0}, "a gauge u above 0"),
    ],
)
def test_whatever_a_table_would_refuse_is_refused_in_python(gear, name, value, words):
    good = Inspection("R1", "N1", Side.LH, Convention.RADIAL, {3: 0.01})
    with pytest.raises(TroubleshootError, match=words):
        check(replace(good, **{name: value}), gear)  # type: ignore[arg-type]
