"""The JSON of what is said about a model: a study, a survey, a reconstruction."""

from __future__ import annotations

from typing import Any

import msgspec

from mlg_troubleshoot.indices.given_data import GivenDataResult
from mlg_troubleshoot.output_types import (
    MetTarget,
    ReconstructOutput,
    StudiedAmplification,
    StudiedBound,
    StudiedStatement,
)
from mlg_troubleshoot.outputs import SCHEMA_VERSION
from mlg_troubleshoot.paper.reconstruct import Reconstruction
from mlg_troubleshoot.paper.study import StudyFindings
from mlg_troubleshoot.reporting.json_form import plain, written
from mlg_troubleshoot.surveying.result import SurveyResult


def study_as_json(findings: StudyFindings, given: GivenDataResult | None = None) -> dict[str, Any]:
    """Return the study as plain values, as the JSON contract has it; what is not known is null."""
    result, options = findings.result, findings.options
    growth = result.growth
    values = {
        **msgspec.to_builtins(result.table),
        "directions": str(options.directions),
        "distribution": options.distribution,
        "of": "exceeding the margin" if options.beyond_margin else "displacement",
        "accuracy": options.accuracy,
        "finished": result.finished,
        "note": result.indices.note,
        "mean": result.indices.mean,
        "variance": result.indices.variance,
        "first_order_plain": result.plain,
        "second_order": result.indices.second_order,
        "groups": result.groups,
        "ensemble": [linkage.name for linkage in findings.gear.ensemble],
        "amplification": written(StudiedAmplification, growth, exact_plunger=growth.exact),
        "statements": [written(StudiedStatement, statement) for statement in findings.statements],
        "bounds": [
            written(
                StudiedBound,
                found.proved,
                sense="over-travel" if found.sense > 0 else "under-travel",
                sequential_in=found.sequential_in,
                searched_in=found.searched_in,
                directions_rad=found.proved.directions,
            )
            for found in findings.searches
        ],
    }
    if given is not None:
        found = given.indices
        lists = (found.first_order.tolist(), found.interval.tolist(), found.rows.tolist())
        values["given_data"] = {
            "file": given.file,
            "rows_read": given.rows_read,
            "rows_used": given.rows_used,
            "joints": [
                {"joint": number, "first_order": first, "first_order_interval": ends, "rows": rows}
                for number, first, ends, rows in zip(
                    findings.gear.joint_numbers, *lists, strict=True
                )
            ],
        }
    cleaned: dict[str, Any] = plain(values)
    return cleaned


def survey_as_json(result: SurveyResult) -> dict[str, Any]:
    """Return a survey as plain values, as the JSON contract has it."""
    found, suggestion = result.survey, result.suggestion
    mode = None if found is None else found.modes[0]
    rows = zip(
        result.gear.joints, result.amplification, result.interval, result.before, strict=True
    )
    values: dict[str, Any] = {
        "schema_version": SCHEMA_VERSION,
        "gear_file": None if result.gear_file is None else str(result.gear_file),
        "joints": [
            {
                "joint": joint.number,
                "plunger_amplification": float(a),
                "interval_90": after.tolist(),
                "before": before.tolist(),
            }
            for joint, a, after, before in rows
        ],
        "next": (
            []
            if suggestion is None
            else [
                {
                    "kind": suggestion.reading.kind.value,
                    "from": suggestion.reading.start or None,
                    "to": suggestion.reading.end or None,
                    "extension_in": suggestion.reading.extension,
                    "expected_narrowing": suggestion.narrowing,
                }
            ]
        ),
        "misfits": [
            {
                "row": m.reading.row,
                "value_in": None if m.reading.is_angle else m.reading.value,
                "expected_in": None if m.reading.is_angle else m.expected,
                **({k: m.reading.in_units(v) for k, v in angles} if m.reading.is_angle else {}),
                "suggestion": m.words,
            }
            for m in (() if found is None else found.misfits)
            for angles in [(("value_deg", m.reading.value), ("expected_deg", m.expected))]
        ],
        "chi2": None if mode is None else mode.chi2,
        "degrees_of_freedom": None if found is None else found.degrees_of_freedom,
        "warnings": list(result.warnings),
        "problems": [problem.as_dict() for problem in result.problems],
    }
    if result.inspections:
        values["inspections"] = [
            {
                "record_id": each.record_id,
                "displacement_in": each.displacement_in,
                "interval_90": list(each.interval_in),
                "probability_within_margin": each.probability_within_margin,
            }
            for each in result.inspections
        ]
    return values


def reconstruction_as_json(found: Reconstruction, text: str) -> dict[str, object]:
    return written(
        ReconstructOutput,
        found,
        schema_version=SCHEMA_VERSION,
        linkages_tried=found.evaluations,
        free=found.numbers - found.determined,
        loosest=[{"number": name, "free_part": part} for name, part in found.loosest],
        targets=[
            written(
                MetTarget,
                each,
                quantity=each.target.quantity,
                printed=each.target.printed,
                unit=each.target.unit,
                accepted=each.target.accepted,
            )
            for each in found.met
        ],
        member_toml=text,
    )
