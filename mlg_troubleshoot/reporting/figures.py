"""Figures as inline SVG: flat colours, and text or shape wherever a colour says something.

A :class:`Canvas` escapes what it is given and carries a title and a description for readers who
cannot see it; a :class:`Plot` puts axes and series on it. A unit of a canvas is about 1
px on a screen and 0.25 mm on paper; its text is 11 units.

Numbers as a reader sees them: every figure, table and sentence of a report formats with
these.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from itertools import groupby
from typing import Any, Literal

from markupsafe import Markup, escape

from mlg_troubleshoot.decision import sentences
from mlg_troubleshoot.units import LengthUnit, said_in
from mlg_troubleshoot.visible import visible

ABSENT = "–"
MINUS = "−"


def number(value: float | None, decimals: int, signed: bool = False) -> str:
    if value is None or not math.isfinite(value):
        return ABSENT
    text = f"{abs(value):.{decimals}f}"
    if float(text) == 0.0:
        return text
    return (MINUS if value < 0 else "+" if signed else "") + text


@dataclass(frozen=True, slots=True)
class Lengths:
    """How a document writes lengths: in the one unit that its reader chose."""

    unit: LengthUnit = LengthUnit.INCH

    def bare(self, value_in: float | None, signed: bool = False, fine: int = 0) -> str:
        """Write the number alone; `fine` adds decimals."""
        value = None if value_in is None else self.unit.from_inches(value_in)
        return number(value, self.unit.decimals + fine, signed)

    def full(self, value_in: float | None, signed: bool = False, fine: int = 0) -> str:
        """Write a length with its unit: ``0.0472 in``."""
        text = self.bare(value_in, signed, fine)
        return text if text == ABSENT else f"{text}\u00a0{self.unit}"

    def said(self, sentence: str) -> str:
        """Say a sentence of the program in this unit."""
        return said_in(sentence, self.unit)


def percent(share: float | None) -> str:
    """Write a probability: ``25 %``, ``< 0.1 %``, ``> 99.9 %``; never a rounded 0 or 100 that is
    neither.
    """
    if share is None or math.isnan(share):
        return ABSENT
    return sentences.percent(share).replace(" ", "\u00a0")


def joint_list(joints: Sequence[int]) -> str:
    return sentences.joint_list(joints) or ABSENT


def moment(value: datetime) -> str:
    zone = value.tzname()
    return f"{value:%Y-%m-%d %H:%M}{f' {zone}' if zone else ''}"


def several(count: int, one: str, many: str | None = None) -> str:
    """Write a count with its noun: ``1 gear``, ``12 gears``."""
    return f"{count}\u00a0{one if count == 1 else many or one + 's'}"


def short(text: str, length: int) -> str:
    """Cut a text that is too long for its place."""
    return text if len(text) <= length else text[: length - 1] + "…"


def landings(ends: Mapping[str, float | None] | None) -> str:
    """Write the quantiles of a forecast, to two digits: it has no more."""
    if ends is None:
        return ABSENT
    said = ["beyond" if end is None else landings_count(end) for end in ends.values()]
    return said[0] if len({*said}) == 1 else ", ".join(said)


def landings_count(count: float | None) -> str:
    """Write landings that remain, to two digits: a forecast has no more."""
    return ABSENT if count is None else f"{float(f'{count:.2g}'):.0f}"


def minutes(value: float) -> str:
    """Write a time of work; less than half a minute is written as none."""
    return f"{value:.0f}\u00a0min" if value >= 0.5 else ""


INK = "#16202a"
SOFT = "#55606b"
RULE = "#9aa4ae"
PALE = "#e4e8ec"
PAPER = "#ffffff"
ACCENT = "#0b4f8a"

# Sizes of the text of a figure: names, and all else. [px]
TEXT_SIZE = 11
SMALL = 10
# Average width of a character of the report's font, per unit of its size.
_CHARACTER = 0.62

Anchor = Literal["start", "middle", "end"]
Marker = Literal["circle", "square", "diamond", "triangle", "ring"]
# Points and directions of a drawing are complex numbers: x to the right, y downward. [canvas units]
_CORNERS: dict[str, tuple[complex, ...]] = {
    "square": (-1 - 1j, 1 - 1j, 1 + 1j, -1 + 1j),
    "diamond": (-1j, 1, 1j, -1),
    "triangle": (-1j, 1 + 0.8j, -1 + 0.8j),
}


def _stroke(
    colour: str | None = INK, width: float = 1.0, dash: str | None = None, cap: str | None = None
) -> dict[str, Any]:
    """How a line is drawn: black, 1 unit wide and whole unless it says otherwise."""
    return {
        "stroke": colour,
        "stroke_width": width if colour else None,
        "stroke_dasharray": dash,
        "stroke_linecap": cap,
    }


def text_width(text: str, size: float) -> float:
    wide = sum(2.0 if ord(c) > 0x2E80 else 1.0 for c in text)
    return wide * size * _CHARACTER


class Canvas:
    """An SVG being drawn; title and description are read aloud by screen readers."""

    def __init__(self, width: float, height: float, title: str, description: str = "") -> None:
        self.width = width
        self.height = height
        self.title = title
        self.description = description
        self._parts: list[str] = []

    def add(self, element: str, content: str = "", **attributes: str | float | None) -> None:
        """Add an element; underscores in attribute names become hyphens, None leaves an attribute
        out.
        """
        written = []
        for name, value in attributes.items():
            if value is not None:
                # Digits need no escape: that would be most of the time of a drawing.
                shown = (
                    str(escape(value))
                    if isinstance(value, str)
                    else f"{value:.2f}".rstrip("0").rstrip(".")
                )
                written.append(f' {name.rstrip("_").replace("_", "-")}="{shown}"')
        body = f">{escape(visible(content))!s}</{element}>" if content else "/>"
        self._parts.append(f"<{element}{''.join(written)}{body}")

    def line(self, start: complex, end: complex, **stroke: Any) -> None:
        x1, y1, x2, y2 = start.real, start.imag, end.real, end.imag
        self.add("line", x1=x1, y1=y1, x2=x2, y2=y2, **_stroke(**stroke))

    def circle(self, at: complex, radius: float, fill: str = "none", **stroke: Any) -> None:
        self.add("circle", cx=at.real, cy=at.imag, r=radius, fill=fill, **_stroke(**stroke))

    def rectangle(self, corner: complex, size: complex, fill: str = "none", **stroke: Any) -> None:
        self.add(
            "rect",
            x=corner.real,
            y=corner.imag,
            width=size.real,
            height=size.imag,
            fill=fill,
            **_stroke(**stroke),
        )

    def polyline(self, points: Iterable[complex], fill: str = "none", **stroke: Any) -> None:
        """Draw a line through points; with a fill a closed one."""
        self.add(
            "polyline" if fill == "none" else "polygon",
            points=" ".join(f"{each.real:.1f},{each.imag:.1f}" for each in points),
            fill=fill,
            **_stroke(**{"width": 1.5, **stroke}),
            stroke_linejoin="round",
        )

    def text(
        self,
        at: complex,
        text: str,
        *,
        size: float = TEXT_SIZE,
        bold: bool = False,
        colour: str = INK,
        anchor: Anchor = "start",
    ) -> None:
        """Write a text, its baseline at a point."""
        self.add(
            "text",
            text,
            x=at.real,
            y=at.imag,
            font_size=size,
            font_weight="bold" if bold else None,
            fill=colour,
            text_anchor=None if anchor == "start" else anchor,
        )

    def marker(self, shape: Marker, at: complex, size: float = 5.0, colour: str = INK) -> None:
        """Draw a marker centred on a point; `size` is half its width. [canvas units]"""
        if shape == "ring":
            self.circle(at, size, PAPER, colour=colour, width=1.6)
        elif shape == "circle":
            self.circle(at, size, colour, colour=None)
        else:
            corners = [at + size * corner for corner in _CORNERS[shape]]
            self.polyline(corners, colour, colour=colour, width=1.0)

    def svg(self, css_class: str = "figure") -> Markup:
        title = visible(self.title)
        spoken = escape(f"{title}. {visible(self.description)}" if self.description else title)
        return Markup(
            f'<svg class="{escape(css_class)}" viewBox="0 0 {self.width:g} {self.height:g}" '
            f'width="{self.width:g}" height="{self.height:g}" role="img" aria-label="{spoken}">'
            f"<title>{escape(title)}</title>{''.join(self._parts)}</svg>"
        )


def nice_ticks(low: float, high: float, about: int = 5) -> list[float]:
    span = high - low
    if not math.isfinite(span) or span <= 0.0:
        return [low]
    raw = span / max(about, 1)
    power = 10.0 ** math.floor(math.log10(raw))
    steps = (multiple * power for multiple in (1.0, 2.0, 5.0, 10.0))
    step = next(each for each in steps if each >= raw * 0.999)
    first = math.ceil(low / step - 1e-9)
    last = math.floor(high / step + 1e-9)
    return [k * step for k in range(first, last + 1)]


def decimals_of(ticks: Sequence[float]) -> int:
    if len(ticks) < 2:
        return 3
    step = ticks[1] - ticks[0]
    return max(0, -math.floor(math.log10(step) + 1e-9))


@dataclass(frozen=True, slots=True)
class Axis:
    """A linear axis: quantity with its unit, and its ends in that unit."""

    label: str
    low: float
    high: float

    @classmethod
    def around(cls, label: str, values: Sequence[float], margin: float = 0.06) -> Axis:
        finite = [v for v in values if math.isfinite(v)] or [0.0, 1.0]
        low = min(finite)
        high = max(finite)
        room = (high - low) * margin or abs(high) * 0.1 or 1.0
        return cls(label, low - room, high + room)

    def ticks(self, about: int = 5) -> list[tuple[float, str]]:
        """Round numbers within it, each as it is written."""
        values = nice_ticks(self.low, self.high, about)
        return [(value, number(value, decimals_of(values))) for value in values]


class Plot:
    """Axes on a canvas, with margins around the plotting area. [canvas units]"""

    def __init__(
        self,
        canvas: Canvas,
        x: Axis,
        y: Axis,
        left: float | None = None,
        right: float = 12.0,
        top: float = 10.0,
        bottom: float = 38.0,
    ) -> None:
        self.canvas = canvas
        self.x = x
        self.y = y
        if left is None:
            # The label of the vertical axis ends 16 units from the edge; its numbers follow it.
            left = max(52.0, 24.0 + max(text_width(text, SMALL) for _, text in y.ticks()))
        self.area = (left, top, canvas.width - right, canvas.height - bottom)

    def at(self, x: float, y: float) -> complex:
        x0, y0, x1, y1 = self.area
        across = (x - self.x.low) / (self.x.high - self.x.low)
        up = (y - self.y.low) / (self.y.high - self.y.low)
        return complex(x0 + across * (x1 - x0), y1 - up * (y1 - y0))

    def draw_axes(
        self, x_ticks: int = 6, names: Sequence[str] = (), *, lanes: bool = False
    ) -> None:
        """Draw grid, ticks, frame and labels; names take the place of numbers on the horizontal
        axis. Of lanes, which their names distinguish, the grid is vertical, stronger at zero.
        """
        canvas = self.canvas
        x0, y0, x1, y1 = self.area
        numbers: dict[str, Any] = {"size": SMALL, "colour": SOFT}
        if not lanes:
            for value, text in self.y.ticks():
                start = self.at(self.x.low, value)
                canvas.line(start, complex(x1, start.imag), colour=PALE)
                canvas.text(start + (-5 + 3.5j), text, anchor="end", **numbers)
            canvas.line(complex(x0, y0), complex(x0, y1), colour=SOFT)
            canvas.add(
                "text",
                self.y.label,
                transform=f"translate(11 {(y0 + y1) / 2:.1f}) rotate(-90)",
                text_anchor="middle",
                font_size=SMALL,
                fill=INK,
            )
        room = max(2, int((x1 - x0) / max(len(names), 1) / 6.5))
        named = [(float(k), short(name, room)) for k, name in enumerate(names)]
        for value, text in named or self.x.ticks(x_ticks):
            foot = self.at(value, self.y.low)
            if lanes:
                colour, width = (SOFT, 1.0) if value == 0.0 else (RULE, 0.5)
                canvas.line(complex(foot.real, y0), foot, colour=colour, width=width)
            else:
                canvas.line(foot, foot + 4j, colour=SOFT)
            canvas.text(foot + 14j, text, anchor="middle", **numbers)
        canvas.line(complex(x0, y1), complex(x1, y1), colour=SOFT)
        canvas.text(complex((x0 + x1) / 2, y1 + 28), self.x.label, size=SMALL, anchor="middle")

    def draw(self, places: Iterable[tuple[float, float]], **stroke: Any) -> None:
        """Draw a line through points; a NaN is a gap."""
        for known, run in groupby(places, lambda at: all(map(math.isfinite, at))):
            if known:
                self.canvas.polyline([self.at(*each) for each in run], **{"width": 1.8, **stroke})
