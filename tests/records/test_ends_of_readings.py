"""Readings of which only an end was found: the end is counted on the safe side, and said."""

from __future__ import annotations

from pathlib import Path

import pandas as pd
import pytest

from mlg_troubleshoot.decision.inspection import Inspection
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.records import ReadOptions, ReadResult, read_many
from mlg_troubleshoot.store.inspections import inspection_from, inspection_record
from mlg_troubleshoot.units import ClearanceConvention
from tests.cli.conftest import mlg


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
    assert any("joint 3: 0.016in is 0.016 in" in w for w in inspection(gear, "0.016in").warnings)


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
