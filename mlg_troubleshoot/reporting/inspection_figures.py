"""The figure of the inspection report: the margin gauge."""

from __future__ import annotations

from collections.abc import Mapping

from markupsafe import Markup

from mlg_troubleshoot.decision.assessment import Assessment
from mlg_troubleshoot.reporting import figures
from mlg_troubleshoot.reporting.figures import INK, PALE, SOFT, Canvas, Marker
from mlg_troubleshoot.reporting.formats import Lengths


def margin_gauge(assessment: Assessment, lengths: Lengths) -> Markup | None:
    """Draw the worst cases of both senses against the margin, with the uncertainty and what was
    measured: a lane for each.
    """
    a = assessment
    if a.predicted_displacement_in is None or a.over_travel_in is None or a.under_travel_in is None:
        return None
    over = a.over_travel_in
    under = a.under_travel_in
    worst = a.predicted_displacement_in
    sense = 1.0 if over >= -under else -1.0
    u2 = 2.0 * (a.standard_uncertainty_in or 0.0)
    what = "As loaded (expected)" if a.as_loaded else "Worst case (bound)"
    what = "With the extension" if a.rigid_displacement_in else what
    # Of each lane its name, its ends [in] and how they are marked.
    lanes: list[tuple[str, tuple[float, ...], Marker]] = [(what, (under, over), "diamond")]
    if a.inspection.measured_displacement_in is not None:
        measured = (a.inspection.measured_displacement_in,)
        lanes.insert(0, ("Measured on the gear", measured, "triangle"))
    if a.rigid_displacement_in:
        lanes.append(("plain model (bound)", (sense * a.rigid_displacement_in,), "diamond"))
    if a.predicted_upper_in is not None and a.predicted_upper_in > worst + 5e-5:
        lanes.append(("unmeasured at limit", (sense * a.predicted_upper_in,), "ring"))
    if a.geometry_spread_in:
        low, high = a.geometry_spread_in
        lanes.append(("other geometries", (sense * low, sense * high), "circle"))
    farthest = max(a.margin_in, worst + u2, *(abs(end) for _, ends, _ in lanes for end in ends))
    said = {
        name: " / ".join(dict.fromkeys(lengths.bare(end, True) for end in ends))
        for name, ends, _ in lanes
    }
    plot = _gauge(said, a.margin_in, 1.06 * farthest, lengths)
    shown = lengths.unit.from_inches
    for place, (name, ends, marker) in enumerate(lanes):
        y = place + 0.5
        start = ends[0] if len(ends) > 1 else 0.0
        width = 4.0 if name == what else 1.5
        plot.canvas.line(*plot.at(shown(start), y), *plot.at(shown(ends[-1]), y), width=width)
        if name == what:
            left, middle = plot.at(shown(sense * worst - u2), y)
            right, _ = plot.at(shown(sense * worst + u2), y)
            plot.canvas.rectangle(left, middle - 6, right - left, 12, colour=INK)
        for end in ends:
            plot.canvas.marker(marker, *plot.at(shown(end), y), 5.0)
    return plot.canvas.svg()


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
    plot.draw_axes(lanes=True)
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
