"""What was read of each joint between its restorations, as paths of wear over landings."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from datetime import date
from operator import itemgetter

import numpy as np

from mlg_troubleshoot.life.chronology import Moment
from mlg_troubleshoot.life.folding import GearLife
from mlg_troubleshoot.life.state import GearKey
from mlg_troubleshoot.wear import WearPath


@dataclass(slots=True)
class Stretch:
    """What was read of a joint between two restorations: landings (None: not stated), clearance and
    its uncertainty. Landings before the last overhaul are negative.
    """

    begun: float
    readings: list[tuple[float | None, float, float]]

    def count_from(self, landings: float) -> None:
        """Count landings from these on."""
        self.begun -= landings
        self.readings = [
            (None if at is None else at - landings, value, u) for at, value, u in self.readings
        ]

    @property
    def placed(self) -> list[tuple[float, float, float]]:
        """The readings whose landings are known."""
        return [(at, value, u) for at, value, u in self.readings if at is not None]


def stretches(life: GearLife, joints: Sequence[int]) -> dict[int, list[Stretch]]:
    """Readings of each joint between its restorations, in the order of time."""
    found = {joint: [Stretch(0.0, [])] for joint in joints}
    landings = 0.0
    for place, event in enumerate(life.events):
        if place in life.overhauls:
            _begin_anew(found, life.overhauls[place], landings)
        if event.joints is None:
            landings = landings if event.landings is None else event.landings
            for joint, reading in event.read.items():
                if joint in found:
                    found[joint][-1].readings.append((event.landings, *reading))
        else:
            at = _landings_of(event, life)
            for joint in found.keys() & event.joints:
                begun = found[joint][-1].begun if at is None else at
                found[joint].append(Stretch(begun, []))
    return found


def _begin_anew(
    found: Mapping[int, list[Stretch]], restored: Collection[int], landings: float
) -> None:
    """Count landings from an overhaul on, after which restored joints begin anew."""
    for joint, between in found.items():
        for stretch in between:
            stretch.count_from(landings)
        if joint in restored:
            between.append(Stretch(0.0, []))


def wear_paths(life: GearLife, joints: Sequence[int]) -> dict[int, tuple[list[WearPath], float]]:
    """Paths of each joint between its restorations, and the landings at which the current one
    began.
    """
    found = {}
    for joint, between in stretches(life, joints).items():
        paths = []
        reading_u: float | None = None
        for stretch in between:
            placed = stretch.placed
            reading_u = placed[-1][2] if placed else reading_u
            landings = [max(at - stretch.begun, 0.0) for at, _value, _u in placed]
            # Only those of another gear's inspection fall.
            usage = np.maximum.accumulate(landings)
            value = [value for _at, value, _u in placed]
            paths.append(WearPath(unit_of(life.key, joint), usage, value, reading_u))
        found[joint] = paths, between[-1].begun
    return found


def unit_of(key: GearKey, joint: int) -> str:
    """Name of a joint of a gear for the forecasts."""
    return f"{key[0]} {key[1]} #{joint}"


def placed_in_time(life: GearLife) -> list[list[tuple[int, float]]]:
    """Day and landings of the inspections that state both, those between two overhauls together."""
    found: list[list[tuple[int, float]]] = [[]]
    for place, event in enumerate(life.events):
        if place in life.overhauls:
            found.append([])
        if event.joints is None and event.day and event.landings is not None:
            found[-1].append((date.fromisoformat(event.day).toordinal(), event.landings))
    return found


def _landings_of(repair: Moment, life: GearLife) -> float | None:
    """Landings at a repair: as recorded, else between the inspections about it, by their days."""
    if repair.landings is not None:
        return float(repair.landings)
    eras = [era for era in placed_in_time(life) if era]
    if not eras or not repair.day:
        return None
    day = date.fromisoformat(repair.day).toordinal()
    own = max((era for era in eras if era[0][0] <= day), key=itemgetter(0), default=eras[0])
    days, landings = zip(*own, strict=True)
    return float(np.interp(day, days, landings))
