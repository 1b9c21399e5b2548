"""Keep what a check judged: inspections with the repairs that they state, and corrections."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from itertools import chain, count
from typing import Any

from mlg_troubleshoot.decision.assessment import Assessment, Judgement
from mlg_troubleshoot.decision.columns import RECORD_ID, SIDE, TAIL_NO
from mlg_troubleshoot.decision.inspection import (
    Inspection,
    Side,
)
from mlg_troubleshoot.errors import UsageError
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.life.folding import as_spelt, is_readable, lives_of, warnings_of
from mlg_troubleshoot.life.state import GearKey, key_of
from mlg_troubleshoot.parallel import Progress
from mlg_troubleshoot.records import ReadOptions, judge_again, made_record_id
from mlg_troubleshoot.records.rows import is_made_for_row
from mlg_troubleshoot.store import (
    NOT_CONTENT,
    Record,
    RecordKind,
    Store,
    StoreError,
    content_of,
    inspection_from,
    inspection_record,
    packed,
    same_inspection,
)
from mlg_troubleshoot.workflows.check import CheckResult

_ENTERED = (RecordKind.INSPECTION, RecordKind.CORRECTION)
# Inspections that one sentence names at most.
_MOST_NAMED = 6


@dataclass(frozen=True, slots=True)
class Kept:
    """How many inspections were new, and how many stood there already; and which records of these
    gears now disagree in dates and landings.
    """

    new: int
    known: int
    warnings: tuple[str, ...]


def inspections_of(judgements: Iterable[Judgement]) -> list[Inspection]:
    """What is kept of judgements: nothing of a row that was not judged or says nothing."""
    return [
        j.inspection
        for j in judgements
        if isinstance(j, Assessment) and not j.inspection.says_nothing
    ]


class _KnownContents:
    """What a store and the rows before say of the gears of a call: an inspection is known by its
    gear, its day and what was found, and by its id where each of two states one. What was voided
    is known as well, and stays void.
    """

    def __init__(self, store: Store, tails: Collection[str]) -> None:
        self._contents: dict[bytes, list[Record]] = {}
        self._without_day: dict[bytes, list[Record]] = {}
        # What each id of a gear stands for on each day, and those that stand without a day.
        self._by_id: dict[tuple[str, ...], Record] = {}
        self._undated: dict[tuple[str, ...], Record] = {}
        # What a table without ids said of a gear on a day.
        self._unnamed: dict[tuple[str, ...], list[Record]] = {}
        self._stand: list[Record] = []
        self._void: dict[tuple[object, ...], list[Record]] = {}
        gears = [key for key in store.gears() if key[0] in tails]
        for life in lives_of(store, gears).values():
            for void in life.voided:
                self._void.setdefault(void.content[:4], []).append(void)
            standing = [each.kept for each in life.inspections]
            self._stand += standing
            for record in standing:
                self.add(record)
            # A table that comes back may have the day that was corrected.
            by_name = {record.record_id: record for record in standing}
            for record in life.records:
                name = record.record_id
                if record.kind is RecordKind.INSPECTION and name in by_name:
                    self._by_id.setdefault((name, *life.key, record.day), by_name[name])

    def add(self, record: Record) -> None:
        self._contents.setdefault(content_of(record), []).append(record)
        self._without_day.setdefault(content_of(record, with_day=False), []).append(record)
        whose = record.record_id, record.tail_no, record.side
        self._undated.pop(whose, None)
        if not record.day:
            self._undated[whose] = record
        self._by_id[*whose, record.day] = record
        if is_made_for_row(record.record_id):
            self._unnamed.setdefault((*whose[1:], record.day), []).append(record)

    def same(self, record: Record) -> Record | None:
        alike = self._contents.get(content_of(record), ())
        return next((each for each in alike if _may_be_one(each, record)), None)

    def otherwise(self, record: Record, stand: Collection[str]) -> Record | None:
        """The record that stands for the same inspection with other content: under its id on its
        day or without one, or the same findings under its id on another day or without one; where
        no table has ids, what is mostly the same on that day and in no row of this table (`stand`).
        """
        whose = record.record_id, record.tail_no, record.side
        same = self._by_id.get((*whose, record.day)) or self._undated.get(whose)
        alike = self._without_day.get(content_of(record, with_day=False), ())
        moved = (
            each
            for each in alike
            if each.record_id == record.record_id or (not each.day and _may_be_one(each, record))
        )
        found = same or next(moved, None)
        if found is None and is_made_for_row(record.record_id):
            unnamed = self._unnamed.get((*whose[1:], record.day), ())
            left = (each for each in unnamed if each.key and each.key not in stand)
            found = next((each for each in left if _is_mostly(each, record)), None)
        return found

    def new(self, record: Record) -> Record | None:
        """A record to add; None if it was voided, which it stays. Under the id of a void one it is
        another.
        """
        named = self._void.get(record.content[:4], [])
        if any(same_inspection(each, record) for each in named):
            return None
        return replace(record, identity=()) if named else record

    def told(self, records: Iterable[Record]) -> Iterator[Record]:
        """What is kept of some records."""
        for record in records:
            yield from self._contents.get(content_of(record), ())

    def vanished(self, files: Collection[str], stand: Collection[str]) -> list[str]:
        """Inspections that a file said when it was kept, and that its rows no longer say."""
        return [
            f"{record.record_id} ({record.tail_no} {record.side} {record.day or 'no date'})"
            for record in self._stand
            if record.key not in stand
            if (inspection_from(record).source.file or "") in files
        ]


def _is_mostly(one: Record, other: Record) -> bool:
    """Whether most of what two records say of one gear and day is the same."""
    said = [set(record.body["inspection"]["clearance_in"].items()) for record in (one, other)]
    return 2 * len(said[0] & said[1]) >= max(map(len, said)) > 0


def _may_be_one(one: Record, other: Record) -> bool:
    """Whether the ids of two records do not state that they are two inspections."""
    ids = one.record_id, other.record_id
    return ids[0] == ids[1] or any(map(is_made_for_row, ids))


def keep(
    result: CheckResult,
    store: Store,
    progress: Progress = lambda _done, _total: None,
    judged: Sequence[Inspection] | None = None,
    *,
    amend: bool | None = None,
) -> Kept:
    """Add the judged inspections of a check that found something, all or none.

    ``judged``: the inspections of a result that does not hold its judgements.
    ``amend``: take what the table says of inspections that are kept otherwise, or leave them; None
    refuses the table.
    """
    if judged is None:
        judged = inspections_of(result.judgements)
    tails = as_spelt((row.tail_no for row in judged), store)
    rows = [replace(row, tail_no=tails[row.tail_no]) for row in judged]
    known = _KnownContents(store, {row.tail_no for row in rows})
    made = [inspection_record(row) for row in rows]
    stand = {same.key for record in made if (same := known.same(record)) is not None}
    records: list[Record] = []
    changed: list[tuple[Record, Record]] = []
    new = 0
    for done, (row, record) in enumerate(zip(rows, made, strict=True), 1):
        progress(done, len(rows))
        if known.same(record) is not None:
            continue
        other = known.otherwise(record, stand)
        if other is None:
            fresh = known.new(record)
            if fresh is None:
                continue
            records.append(fresh)
        else:
            changed.append((other, record))
            stand.add(other.key)
            if amend:
                amended = replace(row, record_id=other.record_id)
                kind = RecordKind.CORRECTION
                records.append(inspection_record(amended, kind, supersedes=other.key))
        known.add(record)
        new += other is None or bool(amend)
    if changed and amend is None:
        raise _kept_otherwise(changed)
    store.add(records, lambda _kept, record: record.kind is not RecordKind.INSPECTION)
    files = {row.source.file for row in rows if row.source.file is not None}
    gone: list[str] = []
    if stand and files:
        # The table, or a part of it, was kept before.
        every = _KnownContents(store, {tail for tail, _side in store.gears()})
        gone = every.vanished(files, stand | {record.key for record in every.told(made)})
    gears = {key_of(row) for row in rows}
    said = [f"{one} is kept as {kept}: one aircraft" for one, kept in tails.items() if one != kept]
    warnings = (*said, *_vanished(gone), *warnings_of(store, gears))
    return Kept(new, len(rows) - new, warnings)


def _vanished(gone: Sequence[str]) -> list[str]:
    if not gone:
        return []
    listed = ", ".join(gone[:_MOST_NAMED]) + (" …" if len(gone) > _MOST_NAMED else "")
    return [
        f"kept from this table before, and no longer in it: {listed}. They go on counting; if they"
        " are wrong: mlg history void RECORD --why TEXT"
    ]


def _kept_otherwise(changed: Sequence[tuple[Record, Record]]) -> StoreError:
    """Refuse a table that says otherwise of what is kept already, and name the cells."""
    named = "; ".join(_difference(*both) for both in changed[:_MOST_NAMED])
    more = f"; and {len(changed) - _MOST_NAMED} more" if len(changed) > _MOST_NAMED else ""
    return StoreError(
        f"kept already with other content: {named}{more}; nothing of this was kept",
        "Settle the table as a whole: --amend takes what it says, --keep-old leaves what is kept."
        " An inspection of its own needs its own record_id or date.",
    )


def _difference(kept: Record, new: Record) -> str:
    """Name an inspection, and what of it was kept and what a table says."""
    was, says = (record.body["inspection"] for record in (kept, new))
    cells = []
    for name in [*dict.fromkeys((*was, *says))]:
        before, now = was.get(name), says.get(name)
        if name in NOT_CONTENT or before == now:
            continue
        if name == "clearance_in":
            joints = sorted({*(before or {}), *(now or {})}, key=int)
            pairs = [(f"#{n}", (before or {}).get(n), (now or {}).get(n)) for n in joints]
        else:
            pairs = [(name.replace("_", " "), before, now)]
        cells += [f"{what} was {a}, the table says {b}" for what, a, b in pairs if a != b]
    of = f"{kept.record_id} ({kept.tail_no} {kept.side} {kept.day or 'no date'})"
    return f"{of}: {', '.join(cells).replace('None', 'blank')}" if cells else of


def under_a_free_id(made: Inspection, store: Store) -> Inspection:
    """An inspection whose id was made from the second of its entry: with a number behind it where
    the gear has another inspection of that id.
    """
    records = store.of_gear(*key_of(made))
    kept = [r for r in records if r.kind is RecordKind.INSPECTION]
    by_id = {record.record_id: record for record in kept}
    free = made
    number = 1
    while (other := by_id.get(free.record_id)) and not same_inspection(
        other, inspection_record(free)
    ):
        number += 1
        free = replace(made, record_id=f"{made.record_id}-{number}")
    return free


def with_its_repairs(store: Store, record: Record) -> list[Record]:
    """A record, and the repairs that 0.2.0 kept beside the inspection that states them."""
    own = store.of_gear(record.tail_no, record.side)
    return [
        record,
        *(
            each
            for each in own
            if each.kind in (RecordKind.REPAIR, RecordKind.RERIG)
            and is_readable(each)
            and each.body.get("stated_by") == record.record_id
        ),
    ]


def voids(record: Record, why: str, **more: Any) -> Record:
    """What makes a record not count; it stays in the chain."""
    body = {"voids": record.key, "why": why, **more}
    return replace(record, kind=RecordKind.VOID, packed=packed(body), identity=())


def move(store: Store, wrong: Record, gear: GearKey, why: str) -> Record:
    """Move an inspection to the gear that it is of: it counts there, and no longer where it was."""
    if wrong.kind not in _ENTERED:
        raise UsageError(f"record {wrong.record_id!r} is a {wrong.kind}", "Give an inspection.")
    if gear == (wrong.tail_no, wrong.side):
        raise UsageError(
            f"{wrong.record_id} is of {' '.join(gear)} already", "Give another tail or side."
        )
    own = lives_of(store, [(wrong.tail_no, wrong.side)])[wrong.tail_no, wrong.side]
    entered = next(each.place for each in own.inspections if each.kept.digest == wrong.digest)
    row = replace(inspection_from(wrong), tail_no=gear[0], side=Side(gear[1]))
    there = lives_of(store, [gear]).get(gear)
    if there and any(v.inspection.record_id == row.record_id for v in there.inspections):
        row = under_a_free_id(row, store)
    moved = inspection_record(row, moved_from=wrong.key, entered=entered)
    # Moved back it differs from the record that was moved away from there.
    moved = replace(moved, identity=())
    gone = [voids(each, why, moved_to=gear) for each in with_its_repairs(store, wrong)]
    store.add([*gone, moved])
    return store.known([moved.identity_hash])[moved.identity_hash]


def add_typed(store: Store, typed: Sequence[Inspection], since: datetime) -> list[str]:
    """Add visits of one gear that were typed one after the other, all or none, under ids made of
    its day; without what was kept `since` a moment by a program that ended before it said so. The
    records of the gear that disagree now are returned.
    """
    tails = as_spelt([typed[0].tail_no], store)
    rows = [replace(row, tail_no=tails[row.tail_no]) for row in typed]
    own = [r for r in store.of_gear(*key_of(rows[0])) if r.kind is RecordKind.INSPECTION]
    at = since.astimezone()
    kept = {content_of(r) for r in own if r.recorded_at and at <= _moment(r.recorded_at)}
    used = {record.record_id for record in own}
    new = []
    for row in rows:
        made = made_record_id(row)
        names = chain([made], (f"{made}-{number}" for number in count(2)))
        record = inspection_record(replace(row, record_id=next(n for n in names if n not in used)))
        if content_of(record) not in kept:
            new.append(record)
            used.add(record.record_id)
    store.add(new)
    return warnings_of(store, [key_of(rows[0])])


def _moment(recorded_at: str) -> datetime:
    return datetime.fromisoformat(recorded_at).astimezone()


def amend(store: Store, gear: Gear, wrong: Record, changes: Mapping[str, str]) -> Record:
    """Append an inspection with other texts in some columns; the one before stays readable."""
    if wrong.kind not in _ENTERED:
        raise UsageError(f"record {wrong.record_id!r} is a {wrong.kind}", "Give an inspection.")
    if gear_columns := changes.keys() & {RECORD_ID.name, TAIL_NO.name, SIDE.name}:
        raise UsageError(
            f"{gear_columns.pop()} is not a value of an inspection",
            "mlg history move RECORD TAIL SIDE moves it to another gear.",
        )
    right = judge_again(inspection_from(wrong), ReadOptions.of(gear), changes)
    record = inspection_record(right, RecordKind.CORRECTION, supersedes=wrong.key)
    if content_of(record) == content_of(wrong):
        raise UsageError(f"{wrong.record_id} says that already", "Give another value.")
    store.add([record])
    return record
