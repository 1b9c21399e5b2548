"""Figures of the inspection report: margin gauge, ranked bars, plunger over the release."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from itertools import pairwise

import numpy as np
from markupsafe import Markup

from mlg_troubleshoot.decision.assessment import Assessment, JointFinding
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.gear.model import links_from
from mlg_troubleshoot.reporting import figures
from mlg_troubleshoot.reporting.figures import INK, PALE, SOFT, Bar, Canvas
from mlg_troubleshoot.reporting.formats import Lengths

_PLAIN = "plain model (bound)"


def margin_gauge(assessment: Assessment, lengths: Lengths) -> Markup | None:
    """Draw the worst cases of both senses against the margin, with the uncertainty and what was
    measured: a lane for each.
    """
    a = assessment
    if a.predicted_displacement_in is None or a.over_travel_in is None or a.under_travel_in is None:
        return None
    over = a.over_travel_in
    under = a.under_travel_in
    margin = a.margin_in
    worst = a.predicted_displacement_in
    sense = 1.0 if over >= -under else -1.0
    u2 = 2.0 * (a.standard_uncertainty_in or 0.0)
    measured = a.inspection.measured_displacement_in
    low, high = (sense * value for value in a.geometry_spread_in or (0.0, 0.0))
    upper = sense * (a.predicted_upper_in or 0.0)
    bound = sense * (a.rigid_displacement_in or 0.0)
    what = "As loaded (expected)" if a.as_loaded else "Worst case (bound)"
    what = "With the extension" if bound else what
    shown = partial(lengths.bare, signed=True)
    lanes = {what: f"{shown(under)} / {shown(over)}"}
    if measured is not None:
        lanes = {"Measured on the gear": shown(measured), **lanes}
    if bound:
        lanes[_PLAIN] = shown(bound)
    if abs(upper) > worst + 5e-5:
        lanes["unmeasured at limit"] = shown(upper)
    if a.geometry_spread_in:
        lanes["other geometries"] = " … ".join(dict.fromkeys((shown(low), shown(high))))
    farthest = max(margin, worst + u2, *map(abs, (measured or 0.0, upper, high, bound)))
    plot = _gauge(lanes, margin, 1.06 * farthest, lengths)
    canvas = plot.canvas
    rows = {name: place + 0.5 for place, name in enumerate(lanes)}

    def at(value_in: float, lane: str) -> figures.Place:
        return plot.at(lengths.unit.from_inches(value_in), rows[lane])

    if measured is not None:
        ends = at(0.0, "Measured on the gear"), at(measured, "Measured on the gear")
        canvas.line(*ends[0], *ends[1], width=2.0)
        canvas.marker("triangle", *ends[1], 6.5)
    canvas.line(*at(under, what), *at(over, what), width=4)
    x, y = at(sense * worst - u2, what)
    canvas.rectangle(x, y - 6, at(sense * worst + u2, what)[0] - x, 12, colour=INK)
    for end in (under, over):
        canvas.marker("diamond", *at(end, what), 5.5)
    if bound:
        canvas.line(*at(0.0, _PLAIN), *at(bound, _PLAIN), width=4)
        canvas.marker("diamond", *at(bound, _PLAIN), 5.5)
    if "unmeasured at limit" in lanes:
        ends = at(0.0, "unmeasured at limit"), at(upper, "unmeasured at limit")
        canvas.line(*ends[0], *ends[1], width=1.5, dash="5 3")
        canvas.marker("ring", *ends[1], 4.5)
    if "other geometries" in lanes:
        canvas.line(*at(low, "other geometries"), *at(high, "other geometries"), width=1.5)
        for end in (low, high):
            x, y = at(end, "other geometries")
            canvas.line(x, y - 5, x, y + 5, width=1.5)
    return canvas.svg()


def _gauge(
    lanes: Mapping[str, str], margin_in: float, extent_in: float, lengths: Lengths
) -> figures.Plot:
    """The gauge with its margin, and each lane with its name and what it says."""
    said = ", ".join(f"{name}: {value}" for name, value in lanes.items())
    canvas = Canvas(
        690,
        68 + 21 * len(lanes),
        "Margin gauge: plunger displacement from mid-position",
        f"Margin ±{lengths.full(margin_in)}. {said} {lengths.unit}",
    )
    extent = lengths.unit.from_inches(extent_in)
    plot = figures.Plot(
        canvas,
        figures.Axis(f"{lengths.unit}, over-travel +", -extent, extent),
        figures.Axis("", float(len(lanes)), 0.0),
        left=150,
        right=134,
        top=36,
        bottom=32,
    )
    left, top, right, bottom = plot.area
    ends = [plot.at(lengths.unit.from_inches(end), 0.0)[0] for end in (-margin_in, margin_in)]
    canvas.rectangle(ends[0], top, ends[1] - ends[0], bottom - top, fill=PALE)
    plot.draw_vertical_grid()
    canvas.text(left, 10, "◀ short of mid-position", size=10, colour=SOFT)
    canvas.text(
        (left + right) / 2,
        10,
        "allowed",
        size=10,
        anchor="middle",
        colour=SOFT,
    )
    canvas.text(
        right,
        10,
        "beyond mid-position ▶",
        size=10,
        colour=SOFT,
        anchor="end",
    )
    canvas.text(canvas.width, 10, lengths.unit, size=10, colour=SOFT, anchor="end")
    for x, end in zip(ends, (-margin_in, margin_in), strict=True):
        canvas.line(x, top - 8, x, bottom + 4, width=2.6)
        words = lengths.bare(end, True)
        canvas.text(
            x,
            top - 11,
            words,
            size=10.5,
            bold=True,
            anchor="middle",
            halo=True,
        )
    for place, (name, value) in enumerate(lanes.items()):
        y = plot.at(0.0, place + 0.5)[1] + 4
        bold = name[0].isupper()
        canvas.text(0, y, name, size=10.5, bold=bold)
        canvas.text(canvas.width, y, value, size=10.5, bold=bold, anchor="end")
    return plot


def contribution_bar(
    finding: JointFinding, longest_in: float, gauge_u_in: float, lengths: Lengths
) -> Markup:
    name = f"Contribution of joint {finding.joint}"
    value = finding.contribution_in
    if value is None:
        value = bar_stand_in(finding)
        canvas = Canvas(200, 14, name, f"not measured; ranked with {lengths.full(value)}")
        bar = Bar(value, style="open")
    else:
        canvas = Canvas(200, 14, name, lengths.full(value))
        u2 = 2.0 * gauge_u_in * finding.plunger_amplification
        style: figures.Style = "solid" if finding.over_limit else "mid"
        bar = Bar(value, max(value - u2, 0.0), value + u2, style)
    figures.draw_bar(
        canvas,
        bar,
        1,
        2,
        10,
        196 / longest_in if longest_in > 0 else 0.0,
    )
    canvas.line(1, 0, 1, 14, colour=SOFT)
    return canvas.svg("bar")


def bar_stand_in(finding: JointFinding) -> float:
    """Displacement with which an unmeasured joint is ranked: its amplification × half its limit.
    [in]
    """
    return finding.plunger_amplification * finding.limit_in / 2.0


def plunger_curve(
    gear: Gear,
    assessment: Assessment,
    lengths: Lengths | None = None,
    width: float = 440.0,
    height: float = 250.0,
) -> Markup:
    """Draw how far clearances move the plunger from where it would stand without them, over the
    release stroke.

    Both worst cases, the margin at mid-position, and what was measured: at mid-position and at Down
    Lock.
    """
    a = assessment
    model = gear.model
    shown = lengths or Lengths()
    per_inch = shown.unit.per_inch
    start, end = model.stroke
    strokes = np.linspace(start, end, 61)
    nominal = model.plunger(strokes)
    clearance = np.array([a.inspection.clearance_in.get(n, 0.0) for n in gear.joint_numbers])
    x = tuple((strokes * per_inch).tolist())
    series = []
    for label, directions, dash in (
        ("worst over-travel", a.over_directions_rad, None),
        ("worst under-travel", a.under_directions_rad, "6 3"),
    ):
        if directions:
            links = links_from(clearance, np.array(directions))
            moved = model.plunger(strokes, links) - nominal
            drawn = tuple((moved * per_inch).tolist())
            series.append(figures.Series(label, x, drawn, dash=dash, width=2.2))
    measured = _measured(gear, a, start, end)
    margin = a.margin_in * per_inch
    farthest = max([end + 0.3 * (end - start), *(place for place, _ in measured)])
    values = (
        [v for one in series for v in one.y]
        + [y * per_inch for _, y in measured]
        + [margin, -margin, 0.0]
    )
    span = (end - start) * per_inch
    canvas = Canvas(
        width,
        height,
        "Plunger displacement over the release of the Down Lock",
        "Displacement of the plunger from its nominal position against actuator extension, in the"
        " worst case of each sense, with the margin at mid-position and what was measured",
    )
    plot = figures.Plot(
        canvas,
        # Room for the labels beyond mid-position.
        figures.Axis(
            f"actuator extension from Down Lock, {shown.unit}",
            start * per_inch - 0.02 * span,
            farthest * per_inch,
        ),
        figures.Axis.around(f"displacement from nominal, {shown.unit}", values, 0.08),
        left=56,
        top=26,
    )
    plot.draw_axes()
    left_end = plot.at(plot.x.low, 0.0)
    right_end = plot.at(end * per_inch, 0.0)
    canvas.line(*left_end, *right_end, width=1.2)
    for one in series:
        plot.draw(one)
    px, high = plot.at(end * per_inch, margin)
    _, low = plot.at(end * per_inch, -margin)
    canvas.rectangle(px, high, 7, low - high, fill=PALE, colour=INK, width=1.2)
    marks = [(0.0, f"margin ±{shown.bare(a.margin_in)}", False)]
    marks += [
        (v, shown.bare(v, True), True)
        for v in (a.over_travel_in, a.under_travel_in)
        if v is not None
    ]
    heights = [plot.at(0.0, value * per_inch)[1] for value, _, _ in marks]
    for (_, text, bold), y in zip(marks, _spread_out(heights, 11.0), strict=True):
        canvas.text(px + 11, y + 3, text, size=9, bold=bold)
    for place, value in measured:
        canvas.marker("triangle", *plot.at(place * per_inch, value * per_inch), 5.0)
    plot.draw_legend(
        series, plot.area[0], 10, markers=[("triangle", "measured")] if measured else ()
    )
    return canvas.svg()


def _measured(gear: Gear, a: Assessment, start: float, end: float) -> list[tuple[float, float]]:
    """What was measured, as actuator extension and displacement from nominal. [in]"""
    down_lock = a.inspection.plunger_down_lock_in
    found = [] if down_lock is None else [(start, down_lock - gear.model.calibration.down_lock_in)]
    if a.inspection.measured_displacement_in is not None:
        found.append((end, a.inspection.measured_displacement_in))
    return found


def _spread_out(places: Sequence[float], gap: float) -> list[float]:
    """Move places along a line until none is nearer to another one than the gap."""
    order = sorted(range(len(places)), key=lambda k: places[k])
    moved = list(places)
    for _ in range(20):
        for one, other in pairwise(order):
            short = gap - (moved[other] - moved[one])
            if short > 0.0:
                moved[one] -= short / 2
                moved[other] += short / 2
    return moved
