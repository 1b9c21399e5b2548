"""The life of each gear, folded from its records: what was corrected or voided does not count.

What the model of today says of kept gears: worked out when it is asked for, never kept.

Margin, limits, repairs, version and correction of an inspection are thus always those that stand.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import date, datetime
from functools import cached_property
from operator import itemgetter

from mlg_troubleshoot.decision.assessment import Action, Assessment, Basis, Verdict
from mlg_troubleshoot.decision.inspection import (
    Fleet,
    Inspection,
    RiggingCheck,
    Side,
    plain_tail,
)
from mlg_troubleshoot.decision.judge_rows import Listed, assess, verdicts
from mlg_troubleshoot.decision.sentences import joint_list
from mlg_troubleshoot.errors import UsageError
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.indices.index_table import IndexTable
from mlg_troubleshoot.life.state import (
    GearKey,
    GearState,
    GearVisit,
    Moment,
    contradictions,
    in_order,
    overhauls,
    state_now,
    states,
)
from mlg_troubleshoot.store import (
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
ENTERED = (RecordKind.INSPECTION, RecordKind.CORRECTION)
# Gears that are read at once. [1]
_AT_ONCE = 25
# What a clock counts in. [s]
_TICK_S = 1e-6


@dataclass(frozen=True, slots=True)
class TodaysVerdict:
    """What a check says of a gear today; the defaults of one that cannot be judged, or of a verdict
    without a plan.

    worst_joint: the joint to look at first. next_action: in brief. minutes, restore: of the plan.
    is_fine: whether nothing needs attention.
    """

    verdict: Verdict | None = None
    basis: Basis | None = None
    predicted_displacement_in: float | None = None
    margin_in: float | None = None
    worst_joint: int | None = None
    next_action: str | None = None
    minutes: float = 0.0
    restore: tuple[int, ...] = ()
    is_fine: bool = True

    @property
    def title(self) -> str:
        return self.verdict.title(self.basis) if self.verdict else ""


@dataclass(frozen=True, slots=True)
class LogEntry:
    """A record in the log of a gear, and whether it counts; what was recorded in two chains before
    they were merged is one entry.

    newest: the last version of its visit. row: the inspection, of the last version of it.
    correction: the version that it corrects, and what it says.
    """

    record: Record
    counts: bool
    newest: Record
    row: Inspection | None = None
    correction: tuple[Inspection, Inspection] | None = None


@dataclass(frozen=True)
class GearLife:
    """What stands of one gear: inspections and repairs in the order of time, and every entry of its
    log as it came.

    warnings: the records whose dates and landings disagree, and how to correct them; with any of
    them nothing is forecast.
    overhauls: events from which landings begin anew, by their place, with the joints that were
    restored there.
    judged: what is said of the gear at each inspection, by the hash of its record.
    state, now: what stands of the gear today, and what is said of that once it is judged.
    """

    key: GearKey
    entries: tuple[LogEntry, ...]
    events: tuple[Moment, ...]
    warnings: tuple[str, ...]
    overhauls: Mapping[int, frozenset[int]] = field(default_factory=dict)
    judged: Mapping[str, TodaysVerdict] = field(default_factory=dict)
    state: GearState | None = None
    now: TodaysVerdict = TodaysVerdict()

    @property
    def name(self) -> str:
        return " ".join(self.key)

    @property
    def tail_no(self) -> str:
        return self.key[0]

    @property
    def side(self) -> str:
        return self.key[1]

    @property
    def notes(self) -> tuple[str, ...]:
        """What is to be known of its history: from where its landings begin anew."""
        return tuple(
            f"Landings begin anew on {self.events[place].day}: taken as an overhaul that"
            f" restored {joint_list(sorted(joints))}. Landings before it are negative here."
            for place, joints in self.overhauls.items()
        )

    @cached_property
    def inspections(self) -> tuple[GearVisit, ...]:
        return tuple(at.visit for at in self.events if at.visit and at.joints is None)

    @property
    def repairs(self) -> tuple[Moment, ...]:
        """Restorations of joints and re-riggings."""
        return tuple(at for at in self.events if at.joints is not None)

    @property
    def latest(self) -> GearVisit | None:
        return self.inspections[-1] if self.inspections else None

    @cached_property
    def visits(self) -> tuple[GearVisit, ...]:
        """The inspections, and the repairs that were recorded by themselves, in the order of
        time.
        """
        return tuple(
            at.visit for at in self.events if at.visit and (at.joints is None or at.is_alone)
        )


def lives(store: Store) -> dict[GearKey, GearLife]:
    """Every gear's life."""
    return _lives(store.all())


def lives_of(store: Store, keys: Collection[GearKey]) -> dict[GearKey, GearLife]:
    """The lives of some gears."""
    return _lives(store.of_gears(keys))


def in_turn(store: Store, keys: Sequence[GearKey]) -> Iterator[GearLife | None]:
    """The life of each of many gears, None of one without records: few stand in memory."""
    for first in range(0, len(keys), _AT_ONCE):
        part = keys[first : first + _AT_ONCE]
        found = lives_of(store, part)
        yield from map(found.get, part)


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
    life = lives_of(store, [(tail, side)]).get((tail, side))
    if life is None:
        near = [f"{t} {s}" for t, s in store.gears() if plain_tail(t) == plain_tail(tail)]
        raise UsageError(
            f"no records of {tail} {side} in {store.place}",
            f"The store has {', '.join(near)}."
            if near
            else "See which gears are kept: mlg history",
        )
    return life


def warnings_of(store: Store, keys: Collection[GearKey]) -> list[str]:
    """The records of some gears whose dates and landings disagree."""
    found = lives_of(store, keys).values()
    return [warning for life in found for warning in life.warnings]


def find(store: Store, record_id: str) -> Record:
    """Find the record that a command names: by its id, or by the first letters of its hash where an
    id is not one.
    """
    keys = {(record.tail_no, record.side) for record in store.named(record_id)}
    gears = lives_of(store, keys).values()
    live = [visit.kept for life in gears for visit in life.visits]
    found = [r for r in live if r.record_id == record_id and r.kind not in _WORK]
    if not found and len(record_id) >= LEAST_OF_A_HASH:
        newest = {
            entry.newest
            for life in gears
            for entry in life.entries
            if entry.record.digest.startswith(record_id.lower())
        }
        found = [record for record in live if record in newest]
    if len(found) == 1:
        return found[0]
    if not found:
        raise UsageError(
            f"no record that counts is called {record_id!r} in {store.place}",
            "See the records, and which are void: mlg history TAIL SIDE",
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
    places = _by_clock(_readable_or_not_void(records))
    one = _first_keys(places)
    bodies = {record.key: record.body for record in places if record.kind in ENTERED}
    rows = {r.key: inspection_from(r, bodies[r.key]) for r in places if r.key in bodies}
    # The visit that each version of it is of, and the last version of each.
    roots: dict[str, Record] = {}
    last: dict[Record, Record] = {}
    before: dict[str, Record] = {}
    others: dict[str, Record] = {}
    void: set[Record] = set()
    for record in places:
        own = one[record.key]
        if record.kind is RecordKind.INSPECTION:
            last.setdefault(roots.setdefault(own, record), record)
        elif record.kind is RecordKind.CORRECTION:
            root = roots.get(one.get(bodies[record.key]["supersedes"], ""))
            if root is not None and own not in roots:
                roots[own] = root
                before[own] = last[root]
                last[root] = record
        elif record.kind is RecordKind.VOID:
            gone = one.get(record.body["voids"], "")
            void |= {roots[gone]} if gone in roots else set()
            others.pop(gone, None)
        elif record.kind is not RecordKind.ASSESSMENT:
            others.setdefault(own, record)
    newest = {record.key for record in last.values()}
    entries = tuple(
        LogEntry(
            record,
            roots[own] not in void
            if own in roots
            else own in others or record.kind is RecordKind.VOID,
            last[roots[own]] if own in roots else record,
            rows[own] if own in newest else None,
            (rows[before[own].key], rows[own]) if own in before else None,
        )
        for record in places
        if one[own := record.key] == own
    )
    visits = []
    for root, record in last.items():
        if root not in void:
            row = rows[record.key]
            entered = bodies[root.key].get("entered")
            place = places[root] if entered is None else float(entered)
            visits.append(GearVisit(row, place, row.source.file is None, record))
    moments = [at for visit in visits for at in _moments(visit)]
    # A repair that an inspection states is that of the same day which was recorded by itself; one
    # that came with an inspection falls with it.
    known = {(at.day, at.joints) for at in moments}
    repaired = {None, *(v.kept.record_id for v in visits if v.inspection.is_repaired)}
    for record in others.values():
        if record.kind in _WORK and record.body.get("stated_by") in repaired:
            typed = "stated_by" not in record.body
            work = _moments(GearVisit(_work_of(record), places[record], typed, record))
            moments += [at for at in work if (at.day, at.joints) not in known]
    moments.sort(key=lambda at: at.visit.place if at.visit else 0.0)
    events = tuple(moments[place] for place in in_order(moments))
    return GearLife(key, entries, events, _disagreements(key, moments), overhauls(events))


def _moments(visit: GearVisit) -> list[Moment]:
    """The repairs that a visit states, and the visit, unless it is a repair by itself."""
    row = visit.inspection
    is_alone = visit.kept.kind in _WORK
    done = [frozenset(row.restored_joints)] * bool(row.restored_joints)
    is_other = row.rigging_checked is RiggingCheck.CORRECTED or bool(row.other_repair)
    done += [frozenset()] * is_other
    day = "" if row.repair_date is None else row.repair_date.isoformat()[:10]
    if is_alone:
        return [Moment(day, row.gear_landings, joints, visit, is_alone) for joints in done]
    stated = [Moment(day, None, joints, visit) for joints in done if day]
    return [*stated, Moment.of(visit)]


def _work_of(record: Record) -> Inspection:
    """A repair that was recorded by itself."""
    body = record.body
    joints = tuple(sorted(body.get("joints", ())))
    day = date.fromisoformat(record.day) if record.day else None
    return Inspection(
        record.record_id or record.digest[:LEAST_OF_A_HASH],
        record.tail_no,
        Side(record.side),
        ClearanceConvention.RADIAL,
        {},
        inspection_date=day,
        gear_landings=body.get("landings"),
        restored_joints=joints,
        rigging_checked=None if joints else RiggingCheck.CORRECTED,
        repair_date=datetime.fromisoformat(body["at"]) if "at" in body else day,
    )


def _first_keys(records: Iterable[Record]) -> dict[str, str]:
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


def _disagreements(key: GearKey, moments: Sequence[Moment]) -> tuple[str, ...]:
    """Name the records whose dates and landings disagree, each with how to correct it."""
    visits = [at.visit for at in moments if at.visit]

    def name(place: int) -> str:
        record = visits[place].kept
        what = f"{record.kind} " if moments[place].is_alone else ""
        return f"{what}{record.record_id}, ".lstrip(", ") + record.digest[:10]

    gear = " ".join(key)
    return tuple(
        f"{gear}: {sentence}. No forecast until this is corrected: mlg history amend RECORD"
        " COLUMN=VALUE, or mlg history void RECORD --why TEXT. After an overhaul record its"
        f" joints: mlg history repair {gear} --joint N --date D"
        for sentence in dict.fromkeys(contradictions(moments, name).values())
    )


def judge_lives(
    lives: Iterable[GearLife],
    gear: Gear,
    table: IndexTable,
    *,
    fleet: Fleet | None = None,
    every: bool = False,
) -> list[GearLife]:
    """Judge what stands of each gear today by what its `fleet` teaches and, with `every`, say the
    verdict of what stood at each visit.
    """
    asked = list(lives)
    numbers = set(gear.joint_numbers)
    visits = [
        [v for v in life.visits if v.inspection.clearance_in.keys() <= numbers] for life in asked
    ]
    now = [state_now(own, gear) for own in visits]
    before = [states(own, gear) if every else [] for own in visits]
    rows = [state.inspection for own in before for state in own]
    was = verdicts(rows, gear, table, fleet=fleet)
    standing = [state for state in now if state is not None]
    says = _judged(standing, gear, table, fleet)
    return [
        replace(
            life,
            judged={state.visit.kept.digest: TodaysVerdict(*next(was)) for state in own},
            state=state,
            now=TodaysVerdict() if state is None else next(says),
        )
        for life, own, state in zip(asked, before, now, strict=True)
    ]


def _judged(
    states: Sequence[GearState], gear: Gear, table: IndexTable, fleet: Fleet | None
) -> Iterator[TodaysVerdict]:
    rows = [state.inspection for state in states]
    each = assess(rows, gear, table, sets=False, fleet=fleet)
    for state, found in zip(states, each, strict=True):
        if isinstance(found, Assessment):
            yield TodaysVerdict(
                found.verdict,
                found.basis,
                found.predicted_displacement_in,
                found.margin_in,
                found.ranked[0].joint,
                found.in_brief,
                sum(step.minutes for step in found.plan.steps),
                tuple(n for s in found.plan.steps if s.action is Action.RESTORE for n in s.joints),
                Listed.of(replace(found, older=state.older)).is_fine,
            )
