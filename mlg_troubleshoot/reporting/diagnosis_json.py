"""The JSON contract of a diagnosis, lengths in inches, numbers not rounded."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from mlg_troubleshoot.diagnosis import Diagnosis, ModelExtension, NamedCause
from mlg_troubleshoot.reporting.json_form import SCHEMA_VERSION


def diagnosis_as_json(diagnosis: Diagnosis, extension: ModelExtension | None) -> dict[str, Any]:
    """Return a diagnosis in the form of the contract.

    Parameters
    ----------
    diagnosis : Diagnosis
        The diagnosis.
    extension : ModelExtension or None
        The extension that follows from it.

    Returns
    -------
    dict
        Values for :func:`json.dumps`.
    """
    d = diagnosis
    return {
        "schema_version": SCHEMA_VERSION,
        "rows": {"read": d.rows_read, "used": d.rows_used, "set_aside": d.rows_read - d.rows_used},
        "data_faults": [
            {
                "row": f.row,
                "record_id": f.record_id,
                "column": f.column,
                "kind": f.kind,
                "value": f.value,
                "suggested": f.suggested,
            }
            for f in d.faults
        ],
        "misfit": {
            "mean_in": d.mean_in,
            "rms_in": d.rms_in,
            "repeatability_in": d.repeatability_in,
            "repeatability_source": d.repeatability_source,
        },
        "verdict": d.verdict,
        "causes": [_cause(c) for c in d.causes],
        "also_possible": [
            {
                "cause": c.candidate.cause.name,
                "target": c.candidate.target,
                "separating_reading": c.candidate.separates,
            }
            for c in d.also_possible
        ],
        "unlisted_variables": list(d.unlisted_variables),
        "not_testable": [{"cause": cause, "missing_column": column} for cause, column in d.not_testable],
        "ruled_out": [{"cause": cause, "target": target} for cause, target in d.ruled_out],
        "smallest_detectable_rms_in": d.smallest_rms_in,
        "extension": None if extension is None else _extension(extension),
        "gain": _gain(d),
        "remainder": {
            "p_value": d.remainder_p,
            "looks_like_noise": d.remainder_is_noise,
            "rms_in": d.residual_u_in,
            "expected_from_gauges_in": d.expected_scatter_in,
        },
        "seed": d.seed,
        "permutations": d.permutations,
    }


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None


def _cause(c: NamedCause) -> dict[str, Any]:
    return {
        "cause": c.candidate.cause.name,
        "target": c.candidate.target,
        "effect_rms_in": c.effect_rms_in,
        "p_value": c.p_value,
        "parameters": {k: _finite(v) if isinstance(v, float) else v for k, v in c.parameters.items()},
        "interval_95": {k: [_finite(low), _finite(high)] for k, (low, high) in c.interval_shown.items()},
    }


def _extension(extension: ModelExtension) -> dict[str, Any]:
    return {
        "geometry_sha256": extension.gear.geometry_sha256,
        "data_sha256": list(extension.data_sha256),
        "residual_u_in": extension.residual_u_in,
        "terms": [
            {
                "cause": t.candidate.cause.name,
                "target": t.candidate.target,
                "parameter": t.candidate.cause.parameter,
                "value": t.value,
                "interval_95": list(t.interval),
            }
            for t in extension.terms
        ],
    }


def _gain(d: Diagnosis) -> dict[str, Any]:
    g = d.gain
    if g is None:
        return _no_gain(d)
    return {
        "held_out_rms_before_in": g.rms_before_in,
        "held_out_rms_after_in": g.rms_after_in,
        "share_removed_interval_95": list(g.share_interval),
        "held_out_by": g.held_out_by,
        "false_within_before": g.false_within_before,
        "false_within_after": g.false_within_after,
        "false_outside_before": g.false_outside_before,
        "false_outside_after": g.false_outside_after,
        "verdicts_changed": list(g.verdicts_changed),
    }


def _no_gain(d: Diagnosis) -> dict[str, Any]:
    """The model is not extended: everything after is as before."""
    outside = np.abs(d.used.measured_in) > d.used.margin_in
    said_within = np.abs(d.predicted_in) <= d.used.margin_in
    rms = float(np.sqrt(np.mean(d.misfit_in**2)))
    false_within, false_outside = int(np.sum(said_within & outside)), int(np.sum(~said_within & ~outside))
    return {
        "held_out_rms_before_in": rms,
        "held_out_rms_after_in": rms,
        "share_removed_interval_95": [0.0, 0.0],
        "held_out_by": None,
        "false_within_before": false_within,
        "false_within_after": false_within,
        "false_outside_before": false_outside,
        "false_outside_after": false_outside,
        "verdicts_changed": [],
    }
