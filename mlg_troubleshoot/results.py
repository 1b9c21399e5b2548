"""What every result of the package can do in Python: compare, show itself in short, and become a
table, JSON or a picture.
"""

from __future__ import annotations

import textwrap
from collections.abc import Collection, Mapping
from dataclasses import fields, is_dataclass
from importlib import import_module
from typing import TYPE_CHECKING, Any, Literal

if TYPE_CHECKING:
    import pandas as pd

    from mlg_troubleshoot.notebook import Picture

# Of every JSON output: raised when a name or a meaning changes.
SCHEMA_VERSION: Literal[2] = 2

# A representation has at most so many lines of so many characters, and a value in it so many.
_LINES = 18
_WIDTH = 100
_VALUE = 60


class Result:
    """A result: its tables and pictures are made by a room far above it, when they are asked
    for.
    """

    __slots__ = ()

    def to_frame(self, of: str = "") -> pd.DataFrame:
        """Return a list of the JSON as a table: the main one, or the one of that name."""
        frame: pd.DataFrame = notebook().to_frame(self, of)
        return frame

    def to_dict(self) -> dict[str, Any]:
        """Return the documented JSON."""
        from mlg_troubleshoot.json_form import plain

        values: dict[str, Any] = plain(self)
        return values

    def plot(self, **options: Any) -> Picture:
        """Draw its picture, where it has one."""
        picture: Picture = notebook().plot(self, **options)
        return picture

    def _repr_html_(self) -> str:
        text: str = notebook().html(self)
        return text

    def __hash__(self) -> int:
        raise TypeError(f"unhashable type: {type(self).__name__!r}")

    def __eq__(self, other: object) -> bool:
        return same(self, other)

    def __repr__(self) -> str:
        parts = (f"{name}={_short(value)}" for name, value in _parts(self).items())
        lines = textwrap.wrap(f"{type(self).__name__}({', '.join(parts)})", _WIDTH)
        return "\n".join(lines if len(lines) <= _LINES else [*lines[:_LINES], "…"])


class JsonOutput(Result):
    """A result that a command writes as JSON, with the version of its schema."""

    __slots__ = ()
    schema_version: Literal[2] = SCHEMA_VERSION


def notebook() -> Any:
    """The room that makes tables and pictures; no import, since it loads pandas and what draws
    reports.
    """
    return import_module("mlg_troubleshoot.notebook")


def _parts(value: Any) -> dict[str, Any]:
    if is_dataclass(value):
        return {field.name: getattr(value, field.name) for field in fields(value)}
    names = getattr(value, "__struct_fields__", None)
    return dict(vars(value)) if names is None else {name: getattr(value, name) for name in names}


def _short(value: object) -> str:
    kind = type(value).__name__
    shape = getattr(value, "shape", None)
    if shape is not None:
        return f"array{shape}"
    if isinstance(value, str | int | float | None):
        return textwrap.shorten(repr(value), _VALUE, placeholder="…")
    text = "" if isinstance(value, Result) or is_dataclass(value) else repr(value)
    if text and len(text) <= _VALUE:
        return text
    return f"{kind} of {len(value)}" if isinstance(value, Collection) else f"{kind}(…)"


def same(one: Any, other: Any) -> bool:
    """Whether two values hold the same, arrays and missing numbers included."""
    import numpy as np

    if one is other:
        return True
    both_map = isinstance(one, Mapping) and isinstance(other, Mapping)
    if not (both_map or isinstance(one, type(other)) or isinstance(other, type(one))):
        return False
    if isinstance(one, np.ndarray | float):
        return np.array_equal(one, other, equal_nan=np.asarray(one).dtype.kind == "f")
    pieces = _pieces(one)
    others = _pieces(other)
    if pieces is None or others is None:
        return bool(one == other)
    if pieces.keys() != others.keys():
        return False
    return all(same(pieces[key], others[key]) for key in pieces)


def _pieces(value: Any) -> Mapping[Any, Any] | None:
    """What a value is made of; None if it is compared as a whole."""
    if isinstance(value, Mapping):
        return value
    if isinstance(value, tuple | list):
        return dict(enumerate(value))
    compares = getattr(type(value), "__eq__", None)
    is_plain = compares is getattr(object, "__eq__", None) and hasattr(value, "__dict__")
    return _parts(value) if isinstance(value, Result) or is_dataclass(value) or is_plain else None
