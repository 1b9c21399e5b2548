"""Fleets of more gears than the wear of joints is learnt from, and gears of many visits."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import replace
from datetime import date, timedelta
from pathlib import Path

import numpy as np
import pytest

from mlg_troubleshoot.decision.inspection import Inspection, Side
from mlg_troubleshoot.gear.gear_file import load_gear
from mlg_troubleshoot.life.folding import lives, lives_of
from mlg_troubleshoot.life.forecast import TEACHERS, fit_fleet, stretches, teachers_first
from mlg_troubleshoot.life.logbook import log_of
from mlg_troubleshoot.life.state import GearVisit, state_now, states
from mlg_troubleshoot.records import ReadOptions, read_many
from mlg_troubleshoot.store import Store, StoreError, inspection_record
from mlg_troubleshoot.units import ClearanceConvention
from mlg_troubleshoot.workflows.check import CheckOptions, check_files
from mlg_troubleshoot.workflows.history import Lives, show_fleet, show_lives
from mlg_troubleshoot.workflows.keep import Told, keep, told_by

TAILS = [f"N{n:03d}" for n in range(TEACHERS + 30)]


def fleet_of(folder: Path, landings_of: Sequence[str] = TAILS) -> Store:
    """Gears of three inspections each; only some state their landings."""
    rng = np.random.default_rng(5)
    store = Store(folder / "fleet.sqlite")
    pace = dict(zip(TAILS, 1e-6 * np.exp(0.3 * rng.standard_normal(len(TAILS))), strict=True))
    inspections = [
        Inspection(
            f"{tail}-{visit}",
            tail,
            Side.LH,
            ClearanceConvention.RADIAL,
            {
                joint: round(0.0005 + pace[tail] * 500.0 * visit + 0.0002 * rng.random(), 4)
                for joint in (3, 4, 5)
            },
            inspection_date=date(2020 + visit, 1, 1),
            gear_landings=500.0 * visit if tail in landings_of else None,
        )
        for tail in TAILS
        for visit in (1, 2, 3)
    ]
    store.add([inspection_record(each) for each in inspections])
    return store


@pytest.fixture(scope="module")
def store(tmp_path_factory: pytest.TempPathFactory) -> Store:
    return fleet_of(tmp_path_factory.mktemp("fleet"))


@pytest.fixture(scope="module")
def fleet(store: Store) -> Lives:
    return show_fleet(store, load_gear(), ahead=True)


def test_a_gear_has_the_same_forecast_alone_as_in_its_fleet(store: Store, fleet: Lives) -> None:
    gear = load_gear()
    taught = teachers_first(fleet.forecasts)[:TEACHERS]
    for key in (taught[0], teachers_first(fleet.forecasts)[-1]):
        alone = show_lives(store, gear, *key, ahead=True).forecasts[key]
        assert alone.landings_to_limit == fleet.forecasts[key].landings_to_limit is not None
        assert alone.landings_to_margin == fleet.forecasts[key].landings_to_margin
        assert alone.due_date == fleet.forecasts[key].due_date


def test_the_life_of_one_gear_says_how_far_the_wear_of_its_fleet_is_learnt(store: Store) -> None:
    said: dict[str, list[tuple[int, int | None]]] = {}
    show_lives(
        store,
        load_gear(),
        TAILS[0],
        "LH",
        ahead=True,
        progress=lambda name, *how_far: said.setdefault(name, []).append(how_far),
    )
    learning = said["Learning how joints wear"]
    assert [*said] == ["Reading the store", "Learning how joints wear", "Looking ahead"]
    assert learning == [
        (0, None),
        *((done, len(learning) - 1) for done in range(len(learning) - 1)),
    ]


def test_the_life_of_one_gear_is_shown_without_reading_the_whole_store(store, monkeypatch):
    read: list[str] = []
    found = Store._record
    monkeypatch.setattr(
        Store, "_record", lambda self, row: (read.append(row.tail_no), found(self, row))[1]
    )
    # NEXT is judged by the newest inspections of the fleet: here those of ten gears.
    monkeypatch.setattr("mlg_troubleshoot.life.forecast._MOST", 30)
    show_lives(store, load_gear(), TAILS[0], "LH", ahead=True)
    assert TEACHERS <= len(set(read)) <= TEACHERS + 1 + 10


def test_where_few_gears_state_their_landings_all_of_them_are_learnt_from(tmp_path: Path) -> None:
    last = [tail for tail, _side in teachers_first((tail, "LH") for tail in TAILS)[-5:]]
    by_key = lives(fleet_of(tmp_path, last))
    model = fit_fleet((by_key[key] for key in teachers_first(by_key)), load_gear())
    assert model is not None
    assert {unit.split()[0] for unit in model.paths} == set(last)


def test_a_store_kept_in_many_blocks_is_the_one_kept_at_once(tmp_path, monkeypatch):
    batch = Path(__file__).parents[2] / "inspection_data" / "fleet_batch.csv"
    told = told_by(check_files([batch, batch], CheckOptions()).judgements)
    at_once, in_blocks = (Store(tmp_path / f"{name}.sqlite") for name in ("one", "many"))
    kept = keep(told, at_once)
    monkeypatch.setattr("mlg_troubleshoot.store.database._AT_ONCE", 5)
    assert keep(told, in_blocks) == kept
    assert [r.content for r in in_blocks.all()] == [r.content for r in at_once.all()]


def test_keeping_says_how_far_it_is_also_where_rows_state_repairs(tmp_path: Path) -> None:
    rows = [
        Inspection(
            f"R{n}",
            f"N{n}",
            Side.LH,
            ClearanceConvention.RADIAL,
            {3: 0.001},
            inspection_date=date(2024, 5, 1),
            restored_joints=(3,),
            repair_date=date(2024, 5, 2),
        )
        for n in range(3)
    ]
    told = [Told.of(inspection_record(row)) for row in rows]
    said: list[tuple[int, int]] = []
    store = Store(tmp_path / "store.sqlite")
    keep(told, store, progress=lambda done, total: said.append((done, total)))
    assert said == [(1, 3), (2, 3), (3, 3)]


def test_the_gears_learnt_from_stay_the_same_when_one_comes_in_behind_them() -> None:
    keys = [(tail, "LH") for tail in TAILS]
    order = teachers_first(keys)
    assert [key for key in teachers_first([*keys, ("NEW", "RH")]) if key[0] != "NEW"] == order


def test_another_margin_has_another_forecast(store: Store, fleet: Lives) -> None:
    gear, before = load_gear(), fleet.forecasts
    wide = replace(gear, margin=replace(gear.margin, value=2.0 * gear.margin.value))
    after = show_fleet(store, wide, ahead=True).forecasts
    key = teachers_first(before)[-1]
    assert after[key].landings_to_margin != before[key].landings_to_margin


def test_unpacked_contents_are_judged_by_the_gate_of_their_own_store(store: Store) -> None:
    [life] = lives_of(store, [(TAILS[0], "LH")]).values()
    assert life.inspections[0].inspection.tail_no == TAILS[0]
    strict = Store(store.place, judge=lambda _record, _body: "it is wrong")
    with pytest.raises(StoreError, match="it is wrong"):
        lives_of(strict, [(TAILS[0], "LH")])


# Rows of one gear: the columns of a table, and what stands in them.
SHAPES = {
    "days": ("inspection_date,clearance_3_in", "{day},{c}"),
    "one day": ("inspection_date,clearance_3_in", "2024-05-01,{c}"),
    "no day": ("plunger_displacement_in,clearance_3_in", "{plunger},{c}"),
    "failures": ("inspection_date,outcome", "{day},FAILED"),
    "repairs of days": (
        "inspection_date,restored_joints,repair_date,gear_landings,clearance_3_in",
        "{day},{joint},{day},{landings},{c}",
    ),
    "repairs of any day": (
        "inspection_date,outcome,restored_joints,repair_date,plunger_displacement_in,clearance_3_in",
        "{any_day},{outcome},{joint},{day},{plunger},{c}",
    ),
    "repairs without a day": ("restored_joints,outcome,clearance_3_in", "{joint},{outcome},{c}"),
    "a repair in each row": (
        "inspection_date,outcome,restored_joints,repair_date,clearance_3_in",
        "{any_day},{outcome},3,2024-05-01,{c}",
    ),
    "landings of any day": ("inspection_date,gear_landings,clearance_3_in", "{day},{landings},{c}"),
}


@pytest.mark.parametrize("shape", SHAPES)
def test_a_gear_of_four_times_as_many_visits_takes_four_times_the_work(
    shape: str, tmp_path: Path
) -> None:
    gear = load_gear()
    header, row = SHAPES[shape]

    def read(visits: int, seed: int) -> Sequence[Inspection]:
        rng = np.random.default_rng(seed)
        file = tmp_path / "gear.csv"
        lines = [f"tail_no,side,clearance_convention,{header}"]
        for n in range(visits):
            cells = row.format(
                day=date(2000, 1, 1) + timedelta(days=n),
                any_day=date(2000, 1, 1) + timedelta(days=int(rng.integers(visits))),
                joint=rng.integers(1, 11),
                outcome=rng.choice(["FAILED", "RETRACTED", ""]),
                plunger=f"{rng.uniform(0.0, 0.05):.4f}",
                landings=rng.integers(20_000),
                c=f"{rng.uniform(0.001, 0.009):.5f}",
            )
            lines.append(f"N1,LH,RADIAL,{cells}")
        file.write_text("\n".join(lines), encoding="utf-8")
        rows = read_many([file], ReadOptions.of(gear)).inspections
        assert len(rows) == visits
        return rows

    def calls_of(visits: int) -> int:
        """Calls of a check of a table, of keeping it and another one, and of showing the gear."""
        rows, others = read(visits, 5), read(visits, 6)
        count = 0

        def count_call(_frame: object, event: str, _of: object) -> None:
            nonlocal count
            count += event == "call"

        store = Store(tmp_path / f"{visits}.sqlite")
        before = sys.getprofile()
        sys.setprofile(count_call)
        try:
            states([GearVisit(row) for row in rows], gear)
            keep(map(Told.by, rows), store)
            keep(map(Told.by, others), store, amend=False)
            (life,) = lives(store).values()
            states(life.visits, gear)
            state_now(life.visits, gear)
            log_of(life, gear)
            stretches(life, gear.joint_numbers)
        finally:
            sys.setprofile(before)
        return count

    few, many = calls_of(60), calls_of(240)
    assert many < 5.0 * few
