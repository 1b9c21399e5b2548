"""The one place where TOML and JSON from outside are read: files that are data, never code.

A gear file, an ensemble, targets, a table of indices, an extension and settings may come from
anybody. They are read as regular files of sane size and depth. What may stand in them is a struct
that msgspec decodes; what is wrong is a `GearFileError` that says file, key, value and what was
expected.
"""

from __future__ import annotations

import difflib
import json
import re
import stat
import tomllib
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from types import UnionType
from typing import (
    Annotated,
    Any,
    Generic,
    TypeVar,
    Union,
    get_args,
    get_origin,
    get_type_hints,
)

import msgspec
from msgspec import Meta, inspect
from msgspec.structs import fields

from mlg_troubleshoot.errors import GearFileError

# The shipped files have 25 kB, lines of 400 characters and tables four deep; reading dotted keys
# takes time with the square of a line's length, and deep nesting ends in a full stack.
MOST_BYTES = 2_000_000
LONGEST_LINE = 8_000
DEEPEST = 24
MOST_ENTRIES = 200
LONGEST_NAME = 40
LONGEST_FILE_NAME = 200
LONGEST_TEXT = 2_000
LARGEST = 10**12
_SHOWN = 80

Number = Annotated[float, Meta(ge=-LARGEST, le=LARGEST)]
AboveZero = Annotated[float, Meta(gt=0, le=LARGEST)]
Whole = Annotated[int, Meta(ge=-LARGEST, le=LARGEST)]
Count = Annotated[int, Meta(ge=0, le=LARGEST)]
Pair = tuple[Number, Number]
# A name becomes part of messages, keys and drawings.
Name = Annotated[str, Meta(min_length=1, max_length=LONGEST_NAME, pattern=r"^[^\n]*\S[^\n]*$")]
Sibling = Annotated[
    str,
    Meta(
        pattern=r"^(?!\.{1,2}$)[^/\\\n]+$",
        max_length=LONGEST_FILE_NAME,
        description="the name of a file in the same folder, without a folder",
    ),
]
JsonSibling = Annotated[
    str,
    Meta(
        pattern=r"^[^/\\\n]+\.json$",
        max_length=LONGEST_FILE_NAME,
        description="the name of a .json file in the same folder, without a folder",
    ),
]

T = TypeVar("T")
Place = tuple[str | int, ...]


# No float holds a number so large, no text more than 4,300 digits, and no file half of a character.
_REFUSED = (msgspec.ValidationError, OverflowError, ValueError)
# By name, since a checker of types would otherwise ask for ``frozen`` at every kind of table.
_STRICT: dict[str, Any] = {"frozen": True, "forbid_unknown_fields": True}


class Table(msgspec.Struct, **_STRICT):
    """A table of a data file: its fields are the keys that it may have."""


class RefusedValueError(ValueError):
    """What is wrong with the value of a key of a table, raised by the table itself."""

    def __init__(self, key: str, expected: str) -> None:
        super().__init__(expected)
        self.key = key


@dataclass(frozen=True, slots=True)
class DataFile(Generic[T]):
    """A data file: what was decoded, and the values as they stand."""

    path: Path
    values: dict[str, Any]
    content: T

    def fail(self, place: Place, expected: str) -> GearFileError:
        """Return the error of a value, found by its keys and its index in lists."""
        return _error(self.path, self.values, place, expected)


def read_toml(
    path: Path, kind: type[T], missing: str = "Put it next to the gear file that names it."
) -> DataFile[T]:
    """Read a TOML file of a kind; `missing` is the remedy if it does not exist."""
    return _read(path, kind, missing, "TOML", _parsed_toml)


def read_json(path: Path, kind: type[T], missing: str) -> DataFile[T]:
    """Read a JSON file of a kind; `missing` is the remedy if it does not exist."""
    return _read(path, kind, missing, "JSON", json.loads)


def decode(path: Path, values: dict[str, Any], kind: type[T]) -> T:
    """Return the values of a file as a kind of table; `GearFileError` if they do not fit it."""
    try:
        return msgspec.convert(values, kind, str_keys=True)
    except _REFUSED:
        raise _error(path, values, *_refusal(values, kind)) from None


def refusal(values: Any, kind: Any) -> tuple[Place, str, str] | None:
    """Return which of some values is not of a kind: where it stands, how it is shown, and what was
    expected there; None if all are.
    """
    if _why(values, kind) is None:
        return None
    place, expected = _refusal(values, kind)
    found = values
    for key in place:
        known = isinstance(found, list) or (isinstance(found, dict) and key in found)
        found = found[key] if known else msgspec.UNSET
    return place, "nothing" if found is msgspec.UNSET else _shown(found), expected


def _parsed_toml(text: str) -> Any:
    longest = max(map(len, text.splitlines()), default=0)
    if longest > LONGEST_LINE:
        raise ValueError(f"a line has {longest} characters, at most {LONGEST_LINE} are read")
    return tomllib.loads(text)


def _read(
    path: Path, kind: type[T], missing: str, form: str, parse: Callable[[str], Any]
) -> DataFile[T]:
    remedy = "Correct the file and run again."
    deep = GearFileError(
        f"{path}: cannot be read as {form}: nested more than {DEEPEST} deep", remedy
    )
    try:
        found = path.stat()
        if not stat.S_ISREG(found.st_mode):
            raise GearFileError(f"{path} is not a regular file", "Give the name of a file.")
        if found.st_size > MOST_BYTES:
            raise GearFileError(
                f"{path}: has {found.st_size} bytes, at most {MOST_BYTES} are read", remedy
            )
        raw = parse(path.read_text(encoding="utf-8-sig"))
    except FileNotFoundError:
        raise GearFileError(f"{path}: there is no such file", missing) from None
    except RecursionError:
        raise deep from None
    except (OSError, ValueError) as error:
        raise GearFileError(f"{path}: cannot be read as {form}: {error}", remedy) from error
    if not isinstance(raw, dict):
        raise GearFileError(
            f"{path}: expected names with values at the top, found {_shown(raw)}", remedy
        )
    for place, value in walk(raw):
        if len(place) >= DEEPEST:
            raise deep
        if isinstance(value, dict | list) and len(value) > MOST_ENTRIES:
            raise _error(path, raw, place, f"at most {MOST_ENTRIES} entries")
        if isinstance(value, str) and not _is_text(value):
            expected = f"a text of at most {LONGEST_TEXT} characters, all of them printable"
            raise _error(path, raw, place, expected)
        if place and isinstance(place[-1], str) and not place[-1].isprintable():
            raise _error(path, raw, place, f"a name of 1 to {LONGEST_NAME} printable characters")
    return DataFile(path, raw, decode(path, raw, kind))


def walk(values: Any) -> Iterator[tuple[Place, Any]]:
    """Walk over all values, those at the top first; nothing deeper than allowed."""
    level: list[tuple[Place, Any]] = [((), values)]
    while level:
        yield from level
        level = [
            ((*place, key), part)
            for place, value in level
            if isinstance(value, dict | list) and len(place) < DEEPEST
            for key, part in (value.items() if isinstance(value, dict) else enumerate(value))
        ]


def _is_text(text: str) -> bool:
    return len(text) <= LONGEST_TEXT and all(c.isprintable() or c == "\n" for c in text)


def _error(path: Path, values: Any, place: Place, expected: str) -> GearFileError:
    words = ""
    found: Any = values
    for key in place:
        here = found
        if isinstance(key, int):
            found = here[key]
            words += f"[{_label(found, key)}]"
        else:
            found = here.get(key, msgspec.UNSET) if isinstance(here, dict) else msgspec.UNSET
            shown = key if key.isprintable() and len(key) <= _SHOWN else _shown(key)
            words += f".{shown}" if words else shown
    shown = "nothing" if found is msgspec.UNSET else _shown(found)
    return GearFileError(
        f"{path.name}: {words}: expected {expected}, found {shown}",
        "Correct the file and run again.",
    )


def _label(entry: Any, index: int) -> str | int:
    """Return what an entry of a list calls itself, or which one it is."""
    named = entry if isinstance(entry, dict) else {}
    label = named.get("name", named.get("joint"))
    is_shown = isinstance(label, int) and abs(label) <= LARGEST
    if isinstance(label, str):
        # Short, and without control characters or turned directions.
        is_shown = label.isprintable() and label.strip() != "" and len(label) <= LONGEST_NAME
    return str(label) if is_shown else index + 1


def _shown(value: Any) -> str:
    if isinstance(value, dict | list) and len(value) > 4:
        return f"{len(value)} entries"
    try:
        text = repr(value)
    except ValueError:
        # More than 4,300 digits cannot be printed at all.
        text = "a number of more than 4,300 digits"
    return text if len(text) <= _SHOWN else f"{text[:_SHOWN]}…"


def _refusal(value: Any, kind: Any, place: Place = ()) -> tuple[Place, str]:
    """Return which value within a refused one is wrong, and what was expected there."""
    for key, part, of in _parts(value, kind):
        if _why(part, of) is not None:
            return _refusal(part, of, (*place, key))
    known = _fields(value, kind)
    for key in value if known else ():
        if key not in known:
            near = difflib.get_close_matches(key, known, n=1)
            meant = f"one of the known keys; did you mean {near[0]!r}?" if near else "a known key"
            return (*place, key), meant
    why = _why(value, kind)
    if isinstance(why, RefusedValueError):
        return (*place, why.key), str(why)
    return place, _words(inspect.type_info(kind))


def _why(value: Any, kind: Any) -> Exception | None:
    """Return why a value is not of a kind; None if it is."""
    try:
        msgspec.convert(value, kind, str_keys=True)
    except _REFUSED as error:
        return error.__cause__ if isinstance(error.__cause__, RefusedValueError) else error
    return None


def _alternatives(kind: Any) -> list[Any]:
    """Return what a value may be, but for nothing."""
    if get_origin(kind) is Annotated:
        return _alternatives(get_args(kind)[0])
    if get_origin(kind) in (Union, UnionType):
        return [each for each in get_args(kind) if each is not type(None)]
    return [kind]


def _structs(kind: Any) -> list[Any]:
    """Return the kinds of table that a kind allows."""
    return [k for k in _alternatives(kind) if isinstance(k, type) and issubclass(k, Table)]


def _fields(value: Any, kind: Any) -> dict[str, tuple[Any, bool]]:
    """Return the keys of a table, their kinds, and whether they must be there; nothing for a
    value of another kind.
    """
    structs = _structs(kind)
    if not structs or not isinstance(value, dict):
        return {}
    hints = get_type_hints(structs[0], include_extras=True)
    return {field.name: (hints[field.name], field.required) for field in fields(structs[0])}


def _parts(value: Any, kind: Any) -> Iterator[tuple[str | int, Any, Any]]:
    """Walk over keys, values and kinds of what a table, or a list of tables, consists of."""
    for key, (of, required) in _fields(value, kind).items():
        if required or key in value:
            yield key, value.get(key, msgspec.UNSET), of
    container = _alternatives(kind)[0]
    if isinstance(value, dict) and get_origin(container) is dict:
        of_keys, of_values = get_args(container)
        for key, part in value.items():
            is_key = _why({key: None}, dict[of_keys, Any]) is None  # type: ignore[valid-type]
            yield (key, part, of_values) if is_key else (key, key, of_keys)
    if isinstance(value, list) and get_origin(container) is tuple:
        of = get_args(container)[0]
        yield from ((i, part, of) for i, part in enumerate(value) if _structs(of))


def _words(info: Any) -> str:
    """Say what a value of a kind is: a number from 0 to 1, a name of 1 to 40 characters, …"""
    match info:
        case inspect.Metadata():
            words = str((info.extra_json_schema or {})["description"])
        case inspect.UnionType():
            words = _words(next(t for t in info.types if not isinstance(t, inspect.NoneType)))
        case inspect.FloatType():
            words = f"a number{_range(info)}"
        case inspect.IntType():
            words = f"a whole number{_range(info)}"
        case inspect.StrType():
            most = info.max_length
            words = f"a name of 1 to {most} printable characters" if most else "a text"
        case inspect.BoolType():
            words = "true or false"
        case inspect.LiteralType():
            words = _choice(info.values)
        case inspect.EnumType():
            words = _choice(info.cls)
        case inspect.TupleType():
            words = f"two {_plural(info.item_types[0])}"
        case inspect.VarTupleType(item_type=inspect.StructType() | inspect.UnionType()):
            words = "an array of tables"
        case inspect.VarTupleType():
            words = f"a list of {_plural(info.item_type)}"
        case _:
            words = "a table"
    return words


def _choice(values: Iterable[object]) -> str:
    *others, last = map(str, values)
    return f"{', '.join(others)} or {last}" if others else last


def _plural(info: Any) -> str:
    words = re.sub(r"^a (whole number|\w+)", r"\1s", _words(info))
    return re.sub("^two", "pairs of", words)


def _range(info: Any) -> str:
    """Say the range of a number; nothing if it has none."""
    has_most = info.le is not None and info.le < LARGEST
    if info.gt is not None:
        return f" above {info.gt:g}" + (f", at most {info.le:g}" if has_most else "")
    if info.ge is None or info.ge <= -LARGEST:
        return ""
    return f" from {info.ge:g} to {info.le:g}" if has_most else f" of {info.ge:g} or more"
