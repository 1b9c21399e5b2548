"""Several causes at once: what is added, what is left out again, and when it ends."""

from __future__ import annotations

from dataclasses import dataclass, replace

from mlg_troubleshoot.diagnosis.evidence.one_by_one import one_by_one


@dataclass(frozen=True)
class Script:
    """Causes as a script adds them, and what it calls idle once it is there with another."""

    order: tuple[int, ...]
    idle: frozenset[tuple[int, int]] = frozenset()
    chosen: tuple[int, ...] = ()

    def further(self) -> Script | None:
        left = [k for k in self.order if k not in self.chosen]
        return replace(self, chosen=(*self.chosen, left[0])) if left else None

    def without_idle(self) -> Script | None:
        useless = [k for k in self.chosen if any((k, other) in self.idle for other in self.chosen)]
        return replace(self, chosen=tuple(k for k in self.chosen if k != useless[0])) if useless else None


def test_causes_are_added_until_none_earns_its_place() -> None:
    assert one_by_one(Script((2, 0, 1)), most=9).chosen == (2, 0, 1)


def test_no_more_causes_are_added_than_allowed() -> None:
    assert one_by_one(Script((2, 0, 1)), most=2).chosen == (2, 0)


def test_a_cause_that_others_make_idle_is_left_out_again() -> None:
    assert 5 not in one_by_one(Script((5, 0, 1), frozenset({(5, 1)})), most=3).chosen


def test_a_search_that_goes_in_a_circle_ends() -> None:
    assert one_by_one(Script((0, 1), frozenset({(0, 1), (1, 0)})), most=9).chosen in {(0,), (1,)}
