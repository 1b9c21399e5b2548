"""Outcomes and readings under headers that are not understood: asked about, never passed over."""

from __future__ import annotations

import io
from collections.abc import Sequence
from typing import Any

import openpyxl
import pytest

from mlg_troubleshoot.decision.assessment import Judgement, Verdict
from mlg_troubleshoot.decision.inspection import Inspection, Outcome
from mlg_troubleshoot.errors import ExitCode
from mlg_troubleshoot.gear.gear_file import load_gear
from mlg_troubleshoot.records import ReadOptions, ReadResult, read_many
from mlg_troubleshoot.workflows.check import check
from tests.records.reading import Named

GEAR = load_gear()
ALL = ["record_id", "tail_no", "side", "clearance_convention"]
ALL += [f"clearance_{n}_in" for n in range(1, 11)]
GOOD = ["R1", "N1", "LH", "RADIAL", *["0.001"] * 10]
# Headers of a column that asks what the gear did, and what a yes to it means.
NEGATED = (
    *("not_retracted", "Not retracted", "Not-retracted", "Not\u2010retracted", "NOT RETRACTED?"),
    *("not retracted (y/n)", "Not_retracted_y_n", "Failed?", "failed_(y/n)", "Gear failed [Y/N]"),
    "Failed to retract?",
)
AFFIRMED = (
    *("retracted", "Retracted?", "gear_retracted", "retracted (y/n)", "Retracted yes/no"),
    "Did the gear retract?",
)
# Headers of a column that only travels to the report, whatever is in it.
CARRIED = (
    *("Result 2026", "Retraction 1", "Result (2nd try)", "status 2", "remarks", "Ergebnis 3"),
    *("Joint 6 status", "col7", "Finding", "Gear"),
)
PLUNGER = (
    *("Plunger reading 1", "Plunger displ.", "RV plunger", "plunger 1st", "plunger pos.", "RV 1"),
    *("Plunger mid-position", "plunger_mm_read", "Plunger (measured)", "reversing valve", "Plgr"),
    *("plg disp", "Kolben", "Stößel", "mid pos deviation", "spool", "Messwert", "stroke", "actual"),
)
JOINTS = (
    *("6 extension lever end (in)", "play 6 (in)", "radial 6 (in)", "extension lever end"),
    *("play 6", "6 play", "reading 6", "value 6", "c6 measured", "gap #6", "pos 6", "Spiel 6"),
    *("6a", "Lever end 6", "bellcrank", "wear 6 thou", "total play 6", "6 found", ""),
)
MARGINS = (
    *("Margin of gear", "allowed displacement in", "rig margin", "Margin as rigged", "MARGIN 2"),
    *("Allowable travel (thou)", "permitted travel", "tolerance in", "Marginal travel allowed"),
)


def pairs(header: Sequence[str], values: Sequence[str]) -> list[Any]:
    """Each header with a value and each value with a header every day, all pairs in the slow
    part.
    """
    return [
        pytest.param(
            each,
            value,
            marks=[pytest.mark.slow] * (at != k % len(values) and k != at % len(header)),
        )
        for k, each in enumerate(header)
        for at, value in enumerate(values)
    ]


def crossed(header: Sequence[str], **by_name: Sequence[str]) -> pytest.MarkDecorator:
    [(name, values)] = by_name.items()
    return pytest.mark.parametrize(("header", name), pairs(header, values))


def judged(headers: list[str], cells: list[str], **declared: object) -> Judgement:
    cells = [f'"{cell}"' for cell in cells]
    text = ",".join([*ALL, *headers]) + "\n" + ",".join([*GOOD, *cells]) + "\n"
    result = check(Named(text.encode(), "t.csv"), advice=False, **declared)
    (judgement,) = result.judgements
    return judgement


def read(headers: list[str], rows: list[list[str]]) -> ReadResult:
    lines = [",".join(headers), *(",".join(row) for row in rows)]
    return read_many([Named("\n".join(lines).encode(), "t.csv")], ReadOptions.of(GEAR))


@crossed(header=[*NEGATED, *AFFIRMED], answer=["yes", "TRUE", "1", "no", "N"])
def test_a_question_is_answered_as_it_was_asked(header: str, answer: str) -> None:
    (row,) = read([*ALL, header], [[*GOOD, answer]]).rows
    assert isinstance(row, Inspection)
    has_failed = (header in NEGATED) is (answer not in ("no", "N"))
    assert row.outcome is (Outcome.FAILED if has_failed else Outcome.RETRACTED)


@crossed(
    header=["Retracts OK?", "no retraction", "hyd failure", "2 failed"],
    answer=["yes", "N", "1", "TRUE"],
)
def test_an_answer_under_a_question_that_is_not_understood_is_asked_about(header, answer):
    assert judged([header], [answer]).verdict is Verdict.INCOMPLETE


@crossed(
    header=CARRIED,
    word=[
        *("FAILED", "fail", "failed!", "did not retract", "failed last week, repaired", "Hung."),
        *("LH gear hung at mid travel", "wouldn't retract", "leg was stuck, freed by hand"),
        *("gear cannot lock up", "Refused to retract when cold", "MLG jammed"),
    ],
)
def test_a_failure_is_seen_whatever_the_header_is(header: str, word: str) -> None:
    row = judged([header], [word]).row
    assert isinstance(row, Inspection)
    assert f'--map "{header}=outcome"' in row.unit_question


def test_a_failure_in_a_remark_leaves_what_was_measured_judged() -> None:
    asked = judged(["plunger_displacement_in", "remarks"], ["0.06", "failed last week"])
    assert asked.verdict is Verdict.OUTSIDE_MARGIN


@pytest.mark.parametrize(
    ("header", "cell"), [("remarks", "did not retract"), ("Status", "hung"), ("VI", "0.06")]
)
def test_a_row_that_says_something_only_where_nobody_reads_is_not_set_aside(header, cell):
    blank = ["R2", "N2", *GOOD[2:4], *[""] * 10, cell]
    text = "\n".join(",".join(line) for line in ([*ALL, header], [*GOOD, ""], blank))
    result = check(Named(text.encode(), "t.csv"), advice=False)
    assert [each.verdict for each in result.judgements][1:] == [Verdict.INCOMPLETE]


def test_a_table_none_of_whose_clearance_headers_is_understood_is_invalid_in_every_row() -> None:
    text = "tail_no,side,clearance_convention,Wert A,Wert B\n"
    text += "N1,LH,RADIAL,0.013,0.002\nN2,LH,RADIAL,0.003,0.002\n"
    result = check(Named(text.encode(), "t.csv"), advice=False)
    assert [each.verdict for each in result.judgements] == [Verdict.INVALID] * 2
    assert result.exit_code is ExitCode.NO_CONCLUSION


# Remarks of every day, which nobody has to answer for.
ORDINARY = (
    *("stuck bolt replaced", "pin jammed in bush, pressed out", "placard hung at the door"),
    *("gear swing OK", "gear could retract slower when cold", "landing gear lubricated"),
    *("no gear hung or stuck", "jam nut tightened", "retracts slowly", "did not measure #9"),
    *("gear jacked", "did not lock the door", "LH tyre worn", "cannot find the log book"),
)
UNCLEAR = ("F", "x", "0", "3", "intermittent", "hung", "partial", "FAULT", "slow", "OK?")


@crossed(header=["Result", "Status", "Gear swing", "Defect", "P/F", "Result 2"], word=UNCLEAR)
def test_what_is_not_plainly_good_in_a_column_of_results_is_asked_about(header, word):
    asked = judged([header], [word])
    assert asked.verdict is Verdict.INCOMPLETE
    assert f'--map "{header}=outcome"' in asked.row.unit_question


@pytest.mark.parametrize(
    ("header", "value", "unit"),
    [
        *(
            (header, value, "in")
            for header in ("VI", "six", "X", "11")
            for value in ("0.06", "1.5")
        ),
        *(("VI", value, "thou") for value in ("60", "60.0")),
        ("six", "12", "thou"),
    ],
)
def test_a_bare_number_that_could_decide_is_asked_about_under_any_header(header, value, unit):
    names = [name.replace("_in", f"_{unit}") for name in [*ALL, header]]
    text = (
        ",".join(names) + "\n" + ",".join([*GOOD[:4], *["1" if unit == "thou" else "0.001"] * 10])
    )
    result = check(Named(f"{text},{value}\n".encode(), "t.csv"), advice=False)
    assert [each.verdict for each in result.judgements] == [Verdict.INCOMPLETE]


# Under any header a length with its unit.
UNKNOWN = ("プランジャ", "stantuffo", "check", "x", "P")


@pytest.mark.parametrize(
    ("header", "value"),
    [
        *pairs(PLUNGER, ["0.06", "0.06 in", "1.5 mm"]),
        *pairs(JOINTS, ["0.0121", "0.0121 in", "12.1 thou", "0.31"]),
        *pairs(MARGINS, ["0.005", "5 thou", "0.12 mm"]),
        *pairs(UNKNOWN, ["0.06 in", "60 thou", '.06"', "1.5 mm"]),
        ("locking pin", "17"),
    ],
)
def test_a_number_that_may_be_of_plunger_joint_or_margin_is_asked_about(header, value):
    assert judged([header], [value]).verdict is not Verdict.WITHIN_MARGIN


@pytest.mark.parametrize("header", ["Plunger reading 1", "play 6", "rig margin"])
def test_carry_answers_the_question(header: str) -> None:
    asked = judged([header], ["0.0121"])
    assert asked.verdict is Verdict.INCOMPLETE
    assert f'"{header}=carry"' in asked.row.unit_question
    declared = {"column_map": {header: "carry"}}
    assert judged([header], ["0.0121"], **declared).verdict is Verdict.WITHIN_MARGIN


@pytest.mark.parametrize("meaning", ["carry", "work_order"])
@pytest.mark.parametrize(
    ("header", "value", "verdict"),
    [
        ("plunger_displacement_in", "0.06", Verdict.INCOMPLETE),
        ("Outcome", "FAILED", Verdict.INCOMPLETE),
        ("Outcome", "closed", Verdict.WITHIN_MARGIN),
    ],
)
def test_what_bears_the_verdict_is_not_declared_away(header, value, verdict, meaning):
    text = ",".join([*ALL, header]) + "\n" + ",".join([*GOOD, value]) + "\n"
    result = check(Named(text.encode(), "t.csv"), advice=False, column_map={header: meaning})
    said = "is left unread" if meaning == "carry" else f"is read as {meaning}"
    assert [note for note in result.unread if f'"{header}" {said}' in note]
    assert [judgement.verdict for judgement in result.judgements] == [verdict]


@pytest.mark.parametrize(
    ("header", "value"),
    [
        ("limit 6 (in)", "0.0075"),
        ("Limit", "0.0075"),
        ("cycles", "12"),
        ("week 3", "17"),
        ("mod 2", "1"),
        ("OAT", "21.5"),
        ("humidity", "0.45"),
        ("gauge", "0.5 in"),
        ("joint 6 part no", "9"),
        ("plunger s/n", ""),
    ],
)
def test_other_numbers_are_carried(header: str, value: str) -> None:
    assert judged([header], [value]).verdict is Verdict.WITHIN_MARGIN


@crossed(
    header=["Eingefahren?", "Ausfall", "Rentré ?", "Pass", "status", "Locked up", "OK", ""],
    value=["nein", "no", "FALSE", "ja", "non", "OK?", "\u2717"],
)
def test_an_answer_to_an_unknown_question_is_asked_about(header: str, value: str) -> None:
    asked = judged([header], [value])
    assert asked.verdict is Verdict.INCOMPLETE
    name = header or "O"
    assert f'--map "{name}=outcome"' in asked.row.unit_question
    declared = {"column_map": {name: "carry"}}
    assert judged([header], [value], **declared).verdict is Verdict.WITHIN_MARGIN


@pytest.mark.parametrize(
    ("header", "value", "outcome"),
    [
        ("Eingefahren?", "nein", Outcome.FAILED),
        ("Ausfall", "ja", Outcome.FAILED),
        ("Rentré ?", "non", Outcome.FAILED),
        ("Pass", "no", Outcome.FAILED),
        ("Rentré ?", "oui", Outcome.RETRACTED),
        ("Ausfall", "nein", Outcome.RETRACTED),
    ],
)
def test_a_question_that_is_mapped_is_answered(header: str, value: str, outcome: Outcome) -> None:
    text = ",".join([*ALL, header]) + "\n" + ",".join([*GOOD, value]) + "\n"
    options = ReadOptions.of(GEAR, column_map={header: "outcome"})
    (row,) = read_many([Named(text.encode(), "t.csv")], options).rows
    assert isinstance(row, Inspection)
    assert row.outcome is outcome


@pytest.mark.parametrize(
    "word",
    [
        *("NOK", "n.i.O.", "u/s", "unserviceable", "did not lock up", "NG?", "stuck", "échec"),
        *("FAILED 2x", "failed, see WO", "gear did not retract", "retracted: no", "no good"),
        "FAILED - RETRACTED 2nd attempt",
    ],
)
def test_further_words_of_failure_are_asked_about(word: str) -> None:
    assert judged(["status"], [word]).verdict is Verdict.INCOMPLETE


@pytest.mark.parametrize("word", ["RETRACTED?", "OK?", "retracted ?"])
def test_an_outcome_that_is_in_doubt_is_not_taken_as_sure(word: str) -> None:
    assert judged(["outcome"], [word]).verdict is Verdict.INVALID


@pytest.mark.parametrize(
    ("headers", "cells"),
    [
        (["greased"], ["yes"]),
        (["photo taken"], ["yes"]),
        (["status"], ["OK"]),
        (["notes"], ["not failed"]),
        *((["remarks"], [text]) for text in ORDINARY),
        (["VI"], ["60"]),
        (["outcome", "notes"], ["RETRACTED", "bush replaced; no failed part found"]),
        (["outcome", "Locked up"], ["RETRACTED", "yes"]),
    ],
)
def test_other_answers_are_carried(headers: list[str], cells: list[str]) -> None:
    assert judged(headers, cells).verdict is Verdict.WITHIN_MARGIN


@pytest.mark.parametrize(
    "header", ["Margin today (in)", "RV margin", "Margin left", "Spielraum (in)", "allowed travel"]
)
def test_a_margin_under_another_header_is_asked_about(header: str) -> None:
    asked = judged([header], ["0.004"])
    assert asked.verdict is Verdict.INCOMPLETE
    assert "margin" in asked.row.unit_question


@pytest.mark.parametrize(
    ("value", "row", "gap", "joint"),
    [
        *(("0.06", 60, 0, joint) for joint in (False, True)),
        *((60.0, 1, 1, joint) for joint in (False, True)),
        *(("1.5 mm", 60, 2, joint) for joint in (False, True)),
    ],
)
def test_a_number_to_the_right_of_the_headers_is_never_dropped(value, row, gap, joint):
    book = openpyxl.Workbook()
    sheet = book.worksheets[0]
    good = [*GOOD[:4], *[0.001] * 10]
    if joint:
        sheet.append([*ALL[:4], "joint", "clearance_in"])
        lines = [[f"R{n}", *good[1:4], j, 0.001] for n in range(7) for j in range(1, 11)]
    else:
        sheet.append(ALL)
        lines = [[f"R{n}", *good[1:]] for n in range(70)]
    lines[row - 1] += [*[None] * gap, value]
    for line in lines:
        sheet.append(line)
    data = io.BytesIO()
    book.save(data)
    result = check(Named(data.getvalue(), "t.xlsx"), advice=False)
    assert result.exit_code is not ExitCode.FINE
    assert any(j.verdict is not Verdict.WITHIN_MARGIN for j in result.judgements)


def test_a_remark_to_the_right_of_the_headers_travels_to_the_report() -> None:
    book = openpyxl.Workbook()
    for line in (ALL, [*GOOD[:4], *[0.001] * 10, None, "checked by Max"]):
        book.worksheets[0].append(line)
    data = io.BytesIO()
    book.save(data)
    (row,) = read_many([Named(data.getvalue(), "t.xlsx")], ReadOptions.of(GEAR)).rows
    assert isinstance(row, Inspection)
    assert row.carried == {"column P": "checked by Max"}


@pytest.mark.parametrize("title", [[], ["Zeiss Calypso"]])
@pytest.mark.parametrize("carry", [{}, {"Prüfer": "carry"}])
def test_a_header_is_found_by_what_is_mapped(title: list[str], carry: dict[str, str]) -> None:
    names = {"Kennz.": "tail_no", "Seite": "side", "Gelenk": "joint", "Ist": "clearance_mm"}
    lines = [title, [*names, "Prüfer"], ["N1", "LH", "3", "0.33", "Max"]]
    text = "\n".join(",".join(line) for line in lines if line)
    options = ReadOptions.of(GEAR, column_map={**names, **carry}, convention="RADIAL")
    found = read_many([Named(text.encode(), "t.csv")], options)
    assert "header_missing" not in {problem.code for problem in found.problems}
    assert [row.tail_no for row in found.rows] == ["N1"]


def test_a_second_column_of_numbers_in_a_list_of_joints_is_asked_about() -> None:
    header = [*ALL[:4], "joint", "clearance_in", "found"]
    rows = [[*GOOD[:4], str(n), "0.001", "0.0121"] for n in range(1, 11)]
    (row,) = read(header, rows).rows
    assert isinstance(row, Inspection)
    assert '--map "found=' in row.unit_question
