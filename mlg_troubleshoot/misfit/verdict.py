"""What measured data say about a model."""

from __future__ import annotations

from enum import StrEnum


class MisfitVerdict(StrEnum):
    """What measured data say about a simulation."""

    NONE = "NONE"
    NAMED = "NAMED"
    AMBIGUOUS = "AMBIGUOUS"
    UNLISTED = "UNLISTED"
