"""The report of a sensitivity study: indices, the counterparts of Figs. 12 and 13, each
statement.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace
from hashlib import sha256
from typing import Any

import numpy as np
from markupsafe import Markup

from mlg_troubleshoot.arrays import Array
from mlg_troubleshoot.paper.study import Directions, StudyFindings
from mlg_troubleshoot.reporting import study_figures as drawn
from mlg_troubleshoot.reporting.figures import Style
from mlg_troubleshoot.reporting.formats import ABSENT, MINUS, Lengths, joint_list
from mlg_troubleshoot.reporting.html import Document
from mlg_troubleshoot.reporting.provenance import ReportProvenance, head
from mlg_troubleshoot.reporting.publish import safe_stem
from mlg_troubleshoot.reporting.study_figures import BarSeries
from mlg_troubleshoot.units import LengthUnit

# A possible reason is ruled out if the excess is more than this many times what it explains. [1]
_CLEARLY = 3
_DIRECTIONS = {
    Directions.WORST: (
        "in the directions that move the plunger farthest, in the worse of the two senses"
    ),
    Directions.OVER: "in the directions of the largest over-travel",
    Directions.UNDER: "in the directions of the largest under-travel",
    Directions.RANDOM: "in random directions, all equally likely",
    Directions.FIXED: "in directions set by a load",
}


def study_document(
    findings: StudyFindings, provenance: ReportProvenance, unit: LengthUnit = LengthUnit.INCH
) -> Document:
    options = findings.options
    asked = repr(replace(options, executor=None))
    mark = sha256(f"{findings.result.table.gear.geometry_sha256} {asked}".encode()).hexdigest()[:8]
    stem = safe_stem("study", findings.gear.id, options.design, f"seed {options.seed}", mark)
    return Document("study.html.j2", _context(findings, provenance, Lengths(unit)), stem)


def _context(f: StudyFindings, provenance: ReportProvenance, lengths: Lengths) -> dict[str, Any]:
    table = f.result.table
    order = sorted(table.joints, key=lambda e: (e.rank, e.joint))
    return {
        **head(
            f"Sensitivity study – {f.gear.name}",
            f"Sensitivity study · {f.gear.id}",
            f.gear,
            provenance,
            lengths,
        ),
        "f": f,
        "table": table,
        "directions": _DIRECTIONS[f.options.directions],
        "order": order,
        "span": _span,
        "half": float(np.ptp([e.first_order_interval for e in table.joints], axis=1).max()) / 2.0,
        "rows": list(
            zip(f.gear.joints, table.joints, f.result.growth.local_stage.tolist(), strict=True)
        ),
        "tiny": _tiny,
        "curve": drawn.release_curve(f.gear, lengths),
        "orders": _orders(f),
        "interactions": _interactions(f),
        "methods": _methods(f),
        "lead": _stage_that_leads(f, lengths) if _compares_methods(f) else None,
        "designs": _designs(f),
        "compared": _designs_compared(f),
        "isfinite": math.isfinite,
    }


def _tiny(value: float) -> str:
    """Write a number where only the order of magnitude matters."""
    return f"{value:.0e}".replace("-", MINUS) if math.isfinite(value) else ABSENT


def _bars(f: StudyFindings, series: list[BarSeries], title: str, said: str) -> Markup:
    return drawn.grouped_bars([f"#{n}" for n in f.gear.joint_numbers], series, title, said)


def _span(joints: Iterable[int]) -> str:
    numbers = sorted(joints)
    if numbers == list(range(numbers[0], numbers[-1] + 1)):
        return f"#{numbers[0]} to #{numbers[-1]}"
    return joint_list(numbers)


def _orders(f: StudyFindings) -> Markup:
    joints = f.result.table.joints
    spread = np.array([e.first_order_spread for e in joints])
    return _bars(
        f,
        [
            BarSeries("first order", f.result.table.first_order, "solid", spread),
            BarSeries("total order", f.result.table.total_order, "mid"),
        ],
        "First- and total-order index of each joint",
        "Two bars per joint; the line through the first is its range over all linkages",
    )


def _interactions(f: StudyFindings) -> tuple[int, float] | None:
    """Joint with the largest difference of total and first order, and that difference; None without
    total orders.
    """
    difference = f.result.table.total_order - f.result.table.first_order
    if not np.all(np.isfinite(difference)):
        return None
    largest = int(np.argmax(difference))
    return f.result.table.joints[largest].joint, float(difference[largest])


def _compares_methods(f: StudyFindings) -> bool:
    return not f.options.beyond_margin and f.options.directions is not Directions.RANDOM


def _shares(f: StudyFindings) -> tuple[Array, Array, Array]:
    """Shares by the amplification method, maxima and mid-position, and by the exact gradient."""
    growth = f.result.growth
    limits = np.array([e.limit_in for e in f.result.table.joints])
    found = (
        growth.shares(p, limits) for p in (growth.max_plunger, growth.local_plunger, growth.exact)
    )
    return next(found), next(found), next(found)


def _methods(f: StudyFindings) -> Markup | None:
    if not _compares_methods(f):
        return None
    by_maxima, local, _ = _shares(f)
    return _bars(
        f,
        [
            BarSeries("computed", f.result.table.first_order, "solid"),
            BarSeries("amplification, maxima", by_maxima, "mid"),
            BarSeries("amplification, mid-position", local, "open"),
        ],
        "Index by computation and by the amplification method",
        "Three bars per joint: first order, share by the largest indices of the release, share at"
        " mid-position",
    )


def _stage_that_leads(f: StudyFindings, lengths: Lengths) -> dict[str, Any]:
    """Why the amplification method is too high where it is: with the numbers of this gear."""
    growth = f.result.growth
    first = f.result.table.first_order
    by_maxima, local, exact = _shares(f)
    k = int(np.argmax(by_maxima - first))
    at = float(growth.stroke[int(np.argmax(growth.stage[k]))])
    start, end = f.gear.model.stroke
    numbers = zip(f.gear.joint_numbers, growth.stage, strict=True)
    largest_at_mid = [n for n, stage in numbers if int(np.argmax(stage)) == stage.size - 1]
    excess = float(by_maxima[k] - first[k])
    curvature = float(np.abs(exact - first).max())
    return {
        "joint": f.gear.joint_numbers[k],
        "place": (
            "Down Lock"
            if at <= start
            else "mid-position"
            if at >= end
            else f"{lengths.full(at)} of the stroke"
        ),
        "others": [] if f.gear.joint_numbers[k] in largest_at_mid else largest_at_mid,
        "by_maxima": float(by_maxima[k]),
        "first": float(first[k]),
        "local": float(local[k]),
        "exact": float(exact[k]),
        "max_stage": float(growth.max_stage[k]),
        "local_stage": float(growth.local_stage[k]),
        "excess": excess,
        "curvature": curvature,
        "curvature_is_none": excess > _CLEARLY * curvature,
    }


def _designs(f: StudyFindings) -> Markup | None:
    if not f.designs:
        return None
    styles: tuple[Style, ...] = ("solid", "mid", "open")
    return _bars(
        f,
        [
            BarSeries(found.design.name.upper(), found.shares, style)
            for found, style in zip(f.designs, styles, strict=True)
        ],
        "Share of each joint by the designs of the paper",
        "Three bars per joint: Latin hypercube, with composite points, composite points only;"
        " normalised to 1 in total",
    )


def _designs_compared(f: StudyFindings) -> dict[str, Any] | None:
    first = f.result.table.first_order
    indices = [first, *(d.plain for d in f.designs)]
    if not f.designs or not np.isfinite(indices).all():
        return None
    top = np.sort(np.argsort(first)[::-1][:5])
    change = f.designs[-1].shares - f.designs[0].shares
    return {
        "top": _span(f.gear.joint_numbers[i] for i in top),
        "change": float(change[top].sum()),
        "scatter": float(max(d.scatter.max() for d in f.designs)),
    }
