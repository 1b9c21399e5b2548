"""Last inspections that wear does not explain: a restoration without a record, two gears that were
exchanged.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations, permutations

import numpy as np

from mlg_troubleshoot.arrays import Array
from mlg_troubleshoot.decision.sentences import joint_list
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.life.folding import GearLife
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


def suggestions(lives: Sequence[GearLife], model: WearModel | None, gear: Gear) -> list[str]:
    """Name last inspections that look like an unrecorded restoration, or like two gears
    exchanged.
    """
    if model is None:
        return []
    # Seen twice, the last time with its landings.
    known = [
        life
        for life in lives
        if len(life.inspections) > 1
        and not life.warnings
        and life.inspections[-1].inspection.gear_landings is not None
    ]
    scores = _departures([(life, life) for life in known], model, gear)
    exchanged = _exchanged(known, scores, model, gear)
    sentences = [
        f"The last inspections of {known[i].name} and {known[j].name} fit each other's wear: were"
        " they exchanged?"
        for i, j in exchanged
    ]
    explained = {place for pair in exchanged for place in pair}
    for i, life in enumerate(known):
        dropped = [n for n, z in zip(gear.joint_numbers, scores[i], strict=True) if z <= -_DROP]
        if dropped and i not in explained:
            listed = joint_list(dropped)
            sentences.append(
                f"{life.name}: {listed} read much tighter than before. Restored without a"
                f" record? mlg history repair {life.name} --joint {dropped[0]} --date D"
            )
    return sentences


def _exchanged(
    known: Sequence[GearLife], scores: Sequence[Array], model: WearModel, gear: Gear
) -> list[tuple[int, int]]:
    """Places of gears that fit each other's wear and not their own, the clearest pair first."""
    days = [life.inspections[-1].record.day for life in known]
    # Gears are exchanged on one aircraft, or by those who entered one day's sheets.
    misfits = [i for i, z in enumerate(scores) if _fit(z) < _POOR_FIT]
    pairs = [
        (i, j)
        for i, j in combinations(misfits, 2)
        if known[i].key[0] == known[j].key[0] or days[i] == days[j]
    ]
    both_ways = [order for pair in pairs for order in permutations(pair)]
    crossed = _departures([(known[a], known[b]) for a, b in both_ways], model, gear)
    gains = []
    for n, (i, j) in enumerate(pairs):
        others = crossed[2 * n : 2 * n + 2]
        gain = (_square(scores[i], scores[j]) - _square(*others)) / 2.0
        if gain > _EXCHANGED and min(map(_fit, others)) > _NO_FIT:
            gains.append((gain, i, j))
    found: list[tuple[int, int]] = []
    # A gear was exchanged with one other at most.
    for _gain, i, j in sorted(gains, reverse=True):
        if not any(place in pair for pair in found for place in (i, j)):
            found.append((i, j))
    return found


def _fit(scores: Array) -> float:
    """Chance that an inspection of a gear lies as far from its forecasts as these scores do. [1]"""
    from scipy.special import chdtrc

    return float(chdtrc(np.sum(np.isfinite(scores)), _square(scores)))


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
