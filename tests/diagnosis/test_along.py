"""Rows along the stroke: what is predicted there, which cells are wrong, what a table without
clearances may say.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from mlg_troubleshoot.decision.inspection import Inspection, Side
from mlg_troubleshoot.diagnosis import Diagnosis, diagnose, table_from_inspections
from mlg_troubleshoot.diagnosis.along import predicted
from mlg_troubleshoot.diagnosis.causes.linkage import CalibrationRate
from mlg_troubleshoot.diagnosis.scene import build_scene, effect
from mlg_troubleshoot.diagnosis.wear import wear_of_gears
from mlg_troubleshoot.errors import InconclusiveDataError
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.units import ClearanceConvention
from mlg_troubleshoot.workflows.diagnose import DiagnoseOptions, diagnose_files

from .conftest import only

NOISE_IN = 0.001


def rig(
    gear: Gear, rows: int = 16, clearance_in: float | NDArray[np.float64] | None = 0.003
) -> list[Inspection]:
    """One sound gear, a dial on its plunger, read from Down Lock to mid-position."""
    extension = np.linspace(0.05, gear.reference.stroke[1], rows)
    worn = (
        []
        if clearance_in is None
        else np.broadcast_to(clearance_in, len(gear.joint_numbers)).tolist()
    )
    joints = dict(zip(gear.joint_numbers, worn, strict=False))
    table = table_from_inspections(
        [_row(k, float(s), 0.0, joints) for k, s in enumerate(extension)], gear, along=True
    )
    moved = predicted(gear.model, table, np.nan_to_num(table.clearance_in))[0]
    position = (
        gear.model.plunger(extension) + moved + np.random.default_rng(1).normal(0.0, NOISE_IN, rows)
    )
    return [
        _row(k, float(s), float(p), joints)
        for k, (s, p) in enumerate(zip(extension, position, strict=True))
    ]


def _row(k: int, extension: float, position: float, joints: dict[int, float]) -> Inspection:
    return Inspection(
        record_id=f"R{k + 1}",
        tail_no="N1",
        side=Side.LH,
        convention=ClearanceConvention.RADIAL,
        clearance_in=joints,
        actuator_extension_in=extension,
        plunger_position_in=position,
    )


def diagnosis(gear: Gear, rows: list[Inspection]) -> Diagnosis:
    table = table_from_inspections(rows, gear, along=True)
    return diagnose(gear.model, table, gear.discrepancies, ensemble=gear.ensemble_models[1:])


def cells(found: Diagnosis) -> list[tuple[str, str, str, str | None]]:
    return [(f.record_id, f.column, f.kind, f.suggested) for f in found.faults]


def along(gear: Gear) -> NDArray[np.float64]:
    """What a wrong rate of 1 % does to the rows of a sound rig."""
    table = table_from_inspections(rig(gear), gear, along=True)
    scene = build_scene(gear.model, table, gear.discrepancies)[0]
    return effect(scene, CalibrationRate().adjust(scene, only(CalibrationRate(), scene), 0.01))


def test_at_full_extension_the_prediction_is_that_of_mid_position(gear: Gear) -> None:
    table = table_from_inspections(rig(gear), gear, along=True)
    at_mid = replace(table, quantities={})
    there, here = (predicted(gear.model, t, t.clearance_in)[0][-1] for t in (table, at_mid))
    assert there == pytest.approx(here, abs=1e-12)


def test_a_wrong_rate_counts_with_the_whole_travel_of_the_plunger(gear: Gear) -> None:
    table = table_from_inspections(rig(gear), gear, along=True)
    moved = gear.model.plunger(table.extension_in) - gear.calibration.down_lock_in
    over = predicted(gear.model, table, table.clearance_in)[0]
    assert along(gear) == pytest.approx(0.01 * (moved + over), abs=2e-5)


def test_an_inspection_with_both_readings_is_one_inspection_and_two_rows(gear: Gear) -> None:
    both = [replace(row, readings_in=(0.04 + 0.0001 * k,)) for k, row in enumerate(rig(gear))]
    assert len(table_from_inspections(both, gear, along=True)) == 2 * len(both)
    assert diagnosis(gear, both).rows_used == len(both)


def test_a_check_sees_one_row_for_each_inspection(gear: Gear) -> None:
    table = table_from_inspections(rig(gear), gear)
    assert (len(table), table.along.any()) == (16, False)


def test_a_position_beyond_reach_is_taken_for_millimetres_and_repaired(gear: Gear) -> None:
    rows = rig(gear)
    right = rows[9].plunger_position_in or 0.0
    rows[9] = replace(rows[9], plunger_position_in=25.4 * right)
    assert cells(diagnosis(gear, rows)) == [
        ("R10", "plunger_position_in", "mm_as_in", f"{right:.4g}")
    ]


def test_within_reach_position_and_extension_are_both_named_and_not_used(gear: Gear) -> None:
    rows = rig(gear)
    rows[12] = replace(rows[12], plunger_position_in=(rows[12].plunger_position_in or 0.0) / 10.0)
    found = diagnosis(gear, rows)
    assert {cell[:3] for cell in cells(found)} == {
        ("R13", "plunger_position_in", "implausible"),
        ("R13", "actuator_extension_in", "implausible"),
    }
    assert found.rows_used == len(rows) - 1


def test_an_extension_that_the_linkage_does_not_reach_is_named(gear: Gear) -> None:
    rows = rig(gear)
    rows[5] = replace(rows[5], actuator_extension_in=4.0)
    assert ("R6", "actuator_extension_in") in {cell[:2] for cell in cells(diagnosis(gear, rows))}


def test_where_the_rod_of_one_rig_was_rigged_is_not_a_cause(gear: Gear) -> None:
    rows = [
        replace(row, plunger_position_in=(row.plunger_position_in or 0.0) + 0.02)
        for row in rig(gear, rows=40)
    ]
    assert diagnosis(gear, rows).verdict == "NONE"


def test_fewer_than_eight_rows_along_the_stroke_are_refused(gear: Gear) -> None:
    with pytest.raises(InconclusiveDataError, match="7 usable rows are too few"):
        diagnosis(gear, rig(gear, rows=7))


def test_one_short_rig_says_which_statements_fall_away(gear: Gear) -> None:
    said = diagnosis(gear, rig(gear, rows=10)).unsaid
    assert ["fewer than 4 aircraft" in said[0], "fewer than 20 rows" in said[1]] == [True, True]


def test_a_covariate_that_never_varies_makes_its_cause_untestable(gear: Gear) -> None:
    rows = [replace(row, hydraulic_pressure_psi=2900.0) for row in rig(gear)]
    assert ("elastic_compliance", "hydraulic_pressure_psi") in diagnosis(gear, rows).not_testable


def test_a_table_without_clearances_needs_no_convention(gear: Gear, tmp_path: Path) -> None:
    file = tmp_path / "rig.csv"
    lines = [
        f"N1,LH,{row.actuator_extension_in},{row.plunger_position_in}"
        for row in rig(gear, clearance_in=None)
    ]
    file.write_text(
        "\n".join(["tail_no,side,actuator_extension_in,plunger_position_in", *lines]),
        encoding="utf-8",
    )
    result = diagnose_files([file], DiagnoseOptions())
    assert (result.problems, result.diagnosis.verdict) == ((), "NONE")


def test_a_position_without_its_extension_is_said_to_be_of_no_use(
    gear: Gear, tmp_path: Path
) -> None:
    from mlg_troubleshoot.records import ReadOptions, read_many

    file = tmp_path / "rig.csv"
    file.write_text(
        "tail_no,side,actuator_extension_in,plunger_position_in,clearance_3_in,clearance_convention\n"
        "N1,LH,,0.2,0.003,RADIAL\n",
        encoding="utf-8",
    )
    (row,) = read_many([file], ReadOptions.of(gear, DiagnoseOptions())).inspections
    assert "plunger_position_in is not used: the row has no actuator_extension_in" in row.warnings


@pytest.mark.parametrize(("worn_in", "supposed_in"), [(0.003, 0.003), (0.012, 0.006)])
def test_heavy_wear_is_supposed_of_a_fleet_without_clearances_where_it_is_clearly_likelier(
    gear: Gear, worn_in: float, supposed_in: float
) -> None:
    rng = np.random.default_rng(3)
    rows = []
    for number in range(8):
        worn = worn_in * rng.lognormal(0.0, 0.4, len(gear.joint_numbers))
        rows += [
            replace(row, record_id=f"{number}-{row.record_id}", tail_no=f"N{number}")
            for row in rig(gear, 16, worn)
        ]
    unread = [replace(row, clearance_in={}) for row in rows]
    scene = build_scene(
        gear.model, table_from_inspections(unread, gear, along=True), gear.discrepancies
    )[0]
    assert scene.clearance_in == pytest.approx(supposed_in)


def test_readings_of_one_day_share_the_wear_that_nobody_read(gear: Gear) -> None:
    table = table_from_inspections(rig(gear)[:3], gear, along=True)
    dated = replace(table, quantities={**table.quantities, "day": np.array([0.0, 0.0, 9.0])})
    wear = wear_of_gears(dated, np.full((3, 10), 0.001))
    assert [np.allclose(wear[0], wear[1]), np.allclose(wear[0], wear[2])] == [True, False]
