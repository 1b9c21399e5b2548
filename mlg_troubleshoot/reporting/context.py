"""What the templates are given: finished texts and figures, no numbers left to format."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from typing import TypedDict

from markupsafe import Markup

from mlg_troubleshoot.decision.assessment import Assessment, JointFinding, Rejected, Verdict
from mlg_troubleshoot.decision.inspection import Inspection, RowSource, Side
from mlg_troubleshoot.decision.wording import confidence_words, rigging_sentence
from mlg_troubleshoot.errors import Problem
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.gear.sources import SourceKind
from mlg_troubleshoot.reporting import inspection_figures as drawn
from mlg_troubleshoot.reporting.formats import (
    ABSENT,
    digest,
    inches,
    joint_list,
    millimetres,
    moment,
    number,
    percent,
    several,
)
from mlg_troubleshoot.reporting.provenance import ReportProvenance
from mlg_troubleshoot.reporting.schematic import joint_mark, joint_state, schematic

DISCLAIMER = (
    "Troubleshooting aid, not maintenance data.",
    "Does not replace the maintenance manual's limits.",
    "Within margin is not an approval for return to service.",
    "In-plane joint clearance only: not hydraulics, friction, doors, switches or structure.",
)
SIGNATORIES = ("Measured by", "Independently measured by", "Rectified by", "Inspected by")
_STATE_WORDS = {"over": "OVER LIMIT", "fine": "within limit", "missing": "not measured"}
_WARNINGS_ON_FRONT = 3


class Fact(TypedDict):
    """A label and its value."""

    label: str
    value: str


class IdentityContext(TypedDict):
    """Which gear this is."""

    side: str
    side_words: str
    tail: str
    record: str
    inspected: str
    outcome: str
    facts: list[Fact]
    carried: list[Fact]


class VerdictContext(TypedDict):
    """The verdict in words and shape."""

    words: str
    tone: str
    sign: Markup
    headline: str


class KeyFigure(TypedDict):
    """A number that the verdict stands on, with what it means."""

    label: str
    value: str
    also: str
    meaning: str


class PanelContext(TypedDict):
    """One drawing of the schematic."""

    svg: Markup
    share: str


class LegendEntry(TypedDict):
    """A mark and what it means."""

    mark: Markup
    meaning: str


class SchematicContext(TypedDict):
    """The linkage drawn."""

    panels: list[PanelContext]
    legend: list[LegendEntry]
    note: str


class JointRow(TypedDict):
    """One joint in the ranked table and in the table of details."""

    order: str
    joint: str
    name: str
    location: str
    entered: str
    radial_in: str
    radial_mm: str
    limit: str
    state: str
    tone: str
    mark: Markup
    contribution: str
    bar: Markup
    amplification: str
    first_order: str
    total_order: str
    rank_range: str
    allowance: str
    alike: str


class RepairRow(TypedDict):
    """One repair set."""

    joints: str
    displacement: str
    probability: str
    minutes: str


class PosteriorContext(TypedDict):
    """Which joints explain the measured displacement."""

    statement: str
    rows: list[PosteriorRow]
    note: str


class PosteriorRow(TypedDict):
    """One group of joints that the plunger cannot tell apart."""

    joints: str
    probability: str
    intervals: str


class MeasuredContext(TypedDict):
    """What was measured at the plunger."""

    statement: str
    urgent: bool
    facts: list[Fact]


class ValveRow(TypedDict):
    """One combination of plunger position and flow."""

    plunger: str
    flow: str
    stage: str
    result: str


class SymptomContext(TypedDict):
    """What the plunger's position means in the sequence, as far as the source states it."""

    cases: list[Fact]
    release: list[str]
    retraction_order: str
    extension_order: str
    valve: list[ValveRow]
    source: str


class ProblemRow(TypedDict):
    """One problem of the input."""

    place: str
    value: str
    expected: str
    remedy: str


class DocumentContext(TypedDict):
    """What every document has: title, footer of each page, provenance."""

    title: str
    heading: str
    footer_left: str
    footer_middle: str
    disclaimer: Sequence[str]
    assumptions: list[str]
    provenance: list[Fact]


class InspectionContext(DocumentContext):
    """The inspection report of a gear that was judged."""

    identity: IdentityContext
    verdict: VerdictContext
    action: str
    front_warnings: list[str]
    more_warnings: str
    warnings: list[str]
    carried_in_full: list[Fact]
    measured: MeasuredContext | None
    key_figures: list[KeyFigure]
    gauge: Markup | None
    schematic: SchematicContext
    convention: str
    joints: list[JointRow]
    unmeasured: str
    bars_note: str
    curve: Markup
    curve_note: str
    symptom: SymptomContext | None
    repairs: list[RepairRow] | None
    rigging: str
    measuring: str
    posterior: PosteriorContext | None
    budget: list[Fact]
    budget_note: str
    signatories: list[Fact]


class RejectedContext(DocumentContext):
    """The report of a row that cannot be judged."""

    identity: IdentityContext
    verdict: VerdictContext
    action: str
    correct: list[str]
    problems: list[ProblemRow]
    warnings: list[str]


def inspection_context(assessment: Assessment, gear: Gear, provenance: ReportProvenance) -> InspectionContext:
    """Make everything that the inspection report shows.

    Parameters
    ----------
    assessment : Assessment
        The decision.
    gear : Gear
        The gear type.
    provenance : ReportProvenance
        Program, inputs and moment.

    Returns
    -------
    InspectionContext
        Texts and figures.
    """
    a = assessment
    inspection = a.inspection
    identity = _identity(inspection.record_id, inspection.tail_no, inspection.side)
    identity["facts"] = _facts(inspection)
    if inspection.inspection_date:
        identity["inspected"] = inspection.inspection_date.isoformat()
    if inspection.outcome:
        identity["outcome"] = inspection.outcome.value
    carried: list[Fact] = [{"label": k.replace("_", " "), "value": v} for k, v in inspection.carried.items() if v]
    identity["carried"] = [{"label": _short(f["label"], 60), "value": _short(f["value"], 120)} for f in carried[:10]]
    warnings = list(dict.fromkeys((*a.warnings, *inspection.warnings)))
    front = warnings if len(warnings) <= _WARNINGS_ON_FRONT else warnings[: _WARNINGS_ON_FRONT - 1]
    rest = len(warnings) - len(front)
    return {
        **_document(f"{identity['tail']} {identity['side']} – {a.verdict.words}", identity, gear, provenance),
        "assumptions": assumptions(gear, assessment),
        "identity": identity,
        "verdict": _verdict(a.verdict, a.headline),
        "action": a.next_action.text,
        "front_warnings": front,
        "more_warnings": f"{several(rest, 'more warning')} under “Warnings”." if rest else "",
        "warnings": warnings if rest else [],
        "carried_in_full": carried if carried != identity["carried"] else [],
        "measured": _measured(a),
        "key_figures": _key_figures(a),
        "gauge": drawn.margin_gauge(a),
        "schematic": _schematic(gear, a, extended=bool(provenance.extension)),
        "convention": inspection.convention.value.replace("_", " ").lower(),
        "joints": _joints(gear, a),
        "unmeasured": _unmeasured(a),
        "bars_note": _bars_note(a),
        "curve": drawn.plunger_curve(gear, a),
        "curve_note": _WITHOUT_EXTENSION if provenance.extension else "",
        "symptom": _symptom(gear, a),
        "repairs": _repairs(a),
        "rigging": rigging_sentence(a.rigging) if a.rigging else "",
        "measuring": a.measuring.text if a.measuring and a.measuring.text not in a.next_action.text else "",
        "posterior": _posterior(a),
        "budget": _budget(a),
        "budget_note": a.budget.model_source if a.budget else "",
        "signatories": [
            {"label": role, "value": inspection.technician_id or "" if i == 0 else ""}
            for i, role in enumerate(SIGNATORIES)
        ],
    }


def rejected_context(
    rejected: Rejected, gear: Gear, provenance: ReportProvenance, problems: Iterable[Problem]
) -> RejectedContext:
    """Make everything that the report of an invalid row shows.

    Parameters
    ----------
    rejected : Rejected
        The row and what to correct.
    gear : Gear
        The gear type.
    provenance : ReportProvenance
        Program, inputs and moment.
    problems : iterable of Problem
        Problems of the input; those of this row are shown.

    Returns
    -------
    RejectedContext
        Texts.
    """
    row = rejected.row
    identity = _identity(row.record_id, row.tail_no, row.side)
    identity["facts"] = _source_facts(row.source)
    return {
        **_document(f"{identity['tail']} {identity['side']} – {Verdict.INVALID.words}", identity, gear, provenance),
        "identity": identity,
        "verdict": _verdict(Verdict.INVALID, "This entry cannot be judged. Do not use it until it is corrected."),
        "action": rejected.next_action.text,
        "correct": list(row.correct),
        "problems": [problem_row(p) for p in problems if (p.file, p.sheet, p.row) == _place(row.source)],
        "warnings": list(dict.fromkeys((*rejected.warnings, *row.warnings))),
    }


def problem_row(problem: Problem) -> ProblemRow:
    """Make the line of one problem.

    Parameters
    ----------
    problem : Problem
        The problem.

    Returns
    -------
    ProblemRow
        Its texts.
    """
    return {
        "place": problem.place(),
        "value": ABSENT if problem.value is None else problem.value,
        "expected": problem.expected,
        "remedy": problem.remedy,
    }


def _place(source: RowSource) -> tuple[str | None, str | None, int | None]:
    return source.file, source.sheet, source.row


def _identity(record: str | None, tail: str | None, side: Side | None) -> IdentityContext:
    words = {Side.LH: "left-hand", Side.RH: "right-hand"}
    return {
        "side": side.value if side else "?",
        "side_words": f"{words[side]} main landing gear" if side else "side not known",
        "tail": tail or "tail not known",
        "record": record or "record not known",
        "inspected": "not recorded",
        "outcome": "not recorded",
        "facts": [],
        "carried": [],
    }


def _facts(inspection: Inspection) -> list[Fact]:
    found: dict[str, str | None] = {
        "Landings since overhaul": _whole(inspection.gear_landings),
        "Gauge": inspection.gauge_id,
        "Temperature": _with_unit(inspection.temperature_c, "°C"),
        "Hydraulic pressure": _with_unit(inspection.hydraulic_pressure_psi, "psi"),
        "Approach": inspection.approach.value.lower() if inspection.approach else None,
        "Reading uncertainty": f"{inches(inspection.gauge_u_in)} radial"
        + (" (default)" if inspection.gauge_u_is_default else ""),
        "End float": ", ".join(f"#{n} {inches(v)}" for n, v in inspection.axial_float_in.items()) or None,
    }
    facts: list[Fact] = [{"label": label, "value": value} for label, value in found.items() if value]
    return facts + _source_facts(inspection.source)


def _source_facts(source: RowSource) -> list[Fact]:
    if source.file is None:
        return []
    parts = [source.file]
    parts += [f"sheet {source.sheet}"] if source.sheet else []
    parts += [f"row {source.row}"] if source.row else []
    return [{"label": "Entered in", "value": ", ".join(parts)}]


def _whole(value: float | None) -> str | None:
    return None if value is None else f"{value:g}"


def _with_unit(value: float | None, unit: str) -> str | None:
    return None if value is None else f"{value:g}\u00a0{unit}"


def _verdict(verdict: Verdict, headline: str) -> VerdictContext:
    return {
        "words": verdict.words,
        "tone": verdict.value.lower().replace("_", "-"),
        "sign": drawn.verdict_sign(verdict),
        "headline": headline,
    }


def _key_figures(a: Assessment) -> list[KeyFigure]:
    closes = a.predicted_displacement_in is not None
    bound = "Each clearance in its worst direction: a bound, not a forecast."
    if a.predicted_upper_in is not None and any(f.clearance_in is None for f in a.joints):
        bound += f" {inches(a.predicted_upper_in)} with unmeasured joints at their limit."
    if a.standard_uncertainty_in is None:
        uncertainty = "Standard uncertainty not known."
    else:
        uncertainty = f"Standard uncertainty {inches(a.standard_uncertainty_in)}; the box below is twice that."
    return [
        {
            "label": "Worst case",
            "value": inches(a.predicted_displacement_in) if closes else "beyond",
            "also": millimetres(a.predicted_displacement_in, decimals=2) if closes else "does not close",
            "meaning": bound,
        },
        {
            "label": "Margin",
            "value": f"±{inches(a.margin_in)}",
            "also": millimetres(a.margin_in, decimals=2),
            "meaning": _margin_meaning(a),
        },
        {
            "label": "Chance, random directions",
            "value": _chance(a),
            "also": "of leaving the margin",
            "meaning": "Each clearance in any direction alike: what to expect, beside the bound.",
        },
        {
            "label": "Worst case within margin",
            "value": percent(a.probability_within_margin),
            "also": "probability",
            "meaning": f"{uncertainty} 95 % or more is within, 5 % or less outside.{_checked(a)}",
        },
    ]


def _checked(a: Assessment) -> str:
    return f" Checked{confidence_words(a.confidence)}." if a.confidence else ""


def _chance(a: Assessment) -> str:
    """The chance with random directions; none among those tried is no proof of none beyond the bound."""
    chance = a.probability_exceed_random_directions
    if chance == 0.0 and (a.predicted_displacement_in or 0.0) > a.margin_in:
        return "<\u00a00.1\u00a0%"
    return percent(chance)


def _margin_meaning(a: Assessment) -> str:
    whose = "This gear's margin as found at rigging." if a.inspection.margin_in is not None else "Published margin."
    if a.remaining_in is None:
        return whose
    if a.remaining_in >= 0:
        return f"{whose} Remaining: {inches(a.remaining_in)}."
    return f"{whose} The worst case is {inches(-a.remaining_in)} beyond it."


def _measured(a: Assessment) -> MeasuredContext | None:
    mean = a.inspection.measured_displacement_in
    if mean is None and a.measured_statement is None:
        return None
    facts: list[Fact] = []
    if mean is not None:
        readings = ", ".join(number(r, 4, True) for r in a.inspection.readings_in)
        facts = [
            {"label": "Readings", "value": f"{readings} in"},
            {"label": "Mean, over-travel +", "value": f"{inches(mean, True)} ({millimetres(mean, True, 2)})"},
            {
                "label": "Predicted worst case",
                "value": f"{inches(a.over_travel_in, True)} and {inches(a.under_travel_in, True)}",
            },
        ]
        nearest = a.over_travel_in if mean >= 0 else a.under_travel_in
        if nearest is not None:
            facts.append({"label": "Measured less predicted, same sense", "value": inches(mean - nearest, True)})
    return {
        "statement": a.measured_statement or "",
        "urgent": mean is not None and abs(mean) > a.margin_in,
        "facts": facts,
    }


_WITHOUT_EXTENSION = "Drawn without the extension that the prediction includes."


def _schematic(gear: Gear, a: Assessment, *, extended: bool) -> SchematicContext:
    figure = schematic(gear, a)
    total = sum(width for _, _, width in figure.panels)
    note = ""
    if figure.exaggeration is not None:
        sense = "over-travel" if (a.over_travel_in or 0.0) >= -(a.under_travel_in or 0.0) else "under-travel"
        note = (
            f"→ clearance as a virtual link, drawn {figure.exaggeration} times its size, "
            f"in the worst direction for {sense}."
        )
    if extended:
        note = f"{note} {_WITHOUT_EXTENSION}".lstrip()
    return {
        "panels": [{"svg": svg, "share": f"{width / total:.4f}"} for _, svg, width in figure.panels],
        "legend": [
            {"mark": joint_mark("", "over"), "meaning": "over its limit"},
            {"mark": joint_mark("", "fine"), "meaning": "within its limit"},
            {"mark": joint_mark("", "missing"), "meaning": "not measured"},
        ],
        "note": note,
    }


def _joints(gear: Gear, a: Assessment) -> list[JointRow]:
    inspection = a.inspection
    longest = max(
        [1e-6, *(_bar_end(f, inspection.gauge_u_in) for f in a.joints)],
    )
    rows: list[JointRow] = []
    for finding in a.ranked:
        entered = inspection.entered.get(finding.joint)
        tone = joint_state(finding)
        best, worst = finding.rank_range
        rows.append(
            {
                "order": str(finding.rank),
                "joint": f"#{finding.joint}",
                "name": finding.name,
                "location": gear.joint(finding.joint).location,
                "entered": _as_entered(entered.text, entered.unit.value) if entered else ABSENT,
                "radial_in": number(finding.clearance_in, 4),
                "radial_mm": millimetres(finding.clearance_in).removesuffix("\u00a0mm"),
                "limit": number(finding.limit_in, 4),
                "state": _STATE_WORDS[tone],
                "tone": tone,
                "mark": joint_mark(str(finding.joint), tone),
                "contribution": number(finding.contribution_in, 4),
                "bar": drawn.contribution_bar(finding, longest, inspection.gauge_u_in),
                "amplification": number(finding.plunger_amplification, 2),
                "first_order": number(finding.first_order, 3),
                "total_order": number(finding.total_order, 3),
                "rank_range": f"{best}" if best == worst else f"{best}–{worst}",
                "allowance": number(finding.allowance_in, 4),
                "alike": f"acts like {joint_list(finding.alike)}" if finding.alike else "",
            }
        )
    return rows


def _bar_end(finding: JointFinding, gauge_u_in: float) -> float:
    if finding.contribution_in is None:
        return drawn.bar_stand_in(finding)
    return finding.contribution_in + 2.0 * gauge_u_in * finding.plunger_amplification


def _as_entered(text: str, unit: str) -> str:
    """The entered text, with its unit if the text does not say it."""
    return text if any(c.isalpha() or c in '"″”' for c in text) else f"{text} {unit}"


def _unmeasured(a: Assessment) -> str:
    missing = [f.joint for f in a.joints if f.clearance_in is None]
    if not missing:
        return "All joints were measured."
    return (
        f"{several(len(missing), 'joint')} not measured: {joint_list(missing)}. "
        f"{'It counts' if len(missing) == 1 else 'They count'} as 0 in the worst case; nothing is guessed."
    )


def _bars_note(a: Assessment) -> str:
    note = "Bar: clearance × plunger amplification, with two standard uncertainties of the reading; black = over limit."
    if any(f.clearance_in is None for f in a.joints):
        note += " Dashed: not measured, ranked with half its limit."
    return note


def _symptom(gear: Gear, a: Assessment) -> SymptomContext | None:
    cycle = gear.cycle
    if cycle is None:
        return None
    places: list[tuple[str, float]] = []
    measured = a.inspection.measured_displacement_in
    if measured is not None:
        places.append(("measured", measured))
    worst = sorted((v for v in (a.over_travel_in, a.under_travel_in) if v is not None), key=abs, reverse=True)
    places += [("worst case", v) for v in worst if abs(v) > a.margin_in or v == worst[0]]
    said: dict[str, list[str]] = {}
    for name, value in places:
        said.setdefault(cycle.symptom(value, a.margin_in), []).append(f"{name} {inches(value, True)}")
    cases: list[Fact] = [
        {"label": _capital(" and ".join(names)), "value": sentence} for sentence, names in said.items()
    ]
    return {
        "cases": cases,
        "release": list(cycle.release),
        "retraction_order": " → ".join(cycle.retraction_order),
        "extension_order": " → ".join(cycle.extension_order),
        "valve": [{"plunger": v.plunger, "flow": v.flow, "stage": v.stage, "result": v.result} for v in cycle.valve],
        "source": cycle.source,
    }


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]


def _repairs(a: Assessment) -> list[RepairRow] | None:
    if a.repair_sets is None:
        return None
    return [
        {
            "joints": joint_list(one.joints),
            "displacement": inches(one.predicted_displacement_in),
            "probability": percent(one.probability_within_margin),
            "minutes": f"{one.access_minutes:.0f}",
        }
        for one in a.repair_sets
    ]


def _posterior(a: Assessment) -> PosteriorContext | None:
    found = a.posterior
    if found is None:
        return None
    intervals = {interval.joint: interval for interval in found.intervals}
    rows: list[PosteriorRow] = [
        {
            "joints": joint_list(group.joints),
            "probability": percent(group.probability),
            "intervals": "; ".join(
                f"#{n} {number(intervals[n].low_in, 4)} to {number(intervals[n].high_in, 4)}" for n in group.joints
            ),
        }
        for group in found.groups
    ]
    return {
        "statement": found.text,
        "rows": rows,
        "note": (
            "Assumed beforehand: each link or pivot worn with a chance of 5 %, another cause 5 %, directions random. "
            f"Both ends of one link stand together. Worth {found.effective_draws:.0f} independent draws."
        ),
    }


def _budget(a: Assessment) -> list[Fact]:
    b = a.budget
    if b is None:
        return []
    return [
        {"label": "clearance readings", "value": inches(b.clearances_in)},
        {"label": "geometry, over the ensemble", "value": inches(b.geometry_in)},
        {"label": "model", "value": inches(b.model_in)},
        {"label": "margin", "value": inches(b.margin_in)},
        {"label": "combined", "value": inches(a.standard_uncertainty_in)},
    ]


def _document(title: str, identity: IdentityContext, gear: Gear, provenance: ReportProvenance) -> DocumentContext:
    return {
        "title": f"{title} – {identity['record']}",
        "heading": gear.name,
        "footer_left": f"{_short(identity['tail'], 20)} {identity['side']} · {_short(identity['record'], 34)}",
        "footer_middle": footer_middle(provenance),
        "disclaimer": DISCLAIMER,
        "assumptions": assumptions(gear),
        "provenance": provenance_facts(gear, provenance),
    }


def _short(text: str, length: int) -> str:
    return text if len(text) <= length else text[: length - 1] + "…"


def footer_middle(provenance: ReportProvenance) -> str:
    """Return program version and hashes as they stand on each page.

    Parameters
    ----------
    provenance : ReportProvenance
        Program, inputs and moment.

    Returns
    -------
    str
        One line.
    """
    parts = [f"mlg {provenance.program_version}", f"geometry {digest(provenance.geometry_sha256, 8)}"]
    hashes = list(provenance.input_sha256.values())
    if len(hashes) == 1:
        parts.append(f"input {digest(hashes[0], 8)}")
    elif hashes:
        parts.append(f"{len(hashes)} inputs")
    return " · ".join(parts)


def provenance_facts(gear: Gear, provenance: ReportProvenance) -> list[Fact]:
    """Return where a report comes from, in full.

    Parameters
    ----------
    gear : Gear
        The gear type.
    provenance : ReportProvenance
        Program, inputs and moment.

    Returns
    -------
    list of Fact
        Labels and values.
    """
    p = provenance
    found: list[tuple[str, str | None]] = [
        ("Program", f"mlg-troubleshoot {p.program_version}"),
        ("Made at", moment(p.created)),
        ("Gear file", f"{gear.path.name} ({gear.id})"),
        ("Geometry", f"sha256 {p.geometry_sha256}"),
        ("Ensemble", f"{several(len(gear.ensemble), 'geometry', 'geometries')}, sha256 {gear.ensemble_sha256}"),
        ("Sensitivity table", f"sha256 {p.indices_sha256}" if p.indices_sha256 else None),
        *(("Input", f"{name}, sha256 {sha256}") for name, sha256 in p.input_sha256.items()),
        ("Input", None if p.input_sha256 else "prompts or command line"),
        ("Seed", None if p.seed is None else str(p.seed)),
        ("Extension", p.extension or "none"),
    ]
    return [{"label": label, "value": value} for label, value in found if value]


def source_counts(gear: Gear) -> str:
    """Say how many numbers behind a prediction come from which kind of source.

    Parameters
    ----------
    gear : Gear
        The gear type.

    Returns
    -------
    str
        One sentence.
    """
    counts: Mapping[SourceKind, int] = Counter(n.kind for n in gear.numbers)
    parts = [f"{counts[kind]} {kind.value}" for kind in SourceKind if counts.get(kind)]
    return f"Of {len(gear.numbers)} numbers behind a verdict: {', '.join(parts)}."


def assumptions(gear: Gear, a: Assessment | None = None) -> list[str]:
    """Say what stands behind a verdict and what does not.

    Parameters
    ----------
    gear : Gear
        The gear type.
    a : Assessment, optional
        The decision, for what is assumed about this gear.

    Returns
    -------
    list of str
        Sentences.
    """
    lines = [f"The geometry is {gear.provenance}.", source_counts(gear)]
    limits = {(j.limit.value, j.limit.kind, j.limit.source) for j in gear.joints}
    for value, kind, source in sorted(limits):
        lines.append(f"Joint limit {inches(value)} radial: {kind.value}. {source}")
    lines.append(
        "The worst direction of every clearance is a bound: most worn gears exceed the margin in their worst "
        "directions and few in random ones. Read both numbers."
    )
    lines.append("One published field failure is not a validation set: the size of the error is not known.")
    pairs = sorted({tuple(sorted((n, *others))) for n, others in gear.alike.items() if others})
    if pairs:
        alike = "; ".join(" = ".join(f"#{n}" for n in pair) for pair in pairs)
        lines.append(f"Both ends of one link act alike on the plunger ({alike}): its position cannot tell them apart.")
    if a is not None:
        lines.append("Unmeasured joints count as 0 in the prediction; a second prediction takes each at its limit.")
        if a.inspection.gauge_u_is_default:
            lines.append(
                f"The uncertainty of the readings is not stated in the record: {inches(a.inspection.gauge_u_in)} "
                "radial is assumed."
            )
        if a.geometry_spread_in is not None and all(map(math.isfinite, a.geometry_spread_in)):
            low, high = a.geometry_spread_in
            lines.append(
                f"Over {several(len(gear.ensemble), 'geometry', 'geometries')} that reproduce the published numbers "
                f"the worst case is {number(low, 4)} to {inches(high)}."
            )
    return lines
