"""The simulator is right about the mechanism, honest about what it hides, and independent of what
it tests.
"""

from __future__ import annotations

import csv
import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.optimize import minimize

from . import simulator
from .simulator import (
    CATALOGUE,
    COLUMNS,
    KINDS,
    NULLS,
    OFF_CATALOGUE,
    EffectSpec,
    FleetSpec,
    draw_fleet,
    follow_up,
    linkage,
    physics,
    simulate_fleet,
    write_csv,
)
from .simulator.generate import _ALIAS_CAUSES
from .simulator.records import CLEARANCES, DISPLACEMENTS

FOLDER = Path(simulator.__file__).parent
Rows = Callable[[dict[str, Any], dict[str, Any]], np.ndarray]
QUIET = FleetSpec(rows=120, blank_share=0.0)


def _failure_case() -> np.ndarray:
    sizes = np.zeros((1, 10))
    sizes[0, 2], sizes[0, 4] = 0.013, 0.007
    return sizes


def _worn(rows: int = 40) -> np.ndarray:
    return np.random.default_rng(5).uniform(0.0, 0.0145, (rows, 10))


def _misfit(fleet: simulator.Fleet) -> np.ndarray:
    """Mean reading minus the worst case at the recorded clearances, as a reader of the table sees
    it.
    """
    clearance = np.array([fleet.table[name] for name in CLEARANCES], dtype=float).T
    readings = np.array(
        [fleet.table[name] for name in DISPLACEMENTS if name in fleet.table], dtype=float
    )
    return readings.mean(axis=0) - physics.worst_case(linkage.load(fleet.spec.geometry), clearance)


def _changed(one: simulator.Fleet, other: simulator.Fleet) -> np.ndarray:
    """Rows in which any cell differs."""
    rows = len(one.table["record_id"])
    return np.array(
        [any(one.table[c][r] != other.table[c][r] for c in one.table) for r in range(rows)]
    )


def _hide(*effects: EffectSpec, **changes: object) -> FleetSpec:
    return replace(QUIET, kind="single", effects=effects, **changes)


# The mechanism


@pytest.mark.parametrize("name", linkage.names())
def test_every_linkage_has_the_published_failure_case_and_the_rate_of_the_drawing(name):
    geometry = linkage.load(name)
    stored = json.loads((FOLDER / "coordinates.json").read_text(encoding="utf-8"))["linkages"][name]
    assert physics.worst_case(geometry, _failure_case())[0] == pytest.approx(0.0472, abs=2e-4)
    assert geometry.rate == pytest.approx(stored["calibration_rate"], abs=2e-5)


def test_every_loop_closes_to_a_ten_billionth_of_an_inch() -> None:
    sizes = _worn()
    build = linkage.Build.nominal(linkage.load("A"), len(sizes))
    build.lever_tilt[:], build.link_offset[:], build.spread[:] = 0.03, 0.1, 3e-4
    build.length("F1")[:] += 0.01
    angles, unknown = linkage.worst_directions(build, sizes)
    assert (
        linkage.closure_error(build, linkage.clearance_vectors(sizes, angles), unknown).max()
        < 1e-10
    )


def test_a_linkage_that_cannot_close_is_not_a_number() -> None:
    build = linkage.Build.nominal(linkage.load("A"), 2)
    build.length("35")[1] += 5.0
    unknown = linkage.close(build, np.zeros((2, 10, 2)))
    assert np.isfinite(unknown[0]).all()
    assert np.isnan(unknown[1]).all()


@pytest.mark.parametrize("name", linkage.names())
def test_no_row_falls_into_another_assembly_when_its_pins_scatter(name: str) -> None:
    sizes = _worn(400)
    build = linkage.Build.nominal(linkage.load(name), len(sizes))
    angles, unknown = linkage.worst_directions(build, sizes)
    turned = angles + np.random.default_rng(1).normal(0.0, np.radians(8.0), angles.shape)
    moved = linkage.close(build, linkage.clearance_vectors(sizes, turned), unknown)
    drop = linkage.reading(build, unknown) - linkage.reading(build, moved)
    assert drop.min() > 0.0
    assert drop.max() < 0.01


def test_the_gradient_is_the_slope_of_the_reading() -> None:
    geometry = linkage.load("A")
    build = linkage.Build.nominal(geometry, 20)
    build.lever_tilt[:], build.link_offset[:] = 0.02, 0.08
    at = np.random.default_rng(3).normal(0.0, 0.004, (20, 10, 2))
    gradient = linkage.plunger_gradient(build, at, linkage.close(build, at))
    for joint in range(10):
        for axis in range(2):
            step = np.zeros_like(at)
            step[:, joint, axis] = 1e-5
            up, down = (
                linkage.reading(build, linkage.close(build, at + s * step)) for s in (1, -1)
            )
            assert np.allclose((up - down) / 2e-5, gradient[:, joint, axis], atol=1e-6)


def test_no_other_directions_push_the_plunger_further() -> None:
    sizes = _worn(3)
    geometry = linkage.load("A")
    found = physics.worst_case(geometry, sizes)
    rng = np.random.default_rng(11)
    for row, size in enumerate(sizes):
        one = linkage.Build.nominal(geometry, 1)

        def short(
            angles: np.ndarray, size: np.ndarray = size, one: linkage.Build = one
        ) -> tuple[float, np.ndarray]:
            vectors = linkage.clearance_vectors(size[None, :], angles[None, :])
            unknown = linkage.close(one, vectors)
            slope = linkage.plunger_gradient(one, vectors, unknown)[0]
            along = size * (slope[:, 1] * np.cos(angles) - slope[:, 0] * np.sin(angles))
            return -100.0 * float(linkage.reading(one, unknown)[0]), -100.0 * along

        best = max(
            -minimize(short, rng.uniform(-np.pi, np.pi, 10), jac=True, method="BFGS").fun / 100.0
            for _ in range(3)
        )
        assert found[row] == pytest.approx(best, abs=1e-7)


def test_uniform_growth_of_all_parts_scales_the_reading_and_does_nothing_else() -> None:
    geometry = linkage.load("A")
    build = linkage.Build.nominal(geometry, 1)
    build.lengths *= 1.001
    build.spread[:] = 0.001
    vectors = linkage.clearance_vectors(_worn(1), geometry.angles)
    plain = linkage.Build.nominal(geometry, 1)
    grown = linkage.reading(build, linkage.close(build, vectors * 1.001))
    assert grown == pytest.approx(
        1.001 * linkage.reading(plain, linkage.close(plain, vectors)), rel=1e-9
    )


def _gears() -> physics.Gears:
    design = simulate_fleet(FleetSpec(rows=30), 1)._world.design
    return physics.Gears(linkage.load("A"), design, np.zeros((30, 10)))


@pytest.mark.parametrize(
    "tilted", range(4), ids=["short link", "link 6-7", "link 9-10", "locking lever"]
)
def test_a_tilt_acts_like_a_projected_length_shrunk_by_its_cosine(tilted: int) -> None:
    gears = _gears()
    state, shrunk = gears.sound(), gears.sound()
    state.tilt[:, tilted] = 0.03
    for name in (("35",), ("67",), ("910",), ("45", "46"))[tilted]:
        shrunk.parts[:, linkage.LENGTHS.index(name)] += np.cos(0.03) - 1.0
    plain = gears.read(gears.sound())
    effect, expected = gears.read(state) - plain, gears.read(shrunk) - plain
    assert np.abs(effect).min() > 1e-5
    assert np.allclose(effect, expected, rtol=0.12 if tilted == 3 else 0.01)


# Fleets


@pytest.mark.parametrize("kind", KINDS)
def test_a_seed_reproduces_the_fleet(kind: str) -> None:
    one, two = (draw_fleet(17, kind) for _ in range(2))
    assert one.table == two.table
    assert json.dumps(one.label.as_dict()) == json.dumps(two.label.as_dict())
    assert one.table != draw_fleet(18, kind).table


@pytest.mark.parametrize("cause", [*CATALOGUE, *OFF_CATALOGUE])
def test_the_requested_strength_is_reached(cause: str) -> None:
    kind = "single" if cause in CATALOGUE else "off_catalogue"
    label = draw_fleet(110, kind, cause=cause, strength=10.0).label
    assert label.strength == pytest.approx(10.0, rel=0.1)
    assert label.effects[0].strength == pytest.approx(label.strength)


@pytest.mark.parametrize("cause", [*CATALOGUE, *OFF_CATALOGUE])
def test_the_misfit_of_the_table_is_the_effect_plus_the_noise_of_the_label(cause: str) -> None:
    fleet = simulate_fleet(_hide(EffectSpec(cause, strength=25.0)), 3)
    rest = _misfit(fleet) - fleet.label.truth_term - fleet.label.noise_term
    assert np.sqrt(np.mean(rest**2)) < 0.12 * fleet.label.effect_rms_in


def test_a_gauge_that_reads_clearances_wrongly_leaves_the_plunger_readings_alone() -> None:
    bias = {"clearance_bias_in": 0.001, "sign": 1.0}
    fleet = simulate_fleet(_hide(EffectSpec("gauge_bias", parameters=bias)), 3)
    sound = simulate_fleet(QUIET, 3)
    assert all(
        fleet.table[name] == sound.table[name] for name in DISPLACEMENTS if name in sound.table
    )
    rest = _misfit(fleet) - fleet.label.truth_term - fleet.label.noise_term
    assert np.sqrt(np.mean(rest**2)) < 0.12 * fleet.label.effect_rms_in
    assert fleet.label.truth_term.max() <= 0.0


@pytest.mark.parametrize("null", NULLS)
def test_a_sound_fleet_carries_noise_and_nothing_else(null: str) -> None:
    fleet = draw_fleet(4, "null", null=null, faults=False)
    assert fleet.label.causes == ()
    assert not fleet.label.truth_term.any()
    assert 0.002 < fleet.label.noise_rms_in < 0.008
    assert len(fleet.table["record_id"]) == (500 if null == "n500" else 200)


@pytest.mark.parametrize(
    ("cause", "column"),
    [
        ("gauge_bias", "gauge_id"),
        ("technician_bias", "technician_id"),
        ("rigging_offset", "tail_no"),
    ],
)
def test_a_cause_of_one_identity_changes_its_rows_only(cause: str, column: str) -> None:
    sound = simulate_fleet(QUIET, 9)
    fleet = simulate_fleet(_hide(EffectSpec(cause, strength=15.0)), 9)
    name = (fleet.label.causes[0][1] or "").split()[1]
    changed = _changed(sound, fleet)
    own = np.array([value == name for value in fleet.table[column]])
    if cause == "rigging_offset":
        effect = fleet.label.effects[0]
        own &= np.array(fleet.table["inspection_date"]) >= (effect.parameters["from_date"] or "")
        if len((effect.target or "").split()) == 3:
            own &= np.array(fleet.table["side"]) == (effect.target or "").split()[2]
    assert np.array_equal(changed, own)


@pytest.mark.parametrize(
    ("cause", "own"),
    [
        ("side_difference", lambda table, _: np.array(table["side"]) == "RH"),
        ("approach_hysteresis", lambda table, _: np.array(table["approach"]) == "RETRACTING"),
        ("date_step", lambda table, step: np.array(table["inspection_date"]) >= step["from_date"]),
    ],
)
def test_a_cause_of_some_rows_changes_these_and_no_other(cause: str, own: Rows) -> None:
    parameters = {"calibrated_at": 0.0} if cause == "approach_hysteresis" else {}
    fleet = simulate_fleet(_hide(EffectSpec(cause, strength=15.0, parameters=parameters)), 9)
    rows = own(fleet.table, fleet.label.effects[0].parameters)
    assert np.array_equal(_changed(simulate_fleet(QUIET, 9), fleet), rows)


@pytest.mark.parametrize("cause", ["direction_not_worst_case", "oval_wear"])
@pytest.mark.parametrize("target", ["joint 4", "joint 9"])
def test_a_cause_of_one_joint_grows_with_that_joints_clearance(cause: str, target: str) -> None:
    fleet = simulate_fleet(_hide(EffectSpec(cause, target, 10.0)), 2)
    truth = fleet.label.truth_term
    clearance = fleet._world.design.clearance
    agreement = [abs(np.corrcoef(truth, clearance[:, joint])[0, 1]) for joint in range(10)]
    assert int(np.argmax(agreement)) == int(target.split()[1]) - 1
    assert np.sign(truth.sum()) == (1.0 if cause == "oval_wear" else -1.0)


def test_contact_costs_displacement_and_never_adds_any() -> None:
    truth = simulate_fleet(
        _hide(EffectSpec("joint_contact", "joints 3,5", 10.0)), 2
    ).label.truth_term
    assert truth.max() < 1e-6
    assert truth.min() < -0.001


def test_heat_and_pressure_act_relative_to_rigging_and_calibration() -> None:
    heat = simulate_fleet(_hide(EffectSpec("thermal_growth", strength=10.0)), 2)
    warmer = heat._world.design.temperature - 20.0
    assert np.corrcoef(heat.label.truth_term, warmer)[0, 1] ** 2 > 0.98
    assert np.abs(heat.label.truth_term / warmer).max() < 0.001
    press = simulate_fleet(_hide(EffectSpec("elastic_compliance", strength=10.0)), 2)
    below = press._world.design.pressure - 3000.0
    slope, at_full = np.polyfit(below, press.label.truth_term, 1)
    assert np.corrcoef(press.label.truth_term, below)[0, 1] ** 2 > 0.95
    assert abs(at_full) < 0.05 * abs(slope) * 3000.0


def test_two_causes_are_each_as_strong_as_requested() -> None:
    label = draw_fleet(6, "double", strength=12.0).label
    assert len({cause for cause, _ in label.causes}) == 2
    assert [effect.strength for effect in label.effects] == pytest.approx([12.0, 12.0], rel=0.1)


@pytest.mark.parametrize("alias", sorted(_ALIAS_CAUSES))
def test_an_aliased_fleet_lists_the_causes_that_touch_the_same_rows(alias: str) -> None:
    for cause in _ALIAS_CAUSES[alias]:
        spec = _hide(EffectSpec(cause, strength=10.0), alias=alias)
        label = simulate_fleet(spec, 8).label
        assert label.causes[0] in label.aliases
        assert {name for name, _ in label.aliases} >= set(_ALIAS_CAUSES[alias])


def test_a_further_reading_separates_an_aliased_pair() -> None:
    fleet = simulate_fleet(
        _hide(EffectSpec("gauge_bias", strength=20.0), alias="gauge_technician"), 8
    )
    (_, gauge), (_, person) = sorted(fleet.label.aliases)
    gauge, person = (gauge or "").split()[1], (person or "").split()[1]
    more = follow_up(
        fleet, [{"gauge_id": gauge, "technician_id": "T-NEW"}, {"technician_id": person}] * 4, 1
    )
    new = more.label.truth_term[fleet.spec.rows :]
    assert len(more.table["record_id"]) == fleet.spec.rows + 8
    assert more.table["technician_id"][-1] == person
    assert np.abs(new[0::2]).min() > 1e-4
    assert len(set(more.table["record_id"])) == fleet.spec.rows + 8


@pytest.mark.parametrize(
    "cause", sorted(name for name, cause in CATALOGUE.items() if cause.columns)
)
def test_a_needed_column_can_be_missing(cause: str) -> None:
    fleet = draw_fleet(12, "missing_column", cause=cause)
    assert fleet.label.removed_columns
    assert not set(fleet.label.removed_columns) & set(fleet.table)


def test_every_fault_of_the_label_stands_in_the_table_and_no_other() -> None:
    kinds = ("mm_as_in", "factor_10", "swapped_joints", "swapped_side", "implausible")
    clean = simulate_fleet(FleetSpec(), 21)
    fleet = simulate_fleet(FleetSpec(faults=kinds), 21)
    expected = {
        (fault.row, fault.column): (fault.right, fault.written) for fault in fleet.label.faults
    }
    found = {
        (row, column): (clean.table[column][row], value)
        for column, values in fleet.table.items()
        for row, value in enumerate(values)
        if value != clean.table[column][row]
    }
    assert found == expected
    assert {fault.kind for fault in fleet.label.faults} >= set(kinds) - {"swapped_joints"}


def test_the_table_has_the_columns_of_the_interface_and_nothing_of_the_label(tmp_path):
    for seed, kind in enumerate(KINDS):
        fleet = draw_fleet(seed, kind)
        assert set(fleet.table) <= set(COLUMNS)
        write_csv(fleet, tmp_path / "fleet.csv")
        text = (tmp_path / "fleet.csv").read_text(encoding="utf-8")
        words = [*CATALOGUE, *OFF_CATALOGUE, "truth", "label", "seed", "fault", "effect", "kind"]
        assert not [word for word in words if word in text]
        rows = list(csv.reader(text.splitlines()))
        assert rows[0] == list(fleet.table)
        assert len(rows) == fleet.spec.rows + 1
        assert rows[1][0] == "R0001"
