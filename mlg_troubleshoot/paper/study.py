"""The study of one gear: a design, indices of every joint, and their spread over the ensemble."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from enum import StrEnum
from functools import partial

import numpy as np

from mlg_troubleshoot.arrays import Array
from mlg_troubleshoot.errors import UsageError
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.indices.amplification import Amplification, amplification
from mlg_troubleshoot.indices.estimators import (
    GroupIndices,
    Indices,
    failed_note,
    group_indices,
    student_half,
)
from mlg_troubleshoot.indices.index_table import (
    IndexTable,
    JointIndices,
    TableGear,
    rank_ranges,
    ranks,
)
from mlg_troubleshoot.indices.inputs import worst_directions
from mlg_troubleshoot.indices.tensor import CORNERS, TensorIndices, order_for, tensor_indices
from mlg_troubleshoot.outputs import SCHEMA_VERSION
from mlg_troubleshoot.paper.replicated import (
    ITERATIONS,
    PAPER_DESIGNS,
    PaperDesign,
    central_composite,
    replicated_first_order,
)
from mlg_troubleshoot.paper.total_order import TotalOrderStudy, total_order
from mlg_troubleshoot.parallel import StageProgress
from mlg_troubleshoot.results import Result


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

    gear: Gear
    options: StudyOptions
    table: IndexTable
    indices: Indices
    plain: Array | None
    groups: tuple[GroupIndices, ...]
    growth: Amplification


@dataclass(slots=True)
class _Run:
    """What the design found on one linkage."""

    indices: Indices
    plain: Array | None = None
    groups: tuple[GroupIndices, ...] = ()


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
    if options.design is StudyDesign.TENSOR:
        run = _on_linkage(gear, limits, options, 0)
    else:
        run = _paper(gear, limits, options, progress)
    found = [run.indices]
    for k in range(1, len(gear.ensemble)):
        found.append(_on_linkage(gear, limits, options, k).indices)
        progress("ensemble", k, len(gear.ensemble) - 1)
    growth = amplification(gear)
    table = _table(gear, limits, options, found, growth)
    return StudyFindings(gear, options, table, run.indices, run.plain, run.groups, growth)


def _on_linkage(gear: Gear, limits: Array, options: StudyOptions, k: int) -> _Run:
    """Indices of linkage k of the ensemble; the first is the reference."""
    response = worst_directions(gear.ensemble_models[k], limits)
    corners = tensor_indices(response, limits, nodes=CORNERS)
    if corners.failed:
        # Gauss points lie inside the range, and a linkage opens at its corners first.
        design = f"{corners.evaluations} corners of the range"
        none = np.full(len(limits), np.nan), np.full(len(limits), np.nan)
        counts = corners.evaluations, corners.failed
        note = failed_note(corners.failed, corners.evaluations)
        return _Run(Indices.around(design, options.seed, none, none, np.nan, np.nan, *counts, note))
    order = order_for(len(limits))
    tensor = tensor_indices(response, limits, order=order)
    coarse = None if k or order < 3 else tensor_indices(response, limits, order=2)
    return _Run(_of_tensor(tensor, coarse, options.seed), groups=group_indices(gear, tensor.closed))


def _of_tensor(tensor: TensorIndices, coarse: TensorIndices | None, seed: int) -> Indices:
    first = tensor.first_order
    total = tensor.total_order
    evaluations = tensor.evaluations
    note = ""
    half = np.zeros((2, len(first)))
    if coarse is not None:
        half = np.abs([first - coarse.first_order, total - coarse.total_order])
        evaluations += coarse.evaluations
        note = "intervals are the difference to two Gauss points per joint"
    design = f"tensor of {len(tensor.weights)} Gauss points per joint"
    estimates = ((first, half[0]), (total, half[1]))
    return Indices.around(
        design, seed, *estimates, tensor.mean, tensor.variance, evaluations, tensor.failed, note
    )


def _paper(gear: Gear, limits: Array, options: StudyOptions, progress: StageProgress) -> _Run:
    """Run the paper's design for the first order and, for ``lhs``, its study of the total order."""
    response = worst_directions(gear.model, limits)
    n = len(limits)
    design = _sized(PAPER_DESIGNS[str(options.design)], n, options)
    iterations = ITERATIONS if options.iterations is None else options.iterations
    found = replicated_first_order(
        lambda unit: response(unit * limits),
        n,
        design,
        options.seed,
        iterations,
        partial(progress, "first order"),
    )
    total = spread = np.full(n, np.nan)
    evaluations = found.evaluations
    failed = found.failed
    note = f"first order corrected for the bias (1 - S)/{design.n1}"
    if options.design is StudyDesign.LHS:
        study = TotalOrderStudy(response, limits, options.seed, design.n1, design.n2, iterations)
        totals = total_order(study, options.executor, partial(progress, "total order"))
        total = totals.total_order
        spread = student_half(totals.scatter, iterations)
        evaluations += totals.evaluations
        failed += totals.failed
        if totals.failed:
            note += f"; {failed_note(totals.failed, totals.evaluations)}"
    name = (
        f"{design.name}: n1 = {design.n1}, n2 = {design.n2}, nCCD = {design.n_ccd}, mean of"
        f" {iterations} iterations"
    )
    half = student_half(found.scatter, iterations)
    indices = Indices.around(
        name,
        options.seed,
        (found.corrected, half),
        (total, spread),
        np.nan,
        np.nan,
        evaluations,
        failed,
        note,
    )
    return _Run(indices, plain=found.plain)


def _sized(paper: PaperDesign, n: int, options: StudyOptions) -> PaperDesign:
    """Return a paper design in the size asked for, with the composite points of this number of
    variables.
    """
    return replace(
        paper,
        n1=paper.n1 if options.n1 is None else options.n1,
        n2=paper.n2 if options.n2 is None or not paper.n2 else options.n2,
        n_ccd=len(central_composite(n)) if paper.n_ccd else 0,
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
    orders = np.array([[each.first_order, each.total_order] for each in found])
    places = ranks(orders[0, 0])
    spans = rank_ranges(orders[:, 0])
    ends = np.array([orders.min(axis=0), orders.max(axis=0)])
    joints = tuple(
        JointIndices(
            joint=joint.number,
            limit_in=float(limits[i]),
            first_order=float(reference.first_order[i]),
            first_order_interval=_pair(reference.first_order_interval[i]),
            total_order=float(reference.total_order[i]),
            total_order_interval=_pair(reference.total_order_interval[i]),
            plunger_amplification=float(growth.exact[i]),
            max_amplification_index=float(growth.max_stage[i]),
            rank=int(places[i]),
            rank_range=spans[i],
            first_order_spread=_pair(ends[:, 0, i]),
            total_order_spread=_pair(ends[:, 1, i]),
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


def _pair(ends: Array) -> tuple[float, float]:
    return float(ends[0]), float(ends[1])
