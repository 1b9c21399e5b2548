"""What holds of the state of any gear, whatever was found in which order.

The truth is worked out from days as whole numbers; nothing of the product orders anything here.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import date, timedelta
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mlg_troubleshoot.decision.inspection import Inspection, Outcome
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.gear.gear_file import load_gear
from mlg_troubleshoot.life.state import GearVisit, state_now
from tests.decision.conftest import inspected

GEAR: Gear = load_gear()
WORN, SOUND, FAR, NEAR = 0.0121, 0.001, 0.046, 0.004
BEGIN = date(2026, 1, 1)


@dataclass(frozen=True)
class Drawn:
    """One row of a table; the days of the visit and of its repair count from the first one."""

    day: int | None
    read: tuple[tuple[int, float], ...] = ()
    plunger: float | None = None
    outcome: str = ""
    restored: tuple[int, ...] = ()

    def row(self) -> Inspection:
        day = None if self.day is None else BEGIN + timedelta(days=self.day)
        more: dict[str, Any] = {"inspection_date": day}
        if self.plunger is not None:
            more["readings_in"] = (self.plunger,)
        if self.outcome:
            more["outcome"] = Outcome(self.outcome)
        if self.restored:
            more |= {"restored_joints": self.restored, "repair_date": day}
        return inspected(dict(self.read), **more)


DAYS = st.one_of(st.none(), st.integers(0, 5))
READ = st.dictionaries(st.sampled_from([3, 6]), st.sampled_from([WORN, SOUND]), max_size=2)
FOUND = st.builds(
    Drawn,
    day=DAYS,
    read=READ.map(lambda read: tuple(sorted(read.items()))),
    plunger=st.sampled_from([None, None, FAR, NEAR]),
    outcome=st.sampled_from(["", "", "FAILED", "RETRACTED"]),
)
DONE = st.builds(Drawn, day=st.integers(0, 5), restored=st.sampled_from([(3,), (6,), (3, 6)]))
VISITS = st.lists(st.one_of(FOUND, FOUND, DONE), min_size=1, max_size=6).map(
    lambda drawn: [Drawn(0, ((9, SOUND),)), *drawn]
)
COMMON = settings(max_examples=300, deadline=None)


def state(drawn: Sequence[Drawn]) -> tuple[Any, ...]:
    """What stands: clearances, the plunger, a failure, and what the gear did since a repair."""
    by_time = sorted(drawn, key=lambda each: -1 if each.day is None else each.day)
    found = state_now([GearVisit(d.row(), n) for n, d in enumerate(by_time)], GEAR)
    assert found is not None
    row = found.inspection
    plunger = max(map(abs, row.standing_readings_in), default=None)
    # Within the margin, one that may be older than a repair says nothing.
    plunger = None if plunger == NEAR and row.is_plunger_in_doubt else plunger
    has_failed = row.outcome is Outcome.FAILED
    return dict(row.clearance_in), plunger, has_failed, row.standing_outcome


def is_before(one: Drawn, other: Drawn) -> bool:
    return one.day is not None and other.day is not None and one.day < other.day


@given(VISITS, DAYS, st.integers(0, 7))
@COMMON
def test_a_blank_visit_changes_nothing(drawn: list[Drawn], day: int | None, place: int) -> None:
    assert state([*drawn[:place], Drawn(day), *drawn[place:]]) == state(drawn)


@given(VISITS, st.randoms(use_true_random=False))
@COMMON
def test_rows_in_any_order_give_one_state(drawn: list[Drawn], rng: Any) -> None:
    shuffled = drawn[1:]
    rng.shuffle(shuffled)
    assert state([*shuffled, drawn[0]]) == state(drawn)


@given(VISITS)
@COMMON
def test_one_row_or_one_row_for_each_fact_give_one_state(drawn: list[Drawn]) -> None:
    split = []
    for each in drawn:
        parts = [replace(each, plunger=None, outcome="", restored=(), read=(r,)) for r in each.read]
        if each.plunger is not None:
            parts.append(Drawn(each.day, plunger=each.plunger))
        if each.outcome:
            parts.append(Drawn(each.day, outcome=each.outcome))
        split += [*parts, *([Drawn(each.day, restored=each.restored)] if each.restored else [])]
    assert state(split) == state(drawn)


@given(VISITS)
@COMMON
def test_the_same_visits_twice_are_the_same_state(drawn: list[Drawn]) -> None:
    assert state([*drawn, *drawn]) == state(drawn)


@given(VISITS)
@COMMON
def test_a_failure_goes_only_by_a_later_repair_and_a_later_retraction(drawn: list[Drawn]) -> None:
    closed = [
        any(
            repair.restored
            and is_before(failed, repair)
            and any(t.outcome == "RETRACTED" and is_before(repair, t) for t in drawn)
            for repair in drawn
        )
        for failed in drawn
        if failed.outcome == "FAILED"
    ]
    assert state(drawn)[2] is (not all(closed))


@pytest.mark.parametrize("joint", [3, 6])
@given(drawn=VISITS)
@COMMON
def test_a_reading_over_its_limit_goes_only_by_what_is_later_and_of_its_joint(
    joint: int, drawn: list[Drawn]
) -> None:
    stands = any(
        dict(worn.read).get(joint) == WORN
        and not any(
            is_before(worn, later) and (joint in dict(later.read) or joint in later.restored)
            for later in drawn
        )
        for worn in drawn
    )
    assert (state(drawn)[0].get(joint) == WORN) is stands


@given(VISITS)
@COMMON
def test_a_plunger_beyond_its_margin_goes_only_by_a_later_reading_or_repair(
    drawn: list[Drawn],
) -> None:
    stands = any(
        far.plunger == FAR
        and not any(
            is_before(far, later) and (later.plunger is not None or later.restored)
            for later in drawn
        )
        for far in drawn
    )
    assert (state(drawn)[1] == FAR) is stands
