"""Slips of the pen are shown and repaired in the analysis only; what gathers in one tail is an
effect.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from mlg_troubleshoot.diagnosis import DiagnosisTable, diagnose
from mlg_troubleshoot.diagnosis.faults import screen_faults
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.gear.linkage import worst_case
from mlg_troubleshoot.reporting.diagnosis_figures import seven_lines

from .conftest import fleet

ROW = 40
Slip = Callable[[DiagnosisTable], DiagnosisTable]


def clearance(factor: float) -> Slip:
    """Write the clearance of joint 3 in one row wrong by a factor."""

    def slip(table: DiagnosisTable) -> DiagnosisTable:
        values = table.clearance_in.copy()
        values[ROW, 2] *= factor
        return replace(table, clearance_in=values)

    return slip


def readings(factor: float, place: slice = slice(None)) -> Slip:
    """Write plunger readings of one row wrong by a factor."""

    def slip(table: DiagnosisTable) -> DiagnosisTable:
        values = table.readings_in.copy()
        values[ROW, place] *= factor
        return replace(table, readings_in=values)

    return slip


def swapped(table: DiagnosisTable) -> DiagnosisTable:
    """Swap joints 3 and 8 in one row whose clearances are made to differ."""
    values = table.clearance_in.copy()
    values[ROW, 2], values[ROW, 7] = values[ROW, 7], values[ROW, 2]
    return replace(table, clearance_in=values)


@pytest.fixture(scope="module")
def sound(gear: Gear) -> DiagnosisTable:
    """A fleet with nothing wrong, one row of which has a large and a small clearance, as its gear
    always has.
    """
    table = fleet(gear.model)
    values = table.clearance_in.copy()
    own = table.gears == table.gears[ROW]
    values[own, 2], values[own, 7] = 0.011, 0.0012
    return fleet(gear.model, clearance_in=values)


def faults(gear: Gear, table: DiagnosisTable) -> list[tuple[int, str, str]]:
    return [(f.place, f.column, f.kind) for f in screen_faults(gear.model, table)[1]]


def test_a_sound_fleet_has_no_faults(gear: Gear, sound: DiagnosisTable) -> None:
    assert faults(gear, sound) == []


@pytest.mark.parametrize(
    ("slip", "column", "kind"),
    [
        (clearance(25.4), "clearance_3_in", "mm_as_in"),
        (clearance(10.0), "clearance_3_in", "factor_10"),
        (clearance(0.1), "clearance_3_in", "factor_10"),
        (readings(25.4, slice(0, 1)), "plunger_displacement_in", "mm_as_in"),
        (readings(25.4, slice(1, 2)), "plunger_displacement_2_in", "mm_as_in"),
        (readings(10.0, slice(1, 2)), "plunger_displacement_2_in", "factor_10"),
    ],
    ids=[
        *("clearance mm", "clearance x 10", "clearance / 10", "reading mm", "second reading mm"),
        "reading x 10",
    ],
)
def test_a_slip_is_found_in_its_cell(slip, column, kind, gear, sound):
    assert faults(gear, slip(sound)) == [(ROW, column, kind)]


def test_all_readings_of_a_row_in_millimetres_are_found(gear: Gear, sound: DiagnosisTable) -> None:
    assert {(place, kind) for place, _column, kind in faults(gear, readings(25.4)(sound))} == {
        (ROW, "mm_as_in")
    }
    few = sound.clearance_in.copy()
    few[ROW, [0, 1, 3, 4, 5, 6, 8, 9]] = np.nan
    few[ROW] *= 25.4
    assert faults(gear, replace(sound, clearance_in=few)) == [
        (ROW, "clearance_3_in", "mm_as_in"),
        (ROW, "clearance_8_in", "mm_as_in"),
    ]


def test_two_swapped_joints_are_found_together(gear: Gear, sound: DiagnosisTable) -> None:
    assert faults(gear, swapped(sound)) == [
        (ROW, "clearance_3_in", "swapped_joints"),
        (ROW, "clearance_8_in", "swapped_joints"),
    ]


def test_a_slip_is_named_with_its_row_and_repaired_in_the_analysis_only(gear, sound):
    table = clearance(25.4)(sound)
    before = table.clearance_in.copy()
    repaired, (fault,), _usable = screen_faults(gear.model, table)
    assert (fault.row, fault.record_id) == (sound.row[ROW], sound.record_id[ROW])
    assert float(fault.suggested or "nan") == pytest.approx(0.011, abs=1e-5)
    assert np.array_equal(table.clearance_in, before)
    assert repaired.clearance_in[ROW, 2] == pytest.approx(0.011, abs=1e-5)
    others = np.ones(sound.clearance_in.shape, bool)
    others[ROW, 2] = False
    assert np.array_equal(repaired.clearance_in[others], sound.clearance_in[others])


def test_a_fault_does_not_become_a_cause(gear: Gear, sound: DiagnosisTable) -> None:
    assert diagnose(gear.model, clearance(25.4)(sound), gear.discrepancies).verdict == "NONE"


def test_rows_that_stand_out_in_one_tail_are_an_effect(gear: Gear) -> None:
    table = fleet(gear.model, lambda t, _over: np.where(t.factors["tail_no"] == "N104", 0.03, 0.0))
    assert faults(gear, table) == []


def test_rows_that_stand_out_with_one_gauge_are_an_effect(gear: Gear) -> None:
    gauges = np.where(np.arange(120) % 30 == 4, "G-9", "G-1")
    factors = {**fleet(gear.model).factors, "gauge_id": gauges}
    table = fleet(
        gear.model,
        lambda t, _over: np.where(t.factors["gauge_id"] == "G-9", 0.03, 0.0),
        factors=factors,
    )
    assert faults(gear, table) == []


def test_a_row_without_explanation_is_implausible_and_not_used(gear, sound):
    values = sound.readings_in.copy()
    values[ROW] = -0.9
    _table, found, usable = screen_faults(gear.model, replace(sound, readings_in=values))
    assert {f.kind for f in found} == {"implausible"}
    assert not usable[ROW]


def worn_by_landings(gear: Gear) -> DiagnosisTable:
    """A fleet of few inspections a gear, in which joint 5 wears twice as fast as the others."""
    plain = fleet(gear.model, tails=30)
    landings = np.linspace(300.0, 3000.0, 120)[np.random.default_rng(3).permutation(120)]
    landings[ROW] = 2900.0
    rate = np.where(np.arange(10) == 4, 2.2e-6, 1.0e-6)
    scatter = np.random.default_rng(4).lognormal(0.0, 0.12, (120, 10))
    return fleet(
        gear.model,
        tails=30,
        noise_in=0.0005,
        clearance_in=rate * landings[:, None] * scatter,
        quantities={**plain.quantities, "gear_landings": landings},
    )


def test_a_heavily_worn_gear_is_not_at_fault(gear: Gear) -> None:
    assert faults(gear, worn_by_landings(gear)) == []


def test_two_swapped_joints_are_found_by_the_wear_that_their_landings_make_expect(gear):
    table = worn_by_landings(gear)
    values = table.clearance_in.copy()
    values[ROW, [4, 6]] = values[ROW, [6, 4]]
    assert faults(gear, replace(table, clearance_in=values)) == [
        (ROW, "clearance_5_in", "swapped_joints"),
        (ROW, "clearance_7_in", "swapped_joints"),
    ]


def test_one_of_two_readings_that_cannot_be_is_not_used(gear: Gear, sound: DiagnosisTable) -> None:
    values = sound.readings_in.copy()
    values[ROW, 1] += 0.06
    assert faults(gear, replace(sound, readings_in=values)) == [
        (ROW, "plunger_displacement_2_in", "implausible")
    ]


def test_a_row_in_millimetres_is_found_in_its_clearances(gear: Gear, sound: DiagnosisTable) -> None:
    values = sound.clearance_in.copy()
    values[ROW] *= 25.4
    found = screen_faults(gear.model, replace(sound, clearance_in=values))[1]
    assert {(f.kind, f.column.split("_")[0]) for f in found} == {("mm_as_in", "clearance")}


def test_a_worn_joint_that_moves_the_plunger_is_not_a_slip(gear: Gear) -> None:
    values = fleet(gear.model).clearance_in.copy()
    values[29, 6] = 0.024
    assert faults(gear, fleet(gear.model, noise_in=0.003, clearance_in=values)) == []


def restored_between_the_readings(
    gear: Gear, noise_in: float = 0.0015
) -> tuple[DiagnosisTable, set[int], NDArray[np.float64]]:
    """A fleet of whose rows every eighth has its worst joint replaced after its reading; these
    rows, and what the plunger moves by. [in]
    """
    rows = np.arange(3, 120, 8)
    written = fleet(gear.model).clearance_in
    written[rows, 3] = 0.009
    true = written.copy()
    true[rows, 3] = 0.001
    moved = worst_case(gear.model, true).over_in - worst_case(gear.model, written).over_in
    table = fleet(gear.model, lambda *_: moved, clearance_in=written, noise_in=noise_in)
    return table, set(rows.tolist()), moved


def restored(gear: Gear, table: DiagnosisTable) -> set[int]:
    found = diagnose(gear.model, table, gear.discrepancies).faults
    return {fault.row - 2 for fault in found if fault.kind == "restored_joint"}


def test_rows_whose_worst_joint_was_restored_between_the_readings_are_named_and_no_cause(gear):
    table, rows, _moved = restored_between_the_readings(gear)
    found = diagnose(gear.model, table, gear.discrepancies)
    assert found.verdict == "NONE"
    assert {fault.row - 2 for fault in found.faults} == rows
    assert {(f.column, f.kind) for f in found.faults} == {("clearance_4_in", "restored_joint")}
    assert all(float(fault.suggested or "nan") < 0.002 for fault in found.faults)
    said = seven_lines(found)
    assert f"Enter the clearances of {len(rows)} rows" in said[-1].text
    assert "joint restored between its reading and the plunger's" in said[0].text


@pytest.mark.slow
def test_such_rows_are_found_beside_a_cause(gear: Gear) -> None:
    table, rows, _moved = restored_between_the_readings(gear)
    shifted = 0.004 * (table.factors["gauge_id"] == "G-1")
    table = replace(table, readings_in=table.readings_in + shifted[:, None])
    found = diagnose(gear.model, table, gear.discrepancies)
    assert [cause.candidate.key for cause in found.causes] == [("gauge_bias", "gauge G-1")]
    assert {fault.row - 2 for fault in found.faults} == rows


def test_a_row_that_may_be_restored_counts_by_its_probability(gear: Gear) -> None:
    table, rows, _moved = restored_between_the_readings(gear, noise_in=0.006)
    found = diagnose(gear.model, table, gear.discrepancies)
    undecided = sorted(rows - {fault.row - 2 for fault in found.faults})
    assert 0 < len(undecided) < len(rows)
    assert np.all(found.used.clearance_in[undecided, 3] < 0.009)
    assert np.all(found.used.clearance_in[undecided, 3] > 0.0015)


@pytest.mark.slow
def test_rows_that_scatter_as_far_the_other_way_were_not_restored(gear: Gear) -> None:
    table, _rows, moved = restored_between_the_readings(gear)
    clearance = table.clearance_in.copy()
    clearance[5::8] = clearance[3::8]
    other = fleet(gear.model, lambda *_: moved - np.roll(moved, 2), clearance_in=clearance)
    assert restored(gear, other) == set()


def test_rows_that_a_named_cause_lowers_were_not_restored(gear: Gear) -> None:
    def re_rigged(table: DiagnosisTable, _over: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.where(table.factors["tail_no"] == "N103", -0.01, 0.0)

    assert restored(gear, fleet(gear.model, re_rigged, noise_in=0.0008)) == set()
