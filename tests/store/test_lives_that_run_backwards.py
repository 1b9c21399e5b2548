"""Landings and dates of one gear that disagree, and gears that are due now: what history and fleet
say of them.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import date, timedelta
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mlg_troubleshoot.decision.inspection import Inspection, Side
from mlg_troubleshoot.gear.gear_file import load_gear
from mlg_troubleshoot.life.folding import judge_lives, life_of, lives
from mlg_troubleshoot.life.forecast import (
    FleetLine,
    LifeAhead,
    fit_fleet,
    forecast,
    suggestion,
    wear_paths,
)
from mlg_troubleshoot.store import Store, inspection_record
from mlg_troubleshoot.units import ClearanceConvention
from mlg_troubleshoot.workflows.check import load_index_table
from mlg_troubleshoot.workflows.history import Lives
from tests.cli.conftest import Run, mlg, row

from .places import table

# Landings and the readings of #3 and #5 at the yearly inspections of one gear. [1, in, in]
YEARS = (
    (14, 0.0011, 0.0010),
    (863, 0.0016, 0.0015),
    (1672, 0.0022, 0.0021),
    (2407, 0.0120, 0.0110),
)
SLIP = {3: 240}
QUANTILES = ("landings_to_limit", "landings_to_margin")


@pytest.fixture(autouse=True)
def _place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MLG_STORE", str(tmp_path / "store.sqlite"))


def years(
    folder: Path,
    landings: Mapping[int, float],
    *,
    only: Sequence[int] = range(4),
    name: str = "slip",
) -> Path:
    """Four yearly inspections of N507 LH, of some years, some with other landings than they had."""
    rows = []
    for n in only:
        stated, third, fifth = YEARS[n]
        read = {"clearance_3_in": f"{third:.4f}", "clearance_5_in": f"{fifth:.4f}"}
        when = {
            "inspection_date": f"{2023 + n}-03-01",
            "gear_landings": f"{landings.get(n, stated)}",
        }
        rows.append(row(record_id=f"S{n + 1}", tail_no="N507", side="LH", **when, **read))
    return table(folder, *rows, name=f"{name}.csv")


def kept(folder: Path, landings: Mapping[int, float]) -> None:
    assert mlg("check", years(folder, landings), "--keep").code == 1


def gear_of_the_fleet(*more: str) -> dict[str, Any]:
    (found,) = mlg("fleet", "--json", *more).json["gears"]
    return dict(found)


def life(*more: str) -> dict[str, Any]:
    return dict(mlg("history", "N507", "LH", "--json", *more).json)


def restored(joints: Iterable[int], day: str, landings: str) -> Run:
    """Enter a repair of joints of N507 LH."""
    of = [f"--joint={joint}" for joint in joints]
    return mlg("history", "repair", "N507", "LH", *of, "--date", day, "--landings", landings)


def words_of(page: Path) -> str:
    return re.sub(r"\s+", " ", re.sub(r"<[^>]+>", " ", page.read_text(encoding="utf-8")))


# What a check says.


def test_a_check_names_row_and_cell_of_landings_that_fall(tmp_path: Path) -> None:
    file = years(tmp_path, SLIP)
    said = f"240 landings on 2026-03-01 (row 5 of {file}, P5, O5) cannot both be right"
    assert said in mlg("check", file).err


def test_the_rows_between_which_landings_fall_carry_the_warning_in_json(tmp_path: Path) -> None:
    rows = mlg("check", years(tmp_path, SLIP), "--json").json["inspections"]
    assert [any("landings never fall" in text for text in each["warnings"]) for each in rows] == [
        False,
        False,
        True,
        True,
    ]


def test_a_date_that_runs_backwards_is_named_as_landings_are(tmp_path: Path) -> None:
    file = years(tmp_path, {})
    file.write_text(
        file.read_text(encoding="utf-8").replace("2025-03-01", "2022-03-01"), encoding="utf-8"
    )
    assert f"1672 landings on 2022-03-01 (row 4 of {file}, P4, O4) and" in mlg("check", file).err


def test_a_life_in_order_is_not_warned_of(tmp_path: Path) -> None:
    run = mlg("check", years(tmp_path, {}), "--keep")
    assert "landings never fall" not in run.err
    assert life("--no-forecast")["warnings"] == []


def test_inspections_of_two_gears_are_not_compared(tmp_path: Path) -> None:
    text = years(tmp_path, SLIP).read_text(encoding="utf-8").replace("S4,N507,LH", "S4,N507,RH")
    (tmp_path / "two.csv").write_text(text, encoding="utf-8")
    assert "landings never fall" not in mlg("check", tmp_path / "two.csv").err


def test_keeping_what_contradicts_the_store_keeps_it_and_warns(tmp_path: Path) -> None:
    mlg("check", years(tmp_path, {}, only=[0, 1, 2], name="first"), "--keep")
    run = mlg("check", years(tmp_path, SLIP, only=[3], name="last"), "--keep")
    assert "1 inspection kept" in run.err
    assert "240 landings on 2026-03-01 (S4" in run.err
    assert "mlg history amend" in run.err


# What history and fleet say of a life that contradicts itself.


VIEWS = pytest.mark.parametrize("view", [life, gear_of_the_fleet])


@VIEWS
def test_a_slip_in_the_landings_of_a_worn_gear_leaves_it_due_now(tmp_path, view):
    kept(tmp_path, SLIP)
    told = view()
    nothing = dict.fromkeys(("p05", "p50", "p95"), 0.0)
    assert [told[name] for name in QUANTILES] == [nothing] * 2
    assert (told["next_inspection_landings"], told["due_date"]) == (0.0, "2026-03-01")


@VIEWS
def test_a_slip_in_the_landings_of_a_sound_gear_gives_no_forecast(tmp_path, view):
    assert mlg("check", years(tmp_path, {2: 86}, only=range(3)), "--keep").code in (0, 1)
    told = view()
    assert [told[name] for name in (*QUANTILES, "next_inspection_landings", "due_date")] == [
        None
    ] * 4


def test_a_slip_gives_no_joint_a_forecast_but_those_over_their_limit(tmp_path: Path) -> None:
    kept(tmp_path, SLIP)
    left = {joint["joint"]: joint["landings_to_limit"] for joint in life()["joints"]}
    assert {n for n, ends in left.items() if ends is not None} == {3, 5}


@pytest.mark.parametrize("command", [("history", "N507", "LH"), ("fleet",)])
@pytest.mark.parametrize("form", ["screen", "json", "report"])
def test_every_view_names_the_record_and_how_to_correct_it(tmp_path, command, form):
    kept(tmp_path, SLIP)
    wrong = next(record.digest[:10] for record in Store().all() if record.record_id == "S4")
    if form == "report":
        mlg(*command, "--no-forecast", "--report", tmp_path / "pages")
        page = "fleet.html" if command == ("fleet",) else "mlg-life-N507-LH.html"
        text = words_of(
            next(
                path
                for path in (tmp_path / "pages").glob("*.html")
                if path.name.startswith(page[:8])
            )
        )
    elif form == "json":
        (text,) = mlg(*command, "--json").json["warnings"]
    else:
        text = re.sub(r"\s+", " ", mlg(*command).out)
    assert f"240 landings on 2026-03-01 (S4, {wrong})" in text
    assert "mlg history amend RECORD COLUMN=VALUE" in text


def test_a_correction_brings_the_forecast_back(tmp_path: Path) -> None:
    kept(tmp_path, SLIP)
    mlg("history", "amend", "S4", "landings=2407")
    told = life()
    assert told["warnings"] == []
    assert told["next_inspection_landings"] == 0.0


def test_the_readings_of_a_life_that_contradicts_itself_stand_by_date(tmp_path: Path) -> None:
    kept(tmp_path, SLIP)
    third = life("--no-forecast")["joints"][2]
    assert [landings for landings, _clearance in third["readings"]] == [14.0, 863.0, 1672.0, 240.0]


def test_a_repair_whose_landings_contradict_the_inspections_is_named(tmp_path: Path) -> None:
    kept(tmp_path, {})
    run = restored([3], "2025-06-01", "81")
    assert "81 landings on 2025-06-01 (repair" in run.err
    assert "mlg history void" in run.err


def test_a_life_that_contradicts_itself_teaches_the_fleet_nothing(tmp_path: Path) -> None:
    kept(tmp_path, SLIP)
    assert fit_fleet(lives(Store()).values(), load_gear()) is None


# The order of time.


def inspection(n: int, day: str, landings: float | None, worn_in: float = 0.001) -> Inspection:
    when = date.fromisoformat(day) if day else None
    read = dict.fromkeys(range(1, 11), worn_in)
    return Inspection(
        f"R{n}",
        "N507",
        Side.LH,
        ClearanceConvention.RADIAL,
        read,
        inspection_date=when,
        gear_landings=landings,
    )


def test_an_undated_inspection_is_placed_by_its_landings() -> None:
    seen = [("2024-01-01", 100), ("2025-01-01", 900), ("", 400), ("", 1500)]
    Store().add([inspection_record(inspection(n, *each)) for n, each in enumerate(seen)])
    found = life_of(Store(), "N507", "LH")
    assert [each.inspection.gear_landings for each in found.inspections] == [100, 400, 900, 1500]


def test_the_higher_landings_of_one_date_are_the_later_ones() -> None:
    seen = [("2024-01-01", 802), ("2024-01-01", 800)]
    Store().add([inspection_record(inspection(n, *each)) for n, each in enumerate(seen)])
    found = life_of(Store(), "N507", "LH")
    assert found.latest is not None
    assert found.latest.inspection.gear_landings == 802
    assert found.warnings == ()


def test_a_repair_that_states_no_landings_has_those_of_its_day_between_the_inspections() -> None:
    add([[inspection(1, "2024-01-01", 100.0), inspection(2, "2024-01-21", 300.0)]])
    assert mlg("history", "repair", "N507", "LH", "--joint", "3", "--date", "2024-01-06").code == 0
    _paths, begun = wear_paths(life_of(Store(), "N507", "LH"), [3])[3]
    assert begun == pytest.approx(150.0)


# One gear, one forecast.


def fleet_of(gears: int, visits: int, seed: int) -> list[list[Inspection]]:
    """Draw gears that wear, dated and with landings."""
    rng = np.random.default_rng(seed)
    found = []
    for gear in range(gears):
        worn, own = np.full(10, 0.0005), []
        pace = 4e-7 * np.exp(0.4 * rng.standard_normal(10))
        for visit in range(visits):
            worn = worn + rng.gamma(8.0, 400.0 * pace / 8.0)
            read = {n + 1: float(value) for n, value in enumerate(np.round(worn, 4))}
            first = inspection(
                visit,
                (date(2024, 1, 1) + timedelta(days=60 * visit)).isoformat(),
                400.0 * (visit + 1),
            )
            own.append(
                replace(first, tail_no=f"N{gear}", record_id=f"{gear}-{visit}", clearance_in=read)
            )
        found.append(own)
    return found


def add(lives: Sequence[Sequence[Inspection]], place: Path | None = None) -> None:
    Store(place).add([inspection_record(each) for own in lives for each in own])


@dataclass(frozen=True)
class Views:
    """What the commands say of nine gears, of which N4 LH is looked at."""

    lines: Mapping[str, Mapping[str, Any]]
    lives: Mapping[str, Mapping[str, Any]]
    texts: Mapping[str, str]


@pytest.fixture(scope="module")
def views(tmp_path_factory: pytest.TempPathFactory) -> Views:
    folder = tmp_path_factory.mktemp("views")
    place = ("--store", folder / "store.sqlite")
    add(fleet_of(9, 4, 1), folder / "store.sqlite")
    lines = {line["tail_no"]: line for line in mlg("fleet", "--json", *place).json["gears"]}
    lives = {tail: mlg("history", tail, "LH", "--json", *place).json for tail in ("N0", "N4")}
    texts = {}
    for command in (("fleet",), ("history", "N4", "LH")):
        with pytest.MonkeyPatch.context() as patch:
            patch.setenv("COLUMNS", "200")
            shown = mlg(*command, "--report", folder / command[0], *place).out
        texts[command[0]] = re.sub(r"\s+", " ", shown)
        (page,) = (folder / command[0]).glob("fleet.html" if len(command) == 1 else "*life*.html")
        texts[f"page of {command[0]}"] = words_of(page)
    return Views(lines, lives, texts)


@pytest.mark.parametrize("tail", ["N0", "N4"])
def test_history_and_fleet_give_the_same_numbers_of_a_gear(views: Views, tail: str) -> None:
    names = (*QUANTILES, "limit_joint", "next_inspection_landings", "due_date")
    told, line = views.lives[tail], views.lines[tail]
    assert {name: told[name] for name in names} == {name: line[name] for name in names}
    assert line["next_inspection_landings"] > 0.0


def test_the_gear_goes_to_its_limit_as_the_joint_that_is_named(views: Views) -> None:
    told = views.lives["N4"]
    medians = {joint["joint"]: joint["landings_to_limit"]["p50"] or 1e9 for joint in told["joints"]}
    assert told["limit_joint"] == min(medians, key=lambda joint: medians[joint])


def test_the_date_due_follows_from_the_landings_between_the_inspections(views: Views) -> None:
    line = views.lines["N4"]
    # 400 landings in 60 days.
    days = line["next_inspection_landings"] * 60.0 / 400.0
    due = date.fromisoformat(line["inspection_date"]) + timedelta(days=int(days))
    assert line["due_date"] == due.isoformat()


@pytest.mark.parametrize("view", ["history", "page of fleet", "page of history"])
def test_the_view_says_what_its_quantiles_are_of(views: Views, view: str) -> None:
    assert "worst-case bound" in views.texts[view]
    assert f"#{views.lives['N4']['limit_joint']}" in views.texts[view]
    assert "most likely reaches its limit first" in views.texts[view]


def test_without_a_date_there_is_no_date_due() -> None:
    add([[replace(each, inspection_date=None) for each in own] for own in fleet_of(2, 3, 1)])
    one, _two = mlg("fleet", "--json").json["gears"]
    assert one["next_inspection_landings"] is not None
    assert one["due_date"] is None


def test_gears_without_landings_stand_behind_those_that_are_due_some_day() -> None:
    first, *others = fleet_of(3, 4, 1)
    add([[replace(each, gear_landings=None) for each in first], *others])
    lines = mlg("fleet", "--json").json["gears"]
    assert [line["next_inspection_landings"] is None for line in lines] == [False, False, True]


def test_a_joint_that_was_never_read_takes_no_landings_from_those_that_were() -> None:
    first, *others = fleet_of(3, 4, 1)
    add([[replace(each, clearance_in={3: each.clearance_in[3]}) for each in first], *others])
    told = mlg("history", "N0", "LH", "--json").json
    (of_joint,) = [joint["landings_to_limit"] for joint in told["joints"] if joint["readings"]]
    assert of_joint["p05"] is not None
    assert (told["limit_joint"], told["landings_to_limit"]) == (3, of_joint)
    # What the others could add would bring the margin nearer than this one alone can.
    assert told["landings_to_margin"]["p50"] is None


def test_landings_are_left_to_the_margin_that_the_last_inspection_states(tmp_path: Path) -> None:
    first, *others = fleet_of(3, 4, 1)
    left = []
    for margin_in in (None, 0.02):
        place = tmp_path / f"{margin_in}.sqlite"
        add([[replace(each, margin_in=margin_in) for each in first], *others], place)
        left.append(
            mlg("history", "N0", "LH", "--json", "--store", place).json["landings_to_margin"]["p05"]
        )
    assert left[1] < 0.8 * left[0]


# Last inspections that do not fit the wear of their gear.


@pytest.mark.parametrize(("reads", "told"), [(0.0033, False), (0.0031, True), (0.0090, False)])
def test_a_reading_four_standard_deviations_tighter_is_taken_for_a_restoration(reads, told):
    # Readings to 0.0005 in: their difference to 0.0007 in.
    seen = [inspection(n, f"2024-0{n}-01", 100.0 * n) for n in (1, 2)]
    add(
        [
            [
                replace(row, clearance_in={3: value})
                for row, value in zip(seen, (0.006, reads), strict=True)
            ]
        ]
    )
    found = suggestion(life_of(Store(), "N507", "LH"), load_gear())
    assert ("#3 read much tighter" in found) is told
    if told:
        restored([3], "2024-01-20", "100")
        assert suggestion(life_of(Store(), "N507", "LH"), load_gear()) == ""


# A gear that is outside its margin or has a joint over its limit is due now.


def shown(told: Mapping[str, Any]) -> list[float]:
    """Every number of landings left that a gear's line or life shows."""
    ends = [told[name] or {} for name in QUANTILES]
    ends += [joint["landings_to_limit"] or {} for joint in told.get("joints", ())]
    return [value or 0.0 for each in ends for value in each.values()] + [
        told["next_inspection_landings"] or 0.0
    ]


def test_a_gear_that_is_due_now_shows_no_landings_left_in_60_lives() -> None:
    rng = np.random.default_rng(29)
    records = []
    for n, own in enumerate(fleet_of(60, 4, 2)):
        last = own[-1]
        outside, over = ((True, False), (False, True), (True, True))[n % 3]
        measured = outside and n % 2 == 0
        clearances = dict.fromkeys(range(1, 11), 0.0074) if outside else dict(last.clearance_in)
        if over:
            clearances[int(rng.integers(1, 11))] = 0.0076 + 0.01 * float(rng.random())
        unknown = rng.random() < 0.2
        own[-1] = replace(
            last,
            clearance_in=clearances,
            gear_landings=None if unknown else last.gear_landings,
            readings_in=(0.06,) if measured else (),
        )
        records += map(inspection_record, own)
    Store().add(records)
    gear = load_gear()
    found = judge_lives(lives(Store()).values(), gear, load_index_table(gear))
    model = fit_fleet(found[:5], gear)
    ahead = forecast(found, model, gear)
    lines = [FleetLine.of(life, ahead[life.key], gear) for life in found]
    fleet = Lives(gear, (), tuple(lines), model).to_dict()["gears"]
    pages = [
        LifeAhead(life, forecast([life], model, gear)[life.key], gear).to_dict() for life in found
    ]
    assert len(fleet) == len(pages) == 60
    assert max(value for told in (*fleet, *pages) for value in shown(told)) == 0.0
    assert {told["next_inspection_landings"] for told in (*fleet, *pages)} == {0.0}
    assert all(line["due_date"] == line["inspection_date"] for line in fleet)
    assert {line.by_when(gear) for line in lines} == {"now"}


def test_a_joint_that_was_over_its_limit_before_and_is_not_read_again_still_counts() -> None:
    worn = inspection(1, "2024-01-01", 400, 0.001)
    worn = replace(worn, clearance_in={**worn.clearance_in, 3: 0.012})
    later = inspection(2, "2024-06-01", 800, 0.001)
    later = replace(
        later, clearance_in={n: value for n, value in later.clearance_in.items() if n != 3}
    )
    add([[worn, later]])
    assert gear_of_the_fleet()["next_inspection_landings"] == 0.0


def test_a_joint_that_was_restored_is_over_its_limit_no_more() -> None:
    worn = inspection(1, "2024-01-01", 400, 0.001)
    add([[replace(worn, clearance_in={**worn.clearance_in, 3: 0.012})]])
    restored([3], "2024-02-01", "410")
    assert gear_of_the_fleet()["next_inspection_landings"] > 0.0


def test_history_says_in_words_why_a_gear_is_due_now(tmp_path: Path) -> None:
    kept(tmp_path, {})
    said = re.sub(r"\s+", " ", mlg("history", "N507", "LH").out)
    assert (
        "outside the margin at the last inspection, and #3, #5 over the limit when last read"
        in said
    )
    assert "Next inspection due now" in said


# What has no date may be the last inspection.


def undated_after_sound_ones(folder: Path, **undated: str) -> None:
    sound = [
        row(
            record_id=f"Y{n}",
            tail_no="N507",
            side="LH",
            inspection_date=f"2025-0{n}-10",
            gear_landings=f"{300 * n}",
        )
        for n in (1, 2, 3)
    ]
    worn = {f"clearance_{n}_in": "0.006" for n in range(1, 11)}
    last = row(record_id="Z", tail_no="N507", side="LH", **{**worn, **undated})
    assert mlg("check", table(folder, *sound), "--keep").code in (0, 1)
    assert mlg("check", table(folder, last), "--keep").code == 1


@pytest.mark.parametrize(
    ("landings", "view"),
    [("240", life), ("500", gear_of_the_fleet), ("2407000", life), ("", gear_of_the_fleet)],
)
def test_an_undated_inspection_outside_the_margin_leaves_nothing(tmp_path, landings, view):
    undated_after_sound_ones(tmp_path, gear_landings=landings)
    assert view()["next_inspection_landings"] == 0.0


def test_a_repair_after_an_undated_inspection_takes_its_place(tmp_path: Path) -> None:
    undated_after_sound_ones(tmp_path, gear_landings="240")
    said = "No landings left"
    assert said in " ".join(mlg("history", "N507", "LH").out.split())
    assert restored(range(1, 11), "2025-09-01", "950").code == 0
    assert said not in " ".join(mlg("history", "N507", "LH").out.split())
