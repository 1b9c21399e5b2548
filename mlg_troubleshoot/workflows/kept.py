"""The content of kept records, judged as cells are whenever it is read: a store or an export may
come from anybody.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import fields
from enum import StrEnum
from functools import partial
from typing import Any

from mlg_troubleshoot.decision.assessment import Verdict
from mlg_troubleshoot.decision.columns import (
    COLUMNS,
    CONVENTION,
    DATE,
    IDENTITY,
    LANDINGS,
    RECORD_ID,
    SIDE,
    TAIL_NO,
    Column,
    Holds,
)
from mlg_troubleshoot.decision.inspection import Inspection
from mlg_troubleshoot.gear.gear import ROUNDING_IN, Gear
from mlg_troubleshoot.records import ReadOptions
from mlg_troubleshoot.records.values import (
    CellFaultError,
    read_date,
    read_moment,
    read_text,
    read_value,
)
from mlg_troubleshoot.store import Record, RecordKind
from mlg_troubleshoot.units import LengthUnit

_Check = Callable[[str, Any], None]
_SHOWN = 60
_HASH = re.compile(r"[0-9a-f]{64}")
# Of the program's own making: neither is read back as more than a text, a list or nothing.
_NUMBERS_OF_A_RESULT = ("predicted_displacement_in", "margin_in")


class _WrongError(Exception):
    """A value that a record of its kind cannot hold."""

    def __init__(self, column: str, value: Any, expected: str) -> None:
        shown = repr(value)
        shown = shown if len(shown) <= _SHOWN else f"{shown[:_SHOWN]}…"
        super().__init__(f"column {column!r}: {shown} is not {expected}")


class KeptGate:
    """Says what is wrong with the content of a record, empty if nothing is; the gear says what its
    joints are.
    """

    def __init__(self, gear: Gear) -> None:
        options = ReadOptions.of(gear)
        self._joints = options.joints.numbers
        self._fields: dict[str, _Check] = {
            **{field.name: _anything for field in fields(Inspection)},
            **{name: check for column in COLUMNS for name, check in self._checks(column, options)},
            "gauge_u_is_default": _flag,
            "entered": self._by_joint(_entered),
            "carried": _texts_by_name,
            "warnings": _each(_some_text),
            "source": _source,
            "unit_question": _some_text,
        }
        del self._fields["other_columns"]
        self._of_kind: dict[RecordKind, Callable[[Record, Mapping[str, Any]], None]] = {
            RecordKind.INSPECTION: self._inspection,
            RecordKind.CORRECTION: self._correction,
            RecordKind.ASSESSMENT: self._assessment,
            RecordKind.REPAIR: self._repair,
            RecordKind.RERIG: self._work,
            RecordKind.OUTCOME: self._outcome,
            RecordKind.VOID: _void,
        }

    def _checks(self, column: Column, options: ReadOptions) -> Iterator[tuple[str, _Check]]:
        """What may stand under the names that a column has in a kept record."""
        if column.is_length:
            low, high = options.range_in(column)
            if column.joint_fills:
                number = _number(low, high, above=column.is_above_zero(1))
                yield column.joint_fills, self._by_joint(number)
            if not column.needs_joint:
                number = _number(low, high, above=column.is_above_zero(None))
                yield column.filled, _each(number) if column.copies > 1 else number
        elif column in IDENTITY or column is CONVENTION:
            yield column.filled, _text if column.choices is None else _one_of(column.choices)
        elif column.holds is Holds.YES_NO:
            yield column.filled, _flag
        elif column.holds is Holds.DATE:
            yield column.filled, _cell(read_date)
        elif column.holds is Holds.MOMENT:
            yield column.filled, _moment
        elif column.holds is Holds.JOINTS:
            yield column.filled, _each(self._joint)
        elif column.holds is Holds.AREAS:
            yield column.filled, _each(_text)
        elif not column.carried:
            yield column.filled, _cell(partial(read_value, column))

    def __call__(self, record: Record, body: Any) -> str:
        try:
            if not isinstance(body, dict):
                raise _WrongError("content", body, "a table of names and values")
            # Whatever stands there can be voided under the names that it has.
            if record.kind is not RecordKind.VOID:
                self._fields[SIDE.filled](SIDE.name, record.side)
                _text(TAIL_NO.name, record.tail_no)
                if record.day:
                    self._fields[DATE.filled]("day", record.day)
            self._of_kind[record.kind](record, body)
        except _WrongError as wrong:
            return str(wrong)
        return ""

    def _inspection(self, record: Record, body: Mapping[str, Any]) -> None:
        found = _taken(body, "inspection", dict)
        for column in (*IDENTITY, CONVENTION):
            _taken(found, column.filled, str)
        for name, value in found.items():
            check = self._fields.get(name)
            if check is None:
                raise _WrongError(name, value, "a column of an inspection")
            check(name, value)
        filed = {
            RECORD_ID: record.record_id,
            TAIL_NO: record.tail_no,
            SIDE: record.side,
            DATE: record.day or None,
        }
        for column, value in filed.items():
            name = column.filled
            if found.get(name) != value:
                raise _WrongError(
                    name, found.get(name), f"what the record is filed under ({value!r})"
                )

    def _correction(self, record: Record, body: Mapping[str, Any]) -> None:
        _hash(body, "supersedes")
        self._inspection(record, body)

    def _assessment(self, _record: Record, body: Mapping[str, Any]) -> None:
        result = _taken(body, "result", dict)
        if result.get("verdict") is not None:
            _verdict("verdict", result["verdict"])
        for name in _NUMBERS_OF_A_RESULT:
            if result.get(name) is not None:
                _any_number(name, result[name])
        for finding in _taken(result, "joints", list, []):
            if not isinstance(finding, dict):
                raise _WrongError("joints", finding, "a joint of a result")
            self._joint("joint", finding.get("joint"))
            _any_number("rank", finding.get("rank"))
        action = result.get("next_action")
        if action is not None:
            _each(self._joint)(
                "next_action", _taken(_taken(result, "next_action", dict), "joints", list, [])
            )

    def _work(self, _record: Record, body: Mapping[str, Any]) -> None:
        if body.get("landings") is not None:
            self._fields[LANDINGS.filled]("landings", body["landings"])
        if body.get("work_order") is not None:
            _text("work_order", body["work_order"])

    def _repair(self, record: Record, body: Mapping[str, Any]) -> None:
        _each(self._joint)("joints", _taken(body, "joints", list))
        self._work(record, body)

    def _outcome(self, _record: Record, body: Mapping[str, Any]) -> None:
        _hash(body, "of")
        _taken(body, "found", str)
        if body.get("joint", "nothing") is not None:
            self._joint("joint", body.get("joint"))

    def _joint(self, column: str, value: Any) -> None:
        if isinstance(value, bool) or not isinstance(value, int) or value not in self._joints:
            raise _WrongError(column, value, f"a joint of this gear ({_listed(self._joints)})")

    def _by_joint(self, check: _Check) -> _Check:
        names = frozenset(map(str, self._joints))

        def each(column: str, value: Any) -> None:
            if not isinstance(value, dict):
                raise _WrongError(column, value, "a table of values by joint")
            for joint, found in value.items():
                if joint not in names:
                    raise _WrongError(
                        column, joint, f"a joint of this gear ({_listed(self._joints)})"
                    )
                check(f"{column}, joint {joint}", found)

        return each


def _listed(joints: Collection[int]) -> str:
    return ", ".join(map(str, joints))


def _anything(_column: str, _value: Any) -> None:
    """A field that no rule is made for, such as a newer one."""


def _text(column: str, value: Any) -> None:
    try:
        if isinstance(value, str) and read_text(value, "a text"):
            return
    except CellFaultError:
        pass
    raise _WrongError(column, value, "a text")


def _some_text(column: str, value: Any) -> None:
    if not isinstance(value, str):
        raise _WrongError(column, value, "a text")


def _flag(column: str, value: Any) -> None:
    if not isinstance(value, bool):
        raise _WrongError(column, value, "true or false")


def _number(low: float = -1e12, high: float = 1e12, *, above: bool = False) -> _Check:
    expected = (
        f"a number from {low:g} to {high:g}"
        if not above
        else f"a number above {low:g}, at most {high:g}"
    )

    def check(column: str, value: Any) -> None:
        number = isinstance(value, int | float) and not isinstance(value, bool)
        if (
            not number
            or not low - ROUNDING_IN <= value <= high + ROUNDING_IN
            or (above and value <= low)
        ):
            raise _WrongError(column, value, expected)

    return check


_any_number = _number()


def _one_of(words: type[StrEnum]) -> _Check:
    known = frozenset(word.value for word in words)

    def check(column: str, value: Any) -> None:
        if not isinstance(value, str) or value not in known:
            raise _WrongError(column, value, f"one of {', '.join(word.value for word in words)}")

    return check


_verdict = _one_of(Verdict)


def _cell(read: Callable[[Any], object]) -> _Check:
    """A value as the cell of its column: what comes back is what was kept."""

    def check(column: str, value: Any) -> None:
        kept = (
            float(value)
            if isinstance(value, int) and not isinstance(value, bool) and abs(value) < 1e15
            else value
        )
        if not isinstance(kept, str | float):
            raise _WrongError(column, value, "a text or a number")
        try:
            found = read(kept)
        except CellFaultError as fault:
            raise _WrongError(column, value, fault.expected) from None
        if (found if isinstance(found, float) else str(found)) != kept:
            raise _WrongError(column, value, f"written as it was kept ({found})")

    return check


def _moment(column: str, value: Any) -> None:
    try:
        if isinstance(value, str) and read_moment(value).isoformat() == value:
            return
    except CellFaultError:
        pass
    raise _WrongError(column, value, "a date, with its time if known")


def _each(check: _Check) -> _Check:
    def every(column: str, value: Any) -> None:
        if not isinstance(value, list):
            raise _WrongError(column, value, "a list")
        for found in value:
            check(column, found)

    return every


_UNITS = frozenset(unit.value for unit in LengthUnit)


def _entered(column: str, value: Any) -> None:
    if not (isinstance(value, list) and len(value) == 2 and all(isinstance(v, str) for v in value)):
        raise _WrongError(column, value, "a text and its unit")
    if value[1] not in _UNITS:
        raise _WrongError(column, value[1], f"one of {', '.join(sorted(_UNITS))}")


def _texts_by_name(column: str, value: Any) -> None:
    if not isinstance(value, dict) or not all(isinstance(text, str) for text in value.values()):
        raise _WrongError(column, value, "a table of texts")


def _source(column: str, value: Any) -> None:
    kinds = (str, str, int)
    if not isinstance(value, list) or len(value) != len(kinds):
        raise _WrongError(column, value, "a file, a sheet and a row")
    if not all(
        found is None or isinstance(found, kind) for found, kind in zip(value, kinds, strict=True)
    ):
        raise _WrongError(column, value, "a file, a sheet and a row")


_WORDS: dict[type, str] = {dict: "a table", list: "a list", str: "a text"}


def _taken(body: Mapping[str, Any], name: str, kind: type, default: Any = None) -> Any:
    value = body.get(name, default)
    if not isinstance(value, kind):
        raise _WrongError(name, value, _WORDS[kind])
    return value


def _hash(body: Mapping[str, Any], name: str) -> None:
    if not _HASH.fullmatch(_taken(body, name, str)):
        raise _WrongError(name, body[name], "the hash of a record")


def _void(_record: Record, body: Mapping[str, Any]) -> None:
    _hash(body, "voids")
    _taken(body, "why", str)
