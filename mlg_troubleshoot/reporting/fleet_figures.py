"""The figure of one gear's life: how each joint wears."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from markupsafe import Markup

from mlg_troubleshoot.arrays import Array
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.reporting.figures import (
    ACCENT,
    PALE,
    SOFT,
    Axis,
    Canvas,
    Plot,
    Series,
)
from mlg_troubleshoot.reporting.formats import Lengths

if TYPE_CHECKING:
    from mlg_troubleshoot.life.folding import GearLife
    from mlg_troubleshoot.life.forecast import Forecast
    from mlg_troubleshoot.life.wear_paths import Stretch

_RED = "#a3131a"
_LEGEND = "● reading  ■ over its limit  ▲ restored  - - limit  ··· forecast, median; grey: 90 %"
_PANEL_WIDE = 350
_PANEL_HIGH = 132


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
    canvas.text(52, canvas.height - 4, _LEGEND, size=9.5)
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
