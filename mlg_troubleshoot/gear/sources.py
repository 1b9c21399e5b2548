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
    """A source in words, which numbers of a gear file refer to by name: document, section, how it
    was obtained.
    """

    name: str
    kind: SourceKind
    text: str


@dataclass(frozen=True, slots=True)
class Sourced:
    """A number with its unit and its source in words."""

    value: float
    unit: str
    kind: SourceKind
    source: str
