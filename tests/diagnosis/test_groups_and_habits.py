"""What concerns some gears, bases or people only is named as such."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from mlg_troubleshoot.decision.inspection import Inspection, Side
from mlg_troubleshoot.diagnosis import Scene, diagnose
from mlg_troubleshoot.diagnosis.explain import build_bank
from mlg_troubleshoot.diagnosis.table import DiagnosisTable, table_from_inspections
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.misfit.columns import EffectColumns
from mlg_troubleshoot.units import DAYS_PER_YEAR
from mlg_troubleshoot.units import ClearanceConvention as Convention
from tests.cli.conftest import mlg
from tests.hidden_effect.simulator import blemished_fleet, write_rows

from .conftest import Array, fleet

MODIFIED = {"N101": 150, "N104": 420, "N105": 240, "N108": 510}


def names(gear: Gear, table: DiagnosisTable) -> list[tuple[str, str | None]]:
    return [
        (c.candidate.cause.name, c.candidate.target)
        for c in diagnose(gear.model, table, gear.discrepancies).causes
    ]


def modified(table: DiagnosisTable, _over: Array) -> Array:
    since = np.array([MODIFIED.get(tail, 10_000) for tail in table.tails])
    return 0.006 * (table.quantities["day"] >= since)


def approaching(table: DiagnosisTable, _over: Array) -> Array:
    own = table.factors["technician_id"] == "T-2"
    return 0.006 * (own & (table.factors["approach"] == "RETRACTING"))


def own_column(table: DiagnosisTable, over: Array) -> DiagnosisTable:
    texts = np.where(modified(table, over) > 0.0, "POST", "PRE")
    return replace(table, factors={**table.factors, "mod_status": texts})


@pytest.mark.parametrize("phase", np.pi * np.linspace(0.0, 1.0, 7))
def test_a_season_of_any_phase_is_nearly_a_shape_of_the_bank(scene: Scene, phase: float) -> None:
    shapes = build_bank(scene, EffectColumns.of(np.empty((len(scene.table), 0)))).columns
    season = np.cos(2.0 * np.pi * scene.table.quantities["day"] / DAYS_PER_YEAR - phase)
    along = np.abs(shapes.onto(season[None])[0]) / np.linalg.norm(season) / np.sqrt(shapes.squares)
    assert along.max() > 0.97


def test_lost_motion_in_the_rows_of_one_technician_is_named_with_the_technician(gear: Gear) -> None:
    table = fleet(gear.model, approaching, rows=200)
    (cause,) = diagnose(gear.model, table, gear.discrepancies).causes
    assert cause.candidate.key == ("approach_hysteresis", "technician T-2")
    assert cause.candidate.cause.words(cause.candidate.target).endswith("of technician T-2")


@pytest.mark.slow
def test_lost_motion_of_all_is_not_one_technicians(gear: Gear) -> None:
    def of_all(table: DiagnosisTable, _over: Array) -> Array:
        return 0.004 * (table.factors["approach"] == "RETRACTING")

    assert names(gear, fleet(gear.model, of_all, rows=200)) == [("approach_hysteresis", None)]


def test_a_column_of_the_tables_own_is_named_with_its_value(gear: Gear) -> None:
    table = fleet(gear.model, modified, rows=200)
    assert names(gear, own_column(table, np.zeros(200))) == [("modification", "mod_status POST")]


def test_bases_that_differ_are_not_scatter_of_the_readers_who_work_there(tmp_path: Path) -> None:
    rows, truth = blemished_fleet("zero_by_base", "strong", 61_001, rows=150)
    write_rows(rows, tmp_path / "bases.csv")
    said = mlg("diagnose", tmp_path / "bases.csv", "--json").json
    assert {(c["cause"], c["target"]) for c in said["causes"]} == set(truth.causes)


@pytest.mark.slow
def test_aircraft_that_wander_each_on_its_own_are_on_no_list(tmp_path: Path) -> None:
    rows, _truth = blemished_fleet("walk", "strong", 61_003, rows=150)
    write_rows(rows, tmp_path / "fleet.csv")
    said = mlg("diagnose", tmp_path / "fleet.csv", "--json").json
    assert (said["verdict"], said["causes"]) == ("UNLISTED", [])
    assert said["unlisted_variables"] == ["tail_no", "day"]


@pytest.mark.slow
def test_a_step_of_all_aircraft_is_not_a_modification(gear: Gear) -> None:
    def all_from(table: DiagnosisTable, _over: Array) -> Array:
        return 0.006 * (table.quantities["day"] >= 350)

    assert names(gear, fleet(gear.model, all_from, rows=200)) == [("date_step", None)]


def test_a_column_with_many_values_does_not_group_the_rows(gear: Gear) -> None:
    rows = [
        Inspection(
            f"R{k}",
            "N1",
            Side.LH,
            Convention.RADIAL,
            {3: 0.002},
            carried={"mod_status": ("PRE", "POST")[k % 2], "squawk": f"note {k}", "base": "LHR"},
        )
        for k in range(9)
    ]
    table = table_from_inspections(rows, gear)
    assert table.own_factors == ("mod_status",)
    assert table.left_out == (("base", "the same in all rows"), ("squawk", "no value repeats"))


def test_the_report_draws_the_residuals_against_every_column(tmp_path: Path) -> None:
    rows, _truth = blemished_fleet("modification_col", "strong", 61_001, rows=80)
    write_rows(rows, tmp_path / "fleet.csv")
    mlg("diagnose", tmp_path / "fleet.csv", "--convention", "RADIAL", "--report", tmp_path)
    page = next(tmp_path.glob("*.html")).read_text(encoding="utf-8")
    section = page[page.index('id="columns"') :]
    labels = ["temperature, °C", "hydraulic pressure, psi", "days since", "gauge", "mod status"]
    labels += [f"clearance of joint {joint}" for joint in range(1, 11)]
    assert [label for label in labels if f"against {label}" not in section] == []
