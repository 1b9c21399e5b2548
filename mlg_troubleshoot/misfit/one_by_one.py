"""Several causes at once: added stepwise while each earns its place, left out again where others
make it idle.
"""

from __future__ import annotations

from typing import Protocol, Self, TypeVar


class GrowingSet(Protocol):
    """Causes that explain data together, by their places in a list of candidates."""

    @property
    def chosen(self) -> tuple[int, ...]:
        """The causes."""

    def further(self) -> Self | None:
        """The same with one more, if one earns its place: it stands out beyond chance given the
        others, and helps.
        """

    def without_idle(self) -> Self | None:
        """The same without the one that stands out least, if it does so no more than by chance
        given the others.
        """


E = TypeVar("E", bound=GrowingSet)


def one_by_one(explanation: E, most: int) -> E:
    """Add causes until none earns its place any more, or one comes back to what was tried."""
    tried = {tuple(sorted(explanation.chosen))}
    while len(explanation.chosen) < most:
        more = explanation.further()
        if more is None:
            break
        explanation = settled(more)
        key = tuple(sorted(explanation.chosen))
        if key in tried:
            break
        tried.add(key)
    return explanation


def settled(explanation: E) -> E:
    """Leave out again what no longer stands out given the others."""
    while len(explanation.chosen) > 1 and (fewer := explanation.without_idle()) is not None:
        explanation = fewer
    return explanation
