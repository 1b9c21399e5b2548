"""What the decision can do, measured on simulated fleets: ``python
tests/benchmarks/bench_decision.py``.

Not collected by pytest. The fleets come from ``worn_gears``, which shares no code with the product.
Every figure is printed beside its target; one that is not reached is printed all the same.
"""

from __future__ import annotations

import argparse
import itertools
import sys
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

sys.path.insert(0, str(Path(__file__).parents[2]))


from mlg_troubleshoot.decision import repair
from mlg_troubleshoot.decision.assessment import RepairSet, Verdict
from mlg_troubleshoot.decision.case import Cases, predict_batch
from mlg_troubleshoot.decision.inspection import Inspection, Side
from mlg_troubleshoot.decision.judge_rows import assess
from mlg_troubleshoot.decision.likely_worn import explain
from mlg_troubleshoot.decision.prediction import predict
from mlg_troubleshoot.decision.verdict_rule import verdict
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.gear.gear_file import load_gear
from mlg_troubleshoot.indices.index_table import read_index_table
from mlg_troubleshoot.units import ClearanceConvention
from tests.benchmarks import worn_gears

Array = NDArray[np.float64]

MARGIN_IN = 0.03
PAPER_ORDER = (2, 3, 4, 5, 1, 6, 7, 8, 9, 10)


def repair_sets(gear: Gear, of: Inspection, margin_in: float = 0.03) -> tuple[RepairSet, ...]:
    """Repair sets of one gear."""
    cases = Cases.of(gear, [replace(of, margin_in=margin_in)])
    upper = predict_batch(cases).upper
    return repair.repair_sets(cases, upper, np.array([0]))[0]


def show(what: str, found: str, target: str, *, met: bool) -> None:
    """Print one figure beside its target."""
    print(f"{what:<66} {found:>22}   {target:<12} {'met' if met else 'NOT MET'}", flush=True)


def inspection(clearance_in: dict[int, float], plunger_in: float | None = None) -> Inspection:
    """An inspection of a simulated gear."""
    return Inspection(
        record_id="simulated",
        tail_no="simulated",
        side=Side.LH,
        convention=ClearanceConvention.RADIAL,
        clearance_in=clearance_in,
        gauge_u_in=worn_gears.GAUGE_U_IN,
        gauge_u_is_default=False,
        readings_in=() if plunger_in is None else (plunger_in,),
    )


@dataclass(frozen=True, slots=True)
class Explained:
    """What the posterior said about one gear."""

    covered: tuple[bool, ...]
    covered_measured: tuple[bool, ...]
    place: int
    called: bool
    open_groups: int


def _explain_some(
    rows: Sequence[int], fleet: worn_gears.Fleet, measured: NDArray[np.bool_]
) -> list[Explained]:
    gear = load_gear()
    found = []
    for row in rows:
        read = {j + 1: float(fleet.read_in[row, j]) for j in range(10) if measured[row, j]}
        one = Cases.of(gear, [inspection(read, float(fleet.plunger_in[row]))])
        answer = explain(one)
        assert answer is not None
        true = fleet.true_in[row]
        inside = [i.low_in <= true[i.joint - 1] <= i.high_in for i in answer.intervals]
        worn = {joint + 1 for joint in np.flatnonzero(true > worn_gears.LIMIT_IN)}
        places = [k for k, group in enumerate(answer.groups) if worn & set(group.joints)]
        found.append(
            Explained(
                tuple(ok for j, ok in enumerate(inside) if not measured[row, j]),
                tuple(ok for j, ok in enumerate(inside) if measured[row, j]),
                min(places, default=-1),
                bool(answer.called_worn),
                sum(
                    any(j + 1 not in read for j in np.array(group) - 1)
                    for group in worn_gears.GROUPS
                ),
            )
        )
    return found


def explained(fleet: worn_gears.Fleet, measured: NDArray[np.bool_]) -> list[Explained]:
    """Explain every gear of a fleet, on two processes."""
    rows = np.array_split(np.arange(len(fleet.true_in)), 8)
    with ProcessPoolExecutor(2) as pool:
        return list(
            itertools.chain(*pool.map(partial(_explain_some, fleet=fleet, measured=measured), rows))
        )


def posterior(n: int) -> None:
    """Coverage of the intervals, place of the worn group, healthy gears called worn."""
    rng = np.random.default_rng(6)
    fleet = worn_gears.explained_fleet(n, rng)
    measured = rng.random((n, 10)) < 0.5
    found = explained(fleet, measured)
    cover = float(np.mean([ok for e in found for ok in e.covered]))
    show(
        f"{n} gears, half of the joints read: 90 % intervals, unread joints",
        f"{cover:.1%}",
        "88-92 %",
        met=0.88 <= cover <= 0.92,
    )
    cover = float(np.mean([ok for e in found for ok in e.covered_measured]))
    show("the same, joints that were read", f"{cover:.1%}", "88-92 %", met=0.88 <= cover <= 0.92)
    healthy = [
        e
        for e, true in zip(found, fleet.true_in, strict=True)
        if np.all(true <= worn_gears.LIMIT_IN)
    ]
    false = float(np.mean([e.called for e in healthy]))
    show(f"healthy gears ({len(healthy)}) called worn", f"{false:.2%}", "<= 1 %", met=false <= 0.01)
    worn = worn_gears.explained_fleet(n, rng, worn=None, other=0.0)
    measured = rng.random((n, 10)) < 0.5
    found = explained(worn, measured)
    top = float(np.mean([0 <= e.place < 2 for e in found]))
    show(
        f"{n} gears, one worn joint, half read: worn group in the top two",
        f"{top:.1%}",
        ">= 95 %",
        met=top >= 0.95,
    )
    best = worn_gears.best_places(worn, measured, rng)
    print(
        "    the best that anyone could do who knows how these gears were drawn:"
        f" {np.mean(best < 2):.1%}",
        flush=True,
    )
    for k in range(8):
        some = [e for e in found if e.open_groups == k]
        if len(some) >= 20:
            top = float(np.mean([0 <= e.place < 2 for e in some]))
            print(
                f"    {k} of 7 groups not fully read ({len(some)} gears): in the top two {top:.1%}"
            )


def _verdicts(gear: Gear, read: Array, measured: NDArray[np.bool_]) -> list[Verdict]:
    n = len(read)
    rows = [inspection({})] * n
    gauge = np.full(n, worn_gears.GAUGE_U_IN)
    margin, none = np.full(n, MARGIN_IN), np.zeros(n)
    p = []
    for unread in (np.zeros(10), gear.limits_in):
        found = predict(gear, rows, np.where(measured, read, unread), measured, gauge)
        p.append(found.probability_within(margin, none))
    missing = ~measured[:, :5].all(axis=1)
    return [
        verdict(float(low), float(high), critical_missing=bool(miss))
        for low, high, miss in zip(*p, missing, strict=True)
    ]


def _by_hand(gear: Gear, joints: Sequence[int]) -> float:
    minutes = {j.number: j.restore.value for j in gear.joints}
    area = {j.number: j.area for j in gear.joints}
    return sum(minutes[j] for j in joints) + sum(
        a.access.value for a in gear.areas if a.name in {area[j] for j in joints}
    )


def _beaten(gear: Gear, read: Array, best: RepairSet | None) -> bool:
    """True if another set reaches 95 % in less time, or in the same time with fewer joints."""
    must = {j + 1 for j in range(10) if read[j] > worn_gears.LIMIT_IN}
    every = [
        s for k in range(11) for s in itertools.combinations(range(1, 11), k) if must <= set(s)
    ]
    if best is None:
        rival = every
    else:
        key = (best.minutes, len(best.joints))
        rival = [s for s in every if (_by_hand(gear, s), len(s)) < key]
    if not rival:
        return False
    after = np.array(
        [[min(read[j], 0.0005) if j + 1 in s else read[j] for j in range(10)] for s in rival]
    )
    n = len(rival)
    found = predict(
        gear, [inspection({})] * n, after, np.ones((n, 10), bool), np.full(n, worn_gears.GAUGE_U_IN)
    )
    enough = found.probability_within(np.full(n, MARGIN_IN), np.zeros(n)) >= 0.95
    return bool(enough.any())


def repairs(n: int) -> None:
    """Repair sets against brute force, and the simulated gear after the repair."""
    gear = load_gear()
    rng = np.random.default_rng(8)
    true_in = worn_gears.mixed_fleet(4 * n, rng)
    true_in = true_in[worn_gears.worst(true_in) > MARGIN_IN][:n]
    n = len(true_in)
    read = worn_gears.readings(true_in, rng)
    beaten, repaired, none, not_needed = 0, [], 0, 0
    for row in range(n):
        sets = repair_sets(
            gear, inspection({j + 1: float(read[row, j]) for j in range(10)}), MARGIN_IN
        )
        if sets:
            beaten += _beaten(gear, read[row], sets[0])
            after = true_in[row].copy()
            for joint in sets[0].joints:
                after[joint - 1] = min(after[joint - 1], rng.uniform(0.0, 0.001))
            repaired.append(after)
        elif np.all(read[row] <= worn_gears.LIMIT_IN) and _verdicts(
            gear, read[row : row + 1], np.ones((1, 10), bool)
        ) == [Verdict.WITHIN_MARGIN]:
            not_needed += 1
        else:
            none += 1
            beaten += _beaten(gear, read[row], None)
    show(f"{n} gears: a smaller or quicker set exists", str(beaten), "0", met=beaten == 0)
    print(f"    {none} gears without a sufficient set, {not_needed} read as within already")
    rows = np.array(repaired)
    moved = worn_gears.worst(rows)
    moved = moved + rng.normal(size=len(rows)) * np.maximum(0.003, 0.1 * moved)
    share = float(np.mean(moved <= MARGIN_IN))
    show(
        f"simulated gear within its margin after the repair ({len(rows)})",
        f"{share:.1%}",
        ">= 95 %",
        met=share >= 0.95,
    )


def speed() -> None:
    """Time of one gear with repair sets, next joint, posterior."""
    gear = load_gear()
    table = read_index_table(gear)
    rows = {1: 0.002, 2: 0.004, 3: 0.013, 5: 0.007, 6: 0.001}
    times = []
    for _ in range(4):
        start = time.perf_counter()
        assess([inspection(rows, 0.04)], gear, table, advice=True)
        times.append(time.perf_counter() - start)
    show(
        "one gear with repair sets and next joint, first / least of 4",
        f"{times[0]:.2f} / {min(times):.2f} s",
        "<= 1 s",
        met=times[0] <= 1.0,
    )


def main() -> None:
    """Run the benchmarks."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--only", choices=("speed", "repairs", "posterior"))
    parser.add_argument(
        "--gears", type=int, default=10_000, help="size of the fleet of the posterior"
    )
    parser.add_argument(
        "--repaired", type=int, default=1_000, help="size of the fleet that is repaired"
    )
    chosen = parser.parse_args()
    parts: dict[str, Callable[[], None]] = {
        "speed": speed,
        "repairs": partial(repairs, chosen.repaired),
        "posterior": partial(posterior, chosen.gears),
    }
    for name, part in parts.items():
        if chosen.only in (None, name):
            part()


if __name__ == "__main__":
    main()
