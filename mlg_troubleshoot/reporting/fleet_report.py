"""The page of a fleet to hang up, and the page of one gear's life with before and after side by
side.

The figure of one gear's life: how each joint wears.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

import numpy as np
from markupsafe import Markup

from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.life.folding import GearLife
from mlg_troubleshoot.life.forecast import (
    FleetLine,
    Forecast,
    LifeAhead,
    most_urgent_first,
    outlook_sentence,
    work_sentence,
)
from mlg_troubleshoot.life.logbook import as_found_as_left, shortened
from mlg_troubleshoot.life.urgency import repair_sentence
from mlg_troubleshoot.reporting.figures import (
    ACCENT,
    PALE,
    SMALL,
    SOFT,
    Axis,
    Canvas,
    Lengths,
    Plot,
)
from mlg_troubleshoot.reporting.html import Document, ReportProvenance, head
from mlg_troubleshoot.reporting.publish import safe_stem
from mlg_troubleshoot.units import LengthUnit

if TYPE_CHECKING:
    from mlg_troubleshoot.life.folding import GearLife
    from mlg_troubleshoot.life.forecast import Forecast


_RED = "#a3131a"
_LEGEND = "● reading  ■ over its limit  ▲ restored  - - limit  ··· forecast, median; grey: 90 %"
_PANEL_WIDE = 350
_PANEL_HIGH = 132


def wear_figure(life: GearLife, ahead: Forecast, gear: Gear, lengths: Lengths) -> Markup:
    """Draw the clearance of each joint over the landings: readings, limit, restorations and, from
    the last inspection on, the forecast with its 90 % band.
    """
    from mlg_troubleshoot.life.forecast import landings_of_bands, stretches

    known = stretches(life, gear.joint_numbers)
    joints = {n: own for n, own in known.items() if any(each.placed for each in own)}
    if not joints:
        return Markup("")
    read = [at for own in joints.values() for each in own for at, *_ in each.placed]
    begun = [each.begun for own in joints.values() for each in own[1:]]
    last = max(read)
    due = ahead.next_inspection_landings or 0.0
    end = max(last * 1.4, last + 2.0 * due, 1.0, *begun)
    landings = Axis("landings", min(0.0, *read, *begun), end)
    passed = np.linspace(0.0, min(end - last, gear.horizon.value), 25)
    canvas = Canvas(
        2 * _PANEL_WIDE,
        -(-len(joints) // 2) * _PANEL_HIGH + 18,
        f"Clearance of each joint of {life.name} over landings",
    )
    shown = lengths.unit.from_inches
    for place, (number, between) in enumerate(joints.items()):
        joint = gear.joint(number)
        limit = shown(joint.limit.value)
        placed = [[(at, shown(value)) for at, value, _u in each.placed] for each in between]
        most = max(value for own in placed for _at, value in own)
        x = _PANEL_WIDE * (place % 2)
        y = _PANEL_HIGH * (place // 2)
        plot = Plot(canvas, landings, Axis("", 0.0, 1.15 * max(limit, most)))
        plot.area = (x + 52, y + 20, x + _PANEL_WIDE - 14, y + _PANEL_HIGH - 34)
        canvas.text(complex(x + 52, y + 13), f"{joint.label}, {lengths.unit}", bold=True)
        if number in ahead.bands:
            edges = [np.interp(passed, landings_of_bands(gear), e) for e in ahead.bands[number]]
            low, middle, high = np.minimum(np.array(edges) * shown(1.0), plot.y.high)
            at = last + passed
            around = [*zip(at, low, strict=True), *zip(at[::-1], high[::-1], strict=True)]
            canvas.polyline([plot.at(*each) for each in around], PALE, colour=None)
            plot.draw(zip(at, middle, strict=True), dash="2 2", colour=ACCENT)
        plot.draw_axes(5)
        plot.draw([(landings.low, limit), (landings.high, limit)], dash="5 3", colour=_RED)
        for restored in sorted({each.begun for each in between[1:]} - {between[0].begun}):
            base = plot.at(restored, 0.0)
            canvas.line(base, plot.at(restored, plot.y.high), colour=SOFT, dash="1 3")
            canvas.marker("triangle", base, 4.5)
        for own in placed:
            plot.draw(own)
            for usage, value in own:
                canvas.marker("square" if value > limit else "circle", plot.at(usage, value), 3.2)
    canvas.text(complex(52, canvas.height - 4), _LEGEND, size=SMALL)
    return canvas.svg()


def fleet_document(
    lives: Iterable[GearLife],
    every: Sequence[FleetLine],
    gear: Gear,
    provenance: ReportProvenance,
    unit: LengthUnit,
) -> Document:
    """Make one page: one line per gear, worst first, with its landings left and the worst case over
    its inspections.
    """
    lengths = Lengths(unit)
    by_key = {life.key: life for life in lives}
    gears = most_urgent_first(every)
    lines = []
    for line in gears:
        life = by_key[line.key]
        cases = [
            None if said is None else said.predicted_displacement_in
            for visit in life.inspections
            for said in (life.judged.get(visit.kept.digest),)
        ]
        lines.append((line, cases, f"{safe_stem('life', *line.key)}.html"))
    context = {
        **head("Fleet", "Fleet", gear, provenance, lengths),
        "lines_of": lines,
        "work": work_sentence(gears),
        "notes": [warning for line in every for warning in line.warnings],
    }
    return Document("fleet.html.j2", context, "fleet", landscape=True, script="table.js")


def life_document(
    life: GearLife,
    ahead: Forecast,
    gear: Gear,
    provenance: ReportProvenance,
    unit: LengthUnit,
) -> Document:
    """Make one gear's life: its log book, what was found and left, landings left."""
    known = LifeAhead(life, ahead, gear)
    log = known.events
    shown = {
        "life": life,
        "joints": known.joints,
        "log": list(shortened(log)),
        "found_left": as_found_as_left(log),
        "helped": repair_sentence(log),
        "outlook": outlook_sentence(life, ahead, gear),
        "figure": wear_figure(life, ahead, gear, Lengths(unit)),
    }
    context = {**head(f"Life of {life.name}", life.name, gear, provenance, Lengths(unit)), **shown}
    return Document("life.html.j2", context, safe_stem("life", *life.key))
