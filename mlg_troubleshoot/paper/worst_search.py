"""The worst directions by three routes: the paper's sequential rule, a global search, a proved
bound.

The paper's conclusion leaves "more advanced algorithms such as a genetic algorithm" as future work.
Differential evolution searches all directions and the whole stroke at once; the proof of
:mod:`~mlg_troubleshoot.paper.certified` says how much any search can have missed.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.random import Generator

from mlg_troubleshoot.arrays import Array
from mlg_troubleshoot.gear.directions import worst_of_sense
from mlg_troubleshoot.gear.model import LinkageModel, links_from
from mlg_troubleshoot.paper.certified import CertifiedBound, certified_bound


@dataclass(frozen=True, slots=True)
class WorstSearch:
    """The worst displacement of one sense by three routes.

    sequential_in: by the paper's rule, joint by joint at mid-position. [in]
    searched_in: by differential evolution over all directions and the stroke. [in]
    proved: what none can exceed.
    """

    sense: float
    seed: int
    sequential_in: float
    searched_in: float
    evaluations: int
    proved: CertifiedBound


def search_worst(
    model: LinkageModel,
    clearance_in: Array,
    sense: float,
    rng: Generator,
    seed: int,
    generations: int = 300,
) -> WorstSearch:
    """Find the worst displacement by the sequential rule, by differential evolution and by
    proof.
    """
    clearance = np.asarray(clearance_in, float)
    sequential = sense * float(worst_of_sense(model, clearance[None], sense)[0][0])
    searched, evaluations = _evolved(model, clearance, sense, rng, generations)
    return WorstSearch(
        sense, seed, sequential, searched, evaluations, certified_bound(model, clearance, sense)
    )


def _evolved(
    model: LinkageModel, clearance: Array, sense: float, rng: Generator, generations: int
) -> tuple[float, int]:
    from scipy.optimize import differential_evolution

    worn = np.flatnonzero(clearance > 0.0)
    bounds: Any = [(-np.pi, np.pi)] * len(worn) + [(min(model.stroke), max(model.stroke))]
    count = 0

    def lost(points: Array) -> Any:
        nonlocal count
        count += points.shape[1]
        directions = np.zeros((points.shape[1], len(clearance)))
        directions[:, worn] = points[:-1].T
        links = links_from(np.broadcast_to(clearance, directions.shape), directions)
        moved = sense * model.displacement(links, None, points[-1])
        return np.where(np.isfinite(moved), -moved, 1e3)

    # The population moves as one: a generation is a batch.
    found = differential_evolution(
        lost,
        bounds,
        popsize=12,
        maxiter=generations,
        tol=1e-10,
        atol=1e-12,
        polish=False,
        vectorized=True,
        updating="deferred",
        rng=rng,
    )
    return -float(found.fun), count
