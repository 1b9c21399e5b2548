"""Forms as shops write them: pairs of labels and values anywhere, one or two columns of readings,
and words of a sheet against what is declared.
"""

from __future__ import annotations

import io
from collections.abc import Iterable

import openpyxl
import pytest

from mlg_troubleshoot.decision.inspection import Inspection, InvalidRow, Side
from mlg_troubleshoot.errors import ExitCode
from mlg_troubleshoot.gear.gear_file import load_gear
from mlg_troubleshoot.records import ReadOptions, ReadResult, read_many
from mlg_troubleshoot.units import ClearanceConvention
from mlg_troubleshoot.workflows.check import check
from tests.records.reading import Named

GEAR = load_gear()
JOINTS = [f"{n},0.00{11 + n % 3}" for n in range(1, 11)]
WIDE = "Tail,Side,Date,Joint 1 (in),Joint 2 (in),Joint 3 (in)"


def named(lines: Iterable[str], name: str = "form.csv") -> Named:
    return Named("\n".join(lines).encode(), name)


def read(lines: Iterable[str], name: str = "form.csv", **declared: object) -> ReadResult:
    return read_many([named(lines, name)], ReadOptions.of(GEAR, **declared))


def form(*lines: str, head: str = "Joint,Found (in)", joints: Iterable[str] = JOINTS) -> list[str]:
    """A form of N801HK LH with further lines above the table of joints."""
    return ["Convention,RADIAL", *lines, head, *joints]


@pytest.mark.parametrize(
    ("head", "column", "pairs", "visits"),
    [
        ("Joint,LH (in),RH (in)", (1, 1), ("Aircraft,N801HK,Date,2026-03-14",), 2),
        ("Joint,Limit (in),Found (in)", (0.0075, 1), ("Aircraft,N801HK,Type,H800XP", "Side,LH"), 1),
        ("Joint,Found (in),As left (in)", (1, 1), ("Aircraft,N801HK,Station,EGHH", "Side,LH"), 2),
        ("Joint,2025-03-14 (in),2026-03-14 (in)", (1, 1), ("Aircraft,N801HK,Operator,Acme",), 2),
        ("Joint,2025-03-14 (in),2026-03-14 (in)", (1, 1), ("Aircraft,N801HK,Operator,",), 2),
        ("Joint,Found (in),Remarks", (1,), ("Aircraft,N801HK,Plunger (in),0.002", "Side,LH"), 1),
    ],
)
def test_a_pair_above_the_table_is_of_every_visit(head, column, pairs, visits):
    joints = [f"{n}," + ",".join(f"{0.001 if c == 1 else c}" for c in column) for n in range(1, 11)]
    found = read(form(*pairs, head=head, joints=joints), side=Side.LH)
    assert [(row.tail_no, len(row.clearance_in)) for row in found.inspections] == [
        ("N801HK", 10)
    ] * visits
    assert found.problems == ()


def test_who_signed_and_a_convention_in_words_leave_a_form_readable():
    lines = ["A/C,N801HK", "Side,LH", "Convention,Total play (dial indicator)", "Joint,Found (in)"]
    found = read([*lines, *JOINTS, "Measured by,J. Smith,Inspected by,A. Lee"])
    (row,) = found.inspections
    assert (row.tail_no, row.clearance_in[1]) == ("N801HK", 0.0006)
    assert found.problems == ()


def test_two_tails_of_one_line_above_the_table_are_not_settled():
    found = read(form("Aircraft,N801HK,N802HK", head="Joint,LH (in),RH (in)", joints=["1,0.1,0.1"]))
    assert not found.inspections


def test_what_was_found_and_what_was_left_keep_their_outcomes():
    lines = ["8,0.0101,0.0011", "Plunger (in),0.046,0.006", "Outcome,FAILED,RETRACTED"]
    top = ("Aircraft,N3CC", "Side,LH")
    found = read(form(*top, head="Joint,As found (in),As left (in)", joints=lines))
    said = [(row.outcome, row.readings_in, row.is_left) for row in found.inspections]
    assert said == [("FAILED", (0.046,), False), ("RETRACTED", (0.006,), True)]


def test_a_repair_that_is_stated_once_is_of_what_was_left_and_an_outcome_of_what_was_found():
    lines = ["3,0.0101,0.0011", "Outcome,FAILED", "Restored joints,3", "Repair date,2026-01-05"]
    top = ("Aircraft,N3CC", "Side,LH", "Date,2026-01-05")
    found = read(form(*top, head="Joint,As found (in),As left (in)", joints=lines))
    said = [(row.outcome, row.restored_joints) for row in found.inspections]
    assert said == [("FAILED", ()), (None, (3,))]


@pytest.mark.parametrize("line", ["3 (recheck),26", "3a,26", "10 / 9,13"])
def test_a_number_beside_an_unclear_joint_is_asked_about_with_its_unit(line):
    joints = [f"{n},1.{n % 3}" for n in range(1, 9)]
    lines = form("Aircraft,N801HK", "Side,LH", head="Joint,Found (thou)", joints=[*joints, line])
    (row,) = read(lines).inspections
    meant = "clearance_9_thou or clearance_10_thou" if "/" in line else "clearance_3_thou"
    assert meant in row.unit_question


def test_letters_that_two_lines_share_are_not_proposed():
    lines = form("Aircraft,N801HK", "Side,LH", joints=[*JOINTS, "3,0.0131"])
    (problem,) = read(lines).problems
    assert (problem.code, problem.remedy) == ("header_duplicate", "Remove one of the two.")


@pytest.mark.parametrize(
    "lines",
    [
        ["All joints: radial. Unit: 0.001 in", WIDE, "N1,LH,2026-03-14,0.0012,0.0011,0.013"],
        ["Clearance type: radial", WIDE, "N1,LH,2026-03-14,0.0012,0.0011,0.013"],
        [WIDE, "N1,LH,2026-03-14,0.0012,0.0011,0.013", "Note: readings are radial offsets,,,,,"],
        [f"{WIDE},Remarks", "N1,LH,2026-03-14,0.0012,0.0011,0.013,radial offset of the pin"],
        ["All readings radial", "Aircraft,N1", "Side,LH", "Joint,Found (in)", *JOINTS],
    ],
)
def test_words_of_the_sheet_against_the_declared_convention_are_asked_about(lines):
    result = check(named(lines), convention=ClearanceConvention.TOTAL_PLAY, advice=False)
    assert result.exit_code is not ExitCode.FINE
    for convention in ("TOTAL_PLAY", "RADIAL"):
        (row,) = read(lines, convention=convention).inspections
        assert ("radial" in row.unit_question) == (convention == "TOTAL_PLAY")


@pytest.mark.parametrize("finding", [["N1", "LH", "Gear failed to retract"], ["plunger +46 thou"]])
def test_a_finding_on_a_sheet_that_is_not_read_never_leaves_with_exit_0(finding):
    row = ["N1", "LH", *[0.0011, 0.0012, 0.0013] * 3, 0.0011, "RADIAL"]
    head = ["Tail", "Side", *(f"Joint {n} (in)" for n in range(1, 11)), "Convention"]
    codes = []
    for text in (["Retraction tests: RETRACTED or FAILED"], finding):
        book = openpyxl.Workbook()
        for line in (head, row):
            book.worksheets[0].append(line)
        book.create_sheet("Findings").append(text)
        data = io.BytesIO()
        book.save(data)
        codes.append(check(Named(data.getvalue(), "t.xlsx"), advice=False).exit_code)
    assert codes == [ExitCode.FINE, ExitCode.ATTENTION]


@pytest.mark.parametrize(
    ("name", "line", "declared"),
    [
        ("form.csv", "Station,EGHH", {"side": Side.LH}),
        ("N801HK_LH.csv", "Station,EGHH", {}),
        ("form.csv", "Gear,LH", {}),
    ],
)
def test_the_side_of_a_form_is_found_as_that_of_a_table(name, line, declared):
    (row,) = read(form("Aircraft,N801HK", line), name, **declared).inspections
    assert row.side is Side.LH


def test_under_travel_is_negative_however_it_was_written():
    lines = [f"{WIDE},Convention,Plunger under-travel (in)"]
    lines.append("N1,LH,2026-03-14,0.0012,0.0011,0.0013,RADIAL,0.046")
    (row,) = read(lines).inspections
    assert "plunger_displacement_in" in row.unit_question
    proposed = {"Plunger under-travel (in)": "plunger_displacement_in"}
    (row,) = read(lines, column_map=proposed).inspections
    assert row.readings_in == (-0.046,)


@pytest.mark.parametrize(
    ("words", "outcome"),
    [
        ("failed retraction", "FAILED"),
        ("Gear would not retract on first attempt", "FAILED"),
        ("satisfactory", "RETRACTED"),
        ("unsatisfactory", "FAILED"),
        ("failed, retracted after a reset", None),
    ],
)
def test_sentences_under_an_outcome_header_are_read_or_refused(words, outcome):
    lines = [f"{WIDE},Convention,Outcome", f'N1,LH,2026-03-14,0.001,0.001,0.002,RADIAL,"{words}"']
    (row,) = read(lines).rows
    assert row.outcome == outcome if isinstance(row, Inspection) else outcome is None


ROW = "LH,2026-03-14,0.001,0.001,0.002,RADIAL"


@pytest.mark.parametrize("tail", ["ditto", "do.", "idem", '""""'])
def test_ditto_is_no_tail(tail):
    lines = [f"{WIDE},Convention", f"N1,{ROW}", f"{tail},{ROW}"]
    (row,) = (row for row in read(lines).rows if isinstance(row, InvalidRow))
    assert row.tail_no is None


@pytest.mark.parametrize("note", ["* replaced at next C-check", "gear hung up in transit"])
def test_words_alone_below_the_rows_are_a_note_unless_they_say_a_failure(note):
    found = read([f"{WIDE},Convention", f"N1,{ROW}", f"{note},,,,,,"])
    assert len(found.rows) == 1 + ("hung" in note)
    assert note in " ".join(found.notes)
