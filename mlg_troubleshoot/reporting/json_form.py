"""The JSON contract: judgements and problems as plain values, lengths in inches, numbers not rounded."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import asdict
from typing import Any

from mlg_troubleshoot.decision.assessment import (
    Assessment,
    Confidence,
    Judgement,
    MeasuringAdvice,
    NextAction,
    Posterior,
    Rejected,
    Rigging,
)
from mlg_troubleshoot.errors import Problem
from mlg_troubleshoot.gear.gear import Gear

SCHEMA_VERSION = 1


def check_as_json(
    gear: Gear, judgements: Iterable[Judgement], problems: Sequence[Problem], warnings: Sequence[str]
) -> dict[str, Any]:
    """Return the result of a check in the form of the contract.

    Parameters
    ----------
    gear : Gear
        The gear.
    judgements : iterable of Assessment or Rejected
        One for each data row.
    problems : sequence of Problem
        What is wrong with the input.
    warnings : sequence of str
        Notes on the input as a whole.

    Returns
    -------
    dict
        Values for :func:`json.dumps`.
    """
    return {
        **_head(gear),
        "inspections": [_inspection(j, gear) for j in judgements],
        **_tail(problems, warnings),
    }


def check_json_pieces(
    gear: Gear, judgements: Iterable[Judgement], problems: Sequence[Problem], warnings: Sequence[str]
) -> Iterator[str]:
    """Write the same form as JSON text piece by piece, one inspection a line: a large batch never stands in memory.

    Parameters
    ----------
    gear, judgements, problems, warnings
        As for :func:`check_as_json`.

    Yields
    ------
    str
        The next piece of one JSON document.
    """
    yield _text(_head(gear))[:-1] + ', "inspections": [\n'
    separator = ""
    for judgement in judgements:
        yield separator + _text(_inspection(judgement, gear))
        separator = ",\n"
    yield "\n], " + _text(_tail(problems, warnings))[1:] + "\n"


def _text(value: dict[str, Any]) -> str:
    return json.dumps(value, allow_nan=False, ensure_ascii=False)


def _head(gear: Gear) -> dict[str, Any]:
    return {
        "schema_version": SCHEMA_VERSION,
        "gear": {"id": gear.id, "geometry_sha256": gear.geometry_sha256, "provenance": gear.provenance},
    }


def _tail(problems: Sequence[Problem], warnings: Sequence[str]) -> dict[str, Any]:
    return {"problems": [problem.as_dict() for problem in problems], "warnings": list(warnings)}


def _inspection(judgement: Judgement, gear: Gear) -> dict[str, Any]:
    return _assessment(judgement) if isinstance(judgement, Assessment) else _rejected(judgement, gear)


def _action(action: NextAction) -> dict[str, Any]:
    return {"action": str(action.action), "joints": list(action.joints), "text": action.text}


def _assessment(a: Assessment) -> dict[str, Any]:
    warnings = [*([a.measured_statement] if a.measured_statement else []), *a.warnings]
    return {
        "record_id": a.inspection.record_id,
        "tail_no": a.inspection.tail_no,
        "side": str(a.inspection.side),
        "verdict": str(a.verdict),
        "headline": a.headline,
        "predicted_displacement_in": a.predicted_displacement_in,
        "over_travel_in": a.over_travel_in,
        "under_travel_in": a.under_travel_in,
        "predicted_upper_in": a.predicted_upper_in,
        "margin_in": a.margin_in,
        "remaining_in": a.remaining_in,
        "standard_uncertainty_in": a.standard_uncertainty_in,
        "probability_within_margin": a.probability_within_margin,
        "probability_exceed_random_directions": a.probability_exceed_random_directions,
        "measured_displacement_in": a.inspection.measured_displacement_in,
        "geometry_spread_in": None if a.geometry_spread_in is None else list(a.geometry_spread_in),
        "joints": [
            {
                "joint": f.joint,
                "name": f.name,
                "clearance_in": f.clearance_in,
                "over_limit": f.over_limit,
                "contribution_in": f.contribution_in,
                "first_order": f.first_order,
                "total_order": f.total_order,
                "plunger_amplification": f.plunger_amplification,
                "rank": f.rank,
                "rank_range": list(f.rank_range),
                "acts_like": list(f.alike),
                "allowance_in": f.allowance_in,
            }
            for f in a.joints
        ],
        "next_action": _action(a.next_action),
        "repair_sets": None
        if a.repair_sets is None
        else [
            {
                "joints": list(s.joints),
                "predicted_displacement_in": s.predicted_displacement_in,
                "probability_within_margin": s.probability_within_margin,
                "access_minutes": s.access_minutes,
            }
            for s in a.repair_sets
        ],
        **{key: None if part is None else asdict(part) for key, part in zip(_EXTRA, _parts(a), strict=True)},
        "warnings": warnings,
    }


_EXTRA = ("rigging", "measuring", "confidence", "posterior")


def _parts(a: Assessment) -> tuple[Rigging | None, MeasuringAdvice | None, Confidence | None, Posterior | None]:
    return a.rigging, a.measuring, a.confidence, a.posterior


_NUMBERS = (
    "predicted_displacement_in",
    "over_travel_in",
    "under_travel_in",
    "predicted_upper_in",
    "margin_in",
    "remaining_in",
    "standard_uncertainty_in",
    "probability_within_margin",
    "probability_exceed_random_directions",
    "measured_displacement_in",
    "geometry_spread_in",
)


def _rejected(r: Rejected, gear: Gear) -> dict[str, Any]:
    return {
        "record_id": r.row.record_id,
        "tail_no": r.row.tail_no,
        "side": None if r.row.side is None else str(r.row.side),
        "verdict": str(r.verdict),
        "headline": r.next_action.text,
        **dict.fromkeys(_NUMBERS),
        "joints": [
            {
                "joint": joint.number,
                "name": joint.name,
                **dict.fromkeys(
                    (
                        "clearance_in",
                        "over_limit",
                        "contribution_in",
                        "first_order",
                        "total_order",
                        "plunger_amplification",
                        "rank",
                        "rank_range",
                        "acts_like",
                        "allowance_in",
                    )
                ),
            }
            for joint in gear.joints
        ],
        "next_action": _action(r.next_action),
        "repair_sets": None,
        **dict.fromkeys(_EXTRA),
        "warnings": list(r.warnings),
    }
