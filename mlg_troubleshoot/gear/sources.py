"""Where a number comes from."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum


class SourceKind(StrEnum):
    """How much a number is worth."""

    TECHNICAL_ORDER = "technical order"
    STATED = "stated in the paper"
    RECONSTRUCTED = "reconstructed"
    MEASURED = "measured"
    ASSUMED = "assumed"


@dataclass(frozen=True, slots=True)
class Source:
    """A source that numbers of a gear file refer to by name.

    name: name within the gear file.
    kind: what kind of source.
    text: the source in words: document, section, how it was obtained.
    """

    name: str
    kind: SourceKind
    text: str


@dataclass(frozen=True, slots=True)
class Sourced:
    """A number with its unit and its source.

    kind: what kind of source.
    source: the source in words.
    """

    value: float
    unit: str
    kind: SourceKind
    source: str
