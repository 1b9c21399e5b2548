"""Where a number comes from."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

from mlg_troubleshoot.datafile import Table


class SourceKind(StrEnum):
    """How much a number is worth."""

    TECHNICAL_ORDER = "technical order"
    STATED = "stated in the paper"
    RECONSTRUCTED = "reconstructed"
    MEASURED = "measured"
    ASSUMED = "assumed"


class Source(Table):
    """A source in words, which numbers of a gear file refer to by name: document, section, how it
    was obtained.
    """

    kind: SourceKind
    text: str


@dataclass(frozen=True, slots=True)
class Sourced:
    """A number with its unit and its source in words."""

    value: float
    unit: str
    kind: SourceKind
    source: str
