"""The advice beside other ways to go about it: ``python tests/benchmarks/bench_advice.py [--gears
2000] [--true B]``.

Not collected by pytest. A robot that knows the true clearances and directions does what each policy
says; gears, linkage and costs share no code with the product (`tests/decision/robot.py`). Every
figure is printed beside its target.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[2]))

from tests.decision import robot
from tests.decision.robot import AREA_MIN, PLUNGER_MIN, READ_MIN, RESTORE_MIN, Figures, Gears

PAPER_ORDER = (2, 3, 4, 5, 1, 6, 7, 8, 9, 10)


def _rows(gears: Gears, folder: Path, which: np.ndarray) -> dict[int, dict[str, Any]]:
    return (
        {}
        if not len(which)
        else dict(zip(which.tolist(), robot.judged(folder / "t.csv", gears, which), strict=True))
    )


def _measure(gears: Gears, i: int, joints: list[int], rng: np.random.Generator) -> None:
    gears.open(i, joints)
    for j in joints:
        gears.minutes[i] += READ_MIN[j - 1]
        gears.read(i, j, rng)


def _best_repair(gears: Gears, folder: Path, rng: np.random.Generator) -> None:
    """Restore the best set of a gear that failed and is not within its margin, else what is over
    its limit.
    """
    for i, row in _rows(gears, folder, np.arange(len(gears.kind))).items():
        over = [j["joint"] for j in row["joints"] if j["over_limit"]]
        wanted = bool(gears.failed[i]) and row["verdict"] != "WITHIN_MARGIN"
        joints = row["repair_sets"][0]["joints"] if wanted and row["repair_sets"] else over
        if joints:
            gears.restore(i, joints, rng)
        gears.rounds[i] += 2
        gears.end[i] = row["end"]
    gears.failed = (gears.kind == robot.OTHER) | (np.abs(gears.moved()) > robot.MARGIN_IN)


def measure_all(gears: Gears, folder: Path, rng: np.random.Generator) -> None:
    """Measure all ten, then the best repair."""
    for i in range(len(gears.kind)):
        _measure(gears, i, [j for j in range(1, 11) if np.isnan(gears.read_in[i, j - 1])], rng)
    _best_repair(gears, folder, rng)


def paper_order(gears: Gears, folder: Path, rng: np.random.Generator) -> None:
    """Measure in the order of the paper's indices until there is a verdict, then the best
    repair.
    """
    going = np.arange(len(gears.kind))
    while len(going):
        found = _rows(gears, folder, going)
        going = np.array(
            [i for i in going if found[int(i)]["verdict"] == "INCOMPLETE"], dtype=np.intp
        )
        for i in going:
            _measure(
                gears,
                int(i),
                [next(j for j in PAPER_ORDER if np.isnan(gears.read_in[i, j - 1]))],
                rng,
            )
    _best_repair(gears, folder, rng)


def oracle(gears: Gears, folder: Path, rng: np.random.Generator) -> None:
    """Know the clearances without reading them, and be bound by the same rule."""
    gears.read_in[:] = gears.true_in
    robot.play(gears, folder, rng)


def advice(gears: Gears, folder: Path, rng: np.random.Generator) -> None:
    """Do what the next action says."""
    robot.play(gears, folder, rng)


def go_on(gears: Gears, _folder: Path, _rng: np.random.Generator) -> None:
    """Say CONTINUE at once."""
    gears.end = ["CONTINUE"] * len(gears.kind)


def main() -> None:
    """Run all policies on the same gears and print one table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--gears", type=int, default=2000)
    parser.add_argument("--true", default="A", help="linkage of the gears; the tool has A")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", action="append", help="a policy; may repeat")
    chosen = parser.parse_args()
    print(
        f"Cost model (assumed, from the gear file): areas {AREA_MIN} min an opening, joints"
        f" {READ_MIN} min to read, {RESTORE_MIN} min to restore, {PLUNGER_MIN} min for the"
        f" plunger.\n{chosen.gears} gears of linkage {chosen.true}, a third failed through"
        " clearance, a third through something else, a third not; 0, 2, 5 or 10 joints read."
    )
    found: dict[str, Figures] = {}
    for policy in (advice, measure_all, paper_order, oracle, go_on):
        if chosen.only and policy.__name__ not in chosen.only:
            continue
        rng = np.random.default_rng(chosen.seed)
        gears = robot.drawn(chosen.gears, rng, chosen.true)
        with tempfile.TemporaryDirectory() as folder:
            policy(gears, Path(folder), rng)
        found[policy.__name__] = Figures.of(gears)
        _show(policy.__name__, found[policy.__name__], found.get("measure_all"))
    if "advice" in found and "measure_all" in found:
        _targets(found["advice"], found["measure_all"], 0.001 if chosen.true == "A" else 0.005)


def _show(name: str, f: Figures, base: Figures | None) -> None:
    share = "" if base is None else f" ({f.minutes / base.minutes:.0%} of measure_all)"
    kinds = ", ".join(f"{m:.0f}" for m in f.by_kind)
    parts = (
        f"{name:12s} {f.minutes:6.1f} min{share}, by kind {kinds}",
        f"ended {f.ended:.1%}, rounds median {f.median_rounds:.0f} most {f.most_rounds}",
        f"second repair {f.second_repair:.1%}",
        f"WITHIN wrongly {f.wrong_within:.2%}",
        f"retract {f.retract:.1%}",
        f"other cause, sound restored {f.other_sound:.1%}",
        f"sound of restored {f.sound_share:.1%}",
        f"over limit overlooked {f.overlooked:.1%}",
    )
    print("; ".join(parts), flush=True)


def _targets(f: Figures, base: Figures, wrong: float) -> None:
    for what, value, target, met in (
        (
            "ended within twelve rounds",
            f.ended,
            "100 %",
            f.ended == 1.0 and f.most_rounds <= robot.ROUNDS,
        ),
        ("median of the rounds", f.median_rounds, "<= 4", f.median_rounds <= 4),
        ("second repair of the repaired", f.second_repair, "<= 2 %", f.second_repair <= 0.02),
        (
            "end WITHIN with a true worst case above 1.05 margins",
            f.wrong_within,
            f"<= {wrong:.1%}",
            f.wrong_within <= wrong,
        ),
        ("failures by clearance that retract at the end", f.retract, ">= 98 %", f.retract >= 0.98),
        (
            "other failures with a sound joint restored",
            f.other_sound,
            "<= 10 %",
            f.other_sound <= 0.10,
        ),
        (
            "sound joints of the restored, more than measure_all",
            f.sound_share - base.sound_share,
            "<= 2 points",
            f.sound_share - base.sound_share <= 0.02,
        ),
        (
            "end with a joint over its limit overlooked",
            f.overlooked,
            "<= 3 %",
            f.overlooked <= 0.03,
        ),
        (
            "minutes of measure_all",
            f.minutes / base.minutes,
            "<= 85 %",
            f.minutes <= 0.85 * base.minutes,
        ),
    ):
        print(f"{what:<56} {value:8.3f}   {target:<12} {'met' if met else 'NOT MET'}")


if __name__ == "__main__":
    main()
