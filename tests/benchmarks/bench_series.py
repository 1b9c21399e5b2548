"""How often ``diagnose_simulation`` is right where rows follow each other.

``python -m tests.benchmarks.bench_series nulls|power|smooth|speed [--draws 25] [--seed 0]
[--noise KIND ...] [--size 14] [--without-series]`` prints a line for each noise:

- ``nulls``: nothing is wrong; share of draws with a cause, with the verdict NAMED, with an alarm;
- ``power``: one parameter is wrong by so many standard deviations of the mean of white noise:
  named, in the set, a wrong unique name, and how many 95 % intervals of it hold the true value;
- ``smooth``: something smooth is wrong that no suspect is, by 40 of these: the verdicts;
- ``speed``: 2,000 rows × 2 outputs, 12 suspects, a call of 10 ms.

Progress goes to standard error.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mlg_troubleshoot.diagnosis import SimulationDiagnosis, Suspect, Verdict, diagnose_simulation
from tests.simulation.rigs import Array, Rig
from tests.simulation.timed_rigs import NOISES, TIMED, scatter

Labels = NDArray[np.int64]
# Size of what no suspect is, in standard deviations of the mean of white noise.
SMOOTH = 40.0


@dataclass(frozen=True)
class Draw:
    """Readings of a rig in one, two or three series, and what is wrong there."""

    rig: Rig
    exact: Array
    read: Array
    series: Labels
    noise: float
    name: str | None
    true: Mapping[str, float]

    def diagnosed(self, stated: bool = True) -> SimulationDiagnosis:
        """Diagnose these rows, with or without saying that they follow each other."""
        return diagnose_simulation(
            self.rig.predict,
            self.read,
            self.rig.suspected,
            self.rig.unknown,
            series=self.series if stated else None,
        )


def drawn(rig_name: str, kind: str, size: float, smooth: bool, seed: tuple[int, int]) -> Draw:
    """Draw readings; `size` 0 is nothing wrong, with `smooth` the wrong thing is on no list."""
    rng = np.random.default_rng([*seed, sum(map(ord, rig_name + kind)), int(size), int(smooth)])
    n = int(rng.integers(60, 201))
    rig = TIMED[rig_name](n, rng)
    series = np.arange(n) * int(rng.integers(1, 4)) // n
    here = rig.nominal
    true = {
        **here,
        **{name: value + t * rng.uniform(-1.0, 1.0) for name, (value, t) in rig.nuisance.items()},
    }
    exact, name = rig.predict(true)[:, 0], None
    noise = 0.02 * float(np.std(exact))
    if size and smooth:
        turns = rng.uniform(0.5, 1.5)
        bend = np.sin(2.0 * np.pi * (turns * np.linspace(0.0, 1.0, n) + rng.uniform()))
        exact = exact + size * noise / np.sqrt(n) * bend / np.std(bend)
    elif size:
        name = str(rng.choice(list(rig.suspects)))
        nominal, trial = rig.suspects[name]
        change = float(rng.choice([-2.0, -1.0, 1.0, 2.0])) * trial
        noise = rig.seen(name, change) * np.sqrt(n) / size
        true[name] = nominal + change
        exact = rig.predict(true)[:, 0]
    errors = [scatter(kind, exact[series == k], rng) for k in range(series.max() + 1)]
    return Draw(rig, exact, exact + noise * np.concatenate(errors), series, noise, name, true)


def draws(kind: str, size: float, smooth: bool, wanted: argparse.Namespace) -> Iterator[Draw]:
    """All draws of a noise, the rigs in turn."""
    for number in range(wanted.draws):
        for rig_name in TIMED:
            yield drawn(rig_name, kind, size, smooth, (wanted.seed, number))
        print(f"{kind}: {number + 1} of {wanted.draws}", end="\r", file=sys.stderr, flush=True)


def counted(draw: Draw, found: SimulationDiagnosis) -> Counter[str]:
    """What is right and wrong in a diagnosis, 1 each."""
    count = Counter(draws=1, alarm=int(found.verdict is not Verdict.NONE))
    count[str(found.verdict)] += 1
    causes = [{cause.name, *cause.aliases} for cause in found.causes]
    if draw.name is None:
        count["a cause"] += bool(causes)
        return count
    if draw.name in found.untestable:
        return Counter(untestable=1)
    right = [draw.name in names for names in causes]
    listed = [*found.causes, *found.also_possible]
    count["named"] += any(right)
    count["in the set"] += any(draw.name in {cause.name, *cause.aliases} for cause in listed)
    count["wrong unique"] += found.verdict is Verdict.NAMED and not all(right)
    for cause in listed:
        if cause.name == draw.name:
            low, high = cause.interval
            count["intervals"] += 1
            count["hold"] += low <= draw.true[draw.name] <= high
    return count


def rates(wanted: argparse.Namespace, size: float, smooth: bool) -> None:
    """Print what is right and wrong for each noise."""
    for kind in wanted.noise:
        total: Counter[str] = Counter()
        for draw in draws(kind, size, smooth, wanted):
            total += counted(draw, draw.diagnosed(not wanted.without_series))
        print(f"{kind:8}", dict(total), flush=True)


def speed() -> None:
    """Print calls and processor time; the simulation sleeps, which takes no processor time."""
    rng = np.random.default_rng(0)
    slopes = rng.standard_normal((4000, 12))
    names = [f"p{k}" for k in range(12)]

    def predict(p: Mapping[str, float]) -> Array:
        time.sleep(0.01)
        x = np.array([p[name] for name in names])
        return np.asarray((slopes @ (x + 0.05 * x**2)).reshape(2000, 2))

    read = predict({name: 0.5 * (name == "p0") for name in names})
    errors = [scatter("AR .7", read[:, 0], rng) for _output in range(2)]
    start = time.process_time()
    found = diagnose_simulation(
        predict,
        read + np.column_stack(errors),
        [Suspect(name, 0.0, 0.1) for name in names],
        series=np.arange(2000) // 250,
    )
    print(
        f"2,000 × 2 readings, 12 suspects: {time.process_time() - start:.1f} s of processor time,"
        f" {found.calls} calls; {found.verdict}, {[cause.name for cause in found.causes]}"
    )


def main() -> None:
    """Run what the command line asks for."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("what", choices=["nulls", "power", "smooth", "speed"])
    parser.add_argument("--draws", type=int, default=25, help="draws of each of the eight rigs")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--size", type=float, default=14.0)
    parser.add_argument("--noise", nargs="+", default=NOISES, choices=NOISES)
    parser.add_argument("--without-series", action="store_true")
    wanted = parser.parse_args()
    if wanted.what == "speed":
        speed()
    else:
        size = {"nulls": 0.0, "power": wanted.size, "smooth": SMOOTH}[wanted.what]
        rates(wanted, size, wanted.what == "smooth")


if __name__ == "__main__":
    main()
