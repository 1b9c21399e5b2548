"""The figure of a study: the indices of each joint (counterpart of Fig. 13a)."""

from __future__ import annotations

import math

from markupsafe import Markup

from mlg_troubleshoot.indices.index_table import IndexTable
from mlg_troubleshoot.reporting.diagnosis_figures import lanes
from mlg_troubleshoot.reporting.figures import Axis, Marker

_MARKERS: dict[str, Marker] = {"first_order": "circle", "total_order": "ring"}


def indices_figure(table: IndexTable) -> Markup:
    """Draw first- and total-order index of each joint with their 95 % intervals."""
    drawn = [
        (place, getattr(joint, name), *getattr(joint, f"{name}_interval"), marker)
        for place, joint in enumerate(table.joints)
        for name, marker in _MARKERS.items()
    ]
    most = max(each for _, *values, _ in drawn for each in values if math.isfinite(each))
    across = Axis("first order: disc; total order: ring; line: 95 %", -0.02 * most, 1.02 * most)
    plot = lanes("Indices", across, [f"#{joint.joint}" for joint in table.joints])
    for place, value, low, high, marker in drawn:
        y = place + (0.3 if marker == "circle" else 0.7)
        if math.isfinite(low + high):
            plot.canvas.line(plot.at(low, y), plot.at(high, y))
        if math.isfinite(value):
            plot.canvas.marker(marker, plot.at(value, y), 3.0)
    return plot.canvas.svg()
