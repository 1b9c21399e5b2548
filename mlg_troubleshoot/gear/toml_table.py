"""Reads TOML tables strictly: what is missing, of the wrong kind or unknown is named with its place."""

from __future__ import annotations

import difflib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from mlg_troubleshoot.errors import GearFileError


class TomlTable:
    """A table of a TOML file that knows its place and which of its keys were read.

    Parameters
    ----------
    values : dict
        The table.
    file : Path
        The file, for messages.
    place : str
        The table's place in the file.
    """

    def __init__(self, values: dict[str, Any], file: Path, place: str = "") -> None:
        self._values = values
        self._file = file
        self._place = place
        self._read: set[str] = set()

    def fail(self, key: str, expected: str) -> GearFileError:
        """Make the error for a key.

        Parameters
        ----------
        key : str
            The key.
        expected : str
            What should stand there.

        Returns
        -------
        GearFileError
            The error, with file, place, value and expectation.
        """
        place = f"{self._place}.{key}" if self._place else key
        found = repr(self._values[key]) if key in self._values else "nothing"
        return GearFileError(
            f"{self._file.name}: {place}: expected {expected}, found {found}",
            "Correct the file and run again.",
        )

    def _get(self, key: str) -> Any:
        self._read.add(key)
        return self._values.get(key)

    def has(self, key: str) -> bool:
        """Tell whether the key stands in the table."""
        return key in self._values

    def text(self, key: str, default: str | None = None) -> str:
        """Return a text; without a default it must be there."""
        value = self._get(key)
        if value is None and default is not None:
            return default
        if not isinstance(value, str):
            raise self.fail(key, "a text")
        return value

    def number(self, key: str, default: float | None = None) -> float:
        """Return a finite number; without a default it must be there."""
        value = self._get(key)
        if value is None and default is not None:
            return default
        if not _is_number(value):
            raise self.fail(key, "a number")
        return float(value)

    def positive(self, key: str, *, or_zero: bool = False) -> float:
        """Return a finite number above 0, or 0 where that is allowed."""
        value = self.number(key)
        if value < 0.0 or (value == 0.0 and not or_zero):
            raise self.fail(key, "a number of 0 or more" if or_zero else "a number above 0")
        return value

    def whole(self, key: str) -> int:
        """Return a whole number."""
        value = self._get(key)
        if isinstance(value, bool) or not isinstance(value, int):
            raise self.fail(key, "a whole number")
        return value

    def flag(self, key: str, default: bool = False) -> bool:
        """Return true or false."""
        value = self._get(key)
        if value is None:
            return default
        if not isinstance(value, bool):
            raise self.fail(key, "true or false")
        return value

    def pair(self, key: str) -> tuple[float, float]:
        """Return two numbers."""
        value = self._get(key)
        if not isinstance(value, list) or len(value) != 2 or not all(_is_number(v) for v in value):
            raise self.fail(key, "two numbers")
        return float(value[0]), float(value[1])

    def wholes(self, key: str) -> tuple[int, ...]:
        """Return a list of whole numbers, empty if the key is absent."""
        value = self._get(key)
        if value is None:
            return ()
        if not isinstance(value, list) or any(isinstance(v, bool) or not isinstance(v, int) for v in value):
            raise self.fail(key, "a list of whole numbers")
        return tuple(value)

    def pairs(self, key: str) -> tuple[tuple[int, int], ...]:
        """Return a list of pairs of whole numbers, empty if the key is absent."""
        value = self._get(key)
        if value is None:
            return ()
        if not isinstance(value, list) or not all(
            isinstance(pair, list) and len(pair) == 2 and all(isinstance(v, int) for v in pair) for pair in value
        ):
            raise self.fail(key, "a list of pairs of whole numbers")
        return tuple((pair[0], pair[1]) for pair in value)

    def texts(self, key: str) -> tuple[str, ...]:
        """Return a list of texts."""
        value = self._get(key)
        if not isinstance(value, list) or not all(isinstance(v, str) for v in value):
            raise self.fail(key, "a list of texts")
        return tuple(value)

    def table(self, key: str) -> TomlTable:
        """Return a sub-table; it must be there."""
        value = self._get(key)
        if not isinstance(value, dict):
            raise self.fail(key, "a table")
        return TomlTable(value, self._file, f"{self._place}.{key}" if self._place else key)

    def tables(self, key: str) -> Iterator[TomlTable]:
        """Yield the tables of an array of tables."""
        value = self._get(key)
        if value is None:
            return
        if not isinstance(value, list) or not all(isinstance(v, dict) for v in value):
            raise self.fail(key, "an array of tables")
        for i, entry in enumerate(value):
            label = entry.get("name", entry.get("joint", entry.get("number", i + 1)))
            place = f"{self._place}.{key}" if self._place else key
            yield TomlTable(entry, self._file, f"{place}[{label}]")

    def skip(self, *keys: str) -> None:
        """Count keys as read that another reader takes care of."""
        self._read.update(keys)

    @property
    def names(self) -> tuple[str, ...]:
        """The keys of the table."""
        return tuple(self._values)

    def finish(self) -> None:
        """Refuse keys that nobody read, with the nearest known name.

        Raises
        ------
        GearFileError
            If a key is unknown.
        """
        for key in self._values:
            if key not in self._read:
                near = difflib.get_close_matches(key, self._read, n=1)
                hint = f"one of the known keys; did you mean {near[0]!r}?" if near else "a known key"
                raise self.fail(key, hint)


def _is_number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool) and abs(value) <= 1e12
