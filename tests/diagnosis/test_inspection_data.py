"""The shipped diagnosis data sets are what their description says, and its commands print what it
shows.
"""

from __future__ import annotations

import csv
import re
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from mlg_troubleshoot.diagnosis import CATALOGUE, Diagnosis
from mlg_troubleshoot.misfit.beliefs import Beliefs
from mlg_troubleshoot.workflows.diagnose import DiagnoseOptions, diagnose_files

from ..hidden_effect import data_sets

ROOT = Path(__file__).parents[2]
FOLDER = ROOT / "inspection_data"
PUZZLE = (ROOT / "docs/tutorial/diagnosis.md").read_text(encoding="utf-8")
SOLUTION = (ROOT / "docs/tutorial/diagnosis-solution.md").read_text(encoding="utf-8")
OWN_CAUSE = (ROOT / "docs/how-to/own-cause.md").read_text(encoding="utf-8")
FILES = sorted(file.name for file in FOLDER.glob("measured_*.csv"))


@cache
def diagnosis(name: str, *causes: str) -> Diagnosis:
    files = tuple(FOLDER / cause for cause in causes)
    return diagnose_files([FOLDER / name], DiagnoseOptions(cause_files=files)).diagnosis


def test_the_puzzle_does_not_give_the_answer_away() -> None:
    assert not re.search(
        r"stretch|grease|seed|hidden", PUZZLE.replace("measured_frozen_grease", "")
    )


def test_the_p_value_of_the_residual_tells_an_effect_on_no_list_from_noise() -> None:
    assert diagnosis("measured_frozen_grease.csv").remainder_p < 0.001
    assert diagnosis("measured_nothing_wrong.csv").remainder_p > 0.1


def test_the_odds_of_a_name_are_what_is_expected_times_what_the_rows_say_of_it() -> None:
    found = diagnosis("measured_pressure.csv")
    (named,), first = found.causes, found.weighed[0]
    assert (first.cause, first.target) == named.candidate.key
    # The share of sets with slips of single rows is nearly that of nothing with the same slips.
    odds = np.log(named.probability / found.p_nothing)
    assert np.log(first.beforehand) + first.evidence == pytest.approx(odds, abs=0.5)


def test_every_cause_that_may_act_is_expected_as_often_as_any_other() -> None:
    expected: dict[str, float] = {}
    for own in diagnosis("measured_pressure.csv").weighed:
        expected[own.cause] = expected.get(own.cause, 0.0) + own.beforehand
    # Of the aircraft that a modification may be of only the likeliest are offered.
    share = Beliefs().expected * (1.0 - Beliefs().unlisted) / len(CATALOGUE)
    listed = {name: p for name, p in expected.items() if name not in {"unlisted", "modification"}}
    assert len(listed) > 15
    assert listed == pytest.approx(dict.fromkeys(listed, share))


def test_the_command_makes_the_data_sets_again_byte_for_byte(tmp_path: Path) -> None:
    assert data_sets.main([str(tmp_path)]) == 0
    assert {f.name: f.read_bytes() for f in tmp_path.iterdir()} == {
        n: (FOLDER / n).read_bytes() for n in FILES
    }


def test_the_seeds_in_the_description_are_those_of_the_command() -> None:
    said = {
        name: int(seed)
        for name, seed in re.findall(r"\| `(measured_\w+)\.csv` \|.*\| (\d+) \|", SOLUTION)
    }
    made = {name: seed for name, (_spec, seed) in data_sets.DATA_SETS.items()}
    later = {
        f"{name}_later": made[name] + 1000 for name in ("measured_pressure", "measured_far_below")
    }
    assert said == {**made, **later}


@pytest.mark.parametrize(
    ("file", "causes", "verdict", "named"),
    [
        ("measured_pressure", (), "NAMED", [("elastic_compliance", None)]),
        ("measured_pin_direction", (), "NAMED", [("direction_not_worst_case", "joint 3")]),
        ("measured_frozen_grease", (), "UNLISTED", []),
        ("measured_nothing_wrong", (), "NONE", []),
        ("measured_frozen_grease", ("own_cause.py",), "NAMED", [("frozen_grease", None)]),
    ],
)
def test_what_is_hidden_is_named_and_nothing_else(file, causes, verdict, named):
    found = diagnosis(f"{file}.csv", *causes)
    assert found.verdict == verdict
    assert [c.candidate.key for c in found.causes] == named
    assert found.unlisted_variables == (("temperature_c",) if verdict == "UNLISTED" else ())


@pytest.mark.slow
@pytest.mark.parametrize("name", ["pressure", "pin_direction", "nothing_wrong"])
def test_a_cause_of_ones_own_is_not_named_for_another(name: str) -> None:
    alone, beside = (diagnosis(f"measured_{name}.csv", *own) for own in ((), ("own_cause.py",)))
    assert [c.candidate.key for c in beside.causes] == [c.candidate.key for c in alone.causes]


def test_nothing_wrong_has_no_fault() -> None:
    assert diagnosis("measured_nothing_wrong.csv").faults == ()


def test_the_row_in_millimetres_is_found() -> None:
    faults = {(f.record_id, f.kind) for f in diagnosis("measured_pressure.csv").faults}
    assert ("R0097", "mm_as_in") in faults
    assert {record for record, _kind in faults} <= {"R0097", "R0190"}


@pytest.mark.slow
def test_the_directions_under_load_are_named_and_take_back_most_false_outside() -> None:
    found = diagnosis("measured_far_below.csv")
    assert [c.candidate.cause.name for c in found.causes] == ["load_directions"]
    assert found.gain is not None
    assert found.gain.false_outside_before > 100
    assert found.gain.false_within_after + found.gain.false_outside_after <= 5


def test_the_number_of_a_cause_of_one_s_own_comes_out_right() -> None:
    (cause,) = diagnosis("measured_frozen_grease.csv", "own_cause.py").causes
    assert cause.interval[0] < -data_sets.DRAG_IN_PER_C < cause.interval[1]


def test_the_example_of_a_cause_stands_in_the_story_as_it_is() -> None:
    assert (FOLDER / "own_cause.py").read_text(encoding="utf-8").rstrip() in OWN_CAUSE


def in_millimetres_across(source: Path, to: Path) -> Path:
    """The same inspections with clearances in millimetres as bore less pin."""
    with source.open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    joints = range(1, 11)
    for row in rows:
        for n in joints:
            inches = row.pop(f"clearance_{n}_in")
            row[f"clearance_{n}_mm"] = f"{float(inches) * 50.8:.4f}" if inches else ""
        row["clearance_convention"] = "DIAMETRAL"
    with to.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, fieldnames=list(rows[0]))
        writer.writeheader()
        writer.writerows(rows)
    return to


def test_a_fault_is_shown_in_the_unit_and_the_convention_of_its_cell(tmp_path: Path) -> None:
    file = in_millimetres_across(FOLDER / "measured_pressure.csv", tmp_path / "across.csv")
    found = diagnose_files([file], DiagnoseOptions()).diagnosis.faults
    swapped = {(f.column, f.value, f.suggested) for f in found if f.kind == "swapped_joints"}
    assert swapped == {
        ("clearance_2_mm", "0.7620", "0.0762"),
        ("clearance_6_mm", "0.0762", "0.762"),
    }


def test_a_joint_that_nobody_measured_is_said(tmp_path: Path) -> None:
    with (FOLDER / "measured_nothing_wrong.csv").open(newline="", encoding="utf-8") as source:
        rows = [{**row, "clearance_9_in": ""} for row in csv.DictReader(source)]
    file = tmp_path / "t.csv"
    with file.open("w", newline="", encoding="utf-8") as out:
        writer = csv.DictWriter(out, fieldnames=list(rows[0]))
        writer.writeheader()
        writer.writerows(rows)
    notes = diagnose_files([file], DiagnoseOptions()).notes
    assert any(note.startswith("not measured in any row: #9") for note in notes)
