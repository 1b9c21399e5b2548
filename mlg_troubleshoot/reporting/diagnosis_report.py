"""The report of a diagnosis: verdict, seven lines, residuals before and after, rivals, faults, gain, what to do."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TypedDict

import numpy as np
from markupsafe import Markup

from mlg_troubleshoot.diagnosis import CATALOGUE, Diagnosis, ModelExtension, NamedCause
from mlg_troubleshoot.errors import Problem
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.reporting import diagnosis_figures as drawn
from mlg_troubleshoot.reporting.context import (
    DISCLAIMER,
    DocumentContext,
    Fact,
    KeyFigure,
    ProblemRow,
    VerdictContext,
    footer_middle,
    problem_row,
    provenance_facts,
    source_counts,
)
from mlg_troubleshoot.reporting.diagnosis_figures import Residuals
from mlg_troubleshoot.reporting.diagnosis_lines import (
    Line,
    cause_words,
    chance_words,
    column_words,
    fitted_numbers,
    kind_words,
    seven_lines,
    what_to_do,
)
from mlg_troubleshoot.reporting.formats import ABSENT, inches, millimetres, number, percent, several
from mlg_troubleshoot.reporting.html import Document
from mlg_troubleshoot.reporting.provenance import ReportProvenance
from mlg_troubleshoot.reporting.publish import USUAL_FORMATS, WrittenReport, publish, safe_stem

_WORDS = {
    "NAMED": "CAUSE NAMED",
    "AMBIGUOUS": "CANNOT BE TOLD APART",
    "UNLISTED": "REAL, BUT NOT ON THE LIST",
    "NONE": "NOTHING FOUND",
}
_TONE = {"NAMED": "outside-margin", "AMBIGUOUS": "inconclusive", "UNLISTED": "inconclusive", "NONE": "within-margin"}
_MOST_PANELS = 2
_MOST_RULED_OUT = 14
_MOST_CHANGES = 40


class PlotPair(TypedDict):
    """Two plots side by side: before and after, or two columns."""

    left: Markup
    right: Markup
    caption: str


class RivalRow(TypedDict):
    """One cause and how it stands."""

    state: str
    tone: str
    cause: str
    target: str
    meaning: str


class FaultRow(TypedDict):
    """One cell that is most likely wrong."""

    row: str
    record: str
    column: str
    value: str
    suggested: str
    kind: str


class GainRow(TypedDict):
    """One figure before and with the extension."""

    label: str
    before: str
    after: str


class ChangeRow(TypedDict):
    """One inspection whose predicted side of the margin changes."""

    record: str
    gear: str
    margin: str
    before: str
    after: str
    measured: str
    right: str


class DoRow(TypedDict):
    """What to do about one cause, and the reading that would change the verdict."""

    cause: str
    inspect: str
    separates: str


class DiagnosisContext(DocumentContext):
    """The report of a diagnosis."""

    source: str
    summary: str
    verdict: VerdictContext
    action: str
    key_figures: list[KeyFigure]
    lines: tuple[Line, ...]
    plots: list[PlotPair]
    scatter: Markup
    strips: Markup
    strips_note: str
    model: tuple[str, ...]
    rivals: list[RivalRow]
    rivals_note: str
    faults: list[FaultRow]
    gain: list[GainRow]
    gain_note: str
    changes: list[ChangeRow]
    changes_note: str
    do: list[DoRow]
    problems: list[ProblemRow]
    notes: list[str]


def write_diagnosis_report(
    diagnosis: Diagnosis,
    gear: Gear,
    directory: Path,
    *,
    extension: ModelExtension | None,
    provenance: ReportProvenance,
    formats: Sequence[str] = USUAL_FORMATS,
    page: str = "A4",
    problems: Iterable[Problem] = (),
    notes: Iterable[str] = (),
) -> WrittenReport:
    """Write the report of a diagnosis.

    Parameters
    ----------
    diagnosis : Diagnosis
        What was found.
    gear : Gear
        The gear type.
    directory : Path
        Folder; it is made if it is missing.
    extension : ModelExtension or None
        The extension that follows from the diagnosis.
    provenance : ReportProvenance
        Program, inputs and moment.
    formats : sequence of str
        Any of ``html``, ``pdf`` and ``pdf-ua`` (tagged).
    page : str
        ``A4`` or ``Letter``.
    problems : iterable of Problem, optional
        Problems of the input.
    notes : iterable of str, optional
        What the reader noticed about the whole input.

    Returns
    -------
    WrittenReport
        The files, and what to know about them.

    Raises
    ------
    OutputError
        If a file cannot be written.
    """
    context = diagnosis_context(diagnosis, gear, extension, provenance, problems, notes)
    stem = safe_stem("diagnosis", *(Path(name).stem for name in provenance.input_sha256))
    document = Document("diagnosis.html.j2", context, stem)
    return publish(document, directory, formats=formats, page=page, created=provenance.created)


def diagnosis_context(
    diagnosis: Diagnosis,
    gear: Gear,
    extension: ModelExtension | None,
    provenance: ReportProvenance,
    problems: Iterable[Problem] = (),
    notes: Iterable[str] = (),
) -> DiagnosisContext:
    """Make everything that the report of a diagnosis shows.

    Parameters
    ----------
    diagnosis : Diagnosis
        What was found.
    gear : Gear
        The gear type.
    extension : ModelExtension or None
        The extension that follows from the diagnosis.
    provenance : ReportProvenance
        Program, inputs and moment.
    problems : iterable of Problem, optional
        Problems of the input.
    notes : iterable of str, optional
        What the reader noticed about the whole input.

    Returns
    -------
    DiagnosisContext
        Texts and figures.
    """
    d = diagnosis
    source = ", ".join(Path(name).name for name in provenance.input_sha256) or "inspections"
    residuals = Residuals(d, gear.joint_numbers)
    return {
        "title": f"Measured against predicted – {source}",
        "heading": gear.name,
        "footer_left": f"Diagnosis · {source[:40]}",
        "footer_middle": footer_middle(provenance),
        "disclaimer": DISCLAIMER,
        "assumptions": _assumptions(d, gear, extension),
        "provenance": _provenance(d, gear, provenance),
        "source": source,
        "summary": _summary(d),
        "verdict": {
            "words": _WORDS[d.verdict],
            "tone": _TONE[d.verdict],
            "sign": drawn.diagnosis_sign(d.verdict),
            "headline": _headline(d),
        },
        "action": what_to_do(d),
        "key_figures": _key_figures(d),
        "lines": seven_lines(d),
        "plots": _plots(residuals),
        "scatter": drawn.measured_against_predicted(residuals),
        "strips": drawn.tail_strips(residuals),
        "strips_note": _strips_note(d),
        "model": fitted_numbers(d),
        "rivals": _rivals(d),
        "rivals_note": _rivals_note(d),
        "faults": _faults(d),
        "gain": _gain(d),
        "gain_note": _gain_note(d),
        "changes": _changes(residuals),
        "changes_note": _changes_note(d),
        "do": _do(d),
        "problems": [problem_row(p) for p in problems],
        "notes": list(notes),
    }


def _thou(value_in: float | None, decimals: int = 1, signed: bool = False) -> str:
    text = number(None if value_in is None else 1000.0 * value_in, decimals, signed)
    return text if text == ABSENT else f"{text}\u00a0thou"


def _summary(d: Diagnosis) -> str:
    parts = [f"{several(d.rows_read, 'row')} read, {d.rows_used} used"]
    if "tail_no" in d.used.factors:
        parts.append(several(len(np.unique(d.used.tails)), "aircraft", "aircraft"))
    days = d.used.quantities.get("day")
    if d.used.first_day is not None and days is not None and np.isfinite(days).any():
        parts.append(f"from {d.used.first_day} over {several(int(np.nanmax(days) - np.nanmin(days)), 'day')}")
    return "; ".join(parts) + "."


def _headline(d: Diagnosis) -> str:
    if d.verdict == "NAMED":
        each = "; ".join(f"{cause_words(c)}: {_thou(c.effect_rms_in)} rms" for c in d.causes)
        return f"{each}. Every rival is ruled out."
    if d.verdict == "AMBIGUOUS" and len(d.also_possible) == 1:
        return f"{cause_words(d.also_possible[0])}? Too faint to be named. The model is unchanged."
    if d.verdict == "AMBIGUOUS":
        return (
            f"{several(len(d.also_possible), 'cause')} explain the misfit alike. None is named, the model is unchanged."
        )
    if d.verdict == "UNLISTED":
        moves = " and ".join(column_words(v) for v in d.unlisted_variables)
        return f"The misfit is no chance and none of the listed causes. It moves with {moves}. The model is unchanged."
    return (
        f"Nothing stands out beyond chance. An effect of {_thou(d.smallest_rms_in)} rms would have been found "
        "4 times in 5; smaller ones may be there."
    )


def _key_figures(d: Diagnosis) -> list[KeyFigure]:
    repeat = {"repeat readings": "Estimated from the repeat readings.", "declared": "As declared, not estimated."}
    figures: list[KeyFigure] = [
        {
            "label": "Measured − predicted",
            "value": _thou(d.rms_in),
            "also": f"rms, mean {_thou(d.mean_in, signed=True)}",
            "meaning": f"{millimetres(d.rms_in)} rms over all rows used, before anything is changed.",
        },
        {
            "label": "One reading repeats to",
            "value": _thou(d.repeatability_in),
            "also": "standard deviation",
            "meaning": repeat.get(d.repeatability_source, "No repeat readings, none declared."),
        },
    ]
    if d.gain is not None:
        share = 1.0 - (d.gain.rms_after_in / d.gain.rms_before_in) ** 2
        low, high = d.gain.share_interval
        figures.append(
            {
                "label": "On rows not used for the fit",
                "value": f"{number(1000 * d.gain.rms_before_in, 2)} → {number(1000 * d.gain.rms_after_in, 2)}",
                "also": "thou rms",
                "meaning": f"{100 * share:.0f} % of the mean square goes (95 %: {100 * low:.0f} to {100 * high:.0f}).",
            }
        )
    else:
        figures.append(
            {
                "label": "Scatter of what is left",
                "value": _thou(d.residual_u_in),
                "also": "standard deviation",
                "meaning": "The model was not extended: nothing is taken out.",
            }
        )
    found = d.causes or d.also_possible
    chance = found[0].p_value if found else d.remainder_p
    figures.append(
        {
            "label": "Chance if nothing is wrong",
            "value": ABSENT if chance is None else chance_words(chance, d.permutations),
            "also": "all causes together",
            "meaning": f"Against {d.permutations} data sets drawn with nothing wrong.",
        }
    )
    return figures


def _plots(residuals: Residuals) -> list[PlotPair]:
    d = residuals.diagnosis
    axis = drawn.residual_axis(residuals)
    before = residuals.before_in
    if d.causes:
        pairs: list[PlotPair] = []
        for cause in d.causes[:_MOST_PANELS]:
            column = drawn.against_cause(residuals, cause.candidate, cause.effect_in)
            left = drawn.residual_plot(before, column, axis, "before")
            right = drawn.residual_plot(residuals.after_in, column, axis, "with the extension", after=True)
            pairs.append({"left": left, "right": right, "caption": cause_words(cause)})
        return pairs
    if d.verdict == "AMBIGUOUS":
        panels = [
            drawn.residual_plot(
                before,
                drawn.against_cause(residuals, c.candidate, c.effect_in),
                axis,
                f"{c.candidate.cause.name.replace('_', ' ')} {c.candidate.target or ''}".strip(),
            )
            for c in d.also_possible[:_MOST_PANELS]
        ]
        right = panels[1] if len(panels) > 1 else drawn.measured_against_predicted(residuals)
        return [{"left": panels[0], "right": right, "caption": "What the data cannot tell apart"}]
    if d.unlisted_variables:
        return [_unlisted_plots(residuals, d.unlisted_variables)]
    left = drawn.residual_plot(before, drawn.against_column(residuals, "predicted"), axis, "")
    return [{"left": left, "right": drawn.measured_against_predicted(residuals), "caption": "Against the prediction"}]


def _unlisted_plots(residuals: Residuals, variables: tuple[str, ...]) -> PlotPair:
    """Plots against the variables of an unlisted effect; of two, the rows split by the second one."""
    axis, before = drawn.residual_axis(residuals), residuals.before_in
    columns = [drawn.against_column(residuals, name) for name in variables]
    caption = f"Moves with {' and '.join(column_words(name) for name in variables)}"
    # A number makes the better axis, a name the better way to split.
    first = 1 if len(columns) > 1 and columns[0].values is None and columns[1].values is not None else 0
    split = drawn.split_by(residuals, variables[1 - first], columns[first]) if len(columns) > 1 else None
    if split is None:
        left = drawn.residual_plot(before, columns[0], axis, "")
        return {"left": left, "right": drawn.measured_against_predicted(residuals), "caption": caption}
    rows, these, others = split
    return {
        "left": drawn.residual_plot(before, columns[first], axis, these, only=rows),
        "right": drawn.residual_plot(before, columns[first], axis, others, only=~rows),
        "caption": caption,
    }


def _strips_note(d: Diagnosis) -> str:
    tails = len(np.unique(d.used.tails))
    note = "Square: mean of the tail. Rows of one aircraft scatter together; that is part of the noise, not a cause."
    if tails > drawn.MOST_TAILS:
        note += f" Of {tails} tails the {drawn.MOST_TAILS} with the largest mean are drawn."
    return note


def _rivals(d: Diagnosis) -> list[RivalRow]:
    known = {cause.name: cause for cause in CATALOGUE}
    rows = [_rival("named", "strong", c) for c in d.causes]
    rows += [_rival("not ruled out", "strong", c) for c in d.also_possible]
    for name, target in d.ruled_out[:_MOST_RULED_OUT]:
        cause = known.get(name)
        rows.append(
            {
                "state": "ruled out",
                "tone": "",
                "cause": name.replace("_", " "),
                "target": target or ABSENT,
                "meaning": cause.words(target) if cause else "",
            }
        )
    for name, column in d.not_testable:
        cause = known.get(name)
        rows.append(
            {
                "state": f"not testable: no {column}",
                "tone": "missing",
                "cause": name.replace("_", " "),
                "target": ABSENT,
                "meaning": cause.words("") if cause else "",
            }
        )
    return rows


def _rival(state: str, tone: str, c: NamedCause) -> RivalRow:
    return {
        "state": state,
        "tone": tone,
        "cause": c.candidate.cause.name.replace("_", " "),
        "target": c.candidate.target or ABSENT,
        "meaning": cause_words(c),
    }


def _rivals_note(d: Diagnosis) -> str:
    parts = []
    if d.verdict == "NONE":
        parts.append("None of the causes explains more than chance does.")
    elif d.verdict == "UNLISTED":
        parts.append("No listed cause explains what was found.")
    elif d.ruled_out:
        parts.append(
            "Ruled out: explains clearly less of the misfit. Causes that explain nothing at all are not listed."
        )
    if len(d.ruled_out) > _MOST_RULED_OUT:
        parts.append(f"{len(d.ruled_out) - _MOST_RULED_OUT} more are ruled out.")
    if d.not_testable:
        parts.append("A cause that is not testable is neither found nor ruled out.")
    return " ".join(parts)


def _faults(d: Diagnosis) -> list[FaultRow]:
    return [
        {
            "row": str(f.row),
            "record": f.record_id,
            "column": f.column,
            "value": f.value,
            "suggested": f.suggested if f.suggested is not None else "not used",
            "kind": kind_words(f.kind),
        }
        for f in d.faults
    ]


def _gain(d: Diagnosis) -> list[GainRow]:
    g = d.gain
    if g is None:
        return []
    changes = (
        ("rms on rows not used for the fit", _thou(g.rms_before_in, 2), _thou(g.rms_after_in, 2)),
        (
            "false WITHIN: predicted within, measured outside",
            f"{g.false_within_before} of {d.rows_used}",
            f"{g.false_within_after} of {d.rows_used}",
        ),
        (
            "false OUTSIDE: predicted outside, measured within",
            f"{g.false_outside_before} of {d.rows_used}",
            f"{g.false_outside_after} of {d.rows_used}",
        ),
    )
    return [{"label": label, "before": before, "after": after} for label, before, after in changes]


def _gain_note(d: Diagnosis) -> str:
    g = d.gain
    if g is None:
        return "No gain was measured: the model was not extended."
    together = "aircraft" if g.held_out_by == "tail" else "single rows, because the cause concerns one aircraft"
    low, high = g.share_interval
    return (
        f"Held out by {g.held_out_by}: each prediction comes from a fit to other {together}. "
        f"Share of the mean square removed: {percent(1.0 - (g.rms_after_in / g.rms_before_in) ** 2)} "
        f"(95 %: {number(100 * low, 0)} to {number(100 * high, 0)}\u00a0%). The prediction here takes the most likely "
        "clearances behind the readings, so its rms differs a little from that of the readings as they stand."
    )


def _changes(residuals: Residuals) -> list[ChangeRow]:
    d = residuals.diagnosis
    if d.gain is None:
        return []
    places = {record: k for k, record in enumerate(d.used.record_id)}
    gears, measured = d.used.gears, d.used.measured_in
    rows: list[ChangeRow] = []
    for record in d.gain.verdicts_changed[:_MOST_CHANGES]:
        k = places[record]
        margin, after_in = float(d.used.margin_in[k]), float(d.predicted_in[k] + residuals.effect_in[k])
        before, after = _side(float(d.predicted_in[k]), margin), _side(after_in, margin)
        truth = _side(float(measured[k]), margin)
        rows.append(
            {
                "record": record,
                "gear": str(gears[k]),
                "margin": number(margin, 4),
                "before": f"{number(float(d.predicted_in[k]), 4, True)} {before}",
                "after": f"{number(after_in, 4, True)} {after}",
                "measured": f"{number(float(measured[k]), 4, True)} {truth}",
                "right": "on the edge" if before == after else "now right" if after == truth else "now wrong",
            }
        )
    return rows


def _side(value_in: float, margin_in: float) -> str:
    return "within" if abs(value_in) <= margin_in else "OUTSIDE"


def _changes_note(d: Diagnosis) -> str:
    if d.gain is None:
        return ""
    more = len(d.gain.verdicts_changed) - _MOST_CHANGES
    note = (
        "Lengths in inches. A reading beyond the margin counts, whatever is predicted. "
        "On the edge: the side depends on the rows that the fit used."
    )
    return note + (f" {more} more change; --json lists all of them." if more > 0 else "")


def _do(d: Diagnosis) -> list[DoRow]:
    return [
        {"cause": cause_words(c), "inspect": c.candidate.cause.inspect, "separates": c.candidate.separates}
        for c in (d.causes or d.also_possible)
    ]


def _assumptions(d: Diagnosis, gear: Gear, extension: ModelExtension | None) -> list[str]:
    lines = [f"The geometry is {gear.provenance}.", source_counts(gear)]
    lines.append(
        "A cause is a small change inside the geometric model with one fitted number. That its form fits does not "
        "prove that the part is faulty: inspect it."
    )
    lines.append(
        "Ordinary scatter between aircraft, the gauges' resolution and pins that rest a few degrees beside the worst "
        "direction (a healthy fleet reads a little less than the bound) are part of the noise."
    )
    lines.append("What the catalogue does not hold cannot be named; it can only be reported as not on the list.")
    if d.faults:
        lines.append("Data faults were repaired in this analysis only. The input file is as it was.")
    if d.repeatability_source == "declared":
        lines.append(
            "The repeatability of the plunger reading is declared, not estimated: there are no repeat readings."
        )
    if d.expected_scatter_in is not None:
        lines.append(
            f"Reading and clearance gauges alone would leave about {inches(d.expected_scatter_in)}; "
            f"{inches(d.residual_u_in)} is left."
        )
    if extension is not None:
        lines.append(
            f"With this extension a check takes {inches(extension.residual_u_in)} as the model's standard uncertainty. "
            "It holds for this geometry, for gears and circumstances like those in the data."
        )
    return lines


def _provenance(d: Diagnosis, gear: Gear, provenance: ReportProvenance) -> list[Fact]:
    facts = [fact for fact in provenance_facts(gear, provenance) if fact["label"] != "Extension"]
    facts.append({"label": "Null data sets", "value": f"{d.permutations}, drawn with seed {d.seed}"})
    return facts
