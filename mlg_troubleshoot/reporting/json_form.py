"""The JSON contracts of a check and a diagnosis: lengths in inches, numbers not rounded, null where
not known.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import fields, is_dataclass
from enum import Enum
from functools import cache
from operator import attrgetter
from typing import Any

import numpy as np

from mlg_troubleshoot.decision.assessment import Assessment, JointFinding, Judgement
from mlg_troubleshoot.diagnosis import Diagnosis, ModelExtension, NamedCause
from mlg_troubleshoot.errors import Problem
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.schemas import SCHEMA_VERSION

_AS_THEY_ARE = frozenset((str, int, bool, type(None)))
_SINGLE = (Enum, np.generic)
_NUMBERS = (
    *(
        "predicted_displacement_in",
        "over_travel_in",
        "under_travel_in",
        "predicted_upper_in",
        "bound_in",
    ),
    *(
        "margin_in",
        "remaining_in",
        "standard_uncertainty_in",
        "probability_within_margin",
        "probability_exceed_random_directions",
    ),
    *("geometry_spread_in", "explained_at_most_in", "unexplained_in"),
)
_JOINT = (
    *(
        "joint",
        "name",
        "clearance_in",
        "over_limit",
        "contribution_in",
        "first_order",
        "total_order",
    ),
    *("plunger_amplification", "rank", "rank_range", "allowance_in"),
)
_OF_JOINT = attrgetter(*_JOINT)
# What the geometry says of a joint of every gear, and so is not kept with each assessment.
_KEPT = tuple(
    name
    for name in _JOINT
    if name not in ("name", "first_order", "total_order", "plunger_amplification")
)
_KEPT_OF_JOINT = attrgetter(*_KEPT)
_PARTS = ("repair_sets", "rigging", "measuring", "confidence", "posterior")


def plain(value: Any) -> Any:
    """Return a value as JSON can hold it: records as objects, arrays as lists, names as text,
    nothing but numbers.
    """
    kind = value.__class__
    if kind is float:
        return value if math.isfinite(value) else None
    if kind in _AS_THEY_ARE:
        return value
    names = _field_names(kind)
    if names:
        return chosen(value, *names)
    if isinstance(value, _SINGLE):
        return value.value if isinstance(value, Enum) else plain(value.item())
    if isinstance(value, Mapping):
        return {str(key): plain(each) for key, each in value.items()}
    return [plain(each) for each in (value.tolist() if isinstance(value, np.ndarray) else value)]


@cache
def _field_names(kind: type) -> tuple[str, ...]:
    return tuple(field.name for field in fields(kind)) if is_dataclass(kind) else ()


def chosen(record: Any, *names: str) -> dict[str, Any]:
    return {name: plain(getattr(record, name)) for name in names}


def check_as_json(
    gear: Gear,
    judgements: Iterable[Judgement],
    problems: Sequence[Problem],
    warnings: Sequence[str],
    seed: int = 1,
) -> dict[str, Any]:
    return {
        **_head(gear, seed),
        "inspections": [_inspection(j, gear) for j in judgements],
        **_tail(problems, warnings),
    }


def kept_as_json(assessment: Assessment) -> dict[str, Any]:
    """An assessment as a store keeps it: as in the form of a check, without what the geometry's
    hash says already.
    """
    joints = [
        dict(zip(_KEPT, map(plain, _KEPT_OF_JOINT(finding)), strict=True))
        for finding in assessment.joints
    ]
    return _assessment(assessment, joints)


def check_json_pieces(
    gear: Gear,
    judgements: Iterable[Judgement],
    problems: Sequence[Problem],
    warnings: Sequence[str],
    seed: int = 1,
) -> Iterator[str]:
    """Write the same form as JSON text piece by piece, one inspection a line: a large batch never
    stands in memory.
    """
    yield _text(_head(gear, seed))[:-1] + ', "inspections": [\n'
    separator = ""
    for judgement in judgements:
        yield separator + _text(_inspection(judgement, gear))
        separator = ",\n"
    yield "\n], " + _text(_tail(problems, warnings))[1:] + "\n"


def _text(value: dict[str, Any]) -> str:
    return json.dumps(value, allow_nan=False, ensure_ascii=False)


def _head(gear: Gear, seed: int) -> dict[str, Any]:
    return {
        "schema_version": SCHEMA_VERSION,
        "seed": seed,
        "gear": chosen(gear, "id", "geometry_sha256", "provenance"),
    }


def _tail(problems: Sequence[Problem], warnings: Sequence[str]) -> dict[str, Any]:
    return {"problems": [problem.as_dict() for problem in problems], "warnings": list(warnings)}


def _inspection(judgement: Judgement, gear: Gear) -> dict[str, Any]:
    """One row of the input; of a row that cannot be judged every number is null."""
    if isinstance(judgement, Assessment):
        return _assessment(judgement, [_joint(finding) for finding in judgement.joints])
    unknown: dict[str, None] = dict.fromkeys((*_JOINT[2:], "acts_like"))
    return {
        **_identity(judgement.row, judgement, judgement.next_action.text),
        **dict.fromkeys((*_NUMBERS, "measured_displacement_in")),
        "joints": [{"joint": joint.number, "name": joint.name, **unknown} for joint in gear.joints],
        "basis": None,
        **_course(judgement),
        **dict.fromkeys(_PARTS),
        "warnings": list(judgement.warnings),
    }


def _assessment(a: Assessment, joints: list[dict[str, Any]]) -> dict[str, Any]:
    said = [a.measured_statement] if a.measured_statement else []
    return {
        **_identity(a.inspection, a, a.headline),
        **chosen(a, *_NUMBERS),
        "measured_displacement_in": a.inspection.measured_displacement_in,
        "joints": joints,
        "basis": a.basis.value,
        **_course(a),
        **chosen(a, *_PARTS),
        "warnings": [*said, *a.warnings],
    }


def _identity(row: Any, judgement: Judgement, headline: str) -> dict[str, Any]:
    return {
        **chosen(row, "record_id", "tail_no", "side"),
        "verdict": judgement.verdict.value,
        "headline": headline,
    }


def _joint(finding: JointFinding) -> dict[str, Any]:
    return {
        **dict(zip(_JOINT, map(plain, _OF_JOINT(finding)), strict=True)),
        "acts_like": list(finding.alike),
    }


def _course(judgement: Judgement) -> dict[str, Any]:
    steps = plain(judgement.plan.steps)
    return {
        "next_action": steps[0],
        "plan": steps,
        "end": judgement.end.value,
        "open_question": judgement.plan.open_question,
    }


def diagnosis_as_json(
    diagnosis: Diagnosis, extension: ModelExtension | None, warnings: Sequence[str] = ()
) -> dict[str, Any]:
    d = diagnosis
    return {
        "schema_version": SCHEMA_VERSION,
        "rows": {"read": d.rows_read, "used": d.rows_used, "set_aside": d.rows_read - d.rows_used},
        "data_faults": [
            chosen(f, "row", "record_id", "column", "kind", "value", "suggested") for f in d.faults
        ],
        "misfit": chosen(d, "mean_in", "rms_in", "repeatability_in", "repeatability_source"),
        "verdict": d.verdict,
        "causes": [_cause(c) for c in d.causes],
        "also_possible": [_possible(c.candidate) for c in d.also_possible],
        "beside": [_possible(c.candidate) for c in d.beside],
        "unlisted_variables": list(d.unlisted_variables),
        "not_testable": [
            {"cause": cause, "missing_column": column} for cause, column in d.not_testable
        ],
        "cannot_say": list(d.unsaid),
        "ruled_out": [{"cause": cause, "target": target} for cause, target in d.ruled_out],
        "smallest_detectable_rms_in": plain(d.smallest_rms_in),
        "extension": None if extension is None else _extension(extension),
        "gain": _gain(d),
        "remainder": {
            "p_value": plain(d.remainder_p),
            "looks_like_noise": plain(d.remainder_is_noise),
            "rms_in": plain(d.residual_u_in),
            "expected_from_gauges_in": plain(d.expected_scatter_in),
        },
        **chosen(d, "seed", "permutations"),
        "warnings": list(warnings),
    }


def _named(candidate: Any) -> dict[str, Any]:
    return {"cause": candidate.cause.name, "target": candidate.target}


def _possible(candidate: Any) -> dict[str, Any]:
    return {**_named(candidate), "separating_reading": candidate.separates}


def _cause(c: NamedCause) -> dict[str, Any]:
    return {
        **_named(c.candidate),
        **chosen(c, "effect_rms_in", "p_value", "parameters"),
        "interval_95": plain(c.interval_shown),
        "aliases": [_possible(candidate) for candidate in c.aliases],
    }


def _extension(extension: ModelExtension) -> dict[str, Any]:
    return {
        "geometry_sha256": extension.gear.geometry_sha256,
        **chosen(extension, "data_sha256", "residual_u_in"),
        "terms": [
            {
                **_named(t.candidate),
                "parameter": t.candidate.cause.parameter,
                "value": plain(t.value),
                "interval_95": plain(t.interval),
            }
            for t in extension.terms
        ],
    }


def _gain(d: Diagnosis) -> dict[str, Any]:
    """What the extension gains; where the model is not extended, everything after is as before."""
    counts = (
        "false_within_before",
        "false_within_after",
        "false_outside_before",
        "false_outside_after",
    )
    if d.gain is not None:
        g = d.gain
        return {
            "held_out_rms_before_in": g.rms_before_in,
            "held_out_rms_after_in": g.rms_after_in,
            "share_removed_interval_95": plain(g.share_interval),
            **chosen(g, "held_out_by", *counts, "verdicts_changed"),
        }
    outside = np.abs(d.used.measured_in) > d.used.margin_in
    said_within = np.abs(d.predicted_in) <= d.used.margin_in
    rms = float(np.sqrt(np.mean(d.misfit_in**2)))
    within, beyond = int(np.sum(said_within & outside)), int(np.sum(~said_within & ~outside))
    return {
        "held_out_rms_before_in": rms,
        "held_out_rms_after_in": rms,
        "share_removed_interval_95": [0.0, 0.0],
        "held_out_by": None,
        **dict(zip(counts, (within, within, beyond, beyond), strict=True)),
        "verdicts_changed": [],
    }
