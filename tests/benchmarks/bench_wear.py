"""Forecasts of wear beside other ways to forecast: ``python tests/benchmarks/bench_wear.py
[--fleets N] [--quick]``.

Not collected by pytest. Liners and cracks are measured series beside the checkout
(``../shared/real``); cracks are forecast in 1/sqrt(length), in which their paths are nearly
straight, and to their limit of 1.2 in both in length and so. The simulated fleets come from
``tests/wear/worlds.py``, which shares no code with the product: four worlds as the model thinks of
them and four that it does not know. Every figure stands beside its target, reached or not.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
import warnings
from collections.abc import Callable, Mapping
from datetime import date, timedelta
from pathlib import Path

import numpy as np
import statsmodels.api as sm
import surpyval
from numpy.typing import NDArray

sys.path.insert(0, str(Path(__file__).parents[2]))

from mlg_troubleshoot.decision.inspection import Inspection, Side
from mlg_troubleshoot.gear.gear_file import load_gear
from mlg_troubleshoot.life import folding
from mlg_troubleshoot.life.forecast import fit_fleet, landings_of_bands, teachers_first
from mlg_troubleshoot.life.forecast import forecast as look_ahead
from mlg_troubleshoot.store import Store, inspection_record
from mlg_troubleshoot.units import ClearanceConvention
from mlg_troubleshoot.wear import Samples, WearPath, fit_wear
from tests.wear import real, worlds

Array = NDArray[np.float64]
Known = Mapping[str, Array]
Forecaster = Callable[[Known], Callable[[str, Array], Array]]
# Clearance and landings of a gear where a simulated part has wear 1 and usage 1. [in; landings]
WEAR_IN, LANDINGS = 0.003, 4000.0
# What a row without a gauge uncertainty is taken to have. [in]
GAUGE_U_IN = 0.0005
# Samples that stand for a forecast distribution. [1]
N = 2000
Z = np.random.default_rng(0).standard_normal(N)


def crps(samples: Array, value: float) -> float:
    """Continuous ranked probability score of samples; of one sample the absolute error."""
    ordered, n = np.sort(samples), len(samples)
    spread = float(np.sum((2.0 * np.arange(1, n + 1) - n - 1.0) * ordered)) / n**2
    return float(np.mean(np.abs(ordered - value))) - spread


def line(h: Array) -> Array:
    """Least-squares line of a unit, level where it was read once."""
    return np.polyfit(h[:, 0], h[:, 1], 1) if len(h) > 1 else np.array([0.0, h[-1, 1]])


def ours(known: Known) -> Callable[[str, Array], Array]:
    """The project's forecast."""
    model = fit_wear([WearPath(unit, h[:, 0], h[:, 1]) for unit, h in known.items()])
    return lambda unit, usage: model.forecast(unit, usage).samples


def persistence(known: Known) -> Callable[[str, Array], Array]:
    """As last read."""
    return lambda unit, usage: np.full((len(usage), 1), known[unit][-1, 1])


def own_line(known: Known) -> Callable[[str, Array], Array]:
    """Each unit's own line."""
    return lambda unit, usage: np.polyval(line(known[unit]), usage)[:, None]


def mixed_model(known: Known) -> Callable[[str, Array], Array]:
    """Random intercept and slope with independent errors (statsmodels)."""
    h = np.vstack(list(known.values()))
    scale = h[:, 0].max()
    group = np.concatenate([[unit] * len(rows) for unit, rows in known.items()])
    x = np.column_stack([np.ones(len(h)), h[:, 0] / scale])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        fit = sm.MixedLM(h[:, 1], x, group, x).fit()
    spread, noise, fixed = np.asarray(fit.cov_re), float(fit.scale), np.asarray(fit.fe_params)

    def forecast(unit: str, usage: Array) -> Array:
        own = known[unit]
        a = np.column_stack([np.ones(len(own)), own[:, 0] / scale])
        gain = spread @ a.T @ np.linalg.inv(a @ spread @ a.T + noise * np.eye(len(own)))
        ahead = np.column_stack([np.ones(len(usage)), usage / scale])
        mean = ahead @ (fixed + gain @ (own[:, 1] - a @ fixed))
        left = spread - gain @ a @ spread
        sd = np.sqrt(np.maximum(np.einsum("ij,jk,ik->i", ahead, left, ahead), 0.0) + noise)
        return np.asarray(mean[:, None] + sd[:, None] * Z)

    return forecast


FORECASTERS: dict[str, Forecaster] = {
    "this project": ours,
    "persistence": persistence,
    "each unit's own line": own_line,
    "statsmodels MixedLM": mixed_model,
}


def show(set_name: str, who: str, figures: str, target: str = "", *, met: bool = True) -> None:
    """Print one line of the table."""
    verdict = "" if not target else "met" if met else "NOT MET"
    print(f"{set_name:<26} {who:<21} {figures:<58} {target:<34} {verdict}", flush=True)


def forecasts(name: str, known: Known, later: Known, least: float, most_crps: float | None) -> None:
    """Compare forecasts of what was read later."""
    own_error = np.nan
    rows = {}
    for who, forecaster in FORECASTERS.items():
        forecast = forecaster(known)
        held, below, scores = [], [], []
        for unit, h in later.items():
            samples = forecast(unit, h[:, 0])
            low, high = Samples(samples).quantile([0.05, 0.95]).T
            held += list((low <= h[:, 1]) & (h[:, 1] <= high))
            below += list(h[:, 1] < low)
            scores += [crps(s, y) for s, y in zip(samples, h[:, 1], strict=True)]
        rows[who] = (np.sum(held), len(held), np.mean(below), float(np.mean(scores)))
        if forecaster is own_line:
            own_error = float(np.mean(scores))
    limit = own_error if most_crps is None else min(most_crps, own_error)
    for who, (held_count, n, below_share, score) in rows.items():
        figures = (
            f"held {held_count}/{n} = {held_count / n:.0%}, below {below_share:.0%}, CRPS"
            f" {score:.4f}"
        )
        if who == "this project":
            target = f"held >= {least:.0%}, CRPS <= {limit:.4f}"
            show(name, who, figures, target, met=bool(held_count / n >= least and score <= limit))
        else:
            point = who in {"persistence", "each unit's own line"}
            show(name, who, f"mean absolute error {score:.4f}" if point else figures)


def crack_limit(seen: float, least: int, transform: Callable[[Array], Array], name: str) -> None:
    """Compare when the crack limit is crossed, seen up to some usage."""
    data = real.cracks()
    known = {unit: h[h[:, 0] <= seen + 1e-9] for unit, h in data.items()}
    asked = {unit: h for unit, h in data.items() if known[unit][-1, 1] < 1.2 <= h[-1, 1]}
    crossing = {unit: float(np.interp(1.2, h[:, 1], h[:, 0])) for unit, h in asked.items()}
    model = fit_wear([WearPath(unit, h[:, 0], transform(h[:, 1])) for unit, h in known.items()])
    limit = float(transform(np.array([1.2]))[0])
    ends = {unit: model.usage_to_limit(unit, limit).quantile([0.05, 0.95]) for unit in asked}

    def count(ends: Mapping[str, Array]) -> tuple[int, int]:
        held = sum(ends[unit][0] <= crossing[unit] <= ends[unit][1] for unit in asked)
        return int(held), int(sum(crossing[unit] < ends[unit][0] for unit in asked))

    held, early = count(ends)
    figures = f"held {held}/{len(asked)}, before the 5 % end {early}"
    show(
        name,
        "this project",
        figures,
        f"held >= {least}, early <= 1",
        met=held >= least and early <= 1,
    )
    # A life distribution of the whole population, of the crossings that each unit's own line
    # promises.
    slope = {
        unit: line(np.column_stack([h[:, 0], transform(h[:, 1])])) for unit, h in known.items()
    }
    promised = np.array([(limit - b) / a for a, b in slope.values()])
    weibull = surpyval.Weibull.fit(x=promised)
    population = np.asarray(weibull.qf(np.array([0.05, 0.95])), float)
    held, early = count(dict.fromkeys(asked, population))
    show(name, "surpyval Weibull", f"held {held}/{len(asked)}, before the 5 % end {early}")


def simulated(kind: str, fleets: int) -> None:
    """Hold forecasts of simulated fleets against what then happened."""
    held: list[bool] = []
    limit_held: list[bool] = []
    early: list[bool] = []
    scores: list[float] = []
    errors: list[float] = []
    for seed in range(fleets):
        rng = np.random.default_rng(100 + seed)
        parts = worlds.fleet(kind, rng)
        paths = [WearPath(life.unit, life.usage, life.read) for part in parts for life in part[:-1]]
        seen = rng.integers(1, 6, len(parts))
        now = [(part[-1], n) for part, n in zip(parts, seen, strict=True)]
        model = fit_wear(
            [*paths, *(WearPath(life.unit, life.usage[:n], life.read[:n]) for life, n in now)]
        )
        for life, n in now:
            samples = model.forecast(life.unit, life.usage[n:]).samples
            low, high = Samples(samples).quantile([0.05, 0.95]).T
            held += list((low <= life.read[n:]) & (life.read[n:] <= high))
            scores += [crps(s, y) for s, y in zip(samples, life.read[n:], strict=True)]
            own = np.column_stack([life.usage[:n], life.read[:n]])
            errors += list(np.abs(np.polyval(line(own), life.usage[n:]) - life.read[n:]))
            crossing = life.crossing(1.6)
            if crossing > life.usage[n - 1]:
                low, high = model.usage_to_limit(life.unit, 1.6).quantile([0.05, 0.95])
                early.append(crossing < low)
                limit_held.append(
                    low <= crossing <= high if np.isfinite(crossing) else high > life.grid[-1]
                )
    known, most = kind in worlds.KINDS, 0.10 if kind == "gamma" else 0.07
    figures = (
        f"held {np.mean(held):.1%}, limit {np.mean(limit_held):.1%}, early {np.mean(early):.1%}, "
        f"CRPS {np.mean(scores):.3f} ({np.mean(errors):.3f})"
    )
    met = (
        0.88 <= np.mean(held) <= 0.95
        and np.mean(early) <= most
        and np.mean(scores) <= np.mean(errors)
    )
    show(
        f"simulated: {kind}",
        "this project",
        figures,
        f"88-95 %, early <= {most:.0%}" if known else "",
        met=bool(met),
    )


def large_fleet(kind: str, fleets: int, gears: int) -> None:
    """Hold the forecasts of fleets in a store, which learn from a part of their joints, against the
    wear that then came.
    """
    known_gear, numbers = load_gear(), range(1, 11)
    ahead = landings_of_bands(known_gear)
    held: list[bool] = []
    limit_held: list[bool] = []
    early: list[bool] = []
    for seed in range(fleets):
        rng = np.random.default_rng(37_000 + seed)
        parts = worlds.fleet(kind, rng, parts=gears * len(numbers), restored=0.0)
        drawn = [[part[0] for part in parts[g::gears]] for g in range(gears)]
        kept = []
        last = {}
        for g, joints in enumerate(drawn):
            usage = np.sort(rng.uniform(0.02, 1.5, rng.integers(1, 6)))
            key = f"N{g}", "LH"
            last[key] = usage[-1], joints
            for visit, at in enumerate(usage):
                true_in = WEAR_IN * np.array([np.interp(at, p.grid, p.true) for p in joints])
                read = true_in + GAUGE_U_IN * rng.standard_normal(len(true_in))
                inches = np.maximum(np.round(read, 4), 0.0)
                clearance_in = dict(zip(numbers, map(float, inches), strict=True))
                kept.append(
                    inspection_record(
                        Inspection(
                            f"{g}-{visit}",
                            key[0],
                            Side.LH,
                            ClearanceConvention.RADIAL,
                            clearance_in,
                            inspection_date=date(2015, 1, 1) + timedelta(days=60 * visit),
                            gear_landings=float(LANDINGS * at),
                        )
                    )
                )
        with tempfile.TemporaryDirectory() as folder:
            store = Store(Path(folder) / "store.sqlite")
            store.add(kept)
            found = folding.lives(store)
        model = fit_fleet(map(found.__getitem__, teachers_first(found)), known_gear)
        for key, forecast in look_ahead(list(found.values()), model, known_gear).items():
            now, joints = last[key]
            # What is over its limit is due at once, without a forecast.
            if forecast.due_now:
                continue
            # Wear is known along the grid only.
            known = LANDINGS * now + ahead <= LANDINGS * joints[0].grid[-1]
            for joint, part in zip(numbers, joints, strict=True):
                low, _middle, high = forecast.bands[joint]
                at = now + ahead[known] / LANDINGS
                true = np.maximum(WEAR_IN * np.interp(at, part.grid, part.true), 0.0)
                held += list((low[known] <= true) & (true <= high[known]))
                crossing = LANDINGS * (
                    part.crossing(known_gear.joint(joint).limit.value / WEAR_IN) - now
                )
                if crossing > 0.0:
                    ends = forecast.joints[joint]
                    low_end = np.inf if ends["p05"] is None else ends["p05"]
                    high_end = np.inf if ends["p95"] is None else ends["p95"]
                    early.append(crossing < low_end)
                    limit_held.append(
                        low_end <= crossing <= high_end
                        if np.isfinite(crossing)
                        else high_end > LANDINGS * (part.grid[-1] - now)
                    )
    most = 0.10 if kind == "gamma" else 0.07
    show(
        f"fleets of {gears} gears: {kind}",
        "this project",
        f"held {np.mean(held):.1%} of {len(held)}, limit {np.mean(limit_held):.1%}, "
        f"early {np.mean(early):.1%} of {len(early)}",
        f"88-95 %, early <= {most:.0%}",
        met=bool(0.88 <= np.mean(held) <= 0.95 and np.mean(early) <= most),
    )


def speed(gears: int) -> None:
    """Fit and forecast ten joints of each gear."""
    rng = np.random.default_rng(0)
    paths = []
    for number in range(10 * gears):
        n = int(rng.integers(1, 8))
        usage = np.cumsum(rng.uniform(100.0, 400.0, n))
        value = 0.001 + rng.lognormal(-0.1, 0.3) * 2e-6 * usage + 0.0004 * rng.standard_normal(n)
        paths.append(WearPath(f"{number}", usage, np.round(value, 4), 0.0005))
    start = time.perf_counter()
    model = fit_wear(paths)
    samples = model.usage_to_limit([path.unit for path in paths], 0.0075)
    samples.quantile([0.05, 0.5, 0.95])
    taken = time.perf_counter() - start
    show(
        f"{gears} gears x 10 joints",
        "this project",
        f"fitted and forecast in {taken:.0f} s",
        "<= 60 s",
        met=taken <= 60,
    )


def main() -> None:
    """Print the table."""
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument(
        "--fleets", type=int, default=4, help="simulated fleets of 60 parts of each kind"
    )
    arguments.add_argument("--gears", type=int, default=10_000)
    arguments.add_argument(
        "--large", type=int, help="only fleets of as many gears in a store, of each kind"
    )
    given = arguments.parse_args()
    if given.large:
        for kind in worlds.KINDS:
            large_fleet(kind, given.fleets, given.large)
        return
    data = real.liners()
    known = {unit: h[: max(len(h) - 1, 1)] for unit, h in data.items()}
    forecasts(
        "liners, last visit",
        known,
        {u: h[-1:] for u, h in data.items() if len(h) > 1},
        14 / 17,
        0.20,
    )
    data = real.cracks()
    for name, transform, least, most in (
        ("cracks, 1/sqrt, 2nd half", lambda y: y**-0.5, 0.8, 0.0110),
        ("cracks, in, 2nd half", lambda y: y, 0.0, None),
    ):
        paths = {unit: np.column_stack([h[:, 0], transform(h[:, 1])]) for unit, h in data.items()}
        half = {unit: (len(h) + 1) // 2 for unit, h in paths.items()}
        later = {u: h[half[u] :] for u, h in paths.items()}
        forecasts(name, {u: h[: half[u]] for u, h in paths.items()}, later, least, most)
    for seen, least_held in ((0.03, 18), (0.06, 16)):
        crack_limit(seen, least_held, lambda y: y, f"crack limit, seen {seen}")
        crack_limit(seen, least_held, lambda y: y**-0.5, f"same in 1/sqrt, {seen}")
    for kind in (*worlds.KINDS, *worlds.FOREIGN):
        simulated(kind, given.fleets)
    speed(given.gears)


if __name__ == "__main__":
    main()
