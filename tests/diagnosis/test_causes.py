"""Each cause changes the number of the model that its physics says, and its column is that change's
slope.
"""

from __future__ import annotations

from dataclasses import replace
from datetime import date, timedelta

import numpy as np
import pytest

from mlg_troubleshoot.diagnosis import CATALOGUE, Candidate, Cause, Scene, diagnose
from mlg_troubleshoot.diagnosis.causes import JointContact, OutOfPlaneTilt, RiggingOffset
from mlg_troubleshoot.diagnosis.extension import effects_of
from mlg_troubleshoot.diagnosis.table import DiagnosisTable
from mlg_troubleshoot.gear.gear import Gear, adjusted_worst_case

from .conftest import Array, fleet, only, scene_of

BY_NAME = {cause.name: cause for cause in CATALOGUE}
# The names, the columns they need and the allowed sign of the parameter, from the contract and the
# physics.
NEEDS = {
    "out_of_plane_tilt": ("axial_float",),
    "elastic_compliance": ("hydraulic_pressure_psi",),
    "thermal_growth": ("temperature_c",),
    "direction_not_worst_case": (),
    "oval_wear": (),
    "unlisted_wear": ("gear_landings",),
    "rigging_offset": ("tail_no",),
    "date_step": ("day",),
    "gauge_bias": ("gauge_id",),
    "gear_scale": ("tail_no",),
    "gauge_scale": ("gauge_id",),
    "technician_bias": ("technician_id",),
    "modification": (),
    "side_difference": ("side",),
    "calibration_rate": (),
    "approach_hysteresis": ("approach",),
    "joint_contact": (),
    "convention_slip": (),
    "load_directions": (),
    "geometry": (),
}
# What a fleet with nothing wrong has candidates of: no group in doubt, no column of its own, and
# all-joint effects are fitted together.
NONE_THERE = {"convention_slip", "modification", "load_directions", "geometry"}
SINGLE = [name for name in NEEDS if name not in NONE_THERE]
ONE_SIGN = {
    "out_of_plane_tilt": 1,
    "direction_not_worst_case": -1,
    "oval_wear": 1,
    "joint_contact": 1,
    "convention_slip": 1,
}


def first(cause: Cause, scene: Scene) -> Candidate:
    return next(iter(cause.candidates(scene)))


def test_a_cause_of_the_contract_says_its_columns_its_sign_and_what_to_inspect() -> None:
    assert {name: cause.needs for name, cause in BY_NAME.items()} == NEEDS
    assert {name: cause.sign for name, cause in BY_NAME.items() if cause.sign} == ONE_SIGN
    for cause in BY_NAME.values():
        assert min(map(len, (cause.sentence, cause.inspect, cause.separates))) > 15


@pytest.mark.parametrize("name", SINGLE)
def test_a_cause_of_size_zero_changes_nothing(name: str, gear: Gear, scene: Scene) -> None:
    cause = BY_NAME[name]
    adjustment = cause.adjust(scene, first(cause, scene), 0.0)
    assert adjusted_worst_case(gear.model, adjustment).over_in == pytest.approx(
        scene.over_in, abs=1e-12
    )


@pytest.mark.parametrize("name", SINGLE)
def test_the_column_of_a_cause_is_the_slope_of_the_true_worst_case(name, gear, scene):
    cause = BY_NAME[name]
    candidate = first(cause, scene)
    (column,) = effects_of(scene, [candidate])
    step = 1e-3 * cause.trial
    moved = adjusted_worst_case(gear.model, cause.adjust(scene, candidate, step)).over_in
    slope = (moved - scene.over_in) / step
    assert np.max(np.abs(slope)) > 0.0
    assert column == pytest.approx(slope, abs=0.03 * np.max(np.abs(slope)))


def test_a_gear_that_was_never_read_hides_no_convention_slip(gear: Gear) -> None:
    plain = fleet(gear.model)
    own = plain.factors["tail_no"] == "N103"
    twice = plain.clearance_in * np.where(own, 2.0, 1.0)[:, None]
    unread = plain.gears == sorted(plain.gears)[-1]
    twice[unread] = np.nan
    scene = scene_of(gear.model, replace(plain, clearance_in=twice), gear.discrepancies)
    assert "tail N103" in {each.target for each in BY_NAME["convention_slip"].candidates(scene)}


def test_tilt_shrinks_a_link_by_the_cosine_of_its_floats_over_the_span(scene: Scene) -> None:
    cause, span = OutOfPlaneTilt(), 1.5
    factors = cause.adjust(scene, only(cause, scene), 1.0 / span**2).scaled["length.3-5"]
    floats = scene.table.axial_float_in
    assert floats is not None
    tilt = np.arcsin(np.hypot(floats[:, 2], floats[:, 4]) / span)
    assert factors == pytest.approx(np.cos(tilt), abs=1e-12)


def test_a_lever_is_tilted_by_the_float_of_its_pivot_alone(scene: Scene) -> None:
    cause = OutOfPlaneTilt()
    table = scene.table
    assert table.axial_float_in is not None
    floats = table.axial_float_in.copy()
    floats[:, 3] = 0.0
    still = replace(scene, table=replace(table, axial_float_in=floats))
    assert cause.adjust(still, only(cause, still), 1.0).scaled["length.5-4"] == pytest.approx(
        1.0, abs=0.0
    )


def test_tilt_is_shown_as_the_bearing_span_that_it_implies() -> None:
    assert OutOfPlaneTilt().shown(1.0 / 1.5**2) == {"bearing_span_in": pytest.approx(1.5)}


def test_a_stretch_is_nothing_at_full_pressure(scene: Scene) -> None:
    cause = BY_NAME["elastic_compliance"]
    full = replace(
        scene.table, quantities={"hydraulic_pressure_psi": np.full(len(scene.table), 3000.0)}
    )
    at_full = replace(scene, table=full)
    changed = cause.adjust(at_full, first(cause, at_full), 1e-6).changed
    assert all(np.all(change == 0.0) for change in changed.values())


def test_growth_moves_fixed_points_in_proportion_to_the_distance_from_20_c(scene: Scene) -> None:
    cause = BY_NAME["thermal_growth"]
    scaled = cause.adjust(scene, only(cause, scene), 1e-5).scaled
    assert not any(name.startswith(("length.", "lever.")) for name in scaled)
    grown = 1.0 + 1e-5 * (scene.table.quantities["temperature_c"] - 20.0)
    assert next(iter(scaled.values())) == pytest.approx(grown, abs=1e-12)


@pytest.mark.parametrize("exponent", [0.84, 1.0, 1.19])
def test_unlisted_wear_shifts_the_lever_with_a_power_of_the_landings(exponent, scene):
    cause = BY_NAME["unlisted_wear"]
    candidate = next(c for c in cause.candidates(scene) if c.setting["wear_exponent"] == exponent)
    (shift,) = cause.adjust(scene, candidate, 0.002).changed.values()
    assert shift == pytest.approx(
        0.002 * (scene.table.quantities["gear_landings"] / 1000.0) ** exponent
    )


def test_wear_of_the_joints_stands_for_landings_that_nobody_recorded(scene: Scene) -> None:
    cause = BY_NAME["unlisted_wear"]
    (stand_in,) = cause.stand_ins(scene)
    (shift,) = cause.adjust(scene, stand_in, 0.002).changed.values()
    assert np.corrcoef(shift, scene.clearance_in.sum(axis=1))[0, 1] > 0.9


def test_contact_may_cost_the_smaller_clearance_where_that_contributes_more(gear, scene):
    cause = JointContact()
    candidate = next(
        c
        for c in cause.candidates(scene)
        if c.target == "joints 9,10" and c.setting.get("smaller") == "clearance"
    )
    left = cause.adjust(scene, candidate, 1.0).clearance_in[:, [8, 9]]
    assert np.all(left.max(axis=1) == scene.clearance_in[:, [8, 9]].max(axis=1))
    assert np.all(left.min(axis=1) == 0.0)


@pytest.mark.parametrize(
    ("name", "value"), [("direction_not_worst_case", -0.4), ("oval_wear", 0.4)]
)
def test_a_joint_s_cause_touches_that_joint_alone(name: str, value: float, scene: Scene) -> None:
    cause = BY_NAME[name]
    candidate = next(c for c in cause.candidates(scene) if c.target == "joint 3")
    change = cause.adjust(scene, candidate, value).clearance_in / scene.clearance_in
    assert change[:, 2] == pytest.approx(1.0 + value)
    assert np.delete(change, 2, axis=1) == pytest.approx(1.0)


def test_a_clearance_that_is_not_taken_up_is_never_negative(scene: Scene) -> None:
    cause = BY_NAME["direction_not_worst_case"]
    assert np.min(cause.adjust(scene, first(cause, scene), -7.0).clearance_in) == 0.0


def test_a_joint_without_any_clearance_is_not_a_candidate(gear, plain):
    clearance = plain.clearance_in.copy()
    clearance[:, 6] = 0.0
    scene = scene_of(gear.model, replace(plain, clearance_in=clearance), gear.discrepancies)
    targets = {c.target for c in BY_NAME["oval_wear"].candidates(scene)}
    assert "joint 7" not in targets
    assert "joint 6" in targets


def test_contact_is_tried_on_neighbours_only(scene: Scene) -> None:
    pairs = {c.target for c in JointContact().candidates(scene)}
    assert pairs == {
        f"joints {p}" for p in ("1,2", "2,3", "3,5", "4,5", "5,6", "6,7", "7,8", "7,9", "9,10")
    }


def test_contact_takes_clearance_from_its_own_joints_only(scene: Scene) -> None:
    cause = JointContact()
    for candidate in cause.candidates(scene):
        taken = scene.clearance_in - cause.adjust(scene, candidate, 0.7).clearance_in
        assert np.min(taken) >= -1e-15
        own = {int(joint) - 1 for joint in str(candidate.target).split()[1].split(",")}
        assert not np.delete(taken, list(own), axis=1).any()


def test_contact_takes_at_most_the_contribution_of_the_one_that_gives_less(gear, scene):
    cause = JointContact()
    candidate = next(c for c in cause.candidates(scene) if c.target == "joints 3,5")
    least = np.min(scene.contribution_in[:, [2, 4]], axis=1)
    lost = (
        scene.over_in - adjusted_worst_case(gear.model, cause.adjust(scene, candidate, 1.0)).over_in
    )
    assert np.all(lost <= 1.02 * least + 1e-6)


@pytest.mark.parametrize("name", ["gauge_bias", "technician_bias"])
def test_a_bias_acts_on_the_rows_of_its_level_alone(name: str, scene: Scene) -> None:
    cause = BY_NAME[name]
    candidate = first(cause, scene)
    column = scene.table.factors[cause.needs[0]]
    moved = cause.adjust(scene, candidate, 0.002).offset_in
    assert moved == pytest.approx(np.where(column == candidate.setting["value"], 0.002, 0.0))


def test_an_empty_gauge_is_not_a_gauge(gear: Gear, plain: DiagnosisTable) -> None:
    gauges = plain.factors["gauge_id"].copy()
    gauges[:20] = ""
    scene = scene_of(
        gear.model,
        replace(plain, factors={**plain.factors, "gauge_id": gauges}),
        gear.discrepancies,
    )
    assert "gauge " not in {c.target for c in BY_NAME["gauge_bias"].candidates(scene)}


def test_sides_are_not_compared_where_there_is_one(gear: Gear, plain: DiagnosisTable) -> None:
    alike = np.full(len(plain), "LH")
    scene = scene_of(
        gear.model, replace(plain, factors={**plain.factors, "side": alike}), gear.discrepancies
    )
    assert list(BY_NAME["side_difference"].candidates(scene)) == []


def test_the_rate_scales_the_prediction(gear: Gear, scene: Scene) -> None:
    cause = BY_NAME["calibration_rate"]
    moved = adjusted_worst_case(gear.model, cause.adjust(scene, only(cause, scene), 0.05)).over_in
    assert moved == pytest.approx(1.05 * scene.over_in, rel=1e-9)


@pytest.mark.parametrize(
    ("name", "larger"), [("approach_hysteresis", "EXTENDING"), ("side_difference", "RH")]
)
def test_two_kinds_of_rows_differ_by_the_parameter(name: str, larger: str, scene: Scene) -> None:
    cause = BY_NAME[name]
    rows = scene.table.factors[cause.needs[0]] == larger
    of_all = [candidate for candidate in cause.candidates(scene) if candidate.target is None]
    assert len(of_all) == 3
    for candidate in of_all:
        offset = cause.adjust(scene, candidate, 0.004).offset_in
        assert offset is not None
        assert np.mean(offset[rows]) - np.mean(offset[~rows]) == pytest.approx(0.004)


def test_the_habit_of_one_technician_shifts_no_rows_of_others(scene: Scene) -> None:
    cause = BY_NAME["approach_hysteresis"]
    habits = [c for c in cause.candidates(scene) if c.target == "technician T-2"]
    assert len(habits) == 3
    own = scene.table.factors["technician_id"] == "T-2"
    extending = scene.table.factors["approach"] == "EXTENDING"
    for candidate in habits:
        offset = cause.adjust(scene, candidate, 0.004).offset_in
        assert offset is not None
        assert not offset[~own].any()
        apart = np.mean(offset[own & extending]) - np.mean(offset[own & ~extending])
        assert apart == pytest.approx(0.004)


def test_a_rigging_change_concerns_one_aircraft_or_one_of_its_gears(scene: Scene) -> None:
    keys = {c.target: c.key for c in RiggingOffset().candidates(scene)}
    for target in ("tail N103", "tail N103 LH", "tail N103 RH"):
        assert keys[target] == ("rigging_offset", "tail N103")


def test_a_gear_whose_worn_joints_were_never_read_has_no_rigging_change(gear: Gear) -> None:
    table = fleet(gear.model)
    values = table.clearance_in.copy()
    blank = table.gears == "N103 LH"
    values[np.ix_(blank, [1, 2, 3])] = np.nan
    scene = scene_of(gear.model, replace(table, clearance_in=values), gear.discrepancies)
    targets = {c.target for c in RiggingOffset().candidates(scene)}
    assert "tail N103 LH" not in targets
    assert "tail N103 RH" in targets


def test_a_re_rigging_after_the_first_visit_is_named_with_its_day(gear: Gear) -> None:
    second = 0.0

    def from_the_second_visit_on(table: DiagnosisTable, _over: Array) -> Array:
        nonlocal second
        own = table.tails == "N103"
        second = float(np.unique(table.quantities["day"][own])[1])
        return -0.01 * (own & (table.quantities["day"] >= second))

    table = fleet(gear.model, from_the_second_visit_on, rows=200)
    (cause,) = diagnose(gear.model, table, gear.discrepancies).causes
    assert (cause.candidate.target, cause.candidate.setting["day"]) == ("tail N103", second)


def test_a_rigging_change_acts_from_its_day_on(scene: Scene) -> None:
    cause = RiggingOffset()
    candidate = next(
        c
        for c in cause.candidates(scene)
        if c.target == "tail N103" and c.setting["day"] is not None
    )
    offset = cause.adjust(scene, candidate, 0.01).offset_in
    own = scene.table.factors["tail_no"] == "N103"
    later = scene.table.quantities["day"] >= candidate.setting["day"]
    assert np.array_equal(offset != 0.0, own & later)


def test_the_date_of_a_change_is_found_in_a_table_with_another_first_day(gear, scene):
    cause = RiggingOffset()
    candidate = next(
        c
        for c in cause.candidates(scene)
        if c.target == "tail N103" and c.setting["day"] is not None
    )
    since = date.fromisoformat(candidate.setting["since"])
    start = since - timedelta(days=10)
    days = np.arange(len(scene.table), dtype=float)
    table = replace(
        scene.table,
        quantities={**scene.table.quantities, "day": days},
        factors={**scene.table.factors, "tail_no": np.full(len(scene.table), "N103")},
        first_day=start.isoformat(),
    )
    moved = cause.adjust(replace(scene, table=table), candidate, 0.01).offset_in
    assert np.array_equal(moved != 0.0, days >= 10)


@pytest.mark.parametrize("name", ["rigging_offset", "date_step"])
def test_a_change_without_dates_in_the_table_does_nothing(name: str, scene: Scene) -> None:
    cause = BY_NAME[name]
    candidate = next(c for c in cause.candidates(scene) if c.setting["day"] is not None)
    kept = {key: values for key, values in scene.table.quantities.items() if key != "day"}
    bare = replace(scene, table=replace(scene.table, quantities=kept))
    assert not np.any(cause.adjust(bare, candidate, 0.01).offset_in)


@pytest.mark.parametrize("name", ["elastic_compliance", "thermal_growth"])
def test_a_missing_cell_makes_a_cause_do_nothing_in_that_row(name, gear, scene):
    cause = BY_NAME[name]
    column = cause.needs[0]
    values = scene.table.quantities[column].copy()
    values[3] = np.nan
    gap = replace(
        scene, table=replace(scene.table, quantities={**scene.table.quantities, column: values})
    )
    moved = adjusted_worst_case(
        gear.model, cause.adjust(gap, first(cause, gap), cause.trial)
    ).over_in
    assert moved[3] == pytest.approx(scene.over_in[3], abs=1e-12)


def test_the_contributions_of_the_joints_add_up_to_the_prediction(scene: Scene) -> None:
    assert scene.contribution_in.sum(axis=1) == pytest.approx(scene.over_in, rel=0.1)
