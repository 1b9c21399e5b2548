"""The linkage as a chain of joints on a few lines of text, drawn from the gear's own mechanism."""

from __future__ import annotations

from dataclasses import dataclass

from mlg_troubleshoot.cli.prompts.lines import Line, Tone
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.geometry.mechanism import Crank, Dyad, Lever, Slider, Slot, Step

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


class _Canvas:
    def __init__(self, rows: int, width: int) -> None:
        self._cells = [[(" ", Tone.PLAIN)] * width for _ in range(rows)]

    def write(self, row: int, column: int, text: str, tone: Tone = Tone.PLAIN) -> None:
        for i, character in enumerate(text):
            self._cells[row][column + i] = (character, tone)

    def lines(self) -> tuple[Line, ...]:
        drawn = []
        for cells in self._cells:
            parts: list[tuple[str, Tone]] = []
            while cells and cells[-1][0] == " ":
                cells.pop()
            for character, tone in cells:
                if parts and parts[-1][1] is tone:
                    parts[-1] = (parts[-1][0] + character, tone)
                else:
                    parts.append((character, tone))
            if parts:
                drawn.append(Line(tuple(parts), rigid=True))
        return tuple(drawn)


def sketch(gear: Gear, current: int, width: int) -> tuple[Line, ...]:
    """Draw the linkage from the input to the output with one joint marked.

    Levers are double bars with their pivot below, links are single bars. A mechanism that is no simple
    chain, or a narrow terminal, gets a row of joint numbers.
    """
    numbers = {joint.point: joint.number for joint in gear.joints}
    chain = _chain(gear.reference.mechanism.steps)
    if chain is not None:
        shown = {*chain.points, *(bar.pivot for bar in chain.bars)}
        if not set(numbers) <= shown:
            chain = None
    drawn = () if chain is None else _draw(gear, chain, numbers, current, width - 3)
    row = _Chain(tuple(numbers), (_Bar("·", None),) * (len(numbers) - 1), False)
    return drawn or _draw(gear, row, numbers, current, width - 3)


def _chain(steps: tuple[Step, ...]) -> _Chain | None:
    """Follow the steps from the input; None if they branch."""
    points: list[str] = []
    bars: list[_Bar] = []
    rocker = ""
    slides = False
    for step in steps:
        match step:
            case Crank():
                start, bar, rocker = step.pivot, _Bar("═", None), ""
            case Dyad():
                start, bar, rocker = step.upstream, _Bar("─", None), step.downstream
            case Lever():
                start, bar, rocker = step.follows, _Bar("═", step.pivot), ""
            case Slot():
                start, bar, rocker = step.pin, _Bar("═", step.pivot), ""
            case Slider():
                start, bar, rocker, slides = step.upstream, _Bar("─", None), "", True
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


def _draw(gear: Gear, chain: _Chain, numbers: dict[str, int], current: int, width: int) -> tuple[Line, ...]:
    def label(point: str) -> str:
        number = numbers.get(point)
        if number is None:
            return "○"
        return f"[{number}]" if number == current else f"({number})"

    labels = [label(point) for point in chain.points]
    arrow = "═▶" if chain.slides else ""
    space = width - sum(map(len, labels)) - len(arrow)
    bar_length = min(_LONGEST_BAR, space // max(len(chain.bars), 1))
    if bar_length < 1 or (bar_length < 3 and any(bar.pivot for bar in chain.bars)):
        return ()
    canvas = _Canvas(4, width)
    column = 0
    spans: list[tuple[str, int, int]] = []
    areas = {joint.number: joint.area for joint in gear.joints}
    for i, text in enumerate(labels):
        number = numbers.get(chain.points[i])
        marked = number == current
        canvas.write(1, column, text, Tone.CURRENT if marked else Tone.PLAIN)
        if marked:
            canvas.write(2, column + len(text) // 2, "▲", Tone.STRONG)
        if number is not None:
            last = column + len(text) - 1
            if spans and spans[-1][0] == areas[number]:
                spans[-1] = (spans[-1][0], spans[-1][1], last)
            else:
                spans.append((areas[number], column, last))
        column += len(text)
        if i < len(chain.bars):
            bar = chain.bars[i]
            canvas.write(1, column, bar.sign * bar_length)
            if bar.pivot is not None:
                _pivot(canvas, column + bar_length // 2, numbers.get(bar.pivot), current)
            column += bar_length
    canvas.write(1, column, arrow)
    for area, first, last in spans:
        name = f" {area} "
        length = last - first + 1
        if length >= len(name) + 4:
            canvas.write(0, first, f"╭{name.center(length - 2, '─')}╮", Tone.QUIET)
    return canvas.lines()


def _pivot(canvas: _Canvas, middle: int, number: int | None, current: int) -> None:
    if number is None:
        canvas.write(2, middle, "△", Tone.QUIET)
        return
    marked = number == current
    text = f"[{number}]" if marked else f"({number})"
    canvas.write(2, middle - len(text) // 2, text, Tone.CURRENT if marked else Tone.PLAIN)
    if marked:
        canvas.write(3, middle, "▲", Tone.STRONG)
