"""What every document has: title, footer of each page, disclaimer, assumptions, provenance."""

from __future__ import annotations

from collections import Counter
from typing import Any

from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.gear.sources import SourceKind
from mlg_troubleshoot.reporting.formats import Lengths, digest, moment, several
from mlg_troubleshoot.reporting.provenance import ReportProvenance
from mlg_troubleshoot.studies.groups import link_groups

Facts = list[tuple[str, str]]
DISCLAIMER = (
    "Troubleshooting aid, not maintenance data.",
    "Does not replace the maintenance manual's limits.",
    "Within margin is not an approval for return to service.",
    "In-plane joint clearance only: not hydraulics, friction, doors, switches or structure.",
)


def head(title: str, footer: str, gear: Gear, provenance: ReportProvenance, lengths: Lengths) -> dict[str, Any]:
    """Return what the base template shows; the caller adds its own and may replace any of it."""
    return {
        "title": title,
        "heading_of_gear": gear.name,
        "footer_left": footer,
        "footer_middle": _program_and_hashes(provenance),
        "disclaimer": DISCLAIMER,
        "source_counts": source_counts(gear),
        "limits_of": sorted({(j.limit.value, j.limit.kind, j.limit.source) for j in gear.joints}),
        "alike": [" = ".join(map("#{}".format, pair)) for pair in link_groups(gear) if len(pair) > 1],
        "provenance": provenance_facts(gear, provenance),
        "made_on": provenance.created.date().isoformat(),
        "lengths": lengths,
        "unit": lengths.unit.value,
        "gear": gear,
    }


def _program_and_hashes(p: ReportProvenance) -> str:
    hashes = list(p.input_sha256.values())
    parts = [f"mlg {p.program_version}", f"geometry {digest(p.geometry_sha256, 8)}"]
    if hashes:
        parts.append(f"input {digest(hashes[0], 8)}" if len(hashes) == 1 else f"{len(hashes)} inputs")
    return " · ".join(parts)


def provenance_facts(gear: Gear, provenance: ReportProvenance) -> Facts:
    p = provenance
    found: list[tuple[str, str | None]] = [
        ("Program", f"mlg-troubleshoot {p.program_version}"),
        ("Made at", moment(p.created)),
        ("Gear file", f"{gear.path.name} ({gear.id})"),
        ("Geometry", f"sha256 {p.geometry_sha256}"),
        ("Ensemble", f"{several(len(gear.ensemble), 'geometry', 'geometries')}, sha256 {gear.ensemble_sha256}"),
        ("Sensitivity table", f"sha256 {p.indices_sha256}" if p.indices_sha256 else None),
        *(("Input", f"{name}, sha256 {sha256}") for name, sha256 in p.input_sha256.items()),
        ("Input", None if p.input_sha256 else "prompts or command line"),
        ("Seed", None if p.seed is None else str(p.seed)),
        ("Extension", p.extension or "none"),
        ("Settings", p.remembered),
    ]
    return [(label, value) for label, value in found if value]


def source_counts(gear: Gear) -> str:
    """Say how many numbers behind a prediction come from which kind of source."""
    counts = Counter(n.kind for n in gear.numbers)
    parts = [f"{counts[kind]} {kind.value}" for kind in SourceKind if counts.get(kind)]
    return f"Of {len(gear.numbers)} numbers behind a verdict: {', '.join(parts)}."
