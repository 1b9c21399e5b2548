"""The JSON of what is said about a model: a study, a survey."""

from __future__ import annotations

from typing import Any

import msgspec

from mlg_troubleshoot.json_outputs import (
    StudiedAmplification,
    SurveyedInspection,
    SurveyOutput,
)
from mlg_troubleshoot.paper.study import StudyFindings
from mlg_troubleshoot.reporting.json_form import plain, written
from mlg_troubleshoot.surveying.plan import Suggested
from mlg_troubleshoot.surveying.result import SurveyResult
from mlg_troubleshoot.surveying.survey import Misfit


def study_as_json(findings: StudyFindings) -> dict[str, Any]:
    """Return the study as plain values, as the JSON contract has it; what is not known is null."""
    result = findings.result
    options = findings.options
    growth = result.growth
    values = {
        **msgspec.to_builtins(result.table),
        "directions": str(options.directions),
        "distribution": options.distribution,
        "note": result.indices.note,
        "mean": result.indices.mean,
        "variance": result.indices.variance,
        "first_order_plain": result.plain,
        "groups": result.groups,
        "ensemble": [linkage.name for linkage in findings.gear.ensemble],
        "amplification": written(StudiedAmplification, growth, exact_plunger=growth.exact),
    }
    cleaned: dict[str, Any] = plain(values)
    return cleaned


def survey_as_json(result: SurveyResult) -> dict[str, Any]:
    """Return a survey as plain values, as the JSON contract has it."""
    found = result.survey
    suggestion = result.suggestion
    rows = zip(
        result.gear.joints, result.amplification, result.interval, result.before, strict=True
    )
    values = written(
        SurveyOutput,
        result,
        gear_file=None if result.gear_file is None else str(result.gear_file),
        joints=[
            {
                "joint": joint.number,
                "plunger_amplification": a,
                "interval_90": after,
                "before": before,
            }
            for joint, a, after, before in rows
        ],
        next=[] if suggestion is None else [_next(suggestion)],
        misfits=[] if found is None else [_misfit(each) for each in found.misfits],
        chi2=None if found is None else found.modes[0].chi2,
        degrees_of_freedom=None if found is None else found.degrees_of_freedom,
        problems=[problem.as_dict() for problem in result.problems],
        inspections=[
            written(SurveyedInspection, each, interval_90=each.interval_in)
            for each in result.inspections
        ],
    )
    if not result.inspections:
        del values["inspections"]
    return values


def _next(suggestion: Suggested) -> dict[str, Any]:
    reading = suggestion.reading
    return {
        "kind": reading.kind,
        "from": reading.start or None,
        "to": reading.end or None,
        "extension_in": reading.extension,
        "expected_narrowing": suggestion.narrowing,
    }


def _misfit(misfit: Misfit) -> dict[str, Any]:
    """A reading that does not fit, lengths in inches or angles in degrees."""
    reading = misfit.reading
    ends = {"value": reading.value, "expected": misfit.expected}
    lengths = {f"{k}_in": None if reading.is_angle else v for k, v in ends.items()}
    angles = {f"{k}_deg": reading.in_units(v) for k, v in ends.items() if reading.is_angle}
    return {"row": reading.row, **lengths, **angles, "suggestion": misfit.words}
