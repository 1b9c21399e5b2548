"""What the kept inspections of a fleet teach of its next gear."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from mlg_troubleshoot.decision.belief import SHARES, WEAR, given_readings
from mlg_troubleshoot.decision.inspection import Fleet, Inspection
from mlg_troubleshoot.decision.learning import learned
from mlg_troubleshoot.decision.prediction import Cases
from mlg_troubleshoot.decision.priors import PRIORS
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.life.forecast import expected_of
from mlg_troubleshoot.store import Store
from mlg_troubleshoot.workflows.check import CheckOptions, check_files
from mlg_troubleshoot.workflows.keep import keep, told_by
from tests.decision.conftest import belief_of, every_joint, inspected
from tests.decision.technician import Hangar, World


def read(pins: str, n: int, joints: int = 10) -> list[Inspection]:
    """Gears of the independent simulator, the plunger read on each."""
    hangar = Hangar(World(pins, pins=pins), n, 51)
    for one in hangar.gears:
        for j in range(1, joints + 1):
            hangar.read(one, j)
        hangar.read_plunger(one)
    return [
        inspected(
            {j: one.row[f"clearance_{j}_in"] for j in range(1, joints + 1)},
            readings_in=(one.row["plunger_displacement_in"],),
        )
        for one in hangar.gears
    ]


def test_a_fleet_whose_pins_are_held_says_so(gear: Gear) -> None:
    assert learned(gear, read("axial", 40)).loaded > 0.95


def test_a_fleet_whose_pins_rest_anywhere_says_so(gear: Gear) -> None:
    assert learned(gear, read("uniform", 40)).loaded < 0.01


def test_one_gear_is_not_a_fleet(gear: Gear) -> None:
    assert learned(gear, read("axial", 8)[:1]).loaded < 0.5


def test_gears_that_were_not_read_whole_say_nothing_of_their_pins(gear: Gear) -> None:
    found = learned(gear, read("axial", 40, joints=9))
    assert found.loaded == pytest.approx(PRIORS.loaded, rel=0.05)


@pytest.mark.parametrize(("clearance_in", "more"), [(0.0002, False), (0.006, True)])
def test_unread_joints_are_worn_as_the_fleet_is(gear, clearance_in, more):
    fleet = learned(gear, [inspected(every_joint(clearance_in))] * 20)
    expected = [
        (given_readings(Cases.of(gear, [inspected({})], fleet=known))[0] @ WEAR @ SHARES)[0]
        for known in (Fleet(), fleet)
    ]
    assert bool(expected[1] > expected[0]) is more


def test_a_small_fleet_excludes_no_level_of_wear(gear: Gear) -> None:
    new_parts = learned(gear, [inspected(every_joint(0.0002))] * 2)
    assert min(new_parts.levels) > 0.05


def test_a_failure_near_the_bound_is_repaired_again_more_often_where_loads_hold_the_pins(gear):
    """Plain draws of the model: .025 with free pins, .203 with held ones."""
    reading = float(0.8 * gear.model.plunger_amplification() @ np.full(10, 0.0035))
    row = inspected(every_joint(0.0035), readings_in=(reading,))
    least, most = (
        belief_of(Cases.of(gear, [row], fleet=Fleet(loaded))) for loaded in (0.001, 0.999)
    )
    shut = np.arange(10) < 2
    assert most.second_repair(shut) == pytest.approx(0.203, abs=0.02)
    assert least.second_repair(shut) == pytest.approx(0.025, abs=0.02)


@pytest.fixture(scope="module")
def store(tmp_path_factory: pytest.TempPathFactory) -> Store:
    """Ten gears of one fleet, kept; one of them inspected twice."""
    folder = tmp_path_factory.mktemp("kept")
    rows = ["record_id,tail_no,side,clearance_convention,inspection_date,clearance_3_in"]
    rows += [f"R{k},N{k % 10},LH,RADIAL,2026-03-{k + 1:02},0.004" for k in range(11)]
    (folder / "fleet.csv").write_text("\n".join(rows), encoding="utf-8")
    found, options = Store(folder / "kept.sqlite"), CheckOptions()
    keep(told_by(check_files([folder / "fleet.csv"], options).judgements), found)
    return found


def test_the_last_inspection_of_each_gear_is_learned_from(gear: Gear, store: Store) -> None:
    fleet = expected_of(store, gear)
    assert fleet is not None
    assert fleet.text.startswith("Expected from 10 gears kept:")


def test_an_empty_store_teaches_nothing(gear: Gear, tmp_path: Path) -> None:
    assert expected_of(Store(tmp_path / "none.sqlite"), gear) is None


def test_a_few_gears_are_not_a_fleet(gear: Gear, tmp_path: Path) -> None:
    rows = ["record_id,tail_no,side,clearance_convention,clearance_3_in"]
    rows += [f"R{k},N{k},LH,RADIAL,0.004" for k in range(9)]
    (tmp_path / "few.csv").write_text("\n".join(rows), encoding="utf-8")
    few, options = Store(tmp_path / "kept.sqlite"), CheckOptions()
    keep(told_by(check_files([tmp_path / "few.csv"], options).judgements), few)
    assert expected_of(few, gear) is None


def test_a_check_beside_a_store_says_what_it_expects(store: Store, tmp_path: Path) -> None:
    file = tmp_path / "next.csv"
    file.write_text(
        "record_id,tail_no,side,clearance_convention,clearance_3_in\nR9,N9,LH,RADIAL,0.004\n"
    )
    assert any(
        "Expected from 10 gears kept" in note for note in check_files([file], store=store).notes
    )


def test_what_is_kept_changes_no_verdict(store: Store, tmp_path: Path) -> None:
    file = tmp_path / "next.csv"
    cells = ",".join(["0.0025"] * 10)
    header = ",".join(f"clearance_{j}_in" for j in range(1, 11))
    file.write_text(
        f"record_id,tail_no,side,clearance_convention,{header}\nR9,N9,LH,RADIAL,{cells}\n"
    )
    alone, beside = (check_files([file], store=kept).judgements[0] for kept in (None, store))
    assert alone.verdict is beside.verdict
    assert alone.probability_within_margin == beside.probability_within_margin
