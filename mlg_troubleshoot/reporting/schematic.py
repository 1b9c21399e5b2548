"""The linkage drawn in its planes: joints numbered in place, distinguished by shape, clearances
exaggerated.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any, Literal, Unpack

import numpy as np
from markupsafe import Markup

from mlg_troubleshoot.arrays import Array
from mlg_troubleshoot.decision.assessment import Assessment
from mlg_troubleshoot.gear.gear import Gear, JointSpec
from mlg_troubleshoot.geometry.mechanism import (
    Crank,
    Dyad,
    Guided,
    Lever,
    Mechanism,
    Slider,
    Slot,
    Towards,
    needs,
)
from mlg_troubleshoot.reporting.figures import (
    INK,
    PALE,
    PAPER,
    RULE,
    SOFT,
    Anchor,
    Canvas,
    Stroke,
    text_width,
)
from mlg_troubleshoot.reporting.formats import Lengths

JointState = Literal["over", "fine", "missing"]
JOINT_STATES: dict[JointState, str] = {
    "over": "over its limit",
    "fine": "within its limit",
    "missing": "not measured",
}


@dataclass(frozen=True, slots=True)
class Schematic:
    """The linkage drawn in its planes, all at one scale.

    panels: name of each plane, its drawing and the drawing's width [canvas units]. exaggeration:
    how many times larger than life the virtual links are drawn; None without any.
    """

    panels: tuple[tuple[str, Markup, float], ...]
    exaggeration: int | None


# Lengths of the drawing: its width, half of a joint's marker, the longest and the shortest arrow of
# a virtual link. [px]
_WIDTH = 690
_MARKER = 9.5
_LONGEST_ARROW = 42
_SHORTEST_ARROW = 2.5
# One scale for most reports, so that their drawings compare.
_LARGEST_EXAGGERATION = 100
# With more joints over their limit, frames would cover the linkage.
_MOST_FRAMES = 2
# Room for labels, supports and the slot above and below the linkage. [px]
_ABOVE = 44
_BELOW = 40

# Where a label is tried around a joint: every 15 degrees, none of them straight along a line, at
# these distances from its marker. [rad, px]
_TURNS = np.arange(24) * np.pi / 12 + 1e-6
_COSINES = np.cos(_TURNS)
_SINES = np.sin(_TURNS)
_RINGS = np.array([0, 5, 10, 16, 24, 34, 46, 60, 76, 94], float)

# Points and directions of a drawing are complex numbers: x to the right, y downward. [canvas units]
Segment = tuple[complex, complex]
Box = tuple[float, float, float, float]


def schematic(
    gear: Gear, assessment: Assessment, lengths: Lengths | None = None, width: float = _WIDTH
) -> Schematic:
    """Draw the linkage at mid-position, its joints numbered in place and their clearances
    exaggerated.
    """
    over = (assessment.over_travel_in or 0.0) >= -(assessment.under_travel_in or 0.0)
    directions = assessment.over_directions_rad if over else assessment.under_directions_rad
    clearance_in = assessment.inspection.clearance_in
    return _drawn(gear, clearance_in, directions, lengths or Lengths(), width)


def blank_schematic(gear: Gear) -> Schematic:
    """Draw the linkage with its joints numbered and named, none of them measured yet."""
    return _drawn(gear, {}, (), Lengths(), _WIDTH)


def _drawn(
    gear: Gear,
    clearance_in: Mapping[int, float],
    directions: Sequence[float],
    lengths: Lengths,
    width: float,
) -> Schematic:
    planes = (_PlaneDrawing(gear, plane.name) for plane in gear.reference.mechanism.planes)
    drawings = [drawing for drawing in planes if drawing.points]
    gap = 6.0
    side = 74.0
    free = width - gap * (len(drawings) - 1) - 2 * side * len(drawings)
    scale = free / sum(drawing.size.real for drawing in drawings)
    largest = max(clearance_in.values(), default=0.0)
    exaggeration = None
    if largest > 0.0 and directions:
        exaggeration = min(_LARGEST_EXAGGERATION, _one_digit(_LONGEST_ARROW / (largest * scale)))
    height = max(drawing.size.imag for drawing in drawings) * scale + _ABOVE + _BELOW
    shown = _Shown(
        gear,
        clearance_in,
        dict(zip(gear.joint_numbers, directions, strict=True)) if exaggeration else {},
        (exaggeration or 0) * scale,
        lengths,
    )
    return Schematic(
        tuple(drawing.draw(scale, side, height, shown) for drawing in drawings), exaggeration
    )


@dataclass(frozen=True, slots=True)
class _Shown:
    """What is shown at the joints: clearances, their directions, and how long an inch of clearance
    is drawn.
    """

    gear: Gear
    clearance_in: Mapping[int, float]
    angles: dict[int, float]
    per_inch: float
    lengths: Lengths

    def state(self, joint: int) -> JointState:
        return joint_state(self.gear.joint(joint), self.clearance_in.get(joint))

    def said(self, joint: int) -> str:
        state = self.state(joint)
        if state == "missing":
            return JOINT_STATES[state]
        over = f" {JOINT_STATES[state]}" if state == "over" else ""
        return self.lengths.full(self.clearance_in[joint]) + over

    def arrow(self, joint: int, place: complex) -> Segment | None:
        """The joint's clearance as an arrow from the edge of its marker; None if it would be too
        short to see.
        """
        length = self.clearance_in.get(joint, 0.0) * self.per_inch
        if joint not in self.angles or length <= _SHORTEST_ARROW:
            return None
        along = cmath.rect(1.0, -self.angles[joint])
        start = place + _MARKER * along
        return start, start + length * along

    def label(self, joint: int, name: str, *, strong: bool) -> list[_Line]:
        lines = [_Line(part, 8.5, False) for part in ([name] if strong else _two_lines(name))]
        state = self.state(joint)
        if state != "missing":
            mark = " OVER LIMIT" if strong else " OVER" if state == "over" else ""
            size = 10.5 if strong else 9.5
            lines.append(_Line(self.lengths.bare(self.clearance_in[joint]) + mark, size, True))
        return lines


def _one_digit(value: float) -> int:
    """Round down to one significant digit, at least 1."""
    if value < 1.0:
        return 1
    power = 10 ** math.floor(math.log10(value))
    return int(value // power * power)


class _PlaneDrawing:
    """One plane of the mechanism: its points, the links between them, and how they are drawn."""

    def __init__(self, gear: Gear, plane: str) -> None:
        self.gear = gear
        self.plane = plane
        self.mechanism: Mechanism = gear.reference.mechanism
        steps = self.mechanism.steps
        self.steps = [s for s in steps if self.mechanism.point(s.joint).plane == plane]
        # Points of another plane are drawn where they stand above this one.
        origin, axes = self.mechanism.frame(plane)
        self.points: dict[str, complex] = {}
        names = {name for step in self.steps for name in (step.joint, *needs(step))}
        for name in sorted(names):
            offset = self.mechanism.reference_in_space(name) - origin
            self.points[name] = complex(offset @ axes[0], offset @ axes[1])
        driven = [s for s in self.steps if isinstance(s, Dyad) and s.driven]
        self.cut = {s.upstream: s.joint for s in driven}
        self._shorten()
        places = self.points.values()
        if places:
            low, high = (
                complex(end(p.real for p in places), end(p.imag for p in places))
                for end in (min, max)
            )
            self.low = low
            self.size = high - low

    def _shorten(self) -> None:
        """Draw only the near end of the actuator: its anchor lies far from everything else."""
        others = np.array([p for name, p in self.points.items() if name not in self.cut])
        if not others.size:
            return
        span = max(np.ptp(others.real), np.ptp(others.imag))
        for anchor, joint in self.cut.items():
            run = self.points[anchor] - self.points[joint]
            share = min(1.0, 0.34 * span / abs(run))
            self.points[anchor] = self.points[joint] + share * run

    def draw(
        self, scale: float, side: float, height: float, shown: _Shown
    ) -> tuple[str, Markup, float]:
        """Draw the plane: links and supports, then joints with their clearances, then their
        names.
        """
        width = self.size.real * scale + 2 * side
        name = self.plane.replace("_", " ") + " plane"
        joints = [j for j in self.gear.joints if j.point in self.points]
        said = ", ".join(f"joint {j.number} {shown.said(j.number)}" for j in joints)
        canvas = Canvas(width, height, f"Linkage schematic, {name}", said)
        # Upward in the plane is to lower numbers on the canvas.
        corner = complex(side, (height + _ABOVE - _BELOW + self.size.imag * scale) / 2)
        at = {
            name: corner + scale * (point - self.low).conjugate()
            for name, point in self.points.items()
        }

        canvas.text(2, 11, name, size=10.5, bold=True, colour=SOFT)
        segments = self._links(canvas, at)
        boxes = self._obstacles(at)
        for point, place in at.items():
            if point not in self.cut:
                if self.mechanism.point(point).fixed:
                    _ground(canvas, place)
                if all(joint.point != point for joint in joints):
                    canvas.marker("circle", place.real, place.imag, 3.0)
        markers = _without_overlap({j.number: at[j.point] for j in joints})
        here = [j for j in joints if self.mechanism.point(j.point).plane == self.plane]
        for joint in joints:
            if joint not in here:
                state = shown.state(joint.number)
                _mark(canvas, markers[joint.number], str(joint.number), state, faded=True)
        for joint in here:
            place = at[joint.point]
            marker = markers[joint.number]
            arrow = shown.arrow(joint.number, place)
            if arrow is not None:
                _arrow(canvas, *arrow)
                segments.append(arrow)
                boxes.append(_box(*arrow))
            if marker != place:
                _line(canvas, place, marker, colour=SOFT, width=1.2)
                canvas.marker("circle", place.real, place.imag, 2.5)
                boxes.append(_box(marker, around=11 + 11j))
            _mark(canvas, marker, str(joint.number), shown.state(joint.number))
        over = [joint for joint in here if shown.state(joint.number) == "over"]
        for joint in sorted(here, key=lambda joint: joint not in over):
            strong = joint in over and len(over) <= _MOST_FRAMES
            lines = shown.label(joint.number, joint.name, strong=strong)
            _callout(canvas, markers[joint.number], lines, boxes, segments, strong)
        return name, canvas.svg("figure panel"), width

    def _obstacles(self, at: Mapping[str, complex]) -> list[Box]:
        """Boxes of what labels must not cover: markers, supports, the slot, actuator and plunger
        with their names.
        """
        boxes: list[Box] = [(0.0, 0.0, 130.0, 14.0)]
        pins = {s.pin for s in self.steps if isinstance(s, Slot)}
        for point, place in at.items():
            fixed = self.mechanism.point(point).fixed and point not in self.cut
            reach = 27.0 if point in pins or fixed else _MARKER
            half = 15.0 if fixed else 11.0
            # A support hidden by a label would be missed most: it counts three times.
            box = _box(place - complex(half, 11.0), place + complex(half, reach))
            boxes += [box] * (3 if fixed else 1)
        for step in self.steps:
            place = at[step.joint]
            if isinstance(step, Slider):
                along = cmath.rect(1.0, -step.axis)
                left, top, right, bottom = _box(place + 20 * along, place + 60 * along)
                boxes.append((left - 60, top - 6, right + 10, bottom + 6))
            if isinstance(step, Dyad) and step.driven:
                far = at[step.upstream]
                left, _top, right, bottom = _box(place, far)
                middle = (place + far).imag / 2
                boxes.append((left - 62, middle - 12, right + 8, bottom))
        return boxes

    def _links(self, canvas: Canvas, at: Mapping[str, complex]) -> list[Segment]:
        """Draw the rigid parts below, the links above; return the segments for the placing of
        labels.
        """
        segments = self._rigid_parts(canvas, at)
        for step in self.steps:
            place = at[step.joint]
            match step:
                case Dyad():
                    ends = at[step.upstream], at[step.downstream]
                    (_actuator if step.driven else _bar)(canvas, ends[0], place)
                    if not self._rigid(step.joint, step.downstream):
                        _bar(canvas, place, ends[1])
                    segments += [(ends[0], place), (place, ends[1])]
                case Crank():
                    _bar(canvas, at[step.pivot], place)
                    segments.append((at[step.pivot], place))
                case Slider():
                    segments += [_plunger(canvas, place, step.axis), (at[step.upstream], place)]
                    _bar(canvas, at[step.upstream], place)
                case Guided():
                    segments += _guides(canvas, step, at)
        return segments

    def _rigid_parts(self, canvas: Canvas, at: Mapping[str, complex]) -> list[Segment]:
        """Draw levers as plates, and the slot in its lever."""
        segments: list[Segment] = []
        for step in self.steps:
            if isinstance(step, (Lever, Slot)):
                first = step.follows if isinstance(step, Lever) else step.pin
                corners = at[first], at[step.pivot], at[step.joint]
                _polygon(canvas, *corners, fill=PALE, colour=RULE, width=7.0)
                _polygon(canvas, *corners, fill=PALE, colour=PALE, width=4.0)
                segments += combinations(corners, 2)
        for step in self.steps:
            if isinstance(step, Slot):
                pivot = at[step.pivot]
                pin = at[step.pin]
                along = _unit(pin - pivot)
                _tube(
                    canvas,
                    pin - 13 * along,
                    pin + 9 * along,
                    25,
                    PAPER,
                    cap="round",
                )
        return segments

    def _rigid(self, joint: str, pivot: str) -> bool:
        """Tell whether two points are already drawn as an edge of a rigid part."""
        return any(
            isinstance(s, Lever) and s.pivot == pivot and joint in (s.follows, s.joint)
            for s in self.steps
        )


def _without_overlap(markers: Mapping[int, complex]) -> dict[int, complex]:
    """Places of the joints' markers: at the joints, or next to them where two would overlap."""
    places = dict(markers)
    least = 2.0 * _MARKER + 2.0
    for _ in range(30):
        moved = False
        for one, other in combinations(sorted(places), 2):
            apart = places[other] - places[one]
            if abs(apart) < least - 1e-6:
                direction = _unit(apart) if abs(apart) > 1e-6 else 1.0
                push = (least - abs(apart)) / 2 * direction
                places[one] -= push
                places[other] += push
                moved = True
        if not moved:
            break
    return places


def _unit(run: complex) -> complex:
    return run / (abs(run) or 1.0)


def _box(*points: complex, around: complex = 0) -> Box:
    """The box about some points, with room around it."""
    xs = [p.real for p in points]
    ys = [p.imag for p in points]
    return (
        min(xs) - around.real,
        min(ys) - around.imag,
        max(xs) + around.real,
        max(ys) + around.imag,
    )


def _line(canvas: Canvas, start: complex, end: complex, **stroke: Unpack[Stroke]) -> None:
    canvas.line(start.real, start.imag, end.real, end.imag, **stroke)


def _polygon(canvas: Canvas, *corners: complex, fill: str, **stroke: Unpack[Stroke]) -> None:
    canvas.polyline([(p.real, p.imag) for p in corners], fill=fill, closed=True, **stroke)


def _tube(
    canvas: Canvas, start: complex, end: complex, width: float, fill: str, cap: str | None = None
) -> None:
    """A thick line with an outline."""
    _line(canvas, start, end, width=width, cap=cap)
    _line(canvas, start, end, width=width - 3, cap=cap, colour=fill)


def _bar(canvas: Canvas, start: complex, end: complex) -> None:
    _tube(canvas, start, end, 7, PAPER, cap="round")


def _actuator(canvas: Canvas, far: complex, joint: complex) -> None:
    """A cylinder towards its anchor, broken off, and its rod."""
    along = _unit(far - joint)
    neck = joint + 0.42 * (far - joint)
    _line(canvas, joint, neck, width=5)
    _tube(canvas, neck, far, 15, PALE)
    across = (3 - 10j) * along
    for break_at in (far - 3 * along, far + 3 * along):
        _line(canvas, break_at - across, break_at + across)
    left = neck.real < canvas.width / 2
    _named(canvas, neck + complex(-12 if left else 12, 16), "actuator", "end" if left else "start")


def _plunger(canvas: Canvas, joint: complex, axis: float) -> Segment:
    """The plunger beyond its pin, entering the valve."""
    along = cmath.rect(1.0, -axis)
    tip = joint + 30 * along
    end = joint + 52 * along
    _line(canvas, joint, tip, width=6)
    _tube(canvas, tip, end, 24, PALE)
    _named(canvas, (tip + end) / 2 - (18 + 7j), "plunger", "end")
    return joint, end


def _guides(canvas: Canvas, step: Guided, at: Mapping[str, complex]) -> list[Segment]:
    """The lines that a joint slides on, broken where they keep a direction, and its link."""
    place = at[step.joint]
    lines: list[tuple[str, Towards | None]] = [step.line, (step.upstream, step.across)]
    segments = []
    for start, to in lines:
        if isinstance(to, float):
            along = cmath.rect(45.0, -to)
            segments.append((place - along, place + along))
            _line(canvas, *segments[-1], width=3)
            if start == step.upstream:
                _line(canvas, at[start], place)
        else:
            segments.append((at[start], place if to is None else at[to]))
            (_bar if to is None else _line)(canvas, *segments[-1])
    return segments


def _named(canvas: Canvas, place: complex, name: str, anchor: Anchor) -> None:
    canvas.text(
        place.real,
        place.imag,
        name,
        size=9,
        bold=True,
        colour=SOFT,
        anchor=anchor,
    )


def _ground(canvas: Canvas, place: complex) -> None:
    _polygon(
        canvas,
        place,
        place + (12 + 19j),
        place + (-12 + 19j),
        fill=PAPER,
        width=1.4,
    )
    for k in range(-2, 3):
        above = place + complex(5 * k + 1, 19)
        below = place + complex(5 * k - 3, 24)
        _line(canvas, above, below)


def joint_state(joint: JointSpec, clearance_in: float | None) -> JointState:
    if clearance_in is None:
        return "missing"
    return "over" if joint.is_over_limit(clearance_in) else "fine"


def _mark(canvas: Canvas, at: complex, text: str, state: str, faded: bool = False) -> None:
    x = at.real
    y = at.imag
    size = _MARKER
    missing = state == "missing"
    pale = state == "missing" or faded
    colour = SOFT if pale else INK
    if state == "over":
        canvas.rectangle(
            x - size,
            y - size,
            2 * size,
            2 * size,
            fill=colour,
            colour=PAPER,
        )
        colour = PAPER
    else:
        outline: dict[str, Any] = {
            "stroke": colour,
            "stroke_width": 1.3 if pale else 2.2,
            "stroke_dasharray": "3 2.2" if missing else None,
        }
        canvas.add("circle", cx=x, cy=y, r=size, fill=PAPER, **outline)
    canvas.text(x, y + 4, text, bold=not missing, colour=colour, anchor="middle")


def joint_mark(text: str, state: JointState) -> Markup:
    words = JOINT_STATES[state]
    canvas = Canvas(22, 22, f"joint {text}, {words}" if text else words)
    _mark(canvas, 11 + 11j, text, state)
    return canvas.svg("mark")


def _arrow(canvas: Canvas, start: complex, end: complex) -> None:
    along = _unit(end - start)
    base = end - min(8.0, abs(end - start)) * along
    _line(canvas, start, end, colour=PAPER, width=5.5)
    _line(canvas, start, base, width=2.4)
    _polygon(
        canvas,
        end,
        base + 4.2j * along,
        base - 4.2j * along,
        fill=INK,
        width=0.5,
    )


@dataclass(frozen=True, slots=True)
class _Line:
    text: str
    size: float
    bold: bool


def _callout(
    canvas: Canvas,
    joint: complex,
    lines: list[_Line],
    boxes: list[Box],
    segments: list[Segment],
    framed: bool,
) -> None:
    """Write a label where it covers least, and remember its box."""
    widths = [text_width(line.text, line.size) * (1.12 if line.bold else 1.0) for line in lines]
    width = max(widths) + 6
    height = sum(line.size + 2.0 for line in lines) + 3
    # From the marker's edge outwards until the label's box clears it, in every direction and at
    # several distances.
    with np.errstate(divide="ignore"):
        sideways = width / 2 / np.abs(_COSINES)
        above = height / 2 / np.abs(_SINES)
    clears = np.minimum(sideways, above)
    reach = _MARKER + 2 + _RINGS[:, None] + clears
    x = (joint.real + _COSINES * reach).ravel()
    y = (joint.imag + _SINES * reach).ravel()
    across = width / 2
    up = height / 2
    tried = np.column_stack([x - across, y - up, x + across, y + up])
    too_low = tried < [0, 14, 0, 0]
    too_high = tried > [np.inf, np.inf, canvas.width, canvas.height]
    outside = np.any(too_low | too_high, axis=1)
    cost = (
        np.repeat(1.1 * _RINGS, len(_COSINES))
        + _overlap(tried, np.array(boxes))
        + _covered(tried, segments)
        + 2000.0 * outside
    )
    cheapest = int(np.argmin(np.round(cost, 6)))
    box: Box = tuple(tried[cheapest].tolist())
    # A label under another cannot be read at all.
    boxes += [box] * 16
    edge = complex(
        min(max(joint.real, box[0]), box[2]),
        min(max(joint.imag, box[1]), box[3]),
    )
    if abs(edge - joint) > _MARKER + 14:
        start = joint + (_MARKER + 1) * _unit(edge - joint)
        _line(canvas, start, edge, colour=SOFT, width=0.8)
    if framed:
        canvas.rectangle(
            box[0],
            box[1],
            width,
            height,
            fill=PAPER,
            colour=INK,
            width=1.4,
        )
    base = box[1] + 0.5
    middle = (box[0] + box[2]) / 2
    for line in lines:
        base += line.size + 2.0
        canvas.text(
            middle,
            base - 1.5,
            line.text,
            size=line.size,
            bold=line.bold,
            anchor="middle",
            colour=INK if line.bold else SOFT,
        )


def _two_lines(name: str) -> list[str]:
    """Split a name of several words near its middle, so that its label is compact."""
    words = name.split()
    if len(name) <= 14 or len(words) < 2:
        return [name]

    def from_middle(cut: int) -> float:
        return abs(len(" ".join(words[:cut])) - len(name) / 2)

    cut = min(range(1, len(words)), key=from_middle)
    return [" ".join(words[:cut]), " ".join(words[cut:])]


def _overlap(tried: Array, boxes: Array) -> Array:
    """Area that each tried box shares with all others. [canvas units squared]"""
    low = np.maximum(tried[:, None, :2], boxes[None, :, :2])
    high = np.minimum(tried[:, None, 2:], boxes[None, :, 2:])
    sides = np.clip(high - low, 0.0, None)
    area: Array = sides.prod(axis=2).sum(axis=1)
    return area


def _covered(tried: Array, segments: list[Segment]) -> Array:
    """Cost of laying each tried box, a little widened, over lines: by the length it covers."""
    if not segments:
        return np.zeros(len(tried))
    ends = np.array([[(p.real, p.imag) for p in segment] for segment in segments])
    start = ends[:, 0]
    run = ends[:, 1] - ends[:, 0]
    run = np.where(np.abs(run) < 1e-9, 1e-9, run)
    # The part of each line between the box's sides, as in Liang and Barsky's clipping.
    first = (tried[:, None, :2] - 3.0 - start) / run
    last = (tried[:, None, 2:] + 3.0 - start) / run
    enter = np.maximum(np.minimum(first, last).max(axis=2), 0.0)
    leave = np.minimum(np.maximum(first, last).min(axis=2), 1.0)
    share = np.clip(leave - enter, 0.0, None)
    length = share * np.hypot(run[:, 0], run[:, 1])
    total: Array = length.sum(axis=1)
    return 6.0 * total
