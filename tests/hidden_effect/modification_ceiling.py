"""What no method could exceed where half of the aircraft are modified, each on a day of its own: an
oracle that knows the size of the step and all noise.

    python -m tests.hidden_effect.modification_ceiling --fleets 60 --first-seed 5970000

The fleets are those of ``blemished --cases modification``, strong. The oracle sees the misfit that
the program sees, with its estimate of the clearances. It is told what a row scatters and what the
rows of a gear have in common, both from the same fleet without the step; how large the step is,
that each aircraft has it with a chance of one half, on any day of its own alike; and that otherwise
nothing is wrong, or that all aircraft wander as far in a month as in the simulator's strong
``walk``. All three are as likely beforehand. It names as the program does: a modification from nine
to one on, and the aircraft of which all together have the step with 95 %, two at least.
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.special import logsumexp
from scipy.stats import multivariate_normal

from mlg_troubleshoot import load_gear
from mlg_troubleshoot.diagnosis.scene import build_scene
from mlg_troubleshoot.diagnosis.table import DiagnosisTable, table_from_inspections
from mlg_troubleshoot.records import ReadOptions, read_many
from mlg_troubleshoot.workflows.check import CheckOptions
from tests.hidden_effect.blemished import judged
from tests.hidden_effect.simulator import Truth, blemished_fleet, write_rows

Array = NDArray[np.float64]

STEP_IN = 0.004
WANDER_IN = 0.0006
MONTH = 30.0
SURE = 0.9
TOGETHER = 0.95


@dataclass(frozen=True)
class Told:
    """A fleet as the oracle sees it: misfit of each row [in], and what is told of its noise: the
    variance of a row by itself, and of what the rows of a gear have in common [in²].
    """

    table: DiagnosisTable
    misfit: Array
    own: float
    of_gear: float
    truth: Truth


def told(seed: int, case: str = "modification") -> Told:
    """What the oracle is told of a strong fleet of a case."""
    rows, truth = blemished_fleet(case, "strong", seed)
    table, misfit = _misfit(rows)
    _table, sound = _misfit(blemished_fleet("sound", "strong", seed)[0])
    gears, place, count = np.unique(table.gears, return_inverse=True, return_counts=True)
    mean = np.bincount(place, sound) / count
    own = float(np.sum((sound - mean[place]) ** 2) / (len(sound) - len(gears)))
    of_gear = float(np.var(mean)) - own * float(np.mean(1.0 / count))
    return Told(table, misfit - float(np.mean(sound)), own, max(of_gear, 0.0), truth)


def _misfit(rows: list[dict[str, object]]) -> tuple[DiagnosisTable, Array]:
    gear = load_gear()
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "fleet.csv"
        write_rows(rows, file)
        read = read_many([file], ReadOptions.of(gear, CheckOptions()))
    table = table_from_inspections(list(read.inspections), gear)
    scene, _rows = build_scene(gear.model, table, gear.discrepancies)
    return table, table.measured_in - scene.over_in


def aircraft(fleet: Told) -> Iterator[tuple[str, float, Array, float]]:
    """Each aircraft with the log-likelihoods of its rows: without a step, with one from each of its
    days on, and if it wanders.
    """
    for tail in np.unique(fleet.table.tails).tolist():
        rows = fleet.table.tails == tail
        days = fleet.table.quantities["day"][rows]
        gears = fleet.table.gears[rows]
        data = fleet.misfit[rows]
        noise = fleet.own * np.eye(len(data)) + fleet.of_gear * (gears[:, None] == gears)
        month = (days - days.min()) // MONTH + 1.0
        wander = noise + WANDER_IN**2 * np.minimum.outer(month, month)
        likely = multivariate_normal(cov=noise).logpdf
        steps = [float(likely(data - STEP_IN * (days >= day))) for day in np.unique(days)]
        wanders = float(multivariate_normal(cov=wander).logpdf(data))
        yield tail, float(likely(data)), np.array(steps), wanders


def named(fleet: Told, *, may_wander: bool) -> list[str]:
    """Aircraft that the oracle names as modified."""
    nothing = steps = wanders = 0.0
    chance = {}
    for tail, bare, each, wandering in aircraft(fleet):
        stepped = each - np.log(len(each))
        either = float(logsumexp([bare, logsumexp(stepped)]))
        nothing += bare
        steps += either - np.log(2.0)
        wanders += wandering
        # Rows on both sides of the step.
        chance[tail] = float(np.exp(logsumexp(stepped[1:]) - either)) if len(each) > 1 else 0.0
    others = [nothing, wanders] if may_wander else [nothing]
    if float(np.exp(steps - logsumexp([steps, *others]))) < SURE:
        return []
    found: list[str] = []
    together = 1.0
    for tail in sorted(chance, key=lambda name: -chance[name]):
        together *= chance[tail]
        if together < TOGETHER:
            break
        found.append(tail)
    return found if len(found) > 1 else []


def right(fleet: Told, *, may_wander: bool) -> tuple[bool, bool]:
    """Whether the modification is named, and with aircraft that count as right."""
    found = named(fleet, may_wander=may_wander)
    causes = [{"cause": "modification", "target": f"tails {','.join(sorted(found))}"}]
    said = judged("NAMED" if found else "NONE", causes if found else [], [], fleet.truth)
    return bool(found), bool(said["right"])


def main() -> None:
    """Print how often the oracle is right."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--fleets", type=int, default=60)
    parser.add_argument("--first-seed", type=int, required=True)
    given = parser.parse_args()
    fleets = [told(given.first_seed + k) for k in range(given.fleets)]
    for words, may_wander in (("aircraft may wander", True), ("nothing else may act", False)):
        for least in (0, 120):
            some = [right(f, may_wander=may_wander) for f in fleets if len(f.misfit) >= least]
            said, hits = np.sum(some, axis=0)
            print(f"{words}, {least} rows or more: named {said}, right {hits} of {len(some)}")


if __name__ == "__main__":
    main()
