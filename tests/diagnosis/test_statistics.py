"""Numbers of the inference against what statistics and mechanics say of them."""

from __future__ import annotations

from contextlib import nullcontext
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import norm

from mlg_troubleshoot.diagnosis import CATALOGUE, Candidate, Scene, Term
from mlg_troubleshoot.diagnosis.causes.linkage import Block, LoadDirections, OtherGeometry
from mlg_troubleshoot.diagnosis.causes.reading import as_meant
from mlg_troubleshoot.diagnosis.diagnose import _expected_scatter, _interval_of_gain, _single_slips
from mlg_troubleshoot.diagnosis.diagnose import _interval as interval_of
from mlg_troubleshoot.diagnosis.extension import adjustment_of, build_scene
from mlg_troubleshoot.diagnosis.faults import DataFault
from mlg_troubleshoot.diagnosis.noise import EXPECTED_SLOPE, measured_uncertainty, robust_scale
from mlg_troubleshoot.diagnosis.table import DiagnosisTable
from mlg_troubleshoot.errors import InconclusiveDataError
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.gear.linkage import worst_case

from .conftest import fleet

BY_NAME = {cause.name: cause for cause in CATALOGUE}


def test_an_interval_holds_the_middle_95_percent_of_a_normal_distribution() -> None:
    assert interval_of(0.05, 0.01) == pytest.approx(norm.interval(0.95, 0.05, 0.01), abs=1e-4)


def test_a_link_is_shorter_below_the_reference_pressure_for_a_positive_stretch(scene):
    cause = BY_NAME["elastic_compliance"]
    candidate = next(iter(cause.candidates(scene)))
    (change,) = cause.adjust(scene, candidate, 1e-6).changed.values()
    pressure = scene.table.quantities["hydraulic_pressure_psi"]
    assert np.all(np.sign(change) == np.sign(pressure - 3000.0))


def test_two_causes_that_scale_one_length_multiply(gear: Gear, scene: Scene) -> None:
    growth = Candidate(BY_NAME["thermal_growth"])
    terms = [Term(growth, value, (0.0, 1.0)) for value in (1e-5, 3e-5)]
    scaled = adjustment_of(
        terms, gear.model, scene.table, scene.clearance_in, gear.discrepancies
    ).scaled
    warmer = scene.table.quantities["temperature_c"] - 20.0
    assert next(iter(scaled.values())) == pytest.approx(
        (1.0 + 1e-5 * warmer) * (1.0 + 3e-5 * warmer), rel=1e-12
    )


def test_a_healthy_fleet_reads_less_than_the_bound_by_what_pins_scatter() -> None:
    angles = np.radians(np.random.default_rng(3).normal(0.0, 6.0, 100_000))
    assert pytest.approx(float(np.mean(np.cos(angles))) - 1.0, abs=0.002) == EXPECTED_SLOPE


def test_the_robust_scale_is_the_standard_deviation_of_a_normal_distribution() -> None:
    values = 0.7 * np.random.default_rng(1).standard_normal(20_000)
    values[:200] += 50.0
    assert robust_scale(values) == pytest.approx(0.7, rel=0.04)


def test_the_mean_of_four_readings_is_twice_as_certain_as_one(plain: DiagnosisTable) -> None:
    readings = 0.001 * np.random.default_rng(1).standard_normal((len(plain), 4))
    assert measured_uncertainty(replace(plain, readings_in=readings)) == pytest.approx(
        0.0005, rel=0.1
    )


def test_gauges_alone_leave_what_their_errors_do_through_the_mechanism(gear, plain):
    rng, n = np.random.default_rng(1), 4000
    clearance = np.tile(plain.clearance_in[0], (n, 1))
    moved = worst_case(
        gear.model, clearance + 0.0003 * rng.standard_normal(clearance.shape)
    ).over_in
    table = replace(
        plain, gauge_u_in=np.full(len(plain), 0.0003), readings_in=plain.readings_in[:, :1]
    )
    found = _expected_scatter(
        gear.model, replace(table, plunger_gauge_u_in=np.full(len(plain), 0.002)), 0.002
    )
    assert found == pytest.approx(np.hypot(np.std(moved), 0.002), rel=0.05)


def test_the_share_removed_has_an_interval_of_95_percent_over_tails() -> None:
    rng, tails = np.random.default_rng(1), np.arange(400)
    before = rng.lognormal(0.0, 0.3, 400)
    after = before * rng.uniform(0.2, 0.6, 400)
    share = np.sum(after**2) / np.sum(before**2)
    error = float(np.std(after**2 - share * before**2) / np.sqrt(400) / np.mean(before**2))
    low, high = _interval_of_gain(before, after, tails)
    assert (low, high) == pytest.approx(norm.interval(0.95, 1.0 - share, error), abs=0.3 * error)


@pytest.mark.parametrize(
    ("k", "mean", "variance"),
    [(0, 0.9092, 0.0151), (1, 0.7346, 0.1063), (2, 0.2912, 0.4187), (3, 0.0, 0.5)],
)
def test_directions_have_the_mean_and_variance_of_the_cosine_of_their_angles(
    gear, k, mean, variance
):
    # exp(-s^2/2) and (1 - exp(-s^2))^2 / 2 for normal angles of s = 25 and 45 degrees; 0 and 1/2
    # all around.
    scene, _rows = build_scene(gear.model, fleet(gear.model), gear.discrepancies)
    covariance = [*LoadDirections().blocks(scene, ())][k].covariance
    assert covariance[0, 0] == pytest.approx((1.0 - mean) ** 2 + variance, abs=1e-3)
    assert covariance[0, 1] == pytest.approx((1.0 - mean) ** 2, abs=1e-3)


def test_factors_of_all_joints_have_intervals_of_95_percent() -> None:
    block = Block(None, 0.0, np.ones((4, 2)), cause=OtherGeometry(), joints=(3, 5))
    setting = block.candidate(np.array([0.1, -0.2]), np.diag([0.04, 0.01])).setting
    for joint, middle, error in (("3", 1.1, 0.2), ("5", 0.8, 0.1)):
        found = setting["low"][joint], setting["high"][joint]
        assert found == pytest.approx(norm.interval(0.95, middle, error), abs=1e-3)


def test_two_changes_of_the_calibration_rate_multiply(gear: Gear, scene: Scene) -> None:
    terms = [
        Term(Candidate(BY_NAME["calibration_rate"]), value, (0.0, 1.0)) for value in (0.1, 0.2)
    ]
    found = adjustment_of(
        terms, gear.model, scene.table, scene.clearance_in, gear.discrepancies
    ).rate_factor
    assert found == pytest.approx(np.full(len(scene.table), 1.1 * 1.2))


def test_directions_of_two_extensions_multiply(gear: Gear, scene: Scene) -> None:
    parts = [{"factors": {"3": 0.5, "5": -0.4}}, {"factors": {"3": 0.6, "4": 0.2}}]
    terms = [Term(Candidate(LoadDirections(), None, setting), 1.0, (0.0, 1.0)) for setting in parts]
    found = adjustment_of(
        terms, gear.model, scene.table, scene.clearance_in, gear.discrepancies
    ).direction_factors
    assert found is not None
    assert found[[2, 3, 4]] == pytest.approx([0.3, 0.2, -0.4])


def test_what_is_written_twice_as_large_has_twice_the_error(plain: DiagnosisTable) -> None:
    rows = plain.factors["technician_id"] == "T-2"
    meant = as_meant(plain, {"column": "technician_id", "value": "T-2", "written_factor": 2.0})
    assert meant.gauge_u_in == pytest.approx(np.where(rows, 0.5, 1.0) * plain.gauge_u_in)
    assert meant.clearance_in[rows] == pytest.approx(0.5 * plain.clearance_in[rows])


@pytest.mark.parametrize(("wrong", "refused"), [(15, False), (30, True)])
def test_a_table_of_which_a_third_looks_wrong_has_no_slips_of_the_pen(wrong, refused):
    faults = tuple(
        DataFault(k, k, f"R{k}", "clearance_3_in", "mm_as_in", "0.1", "0.004") for k in range(wrong)
    )
    with pytest.raises(InconclusiveDataError) if refused else nullcontext() as told:
        _single_slips(faults, 100)
    assert not refused or "(rows 0, 1, 2, 3, 4, 5, 6, 7 and 22 more)" in str(told.value)


def test_a_reading_that_is_too_large_by_chance_predicts_too_much(gear, plain):
    clearance = plain.clearance_in.copy()
    clearance[5, 2] += 0.002
    table = replace(plain, clearance_in=clearance, gauge_u_in=np.full(len(plain), 0.001))
    _scene, found = build_scene(gear.model, table, gear.discrepancies)
    assert found.drawn_in[5] > 0.0003
