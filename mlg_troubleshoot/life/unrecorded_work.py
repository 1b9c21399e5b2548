"""Last inspections that wear does not explain: a restoration without a record, two gears that were
exchanged.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations, permutations

import numpy as np

from mlg_troubleshoot.arrays import Array
from mlg_troubleshoot.decision.sentences import joint_list
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.life.folding import GearKey, GearLife
from mlg_troubleshoot.life.wear_paths import wear_paths
from mlg_troubleshoot.wear import WearModel, WearPath

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
# Gears that are compared at once: their simulated clearances are 2 MB. [1]
_AT_ONCE = 100


@dataclass(frozen=True, slots=True)
class Departure:
    """How far the last inspection of a gear, on a day, lies from what its history promised: each
    joint in standard deviations, NaN where it was not read.
    """

    day: str
    scores: tuple[float, ...]


def departures(lives: Sequence[GearLife], model: WearModel, gear: Gear) -> dict[GearKey, Departure]:
    """Compare the last inspections of gears that were seen twice, the last time with their
    landings, with what was expected of them.
    """
    known = [
        life
        for life in lives
        if len(life.inspections) > 1
        and not life.warnings
        and life.inspections[-1].inspection.gear_landings is not None
    ]
    scores = _departures([(life, life) for life in known], model, gear)
    return {
        life.key: Departure(life.inspections[-1].record.day, tuple(own.tolist()))
        for life, own in zip(known, scores, strict=True)
    }


def suggestions(
    found: Mapping[GearKey, Departure],
    read: Callable[[Collection[GearKey]], Mapping[GearKey, GearLife]],
    model: WearModel | None,
    gear: Gear,
) -> list[str]:
    """Name last inspections that look like an unrecorded restoration, or like two gears exchanged.

    read: the lives of those of the gears that may have been exchanged.
    """
    exchanged = [] if model is None else _exchanged(found, read, model, gear)
    sentences = [
        f"The last inspections of {' '.join(one)} and {' '.join(other)} fit each other's wear: were"
        " they exchanged?"
        for one, other in exchanged
    ]
    explained = {key for pair in exchanged for key in pair}
    for key, departure in found.items():
        scores = zip(gear.joint_numbers, departure.scores, strict=True)
        dropped = [n for n, z in scores if z <= -_DROP]
        if dropped and key not in explained:
            name, listed = " ".join(key), joint_list(dropped)
            sentences.append(
                f"{name}: {listed} read much tighter than before. Restored without a"
                f" record? mlg history repair {name} --joint {dropped[0]} --date D"
            )
    return sentences


def _exchanged(
    found: Mapping[GearKey, Departure],
    read: Callable[[Collection[GearKey]], Mapping[GearKey, GearLife]],
    model: WearModel,
    gear: Gear,
) -> list[tuple[GearKey, GearKey]]:
    """Gears that fit each other's wear and not their own, the clearest pair first."""
    apart = np.array([departure.scores for departure in found.values()])
    apart = apart.reshape(len(found), len(gear.joint_numbers))
    scores = dict(zip(found, apart, strict=True))
    # Gears are exchanged on one aircraft, or by those who entered one day's sheets.
    misfits = [key for key, fits in zip(found, _fit(apart), strict=True) if fits < _POOR_FIT]
    pairs = [
        (one, other)
        for one, other in combinations(misfits, 2)
        if one[0] == other[0] or found[one].day == found[other].day
    ]
    lives = read({key for pair in pairs for key in pair})
    both_ways = [order for pair in pairs for order in permutations(pair)]
    crossed = _departures([(lives[a], lives[b]) for a, b in both_ways], model, gear)
    gains = []
    for n, (one, other) in enumerate(pairs):
        others = crossed[2 * n : 2 * n + 2]
        gain = (_square(scores[one], scores[other]) - _square(*others)) / 2.0
        if gain > _EXCHANGED and min(_fit(np.array(others))) > _NO_FIT:
            gains.append((gain, one, other))
    clearest: list[tuple[GearKey, GearKey]] = []
    # A gear was exchanged with one other at most.
    for _gain, one, other in sorted(gains, reverse=True):
        if not any(key in pair for pair in clearest for key in (one, other)):
            clearest.append((one, other))
    return clearest


def _fit(scores: Array) -> Array:
    """Chance that an inspection of a gear lies as far from its forecasts as its scores, the last
    axis, do. [1]
    """
    from scipy.special import chdtrc

    chance: Array = chdtrc(np.isfinite(scores).sum(axis=-1), np.nansum(scores**2, axis=-1))
    return chance


def _square(*scores: Array) -> float:
    return float(sum(np.nansum(z**2) for z in scores))


def _departures(
    pairs: Sequence[tuple[GearLife, GearLife]], model: WearModel, gear: Gear
) -> list[Array]:
    """How far the newest inspections of gears lie from what others' histories promised, in standard
    deviations.
    """
    return [
        score
        for first in range(0, len(pairs), _AT_ONCE)
        for score in _departures_of_part(pairs[first : first + _AT_ONCE], model, gear)
    ]


def _departures_of_part(
    pairs: Sequence[tuple[GearLife, GearLife]], model: WearModel, gear: Gear
) -> list[Array]:
    numbers = gear.joint_numbers
    paths: dict[str, tuple[WearPath, ...]] = {}
    at: list[tuple[int, int]] = []
    ahead = []
    read = []
    for n, (history, newest) in enumerate(pairs):
        last = newest.inspections[-1].inspection
        landings = last.gear_landings or 0.0
        before = replace(
            history, events=tuple(event for event in history.events if event is not history.latest)
        )
        for j, (own, begun) in enumerate(wear_paths(before, numbers).values()):
            if numbers[j] in last.clearance_in and len(np.asarray(own[-1].usage)):
                paths[f"{n} {j}"] = tuple(own)
                at.append((n, j))
                ahead.append(max(landings - begun, 0.0))
                read.append(last.clearance_in[numbers[j]])
    scores = np.full((len(pairs), len(numbers)), np.nan)
    if at:
        of_paths = replace(model, paths=paths)
        # Each joint as if it were the only one: what is said of a gear does not depend on others.
        usage = np.array(ahead)[:, None]
        samples = of_paths.forecast(list(paths), usage, together=1).samples[:, 0]
        departures = np.array(read) - samples.mean(axis=1)
        departures /= samples.std(axis=1)
        scores[tuple(np.array(at).T)] = departures
    return list(scores)
