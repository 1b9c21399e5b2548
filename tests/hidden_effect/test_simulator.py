"""The simulator is right about the mechanism, honest about what it hides, and independent of what
it tests.
"""

from __future__ import annotations

import ast
import csv
import json
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import minimize

from . import simulator
from .simulator import (
    BLEMISHES,
    CATALOGUE,
    COLUMNS,
    KINDS,
    NULLS,
    OFF_CATALOGUE,
    EffectSpec,
    FleetSpec,
    blemished_fleet,
    draw_fleet,
    follow_up,
    linkage,
    physics,
    simulate_fleet,
    write_csv,
)
from .simulator.blemishes import UNSEEN, Rows, Truth
from .simulator.generate import _ALIAS_CAUSES
from .simulator.records import CLEARANCES, DISPLACEMENTS

FOLDER = Path(simulator.__file__).parent
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


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_a_seed_reproduces_the_fleet(kind: str) -> None:
    one, two = (draw_fleet(17, kind) for _ in range(2))
    assert one.table == two.table
    assert json.dumps(one.label.as_dict()) == json.dumps(two.label.as_dict())
    assert one.table != draw_fleet(18, kind).table


@pytest.mark.slow
@pytest.mark.parametrize("cause", [*CATALOGUE, *OFF_CATALOGUE])
def test_the_requested_strength_is_reached(cause: str) -> None:
    kind = "single" if cause in CATALOGUE else "off_catalogue"
    label = draw_fleet(110, kind, cause=cause, strength=10.0).label
    assert label.strength == pytest.approx(10.0, rel=0.1)
    assert label.effects[0].strength == pytest.approx(label.strength)


@pytest.mark.slow
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


SEED = 41


@cache
def drawn(case: str, form: str = "strong") -> tuple[Rows, Truth]:
    return blemished_fleet(case, form, SEED, rows=120)


@pytest.mark.slow
@pytest.mark.parametrize("case", BLEMISHES)
def test_a_blemish_changes_the_table_tells_nothing_of_itself_and_leaves_unseen_rows(case):
    rows, truth = drawn(case)
    assert (rows != drawn("sound")[0]) == (case != "sound")
    assert set(rows[0]) - {"mod_status", "base"} == set(drawn("sound")[0][0])
    assert len(truth.unseen) == UNSEEN
    assert all(isinstance(row[joint], float) for row in truth.unseen for joint in CLEARANCES)


@pytest.mark.parametrize("case", ["gonogo", "worn_repair"])
def test_the_same_seed_gives_the_same_fleet(case: str) -> None:
    assert drawn.__wrapped__(case) == drawn(case)


@pytest.mark.slow
@pytest.mark.parametrize("cause", CATALOGUE)
def test_any_listed_cause_stands_beside_a_blemish(cause: str) -> None:
    _, truth = blemished_fleet("round", "mild", SEED, beside=cause, rows=120)
    assert [name for name, _target in truth.causes] == [cause]


ROOT = Path(__file__).parents[2]
SIMULATOR = sorted((Path(__file__).parent / "simulator").glob("*.py"))
PRODUCT = sorted((ROOT / "mlg_troubleshoot").rglob("*.py"))


def imported(file: Path) -> set[str]:
    """First names of the modules that a file imports from outside its own package."""
    found = set()
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found |= {alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.level == 0:
            found.add(str(node.module).split(".")[0])
        elif isinstance(node, ast.ImportFrom) and node.level > 1:
            found.add("a package above its own")
    return found


def test_the_simulator_imports_nothing_of_the_product() -> None:
    allowed = "__future__ collections csv dataclasses datetime functools itertools json math numpy"
    for file in SIMULATOR:
        assert imported(file) <= {*allowed.split(), "pathlib", "scipy", "typing"}, file.name


def test_the_simulator_names_no_file_of_the_product_and_imports_nothing_by_a_name() -> None:
    words = ("mlg", "__import__", "import_module", "exec(", "eval(")
    assert not [
        (f.name, word) for f in SIMULATOR for word in words if word in f.read_text(encoding="utf-8")
    ]


def test_the_product_imports_nothing_of_the_tests_and_names_no_file_of_theirs() -> None:
    imports = ("import tests", "from tests", "import simulator", "from simulator", "conftest")
    words = (*imports, "hidden_effect", "coordinates.json", "truth_term", "simulate_fleet")
    assert not [f for f in PRODUCT if any(word in f.read_text(encoding="utf-8") for word in words)]
