"""The content of kept records, judged as cells are whenever it is read: a store or an export may
come from anybody.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import fields
from functools import lru_cache
from typing import Annotated, Any, Literal

import msgspec
from msgspec import Meta

from mlg_troubleshoot.datafile import Table, refusal
from mlg_troubleshoot.decision.columns import (
    COLUMNS,
    CONVENTION,
    DATE,
    IDENTITY,
    LANDINGS,
    RECORD_ID,
    SIDE,
    TAIL_NO,
    WORK_ORDER,
    Column,
    Holds,
)
from mlg_troubleshoot.decision.inspection import Inspection, Side
from mlg_troubleshoot.gear.gear import ROUNDING_IN, Gear
from mlg_troubleshoot.records import ReadOptions
from mlg_troubleshoot.records.values import CellFaultError, read_date, read_moment, read_text
from mlg_troubleshoot.store import RETIRED, Record, RecordKind
from mlg_troubleshoot.units import LengthUnit

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


_ENTERED = Annotated[_Entered, Meta(extra_json_schema={"description": "a text with its unit"})]


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
                    "gauge_u_is_default": bool,
                    "entered": _BY[self._by_joint, _ENTERED],
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
