"""How often ``diagnose_simulation`` is right where rows follow each other, beside other methods.

``python -m tests.benchmarks.bench_series nulls|power|smooth|rivals|speed [--draws 25] [--seed 0]
[--noise KIND ...] [--size 14] [--without-series]`` prints a line for each noise:

- ``nulls``: nothing is wrong; share of draws with a cause, with the verdict NAMED, with an alarm;
- ``power``: one parameter is wrong by so many standard deviations of the mean of white noise:
  named, in the set, a wrong unique name, and how many 95 % intervals of it hold the true value;
- ``smooth``: something smooth is wrong that no suspect is, by 40 of these: the verdicts;
- ``rivals``: nothing, one parameter, or something smooth that no suspect is, by this diagnosis, by
  BIC with least squares, by BIC with first-order autoregressive residuals, and by all suspects
  under a Gaussian process: names, error of the prediction in and beyond the range of the rows,
  processor time;
- ``speed``: 2,000 rows × 2 outputs, 12 suspects, a call of 10 ms.

Progress goes to standard error.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections import Counter, defaultdict
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve
from scipy.optimize import least_squares, minimize
from scipy.stats import norm

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


@dataclass(frozen=True)
class Answer:
    """What a method names, and what it predicts for all rows."""

    names: set[str]
    predicted: Array


def ours(draw: Draw, kept: NDArray[np.bool_]) -> Answer:
    """The diagnosis of the kept rows."""
    found = diagnose_simulation(
        lambda p: draw.rig.predict(p)[kept],
        draw.read[kept],
        draw.rig.suspected,
        draw.rig.unknown,
        series=draw.series[kept],
        time=np.flatnonzero(kept).astype(float),
    )
    # A class is named, not a member.
    names = {
        str(draw.name) if draw.name in (cause.name, *cause.aliases) else cause.name
        for cause in found.named
    }
    return Answer(names, draw.rig.predict(found.parameters)[:, 0])


def by_bic(draw: Draw, kept: NDArray[np.bool_], correlated: bool = False) -> Answer:
    """Least squares of the set that BIC chooses, one suspect more at a time; with `correlated` on
    innovations of first order, whose coefficient is fitted too.
    """
    rig, rows = draw.rig, np.flatnonzero(kept)
    follows = (np.diff(draw.series[rows]) == 0) & (np.diff(rows) == 1)
    steps = {name: trial for name, (_v, trial) in {**rig.suspects, **rig.nuisance}.items()}

    def fitted(chosen: list[str]) -> tuple[float, dict[str, float]]:
        free = [*rig.nuisance, *chosen]

        def values(x: Array) -> dict[str, float]:
            moved = {
                name: rig.nominal[name] + steps[name] * c for name, c in zip(free, x, strict=False)
            }
            return {**rig.nominal, **moved}

        def left(x: Array) -> Array:
            error = (draw.read - rig.predict(values(x))[:, 0])[rows] / draw.noise
            if correlated:
                stays = np.tanh(x[-1])
                fresh = np.sqrt(1.0 - stays**2) * error
                fresh[1:][follows] = error[1:][follows] - stays * error[:-1][follows]
                # The likelihood of a first row takes the determinant along.
                error = fresh * (1.0 - stays**2) ** (-0.5 * np.mean([True, *~follows]))
            return np.asarray(error)

        x = least_squares(left, np.zeros(len(free) + correlated), method="lm").x
        rows_read = len(rows)
        return rows_read * np.log(np.mean(left(x) ** 2)) + len(x) * np.log(rows_read), values(x)

    chosen: list[str] = []
    best = fitted(chosen)
    while len(chosen) < len(rig.suspects):
        others = [name for name in rig.suspects if name not in chosen]
        tried = {name: fitted([*chosen, name]) for name in others}
        name = min(tried, key=lambda one: tried[one][0])
        if tried[name][0] >= best[0]:
            break
        chosen.append(name)
        best = tried[name]
    return Answer(set(chosen), rig.predict(best[1])[:, 0])


def autoregressive(draw: Draw, kept: NDArray[np.bool_]) -> Answer:
    """BIC with first-order autoregressive residuals."""
    return by_bic(draw, kept, correlated=True)


def gaussian_process(draw: Draw, kept: NDArray[np.bool_]) -> Answer:
    """All suspects at once, linear, each wrong by some three trials, under a smooth discrepancy of
    likeliest size and length; named where 1 % of all of them would lie so far off.
    """
    rig, n = draw.rig, len(draw.read)
    here, along = rig.nominal, np.arange(n) / n
    base = rig.predict(here)[:, 0]
    every = {**rig.suspects, **rig.nuisance}
    slopes = np.column_stack(
        [3.0 * (rig.predict({**here, k: v + t})[:, 0] - base) for k, (v, t) in every.items()]
    )
    slopes /= draw.noise
    error = (draw.read - base)[kept] / draw.noise
    apart = np.where(draw.series[:, None] == draw.series, (along[:, None] - along) ** 2, np.inf)

    def smooth(x: Array) -> Array:
        return np.asarray(np.exp(2.0 * x[0] - 0.5 * apart / np.exp(2.0 * x[1])))

    def covariance(x: Array) -> Array:
        all_rows = slopes @ slopes.T + smooth(x)
        return np.asarray(all_rows[np.ix_(kept, kept)] + np.exp(2.0 * x[2]) * np.eye(kept.sum()))

    def unlikely(x: Array) -> float:
        root = cho_factor(covariance(x), lower=True)
        return float(0.5 * error @ cho_solve(root, error) + np.sum(np.log(np.diag(root[0]))))

    bounds = [(-6.0, 5.0), (np.log(0.02), np.log(3.0)), (-3.0, 3.0)]
    found = minimize(unlikely, [-1.0, np.log(0.2), 0.0], bounds=bounds, method="L-BFGS-B").x
    root = cho_factor(covariance(found), lower=True)
    weights = cho_solve(root, error)
    mean = slopes[kept].T @ weights
    variance = 1.0 - np.sum(slopes[kept] * cho_solve(root, slopes[kept]), axis=0)
    far = np.abs(mean) / np.sqrt(variance) > norm.isf(0.005 / len(rig.suspects))
    names = {name for name, stands_out in zip(rig.suspects, far, strict=False) if stands_out}
    moved = slopes @ mean + smooth(found)[:, kept] @ weights
    return Answer(names, base + draw.noise * moved)


METHODS: dict[str, Callable[[Draw, NDArray[np.bool_]], Answer]] = {
    "this diagnosis": ours,
    "BIC": by_bic,
    "AR(1) and BIC": autoregressive,
    "Gaussian process": gaussian_process,
}


def rivals(wanted: argparse.Namespace) -> None:
    """Print names, errors and time of every method for each noise; a tenth of the rows, in the
    middle, and the last quarter are held out.
    """
    for kind in wanted.noise:
        for world, size, smooth in (
            ("nothing", 0.0, False),
            ("one", wanted.size, False),
            ("smooth", SMOOTH, True),
        ):
            count: dict[str, Counter[str]] = defaultdict(Counter)
            errors: dict[str, list[tuple[float, float, float]]] = defaultdict(list)
            for draw in draws(kind, size, smooth, wanted):
                place = np.arange(len(draw.read)) / len(draw.read)
                inside, beyond = (place >= 0.35) & (place < 0.45), place >= 0.75
                for method, answers in METHODS.items():
                    start = time.process_time()
                    answer = answers(draw, ~inside & ~beyond)
                    spent = time.process_time() - start
                    off = (answer.predicted - draw.exact) / draw.noise
                    rms = [float(np.sqrt(np.mean(off[rows] ** 2))) for rows in (inside, beyond)]
                    errors[method].append((*rms, spent))
                    count[method]["draws"] += 1
                    count[method]["right"] += draw.name in answer.names
                    count[method]["false"] += bool(answer.names - {draw.name})
            for method, rows_of in errors.items():
                near, far, spent = np.median(rows_of, axis=0)
                print(
                    f"{kind:8} {world:8} {method:17} {dict(count[method])}, median error in the"
                    f" range {near:.2f}, beyond {far:.2f} of the noise, {spent:.2f} s",
                    flush=True,
                )


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
    parser.add_argument("what", choices=["nulls", "power", "smooth", "rivals", "speed"])
    parser.add_argument("--draws", type=int, default=25, help="draws of each of the eight rigs")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--size", type=float, default=14.0)
    parser.add_argument("--noise", nargs="+", default=NOISES, choices=NOISES)
    parser.add_argument("--without-series", action="store_true")
    wanted = parser.parse_args()
    if wanted.what == "speed":
        speed()
    elif wanted.what == "rivals":
        rivals(wanted)
    else:
        size = {"nulls": 0.0, "power": wanted.size, "smooth": SMOOTH}[wanted.what]
        rates(wanted, size, wanted.what == "smooth")


if __name__ == "__main__":
    main()
