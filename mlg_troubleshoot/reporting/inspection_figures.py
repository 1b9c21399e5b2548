"""The figure of the inspection report: the margin gauge."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial

from markupsafe import Markup

from mlg_troubleshoot.decision.assessment import Assessment
from mlg_troubleshoot.reporting import figures
from mlg_troubleshoot.reporting.figures import INK, PALE, SOFT, Canvas
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
        )
    for place, (name, value) in enumerate(lanes.items()):
        y = plot.at(0.0, place + 0.5)[1] + 4
        bold = name[0].isupper()
        canvas.text(0, y, name, size=10.5, bold=bold)
        canvas.text(canvas.width, y, value, size=10.5, bold=bold, anchor="end")
    return plot
