"""Numbers of the inference against what statistics and mechanics say of them."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from scipy.stats import norm

from mlg_troubleshoot.diagnosis import CATALOGUE, Candidate, Scene, Term
from mlg_troubleshoot.diagnosis.diagnose import _cause
from mlg_troubleshoot.diagnosis.extension import adjustment_of
from mlg_troubleshoot.diagnosis.inference import RULED_OUT, Inference
from mlg_troubleshoot.diagnosis.noise import EXPECTED_SLOPE
from mlg_troubleshoot.gear.gear import Gear

BY_NAME = {cause.name: cause for cause in CATALOGUE}


def test_an_interval_holds_the_middle_95_percent_of_a_normal_distribution() -> None:
    found = _cause(Candidate(BY_NAME["calibration_rate"]), np.ones(3), 0.001, 0.05, 0.01)
    assert found.interval == pytest.approx(norm.interval(0.95, 0.05, 0.01), abs=1e-4)


def test_a_link_is_shorter_below_the_reference_pressure_for_a_positive_stretch(scene: Scene) -> None:
    cause = BY_NAME["elastic_compliance"]
    candidate = next(iter(cause.candidates(scene)))
    (change,) = cause.adjust(scene, candidate, 1e-6).changed.values()
    pressure = scene.table.quantities["hydraulic_pressure_psi"]
    assert np.all(np.sign(change) == np.sign(pressure - 3000.0))


def test_two_causes_that_scale_one_length_multiply(gear: Gear, scene: Scene) -> None:
    growth = Candidate(BY_NAME["thermal_growth"])
    terms = [Term(growth, value, (0.0, 1.0)) for value in (1e-5, 3e-5)]
    scaled = adjustment_of(terms, gear.model, scene.table, scene.clearance_in, gear.discrepancies).scaled
    warmer = scene.table.quantities["temperature_c"] - 20.0
    assert next(iter(scaled.values())) == pytest.approx((1.0 + 1e-5 * warmer) * (1.0 + 3e-5 * warmer), rel=1e-12)


def test_a_healthy_fleet_reads_less_than_the_bound_by_what_pins_scatter() -> None:
    angles = np.radians(np.random.default_rng(3).normal(0.0, 6.0, 100_000))
    assert pytest.approx(float(np.mean(np.cos(angles))) - 1.0, abs=0.002) == EXPECTED_SLOPE


def test_the_smallest_effect_would_be_found_four_times_in_five() -> None:
    # An estimate of a size of t standard errors exceeds the bar, here 0, four times in five if t is this quantile.
    bare = cast(Any, SimpleNamespace(penalty=np.zeros(3), misfit=np.zeros(100)))
    assert Inference._smallest(bare, np.zeros(50), 1.0) * 10.0 == pytest.approx(float(norm.ppf(0.8)), abs=0.005)


def test_a_rival_is_ruled_out_only_at_odds_of_ten_to_one() -> None:
    assert np.exp(RULED_OUT) > 10.0
