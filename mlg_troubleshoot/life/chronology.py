"""When the inspections and repairs of one gear took place, by their dates and their landings."""

from __future__ import annotations

from bisect import bisect_right
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from math import hypot, inf

from mlg_troubleshoot.life.state import GearVisit

# More records than this are not listed in one sentence. [1]
_MOST_NAMED = 6
# An overhaul restores at least so many joints. [1]
_SEVERAL = 3
# Standard deviations of a difference by which a joint clearly reads tighter, or wider. [1]
_CLEARLY = 2.0


@dataclass(frozen=True, slots=True)
class Moment:
    """Date (ISO 8601, empty if not known) and landings of one inspection or repair.

    joints: those that were restored, none where the rigging was set right; None of an inspection.
    visit: who states it; of a repair that an inspection states it is the inspection.
    """

    day: str
    landings: float | None
    joints: frozenset[int] | None = None
    visit: GearVisit | None = field(default=None, repr=False)
    is_alone: bool = False

    @classmethod
    def of(cls, visit: GearVisit) -> Moment:
        """An inspection."""
        day = "" if visit.at is None else visit.at.isoformat()
        return cls(day, visit.inspection.gear_landings, None, visit)

    @property
    def read(self) -> Mapping[int, tuple[float, float]]:
        """Radial clearance of each joint that was read, and its standard uncertainty. [in]"""
        if self.visit is None or self.joints is not None:
            return {}
        row = self.visit.inspection
        return {n: (value, row.gauge_u_of(n)) for n, value in row.clearance_in.items()}


def in_order(moments: Sequence[Moment]) -> list[int]:
    """Places in the order of time: by date, and by landings on one date and without a date.

    What states no landings stands behind what came before it with the same date.
    """
    before: dict[str, float] = {}
    at = []
    for moment in moments:
        before[moment.day] = (
            before.get(moment.day, -inf) if moment.landings is None else moment.landings
        )
        at.append(before[moment.day])
    by_time = sorted(range(len(moments)), key=lambda place: (moments[place].day, at[place]))
    dated = [place for place in by_time if moments[place].day]
    for earlier, place in pairwise(dated):
        if moments[place].landings is None:
            at[place] = at[earlier]
    # An undated record follows every dated one with as many landings or fewer, and what is dated
    # before that one.
    for later, place in pairwise(reversed(dated)):
        at[place] = min(at[place], at[later])
    undated = [place for place in by_time if not moments[place].day]
    return sorted(dated + undated, key=lambda place: at[place])


def overhauls(moments: Sequence[Moment]) -> dict[int, frozenset[int]]:
    """Places from which the landings of a gear begin anew, and the joints that were restored there
    as readings and records tell.

    At an overhaul the two landings before are above the two after, so that one mistyped number
    begins nothing, and several joints are restored: a record says so, or they clearly read tighter,
    and no other joint wider.
    """
    placed = _placed(moments)
    landings = [moments[i].landings or 0.0 for i in placed]
    falls = [n for n in range(1, len(placed)) if landings[n] < landings[n - 1]]
    found = {}
    begun = 0
    for n, end in pairwise([*falls, len(placed)]):
        if min(landings[max(begun, n - 2) : n]) > max(landings[n : min(end, n + 2)]):
            restored = _restored(moments, placed[begun:n], placed[n:end])
            if len(restored) >= _SEVERAL:
                found[placed[n]] = restored
                begun = n
    return found


def _placed(moments: Sequence[Moment]) -> list[int]:
    """Places of what states both date and landings, by date."""
    found = [i for i, moment in enumerate(moments) if moment.day and moment.landings is not None]
    return sorted(found, key=lambda i: (moments[i].day, moments[i].landings))


def _restored(
    moments: Sequence[Moment], before: Sequence[int], after: Sequence[int]
) -> frozenset[int]:
    """Joints that were restored between two stretches of a life; none if another one reads
    wider.
    """
    days = moments[before[-1]].day, moments[after[0]].day
    recorded = (m.joints for m in moments if m.joints and days[0] <= m.day <= days[1])
    restored = frozenset[int]().union(*recorded)
    last = {joint: reading for i in before for joint, reading in moments[i].read.items()}
    first = {joint: reading for i in after[::-1] for joint, reading in moments[i].read.items()}
    tighter = set(restored)
    for joint in (last.keys() & first.keys()) - restored:
        (was, was_u), (reads, u) = last[joint], first[joint]
        clearly = _CLEARLY * hypot(was_u, u)
        if reads > was + clearly:
            return frozenset()
        if reads < was - clearly:
            tighter.add(joint)
    return frozenset(tighter)


def contradictions(moments: Sequence[Moment], name: Callable[[int], str]) -> dict[int, str]:
    """Say of each record that may be wrong how its date and its landings disagree with those of the
    others between the same overhauls.

    Suspect is what has to go so that the landings of the others never fall as time goes on: the
    fewest records that do. Where several choices are as few, every record of any of them is a
    suspect, and they share one sentence.
    """
    placed = _placed(moments)
    begins = [0, *(placed.index(place) for place in overhauls(moments)), len(placed)]
    found: dict[int, str] = {}
    for start, end in pairwise(begins):
        found |= _disagreements(moments, placed[start:end], name)
    return found


def _disagreements(
    moments: Sequence[Moment], placed: Sequence[int], name: Callable[[int], str]
) -> dict[int, str]:
    """The contradictions of the records between two overhauls."""
    landings = [moments[i].landings or 0.0 for i in placed]
    if landings == sorted(landings):
        return {}
    up_to = _longest_rising(landings)
    onwards = _longest_rising([-each for each in reversed(landings)])[::-1]
    longest = max(up_to)
    through = [before + after - 1 for before, after in zip(up_to, onwards, strict=True)]
    in_some = [n for n, length in enumerate(through) if length == longest]
    alone = Counter(up_to[n] for n in in_some)
    trusted = [n for n in in_some if alone[up_to[n]] == 1]
    suspects = [n for n in range(len(placed)) if n not in set(trusted)]

    def said(n: int) -> str:
        moment = moments[placed[n]]
        return f"{moment.landings:g} landings on {moment.day} ({name(placed[n])})"

    if len(trusted) < longest:
        listed = ", ".join(map(said, suspects[:_MOST_NAMED])) + (
            " …" if len(suspects) > _MOST_NAMED else ""
        )
        return dict.fromkeys(
            (placed[n] for n in suspects), f"{listed} cannot all be right: landings never fall"
        )
    found = {}
    for n in suspects:
        earlier = [m for m in trusted if m < n and landings[m] > landings[n]]
        other = (
            earlier[-1]
            if earlier
            else next(m for m in trusted if m > n and landings[m] < landings[n])
        )
        found[placed[n]] = f"{said(n)} disagree with {said(other)}: landings never fall"
    return found


def _longest_rising(values: Sequence[float]) -> list[int]:
    """Length of the longest series that never falls and ends at each value."""
    least: list[float] = []
    lengths = []
    for value in values:
        at = bisect_right(least, value)
        least[at : at + 1] = [value]
        lengths.append(at + 1)
    return lengths
