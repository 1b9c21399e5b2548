"""The report of a sensitivity study: indices, the counterparts of Figs. 12 and 13, each statement, the bound."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace
from hashlib import sha256
from pathlib import Path
from typing import TypedDict

import numpy as np
from markupsafe import Markup
from numpy.typing import NDArray

from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.reporting import study_figures as drawn
from mlg_troubleshoot.reporting.context import (
    DISCLAIMER,
    DocumentContext,
    Fact,
    KeyFigure,
    assumptions,
    footer_middle,
    provenance_facts,
)
from mlg_troubleshoot.reporting.formats import ABSENT, MINUS, joint_list, number, several
from mlg_troubleshoot.reporting.html import Document
from mlg_troubleshoot.reporting.provenance import ReportProvenance
from mlg_troubleshoot.reporting.publish import USUAL_FORMATS, WrittenReport, publish, safe_stem
from mlg_troubleshoot.reporting.study_figures import BarSeries, Style
from mlg_troubleshoot.studies.findings import StudyFindings
from mlg_troubleshoot.studies.statements import Outcome
from mlg_troubleshoot.studies.study import Directions
from mlg_troubleshoot.studies.worst_search import WorstSearch

Array = NDArray[np.float64]
# A reason that explains less than a third of an excess is not its reason.
_CLEARLY = 3.0
_DIRECTIONS = {
    Directions.WORST: "turned to move the plunger farthest, in the worse of the two senses",
    Directions.OVER: "turned for the largest over-travel",
    Directions.UNDER: "turned for the largest under-travel",
    Directions.RANDOM: "turned at random, every direction alike",
    Directions.FIXED: "in directions set by a load",
}


class IndexRow(TypedDict):
    """Indices of one joint."""

    joint: str
    first: str
    half: str
    total: str
    difference: str
    linkages: str
    rank: str
    amplification: str
    local_stage: str
    max_stage: str


class StatementRow(TypedDict):
    """A statement and what became of it."""

    sign: Markup
    outcome: str
    claim: str
    section: str
    numbers: str


class BoundRow(TypedDict):
    """Worst displacement of one sense."""

    sense: str
    sequential: str
    short: str
    searched: str
    proved: str
    gap: str
    stroke: str


class StudyContext(DocumentContext):
    """The report of a study."""

    summary: str
    conditions: str
    notes: list[str]
    key_figures: list[KeyFigure]
    rows: list[IndexRow]
    groups_note: str
    curve: Markup
    orders: Markup
    orders_note: str
    methods: Markup | None
    methods_note: list[str]
    designs: Markup | None
    designs_note: list[str]
    statements: list[StatementRow]
    bounds: list[BoundRow]
    bounds_note: str


def write_study_report(
    findings: StudyFindings,
    directory: Path,
    *,
    provenance: ReportProvenance,
    formats: Sequence[str] = USUAL_FORMATS,
    page: str = "A4",
) -> WrittenReport:
    """Write the report of a study.

    Parameters
    ----------
    findings : StudyFindings
        What was found.
    directory : Path
        Folder; it is made if it is missing.
    provenance : ReportProvenance
        Program, inputs and moment.
    formats : sequence of str
        Any of ``html``, ``pdf`` and ``pdf-ua`` (tagged).
    page : str
        ``A4`` or ``Letter``.

    Returns
    -------
    WrittenReport
        The files, and what to know about them.

    Raises
    ------
    OutputError
        If a file cannot be written.
    """
    table = findings.result.table
    options = findings.options
    asked = repr(replace(options, scheduler=None, state=None, workers=1))
    mark = sha256(f"{table.geometry_sha256} {asked}".encode()).hexdigest()[:8]
    stem = safe_stem("study", findings.gear.id, options.design, f"seed {options.seed}", mark)
    document = Document("study.html.j2", study_context(findings, provenance), stem)
    return publish(document, directory, formats=formats, page=page, created=provenance.created)


def study_context(findings: StudyFindings, provenance: ReportProvenance) -> StudyContext:
    """Make everything that the report of a study shows.

    Parameters
    ----------
    findings : StudyFindings
        What was found.
    provenance : ReportProvenance
        Program, inputs and moment.

    Returns
    -------
    StudyContext
        Texts and figures.
    """
    f = findings
    table = f.result.table
    facts = provenance_facts(f.gear, provenance)
    if not provenance.input_sha256:
        facts = [fact for fact in facts if fact["label"] != "Input"]
    return {
        "title": f"Sensitivity study – {f.gear.name}",
        "heading": f.gear.name,
        "footer_left": f"Sensitivity study · {f.gear.id}",
        "footer_middle": footer_middle(provenance),
        "disclaimer": DISCLAIMER,
        "assumptions": assumptions(f.gear),
        "provenance": [*facts, *_draws(f)],
        "summary": _summary(f),
        "conditions": _conditions(f),
        "notes": _notes(f),
        "key_figures": _key_figures(f),
        "rows": _rows(f),
        "groups_note": _groups_note(f),
        "curve": drawn.release_curve(f.gear),
        "orders": _orders(f),
        "orders_note": _orders_note(f),
        "methods": _methods(f),
        "methods_note": _methods_note(f),
        "designs": _designs(f),
        "designs_note": _designs_note(f),
        "statements": [
            {
                "sign": drawn.outcome_sign(s.outcome),
                "outcome": str(s.outcome),
                "claim": s.claim,
                "section": s.section,
                "numbers": s.numbers,
            }
            for s in f.statements
        ],
        "bounds": [_bound(found) for found in f.searches],
        "bounds_note": _bounds_note(f, table.failed),
    }


def _labels(gear: Gear) -> list[str]:
    return [f"#{n}" for n in gear.joint_numbers]


def _joined(parts: Sequence[str]) -> str:
    return parts[0] if len(parts) == 1 else f"{', '.join(parts[:-1])} and {parts[-1]}"


def _summary(f: StudyFindings) -> str:
    table = f.result.table
    failed = f"{table.failed} did not close" if table.failed else "none failed"
    linkages = several(len(f.gear.ensemble), "linkage")
    return f"Design: {table.design}; {table.evaluations} solutions over {linkages}, {failed}; seed {table.seed}."


def _conditions(f: StudyFindings) -> str:
    limits = sorted({entry.limit_in for entry in f.result.table.joints})
    many = " in, ".join(f"{value:g}" for value in limits)
    what = "whether the margin is exceeded" if f.options.beyond_margin else "the plunger displacement at mid-position"
    return (
        f"Indices of {what}. Clearances: {f.options.distribution}, from 0 to {many} in radial, "
        f"{_DIRECTIONS[f.options.directions]}. Geometry: {f.gear.provenance}."
    )


def _notes(f: StudyFindings) -> list[str]:
    notes = []
    if not f.result.finished:
        notes.append("The study was interrupted: the numbers are of what was done.")
    if f.result.indices.note:
        note = f.result.indices.note.rstrip(".")
        notes.append(f"{note[0].upper()}{note[1:]}.")
    if f.result.table.failed:
        notes.append(
            f"{f.result.table.failed} samples did not close. They are counted, not dropped: indices they touch are "
            "not given."
        )
    return notes


def _key_figures(f: StudyFindings) -> list[KeyFigure]:
    table = f.result.table
    order = sorted(table.joints, key=lambda e: (e.rank, e.joint))
    greatest = [e.joint for e in order[:4]]
    share = sum(e.first_order for e in order[:5])
    half = float(np.ptp([e.first_order_interval for e in table.joints], axis=1).max()) / 2.0
    figures: list[KeyFigure] = [
        {
            "label": "Most sensitive",
            "value": ", ".join(f"#{n}" for n in sorted(greatest)),
            "also": "",
            "meaning": "The four greatest first-order indices on the reference linkage.",
        },
        {
            "label": f"{_span(e.joint for e in order[:5])} together",
            "value": f"{number(100 * share, 1)} %",
            "also": "of the variance",
            "meaning": "Sum of their first-order indices.",
        },
        {
            "label": "Error of an index",
            "value": "not known" if math.isnan(half) else f"± {half:.1g}",
            "also": "",
            "meaning": "Largest half-width of the 95 % intervals of the first order. The spread over the linkages is "
            "what counts.",
        },
    ]
    if f.statements:
        counts = [sum(s.outcome is outcome for s in f.statements) for outcome in Outcome]
        held, reading, some, fails = counts
        figures.append(
            {
                "label": "Statements of the paper",
                "value": f"{held} of {len(f.statements)}",
                "also": "hold",
                "meaning": f"{reading + some} only in part or under a reading, {fails} not at all.",
            }
        )
    return figures


def _span(joints: Iterable[int]) -> str:
    numbers = sorted(joints)
    if numbers == list(range(numbers[0], numbers[-1] + 1)):
        return f"#{numbers[0]} to #{numbers[-1]}"
    return joint_list(numbers)


def _rows(f: StudyFindings) -> list[IndexRow]:
    rows: list[IndexRow] = []
    local = f.result.growth.local_stage
    for joint, e, stage in zip(f.gear.joints, f.result.table.joints, local, strict=True):
        low, high = e.first_order_interval
        least, most = e.rank_range
        near, far = (number(v, 3) for v in e.first_order_spread)
        difference = e.total_order - e.first_order
        rows.append(
            {
                "joint": joint.label,
                "first": number(e.first_order, 4),
                "half": f"{(high - low) / 2:.0e}".replace("-", MINUS) if math.isfinite(high - low) else ABSENT,
                "total": number(e.total_order, 4),
                "difference": f"{difference:.0e}".replace("-", MINUS) if math.isfinite(difference) else ABSENT,
                "linkages": f"{near} to {far}",
                "rank": str(e.rank) if least == most else f"{e.rank} ({least} to {most})",
                "amplification": number(e.plunger_amplification, 3),
                "local_stage": number(float(stage), 3),
                "max_stage": number(e.max_amplification_index, 3),
            }
        )
    return rows


def _groups_note(f: StudyFindings) -> str:
    ends = [g for g in f.result.groups if len(g.joints) > 1]
    if not ends:
        return ""
    each = ", ".join(f"{' + '.join(f'#{j}' for j in g.joints)}: {number(g.closed, 4)}" for g in ends)
    return f"Both ends of one link as one input: {each}."


def _orders(f: StudyFindings) -> Markup:
    joints = f.result.table.joints
    spread = np.array([e.first_order_spread for e in joints])
    return drawn.grouped_bars(
        _labels(f.gear),
        [
            BarSeries("first order", f.result.table.first_order, "solid", spread),
            BarSeries("total order", f.result.table.total_order, "mid"),
        ],
        "First- and total-order index of each joint",
        "Two bars a joint; the line through the first is its range over all linkages",
    )


def _orders_note(f: StudyFindings) -> str:
    table = f.result.table
    difference = table.total_order - table.first_order
    if not np.all(np.isfinite(difference)):
        return "This design gives no total order."
    largest = int(np.argmax(difference))
    return (
        f"Total less first order is at most {difference[largest]:.1g} (#{table.joints[largest].joint}): "
        f"the first orders add to {number(float(table.first_order.sum()), 4)}. Line: range of the first order over "
        f"{several(len(f.gear.ensemble), 'linkage')}."
    )


def _compares_methods(f: StudyFindings) -> bool:
    return not f.options.beyond_margin and f.options.directions is not Directions.RANDOM


def _shares(f: StudyFindings) -> tuple[Array, Array, Array]:
    """Shares by the amplification method, maxima and mid-position, and by the exact gradient."""
    growth = f.result.growth
    limits = np.array([e.limit_in for e in f.result.table.joints])
    found = (growth.shares(p, limits) for p in (growth.max_plunger, growth.local_plunger, growth.exact))
    return next(found), next(found), next(found)


def _methods(f: StudyFindings) -> Markup | None:
    if not _compares_methods(f):
        return None
    by_maxima, local, _ = _shares(f)
    return drawn.grouped_bars(
        _labels(f.gear),
        [
            BarSeries("computed", f.result.table.first_order, "solid"),
            BarSeries("amplification, maxima", by_maxima, "mid"),
            BarSeries("amplification, mid-position", local, "open"),
        ],
        "Index by computation and by the amplification method",
        "Three bars a joint: first order, share by the largest indices of the release, share by those at mid-position",
    )


def _methods_note(f: StudyFindings) -> list[str]:
    """Why the amplification method is too high where it is: with the numbers of this gear."""
    if not _compares_methods(f):
        return []
    growth, first = f.result.growth, f.result.table.first_order
    by_maxima, local, exact = _shares(f)
    k = int(np.argmax(by_maxima - first))
    joint = f"#{f.gear.joint_numbers[k]}"
    at = float(growth.stroke[int(np.argmax(growth.stage[k]))])
    start, end = f.gear.model.stroke
    place = (
        "at Down Lock" if at <= start else "at mid-position" if at >= end else f"at {number(at, 3)} in of the stroke"
    )
    others = [
        f"#{n}" for n, v in zip(f.gear.joint_numbers, growth.stage, strict=True) if int(np.argmax(v)) == v.size - 1
    ]
    lines = [
        f"With the largest index of every stage over the release, {joint} is highest above what is computed: "
        f"{number(float(by_maxima[k]), 4)} against {number(float(first[k]), 4)}. Its stage index is "
        f"{number(float(growth.max_stage[k]), 3)} {place}, but {number(float(growth.local_stage[k]), 3)} at "
        "mid-position, where the displacement is read."
    ]
    if others and joint not in others:
        lines[0] += f" Those of {_joined(others)} are largest at mid-position itself."
    lines.append(
        f"With all indices at mid-position its share is {number(float(local[k]), 4)}, by the exact gradient "
        f"{number(float(exact[k]), 4)}."
    )
    excess, curvature = float(by_maxima[k] - first[k]), float(np.abs(exact - first).max())
    if excess > _CLEARLY * curvature:
        lines.append(
            "Section 4.3 supposes that minute curves treated as lines are the reason. The exact gradient treats every "
            f"curve as a line and is within {curvature:.1g} of what is computed, so that they account for no more than "
            f"that; the excess of {number(excess, 3)} comes from indices taken at different positions of the stroke."
        )
    return lines


def _designs(f: StudyFindings) -> Markup | None:
    if not f.designs:
        return None
    styles: tuple[Style, ...] = ("solid", "mid", "open")
    return drawn.grouped_bars(
        _labels(f.gear),
        [
            BarSeries(found.design.name.upper(), found.shares, style)
            for found, style in zip(f.designs, styles, strict=True)
        ],
        "Share of each joint by the designs of the paper",
        "Three bars a joint: Latin hypercube, with composite points, composite points only; normalised to 1 in total",
    )


def _designs_note(f: StudyFindings) -> list[str]:
    if not f.designs:
        return []
    first = f.result.table.first_order
    sizes = "; ".join(
        f"{d.design.name.upper()}: n1 = {d.design.n1}, n2 = {d.design.n2}, nCCD = {d.design.n_ccd}" for d in f.designs
    )
    lhs, ccd = f.designs[0], f.designs[-1]
    lines = [
        f"Mean of {several(lhs.iterations, 'iteration')}, plain indices normalised to 1 as in the paper. {sizes}. "
        f"{sum(d.evaluations for d in f.designs)} solutions, {sum(d.failed for d in f.designs)} failed."
    ]
    if not all(np.all(np.isfinite(values)) for values in (first, *(d.plain for d in f.designs))):
        return [*lines, "An iteration with a sample that does not close has no indices."]
    top = np.sort(np.argsort(first)[::-1][:5])
    change = float((ccd.shares - lhs.shares)[top].sum())
    lines.append(
        f"From LHS to CCD the share of {_span(f.gear.joint_numbers[i] for i in top)} changes by "
        f"{number(change, 4, True)}; one iteration scatters by up to "
        f"{number(float(max(d.scatter.max() for d in f.designs)), 4)} in one index."
    )
    bias = "; ".join(
        f"{d.design.name.upper()} adds to {number(float(d.plain.sum()), 3)} plain and "
        f"{number(float(d.corrected.sum()), 3)} corrected"
        for d in f.designs
    )
    lines.append(f"A plain index exceeds the true one by (1 − S)/n1 on average: {bias}.")
    return lines


def _bound(found: WorstSearch) -> BoundRow:
    proved = found.proved
    shown = math.isfinite(proved.bound_in)
    return {
        "sense": "over-travel" if found.sense > 0 else "under-travel",
        "sequential": number(found.sequential_in, 6),
        "short": f"{number(100 * (1 - found.sequential_in / proved.found_in), 3)}\u00a0%"
        if proved.found_in
        else ABSENT,
        "searched": number(found.searched_in, 6),
        "proved": f"≤ {number(proved.bound_in, 6)}" if shown else "could not be proved",
        "gap": f"{max(proved.gap_in, 0.0):.0e}".replace("-", MINUS) if shown else ABSENT,
        "stroke": number(proved.stroke_in, 3),
    }


def _bounds_note(f: StudyFindings, failed: int) -> str:
    if not f.searches:
        return ""
    effort = sum(s.evaluations for s in f.searches)
    boxes = sum(s.proved.boxes for s in f.searches)
    note = (
        "Lengths in inches, every clearance at its limit. Sequential: the paper's rule, joint by joint at "
        "mid-position, for this sense. Searched: differential evolution over all directions and the stroke, "
        f"{effort} solutions. Proved: interval arithmetic, {boxes} ranges of directions and stroke: no direction, no "
        "position gives more. Gap: proved less the largest displacement found."
    )
    return note + (
        " Samples of the study did not close: the bound is of the linkage while it closes." if failed else ""
    )


def _draws(f: StudyFindings) -> list[Fact]:
    facts: list[Fact] = [
        {"label": "Design", "value": f.result.table.design},
        {"label": "Linkages", "value": ", ".join(linkage.name for linkage in f.gear.ensemble)},
    ]
    if f.designs:
        facts.append({"label": "Designs' seed", "value": f"{f.designs[0].seed}, a stream for each iteration"})
    if f.searches:
        facts.append({"label": "Search's seed", "value": f"{f.searches[0].seed}, a stream for each sense"})
    return facts
