"""What no method could exceed on the study's fleets: how far the true cause's effect lies from its
nearest rival's.

    python -m tests.hidden_effect.ceiling --write

Two effects that look alike are distinguished, at best, by the likelihood ratio of the true effect
and the rival that fits it best. In normal noise, with its size, the scatter between tails and
everything else known, the logarithm of that ratio has mean g and variance 2 g, with g half the
squared distance of the two in units of the noise. So the best test prefers the true effect with
the probability Φ(√(g / 2)), and is as sure of it as a name needs, both being equally likely
beforehand, with Φ((g − odds) / √(2 g)). Other rivals, unknown sizes and unknown noise only make it
harder.
"""

from __future__ import annotations

import argparse
import json
from collections import Counter, defaultdict
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.special import logsumexp
from scipy.stats import norm

from mlg_troubleshoot import load_gear
from mlg_troubleshoot.arrays import Array, Mask
from mlg_troubleshoot.diagnosis import diagnose
from mlg_troubleshoot.diagnosis.causes import CATALOGUE
from mlg_troubleshoot.diagnosis.causes.linkage import JointFactors
from mlg_troubleshoot.diagnosis.extension import build_scene, effects_of
from mlg_troubleshoot.misfit.beliefs import Beliefs
from tests.hidden_effect import calibration, simulator, study
from tests.hidden_effect.as_table import as_table
from tests.hidden_effect.study import Task, tasks

# Share of what goes wrong that a cause has which is known not to act.
NEVER = 1e-6
RESULT = Path(__file__).with_name("ceiling_result.json")
# Fleets of the committed result, and the first of their seeds.
PLAN = {"single:10": 420, "single:15": 294, "single:25": 294}
FIRST_SEED = 1_002_680


def chance(task: Task) -> tuple[str, str, float, float]:
    """Group, cause, and chances that the best test prefers the true effect to its nearest rival,
    and that it is sure of it.
    """
    fleet = simulator.draw_fleet(task["seed"], faults=False, **task["arguments"])
    ((cause, target),) = fleet.label.causes
    table, gear = as_table(fleet.table), load_gear()
    usable = np.isfinite(table.measured_in)
    scene, _rows = build_scene(gear.model, table.take(usable), gear.discrepancies)
    rivals = [
        c for kind in CATALOGUE for c in kind.candidates(scene) if not _same(c.key, (cause, target))
    ]
    own = whitened(fleet, usable, np.column_stack(list(effects_of(scene, rivals))))
    columns = own[:, 1:]
    truth = own[:, 0]
    along = truth @ columns
    sign = np.array([c.cause.sign for c in rivals])
    allowed = (sign == 0) | (np.sign(along) == sign)
    explained = np.where(allowed, along**2 / np.maximum(np.sum(columns**2, axis=0), 1e-300), 0.0)
    gap = max(0.5 * float(truth @ truth - np.max(explained)), 1e-9)
    first, sure = norm.cdf((gap - np.array([0.0, Beliefs().odds])) / np.sqrt(2.0 * gap))
    return str(task["group"]), cause, float(first), float(sure)


def whitened(fleet: simulator.Fleet, usable: Mask, columns: Array) -> Array:
    """The true effect, then others, in units of the noise: readings of one tail share a scatter."""
    both = np.column_stack([fleet.label.truth_term[usable], columns])
    tails = np.unique(np.asarray(fleet.table["tail_no"])[usable], return_inverse=True)[1]
    shared = (fleet.spec.tail_share * fleet.label.repeatability_in) ** 2
    alone = fleet.label.noise_rms_in**2 - shared
    own = (tails[:, None] == np.arange(tails.max() + 1)).astype(float)
    count = own.sum(axis=0)
    taken = (1.0 - 1.0 / np.sqrt(1.0 + count * shared / alone)) / count
    return np.asarray((both - own @ (taken[:, None] * (own.T @ both))) / np.sqrt(alone))


def known(task: Task) -> dict[str, bool]:
    """Whether all true causes and no other are named: as it is; if it is known beforehand that the
    study's causes alone may act; and if clearances are read without error, the effects being as
    large as before.
    """
    spec = simulator.draw_spec(task["seed"], **task["arguments"])
    fleet = simulator.simulate_fleet(spec, task["seed"])
    hidden = tuple(
        simulator.EffectSpec(e.cause, e.target, None, dict(e.parameters))
        for e in fleet.label.effects
    )
    exact = replace(spec, clearance_noise=0.0, blank_share=0.0, effects=hidden)
    others = {cause.name: NEVER for cause in CATALOGUE if cause.name not in simulator.CATALOGUE}
    only = Beliefs(rarer=others, unlisted=NEVER)
    return {
        "as it is": _named(fleet, Beliefs()),
        "only the study's causes": _named(fleet, only),
        "clearances without error": _named(
            simulator.simulate_fleet(exact, task["seed"]), Beliefs()
        ),
    }


def oracle(task: Task) -> dict[str, float | str]:
    """How often, over fresh noise, the true cause is sure beside all listed rivals: for one who
    knows the exact form of its effect, all noise, and that one thing is wrong and on the list.

    The effect is as large as it is; believed of it and of each rival is what the program believes.
    """
    fleet = simulator.draw_fleet(task["seed"], faults=False, **task["arguments"])
    ((cause, target),) = fleet.label.causes
    table, gear = as_table(fleet.table), load_gear()
    usable = np.isfinite(table.measured_in)
    scene, _rows = build_scene(gear.model, table.take(usable), gear.discrepancies)
    here = [c for c in CATALOGUE if set(c.needs) <= set(scene.table.columns)]
    found = [c for kind in here for c in kind.candidates(scene)]
    rivals = [c for c in found if not _same(c.key, (cause, target))]
    blocks = [
        b
        for kind in here
        if isinstance(kind, JointFactors)
        for b in kind.blocks(scene, gear.ensemble_models[1:])
    ]
    effects = np.column_stack(list(effects_of(scene, rivals)))
    own = whitened(fleet, usable, np.hstack([effects, *(b.independent_in for b in blocks)]))
    truth, columns, wide = own[:, :1], own[:, 1 : 1 + len(rivals)], own[:, 1 + len(rivals) :]
    noise = np.random.default_rng(task["seed"]).standard_normal((len(truth), 200))
    data = truth + noise
    usual = Beliefs().shape_size * np.sqrt(np.count_nonzero(own, axis=0))
    usual = usual / np.maximum(np.linalg.norm(own, axis=0), 1e-300)
    size = np.array([c.cause.plausible or own for c, own in zip(rivals, usual[1:], strict=False)])
    sign = np.array([c.cause.sign for c in rivals])
    names = Counter(c.cause.name for c in found)
    share = -np.log([names[c.cause.name] for c in rivals])
    alone = float(np.log(sum(_same(c.key, (cause, target)) for c in found) / names[cause]))
    true = alone + _evidence(truth, usual[:1], np.zeros(1), data)[0]
    odds = [*(share[:, None] + _evidence(columns, size, sign, data))]
    for block in blocks:
        width = block.independent_in.shape[1]
        part, wide = wide[:, :width], wide[:, width:]
        inner = np.eye(width) + part.T @ part
        along = part.T @ data
        fitted = np.sum(along * np.linalg.solve(inner, along), axis=0)
        odds.append(block.log_prior + 0.5 * (fitted - np.linalg.slogdet(inner)[1]))
    lead = true - logsumexp(np.array(odds), axis=0)
    return {
        "group": str(task["group"]),
        "cause": cause,
        "sure": float(np.mean(lead >= Beliefs().odds)),
    }


def _evidence(columns: Array, size: Array, sign: Array, data: Array) -> Array:
    """Log-likelihood of whitened data with each column over that without, (p, k), sizes summed."""
    square = np.sum(columns**2, axis=0)[:, None]
    along = columns.T @ data
    found = []
    for factor in Beliefs().sizes:
        spread = (factor * size[:, None]) ** 2
        wider = 1.0 + spread * square
        mean = spread * along / wider
        one = sign[:, None] * mean * np.sqrt(wider / spread)
        signed = np.where(sign[:, None] == 0, 0.0, np.log(2.0) + norm.logcdf(one))
        found.append(0.5 * (mean * along - np.log(wider)) + signed)
    return np.asarray(logsumexp(found, axis=0) - np.log(len(found)))


def sure_of_all(first_seed: int) -> dict[str, float | int]:
    """The oracle on the single causes of S = 10 and 15 among 300 mixed fleets."""
    mixed = [task for _seed, task in calibration.tasks(first_seed)[:300]]
    found = [oracle(t) for t in mixed if isinstance(t, dict) and t["group"] in PLAN]
    shares = {
        group: float(np.mean([f["sure"] for f in found if f["group"] == group]))
        for group in sorted({f["group"] for f in found})
    }
    causes = sorted({str(f["cause"]) for f in found})
    return {
        "fleets": len(found),
        "S >= 10": float(np.mean([f["sure"] for f in found])),
        **shares,
        **{c: float(np.mean([f["sure"] for f in found if f["cause"] == c])) for c in causes},
    }


def _named(fleet: simulator.Fleet, beliefs: Beliefs) -> bool:
    gear = load_gear()
    found = diagnose(
        gear.model,
        as_table(fleet.table),
        gear.discrepancies,
        ensemble=gear.ensemble_models[1:],
        beliefs=beliefs,
    )
    return bool(study.compare(fleet, found)["right"])


def _same(key: tuple[str, str | None], truth: tuple[str, str | None]) -> bool:
    """A tail's single gears are the tail."""
    return key[0] == truth[0] and (key[1] or "").split(" ")[:2] == (truth[1] or "").split(" ")[:2]


def ceiling(plan: Sequence[Task], workers: int) -> dict[str, Any]:
    """Mean chance of the best test by strength, and by cause at S = 10."""
    with ProcessPoolExecutor(workers) as pool:
        found = list(pool.map(chance, plan, chunksize=8))
    groups: dict[str, list[float]] = defaultdict(list)
    causes: dict[str, list[float]] = defaultdict(list)
    named: dict[str, list[float]] = defaultdict(list)
    for group, cause, right, sure in found:
        for name in (group, "S >= 10"):
            groups[name].append(right)
            named[name].append(sure)
        if group == "single:10":
            causes[cause].append(right)
    return {
        "fleets": len(found),
        "right": {name: float(np.mean(values)) for name, values in groups.items()},
        "named": {name: float(np.mean(values)) for name, values in named.items()},
        "right_by_cause_s10": {
            name: float(np.mean(values)) for name, values in sorted(causes.items())
        },
    }


def worth(fleets: int, first_seed: int, workers: int, group: str | None) -> dict[str, int]:
    """How many of some fleets have all that is wrong named and nothing else: of one group, or with
    one cause, five in nine of S = 10 and the others of 15.
    """
    plan = {"single:10": round(fleets * 5 / 9), "single:15": fleets - round(fleets * 5 / 9)}
    plan = {group: fleets} if group else plan
    with ProcessPoolExecutor(workers) as pool:
        found = list(pool.map(known, tasks(plan, first_seed), chunksize=4))
    return {"fleets": len(found), **{name: sum(f[name] for f in found) for name in found[0]}}


def sentence(result: dict[str, Any]) -> str:
    """Return the README's sentence of a result."""
    hardest = sorted(result["right_by_cause_s10"].items(), key=lambda item: item[1])[:4]
    listed = ", ".join(f"{name} {100 * value:.0f} %" for name, value in hardest)
    return (
        "the best possible test between the true effect and its nearest rival alone would be right"
        f" in {100 * result['right']['single:10']:.1f} % at S = 10 ({listed}),"
        f" {100 * result['right']['single:15']:.1f} % at 15 and"
        f" {100 * result['right']['single:25']:.1f} % at 25; it would be as sure as a name needs in"
        f" {100 * result['named']['single:10']:.1f}, {100 * result['named']['single:15']:.1f} and"
        f" {100 * result['named']['single:25']:.1f} %"
    )


def main() -> None:
    """Compute the ceiling on the study's fleets."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--known", type=int, help="of so many fleets only: what knowledge is worth")
    parser.add_argument("--oracle", action="store_true", help="with all listed rivals, exact form")
    parser.add_argument("--group", help="of these fleets alone, double or triple")
    parser.add_argument("--first-seed", type=int, default=FIRST_SEED)
    parser.add_argument("--write", action="store_true", help=f"write {RESULT.name}")
    arguments = parser.parse_args()
    if arguments.oracle:
        print(json.dumps(sure_of_all(arguments.first_seed), indent=1))
        return
    if arguments.known:
        given = arguments.known, arguments.first_seed, arguments.workers, arguments.group
        print(json.dumps(worth(*given), indent=1))
        return
    result = ceiling(list(tasks(PLAN, FIRST_SEED)), arguments.workers)
    print(json.dumps(result, indent=1))
    print(sentence(result))
    if arguments.write:
        RESULT.write_text(json.dumps(result, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
