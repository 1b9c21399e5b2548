"""Keep what a check judged: inspections with the repairs that they state, and corrections.

The content of kept records, judged as cells are whenever it is read: a store or an export may
come from anybody.
"""

from __future__ import annotations

import math
from collections import Counter, defaultdict
from collections.abc import Callable, Collection, Hashable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from datetime import datetime
from functools import lru_cache
from hashlib import sha256
from itertools import chain, count
from typing import Annotated, Any, Literal

import msgspec
from msgspec import Meta

from mlg_troubleshoot.datafile import Table, refusal
from mlg_troubleshoot.decision.assessment import Assessment, Judgement
from mlg_troubleshoot.decision.columns import (
    BY_NAME,
    CLEARANCE,
    COLUMNS,
    CONVENTION,
    DATE,
    GAUGE_U,
    IDENTITY,
    LANDINGS,
    MARGIN,
    MARGIN_U,
    PLUNGER_DISPLACEMENT,
    RECORD_ID,
    SIDE,
    TAIL_NO,
    WORK_ORDER,
    Column,
    Holds,
)
from mlg_troubleshoot.decision.inspection import Inspection, Side
from mlg_troubleshoot.errors import UsageError
from mlg_troubleshoot.gear.gear import ROUNDING_IN, Gear
from mlg_troubleshoot.life.folding import (
    ENTERED,
    GearLife,
    as_spelt,
    in_turn,
    lives_of,
    warnings_of,
)
from mlg_troubleshoot.life.state import GearKey, key_of
from mlg_troubleshoot.parallel import Progress
from mlg_troubleshoot.records import ReadOptions, judge_again, made_record_id
from mlg_troubleshoot.records.rows import is_made_for_row
from mlg_troubleshoot.records.values import CellFaultError, read_date, read_moment, read_text
from mlg_troubleshoot.store import (
    NOT_CONTENT,
    RETIRED,
    Record,
    RecordKind,
    Store,
    StoreError,
    canonical,
    cells_of,
    inspection_from,
    inspection_record,
    packed,
    record_of,
    said_of,
)
from mlg_troubleshoot.units import LengthUnit

_STANDS = (MARGIN, MARGIN_U, BY_NAME["cannot_reach"], BY_NAME["no_spare"])
_PLUNGERS = tuple(map(PLUNGER_DISPLACEMENT.header, range(1, PLUNGER_DISPLACEMENT.copies + 1)))
_COPIES = {PLUNGER_DISPLACEMENT.name: _PLUNGERS}
# Inspections that one sentence names at most.
_MOST_NAMED = 6


@dataclass(frozen=True, slots=True)
class Kept:
    """How many inspections were new, and how many stood there already; and what is to be known of
    the table.
    """

    new: int
    known: int
    warnings: tuple[str, ...]


def _as_shown(value: Any) -> Any:
    """A value with numbers of 12 digits: a spreadsheet program keeps 15 of the 17 of a double."""
    if isinstance(value, float):
        return float(f"{value:.12g}")
    return {k: _as_shown(v) for k, v in value.items()} if isinstance(value, Mapping) else value


@dataclass(frozen=True, slots=True)
class Told:
    """An inspection as a record, with the hashes of what was found, with its day and without it;
    and the file that says so.
    """

    record: Record
    content: bytes
    without_day: bytes
    file: str | None

    @classmethod
    def by(cls, inspection: Inspection) -> Told:
        said = said_of(inspection)
        return cls.of(record_of(said), said)

    @classmethod
    def of(cls, record: Record, said: Mapping[str, Any] | None = None) -> Told:
        said = said or record.body["inspection"]
        left_out = (*NOT_CONTENT, DATE.filled)
        found = {n: _as_shown(v) for n, v in said.items() if n not in left_out}
        text = canonical(found).encode()
        contents = sha256(text + record.day.encode()).digest(), sha256(text).digest()
        return cls(record, *contents, said.get("source", (None,))[0])

    @property
    def key(self) -> GearKey:
        return self.record.tail_no, self.record.side

    @property
    def known_by(self) -> Iterator[Hashable]:
        """What another record of the same inspection has as well."""
        name, day = self.record.record_id, self.record.day
        yield self.content
        yield self.content, "" if is_made_for_row(name) else name
        yield "found", self.without_day, name
        yield "id", name
        yield "id", name, day

    @property
    def cells(self) -> list[Hashable]:
        """What a table without ids says of the joints of a gear on a day."""
        read = self.record.body["inspection"].get("clearance_in", {})
        return [(self.record.day, *cell) for cell in read.items()]


def told_by(judgements: Iterable[Judgement]) -> list[Told]:
    """What is kept of judgements: nothing of a row that was not judged or says nothing."""
    rows = (j.inspection for j in judgements if isinstance(j, Assessment))
    return [Told.by(row) for row in rows if not row.says_nothing]


class _KnownContents:
    """What a store and the rows before say of one gear: an inspection is known by its day and what
    was found, and by its id where each of two states one. What was voided is known as well, and
    stays void.
    """

    def __init__(self, life: GearLife | None) -> None:
        self._by: defaultdict[Hashable, list[Told]] = defaultdict(list)
        self._by_cell: defaultdict[Hashable, list[tuple[Told, int]]] = defaultdict(list)
        self._void: dict[tuple[object, ...], set[bytes]] = {}
        standing = {}
        for visit in life.inspections if life else ():
            told = standing[visit.kept.record_id] = Told.of(visit.kept)
            self.add(told)
            cells = told.cells if is_made_for_row(visit.kept.record_id) else []
            for cell in cells:
                self._by_cell[cell].append((told, len(cells)))
        for entry in life.entries if life else ():
            record, name = entry.record, entry.record.record_id
            if record.kind is not RecordKind.INSPECTION:
                continue
            if not entry.counts:
                self._void.setdefault(record.content[:4], set()).add(Told.of(record).content)
            # A table that comes back may have the day that was corrected.
            if name in standing:
                of_day = self._by["id", name, record.day]
                of_day[:] = of_day or [standing[name]]

    def add(self, told: Told) -> None:
        for key in told.known_by:
            self._by[key].append(told)

    def same(self, told: Told, content: bytes | None = None) -> Told | None:
        """What stands with the same content, unless the ids state that it is another inspection."""
        what = content or told.content
        name = told.record.record_id
        keys = (what,) if is_made_for_row(name) else ((what, name), (what, ""))
        return next((o for key in keys for o in self._by.get(key, ())), None)

    def otherwise(self, told: Told, stand: Collection[str]) -> Told | None:
        """What stands for the same inspection with other content: under its id on its day or
        without one, or the same findings under its id on another day or without one; where no
        table has ids, what is mostly the same on that day and in no row of this table (`stand`).
        """
        name, day = told.record.record_id, told.record.day
        of_day, of_id, moved = (
            self._by.get(key, [])
            for key in (("id", name, day), ("id", name), ("found", told.without_day, name))
        )
        undated = [o for o in of_id[-1:] if not o.record.day]
        # The hash of what states no day is that without one.
        without_day = self.same(told, told.without_day)
        known = next(chain(of_day[-1:], undated, moved), without_day)
        return known or (self._mostly(told, stand) if is_made_for_row(name) else None)

    def _mostly(self, told: Told, stand: Collection[str]) -> Told | None:
        """What has half or more of the same readings on that day."""
        cells = told.cells
        alike: Counter[str] = Counter()
        for cell in cells:
            for other, most in self._by_cell.get(cell, ()):
                key = other.record.key
                alike[key] += 1
                if 2 * alike[key] >= max(most, len(cells)) and key not in stand:
                    return other
        return None

    def new(self, told: Told) -> Record | None:
        """A record to add; None if it was voided, which it stays. Under the id of a void one it is
        another.
        """
        void = self._void.get(told.record.content[:4], ())
        if told.content in void:
            return None
        return replace(told.record, identity=()) if void else told.record


def keep(
    told: Iterable[Told],
    store: Store,
    progress: Progress = lambda _done, _total: None,
    *,
    amend: bool | None = None,
) -> Kept:
    """Add inspections, all or none.

    ``amend``: take what the table says of inspections that are kept otherwise, or leave them; None
    refuses the table.
    """
    given = [*told]
    tails = as_spelt((each.record.tail_no for each in given), store)
    made = [_under(each, tails[each.record.tail_no]) for each in given]
    places: dict[GearKey, list[int]] = {}
    for place, each in enumerate(made):
        places.setdefault(each.key, []).append(place)
    stand: set[str] = set()
    records: dict[int, Record] = {}
    changed: list[tuple[Told, Told]] = []
    new = 0
    for own, life in zip(places.values(), in_turn(store, [*places]), strict=True):
        known = _KnownContents(life)
        stand |= {same.record.key for n in own if (same := known.same(made[n])) is not None}
        for place in own:
            each = made[place]
            if known.same(each) is not None:
                continue
            other = known.otherwise(each, stand)
            if other is None:
                fresh = known.new(each)
                if fresh is None:
                    continue
                records[place] = fresh
            else:
                changed.append((other, each))
                stand.add(other.record.key)
                if amend and other.record.key:
                    row = replace(inspection_from(each.record), record_id=other.record.record_id)
                    kind = RecordKind.CORRECTION
                    records[place] = inspection_record(row, kind, supersedes=other.record.key)
            known.add(each)
            new += other is None or bool(amend)
        progress(own[-1] + 1, len(made))
    # Two rows of one call that contradict each other do not correct what is kept.
    if any(amend is None or (amend and not old.record.key) for old, _new in changed):
        raise _kept_otherwise(changed)
    store.add(records[place] for place in sorted(records))
    gone = _vanished(store, made, stand) if stand else []
    said = [f"{one} is kept as {kept}: one aircraft" for one, kept in tails.items() if one != kept]
    return Kept(new, len(made) - new, (*said, *gone))


def _under(told: Told, tail: str) -> Told:
    """An inspection under the tail number as the store spells it."""
    if told.record.tail_no == tail:
        return told
    return Told.by(replace(inspection_from(told.record), tail_no=tail))


def _vanished(store: Store, made: Sequence[Told], stand: Collection[str]) -> list[str]:
    """Name the inspections that a file said when it was kept, and that its rows no longer say."""
    files = {each.file for each in made} - {None}
    contents = {each.content for each in made}
    every = in_turn(store, store.gears()) if files else ()
    kept = (Told.of(visit.kept) for life in every if life for visit in life.inspections)
    gone = [
        each.record.visit
        for each in kept
        if each.file in files and each.record.key not in stand and each.content not in contents
    ]
    if not gone:
        return []
    listed = ", ".join(gone[:_MOST_NAMED]) + (" …" if len(gone) > _MOST_NAMED else "")
    return [
        f"kept from this table before, and no longer in it: {listed}. They go on counting; if they"
        " are wrong: mlg history void RECORD --why TEXT"
    ]


def _kept_otherwise(changed: Sequence[tuple[Told, Told]]) -> StoreError:
    """Refuse a table that says otherwise of what is kept already, and name the cells."""
    named = "; ".join(_difference(*both) for both in changed[:_MOST_NAMED])
    more = f"; and {len(changed) - _MOST_NAMED} more" if len(changed) > _MOST_NAMED else ""
    return StoreError(
        f"kept already with other content: {named}{more}; nothing of this was kept",
        "Settle the table as a whole: --amend takes what it says, --keep-old leaves what is kept."
        " An inspection of its own needs its own record_id or date.",
    )


def _difference(kept: Told, new: Told) -> str:
    """Name an inspection, and what of it was kept and what a table says."""
    was, says = (cells_of(told.record.body["inspection"]) for told in (kept, new))
    cells = [
        f"{what} was {was.get(what, 'blank')}, the table says {says.get(what, 'blank')}"
        for what in dict.fromkeys((*was, *says))
        if was.get(what) != says.get(what)
    ]
    return ": ".join(filter(None, (kept.record.visit, ", ".join(cells))))


def _free_id(made: str, used: Collection[str]) -> str:
    """An id that was made of a gear and a day: with a number behind it where it is used."""
    numbered = (f"{made}-{number}" for number in count(2))
    return next(name for name in chain([made], numbered) if name not in used)


def _kept_of(store: Store, key: GearKey) -> list[Told]:
    """Every inspection of a gear as it was kept first, whatever became of it."""
    kept = store.of_gears([key])
    return [Told.of(record) for record in kept if record.kind is RecordKind.INSPECTION]


def under_a_free_id(made: Inspection, store: Store) -> Inspection:
    """An inspection under an id that no other one of its gear has."""
    content = Told.by(made).content
    others = [told for told in _kept_of(store, key_of(made)) if told.content != content]
    return replace(made, record_id=_free_id(made.record_id, {t.record.record_id for t in others}))


def voids(record: Record, why: str, **more: Any) -> Record:
    """What makes a record not count; it stays in the chain."""
    body = {"voids": record.key, "why": why, **more}
    return replace(record, kind=RecordKind.VOID, packed=packed(body), identity=())


def move(store: Store, wrong: Record, gear: GearKey, why: str) -> Record:
    """Move an inspection to the gear that it is of: it counts there, and no longer where it was."""
    row = _entered(wrong)
    if gear == (wrong.tail_no, wrong.side):
        raise UsageError(
            f"{wrong.record_id} is of {' '.join(gear)} already", "Give another tail or side."
        )
    found = lives_of(store, [(wrong.tail_no, wrong.side), gear])
    own = found[wrong.tail_no, wrong.side].inspections
    entered = next(each.place for each in own if each.kept.digest == wrong.digest)
    # What stood there under its name and no longer counts may be this one, before it was moved.
    used = {each.kept.record_id for each in found[gear].inspections} if gear in found else ()
    name = _free_id(row.record_id, used)
    row = replace(row, record_id=name, tail_no=gear[0], side=Side(gear[1]))
    moved = inspection_record(row, moved_from=wrong.key, entered=entered)
    # Moved back it differs from the record that was moved away from there.
    moved = replace(moved, identity=())
    store.add([voids(wrong, why, moved_to=gear), moved])
    return next(each for each in store.of_gears([gear])[::-1] if each.packed == moved.packed)


def _entered(record: Record) -> Inspection:
    """The inspection of a record; another kind of record is refused."""
    if record.kind not in ENTERED:
        raise UsageError(f"record {record.record_id!r} is a {record.kind}", "Give an inspection.")
    return inspection_from(record)


def add_typed(
    store: Store, typed: Sequence[Inspection], since: datetime
) -> tuple[list[Record], list[str]]:
    """Add visits of one gear that were typed one after the other, all or none, under ids made of
    its day; without what was kept `since` a moment by a program that ended before it said so. The
    records that were added are returned, and which of the gear disagree now.
    """
    tail = as_spelt([typed[0].tail_no], store)[typed[0].tail_no]
    key = tail, typed[0].side.value
    own = _kept_of(store, key)
    used = {told.record.record_id for told in own}
    at = since.astimezone()
    kept = {
        told.content
        for told in own
        if (stamp := told.record.recorded_at) and at <= datetime.fromisoformat(stamp).astimezone()
    }
    new = []
    for row in (replace(row, tail_no=tail) for row in typed):
        name = _free_id(made_record_id(row), used)
        told = Told.by(replace(row, record_id=name))
        if told.content not in kept:
            new.append(told.record)
            used.add(name)
    store.add(new)
    return new, warnings_of(store, [key])


def amend(store: Store, gear: Gear, wrong: Record, changes: Mapping[str, str]) -> Record:
    """Append an inspection with other texts in some columns; the one before stays readable."""
    row = _entered(wrong)
    if gear_columns := changes.keys() & {RECORD_ID.name, TAIL_NO.name, SIDE.name}:
        raise UsageError(
            f"{gear_columns.pop()} is not a value of an inspection",
            "mlg history move RECORD TAIL SIDE moves it to another gear.",
        )
    right = judge_again(row, ReadOptions.of(gear), changes)
    record = inspection_record(right, RecordKind.CORRECTION, supersedes=wrong.key)
    if Told.of(record).content == Told.of(wrong).content:
        raise UsageError(f"{wrong.record_id} says that already", "Give another value.")
    store.add([record])
    return record


def correct(
    store: Store, gear: Gear, records: Sequence[Record], changes: Mapping[str, str]
) -> list[UsageError]:
    """Correct columns in the visit that was recorded last, those without a text in the last one
    that states them; why others were not is returned.
    """
    of: defaultdict[Record, dict[str, str]] = defaultdict(dict)
    for name, text in changes.items():
        states = [each for each in records if text or name in _stated(each)]
        of[(states or records)[-1]].update(dict.fromkeys(_COPIES.get(name, (name,)), text))
    refused = []
    for record, texts in of.items():
        try:
            amend(store, gear, record, texts)
        except UsageError as error:
            refused.append(error)
    return refused


def _stated(record: Record) -> set[str]:
    """The columns in which a visit says something."""
    row = inspection_from(record)
    joints = map(CLEARANCE.header, row.clearance_in)
    return {*joints, *(c.name for c in COLUMNS if not c.needs_joint and row.value(c.filled))}


def put_back(store: Store, before: Iterable[Record], now: Iterable[Record]) -> None:
    """Let visits say again what they said before they were corrected."""
    newest = {each.record_id: each.key for each in now}
    store.add(
        inspection_record(inspection_from(old), RecordKind.CORRECTION, supersedes=wrong)
        for old in before
        if (wrong := newest[old.record_id]) != old.key
    )


def continued(
    known: Inspection, row: Inspection, typed: Collection[str], again: Collection[int]
) -> Inspection:
    """A visit with what stands of the gear and was not typed anew: its margin, what the day does
    not allow, the uncertainty of the same gauge; and which of the joints that were to be measured
    `again` were.
    """
    stands = [column.filled for column in _STANDS if column.name not in typed]
    if row.inspection_date == known.inspection_date and LANDINGS.name not in typed:
        stands.append(LANDINGS.filled)
    if row.gauge_u_is_default and row.gauge_id == known.gauge_id:
        stands += [GAUGE_U.filled, "gauge_u_is_default"]
    more = {name: getattr(known, name) for name in stands}
    # What the reader of a row alone misses in it stands in other visits.
    measured_again = tuple(sorted(row.clearance_in.keys() & again))
    return replace(row, measured_again=measured_again, warnings=(), **more)


# Made at run time from the joints of a gear: no checker of types reads them.
_MANY: Any = tuple
_BY: Any = dict
_HASH = Annotated[
    str,
    Meta(pattern="^[0-9a-f]{64}$", extra_json_schema={"description": "the hash of a record"}),
]
_PLAIN: dict[Holds, Any] = {Holds.YES_NO: bool}
# What is read of a text must be what stands there.
_READ: dict[Holds, tuple[str, Callable[[str], str]]] = {
    # A store has few aircraft and days, and many records of each.
    Holds.TEXT: ("a text", lru_cache(1024)(lambda text: text if read_text(text, "") else "")),
    Holds.DATE: ("a date", lru_cache(1024)(lambda text: read_date(text).isoformat())),
    Holds.MOMENT: ("a date, with its time if known", lambda text: read_moment(text).isoformat()),
}

# Each column that holds one, whoever fills it.
_TEXTS = tuple(column for column in COLUMNS if not column.carried and column.holds in _READ)


class _Entered(msgspec.Struct, array_like=True, forbid_unknown_fields=True):
    """A reading as it was entered; `bound` where only an end of it was found."""

    text: str
    unit: LengthUnit
    bound: Literal["", "<", ">"] = ""


_ENTERED_CELL = Annotated[_Entered, Meta(extra_json_schema={"description": "a text with its unit"})]


def _table(known: Mapping[str, Any], **others: Any) -> Any:
    """A table that has the known keys and may have the others, and any key beyond them."""
    optional = [(name, kind, None) for name, kind in others.items()]
    keys: list[Any] = [*known.items(), *optional]
    return msgspec.defstruct(
        "Kept", keys, bases=(Table,), kw_only=True, forbid_unknown_fields=False
    )


class KeptGate:
    """Says what is wrong with the content of a record, empty if nothing is; the gear says what its
    joints are.
    """

    def __init__(self, gear: Gear) -> None:
        options = ReadOptions.of(gear)
        numbers = options.joints.numbers
        self._joint: Any = Literal[tuple(numbers)]
        self._by_joint: Any = Literal[tuple(map(str, numbers))]
        columns = {name: kind for c in COLUMNS for name, kind in self._kinds(c, options)}
        needed = {column.filled for column in (*IDENTITY, CONVENTION)}
        inspection = msgspec.defstruct(
            "KeptInspection",
            [
                (name, kind) if name in needed else (name, kind, msgspec.UNSET)
                for name, kind in {
                    **dict.fromkeys((*(f.name for f in fields(Inspection)), *RETIRED), Any),
                    **columns,
                    **dict.fromkeys(("gauge_u_is_default", "is_left"), bool),
                    "entered": _BY[self._by_joint, _ENTERED_CELL],
                    "carried": dict[str, str],
                    "warnings": tuple[str, ...],
                    "source": tuple[str | None, str | None, int | None],
                    "unit_question": str,
                }.items()
                if name != "other_columns"
            ],
            bases=(Table,),
            kw_only=True,
        )
        joints = _MANY[self._joint, ...]
        work = {"landings": columns[LANDINGS.filled] | None, WORK_ORDER.name: str | None}
        self._of_kind: dict[RecordKind, Any] = {
            RecordKind.INSPECTION: _table({"inspection": inspection}),
            RecordKind.CORRECTION: _table({"supersedes": _HASH, "inspection": inspection}),
            RecordKind.ASSESSMENT: _table({"result": dict}),
            RecordKind.REPAIR: _table({"joints": joints}, **work),
            RecordKind.RERIG: _table({}, **work),
            RecordKind.OUTCOME: _table({"of": _HASH, "found": str, "joint": self._joint | None}),
            RecordKind.VOID: _table({"voids": _HASH, "why": str}),
        }

    def _kinds(self, column: Column, options: ReadOptions) -> Iterator[tuple[str, Any]]:
        """What may stand under the names that a column has in a kept record."""
        if column.is_length:
            low, high = options.range_in(column)
            if column.joint_fills:
                number = _number(low, high, above=column.is_above_zero(1))
                yield column.joint_fills, _BY[self._by_joint, number]
            if not column.needs_joint:
                number = _number(low, high, above=column.is_above_zero(None))
                several = _MANY[number, ...]
                yield column.filled, several if column.copies > 1 else number
        elif column.choices is not None:
            yield column.filled, column.choices
        elif column.holds is Holds.JOINTS:
            yield column.filled, _MANY[self._joint, ...]
        elif column.holds is Holds.NUMBER:
            yield column.filled, _number(column.low, column.high)
        elif not column.carried:
            yield column.filled, _PLAIN.get(column.holds, str)

    def __call__(self, record: Record, body: Any) -> str:
        wrong = refusal(body, self._of_kind[record.kind])
        if wrong is not None:
            place, shown, expected = wrong
            name = str(place[-1]) if place else "content"
            if name.isdecimal() and len(place) > 1:
                name = f"{place[-2]}, joint {name}"
            return f"column {name!r}: {shown} is not {expected}"
        # Whatever stands there can be voided under the names that it has.
        if record.kind is RecordKind.VOID:
            return ""
        filed: dict[Column, Any] = {
            RECORD_ID: record.record_id,
            TAIL_NO: record.tail_no,
            SIDE: record.side,
            DATE: record.day or None,
        }
        found = body.get("inspection")
        if found is None:
            if record.side not in set(Side):
                return f"column 'side': {record.side!r} is not one of {', '.join(Side)}"
            read = {TAIL_NO: record.tail_no, DATE: record.day, WORK_ORDER: body.get("work_order")}
            return _unread(read)
        for column, value in filed.items():
            if found.get(column.filled) != value:
                return (
                    f"column {column.filled!r}: {found.get(column.filled)!r} is not what the record"
                    f" is filed under ({value!r})"
                )
        return _unread({c: found[c.filled] for c in _TEXTS if c.filled in found})


def _number(low: float, high: float, *, above: bool = False) -> Any:
    """A number in the range of a column; what was converted to inches may be rounded."""
    most = high + ROUNDING_IN if math.isfinite(high) else 1e12
    if above:
        return Annotated[float, Meta(gt=low, le=most)]
    return Annotated[float, Meta(ge=low - ROUNDING_IN * (low != 0.0), le=most)]


def _unread(values: Mapping[Column, Any]) -> str:
    """Say which text is not written as it would be read; empty if all are."""
    for column, value in values.items():
        if column.holds not in _READ or not value:
            continue
        expected, read = _READ[column.holds]
        try:
            texts = [value] if isinstance(value, str) else value
            if all(read(each) == each for each in texts):
                continue
        except CellFaultError:
            pass
        return f"column {column.filled!r}: {value!r} is not {expected}"
    return ""
