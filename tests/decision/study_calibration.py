"""What the program states about chances, against what is true of the robot's gears: ``python -m
tests.decision.study_calibration [--gears 400] [--seed 8100]``.

Gears of every world of ten linkages with true gauges, as they stand before anything is done to
them: none, two, five or ten joints read, plunger read once. A line is a bin of ten percent with at
least thirty gears: what was said on average, and how often it was so.
"""

from __future__ import annotations

import argparse
import tempfile
from collections import defaultdict
from pathlib import Path

import numpy as np

from mlg_troubleshoot.decision.belief import believed
from mlg_troubleshoot.decision.prediction import Cases
from mlg_troubleshoot.life.forecast import expected_of
from mlg_troubleshoot.workflows.check import CheckOptions, check_files
from tests.benchmarks.worn_gears import LIMIT_IN, displacement, worst
from tests.decision.technician import CLEARANCE, MARGIN_IN, MISRIGGED, NONE, OTHER, Hangar, World

_TURNS = 150
_MIX = (3.0, 1.0, 4.0, 1.0)


def _said(hangar: Hangar, folder: Path, rng: np.random.Generator) -> dict[str, list]:
    """Pairs of what was said and what is true, by kind of statement."""
    world, gears = hangar.world, hangar.gears
    pairs: dict[str, list] = defaultdict(list)
    true = np.array([gear.true_in for gear in gears])
    bound = worst(true, world.linkage)
    unread = hangar.judged(gears, folder)
    for gear in gears:
        hangar.read_plunger(gear)
    hangar.judged(gears, folder)
    result = check_files([folder / "row.csv"], CheckOptions(advice=False))
    fleet = None if hangar.store is None else expected_of(hangar.store, result.gear)
    rows = [judgement.inspection for judgement in result.judgements]
    cases = Cases.of(result.gear, rows, fleet=fleet)
    beliefs = [*believed(cases, range(len(cases)))]
    causes = [belief.chances[place] for belief, place in beliefs]
    for i, (gear, said) in enumerate(zip(gears, unread, strict=True)):
        read = cases.measured[i]
        if read.all():
            pairs["worst case within, ten joints read"].append(
                (said["probability_within_margin"], bound[i] <= MARGIN_IN)
            )
            z = (bound[i] - said["predicted_displacement_in"]) / said["standard_uncertainty_in"]
            pairs["z"].append((z, abs(z) <= 1.645))
        # Whatever happened to the gear: its pins rest anew in random directions.
        turned = rng.uniform(0.0, 2.0 * np.pi, (_TURNS, 10))
        moved = displacement(np.repeat(true[i : i + 1], _TURNS, axis=0), turned, world.linkage)
        name = "random directions, ten read" if read.all() else "random directions, some unread"
        chance = float(np.mean(np.abs(moved) > MARGIN_IN))
        pairs[name].append((said["probability_exceed_random_directions"], chance))
        if gear.kind != NONE:
            pairs["the joints"].append((causes[i][0], gear.kind == CLEARANCE))
            pairs["rigging"].append((causes[i][1], gear.kind == MISRIGGED))
            pairs["something else"].append((causes[i][2], gear.kind == OTHER))
        if gear.kind in (CLEARANCE, MISRIGGED):
            belief, place = beliefs[i]
            for j in np.flatnonzero(~read):
                worn = float(belief.worn[place, j])
                pairs["worn, unread joint"].append((worn, true[i, j] > LIMIT_IN))
    hangar.work(folder)
    for gear in gears:
        pairs["a second repair"] += gear.chances
    return pairs


def main() -> None:
    """Print what was said and what was so, bin by bin."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--gears", type=int, default=200)
    parser.add_argument("--seed", type=int, default=8100)
    parser.add_argument("--pins", default="uniform")
    parser.add_argument("--known", type=int, default=0, help="gears of the fleet that are kept")
    chosen = parser.parse_args()
    pairs: dict[str, list] = defaultdict(list)
    with tempfile.TemporaryDirectory() as folder:
        for place, linkage in enumerate("ABCDEFGHIJ"):
            world = World(linkage, linkage, chosen.pins, mix=_MIX)
            hangar = Hangar(world, chosen.gears, chosen.seed + place)
            if chosen.known:
                hangar.kept(chosen.known, chosen.seed + 5000 + place, Path(folder))
            rng = np.random.default_rng(chosen.seed + 50 + place)
            for name, some in _said(hangar, Path(folder), rng).items():
                pairs[name] += some
    z = np.array(pairs.pop("z"))
    print(
        f"standardised error of the worst case: sd {z[:, 0].std():.2f}, within 1.645:"
        f" {z[:, 1].mean():.1%} of {len(z)}"
    )
    for name, some in pairs.items():
        said, was = np.array(some, float).T
        place = np.minimum((said * 10).astype(int), 9)
        lines = [
            f"{said[place == k].mean():.1%} {was[place == k].mean():.1%} ({(place == k).sum()})"
            for k in range(10)
            if (place == k).sum() >= 30
        ]
        print(f"{name}: " + "; ".join(lines), flush=True)


if __name__ == "__main__":
    main()
