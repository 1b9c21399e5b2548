"""Figures of the diagnosis report: its sign, residuals before and after, measured against
predicted, tails.

The seven lines of a diagnosis, as a person reads them on the terminal and on paper."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from markupsafe import Markup
from numpy.typing import NDArray

from mlg_troubleshoot.arrays import Array, Mask
from mlg_troubleshoot.decision.columns import (
    AXIAL_FLOAT,
    BY_NAME,
    CLEARANCE,
    COVARIATES,
)
from mlg_troubleshoot.decision.sentences import percent
from mlg_troubleshoot.diagnosis import Candidate, Diagnosis, NamedCause
from mlg_troubleshoot.diagnosis.faults import DataFault
from mlg_troubleshoot.reporting.figures import (
    ACCENT,
    PALE,
    PAPER,
    SMALL,
    SOFT,
    Axis,
    Canvas,
    Lengths,
    Plot,
    short,
)
from mlg_troubleshoot.reporting.html import environment
from mlg_troubleshoot.units import LengthUnit

_WORDS = ("DATA", "MISFIT", "CAUSE", "MODEL", "GAIN", "LEFT", "DO")
_KINDS = {
    "mm_as_in": "millimetres entered as inches",
    "factor_10": "misplaced decimal point",
    "swapped_joints": "two joints swapped",
    "implausible": "implausible",
    "restored_joint": "joint restored between its reading and the plunger's",
    "other_convention": "the other convention",
}
_CONDITIONS = {
    "rounded": "Rounded values",
    "censored": "Values at an end",
    "blank_not_at_random": "Blanks not at random",
    "copied": "Copied from the inspection before",
    "duplicate": "Written twice",
    "limit_written": "Limits in place of readings",
    "selected": "Selected gears",
    "landings_fall": "Landings that fall",
    "identical_cells": "Identical cells",
}
_VARIABLES = {c.variable: c.said for c in (*COVARIATES, AXIAL_FLOAT)}


# What is less likely than this is not worth a word, and more than so many are not read.
LEAST_SAID = 0.01
_MOST_SAID = 3


@dataclass(frozen=True, slots=True)
class DiagnosisLine:
    """One of the seven lines: its number, what it is about in one word, and what it says."""

    number: int
    word: str
    text: str


def kind_words(kind: str) -> str:
    return _KINDS.get(kind, kind.replace("_", " "))


def condition_words(kind: str) -> str:
    return _CONDITIONS[kind]


def column_words(name: str) -> str:
    kind, _, joint = name.rpartition("_")
    if joint.isdigit() and kind in (CLEARANCE.name, AXIAL_FLOAT.name):
        return f"{BY_NAME[kind].said} of joint {joint}"
    if name == "predicted":
        return "predicted displacement"
    return _VARIABLES.get(name, name.replace("_", " "))


def chance_words(chance: float) -> str:
    """Write a probability in percent: one of a model is never 0 or 1."""
    return percent(min(max(chance, 1e-6), 1.0 - 1e-6))


def name_words(cause: str) -> str:
    """Name a cause as a person would: its identifier is for files."""
    return cause.replace("_", " ")


def target_words(candidate: Candidate) -> str:
    """Name a cause with its target."""
    return " ".join(filter(None, (name_words(candidate.cause.name), candidate.target)))


def cause_words(cause: NamedCause) -> str:
    candidate = cause.candidate
    words = candidate.cause.words(candidate.target)
    if not candidate.stands_in:
        return words
    needed = " and ".join(map(column_words, candidate.cause.needs)) or "every joint as read"
    return f"{words} (not testable without {needed})"


def seven_lines(d: Diagnosis, unit: LengthUnit = LengthUnit.THOU) -> tuple[DiagnosisLine, ...]:
    """Say what a diagnosis found: data, misfit, cause, model, gain, residual, what to do."""
    # Blanks of every kind break a line of the terminal, and long words where they must.
    texts = [" ".join(text.split()) for text in _said(d, unit, *_WORDS)]
    return tuple(
        DiagnosisLine(k, word, text)
        for k, (word, text) in enumerate(zip(_WORDS, texts, strict=True), 1)
    )


def headline(d: Diagnosis, unit: LengthUnit) -> str:
    """Say the verdict of a diagnosis in one or two sentences."""
    return next(_said(d, unit, "HEADLINE")).strip()


def _said(d: Diagnosis, unit: LengthUnit, *parts: str) -> Iterator[str]:
    words = {
        "kind_words": kind_words,
        "fitted_numbers": fitted_numbers,
    }
    context = {
        **words,
        "d": d,
        "by_slip": by_slip,
        "likeliest": likeliest(d),
        "lengths": Lengths(unit),
    }
    said = environment().get_template("diagnosis.txt.j2").make_module(context)
    return (str(getattr(said, part)).replace("\u200b", "") for part in parts)


def likeliest(d: Diagnosis) -> list[tuple[str, float]]:
    """What may be wrong and is not said already, likeliest first, each with its probability."""
    said = {c.candidate.key for c in (*d.causes, *d.also_possible, *d.beside)}
    found = [
        (f"{name_words(cause)}{f' {target}' if target else ''}", chance)
        for (cause, target), chance in d.probabilities.items()
        if (cause, target) not in said and chance >= LEAST_SAID
    ]
    return found[:_MOST_SAID]


def by_slip(faults: Sequence[DataFault]) -> list[list[DataFault]]:
    """Gather the cells of one entry error in a row."""
    slips: dict[tuple[int, str], list[DataFault]] = {}
    for fault in faults:
        slips.setdefault((fault.row, fault.kind), []).append(fault)
    return list(slips.values())


def fitted_numbers(d: Diagnosis, lengths: Lengths) -> tuple[str, ...]:
    """Write the fitted parameters of the named causes with their intervals, lengths in the reader's
    unit.
    """
    parts = []
    for c in d.causes:
        for name, value in c.parameters.items():
            words, _, per = name.partition("_in_per_")
            is_length = name.endswith("_in") and not isinstance(value, str)

            def said(number: float, is_length: bool = is_length) -> str:
                return lengths.bare(number, fine=1) if is_length else f"{number:.4g}"

            interval = c.interval_shown.get(name)
            band = "" if interval is None else f" (95 % {said(interval[0])} to {said(interval[1])})"
            unit = f" {lengths.unit}" if is_length else f" in per {per}" if per else ""
            shown = value if isinstance(value, str) else said(value) + unit
            parts.append(f"{name_words(words.removesuffix('_in'))} {shown}{band}")
    return tuple(parts)


environment().filters.update(
    chance_words=chance_words,
    name_words=name_words,
    cause_words=cause_words,
    target_words=target_words,
    column_words=column_words,
    condition_words=condition_words,
)


Texts = NDArray[np.str_]

# Width and height of one plot of two side by side. [canvas units]
_PLOT = (335, 236)
_BINS = 8
_FEWEST_IN_A_BIN = 5
# Length of a legend's text. [characters]
_MARKED = 24
MOST_TAILS = 36
_UNITS = {c.variable: "in" if c.is_length else c.unit for c in COVARIATES}


@dataclass(frozen=True)
class FittedRows:
    """Rows as they were measured, predicted before and after a fit, in the unit that is drawn.

    fit: what the fit is; empty without one.
    """

    measured: Array
    predicted: Array
    fitted: Array
    fit: str
    unit: str

    @property
    def axis(self) -> Axis:
        """The axis that all plots of residuals share, so that they can be compared."""
        both = np.concatenate([self.left(after=False), self.left(after=True)])
        return Axis.around(f"measured − predicted, {self.unit}", both.tolist())

    def left(self, *, after: bool) -> Array:
        """What the prediction leaves of each row."""
        return self.measured - (self.fitted if after else self.predicted)


def effect_of(d: Diagnosis) -> Array:
    """What the named causes add to the prediction, shape (n,); zero if none is named. [in]"""
    effects = [cause.effect_in for cause in d.causes]
    total: Array = np.sum([np.zeros_like(d.misfit_in), *effects], axis=0)
    return total


def rows_of(d: Diagnosis, unit: LengthUnit) -> FittedRows:
    """The rows behind a diagnosis, before and after its extension."""
    return FittedRows(
        d.used.measured_in * unit.per_inch,
        d.predicted_in * unit.per_inch,
        (d.predicted_in + effect_of(d)) * unit.per_inch,
        "with the extension" if d.causes else "",
        str(unit),
    )


@dataclass(frozen=True, slots=True)
class ResidualAxis:
    """What residuals are drawn against.

    values: a number for each row, NaN where missing; of names the place of its own among them.
    names: what the numbers stand for, where the column holds words.
    marked: rows that the cause acts on, where it acts on some only.
    """

    label: str
    values: Array
    names: tuple[str, ...] = ()
    marked: Mask | None = None
    marked_label: str = ""


def axes_of(d: Diagnosis, joints: Iterable[int], unit: LengthUnit) -> dict[str, ResidualAxis]:
    """What residuals can be drawn against, by the name of the column; the prediction first."""
    table = d.used
    predicted = d.predicted_in * unit.per_inch
    axes = {"predicted": ResidualAxis(f"predicted displacement, {unit}", predicted)}
    for name, values in table.quantities.items():
        label = ", ".join(filter(None, (column_words(name), _UNITS.get(name))))
        if name == "day":
            label = f"days since {table.first_day}" if table.first_day else "day"
        axes[name] = ResidualAxis(label, values)
    for name, texts in table.factors.items():
        names = sorted({str(each) for each in texts if each})
        places = [names.index(str(each)) if each else np.nan for each in texts]
        axes[name] = ResidualAxis(column_words(name), np.array(places, float), tuple(names))
    for column, lengths_in in (
        (CLEARANCE, table.clearance_in),
        (AXIAL_FLOAT, table.axial_float_in),
    ):
        for joint, own in zip(joints, () if lengths_in is None else lengths_in.T, strict=False):
            name = column.header(joint)
            axes[name] = ResidualAxis(f"{column_words(name)}, {unit}", own * unit.per_inch)
    return axes


def against_cause(
    d: Diagnosis, axes: Mapping[str, ResidualAxis], candidate: Candidate, unit: LengthUnit
) -> ResidualAxis:
    """Choose what to draw residuals against: the column that the cause lives on, else the
    prediction.
    """
    table = d.used
    setting = candidate.setting
    joints = [setting["joint"]] if "joint" in setting else list(setting.get("pair", ()))
    if joints:
        least = np.stack([axes[CLEARANCE.header(n)].values for n in joints]).min(axis=0)
        named = " and ".join(f"#{joint}" for joint in joints)
        smaller = "smaller " if len(joints) > 1 else ""
        return ResidualAxis(f"{smaller}clearance of {named}, {unit}", least)
    if "column" in setting:
        return axes.get(setting["column"], axes["predicted"])
    if "tail" in setting and "day" in axes:
        # The days, with the rows of an aircraft or of its gear marked.
        rows = table.factors["tail_no"] == setting["tail"]
        if "side" in setting:
            rows = rows & (table.factors["side"] == setting["side"])
        label = short(str(candidate.target), _MARKED)
        return replace(axes["day"], marked=rows, marked_label=label)
    floats = [axis for name, axis in axes.items() if name.startswith(f"{AXIAL_FLOAT.name}_")]
    for need in candidate.cause.needs:
        if need == AXIAL_FLOAT.variable and floats:
            return max(floats, key=lambda axis: float(np.nansum(axis.values**2)))
        if need in axes:
            return axes[need]
    return axes["predicted"]


def split_by(
    name: str, column: ResidualAxis, other: ResidualAxis, left: Array
) -> tuple[Mask, str, str] | None:
    """Split the rows by a column, so that what moves with two columns together can be seen."""
    x = other.values
    if not column.names:
        known = np.isfinite(column.values)
        half = float(np.median(column.values[known])) if known.any() else np.nan
        words = column_words(name)
        shown = f"{half:.0f}" if abs(half) >= 100.0 else f"{half:.3g}"
        return column.values >= half, f"{words} {shown} and more", f"{words} below {shown}"
    slopes = {}
    for place, level in enumerate(column.names):
        rows = (column.values == place) & np.isfinite(x)
        if rows.sum() > 3 and np.std(x[rows]) > 0.0:
            slope = float(np.polyfit(x[rows], left[rows], 1)[0])
            slopes[level] = abs(slope) * np.sqrt(rows.sum())
    if not slopes:
        return None
    level = max(slopes, key=lambda each: slopes[each])
    return column.values == column.names.index(level), level, f"not {level}"


def residual_plot(
    fitted: FittedRows,
    against: ResidualAxis,
    title: str,
    *,
    after: bool = False,
    only: Mask | None = None,
) -> Markup:
    """Draw residuals against a column, with the mean of each stretch or group and twice its
    standard error.
    """
    y = fitted.left(after=after)
    if only is not None:
        y = np.where(only, y, np.nan)
    axis = fitted.axis
    x = against.values
    names = against.names
    canvas = Canvas(*_PLOT, title, f"{axis.label}, against {against.label}")
    if names:
        across = Axis(against.label, -0.6, len(names) - 0.4)
        # Points of one group stand side by side in the order of the rows, so that none hides
        # another.
        x = x + 0.5 * (np.arange(len(x)) * 0.618 % 1.0 - 0.5)
    else:
        across = Axis.around(against.label, x.tolist(), 0.03)
    plot = Plot(canvas, across, axis, top=24)
    plot.draw_axes(names=names)
    canvas.text(plot.area[0] + 12j, title, bold=True)
    canvas.line(plot.at(plot.x.low, 0.0), plot.at(plot.x.high, 0.0), colour=SOFT)
    marked = np.zeros(len(y), bool) if against.marked is None else against.marked
    known = np.isfinite(x) & np.isfinite(y)
    # What is marked stands on top.
    for row in sorted(np.flatnonzero(known).tolist(), key=lambda row: bool(marked[row])):
        at = plot.at(float(x[row]), float(y[row]))
        _point(canvas, at, after=after, marked=bool(marked[row]))
    rows = known & marked if against.marked is not None else known
    if names:
        parts = [np.flatnonzero(known & (against.values == k)) for k in range(len(names))]
        centres = [float(k) for k in range(len(names))]
    else:
        # The mean of each stretch of the column that holds as many rows as the others.
        order = np.flatnonzero(rows)[np.argsort(x[rows], kind="stable")]
        stretches = max(1, min(_BINS, len(order) // _FEWEST_IN_A_BIN))
        parts = [p for p in np.array_split(order, stretches) if len(p) >= _FEWEST_IN_A_BIN]
        centres = [float(np.mean(x[part])) for part in parts]
    for centre, part in zip(centres, parts, strict=True):
        if len(part) >= 2:
            _mean_mark(plot, centre, y[part])
    if against.marked is not None:
        canvas.marker("triangle", plot.area[2] - 6 + 8j, 4.0)
        canvas.text(plot.area[2] - 14 + 12j, against.marked_label, size=SMALL, anchor="end")
    return canvas.svg()


def _point(canvas: Canvas, at: complex, *, after: bool, marked: bool = False) -> None:
    if marked:
        canvas.marker("triangle", at, 4.0)
    elif after:
        canvas.marker("circle", at, 1.9, ACCENT)
    else:
        canvas.circle(at, 2.3, colour=SOFT, width=0.8)


def _mean_mark(plot: Plot, x: float, values: Array) -> None:
    mean = float(np.mean(values))
    error = float(np.std(values, ddof=1) / np.sqrt(len(values)))
    low, high = (plot.at(x, mean + 2.0 * end) for end in (-error, error))
    plot.canvas.polyline([low - 3, low + 3, low, high, high - 3, high + 3], width=1.6)
    _square(plot.canvas, plot.at(x, mean))


def _square(canvas: Canvas, at: complex) -> None:
    """The mark of a mean."""
    canvas.rectangle(at - (3 + 3j), 6 + 6j, PAPER, width=1.4)


def lanes(title: str, across: Axis, names: Sequence[str], high: float = 20.0) -> Plot:
    """Axes of one of two figures side by side with a lane for each name: that of the first reaches
    from 0 to 1.
    """
    margins = {"left": 62.0, "top": 22.0, "bottom": 38.0}
    height = margins["top"] + high * len(names) + margins["bottom"]
    canvas = Canvas(_PLOT[0], height, title, f"one line per name: {', '.join(names)}")
    plot = Plot(canvas, across, Axis("", float(len(names)), 0.0), **margins)
    plot.draw_axes(lanes=True)
    left, top, right, _ = plot.area
    canvas.text(complex(left, top - 9), title, bold=True)
    for place, name in enumerate(names, 1):
        base = complex(left, top + high * place)
        middle = base + (-6 + 3.5j) - 1j * high / 2
        canvas.text(middle, short(name, 9), size=SMALL, anchor="end")
        canvas.line(base, base + right - left, colour=PALE)
    return plot


def tail_strips(rows: FittedRows, tails: Texts) -> list[Markup]:
    """Draw the residuals of each tail in a lane of its own, before and, where the model was
    extended, after; the square is their mean.
    """
    before = rows.left(after=False)

    def size(name: str) -> float:
        return abs(float(np.mean(before[tails == name])))

    names = sorted(np.unique(tails).tolist(), key=size, reverse=True)
    shown = sorted(names[:MOST_TAILS])
    panels = [("by tail, before", before, False)]
    if rows.fit:
        panels.append((f"by tail, {rows.fit}", rows.left(after=True), True))
    figures = []
    for title, values, after in panels:
        plot = lanes(title, rows.axis, shown, 13.0)
        for place, tail in enumerate(shown):
            own = values[tails == tail].tolist()
            for value in own:
                _point(plot.canvas, plot.at(value, place + 0.5), after=after)
            _square(plot.canvas, plot.at(float(np.mean(own)), place + 0.5))
        figures.append(plot.canvas.svg())
    return figures


def measured_against_predicted(rows: FittedRows) -> Markup:
    description = "Each measured value against the predicted one; on the line both are equal"
    canvas = Canvas(*_PLOT, "Measured against predicted", description)
    values = np.concatenate([rows.predicted, rows.fitted, rows.measured]).tolist()
    plot = Plot(
        canvas,
        Axis.around(f"predicted, {rows.unit}", values),
        Axis.around(f"measured, {rows.unit}", values),
        top=24,
    )
    plot.draw_axes(x_ticks=8)
    low = plot.x.low
    high = plot.x.high
    canvas.line(plot.at(low, low), plot.at(high, high), colour=SOFT, dash="6 3")
    shown = [
        ("before", rows.predicted, False),
        *([(rows.fit, rows.fitted, True)] if rows.fit else []),
    ]
    for k, (label, x_values, is_after) in enumerate(shown):
        for x, y in zip(x_values, rows.measured, strict=True):
            _point(canvas, plot.at(float(x), float(y)), after=is_after)
        if rows.fit:
            key = plot.area[0] + 6 + 62 * k + 10j
            _point(canvas, key, after=is_after)
            canvas.text(key + (7 + 3.5j), label, size=SMALL)
    return canvas.svg()
