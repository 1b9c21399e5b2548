"""Figures of the inspection report: verdict sign, margin gauge, ranked bars, plunger curve."""

from __future__ import annotations

import math
from typing import Literal

import numpy as np
from markupsafe import Markup

from mlg_troubleshoot.decision.assessment import Assessment, JointFinding, Verdict
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.gear.model import links_from
from mlg_troubleshoot.reporting import figures
from mlg_troubleshoot.reporting.figures import INK, PALE, PAPER, SOFT, Bar, Canvas
from mlg_troubleshoot.reporting.formats import inches, number

VERDICT_COLOUR = {
    Verdict.INVALID: INK,
    Verdict.OUTSIDE_MARGIN: "#a3131a",
    Verdict.INCOMPLETE: "#0b4f8a",
    Verdict.WITHIN_MARGIN: "#1d6b2a",
    Verdict.INCONCLUSIVE: "#8a4b00",
}
VERDICT_SHAPE = {
    Verdict.INVALID: "crossed square",
    Verdict.OUTSIDE_MARGIN: "octagon with exclamation mark",
    Verdict.INCOMPLETE: "open circle, a part missing",
    Verdict.WITHIN_MARGIN: "circle with check mark",
    Verdict.INCONCLUSIVE: "diamond with question mark",
}


def verdict_sign(verdict: Verdict) -> Markup:
    """Draw the shape that goes with a verdict, so that it is told apart without colour.

    Parameters
    ----------
    verdict : Verdict
        The verdict.

    Returns
    -------
    Markup
        The sign.
    """
    canvas = Canvas(60, 60, f"Sign: {VERDICT_SHAPE[verdict]}")
    colour = VERDICT_COLOUR[verdict]
    match verdict:
        case Verdict.OUTSIDE_MARGIN:
            eighths = [math.pi / 8 + k * math.pi / 4 for k in range(8)]
            corners = [(30 + 28 * math.cos(a), 30 + 28 * math.sin(a)) for a in eighths]
            canvas.polyline(corners, fill=colour, colour=colour, closed=True)
            canvas.rectangle(26.5, 13, 7, 22, fill=PAPER)
            canvas.rectangle(26.5, 40, 7, 7, fill=PAPER)
        case Verdict.WITHIN_MARGIN:
            canvas.add("circle", cx=30.0, cy=30.0, r=27.0, fill=PAPER, stroke=colour, stroke_width=4.0)
            canvas.polyline([(17, 31), (26, 41), (44, 19)], colour=colour, width=6.0)
        case Verdict.INCONCLUSIVE:
            corners = [(30.0, 2.0), (58.0, 30.0), (30.0, 58.0), (2.0, 30.0)]
            canvas.polyline(corners, fill=PAPER, colour=colour, width=4.0, closed=True)
            canvas.text(30, 41, "?", size=32, bold=True, anchor="middle", colour=colour)
        case Verdict.INCOMPLETE:
            canvas.add(
                "path",
                d="M 48.4 48.4 A 26 26 0 1 1 56 30",
                fill=PAPER,
                stroke=colour,
                stroke_width=5.0,
            )
            canvas.line(18, 30, 42, 30, colour=colour, width=5)
        case Verdict.INVALID:
            canvas.rectangle(5, 5, 50, 50, fill=PAPER, edge=colour, edge_width=4)
            canvas.line(5, 5, 55, 55, colour=colour, width=4)
            canvas.line(5, 55, 55, 5, colour=colour, width=4)
    return canvas.svg("sign")


def margin_gauge(assessment: Assessment) -> Markup | None:
    """Draw the worst cases of both senses against the margin, with the uncertainty and what was measured.

    Parameters
    ----------
    assessment : Assessment
        The decision.

    Returns
    -------
    Markup or None
        The gauge; None where the linkage does not close.
    """
    a = assessment
    if a.predicted_displacement_in is None or a.over_travel_in is None or a.under_travel_in is None:
        return None
    over, under, margin = a.over_travel_in, a.under_travel_in, a.margin_in
    worst, sense = a.predicted_displacement_in, 1.0 if over >= -under else -1.0
    u2 = 2.0 * (a.standard_uncertainty_in or 0.0)
    measured, spread = a.inspection.measured_displacement_in, a.geometry_spread_in
    upper = a.predicted_upper_in if _differs(a.predicted_upper_in, worst) else None
    extent = max(margin, worst + u2, abs(measured or 0.0), upper or 0.0, spread[1] if spread else 0.0)
    lanes = 1 + (upper is not None) + (spread is not None) + (measured is not None)
    description = (
        f"Worst case {inches(over, True)} over-travel and {inches(under, True)} under-travel against a margin of "
        f"plus or minus {inches(margin)}"
    )
    if measured is not None:
        description += f"; measured {inches(measured, True)}"
    gauge = _Gauge(extent, margin, lanes, description)
    canvas = gauge.canvas

    y = gauge.lane("Worst case (bound)", f"{number(under, 4, True)} / {number(over, 4, True)}", bold=True)
    canvas.line(gauge.px(under), y, gauge.px(over), y, width=4)
    canvas.rectangle(gauge.px(sense * worst - u2), y - 6, gauge.px(2 * u2) - gauge.px(0.0), 12, edge=INK)
    for value in (under, over):
        canvas.marker("diamond", gauge.px(value), y, 5.5)
    if upper is not None:
        y = gauge.lane("unmeasured at limit", number(sense * upper, 4, True))
        canvas.line(gauge.px(0.0), y, gauge.px(sense * upper), y, width=1.5, dash="5 3")
        canvas.marker("ring", gauge.px(sense * upper), y, 4.5)
    if spread is not None:
        ends = [gauge.px(sense * value) for value in spread]
        y = gauge.lane("other geometries", " … ".join(dict.fromkeys(number(sense * v, 4, True) for v in spread)))
        canvas.line(*(ends[0], y), *(ends[1], y), width=1.5)
        for end in ends:
            canvas.line(end, y - 5, end, y + 5, width=1.5)
    if measured is not None:
        y = gauge.lane("Measured on the gear", number(measured, 4, True), bold=True)
        canvas.marker("triangle", gauge.px(measured), y, 6.5)
    return canvas.svg()


class _Gauge:
    """The gauge without its lanes: axis, margin and allowed range; lanes are added from the top."""

    def __init__(self, extent: float, margin: float, lanes: int, description: str) -> None:
        self.left, self.right, self.top, self.row, self.width = 150.0, 556.0, 36.0, 21.0, 690.0
        self.bottom = self.top + self.row * lanes + 4
        self.centre = (self.left + self.right) / 2
        self.scale = (self.right - self.left) / 2 / (extent * 1.06)
        self.filled = 0
        self.canvas = canvas = Canvas(
            self.width, self.bottom + 24, "Margin gauge: plunger displacement from mid-position", description
        )
        top, bottom, header = self.top, self.bottom, self.top - 26
        canvas.rectangle(self.px(-margin), top - 4, self.px(margin) - self.px(-margin), bottom - top + 4, fill=PALE)
        canvas.text(self.centre, header, "allowed", size=10, anchor="middle", colour=SOFT)
        for end in (-margin, margin):
            canvas.line(self.px(end), top - 8, self.px(end), bottom + 4, width=2.6)
            canvas.text(self.px(end), top - 11, number(end, 4, True), size=10.5, bold=True, anchor="middle", halo=True)
        canvas.line(self.centre, top - 4, self.centre, bottom, colour=SOFT, dash="3 3")
        canvas.text(self.left, header, "◀ short of mid-position", size=10, colour=SOFT)
        canvas.text(self.right, header, "beyond mid-position ▶", size=10, colour=SOFT, anchor="end")
        canvas.text(self.width, header, "in", size=10, colour=SOFT, anchor="end")
        canvas.line(self.left, bottom, self.right, bottom, colour=SOFT)
        for tick in figures.nice_ticks(-extent * 1.05, extent * 1.05, 7):
            canvas.line(self.px(tick), bottom, self.px(tick), bottom + 4, colour=SOFT)
            canvas.text(self.px(tick), bottom + 15, number(tick, 2, True), size=9.5, anchor="middle", colour=SOFT)
        canvas.text(0, bottom + 15, "in, over-travel +", size=9.5, colour=SOFT)

    def px(self, value: float) -> float:
        return self.centre + value * self.scale

    def lane(self, name: str, said: str, bold: bool = False) -> float:
        """Write the name and the value of the next lane; return its height on the canvas."""
        y = self.top + self.row * (self.filled + 0.5)
        self.filled += 1
        self.canvas.text(0, y + 4, name, size=10.5, bold=bold)
        self.canvas.text(self.width, y + 4, said, size=10.5, bold=bold, anchor="end")
        return y


def _differs(a: float | None, b: float | None) -> bool:
    return a is not None and b is not None and abs(a - b) > 5e-5


def contribution_bar(finding: JointFinding, longest_in: float, gauge_u_in: float) -> Markup:
    """Draw the bar of one joint for the ranked table.

    Parameters
    ----------
    finding : JointFinding
        The joint.
    longest_in : float
        Displacement at the right end. [in]
    gauge_u_in : float
        Standard uncertainty of the clearance. [in]

    Returns
    -------
    Markup
        The bar: black over the limit, grey within it, outlined and dashed where half the limit stands in for
        a missing reading.
    """
    name = f"Contribution of joint {finding.joint}"
    value = finding.contribution_in
    if value is None:
        value = bar_stand_in(finding)
        canvas = Canvas(200, 14, name, f"not measured; ranked with {inches(value)}")
        bar = Bar("", value, "", style="open")
    else:
        canvas = Canvas(200, 14, name, inches(value))
        u2 = 2.0 * gauge_u_in * finding.plunger_amplification
        style: Literal["solid", "mid"] = "solid" if finding.over_limit else "mid"
        bar = Bar("", value, "", max(value - u2, 0.0), value + u2, style)
    figures.draw_bar(canvas, bar, 1, 2, 10, 196 / longest_in if longest_in > 0 else 0.0)
    canvas.line(1, 0, 1, 14, colour=SOFT)
    return canvas.svg("bar")


def bar_stand_in(finding: JointFinding) -> float:
    """Displacement with which an unmeasured joint is ranked: its amplification × half its limit. [in]"""
    return finding.plunger_amplification * finding.limit_in / 2.0


def plunger_curve(gear: Gear, assessment: Assessment, width: float = 440.0, height: float = 262.0) -> Markup:
    """Draw the plunger over the release stroke (Fig. 12): without clearance and in both worst cases.

    Parameters
    ----------
    gear : Gear
        The gear.
    assessment : Assessment
        The decision, whose worst directions are drawn.
    width, height : float
        Size. [canvas units]

    Returns
    -------
    Markup
        The figure.
    """
    model = gear.model
    start, end = model.stroke
    strokes = np.linspace(start, end, 61)
    x = tuple(strokes.tolist())
    nominal = model.plunger(strokes)
    series = [figures.Series("no clearance", x, tuple(nominal.tolist()), width=1.6)]
    clearance = np.array([assessment.inspection.clearance_in.get(n, 0.0) for n in gear.joint_numbers])
    senses = (
        ("worst case, over-travel", assessment.over_directions_rad, "7 3"),
        ("worst case, under-travel", assessment.under_directions_rad, "2 3"),
    )
    for label, directions, dash in senses:
        if directions:
            moved = model.plunger(strokes, links_from(clearance, np.array(directions)))
            series.append(figures.Series(label, x, tuple(moved.tolist()), dash=dash, width=2.2))
    mid, margin = float(nominal[-1]), assessment.margin_in
    values = [v for one in series for v in one.y] + [mid + margin, mid - margin]
    y_axis = figures.Axis.around("plunger position, in", [*values, -0.08 * max(values)], 0.03)
    span = end - start
    x_axis = figures.Axis("actuator extension from Down Lock, in", start - 0.02 * span, end + 0.19 * span)
    canvas = Canvas(
        width,
        height,
        "Plunger over the release of the Down Lock",
        "Plunger position against actuator extension, without clearance and in the worst case of each sense, "
        "with the margin around mid-position marked",
    )
    plot = figures.Plot(canvas, x_axis, y_axis, left=48)
    plot.draw_axes()
    for one in series:
        plot.draw(one, joined=True)
    px, high = plot.at(end, mid + margin)
    _, low = plot.at(end, mid - margin)
    canvas.rectangle(px, high, 7, low - high, fill=PALE, edge=INK, edge_width=1.2)
    _, middle = plot.at(end, mid)
    for i, text in enumerate(("margin", f"±{number(margin, 4)}")):
        canvas.text(px + 11, middle - 2 + 11 * i, text, size=9)
    for value, drop in ((assessment.over_travel_in, 0), (assessment.under_travel_in, 8)):
        if value is not None:
            canvas.text(px + 11, plot.at(end, mid + value)[1] + drop, number(value, 4, True), size=9, bold=True)
    low_lock, high_lock = gear.down_lock_range
    if math.isfinite(low_lock) and math.isfinite(high_lock):
        sx, top = plot.at(start, high_lock)
        _, bottom = plot.at(start, low_lock)
        canvas.rectangle(sx - 3, top, 6, bottom - top, fill=PALE, edge=INK, edge_width=1.2)
        canvas.text(sx + 2, bottom + 13, "allowed at Down Lock", size=9)
    found = assessment.inspection.plunger_down_lock_in
    if found is not None:
        canvas.marker("triangle", *plot.at(start, found), 5.0)
    measured = assessment.inspection.measured_displacement_in
    if measured is not None:
        canvas.marker("triangle", px + 3.5, plot.at(end, mid + measured)[1], 5.0)
    plot.draw_legend(series, plot.area[0] + 14, plot.area[1] + 10, joined=True)
    return canvas.svg()
