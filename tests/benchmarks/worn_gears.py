"""A fleet of worn gears from code that shares nothing with the product, for the benchmarks of the
decision.

The linkage is the independent simulator's: a closed chain in space solved by Newton's method. Wear
is drawn here, as the priors of the product describe it in words, by other code; what a technician
reads is drawn from it.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

sys.path.insert(0, str(Path(__file__).parents[2]))

from tests.hidden_effect.simulator.linkage import (
    Build,
    clearance_vectors,
    close,
    load,
    names,
    plunger_gradient,
    reading,
)

Array = NDArray[np.float64]

LIMIT_IN = 0.0075
GAUGE_U_IN = 0.0005
#: Joints that no plunger reading can distinguish.
GROUPS = ((1,), (2,), (3, 5), (4,), (6, 7), (8,), (9, 10))


@dataclass(frozen=True, slots=True)
class Fleet:
    """Worn gears: what is true and what was read.

    Parameters
    ----------
    true_in : Array
        Radial clearances, (n, 10) [in].
    read_in : Array
        What the gauge read, not below zero, (n, 10) [in].
    plunger_in : Array
        What the plunger gauge read at mid-position, (n,) [in].
    other_cause : Array
        True where something other than clearance moved the plunger, (n,) [-].
    """

    true_in: Array
    read_in: Array
    plunger_in: Array
    other_cause: NDArray[np.bool_]


def displacement(true_in: Array, angles: Array, linkage: str = "A") -> Array:
    """Plunger displacement of each gear with the given directions, (n,) [in]."""
    geometry = load(linkage)
    build = Build.nominal(geometry, len(true_in))
    zero = Build.nominal(geometry, 1)
    at_rest = reading(zero, close(zero, np.zeros((1, 10, 2))))[0]
    return reading(build, close(build, clearance_vectors(true_in, angles))) - at_rest


def worst(true_in: Array, linkage: str = "A") -> Array:
    """Worst displacement of each gear, the larger of both senses in magnitude, (n,) [in]."""
    geometry = load(linkage)
    build = Build.nominal(geometry, len(true_in))
    zero = Build.nominal(geometry, 1)
    at_rest = reading(zero, close(zero, np.zeros((1, 10, 2))))[0]
    largest = np.zeros(len(true_in))
    for turn in (0.0, np.pi):
        angles = np.repeat(geometry.angles[None, :] + turn, len(true_in), axis=0)
        vectors = clearance_vectors(true_in, angles)
        unknown = close(build, vectors)
        for _ in range(2):
            slope = plunger_gradient(build, vectors, unknown)
            angles = np.arctan2(slope[..., 1], slope[..., 0]) + turn
            vectors = clearance_vectors(true_in, angles)
            unknown = close(build, vectors, unknown)
        largest = np.maximum(largest, np.abs(reading(build, unknown) - at_rest))
    return largest


def linkages() -> tuple[str, ...]:
    """Names of the linkages that reproduce the published numbers."""
    return names()


def explained_fleet(
    n: int,
    rng: np.random.Generator,
    *,
    worn: float | None = 0.05,
    other: float = 0.05,
    healthy: str = "falling",
) -> Fleet:
    """Draw gears whose plunger was read: wear by link or pivot, random directions, now and then
    another cause.

    ``worn=None`` makes every gear have exactly one worn joint, each link or pivot as often.
    """
    share = (
        rng.triangular(0.0, 0.0, 1.0, (n, 10))
        if healthy == "falling"
        else rng.uniform(0.0, 0.5, (n, 10))
    )
    if worn is None:
        for row, group in enumerate(rng.integers(len(GROUPS), size=n)):
            share[row, rng.choice(GROUPS[group]) - 1] = rng.uniform(1.0, 2.0)
    else:
        for group in GROUPS:
            for joint in group:
                hit = rng.random(n) < worn / len(group)
                share[hit, joint - 1] = rng.uniform(1.0, 2.0, int(hit.sum()))
    true_in = LIMIT_IN * share
    moved = displacement(true_in, rng.uniform(0.0, 2.0 * np.pi, (n, 10)))
    # The uncertainty that the decision rule declares for the model, until measured data supply a
    # better one.
    moved = moved + rng.normal(size=n) * np.maximum(0.003, 0.10 * np.abs(moved))
    elsewhere = rng.random(n) < other
    plunger = (
        moved + np.where(elsewhere, rng.normal(0.0, 0.06, n), 0.0) + rng.normal(0.0, GAUGE_U_IN, n)
    )
    return Fleet(true_in, readings(true_in, rng), plunger, elsewhere)


def amplifications(linkage: str = "A") -> Array:
    """How far the plunger moves by a small clearance of each joint in its worst direction, (10,)
    [-].
    """
    geometry = load(linkage)
    build, rigid = Build.nominal(geometry, 1), np.zeros((1, 10, 2))
    slopes: Array = np.linalg.norm(plunger_gradient(build, rigid, close(build, rigid))[0], axis=-1)
    return slopes


def best_places(
    fleet: Fleet, measured: NDArray[np.bool_], rng: np.random.Generator, draws: int = 4000
) -> Array:
    """Rank the worn group as well as anyone could who knows how the fleet was drawn, (n,) 0 for
    first.

    The fleet has exactly one worn joint a gear and no other cause. For each joint the chance of
    what was read, if it is the worn one, is found by drawing all that was not read; the plunger
    moves in proportion to clearances.
    """
    slopes = amplifications()
    shares = (np.arange(800) + 0.5) / 400.0
    sound = np.where(shares < 1.0, 2.0 * (1.0 - shares), 0.0)
    worn = (shares >= 1.0).astype(float)
    places = np.zeros(len(fleet.true_in))
    for row in range(len(places)):
        read = np.where(measured[row], fleet.read_in[row], np.nan)
        fits = np.exp(-0.5 * ((read[:, None] - shares * LIMIT_IN) / GAUGE_U_IN) ** 2)
        fits = np.where(np.isfinite(fits), fits, 1.0)
        moves = slopes[:, None] * np.cos(rng.uniform(0.0, 2.0 * np.pi, (10, draws)))
        drawn = {}
        for state, prior in (("sound", sound), ("worn", worn)):
            weight = fits * prior + 1e-300
            up_to = np.cumsum(weight, axis=1)
            at = [
                np.searchsorted(up_to[j], rng.uniform(0.0, up_to[j, -1], draws)) for j in range(10)
            ]
            drawn[state] = (
                up_to[:, -1],
                moves * LIMIT_IN * shares[np.minimum(at, len(shares) - 1)],
            )
        still = drawn["sound"][1]
        chance = np.zeros(10)
        for j in range(10):
            moved = still.sum(axis=0) - still[j] + drawn["worn"][1][j]
            u = np.hypot(np.maximum(0.003, 0.10 * np.abs(moved)), GAUGE_U_IN)
            density = np.mean(np.exp(-0.5 * ((fleet.plunger_in[row] - moved) / u) ** 2) / u)
            chance[j] = density * drawn["worn"][0][j] / drawn["sound"][0][j]
        group = np.array([np.mean(chance[np.array(g) - 1]) for g in GROUPS])
        truly = int(np.argmax(fleet.true_in[row]))
        place = next(k for k, g in enumerate(GROUPS) if truly + 1 in g)
        places[row] = np.sum(group > group[place])
    return places


def readings(true_in: Array, rng: np.random.Generator) -> Array:
    """What a gauge reads of these clearances: normal errors, never below zero, (n, 10) [in]."""
    return np.maximum(true_in + rng.normal(0.0, GAUGE_U_IN, true_in.shape), 0.0)


def mixed_fleet(n: int, rng: np.random.Generator) -> Array:
    """Clearances of gears from new to worn out: one level of wear a gear, joints scattered about
    it, (n, 10) [in].
    """
    level = np.exp(rng.uniform(np.log(0.05), np.log(1.0), n))
    return LIMIT_IN * np.minimum(level[:, None] * rng.exponential(1.0, (n, 10)), 1.5)
