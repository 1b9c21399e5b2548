"""What every document has: title, footer of each page, disclaimer, assumptions, provenance."""

from __future__ import annotations

from typing import Any

from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.gear.sources import SourceKind
from mlg_troubleshoot.reporting.formats import Lengths, digest
from mlg_troubleshoot.reporting.provenance import ReportProvenance

Facts = list[tuple[str, str]]
DISCLAIMER = (
    "Troubleshooting aid, not maintenance data.",
    "Does not replace the maintenance manual's limits.",
    "Within margin is not an approval for return to service.",
    "In-plane joint clearance only: not hydraulics, friction, doors, switches or structure.",
)


def head(
    title: str, footer: str, gear: Gear, provenance: ReportProvenance, lengths: Lengths
) -> dict[str, Any]:
    """Return what the base template shows; the caller adds its own and may replace any of it."""
    return {
        "title": title,
        "heading_of_gear": gear.name,
        "footer_left": footer,
        "footer_middle": _program_and_hashes(provenance),
        "disclaimer": DISCLAIMER,
        "source_counts": [
            (sum(n.kind is kind for n in gear.numbers), kind.value) for kind in SourceKind
        ],
        "limits_of": sorted({(j.limit.value, j.limit.kind, j.limit.source) for j in gear.joints}),
        "alike": [
            " = ".join(map("#{}".format, pair)) for pair in gear.link_groups if len(pair) > 1
        ],
        "made": provenance,
        "made_on": provenance.created.date().isoformat(),
        "lengths": lengths,
        "unit": lengths.unit.value,
        "gear": gear,
    }


def _program_and_hashes(p: ReportProvenance) -> str:
    hashes = list(p.input_sha256.values())
    parts = [f"mlg {p.program_version}", f"geometry {digest(p.geometry_sha256, 8)}"]
    if hashes:
        parts.append(
            f"input {digest(hashes[0], 8)}" if len(hashes) == 1 else f"{len(hashes)} inputs"
        )
    return " · ".join(parts)
