"""What the report of a diagnosis is made from; its tables and most of its sentences stand in the
template.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from markupsafe import Markup

from mlg_troubleshoot.decision.columns import TAIL_NO
from mlg_troubleshoot.diagnosis import CATALOGUE, Diagnosis, ModelExtension
from mlg_troubleshoot.errors import Problem
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.reporting import diagnosis_figures as drawn
from mlg_troubleshoot.reporting.diagnosis_figures import (
    FittedRows,
    ResidualAxis,
    cause_words,
    column_words,
    fitted_numbers,
    headline,
    kind_words,
    name_words,
    seven_lines,
)
from mlg_troubleshoot.reporting.figures import Lengths, short
from mlg_troubleshoot.reporting.html import Document, ReportProvenance, head
from mlg_troubleshoot.reporting.publish import safe_stem
from mlg_troubleshoot.units import LengthUnit

_WORDS = {
    "NAMED": ("CAUSE NAMED", "outside-margin"),
    "AMBIGUOUS": ("CANNOT BE DISTINGUISHED", "inconclusive"),
    "UNLISTED": ("REAL, BUT NOT ON THE LIST", "inconclusive"),
    "NONE": ("NOTHING FOUND", "within-margin"),
}
# What a page has room for: panels of rivals, and causes ruled out.
_MOST_PANELS = 2
_MOST_RULED_OUT = 14

PlotPair = tuple[Markup, Markup | None, str]


def diagnosis_document(
    d: Diagnosis,
    gear: Gear,
    provenance: ReportProvenance,
    extension: ModelExtension | None,
    unit: LengthUnit = LengthUnit.INCH,
    problems: Iterable[Problem] = (),
    notes: Iterable[str] = (),
) -> Document:
    context = _context(d, gear, extension, provenance, Lengths(unit))
    stem = safe_stem("diagnosis", *(Path(name).stem for name in provenance.input_sha256))
    return Document(
        "diagnosis.html.j2",
        {**context, "problems": list(problems), "notes": [*d.unsaid, *notes]},
        stem,
    )


def _context(
    d: Diagnosis,
    gear: Gear,
    extension: ModelExtension | None,
    provenance: ReportProvenance,
    lengths: Lengths,
) -> dict[str, Any]:
    source = ", ".join(Path(name).name for name in provenance.input_sha256) or "inspections"
    rows = drawn.rows_of(d, lengths.unit)
    axes = drawn.axes_of(d, gear.joint_numbers, lengths.unit)
    words, tone = _WORDS[d.verdict]
    if d.verdict == "UNLISTED" and d.p_nothing > 1.0 - d.beliefs.sure:
        words = "PERHAPS SOMETHING NOT ON THE LIST"
    return {
        **head(
            f"Measured against predicted – {source}",
            f"Diagnosis · {short(source, 40)}",
            gear,
            provenance,
            lengths,
        ),
        "source": source,
        "d": d,
        "days": _days(d),
        "g": d.gain,
        "words": words,
        "tone": tone,
        "headline": headline(d, lengths.unit),
        "action": seven_lines(d, lengths.unit)[-1].text,
        "likely": [
            (name_words(cause), target, chance)
            for (cause, target), chance in d.probabilities.items()
            if chance >= drawn.LEAST_SAID
        ],
        "plots": _plots(d, rows, axes, lengths.unit),
        "scatter": drawn.measured_against_predicted(rows),
        "strips": drawn.tail_strips(rows, d.used.tails),
        "by_column": [
            _before_and_after(rows, axis)
            for name, axis in axes.items()
            if name not in ("predicted", TAIL_NO.variable) and _varies(axis)
        ],
        "tails": len(np.unique(d.used.tails)),
        "most_tails": drawn.MOST_TAILS,
        "model": fitted_numbers(d, lengths),
        "catalogue": {cause.name: cause for cause in CATALOGUE},
        "most_ruled_out": _MOST_RULED_OUT,
        "kind_words": kind_words,
        "places": {record: place for place, record in enumerate(d.used.record_id)},
        "effect_in": drawn.effect_of(d),
        "extension": extension,
    }


def _days(d: Diagnosis) -> int | None:
    days = d.used.quantities.get("day")
    if d.used.first_day is None or days is None or not np.isfinite(days).any():
        return None
    return int(np.nanmax(days) - np.nanmin(days))


def _varies(axis: ResidualAxis) -> bool:
    return len(np.unique(axis.values[np.isfinite(axis.values)])) > 1


def _before_and_after(rows: FittedRows, axis: ResidualAxis) -> tuple[Markup, Markup | None]:
    """Plots against a column, before and, where the model was extended, after."""
    after = drawn.residual_plot(rows, axis, rows.fit, after=True) if rows.fit else None
    return drawn.residual_plot(rows, axis, "before"), after


def _plots(
    d: Diagnosis, rows: FittedRows, axes: Mapping[str, ResidualAxis], unit: LengthUnit
) -> list[PlotPair]:
    """Pairs of plots of residuals, each with what it shows: before and after, two rivals, or two
    columns.
    """
    if d.causes:
        columns = [drawn.against_cause(d, axes, cause.candidate, unit) for cause in d.causes]
        return [
            (*_before_and_after(rows, column), cause_words(cause))
            for column, cause in zip(columns, d.causes, strict=True)
        ]
    scatter = drawn.measured_against_predicted(rows)
    if d.verdict == "AMBIGUOUS":
        panels = [
            drawn.residual_plot(
                rows,
                drawn.against_cause(d, axes, c.candidate, unit),
                f"{name_words(c.candidate.cause.name)} {c.candidate.target or ''}".strip(),
            )
            for c in d.also_possible[:_MOST_PANELS]
        ]
        left, right, *_ = (*panels, scatter)
        return [(left, right, "What the data cannot distinguish")]
    if not d.unlisted_variables:
        left = drawn.residual_plot(rows, axes["predicted"], "")
        return [(left, scatter, "Against the prediction")]
    moving = [(name, axes.get(name, axes["predicted"])) for name in d.unlisted_variables]
    # A number makes the better axis, a name the better way to split.
    (_, first), *others = sorted(moving, key=lambda each: bool(each[1].names))
    caption = f"Moves with {' and '.join(map(column_words, d.unlisted_variables))}"
    split = drawn.split_by(*others[0], first, rows.left(after=False)) if others else None
    if split is None:
        return [(drawn.residual_plot(rows, first, ""), scatter, caption)]
    own, these, rest = split
    left = drawn.residual_plot(rows, first, these, only=own)
    return [(left, drawn.residual_plot(rows, first, rest, only=~own), caption)]
