"""The JSON of a study."""

from __future__ import annotations

from typing import Any

import msgspec

from mlg_troubleshoot.json_outputs import StudiedAmplification
from mlg_troubleshoot.paper.study import StudyFindings
from mlg_troubleshoot.reporting.json_form import plain, written


def study_as_json(findings: StudyFindings) -> dict[str, Any]:
    """Return the study as plain values, as the JSON contract has it; what is not known is null."""
    growth = findings.growth
    values = {
        **msgspec.to_builtins(findings.table),
        "directions": "worst",
        "distribution": "uniform",
        "note": findings.indices.note,
        "mean": findings.indices.mean,
        "variance": findings.indices.variance,
        "first_order_plain": findings.plain,
        "groups": findings.groups,
        "ensemble": [linkage.name for linkage in findings.gear.ensemble],
        "amplification": written(StudiedAmplification, growth, exact_plunger=growth.exact),
    }
    cleaned: dict[str, Any] = plain(values)
    return cleaned
