"""Whether forecasts of a fleet pay on a cluster: ``python -m tests.benchmarks.bench_cluster
[--gears 500]``.

Not collected by pytest. The same forecasts in this process, by its threads, and on a local Dask
cluster of two workers to which each part's records travel. Seconds on the clock and of processor
time, of all processes.
"""

from __future__ import annotations

import argparse
import os
import pickle
import tempfile
import time
from collections.abc import Callable, Iterable
from functools import partial
from pathlib import Path

import distributed
import numpy as np

from mlg_troubleshoot.gear.gear_file import load_gear
from mlg_troubleshoot.life.folding import GearKey, GearLife, lives
from mlg_troubleshoot.life.forecast import Forecast, fit_fleet, forecast
from mlg_troubleshoot.parallel import spread
from mlg_troubleshoot.results import same
from mlg_troubleshoot.store import Store

from . import bench_store

_AT_ONCE = 100
Forecasts = dict[GearKey, Forecast]


def processor_s() -> float:
    """Processor time of this process and of the children that ended. [s]"""
    return sum(os.times()[:4])


def timed(what: str, work: Callable[[], Iterable[Forecasts]]) -> Forecasts:
    """Print what a piece of work takes."""
    start = time.perf_counter(), processor_s()
    found = {key: ahead for part in work() for key, ahead in part.items()}
    print(f"{what}: {time.perf_counter() - start[0]:.1f} s, {processor_s() - start[1]:.1f} s")
    return found


def on_cluster(
    task: Callable[[list[GearLife]], Forecasts], parts: list[list[GearLife]]
) -> Iterable[Forecasts]:
    """Forecast on two workers of one thread each, their start and end included."""
    with (
        distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, dashboard_address=None
        ) as cluster,
        distributed.Client(cluster) as client,
    ):
        start = time.perf_counter()
        yield from spread(task, parts, scheduler=client)
        print(f"of this, once the workers are there: {time.perf_counter() - start:.1f} s")


def main() -> None:
    """Print the figures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--gears", type=int, default=500)
    given = parser.parse_args()
    gear = load_gear()
    drawn = bench_store.lives(given.gears, 20, np.random.default_rng(1))
    with tempfile.TemporaryDirectory() as folder:
        store = Store(Path(folder) / "store.sqlite")
        store.add(bench_store.records(drawn, gear))
        found = list(lives(store).values())
    model = fit_fleet(found, gear)
    parts = [found[first : first + _AT_ONCE] for first in range(0, len(found), _AT_ONCE)]
    task = partial(forecast, model=model, gear=gear)
    print(
        f"load {os.getloadavg()[0]:.1f}; {len(pickle.dumps(parts[0])) / _AT_ONCE:.0f} bytes a gear"
    )
    here = timed("threads of this process, clock and processor", lambda: map(task, parts))
    there = timed("two workers of a local cluster", lambda: on_cluster(task, parts))
    print("the same to the last digit:", same(here, there))


if __name__ == "__main__":
    main()
