"""The state of a gear: what follows from the dated facts of its visits.

A visit replaces what it says anew, and a repair what it is about: a reading by a later reading of
the same joint or a later restoration of it, a plunger reading by a later one or any later repair, a
failure by a later repair *and* a retraction after that. Later is what the stated days and times say
for sure; of visits that were typed the order of entry decides where they do not. What is kept and
cannot be ordered stands if it is against the gear, and is never taken in its favour.

When the inspections and repairs of one gear took place, by their dates and their landings.
"""

from __future__ import annotations

from bisect import bisect, bisect_left
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import date, datetime, timedelta
from itertools import filterfalse, groupby, pairwise
from math import hypot, inf
from operator import itemgetter
from typing import TYPE_CHECKING, Any

import numpy as np

from mlg_troubleshoot.arrays import lasting_falls
from mlg_troubleshoot.decision.inspection import (
    Fact,
    FactKind,
    Inspection,
    Outcome,
    RiggingCheck,
    RowSource,
    surely_later,
)
from mlg_troubleshoot.gear.gear import ROUNDING_IN, Gear
from mlg_troubleshoot.units import ClearanceConvention, Length, Sentence

if TYPE_CHECKING:
    from mlg_troubleshoot.store import Record


GearKey = tuple[str, str]
_DAY = timedelta(days=1)
# That of a repair of which nobody stated the day, where the order of entry says what came first.
_SOME_DAY = date(2000, 1, 1)
# More rows or records than this are not listed in one sentence.
_MOST_NAMED = 6


@dataclass(frozen=True, slots=True)
class GearVisit:
    """Facts that were taken together: a row of a table, an entry at the prompts, or a repair that
    was recorded by itself.

    place: when it was entered; infinite until it is kept. [s]
    typed: whether it was typed; rows of a table are in no order.
    record: as it stands, once it is kept.
    """

    inspection: Inspection
    place: float = inf
    typed: bool = False
    record: Record | None = field(default=None, compare=False, repr=False)

    @property
    def kept(self) -> Record:
        if self.record is None:
            raise TypeError(f"{self.inspection.record_id} is not kept")
        return self.record

    @property
    def at(self) -> date | None:
        return self.inspection.inspection_date

    @property
    def visit(self) -> GearVisit:
        """Itself, where it is compared in time with what was found at others."""
        return self


@dataclass(frozen=True, slots=True)
class GearState:
    """What stands of a gear at a visit, or now.

    inspection: what the decision is about: the visit, with what stands of the other visits.
    older: the facts of other visits among it.
    """

    visit: GearVisit
    inspection: Inspection
    older: tuple[Fact, ...] = ()

    @property
    def is_in_doubt(self) -> bool:
        """Whether a plunger reading or an outcome is not surely newer than the repair."""
        row = self.inspection
        found = ((row.readings_in, row.plunger_date), (row.outcome, row.outcome_date))
        return any(what and row.is_since_repair(day) is not True for what, day in found)


def key_of(row: Inspection) -> GearKey:
    return row.tail_no, row.side.value


def other_visits_count(found: Iterable[GearState | None]) -> tuple[str, ...]:
    """Name in one note the rows of a list of which something may be older than a repair."""
    named = [
        state.visit.inspection.record_id
        for state in found
        if state is not None and state.is_in_doubt
    ]
    if not named:
        return ()
    listed = ", ".join(named[:_MOST_NAMED]) + (" …" if len(named) > _MOST_NAMED else "")
    rows = "1 row" if len(named) == 1 else f"{len(named)} rows"
    return (
        f"{rows}: other visits or repairs of the gear count as well ({listed}); where the order is"
        " not certain the worse reading does. The warnings of each row say which.",
    )


@dataclass(frozen=True, slots=True)
class _Event:
    """A fact with its visit; `value`: a clearance, or the largest displacement. [in]

    left: when the joint of a reading was restored at its own visit, before it was read.
    """

    visit: GearVisit
    at: date | None
    value: float = 0.0
    left: tuple[date | None, ...] = ()

    def fact(self, kind: FactKind, joint: int | None = None, value_in: float | None = None) -> Fact:
        return Fact(kind, joint, value_in, self.at, self.visit.inspection.record_id)


def _is_later(one: _Event | GearVisit, other: _Event | GearVisit) -> bool:
    if surely_later(one.at, other.at):
        return True
    if surely_later(other.at, one.at):
        return False
    if one.visit.inspection.is_left and one.visit is not other.visit:
        return _of_one_row(one.visit) == _of_one_row(other.visit)
    return one.visit.typed and one.visit.place > other.visit.place


def _is_after(found: _Event, repair: _Event) -> bool:
    """Whether something was found after a repair; as left it was, after that of its own visit."""
    is_own = found.visit is repair.visit and found.visit.inspection.is_left
    return _is_later(found, repair) or (is_own and not surely_later(repair.at, found.at))


def _of_one_row(visit: GearVisit) -> tuple[RowSource, date | None]:
    """What is found and left at one visit to a gear has in common."""
    return visit.inspection.source, visit.at


def _newest(events: Sequence[_Event]) -> list[_Event]:
    typed = [e for e in events if e.visit.typed]
    return [e for e in _last(events) if not any(_is_later(other, e) for other in typed)]


def states(visits: Sequence[GearVisit], gear: Gear) -> list[GearState]:
    """The state of one gear at each of its visits: what was known of it when the visit ended."""
    if len(visits) == 1:
        return [_alone(visits[0], gear)]
    found: dict[int, GearState] = {}
    known = _Known(gear, visits)
    undated: list[int] = []

    def is_ordered(visit: GearVisit) -> bool:
        return visit.place < inf or known.left_of(visit) is not None

    for day, same in _by_day(visits):
        together = [visits[n] for n in same]
        # Rows of one table that are in no order stand there themselves.
        known.add(day, together, [*filter(is_ordered, together)])
        if day is None:
            undated = same
        else:
            found |= {n: known.at(visits[n]) for n in same}
            known.note((), [*filterfalse(is_ordered, together)])
    found |= {n: known.at(visits[n]) for n in undated}
    return [found[n] for n in range(len(visits))]


def _by_day(visits: Sequence[GearVisit]) -> Iterator[tuple[date | None, list[int]]]:
    """Places of the visits of each day, first of those that state none."""
    order = sorted(range(len(visits)), key=lambda n: visits[n].at or date.min)
    for day, same in groupby(order, key=lambda n: visits[n].at):
        yield day, list(same)


def state_now(visits: Sequence[GearVisit], gear: Gear) -> GearState | None:
    """The state of one gear after all of its visits; None without any that found something.

    Visits stand in the order of time as far as it is known.
    """
    found = [v for v in visits if not _is_repair_alone(v.inspection)]
    found = [v for v in found if not v.inspection.says_nothing] or found
    if not found:
        return None
    known = _Known(gear, visits)
    if any(visit.typed for visit in visits):
        # Where the order of entry decides as well, a later day alone replaces nothing.
        known.note(visits, visits)
        return known.at(found[-1], now=True)
    for day, same in _by_day(visits):
        together = [visits[n] for n in same]
        known.add(day, together, together)
    return known.at(found[-1], now=True)


def _is_repair_alone(row: Inspection) -> bool:
    # A rigging that was set right was found wrong.
    found = row.rigging_checked is RiggingCheck.CORRECTED or row.readings_in or row.outcome
    return row.is_repaired and not (row.clearance_in or found)


def _alone(visit: GearVisit, gear: Gear) -> GearState:
    row = visit.inspection
    said = _as_found(row, gear)
    return GearState(visit, replace(row, warnings=(*row.warnings, said)) if said else row)


def _as_found(row: Inspection, gear: Gear) -> str:
    """Say which plunger reading of a visit its own repair replaced, where it was beyond the
    margin.
    """
    if not row.readings_in or row.standing_readings_in:
        return ""
    if not _is_beyond(row.readings_in, row, gear):
        return ""
    worst = max(row.readings_in, key=abs)
    fact = Fact(FactKind.PLUNGER, None, worst, row.plunger_date, row.record_id)
    return Sentence.of("As found, before the repair: {}.", fact.words)


def _is_beyond(readings_in: Iterable[float], row: Inspection, gear: Gear) -> bool:
    margin = gear.margin.value if row.margin_in is None else row.margin_in
    return any(abs(each) > margin + ROUNDING_IN for each in readings_in)


def _plunger_of(visit: GearVisit) -> _Event:
    row = visit.inspection
    return _Event(visit, _when(visit, row.plunger_date), max(map(abs, row.readings_in)))


def _outcome_of(visit: GearVisit) -> _Event:
    return _Event(visit, _when(visit, visit.inspection.outcome_date))


def _repair_of(visit: GearVisit) -> _Event:
    return _Event(visit, visit.inspection.repair_date)


def _when(visit: GearVisit, stated: date | None) -> date | None:
    """When something was found: what stands beside a repair that is later than the day of the
    visit may be newer than it.
    """
    row = visit.inspection
    updated = row.is_repaired and surely_later(row.repair_date, visit.at)
    return stated or (None if updated else visit.at)


# Stand in place of a joint for any repair, for one of the rigging, and for one of neither.
_ANY, _RIGGING, _OTHER = 0, -1, -2


class _Known:
    """What may still count of one gear, as its visits are added in the order of their days.

    readings, repairs: of each joint. settled: the last repair after which the gear retracted.
    """

    def __init__(self, gear: Gear, visits: Iterable[GearVisit] = ()) -> None:
        self.gear = gear
        self.readings: dict[int, list[_Event]] = {}
        self.plunger: list[_Event] = []
        self.failed: list[_Event] = []
        self.retracted: list[_Event] = []
        self.repairs: dict[int, list[_Event]] = {}
        self.settled: list[_Event] = []
        self.checked: list[_Event] = []
        self.signed: list[_Event] = []
        self._typed = sorted(visit.place for visit in visits if visit.typed)
        self._left = {_of_one_row(v): v.inspection for v in visits if v.inspection.is_left}

    def add(
        self, day: date | None, visits: Iterable[GearVisit], found: Sequence[GearVisit]
    ) -> None:
        """Add the repairs of all visits of a day, and what was found at some; let go what they
        replace at every visit that follows.
        """
        self.failed = [e for e in self.failed if not self.is_settled(e)]
        self.note(visits, found)

        def is_sure(event: _Event) -> bool:
            # Of what was typed on one day the order of entry decides.
            return not event.visit.typed or surely_later(day, event.visit.at)

        def last(events: list[_Event]) -> list[_Event]:
            return events if len(events) < 2 else _last(self._worst(day, events), is_sure)

        self.retracted = last(self.retracted)
        self.settled = _last(
            [*self.settled, *_followed(self.repairs.get(_ANY, ()), self.retracted, is_sure)]
        )
        if len(self.failed) > 1:
            failed = self._worst(day, self.failed)
            ends = _last(failed, is_sure), _last(failed, is_sure, first=True)
            # The first failure says since when the rigging counts as looked at, the last one what
            # has to be repaired.
            at_ends = {id(e) for each in ends for e in each}
            self.failed = [e for e in failed if id(e) in at_ends]
        self.readings = {joint: last(events) for joint, events in self.readings.items()}
        for joint, events in self.repairs.items():
            both = {id(e): e for each in (events, events[::-1]) for e in self._worst(day, each)}
            newest = _last(both.values(), is_sure)
            others = both.keys() - {id(e) for e in newest}
            # Of a reading at the row of the newest repair the one before it decides.
            self.repairs[joint] = newest + _last([both[n] for n in others], is_sure)
        self.plunger = last(self.plunger)
        self.checked = last(self.checked)
        self.signed = last(self.signed)

    def note(self, visits: Iterable[GearVisit], found: Sequence[GearVisit]) -> None:
        """Add the repairs of all visits, and what was found at some."""
        for visit in visits:
            self.repair(visit)
        self.read(found)
        self.find(found)

    def repair(self, visit: GearVisit) -> None:
        row = visit.inspection
        if not row.is_repaired:
            return
        is_rigging = row.rigging_checked is RiggingCheck.CORRECTED
        others = [_RIGGING] * is_rigging + [_OTHER] * bool(row.other_repair)
        for what in (_ANY, *row.restored_joints, *others):
            self.repairs.setdefault(what, []).append(_repair_of(visit))

    def left_of(self, visit: GearVisit) -> Inspection | None:
        """What was left at the visit at which this was found."""
        is_found = self._left and not visit.inspection.is_left
        return self._left.get(_of_one_row(visit)) if is_found else None

    def read(self, visits: Iterable[GearVisit]) -> None:
        """Add the readings of joints at some visits."""
        for visit in visits:
            row = visit.inspection
            after = self.left_of(visit)
            anew = {*after.clearance_in, *after.restored_joints} if after else ()
            for joint, value in row.clearance_in.items():
                if joint in anew:
                    continue
                left = (row.repair_date,) if joint in row.restored_joints else ()
                read = _Event(visit, visit.at, value, left)
                self.readings.setdefault(joint, []).append(read)

    def find(self, visits: Iterable[GearVisit]) -> None:
        """Add what else was found at some visits."""
        for visit in visits:
            row = visit.inspection
            after = self.left_of(visit)
            if row.readings_in and not (after and after.readings_in):
                self.plunger.append(_plunger_of(visit))
            if row.outcome is not None:
                tried = self.failed if row.outcome is Outcome.FAILED else self.retracted
                tried.append(_outcome_of(visit))
            if row.rigging_checked is RiggingCheck.YES:
                self.checked.append(_Event(visit, visit.at))
            if row.signed_off:
                self.signed.append(_Event(visit, visit.at))

    def _worst(self, day: date | None, events: Iterable[_Event]) -> Collection[_Event]:
        """Of events of which nothing says that one is later than another, the worst one."""
        found: dict[object, _Event] = {}
        for event in events:
            visit = event.visit
            after = self.left_of(visit)
            is_kept = visit.place < inf
            same: object = (
                id(visit)
                if visit.typed
                else (
                    event.at,
                    event.left,
                    visit.at and visit.at == day,
                    is_kept and bisect(self._typed, visit.place),
                    is_kept,
                    after is not None and after.is_repaired,
                )
            )
            if same not in found or event.value > found[same].value:
                found[same] = event
        return found.values()

    def is_settled(self, event: _Event) -> bool:
        """Whether a gear was repaired after something was found, and retracted after that."""
        return any(_is_later(repair, event) for repair in self.settled)

    def at(self, visit: GearVisit, *, now: bool = False) -> GearState:
        return _AsOf(self, visit, now=now).state()


def _always(_event: _Event) -> bool:
    return True


def _last(
    events: Collection[_Event],
    is_sure: Callable[[_Event], bool] = _always,
    *,
    first: bool = False,
) -> list[_Event]:
    """Events than which no other one that is sure is surely later; `first`: earlier."""
    later = _surely_earlier if first else surely_later
    ends: list[date] = []
    for moment in {e.at for e in events if e.at is not None and is_sure(e)}:
        if not any(later(end, moment) for end in ends):
            ends = [moment, *(end for end in ends if not later(moment, end))]
    return [e for e in events if not any(later(end, e.at) for end in ends)]


def _surely_earlier(one: date | None, other: date | None) -> bool:
    return surely_later(other, one)


def _followed(
    repairs: Iterable[_Event],
    retracted: Collection[_Event],
    is_sure: Callable[[_Event], bool] = _always,
) -> list[_Event]:
    """Repairs after which the gear retracted."""
    tried = [e for e in retracted if is_sure(e)]
    return [r for r in repairs if is_sure(r) and any(_is_after(t, r) for t in tried)]


class _AsOf:
    """What counts at one visit; `now`: after all visits, of which it is the last one."""

    def __init__(self, known: _Known, visit: GearVisit, *, now: bool) -> None:
        self._known = known
        self._own = _Known(known.gear)
        self._own.repair(visit)
        self._own.find([visit])
        self._gear = known.gear
        self._visit = visit
        self._row = visit.inspection
        self._now = now
        self._repairs = {
            joint: [
                *(
                    e
                    for e in known.repairs.get(joint, ())
                    if not self._is_own(e) and (now or not _is_later(e.visit, visit))
                ),
                *self._own.repairs.get(joint, ()),
            ]
            for joint in known.repairs.keys() | self._own.repairs.keys()
        }
        self._retracted = self._counting(known.retracted, self._own.retracted)
        self._settled = _followed(self._of(), self._retracted)
        self._older: list[Fact] = []
        self._said: list[str] = []
        self._taken: dict[int, _Event] = {}

    def state(self) -> GearState:
        row = self._row
        changed = self._readings()
        plunger = self._plunger()
        outcome = self._outcome()
        readings = () if plunger is None else self._repeated(plunger)
        if readings != row.readings_in:
            changed["readings_in"] = readings
        if plunger is not None and "readings_in" in changed:
            changed["plunger_gauge_u_in"] = plunger.visit.inspection.plunger_gauge_u_in
        if row.rigging_checked is None and self._is_rigging_checked():
            changed["rigging_checked"] = RiggingCheck.YES
        by = self._measured_by(changed.get("clearance_in", row.clearance_in), plunger)
        if by != row.technician_id:
            changed["technician_id"] = by
        stands = None if outcome is None else outcome.visit.inspection.outcome
        if stands is not row.outcome:
            changed["outcome"] = stands
        changed |= self._in_order(plunger, outcome)
        said = [*self._said, *filter(None, [_as_found(row, self._gear)])]
        if not changed and not said:
            return GearState(self._visit, row)
        inspection = replace(row, warnings=(*row.warnings, *said), **changed)
        return GearState(self._visit, inspection, tuple(self._older))

    def _counting(self, events: Iterable[_Event], own: Iterable[_Event]) -> list[_Event]:
        """What is surely older than the visit, and what is kept and may be; its own comes last."""
        return [
            e
            for e in events
            if not self._is_own(e)
            if self._now
            or _is_later(self._visit, e.visit)
            or (e.visit.place < inf and not _is_later(e.visit, self._visit))
        ] + [*own]

    def _is_own(self, event: _Event) -> bool:
        return event.visit is self._visit

    def _later(self, event: _Event, joint: int = _ANY) -> list[_Event]:
        """Repairs, of one joint or any, that are surely later."""
        return [r for r in self._of(joint, event) if _is_later(r, event)]

    def _of(self, joint: int = _ANY, read: _Event | None = None) -> list[_Event]:
        """Repairs, of one joint or any; not that after which it was `read`: a row tells of a joint
        how it was left.
        """
        repairs = self._repairs.get(joint, [])
        if joint == _ANY or read is None:
            return repairs
        return [r for r in repairs if r.visit is not read.visit]

    def _counts_for(self, event: _Event, joint: int = _ANY) -> bool:
        """Whether something may count in favour of the gear: it is surely older than the visit,
        and no repair of another visit may have replaced it.
        """
        if self._is_own(event) and not self._now:
            return True
        is_before = self._now or _is_later(self._visit, event.visit)
        return is_before and all(_is_after(event, r) for r in self._of(joint, event))

    def _readings(self) -> dict[str, Any]:
        """Clearances of other visits that stand, and of this one those that do."""
        row = self._row
        taken = self._taken
        gone: set[int] = set()
        for joint, events in self._known.readings.items():
            own = joint in row.clearance_in
            if (own and not self._now) or joint not in self._gear.joint_numbers:
                continue
            limit = self._gear.joint(joint)
            standing = [
                e
                for e in _newest(self._counting(events, filter(self._is_own, events)))
                if not self._later(e, joint)
                and (limit.is_over_limit(e.value) or self._counts_for(e, joint))
            ]
            worst = max(standing, key=lambda e: e.value, default=None)
            if worst is None or not self._is_own(worst):
                gone |= {joint} if own else set()
            if worst is not None and not self._is_own(worst):
                taken[joint] = worst
        if not taken and not gone:
            return {}
        clearance = {j: value for j, value in row.clearance_in.items() if j not in gone}
        entered = {j: text for j, text in row.entered.items() if j not in gone}
        gauge_u = {j: u for j, u in row.gauge_u_by_joint_in.items() if j not in gone}
        again = {*row.measured_again}
        questions = dict.fromkeys([row.unit_question] * bool(row.unit_question))
        for joint, event in sorted(taken.items(), key=lambda each: (each[1].visit.place, each[0])):
            read = event.visit.inspection
            clearance[joint] = event.value
            if joint in read.entered and read.convention is row.convention:
                entered[joint] = read.entered[joint]
            if (u := read.gauge_u_of(joint)) != row.gauge_u_in:
                gauge_u[joint] = u
            again.update({joint}.intersection(read.measured_again))
            if read.unit_question:
                questions[read.unit_question] = None
            self._older.append(event.fact(FactKind.READING, joint, event.value))
        if taken:
            by_visit = groupby(self._older, key=lambda fact: (fact.date, fact.record))
            listed = Sentence.joined(
                (_of_one_visit([*facts], row.convention) for _, facts in by_visit), "; "
            )
            self._said.append(Sentence.of("Readings of other entries stand as well: {}.", listed))
        return {
            "clearance_in": clearance,
            "entered": entered,
            "gauge_u_by_joint_in": gauge_u,
            "measured_again": tuple(sorted(again)),
            "unit_question": " ".join(questions),
        }

    def _measured_by(self, joints: Iterable[int], plunger: _Event | None) -> str | None:
        """Who measured what stands, and of several who measured what."""
        read = {
            f"#{n}": self._taken[n].visit if n in self._taken else self._visit
            for n in sorted(joints)
        }
        if plunger is not None:
            read["plunger"] = plunger.visit
        by: dict[str, list[str]] = {}
        for what, visit in read.items():
            if name := visit.inspection.technician_id:
                by.setdefault(name, []).append(what)
        if len(by) < 2:
            return next(iter(by), self._row.technician_id)
        return "; ".join(f"{name} ({', '.join(what)})" for name, what in by.items())

    def _plunger(self) -> _Event | None:
        """The plunger reading that stands; one that a repair replaced where nobody has tried the
        gear since.
        """
        row = self._row
        own = _plunger_of(self._visit) if row.readings_in else None
        if own is not None and not self._now:
            return own
        newest = _newest(self._counting(self._known.plunger, self._own.plunger))
        replaced = [e for e in newest if self._later(e)]
        standing = [
            e for e in newest if e not in replaced and (self._is_beyond(e) or self._counts_for(e))
        ]
        untried = [e for e in replaced if self._is_beyond(e) and not self._is_settled(e)]
        mine = next((e for e in newest if self._is_own(e)), None)
        event = max(standing or untried, key=lambda e: e.value, default=mine)
        if event is None or self._is_own(event):
            return event
        readings = event.visit.inspection.readings_in
        facts = [event.fact(FactKind.PLUNGER, None, each) for each in readings]
        listed = Sentence.joined((fact.words for fact in facts), ", ")
        if not standing:
            self._said.append(Sentence.of("Before the repair: {}. Not tried since.", listed))
            return event
        self._older += facts
        self._said.append(Sentence.of("The plunger reading of another entry stands: {}.", listed))
        return event

    def _repeated(self, event: _Event) -> tuple[float, ...]:
        """Plunger readings of a visit, after those that were typed earlier on its day without a
        repair between them. [in]
        """
        together = [
            e
            for e in self._counting(self._known.plunger, self._own.plunger)
            if event.visit.typed and e.visit.typed and e.at == event.at and _is_later(event, e)
            if not any(_is_later(r, e) and not _is_later(r, event) for r in self._of())
        ]
        together.append(event)
        read = [(e, each) for e in together for each in e.visit.inspection.readings_in]
        if len(together) > 1 and self._is_own(event):
            self._older += [e.fact(FactKind.PLUNGER, None, each) for e, each in read]
        return tuple(each for _event, each in read)

    def _failures(self) -> list[_Event]:
        """Failures that are not settled."""
        counting = self._counting(self._known.failed, self._own.failed)
        return [e for e in counting if not self._is_settled(e)]

    def _is_rigging_checked(self) -> bool:
        """Whether the rigging was looked at since the failure that stands."""
        failed = self._failures()
        checked = self._counting(self._known.checked, self._own.checked)
        return bool(failed) and any(not _is_later(failed[0], e) for e in checked)

    def _is_beyond(self, event: _Event) -> bool:
        return _is_beyond(event.visit.inspection.readings_in, self._row, self._gear)

    def _is_settled(self, event: _Event) -> bool:
        # What is typed without a day may be older than what is settled at the visits of the days.
        known = self._known.settled if self._now or self._visit.at else ()
        return any(_is_later(repair, event) for repair in (*known, *self._settled))

    def _outcome(self) -> _Event | None:
        """The outcome that stands: a failure that is not settled, else the newest retraction."""
        row = self._row
        own = _outcome_of(self._visit) if row.outcome is not None else None
        still = self._failures()
        if own is not None and row.outcome is Outcome.FAILED and not self._is_settled(own):
            return own
        if still:
            stands = [e for e in still if not self._later(e)]
            event = (stands or still)[-1]
            fact = event.fact(FactKind.FAILED)
            self._older.append(fact)
            then = "no repair is surely later" if stands else "it was not tried since the repair"
            when = "" if event.at is None else f" on {event.at.isoformat()}"
            self._said.append(f"{fact.record} states that this gear failed{when}: {then}.")
            return event
        tried = _newest([e for e in self._retracted if self._counts_for(e)])
        if not tried or (row.outcome is Outcome.RETRACTED and not self._now):
            return None if row.outcome is Outcome.FAILED else own
        self._older.append(tried[-1].fact(FactKind.RETRACTED))
        return tried[-1]

    def _in_order(self, plunger: _Event | None, outcome: _Event | None) -> dict[str, Any]:
        """Tell the decision of the repairs of other visits, and whether the plunger reading and
        the outcome are older, newer, or neither for sure.

        The days are made for that comparison: the decision compares them and shows none.
        """
        found = {"plunger_date": plunger, "outcome_date": outcome}
        dated = {name: event for name, event in found.items() if event is not None}
        own = self._own.repairs.get(_ANY, [])

        signed = self._counting(self._known.signed, self._own.signed)
        is_open = outcome is not None and outcome.visit.inspection.outcome is Outcome.FAILED

        def is_since(repair: _Event) -> bool:
            if not is_open and any(_is_later(e, repair) for e in signed):
                return False
            if self._is_own(repair) or (own and not self._now):
                return False
            return (
                any(_is_later(repair, e) for e in dated.values())
                or self._is_closed_by(outcome, repair)
                # What was typed waits for its sign-off, whatever was read since.
                or (self._now and repair.visit.typed and not is_open)
                or not _is_later(own[0] if own else self._visit, repair)
            )

        since = {what: [*filter(is_since, done)] for what, done in self._repairs.items()}
        others = {id(r.visit): r for done in since.values() for r in done}
        if not (own or others):
            return {}
        if not (others or any(not self._is_own(e) for e in dated.values())):
            return {}
        days = [_day_of(r.at) for r in (*own, *others.values()) if r.at is not None]
        day = max(days, default=self._visit.at or _SOME_DAY)
        done = {what for what, later in since.items() if later} | self._own.repairs.keys()
        joints = tuple(sorted(done - {_ANY, _RIGGING, _OTHER}))
        changed: dict[str, Any] = {"restored_joints": joints, "repair_date": day}
        if _RIGGING in done:
            changed["rigging_checked"] = RiggingCheck.CORRECTED
        if later := since.get(_OTHER):
            changed["other_repair"] = later[-1].visit.inspection.other_repair
        self._say_repairs([r for r in others.values() if not _is_later(self._visit, r)])
        return changed | {name: _place(e, self._of(), day) for name, e in dated.items()}

    def _is_closed_by(self, outcome: _Event | None, repair: _Event) -> bool:
        """Whether a gear that had failed retracted after its repair, first at this visit or at one
        that was typed: the repair is not signed off.
        """
        first = next((e for e in self._retracted if _is_after(e, repair)), None)
        if first is None or not (first.visit.typed or self._is_own(first)):
            return False
        failed = (*self._known.failed, *self._own.failed)
        is_good = outcome is not None and outcome.visit.inspection.outcome is Outcome.RETRACTED
        return is_good and any(_is_later(repair, e) for e in failed)

    def _say_repairs(self, repairs: Sequence[_Event]) -> None:
        """Name repairs that may be later than this visit."""
        for repair in repairs:
            done = repair.visit.inspection
            joints = [f"#{joint}" for joint in done.restored_joints]
            rerigged = done.rigging_checked is RiggingCheck.CORRECTED
            parts = [", ".join(joints), "the rigging" * rerigged, done.other_repair]
            what = " and ".join(filter(None, parts))
            when = "without a date" if repair.at is None else f"on {repair.at.isoformat()}"
            then = (
                "what is older does not count"
                if _is_later(repair, self._visit)
                else "this visit may be older or newer, so its worse readings count"
            )
            self._said.append(f"{done.record_id} states a repair of {what} {when}: {then}.")


def _of_one_visit(facts: Sequence[Fact], kind: ClearanceConvention) -> Sentence:
    """Readings of one visit in words: ``#3 0.0130 in, #5 0.0040 in radial on 2026-01-15 (R1)``."""
    read = [
        Sentence.of("#{} {}", fact.joint, Length((fact.value_in or 0.0) * kind.per_radial))
        for fact in facts
    ]
    return Sentence.of("{} {} {}", Sentence.joined(read, ", "), kind.words, facts[0].when)


def _place(event: _Event, repairs: Iterable[_Event], day: date) -> date:
    """A day before the repair, after it, or the same for what cannot be ordered."""
    if any(_is_later(repair, event) for repair in repairs):
        return day - _DAY
    return day + _DAY if all(_is_after(event, repair) for repair in repairs) else day


def _day_of(at: date) -> date:
    return at.date() if isinstance(at, datetime) else at


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
    found: dict[int, frozenset[int]] = {}
    if not _falls(moments):
        return found
    placed = _placed(moments)
    landings = np.array([moments[i].landings for i in placed], float)
    repairs = [(m.day, m.joints) for m in moments if m.joints]
    recorded = sorted(repairs, key=itemgetter(0))
    days = [day for day, _joints in recorded]
    falls = [0, *lasting_falls(landings).tolist(), len(placed)]
    last: dict[int, tuple[float, float]] = {}
    for (start, n), end in zip(pairwise(falls), falls[2:], strict=False):
        for i in placed[start:n]:
            last |= moments[i].read
        first: dict[int, tuple[float, float]] = {}
        for i in reversed(placed[n:end]):
            first |= moments[i].read
        begins = bisect_left(days, moments[placed[n - 1]].day)
        ends = bisect(days, moments[placed[n]].day)
        done = frozenset[int]().union(*(joints for _day, joints in recorded[begins:ends]))
        restored = _restored(done, last, first)
        if len(restored) >= _SEVERAL:
            found[placed[n]] = restored
            last = {}
    return found


def _placed(moments: Sequence[Moment]) -> list[int]:
    """Places of what states both date and landings, by date."""
    found = [i for i, moment in enumerate(moments) if moment.day and moment.landings is not None]
    return sorted(found, key=lambda i: (moments[i].day, moments[i].landings))


def _falls(moments: Sequence[Moment]) -> list[tuple[int, int]]:
    """Neighbours by date of which the later one states fewer landings."""
    landings = [moment.landings or 0.0 for moment in moments]
    return [pair for pair in pairwise(_placed(moments)) if landings[pair[0]] > landings[pair[1]]]


def _restored(
    recorded: frozenset[int],
    last: Mapping[int, tuple[float, float]],
    first: Mapping[int, tuple[float, float]],
) -> frozenset[int]:
    """Joints that were restored between the last readings before and the first ones after, by
    records and as they read; none if another one reads wider.
    """
    tighter = set(recorded)
    for joint in (last.keys() & first.keys()) - recorded:
        (was, was_u), (reads, u) = last[joint], first[joint]
        clearly = _CLEARLY * hypot(was_u, u)
        if reads > was + clearly:
            return frozenset()
        if reads < was - clearly:
            tighter.add(joint)
    return frozenset(tighter)


def contradictions(moments: Sequence[Moment], name: Callable[[int], str]) -> dict[int, str]:
    """Say of each record whose landings are fewer than those of the one before it, and of that one,
    that they cannot both be right; overhauls lie between none of them.
    """
    anew = overhauls(moments)
    found: dict[int, str] = {}
    for one, two in _falls(moments):
        if two in anew:
            continue
        listed = " and ".join(
            f"{moments[n].landings:g} landings on {moments[n].day} ({name(n)})" for n in (one, two)
        )
        found[two] = f"{listed} cannot both be right: landings never fall"
        found.setdefault(one, found[two])
    return found
