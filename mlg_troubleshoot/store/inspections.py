"""Inspections as plain JSON values and back, as entered and as read."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import fields
from datetime import date, datetime
from enum import Enum
from hashlib import sha256
from typing import Any

from mlg_troubleshoot.decision.columns import COLUMNS, Holds
from mlg_troubleshoot.decision.inspection import EnteredClearance, Inspection, RowSource
from mlg_troubleshoot.store.database import Record, RecordKind, canonical, packed
from mlg_troubleshoot.units import LengthUnit

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


def inspection_record(
    inspection: Inspection, kind: RecordKind = RecordKind.INSPECTION, **more: Any
) -> Record:
    """Return an inspection as a record; what is at its default is left out."""
    day = inspection.inspection_date.isoformat() if inspection.inspection_date else ""
    body = {}
    for name, default in _FIELDS:
        value = getattr(inspection, name)
        if value is not default and value != default and value not in ({}, ()):
            body[name] = _plain(value)
    body.update({name: _plain(value) for name, value in inspection.other_columns.items()})
    identity = (inspection.record_id, inspection.tail_no, inspection.side.value, day)
    return Record(
        kind,
        inspection.record_id,
        inspection.tail_no,
        inspection.side.value,
        day,
        packed({"inspection": body, **more}),
        identity if kind is RecordKind.INSPECTION else (),
    )


def _moment(text: str) -> date:
    """A day, or a day with its time."""
    return datetime.fromisoformat(text) if "T" in text else date.fromisoformat(text)


# How a field is read back where it does not stand in JSON as it is.
_READ: dict[str, Callable[[Any], Any]] = {
    **dict.fromkeys(
        _BY_JOINT, lambda found: {int(number): value for number, value in found.items()}
    ),
    "entered": lambda found: {
        int(n): EnteredClearance(text, LengthUnit(unit), *bound)
        for n, (text, unit, *bound) in found.items()
    },
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


def content_of(said: Mapping[str, Any], *left_out: str) -> bytes:
    """Hash of what an inspection says was found at which gear, and of what else is not left out;
    wherever it was entered and whatever it is called.
    """
    found = {n: v for n, v in said.items() if n not in NOT_CONTENT and n not in left_out}
    return sha256(canonical(found).encode()).digest()
