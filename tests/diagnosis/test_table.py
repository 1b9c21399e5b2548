"""Inspections become columns by name; what is missing stays missing."""

from __future__ import annotations

from datetime import date

import numpy as np
import pytest

from mlg_troubleshoot.decision.inspection import Approach, Inspection, Side
from mlg_troubleshoot.diagnosis import DiagnosisTable, table_from_inspections
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.units import ClearanceConvention


def table(gear: Gear, **second: object) -> DiagnosisTable:
    """Two inspections; the second one with what is given."""
    bare = {"tail_no": "007", "side": Side.LH, "convention": ClearanceConvention.RADIAL}
    one = Inspection(record_id="R1", clearance_in={3: 0.004}, **bare)
    two = Inspection(record_id="R2", **{"clearance_in": {}, **bare, **second})
    return table_from_inspections([one, two], gear)


def test_a_joint_that_was_not_measured_is_not_a_number(gear: Gear) -> None:
    found = table(gear).clearance_in
    assert found[0, 2] == 0.004
    assert np.isnan(found).sum() == 19


def test_a_column_that_only_one_inspection_has_is_there_with_gaps(gear: Gear) -> None:
    assert set(table(gear).columns) == {"tail_no", "side"}
    found = table(gear, temperature_c=-5.0, gauge_id="G-1")
    assert found.quantities["temperature_c"].tolist() == pytest.approx([np.nan, -5.0], nan_ok=True)
    assert found.factors["gauge_id"].tolist() == ["", "G-1"]


def test_the_measured_value_is_the_mean_of_the_readings_if_there_are_any(gear: Gear) -> None:
    found = table(gear, readings_in=(0.010, 0.014)).measured_in
    assert found.tolist() == pytest.approx([np.nan, 0.012], nan_ok=True)


def test_a_gear_is_a_side_of_a_tail_which_stays_text(gear: Gear) -> None:
    found = table(gear, side=Side.RH)
    assert found.tails.tolist() == ["007", "007"]
    assert found.gears.tolist() == ["007 LH", "007 RH"]


def test_days_are_counted_from_the_first_date(gear: Gear) -> None:
    found = table(gear, inspection_date=date(2024, 2, 29))
    assert (found.first_day, found.quantities["day"][1]) == ("2024-02-29", 0.0)


def test_the_margin_of_the_gear_file_stands_in_where_none_was_found(gear: Gear) -> None:
    assert table(gear, margin_in=0.026).margin_in.tolist() == [gear.margin.value, 0.026]


def test_taking_rows_takes_them_in_every_column(gear: Gear) -> None:
    full = table(gear, approach=Approach.EXTENDING, temperature_c=1.0, axial_float_in={4: 0.01})
    taken = full.take([1])
    assert taken.record_id == ("R2",)
    assert taken.factors["approach"].tolist() == ["EXTENDING"]
    assert taken.quantities["temperature_c"].tolist() == [1.0]
    assert taken.axial_float_in is not None
    assert taken.axial_float_in[0, 3] == 0.01
