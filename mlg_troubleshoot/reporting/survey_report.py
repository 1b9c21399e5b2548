"""The report of a survey: what was read, what follows, what remains unknown, the linkage before and
now.
"""

from __future__ import annotations

from hashlib import sha256
from typing import Any

import numpy as np
from markupsafe import Markup

from mlg_troubleshoot.gear.gear import Linkage
from mlg_troubleshoot.reporting.figures import INK, RULE, SOFT, Canvas
from mlg_troubleshoot.reporting.formats import Lengths, number
from mlg_troubleshoot.reporting.html import Document
from mlg_troubleshoot.reporting.provenance import ReportProvenance, head
from mlg_troubleshoot.reporting.publish import safe_stem
from mlg_troubleshoot.surveying.result import SurveyResult
from mlg_troubleshoot.surveying.survey import Survey
from mlg_troubleshoot.units import LengthUnit

# Width of a panel, and the room around what it shows. [px]
_WIDTH = 330
_EDGE = 26


def survey_document(
    result: SurveyResult,
    found: Survey,
    provenance: ReportProvenance,
    unit: LengthUnit,
) -> Document:
    readings = [(r.words, r.value, r.u) for r in found.readings]
    mark = sha256(repr(readings).encode()).hexdigest()[:8]
    context = _context(result, found, provenance, Lengths(unit))
    return Document("survey.html.j2", context, safe_stem("survey", result.gear.id, mark))


def _context(
    result: SurveyResult, found: Survey, provenance: ReportProvenance, lengths: Lengths
) -> dict[str, Any]:
    gear = result.gear
    mode = found.modes[0]
    fitted = found.linkage.predicted(found.read, mode.vector[None])[0]
    width = np.log(result.interval[:, 1] / result.interval[:, 0])
    return {
        **head(f"Survey – {gear.name}", f"Survey · {gear.id}", gear, provenance, lengths),
        "result": result,
        "found": found,
        "determined": f"{mode.parameters:.1f} of {len(mode.vector)}",
        "widest": f"± {100 * float(np.expm1(width.max() / 2)):.1f} %",
        "rows": list(
            zip(gear.joints, result.amplification, result.interval, result.before, strict=True)
        ),
        "panels": _panels(gear.reference, found),
        "readings": [
            (r, number((value - r.value) / r.u, 1, True), value)
            for r, value in zip(found.read, fitted.tolist(), strict=True)
        ],
    }


def _panels(before: Linkage, found: Survey) -> list[tuple[str, Markup]]:
    """Both linkages in each plane, at one scale: the old one grey and dashed, the surveyed one over
    it.
    """
    now = found.linkage.linkage(found.modes[0].vector, "now")
    panels = []
    for plane in before.mechanism.planes:
        drawn = [
            {p.name: (p.x, p.y) for p in each.mechanism.points if p.plane == plane.name}
            for each in (before, now)
        ]
        places = np.array([place for one in drawn for place in one.values()])
        if len(places) < 4:
            continue
        low = places.min(axis=0)
        high = places.max(axis=0)
        scale = (_WIDTH - 2 * _EDGE) / max(*(high - low), 1e-9)
        height = float((high - low)[1] * scale + 2 * _EDGE)
        canvas = Canvas(
            _WIDTH, height, f"Plane {plane.name}", "The linkage before, dashed, and as surveyed"
        )
        for points, colour, dash in ((drawn[0], RULE, "4 3"), (drawn[1], INK, None)):
            at = {
                name: (_EDGE + (x - low[0]) * scale, height - _EDGE - (y - low[1]) * scale)
                for name, (x, y) in points.items()
            }
            for pair in found.linkage.rigid:
                if pair <= at.keys():
                    start, end = (at[name] for name in pair)
                    canvas.line(*start, *end, colour=colour, width=1.6, dash=dash)
            for name, (x, y) in at.items():
                canvas.marker("circle", x, y, 3.0, colour=colour)
                if dash is None:
                    canvas.text(x + 6.0, y - 5.0, name, colour=SOFT, halo=True)
        panels.append((plane.name, canvas.svg()))
    return panels
