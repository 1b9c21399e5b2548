"""The JSON of a record, and its schema, by the declaration of the record itself: lengths in inches,
numbers not rounded, null where not known.

A record is written field by field. One that is written otherwise says so in `json_names`:

``name``
    the field or property of that name;
``name=path``
    what stands at a dotted path;
``group.name=path``
    the same in an object of the output;
``*path``
    every name of the record there.

With `json_nulls`, every other name of that kind of record is null.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import fields
from functools import cache, partial
from operator import attrgetter
from typing import Any, NamedTuple

import msgspec
import numpy as np


def plain(value: Any) -> Any:
    """Return a value as JSON can hold it: records as objects, arrays as lists, names as text, and
    null for what is not a finite number.
    """
    return json.loads(json.dumps(_values(value)), parse_constant=lambda _name: None)


def as_text(value: Any) -> str:
    """Write a value as JSON: what `plain` makes of it, faster."""
    values = _values(value)
    try:
        return _ENCODED(values)
    except ValueError:
        return _ENCODED(plain(values))


def _values(value: Any) -> Any:
    """A value without records; its texts may hold what no encoding has."""
    return msgspec.to_builtins(_named(value), enc_hook=_parts)


_ENCODED = json.JSONEncoder(allow_nan=False, check_circular=False).encode


def _parts(value: Any) -> Any:
    """What a value consists of that the encoder does not know."""
    if isinstance(value, np.generic | np.ndarray):
        return value.tolist()
    if isinstance(value, str):
        return str(value)
    return dict(value) if isinstance(value, Mapping) else list(value)


@cache
def paths_of(kind: type) -> tuple[tuple[str, str], ...]:
    """Name in the JSON and path of each value of a record."""
    declared = getattr(kind, "json_names", None)
    if declared is None:
        names = getattr(kind, "_fields", None) or getattr(kind, "__struct_fields__", None)
        names = names or [field.name for field in fields(kind)]
        return tuple((name, name) for name in names)
    words = (word.replace("*", "*=").partition("=") for word in declared.split())
    return tuple((name, path or name) for name, _, path in words)


def names_of(kind: type) -> list[str]:
    """The names of a record in JSON."""
    return [name for name, _path in paths_of(kind)]


def _named(value: Any) -> Any:
    """A value in which every record with names of its own is an object already."""
    kind: Any = type(value)
    how = _how(kind)
    return value if how is None else how(value)


@cache
def _how(kind: type) -> Callable[[Any], Any] | None:
    """How values of a type become what the encoder knows, where it does not."""
    if hasattr(kind, "json_names") or hasattr(kind, "_fields"):
        return partial(_object, _Plan.of(kind))
    if issubclass(kind, tuple | list):
        return lambda value: [*map(_named, value)]
    if kind is dict:
        return lambda value: {key: _named(each) for key, each in value.items()}
    return None


class _Plan(NamedTuple):
    """Names that are null, and of the others the object and the name within it; their values."""

    nulls: dict[str, Any]
    names: list[tuple[str, str]]
    read: attrgetter[tuple[Any, ...]]

    @classmethod
    def of(cls, kind: type) -> _Plan:
        names, paths = zip(*paths_of(kind), strict=True)
        nulls = getattr(kind, "json_nulls", None)
        placed = [name.rpartition(".")[::2] for name in names]
        # A getter of one value would not give a tuple.
        return cls(
            dict.fromkeys(names_of(nulls) if nulls else ()), placed, attrgetter(*paths, "__class__")
        )


def _object(plan: _Plan, value: Any) -> dict[str, Any]:
    found = plan.nulls.copy()
    for (group, name), part in zip(plan.names, plan.read(value), strict=False):
        within = found.setdefault(group, {}) if group else found
        if name == "*":
            found |= _named(part)
        else:
            within[name] = _named(part)
    return found
