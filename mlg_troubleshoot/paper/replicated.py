"""First-order indices as the paper estimates them: replicated designs, averages of ten iterations.

A modified Latin hypercube (section 2.2) has n1 replicates of n2 levels. Sorted by the level of one
joint, the n1 samples of a level share that joint's clearance while the others vary (Fig. 5a);
exchanging one joint's clearance among them lets that joint vary while the others are fixed (Fig.
5b).

A group mean over n1 samples still carries 1/n1 of the variance within the group, so that the
variance of the group means is too large: the plain index exceeds the true one by (1 − S)/n1 on
average. Both columns are given. The total-order study of Fig. 5b is in
:mod:`~mlg_troubleshoot.paper.total_order`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.random import Generator

from mlg_troubleshoot.arrays import Array, Wholes, count_failed
from mlg_troubleshoot.errors import UsageError
from mlg_troubleshoot.indices.inputs import Response

# Resolution V fractions of the two-level factorial: the columns whose product each further column
# is. No word of their defining relations is shorter than five letters.
_FRACTIONS: dict[int, tuple[int, tuple[tuple[int, ...], ...]]] = {
    8: (6, ((0, 1, 2, 3), (0, 1, 4, 5))),
    9: (7, ((0, 2, 3, 5, 6), (1, 2, 4, 5, 6))),
    10: (7, ((0, 1, 2, 6), (1, 2, 3, 4), (0, 2, 3, 5))),
}
_FULL = 7


@dataclass(frozen=True, slots=True)
class Replicated:
    """Levels and points of a replicated design.

    points, shape (n1, n_rows, n): points of the unit cube, replicate by replicate. [1] places,
    shape (n1, n_rows, n): group of each row for each variable: rows of one group share the
    variable's value
      (Fig. 5a). [1]
    """

    points: Array
    places: Wholes


def central_composite(n: int) -> Array:
    """Corners and axial points of the range.

    The paper has 138 points in ten joints and does not say how they are made up. 128 corners are
    the resolution V fraction 2^(10−3) of the two-level factorial; the ten points that remain are
    taken as one axial point per joint, all others in mid-range: the first joint at its limit, the
    second at zero, and so on. (With all ten at their limits a joint in mid-range would go with high
    values of the others, which adds 0.004 to every first-order index.)

    Returns, shape (n_corners + n, n): points of the unit cube. [1]
    Raises `UsageError` for a number of variables without a design.
    """
    if not 2 <= n <= max(_FRACTIONS):
        raise UsageError(
            f"a central composite design in {n} variables", f"It has 2 to {max(_FRACTIONS)}."
        )
    base, words = (n, ()) if n <= _FULL else _FRACTIONS[n]
    signs = np.array(list(product((-1, 1), repeat=base)))
    generated = [np.prod(signs[:, list(word)], axis=1) for word in words]
    corners = (np.column_stack([signs, *generated]) + 1) / 2.0
    face = np.arange(1, n + 1) % 2
    axial = np.where(np.eye(n, dtype=bool), face, 0.5)
    return np.concatenate([corners, axial])


def replicated_levels(n: int, n1: int, n2: int, rng: Generator) -> Wholes:
    """Levels of a modified Latin hypercube: every level once in every replicate.

    Returns, shape (n1, n2, n): levels from 0. [1]
    """
    levels = np.tile(np.arange(n2, dtype=np.int64), (n1, n, 1))
    permuted = rng.permuted(levels, axis=2)
    return np.ascontiguousarray(permuted.transpose(0, 2, 1))


def middle_of_level(levels: Wholes, n2: int) -> Array:
    """Point of the unit interval in the middle of a level. [1]"""
    return (levels + 0.5) / n2


def first_order_design(n: int, n1: int, n2: int, ccd: Array | None, rng: Generator) -> Replicated:
    """Samples for the first-order index (Fig. 5a): Latin hypercube levels, composite points, or
    both.

    Every replicate holds all composite points. Points that share a joint's clearance are put in its
    groups in an order of their own in every replicate, so that the others vary within a group.

    ccd, shape (n_ccd, n): composite points added to every replicate. [1]
    """
    levels = replicated_levels(n, n1, n2, rng)
    points = middle_of_level(levels, max(n2, 1))
    places = levels
    if ccd is not None:
        tie = rng.random((n1, len(ccd), n))
        composite = np.broadcast_to(ccd, tie.shape)
        order = np.lexsort((tie, composite), axis=1)
        groups = np.empty_like(order)
        ranks = np.arange(len(ccd))[None, :, None]
        np.put_along_axis(groups, order, ranks, axis=1)
        points = np.concatenate([points, composite], axis=1)
        places = np.concatenate([places, groups + n2], axis=1)
    return Replicated(points, places)


@dataclass(frozen=True, slots=True)
class PaperDesign:
    """A replicated design of section 4.3.

    n1: repetitions at each level.
    n2: latin hypercube levels.
    n_ccd: composite points.
    """

    name: str
    n1: int
    n2: int
    n_ccd: int


PAPER_DESIGNS: dict[str, PaperDesign] = {
    "lhs": PaperDesign("lhs", 100, 1000, 0),
    "lhs+ccd": PaperDesign("lhs+ccd", 100, 862, 138),
    "ccd": PaperDesign("ccd", 100, 0, 138),
}
ITERATIONS = 10


@dataclass(frozen=True, slots=True)
class ReplicatedIndices:
    """First-order indices of a replicated design, averaged over iterations.

    plain, corrected, shape (n,): mean index over the iterations, as the paper has it and freed of
    its bias. [1] scatter, shape (n,): standard deviation of one iteration's index. [1] evaluations,
    failed: solutions of the linkage, and those that did not close: one makes its iteration NaN.
    """

    design: PaperDesign
    seed: int
    plain: Array
    corrected: Array
    scatter: Array
    evaluations: int
    failed: int


def bias_corrected(plain: Array, n1: int) -> Array:
    """Free a plain replicated-design index of its bias (1 − S)/n1.

    n1: samples in a group.
    """
    return (plain - 1.0 / n1) / (1.0 - 1.0 / n1)


def replicated_first_order(
    response: Response,
    n: int,
    design: PaperDesign,
    seed: int,
    iterations: int = ITERATIONS,
    progress: Callable[[int, int], None] | None = None,
) -> ReplicatedIndices:
    """Estimate first-order indices (Eq. 1) with a replicated design.

    response: unit cube, shape (n_points, n), to values, shape (n_points,). progress: called with
    the iterations done and their number.
    Raises `UsageError` if the design has fewer than two repetitions or no points.
    """
    if design.n1 < 2 or design.n2 + design.n_ccd < 2 or iterations < 1:
        raise UsageError(
            f"{iterations} iterations of a replicated design of {design.n1} × ({design.n2} +"
            f" {design.n_ccd}) points",
            "It has at least two repetitions, two points in each, and one iteration.",
        )
    ccd = central_composite(n) if design.n_ccd else None
    found: list[Array] = []
    evaluations = failed = 0
    for stream in np.random.SeedSequence(seed).spawn(iterations):
        rng = np.random.default_rng(stream)
        rows = first_order_design(n, design.n1, design.n2, ccd, rng)
        values = response(rows.points.reshape(-1, n))
        values = values.reshape(design.n1, -1)
        evaluations += values.size
        failed += count_failed(values)
        found.append(_group_shares(values, rows.places))
        if progress is not None:
            progress(len(found), iterations)
    plain = np.array(found)
    mean = plain.mean(axis=0)
    scatter = plain.std(axis=0, ddof=1) if iterations > 1 else np.full(n, np.nan)
    return ReplicatedIndices(
        design, seed, mean, bias_corrected(mean, design.n1), scatter, evaluations, failed
    )


def _group_shares(values: Array, places: Wholes) -> Array:
    """Variance of group means over the whole variance, for every variable."""
    n1, rows, n = places.shape
    centred = values - values.mean()
    variance = float((centred**2).mean())
    shares = np.empty(n)
    for i in range(n):
        sums = np.bincount(places[:, :, i].ravel(), centred.ravel(), rows)
        shares[i] = (sums / n1).var() / variance
    return shares
