"""A large store, timed: ``python tests/benchmarks/bench_store.py [--gears 5000] [--visits 20]
[--store PATH|URL]``.

Not collected by pytest. Inspections are drawn here and kept without being judged.
Then slips are planted in a fleet of 100 gears and the suggestions counted. Every figure stands
beside its target, reached or not.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from datetime import date, timedelta
from pathlib import Path
from typing import TypeVar

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[2]))

from mlg_troubleshoot.decision.inspection import Inspection, Side
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.gear.gear_file import load_gear
from mlg_troubleshoot.life import folding
from mlg_troubleshoot.life.forecast import fit_fleet, forecast
from mlg_troubleshoot.life.landings_left import Asked, FleetLine
from mlg_troubleshoot.life.unrecorded_work import suggestions
from mlg_troubleshoot.reporting.life_json import fleet_as_json
from mlg_troubleshoot.store import Record, Store, inspection_record
from mlg_troubleshoot.units import ClearanceConvention

T = TypeVar("T")


def show(what: str, found: str, target: str, *, met: bool) -> None:
    """Print one figure beside its target."""
    print(f"{what:<60} {found:>30}   {target:<10} {'met' if met else 'NOT MET'}", flush=True)


def timed(what: str, most_s: float, work: Callable[[], T]) -> T:
    """Time one piece of work, by the clock and by the processor: on a busy machine only the second
    says something.
    """
    start, worked = time.perf_counter(), time.process_time()
    result = work()
    taken, worked = time.perf_counter() - start, time.process_time() - worked
    show(what, f"{taken:.2f} s, processor {worked:.2f} s", f"<= {most_s:g} s", met=taken <= most_s)
    return result


def lives(gears: int, visits: int, rng: np.random.Generator) -> list[list[Inspection]]:
    """Draw gears whose ten joints wear at their own paces, read to 0.0001 in."""
    found = []
    for number in range(gears):
        pace = 1.2e-6 * np.exp(0.4 * rng.standard_normal(10))
        wear = np.full(10, 0.0005)
        own = []
        for visit in range(visits):
            wear = wear + rng.gamma(8.0, 200.0 * pace / 8.0)
            read = np.round(np.maximum(wear + 0.0004 * rng.standard_normal(10), 0.0), 4)
            own.append(
                Inspection(
                    f"{number}-{visit}",
                    f"N{number // 2}",
                    Side.RH if number % 2 else Side.LH,
                    ClearanceConvention.RADIAL,
                    {n + 1: float(value) for n, value in enumerate(read)},
                    inspection_date=date(2015, 1, 1) + timedelta(days=60 * visit),
                    gear_landings=200.0 * (visit + 1),
                )
            )
        found.append(own)
    return found


def records(drawn: list[list[Inspection]]) -> list[Record]:
    """Turn inspections into records, as keeping does."""
    return [inspection_record(inspection) for own in drawn for inspection in own]


def slips(gear: Gear, rng: np.random.Generator, trials: int) -> None:
    """Plant missed restorations in fleets of 100, and count what is suggested.

    A gear restored after 2,800 landings drops by five forecast standard deviations at a joint of
    mean pace.
    """
    drawn = lives(100, 14, rng)
    found_restored = asked = false = 0
    for trial in range(trials):
        planted = [list(own) for own in drawn]
        restored = int(rng.integers(100))
        last = planted[restored][-1]
        planted[restored][-1] = replace(last, clearance_in=dict.fromkeys(last.clearance_in, 0.0005))
        said = suggested(planted, gear)
        name = f"N{restored // 2} {'RH' if restored % 2 else 'LH'}"
        asked += 1
        found_restored += any(line.startswith(f"{name}: ") for line in said)
        if trial == 0:
            false = len(suggested(drawn, gear))
    show(
        "missed restorations suggested",
        f"{found_restored} of {asked}",
        ">= 95 %",
        met=found_restored >= 0.95 * asked,
    )
    show("suggested in 100 sound gears", str(false), "<= 1", met=false <= 1)


def suggested(drawn: list[list[Inspection]], gear: Gear) -> list[str]:
    """Ask for suggestions from a store of these lives."""
    with tempfile.TemporaryDirectory() as folder:
        store = Store(Path(folder) / "store.sqlite")
        store.add([inspection_record(inspection) for own in drawn for inspection in own])
        by_key = folding.lives(store)
    kept = list(by_key.values())
    model = fit_fleet(kept, gear)
    forecasts = forecast(kept, model, gear)
    return suggestions(by_key, forecasts)


def main() -> None:
    """Print the figures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--gears", type=int, default=5000)
    parser.add_argument("--visits", type=int, default=20)
    parser.add_argument(
        "--slips", type=int, default=20, help="fleets of 100 gears with planted slips"
    )
    parser.add_argument("--store")
    given = parser.parse_args()
    gear, rng = load_gear(), np.random.default_rng(1)
    slips(gear, rng, given.slips)
    drawn = lives(given.gears, given.visits, rng)
    count = given.gears * given.visits
    with tempfile.TemporaryDirectory() as folder:
        store = Store(given.store or Path(folder) / "store.sqlite")
        timed(
            f"keeping {count} inspections of {given.gears} gears",
            60.0,
            lambda: store.add(records(drawn)),
        )
        if given.store is None:
            size = Path(store.place).stat().st_size / 1e6
            show("size of the store", f"{size:.0f} MB", "<= 250 MB", met=size <= 250)
        timed("one gear's life", 0.5, lambda: folding.life_of(store, "N7", "LH"))

        def page() -> list[folding.GearLife]:
            found = list(folding.lives(store).values())
            asked = Asked(load_gear())
            fleet_as_json([FleetLine.of(life, asked) for life in found], {})
            return found

        found = timed("the fleet without forecasts", 10.0, page)
        timed(
            "the fleet's forecasts",
            60.0,
            lambda: forecast(found, fit_fleet(found, gear), gear),
        )


if __name__ == "__main__":
    main()
