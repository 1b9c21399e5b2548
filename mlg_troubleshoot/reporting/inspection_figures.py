"""Figures of the inspection report: margin gauge, ranked bars, plunger over the release."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from markupsafe import Markup

from mlg_troubleshoot.decision.assessment import Assessment, JointFinding
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.gear.model import links_from
from mlg_troubleshoot.reporting import figures
from mlg_troubleshoot.reporting.figures import INK, PALE, SOFT, Bar, Canvas
from mlg_troubleshoot.reporting.formats import Lengths, number


def margin_gauge(assessment: Assessment, lengths: Lengths) -> Markup | None:
    """Draw the worst cases of both senses against the margin, with the uncertainty and what was
    measured.
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
    spread = a.geometry_spread_in
    upper = a.predicted_upper_in
    if upper is not None and abs(upper - worst) <= 5e-5:
        upper = None
    extent = max(
        margin, worst + u2, abs(measured or 0.0), upper or 0.0, spread[1] if spread else 0.0
    )
    lanes = 1 + (upper is not None) + (spread is not None) + (measured is not None)
    what = "As loaded" if a.as_loaded else "Worst case"
    description = (
        f"{what} {lengths.full(over, True)} over-travel and {lengths.full(under, True)}"
        f" under-travel against a margin of plus or minus {lengths.full(margin)}"
    )
    if measured is not None:
        description += f"; measured {lengths.full(measured, True)}"
    gauge = _Gauge(extent, margin, lanes, description, lengths)
    canvas = gauge.canvas

    if measured is not None:
        y = gauge.lane("Measured on the gear", lengths.bare(measured, True), bold=True)
        canvas.line(gauge.px(0.0), y, gauge.px(measured), y, width=2.0)
        canvas.marker("triangle", gauge.px(measured), y, 6.5)
    y = gauge.lane(
        f"{what} ({'expected' if a.as_loaded else 'bound'})",
        f"{lengths.bare(under, True)} / {lengths.bare(over, True)}",
        bold=True,
    )
    canvas.line(gauge.px(under), y, gauge.px(over), y, width=4)
    left = gauge.px(sense * worst - u2)
    width = gauge.px(2 * u2) - gauge.px(0.0)
    canvas.rectangle(left, y - 6, width, 12, colour=INK)
    for value in (under, over):
        canvas.marker("diamond", gauge.px(value), y, 5.5)
    if upper is not None:
        y = gauge.lane("unmeasured at limit", lengths.bare(sense * upper, True))
        end = gauge.px(sense * upper)
        canvas.line(gauge.px(0.0), y, end, y, width=1.5, dash="5 3")
        canvas.marker("ring", end, y, 4.5)
    if spread is not None:
        ends = [gauge.px(sense * value) for value in spread]
        y = gauge.lane(
            "other geometries",
            " … ".join(dict.fromkeys(lengths.bare(sense * v, True) for v in spread)),
        )
        canvas.line(ends[0], y, ends[1], y, width=1.5)
        for end in ends:
            canvas.line(end, y - 5, end, y + 5, width=1.5)
    return canvas.svg()


class _Gauge:
    """The gauge without its lanes: axis, margin and allowed range; lanes are added from the top."""

    def __init__(
        self, extent: float, margin: float, lanes: int, description: str, lengths: Lengths
    ) -> None:
        self.left = 150.0
        self.right = 556.0
        self.top = 36.0
        self.row = 21.0
        self.width = 690.0
        self.bottom = self.top + self.row * lanes + 4
        self.centre = (self.left + self.right) / 2
        self.scale = (self.right - self.left) / 2 / (extent * 1.06)
        self.filled = 0
        self.canvas = canvas = Canvas(
            self.width,
            self.bottom + 24,
            "Margin gauge: plunger displacement from mid-position",
            description,
        )
        top = self.top
        bottom = self.bottom
        header = self.top - 26
        canvas.rectangle(
            self.px(-margin),
            top - 4,
            self.px(margin) - self.px(-margin),
            bottom - top + 4,
            fill=PALE,
        )
        canvas.text(self.centre, header, "allowed", size=10, anchor="middle", colour=SOFT)
        for end in (-margin, margin):
            x = self.px(end)
            canvas.line(x, top - 8, x, bottom + 4, width=2.6)
            said = lengths.bare(end, True)
            canvas.text(x, top - 11, said, size=10.5, bold=True, anchor="middle", halo=True)
        canvas.line(self.centre, top - 4, self.centre, bottom, colour=SOFT, dash="3 3")
        canvas.text(self.left, header, "◀ short of mid-position", size=10, colour=SOFT)
        canvas.text(self.right, header, "beyond mid-position ▶", size=10, colour=SOFT, anchor="end")
        canvas.text(self.width, header, lengths.unit, size=10, colour=SOFT, anchor="end")
        canvas.line(self.left, bottom, self.right, bottom, colour=SOFT)
        shown = lengths.unit.from_inches(extent * 1.05)
        ticks = figures.nice_ticks(-shown, shown, 7)
        for tick in ticks:
            x = self.px(lengths.unit.to_inches(tick))
            canvas.line(x, bottom, x, bottom + 4, colour=SOFT)
            said = number(tick, figures.decimals_of(ticks), True)
            canvas.text(x, bottom + 15, said, size=9.5, anchor="middle", colour=SOFT)
        canvas.text(0, bottom + 15, f"{lengths.unit}, over-travel +", size=9.5, colour=SOFT)

    def px(self, value: float) -> float:
        return self.centre + value * self.scale

    def lane(self, name: str, said: str, bold: bool = False) -> float:
        """Write the name and the value of the next lane; return its height on the canvas."""
        y = self.top + self.row * (self.filled + 0.5)
        self.filled += 1
        self.canvas.text(0, y + 4, name, size=10.5, bold=bold)
        self.canvas.text(self.width, y + 4, said, size=10.5, bold=bold, anchor="end")
        return y


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
    figures.draw_bar(canvas, bar, 1, 2, 10, 196 / longest_in if longest_in > 0 else 0.0)
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

    Both worst cases, the margin at mid-position, and what was measured: at mid-position, at Down
    Lock and along the stroke.
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
    measured = _measured_along(gear, a, start, end)
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


def _measured_along(
    gear: Gear, a: Assessment, start: float, end: float
) -> list[tuple[float, float]]:
    """What was measured, as actuator extension and displacement from nominal. [in]"""
    inspection = a.inspection
    found: list[tuple[float, float]] = []
    if inspection.plunger_down_lock_in is not None:
        found.append((start, inspection.plunger_down_lock_in))
    if inspection.actuator_extension_in is not None and inspection.plunger_position_in is not None:
        found.append((inspection.actuator_extension_in, inspection.plunger_position_in))
    displaced = [
        (place, position - float(gear.model.plunger(np.array([place]))[0]))
        for place, position in found
    ]
    if inspection.measured_displacement_in is not None:
        displaced.append((end, inspection.measured_displacement_in))
    return [(place, value) for place, value in displaced if math.isfinite(value)]


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
