"""From a mechanism to one straight-line program: every step becomes a few scalar formulas.

The same formulas run on numpy arrays (:mod:`~mlg_troubleshoot.geometry.kernel`), on complex numbers
for derivatives, and compiled in a loop. In a plane, Eq. 6 needs no matrix: with ω normal to AB the
bracket ``I + [ω] sin θ + [ω]² (1 − cos θ)`` maps AB to ``cos θ · AB + sin θ · ω × AB``, and Eq. 3
gives cos θ.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Any

import numpy as np

from mlg_troubleshoot.errors import MechanismError
from mlg_troubleshoot.geometry.mechanism import (
    Crank,
    Dyad,
    Guided,
    Lever,
    Mechanism,
    Point,
    Slider,
    Slot,
    Step,
    Towards,
    needs,
)


@dataclass(frozen=True, slots=True)
class Program:
    """Formulas that locate every joint of a mechanism, in order, and its numbers by name.

    Attributes
    ----------
    parameters : dict
        Every number of the mechanism by name: ``point.E.x``, ``length.3-5``, ``sign.5`` … Names of
        a mechanism stand here and nowhere in the formulas: whatever they are, they are never run.
        [in, rad or 1]
    lines : tuple of (str, str)
        Assignments (name, expression); each name is assigned once.
    joints : dict
        Names of the two coordinates of each point, in its plane.
    virtual_links : int
        How many virtual links there are, each the two inputs ``vx{i}`` and ``vy{i}`` by its place.
        [in]
    """

    parameters: dict[str, Any]
    lines: tuple[tuple[str, str], ...]
    joints: dict[str, tuple[str, str]]
    output: str
    virtual_links: int

    @property
    def inputs(self) -> tuple[str, ...]:
        """Names that the formulas take, in addition to ``s``: virtual links, then parameters."""
        links = [f"v{axis}{i}" for i in range(self.virtual_links) for axis in "xy"]
        return (*links, *(f"p{i}" for i in range(len(self.parameters))))

    def source(self, results: tuple[str, ...], *, release: bool = True) -> str:
        """Write the formulas that the given results need, as Python source."""
        needed = set(results)
        kept: list[tuple[str, str, set[str]]] = []
        for name, expression in reversed(self.lines):
            if name in needed:
                used = set(_NAME.findall(expression))
                needed |= used
                kept.append((name, expression, used))
        kept.reverse()
        assigned = {name for name, _ in self.lines}
        last = {used: i for i, (_, _, names) in enumerate(kept) for used in names}
        text = []
        for i, (name, expression, names) in enumerate(kept):
            text.append(f"    {name} = {expression}")
            dead = sorted(n for n in names if last[n] == i and n in assigned and n not in results)
            if release and dead:
                text.append(f"    del {', '.join(dead)}")
        return "\n".join(text)


_NAME = re.compile(r"\b[a-z]\w*\b")
# Twice the area of a triangle whose corners are in line. [in²]
_IN_LINE = 1e-9


# Names of the formulas of x and y.
_Place = tuple[str, str]


class _Writer:
    """Collects parameters and formulas while a mechanism is written out."""

    def __init__(self, mechanism: Mechanism) -> None:
        self.mechanism = mechanism
        self.parameters: dict[str, Any] = {}
        self.lines: list[tuple[str, str]] = []
        self.joints: dict[str, tuple[str, str]] = {}
        self.positions: dict[str, str] = {}
        # Where a link that clearances displace starts, by its joint and the one it comes from.
        self.starts: dict[tuple[str, str], tuple[str, str]] = {}

    def parameter(self, name: str, value: Any) -> str:
        if not np.array_equal(self.parameters.setdefault(name, value), value, equal_nan=True):
            raise MechanismError(
                f"Two numbers of the mechanism are called {name!r}.", "Give its points other names."
            )
        return f"p{list(self.parameters).index(name)}"

    def let(self, expression: str) -> str:
        name = f"t{len(self.lines)}"
        self.lines.append((name, expression))
        return name

    def shifted(self, place: tuple[str, str], links: tuple[int, ...]) -> tuple[str, str]:
        if not links:
            return place
        x, y = place
        places = [self.mechanism.virtual_links.index(n) for n in links]
        return (
            self.let(" + ".join([x, *(f"vx{i}" for i in places)])),
            self.let(" + ".join([y, *(f"vy{i}" for i in places)])),
        )

    def between(self, start: _Place, end: _Place) -> _Place:
        """The vector from one place to another."""
        return self.let(f"{end[0]} - {start[0]}"), self.let(f"{end[1]} - {start[1]}")

    def turned(self, origin: _Place, arm: _Place, by: _Place, scale: str = "") -> _Place:
        """A place at a distance along and to the left of an arm from its origin, both in lengths of
        the arm or, with the inverse of its length, as they are.
        """
        (x, y), (dx, dy), (along, across) = origin, arm, by
        ahead = f"{along} * {dx} - {across} * {dy}"
        aside = f"{along} * {dy} + {across} * {dx}"
        if scale:
            ahead, aside = f"({ahead}) * {scale}", f"({aside}) * {scale}"
        return self.let(f"{x} + {ahead}"), self.let(f"{y} + {aside}")

    def inverse_length(self, arm: _Place) -> str:
        dx, dy = arm
        return self.let(f"1.0 / sqrt({dx} * {dx} + {dy} * {dy})")

    def seen_from(self, name: str, plane: str) -> tuple[tuple[str, str], str | None]:
        """Coordinates of a located point in another plane, and its distance from that plane."""
        point = self.mechanism.point(name)
        x, y = self.joints[name]
        if point.plane == plane:
            return (x, y), None
        origin, axes = self.mechanism.frame(plane)
        from_origin, from_axes = self.mechanism.frame(point.plane)
        constant = np.einsum("...ij,...j->...i", axes, from_origin - origin)
        slopes = np.einsum("...ij,...kj->...ik", axes, from_axes[..., :2, :])
        seen = []
        for i, axis in enumerate("uvh"):
            name = f"transfer.{point.plane}.{plane}.{axis}"
            c0 = self.parameter(f"{name}0", constant[..., i])
            cx = self.parameter(f"{name}x", slopes[..., i, 0])
            cy = self.parameter(f"{name}y", slopes[..., i, 1])
            seen.append(self.let(f"{c0} + {cx} * {x} + {cy} * {y}"))
        return (seen[0], seen[1]), seen[2]

    def same_plane(self, step: Step, *names: str) -> None:
        plane = self.mechanism.point(step.joint).plane
        for name in names:
            if self.mechanism.point(name).plane != plane:
                raise MechanismError(
                    f"Step {step.joint!r}: {name!r} is not in the plane {plane!r}."
                )

    def distance(self, a: str, b: str) -> Any:
        between = self.mechanism.reference_in_space(a) - self.mechanism.reference_in_space(b)
        value = np.sqrt((between * between).sum(axis=-1))
        if np.any(value == 0.0):
            raise MechanismError(f"The link {a}-{b} has no length.")
        return value

    def length(self, a: str, b: str) -> str:
        return self.parameter(f"length.{a}-{b}", self.distance(a, b))

    def sign(self, step: Dyad | Slider) -> str:
        """Which of two solutions the coordinates show; in line a dyad may snap to either side."""
        side = self.mechanism.side(step)
        if isinstance(step, Dyad) and np.ndim(side) == 0 and abs(side) < _IN_LINE:
            raise MechanismError(
                f"{step.joint!r} is in line with {step.upstream!r} and {step.downstream!r}: it may"
                " snap to either side.",
                "Give the points in a position off that line.",
            )
        return self.parameter(f"sign.{step.joint}", np.where(side >= 0.0, 1.0, -1.0)[()])


def write_program(mechanism: Mechanism) -> Program:
    w = _Writer(mechanism)
    for point in mechanism.points:
        if point.fixed:
            place = (
                w.parameter(f"point.{point.name}.x", point.x),
                w.parameter(f"point.{point.name}.y", point.y),
            )
            links = () if point.virtual_link is None else (point.virtual_link,)
            w.joints[point.name] = w.shifted(place, links)
    for step in mechanism.steps:
        match step:
            case Crank():
                _crank(w, step)
            case Dyad():
                _dyad(w, step)
            case Lever() | Slot():
                _turning(w, step)
            case Slider():
                _slider(w, step)
            case Guided():
                _guided(w, step)
    output = _output(w)
    return Program(w.parameters, tuple(w.lines), w.joints, output, len(mechanism.virtual_links))


def _travel(w: _Writer) -> str:
    return w.let(f"s - {w.parameter('input.reference', w.mechanism.reference_input)}")


def _crank(w: _Writer, step: Crank) -> None:
    w.same_plane(step, step.pivot)
    joint = w.mechanism.point(step.joint)
    pivot = w.mechanism.point(step.pivot)
    length = w.length(step.pivot, step.joint)
    start = w.parameter(
        f"crank.{step.joint}.angle", np.arctan2(joint.y - pivot.y, joint.x - pivot.x)
    )
    angle = w.let(f"{start} + {_travel(w)}")
    x, y = w.joints[step.pivot]
    place = (w.let(f"{x} + {length} * cos({angle})"), w.let(f"{y} + {length} * sin({angle})"))
    w.joints[step.joint] = w.shifted(place, step.virtual_links)


def _dyad(w: _Writer, step: Dyad) -> None:
    w.same_plane(step, step.downstream)
    first = w.length(step.upstream, step.joint)
    second = w.length(step.joint, step.downstream)
    plane = w.mechanism.point(step.joint).plane
    sign = w.sign(step)
    seen, height = w.seen_from(step.upstream, plane)
    start = w.shifted(seen, step.virtual_links)
    w.starts[step.joint, step.upstream] = start
    reach = w.let(f"{first} + {_travel(w)}") if step.driven else first
    dx, dy = base = w.between(start, w.joints[step.downstream])
    apart = w.let(f"{dx} * {dx} + {dy} * {dy}")
    inverse = w.let(f"1.0 / {apart}")
    if height is None:
        square = f"{reach} * {reach}"
        # Eq. 3 in factors (Heron): nothing cancels where the two links lie almost in line.
        more = w.let(f"{reach} + {second}")
        less = w.let(f"{reach} - {second}")
        along = w.let(f"0.5 + 0.5 * ({more} * {less}) * {inverse}")
        factors = w.let(f"({more} * {more} - {apart}) * ({apart} - {less} * {less})")
    else:
        square = w.let(f"{reach} * {reach} - {height} * {height}")
        along = w.let(f"0.5 + 0.5 * ({square} - {second} * {second}) * {inverse}")
        excess = w.let(f"{apart} - {square} - {second} * {second}")
        factors = w.let(f"4.0 * {second} * {second} * {square} - {excess} * {excess}")
    area = w.let(f"0.5 * {sign} * sqrt({factors})")
    across = w.let(f"{area} * {inverse}")
    w.joints[step.joint] = w.turned(start, base, (along, across))


def _arm(pivot: Point, end: Point) -> Any:
    """Vector from a pivot to another point in its plane, as a complex number. [in]"""
    return (end.x - pivot.x) + 1j * (end.y - pivot.y)


def _turning(w: _Writer, step: Lever | Slot) -> None:
    """A rigid link about its pivot: a lever keeps its shape, a slot the length of one arm."""
    led, _ = needs(step)
    w.same_plane(step, step.pivot, led)
    pivot = w.mechanism.point(step.pivot)
    to_joint = _arm(pivot, w.mechanism.point(step.joint))
    to_led = _arm(pivot, w.mechanism.point(led))
    w.distance(step.pivot, led)
    is_slot = isinstance(step, Slot)
    ratio = to_joint / (to_led / abs(to_led) if is_slot else to_led)
    name = f"{'arm' if is_slot else 'lever'}.{step.joint}"
    by = w.parameter(f"{name}.along", ratio.real), w.parameter(f"{name}.across", ratio.imag)
    start = w.joints[step.pivot]
    links = step.virtual_links
    if is_slot:
        arm = w.between(start, w.shifted(w.joints[led], links))
        w.joints[step.joint] = w.turned(start, arm, by, w.inverse_length(arm))
    else:
        place = w.turned(start, w.between(start, w.joints[led]), by)
        w.joints[step.joint] = w.shifted(place, links)


def _slider(w: _Writer, step: Slider) -> None:
    joint = w.mechanism.point(step.joint)
    length = w.length(step.upstream, step.joint)
    sign = w.sign(step)
    axis = w.parameter(f"slider.{step.joint}.axis", step.axis)
    ox = w.parameter(f"slider.{step.joint}.x", joint.x)
    oy = w.parameter(f"slider.{step.joint}.y", joint.y)
    seen, height = w.seen_from(step.upstream, joint.plane)
    start = w.shifted(seen, step.virtual_links)
    w.starts[step.joint, step.upstream] = start
    c = w.let(f"cos({axis})")
    s = w.let(f"sin({axis})")
    square = w.let(f"{length} * {length}" + (f" - {height} * {height}" if height else ""))
    line = ox, oy, c, s
    _slide(w, step.joint, line, _reach(line, start, square, sign, w))


# A point of a line and its direction: the names of x, y, cosine and sine.
_Line = tuple[str, str, str, str]


def _slide(w: _Writer, joint: str, line: _Line, position: str) -> None:
    """Place a joint on a line, `position` being from the line's point."""
    x, y, c, s = line
    w.joints[joint] = (w.let(f"{x} + {c} * {position}"), w.let(f"{y} + {s} * {position}"))
    w.positions[joint] = position


def _reach(line: _Line, end: tuple[str, str], square: str, sign: str, w: _Writer) -> str:
    """Where a link from `end` reaches a line, as a distance along it; square: of its length."""
    x, y, c, s = line
    dx, dy = w.between((x, y), end)
    across = w.let(f"{c} * {dy} - {s} * {dx}")
    return w.let(f"{c} * {dx} + {s} * {dy} + {sign} * sqrt({square} - {across} * {across})")


def _guided(w: _Writer, step: Guided) -> None:
    w.same_plane(step, *needs(step))
    own = step.virtual_links if step.driven else ()
    line, (cosine, sine) = _line_of(w, step, "line", *step.line, own)
    if step.driven:
        position = _travel(w)
    elif step.across is None:
        length = w.length(step.upstream, step.joint)
        joint = w.mechanism.point(step.joint)
        end = w.mechanism.point(step.upstream)
        ahead = cosine * (joint.x - end.x) + sine * (joint.y - end.y)
        sign = w.parameter(f"sign.{step.joint}", 1.0 if ahead >= 0.0 else -1.0)
        end_at = w.shifted(w.joints[step.upstream], step.virtual_links)
        w.starts[step.joint, step.upstream] = end_at
        position = _reach(line, end_at, w.let(f"{length} * {length}"), sign, w)
    else:
        x, y, c, s = line
        at_x, at_y, along, over = _line_of(
            w, step, "across", step.upstream, step.across, step.virtual_links
        )[0]
        dx, dy = w.between((x, y), (at_x, at_y))
        position = w.let(
            f"({dx} * {over} - {dy} * {along}) * (1.0 / ({c} * {over} - {s} * {along}))"
        )
    _slide(w, step.joint, line, position)


def _line_of(
    w: _Writer, step: Guided, part: str, start: str, to: Towards, links: tuple[int, ...]
) -> tuple[_Line, tuple[float, float]]:
    """A line through a joint's reference position, carried by the points that it belongs to, and
    its direction there.
    """
    joint = w.mechanism.point(step.joint)
    first = w.mechanism.point(start)
    origin = w.shifted(w.joints[start], links)
    if isinstance(to, str):
        second = w.mechanism.point(to)
        length = w.distance(start, to)
        direction = (second.x - first.x) / length, (second.y - first.y) / length
        dx, dy = arm = w.between(origin, w.shifted(w.joints[to], links))
        inverse = w.inverse_length(arm)
        c = w.let(f"{dx} * {inverse}")
        s = w.let(f"{dy} * {inverse}")
    else:
        direction = float(np.cos(to)), float(np.sin(to))
        angle = w.parameter(f"guide.{step.joint}.{part}.axis", to)
        c = w.let(f"cos({angle})")
        s = w.let(f"sin({angle})")
    dx0 = joint.x - first.x
    dy0 = joint.y - first.y
    name = f"guide.{step.joint}.{part}"
    along = w.parameter(f"{name}.along", direction[0] * dx0 + direction[1] * dy0)
    aside = w.parameter(f"{name}.aside", direction[0] * dy0 - direction[1] * dx0)
    return (*w.turned(origin, (along, aside), (c, s)), c, s), direction


def _output(w: _Writer) -> str:
    output = w.mechanism.output
    if output.kind == "position":
        if output.joint not in w.positions:
            raise MechanismError(
                f"The output is the position of {output.joint!r}, which is not a slider."
            )
        return w.positions[output.joint]
    ends = output.joint, output.pivot
    jx, jy = w.starts.get(ends[::-1], w.joints[output.joint])
    px, py = w.starts.get(ends, w.joints[output.pivot])
    return w.let(f"arctan2({jy} - {py}, {jx} - {px})")
