"""Last inspections that wear does not explain: a restoration without a record, two gears that were
exchanged.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import replace
from itertools import combinations, permutations

import numpy as np

from mlg_troubleshoot.arrays import Array
from mlg_troubleshoot.decision.sentences import joint_list
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.life.folding import GearKey, GearLife
from mlg_troubleshoot.life.forecast import Forecast, departures
from mlg_troubleshoot.life.landings_left import FleetLine
from mlg_troubleshoot.wear import WearModel

# A reading as many forecast standard deviations below its forecast is not wear: a restoration that
# nobody recorded. Lower ones name sound joints, one in 30,000 of a normal distribution at 4. [1]
_DROP = 4
# Two gears are exchanged only if each fits its own wear worse than this share of sound ones, [1]
_POOR_FIT = 0.02
# and the other's better by this much of the log likelihood. [1]
_EXCHANGED = 8
# An inspection that fits another gear's wear as badly as this was not taken there: without it a
# restored gear passed for exchanged in 3 of 20 fleets of 100. [1]
_NO_FIT = 0.001
# Of joints, in standard deviations.
Scores = Mapping[int, float]


def suggestions(
    lines: Iterable[FleetLine],
    forecasts: Mapping[GearKey, Forecast],
    read: Callable[[Collection[GearKey]], Mapping[GearKey, GearLife]],
    model: WearModel | None,
    gear: Gear,
) -> list[str]:
    """Name last inspections that look like an unrecorded restoration, or like two gears exchanged.

    read: the lives of those of the gears that may have been exchanged.
    """
    days = {line.key: line.inspection_date for line in lines}
    apart = {key: forecasts[key].departures for key in days if forecasts[key].departures}
    exchanged = _exchanged(apart, days, read, model, gear) if model is not None and apart else []
    sentences = [
        f"The last inspections of {' '.join(one)} and {' '.join(other)} fit each other's wear: were"
        " they exchanged?"
        for one, other in exchanged
    ]
    explained = {key for pair in exchanged for key in pair}
    for key, scores in apart.items():
        dropped = [n for n, z in scores.items() if z <= -_DROP]
        if dropped and key not in explained:
            name, listed = " ".join(key), joint_list(dropped)
            sentences.append(
                f"{name}: {listed} read much tighter than before. Restored without a"
                f" record? mlg history repair {name} --joint {dropped[0]} --date D"
            )
    return sentences


def _exchanged(
    apart: Mapping[GearKey, Scores],
    days: Mapping[GearKey, str | None],
    read: Callable[[Collection[GearKey]], Mapping[GearKey, GearLife]],
    model: WearModel,
    gear: Gear,
) -> list[tuple[GearKey, GearKey]]:
    """Gears that fit each other's wear and not their own, the clearest pair first."""
    # Gears are exchanged on one aircraft, or by those who entered one day's sheets.
    chances = zip(apart, _fit(apart.values()), strict=True)
    misfits = [key for key, chance in chances if chance < _POOR_FIT]
    pairs = [
        (one, other)
        for one, other in combinations(misfits, 2)
        if one[0] == other[0] or days[one] == days[other]
    ]
    lives = read({key for pair in pairs for key in pair})
    both_ways = [_with_last_of(lives[a], lives[b]) for pair in pairs for a, b in permutations(pair)]
    crossed = departures(both_ways, model, gear)
    gains = []
    for n, (one, other) in enumerate(pairs):
        others = crossed[2 * n : 2 * n + 2]
        gain = (_square(apart[one], apart[other]) - _square(*others)) / 2.0
        if gain > _EXCHANGED and min(_fit(others)) > _NO_FIT:
            gains.append((gain, one, other))
    clearest: list[tuple[GearKey, GearKey]] = []
    # A gear was exchanged with one other at most.
    for _gain, one, other in sorted(gains, reverse=True):
        if not any(key in pair for pair in clearest for key in (one, other)):
            clearest.append((one, other))
    return clearest


def _with_last_of(life: GearLife, other: GearLife) -> GearLife:
    """The life of a gear as if its last inspection had been that of another one."""
    own = life.inspections[-1]
    others = other.inspections[-1]
    events = tuple(others if event is own else event for event in life.events)
    return replace(life, key=(life.name, other.name), events=events)


def _fit(scores: Collection[Scores]) -> Array:
    """Chance that inspections lie as far from their forecasts as their scores do. [1]"""
    from scipy.special import chdtrc

    return np.asarray(chdtrc([*map(len, scores)], [*map(_square, scores)]), float)


def _square(*scores: Scores) -> float:
    return sum(z**2 for of_gear in scores for z in of_gear.values())
