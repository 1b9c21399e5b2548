"""How often ``diagnose_simulation`` is right: rigs with hidden errors, groups, outliers, heavy
tails, large changes.

``python -m tests.benchmarks.bench_simulation [sets of each rig]`` prints for each rig, with nothing
wrong and with one parameter wrong at S = 10, the share of alarms, of true classes in the set, and
of wrong unique names, and the time of a set with 300 rows × 3 outputs, 24 suspects and 30 nuisance
parameters.
"""

from __future__ import annotations

import sys
import time
from collections import Counter
from collections.abc import Mapping

import numpy as np

from mlg_troubleshoot.diagnosis import SimulationDiagnosis, Suspect, Verdict, diagnose_simulation
from tests.simulation.rigs import RIGS, readings

S = 10.0


def one_set(rig_name: str, number: int, wrong: bool) -> tuple[str | None, SimulationDiagnosis]:
    """Draw a set and diagnose it: the parameter that is wrong, and what is said."""
    rng = np.random.default_rng([sum(map(ord, rig_name)), number])
    n = int(rng.integers(40, 200))
    rig = RIGS[rig_name](n, rng)
    count = int(rng.choice([0, 3, 8, 25]))
    groups = np.unique(rng.integers(0, count, n), return_inverse=True)[1] if count else None
    scatter = float(rng.choice([0.0, 0.3, 0.6])) if count else 0.0
    name, values, noise = None, {}, 0.02 * float(np.std(rig.predict(rig.nominal)))
    if wrong:
        name = str(rng.choice(list(rig.suspects)))
        nominal, trial = rig.suspects[name]
        change = float(rng.choice([-3.0, -1.0, 1.0, 3.0])) * trial
        readings_read = n * rig.predict(rig.nominal).shape[1]
        noise = rig.seen(name, change) * np.sqrt(readings_read) / S / np.sqrt(1.0 + scatter**2)
        values = {name: nominal + change}
    read = readings(
        rig,
        values,
        noise,
        rng,
        groups,
        scatter,
        0.02 * rng.integers(2),
        missing=0.01,
        heavy=bool(rng.integers(2)),
    )
    found = diagnose_simulation(rig.predict, read, rig.suspected, rig.unknown, groups)
    return name, found


def said(found: SimulationDiagnosis) -> set[str]:
    """All names in the reported set."""
    return {name for c in (*found.causes, *found.also_possible) for name in (c.name, *c.aliases)}


def timed() -> float:
    """Time one set of the size that the issue names, the simulation's own calls included. [s]"""
    rng = np.random.default_rng(0)
    slopes = rng.standard_normal((900, 54))
    names = [f"p{k}" for k in range(54)]

    def predict(p: Mapping[str, float]) -> np.ndarray:
        return (slopes @ [p[name] for name in names]).reshape(300, 3)

    true = np.where(np.arange(54) == 0, 0.5, 0.0) + np.where(np.arange(54) >= 24, 1.0, 0.0)
    read = (slopes @ true + rng.standard_normal(900)).reshape(300, 3)
    suspects = [Suspect(name, 0.0, 0.1) for name in names]
    start = time.process_time()
    diagnose_simulation(predict, read, suspects[:24], suspects[24:], np.arange(300) % 8)
    return time.process_time() - start


def main(sets: int) -> None:
    """Print the table."""
    for wrong in (False, True):
        total: Counter[str] = Counter()
        for rig_name in RIGS:
            count: Counter[str] = Counter()
            for number in range(sets):
                name, found = one_set(rig_name, number, wrong)
                if name in found.untestable:
                    continue
                count["sets"] += 1
                count["alarm"] += found.verdict is not Verdict.NONE
                if name is not None:
                    count["true class in the set"] += name in said(found)
                    unique = found.verdict is Verdict.NAMED
                    count["wrong unique name"] += unique and any(
                        name not in (c.name, *c.aliases) for c in found.causes
                    )
            print(
                f"{rig_name:12} {'one wrong' if wrong else 'nothing wrong':14}",
                dict(count),
                flush=True,
            )
            total += count
        print("all", dict(total))
    print(
        f"300 × 3 readings, 24 suspects, 30 nuisance parameters: {timed():.2f} s of processor time"
    )


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 40)
