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
def test_suspects_are_what_the_smallest_removals_take_away(pairs: list[tuple[int, int]]) -> None:
    given_ = moments(pairs)
    places = range(len(given_))
    for count in range(len(given_)):
        removals = [
            set(c)
            for c in combinations(places, count)
            if fits([given_[i] for i in places if i not in c])
        ]
        if removals:
            break
    assert set(contradictions(given_, str)) == set().union(*removals)


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
    ("pairs", "said"),
    [
        (
            [(1, 1), (2, 5), (3, 2), (4, 3)],
            {1: "500 landings on 2024-02-01 (1) disagree with 200 landings on 2024-03"},
        ),
        (
            [(1, 1), (2, 2), (3, 3), (4, 0)],
            {3: "0 landings on 2024-04-01 (3) disagree with 300 landings on 2024-03"},
        ),
    ],
)
def test_the_record_that_alone_may_be_wrong_is_named_with_the_nearest_it_contradicts(pairs, said):
    found = contradictions(moments(pairs), str)
    assert {place: text[: len(said[place])] for place, text in found.items()} == said


@pytest.mark.parametrize(("count", "named", "more"), [(6, 6, False), (8, 6, True)])
def test_of_many_suspects_six_are_named(count: int, named: int, more: bool) -> None:
    (said,) = set(contradictions(moments([(n + 1, count - n) for n in range(count)]), str).values())
    assert said.count("landings on") == named
    assert (" …" in said) == more
