"""The gain is measured on rows that the fit never saw, tail by tail."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

from mlg_troubleshoot.diagnosis import Diagnosis, diagnose
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.misfit import columns as fitting

from .conftest import Array, DiagnosisTable, fleet


def biased_gauge(table: DiagnosisTable, _over: Array) -> Array:
    return np.where(table.factors["gauge_id"] == "G-2", 0.006, 0.0)


def rigged_tail(table: DiagnosisTable, _over: Array) -> Array:
    return np.where(table.factors["tail_no"] == "N103", 0.012, 0.0)


@pytest.fixture(scope="module")
def table(gear: Gear) -> DiagnosisTable:
    """A fleet with one gauge that reads 6 thou more."""
    return fleet(gear.model, biased_gauge)


@pytest.fixture(scope="module")
def found(gear: Gear, table: DiagnosisTable) -> Diagnosis:
    """What the diagnosis says of it."""
    return diagnose(gear.model, table, gear.discrepancies)


@pytest.fixture
def fitted_tails(monkeypatch: pytest.MonkeyPatch) -> Iterator[list[int]]:
    """Numbers of rows that each fit of the cross-validation saw."""
    seen: list[int] = []

    def watched(noise: object, columns: Array, data: Array) -> object:
        seen.append(len(data))
        return real(noise, columns, data)

    real = fitting.fit
    monkeypatch.setattr(fitting, "fit", watched)
    yield seen


def test_the_cause_is_named_with_its_number_in_its_interval(found: Diagnosis) -> None:
    (cause,) = found.causes
    assert (cause.candidate.cause.name, cause.candidate.target) == ("gauge_bias", "gauge G-2")
    assert cause.value == pytest.approx(0.006, abs=0.001)
    assert cause.interval[0] < 0.006 < cause.interval[1]


def test_the_misfit_of_held_out_tails_falls_by_a_share_above_zero(found: Diagnosis) -> None:
    assert found.gain is not None
    assert found.gain.held_out_by == "tail"
    assert found.gain.rms_after_in < 0.6 * found.gain.rms_before_in
    low, high = found.gain.share_interval
    assert 0.0 < low < high < 1.0


def test_rows_of_one_tail_are_held_out_together(gear, table, fitted_tails):
    diagnose(gear.model, table, gear.discrepancies)
    # Ten tails of twelve rows: each fit leaves out whole tails.
    assert fitted_tails
    assert {(len(table) - rows) % 12 for rows in fitted_tails} == {0}
    assert min(len(table) - rows for rows in fitted_tails) == 12


def test_a_cause_of_one_aircraft_is_held_out_row_by_row(gear: Gear) -> None:
    rigged = diagnose(gear.model, fleet(gear.model, rigged_tail), gear.discrepancies)
    assert [c.candidate.cause.name for c in rigged.causes] == ["rigging_offset"]
    assert rigged.gain is not None
    assert rigged.gain.held_out_by == "row"


def test_decisions_are_counted_against_what_was_measured(found: Diagnosis) -> None:
    assert found.gain is not None
    outside = np.abs(found.used.measured_in) > found.used.margin_in
    said_within = np.abs(found.predicted_in) <= found.used.margin_in
    assert found.gain.false_within_before == np.sum(said_within & outside)
    assert found.gain.false_outside_before == np.sum(~said_within & ~outside)


@pytest.fixture(scope="module")
def nothing(gear: Gear, plain: DiagnosisTable) -> Diagnosis:
    return diagnose(gear.model, plain, gear.discrepancies)


def test_wrong_verdicts_of_a_model_that_stays_are_counted_by_their_sense(nothing):
    # Every row is measured beyond its margin and predicted within it.
    margin, none = np.full(len(nothing.predicted_in), 1e-9), np.zeros_like(nothing.predicted_in)
    kept = replace(nothing, used=replace(nothing.used, margin_in=margin), predicted_in=none)
    told = kept.to_dict()["gain"]
    assert told["false_within_before"] == told["false_within_after"] == len(margin)
    assert told["false_outside_before"] == told["false_outside_after"] == 0


def test_no_gain_is_claimed_where_nothing_is_named(nothing: Diagnosis) -> None:
    assert (nothing.verdict, nothing.gain, nothing.terms) == ("NONE", None, ())


def test_a_cause_whose_column_is_missing_is_not_testable(gear: Gear, plain: DiagnosisTable) -> None:
    bare = fleet(
        gear.model,
        quantities={},
        factors={"tail_no": plain.factors["tail_no"]},
        axial_float_in=None,
    )
    found = diagnose(gear.model, bare, gear.discrepancies)
    assert dict(found.not_testable) == {
        "out_of_plane_tilt": "axial_float",
        "elastic_compliance": "hydraulic_pressure_psi",
        "gauge_scale": "gauge_id",
        "thermal_growth": "temperature_c",
        "unlisted_wear": "gear_landings",
        "date_step": "day",
        "gauge_bias": "gauge_id",
        "technician_bias": "technician_id",
        "side_difference": "side",
        "approach_hysteresis": "approach",
    }


def test_repeat_readings_tell_the_repeatability(found: Diagnosis) -> None:
    assert found.repeatability_source == "repeat readings"
    assert found.repeatability_in == pytest.approx(0.00075, rel=0.2)


@pytest.mark.parametrize(
    ("declared_in", "said"), [(0.002, (0.002, "declared")), (None, (None, "unknown"))]
)
def test_without_repeat_readings_the_declared_repeatability_is_marked(declared_in, said, gear):
    stated = {} if declared_in is None else {"plunger_gauge_u_in": np.full(120, declared_in)}
    single = diagnose(gear.model, _one_reading(fleet(gear.model, **stated)), gear.discrepancies)
    assert (single.repeatability_in, single.repeatability_source) == said


def _one_reading(table: DiagnosisTable) -> DiagnosisTable:
    return replace(table, readings_in=table.readings_in[:, :1])
