"""The state of a gear: what its visits found, and no later visit or repair replaced."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from datetime import date, datetime
from math import inf
from pathlib import Path
from typing import Any

import pytest

from mlg_troubleshoot.decision.inspection import Fact, FactKind, Inspection, Outcome, RiggingCheck
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.life.state import GearState, GearVisit, states
from tests.cli.conftest import Run, mlg, row
from tests.decision.conftest import every_joint, inspected

from .places import table

WORN, SOUND, FAR = 0.012, 0.001, 0.046
JAN, FEB, MAR = (date(2026, month, 1) for month in (1, 2, 3))
At = Callable[..., GearState]
FAILED = {"outcome": Outcome.FAILED}
RETRACTED = {"outcome": Outcome.RETRACTED}


def of(day: date | None, clearance_in: dict[int, float] | None = None, **more: Any) -> Inspection:
    return inspected(clearance_in or {}, inspection_date=day, **more)


def repaired(day: date | None, *joints: int, **more: Any) -> Inspection:
    return of(day, restored_joints=joints, repair_date=day, **more)


@pytest.fixture
def at(gear: Gear) -> At:
    """The state at the last of some rows of a table."""

    def last(*rows: Inspection) -> GearState:
        return states([GearVisit(each) for each in rows], gear)[-1]

    return last


def test_one_visit_stands_as_it_is(at: At) -> None:
    row = of(JAN, {3: WORN})
    assert at(row).inspection is row


def test_what_was_not_read_again_stands(at: At) -> None:
    found = at(of(JAN, {3: WORN, 6: SOUND}), of(FEB, {6: 0.002}))
    assert found.inspection.clearance_in == {3: WORN, 6: 0.002}
    assert found.older == (Fact(FactKind.READING, 3, WORN, JAN, "R1"),)
    # A row tells of a joint how it was left.
    left = of(JAN, {3: SOUND}, restored_joints=(3,), repair_date=FEB)
    assert at(left, of(MAR, {6: SOUND})).inspection.clearance_in == {3: SOUND, 6: SOUND}


def test_a_visit_knows_nothing_of_a_later_one(at: At) -> None:
    assert at(of(FEB, {3: WORN}), of(JAN, {6: SOUND})).inspection.clearance_in == {6: SOUND}


def test_a_restored_joint_is_not_read(at: At) -> None:
    found = at(of(JAN, {3: WORN, 5: WORN}), repaired(FEB, 3), of(MAR, {6: SOUND}))
    assert found.inspection.clearance_in == {5: WORN, 6: SOUND}


@pytest.mark.parametrize(("worn_in", "stands"), [(WORN, True), (SOUND, False)])
def test_what_is_kept_and_cannot_be_ordered_counts_only_against_the_gear(gear, worn_in, stands):
    for day in (None, MAR):
        kept = GearVisit(of(day, {3: worn_in}), 1)
        found = states([kept, GearVisit(of(MAR, {6: SOUND}))], gear)[-1]
        assert (3 in found.inspection.clearance_in) is stands


@pytest.mark.parametrize("day", [None, MAR])
def test_rows_of_one_table_that_cannot_be_ordered_speak_each_for_itself(at, day):
    row = of(day, {6: SOUND})
    assert at(of(day, {3: WORN}, readings_in=(FAR,), **FAILED), row).inspection is row


@pytest.mark.parametrize(("worn_in", "stands"), [(WORN, True), (SOUND, False)])
def test_a_reading_of_the_day_of_a_repair_counts_only_against_the_gear(at, worn_in, stands):
    found = at(of(FEB, {3: worn_in}), repaired(FEB, 3), of(MAR, {6: SOUND}))
    assert (3 in found.inspection.clearance_in) is stands


@pytest.mark.parametrize("landings", [(None, None), (100, 500)])
def test_of_two_readings_of_one_day_the_worse_stands(at, landings):
    worn = of(JAN, {3: WORN}, gear_landings=landings[0])
    sound = of(JAN, {3: SOUND}, gear_landings=landings[1])
    assert at(worn, sound, of(FEB, {6: SOUND})).inspection.clearance_in[3] == WORN


def test_an_older_reading_keeps_the_uncertainty_of_its_gauge(at: At) -> None:
    found = at(of(JAN, {3: SOUND}, gauge_u_in=0.001), of(FEB, {6: SOUND}, gauge_u_in=0.0002))
    assert [found.inspection.gauge_u_of(joint) for joint in (3, 6)] == [0.001, 0.0002]


@pytest.mark.parametrize(
    ("visits", "stands"),
    [
        ([of(JAN, **FAILED), of(MAR, {3: SOUND})], True),
        ([of(JAN, **FAILED), of(MAR, **RETRACTED)], True),
        ([of(JAN, **FAILED), repaired(FEB, 3), of(MAR, {3: SOUND})], True),
        ([of(JAN, **FAILED), of(FEB, **RETRACTED), repaired(MAR, 3)], True),
        ([of(JAN, **FAILED), repaired(FEB, 3), of(MAR, **RETRACTED)], False),
        ([repaired(JAN, 3), of(FEB, **FAILED), of(MAR, **RETRACTED)], True),
        ([of(FEB, **FAILED), repaired(FEB, 3), of(MAR, **RETRACTED)], True),
        ([of(JAN, **FAILED), repaired(None, 3), of(MAR, **RETRACTED)], True),
        ([of(JAN, **FAILED), of(MAR, **RETRACTED, restored_joints=(3,), repair_date=FEB)], False),
    ],
)
def test_a_failure_stands_until_a_repair_and_a_good_retraction(at, visits, stands):
    found = at(*visits)
    assert (found.inspection.outcome is Outcome.FAILED) is stands
    assert (FactKind.FAILED in {fact.kind for fact in found.older}) is stands


def test_after_a_repair_the_gear_that_failed_has_to_be_tried(at: At) -> None:
    found = at(of(JAN, **FAILED, record_id="R0"), repaired(FEB, 3)).inspection
    assert (found.standing_outcome, found.outcome) == (None, Outcome.FAILED)
    assert "R0 states that this gear failed on 2026-01-01" in found.warnings[-1]


def test_a_plunger_reading_stands_until_it_is_read_again(at: At) -> None:
    found = at(of(JAN, readings_in=(FAR,)), of(FEB, {3: SOUND})).inspection
    assert found.standing_readings_in == (FAR,)


def test_a_plunger_reading_from_before_a_repair_stands_no_more(at: At) -> None:
    found = at(of(JAN, readings_in=(FAR,)), repaired(FEB, 3), of(MAR, {3: SOUND})).inspection
    assert found.standing_readings_in == ()
    assert "+0.0460 in on 2026-01-01" in found.warnings[-1]


@pytest.mark.parametrize(("reading_in", "stands"), [(FAR, True), (0.002, False)])
def test_a_plunger_reading_of_the_day_of_a_repair_counts_only_beyond_the_margin(
    at, reading_in, stands
):
    found = at(of(FEB, readings_in=(reading_in,)), repaired(FEB, 3), of(MAR, {3: SOUND}))
    assert bool(found.inspection.readings_in) is stands


def test_a_reading_of_the_day_of_a_repair_may_be_older(at: At) -> None:
    found = at(repaired(FEB, 3, rigging_checked=RiggingCheck.CORRECTED), of(FEB, {3: SOUND}))
    assert found.inspection.is_repaired
    assert found.inspection.rigging_checked is RiggingCheck.CORRECTED
    assert set(found.inspection.clearance_in) == {3}


def test_what_was_replaced_by_the_repair_of_its_own_row_is_said(at: At) -> None:
    day = {"restored_joints": (3,), "repair_date": FEB, "plunger_date": JAN}
    found = at(of(MAR, {3: SOUND}, readings_in=(FAR,), **day, **RETRACTED)).inspection
    assert "As found, before the repair: plunger +0.0460 in on 2026-01-01" in found.warnings[-1]


def test_ten_thousand_rows_of_one_gear_take_a_moment(gear: Gear) -> None:
    rows = [of(JAN, {3: SOUND}, readings_in=(0.01,), **FAILED) for _ in range(10_000)]
    begun = datetime.now()
    assert len(states([GearVisit(each, inf) for each in rows], gear)) == 10_000
    assert (datetime.now() - begun).total_seconds() < 10.0


# The commands.


def kept(folder: Path, *tables: Sequence[dict[str, str]]) -> Run:
    """Keep one table after the other; what the last one said."""
    store = ("--store", folder / "store.sqlite")
    runs = [mlg("check", table(folder, *rows), "--keep", "--json", *store) for rows in tables]
    return runs[-1]


def line(day: str, **more: str) -> dict[str, str]:
    return row(record_id=f"R{day}", inspection_date=day, **more)


def test_a_kept_failure_without_a_repair_stands_at_a_sound_row(tmp_path: Path) -> None:
    found = kept(tmp_path, [line("2026-01-01", outcome="FAILED")], [line("2026-02-01")])
    assert found.code == 1
    assert {"FAILED"} <= {fact["kind"] for fact in found.one["standing"]}
    fleet = mlg("fleet", "--json", "--no-forecast", "--store", tmp_path / "store.sqlite")
    (gear,) = fleet.json["gears"]
    assert gear["next_action"] not in ("", None, "Nothing is required")


def test_reading_two_joints_again_hides_no_third_one(tmp_path: Path) -> None:
    blank = dict.fromkeys((f"clearance_{n}_in" for n in range(1, 11)), "")
    again = blank | {"clearance_6_in": "0.001", "clearance_7_in": "0.001"}
    found = kept(
        tmp_path, [line("2026-01-01", clearance_3_in="0.0121")], [line("2026-02-01", **again)]
    )
    assert found.code == 1
    assert found.one["joints"][2]["over_limit"]
    (fact,) = (f for f in found.one["standing"] if f["joint"] == 3)
    assert fact == {
        "kind": "reading",
        "joint": 3,
        "value_in": 0.0121,
        "date": "2026-01-01",
        "record": "R2026-01-01",
    }


def test_the_store_is_read_without_keeping(tmp_path: Path) -> None:
    kept(tmp_path, [line("2026-01-01", outcome="FAILED")])
    store = ("--store", tmp_path / "store.sqlite")
    later = table(tmp_path, line("2026-02-01"))
    assert mlg("check", later, *store).code == 1
    assert mlg("check", later, "--keep", *store).err.startswith("1 inspection kept")


def test_rows_that_say_nothing_are_set_aside_and_not_kept(tmp_path: Path) -> None:
    blank = dict.fromkeys((f"clearance_{n}_in" for n in range(1, 11)), "")
    rows = [
        row(
            inspection_date="2026-02-01",
            **{"tail_no": f"N{n}", "record_id": f"B{n}", **(blank if n else {})},
        )
        for n in range(71)
    ]
    found = kept(tmp_path, rows)
    assert (found.code, len(found.json["inspections"])) == (0, 1)
    assert any("70 rows without a reading" in said for said in found.json["warnings"])
    fleet = mlg("fleet", "--json", "--no-forecast", "--store", tmp_path / "store.sqlite")
    assert len(fleet.json["gears"]) == 1


def test_a_table_of_blank_rows_alone_is_no_conclusion(tmp_path: Path) -> None:
    blank = dict.fromkeys((f"clearance_{n}_in" for n in range(1, 11)), "")
    assert kept(tmp_path, [line("2026-02-01", **blank)]).code == 3


def test_every_joint_of_a_full_reading_is_its_own(tmp_path: Path) -> None:
    found = kept(tmp_path, [line("2026-01-01")], [line("2026-02-01")])
    assert {fact["record"] for fact in found.one["standing"]} == {"R2026-02-01"}
    assert len(every_joint(SOUND)) == len(found.one["standing"])
