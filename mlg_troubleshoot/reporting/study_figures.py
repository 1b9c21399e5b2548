"""Figures of the study report: plunger over the release, and indices side by side (counterparts of
Figs. 12 and 13).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from markupsafe import Markup

from mlg_troubleshoot.arrays import Array
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.reporting.figures import (
    INK,
    PALE,
    RULE,
    SOFT,
    Axis,
    Bar,
    Canvas,
    Plot,
    Series,
    Style,
    draw_bar,
)
from mlg_troubleshoot.reporting.formats import Lengths, number

# Points of a curve. [1]
_POINTS = 81
# Bars: height of one, the gap below it, room above all, width of the chart and its labels. [px]
_BAR_HEIGHT = 9
_GAP = 7
_TOP = 20
_WIDTH = 430
_LABEL_WIDTH = 30


@dataclass(frozen=True, slots=True)
class BarSeries:
    """One kind of bar in a chart of groups: NaN draws none, a spread is an interval of each bar,
    shape (n, 2). [1]
    """

    label: str
    values: Array
    style: Style
    spread: Array | None = None


def grouped_bars(
    labels: Sequence[str], series: Sequence[BarSeries], title: str, description: str
) -> Markup:
    """Draw horizontal bars in groups: a group for each label, in it a bar of each series with its
    value.
    """
    row = _BAR_HEIGHT * len(series) + _GAP
    canvas = Canvas(_WIDTH, _TOP + row * len(labels) + 2, title, description)
    x: float = _LABEL_WIDTH
    for one in series:
        draw_bar(canvas, Bar(1.0, style=one.style), x, 3, 9, 18)
        canvas.text(x + 23, 11.5, one.label, size=9.5)
        x += 36 + 5.6 * len(one.label)
    ends = [one.values for one in series] + [one.spread for one in series if one.spread is not None]
    values = [float(v) for part in ends for v in part.ravel() if math.isfinite(v)]
    longest = max(values, default=0.0)
    per_value = (_WIDTH - _LABEL_WIDTH - 46) / longest if longest > 0.0 else 0.0
    for i, label in enumerate(labels):
        top = _TOP + row * i
        canvas.text(
            _LABEL_WIDTH - 5,
            top + row / 2 + 1,
            label,
            size=10,
            anchor="end",
            bold=True,
        )
        for k, one in enumerate(series):
            value = float(one.values[i])
            if not math.isfinite(value):
                continue
            low, high = (None, None) if one.spread is None else one.spread[i].tolist()
            y = top + _BAR_HEIGHT * k
            bar = Bar(max(value, 0.0), low, high, one.style)
            end = draw_bar(
                canvas,
                bar,
                _LABEL_WIDTH,
                y + 0.5,
                _BAR_HEIGHT - 1.5,
                per_value,
            )
            canvas.text(end + 4, y + 7.2, number(value, 4), size=8)
    canvas.line(_LABEL_WIDTH, _TOP - 2, _LABEL_WIDTH, canvas.height, colour=SOFT)
    return canvas.svg()


def release_curve(gear: Gear, lengths: Lengths) -> Markup:
    """Draw the plunger over the release of the Down Lock (Fig. 12), on the reference and on the
    other linkages.
    """
    share = np.linspace(0.0, 1.0, _POINTS)
    curves = []
    for model in gear.ensemble_models:
        start, end = model.stroke
        curves.append(model.plunger(start + share * (end - start)) * lengths.unit.per_inch)
    x = tuple(share.tolist())
    others = [
        Series("other linkages", x, tuple(c.tolist()), colour=RULE, width=1.0) for c in curves[1:]
    ]
    reference = Series(f"linkage {gear.reference.name}", x, tuple(curves[0].tolist()), width=2.4)
    canvas = Canvas(
        _WIDTH,
        262.0,
        "Plunger over the release of the Down Lock, without clearance",
        "Plunger position against the share of the release stroke, on the reference linkage and on"
        " the others; the margin around mid-position is marked",
    )
    mid = float(curves[0][-1])
    margin = gear.margin.value * lengths.unit.per_inch
    values = [float(v) for curve in curves for v in (curve.min(), curve.max())]
    plot = Plot(
        canvas,
        Axis("share of the release stroke", 0.0, 1.16),
        Axis.around(f"plunger position, {lengths.unit}", [*values, mid + margin], 0.05),
        top=22,
    )
    plot.draw_axes()
    for one in (*others, reference):
        plot.draw(one)
    px, high = plot.at(1.0, mid + margin)
    _, low = plot.at(1.0, mid - margin)
    canvas.rectangle(
        px,
        high,
        7,
        low - high,
        fill=PALE,
        colour=INK,
        width=1.2,
    )
    for i, text in enumerate(("margin", f"±{lengths.bare(gear.margin.value)}")):
        canvas.text(px + 11, (high + low) / 2 + 1 + 10 * i, text, size=9)
    plot.draw_legend([reference, others[0]] if others else [reference], plot.area[0], 8)
    return canvas.svg()
