"""The life of each gear, folded from its records: what was corrected or voided does not count."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import date, datetime
from functools import cached_property, lru_cache
from math import inf

from mlg_troubleshoot.decision.assessment import Verdict
from mlg_troubleshoot.decision.inspection import Inspection, Side, plain_tail, surely_later
from mlg_troubleshoot.decision.plan import Plan
from mlg_troubleshoot.decision.sentences import joint_list
from mlg_troubleshoot.errors import UsageError
from mlg_troubleshoot.life.chronology import Moment, contradictions, in_order, overhauls
from mlg_troubleshoot.store import (
    Judge,
    Record,
    RecordKind,
    Store,
    StoreError,
    inspection_from,
)

GearKey = tuple[str, str]
# Letters of a hash by which a record may be named. [1]
LEAST_OF_A_HASH = 6
# Contents that stay unpacked: those of the gears that are being worked on, not of a fleet. [1]
_UNPACKED = 4096


# Who judges is not part of what a record says, but decides whether it can be read.
@lru_cache(_UNPACKED)
def _inspection_of(record: Record, _judge: Judge | None) -> Inspection:
    return inspection_from(record)


@dataclass(frozen=True, slots=True)
class KeptInspection:
    """An inspection as it stands after corrections, unpacked when it is asked for."""

    record: Record

    @property
    def inspection(self) -> Inspection:
        return _inspection_of(self.record, self.record.judge)

    @property
    def moment(self) -> Moment:
        return Moment.of(self.inspection)


Event = KeptInspection | Record


@dataclass(frozen=True, slots=True)
class TodaysVerdict:
    """What a check says of one kept inspection; the worse of two has the greater `severity`.

    worst_joint: the joint to look at first.
    """

    verdict: Verdict
    predicted_displacement_in: float | None
    margin_in: float
    worst_joint: int
    plan: Plan
    in_brief: str
    severity: tuple[float, ...]


@dataclass(frozen=True)
class GearLife:
    """What stands of one gear: inspections and repairs in the order of time, outcomes, and every
    record as it came.

    warnings: the records whose dates and landings disagree, and how to correct them; with any of
    them nothing is forecast.
    overhauls: events from which landings begin anew, by their place, with the joints that were
    restored there.
    judged, standing: what is said of inspections as they were found, and of those that may be the
    last one since the repairs, by their hash; empty until they are judged.
    """

    key: GearKey
    records: tuple[Record, ...]
    events: tuple[Event, ...]
    outcomes: tuple[Record, ...]
    warnings: tuple[str, ...]
    overhauls: Mapping[int, frozenset[int]] = field(default_factory=dict)
    judged: Mapping[str, TodaysVerdict] = field(default_factory=dict)
    standing: Mapping[str, TodaysVerdict] = field(default_factory=dict)

    @property
    def name(self) -> str:
        return " ".join(self.key)

    @property
    def notes(self) -> tuple[str, ...]:
        """What is to be known of its history: from where its landings begin anew."""
        return tuple(
            f"Landings begin anew on {_moment(self.events[place]).day}: taken as an overhaul that"
            f" restored {joint_list(sorted(joints))}. Landings before it are negative here."
            for place, joints in self.overhauls.items()
        )

    @cached_property
    def inspections(self) -> tuple[KeptInspection, ...]:
        return tuple(event for event in self.events if isinstance(event, KeptInspection))

    @cached_property
    def repairs(self) -> tuple[Record, ...]:
        """Restorations of joints and re-riggings."""
        return tuple(event for event in self.events if isinstance(event, Record))

    @property
    def latest(self) -> KeptInspection | None:
        return self.inspections[-1] if self.inspections else None

    @property
    def newest(self) -> tuple[KeptInspection, ...]:
        """The inspections that may be the last one, as far as days, landings and the order of what
        was entered by hand say.
        """
        newest = max((kept.record.day for kept in self.inspections), default="")
        return tuple(kept for kept in self.inspections if self._may_be_last(kept, newest))

    def _may_be_last(self, kept: KeptInspection, newest: str) -> bool:
        last = self.inspections[-1]
        if kept is last:
            return True
        if not kept.record.day:
            # Nobody can say that an inspection without a date is an earlier one, unless a repair
            # was entered after it; rows of a table are in no order.
            entered = [r.seq for r in self.repairs if "stated_by" not in r.body]
            return kept.record.seq > max(entered, default=-1)
        if not last.record.day:
            return kept.record.day == newest and not self.is_repaired_since(kept)
        landings = kept.inspection.gear_landings, last.inspection.gear_landings
        ordered = None not in landings and landings[0] != landings[1]
        by_hand = kept.inspection.source.file is last.inspection.source.file is None
        return kept.record.day == last.record.day and not ordered and not by_hand

    def is_repaired_since(self, kept: KeptInspection) -> bool:
        """Whether a repair is surely later, also than the one that the inspection states."""
        row = kept.inspection
        days = (row.inspection_date, *((row.repair_date,) if row.is_repaired else ()))
        return any(
            all(surely_later(moment_of_repair(record), day) for day in days)
            for record in self.repairs
        )

    @property
    def worst(self) -> tuple[KeptInspection, TodaysVerdict] | None:
        """Of the inspections that may be the last one the worst; None until they are judged."""
        known = [kept for kept in self.newest if kept.record.digest in self.standing]
        if not known:
            return None
        worst = max(known, key=lambda kept: self.standing[kept.record.digest].severity)
        return worst, self.standing[worst.record.digest]

    def versions(self, last: Record) -> list[Record]:
        """An inspection from its first entry to the given one."""
        chain = [last]
        for record in reversed(self.records):
            if chain[-1].kind is not RecordKind.CORRECTION:
                break
            if record.digest == chain[-1].body["supersedes"]:
                chain.append(record)
        return chain[::-1]


def lives(
    store: Store, tail: str | None = None, side: str | None = None
) -> dict[GearKey, GearLife]:
    """Every gear's life, or those of one aircraft."""
    return _lives(store.all() if tail is None else store.of_gear(tail, side))


def lives_of(
    store: Store, keys: Collection[GearKey], up_to: float = inf
) -> dict[GearKey, GearLife]:
    """The lives of some gears; of their records up to a number, as they were corrected or voided
    since.
    """
    wanted = set(keys)
    records = store.of_aircraft({tail for tail, _side in wanted})
    later = (RecordKind.CORRECTION, RecordKind.VOID)
    return _lives(
        each
        for each in records
        if (each.tail_no, each.side) in wanted and (each.seq <= up_to or each.kind in later)
    )


def _lives(records: Iterable[Record]) -> dict[GearKey, GearLife]:
    by_gear: dict[GearKey, list[Record]] = {}
    for record in records:
        by_gear.setdefault((record.tail_no, record.side), []).append(record)
    return {key: _life(key, own) for key, own in sorted(by_gear.items())}


def life_of(store: Store, tail: str, side: str) -> GearLife:
    """One gear's life; a gear without records is a usage error that names near spellings."""
    side = Side.parse(side).value
    life = lives(store, tail, side).get((tail, side))
    if life is None:
        near = [f"{t} {s}" for t, s in store.gears() if plain_tail(t) == plain_tail(tail)]
        raise UsageError(
            f"no records of {tail} {side} in {store.place}",
            f"The store has {', '.join(near)}."
            if near
            else "See which gears are kept: mlg history",
        )
    for kept in life.inspections:
        # What stands there and cannot be read is named before anything is added to it.
        _ = kept.inspection
    return life


def warnings_of(store: Store, keys: Collection[GearKey]) -> list[str]:
    """The records of some gears whose dates and landings disagree."""
    found = lives_of(store, keys).values()
    return [warning for life in found for warning in life.warnings]


def find(store: Store, record_id: str) -> Record:
    """Find the record that a command names: by its id, or by the first letters of its hash where an
    id is not one.
    """
    live = [
        record
        for life in lives(store).values()
        for record in (*(s.record for s in life.inspections), *life.repairs, *life.outcomes)
    ]
    inspections = (RecordKind.INSPECTION, RecordKind.CORRECTION)
    found = [r for r in live if r.record_id == record_id and r.kind in inspections]
    if not found and len(record_id) >= LEAST_OF_A_HASH:
        found = [r for r in live if r.digest.startswith(record_id.lower())]
    if len(found) == 1:
        return found[0]
    if not found:
        raise UsageError(
            f"no record {record_id!r} in {store.place}",
            "See the records: mlg history TAIL SIDE",
        )
    named = ", ".join(
        f"{r.digest[:10]} ({r.tail_no} {r.side} {r.day or 'no date'})" for r in found[:6]
    )
    raise UsageError(
        f"{len(found)} records are called {record_id!r}: {named}",
        "Name one by the start of its hash.",
    )


def moment_of_repair(record: Record) -> date | None:
    """When a kept repair was done, with its time where the inspection that states it has one."""
    try:
        return datetime.fromisoformat(record.body["at"])
    except (KeyError, TypeError, ValueError):
        return date.fromisoformat(record.day) if record.day else None


def is_readable(record: Record) -> bool:
    try:
        return bool(record.body)
    except StoreError:
        return False


def _life(key: GearKey, records: Sequence[Record]) -> GearLife:
    kept: dict[str, KeptInspection] = {}
    others: dict[str, Record] = {}
    records = _readable_or_not_void(records)
    for record in records:
        if record.kind is RecordKind.INSPECTION:
            kept[record.digest] = KeptInspection(record)
        elif record.kind is RecordKind.CORRECTION:
            wrong = record.body["supersedes"]
            first = next((k for k, s in kept.items() if wrong in (k, s.record.digest)), None)
            if first is not None:
                kept[first] = KeptInspection(record)
        elif record.kind is RecordKind.VOID:
            gone = record.body["voids"]
            kept = {k: s for k, s in kept.items() if gone not in (k, s.record.digest)}
            others.pop(gone, None)
        elif record.kind is not RecordKind.ASSESSMENT:
            others[record.digest] = record
    work = (RecordKind.REPAIR, RecordKind.RERIG)
    repairs = [r for r in others.values() if r.kind in work]
    events: list[Event] = [*kept.values(), *repairs]
    events.sort(key=lambda event: _record_of(event).seq)
    moments = [_moment(event) for event in events]
    order = in_order(moments)
    return GearLife(
        key,
        tuple(records),
        tuple(events[place] for place in order),
        tuple(r for r in others.values() if r.kind is RecordKind.OUTCOME),
        _disagreements(key, events, moments),
        overhauls([moments[place] for place in order]),
    )


def _readable_or_not_void(records: Sequence[Record]) -> list[Record]:
    """Leave out what is void and cannot be read: that is how such a record is put aside."""
    void: set[str] = set()
    kept = []
    # A record is void by a later one.
    for record in reversed(records):
        if record.digest not in void or is_readable(record):
            kept.append(record)
            if record.kind is RecordKind.VOID:
                void.add(record.body["voids"])
    return kept[::-1]


def _record_of(event: Event) -> Record:
    return event.record if isinstance(event, KeptInspection) else event


def _moment(event: Event) -> Moment:
    if isinstance(event, KeptInspection):
        return event.moment
    joints = frozenset(event.body.get("joints", ()))
    return Moment(event.day, event.body.get("landings"), restored=joints)


def _disagreements(
    key: GearKey, events: Sequence[Event], moments: Sequence[Moment]
) -> tuple[str, ...]:
    """Name the records whose dates and landings disagree, each with how to correct it."""

    def name(place: int) -> str:
        record = _record_of(events[place])
        what = "" if isinstance(events[place], KeptInspection) else f"{record.kind} "
        return f"{what}{record.record_id}, ".lstrip(", ") + record.digest[:10]

    by_sentence: dict[str, list[int]] = {}
    for place, sentence in contradictions(moments, name).items():
        by_sentence.setdefault(sentence, []).append(place)
    warnings = []
    for sentence, places in by_sentence.items():
        record = _record_of(events[places[0]]).digest[:10] if len(places) == 1 else "RECORD"
        remedy = f"mlg history void {record} --why TEXT"
        if any(isinstance(events[place], Record) for place in places):
            remedy += ", then mlg history repair"
        else:
            remedy = f"mlg history correct {record} FILE, or {remedy}"
        gear = " ".join(key)
        warnings.append(
            f"{gear}: {sentence}. No forecast until this is corrected: {remedy}. After an overhaul"
            f" record its joints: mlg history repair {gear} --joint N --date D"
        )
    return tuple(warnings)
