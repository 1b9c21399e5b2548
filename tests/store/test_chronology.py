"""The order of a gear's inspections in time, and those whose date and landings disagree."""

from __future__ import annotations

from itertools import combinations

import pytest
from hypothesis import given
from hypothesis import strategies as some

from mlg_troubleshoot.life.state import Moment, contradictions, in_order

# Months, and landings in hundreds; None is not stated.
PLACES = some.tuples(some.integers(1, 6), some.integers(0, 6))


def moments(pairs: list[tuple[int, int]]) -> list[Moment]:
    return [Moment(f"2024-0{month}-01", 100.0 * landings) for month, landings in pairs]


def fits(found: list[Moment]) -> bool:
    """Whether no landings fall from an earlier date to a later one."""
    return all(
        (one.day >= two.day or (one.landings or 0.0) <= (two.landings or 0.0))
        and (two.day >= one.day or (two.landings or 0.0) <= (one.landings or 0.0))
        for one, two in combinations(found, 2)
    )


@given(some.lists(PLACES, min_size=1, max_size=7))
def test_a_contradiction_is_named_where_landings_fall_and_nowhere_else(pairs) -> None:
    given_ = moments(pairs)
    assert bool(contradictions(given_, str)) == (not fits(given_))


@given(some.lists(PLACES, min_size=1, max_size=7))
def test_a_life_that_fits_is_in_the_order_of_its_landings(pairs: list[tuple[int, int]]) -> None:
    given_ = moments(pairs)
    if fits(given_):
        ordered = [given_[i].landings or 0.0 for i in in_order(given_)]
        assert ordered == sorted(ordered)


@given(some.lists(some.tuples(some.integers(0, 6), some.none() | some.integers(0, 6)), max_size=9))
def test_dated_records_stand_by_date_and_none_is_lost(pairs: list[tuple[int, int | None]]) -> None:
    given_ = [Moment(f"2024-0{month}-01" if month else "", landings) for month, landings in pairs]
    order = in_order(given_)
    days = [given_[i].day for i in order if given_[i].day]
    assert sorted(order) == list(range(len(given_)))
    assert days == sorted(days)


def test_records_of_one_date_do_not_contradict_each_other() -> None:
    assert contradictions(moments([(1, 2), (1, 1)]), str) == {}


@pytest.mark.parametrize(
    ("landings", "said"),
    [
        ((1, 5, 2, 3), {(1, 2): ("500", "200")}),
        ((1, 2, 3, 0), {(2, 3): ("300", "0")}),
        ((3, 2, 1), {(0, 1): ("300", "200"), (2,): ("200", "100")}),
    ],
)
def test_both_records_between_which_landings_fall_are_named(landings, said) -> None:
    found = contradictions(moments([*enumerate(landings, 1)]), str)
    assert {n for places in said for n in places} == found.keys()
    for places, (was, now) in said.items():
        for place in places:
            assert found[place].startswith(f"{was} landings on 2024-0")
            assert f" and {now} landings on 2024-0" in found[place]
