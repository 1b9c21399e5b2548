"""Figures of the diagnosis report: its sign, residuals before and after, measured against predicted, tails."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from markupsafe import Markup
from numpy.typing import NDArray

from mlg_troubleshoot.diagnosis import Candidate, Diagnosis
from mlg_troubleshoot.reporting.diagnosis_lines import column_words
from mlg_troubleshoot.reporting.figures import (
    ACCENT,
    INK,
    PAPER,
    RULE,
    SOFT,
    Axis,
    Canvas,
    Plot,
    nice_ticks,
)

Array = NDArray[np.float64]
Texts = NDArray[np.str_]

THOU_PER_IN = 1000.0
SIGN_COLOUR = {"NAMED": "#a3131a", "AMBIGUOUS": "#8a4b00", "UNLISTED": "#8a4b00", "NONE": "#1d6b2a"}
SIGN_SHAPE = {
    "NAMED": "filled square with an arrow to one point",
    "AMBIGUOUS": "two circles that overlap",
    "UNLISTED": "diamond with question mark",
    "NONE": "circle with an equals sign",
}
_BINS = 8
_FEWEST_IN_A_BIN = 5
MOST_TAILS = 36
_UNITS = {"temperature_c": "°C", "hydraulic_pressure_psi": "psi"}


def diagnosis_sign(verdict: str) -> Markup:
    """Draw the shape that goes with a verdict, so that it is told apart without colour.

    Parameters
    ----------
    verdict : str
        NONE, NAMED, AMBIGUOUS or UNLISTED.

    Returns
    -------
    Markup
        The sign.
    """
    canvas = Canvas(60, 60, f"Sign: {SIGN_SHAPE[verdict]}")
    colour = SIGN_COLOUR[verdict]
    match verdict:
        case "NAMED":
            canvas.rectangle(3, 3, 54, 54, fill=colour)
            canvas.line(12, 12, 33, 33, colour=PAPER, width=5)
            canvas.polyline([(37, 20), (37, 37), (20, 37)], colour=PAPER, width=5)
            canvas.marker("circle", 46, 46, 4.5, colour=PAPER)
        case "AMBIGUOUS":
            canvas.add("circle", cx=21.0, cy=30.0, r=18.0, fill="none", stroke=colour, stroke_width=4.0)
            canvas.add("circle", cx=39.0, cy=30.0, r=18.0, fill="none", stroke=colour, stroke_width=4.0)
        case "UNLISTED":
            corners = [(30.0, 2.0), (58.0, 30.0), (30.0, 58.0), (2.0, 30.0)]
            canvas.polyline(corners, fill=PAPER, colour=colour, width=4.0, closed=True)
            canvas.text(30, 41, "?", size=32, bold=True, anchor="middle", colour=colour)
        case _:
            canvas.add("circle", cx=30.0, cy=30.0, r=27.0, fill=PAPER, stroke=colour, stroke_width=4.0)
            canvas.line(17, 25, 43, 25, colour=colour, width=5)
            canvas.line(17, 36, 43, 36, colour=colour, width=5)
    return canvas.svg("sign")


@dataclass(frozen=True)
class Residuals:
    """The rows behind a diagnosis, before and after its extension.

    Parameters
    ----------
    diagnosis : Diagnosis
        The diagnosis.
    joints : tuple of int
        Numbers of the joints, in the order of the clearances.
    """

    diagnosis: Diagnosis
    joints: tuple[int, ...]

    @property
    def before_in(self) -> Array:
        """Measured less predicted, shape (n,). [in]"""
        return self.diagnosis.misfit_in

    @property
    def effect_in(self) -> Array:
        """What the named causes add to the prediction, shape (n,); zero if none is named. [in]"""
        total = np.zeros(len(self.before_in))
        for cause in self.diagnosis.causes:
            total = total + cause.effect_in
        return total

    @property
    def after_in(self) -> Array:
        """What the extended model leaves, shape (n,). [in]"""
        return self.before_in - self.effect_in

    def clearance(self, joint: int) -> Array:
        """Clearance of one joint in each row, NaN where not measured. [in]"""
        return self.diagnosis.used.clearance_in[:, self.joints.index(joint)]


@dataclass(frozen=True)
class Against:
    """What residuals are drawn against.

    Parameters
    ----------
    label : str
        Quantity and unit.
    values : ndarray, shape (n,), or None
        A number for each row, NaN where missing.
    groups : ndarray of str, shape (n,), or None
        A name for each row, empty where missing; instead of numbers.
    marked : ndarray of bool, shape (n,), or None
        Rows that the cause acts on, where it acts on some only.
    marked_label : str
        What they are.
    """

    label: str
    values: Array | None = None
    groups: Texts | None = None
    marked: NDArray[np.bool_] | None = None
    marked_label: str = ""


def against_cause(residuals: Residuals, candidate: Candidate, effect_in: Array) -> Against:
    """Choose what to draw residuals against: the column that the cause lives on, else the prediction.

    Parameters
    ----------
    residuals : Residuals
        The rows.
    candidate : Candidate
        The cause with its target.
    effect_in : ndarray, shape (n,)
        Its effect. [in]

    Returns
    -------
    Against
        The column.
    """
    table, setting = residuals.diagnosis.used, candidate.setting
    joints = [setting["joint"]] if "joint" in setting else list(setting.get("pair", ()))
    if joints:
        least = np.min([residuals.clearance(joint) for joint in joints], axis=0) * THOU_PER_IN
        named = " and ".join(f"#{joint}" for joint in joints)
        return Against(f"{'smaller ' if len(joints) > 1 else ''}clearance of {named}, thou", least)
    if "tail" in setting and "day" in table.quantities:
        rows = table.factors["tail_no"] == setting["tail"]
        if "side" in setting:
            rows = rows & (table.factors["side"] == setting["side"])
        return Against(_day_label(residuals), table.quantities["day"], marked=rows, marked_label=candidate.target or "")
    for need in candidate.cause.needs:
        if need == "axial_float" and table.axial_float_in is not None:
            return _most_telling_float(table.axial_float_in, effect_in, residuals.joints)
        if need in table.quantities or need in table.factors:
            return against_column(residuals, need)
    return against_column(residuals, "predicted")


def against_column(residuals: Residuals, name: str) -> Against:
    """Return a column of the table to draw residuals against.

    Parameters
    ----------
    residuals : Residuals
        The rows.
    name : str
        A quantity, a factor, a clearance or end float by its joint, or ``predicted``.

    Returns
    -------
    Against
        The column; the prediction where there is no such column.
    """
    table = residuals.diagnosis.used
    if name == "day" and "day" in table.quantities:
        return Against(_day_label(residuals), table.quantities["day"])
    if name in table.quantities:
        return Against(_axis_label(name), table.quantities[name])
    if name in table.factors:
        return Against(column_words(name), groups=table.factors[name])
    kind, _, joint = name.rpartition("_")
    if joint.isdigit() and int(joint) in residuals.joints:
        if kind == "clearance":
            return Against(f"{column_words(name)}, thou", residuals.clearance(int(joint)) * THOU_PER_IN)
        if kind == "axial_float" and table.axial_float_in is not None:
            values = table.axial_float_in[:, residuals.joints.index(int(joint))]
            return Against(f"{column_words(name)}, thou", values * THOU_PER_IN)
    return Against("predicted displacement, thou", residuals.diagnosis.predicted_in * THOU_PER_IN)


def _axis_label(name: str) -> str:
    unit = _UNITS.get(name)
    return column_words(name) + (f", {unit}" if unit else "")


def split_by(residuals: Residuals, name: str, other: Against) -> tuple[NDArray[np.bool_], str, str] | None:
    """Split the rows by a column, so that what moves with two columns together can be seen.

    Parameters
    ----------
    residuals : Residuals
        The rows.
    name : str
        The column to split by.
    other : Against
        The column that is drawn.

    Returns
    -------
    tuple of ndarray of bool, str and str, or None
        Rows of the first part and the names of both parts; None where the column does not split them.
    """
    column = against_column(residuals, name)
    if column.values is not None:
        known = np.isfinite(column.values)
        half = float(np.median(column.values[known])) if known.any() else np.nan
        words = column_words(name)
        shown = f"{half:.0f}" if abs(half) >= 100.0 else f"{half:.3g}"
        return np.asarray(column.values >= half), f"{words} {shown} and more", f"{words} below {shown}"
    if column.groups is None:
        return None
    x = other.values
    if x is None:
        x = np.unique(np.asarray(other.groups, str), return_inverse=True)[1].astype(float)
    best: tuple[float, str] | None = None
    for level in np.unique(column.groups):
        rows = (column.groups == level) & np.isfinite(x)
        if level and rows.sum() > 3 and np.std(x[rows]) > 0.0:
            slope = abs(float(np.polyfit(x[rows], residuals.before_in[rows], 1)[0])) * np.sqrt(rows.sum())
            if best is None or slope > best[0]:
                best = (slope, str(level))
    return None if best is None else (np.asarray(column.groups == best[1]), best[1], f"not {best[1]}")


def _most_telling_float(floats_in: Array, effect_in: Array, joints: Sequence[int]) -> Against:
    """The end float with which the fitted effect goes most."""
    best, place = -1.0, 0
    for j in range(floats_in.shape[1]):
        known = np.isfinite(floats_in[:, j])
        if known.sum() > 2 and np.std(floats_in[known, j]) > 0 and np.std(effect_in[known]) > 0:
            alike = abs(float(np.corrcoef(floats_in[known, j] ** 2, effect_in[known])[0, 1]))
            if alike > best:
                best, place = alike, j
    return Against(f"end float of #{joints[place]}, thou", floats_in[:, place] * THOU_PER_IN)


def _day_label(residuals: Residuals) -> str:
    first = residuals.diagnosis.used.first_day
    return f"days since {first}" if first else "day"


def residual_axis(residuals: Residuals) -> Axis:
    """Make the axis that all plots of residuals share, so that they can be compared.

    Parameters
    ----------
    residuals : Residuals
        The rows.

    Returns
    -------
    Axis
        Holds the residuals before and after. [thou]
    """
    both = np.concatenate([residuals.before_in, residuals.after_in]) * THOU_PER_IN
    return Axis.around("measured − predicted, thou", both.tolist())


def residual_plot(
    left_in: Array,
    against: Against,
    axis: Axis,
    title: str,
    *,
    after: bool = False,
    only: NDArray[np.bool_] | None = None,
    width: float = 335.0,
    height: float = 236.0,
) -> Markup:
    """Draw residuals against a column, with the mean of each stretch or group and twice its standard error.

    Parameters
    ----------
    left_in : ndarray, shape (n,)
        Residuals. [in]
    against : Against
        The column.
    axis : Axis
        Axis of the residuals. [thou]
    title : str
        What is drawn.
    after : bool
        True for what an extension leaves: filled points instead of rings.
    only : ndarray of bool, shape (n,), optional
        Rows to draw; all of them if not given.
    width, height : float
        Size. [canvas units]

    Returns
    -------
    Markup
        The figure.
    """
    thou = left_in * THOU_PER_IN if only is None else np.where(only, left_in * THOU_PER_IN, np.nan)
    groups = sorted({str(g) for g in against.groups if g}) if against.groups is not None else []
    description = f"Measured less predicted displacement in thousandths of an inch, against {against.label}"
    canvas = Canvas(width, height, title, description)
    if against.groups is not None:
        x = np.array([groups.index(str(g)) if g else np.nan for g in against.groups], float)
        plot = Plot(canvas, Axis(against.label, -0.6, len(groups) - 0.4), axis, top=24)
        _axes_of_groups(plot, groups)
        # Points of one group stand side by side in the order of the rows, so that none hides another.
        x = x + 0.5 * (np.arange(len(x)) * 0.618 % 1.0 - 0.5)
    else:
        x = np.full(len(thou), np.nan) if against.values is None else against.values
        plot = Plot(canvas, Axis.around(against.label, x[np.isfinite(x)].tolist(), 0.03), axis, top=24)
        plot.draw_axes()
    canvas.text(plot.area[0], 12, title, size=11, bold=True)
    _, zero = plot.at(plot.x.low, 0.0)
    canvas.line(plot.area[0], zero, plot.area[2], zero, colour=SOFT, width=1.0)
    marked = np.zeros(len(thou), bool) if against.marked is None else against.marked
    known = np.isfinite(x) & np.isfinite(thou)
    for place in (*np.flatnonzero(known & ~marked), *np.flatnonzero(known & marked)):
        _point(canvas, *plot.at(float(x[place]), float(thou[place])), after=after, marked=bool(marked[place]))
    rows = known & marked if against.marked is not None else known
    if against.groups is None:
        _means(plot, x[rows], thou[rows])
    else:
        for k, name in enumerate(groups):
            own = thou[(against.groups == name) & known]
            if len(own) >= 2:
                _mean_mark(plot, float(k), own)
    if against.marked is not None:
        canvas.marker("triangle", plot.area[2] - 6, 8, 4.0)
        canvas.text(plot.area[2] - 14, 12, against.marked_label, size=10, anchor="end")
    return canvas.svg()


def _point(canvas: Canvas, x: float, y: float, *, after: bool, marked: bool = False) -> None:
    if marked:
        canvas.marker("triangle", x, y, 4.0)
    elif after:
        canvas.marker("circle", x, y, 1.9, colour=ACCENT)
    else:
        canvas.add("circle", cx=x, cy=y, r=2.3, fill="none", stroke=SOFT, stroke_width=0.8)


def _axes_of_groups(plot: Plot, groups: Sequence[str]) -> None:
    """Draw the axes where the horizontal one has names."""
    canvas = plot.canvas
    x0, y0, x1, y1 = plot.area
    for value in nice_ticks(plot.y.low, plot.y.high):
        _, y = plot.at(plot.x.low, value)
        canvas.line(x0, y, x1, y, colour=RULE, width=0.5)
        canvas.text(x0 - 5, y + 3.5, f"{value:g}".replace("-", "−"), size=9.5, anchor="end", colour=SOFT)
    room = (x1 - x0) / max(len(groups), 1)
    for k, name in enumerate(groups):
        x, _ = plot.at(float(k), plot.y.low)
        canvas.text(x, y1 + 14, _cut(name, max(2, int(room / 6.5))), size=9.5, anchor="middle", colour=SOFT)
    canvas.line(x0, y1, x1, y1, colour=SOFT)
    canvas.line(x0, y0, x0, y1, colour=SOFT)
    canvas.text((x0 + x1) / 2, y1 + 29, plot.x.label, size=10, anchor="middle")
    middle = (y0 + y1) / 2
    turned = f"translate(11 {middle:.1f}) rotate(-90)"
    canvas.add("text", plot.y.label, transform=turned, text_anchor="middle", font_size=10.0, fill=INK)


def _cut(text: str, length: int) -> str:
    return text if len(text) <= length else text[: length - 1] + "…"


def _means(plot: Plot, x: Array, thou: Array) -> None:
    """Mark the mean of each stretch of the column that holds as many rows as the others."""
    order = np.argsort(x, kind="stable")
    count = min(_BINS, len(x) // _FEWEST_IN_A_BIN)
    for part in np.array_split(order, count) if count else ():
        _mean_mark(plot, float(np.mean(x[part])), thou[part])


def _mean_mark(plot: Plot, x: float, thou: Array) -> None:
    mean, error = float(np.mean(thou)), float(np.std(thou, ddof=1) / np.sqrt(len(thou)))
    px, py = plot.at(x, mean)
    ends = [plot.at(x, mean + side * 2.0 * error)[1] for side in (-1.0, 1.0)]
    plot.canvas.line(px, ends[0], px, ends[1], width=1.6)
    for end in ends:
        plot.canvas.line(px - 3, end, px + 3, end, width=1.6)
    plot.canvas.rectangle(px - 3, py - 3, 6, 6, fill=PAPER, edge=INK, edge_width=1.4)


def tail_strips(residuals: Residuals, width: float = 690.0) -> Markup:
    """Draw the residuals of each tail on a line of its own, before and after side by side.

    Parameters
    ----------
    residuals : Residuals
        The rows.
    width : float
        Width. [canvas units]

    Returns
    -------
    Markup
        The figure; of many tails the ones with the largest mean.
    """
    tails = residuals.diagnosis.used.tails
    before, after = residuals.before_in * THOU_PER_IN, residuals.after_in * THOU_PER_IN
    panels = [("before", before, False)]
    if residuals.diagnosis.causes:
        panels.append(("with the extension", after, True))
    names = sorted(np.unique(tails).tolist(), key=lambda name: -abs(float(np.mean(before[tails == name]))))
    shown = sorted(names[:MOST_TAILS])
    row, top, left, gap = 13.0, 22.0, 74.0, 16.0
    height = top + row * len(shown) + 34
    description = "One line for each aircraft; every point is one inspection, the square is their mean"
    canvas = Canvas(width, height, "Measured less predicted, by tail", description)
    both = np.concatenate([before, after])
    axis = Axis.around("", both.tolist(), 0.03)
    room = (width - left - 8 - gap * (len(panels) - 1)) / len(panels)
    for k, (name, thou, is_after) in enumerate(panels):
        start = left + k * (room + gap)
        _strip_panel(canvas, axis, (start, top, start + room, top + row * len(shown)), name)
        for i, tail in enumerate(shown):
            y = top + row * (i + 0.5)
            if k == 0:
                canvas.text(left - 8, y + 3.5, _cut(tail, 10), size=9.5, anchor="end")
            own = thou[tails == tail]
            for value in own:
                _point(canvas, _across(axis, start, room, float(value)), y, after=is_after)
            x = _across(axis, start, room, float(np.mean(own)))
            canvas.rectangle(x - 3, y - 3, 6, 6, fill=PAPER, edge=INK, edge_width=1.4)
    return canvas.svg()


def _across(axis: Axis, start: float, room: float, value: float) -> float:
    return start + (value - axis.low) / (axis.high - axis.low) * room


def _strip_panel(canvas: Canvas, axis: Axis, area: tuple[float, float, float, float], name: str) -> None:
    x0, y0, x1, y1 = area
    canvas.text(x0, y0 - 9, name, size=11, bold=True)
    for value in nice_ticks(axis.low, axis.high, 6):
        x = _across(axis, x0, x1 - x0, value)
        canvas.line(x, y0, x, y1, colour=SOFT if value == 0.0 else RULE, width=1.0 if value == 0.0 else 0.5)
        canvas.text(x, y1 + 13, f"{value:g}".replace("-", "−"), size=9.5, anchor="middle", colour=SOFT)
    canvas.line(x0, y1, x1, y1, colour=SOFT)
    canvas.text((x0 + x1) / 2, y1 + 27, "measured − predicted, thou", size=10, anchor="middle")


def measured_against_predicted(residuals: Residuals, width: float = 335.0, height: float = 236.0) -> Markup:
    """Draw measured against predicted displacement, before and with the extension.

    Parameters
    ----------
    residuals : Residuals
        The rows.
    width, height : float
        Size. [canvas units]

    Returns
    -------
    Markup
        The figure.
    """
    d = residuals.diagnosis
    predicted, measured = d.predicted_in * THOU_PER_IN, d.used.measured_in * THOU_PER_IN
    extended = predicted + residuals.effect_in * THOU_PER_IN
    description = "Measured displacement of each inspection against the predicted one; on the line both are equal"
    canvas = Canvas(width, height, "Measured against predicted", description)
    values = np.concatenate([predicted, extended, measured]).tolist()
    plot = Plot(canvas, Axis.around("predicted, thou", values), Axis.around("measured, thou", values), top=24)
    plot.draw_axes(x_ticks=8)
    low, high = plot.x.low, plot.x.high
    canvas.line(*plot.at(low, low), *plot.at(high, high), colour=SOFT, dash="6 3")
    for x, y in zip(predicted, measured, strict=True):
        _point(canvas, *plot.at(float(x), float(y)), after=False)
    entries: list[tuple[str, bool]] = [("before", False)]
    if d.causes:
        entries.append(("with the extension", True))
        for x, y in zip(extended, measured, strict=True):
            _point(canvas, *plot.at(float(x), float(y)), after=True)
    for k, (label, is_after) in enumerate(entries if len(entries) > 1 else ()):
        x = plot.area[0] + 6 + 62 * k
        _point(canvas, x, 10, after=is_after)
        canvas.text(x + 7, 13.5, label, size=10)
    return canvas.svg()
