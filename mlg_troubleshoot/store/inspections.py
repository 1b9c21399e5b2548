"""Inspections as plain JSON values and back, as entered and as read.

Entries of the prompts that are not finished, in the store with the records: each is one row,
written over.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import asdict, dataclass, fields
from datetime import date, datetime
from enum import Enum
from functools import lru_cache
from typing import Any

import sqlalchemy as sql

from mlg_troubleshoot.decision.columns import COLUMNS, CONVENTION, DATE, GAUGE_U, Holds
from mlg_troubleshoot.decision.inspection import EnteredClearance, Inspection, RowSource
from mlg_troubleshoot.store.database import DRAFTS, Record, RecordKind, Store, packed
from mlg_troubleshoot.units import ClearanceConvention, Length, LengthUnit, Sentence

# What says where and how an inspection was entered, not what was found.
NOT_CONTENT = ("record_id", "source", "warnings", "entered", "unit_question")
_BY_JOINT = tuple(column.joint_fills for column in COLUMNS if column.joint_fills)

_FIELDS = tuple(
    (field.name, field.default) for field in fields(Inspection) if field.name != "other_columns"
)
_NAMES = frozenset(name for name, _ in _FIELDS)
# What records of 0.2.0 may hold and nothing reads any more: it stays in the record.
RETIRED = frozenset(("open_areas", "minutes_available"))
_AS_THEY_ARE = frozenset((str, int, float, bool, type(None)))


def _plain(value: Any) -> Any:
    if value.__class__ in _AS_THEY_ARE:
        return value
    if isinstance(value, Enum | date):
        return value.value if isinstance(value, Enum) else value.isoformat()
    if isinstance(value, Mapping):
        return {str(key): _plain(each) for key, each in value.items()}
    if isinstance(value, EnteredClearance):
        return [value.text, value.unit.value, *filter(None, (value.bound,))]
    if isinstance(value, RowSource):
        return [value.file, value.sheet, value.row]
    return [_plain(each) for each in value] if isinstance(value, tuple) else value


def said_of(inspection: Inspection) -> dict[str, Any]:
    """Return an inspection as plain JSON values; what is at its default is left out."""
    said = {}
    for name, default in _FIELDS:
        value = getattr(inspection, name)
        if value is not default and value != default and value not in ({}, ()):
            said[name] = _plain(value)
    return said | {name: _plain(value) for name, value in inspection.other_columns.items()}


def inspection_record(
    inspection: Inspection, kind: RecordKind = RecordKind.INSPECTION, **more: Any
) -> Record:
    return record_of(said_of(inspection), kind, **more)


def record_of(
    said: Mapping[str, Any], kind: RecordKind = RecordKind.INSPECTION, **more: Any
) -> Record:
    """Return what an inspection says as a record."""
    filed = said["record_id"], said["tail_no"], said["side"], said.get(DATE.filled, "")
    identity = filed if kind is RecordKind.INSPECTION else ()
    return Record(kind, *filed, packed({"inspection": said, **more}), identity)


def _moment(text: str) -> date:
    """A day, or a day with its time."""
    return datetime.fromisoformat(text) if "T" in text else date.fromisoformat(text)


# Many readings of a gear were written alike.
@lru_cache(1024)
def _entered(text: str, unit: str, bound: str = "") -> EnteredClearance:
    return EnteredClearance(text, LengthUnit(unit), bound)


# How a field is read back where it does not stand in JSON as it is.
_READ: dict[str, Callable[[Any], Any]] = {
    **dict.fromkeys(
        _BY_JOINT, lambda found: {int(number): value for number, value in found.items()}
    ),
    "entered": lambda found: {int(number): _entered(*each) for number, each in found.items()},
    "source": lambda found: RowSource(*found),
    **{column.filled: date.fromisoformat for column in COLUMNS if column.holds is Holds.DATE},
    **{column.filled: _moment for column in COLUMNS if column.holds is Holds.MOMENT},
    **{column.filled: column.choices for column in COLUMNS if column.choices is not None},
    **{c.filled: tuple for c in COLUMNS if c.holds is Holds.JOINTS},
    **dict.fromkeys(("readings_in", "warnings"), tuple),
}


def inspection_from(record: Record, body: Any = None) -> Inspection:
    """The inspection that a record holds; `body`: its content, where it is unpacked already."""
    content = (record.body if body is None else body)["inspection"]
    read = {
        name: _READ[name](value) if name in _READ else value
        for name, value in content.items()
        if name not in RETIRED
    }
    other = {name: read.pop(name) for name in [*read] if name not in _NAMES}
    return Inspection(**{"clearance_in": {}, "other_columns": other, **read})


def cells_of(said: Mapping[str, Any]) -> dict[str, Any]:
    """What an inspection says, by its words in a sentence; clearances as they were read."""
    factor = ClearanceConvention(said[CONVENTION.filled]).per_radial
    clearance = sorted(said.get("clearance_in", {}).items(), key=lambda each: int(each[0]))
    left_out = (*NOT_CONTENT, "clearance_in", "gauge_u_is_default")
    others = {
        _WORDS.get(name, name.replace("_", " ")): _in_words(
            name, value * factor if name == GAUGE_U.filled else value
        )
        for name, value in said.items()
        if name not in left_out
    }
    return {f"#{joint}": Length.brief(value * factor) for joint, value in clearance} | others


_WORDS = {column.filled: column.said for column in COLUMNS}


def _in_words(name: str, value: Any) -> Any:
    if isinstance(value, Mapping):
        each = (Sentence.of("{} {}", key, _in_words(name, one)) for key, one in value.items())
        return Sentence.joined(each, ", ")
    if isinstance(value, list):
        return Sentence.joined((_in_words(name, one) for one in value), ", ")
    return Length.brief(value) if name.endswith("_in") else value


_MOST_CHARACTERS = 1_000_000


@dataclass(frozen=True, slots=True)
class Draft:
    """One entry as text; a complete one was shown and kept, or put away, and ``writer`` is the run
    that saved it.
    """

    id: str
    owner: str
    writer: str
    complete: bool
    content: str


class Drafts:
    """The drafts of a store."""

    def __init__(self, store: Store) -> None:
        self.store = store

    def save(self, draft: Draft, writers: Collection[str]) -> bool:
        """Write a draft whole; false, and nothing is written, if none of these writers saved it
        last.
        """
        with self.store.transaction(writing=True) as connection:
            DRAFTS.create(connection, checkfirst=True)
            before = connection.execute(
                sql.select(DRAFTS.c.writer).where(DRAFTS.c.draft_id == draft.id)
            ).scalar()
            if before is not None and before not in writers:
                return False
            newest = sql.select(sql.func.max(DRAFTS.c.saved))
            last = connection.scalar(newest) or 0
            connection.execute(DRAFTS.delete().where(DRAFTS.c.draft_id == draft.id))
            named = {f"draft_{n}" if n == "id" else n: v for n, v in asdict(draft).items()}
            connection.execute(DRAFTS.insert().values(saved=last + 1, **named))
        return True

    def newest_first(self, owner: str | None = None) -> list[Draft]:
        """Drafts of an owner, or of all; what is too large to be one comes without its content."""
        content = sql.case(
            (sql.func.length(DRAFTS.c.content) <= _MOST_CHARACTERS, DRAFTS.c.content), else_=""
        )
        wanted = [DRAFTS.c.owner == owner] if owner else []
        with self.store.transaction(writing=False) as connection:
            if not sql.inspect(connection).has_table(DRAFTS.name):
                return []
            columns = (
                DRAFTS.c.draft_id,
                DRAFTS.c.owner,
                DRAFTS.c.writer,
                DRAFTS.c.complete,
                content,
            )
            rows = connection.execute(
                sql.select(*columns).where(*wanted).order_by(DRAFTS.c.saved.desc())
            )
            return [Draft(*row) for row in rows]

    def discard(self, draft_id: str) -> None:
        """Delete a draft; nothing happens if it does not exist."""
        if self.store.is_new:
            return
        with self.store.transaction(writing=True) as connection:
            if sql.inspect(connection).has_table(DRAFTS.name):
                connection.execute(DRAFTS.delete().where(DRAFTS.c.draft_id == draft_id))
