"""Rows of a table that are older than a repair which the store keeps of the same gear."""

from __future__ import annotations

from collections.abc import Callable
from datetime import date, datetime
from pathlib import Path
from typing import Any

import pytest

from mlg_troubleshoot.decision.inspection import Inspection, Outcome, RiggingCheck
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.life.folding import lives
from mlg_troubleshoot.life.since_repairs import since_repairs
from mlg_troubleshoot.store import Store, inspection_record
from tests.cli.conftest import mlg
from tests.decision.conftest import inspected

Counted = Callable[..., Inspection]
WORN, SOUND = 0.012, 0.001
THE_DAY = date(2026, 2, 1)


@pytest.fixture(scope="module")
def counted(tmp_path_factory: pytest.TempPathFactory, gear: Gear) -> Counted:
    """A row as it counts where the store keeps a repair of joint 3 on 1 February, of one gear with
    a re-rigging on that day as well.
    """
    place = tmp_path_factory.mktemp("store") / "store.sqlite"
    repair = ("--date", THE_DAY.isoformat(), "--store", place)
    for tail in ("N1", "N2"):
        kept = inspected({3: WORN}, tail_no=tail, inspection_date=date(2026, 1, 1))
        Store(place).add([inspection_record(kept)])
        assert mlg("history", "repair", tail, "LH", "--joint", "3", *repair).code == 0
    assert mlg("history", "rerig", "N2", "LH", *repair).code == 0

    def count(day: date | None, worn_in: float = WORN, **more: Any) -> Inspection:
        of_row = {"tail_no": "N1", "inspection_date": day, **more}
        row = inspected({3: worn_in, 5: SOUND}, **of_row)
        (found,) = since_repairs([row], gear, lives(Store(Path(place))))
        assert isinstance(found, Inspection)
        return found

    return count


def test_a_row_of_the_day_before_loses_what_was_restored(counted: Counted) -> None:
    found = counted(date(2026, 1, 31), SOUND)
    assert (set(found.clearance_in), found.restored_joints) == ({5}, (3,))


def test_a_row_of_the_day_after_stays_as_it_is(counted: Counted) -> None:
    found = counted(date(2026, 2, 2))
    assert (set(found.clearance_in), found.restored_joints) == ({3, 5}, ())


def test_a_row_of_the_same_day_may_be_older(counted: Counted) -> None:
    found = counted(THE_DAY, SOUND, readings_in=(0.06,))
    assert found.repair_date == THE_DAY
    assert found.is_plunger_in_doubt


@pytest.mark.parametrize("worn_in", [WORN, SOUND])
def test_on_the_day_of_the_repair_every_reading_stands(counted: Counted, worn_in: float) -> None:
    assert set(counted(THE_DAY, worn_in).clearance_in) == {3, 5}


def test_a_row_that_states_a_repair_itself_stays_as_it_is(counted: Counted) -> None:
    own = {"restored_joints": (5,), "repair_date": datetime(2026, 1, 20, 8, 0)}
    assert counted(date(2026, 1, 21), **own).restored_joints == (5,)


def test_a_row_without_a_date_stays_as_it_is(counted: Counted) -> None:
    assert counted(None).restored_joints == ()


@pytest.mark.parametrize(("tail", "rigging"), [("N1", None), ("N2", RiggingCheck.CORRECTED)])
def test_the_rigging_counts_as_corrected_where_a_re_rigging_is_kept(
    counted: Counted, tail: str, rigging: RiggingCheck | None
) -> None:
    assert counted(date(2026, 1, 31), tail_no=tail).rigging_checked is rigging


def test_what_a_row_was_warned_of_stands_before_what_the_store_keeps(counted: Counted) -> None:
    told = counted(date(2026, 1, 31), warnings=("as read",)).warnings
    assert told[0] == "as read"
    assert "the store keeps a repair of #3 on 2026-02-01" in told[1]


REPAIRED = {"restored_joints": (3,), "repair_date": date(2026, 1, 20)}


def again(gear: Gear, *above: Inspection, store: Store | None = None, **more: Any) -> Inspection:
    """A row below others of its gear that states a repair, as it counts."""
    own = inspected({3: SOUND}, inspection_date=date(2026, 1, 21), **{**REPAIRED, **more})
    kept = {} if store is None else lives(store)
    found = since_repairs([*above, own], gear, kept)[-1]
    assert isinstance(found, Inspection)
    return found


def failing(**more: Any) -> Inspection:
    return inspected({3: WORN}, outcome=Outcome.FAILED, inspection_date=date(2026, 1, 1), **more)


def test_a_gear_that_failed_and_was_repaired_has_still_to_be_tried(gear: Gear) -> None:
    assert again(gear, failing()).outcome is Outcome.FAILED


def test_a_gear_whose_failure_is_kept_and_was_repaired_has_still_to_be_tried(
    gear: Gear, tmp_path: Path
) -> None:
    store = Store(tmp_path / "store.sqlite")
    store.add([inspection_record(failing())])
    assert again(gear, store=store).outcome is Outcome.FAILED


def test_a_repair_without_a_date_leaves_the_complaint_as_well(gear: Gear) -> None:
    assert again(gear, failing(), repair_date=None).outcome is Outcome.FAILED


def test_it_is_said_which_row_states_the_failure(gear: Gear) -> None:
    assert "R0 states that this gear failed" in again(gear, failing(record_id="R0")).warnings[-1]


def test_a_gear_that_retracted_after_its_failure_has_no_complaint(gear: Gear) -> None:
    retracted = inspected({3: SOUND}, outcome=Outcome.RETRACTED)
    assert again(gear, failing(), retracted).outcome is None


def test_the_failure_of_another_gear_is_not_a_complaint(gear: Gear) -> None:
    assert again(gear, failing(tail_no="N9")).outcome is None


def test_a_failure_after_the_repair_is_not_the_complaint_that_led_to_it(gear: Gear) -> None:
    later = inspected({3: WORN}, outcome=Outcome.FAILED, inspection_date=date(2026, 1, 25))
    assert again(gear, later).outcome is None


def test_a_row_that_states_its_own_outcome_keeps_it(gear: Gear) -> None:
    assert again(gear, failing(), outcome=Outcome.RETRACTED).outcome is Outcome.RETRACTED


def test_without_a_repair_an_earlier_failure_is_not_a_complaint(gear: Gear) -> None:
    assert again(gear, failing(), restored_joints=(), repair_date=None).outcome is None


def test_the_plan_reads_the_plunger_and_retracts_a_gear_whose_failure_stands_above(
    tmp_path: Path,
) -> None:
    file = tmp_path / "two.csv"
    file.write_text(
        "record_id,tail_no,side,clearance_convention,clearance_3_in,outcome,inspection_date,"
        "restored_joints,repair_date\n"
        "R1,N1,LH,RADIAL,0.013,FAILED,2026-01-01,,\nR2,N1,LH,RADIAL,0.001,,2026-01-03,3,2026-01-02\n"
    )
    last = mlg("check", file, "--json").json["inspections"][-1]
    assert last["outcome"] is None
    assert [step["action"] for step in last["plan"]] == ["READ_PLUNGER", "RETRACT", "DONE"]
    assert not any("Is it newer?" in warning for warning in last["warnings"])
