"""Figures of a fleet and of one gear's life: how bad, how long still, and how each joint wears."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from markupsafe import Markup

from mlg_troubleshoot.arrays import Array
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.reporting.figures import (
    ACCENT,
    INK,
    PALE,
    SOFT,
    Axis,
    Canvas,
    Marker,
    Plot,
    Series,
)
from mlg_troubleshoot.reporting.formats import Lengths

if TYPE_CHECKING:
    from mlg_troubleshoot.life.folding import GearLife
    from mlg_troubleshoot.life.forecast import Forecast
    from mlg_troubleshoot.life.wear_paths import Stretch

# The colours and shapes of the signs of the verdicts in templates/signs.html.j2.
_RED = "#a3131a"
_MARKS: dict[str, tuple[Marker, str]] = {
    "OUTSIDE_MARGIN": ("square", _RED),
    "INCONCLUSIVE": ("diamond", "#8a4b00"),
    "INCOMPLETE": ("triangle", "#0b4f8a"),
    "WITHIN_MARGIN": ("ring", "#1d6b2a"),
}
_WIDE = 940
_WORST_SHOWN = 4
_PANEL_WIDE = 350
_PANEL_HIGH = 132


@dataclass(frozen=True, slots=True)
class GearInPicture:
    """One gear of a fleet in its picture.

    case: worst case as a multiple of the margin, None where the linkage does not close. [1]
    due: landings to the next inspection, None where they are not known. [landings]
    """

    name: str
    verdict: str | None
    case: float | None
    due: float | None = None


def fleet_picture(places: Sequence[GearInPicture]) -> Markup:
    """Draw each gear's worst case against its margin and, where any is known, its landings left."""
    if not places:
        return Markup("")
    due = [place.due for place in places if place.due is not None]
    order = Axis("gears in the order of the table", 0.5, len(places) + 0.5)
    cases = [min(p.case or _WORST_SHOWN, _WORST_SHOWN) * 100.0 for p in places]
    high = max(*cases, 110.0) * 1.08
    canvas = Canvas(
        _WIDE,
        350 if due else 200,
        "Worst case of each gear against its margin",
        f"{sum(case > 100.0 for case in cases)} of {len(places)} gears are beyond their margin.",
    )
    top = Plot(canvas, order, Axis("worst case, % of margin", 0.0, high), top=22, right=18)
    top.area = (*top.area[:3], 160.0)
    top.draw_axes(min(6, len(places)))
    top.draw(Series("", (order.low, order.high), (100.0, 100.0), "5 3", _RED))
    for number, (place, case) in enumerate(zip(places, cases, strict=True), 1):
        shape, colour = _MARKS.get(place.verdict or "", ("cross", INK))
        canvas.marker(shape, *top.at(number, case), 3.4, colour=colour)
    x = 60.0
    for verdict, (shape, colour) in _MARKS.items():
        canvas.marker(shape, x, 10, 4.5, colour=colour)
        canvas.text(x + 9, 13.5, verdict.replace("_", " ").lower(), size=9.5)
        x += 125
    if due:
        axis = Axis("due in, landings", 0.0, max(*due, 1.0) * 1.08)
        left = Plot(canvas, order, axis, top=214, right=18)
        left.draw_axes(min(6, len(places)))
        for number, place in enumerate(places, 1):
            if place.due is not None:
                x, y = left.at(number, place.due)
                start, _, end, base = left.area
                wide = min(0.7 * (end - start) / len(places), 14.0)
                top_y = min(y, base - 2.0)
                tall = max(base - y, 2.0)
                canvas.rectangle(x - wide / 2, top_y, wide, tall, fill=ACCENT)
    return canvas.svg()


@dataclass(frozen=True, slots=True)
class WearInTime:
    """Clearances over landings from the start of a plot to its end: readings between restorations
    up to the last inspection, then the forecast.
    """

    between: dict[int, list[Stretch]]
    first: float
    last: float
    end: float
    ahead: Forecast

    @classmethod
    def of(cls, life: GearLife, ahead: Forecast, gear: Gear) -> WearInTime | None:
        """The joints that were read at known landings; None without any."""
        from mlg_troubleshoot.life.wear_paths import stretches

        known = stretches(life, gear.joint_numbers)
        between = {n: s for n, s in known.items() if any(each.placed for each in s)}
        if not between:
            return None
        read = [at for of in between.values() for each in of for at, *_ in each.placed]
        last = max(read)
        restored = max(each.begun for of in between.values() for each in of)
        due = ahead.next_inspection_landings or 0.0
        end = max(last * 1.4, last + 2.0 * due, restored, 1.0)
        begun = [each.begun for of in between.values() for each in of[1:]]
        return cls(between, min(0.0, *read, *begun), last, end, ahead)

    def restored(self, number: int) -> list[float]:
        """Landings at which a joint was restored, as far as they are known."""
        new, *others = self.between[number]
        return sorted({each.begun for each in others} - {new.begun})

    def expected(self, number: int, gear: Gear, places: int) -> tuple[Array, Array] | None:
        """Landings from the last inspection on, and the 5, 50 and 95 % quantiles at each. [in]"""
        from mlg_troubleshoot.life.forecast import landings_of_bands

        band = self.ahead.bands.get(number)
        if band is None:
            return None
        passed = np.linspace(0.0, min(self.end - self.last, gear.horizon.value), places)
        edges = [np.interp(passed, landings_of_bands(gear), edge) for edge in band]
        return self.last + passed, np.transpose(edges)


def wear_figure(life: GearLife, ahead: Forecast, gear: Gear, lengths: Lengths) -> Markup:
    """Draw the clearance of each joint over the landings: readings, limit, restorations and, from
    the last inspection on, the forecast with its 90 % band.
    """
    wear = WearInTime.of(life, ahead, gear)
    if wear is None:
        return Markup("")
    rows = -(-len(wear.between) // 2)
    canvas = Canvas(
        2 * _PANEL_WIDE,
        rows * _PANEL_HIGH + 18,
        f"Clearance of each joint of {life.name} over landings",
    )
    for place, number in enumerate(wear.between):
        _panel(canvas, place, gear, number, wear, lengths)
    base = rows * _PANEL_HIGH + 10
    shown = [
        Series("limit", (), (), "5 3", _RED),
        Series("forecast, median", (), (), "2 2", ACCENT),
    ]
    legend = Plot(canvas, Axis("", 0, 1), Axis("", 0, 1))
    legend.draw_legend(
        shown,
        50,
        base,
        [("circle", "reading"), ("square", "over its limit"), ("triangle", "restored")],
    )
    return canvas.svg()


def _panel(
    canvas: Canvas,
    place: int,
    gear: Gear,
    number: int,
    wear: WearInTime,
    lengths: Lengths,
) -> None:
    between = wear.between[number]
    joint = gear.joint(number)
    shown = lengths.unit.from_inches
    limit = shown(joint.limit.value)
    most = max(shown(value) for each in between for _at, value, _u in each.placed)
    x = _PANEL_WIDE * (place % 2)
    y = _PANEL_HIGH * (place // 2)
    clearances = Axis("", 0.0, 1.15 * max(limit, most))
    plot = Plot(canvas, Axis("landings", wear.first, wear.end), clearances)
    plot.area = (x + 52, y + 20, x + _PANEL_WIDE - 14, y + _PANEL_HIGH - 34)
    canvas.text(x + 52, y + 13, f"#{number} {joint.name}, {lengths.unit}", bold=True)
    expected = wear.expected(number, gear, 25)
    if expected is not None:
        ahead_at, edges_in = expected
        low, middle, high = np.minimum(edges_in.T * shown(1.0), plot.y.high)
        around = [
            *zip(ahead_at, low, strict=True),
            *zip(ahead_at[::-1], high[::-1], strict=True),
        ]
        edges = [plot.at(float(a), float(v)) for a, v in around]
        canvas.polyline(edges, fill=PALE, colour=None, closed=True)
        plot.draw(Series("", tuple(ahead_at), tuple(middle), "2 2", ACCENT))
    plot.draw_axes(5)
    plot.draw(Series("", (wear.first, wear.end), (limit, limit), "5 3", _RED))
    for begun in wear.restored(number):
        base = plot.at(begun, 0.0)
        top_y = plot.at(begun, plot.y.high)
        canvas.line(*base, *top_y, colour=SOFT, dash="1 3")
        canvas.marker("triangle", *base, 4.5)
    for each in between:
        placed = [(at, shown(value)) for at, value, _u in each.placed]
        usage = tuple(at for at, _ in placed)
        values = tuple(value for _, value in placed)
        plot.draw(Series("", usage, values))
        for at, value in placed:
            canvas.marker("square" if value > limit else "circle", *plot.at(at, value), 3.2)
