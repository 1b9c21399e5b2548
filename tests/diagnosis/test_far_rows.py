"""Rows that lie far out: an effect that moves them together is named, and a single one is said."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mlg_troubleshoot.diagnosis import Diagnosis, diagnose
from mlg_troubleshoot.diagnosis.faults import DataFault
from mlg_troubleshoot.diagnosis.table import DiagnosisTable
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.misfit.beliefs import Beliefs
from mlg_troubleshoot.reporting.diagnosis_figures import headline, seven_lines
from mlg_troubleshoot.units import LengthUnit

from .conftest import Array, Shift, fleet

FAR_IN = 0.02
LATEST = (63, 83, 103)


def off(*places: int) -> Shift:
    """Some rows read far too much."""

    def shift(table: DiagnosisTable, _over: Array) -> Array:
        return FAR_IN * np.isin(np.arange(len(table)), places)

    return shift


def found(gear: Gear, *places: int) -> Diagnosis:
    table = fleet(gear.model, off(*places))
    return diagnose(gear.model, table, gear.discrepancies)


@pytest.fixture(scope="module")
def one(gear: Gear) -> Diagnosis:
    """A fleet with one row far out."""
    return found(gear, 70)


def test_a_gear_that_was_rerigged_far_off_is_named_after_three_visits(gear: Gear) -> None:
    (cause,) = found(gear, *LATEST).causes
    assert cause.candidate.key == ("rigging_offset", "tail N103")
    assert cause.candidate.target == "tail N103 LH"


@pytest.mark.slow
def test_what_a_cause_explains_is_not_far_off(gear: Gear) -> None:
    assert not found(gear, *LATEST).far_off_in


def test_as_many_rows_of_other_gears_are_no_cause(gear: Gear) -> None:
    assert found(gear, 71, 94, 115).verdict == "NONE"


def test_a_row_far_off_that_nothing_explains_is_named(one: Diagnosis) -> None:
    ((place, left),) = one.far_off_in.items()
    assert (one.used.record_id[place], left) == ("R71", pytest.approx(FAR_IN, abs=0.004))


def test_a_row_that_stays_far_off_as_it_was_repaired_says_so(one: Diagnosis) -> None:
    (place,) = one.far_off_in
    fault = DataFault.at(one.used, place, "plunger_displacement_in", "mm_as_in", "1.4", "0.0551")
    assert "thou as repaired)" in seven_lines(replace(one, faults=(fault,)))[5].text


@pytest.mark.parametrize("line", [6, 7])
def test_what_to_do_about_it_stands_beside_it(one: Diagnosis, line: int) -> None:
    said = seven_lines(one)[line - 1].text
    assert {6: "unexplained: R71 (N100", 7: "check the rigging of that gear"}[line] in said


def test_paper_says_it_with_the_verdict(one: Diagnosis) -> None:
    assert "unexplained: R71 (N100" in headline(one, LengthUnit.THOU)


def test_a_fleet_with_nothing_wrong_has_no_row_far_off(gear: Gear, plain: DiagnosisTable) -> None:
    assert not diagnose(gear.model, plain, gear.discrepancies).far_off_in


def test_the_further_out_a_row_the_likelier_it_is_an_error() -> None:
    odds = Beliefs().slip_odds(np.array([0.0, 3.5, 4.5, 9.0]))
    assert (np.diff(odds) > 0.0).all()


def test_the_more_rows_lie_far_out_the_likelier_each_is_an_error() -> None:
    few = Beliefs().slip_odds(np.array([9.0] + 99 * [0.0]))[0]
    many = Beliefs().slip_odds(np.array(5 * [9.0] + 95 * [0.0]))[0]
    assert many - few == pytest.approx(np.log(5.5 / 1.5))
