"""The figure of the inspection report: the margin gauge.

The linkage drawn in its planes: joints numbered in place, distinguished by shape, clearances
exaggerated; a table next to the drawing names them.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any, Literal

import numpy as np
from markupsafe import Markup

from mlg_troubleshoot.decision.assessment import Assessment
from mlg_troubleshoot.gear.gear import Gear, JointSpec
from mlg_troubleshoot.geometry.mechanism import (
    Dyad,
    Lever,
    Mechanism,
    Slot,
    needs,
)
from mlg_troubleshoot.reporting import figures
from mlg_troubleshoot.reporting.figures import (
    INK,
    PALE,
    PAPER,
    RULE,
    SMALL,
    SOFT,
    TEXT_SIZE,
    Anchor,
    Canvas,
    Lengths,
    Marker,
    text_width,
)

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
_MARKER = 10
_LONGEST_ARROW = 42
_SHORTEST_ARROW = 3
# One scale for most reports, so that their drawings compare.
_LARGEST_EXAGGERATION = 100
# Room for supports and the slot above and below the linkage. [px]
_ABOVE = 44
_BELOW = 40


def schematic(gear: Gear, assessment: Assessment, width: float = _WIDTH) -> Schematic:
    """Draw the linkage at mid-position, its joints numbered in place and their clearances
    exaggerated.
    """
    over = (assessment.over_travel_in or 0.0) >= -(assessment.under_travel_in or 0.0)
    directions = assessment.over_directions_rad if over else assessment.under_directions_rad
    return _drawn(gear, assessment.inspection.clearance_in, directions, width)


def blank_schematic(gear: Gear) -> Schematic:
    """Draw the linkage with its joints numbered, none of them measured yet."""
    return _drawn(gear, {}, (), _WIDTH)


def joint_key(gear: Gear, clearance_in: Mapping[int, float], lengths: Lengths) -> Markup:
    """List the joints by their marks with names and clearances, for a drawing without a table."""
    lines = []
    for joint in gear.joints:
        clearance = clearance_in.get(joint.number)
        state = joint_state(joint, clearance)
        said = "" if clearance is None else f", {lengths.full(clearance)}"
        over = ", OVER LIMIT" if state == "over" else ""
        lines.append((joint, state, joint.name + said + over))
    width = 34 + max(text_width(line, TEXT_SIZE) for _, _, line in lines)
    canvas = Canvas(width, 4 + 21 * len(lines), "Joints")
    for row, (joint, state, line) in enumerate(lines):
        y = 12 + 21 * row
        _mark(canvas, complex(12, y), str(joint.number), state)
        canvas.text(complex(28, y + 4), line, bold=state == "over")
    return canvas.svg("figure")


def _drawn(
    gear: Gear, clearance_in: Mapping[int, float], directions: Sequence[float], width: float
) -> Schematic:
    planes = (_PlaneDrawing(gear, plane.name) for plane in gear.reference.mechanism.planes)
    drawings = [drawing for drawing in planes if drawing.points]
    gap = 6.0
    side = 74.0
    free = width - gap * (len(drawings) - 1) - 2 * side * len(drawings)
    scale = free / sum(drawing.size.real for drawing in drawings)
    largest = max(clearance_in.values(), default=0.0)
    exaggeration = None
    links: dict[int, complex] = {}
    if largest > 0.0 and directions:
        exaggeration = min(_LARGEST_EXAGGERATION, _one_digit(_LONGEST_ARROW / (largest * scale)))
        for joint, angle in zip(gear.joint_numbers, directions, strict=True):
            length = clearance_in.get(joint, 0.0) * exaggeration * scale
            if length > _SHORTEST_ARROW:
                links[joint] = cmath.rect(length, -angle)
    height = max(drawing.size.imag for drawing in drawings) * scale + _ABOVE + _BELOW
    states = {j.number: joint_state(j, clearance_in.get(j.number)) for j in gear.joints}
    panels = (drawing.draw(scale, side, height, states, links) for drawing in drawings)
    return Schematic(tuple(panels), exaggeration)


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
        self,
        scale: float,
        side: float,
        height: float,
        states: Mapping[int, JointState],
        links: Mapping[int, complex],
    ) -> tuple[str, Markup, float]:
        """Draw the plane: rigid parts and supports, then joints with their virtual links [canvas
        units].
        """
        width = self.size.real * scale + 2 * side
        name = self.plane.replace("_", " ") + " plane"
        joints = [j for j in self.gear.joints if j.point in self.points]
        said = ", ".join(f"joint {j.number} {JOINT_STATES[states[j.number]]}" for j in joints)
        canvas = Canvas(width, height, f"Linkage schematic, {name}", said)
        # Upward in the plane is to lower numbers on the canvas.
        corner = complex(side, (height + _ABOVE - _BELOW + self.size.imag * scale) / 2)
        at = {
            name: corner + scale * (point - self.low).conjugate()
            for name, point in self.points.items()
        }

        canvas.text(2 + 11j, name, bold=True, colour=SOFT)
        self._parts(canvas, at)
        for point, place in at.items():
            if self.mechanism.point(point).fixed and point not in self.cut:
                canvas.polyline([place, place + (12 + 19j), place + (-12 + 19j)], PAPER)
            if all(joint.point != point for joint in joints):
                canvas.marker("circle", place, 3.0)
        markers = _without_overlap({j.number: at[j.point] for j in joints})
        # Those of another plane first: nothing of theirs may cover this one's.
        for joint in sorted(joints, key=self._stands_here):
            number = joint.number
            place = at[joint.point]
            marker = markers[number]
            here = self._stands_here(joint)
            if here and number in links:
                along = links[number]
                start = place + _MARKER * _unit(along)
                _arrow(canvas, start, start + along)
            if here and marker != place:
                canvas.line(place, marker, colour=SOFT, width=1.2)
                canvas.marker("circle", place, 2.5)
            _mark(canvas, marker, str(number), states[number], faded=not here)
        return name, canvas.svg("figure panel"), width

    def _stands_here(self, joint: JointSpec) -> bool:
        return self.mechanism.point(joint.point).plane == self.plane

    def _parts(self, canvas: Canvas, at: Mapping[str, complex]) -> None:
        """Draw rigid parts as plates, links as bars above them; name what moves the linkage and
        what it moves.
        """
        plates: list[set[str]] = []
        for step in sorted(self.steps, key=lambda step: not isinstance(step, (Lever, Slot))):
            place = at[step.joint]
            if isinstance(step, (Lever, Slot)):
                plates.append({step.joint, *needs(step)})
                ends = [at[name] for name in needs(step)]
                canvas.polyline([place, *ends], PALE, colour=RULE, width=3)
                continue
            for name in needs(step):
                # Two points of a plate need no bar.
                if not any({step.joint, name} <= plate for plate in plates):
                    canvas.line(place, at[name], width=6, cap="round")
                    canvas.line(place, at[name], width=3, cap="round", colour=PAPER)
        named = dict.fromkeys(self.cut, "actuator") | {self.mechanism.output.joint: "output"}
        for point, name in named.items():
            if point in at:
                left = at[point].real < canvas.width / 2
                beside = at[point] + (-14 if left else 14) + 4j
                end: Anchor = "end" if left else "start"
                canvas.text(beside, name, size=SMALL, colour=SOFT, anchor=end)


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


def joint_state(joint: JointSpec, clearance_in: float | None) -> JointState:
    if clearance_in is None:
        return "missing"
    return "over" if joint.is_over_limit(clearance_in) else "fine"


def _mark(canvas: Canvas, at: complex, text: str, state: str, faded: bool = False) -> None:
    missing = state == "missing"
    pale = missing or faded
    colour = SOFT if pale else INK
    if state == "over":
        canvas.marker("square", at, _MARKER, colour)
    else:
        dash = "3 2.2" if missing else None
        canvas.circle(at, _MARKER, PAPER, colour=colour, width=1.3 if pale else 2.2, dash=dash)
    ink = PAPER if state == "over" else colour
    canvas.text(at + 4j, text, bold=not missing, colour=ink, anchor="middle")


def joint_mark(text: str, state: JointState) -> Markup:
    words = JOINT_STATES[state]
    canvas = Canvas(22, 22, f"joint {text}, {words}" if text else words)
    _mark(canvas, 11 + 11j, text, state)
    return canvas.svg("mark")


def _arrow(canvas: Canvas, start: complex, end: complex) -> None:
    along = _unit(end - start)
    base = end - min(8.0, abs(end - start)) * along
    canvas.line(start, end, colour=PAPER, width=5.5)
    canvas.line(start, base, width=2.4)
    canvas.polyline([end, base + 4.2j * along, base - 4.2j * along], INK, width=0.5)


# Of a lane of the gauge its name, its ends, how they are marked, and the ends of its box. [in]
_Lane = tuple[str, tuple[float, ...], Marker, tuple[float, ...]]


def _lanes_of(a: Assessment) -> list[_Lane]:
    """The lanes of a gauge; none without a prediction."""
    if a.predicted_displacement_in is None or a.over_travel_in is None or a.under_travel_in is None:
        return []
    worst = a.predicted_displacement_in
    sense = 1.0 if a.over_travel_in >= -a.under_travel_in else -1.0
    u2 = 2.0 * (a.standard_uncertainty_in or 0.0)
    box = (sense * worst - u2, sense * worst + u2)
    what = "As loaded (expected)" if a.as_loaded else "Worst case (bound)"
    what = "With the extension" if a.rigid_displacement_in else what
    lanes: list[_Lane] = [(what, (a.under_travel_in, a.over_travel_in), "diamond", box)]
    if a.inspection.measured_displacement_in is not None:
        measured = (a.inspection.measured_displacement_in,)
        lanes.insert(0, ("Measured on the gear", measured, "triangle", ()))
    if a.rigid_displacement_in:
        lanes.append(("plain model (bound)", (sense * a.rigid_displacement_in,), "diamond", ()))
    if a.predicted_upper_in is not None and a.predicted_upper_in > worst + 5e-5:
        lanes.append(("unmeasured at limit", (sense * a.predicted_upper_in,), "ring", ()))
    if a.geometry_spread_in:
        low, high = a.geometry_spread_in
        lanes.append(("other geometries", (sense * low, sense * high), "circle", ()))
    return lanes


def margin_gauge(assessment: Assessment, lengths: Lengths) -> Markup | None:
    """Draw the worst cases of both senses against the margin, with the uncertainty and what was
    measured: a lane for each.
    """
    lanes = _lanes_of(assessment)
    if not lanes:
        return None
    margin = (-assessment.margin_in, assessment.margin_in)
    said = [" / ".join(dict.fromkeys(lengths.bare(end, True) for end in each[1])) for each in lanes]
    spoken = ", ".join(f"{each[0]}: {value}" for each, value in zip(lanes, said, strict=True))
    canvas = Canvas(
        690,
        68 + 21 * len(lanes),
        "Margin gauge: plunger displacement from mid-position",
        f"Margin ±{lengths.full(margin[1])}. {spoken} {lengths.unit}",
    )
    shown = lengths.unit.from_inches
    drawn = [*margin, *(end for _, ends, _, box in lanes for end in (*ends, *box))]
    extent = 1.06 * shown(max(map(abs, drawn)))
    plot = figures.Plot(
        canvas,
        figures.Axis(f"{lengths.unit}, over-travel +", -extent, extent),
        figures.Axis("", float(len(lanes)), 0.0),
        left=150,
        right=134,
        top=36,
        bottom=32,
    )
    left, top, right, bottom = plot.area
    low, high = (plot.at(shown(end), 0.0) for end in margin)
    canvas.rectangle(low, high - low + 1j * (bottom - top), PALE, colour=None)
    plot.draw_axes(lanes=True)
    small: dict[str, Any] = {"size": SMALL, "colour": SOFT}
    canvas.text(left + 10j, "◀ short of mid-position", **small)
    canvas.text((left + right) / 2 + 10j, "allowed", anchor="middle", **small)
    canvas.text(right + 10j, "beyond mid-position ▶", anchor="end", **small)
    canvas.text(canvas.width + 10j, lengths.unit, anchor="end", **small)
    for at, end in zip((low, high), margin, strict=True):
        canvas.line(at - 8j, at + 1j * (bottom - top + 4), width=2.6)
        canvas.text(at - 11j, lengths.bare(end, True), bold=True, anchor="middle")
    for place, (name, ends, marker, box) in enumerate(lanes):
        zero, *points = (plot.at(shown(end), place + 0.5) for end in (0.0, *ends))
        base = 1j * (zero.imag + 4)
        bold = name[0].isupper()
        canvas.text(base, name, bold=bold)
        canvas.text(canvas.width + base, said[place], bold=bold, anchor="end")
        canvas.line(points[0] if len(points) > 1 else zero, points[-1], width=4 if box else 1.5)
        if box:
            start, stop = (plot.at(shown(end), place + 0.5) for end in box)
            canvas.rectangle(start - 6j, stop - start + 12j)
        for point in points:
            canvas.marker(marker, point)
    return canvas.svg()
