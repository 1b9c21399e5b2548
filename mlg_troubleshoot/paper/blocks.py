"""The paper-size total-order study (Fig. 5b) in blocks: resumable, on several cores or a Dask
cluster.

Each of the n1 · n2 samples of a modified Latin hypercube keeps all joints but one while that joint
takes the n1 clearances of its level: n1² · n2 solutions per joint. A block is a range of levels of
one iteration. It depends on nothing but the study and its number, so that blocks computed anywhere
and in any order add up to the same bits.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from mlg_troubleshoot.arrays import Array, Wholes, count_failed
from mlg_troubleshoot.errors import OutputError, UsageError
from mlg_troubleshoot.geometry.kernel import numba_is_installed
from mlg_troubleshoot.indices.estimators import failed_note
from mlg_troubleshoot.indices.inputs import HeldDirections, Inputs
from mlg_troubleshoot.paper.replicated import middle_of_level, replicated_levels
from mlg_troubleshoot.parallel import spread

# Levels of one block: the work that is lost at an interruption. [1]
LEVELS_PER_BLOCK = 50


class StudyBlock(NamedTuple):
    """A range of levels of one iteration: the first and the one after the last."""

    iteration: int
    start: int
    stop: int


class BlockSums(NamedTuple):
    """What a block contributes.

    within: sum over the base samples of the variance when one joint varies, by joint. [in²]
    total, squares: sum and sum of squares of the base samples. [in, in²]
    """

    within: tuple[float, ...]
    total: float
    squares: float
    samples: int
    evaluations: int
    failed: int


@dataclass(frozen=True, slots=True, eq=False)
class BlockStudy:
    """Everything that a block depends on; it travels to other processes.

    n1, n2: repetitions and levels; `iterations` of them are averaged.
    """

    response: HeldDirections
    inputs: Inputs
    geometry_sha256: str
    seed: int
    n1: int = 100
    n2: int = 1000
    iterations: int = 10

    def __post_init__(self) -> None:
        if self.n1 < 2 or self.n2 < 1 or self.iterations < 1:
            raise UsageError(
                f"a total-order study of {self.n1} repetitions, {self.n2} levels, {self.iterations}"
                " iterations",
                "It has at least 2 repetitions, 1 level and 1 iteration.",
            )

    @property
    def n(self) -> int:
        return len(self.inputs.limits_in)

    @property
    def evaluations(self) -> int:
        """Solutions of the linkage in the whole study: every joint's, and the base samples."""
        return self.iterations * self.n1 * self.n2 * (self.n1 * self.n + 1)

    @property
    def blocks(self) -> tuple[StudyBlock, ...]:
        starts = range(0, self.n2, LEVELS_PER_BLOCK)
        return tuple(
            StudyBlock(i, start, min(start + LEVELS_PER_BLOCK, self.n2))
            for i in range(self.iterations)
            for start in starts
        )

    def key(self) -> dict[str, Any]:
        """What must agree for blocks to be of one study; the hash stands for the linkage and its
        calibration.
        """
        return {
            "directions": self.response.directions.tolist(),
            "sense": self.response.sense,
            "limits_in": self.inputs.limits_in.tolist(),
            "distribution": self.inputs.distribution,
            **{
                name: getattr(self, name)
                for name in ("n1", "n2", "iterations", "seed", "geometry_sha256")
            },
            "levels_per_block": LEVELS_PER_BLOCK,
            "compiled": numba_is_installed(),
        }


@dataclass(frozen=True, slots=True)
class TotalOrder:
    """Total-order indices of the study as far as it has been computed.

    total_order, shape (n,): mean of the completed iterations. [1]
    scatter, shape (n,): standard deviation of one iteration's index; NaN with fewer than two. [1]
    """

    total_order: Array
    scatter: Array
    iterations: int
    evaluations: int
    failed: int
    note: str


def compute_block(study: BlockStudy, block: StudyBlock) -> BlockSums:
    response = replace(study.response, compiled=numba_is_installed())
    n = study.n
    n1 = study.n1
    n2 = study.n2
    levels = _levels(n, n1, n2, study.seed, block.iteration)
    within = np.zeros(n)
    total = squares = 0.0
    failed = 0
    wide = np.empty((n, n1, n1))
    for level in range(block.start, block.stop):
        clearance = study.inputs.at(middle_of_level(levels[:, level, :], n2))
        base = response(clearance)
        total += float(base.sum())
        squares += float((base * base).sum())
        failed += count_failed(base)
        columns = clearance.T
        wide[:] = columns[:, :, None]
        for i in range(n):
            wide[i] = columns[i][None, :]
            values = response.by_rows(wide.reshape(n, -1)).reshape(n1, n1)
            wide[i] = columns[i][:, None]
            spread = values - values.mean(axis=1, keepdims=True)
            variance = float(np.einsum("ij,ij->", spread, spread)) / (n1 - 1)
            within[i] += variance
            if not np.isfinite(variance):
                failed += count_failed(values)
    count = (block.stop - block.start) * n1
    evaluations = count * (n1 * n + 1)
    return BlockSums(tuple(within.tolist()), total, squares, count, evaluations, failed)


@lru_cache(maxsize=2)
def _levels(n: int, n1: int, n2: int, seed: int, iteration: int) -> Wholes:
    stream = np.random.SeedSequence(seed, spawn_key=(iteration,))
    return replicated_levels(n, n1, n2, np.random.default_rng(stream))


def total_order_study(
    study: BlockStudy,
    workers: int = 1,
    state: Path | None = None,
    scheduler: Any = None,
    progress: Callable[[int, int], None] | None = None,
) -> TotalOrder:
    """Run a total-order study; what was computed before the run or an interruption counts.

    scheduler: a Dask client to compute with, else `workers` cores of this machine.
    """
    blocks = study.blocks
    done = {} if state is None else _resumed(study, state)
    missing = [block for block in blocks if block not in done]
    # The compiled loop runs without the interpreter's lock.
    task = partial(compute_block, study)
    runner = spread(task, missing, workers, scheduler, threads=numba_is_installed())
    try:
        for block, sums in zip(missing, runner, strict=True):
            done[block] = sums
            if state is not None:
                _append(state, [block, sums])
            if progress is not None:
                progress(len(done), len(blocks))
    except KeyboardInterrupt:
        pass
    return _summed(study, done)


def _summed(study: BlockStudy, done: dict[StudyBlock, BlockSums]) -> TotalOrder:
    """Add up blocks in their order, whoever computed them when."""
    indices = []
    for iteration in range(study.iterations):
        blocks = [block for block in study.blocks if block.iteration == iteration]
        if any(block not in done for block in blocks):
            continue
        within = np.sum([done[block].within for block in blocks], axis=0)
        total, squares, samples = np.sum([done[block][1:4] for block in blocks], axis=0)
        variance = squares / samples - (total / samples) ** 2
        indices.append(within / samples / variance)
    failed = sum(sums.failed for sums in done.values())
    evaluations = sum(sums.evaluations for sums in done.values())
    unknown = np.full(study.n, np.nan)
    found = np.array(indices or [unknown])
    scatter = found.std(axis=0, ddof=1) if len(indices) > 1 else unknown
    return TotalOrder(
        found.mean(axis=0),
        scatter,
        len(indices),
        evaluations,
        failed,
        failed_note(failed, evaluations) if failed else "",
    )


def _append(path: Path, entry: Any) -> None:
    try:
        with path.open("a", encoding="utf-8") as file:
            file.write(json.dumps(entry) + "\n")
    except OSError as error:
        raise OutputError(f"{path}: cannot be written: {error}", "Choose another file.") from error


def _resumed(study: BlockStudy, path: Path) -> dict[StudyBlock, BlockSums]:
    """Read finished blocks; a last line that was cut off by an interruption is dropped with its
    block.
    """
    if not path.exists() or path.stat().st_size == 0:
        _append(path, study.key())
        return {}
    lines = path.read_text(encoding="utf-8", errors="replace").splitlines(keepends=True)
    if lines[0] != json.dumps(study.key()) + "\n":
        raise UsageError(
            f"{path}: belongs to another study", "Give another file, or delete this one."
        )
    if not lines[-1].endswith("\n"):
        path.write_text("".join(lines[:-1]), encoding="utf-8")
        lines = lines[:-1]
    known = set(study.blocks)
    try:
        found = [
            (StudyBlock(*block), BlockSums(tuple(sums[0]), *sums[1:]))
            for block, sums in map(json.loads, lines[1:])
        ]
    except (ValueError, TypeError, LookupError, RecursionError) as error:
        raise UsageError(
            f"{path}: damaged ({error})", "Give another file, or delete this one."
        ) from error
    return {block: sums for block, sums in found if block in known}
