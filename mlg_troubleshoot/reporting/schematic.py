"""The linkage drawn in its planes: joints numbered in place, distinguished by shape, clearances
exaggerated.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any, Literal

import numpy as np
from markupsafe import Markup

from mlg_troubleshoot.arrays import Array
from mlg_troubleshoot.decision.assessment import Assessment, JointFinding
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.geometry.mechanism import Crank, Dyad, Lever, Mechanism, Slider, Slot, needs
from mlg_troubleshoot.reporting.figures import (
    INK,
    PALE,
    PAPER,
    RULE,
    SOFT,
    Anchor,
    Canvas,
    Place,
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
    how many times larger than life the virtual links are drawn; None if there are none.
    """

    panels: tuple[tuple[str, Markup, float], ...]
    exaggeration: int | None


# Lengths of the drawing: its width, half of a joint's marker, the longest and the shortest arrow of
# a virtual link. [px]
_WIDTH, _MARKER = 690, 9.5
_LONGEST_ARROW, _SHORTEST_ARROW = 42, 2.5
# One scale for most reports, so that their drawings compare.
_LARGEST_EXAGGERATION = 100
# With more joints over their limit, frames would cover the linkage.
_MOST_FRAMES = 2
# Room for labels, supports and the slot above and below the linkage. [px]
_ABOVE, _BELOW = 44, 40

# Where a label is tried around a joint: every 15 degrees, none of them straight along a line, at
# these distances from its marker. [rad, px]
_TURNS = np.arange(24) * np.pi / 12 + 1e-6
_COSINES, _SINES = np.cos(_TURNS), np.sin(_TURNS)
_RINGS = np.array([0, 5, 10, 16, 24, 34, 46], float)

Box = tuple[float, float, float, float]
Segment = tuple[Place, Place]
_At = Callable[[str], Place]


def schematic(
    gear: Gear, assessment: Assessment, lengths: Lengths | None = None, width: float = _WIDTH
) -> Schematic:
    """Draw the linkage at mid-position, its joints numbered in place and their clearances
    exaggerated.
    """
    over = (assessment.over_travel_in or 0.0) >= -(assessment.under_travel_in or 0.0)
    directions = assessment.over_directions_rad if over else assessment.under_directions_rad
    return _drawn(gear, assessment.joints, directions, lengths or Lengths(), width)


def blank_schematic(gear: Gear) -> Schematic:
    """Draw the linkage with its joints numbered and named, none of them measured yet."""
    nothing = tuple(
        JointFinding(
            j.number, j.name, None, j.limit.value, False, None, 0.0, 0.0, 0.0, j.number, (1, 1), ()
        )
        for j in gear.joints
    )
    return _drawn(gear, nothing, (), Lengths(), _WIDTH)


def _drawn(
    gear: Gear,
    findings: Sequence[JointFinding],
    directions: Sequence[float],
    lengths: Lengths,
    width: float,
) -> Schematic:
    drawings = [
        d
        for d in (_PlaneDrawing(gear, plane.name) for plane in gear.reference.mechanism.planes)
        if d.points
    ]
    gap, side = 6.0, 74.0
    free = width - gap * (len(drawings) - 1) - 2 * side * len(drawings)
    scale = free / sum(d.extent()[2] - d.extent()[0] for d in drawings)
    largest = max([0.0, *(f.clearance_in or 0.0 for f in findings)])
    exaggeration = None
    if largest > 0.0 and directions:
        exaggeration = min(_LARGEST_EXAGGERATION, _one_digit(_LONGEST_ARROW / (largest * scale)))
    height = max(d.extent()[3] - d.extent()[1] for d in drawings) * scale + _ABOVE + _BELOW
    shown = _Shown(
        {finding.joint: finding for finding in findings},
        dict(zip(gear.joint_numbers, directions, strict=True)) if exaggeration else {},
        exaggeration or 0,
        lengths,
    )
    return Schematic(
        tuple(drawing.draw(scale, side, height, shown) for drawing in drawings), exaggeration
    )


@dataclass(frozen=True, slots=True)
class _Shown:
    """What is shown at the joints: findings, directions of their clearances and how these are
    drawn.
    """

    findings: dict[int, JointFinding]
    angles: dict[int, float]
    exaggeration: int
    lengths: Lengths

    def state(self, joint: int) -> str:
        finding = self.findings[joint]
        if finding.clearance_in is None:
            return "not measured"
        over = " over its limit" if finding.over_limit else ""
        return f"{self.lengths.full(finding.clearance_in)}{over}"

    def arrow(self, joint: int, place: Place, scale: float) -> Segment | None:
        """The joint's clearance as an arrow from the edge of its marker; None if it would be too
        short to see.
        """
        length = (self.findings[joint].clearance_in or 0.0) * scale * self.exaggeration
        if joint not in self.angles or length <= _SHORTEST_ARROW:
            return None
        c, s = math.cos(self.angles[joint]), -math.sin(self.angles[joint])
        start = (place[0] + _MARKER * c, place[1] + _MARKER * s)
        return start, (start[0] + length * c, start[1] + length * s)

    def label(self, joint: int, name: str, *, strong: bool) -> list[_Line]:
        finding = self.findings[joint]
        lines = [_Line(part, 8.5, False) for part in ([name] if strong else _two_lines(name))]
        if finding.clearance_in is not None:
            mark = " OVER LIMIT" if strong else " OVER" if finding.over_limit else ""
            lines.append(
                _Line(self.lengths.bare(finding.clearance_in) + mark, 10.5 if strong else 9.5, True)
            )
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
        self.mechanism: Mechanism = gear.reference.mechanism
        self.plane = plane
        self.steps = [
            s for s in self.mechanism.steps if self.mechanism.point(s.joint).plane == plane
        ]
        names = {name for step in self.steps for name in (step.joint, *needs(step))}
        # Points of another plane are drawn where they stand above this one.
        origin, axes = self.mechanism.frame(plane)
        self.points: dict[str, Place] = {}
        for name in sorted(names):
            offset = self.mechanism.reference_in_space(name) - origin
            self.points[name] = (float(offset @ axes[0]), float(offset @ axes[1]))
        self.cut = {s.upstream: s.joint for s in self.steps if isinstance(s, Dyad) and s.driven}
        self._shorten()

    def _shorten(self) -> None:
        """Draw only the near end of the actuator: its anchor lies far from everything else."""
        others = [p for name, p in self.points.items() if name not in self.cut]
        if not others:
            return
        span = max(max(v) - min(v) for v in zip(*others, strict=True))
        for anchor, joint in self.cut.items():
            (x0, y0), (x1, y1) = self.points[joint], self.points[anchor]
            length = math.hypot(x1 - x0, y1 - y0)
            part = min(1.0, 0.34 * span / length)
            self.points[anchor] = (x0 + part * (x1 - x0), y0 + part * (y1 - y0))

    def extent(self) -> tuple[float, float, float, float]:
        xs, ys = zip(*self.points.values(), strict=True)
        return min(xs), min(ys), max(xs), max(ys)

    def draw(
        self, scale: float, side: float, height: float, shown: _Shown
    ) -> tuple[str, Markup, float]:
        """Draw the plane: links and supports, then joints with their clearances, then their
        names.
        """
        x0, y0, x1, y1 = self.extent()
        width = (x1 - x0) * scale + 2 * side
        name = self.plane.replace("_", " ") + " plane"
        said = ", ".join(
            f"joint {j.number} {shown.state(j.number)}"
            for j in self.gear.joints
            if j.point in self.points
        )
        canvas = Canvas(width, height, f"Linkage schematic, {name}", said)
        lift = (height - _ABOVE - _BELOW - (y1 - y0) * scale) / 2

        def at(point: str) -> Place:
            x, y = self.points[point]
            return side + (x - x0) * scale, _ABOVE + lift + (y1 - y) * scale

        canvas.text(2, 11, name, size=10.5, bold=True, colour=SOFT)
        segments = self._links(canvas, at)
        boxes = self._obstacles(at)
        self._plain_points(canvas, at)
        markers = self._without_overlap(at)
        here = [j for j in self.gear.joints if self._home(j.point)]
        states = {number: joint_state(finding) for number, finding in shown.findings.items()}
        for joint in self.gear.joints:
            if joint.point in self.points and not self._home(joint.point):
                _mark(
                    canvas,
                    *markers[joint.number],
                    str(joint.number),
                    states[joint.number],
                    faded=True,
                )
        for joint in here:
            arrow = shown.arrow(joint.number, at(joint.point), scale)
            if arrow is not None:
                _arrow(canvas, *arrow)
                segments.append(arrow)
                (ax, ay), (bx, by) = arrow
                boxes.append((min(ax, bx), min(ay, by), max(ax, bx), max(ay, by)))
            if markers[joint.number] != at(joint.point):
                canvas.line(*at(joint.point), *markers[joint.number], colour=SOFT, width=1.2)
                canvas.marker("circle", *at(joint.point), 2.5)
                x, y = markers[joint.number]
                boxes.append((x - 11.0, y - 11.0, x + 11.0, y + 11.0))
            _mark(canvas, *markers[joint.number], str(joint.number), states[joint.number])
        framed = sum(shown.findings[j.number].over_limit for j in here) <= _MOST_FRAMES
        for joint in sorted(here, key=lambda j: not shown.findings[j.number].over_limit):
            strong = framed and shown.findings[joint.number].over_limit
            lines = shown.label(joint.number, joint.name, strong=strong)
            _callout(canvas, markers[joint.number], lines, boxes, segments, strong)
        return name, canvas.svg("figure panel"), width

    def _plain_points(self, canvas: Canvas, at: _At) -> None:
        numbered = {j.point for j in self.gear.joints if j.point in self.points}
        for point in self.points:
            if point not in self.cut:
                if self.mechanism.point(point).fixed:
                    _ground(canvas, *at(point))
                if point not in numbered:
                    canvas.marker("circle", *at(point), 3.0)

    def _without_overlap(self, at: _At) -> dict[int, Place]:
        """Places of the joints' markers: at the joints, or next to them where two would overlap."""
        places = {j.number: at(j.point) for j in self.gear.joints if j.point in self.points}
        least = 2.0 * _MARKER + 2.0
        for _ in range(30):
            moved = False
            for one, other in combinations(sorted(places), 2):
                (x0, y0), (x1, y1) = places[one], places[other]
                away = math.hypot(x1 - x0, y1 - y0)
                if away < least - 1e-6:
                    ux, uy = _unit((x0, y0), (x1, y1)) if away > 1e-6 else (1.0, 0.0)
                    push = (least - away) / 2
                    places[one] = (x0 - push * ux, y0 - push * uy)
                    places[other] = (x1 + push * ux, y1 + push * uy)
                    moved = True
            if not moved:
                break
        return places

    def _obstacles(self, at: _At) -> list[Box]:
        """Boxes of what labels must not cover: markers, supports, the slot, actuator and plunger
        with their names.
        """
        boxes: list[Box] = [(0.0, 0.0, 130.0, 14.0)]
        pins = {s.pin for s in self.steps if isinstance(s, Slot)}
        for point in self.points:
            x, y = at(point)
            fixed = self.mechanism.point(point).fixed and point not in self.cut
            reach = 27.0 if point in pins or fixed else _MARKER
            half = 15.0 if fixed else 11.0
            # A support hidden by a label would be missed most: it counts three times.
            boxes += [(x - half, y - 11.0, x + half, y + reach)] * (3 if fixed else 1)
        for step in self.steps:
            x, y = at(step.joint)
            if isinstance(step, Slider):
                ux, uy = math.cos(step.axis), -math.sin(step.axis)
                ends = (x + 20 * ux, x + 60 * ux), (y + 20 * uy, y + 60 * uy)
                boxes.append(
                    (min(ends[0]) - 60, min(ends[1]) - 6, max(ends[0]) + 10, max(ends[1]) + 6)
                )
            if isinstance(step, Dyad) and step.driven:
                fx, fy = at(step.upstream)
                boxes.append((min(x, fx) - 62, (y + fy) / 2 - 12, max(x, fx) + 8, max(y, fy)))
        return boxes

    def _home(self, point: str) -> bool:
        return point in self.points and self.mechanism.point(point).plane == self.plane

    def _links(self, canvas: Canvas, at: _At) -> list[Segment]:
        """Draw the rigid parts below, the links above; return the segments for the placing of
        labels.
        """
        segments = self._rigid_parts(canvas, at)
        for step in self.steps:
            place = at(step.joint)
            match step:
                case Dyad(upstream=upstream, downstream=downstream):
                    (_actuator if step.driven else _bar)(canvas, at(upstream), place)
                    if not self._rigid(step.joint, downstream):
                        _bar(canvas, place, at(downstream))
                    segments += [(at(upstream), place), (place, at(downstream))]
                case Crank(pivot=pivot):
                    _bar(canvas, at(pivot), place)
                    segments.append((at(pivot), place))
                case Slider(upstream=upstream, axis=axis):
                    segments += [_plunger(canvas, place, axis), (at(upstream), place)]
                    _bar(canvas, at(upstream), place)
        return segments

    def _rigid_parts(self, canvas: Canvas, at: _At) -> list[Segment]:
        """Draw levers as plates, and the slot in its lever."""
        segments: list[Segment] = []
        for step in self.steps:
            if isinstance(step, (Lever, Slot)):
                first = step.follows if isinstance(step, Lever) else step.pin
                a, b, c = at(first), at(step.pivot), at(step.joint)
                canvas.polyline([a, b, c], fill=PALE, colour=RULE, width=7.0, closed=True)
                canvas.polyline([a, b, c], fill=PALE, colour=PALE, width=4.0, closed=True)
                segments += [(a, b), (b, c), (a, c)]
        for step in self.steps:
            if isinstance(step, Slot):
                _slot(canvas, at(step.pivot), at(step.pin))
        return segments

    def _rigid(self, joint: str, pivot: str) -> bool:
        """Tell whether two points are already drawn as an edge of a rigid part."""
        return any(
            isinstance(s, Lever) and s.pivot == pivot and joint in (s.follows, s.joint)
            for s in self.steps
        )


def _bar(canvas: Canvas, a: Place, b: Place) -> None:
    canvas.line(*a, *b, colour=INK, width=7, cap="round")
    canvas.line(*a, *b, colour=PAPER, width=4, cap="round")


def _unit(a: Place, b: Place) -> Place:
    length = math.hypot(b[0] - a[0], b[1] - a[1]) or 1.0
    return (b[0] - a[0]) / length, (b[1] - a[1]) / length


def _actuator(canvas: Canvas, far: Place, joint: Place) -> None:
    """A cylinder towards its anchor, broken off, and its rod."""
    ux, uy = _unit(joint, far)
    length = math.hypot(far[0] - joint[0], far[1] - joint[1])
    neck = (joint[0] + 0.42 * length * ux, joint[1] + 0.42 * length * uy)
    canvas.line(*joint, *neck, width=5)
    canvas.line(*neck, *far, width=15)
    canvas.line(*neck, *far, colour=PALE, width=12)
    for k in (-1, 1):
        x, y = far[0] + 3 * k * ux, far[1] + 3 * k * uy
        canvas.line(
            x - 10 * uy - 3 * ux, y + 10 * ux - 3 * uy, x + 10 * uy + 3 * ux, y - 10 * ux + 3 * uy
        )
    outside = -1.0 if neck[0] < canvas.width / 2 else 1.0
    anchor: Anchor = "end" if outside < 0 else "start"
    canvas.text(
        neck[0] + 12 * outside,
        neck[1] + 16,
        "actuator",
        size=9,
        bold=True,
        colour=SOFT,
        anchor=anchor,
    )


def _slot(canvas: Canvas, pivot: Place, pin: Place) -> None:
    ux, uy = _unit(pivot, pin)
    a, b = (pin[0] - 13 * ux, pin[1] - 13 * uy), (pin[0] + 9 * ux, pin[1] + 9 * uy)
    canvas.line(*a, *b, width=25, cap="round", colour=INK)
    canvas.line(*a, *b, width=22, cap="round", colour=PAPER)


def _plunger(canvas: Canvas, joint: Place, axis: float) -> Segment:
    """The plunger beyond its pin, entering the valve."""
    ux, uy = math.cos(axis), -math.sin(axis)
    tip = (joint[0] + 30 * ux, joint[1] + 30 * uy)
    end = (joint[0] + 52 * ux, joint[1] + 52 * uy)
    canvas.line(*joint, *tip, width=6)
    canvas.line(*tip, *end, width=24)
    canvas.line(*tip, *end, width=21, colour=PALE)
    x = (tip[0] + end[0]) / 2
    canvas.text(
        x - 18, (tip[1] + end[1]) / 2 - 7, "plunger", size=9, bold=True, colour=SOFT, anchor="end"
    )
    return joint, end


def _ground(canvas: Canvas, x: float, y: float) -> None:
    canvas.polyline(
        [(x, y), (x + 12, y + 19), (x - 12, y + 19)], fill=PAPER, width=1.4, closed=True
    )
    for k in range(-2, 3):
        canvas.line(x + 5 * k + 1, y + 19, x + 5 * k - 3, y + 24)


def joint_state(finding: JointFinding) -> JointState:
    if finding.clearance_in is None:
        return "missing"
    return "over" if finding.over_limit else "fine"


def _mark(canvas: Canvas, x: float, y: float, text: str, state: str, faded: bool = False) -> None:
    size = _MARKER
    if state == "over":
        canvas.rectangle(
            x - size, y - size, 2 * size, 2 * size, fill=SOFT if faded else INK, colour=PAPER
        )
        canvas.text(x, y + 4, text, bold=True, colour=PAPER, anchor="middle")
        return
    missing, pale = state == "missing", state == "missing" or faded
    colour, dash = SOFT if pale else INK, "3 2.2" if missing else None
    outline: dict[str, Any] = {
        "stroke": colour,
        "stroke_width": 1.3 if pale else 2.2,
        "stroke_dasharray": dash,
    }
    canvas.add("circle", cx=x, cy=y, r=size, fill=PAPER, **outline)
    canvas.text(x, y + 4, text, bold=not missing, colour=colour, anchor="middle")


def joint_mark(text: str, state: JointState) -> Markup:
    words = JOINT_STATES[state]
    canvas = Canvas(22, 22, f"joint {text}, {words}" if text else words)
    _mark(canvas, 11, 11, text, state)
    return canvas.svg("mark")


def _arrow(canvas: Canvas, start: Place, end: Place) -> None:
    ux, uy = _unit(start, end)
    head = min(8.0, math.hypot(end[0] - start[0], end[1] - start[1]))
    base = (end[0] - head * ux, end[1] - head * uy)
    canvas.line(*start, *end, colour=PAPER, width=5.5)
    canvas.line(*start, *base, width=2.4)
    corners = [
        end,
        (base[0] - 4.2 * uy, base[1] + 4.2 * ux),
        (base[0] + 4.2 * uy, base[1] - 4.2 * ux),
    ]
    canvas.polyline(corners, fill=INK, width=0.5, closed=True)


@dataclass(frozen=True, slots=True)
class _Line:
    text: str
    size: float
    bold: bool


def _callout(
    canvas: Canvas,
    joint: Place,
    lines: list[_Line],
    boxes: list[Box],
    segments: list[Segment],
    framed: bool,
) -> None:
    """Write a label where it covers least, and remember its box."""
    width = (
        max(text_width(line.text, line.size) * (1.12 if line.bold else 1.0) for line in lines) + 6
    )
    height = sum(line.size + 2.0 for line in lines) + 3
    # From the marker's edge outwards until the label's box clears it, in every direction and at
    # several distances.
    with np.errstate(divide="ignore"):
        clears = np.minimum(width / 2 / np.abs(_COSINES), height / 2 / np.abs(_SINES))
    reach = _MARKER + 2 + _RINGS[:, None] + clears
    x, y = (joint[0] + _COSINES * reach).ravel(), (joint[1] + _SINES * reach).ravel()
    tried = np.column_stack([x - width / 2, y - height / 2, x + width / 2, y + height / 2])
    cost = (
        np.repeat(1.1 * _RINGS, len(_COSINES))
        + _overlap(tried, np.array(boxes))
        + _covered(tried, segments)
    )
    outside = (
        (tried[:, 0] < 0)
        | (tried[:, 2] > canvas.width)
        | (tried[:, 1] < 14)
        | (tried[:, 3] > canvas.height)
    )
    box: Box = tuple(tried[int(np.argmin(np.round(cost + 2000.0 * outside, 6)))].tolist())
    boxes.append(box)
    edge = (min(max(joint[0], box[0]), box[2]), min(max(joint[1], box[1]), box[3]))
    away = math.hypot(edge[0] - joint[0], edge[1] - joint[1])
    if away > _MARKER + 14:
        ux, uy = _unit(joint, edge)
        canvas.line(
            joint[0] + (_MARKER + 1) * ux,
            joint[1] + (_MARKER + 1) * uy,
            *edge,
            colour=SOFT,
            width=0.8,
        )
    if framed:
        canvas.rectangle(box[0], box[1], width, height, fill=PAPER, colour=INK, width=1.4)
    base, middle = box[1] + 0.5, (box[0] + box[2]) / 2
    for line in lines:
        base += line.size + 2.0
        colour = INK if line.bold else SOFT
        canvas.text(
            middle,
            base - 1.5,
            line.text,
            size=line.size,
            bold=line.bold,
            anchor="middle",
            colour=colour,
        )


def _two_lines(name: str) -> list[str]:
    """Split a name of several words near its middle, so that its label is compact."""
    words = name.split()
    if len(name) <= 14 or len(words) < 2:
        return [name]
    cut = min(range(1, len(words)), key=lambda k: abs(len(" ".join(words[:k])) - len(name) / 2))
    return [" ".join(words[:cut]), " ".join(words[cut:])]


def _overlap(tried: Array, boxes: Array) -> Array:
    """Area that each tried box shares with all others. [canvas units squared]"""
    low = np.maximum(tried[:, None, :2], boxes[None, :, :2])
    high = np.minimum(tried[:, None, 2:], boxes[None, :, 2:])
    return np.asarray(np.prod(np.clip(high - low, 0.0, None), axis=2).sum(axis=1))


def _covered(tried: Array, segments: list[Segment]) -> Array:
    """Cost of laying each tried box, a little widened, over lines: by the length it covers."""
    if not segments:
        return np.zeros(len(tried))
    ends = np.array(segments)
    start, run = ends[:, 0], ends[:, 1] - ends[:, 0]
    run = np.where(np.abs(run) < 1e-9, 1e-9, run)
    # The part of each line between the box's sides, as in Liang and Barsky's clipping.
    first = (tried[:, None, :2] - 3.0 - start) / run
    last = (tried[:, None, 2:] + 3.0 - start) / run
    enter = np.maximum(np.minimum(first, last).max(axis=2), 0.0)
    leave = np.minimum(np.maximum(first, last).min(axis=2), 1.0)
    length = np.clip(leave - enter, 0.0, None) * np.hypot(run[:, 0], run[:, 1])
    return np.asarray(6.0 * length.sum(axis=1))
