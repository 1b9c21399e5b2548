"""What anybody could reach who reads no more than the technician does, but knows how the gears of
a world are drawn: ``python -m tests.decision.ceiling --world G [--seed 9100]``.

This oracle reads with the errors of the world's own gauges, of which it knows scale and slips; it
knows how gears wear there and where their pins rest. Which joints it reads beside those in the
row is chosen afterwards, the best for each gear, so that hardly any plan takes fewer minutes. It
reads the plunger, restores the quickest set after which a second repair is rare enough, reads the
plunger again and retracts. With it are printed the fewest sound joints that whoever knows all must
restore, and how far the plunger alone can tell failures by clearance from others.
"""

from __future__ import annotations

import argparse
import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tests.benchmarks.worn_gears import GROUPS, LIMIT_IN, displacement
from tests.decision.technician import (
    AREA,
    AREA_MIN,
    CLEARANCE,
    GAUGE_U_IN,
    MARGIN_IN,
    OTHER,
    PLUNGER_MIN,
    READ_MIN,
    RESTORE_MIN,
    RETRACT_MIN,
    WORLDS,
    Array,
    Gear,
    Hangar,
    World,
)
from tests.hidden_effect.simulator.linkage import load

_DRAWS = 20000
_SETS = ((np.arange(1024)[:, None] >> np.arange(10)) & 1).astype(bool)
_INSIDE = np.array([[area == name for area in AREA] for name in AREA_MIN])
# What the sum of all joints is off by, the linkage being bent. [in]
_LINEAR_U_IN = 0.001


@dataclass(frozen=True)
class Reached:
    """What the oracle's repairs of failures by clearance take; the fewest sound joints among those
    restored; other failures that look like one by clearance where 0.5 % of those are let go, and
    what other failures take then: two readings of the plunger, and the same repair of those alike.
    """

    minutes: float
    sound: float
    second: float
    fewest_sound: float
    alike: float

    @property
    def others_minutes(self) -> float:
        return 2.0 * PLUNGER_MIN * (1.0 - self.alike) + self.minutes * self.alike


def reached(world: World, n: int, seed: int, accepted: float) -> Reached:
    """What the oracle reaches on the gears of one world."""
    hangar = Hangar(world, n, seed)
    rng = np.random.default_rng(seed + 5)
    failed = [gear for gear in hangar.gears if gear.kind == CLEARANCE]
    minutes, restored, sound, second, fewest, all_of = [], 0, 0, [], 0, 0
    for gear in failed:
        spent, chosen, out = _repair(hangar, gear, rng, accepted)
        minutes.append(spent)
        restored += int(_SETS[chosen].sum())
        sound += int((_SETS[chosen] & (gear.true_in <= LIMIT_IN)).sum())
        second.append(out)
        least = _fewest_sound(hangar, gear)
        fewest += least
        all_of += least + int((gear.true_in > LIMIT_IN).sum())
    return Reached(
        float(np.mean(minutes)),
        sound / max(restored, 1),
        float(np.mean(second)),
        fewest / max(all_of, 1),
        _alike(hangar, failed),
    )


def _repair(
    hangar: Hangar, gear: Gear, rng: np.random.Generator, accepted: float
) -> tuple[float, int, bool]:
    """Minutes, the set that is restored, and whether the plunger stays outside then: whatever
    joints it would have been best to read first.
    """
    world, known = hangar.world, np.array([f"clearance_{j}_in" in gear.row for j in range(1, 11)])
    factor = np.array([world.gauge * world.slips.get(j, 1.0) for j in range(1, 11)])
    read = gear.true_in + rng.normal(0.0, GAUGE_U_IN, 10) / factor
    plunger_u = world.plunger_u_in / np.sqrt(2.0)
    seen = float(hangar.moved([gear])[0]) + rng.normal(0.0, plunger_u)
    angles = hangar.directions(_DRAWS) - load(world.linkage).angles
    strong = _amplification(world)
    turned = strong * np.cos(angles)
    near = np.maximum(read + rng.normal(0.0, GAUGE_U_IN, (_DRAWS, 10)) / factor, 0.0)
    worn = _wear(_DRAWS, rng)
    found = []
    for looks in itertools.product((0, 1, 2, 5), repeat=len(AREA_MIN)):
        # The first joints of each area that nobody read, those that move the plunger most.
        open_ones = _INSIDE & ~known
        order = np.argsort(np.where(open_ones, -strong, np.inf), axis=1).argsort(axis=1)
        taken = open_ones & (order < np.array(looks)[:, None])
        looked = known | taken.any(axis=0)
        each = turned * np.where(looked, near, worn)
        moved = each.sum(axis=1)
        fits = -0.5 * ((moved - seen) / np.hypot(plunger_u, _LINEAR_U_IN)) ** 2
        weight = np.where(np.abs(moved) > MARGIN_IN, np.exp(fits - fits.max()), 0.0) + 1e-30
        some = rng.choice(_DRAWS, 500, p=weight / weight.sum())
        chance = np.mean(np.abs(seen - each[some] @ _SETS.T) > MARGIN_IN, axis=0)
        opened = (_SETS[:, None, :] & _INSIDE).any(axis=2) | taken.any(axis=1)
        minutes = _SETS @ np.array(RESTORE_MIN) + opened @ np.array(list(AREA_MIN.values()))
        minutes += (looked & ~known) @ np.array(READ_MIN) + 2.0 * PLUNGER_MIN + RETRACT_MIN
        able = np.flatnonzero(~((looked & (read > LIMIT_IN)) & ~_SETS).any(axis=1))
        enough = able[chance[able] <= accepted]
        if len(enough):
            best = enough[np.argmin(minutes[enough])]
            found.append((float(minutes[best]), int(best)))
        elif looked.all():
            best = able[np.argmin(chance[able])]
            found.append((float(minutes[best]), int(best)))
    spent, best = min(found)
    after = np.where(_SETS[best], 0.0005, gear.true_in)
    out = abs(float(displacement(after[None], gear.angles[None], world.linkage)[0])) > MARGIN_IN
    return spent, best, bool(out)


def _wear(n: int, rng: np.random.Generator) -> Array:
    """Clearances of joints that nobody read, as `Hangar` draws those of failures by clearance."""
    share = rng.triangular(0.0, 0.0, 1.0, (n, 10))
    for group in GROUPS:
        hit = rng.random(n) < 0.15
        share[hit, rng.choice(group, int(hit.sum())) - 1] = rng.uniform(1.0, 2.0, int(hit.sum()))
    return LIMIT_IN * share


def _fewest_sound(hangar: Hangar, gear: Gear) -> int:
    """Fewest sound joints that must be restored with those over their limit."""
    over = gear.true_in > LIMIT_IN
    able = np.flatnonzero(~(over & ~_SETS).any(axis=1))
    true = np.where(_SETS[able], 0.0005, gear.true_in)
    turned = np.repeat(gear.angles[None], len(able), axis=0)
    holds = np.abs(displacement(true, turned, hangar.world.linkage)) <= MARGIN_IN
    return int((_SETS[able] & ~over).sum(axis=1)[holds].min())


def _amplification(world: World) -> Array:
    step = 1e-4 * np.eye(10)
    turned = np.repeat(load(world.linkage).angles[None], 10, axis=0)
    return displacement(step, turned, world.linkage) / 1e-4


def _alike(hangar: Hangar, failed: Sequence[Gear]) -> float:
    """Share of other failures whose plunger, read twice, stands no nearer to mid-position than that
    of the 0.5 % of failures by clearance that are let go.
    """
    others = [gear for gear in hangar.gears if gear.kind == OTHER]
    u = hangar.world.plunger_u_in / np.sqrt(2.0)
    rng = np.random.default_rng(1)
    seen = [
        np.abs(hangar.moved(some)[:, None] + rng.normal(0.0, u, (len(some), 200)))
        for some in (failed, others)
    ]
    return float(np.mean(seen[1] > np.quantile(seen[0], 0.005)))


def main() -> None:
    """Print what is reached in the worlds asked for."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--gears", type=int, default=200)
    parser.add_argument("--seed", type=int, action="append", help="may repeat; default 7100")
    parser.add_argument("--world", default="G", help="the beginning of a world's name")
    parser.add_argument("--accepted", type=float, default=0.02, help="chance of a second repair")
    chosen = parser.parse_args()
    for seed in chosen.seed or [7100]:
        for place, world in enumerate(WORLDS):
            if world.name.startswith(chosen.world):
                found = reached(world, chosen.gears, seed + place, chosen.accepted)
                print(
                    f"seed {seed + place}, {world.name}: {found.minutes:.0f} min; of those"
                    f" restored {found.sound:.1%} sound, {found.fewest_sound:.1%} at least; second"
                    f" repairs {found.second:.1%}; other failures alike {found.alike:.0%},"
                    f" {found.others_minutes:.0f} min",
                    flush=True,
                )


if __name__ == "__main__":
    main()
