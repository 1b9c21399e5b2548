"""The one place where TOML and JSON from outside are read: files that are data, never code.

A gear file, an ensemble, targets, a table of indices and an extension may come from anybody. They
are read as regular files of sane size and depth, and every value is checked for its type,
finiteness and range; what is wrong is a `GearFileError` that says file, key, value and what was
expected.
"""

from __future__ import annotations

import difflib
import json
import stat
import tomllib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from mlg_troubleshoot.errors import GearFileError

# The shipped files have 25 kB, lines of 400 characters and tables four deep; reading dotted keys
# takes time with the square of a line's length, and deep nesting ends in a full stack.
MOST_BYTES, LONGEST_LINE, DEEPEST, MOST_ENTRIES = 2_000_000, 8_000, 24, 200
LONGEST_NAME, LONGEST_TEXT, LARGEST = 40, 2_000, 1e12
_SHOWN = 80


def read_toml(
    path: Path, missing: str = "Put it next to the gear file that names it."
) -> DataTable:
    """Read a TOML file; `missing` is the remedy if it does not exist."""
    return _read(path, missing, "TOML", _parsed_toml)


def read_json(path: Path, missing: str) -> DataTable:
    """Read a JSON file that holds an object; `missing` is the remedy if it does not exist."""
    return _read(path, missing, "JSON", json.loads)


def _parsed_toml(text: str) -> Any:
    longest = max(map(len, text.splitlines()), default=0)
    if longest > LONGEST_LINE:
        raise ValueError(f"a line has {longest} characters, at most {LONGEST_LINE} are read")
    return tomllib.loads(text)


def _read(path: Path, missing: str, form: str, parse: Callable[[str], Any]) -> DataTable:
    remedy = "Correct the file and run again."
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
        raise GearFileError(
            f"{path}: cannot be read as {form}: nested more than {DEEPEST} deep", remedy
        ) from None
    except (OSError, ValueError) as error:
        raise GearFileError(f"{path}: cannot be read as {form}: {error}", remedy) from error
    if not isinstance(raw, dict):
        raise GearFileError(
            f"{path}: expected names with values at the top, found {_shown(raw)}", remedy
        )
    if _is_deeper(raw, DEEPEST):
        raise GearFileError(
            f"{path}: cannot be read as {form}: nested more than {DEEPEST} deep", remedy
        )
    return DataTable(raw, path)


def _is_deeper(value: Any, most: int) -> bool:
    level = [value]
    for _ in range(most):
        level = [
            part
            for parts in level
            if isinstance(parts, (dict, list))
            for part in (parts.values() if isinstance(parts, dict) else parts)
        ]
        if not level:
            return False
    return True


def _shown(value: Any) -> str:
    if isinstance(value, (dict, list)) and len(value) > 4:
        return f"{len(value)} entries"
    # More than 4,300 digits cannot be printed at all.
    large = isinstance(value, int) and abs(value) > LARGEST
    text = f"a number of {value.bit_length()} bits" if large else repr(value)
    return text if len(text) <= _SHOWN else f"{text[:_SHOWN]}…"


class DataTable:
    """A table of a data file that knows its place and which of its keys were read."""

    def __init__(self, values: dict[str, Any], file: Path, place: str = "") -> None:
        self.values = values
        self._file = file
        self._place = place
        self._read: set[str] = set()

    def fail(self, key: str, expected: str) -> GearFileError:
        found = _shown(self.values[key]) if key in self.values else "nothing"
        return GearFileError(
            f"{self._file.name}: {self._at(key)}: expected {expected}, found {found}",
            "Correct the file and run again.",
        )

    def _at(self, key: str) -> str:
        shown = key if key.isprintable() and len(key) <= _SHOWN else _shown(key)
        return f"{self._place}.{shown}" if self._place else shown

    def get(self, key: str) -> Any:
        """The value as it stands, None if it is absent; whoever takes it so checks it himself."""
        self._read.add(key)
        return self.values.get(key)

    def has(self, key: str) -> bool:
        return key in self.values

    def text(self, key: str, default: str | None = None) -> str:
        """A text that can be shown as it is; without a default it must be there."""
        value = self.get(key)
        if value is None and default is not None:
            return default
        if not isinstance(value, str):
            raise self.fail(key, "a text")
        if len(value) > LONGEST_TEXT or not all(c.isprintable() or c == "\n" for c in value):
            raise self.fail(
                key, f"a text of at most {LONGEST_TEXT} characters, all of them printable"
            )
        return value

    def name(self, key: str, default: str | None = None) -> str:
        """A short name: it becomes part of messages, keys and drawings."""
        value = self.text(key, default)
        self._check_name(key, value)
        return value

    def _check_name(self, key: str, value: str) -> None:
        if not is_name(value):
            raise self.fail(key, f"a name of 1 to {LONGEST_NAME} printable characters")

    def one_of(self, key: str, known: tuple[str, ...], default: str | None = None) -> str:
        value = self.text(key, default)
        if value not in known:
            raise self.fail(key, "one of " + ", ".join(known))
        return value

    def sibling(self, key: str, default: str) -> Path:
        """A file in the same folder, by its name alone."""
        value = self.text(key, default)
        if value in ("", ".", "..") or "/" in value or "\\" in value or "\n" in value:
            raise self.fail(key, "the name of a file in the same folder, without a folder")
        return self._file.with_name(value)

    def number(
        self,
        key: str,
        default: float | None = None,
        *,
        least: float = -LARGEST,
        most: float = LARGEST,
    ) -> float:
        """A finite number in a range; without a default it must be there."""
        value = self.get(key)
        if value is None and default is not None:
            return default
        if not _is_number(value):
            raise self.fail(key, "a number")
        if not least <= value <= most:
            raise self.fail(key, _range_words("a number", least, most))
        return float(value)

    def positive(self, key: str, *, or_zero: bool = False, most: float = LARGEST) -> float:
        """A finite number above 0, or 0 where that is allowed."""
        value = self.number(key)
        if value < 0.0 or (value == 0.0 and not or_zero) or value > most:
            words = "a number of 0 or more" if or_zero else "a number above 0"
            raise self.fail(key, words if most == LARGEST else f"{words}, at most {most:g}")
        return value

    def whole(self, key: str, *, least: float = -LARGEST, most: float = LARGEST) -> int:
        value = self.get(key)
        if not _is_whole(value):
            raise self.fail(key, "a whole number")
        if not least <= value <= most:
            raise self.fail(key, _range_words("a whole number", least, most))
        return int(value)

    def flag(self, key: str, default: bool = False) -> bool:
        value = self.get(key)
        if value is None:
            return default
        if not isinstance(value, bool):
            raise self.fail(key, "true or false")
        return value

    def pair(
        self, key: str, *, least: float = -LARGEST, most: float = LARGEST
    ) -> tuple[float, float]:
        """Two finite numbers in a range."""
        value = self.get(key)
        if not isinstance(value, list) or len(value) != 2 or not all(_is_number(v) for v in value):
            raise self.fail(key, "two numbers")
        if not all(least <= v <= most for v in value):
            raise self.fail(key, _range_words("two numbers", least, most))
        return float(value[0]), float(value[1])

    def rising(
        self, key: str, *, least: float = -LARGEST, most: float = LARGEST
    ) -> tuple[float, float]:
        """Two finite numbers, the first not above the second."""
        low, high = self.pair(key, least=least, most=most)
        if low > high:
            raise self.fail(key, "two numbers, the smaller one first")
        return low, high

    def wholes(self, key: str) -> tuple[int, ...]:
        """A list of whole numbers, empty if the key is absent."""
        return self._list(key, _is_whole, "a list of whole numbers")

    def pairs(self, key: str) -> tuple[tuple[int, int], ...]:
        """A list of pairs of whole numbers, empty if the key is absent."""
        found = self._list(
            key,
            lambda pair: isinstance(pair, list) and len(pair) == 2 and all(map(_is_whole, pair)),
            "a list of pairs of whole numbers",
        )
        return tuple((pair[0], pair[1]) for pair in found)

    def texts(self, key: str) -> tuple[str, ...]:
        """A list of texts; it must be there."""
        if self.get(key) is None:
            raise self.fail(key, "a list of texts")
        return self._list(
            key,
            lambda v: isinstance(v, str) and len(v) <= LONGEST_TEXT and v.isprintable(),
            "a list of texts",
        )

    def _list(self, key: str, is_good: Callable[[Any], bool], expected: str) -> tuple[Any, ...]:
        value = self.get(key)
        if value is None:
            return ()
        if not isinstance(value, list) or not all(map(is_good, value)):
            raise self.fail(key, expected)
        if len(value) > MOST_ENTRIES:
            raise self.fail(key, f"at most {MOST_ENTRIES} entries")
        return tuple(value)

    def table(self, key: str) -> DataTable:
        """A sub-table; it must be there."""
        value = self.get(key)
        if not isinstance(value, dict):
            raise self.fail(key, "a table")
        return DataTable(value, self._file, self._at(key))

    def tables(self, key: str) -> Iterator[DataTable]:
        for i, entry in enumerate(
            self._list(key, lambda v: isinstance(v, dict), "an array of tables"), start=1
        ):
            label = entry.get("name", entry.get("joint", entry.get("number", i)))
            shown = label if _is_whole(label) or (isinstance(label, str) and is_name(label)) else i
            yield DataTable(entry, self._file, f"{self._at(key)}[{shown}]")

    def skip(self, *keys: str) -> None:
        """Count keys as read that another reader takes care of."""
        self._read.update(keys)

    @property
    def names(self) -> tuple[str, ...]:
        """The keys of the table, each of them a name."""
        if len(self.values) > MOST_ENTRIES:
            raise GearFileError(
                f"{self._file.name}: {self._place}: expected at most {MOST_ENTRIES} entries, found"
                f" {len(self.values)}",
                "Correct the file and run again.",
            )
        for key in self.values:
            self._check_name(key, key)
        return tuple(self.values)

    def finish(self) -> None:
        """Refuse keys that nobody read, with the nearest known name."""
        for key in self.values:
            if key not in self._read:
                near = difflib.get_close_matches(key, self._read, n=1)
                raise self.fail(
                    key,
                    f"one of the known keys; did you mean {near[0]!r}?" if near else "a known key",
                )


def is_name(text: str) -> bool:
    """Tell whether a text can be the name of a part: short, and without control characters or
    turned directions.
    """
    return 0 < len(text) <= LONGEST_NAME and text.isprintable() and not text.isspace()


def _range_words(what: str, least: float, most: float) -> str:
    if most == LARGEST:
        return f"{what} of {least:g} or more"
    return f"{what} from {least:g} to {most:g}"


def _is_whole(value: Any) -> bool:
    return isinstance(value, int) and not isinstance(value, bool) and abs(value) <= LARGEST


def _is_number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool) and abs(value) <= LARGEST
