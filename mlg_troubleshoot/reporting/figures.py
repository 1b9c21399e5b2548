"""Figures as inline SVG: flat colours, and text or shape wherever a colour says something.

Primitives for every report: :func:`bar_chart`, :func:`scatter_plot`, :func:`line_plot`, all drawn on a
:class:`Canvas`, which escapes what it is given and carries a title and a description for readers who
cannot see it. A unit of a canvas is about 1 px on a screen and 0.25 mm on paper; its text is 11 units.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from markupsafe import Markup, escape

from mlg_troubleshoot.reporting.formats import number

INK = "#16202a"
SOFT = "#55606b"
RULE = "#9aa4ae"
PALE = "#e4e8ec"
PAPER = "#ffffff"
ACCENT = "#0b4f8a"

TEXT_SIZE = 11.0
# Average width of a character of the report's font, per unit of its size.
_CHARACTER = 0.62

Anchor = Literal["start", "middle", "end"]
Marker = Literal["circle", "square", "diamond", "triangle", "cross", "ring"]


def text_width(text: str, size: float = TEXT_SIZE) -> float:
    """Estimate the width of a text.

    Parameters
    ----------
    text : str
        The text.
    size : float
        Its size. [canvas units]

    Returns
    -------
    float
        Width. [canvas units]
    """
    wide = sum(2.0 if ord(c) > 0x2E80 else 1.0 for c in text)
    return wide * size * _CHARACTER


class Canvas:
    """An SVG being drawn.

    Parameters
    ----------
    width, height : float
        Size of the drawing. [canvas units]
    title : str
        What the figure is, read aloud by screen readers.
    description : str
        What it shows, in a sentence or two.
    """

    def __init__(self, width: float, height: float, title: str, description: str = "") -> None:
        self.width = width
        self.height = height
        self.title = title
        self.description = description
        self._parts: list[str] = []

    def add(self, element: str, content: str = "", **attributes: str | float | None) -> None:
        """Add an element; underscores in attribute names become hyphens, None leaves an attribute out.

        Parameters
        ----------
        element : str
            Name of the SVG element.
        content : str
            Its text; it is escaped.
        **attributes : str or float or None
            Its attributes; they are escaped.
        """
        written = []
        for name, value in attributes.items():
            if value is not None:
                shown = f"{value:.2f}".rstrip("0").rstrip(".") if isinstance(value, float) else str(value)
                written.append(f' {name.rstrip("_").replace("_", "-")}="{escape(shown)}"')
        body = f">{escape(content)}</{element}>" if content else "/>"
        self._parts.append(f"<{element}{''.join(written)}{body}")

    def line(
        self,
        x1: float,
        y1: float,
        x2: float,
        y2: float,
        *,
        colour: str = INK,
        width: float = 1.0,
        dash: str | None = None,
        cap: str | None = None,
    ) -> None:
        """Draw a straight line. [canvas units]"""
        self.add(
            "line",
            x1=float(x1),
            y1=float(y1),
            x2=float(x2),
            y2=float(y2),
            stroke=colour,
            stroke_width=float(width),
            stroke_dasharray=dash,
            stroke_linecap=cap,
        )

    def rectangle(
        self,
        x: float,
        y: float,
        width: float,
        height: float,
        *,
        fill: str = "none",
        edge: str | None = None,
        edge_width: float = 1.0,
        dash: str | None = None,
        radius: float = 0.0,
    ) -> None:
        """Draw a rectangle. [canvas units]"""
        self.add(
            "rect",
            x=float(x),
            y=float(y),
            width=max(float(width), 0.0),
            height=max(float(height), 0.0),
            rx=float(radius) if radius else None,
            fill=fill,
            stroke=edge,
            stroke_width=float(edge_width) if edge else None,
            stroke_dasharray=dash,
        )

    def polyline(
        self,
        points: Sequence[tuple[float, float]],
        *,
        colour: str = INK,
        width: float = 1.5,
        dash: str | None = None,
        fill: str = "none",
        closed: bool = False,
    ) -> None:
        """Draw a line through points, or a polygon. [canvas units]"""
        self.add(
            "polygon" if closed else "polyline",
            points=" ".join(f"{x:.1f},{y:.1f}" for x, y in points),
            fill=fill,
            stroke=colour,
            stroke_width=float(width),
            stroke_dasharray=dash,
            stroke_linejoin="round",
        )

    def text(
        self,
        x: float,
        y: float,
        text: str,
        *,
        size: float = TEXT_SIZE,
        bold: bool = False,
        colour: str = INK,
        anchor: Anchor = "start",
        halo: bool = False,
    ) -> None:
        """Write a text with its baseline at y; a halo keeps it readable across lines. [canvas units]"""
        if halo:
            width = text_width(text, size)
            left = {"start": x, "middle": x - width / 2, "end": x - width}[anchor]
            self.rectangle(left - 1.5, y - 0.8 * size, width + 3, size * 1.02, fill=PAPER)
        self.add(
            "text",
            text,
            x=float(x),
            y=float(y),
            font_size=float(size),
            font_weight="bold" if bold else None,
            fill=colour,
            text_anchor=None if anchor == "start" else anchor,
        )

    def marker(self, shape: Marker, x: float, y: float, size: float = 5.0, *, colour: str = INK) -> None:
        """Draw a marker centred on a point; `size` is half its width. [canvas units]"""
        s = size
        match shape:
            case "circle":
                self.add("circle", cx=float(x), cy=float(y), r=float(s), fill=colour)
            case "ring":
                self.add("circle", cx=float(x), cy=float(y), r=float(s), fill=PAPER, stroke=colour, stroke_width=1.6)
            case "square":
                self.rectangle(x - s, y - s, 2 * s, 2 * s, fill=colour)
            case "diamond":
                corners = [(x, y - s), (x + s, y), (x, y + s), (x - s, y)]
                self.polyline(corners, fill=colour, colour=colour, width=1.0, closed=True)
            case "triangle":
                corners = [(x, y - s), (x + s, y + 0.8 * s), (x - s, y + 0.8 * s)]
                self.polyline(corners, fill=colour, colour=colour, width=1.0, closed=True)
            case "cross":
                self.line(x - s, y - s, x + s, y + s, colour=colour, width=2.0)
                self.line(x - s, y + s, x + s, y - s, colour=colour, width=2.0)

    def svg(self, css_class: str = "figure") -> Markup:
        """Return the finished drawing.

        Parameters
        ----------
        css_class : str
            Class of the SVG element.

        Returns
        -------
        Markup
            The SVG element.
        """
        spoken = escape(f"{self.title}. {self.description}" if self.description else self.title)
        return Markup(
            f'<svg class="{escape(css_class)}" viewBox="0 0 {self.width:g} {self.height:g}" '
            f'width="{self.width:g}" height="{self.height:g}" role="img" aria-label="{spoken}">'
            f"<title>{escape(self.title)}</title>{''.join(self._parts)}</svg>"
        )


def nice_ticks(low: float, high: float, about: int = 5) -> list[float]:
    """Choose round values between two numbers.

    Parameters
    ----------
    low, high : float
        Ends of the axis.
    about : int
        How many values are wanted, roughly.

    Returns
    -------
    list of float
        Values at steps of 1, 2 or 5 times a power of ten.
    """
    span = high - low
    if not math.isfinite(span) or span <= 0.0:
        return [low]
    raw = span / max(about, 1)
    power = 10.0 ** math.floor(math.log10(raw))
    step = next(m * power for m in (1.0, 2.0, 5.0, 10.0) if m * power >= raw * 0.999)
    first, last = math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9)
    return [k * step for k in range(first, last + 1)]


def _decimals(ticks: Sequence[float]) -> int:
    if len(ticks) < 2:
        return 3
    return max(0, -math.floor(math.log10(ticks[1] - ticks[0]) + 1e-9))


@dataclass(frozen=True, slots=True)
class Axis:
    """A linear axis.

    Parameters
    ----------
    label : str
        Quantity and unit.
    low, high : float
        Its ends, in the data's unit.
    """

    label: str
    low: float
    high: float

    @classmethod
    def around(cls, label: str, values: Sequence[float], margin: float = 0.06) -> Axis:
        """Make an axis that holds all finite values.

        Parameters
        ----------
        label : str
            Quantity and unit.
        values : sequence of float
            What it must hold.
        margin : float
            Room on both sides, as a share of the span. [1]

        Returns
        -------
        Axis
            The axis.
        """
        finite = [v for v in values if math.isfinite(v)] or [0.0, 1.0]
        low, high = min(finite), max(finite)
        room = (high - low) * margin or abs(high) * 0.1 or 1.0
        return cls(label, low - room, high + room)


@dataclass(frozen=True, slots=True)
class Series:
    """Points of one kind in a plot.

    Parameters
    ----------
    label : str
        Its name in the legend.
    x, y : tuple of float
        Coordinates; a pair with a NaN is a gap.
    marker : str or None
        Shape of its points; None draws none.
    dash : str or None
        Dashes of its line; None is solid.
    colour : str
        Its colour, which never stands alone: marker, dashes and label say the same.
    width : float
        Width of its line. [canvas units]
    low, high : tuple of float or None
        Ends of an interval at each point.
    """

    label: str
    x: tuple[float, ...]
    y: tuple[float, ...]
    marker: Marker | None = None
    dash: str | None = None
    colour: str = INK
    width: float = 1.8
    low: tuple[float, ...] | None = None
    high: tuple[float, ...] | None = None


@dataclass(frozen=True, slots=True)
class Band:
    """A marked range of the vertical axis.

    Parameters
    ----------
    label : str
        What it marks.
    low, high : float
        Its ends, in the data's unit.
    """

    label: str
    low: float
    high: float


class Plot:
    """Axes on a canvas: what the plots of this module and of others are drawn in.

    Parameters
    ----------
    canvas : Canvas
        Where to draw.
    x, y : Axis
        The axes.
    left, right, top, bottom : float
        Margins around the plotting area. [canvas units]
    """

    def __init__(
        self,
        canvas: Canvas,
        x: Axis,
        y: Axis,
        left: float = 52.0,
        right: float = 12.0,
        top: float = 10.0,
        bottom: float = 38.0,
    ) -> None:
        self.canvas = canvas
        self.x, self.y = x, y
        self.area = (left, top, canvas.width - right, canvas.height - bottom)

    def at(self, x: float, y: float) -> tuple[float, float]:
        """Return the place of a data point on the canvas.

        Parameters
        ----------
        x, y : float
            The point, in the data's units.

        Returns
        -------
        tuple of float
            Its place. [canvas units]
        """
        x0, y0, x1, y1 = self.area
        return (
            x0 + (x - self.x.low) / (self.x.high - self.x.low) * (x1 - x0),
            y1 - (y - self.y.low) / (self.y.high - self.y.low) * (y1 - y0),
        )

    def draw_axes(self, x_ticks: int = 6, y_ticks: int = 5) -> None:
        """Draw grid, ticks, frame and labels."""
        x0, y0, x1, y1 = self.area
        marks = nice_ticks(self.y.low, self.y.high, y_ticks)
        for value in marks:
            _, y = self.at(self.x.low, value)
            self.canvas.line(x0, y, x1, y, colour=PALE)
            self.canvas.text(x0 - 5, y + 3.5, number(value, _decimals(marks)), size=9.5, anchor="end", colour=SOFT)
        marks = nice_ticks(self.x.low, self.x.high, x_ticks)
        for value in marks:
            x, _ = self.at(value, self.y.low)
            self.canvas.line(x, y1, x, y1 + 4, colour=SOFT)
            self.canvas.text(x, y1 + 14, number(value, _decimals(marks)), size=9.5, anchor="middle", colour=SOFT)
        self.canvas.line(x0, y1, x1, y1, colour=SOFT)
        self.canvas.line(x0, y0, x0, y1, colour=SOFT)
        self.canvas.text((x0 + x1) / 2, y1 + 29, self.x.label, size=10, anchor="middle")
        self.canvas.add(
            "text",
            self.y.label,
            transform=f"translate(11 {(y0 + y1) / 2:.1f}) rotate(-90)",
            text_anchor="middle",
            font_size=10.0,
            fill=INK,
        )

    def draw_band(self, band: Band) -> None:
        """Draw a marked range with its label."""
        x0, _, x1, _ = self.area
        _, high = self.at(self.x.low, band.high)
        _, low = self.at(self.x.low, band.low)
        self.canvas.rectangle(x0, high, x1 - x0, low - high, fill=PALE)
        for y in (high, low):
            self.canvas.line(x0, y, x1, y, colour=SOFT, dash="5 3")
        self.canvas.text(x0 + 4, high - 3, band.label, size=9.5, colour=SOFT)

    def draw(self, series: Series, joined: bool) -> None:
        """Draw a series: its intervals, its line if it is joined, its points."""
        for i, (x, y) in enumerate(zip(series.x, series.y, strict=True)):
            if series.low is not None and series.high is not None and math.isfinite(x + y):
                px, top = self.at(x, series.high[i])
                _, bottom = self.at(x, series.low[i])
                self.canvas.line(px, top, px, bottom, colour=series.colour)
                for end in (top, bottom):
                    self.canvas.line(px - 3, end, px + 3, end, colour=series.colour)
        if joined:
            for run in _runs(series):
                places = [self.at(x, y) for x, y in run]
                self.canvas.polyline(places, colour=series.colour, width=series.width, dash=series.dash)
        if series.marker is not None:
            for x, y in (p for run in _runs(series) for p in run):
                self.canvas.marker(series.marker, *self.at(x, y), 4.0, colour=series.colour)

    def draw_legend(self, series: Sequence[Series], x: float, y: float, joined: bool) -> None:
        """Draw the legend from its upper left corner. [canvas units]"""
        for i, one in enumerate(series):
            line = y + 15 * i
            if joined:
                self.canvas.line(x, line, x + 26, line, colour=one.colour, width=one.width, dash=one.dash)
            if one.marker is not None:
                self.canvas.marker(one.marker, x + 13, line, 4.0, colour=one.colour)
            self.canvas.text(x + 32, line + 3.5, one.label, size=10)


def _runs(series: Series) -> list[list[tuple[float, float]]]:
    """Stretches of a series without a gap."""
    runs: list[list[tuple[float, float]]] = [[]]
    for point in zip(series.x, series.y, strict=True):
        if math.isfinite(point[0]) and math.isfinite(point[1]):
            runs[-1].append(point)
        elif runs[-1]:
            runs.append([])
    return [run for run in runs if run]


def line_plot(
    series: Sequence[Series],
    x: Axis,
    y: Axis,
    title: str,
    description: str = "",
    *,
    band: Band | None = None,
    width: float = 430.0,
    height: float = 250.0,
) -> Markup:
    """Draw lines over a common axis.

    Parameters
    ----------
    series : sequence of Series
        The lines; dashes and markers tell them apart.
    x, y : Axis
        The axes.
    title, description : str
        What the figure is and what it shows.
    band : Band, optional
        A marked range of the vertical axis.
    width, height : float
        Size. [canvas units]

    Returns
    -------
    Markup
        The figure.
    """
    canvas = Canvas(width, height, title, description)
    plot = Plot(canvas, x, y)
    if band is not None:
        plot.draw_band(band)
    plot.draw_axes()
    for one in series:
        plot.draw(one, joined=True)
    plot.draw_legend(series, plot.area[0] + 10, plot.area[1] + 10, joined=True)
    return canvas.svg()


def scatter_plot(
    series: Sequence[Series],
    x: Axis,
    y: Axis,
    title: str,
    description: str = "",
    *,
    band: Band | None = None,
    diagonal: bool = False,
    width: float = 430.0,
    height: float = 300.0,
) -> Markup:
    """Draw points, for example measured against predicted.

    Parameters
    ----------
    series : sequence of Series
        The points; the marker tells the series apart.
    x, y : Axis
        The axes.
    title, description : str
        What the figure is and what it shows.
    band : Band, optional
        A marked range of the vertical axis.
    diagonal : bool
        True to draw the line on which both coordinates are equal.
    width, height : float
        Size. [canvas units]

    Returns
    -------
    Markup
        The figure.
    """
    canvas = Canvas(width, height, title, description)
    plot = Plot(canvas, x, y)
    if band is not None:
        plot.draw_band(band)
    plot.draw_axes()
    if diagonal:
        low, high = max(x.low, y.low), min(x.high, y.high)
        if low < high:
            canvas.line(*plot.at(low, low), *plot.at(high, high), colour=SOFT, dash="6 3")
    marked = [one if one.marker else _with_marker(one) for one in series]
    for one in marked:
        plot.draw(one, joined=False)
    plot.draw_legend(marked, plot.area[0] + 10, plot.area[1] + 10, joined=False)
    return canvas.svg()


def _with_marker(series: Series) -> Series:
    return Series(
        series.label, series.x, series.y, "circle", series.dash, series.colour, series.width, series.low, series.high
    )


@dataclass(frozen=True, slots=True)
class Bar:
    """One bar of a chart.

    Parameters
    ----------
    label : str
        Its name.
    value : float or None
        Its length in the data's unit; None draws none.
    text : str
        The value as it is written beside the bar.
    low, high : float or None
        Ends of an interval.
    style : {'solid', 'mid', 'open'}
        Black, grey or outlined: the caption says what they mean.
    """

    label: str
    value: float | None
    text: str
    low: float | None = None
    high: float | None = None
    style: Literal["solid", "mid", "open"] = "mid"


def draw_bar(canvas: Canvas, bar: Bar, x: float, y: float, height: float, per_value: float) -> float:
    """Draw one horizontal bar with its interval.

    Parameters
    ----------
    canvas : Canvas
        Where to draw.
    bar : Bar
        The bar.
    x, y : float
        Its upper left corner. [canvas units]
    height : float
        Its thickness. [canvas units]
    per_value : float
        Canvas units for one unit of the data.

    Returns
    -------
    float
        The right end of what was drawn. [canvas units]
    """
    if bar.value is None:
        return x
    length = max(bar.value * per_value, 0.8)
    fill, edge, dash = {
        "solid": (INK, INK, None),
        "mid": (RULE, SOFT, None),
        "open": (PAPER, SOFT, "3 2"),
    }[bar.style]
    canvas.rectangle(x, y, length, height, fill=fill, edge=edge, dash=dash)
    end = x + length
    if bar.low is not None and bar.high is not None:
        low, high, middle = x + bar.low * per_value, x + bar.high * per_value, y + height / 2
        inside = PAPER if bar.style == "solid" else INK
        canvas.line(max(low, x), middle, min(high, x + length), middle, colour=inside, width=1.2)
        canvas.line(x + length, middle, max(high, x + length), middle, width=1.2)
        canvas.line(max(low, x), middle - 2.5, max(low, x), middle + 2.5, colour=inside, width=1.2)
        canvas.line(high, middle - 2.5, high, middle + 2.5, width=1.2)
        end = max(end, high)
    return end


def bar_chart(
    bars: Sequence[Bar], title: str, description: str = "", *, label_width: float = 150.0, width: float = 430.0
) -> Markup:
    """Draw horizontal bars in the given order, each with its label, its interval and its value as text.

    Parameters
    ----------
    bars : sequence of Bar
        The bars.
    title, description : str
        What the figure is and what it shows.
    label_width : float
        Room for the labels. [canvas units]
    width : float
        Width. [canvas units]

    Returns
    -------
    Markup
        The figure.
    """
    row = 20.0
    canvas = Canvas(width, row * len(bars) + 4, title, description)
    longest = max([0.0, *(max(bar.value or 0.0, bar.high or 0.0) for bar in bars)])
    room = width - label_width - max([0.0, *(text_width(bar.text, 10) for bar in bars)]) - 14
    per_value = room / longest if longest > 0.0 else 0.0
    for i, bar in enumerate(bars):
        y = 2 + row * i
        canvas.text(label_width - 8, y + 13, bar.label, size=10, anchor="end")
        end = draw_bar(canvas, bar, label_width, y + 3, row - 7, per_value)
        canvas.text(end + 6, y + 13, bar.text, size=10)
    canvas.line(label_width, 0, label_width, canvas.height, colour=SOFT)
    return canvas.svg()
