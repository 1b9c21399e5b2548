"""Whether what is said at 90 % is right nine times in ten: a mixture of fleets of both studies.

    python -m tests.hidden_effect.calibration --fleets 300

The fleets are mixed, so that the first of them are as good a sample as all. Their seeds, 18,000,000
and following, were used for no constant of the program.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from typing import Any

from tests.hidden_effect import departures, study

# The studies set one thread a worker before numpy is loaded.
import numpy as np  # isort: skip

from tests.hidden_effect import simulator

FIRST_SEED = 18_000_000
OF_STUDY = {
    **{f"null:{name}": 10 for name in simulator.NULLS},
    "single:10": 140,
    "single:15": 112,
    "off_catalogue": 40,
    "double": 40,
    "triple": 24,
    "aliased": 10,
    "missing_column": 12,
}
OF_DEPARTURES = {
    "loads:40": 24,
    "loads:90": 20,
    "loads:180": 16,
    "loads and gauge_bias": 10,
    "linkage, nothing hidden": 36,
    "linkage, one cause": 42,
    "read #2-#5, nothing hidden": 20,
    "read #2-#5, one cause": 18,
    "blank 50 %": 20,
    "convention": 10,
    "one group": 18,
}
# Other fleets than those that are drawn: how much oftener each occurs, by what is wrong in it.
_EVERY_SECOND = tuple(simulator.CATALOGUE)[::2]
MIXTURES: dict[str, Callable[[list[str]], float]] = {
    "as drawn": lambda _wrong: 1.0,
    "nothing wrong three times as often": lambda wrong: 1.0 if wrong else 3.0,
    "nothing wrong a third as often": lambda wrong: 1.0 if wrong else 1.0 / 3.0,
    "unlisted three times as often": lambda wrong: (
        3.0 if set(wrong) - {*simulator.CATALOGUE, "load_directions", "convention_slip"} else 1.0
    ),
    "every second cause three times as often, the others a third": lambda wrong: float(
        np.prod(
            [3.0 if c in _EVERY_SECOND else 1.0 / 3.0 for c in wrong if c in simulator.CATALOGUE]
        )
    ),
    "every second cause a third as often, the others three times": lambda wrong: float(
        np.prod(
            [1.0 / 3.0 if c in _EVERY_SECOND else 3.0 for c in wrong if c in simulator.CATALOGUE]
        )
    ),
}
EDGES = (0.05, 0.2, 0.4, 0.6, 0.8, 0.95, 0.99, 1.0)


def tasks(first_seed: int = FIRST_SEED) -> list[tuple[int, Any]]:
    """Fleets of both studies in mixed order, each with its seed."""
    listed: list[tuple[int, Any]] = [(t["seed"], t) for t in study.tasks(OF_STUDY, first_seed)]
    listed += [(t[2], t) for t in departures.tasks(OF_DEPARTURES, first_seed + 500_000)]
    return [listed[int(k)] for k in np.random.default_rng(first_seed).permutation(len(listed))]


def run(task: Any) -> dict[str, Any]:
    """Simulate and diagnose one fleet, then compare."""
    return study.run(task) if isinstance(task, dict) else departures.run(task)


def bins(
    records: list[dict[str, Any]], oftener: Callable[[list[str]], float] = MIXTURES["as drawn"]
) -> list[tuple[float, float, int, float, float]]:
    """Of each bin: its edges, how many causes were stated in it, their mean, and the share of them
    that acts, as if fleets with something wrong were so much oftener.

    Fleets of another linkage are left out, and that as a cause: whether it shows in their rows is
    not known.
    """
    said = np.array(
        [
            (
                float(p),
                any(study._same((cause, target), tuple(t)) for t in r["truth"]),
                oftener([str(name) for name, _target in r["truth"]]),
            )
            for r in records
            if r.get("linkage", "A") == "A"
            for cause, target, p in r.get("probabilities", ())
            if cause != "geometry"
        ]
    ).reshape(-1, 3)
    found = []
    for low, high in pairwise(EDGES):
        own = said[(said[:, 0] >= low) & ((said[:, 0] < high) | (high == 1.0))]
        stated, acts = (
            np.average(own[:, :2], axis=0, weights=own[:, 2]) if len(own) else np.full(2, np.nan)
        )
        found.append((low, high, len(own), float(stated), float(acts)))
    return found


def main() -> None:
    """Print the bins."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--fleets", type=int, default=300, help="how many of the mixed fleets")
    parser.add_argument("--first-seed", type=int, default=FIRST_SEED)
    parser.add_argument("--keep", type=Path, help="file to keep records in, to go on after a stop")
    given = parser.parse_args()
    listed = tasks(given.first_seed)[: given.fleets]
    records = study.mapped(run, listed, given.workers, given.keep)
    of_study = study.summarise([r for r in records if "strengths" in r])["targets"]
    of_departures = departures.summarise([r for r in records if "strengths" not in r])["lines"]
    rates = [(name, aim, of_study[name]) for name, aim in study.AIMS.items() if name in of_study]
    rates += [(name, aim, of_departures[name]) for name, (*_f, aim) in departures.LINES.items()]
    print(*study.HEAD, *(study.rate_line(*rate) for rate in rates if rate[2]["n"]), "", sep="\n")
    print("| stated | causes | mean stated | act |\n|---|---|---|---|")
    for low, high, count, mean, acting in bins(records):
        rate = study._rate(round(acting * count) if count else 0, count)
        band = f"{rate['low']:.2f}–{rate['high']:.2f}"
        print(f"| {low:.2f}–{high:.2f} | {count} | {mean:.3f} | {rate['rate']:.3f} ({band}) |")
    print("\nact less stated, in points, in each of these bins, were the fleets others:")
    for name, oftener in MIXTURES.items():
        off = [100.0 * (acting - mean) for *_bin, mean, acting in bins(records, oftener)]
        print(f"| {name} | {' | '.join(f'{points:+.0f}' for points in off)} |")


if __name__ == "__main__":
    main()
