"""The figure of a study: indices side by side (counterpart of Fig. 13)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from markupsafe import Markup

from mlg_troubleshoot.arrays import Array
from mlg_troubleshoot.indices.index_table import IndexTable
from mlg_troubleshoot.reporting.figures import SOFT, Bar, Canvas, Style, draw_bar
from mlg_troubleshoot.reporting.formats import number

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


def indices_figure(table: IndexTable) -> Markup:
    """Draw first- and total-order index of each joint with their 95 % intervals (as Fig. 13a)."""
    styles: dict[str, Style] = {"first_order": "solid", "total_order": "open"}
    series = [
        BarSeries(
            name.replace("_", " "),
            np.array([getattr(joint, name) for joint in table.joints]),
            style,
            np.array([getattr(joint, f"{name}_interval") for joint in table.joints]),
        )
        for name, style in styles.items()
    ]
    description = "First-order and total-order index of each joint with its 95 % interval"
    labels = [f"#{joint.joint}" for joint in table.joints]
    return grouped_bars(labels, series, "Indices", description)
