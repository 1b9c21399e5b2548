"""Landings that begin anew at an overhaul: which falls are one, and how a life goes on from it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from datetime import date
from pathlib import Path
from typing import Any

import pytest

from mlg_troubleshoot.gear.gear_file import load_gear
from mlg_troubleshoot.life.folding import GearLife, life_of
from mlg_troubleshoot.life.forecast import _placed_in_time, stretches
from mlg_troubleshoot.life.state import GearVisit, Moment, contradictions, overhauls
from mlg_troubleshoot.store import Store
from tests.cli.conftest import mlg, row
from tests.decision.conftest import inspected

from .places import table

Visit = tuple[str, float | None, Mapping[int, float]]


def all_joints(clearance: float, **others: float) -> dict[int, float]:
    return dict.fromkeys(range(1, 11), clearance) | {int(j[1:]): v for j, v in others.items()}


# One gear before and after an overhaul: day, landings, clearance of its joints. [1, in]
FIRST: Visit = ("2023-03-01", 1400, all_joints(0.0040))
LAST: Visit = ("2024-03-01", 2200, all_joints(0.0050))
ANEW: Visit = ("2025-03-01", 300, all_joints(0.0005))
NEWEST: Visit = ("2026-03-01", 1100, all_joints(0.0010))
LIFE = (FIRST, LAST, ANEW, NEWEST)


def moments(visits: Sequence[Visit]) -> list[Moment]:
    return [
        Moment.of(
            GearVisit(
                inspected(
                    read,
                    inspection_date=date.fromisoformat(day),
                    gear_landings=landings,
                    gauge_u_in=0.0003,
                )
            )
        )
        for day, landings, read in visits
    ]


def read(visit: Visit, clearance: Mapping[int, float]) -> Visit:
    return (*visit[:2], clearance)


def at(visit: Visit, landings: float | None) -> Visit:
    return visit[0], landings, visit[2]


# Which falls are an overhaul.


def test_landings_that_fall_as_joints_tighten_begin_anew() -> None:
    assert overhauls(moments(LIFE)) == {2: frozenset(range(1, 11))}


def test_an_overhaul_contradicts_nothing() -> None:
    assert contradictions(moments(LIFE), str) == {}


@pytest.mark.parametrize("visits", [(FIRST, LAST, ANEW), (LAST, ANEW, NEWEST), (LAST, ANEW)])
def test_one_inspection_on_a_side_is_enough(visits: Sequence[Visit]) -> None:
    assert len(overhauls(moments(visits))) == 1


@pytest.mark.parametrize(
    ("anew", "some"),
    [
        (all_joints(0.0050), False),
        (all_joints(0.0050, j1=0.0010, j2=0.0010), False),
        (all_joints(0.0050, j1=0.0010, j2=0.0010, j3=0.0010), True),
        (all_joints(0.0010, j7=0.0065), False),
        (all_joints(0.0045), False),
        ({1: 0.001, 2: 0.001, 3: 0.001}, True),
    ],
    ids=["as worn", "two tighter", "three tighter", "one wider", "hardly tighter", "three read"],
)
def test_several_joints_must_clearly_read_tighter_and_none_wider(anew, some):
    visits = FIRST, LAST, read(ANEW, anew), read(NEWEST, anew)
    assert bool(overhauls(moments(visits))) is some


@pytest.mark.parametrize(
    "visits",
    [
        (FIRST, at(LAST, 140), ANEW),
        (FIRST, LAST, ANEW, at(NEWEST, 3000)),
        (at(FIRST, 100), LAST, ANEW, NEWEST),
    ],
    ids=["one low", "goes on above", "one high"],
)
def test_one_mistyped_number_begins_nothing(visits: Sequence[Visit]) -> None:
    assert 2 not in overhauls(moments(visits))


def test_joints_that_were_recorded_as_restored_in_between_need_no_reading() -> None:
    work = Moment("2024-09-01", None, joints=frozenset({1, 2, 3}))
    visits = [FIRST, LAST, read(ANEW, all_joints(0.0050))]
    assert overhauls([*moments(visits), work]) == {2: frozenset({1, 2, 3})}


def test_a_slip_after_an_overhaul_is_still_named() -> None:
    visits = *LIFE, ("2026-09-01", 130, all_joints(0.0025))
    assert set(contradictions(moments(visits), str)) == {3, 4}


# How a life goes on.


@pytest.fixture
def kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> GearLife:
    """The life of that gear, of which joint 4 was left as it was."""
    monkeypatch.setenv("MLG_STORE", str(tmp_path / "store.sqlite"))
    keep(tmp_path, [FIRST, LAST, read(ANEW, all_joints(0.0005, j4=0.0050)), NEWEST])
    return life_of(Store(tmp_path / "store.sqlite"), "N1", "LH")


def keep(folder: Path, visits: Sequence[Visit]) -> None:
    rows = [
        row(
            record_id=day,
            tail_no="N1",
            inspection_date=day,
            gear_landings=f"{landings}",
            gauge_u_in="0.0003",
            **{f"clearance_{joint}_in": f"{value}" for joint, value in clearance.items()},
        )
        for day, landings, clearance in visits
    ]
    mlg("check", table(folder, *rows), "--keep")


def fleet() -> dict[str, Any]:
    (found,) = mlg("fleet", "--json").json["gears"]
    return dict(found)


def test_a_joint_that_was_restored_begins_anew(kept: GearLife) -> None:
    before, after = stretches(kept, [1])[1]
    assert [at for at, *_ in before.readings] == [-800.0, 0.0]
    assert [at for at, *_ in after.readings] == [300.0, 1100.0]
    assert after.begun == 0.0


def test_a_joint_that_was_left_goes_on_wearing(kept: GearLife) -> None:
    (only,) = stretches(kept, [4])[4]
    assert (only.begun, [at for at, *_ in only.readings]) == (-2200.0, [-800, 0, 300, 1100])


def test_days_and_landings_are_those_between_overhauls(kept: GearLife) -> None:
    eras = [[landings for _day, landings in era] for era in _placed_in_time(kept)]
    assert eras == [[1400, 2200], [300, 1100]]


def test_the_gear_has_a_forecast_with_its_day_and_no_warning(kept: GearLife) -> None:
    found = fleet()
    assert kept.warnings == ()
    assert found["next_inspection_landings"] > 0.0
    assert found["due_date"] > "2026-03-01"


def test_history_says_from_where_landings_count(kept: GearLife) -> None:
    said = "Landings begin anew on 2025-03-01: taken as an overhaul that restored #1, #2, #3, #5,"
    assert mlg("history", "N1", "LH", "--json", "--no-forecast").json["notes"] == [*kept.notes]
    assert kept.notes[0].startswith(said)
    assert said in " ".join(mlg("history", "N1", "LH", "--no-forecast").out.split())


def test_the_plot_begins_before_the_overhaul_and_marks_it(kept: GearLife) -> None:
    from mlg_troubleshoot.life.forecast import Forecast
    from mlg_troubleshoot.reporting.figures import Lengths
    from mlg_troubleshoot.reporting.fleet_report import wear_figure

    svg = str(wear_figure(kept, Forecast(), load_gear(), Lengths()))
    marked = {
        panel.partition(">#")[2].partition(" ")[0]
        for panel in svg.split('font-weight="bold"')[1:]
        if "<polygon" in panel
    }
    assert marked >= {"1", "2", "3", "5"}
    assert "4" not in marked
    assert ">−500</text>" in svg


def test_a_joint_that_was_not_read_since_it_was_restored_is_drawn(kept, monkeypatch):
    from mlg_troubleshoot.life import forecast
    from mlg_troubleshoot.reporting.figures import Lengths
    from mlg_troubleshoot.reporting.fleet_report import wear_figure

    between = [forecast.Stretch(0.0, [(800.0, 0.01, 0.0005)]), forecast.Stretch(900.0, [])]
    monkeypatch.setattr(forecast, "stretches", lambda _life, _joints: {1: between})
    svg = str(wear_figure(kept, forecast.Forecast(), load_gear(), Lengths()))
    assert "<polygon" in svg


@pytest.mark.parametrize("joints", [("1", "2"), ("1", "2", "3")])
def test_the_warning_says_how_an_overhaul_is_recorded_and_that_settles_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, joints: tuple[str, ...]
) -> None:
    monkeypatch.setenv("MLG_STORE", str(tmp_path / "store.sqlite"))
    keep(tmp_path, [FIRST, LAST, read(ANEW, all_joints(0.0050))])
    (before,) = mlg("history", "N1", "LH", "--json", "--no-forecast").json["warnings"]
    assert "After an overhaul record its joints: mlg history repair N1 LH --joint N" in before
    named = [word for joint in joints for word in ("--joint", joint)]
    mlg("history", "repair", "N1", "LH", *named, "--date", "2024-09-01")
    after = mlg("history", "N1", "LH", "--json", "--no-forecast").json["warnings"]
    assert bool(after) is (len(joints) < 3)
