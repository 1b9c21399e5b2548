"""The life of each gear, folded from its records: what was corrected or voided does not count."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import date, datetime
from functools import cached_property, lru_cache
from operator import itemgetter

from mlg_troubleshoot.decision.assessment import Verdict
from mlg_troubleshoot.decision.inspection import Inspection, RiggingCheck, Side, plain_tail
from mlg_troubleshoot.decision.plan import Plan
from mlg_troubleshoot.decision.sentences import joint_list
from mlg_troubleshoot.errors import UsageError
from mlg_troubleshoot.life.chronology import Moment, contradictions, in_order, overhauls
from mlg_troubleshoot.life.state import GearKey, GearState, GearVisit
from mlg_troubleshoot.store import (
    Judge,
    Record,
    RecordKind,
    Store,
    StoreError,
    inspection_from,
)
from mlg_troubleshoot.units import ClearanceConvention

# Letters of a hash by which a record may be named. [1]
LEAST_OF_A_HASH = 6
_WORK = (RecordKind.REPAIR, RecordKind.RERIG)
# Contents that stay unpacked: those of the gears that are being worked on, not of a fleet. [1]
_UNPACKED = 4096
# What a clock counts in. [s]
_TICK_S = 1e-6


# Who judges is not part of what a record says, but decides whether it can be read.
@lru_cache(_UNPACKED)
def _inspection_of(record: Record, _judge: Judge | None) -> Inspection:
    return inspection_from(record)


@dataclass(frozen=True, slots=True)
class KeptInspection:
    """An inspection as it stands after corrections, unpacked when it is asked for.

    first: as it was entered, which decides what was typed before it.
    """

    record: Record
    first: Record

    @property
    def inspection(self) -> Inspection:
        return _inspection_of(self.record, self.record.judge)

    @property
    def moment(self) -> Moment:
        return Moment.of(self.inspection)

    def visit(self, place: float) -> GearVisit:
        row = self.inspection
        return GearVisit(row, place, row.source.file is None, self.record.digest)


@dataclass(frozen=True, slots=True)
class Repair:
    """Joints that were restored on a day (ISO 8601, empty if not known), or none where the rigging
    was set right, and the record that states it.
    """

    record: Record
    day: str
    joints: frozenset[int]
    landings: float | None = None

    @classmethod
    def of(cls, record: Record) -> Repair:
        """A repair that was recorded by itself."""
        joints = frozenset(record.body.get("joints", ()))
        return cls(record, record.day, joints, record.body.get("landings"))

    @classmethod
    def stated(cls, kept: KeptInspection) -> list[Repair]:
        """What an inspection states of repairs."""
        row = kept.inspection
        day = "" if row.repair_date is None else _day_of(row.repair_date).isoformat()
        rerigged = row.rigging_checked is RiggingCheck.CORRECTED
        done = [frozenset(row.restored_joints)] * bool(row.restored_joints)
        done += [frozenset()] * rerigged
        return [cls(kept.record, day, joints) for joints in done if day]

    @property
    def moment(self) -> Moment:
        return Moment(self.day, self.landings, restored=self.joints)

    @property
    def first(self) -> Record:
        return self.record

    def visit(self, place: float) -> GearVisit:
        """The visit of a repair that was recorded by itself."""
        record = self.record
        at = record.body.get("at")
        day = date.fromisoformat(self.day) if self.day else None
        row = Inspection(
            record.record_id or record.digest[:LEAST_OF_A_HASH],
            record.tail_no,
            Side(record.side),
            ClearanceConvention.RADIAL,
            {},
            inspection_date=day,
            gear_landings=self.landings,
            restored_joints=tuple(sorted(self.joints)),
            rigging_checked=None if self.joints else RiggingCheck.CORRECTED,
            repair_date=datetime.fromisoformat(at) if at else day,
        )
        return GearVisit(row, place, "stated_by" not in record.body, record.digest)


Event = KeptInspection | Repair


@dataclass(frozen=True, slots=True)
class TodaysVerdict:
    """What a check says of a gear today.

    worst_joint: the joint to look at first. is_fine: whether nothing needs attention.
    """

    verdict: Verdict
    predicted_displacement_in: float | None
    margin_in: float
    worst_joint: int
    plan: Plan
    in_brief: str
    is_fine: bool


@dataclass(frozen=True)
class GearLife:
    """What stands of one gear: inspections and repairs in the order of time, and every record as it
    came.

    warnings: the records whose dates and landings disagree, and how to correct them; with any of
    them nothing is forecast.
    overhauls: events from which landings begin anew, by their place, with the joints that were
    restored there.
    judged: what is said of the gear at each inspection, by the hash of its record.
    state, now: what stands of the gear today, and what is said of that; None until it is judged, or
    if it cannot be.
    """

    key: GearKey
    records: tuple[Record, ...]
    places: Mapping[str, float]
    events: tuple[Event, ...]
    warnings: tuple[str, ...]
    overhauls: Mapping[int, frozenset[int]] = field(default_factory=dict)
    judged: Mapping[str, TodaysVerdict] = field(default_factory=dict)
    state: GearState | None = None
    now: TodaysVerdict | None = None

    @property
    def name(self) -> str:
        return " ".join(self.key)

    @property
    def notes(self) -> tuple[str, ...]:
        """What is to be known of its history: from where its landings begin anew."""
        return tuple(
            f"Landings begin anew on {self.events[place].moment.day}: taken as an overhaul that"
            f" restored {joint_list(sorted(joints))}. Landings before it are negative here."
            for place, joints in self.overhauls.items()
        )

    @cached_property
    def inspections(self) -> tuple[KeptInspection, ...]:
        return tuple(event for event in self.events if isinstance(event, KeptInspection))

    @cached_property
    def repairs(self) -> tuple[Repair, ...]:
        """Restorations of joints and re-riggings."""
        return tuple(event for event in self.events if isinstance(event, Repair))

    @cached_property
    def voided(self) -> list[Record]:
        """Inspections that no longer count, as they were entered."""
        one = first_keys(self.records)
        standing = {one[each.first.key] for each in self.inspections}
        return [
            r
            for r in self.records
            if r.kind is RecordKind.INSPECTION and one[r.key] not in standing
        ]

    @property
    def latest(self) -> KeptInspection | None:
        return self.inspections[-1] if self.inspections else None

    def _place(self, first: Record) -> float:
        """When something was entered first; what was moved here, at its former gear."""
        entered = first.body.get("entered")
        return self.places[first.digest] if entered is None else _clock(entered)

    @cached_property
    def visits(self) -> tuple[GearVisit, ...]:
        """The inspections, and the repairs that were recorded by themselves, in the order of
        time.
        """
        return tuple(
            event.visit(self._place(event.first))
            for event in self.events
            if isinstance(event, KeptInspection) or event.record.kind in _WORK
        )


def lives(
    store: Store, tail: str | None = None, side: str | None = None
) -> dict[GearKey, GearLife]:
    """Every gear's life, or those of one aircraft."""
    return _lives(store.all() if tail is None else store.of_gear(tail, side))


def lives_of(store: Store, keys: Collection[GearKey]) -> dict[GearKey, GearLife]:
    """The lives of some gears."""
    wanted = set(keys)
    records = store.of_aircraft({tail for tail, _side in wanted})
    return _lives(each for each in records if (each.tail_no, each.side) in wanted)


def _lives(records: Iterable[Record]) -> dict[GearKey, GearLife]:
    by_gear: dict[GearKey, list[Record]] = {}
    for record in records:
        by_gear.setdefault((record.tail_no, record.side), []).append(record)
    return {key: _life(key, own) for key, own in sorted(by_gear.items())}


def as_spelt(tails: Iterable[str], store: Store) -> dict[str, str]:
    """Each tail number as the store spells it: case, blanks, dashes and O for 0 make no other
    aircraft.
    """
    known = dict.fromkeys(tail for tail, _side in store.gears())
    first: dict[str, str] = {}
    for tail in known:
        first.setdefault(plain_tail(tail), tail)
    return {
        tail: tail if tail in known else first.setdefault(plain_tail(tail), tail)
        for tail in dict.fromkeys(tails)
    }


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
        for record in dict.fromkeys(event.record for event in life.events)
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


def is_readable(record: Record) -> bool:
    try:
        return bool(record.body)
    except StoreError:
        return False


def _life(key: GearKey, records: Sequence[Record]) -> GearLife:
    kept: dict[str, KeptInspection] = {}
    others: dict[str, Record] = {}
    places = _by_clock(_readable_or_not_void(records))
    records = [*places]
    one = first_keys(records)
    # The visit that each version of it is of.
    roots: dict[str, str] = {}
    for record in records:
        own = one[record.key]
        if record.kind is RecordKind.INSPECTION:
            roots[own] = own
            kept.setdefault(own, KeptInspection(record, record))
        elif record.kind is RecordKind.CORRECTION:
            wrong = one.get(record.body["supersedes"], "")
            root = roots[own] = roots.get(wrong, wrong)
            if root in kept:
                kept[root] = replace(kept[root], record=record)
        elif record.kind is RecordKind.VOID:
            gone = one.get(record.body["voids"], "")
            kept.pop(roots.get(gone, gone), None)
            others.pop(gone, None)
        elif record.kind is not RecordKind.ASSESSMENT:
            others.setdefault(own, record)
    stated = [repair for each in kept.values() for repair in Repair.stated(each)]
    # A repair that an inspection states is that of the same day which was recorded by itself; one
    # that came with an inspection falls with it.
    known = {(repair.day, repair.joints) for repair in stated}
    sound = {each.record.record_id for each in kept.values() if not each.inspection.is_repaired}
    alone = (Repair.of(r) for r in others.values() if r.kind in _WORK)
    repairs = [
        r
        for r in alone
        if (r.day, r.joints) not in known and r.record.body.get("stated_by") not in sound
    ]
    events: list[Event] = [*stated, *repairs, *kept.values()]
    events.sort(key=lambda event: places[event.first])
    moments = [event.moment for event in events]
    order = in_order(moments)
    return GearLife(
        key,
        tuple(records),
        {record.digest: at for record, at in places.items()},
        tuple(events[place] for place in order),
        _disagreements(key, events, moments),
        overhauls([moments[place] for place in order]),
    )


def first_keys(records: Iterable[Record]) -> dict[str, str]:
    """For each record, by its first hash, that of the record which says the same: what was recorded
    in two chains before they were merged is one.
    """
    first_of: dict[tuple[object, ...], str] = {}
    return {r.key: first_of.setdefault((r.kind, *r.content), r.key) for r in records}


def _by_clock(records: Iterable[Record]) -> dict[Record, float]:
    """Records in the order in which they were recorded, with their clocks; of one chain a record
    never comes before the one that it follows, whatever its clock says. [s]
    """
    found: dict[Record, float] = {}
    last = 0.0
    for record in records:
        at = _clock(record.recorded_at) or float(record.seq)
        if not record.origin:
            at = last = max(at, last + _TICK_S)
        found[record] = at
    return dict(sorted(found.items(), key=itemgetter(1)))


def _clock(stamp: str) -> float:
    return datetime.fromisoformat(stamp).timestamp() if stamp else 0.0


def _readable_or_not_void(records: Sequence[Record]) -> list[Record]:
    """Leave out what is void and cannot be read: that is how such a record is put aside."""
    void: set[str] = set()
    kept = []
    # A record is void by a later one.
    for record in reversed(records):
        if record.key not in void or is_readable(record):
            kept.append(record)
            if record.kind is RecordKind.VOID:
                void.add(record.body["voids"])
    return kept[::-1]


def _day_of(at: date) -> date:
    return at.date() if isinstance(at, datetime) else at


def _disagreements(
    key: GearKey, events: Sequence[Event], moments: Sequence[Moment]
) -> tuple[str, ...]:
    """Name the records whose dates and landings disagree, each with how to correct it."""

    def name(place: int) -> str:
        record = events[place].record
        what = f"{record.kind} " if record.kind in _WORK else ""
        return f"{what}{record.record_id}, ".lstrip(", ") + record.digest[:10]

    by_sentence: dict[str, list[int]] = {}
    for place, sentence in contradictions(moments, name).items():
        by_sentence.setdefault(sentence, []).append(place)
    warnings = []
    for sentence, places in by_sentence.items():
        record = events[places[0]].record.digest[:10] if len(places) == 1 else "RECORD"
        remedy = f"mlg history void {record} --why TEXT"
        if any(events[place].record.kind in _WORK for place in places):
            remedy += ", then mlg history repair"
        else:
            remedy = f"mlg history amend {record} COLUMN=VALUE, or {remedy}"
        gear = " ".join(key)
        warnings.append(
            f"{gear}: {sentence}. No forecast until this is corrected: {remedy}. After an overhaul"
            f" record its joints: mlg history repair {gear} --joint N --date D"
        )
    return tuple(warnings)
