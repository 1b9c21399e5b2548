"""Fleets of more gears than the wear of joints is learnt from."""

from __future__ import annotations

import json
import shutil
import sqlite3
from collections.abc import Mapping, Sequence
from dataclasses import replace
from datetime import date
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mlg_troubleshoot.decision.inspection import Inspection, Side
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.gear.gear_file import load_gear
from mlg_troubleshoot.life import remembered
from mlg_troubleshoot.life.chronology import Moment
from mlg_troubleshoot.life.folding import GearKey, GearLife, KeptInspection, lives, lives_of
from mlg_troubleshoot.life.forecast import (
    TEACHERS,
    departures,
    fit_fleet,
    taught_up_to,
    teachers_first,
)
from mlg_troubleshoot.life.landings_left import FleetLine
from mlg_troubleshoot.life.unrecorded_work import suggestions
from mlg_troubleshoot.reporting.life_json import fleet_as_json
from mlg_troubleshoot.store import RecordKind, Store, StoreError, inspection_record, packed
from mlg_troubleshoot.units import ClearanceConvention
from mlg_troubleshoot.wear import WearModel
from mlg_troubleshoot.workflows.check import CheckOptions, check_files, check_inspection
from mlg_troubleshoot.workflows.history import Lives, show_fleet, show_lives, void
from mlg_troubleshoot.workflows.keep import keep

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


def test_a_gear_has_the_same_forecast_alone_as_in_its_fleet(tmp_path: Path) -> None:
    store, gear = fleet_of(tmp_path), load_gear()
    fleet = show_fleet(store, gear, ahead=True)
    taught = teachers_first(fleet.forecasts)[:TEACHERS]
    for key in (taught[0], teachers_first(fleet.forecasts)[-1]):
        alone = show_lives(store, gear, *key, ahead=True).forecasts[key]
        assert alone.landings_to_limit == fleet.forecasts[key].landings_to_limit is not None
        assert alone.landings_to_margin == fleet.forecasts[key].landings_to_margin
        assert alone.due_date == fleet.forecasts[key].due_date


def test_how_far_a_gear_departs_from_its_wear_does_not_depend_on_other_gears(
    tmp_path: Path,
) -> None:
    fleet = show_fleet(fleet_of(tmp_path), load_gear(), ahead=True)
    assert fleet.model is not None
    key = fleet.lives[-1].key
    alone = departures(fleet.lives[-1:], fleet.model, fleet.gear)
    assert alone == [fleet.forecasts[key].departures] != [{}]


def test_the_life_of_one_gear_says_how_far_the_wear_of_its_fleet_is_learnt(tmp_path: Path) -> None:
    said: dict[str, list[tuple[int, int | None]]] = {}
    show_lives(
        fleet_of(tmp_path),
        load_gear(),
        TAILS[0],
        "LH",
        ahead=True,
        progress=lambda name, *how_far: said.setdefault(name, []).append(how_far),
    )
    learning = said["Learning how joints wear"]
    assert [*said] == ["Learning how joints wear", "Looking ahead"]
    assert learning == [
        (0, None),
        *((done, len(learning) - 1) for done in range(len(learning) - 1)),
    ]


def test_the_life_of_one_gear_is_shown_without_reading_the_whole_store(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    store = fleet_of(tmp_path)
    read: list[str] = []
    found = Store._record
    monkeypatch.setattr(
        Store, "_record", lambda self, row: (read.append(row.tail_no), found(self, row))[1]
    )
    show_lives(store, load_gear(), TAILS[0], "LH", ahead=True)
    assert TEACHERS <= len(set(read)) <= TEACHERS + 1


def test_where_few_gears_state_their_landings_all_of_them_are_learnt_from(tmp_path: Path) -> None:
    last = [tail for tail, _side in teachers_first((tail, "LH") for tail in TAILS)[-5:]]
    by_key = lives(fleet_of(tmp_path, last))
    model = fit_fleet((by_key[key] for key in teachers_first(by_key)), load_gear())
    assert model is not None
    assert {unit.split()[0] for unit in model.paths} == set(last)


def test_a_store_kept_in_many_blocks_is_the_one_kept_at_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    batch = Path(__file__).parents[2] / "inspection_data" / "fleet_batch.csv"
    result = check_files([batch, batch], CheckOptions())
    at_once, in_blocks = (Store(tmp_path / f"{name}.sqlite") for name in ("one", "many"))
    kept = keep(result, CheckOptions(), at_once)
    monkeypatch.setattr("mlg_troubleshoot.workflows.keep.AT_ONCE", 7)
    monkeypatch.setattr("mlg_troubleshoot.store.database._AT_ONCE", 5)
    assert keep(result, CheckOptions(), in_blocks) == kept
    assert [*in_blocks.export()] == [*at_once.export()]


def test_rows_that_stand_twice_in_a_call_are_kept_once_as_they_stood_last(tmp_path: Path) -> None:
    batch = Path(__file__).parents[2] / "inspection_data" / "fleet_batch.csv"
    store = Store(tmp_path / "store.sqlite")
    kept = keep(check_files([batch, batch], CheckOptions()), CheckOptions(), store)
    stored = [record for record in store.all() if record.kind is RecordKind.INSPECTION]
    assert len(stored) == kept.new == kept.known == len(store.all()) - kept.new
    assert all("the same inspection as row" in str(record.body) for record in stored)


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
    checked = [check_inspection(row, CheckOptions()) for row in rows]
    result = replace(checked[0], judgements=tuple(each.judgements[0] for each in checked))
    said: list[tuple[int, int]] = []
    store = Store(tmp_path / "store.sqlite")
    keep(result, CheckOptions(), store, progress=lambda done, total: said.append((done, total)))
    assert said == [(1, 3), (2, 3), (3, 3)]


def test_the_gears_learnt_from_stay_the_same_when_one_comes_in_behind_them() -> None:
    keys = [(tail, "LH") for tail in TAILS]
    order = teachers_first(keys)
    assert [key for key in teachers_first([*keys, ("NEW", "RH")]) if key[0] != "NEW"] == order


@pytest.fixture
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    return tmp_path / "cache" / "mlg"


def computed(monkeypatch: pytest.MonkeyPatch, store: Store) -> tuple[Lives, set[GearKey]]:
    """A fleet, and the gears of it whose forecast was not recalled."""
    asked: set[GearKey] = set()
    found = remembered.forecast

    def forecast(lives: Sequence[GearLife], model: WearModel | None, gear: Gear) -> Any:
        asked.update(life.key for life in lives if model is not None)
        return found(lives, model, gear)

    with monkeypatch.context() as patch:
        patch.setattr(remembered, "forecast", forecast)
        return show_fleet(store, load_gear(), ahead=True), asked


WORN = {3: 0.004, 4: 0.003, 5: 0.004}


def one_more(store: Store, tail: str, clearance_in: Mapping[int, float] = WORN) -> None:
    """Keep one new inspection of a gear."""
    last = Inspection(
        f"{tail}-4",
        tail,
        Side.LH,
        ClearanceConvention.RADIAL,
        clearance_in,
        inspection_date=date(2024, 1, 1),
        gear_landings=2000.0,
    )
    store.add([inspection_record(last)])


def test_a_second_look_at_a_fleet_computes_nothing_and_says_the_same(
    tmp_path: Path, cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    store = fleet_of(tmp_path)
    first, asked = computed(monkeypatch, store)
    assert len(asked) == len(TAILS)
    monkeypatch.setattr(remembered, "fit_wear", None)
    again, asked = computed(monkeypatch, store)
    assert not asked
    assert again == first


def test_after_one_new_inspection_only_its_gear_is_forecast_again(
    tmp_path: Path, cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    store = fleet_of(tmp_path)
    before, _ = computed(monkeypatch, store)
    key = teachers_first(before.forecasts)[-1]
    one_more(store, key[0])
    found, asked = computed(monkeypatch, store)
    assert asked == {key}
    shutil.rmtree(cache)
    fresh, asked = computed(monkeypatch, store)
    assert len(asked) == len(TAILS)
    assert found == fresh
    assert found.forecasts[key] != before.forecasts[key]


def test_a_new_inspection_of_a_gear_that_wear_is_learnt_from_changes_its_own_forecast_only(
    tmp_path: Path, cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    store = fleet_of(tmp_path)
    before, _ = computed(monkeypatch, store)
    key = teachers_first(before.forecasts)[0]
    one_more(store, key[0])
    found, asked = computed(monkeypatch, store)
    assert asked == {key}
    assert found.forecasts[key] != before.forecasts[key]
    shutil.rmtree(cache)
    assert computed(monkeypatch, store)[0] == found


def test_wear_is_learnt_again_when_the_number_of_records_reaches_its_next_two_digits(
    tmp_path: Path, cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    store = fleet_of(tmp_path)
    before, _ = computed(monkeypatch, store)
    order = [tail for tail, _side in teachers_first(before.forecasts)]
    for tail in (order[0], *order[-8:]):
        one_more(store, tail)
    assert store.count() == 399
    assert len(computed(monkeypatch, store)[1]) == 9
    one_more(store, order[-9])
    found, asked = computed(monkeypatch, store)
    assert len(asked) == len(TAILS)
    assert found.model != before.model


def test_an_inspection_that_wear_was_learnt_from_is_not_once_it_is_void(
    tmp_path: Path, cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    store = fleet_of(tmp_path)
    before, _ = computed(monkeypatch, store)
    void(store, f"{teachers_first(before.forecasts)[0][0]}-3", "wrong gear")
    assert len(computed(monkeypatch, store)[1]) == len(TAILS)


def test_a_new_gear_does_not_take_the_place_of_one_that_wear_is_learnt_from(
    tmp_path: Path, cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    store = fleet_of(tmp_path)
    before, _ = computed(monkeypatch, store)
    named = ((f"NEW{n}", "LH") for n in range(1000))
    [new] = [key for key in named if teachers_first([key, *before.forecasts])[0] == key][:1]
    one_more(store, new[0])
    assert computed(monkeypatch, store)[1] == {new}


def test_the_wear_of_a_small_fleet_is_learnt_from_every_record(tmp_path: Path) -> None:
    store = fleet_of(tmp_path)
    one_more(store, TAILS[0])
    assert taught_up_to(store, TEACHERS) >= store.count() == 391
    assert taught_up_to(store, TEACHERS + 1) == 390


def test_a_void_inspection_is_not_remembered(
    tmp_path: Path, cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    store = fleet_of(tmp_path)
    before, _ = computed(monkeypatch, store)
    key = teachers_first(before.forecasts)[-1]
    void(store, f"{key[0]}-3", "wrong gear")
    _, asked = computed(monkeypatch, store)
    assert asked == {key}


def test_another_margin_has_another_forecast(tmp_path: Path, cache: Path) -> None:
    store, gear = fleet_of(tmp_path), load_gear()
    before = show_fleet(store, gear, ahead=True).forecasts
    wide = replace(gear, margin=replace(gear.margin, value=2.0 * gear.margin.value))
    after = show_fleet(store, wide, ahead=True).forecasts
    key = teachers_first(before)[-1]
    assert after[key].landings_to_margin != before[key].landings_to_margin


def test_a_damaged_file_of_what_is_remembered_is_left_aside(
    tmp_path: Path, cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    store = fleet_of(tmp_path)
    first, _ = computed(monkeypatch, store)
    for file in cache.iterdir():
        file.write_bytes(file.read_bytes()[:-9])
    again, asked = computed(monkeypatch, store)
    assert len(asked) == len(TAILS)
    assert again == first


def test_where_nothing_can_be_remembered_forecasts_are_made_all_the_same(
    tmp_path: Path, cache: Path
) -> None:
    cache.parent.mkdir()
    cache.write_text("no folder")
    assert show_fleet(fleet_of(tmp_path), load_gear(), ahead=True).model is not None


def test_what_was_forecast_until_it_was_interrupted_is_remembered(
    tmp_path: Path, cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    store = fleet_of(tmp_path)

    def impatient(name: str, done: int, _total: int | None) -> None:
        if done and name == "Looking ahead":
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        show_fleet(store, load_gear(), ahead=True, progress=impatient)
    _, asked = computed(monkeypatch, store)
    assert 0 < len(asked) < len(TAILS)


def test_unpacked_contents_are_judged_by_the_gate_of_their_own_store(tmp_path: Path) -> None:
    store = fleet_of(tmp_path)
    [life] = lives(store, TAILS[0]).values()
    assert life.inspections[0].inspection.tail_no == TAILS[0]
    strict = Store(store.place, judge=lambda _record, _body: "it is wrong")
    with pytest.raises(StoreError, match="it is wrong"):
        lives(strict, TAILS[0])


def unpacked(monkeypatch: pytest.MonkeyPatch, store: Store, gear: Gear) -> tuple[Lives, set[str]]:
    """The lines of a fleet without forecasts, and the inspections that were unpacked for them."""
    read: set[str] = set()
    found = KeptInspection.moment.fget

    def moment(kept: KeptInspection) -> Moment:
        read.add(kept.record.record_id)
        return found(kept)

    with monkeypatch.context() as patch:
        patch.setattr(KeptInspection, "moment", property(moment))
        return show_fleet(store, gear, ahead=False, whole=False), read


def test_a_second_look_unpacks_the_gears_that_changed_only(
    tmp_path: Path, cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    store, gear = fleet_of(tmp_path), load_gear()
    first, read = unpacked(monkeypatch, store, gear)
    assert len(read) == 3 * len(TAILS)
    again, read = unpacked(monkeypatch, store, gear)
    assert not read
    assert again == first
    one_more(store, TAILS[0])
    after, read = unpacked(monkeypatch, store, gear)
    assert read == {f"{TAILS[0]}-{visit}" for visit in (1, 2, 3, 4)}
    assert after.lines == tuple(map(FleetLine.of, lives(store).values()))


def test_gears_are_read_again_for_a_gear_file_that_allows_other_readings(
    tmp_path: Path, cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    store, gear = fleet_of(tmp_path), load_gear()
    unpacked(monkeypatch, store, gear)
    strict = replace(gear, hard_limit=replace(gear.hard_limit, value=0.5))
    assert len(unpacked(monkeypatch, store, strict)[1]) == 3 * len(TAILS)


def test_gears_are_read_again_where_a_content_was_changed_under_its_old_hash(
    tmp_path: Path, cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    store, gear = fleet_of(tmp_path), load_gear()
    unpacked(monkeypatch, store, gear)
    wrong = {"inspection": {**store.all()[0].body["inspection"], "gear_landings": 7.0}}
    file = sqlite3.connect(store.place)
    file.execute("DROP TRIGGER mlg_no_update")
    file.execute("UPDATE mlg_records SET body = ? WHERE seq = 1", (packed(wrong),))
    file.commit()
    assert len(unpacked(monkeypatch, store, gear)[1]) == 3 * len(TAILS)


def test_gears_are_read_again_by_another_version_of_the_program(
    tmp_path: Path, cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    store, gear = fleet_of(tmp_path), load_gear()
    unpacked(monkeypatch, store, gear)
    monkeypatch.setattr(remembered, "version", lambda name: f"another {name}")
    assert len(unpacked(monkeypatch, store, gear)[1]) == 3 * len(TAILS)


def test_a_look_without_forecasts_leaves_them_remembered(
    tmp_path: Path, cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    store = fleet_of(tmp_path)
    computed(monkeypatch, store)
    show_fleet(store, load_gear(), ahead=False, whole=False)
    assert not computed(monkeypatch, store)[1]


def test_what_a_fleet_says_with_its_memory_is_what_it_says_without_to_the_last_digit(
    tmp_path: Path, cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    store, gear = fleet_of(tmp_path), load_gear()

    def said() -> str:
        found = show_fleet(store, gear, ahead=True, whole=False)
        read = partial(lives_of, store)
        noted = suggestions(found.lines, found.forecasts, read, found.model, gear)
        text = json.dumps(fleet_as_json(found.lines, found.forecasts))
        return f"{text} {noted} {[each.departures for each in found.forecasts.values()]}"

    said()
    last = teachers_first(found for found in lives(store))[-2:]
    for tail, _side in last:
        one_more(store, tail, {3: 0.0, 4: 0.0, 5: 0.0})
    remembering = said()
    assert "Restored without a record" in remembering
    shutil.rmtree(cache)
    assert said() == remembering
