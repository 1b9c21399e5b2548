"""What the report of a diagnosis is made from; its tables and most of its sentences stand in the
template.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
from markupsafe import Markup

from mlg_troubleshoot.diagnosis import CATALOGUE, Diagnosis, ModelExtension
from mlg_troubleshoot.errors import Problem
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.reporting import diagnosis_figures as drawn
from mlg_troubleshoot.reporting.diagnosis_figures import (
    Residuals,
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
# What a page has room for: panels of rivals and causes ruled out; what is less likely than this is
# not listed. [1]
_MOST_PANELS = 2
_MOST_RULED_OUT = 14
_LEAST_LIKELY = 0.005

PlotPair = tuple[Markup, Markup, str]


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
    residuals = Residuals(d, gear.joint_numbers, lengths.unit)
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
            if chance >= _LEAST_LIKELY
        ],
        "plots": _plots(residuals),
        "scatter": drawn.measured_against_predicted(residuals.rows),
        "strips": drawn.tail_strips(residuals),
        "by_column": _against_each(residuals),
        "tails": len(np.unique(d.used.tails)),
        "most_tails": drawn.MOST_TAILS,
        "model": fitted_numbers(d, lengths),
        "catalogue": {cause.name: cause for cause in CATALOGUE},
        "most_ruled_out": _MOST_RULED_OUT,
        "kind_words": kind_words,
        "places": {record: place for place, record in enumerate(d.used.record_id)},
        "effect_in": residuals.effect_in,
        "extension": extension,
    }


def _days(d: Diagnosis) -> int | None:
    days = d.used.quantities.get("day")
    if d.used.first_day is None or days is None or not np.isfinite(days).any():
        return None
    return int(np.nanmax(days) - np.nanmin(days))


def _plots(residuals: Residuals) -> list[PlotPair]:
    """Pairs of plots of residuals, each with what it shows: before and after, two rivals, or two
    columns.
    """
    d = residuals.diagnosis
    if d.causes:
        pairs = []
        for cause in d.causes:
            column = drawn.against_cause(residuals, cause.candidate)
            left = drawn.residual_plot(residuals.rows, column, "before")
            right = drawn.residual_plot(residuals.rows, column, "with the extension", after=True)
            pairs.append((left, right, cause_words(cause)))
        return pairs
    scatter = drawn.measured_against_predicted(residuals.rows)
    if d.verdict == "AMBIGUOUS":
        panels = [
            drawn.residual_plot(
                residuals.rows,
                drawn.against_cause(residuals, c.candidate),
                f"{name_words(c.candidate.cause.name)} {c.candidate.target or ''}".strip(),
            )
            for c in d.also_possible[:_MOST_PANELS]
        ]
        return [
            (
                panels[0],
                panels[1] if len(panels) > 1 else scatter,
                "What the data cannot distinguish",
            )
        ]
    if d.unlisted_variables:
        return [_unlisted_plots(residuals, d.unlisted_variables, scatter)]
    left = drawn.residual_plot(residuals.rows, drawn.against_column(residuals, "predicted"), "")
    return [(left, scatter, "Against the prediction")]


def _against_each(residuals: Residuals) -> list[tuple[Markup, Markup | None]]:
    """Plots against each column that varies, before and, where the model was extended, after."""
    d = residuals.diagnosis
    axes = [drawn.against_column(residuals, name) for name in residuals.covariates]

    def varies(axis: drawn.ResidualAxis) -> bool:
        known = axis.values[np.isfinite(axis.values)]
        return len(np.unique(known)) > 1

    return [
        (
            drawn.residual_plot(residuals.rows, axis, "before"),
            drawn.residual_plot(residuals.rows, axis, "with the extension", after=True)
            if d.causes
            else None,
        )
        for axis in filter(varies, axes)
    ]


def _unlisted_plots(residuals: Residuals, variables: tuple[str, ...], scatter: Markup) -> PlotPair:
    """Plots against the variables of an unlisted effect; of two, the rows split by the second
    one.
    """
    columns = [drawn.against_column(residuals, name) for name in variables]
    caption = f"Moves with {' and '.join(column_words(name) for name in variables)}"
    # A number makes the better axis, a name the better way to split.
    first = int(len(columns) > 1 and bool(columns[0].names) and not columns[1].names)
    split = None
    if len(columns) > 1:
        split = drawn.split_by(residuals, variables[1 - first], columns[first])
    if split is None:
        return drawn.residual_plot(residuals.rows, columns[0], ""), scatter, caption
    rows, these, others = split
    return (
        drawn.residual_plot(residuals.rows, columns[first], these, only=rows),
        drawn.residual_plot(residuals.rows, columns[first], others, only=~rows),
        caption,
    )
