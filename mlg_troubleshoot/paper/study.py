"""The study of one gear: a design, indices of every joint, and their spread over the ensemble.

First-order indices as the paper estimates them: replicated designs, averages of ten iterations.

A modified Latin hypercube (section 2.2) has n1 replicates of n2 levels. Sorted by the level of one
joint, the n1 samples of a level share that joint's clearance while the others vary (Fig. 5a);
exchanging one joint's clearance among them lets that joint vary while the others are fixed (Fig.
5b).

A group mean over n1 samples still carries 1/n1 of the variance within the group, so that the
variance of the group means is too large: the plain index exceeds the true one by (1 − S)/n1 on
average. Both columns are given. The total-order study of Fig. 5b is in
:mod:`~mlg_troubleshoot.paper.study`.

The paper-size total-order study (Fig. 5b), in blocks for any executor.

Each of the n1 · n2 samples of a modified Latin hypercube keeps all joints but one while that joint
takes the n1 clearances of its level: n1² · n2 solutions per joint. A block is a range of levels of
one iteration. It depends on nothing but the study and its number, so that blocks computed anywhere
and in any order add up to the same bits.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from enum import StrEnum
from functools import lru_cache, partial
from itertools import product

import numpy as np
from numpy.random import Generator

from mlg_troubleshoot.arrays import Array, Wholes, count_failed
from mlg_troubleshoot.errors import UsageError
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.geometry.kernel import numba_is_installed
from mlg_troubleshoot.indices.index_table import (
    Amplification,
    IndexTable,
    JointIndices,
    TableGear,
    amplification,
    rank_ranges,
    ranks,
)
from mlg_troubleshoot.indices.variance import (
    CORNERS,
    GroupIndices,
    HeldDirections,
    Indices,
    Response,
    group_indices,
    order_for,
    student_half,
    tensor_indices,
    worst_directions,
)
from mlg_troubleshoot.parallel import StageProgress, map_blocks
from mlg_troubleshoot.results import SCHEMA_VERSION, Result

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


# Repetitions at each level and iterations of the paper's designs, and the Latin hypercube levels of
# each: beside them the last two have the composite points (section 4.3).
REPETITIONS = 100
ITERATIONS = 10
LEVELS = {"lhs": 1000, "lhs+ccd": 862, "ccd": 0}


@dataclass(frozen=True, slots=True)
class Averaged:
    """Indices averaged over iterations.

    mean, shape (n,): mean of the iterations. [1]
    scatter, shape (n,): standard deviation of one iteration's index; NaN with fewer than two. [1]
    evaluations, failed: solutions of the linkage, and those that did not close: one makes its
    iteration NaN.
    """

    mean: Array
    scatter: Array
    evaluations: int
    failed: int

    @classmethod
    def over(cls, each: Array, evaluations: int, failed: int) -> Averaged:
        """Average the indices of each iteration, shape (iterations, n)."""
        scatter = each.std(axis=0, ddof=1) if len(each) > 1 else np.full(each.shape[1], np.nan)
        return cls(each.mean(axis=0), scatter, evaluations, failed)


def bias_corrected(plain: Array, n1: int) -> Array:
    """Free a plain replicated-design index of its bias (1 − S)/n1.

    n1: samples in a group.
    """
    return (plain - 1.0 / n1) / (1.0 - 1.0 / n1)


def replicated_first_order(
    response: Response,
    n: int,
    n1: int,
    n2: int,
    seed: int,
    iterations: int = ITERATIONS,
    ccd: Array | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Averaged:
    """Estimate plain first-order indices (Eq. 1) with a replicated design.

    response: unit cube, shape (n_points, n), to values, shape (n_points,).
    n1, n2: repetitions and Latin hypercube levels.
    ccd, shape (n_ccd, n): composite points. [1]
    progress: called with the iterations done and their number.
    Raises `UsageError` if the design has fewer than two repetitions or no points.
    """
    composite = 0 if ccd is None else len(ccd)
    if n1 < 2 or n2 + composite < 2 or iterations < 1:
        raise UsageError(
            f"{iterations} iterations of a replicated design of {n1} × ({n2} + {composite}) points",
            "It has at least two repetitions, two points in each, and one iteration.",
        )
    found: list[Array] = []
    failed = 0
    for stream in np.random.SeedSequence(seed).spawn(iterations):
        rows = first_order_design(n, n1, n2, ccd, np.random.default_rng(stream))
        values = response(rows.points.reshape(-1, n)).reshape(n1, -1)
        failed += count_failed(values)
        found.append(_group_shares(values, rows.places))
        if progress is not None:
            progress(len(found), iterations)
    return Averaged.over(np.array(found), iterations * n1 * (n2 + composite), failed)


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


# Levels of one block. Indices depend on it in their last digits: their sums are those of blocks.
LEVELS_PER_BLOCK = 50


@dataclass(frozen=True, slots=True, eq=False)
class TotalOrderStudy:
    """Everything that a block depends on; it travels to other processes.

    n1, n2: repetitions and levels; `iterations` of them are averaged.
    """

    response: HeldDirections
    limits_in: Array
    seed: int
    n1: int = REPETITIONS
    n2: int = LEVELS["lhs"]
    iterations: int = ITERATIONS

    @property
    def evaluations(self) -> int:
        """Solutions of the linkage in the whole study: every joint's, and the base samples."""
        return self.iterations * self.n1 * self.n2 * (self.n1 * len(self.limits_in) + 1)

    @property
    def blocks(self) -> list[tuple[int, range]]:
        """Iteration and levels of each block."""
        starts = range(0, self.n2, LEVELS_PER_BLOCK)
        return [
            (i, range(start, min(start + LEVELS_PER_BLOCK, self.n2)))
            for i in range(self.iterations)
            for start in starts
        ]


def compute_block(study: TotalOrderStudy, block: tuple[int, range]) -> Array:
    """Add up what a block contributes, shape (n + 3,).

    Returns: sum over the base samples of the variance when one joint varies, of each joint [in²];
    sum and sum of squares of the base samples [in, in²]; solutions that do not close.
    """
    response = replace(study.response, compiled=numba_is_installed())
    n = len(study.limits_in)
    n1 = study.n1
    iteration, block_levels = block
    levels = _levels(n, n1, study.n2, study.seed, iteration)
    sums = np.zeros(n + 3)
    wide = np.empty((n, n1, n1))
    for level in block_levels:
        clearance = middle_of_level(levels[:, level, :], study.n2) * study.limits_in
        base = response(clearance)
        sums[n:] += base.sum(), (base * base).sum(), count_failed(base)
        columns = clearance.T
        wide[:] = columns[:, :, None]
        for i in range(n):
            wide[i] = columns[i][None, :]
            values = response.by_rows(wide.reshape(n, -1)).reshape(n1, n1)
            wide[i] = columns[i][:, None]
            spread = values - values.mean(axis=1, keepdims=True)
            variance = float(np.einsum("ij,ij->", spread, spread)) / (n1 - 1)
            sums[i] += variance
            if not np.isfinite(variance):
                sums[-1] += count_failed(values)
    return sums


@lru_cache(maxsize=2)
def _levels(n: int, n1: int, n2: int, seed: int, iteration: int) -> Wholes:
    stream = np.random.SeedSequence(seed, spawn_key=(iteration,))
    return replicated_levels(n, n1, n2, np.random.default_rng(stream))


def total_order(
    study: TotalOrderStudy,
    executor: Executor | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Averaged:
    """Estimate total-order indices (Eq. 2) with a study of this size, here or by an executor."""
    blocks = study.blocks
    sums: list[Array] = []
    for block in map_blocks(partial(compute_block, study), blocks, executor):
        sums.append(block)
        if progress is not None:
            progress(len(sums), len(blocks))
    iterations = np.array(sums).reshape(study.iterations, -1, len(sums[0])).sum(axis=1)
    within, (total, squares, failed) = np.split(iterations.T, [-3])
    samples = study.n1 * study.n2
    each = within / samples / (squares / samples - (total / samples) ** 2)
    return Averaged.over(each.T, study.evaluations, int(failed.sum()))


class StudyDesign(StrEnum):
    """How the points are chosen: by the exact tensor, or as the paper has it."""

    TENSOR = "tensor"
    LHS = "lhs"
    LHS_CCD = "lhs+ccd"
    CCD = "ccd"


@dataclass(frozen=True, slots=True, repr=False, eq=False)
class StudyOptions(Result):
    """What a study is asked for.

    Parameters
    ----------
    design : StudyDesign
        How the points are chosen.
    seed : int
        Seed of all random draws.
    limits_in : ndarray, shape (n_joints,), or None
        Limits in place of the gear's. [in]
    n1, n2, iterations : int or None
        Size of a paper design in place of the paper's.
    executor : Executor or None
        What computes the total-order study of ``lhs``: any executor of `concurrent.futures`, of a
        Dask cluster, of Ray.
    """

    design: StudyDesign = StudyDesign.TENSOR
    seed: int = 0
    limits_in: Array | None = None
    n1: int | None = None
    n2: int | None = None
    iterations: int | None = None
    executor: Executor | None = None

    @property
    def is_standard(self) -> bool:
        """True if the result is the table that goes with a gear."""
        return self.design is StudyDesign.TENSOR and self.limits_in is None


@dataclass(frozen=True, slots=True, repr=False, eq=False)
class StudyFindings(Result):
    """A study and what was found with it.

    Parameters
    ----------
    gear : Gear
        The gear.
    options : StudyOptions
        What was asked for.
    table : IndexTable
        Indices of every joint with their spread over the ensemble.
    indices : Indices
        Indices of the reference, with moments and notes.
    plain : ndarray, shape (n_joints,), or None
        First-order indices of a paper design before its bias is removed. [1]
    groups : tuple of GroupIndices
        Both ends of each link as one; empty if the design cannot tell.
    growth : Amplification
        Amplification indices of the reference.
    """

    json_names = """
        *table directions distribution note=indices.note mean=indices.mean variance=indices.variance
        first_order_plain=plain groups ensemble=gear.ensemble_names amplification=growth
    """
    directions = "worst"
    distribution = "uniform"
    gear: Gear
    options: StudyOptions
    table: IndexTable
    indices: Indices
    plain: Array | None
    groups: tuple[GroupIndices, ...]
    growth: Amplification


def run_study(
    gear: Gear, options: StudyOptions, progress: StageProgress = lambda _stage, _done, _total: None
) -> StudyFindings:
    """Study the reference of a gear by the chosen design, and the other linkages of its ensemble by
    the tensor.
    """
    limits = np.asarray(gear.limits_in if options.limits_in is None else options.limits_in, float)
    if limits.shape != gear.limits_in.shape or not (np.isfinite(limits) & (limits > 0.0)).all():
        raise UsageError(
            f"limits {limits.tolist()} in of {len(gear.joints)} joints",
            "Give one positive length per joint.",
        )
    plain = None
    groups: tuple[GroupIndices, ...] = ()
    if options.design is StudyDesign.TENSOR:
        indices, groups = _on_linkage(gear, limits, 0)
    else:
        indices, plain = _paper(gear, limits, options, progress)
    found = [indices]
    for k in range(1, len(gear.ensemble)):
        found.append(_on_linkage(gear, limits, k)[0])
        progress("ensemble", k, len(gear.ensemble) - 1)
    growth = amplification(gear)
    table = _table(gear, limits, options, found, growth)
    return StudyFindings(gear, options, table, indices, plain, groups, growth)


def _on_linkage(gear: Gear, limits: Array, k: int) -> tuple[Indices, tuple[GroupIndices, ...]]:
    """Indices of linkage k of the ensemble, and of its links; the first is the reference, whose
    intervals are the difference to two Gauss points per joint.
    """
    response = worst_directions(gear.ensemble_models[k], limits)
    corners = tensor_indices(response, limits, nodes=CORNERS)
    none = np.full((2, len(limits)), np.nan)
    if corners.failed:
        # Gauss points lie inside the range, and a linkage opens at its corners first.
        design = f"{corners.evaluations} corners of the range"
        counts = corners.evaluations, corners.failed
        return Indices(design, none, none, np.nan, np.nan, *counts, _failed_note(*counts)), ()
    order = order_for(len(limits))
    tensor = tensor_indices(response, limits, order=order)
    orders = np.array([tensor.first_order, tensor.total_order])
    half = np.zeros_like(orders)
    evaluations = tensor.evaluations
    note = ""
    if k == 0 and order > 2:
        coarse = tensor_indices(response, limits, order=2)
        half = np.abs(orders - [coarse.first_order, coarse.total_order])
        evaluations += coarse.evaluations
        note = "intervals are the difference to two Gauss points per joint"
    design = f"tensor of {len(tensor.weights)} Gauss points per joint"
    moments = tensor.mean, tensor.variance
    indices = Indices(design, orders, half, *moments, evaluations, tensor.failed, note)
    return indices, group_indices(gear, tensor.closed)


def _paper(
    gear: Gear, limits: Array, options: StudyOptions, progress: StageProgress
) -> tuple[Indices, Array]:
    """Run the paper's design for the first order and, for ``lhs``, its study of the total order;
    return the plain first order as well.
    """
    response = worst_directions(gear.model, limits)
    n = len(limits)
    n1 = REPETITIONS if options.n1 is None else options.n1
    iterations = ITERATIONS if options.iterations is None else options.iterations
    n2 = LEVELS[options.design]
    if n2 and options.n2 is not None:
        n2 = options.n2
    ccd = None if options.design is StudyDesign.LHS else central_composite(n)
    first = replicated_first_order(
        lambda unit: response(unit * limits),
        n,
        n1,
        n2,
        options.seed,
        iterations,
        ccd,
        partial(progress, "first order"),
    )
    total = Averaged(np.full(n, np.nan), np.full(n, np.nan), 0, 0)
    note = f"first order corrected for the bias (1 - S)/{n1}"
    if ccd is None:
        study = TotalOrderStudy(response, limits, options.seed, n1, n2, iterations)
        total = total_order(study, options.executor, partial(progress, "total order"))
        if total.failed:
            note += f"; {_failed_note(total.evaluations, total.failed)}"
    indices = Indices(
        f"{options.design}: n1 = {n1}, n2 = {n2}, nCCD = {0 if ccd is None else len(ccd)}, mean of"
        f" {iterations} iterations",
        np.array([bias_corrected(first.mean, n1), total.mean]),
        student_half(np.array([first.scatter, total.scatter]), iterations),
        np.nan,
        np.nan,
        first.evaluations + total.evaluations,
        first.failed + total.failed,
        note,
    )
    return indices, first.mean


def _failed_note(evaluations: int, failed: int) -> str:
    return (
        f"{failed} of {evaluations} samples do not close, so the variance over the whole range is"
        " not defined: use smaller limits."
    )


def _table(
    gear: Gear,
    limits: Array,
    options: StudyOptions,
    found: Sequence[Indices],
    growth: Amplification,
) -> IndexTable:
    """The table of the reference, the first that was found, with the spread over all."""
    reference = found[0]
    orders = np.array([each.orders for each in found])
    places = ranks(orders[0, 0])
    spans = rank_ranges(orders[:, 0])
    # Lower and upper ends of first and total order, of each joint.
    spread = np.array([orders.min(axis=0), orders.max(axis=0)]).T.tolist()
    intervals = np.array([reference.orders - reference.half, reference.orders + reference.half])
    ends = intervals.T.tolist()
    joints = tuple(
        JointIndices(
            joint=joint.number,
            limit_in=float(limits[i]),
            first_order=float(reference.orders[0, i]),
            first_order_interval=tuple(ends[i][0]),
            total_order=float(reference.orders[1, i]),
            total_order_interval=tuple(ends[i][1]),
            plunger_amplification=float(growth.exact[i]),
            max_amplification_index=float(growth.max_stage[i]),
            rank=int(places[i]),
            rank_range=spans[i],
            first_order_spread=tuple(spread[i][0]),
            total_order_spread=tuple(spread[i][1]),
        )
        for i, joint in enumerate(gear.joints)
    )
    return IndexTable(
        schema_version=SCHEMA_VERSION,
        gear=TableGear(gear.id, gear.geometry_sha256, gear.ensemble_sha256, gear.provenance),
        seed=options.seed,
        design=reference.design,
        evaluations=sum(each.evaluations for each in found),
        failed=sum(each.failed for each in found),
        joints=joints,
    )
