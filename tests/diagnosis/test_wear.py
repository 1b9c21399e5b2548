"""Inspections become columns by name; what to expect of a joint from the history of its gear."""

from __future__ import annotations

from dataclasses import dataclass, replace
from datetime import date

import numpy as np
import pytest

from mlg_troubleshoot.decision.inspection import Approach, Inspection, Side
from mlg_troubleshoot.diagnosis import DiagnosisTable, table_from_inspections
from mlg_troubleshoot.diagnosis.wear import (
    WearHistory,
    _lines,
    _variance,
    landings_of,
    likely_clearances,
    wear_history,
)
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.units import ClearanceConvention

from .conftest import Array

DECLARED_IN = 0.0005


@dataclass(frozen=True)
class Worn:
    """One joint of 40 gears, six inspections each, worn in proportion to landings."""

    gears: np.ndarray[tuple[int], np.dtype[np.intp]]
    kilo: Array
    true_in: Array
    read_in: Array

    def history(self, read_in: Array | None = None) -> WearHistory:
        """Expect the joint from its readings, declared as uncertain by 0.5 thou each."""
        readings = self.read_in if read_in is None else read_in
        return wear_history(
            readings, self.gears, self.kilo, np.full(len(self.gears), DECLARED_IN**2)
        )


def worn(error_in: float, scatter: float = 0.0) -> Worn:
    """Draw the gears; readings have this error, wear scatters about its line by this share."""
    rng = np.random.default_rng(3)
    gears = np.repeat(np.arange(40), 6)
    kilo = np.repeat(rng.uniform(0.1, 2.0, 40), 6) + np.tile(np.arange(6) * 0.25, 40)
    rate = rng.lognormal(np.log(0.0012), 0.5, 40)
    line = 0.0008 + rate[gears] * kilo
    true_in = line * (1.0 + rng.normal(0.0, scatter, len(gears)))
    return Worn(gears, kilo, true_in, true_in + rng.normal(0.0, error_in, len(gears)))


def rms(values: Array) -> float:
    """Root mean square."""
    return float(np.sqrt(np.mean(values**2)))


def test_what_is_expected_lies_nearer_the_truth_than_the_readings_do() -> None:
    gear = worn(0.0003)
    assert rms(gear.history().expected_in - gear.true_in) < 0.7 * rms(gear.read_in - gear.true_in)


@pytest.mark.parametrize("error_in", [0.0002, DECLARED_IN, 2.0 * DECLARED_IN])
def test_readings_better_than_declared_are_recognised_and_never_taken_to_be_worse(error_in):
    taken = np.sqrt(worn(error_in).history().reading_in2).max()
    assert taken == pytest.approx(min(error_in, DECLARED_IN), rel=0.25)


def test_scatter_of_wear_about_its_line_is_told_from_errors_of_reading() -> None:
    gear = worn(0.0001, scatter=0.3)
    assert rms(np.sqrt(gear.history().scatter_in2)) == pytest.approx(
        0.3 * rms(gear.true_in), rel=0.25
    )


def test_a_joint_that_was_not_read_is_expected_from_its_gear_s_other_inspections() -> None:
    gear = worn(0.0002)
    gaps = gear.read_in.copy()
    gaps[2::6] = np.nan
    assert rms((gear.history(gaps).expected_in - gear.true_in)[2::6]) < 0.0002


def test_a_gear_that_was_never_read_is_expected_to_wear_like_the_fleet() -> None:
    gear = worn(0.0002)
    gaps = np.where(gear.gears == 7, np.nan, gear.read_in)
    found = gear.history(gaps).expected_in[gear.gears == 7]
    assert found[-1] - found[0] == pytest.approx(0.0012 * 1.13 * 1.25, rel=0.3)


def test_one_slip_hardly_moves_the_line_of_its_gear() -> None:
    gear = worn(0.0002)
    slipped = gear.read_in.copy()
    slipped[62] *= 25.4
    assert abs(gear.history(slipped).expected_in[60] - gear.history().expected_in[60]) < 0.001


def test_exact_readings_are_kept() -> None:
    gear = worn(0.0, scatter=0.3)
    exact = wear_history(gear.read_in, gear.gears, gear.kilo, np.zeros(len(gear.gears)))
    assert np.all(exact.reading_in2 == 0.0)


def test_landings_that_are_missing_are_those_of_the_gear_on_average_and_teach_nothing() -> None:
    kilo, known = landings_of(np.array([1000.0, np.nan, 3000.0, 500.0]), np.array([0, 0, 0, 1]))
    assert (kilo[1], known.tolist()) == (2.0, [True, False, True, True])
    # Without any landings every row tells its gear's level.
    assert landings_of(np.full(2, np.nan), np.array([0, 0]))[1].all()


def test_a_joint_that_is_tight_everywhere_stays_so() -> None:
    gear = worn(0.0)
    assert np.all(np.abs(gear.history(np.zeros(len(gear.gears))).expected_in) < 1e-6)


def test_one_reading_alone_is_its_own_expectation() -> None:
    alone = wear_history(
        np.array([0.002, np.nan]),
        np.array([0, 1]),
        np.array([1.0, 2.0]),
        np.full(2, DECLARED_IN**2),
    )
    assert alone.expected_in == pytest.approx([0.002, 0.002])


def test_a_gear_s_line_is_that_of_a_linear_mixed_model() -> None:
    rng = np.random.default_rng(2)
    gears, x = np.repeat(np.arange(3), [1, 4, 6]), rng.uniform(0.2, 2.0, (11, 1))
    y, weight = rng.normal(1.0, 0.3, (11, 1)), rng.uniform(5.0, 20.0, (11, 1))
    fleet, spread = np.array([[0.6], [0.4]]), np.array([[0.05], [-0.02], [0.03]])
    of_gears = (np.arange(3)[:, None] == gears).astype(float)
    lines, unsure = _lines(of_gears.__matmul__, x, y, weight, fleet, spread)
    prior = np.linalg.inv(np.array([[0.05, -0.02], [-0.02, 0.03]]))
    for gear in range(3):
        own = gears == gear
        shape = np.column_stack([np.ones(own.sum()), x[own, 0]])
        covariance = np.linalg.inv(prior + shape.T @ (weight[own] * shape))
        values = covariance @ (prior @ fleet[:, 0] + shape.T @ (weight[own] * y[own])[:, 0])
        assert lines[:, gear, 0] == pytest.approx(values)
        variance = _variance(unsure, np.full(own.sum(), gear), x[own])[:, 0]
        assert variance == pytest.approx(np.sum(shape @ covariance * shape, axis=1))


def test_a_reading_is_overruled_by_two_of_its_standard_errors_at_most(plain):
    written = plain.clearance_in.copy()
    written[5, 2] = 0.02
    table = replace(plain, clearance_in=written, gauge_u_in=np.full(len(plain), 0.0005))
    assert 0.02 - 0.0011 < likely_clearances(table).likely_in[5, 2] < 0.02


def fleet_of(plain: DiagnosisTable, together: float, apart: float) -> tuple[DiagnosisTable, Array]:
    """A fleet that reads all joints but the last, and its clearances; gears and their joints wear
    apart by these.
    """
    rng, (gears, rows) = np.random.default_rng(4), np.unique(plain.gears, return_inverse=True)
    hard = rng.lognormal(0.0, together, (len(gears), 1)) * rng.lognormal(
        0.0, apart, (len(gears), 10)
    )
    true_in = (0.0006 + 0.0012 * plain.quantities["gear_landings"][:, None] / 1000.0) * hard[rows]
    read = true_in.copy()
    read[:, 9] = np.nan
    return replace(plain, clearance_in=read), true_in


def test_an_unread_joint_follows_the_others_of_its_gear_as_far_as_joints_wear_together(plain):
    for together, apart, least, most in ((0.4, 0.1, 0.8, 1.2), (0.0, 0.4, -0.2, 0.6)):
        table, true_in = fleet_of(plain, together, apart)
        others = np.log(
            true_in[:, :9].mean(axis=1)
            / (0.0006 + 0.0012 * table.quantities["gear_landings"] / 1000.0)
        )
        filled = np.log(
            likely_clearances(table).likely_in[:, 9] / table.quantities["gear_landings"]
        )
        shape = np.column_stack(
            [np.ones(len(others)), others, 1.0 / table.quantities["gear_landings"]]
        )
        assert least < np.linalg.lstsq(shape, filled, rcond=None)[0][1] < most


def test_an_unread_joint_of_a_row_without_landings_is_as_worn_as_the_row_s_other_joints(plain):
    table, true_in = fleet_of(plain, 0.3, 0.05)
    latest = int(np.argmax(table.quantities["gear_landings"]))
    gap = table.quantities["gear_landings"].copy()
    gap[latest] = np.nan
    likely = likely_clearances(
        replace(table, quantities={**table.quantities, "gear_landings": gap})
    ).likely_in
    assert likely[latest, 9] == pytest.approx(true_in[latest, 9], rel=0.25)


def test_a_gear_of_new_joints_does_not_make_unread_joints_scatter_more(plain):
    scatter = np.exp(np.random.default_rng(5).normal(0.0, 0.2, plain.clearance_in.shape))
    clearance = plain.clearance_in * scatter
    clearance[:, 9] = np.nan
    new = (plain.factors["tail_no"] == "N103") & (plain.factors["side"] == "LH")
    with_new = replace(plain, clearance_in=np.where(new[:, None], clearance * 0.001, clearance))
    usual = likely_clearances(replace(plain, clearance_in=clearance))
    found = likely_clearances(with_new)
    assert found.u_row_in[~new, 9] == pytest.approx(usual.u_row_in[~new, 9], rel=0.3)


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
