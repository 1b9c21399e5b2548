"""The linkage as a chain of joints on a few lines of text, drawn from the gear's own mechanism."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from itertools import zip_longest

from mlg_troubleshoot.cli.prompts.lines import Line, Tone
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.geometry.mechanism import Crank, Dyad, Guided, Lever, Slider, Slot, Step

_LONGEST_BAR = 6


@dataclass(frozen=True, slots=True)
class _Bar:
    """A link or a lever to the next point of the chain; a lever turns about its pivot."""

    sign: str
    pivot: str | None


@dataclass(frozen=True, slots=True)
class _Chain:
    points: tuple[str, ...]
    bars: tuple[_Bar, ...]
    slides: bool


# What stands in a row of the drawing: its column, its text and its tone.
_Mark = tuple[int, str, Tone]


def sketch(gear: Gear, current: int, width: int) -> tuple[Line, ...]:
    """Draw the linkage from the input to the output with one joint marked.

    Levers are double bars with their pivot below, links are single bars. A mechanism that is not a
    simple chain, or a narrow terminal, gets a row of joint numbers.
    """
    numbers = {joint.point: joint.number for joint in gear.joints}
    chain = _chain(gear.reference.mechanism.steps)
    whole = chain is not None and set(numbers) <= {
        *chain.points,
        *(bar.pivot for bar in chain.bars),
    }
    drawn = _draw(gear, chain, current, width - 3) if chain is not None and whole else ()
    row = _Chain(tuple(numbers), (_Bar("·", None),) * (len(numbers) - 1), False)
    return drawn or _draw(gear, row, current, width - 3)


def _chain(steps: tuple[Step, ...]) -> _Chain | None:
    """Follow the steps from the input; None if they branch."""
    points: list[str] = []
    bars: list[_Bar] = []
    rocker = ""
    slides = False
    for step in steps:
        match step:
            case Crank():
                start = step.pivot
                bar = _Bar("═", None)
                rocker = ""
            case Dyad():
                start = step.upstream
                bar = _Bar("─", None)
                rocker = step.downstream
            case Lever():
                start = step.follows
                bar = _Bar("═", step.pivot)
                rocker = ""
            case Slot():
                start = step.pin
                bar = _Bar("═", step.pivot)
                rocker = ""
            case Slider() | Guided():
                start = step.upstream
                bar = _Bar("─", None)
                rocker = ""
                slides = True
        if not points:
            points.append(start)
        if points[-1] != start:
            return None
        bars.append(bar)
        points.append(step.joint)
    if rocker:
        bars.append(_Bar("═", None))
        points.append(rocker)
    return _Chain(tuple(points), tuple(bars), slides)


def _draw(gear: Gear, chain: _Chain, current: int, width: int) -> tuple[Line, ...]:
    joints = {joint.point: joint for joint in gear.joints}

    def shown(point: str, unnamed: str, tone: Tone) -> tuple[str, Tone]:
        if point not in joints:
            return unnamed, tone
        number = joints[point].number
        return (f"[{number}]", Tone.CURRENT) if number == current else (f"({number})", Tone.PLAIN)

    labels = [shown(point, "○", Tone.PLAIN) for point in chain.points]
    arrow = "═▶" if chain.slides else ""
    space = width - sum(len(text) for text, _ in labels) - len(arrow)
    bar_length = min(_LONGEST_BAR, space // max(len(chain.bars), 1))
    if bar_length < 1 or (bar_length < 3 and any(bar.pivot for bar in chain.bars)):
        return ()
    above, across, below, lowest = rows = [list[_Mark]() for _ in range(4)]
    column = 0
    spans: list[tuple[str, int, int]] = []
    for point, (text, tone), bar in zip_longest(chain.points, labels, chain.bars):
        across.append((column, text, tone))
        if tone is Tone.CURRENT:
            below.append((column + len(text) // 2, "▲", Tone.STRONG))
        if point in joints:
            area = joints[point].area
            first = spans.pop()[1] if spans and spans[-1][0] == area else column
            spans.append((area, first, column + len(text)))
        column += len(text)
        if bar is not None:
            across.append((column, bar.sign * bar_length, Tone.PLAIN))
            if bar.pivot is not None:
                pivot, mark = shown(bar.pivot, "△", Tone.QUIET)
                middle = column + bar_length // 2
                below.append((middle - len(pivot) // 2, pivot, mark))
                lowest += [(middle, "▲", Tone.STRONG)] * (mark is Tone.CURRENT)
            column += bar_length
    across.append((column, arrow, Tone.PLAIN))
    for area, first, end in spans:
        if end - first >= len(area) + 6:
            above.append((first, f"╭{f' {area} '.center(end - first - 2, '─')}╮", Tone.QUIET))
    return tuple(_line(row) for row in rows if row)


def _line(marks: Iterable[_Mark]) -> Line:
    parts: list[tuple[str, Tone]] = []
    at = 0
    for column, text, tone in sorted(marks):
        parts += [(" " * (column - at), Tone.PLAIN), (text, tone)]
        at = column + len(text)
    return Line(tuple(parts), rigid=True)
