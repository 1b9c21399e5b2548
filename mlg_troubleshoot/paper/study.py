"""The study of one gear: a design, indices of every joint, their spread over the ensemble, what
goes with them.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import TYPE_CHECKING

import numpy as np

from mlg_troubleshoot.arrays import Array
from mlg_troubleshoot.errors import UsageError
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.gear.model import LinkageModel
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
from mlg_troubleshoot.indices.inputs import (
    HeldDirections,
    Inputs,
    Response,
    beyond_margin,
    joint_groups,
    with_random_directions,
    worst_directions,
    worst_sense,
)
from mlg_troubleshoot.indices.saltelli import fast_indices, saltelli_indices
from mlg_troubleshoot.indices.tensor import TensorIndices, tensor_indices
from mlg_troubleshoot.outputs import SCHEMA_VERSION
from mlg_troubleshoot.results import Result

if TYPE_CHECKING:
    from mlg_troubleshoot.paper.replicated import PaperDesign, ReplicatedIndices
    from mlg_troubleshoot.paper.statements import Statement

Progress = Callable[[str, int, int | None], None]
Stages = Callable[[str], Callable[[int, int | None], None]]


class StudyDesign(StrEnum):
    FAST = "fast"
    SAMPLED = "sampled"
    TENSOR = "tensor"
    LHS = "lhs"
    LHS_CCD = "lhs+ccd"
    CCD = "ccd"


class Directions(StrEnum):
    WORST = "worst"
    OVER = "over"
    UNDER = "under"
    RANDOM = "random"
    FIXED = "fixed"


@dataclass(frozen=True, slots=True, repr=False, eq=False)
class StudyOptions(Result):
    """What a study is asked for.

    Parameters
    ----------
    design : StudyDesign
        How the points are chosen.
    accuracy : float
        Wanted error of every index, where the design takes one. [1]
    seed : int
        Seed of all random draws.
    distribution : str
        Distribution of the clearances.
    limits_in : ndarray, shape (n_joints,), or None
        Limits in place of the gear's. [in]
    directions : Directions
        Directions of the virtual links.
    fixed_rad : ndarray, shape (n_joints,), or None
        Directions set by a load, with ``fixed``. [rad]
    beyond_margin : bool
        Look at exceeding the margin instead of the displacement.
    most : int
        Maximum number of evaluations.
    n1, n2, iterations : int or None
        Size of a paper design in place of the paper's.
    executor : Executor or None
        What computes the total-order study of ``lhs``: any executor of `concurrent.futures`, of a
        Dask cluster, of Ray.
    """

    design: StudyDesign = StudyDesign.FAST
    accuracy: float = 1e-3
    seed: int = 0
    distribution: str = "uniform"
    limits_in: Array | None = None
    directions: Directions = Directions.WORST
    fixed_rad: Array | None = None
    beyond_margin: bool = False
    most: int = 1 << 24
    n1: int | None = None
    n2: int | None = None
    iterations: int | None = None
    executor: Executor | None = None

    @property
    def is_standard(self) -> bool:
        """True if the result is the table that goes with a gear."""
        return (
            self.design in (StudyDesign.FAST, StudyDesign.SAMPLED, StudyDesign.TENSOR)
            and self.distribution == "uniform"
            and self.limits_in is None
            and self.directions is Directions.WORST
            and not self.beyond_margin
        )


@dataclass(frozen=True, slots=True, repr=False, eq=False)
class StudyResult(Result):
    """What a study found.

    table: indices of every joint with their spread over the ensemble.
    indices: the same of the reference, with moments and notes.
    plain, shape (n_joints,): first-order indices of a paper design before its bias is removed. [1]
    groups: both ends of each link as one; empty if the design cannot tell.
    growth: amplification indices of the reference.
    finished: false if it was interrupted: the table holds what was done.
    """

    table: IndexTable
    indices: Indices
    plain: Array | None
    groups: tuple[GroupIndices, ...]
    growth: Amplification
    finished: bool


@dataclass(frozen=True, slots=True, repr=False, eq=False)
class StudyFindings(Result):
    """A study and what was found with it.

    Parameters
    ----------
    gear : Gear
        The gear.
    options : StudyOptions
        What was asked for.
    result : StudyResult
        Indices and amplification.
    designs : tuple of ReplicatedIndices
        The paper's designs; empty if they were not run.
    statements : tuple of Statement
        What became of the source's statements; empty if they were not checked.
    """

    gear: Gear
    options: StudyOptions
    result: StudyResult
    designs: tuple[ReplicatedIndices, ...] = ()
    statements: tuple[Statement, ...] = ()


@dataclass(slots=True)
class _Run:
    """What the design found on one linkage."""

    indices: Indices
    plain: Array | None = None
    groups: tuple[GroupIndices, ...] = ()
    finished: bool = True


def run_study(gear: Gear, options: StudyOptions, progress: Progress | None = None) -> StudyResult:
    """Run a study of a gear: its reference by the chosen design, its ensemble by the fast route."""
    if not options.accuracy > 0.0:
        raise UsageError(
            f"accuracy {options.accuracy}", "Give a positive number, for example 0.001."
        )
    inputs = _inputs(gear, options)
    if len(inputs.limits_in) != len(gear.joints):
        raise UsageError(
            f"{len(inputs.limits_in)} limits for {len(gear.joints)} joints",
            "Give one per joint.",
        )

    def on_stage(name: str) -> Callable[[int, int | None], None]:
        return lambda done, total: None if progress is None else progress(name, done, total)

    if options.design in (StudyDesign.LHS, StudyDesign.LHS_CCD, StudyDesign.CCD):
        run = _paper(gear, inputs, options, on_stage)
    else:
        run = _on_linkage(gear, inputs, options, 0, on_stage("samples"))
    found = [run.indices]
    advance = on_stage("ensemble")
    finished = run.finished and "interrupted" not in run.indices.note
    for k in range(1, len(gear.ensemble)):
        try:
            found.append(_on_linkage(gear, inputs, options, k).indices)
            advance(k, len(gear.ensemble) - 1)
        except KeyboardInterrupt:
            finished = False
            break
    growth = amplification(gear)
    table = _table(gear, inputs, options, found, growth)
    return StudyResult(table, run.indices, run.plain, run.groups, growth, finished)


def _inputs(gear: Gear, options: StudyOptions) -> Inputs:
    return Inputs(
        gear.limits_in if options.limits_in is None else options.limits_in, options.distribution
    )


def _response(
    gear: Gear, model: LinkageModel, inputs: Inputs, options: StudyOptions
) -> tuple[Response, int]:
    """Response on the unit cube and its number of variables."""
    n = len(inputs.limits_in)
    cube: Response
    if options.directions is Directions.RANDOM:
        cube = with_random_directions(model, inputs)
        n = 2 * n
    else:
        cube = inputs.on_unit_cube(_held(model, inputs, options))
    if options.beyond_margin:
        cube = beyond_margin(cube, gear.margin.value)
    return cube, n


def _held(model: LinkageModel, inputs: Inputs, options: StudyOptions) -> HeldDirections:
    if options.directions is Directions.FIXED:
        if options.fixed_rad is None or len(options.fixed_rad) != len(inputs.limits_in):
            raise UsageError("directions fixed by load", "Give one direction per joint.")
        return HeldDirections(model, np.asarray(options.fixed_rad, float))
    if options.directions is Directions.WORST:
        return worst_directions(model, inputs.limits_in)
    return worst_sense(
        model, inputs.limits_in, 1.0 if options.directions is Directions.OVER else -1.0
    )


def _on_linkage(
    gear: Gear,
    inputs: Inputs,
    options: StudyOptions,
    k: int,
    on_stage: Callable[[int, int | None], None] | None = None,
) -> _Run:
    """Indices of linkage k of the ensemble; of the reference, which is the first, by the design
    that was asked for.
    """
    cube, n = _response(gear, gear.ensemble_models[k], inputs, options)
    seeds = np.random.SeedSequence(options.seed, spawn_key=(k,))
    stream = np.random.default_rng(seeds)
    accuracy = options.accuracy
    most = options.most
    advance = None if on_stage is None else (lambda done, _width: on_stage(done, None))
    if options.directions is Directions.RANDOM:
        if k:
            accuracy = max(accuracy, 3e-3)
            most = 1 << 20
        sets = joint_groups(len(inputs.limits_in))
        return _Run(saltelli_indices(cube, n, stream, options.seed, accuracy, most, sets, advance))
    if options.design is StudyDesign.TENSOR:
        tensor = tensor_indices(cube, np.ones(n))
        coarse = None if k else tensor_indices(cube, np.ones(n), order=2)
        return _Run(
            _of_tensor(tensor, coarse, options.seed), groups=group_indices(gear, tensor.closed)
        )
    if options.design is StudyDesign.SAMPLED and not k:
        return _Run(saltelli_indices(cube, n, stream, options.seed, accuracy, most, None, advance))
    if k and options.beyond_margin:
        most = 1 << 18
    indices, fit = fast_indices(cube, n, stream, options.seed, accuracy, most, advance)
    return _Run(indices, groups=() if fit is None else group_indices(gear, fit.closed))


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


def _paper(gear: Gear, inputs: Inputs, options: StudyOptions, on_stage: Stages) -> _Run:
    """Run the paper's design for the first order and, for ``lhs``, its study of the total order."""
    from mlg_troubleshoot.paper.replicated import ITERATIONS, PAPER_DESIGNS, replicated_first_order
    from mlg_troubleshoot.paper.total_order import TotalOrderStudy, total_order

    if options.directions is Directions.RANDOM:
        raise UsageError(
            f"design {options.design} with random directions",
            "The paper's designs keep directions fixed; use sampled.",
        )
    cube, n = _response(gear, gear.model, inputs, options)
    design = _sized(PAPER_DESIGNS[str(options.design)], n, options)
    n1 = design.n1
    n2 = design.n2
    iterations = ITERATIONS if options.iterations is None else options.iterations
    found = replicated_first_order(
        cube, n, design, options.seed, iterations, on_stage("first order")
    )
    half = student_half(found.scatter, found.iterations)
    total = np.full(n, np.nan)
    spread = np.full(n, np.nan)
    evaluations = found.evaluations
    failed = found.failed
    finished = found.iterations == iterations
    note = f"first order corrected for the bias (1 - S)/{n1}"
    if options.design is StudyDesign.LHS and finished and not options.beyond_margin:
        study = TotalOrderStudy(
            _held(gear.model, inputs, options), inputs, options.seed, n1, n2, iterations
        )
        totals = total_order(study, options.executor, on_stage("total order"))
        total = totals.total_order
        spread = student_half(totals.scatter, iterations)
        evaluations = evaluations + totals.evaluations
        failed = failed + totals.failed
        if totals.failed:
            note += f"; {failed_note(totals.failed, totals.evaluations)}"
    if not finished:
        note += "; interrupted, averages of the finished part"
    name = (
        f"{design.name}: n1 = {n1}, n2 = {n2}, nCCD = {design.n_ccd}, mean of {found.iterations}"
        " iterations"
    )
    estimates = (found.corrected, half), (total, spread)
    indices = Indices.around(
        name, options.seed, *estimates, np.nan, np.nan, evaluations, failed, note
    )
    return _Run(indices, plain=found.plain, finished=finished)


def _sized(paper: PaperDesign, n: int, options: StudyOptions) -> PaperDesign:
    """Return a paper design in the size asked for, with the composite points of this number of
    variables.
    """
    from mlg_troubleshoot.paper.replicated import central_composite

    return replace(
        paper,
        n1=paper.n1 if options.n1 is None else options.n1,
        n2=paper.n2 if options.n2 is None or not paper.n2 else options.n2,
        n_ccd=len(central_composite(n)) if paper.n_ccd else 0,
    )


def compare_designs(
    gear: Gear, options: StudyOptions, progress: Progress | None = None
) -> tuple[ReplicatedIndices, ...]:
    """Estimate the first-order indices of the reference with each design of the paper (Fig.
    13c).
    """
    from mlg_troubleshoot.paper.replicated import ITERATIONS, PAPER_DESIGNS, replicated_first_order

    if options.directions is Directions.RANDOM:
        return ()
    cube, n = _response(gear, gear.model, _inputs(gear, options), options)
    iterations = ITERATIONS if options.iterations is None else options.iterations
    found = []
    for k, paper in enumerate(PAPER_DESIGNS.values(), start=1):
        found.append(
            replicated_first_order(cube, n, _sized(paper, n, options), options.seed, iterations)
        )
        if progress is not None:
            progress("designs", k, len(PAPER_DESIGNS))
    return tuple(found)


def _table(
    gear: Gear,
    inputs: Inputs,
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
            limit_in=float(inputs.limits_in[i]),
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
