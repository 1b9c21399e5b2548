"""What no method could exceed on the departures' fleets: an oracle that knows the noise, the priors
and the causes.

    python -m tests.hidden_effect.departures_ceiling --write

The fleets are the departures' own, without entry errors. The oracle is told the covariance of the
noise as it came out in the fleet, the share that the scatter of the pins takes off the bound, and
how large the effect is; scatter to be estimated, slips and unknown sizes only make it harder.

On another linkage it is told the spread of the linkages that the simulator takes: the displacement
differs from the drawn linkage's by a sum of theirs, each weighed at random (normal, variance one
over their number). It compares the marginal likelihood of a linkage with the true cause, of which
it knows the whole effect, with that of a linkage alone and with each other cause, all of them at S
= 15 in either direction that the cause allows; the targets of a cause and the forms of a target
share its prior.

Where loads rest the pins 40 degrees apart it is told that, and compares ten directions so drawn (by
sequential Monte Carlo over the angles) with what else may stand there: one scale of a size that
such directions have, one joint's direction, with a factor from 1 to -1, or both (normal, with these
means and variances). Each has fleets of its own, as large as a fleet of directions; directions are
named where they lead by more than in all but 2 % of these.
"""

from __future__ import annotations

import argparse
import json
from collections import Counter, defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from tests.hidden_effect import departures, study

# The study sets one thread per worker before numpy is loaded.
import numpy as np  # isort: skip
from numpy.typing import NDArray
from scipy.special import logsumexp

from mlg_troubleshoot import load_gear
from mlg_troubleshoot.diagnosis.causes import CATALOGUE, Candidate, Scene
from mlg_troubleshoot.diagnosis.scene import build_scene, effects_of
from tests.hidden_effect import simulator
from tests.hidden_effect.as_table import as_table
from tests.hidden_effect.ceiling import _same
from tests.hidden_effect.simulator import generate, linkage, physics

Array = NDArray[np.float64]
Record = dict[str, Any]
Task = tuple[str, int, int]

RESULT = Path(__file__).with_name("departures_ceiling_result.json")
LINKAGE, SPREAD, SPREAD_DEG = "linkage, one cause", "loads:40", 40.0
# Log-likelihood by which the truth leads clearly: as much as the program asks for.
CLEAR = 2.5
# Share of other fleets that may be called directions.
FALSE = 0.02
# What else may look like directions, and what is hidden in the fleets that have it.
OTHERS = ("one scale", "one joint's direction", "a scale and one joint's direction")
_PARTICLES, _MOVES = 1000, 8
# Standard deviation of what is even from 0 to 2. [1]
_EVEN = 2.0 / np.sqrt(12.0)


@dataclass(frozen=True)
class Told:
    """A fleet as the oracle sees it.

    scene: the rows that have a reading, with what the program makes of their clearances. misfit,
    shape (n,): measured less the drawn linkage's bound less what scatter of the pins takes off it.
    [in] covariance, shape (n, n): of the noise. [in²] truth, shape (n,): what the hidden effects do
    to a gear with the clearances of the scene; what they do to the true
        ones would tell the noise. [in]
    apart, shape (n, n_linkages): what the linkages that the simulator takes add to the bound. [in]
    another, shape (n,): what this fleet's linkage adds to it. [in]
    """

    scene: Scene
    misfit: Array
    covariance: Array
    truth: Array
    apart: Array
    another: Array


def told(fleet: simulator.Fleet) -> Told:
    """Gather what the oracle is told of a fleet."""
    world, gear, table = fleet._world, load_gear(), as_table(fleet.table)
    read = np.isfinite(table.measured_in)
    table = table.take(read)
    scene, _rows = build_scene(gear.model, table, gear.discrepancies)
    drawn, own, *every = (
        physics.worst_case(linkage.load(name), scene.clearance_in)
        for name in ("A", fleet.spec.geometry, *departures.LINKAGES)
    )
    lost = float(np.mean(np.expm1(-(physics.scatter_size(world.design) ** 2) / 2.0)))
    clearance = world.design.clearance.copy()
    clearance[read] = scene.clearance_in
    gears = physics.Gears(
        world.geometry, replace(world.design, clearance=clearance), np.zeros_like(clearance)
    )
    truth = generate._Effects(gears).shift(world.drafts)[0][read]
    tails = np.array([world.errors.tails[tail] for tail in world.design.tail])[read]
    rest = table.measured_in - fleet.label.truth_term[read] - (1.0 + lost) * own - tails
    covariance = _covariance(rest, table.gears) + world.noise.tail**2 * (
        table.tails[:, None] == table.tails
    )
    apart = np.column_stack([over - drawn for over in every if np.isfinite(over).all()])
    return Told(
        scene,
        table.measured_in - (1.0 + lost) * drawn,
        covariance,
        truth,
        apart,
        (1.0 + lost) * (own - drawn),
    )


def _covariance(rest: Array, gears: NDArray[np.str_]) -> Array:
    """Covariance of rows that share a gear's part, by moments of the noise as it came out. [in²]"""
    number = np.unique(gears, return_inverse=True)[1]
    count, total, square = (
        np.bincount(number),
        np.bincount(number, rest),
        np.bincount(number, rest**2),
    )
    shared = max(float(np.sum(total**2 - square) / np.sum(count * (count - 1))), 0.0)
    return (float(np.var(rest)) - shared) * np.eye(len(rest)) + shared * (gears[:, None] == gears)


def beside_linkage(task: Task) -> Record:
    """How far the true cause leads beside another linkage, of which the spread is known, and beside
    a known one.
    """
    group, place, seed = task
    fleet = simulator.simulate_fleet(replace(departures._spec(group, place, seed), faults=()), seed)
    seen, ((cause, target),) = told(fleet), fleet.label.causes
    candidates = [
        c
        for kind in CATALOGUE
        if kind.name in simulator.CATALOGUE
        for c in kind.candidates(seen.scene)
    ]
    columns = np.column_stack(list(effects_of(seen.scene, candidates)))
    size = np.sqrt(np.mean(columns**2, axis=0))
    acts = size > 1e-9 * size.max()
    strength = (
        float(fleet.spec.effects[0].strength or 0.0)
        * fleet.label.noise_rms_in
        / np.sqrt(fleet.spec.rows)
    )
    columns = columns[:, acts] * strength / size[acts]
    candidates = [c for c, one in zip(candidates, acts, strict=True) if one]
    spread = seen.covariance + seen.apart @ seen.apart.T / seen.apart.shape[1]
    found = {}
    for known, covariance, misfit in (
        ("spread", spread, seen.misfit),
        ("linkage", seen.covariance, seen.misfit - seen.another),
    ):
        weight = np.linalg.inv(covariance)
        found[known] = _lead(weight, misfit, candidates, columns, seen.truth, (cause, target))
        found[f"left, {known}"] = float(np.sqrt(seen.truth @ weight @ seen.truth))
    return {"seed": seed, "cause": cause, "linkage": fleet.spec.geometry, **found}


def _lead(
    weight: Array,
    misfit: Array,
    candidates: Sequence[Candidate],
    columns: Array,
    truth: Array,
    true: tuple[str, str | None],
) -> float:
    """Log-likelihood of the true cause and target less that of the likeliest other, or of none.
    [1]
    """
    along, square = columns.T @ weight @ misfit, np.einsum("ij,ij->j", columns, weight @ columns)
    sign = np.array([c.cause.sign for c in candidates])
    either = np.logaddexp(along, -along) - np.log(2.0)
    score = np.where(sign == 0, either, sign * along) - 0.5 * square
    forms: dict[tuple[str, str | None], list[float]] = defaultdict(list)
    for candidate, one in zip(candidates, score, strict=True):
        forms[candidate.key].append(float(one))
    targets = Counter(name for name, _target in forms)
    others = [
        float(logsumexp(values)) - np.log(len(values) * targets[key[0]])
        for key, values in forms.items()
        if not _same(key, true)
    ]
    own = float(truth @ weight @ misfit - 0.5 * truth @ weight @ truth) - np.log(
        max(targets[true[0]], 1)
    )
    return float(own - max(*others, 0.0))


def directions(task: Task) -> Record:
    """How far ten directions lead each other explanation: in a fleet that has them, and in fleets
    of the others.
    """
    group, place, seed = task
    rng = np.random.default_rng([seed, 40])
    spec = replace(departures._spec(group, place, seed), faults=())
    fleet = simulator.simulate_fleet(spec, seed)
    size, share = fleet.label.strength, float(rng.uniform(0.2, 0.8))
    effect = simulator.EffectSpec
    scale = effect("calibration_rate", strength=size, parameters={"sign": -1.0})
    joint = effect("direction_not_worst_case", strength=size)
    both = (replace(scale, strength=share * size), replace(joint, strength=(1.0 - share) * size))
    found: Record = {"seed": seed, "directions": _directions(fleet, rng)}
    for name, hidden in zip(OTHERS, ((scale,), (joint,), both), strict=True):
        found[name] = _directions(
            simulator.simulate_fleet(replace(spec, effects=hidden), seed), rng
        )
    scene = told(fleet).scene
    return {**found, "beats": departures._regression(scene.table, scene.over_in)["beats"]}


def _directions(fleet: simulator.Fleet, rng: np.random.Generator) -> dict[str, float]:
    """Log-likelihood of ten directions less that of each other explanation. [1]"""
    seen, spread = told(fleet), np.radians(SPREAD_DEG)
    weight, share, over = (
        np.linalg.inv(seen.covariance),
        seen.scene.contribution_in,
        seen.scene.over_in,
    )
    along, square = -(share.T @ weight @ seen.misfit), share.T @ weight @ share
    lost = (1.0 - np.cos(spread * rng.standard_normal((2000, share.shape[1])))) @ share.T
    size = np.sqrt(np.mean(lost**2, axis=1) / np.mean(over**2))
    level, width = float(np.mean(size)), float(np.std(size))

    def mean(columns: Array, expected: Array, spread: Array) -> float:
        """Marginal log-likelihood of normal losses of some columns."""
        scaled = columns * spread
        gain = scaled.T @ weight
        rest = -seen.misfit - columns @ expected
        inner = np.eye(len(spread)) + gain @ scaled
        push, plain = gain @ rest, columns @ expected
        found = 0.5 * push @ np.linalg.solve(inner, push) - 0.5 * np.linalg.slogdet(inner)[1]
        return float(found - plain @ weight @ (seen.misfit + 0.5 * plain))

    # A joint whose factor is anything from 1 to -1 loses what it adds, on average; beside it a
    # scale may be any part.
    alone = [mean(one[:, None], np.ones(1), np.full(1, _EVEN)) for one in share.T]
    part = (
        np.array([0.5 * level, 1.0]),
        np.array([np.hypot(0.5 * width, 0.5 * _EVEN * level), _EVEN]),
    )
    paired = [mean(np.column_stack([over, one]), *part) for one in share.T]
    single = mean(over[:, None], np.array([level]), np.array([width]))
    others = (single, *(float(logsumexp(a) - np.log(len(a))) for a in (alone, paired)))
    ten = marginal(along, square, spread, rng)
    return {name: float(ten - other) for name, other in zip(OTHERS, others, strict=True)}


def marginal(along: Array, square: Array, spread: float, rng: np.random.Generator) -> float:
    """Logarithm of the mean of exp(aᵀg − gᵀQg/2), g = 1 − cos φ, over normal angles φ (sequential
    Monte Carlo).
    """
    joints = len(along)
    angle = spread * rng.standard_normal((_PARTICLES, joints))

    def likelihood(angles: Array) -> Array:
        loss = 1.0 - np.cos(angles)
        return np.asarray(loss @ along - 0.5 * np.einsum("ij,ij->i", loss @ square, loss))

    current, power, total, step = likelihood(angle), 0.0, 0.0, 0.5
    while power < 1.0:
        rise = _rise(current, 1.0 - power)
        total += float(logsumexp(rise * current)) - np.log(_PARTICLES)
        weight = np.exp(rise * (current - current.max()))
        at = (rng.random() + np.arange(_PARTICLES)) / _PARTICLES
        kept = np.minimum(np.searchsorted(np.cumsum(weight) / weight.sum(), at), _PARTICLES - 1)
        # The sign of an angle does not matter: with all of one sign the moves follow one peak.
        angle, current, power = np.abs(angle[kept]), current[kept], power + rise
        root = np.linalg.cholesky(np.cov(angle.T) + 1e-8 * np.eye(joints))
        moved = 0.0
        for _ in range(_MOVES):
            trial = np.abs(angle + step * rng.standard_normal(angle.shape) @ root.T)
            ahead = likelihood(trial)
            prior = np.sum(angle**2 - trial**2, axis=1) / (2.0 * spread**2)
            taken = np.log(rng.random(_PARTICLES)) < power * (ahead - current) + prior
            angle[taken], current[taken] = trial[taken], ahead[taken]
            moved += float(np.mean(taken)) / _MOVES
        step *= 1.3 if moved > 0.3 else 0.75 if moved < 0.15 else 1.0
    return total


def _rise(likelihood: Array, most: float) -> float:
    """Step of the power of the likelihood after which half of the particles still count."""

    def enough(step: float) -> bool:
        weight = np.exp(step * (likelihood - likelihood.max()))
        return bool(weight.sum() ** 2 >= 0.5 * len(weight) * np.sum(weight**2))

    low, high = 0.0, most
    if enough(most):
        return most
    for _ in range(40):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if enough(middle) else (low, middle)
    return max(low, 1e-9)


def summarise(linkages: Sequence[Record], fleets: Sequence[Record]) -> dict[str, Any]:
    """What is committed: by cause beside another linkage, and by what else may look like
    directions.
    """
    causes: dict[str, list[Record]] = defaultdict(list)
    for record in linkages:
        causes[record["cause"]].append(record)
    return {
        "linkage": {
            cause: {
                "left": float(np.median([r["left, spread"] for r in rows])),
                "known": study._rate(sum(r["linkage"] >= CLEAR for r in rows), len(rows)),
                "first": study._rate(sum(r["spread"] > 0.0 for r in rows), len(rows)),
                "clear": study._rate(sum(r["spread"] >= CLEAR for r in rows), len(rows)),
            }
            for cause, rows in (*sorted(causes.items()), ("all", list(linkages)))
        },
        "directions": {
            **{name: _distinguished(fleets, (name,)) for name in OTHERS},
            "one scale, and one joint's direction": _distinguished(fleets, OTHERS[:2]),
            "all three": _distinguished(fleets, OTHERS),
        },
    }


def _distinguished(fleets: Sequence[Record], others: Sequence[str]) -> dict[str, Any]:
    """Directions named where they lead each by more than in all but a few of the fleets that have
    that.
    """
    least = {
        o: float(np.quantile([r[o][o] for r in fleets], 1.0 - FALSE, method="higher"))
        for o in others
    }
    named = [(r["beats"], all(r["directions"][o] > least[o] for o in others)) for r in fleets]
    beats = [hit for told, hit in named if told]
    return {
        "least": list(least.values()),
        "beats": study._rate(sum(beats), len(beats)),
        "all": study._rate(sum(hit for _told, hit in named), len(fleets)),
    }


def markdown(result: dict[str, Any]) -> tuple[str, str]:
    """Return the two tables of a result."""

    def share(rate: dict[str, float]) -> str:
        return f"{100 * rate['rate']:.0f} %"

    def band(rate: dict[str, float]) -> str:
        return f"{100 * rate['rate']:.1f} % ({100 * rate['low']:.1f}–{100 * rate['high']:.1f})"

    linkages = [
        (
            "| one cause, S = 15, on another linkage | fleets | S left besides | told the linkage:"
            " clearly first | told the spread: first | clearly first |"
        ),
        "|---|---|---|---|---|---|",
    ]
    for cause, row in result["linkage"].items():
        text = band if cause == "all" else share
        shown = (text(row[name]) for name in ("known", "first", "clear"))
        linkages.append(
            f"| {cause} | {row['first']['n']} | {row['left']:.1f} | {' | '.join(shown)} |"
        )
    directed = [
        (
            "| directions 40° apart, distinguished from | fleets where a regression beats one scale"
            " | all fleets |"
        ),
        "|---|---|---|",
        *(
            f"| {name} | {band(row['beats'])} | {band(row['all'])} |"
            for name, row in result["directions"].items()
        ),
    ]
    return "\n".join(linkages), "\n".join(directed)


def main() -> None:
    """Let the oracle judge the departures' fleets, or a share of them."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--share", type=float, default=1.0, help="share of the plan to run")
    parser.add_argument("--first-seed", type=int, default=departures.FIRST_SEED)
    parser.add_argument("--write", action="store_true", help=f"write {RESULT.name}")
    arguments = parser.parse_args()
    plan = list(departures.tasks(departures.PLAN, arguments.first_seed))
    found = []
    for group, judge in ((LINKAGE, beside_linkage), (SPREAD, directions)):
        own = [(task[2], task) for task in plan if task[0] == group]
        found.append(
            study.mapped(judge, own[: max(1, round(arguments.share * len(own)))], arguments.workers)
        )
    result = {"first_seed": arguments.first_seed, **summarise(*found)}
    print(json.dumps(result, indent=1))
    if arguments.write:
        RESULT.write_text(json.dumps(result, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
