"""The JSON contracts of a check and a diagnosis: lengths in inches, numbers not rounded, null where
not known.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from datetime import date
from operator import attrgetter
from typing import TYPE_CHECKING, Any, cast

import msgspec
import numpy as np

from mlg_troubleshoot.decision.assessment import Assessment, JointFinding, Judgement
from mlg_troubleshoot.errors import Problem
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.json_outputs import (
    CheckedInspection,
    CheckedJoint,
    CheckOutput,
    ConditionOfData,
    DiagnoseOutput,
    ExtensionGain,
    FittedExtension,
    GearIdentity,
    GearOutput,
    MisfitSize,
    NamedCauseOutput,
    NextOutcome,
    ShownJoint,
    SuspectCell,
)
from mlg_troubleshoot.outputs import SCHEMA_VERSION

if TYPE_CHECKING:
    from mlg_troubleshoot.diagnosis import Diagnosis, ModelExtension, NamedCause

_JOINT = tuple(CheckedJoint.__annotations__)
_OF_JOINT = attrgetter(*_JOINT[:-1], "alike")


def plain(value: Any) -> Any:
    """Return a value as JSON can hold it: records as objects, arrays as lists, names as text, and
    null for what is not a finite number.
    """
    return msgspec.json.decode(msgspec.json.encode(value, enc_hook=_parts))


def as_text(value: Any) -> str:
    """Write a value as JSON: what `plain` makes of it, twice as fast."""
    parts = msgspec.to_builtins(value, enc_hook=_parts)
    try:
        return _ENCODED(parts)
    except ValueError:
        return _ENCODED(plain(parts))


def _parts(value: Any) -> Any:
    """What a value consists of that the encoder does not know."""
    if isinstance(value, np.generic | np.ndarray):
        return value.tolist()
    if isinstance(value, str):
        return str(value)
    return dict(value) if isinstance(value, Mapping) else list(value)


_ENCODED = json.JSONEncoder(allow_nan=False, check_circular=False).encode


def written(kind: Any, *records: Any, **given: Any) -> dict[str, Any]:
    """Return records in the form of an output: each key as it is given, or as the first record has
    it that does. The version of the schema stands in every output that has one.
    """
    return cast("dict[str, Any]", plain(filled(kind, *records, **given)))


def filled(kind: Any, *records: Any, **given: Any) -> dict[str, Any]:
    """The same with values as they stand, for a part of an output."""
    known = {"schema_version": SCHEMA_VERSION, **given}
    return {
        n: known[n] if n in known else next(getattr(r, n) for r in records if hasattr(r, n))
        for n in kind.__annotations__
    }


def check_as_json(
    gear: Gear,
    judgements: Iterable[Judgement],
    problems: Sequence[Problem],
    warnings: Sequence[str],
) -> dict[str, Any]:
    return written(
        CheckOutput,
        gear=filled(GearIdentity, gear),
        inspections=[_inspection(judgement, gear) for judgement in judgements],
        problems=problems,
        warnings=warnings,
    )


class CheckText:
    """The same form as JSON text, block by block, one inspection per line: a large batch never
    stands in memory. `begin`, the lines of each block, `end`.
    """

    def __init__(self, gear: Gear, problems: Sequence[Problem], warnings: Sequence[str]) -> None:
        whole = as_text(check_as_json(gear, (), problems, warnings))
        head, none, tail = whole.partition('"inspections": []')
        self.begin = head + none[:-1] + "\n"
        self.end = f"\n]{tail}\n"
        self._joint = ""

    def joined(self, lines: str) -> str:
        """The lines of a block as they go on after the block before."""
        joint, self._joint = self._joint, ",\n"
        return joint + lines


def inspection_lines(gear: Gear, judgements: Iterable[Judgement]) -> str:
    return ",\n".join(as_text(_inspection(judgement, gear)) for judgement in judgements)


def _inspection(judgement: Judgement, gear: Gear) -> dict[str, Any]:
    """One row of the input; of a row that cannot be judged every number is null."""
    if isinstance(judgement, Assessment):
        return _assessment(judgement)
    unknown = dict.fromkeys(_JOINT)
    return {
        **dict.fromkeys(CheckedInspection.__annotations__),
        **_course(judgement.row, judgement),
        "joints": [{**unknown, "joint": joint.number, "name": joint.name} for joint in gear.joints],
        "warnings": list(judgement.warnings),
    }


def gear_as_json(gear: Gear) -> dict[str, Any]:
    return written(
        GearOutput,
        gear,
        ensemble=[linkage.name for linkage in gear.ensemble],
        calibration_rate=gear.model.rate,
        release_stroke_in=gear.reference.stroke[1],
        joints=[
            written(ShownJoint, joint, joint=joint.number, acts_like=gear.alike[joint.number])
            for joint in gear.joints
        ],
        points={
            point.name: {"plane": point.plane, "at_in": [point.x, point.y], "fixed": point.fixed}
            for point in gear.reference.mechanism.points
        },
    )


def assessment_as_json(a: Assessment) -> dict[str, Any]:
    """One gear of a check."""
    return cast("dict[str, Any]", plain(_assessment(a)))


def _assessment(a: Assessment) -> dict[str, Any]:
    """One gear of a check."""
    own = {
        "measured_displacement_in": a.inspection.measured_displacement_in,
        "joints": [_joint(finding) for finding in a.joints],
    }
    return filled(CheckedInspection, a, **_course(a.inspection, a), **own)


def _day(moment: date | None) -> str | None:
    return None if moment is None else moment.isoformat()[:10]


def _course(row: Any, judgement: Judgement) -> dict[str, Any]:
    """Whose row it is, its verdict and what to do next."""
    steps = judgement.plan.steps
    return {
        **{name: getattr(row, name) for name in ("record_id", "tail_no", "side")},
        "outcome": getattr(row, "outcome", None),
        "inspection_date": _day(getattr(row, "inspection_date", None)),
        "gear_landings": getattr(row, "gear_landings", None),
        "verdict": judgement.verdict,
        "headline": judgement.headline,
        "next_action": steps[0],
        "in_brief": judgement.in_brief,
        "then": [filled(NextOutcome, case, **{"if": case.outcome}) for case in judgement.plan.then],
        "plan": steps,
        "end": judgement.end,
        "open_question": judgement.plan.open_question,
    }


def _joint(finding: JointFinding) -> dict[str, Any]:
    return dict(zip(_JOINT, _OF_JOINT(finding), strict=True))


def diagnosis_as_json(
    diagnosis: Diagnosis, extension: ModelExtension | None, warnings: Sequence[str] = ()
) -> dict[str, Any]:
    d = diagnosis
    return written(
        DiagnoseOutput,
        d,
        rows={"read": d.rows_read, "used": d.rows_used, "set_aside": d.rows_read - d.rows_used},
        data_faults=[written(SuspectCell, fault) for fault in d.faults],
        misfit=written(MisfitSize, d),
        causes=[_cause(c) for c in d.causes],
        also_possible=[_rival(c) for c in d.also_possible],
        beside=[_rival(c) for c in d.beside],
        sure=d.beliefs.sure,
        not_testable=[
            {"cause": cause, "missing_column": column} for cause, column in d.not_testable
        ],
        cannot_say=d.unsaid,
        ruled_out=[{"cause": cause, "target": target} for cause, target in d.ruled_out],
        columns_used=d.used.columns,
        columns_left_out=[{"column": name, "why": why} for name, why in d.used.left_out],
        smallest_detectable_rms_in=d.detectable[0][1] if d.detectable else None,
        detectable=[{"cause": name, "rms_in": size} for name, size in d.detectable],
        extension=None if extension is None else _extension(extension),
        gain=_gain(d),
        data_condition=[written(ConditionOfData, c) for c in d.condition],
        remainder={
            "p_value": d.remainder_p,
            "p_something_else": d.p_left,
            "looks_like_noise": d.remainder_is_noise,
            "rms_in": d.residual_u_in,
            "expected_from_gauges_in": d.expected_scatter_in,
            "rows_far_off": [
                {"record_id": d.used.record_id[place], "residual_in": left}
                for place, left in d.far_off_in.items()
            ],
        },
        warnings=warnings,
    )


def _named(candidate: Any) -> dict[str, Any]:
    name = {"cause": candidate.cause.name, "target": candidate.target}
    return {**name, "sentence": candidate.cause.words(candidate.target)}


def _possible(candidate: Any) -> dict[str, Any]:
    return {**_named(candidate), "separating_reading": candidate.separates}


def _rival(c: NamedCause) -> dict[str, Any]:
    return {
        **_possible(c.candidate),
        "probability": plain(c.probability),
        "class_probability": plain(c.class_probability),
    }


def _cause(c: NamedCause) -> dict[str, Any]:
    return written(NamedCauseOutput, c, **_named(c.candidate), interval_95=c.interval_shown)


def _extension(extension: ModelExtension) -> dict[str, Any]:
    terms = [
        {
            **_named(t.candidate),
            "parameter": t.candidate.cause.parameter,
            "value": t.value,
            "interval_95": t.interval,
        }
        for t in extension.terms
    ]
    sha256 = extension.gear.geometry_sha256
    return written(FittedExtension, extension, geometry_sha256=sha256, terms=terms)


def _gain(d: Diagnosis) -> dict[str, Any]:
    """What the extension gains; where the model is not extended, everything after is as before."""
    if d.gain is not None:
        return written(
            ExtensionGain,
            d.gain,
            held_out_rms_before_in=d.gain.rms_before_in,
            held_out_rms_after_in=d.gain.rms_after_in,
            share_removed_interval_95=d.gain.share_interval,
        )
    outside = np.abs(d.used.measured_in) > d.used.margin_in
    said_within = np.abs(d.predicted_in) <= d.used.margin_in
    rms = float(np.sqrt(np.mean(d.misfit_in**2)))
    within = int(np.sum(said_within & outside))
    beyond = int(np.sum(~said_within & ~outside))
    return {
        "held_out_rms_before_in": rms,
        "held_out_rms_after_in": rms,
        "share_removed_interval_95": [0.0, 0.0],
        "held_out_by": None,
        "false_within_before": within,
        "false_within_after": within,
        "false_outside_before": beyond,
        "false_outside_after": beyond,
        "verdicts_changed": [],
    }
