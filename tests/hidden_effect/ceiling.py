"""What no method could exceed on the study's fleets: how far the true cause's effect lies from its
nearest rival's.

    python -m tests.hidden_effect.ceiling --write

Two effects that look alike are told apart, at best, by the likelihood ratio of the true effect and
the rival that fits it best. In independent normal noise, and with everything else known, that ratio
has mean g and variance 2 g, with g half the squared distance of the two in units of the noise; so
the best test is right with the probability Φ(√(g / 2)). Scatter between tails, other rivals,
unknown sizes and unknown noise only make it harder.
"""

from __future__ import annotations

import argparse
import json
from collections import defaultdict
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import norm

from mlg_troubleshoot import load_gear
from mlg_troubleshoot.diagnosis.causes import CATALOGUE
from mlg_troubleshoot.diagnosis.scene import build_scene, effect_columns
from tests.hidden_effect import simulator
from tests.hidden_effect.as_table import as_table
from tests.hidden_effect.study import PLAN, Task, tasks

RESULT = Path(__file__).with_name("ceiling_result.json")
GROUPS = ("single:10", "single:15", "single:25")


def chance(task: Task) -> tuple[str, str, float]:
    """Group, cause, and chance that the best test prefers the true effect to its nearest rival."""
    fleet = simulator.draw_fleet(task["seed"], faults=False, **task["arguments"])
    ((cause, target),) = fleet.label.causes
    table, gear = as_table(fleet.table), load_gear()
    usable = np.isfinite(table.measured_in)
    scene, _rows = build_scene(gear.model, table.take(usable), gear.discrepancies)
    rivals = [
        c for kind in CATALOGUE for c in kind.candidates(scene) if not _same(c.key, (cause, target))
    ]
    columns = effect_columns(scene, rivals)
    truth = fleet.label.truth_term[usable]
    along = truth @ columns
    sign = np.array([c.cause.sign for c in rivals])
    allowed = (sign == 0) | (np.sign(along) == sign)
    explained = np.where(allowed, along**2 / np.maximum(np.sum(columns**2, axis=0), 1e-300), 0.0)
    gap = 0.5 * float(truth @ truth - np.max(explained)) / fleet.label.noise_rms_in**2
    return str(task["group"]), cause, float(norm.cdf(np.sqrt(max(gap, 0.0) / 2.0)))


def _same(key: tuple[str, str | None], truth: tuple[str, str | None]) -> bool:
    """A tail's single gears are the tail."""
    return key[0] == truth[0] and (key[1] or "").split(" ")[:2] == (truth[1] or "").split(" ")[:2]


def ceiling(plan: Sequence[Task], workers: int) -> dict[str, Any]:
    """Mean chance of the best test by strength, and by cause at S = 10."""
    with ProcessPoolExecutor(workers) as pool:
        found = list(pool.map(chance, plan, chunksize=8))
    groups: dict[str, list[float]] = defaultdict(list)
    causes: dict[str, list[float]] = defaultdict(list)
    for group, cause, right in found:
        groups[group].append(right)
        groups["S >= 10"].append(right)
        if group == "single:10":
            causes[cause].append(right)
    return {
        "fleets": len(found),
        "right": {name: float(np.mean(values)) for name, values in groups.items()},
        "right_by_cause_s10": {
            name: float(np.mean(values)) for name, values in sorted(causes.items())
        },
    }


def sentence(result: dict[str, Any]) -> str:
    """Return the README's sentence of a result."""
    hardest = sorted(result["right_by_cause_s10"].items(), key=lambda item: item[1])[:4]
    listed = ", ".join(f"{name} {100 * value:.0f} %" for name, value in hardest)
    return (
        "the best possible test between the true effect and its nearest rival alone would be right"
        f" in {100 * result['right']['single:10']:.1f} % at S = 10 ({listed}),"
        f" {100 * result['right']['single:15']:.1f} % at 15 and"
        f" {100 * result['right']['single:25']:.1f} % at 25"
    )


def main() -> None:
    """Compute the ceiling on the study's fleets."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--write", action="store_true", help=f"write {RESULT.name}")
    arguments = parser.parse_args()
    result = ceiling([task for task in tasks(PLAN) if task["group"] in GROUPS], arguments.workers)
    print(json.dumps(result, indent=1))
    print(sentence(result))
    if arguments.write:
        RESULT.write_text(json.dumps(result, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
