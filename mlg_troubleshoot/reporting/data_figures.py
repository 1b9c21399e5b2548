"""Figures of the data of a diagnosis: the values that each technician wrote, and what is blank."""

from __future__ import annotations

import numpy as np
from markupsafe import Markup
from numpy.typing import NDArray

from mlg_troubleshoot.decision.columns import LANDINGS, TECHNICIAN_ID
from mlg_troubleshoot.reporting.diagnosis_figures import Residuals, lanes
from mlg_troubleshoot.reporting.figures import Axis

# Lines of technicians that are drawn, those who wrote most; cells of a row of blanks. [1]
_MOST = 8
_CELLS = 24


def data_figures(residuals: Residuals) -> list[tuple[Markup, str]]:
    """Draw what was written: by whom and in what steps, and which joints were not read.

    Returns
    -------
    list of (Markup, str)
        Figures, each with what to look for in it.
    """
    table = residuals.diagnosis.used
    if not np.isfinite(table.clearance_in).any():
        return []
    figures = [
        (
            _values(residuals),
            "How often each value was written. A comb is a step of rounding; a tall line among low"
            " ones a limit gauge, or the end of a gauge.",
        )
    ]
    if np.isnan(table.clearance_in).any():
        figures.append(
            (
                _blanks(residuals),
                "Dark: the share of clearances that are blank. Darker on the left, or from joint to"
                " joint: blanks that depend on wear.",
            )
        )
    return figures


def _people(residuals: Residuals) -> list[tuple[str, NDArray[np.bool_]]]:
    """Technicians with their rows, those who wrote most; all rows where none is named."""
    table = residuals.diagnosis.used
    texts = table.factors.get(TECHNICIAN_ID.variable)
    every = [("all", np.ones(len(table), bool))]
    if texts is None:
        return every
    names, counts = np.unique(texts[texts != ""], return_counts=True)
    most = sorted(names[np.argsort(-counts, kind="stable")][:_MOST].tolist())
    return [(name, texts == name) for name in most] or every


def _values(residuals: Residuals) -> Markup:
    table = residuals.diagnosis.used
    written = residuals.drawn(table.clearance_in)
    people = _people(residuals)
    across = Axis(f"clearance, {residuals.unit}", 0.0, float(np.nanmax(written)) or 1.0)
    plot = lanes("Clearances as they were written", across, [name for name, _rows in people])
    for place, (_name, rows) in enumerate(people):
        values = written[rows]
        found, counts = np.unique(np.round(values[np.isfinite(values)], 6), return_counts=True)
        tops = place + 1 - 0.9 * counts / counts.max(initial=1)
        for value, top in zip(found.tolist(), tops.tolist(), strict=True):
            plot.canvas.line(*plot.at(value, place + 1), *plot.at(value, top))
    return plot.canvas.svg()


def _blanks(residuals: Residuals) -> Markup:
    """Share of blanks of each joint, rows in the order of their landings, else as they stand."""
    table = residuals.diagnosis.used
    landings = table.quantities.get(LANDINGS.variable, np.full(len(table), np.nan))
    known = bool(np.isfinite(landings).any())
    order = np.argsort(landings, kind="stable")
    parts = np.array_split(order, min(_CELLS, len(order)))
    label = "rows, few landings to many" if known else "rows as they stand"
    names = [f"#{joint}" for joint in residuals.joints]
    plot = lanes("Blank clearances", Axis(f"{label}, %", 0.0, 100.0), names)
    for joint in range(len(names)):
        for place, rows in enumerate(parts):
            share = float(np.mean(np.isnan(table.clearance_in[rows, joint])))
            if share > 0.0:
                grey = round(255 - 215 * share)
                x, y = plot.at(100.0 * place / len(parts), joint + 0.1)
                right, low = plot.at(100.0 * (place + 1) / len(parts), joint + 0.95)
                fill = f"#{grey:02x}{grey:02x}{grey:02x}"
                plot.canvas.rectangle(x, y, right - x, low - y, fill=fill)
    return plot.canvas.svg()
