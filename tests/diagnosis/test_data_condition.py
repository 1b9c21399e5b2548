"""The condition of the data: how readings were written down, said before the verdict is read."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from numpy.typing import NDArray

from mlg_troubleshoot.decision.inspection import Inspection
from mlg_troubleshoot.diagnosis import diagnose
from mlg_troubleshoot.diagnosis.causes import RiggingOffset
from mlg_troubleshoot.diagnosis.faults import data_condition, doubt_of
from mlg_troubleshoot.diagnosis.table import DiagnosisTable, table_from_inspections
from mlg_troubleshoot.diagnosis.wear import fleet_history, gears_of
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.gear.linkage import worst_case
from mlg_troubleshoot.records import ReadOptions, read_many
from tests.cli.conftest import mlg
from tests.diagnosis.conftest import scene_of
from tests.hidden_effect.simulator import blemished_fleet, write_rows

Change = Callable[[NDArray[np.float64], NDArray[np.float64]], None]


def histories(gear: Gear, **columns: NDArray[np.float64]) -> DiagnosisTable:
    """Twenty gears at six visits each, all joints read to 0.0001 in."""
    rng = np.random.default_rng(5)
    number = np.repeat(np.arange(20), 6)
    landings = np.tile(np.arange(1.0, 7.0) * 300.0, 20) + rng.uniform(0.0, 90.0, 120)
    rate = rng.uniform(0.0006, 0.0025, (20, len(gear.joint_numbers)))
    clearance = 0.0006 + rate[number] * landings[:, None] / 1000.0
    clearance = np.round(clearance + rng.normal(0.0, 0.0003, clearance.shape), 4).clip(0.0001)
    table = DiagnosisTable(
        clearance_in=clearance,
        readings_in=rng.normal(0.02, 0.005, (120, 1)).round(4),
        record_id=tuple(f"R{k}" for k in range(120)),
        row=np.arange(2, 122),
        margin_in=np.full(120, 0.03),
        gauge_u_in=np.full(120, 0.0005),
        quantities={"gear_landings": landings, "day": landings / 3.0},
        factors={
            "tail_no": np.array([f"N{100 + k}" for k in number]),
            "technician_id": np.array([f"T-{k % 3}" for k in range(120)]),
        },
        first_day="2023-02-01",
    )
    return replace(table, **columns)


def kinds(table: DiagnosisTable, gear: Gear) -> set[str]:
    return {found.kind for found in data_condition(table, gear)[0]}


def test_of_clean_data_nothing_is_said(gear: Gear) -> None:
    assert kinds(histories(gear), gear) == set()


@pytest.mark.parametrize("seed", [0, pytest.param(1, marks=pytest.mark.slow)])
def test_of_a_simulated_sound_fleet_nothing_is_said_but_of_overhauls(seed, tmp_path):
    rows, _truth = blemished_fleet("sound", "mild", 61_000 + seed, rows=100)
    write_rows(rows, tmp_path / "sound.csv")
    said = mlg("diagnose", tmp_path / "sound.csv", "--convention", "RADIAL", "--json").json
    assert {found["kind"] for found in said["data_condition"]} <= {"landings_fall"}


def changed(gear: Gear, change: Change) -> DiagnosisTable:
    clearance, readings = histories(gear).clearance_in, histories(gear).readings_in
    change(clearance, readings)
    return histories(gear, clearance_in=clearance, readings_in=readings)


def to_a_thousandth(clearance: NDArray[np.float64], _readings: NDArray[np.float64]) -> None:
    clearance[:] = np.round(clearance, 3)


def plunger_to_five_thousandths(
    _clearance: NDArray[np.float64], readings: NDArray[np.float64]
) -> None:
    readings[:] = np.round(readings / 0.005) * 0.005


def no_smaller_than_two_thousandths(
    clearance: NDArray[np.float64], _readings: NDArray[np.float64]
) -> None:
    clearance[:] = np.maximum(clearance, 0.002)


def no_larger_than_three_thousandths(
    clearance: NDArray[np.float64], _readings: NDArray[np.float64]
) -> None:
    clearance[:] = np.minimum(np.round(clearance / 0.0005) * 0.0005, 0.003)


def only_worn(clearance: NDArray[np.float64], _readings: NDArray[np.float64]) -> None:
    clearance[clearance < 0.0025] = np.nan


def until_the_first_worn(clearance: NDArray[np.float64], _readings: NDArray[np.float64]) -> None:
    for row in clearance:
        worn = np.flatnonzero(row > 0.0025)
        if worn.size:
            row[worn[0] + 1 :] = np.nan


def only_worn_of_one(clearance: NDArray[np.float64], readings: NDArray[np.float64]) -> None:
    only_worn(clearance[1::3], readings)


def until_the_first_worn_of_one(
    clearance: NDArray[np.float64], readings: NDArray[np.float64]
) -> None:
    until_the_first_worn(clearance[1::3], readings)
    clearance[::6, 2] = np.nan


def copied(clearance: NDArray[np.float64], _readings: NDArray[np.float64]) -> None:
    clearance[3::12] = clearance[2::12]


def all_alike(clearance: NDArray[np.float64], _readings: NDArray[np.float64]) -> None:
    clearance[4::30] = 0.004


def at_the_limit(clearance: NDArray[np.float64], _readings: NDArray[np.float64]) -> None:
    clearance[4::30] = 0.0075


def plunger_of_worn_gears(clearance: NDArray[np.float64], readings: NDArray[np.float64]) -> None:
    worn = clearance.mean(axis=1)
    readings[worn < np.median(worn)] = np.nan


@pytest.mark.parametrize(
    ("change", "kind"),
    [
        (to_a_thousandth, "rounded"),
        (plunger_to_five_thousandths, "rounded"),
        (no_smaller_than_two_thousandths, "censored"),
        (no_larger_than_three_thousandths, "censored"),
        (only_worn, "blank_not_at_random"),
        (until_the_first_worn, "blank_not_at_random"),
        (copied, "copied"),
        (all_alike, "identical_cells"),
        (at_the_limit, "limit_written"),
        (plunger_of_worn_gears, "selected"),
    ],
)
def test_what_was_done_to_the_data_is_said(gear: Gear, change: Change, kind: str) -> None:
    assert kind in kinds(changed(gear, change), gear)


@pytest.mark.parametrize("change", [only_worn_of_one, until_the_first_worn_of_one])
def test_blanks_not_at_random_are_said_of_the_technician_whose_they_are(gear, change):
    (found,) = data_condition(changed(gear, change), gear)[0]
    assert (found.kind, "of technician T-1:" in found.where) == ("blank_not_at_random", True)
    # Others read the same joints.
    assert not found.doubtful


def test_blanks_at_random_are_not_remarked_on(gear: Gear) -> None:
    def blanks(clearance: NDArray[np.float64], _readings: NDArray[np.float64]) -> None:
        clearance[np.random.default_rng(3).random(clearance.shape) < 0.3] = np.nan

    assert kinds(changed(gear, blanks), gear) == set()


@pytest.mark.parametrize("largest_in", [0.003, 0.004, 0.005])
def test_a_value_to_which_many_are_rounded_is_not_an_end(gear: Gear, largest_in: float) -> None:
    def rounded(clearance: NDArray[np.float64], _readings: NDArray[np.float64]) -> None:
        # Half to even of values to 0.0005 in: every other value has three of them, or one.
        clearance[:] = np.round(np.round(clearance / 0.0005) / 2.0) * 0.001
        clearance[clearance > largest_in] = np.nan

    assert kinds(changed(gear, rounded), gear) == {"rounded"}


def test_rows_that_stand_twice_count_once(gear: Gear) -> None:
    twice = histories(gear).take(np.r_[np.arange(120), 7, 30])
    found, aside = data_condition(twice, gear)
    assert [f.kind for f in found] == ["duplicate"]
    assert np.flatnonzero(aside).tolist() == [120, 121]


def test_a_row_with_every_joint_below_the_end_of_its_gauge_is_not_one_value_ten_times(gear):
    table = changed(gear, all_alike)
    below = np.zeros(table.clearance_in.shape, bool)
    below[4::30] = True
    assert "identical_cells" not in kinds(replace(table, below=below), gear)


@pytest.mark.parametrize("change", [copied, all_alike, at_the_limit])
def test_rows_without_readings_of_their_own_are_set_aside(gear: Gear, change: Change) -> None:
    touched = changed(gear, change)
    expected = np.any(touched.clearance_in != histories(gear).clearance_in, axis=1)
    assert np.array_equal(data_condition(touched, gear)[1], expected)


def test_steps_are_said_of_the_technician_who_rounds(gear: Gear) -> None:
    def one_rounds(clearance: NDArray[np.float64], _readings: NDArray[np.float64]) -> None:
        clearance[1::3] = np.round(clearance[1::3], 3)

    (found,) = data_condition(changed(gear, one_rounds), gear)[0]
    assert found.where == "clearances, to 0.001 in, technician T-1"
    assert found.share == pytest.approx(1 / 3)


@pytest.mark.parametrize(("step_in", "doubtful"), [(0.001, False), (0.005, True)])
def test_rounding_is_in_doubt_where_its_step_exceeds_the_spread_of_the_values(
    gear, step_in, doubtful
):
    def rounded(clearance: NDArray[np.float64], _readings: NDArray[np.float64]) -> None:
        clearance[:] = np.round(clearance / step_in) * step_in

    found = data_condition(changed(gear, rounded), gear)[0]
    assert [f.doubtful for f in found if f.kind == "rounded"] == [doubtful]
    assert ("clearances, to 0.005 in" in doubt_of(found)) == doubtful


def with_landings(gear: Gear, change: Callable[[NDArray[np.float64]], None]) -> DiagnosisTable:
    table = histories(gear)
    landings = table.quantities["gear_landings"].copy()
    change(landings)
    return replace(table, quantities={**table.quantities, "gear_landings": landings})


def overhauled(landings: NDArray[np.float64]) -> None:
    landings[3:6] -= 1000.0


def overhauled_while_others_are_parked(landings: NDArray[np.float64]) -> None:
    overhauled(landings)
    landings[6:] = 5000.0


@pytest.mark.parametrize(
    ("change", "lives"),
    [
        (lambda _landings: None, 1),
        (overhauled, 2),
        (overhauled_while_others_are_parked, 2),
        (lambda landings: landings.put(2, 9000.0), 1),
        (lambda landings: landings.put(3, 12.0), 1),
    ],
)
def test_the_wear_of_a_gear_begins_anew_at_an_overhaul_and_not_at_a_mistyped_number(
    gear, change, lives
):
    assert len(set(gears_of(with_landings(gear, change))[:6].tolist())) == lives


def test_landings_that_fall_are_said_of_their_gear_but_at_an_overhaul(gear: Gear) -> None:
    def both(landings: NDArray[np.float64]) -> None:
        landings[4:6] -= 1200.0
        landings[9] = 12.0

    (found,) = data_condition(with_landings(gear, both), gear)[0]
    assert (found.kind, found.where) == ("landings_fall", "gear N101")
    assert found.share == pytest.approx(1 / 20)


def test_landings_that_do_not_follow_the_dates_split_no_gear(gear: Gear) -> None:
    shuffled = with_landings(gear, np.random.default_rng(1).shuffle)
    assert np.array_equal(gears_of(shuffled), gears_of(histories(gear)))


def test_the_screen_says_it_before_the_verdict_with_what_to_record(tmp_path: Path) -> None:
    rows, _truth = blemished_fleet("dup", "strong", 61_000, rows=100)
    write_rows(rows, tmp_path / "twice.csv")
    out = " ".join(mlg("diagnose", tmp_path / "twice.csv", "--convention", "RADIAL").out.split())
    assert "Written twice: rows" in out.split("MISFIT")[0]
    assert "Record next time: each inspection once." in out
    said = mlg("diagnose", tmp_path / "twice.csv", "--convention", "RADIAL", "--json").json
    (again,) = (f for f in said["data_condition"] if f["kind"] == "duplicate")
    assert said["rows"]["set_aside"] >= round(again["share"] * said["rows"]["read"]) > 0


def test_readings_below_an_end_are_said_and_used(tmp_path: Path) -> None:
    rows, _truth = blemished_fleet("gonogo", "mild", 61_000, rows=100)
    write_rows(rows, tmp_path / "ends.csv")
    said = mlg("diagnose", tmp_path / "ends.csv", "--convention", "RADIAL", "--json").json
    assert "censored" in {found["kind"] for found in said["data_condition"]}
    assert said["rows"]["used"] >= 95


def test_half_of_an_upper_end_stands_for_a_reading_below_it(gear: Gear) -> None:
    inspection = read_rows(gear, "<0.002")[0]
    table = table_from_inspections([inspection], gear)
    assert table.clearance_in[0, 2] == pytest.approx(0.001)
    assert table.below is not None
    assert np.flatnonzero(table.below[0]).tolist() == [2]


def read_rows(gear: Gear, cell: str) -> list[Inspection]:
    row = {"tail_no": "N1", "side": "LH", "clearance_3_in": cell, "clearance_convention": "RADIAL"}
    return list(read_many([pd.DataFrame([row])], ReadOptions.of(gear)).inspections)


def test_a_re_rigging_needs_a_day_before_it_and_two_after_it(gear: Gear) -> None:
    days = histories(gear).quantities["day"][:6]
    scene = scene_of(gear.model, histories(gear), gear.discrepancies)
    begins = {
        c.setting["day"]
        for c in RiggingOffset().candidates(scene)
        if c.target == "tail N100" and c.setting["day"] is not None
    }
    assert begins == set(days[1:5])


@pytest.mark.slow
@pytest.mark.parametrize(("case", "form"), [("mnar", "strong"), ("gonogo", "strong")])
def test_what_depends_on_clearances_that_are_cut_off_is_not_named(case, form, tmp_path):
    for seed in (61_000, 61_001):
        rows, _truth = blemished_fleet(case, form, seed, rows=200)
        write_rows(rows, tmp_path / "cut.csv")
        said = mlg("diagnose", tmp_path / "cut.csv", "--convention", "RADIAL", "--json").json
        assert said["causes"] == []
        assert any(t.startswith("Causes of joints, of scale") for t in said["cannot_say"])


def test_a_gauge_is_named_though_clearances_are_cut_off(gear: Gear) -> None:
    table = histories(gear)
    over = worst_case(gear.model, table.clearance_in).over_in
    first = np.arange(120) % 4 == 0
    noise = np.random.default_rng(2).normal(0.0, 0.0015, 120)
    readings = (over + 0.004 * first + noise)[:, None]
    gauges = {**table.factors, "gauge_id": np.where(first, "G-1", "G-2")}
    shifted = replace(table, readings_in=readings, factors=gauges, doubt="cut off")
    found = diagnose(gear.model, shifted, gear.discrepancies)
    assert [c.candidate.cause.name for c in found.causes] == ["gauge_bias"]


@pytest.mark.slow
def test_a_scale_is_not_named_where_clearances_are_cut_off(gear: Gear) -> None:
    table = histories(gear)
    over = worst_case(gear.model, table.clearance_in).over_in
    noise = np.random.default_rng(2).normal(0.0, 0.0005, 120)
    scaled = replace(table, readings_in=(1.06 * over + noise)[:, None])
    sure = diagnose(gear.model, scaled, gear.discrepancies)
    doubted = diagnose(gear.model, replace(scaled, doubt="cut off"), gear.discrepancies)
    assert [c.candidate.cause.name for c in sure.causes] == ["calibration_rate"]
    assert doubted.causes == ()


@pytest.mark.slow
def test_landings_that_fall_are_said_of_the_data_and_not_row_by_row(tmp_path: Path) -> None:
    rows, _truth = blemished_fleet("overhaul", "strong", 61_000, rows=200)
    write_rows(rows, tmp_path / "overhaul.csv")
    said = mlg("diagnose", tmp_path / "overhaul.csv", "--convention", "RADIAL", "--json").json
    assert "landings_fall" in {found["kind"] for found in said["data_condition"]}
    assert not [note for note in said["warnings"] if "never fall" in note]


@pytest.mark.slow
def test_a_gauge_that_was_read_as_a_diameter_for_a_time_is_named_with_its_dates(tmp_path):
    rows, _truth = blemished_fleet("diametral_month", "strong", 61_000, rows=150)
    write_rows(rows, tmp_path / "diametral.csv")
    said = mlg("diagnose", tmp_path / "diametral.csv", "--json").json
    (cause,) = said["causes"]
    assert (cause["cause"], cause["target"][:5]) == ("convention_slip", "gauge")
    assert cause["parameters"]["since"] < cause["parameters"]["until"]
    screen = " ".join(mlg("diagnose", tmp_path / "diametral.csv").out.split())
    assert f"from {cause['parameters']['since']} to {cause['parameters']['until']}" in screen


def test_blanks_that_may_account_for_a_misfit_are_said_with_what_to_record(tmp_path: Path) -> None:
    rows, _truth = blemished_fleet("mnar", "strong", 61_000, rows=150)
    write_rows(rows, tmp_path / "worn.csv")
    screen = " ".join(mlg("diagnose", tmp_path / "worn.csv").out.split())
    assert "Clearances that are blank or cut off may account for it." in screen
    assert "To test causes of joints, record next time: every joint that was read" in screen
    assert "Nothing to change" not in screen


def test_a_column_of_its_own_that_groups_rows_is_said_to_be_compared(tmp_path: Path) -> None:
    rows, _truth = blemished_fleet("zero_by_base", "mild", 61_000, rows=150)
    write_rows(rows, tmp_path / "bases.csv")
    said = mlg("diagnose", tmp_path / "bases.csv", "--json").json
    assert "base" in said["columns_used"]
    assert said["columns_left_out"] == []
    assert "unknown column" not in " ".join(said["warnings"])


def test_a_clearance_that_was_rounded_is_as_unsure_as_its_step_is_wide(gear: Gear) -> None:
    table = changed(gear, to_a_thousandth)
    fine, coarse = (fleet_history(t)[0].reading_in2[:, 2] for t in (histories(gear), table))
    assert coarse.max() <= 0.0005**2 + 0.001**2 / 12.0
    assert coarse.mean() > fine.mean()
