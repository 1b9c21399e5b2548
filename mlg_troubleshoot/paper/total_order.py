"""The paper-size total-order study (Fig. 5b), in blocks for any executor.

Each of the n1 · n2 samples of a modified Latin hypercube keeps all joints but one while that joint
takes the n1 clearances of its level: n1² · n2 solutions per joint. A block is a range of levels of
one iteration. It depends on nothing but the study and its number, so that blocks computed anywhere
and in any order add up to the same bits.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from typing import NamedTuple

import numpy as np

from mlg_troubleshoot.arrays import Array, Wholes, count_failed
from mlg_troubleshoot.errors import UsageError
from mlg_troubleshoot.geometry.kernel import numba_is_installed
from mlg_troubleshoot.indices.inputs import HeldDirections
from mlg_troubleshoot.paper.replicated import middle_of_level, replicated_levels
from mlg_troubleshoot.parallel import map_blocks

# Levels of one block. Indices depend on it in their last digits: their sums are those of blocks.
LEVELS_PER_BLOCK = 50


class StudyBlock(NamedTuple):
    """A range of levels of one iteration: the first and the one after the last."""

    iteration: int
    start: int
    stop: int


class BlockSums(NamedTuple):
    """What a block contributes.

    within, shape (n,): sum over the base samples of the variance when one joint varies. [in²]
    total, squares: sum and sum of squares of the base samples. [in, in²]
    """

    within: Array
    total: float
    squares: float
    samples: int
    evaluations: int
    failed: int


@dataclass(frozen=True, slots=True, eq=False)
class TotalOrderStudy:
    """Everything that a block depends on; it travels to other processes.

    n1, n2: repetitions and levels; `iterations` of them are averaged.
    """

    response: HeldDirections
    limits_in: Array
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
        return len(self.limits_in)

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


@dataclass(frozen=True, slots=True)
class TotalOrder:
    """Total-order indices.

    total_order, shape (n,): mean of the iterations. [1]
    scatter, shape (n,): standard deviation of one iteration's index; NaN with fewer than two. [1]
    """

    total_order: Array
    scatter: Array
    evaluations: int
    failed: int


def compute_block(study: TotalOrderStudy, block: StudyBlock) -> BlockSums:
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
        clearance = middle_of_level(levels[:, level, :], n2) * study.limits_in
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
    return BlockSums(within, total, squares, count, evaluations, failed)


@lru_cache(maxsize=2)
def _levels(n: int, n1: int, n2: int, seed: int, iteration: int) -> Wholes:
    stream = np.random.SeedSequence(seed, spawn_key=(iteration,))
    return replicated_levels(n, n1, n2, np.random.default_rng(stream))


def total_order(
    study: TotalOrderStudy,
    executor: Executor | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> TotalOrder:
    """Estimate total-order indices (Eq. 2) with a study of this size, here or by an executor."""
    blocks = study.blocks
    sums: list[BlockSums] = []
    for block in map_blocks(partial(compute_block, study), blocks, executor):
        sums.append(block)
        if progress is not None:
            progress(len(sums), len(blocks))
    size = len(blocks) // study.iterations
    each = np.array([_index(sums[at : at + size]) for at in range(0, len(sums), size)])
    scatter = each.std(axis=0, ddof=1) if len(each) > 1 else np.full(study.n, np.nan)
    evaluations = sum(block.evaluations for block in sums)
    failed = sum(block.failed for block in sums)
    return TotalOrder(each.mean(axis=0), scatter, evaluations, failed)


def _index(sums: Sequence[BlockSums]) -> Array:
    """Total-order indices of one iteration, shape (n,). [1]"""
    within = np.sum([block.within for block in sums], axis=0)
    total, squares, samples = np.sum([block[1:4] for block in sums], axis=0)
    index: Array = within / samples / (squares / samples - (total / samples) ** 2)
    return index
