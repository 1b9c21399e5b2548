"""The clearances of a gear over its landings: one line of a terminal for each joint."""

from __future__ import annotations

from collections.abc import Iterator

from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.life.folding import GearLife
from mlg_troubleshoot.life.forecast import Forecast

# Eighths of the limit.
_LEVELS = "▁▂▃▄▅▆▇█"
LEGEND = (
    "▁ to █: reading in eighths of the limit, ! over it, ^ restored. Forecast: · below the limit,"
    " ? perhaps over it, × probably over it."
)


def wear_lines(life: GearLife, ahead: Forecast, gear: Gear, width: int) -> Iterator[str]:
    """Draw what the page of a gear's life draws: readings, restorations and the forecast."""
    from mlg_troubleshoot.reporting.fleet_figures import WearInTime

    wear = WearInTime.of(life, ahead, gear)
    if wear is None:
        return
    room = width - 4

    def column(landings: float) -> int:
        return round((landings - wear.first) / (wear.end - wear.first) * (room - 1))

    for number, between in wear.between.items():
        limit = gear.joint(number).limit.value
        drawn = [" "] * room
        expected = wear.expected(number, gear, room)
        for at, (_low, middle, high) in () if expected is None else zip(*expected, strict=True):
            drawn[column(at)] = "×" if middle > limit else "?" if high > limit else "·"
        for begun in wear.restored(number):
            drawn[column(begun)] = "^"
        for stretch in between:
            for at, value, _u in stretch.placed:
                level = _LEVELS[min(int(8.0 * value / limit), 7)]
                drawn[column(at)] = "!" if value > limit else level
        yield f"#{number:<3}{''.join(drawn)}".rstrip()
    yield f"{f'landings {wear.first:.0f}':<{room - 4}}{wear.end:>8.0f}"
    yield LEGEND
