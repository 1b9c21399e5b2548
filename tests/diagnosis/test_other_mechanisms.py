"""The diagnosis is a library: other mechanisms with their own measured outputs, unchanged code."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from mlg_troubleshoot.diagnosis import (
    Diagnosis,
    DiagnosisTable,
    ModelExtension,
    diagnose,
    load_extension,
    write_extension,
)
from mlg_troubleshoot.diagnosis.extension import adjustment_of
from mlg_troubleshoot.errors import GearFileError
from mlg_troubleshoot.gear.gear import Gear, adjusted_worst_case
from mlg_troubleshoot.gear.gear_file import load_gear

Array = NDArray[np.float64]
DATA = Path(__file__).parents[1] / "geometry" / "data"
ROWS, RIGS = 160, 8


@pytest.fixture(scope="module")
def crank() -> Gear:
    """The offset slider-crank: crank 2, rod 5, guide one below the crank pivot; its output is a
    position.
    """
    return load_gear(str(DATA / "slider-crank.toml"))


def furthest_wrist_pin(clearance: Array) -> Array:
    """Largest position of the wrist pin beyond the nominal one, by closed formula, on a fine grid
    of directions.

    Clearances at the crank pivot and in the crank pin move the rod's inner end; the one in the
    wrist pin moves its outer end. The input is at the end of its range, one radian.
    """
    turn = np.linspace(0.0, 2.0 * math.pi, 7201)
    angle = 1.0
    inner = np.array([2.0 * math.cos(angle), 2.0 * math.sin(angle)])

    def position(x: Array, y: Array) -> Array:
        return np.asarray(x + np.sqrt(25.0 - (y + 1.0) ** 2))

    nominal = float(position(np.array(inner[0]), np.array(inner[1])))
    total = np.empty(len(clearance))
    for k, row in enumerate(clearance):
        # All three act along the rod in their worst direction: their lengths add up at its ends.
        reach = row[0] + row[1] + row[2]
        total[k] = (
            np.max(position(inner[0] + reach * np.cos(turn), inner[1] + reach * np.sin(turn)))
            - nominal
        )
    return total


def bench(factor: float = 1.0, gauge_in: float = 0.0, seed: int = 11) -> DiagnosisTable:
    """Measured wrist pin positions of worn cranks: some scale the true output, or one gauge that
    reads off.
    """
    rng = np.random.default_rng(seed)
    clearance = rng.uniform(0.001, 0.02, (ROWS, 3))
    gauge = rng.choice(["A", "B", "C"], ROWS)
    true = factor * furthest_wrist_pin(clearance) + gauge_in * (gauge == "B")
    readings = true[:, None] + rng.normal(0.0, 0.0006, (ROWS, 2))
    return DiagnosisTable(
        clearance_in=clearance,
        readings_in=readings,
        record_id=tuple(f"bench {k}" for k in range(ROWS)),
        row=np.arange(1, ROWS + 1),
        margin_in=np.full(ROWS, 0.03),
        gauge_u_in=np.full(ROWS, 1e-5),
        factors={"tail_no": np.array([f"rig {k % RIGS}" for k in range(ROWS)]), "gauge_id": gauge},
    )


def found_in(crank: Gear, table: DiagnosisTable) -> Diagnosis:
    return diagnose(crank.model, table, crank.discrepancies)


def test_the_formula_agrees_with_the_model(crank: Gear) -> None:
    table = bench()
    predicted = found_in(crank, table).predicted_in
    assert predicted == pytest.approx(furthest_wrist_pin(table.clearance_in), abs=2e-4)


def test_a_right_model_is_left_alone(crank: Gear) -> None:
    assert found_in(crank, bench()).verdict == "NONE"


def test_a_wrong_scale_of_the_output_is_named(crank: Gear) -> None:
    found = found_in(crank, bench(factor=1.12))
    assert [c.candidate.cause.name for c in found.causes] == ["calibration_rate"]


def test_the_scale_comes_out_right(crank: Gear) -> None:
    assert found_in(crank, bench(factor=1.12)).causes[0].value == pytest.approx(0.12, abs=0.01)


def test_a_gauge_that_reads_off_is_named(crank: Gear) -> None:
    found = found_in(crank, bench(gauge_in=0.002))
    assert [(c.candidate.cause.name, c.candidate.target) for c in found.causes] == [
        ("gauge_bias", "gauge B")
    ]


def test_the_extension_predicts_other_benches_better(crank: Gear) -> None:
    terms = found_in(crank, bench(factor=1.12)).terms
    later = bench(factor=1.12, seed=12)
    adjusted = adjustment_of(terms, crank.model, later, later.clearance_in, crank.discrepancies)
    after = later.measured_in - adjusted_worst_case(crank.model, adjusted).over_in
    before = later.measured_in - furthest_wrist_pin(later.clearance_in)
    assert np.std(after) < 0.4 * np.std(before)
    assert abs(np.mean(after)) < 0.3 * abs(np.mean(before))


def test_causes_that_need_a_place_in_the_linkage_are_not_tried(crank: Gear) -> None:
    table = replace(bench(), axial_float_in=np.full((ROWS, 3), 0.01))
    assert found_in(crank, table).verdict == "NONE"


def test_its_extension_does_not_fit_a_landing_gear(crank: Gear, gear: Gear, tmp_path: Path) -> None:
    terms = found_in(crank, bench(factor=1.12)).terms
    write_extension(ModelExtension(crank, terms, 0.0005, (), ROWS), tmp_path / "crank.toml")
    with pytest.raises(GearFileError, match="another geometry"):
        load_extension([tmp_path / "crank.toml"], gear)


def test_an_output_in_radians_works_as_well() -> None:
    four_bar = load_gear(str(DATA / "four-bar.toml"))
    rng = np.random.default_rng(3)
    clearance = rng.uniform(0.001, 0.02, (ROWS, 4))
    from mlg_troubleshoot.gear.linkage import worst_case

    true = 0.85 * worst_case(four_bar.model, clearance).over_in
    table = replace(
        bench(),
        clearance_in=clearance,
        readings_in=true[:, None] + rng.normal(0.0, 1e-4, (ROWS, 2)),
    )
    found = diagnose(four_bar.model, table)
    assert next(iter(found.probabilities)) == ("calibration_rate", None)
