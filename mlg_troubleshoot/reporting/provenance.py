"""What every document has: title, footer, disclaimer, assumptions, and where it comes from."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from functools import cache
from importlib.metadata import version
from typing import Any

import msgspec

from mlg_troubleshoot.errors import UsageError
from mlg_troubleshoot.gear.gear import Gear, SourceKind
from mlg_troubleshoot.reporting.formats import Lengths
from mlg_troubleshoot.reporting.witness import Witness

Facts = list[tuple[str, str]]
DISCLAIMER = (
    "Troubleshooting aid, not maintenance data.",
    "Does not replace the maintenance manual's limits.",
    "Within margin is not an approval for return to service.",
    "In-plane joint clearance only: not hydraulics, friction, doors, switches or structure.",
)


@dataclass(frozen=True, slots=True)
class ReportProvenance:
    """Program, inputs and moment behind a report.

    input_sha256: hash of the bytes of each input file by its name; empty for prompts and the
    command line.
    witness: the log that holds what is reported; None where nothing was kept.
    """

    program_version: str
    created: datetime
    geometry_sha256: str
    input_sha256: Mapping[str, str] = field(default_factory=dict)
    seed: int | None = None
    extension: str | None = None
    witness: Witness | None = None

    def about(self, *gear: str | None) -> ReportProvenance:
        """The provenance of the report of one gear, by tail and side, among others."""
        if self.witness is None:
            return self
        own = [each for each in self.witness.gears if (each.tail_no, each.side) == gear]
        return replace(self, witness=msgspec.structs.replace(self.witness, gears=tuple(own)))


def provenance_of(
    gear: Gear,
    input_sha256: Mapping[str, str],
    *,
    seed: int | None = None,
    extension: str | None = None,
    witness: Witness | None = None,
) -> ReportProvenance:
    made = program_version(), moment_of_report(), gear.geometry_sha256
    return ReportProvenance(*made, dict(input_sha256), seed, extension, witness)


@cache
def program_version() -> str:
    return version("mlg-troubleshoot")


def moment_of_report() -> datetime:
    """Return the present moment, or the one of ``SOURCE_DATE_EPOCH`` where a report must be the
    same bytes again.
    """
    given = os.environ.get("SOURCE_DATE_EPOCH")
    if given is None:
        return datetime.now(UTC).astimezone()
    try:
        return datetime.fromtimestamp(int(given), UTC)
    except (ValueError, OverflowError, OSError):
        raise UsageError(
            f"SOURCE_DATE_EPOCH is {given!r}",
            "Set it to seconds since 1970-01-01 UTC, or leave it out.",
        ) from None


def head(
    title: str, footer: str, gear: Gear, provenance: ReportProvenance, lengths: Lengths
) -> dict[str, Any]:
    """Return what the base template shows; the caller adds its own and may replace any of it."""
    return {
        "title": title,
        "footer_left": footer,
        "disclaimer": DISCLAIMER,
        "source_counts": [
            (sum(n.kind is kind for n in gear.numbers), kind.value) for kind in SourceKind
        ],
        "limits_of": sorted({(j.limit.value, j.limit.kind, j.limit.source) for j in gear.joints}),
        "alike": [
            " = ".join(map("#{}".format, pair)) for pair in gear.link_groups if len(pair) > 1
        ],
        "made": provenance,
        "lengths": lengths,
        "unit": lengths.unit.value,
        "gear": gear,
    }
