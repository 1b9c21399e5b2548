"""The paper-size total-order study (Fig. 5b) in blocks: resumable, on several cores or a Dask cluster.

Each of the n1 · n2 samples of a modified Latin hypercube keeps all joints but one while that joint takes the
n1 clearances of its level: n1² · n2 solutions a joint. A block is a range of levels of one iteration. It
depends on nothing but the study and its number, so that blocks computed anywhere and in any order add up to
the same bits.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from concurrent.futures import (
    FIRST_COMPLETED,
    Executor,
    Future,
    ProcessPoolExecutor,
    ThreadPoolExecutor,
    wait,
)
from dataclasses import dataclass
from functools import lru_cache
from importlib import import_module
from multiprocessing import get_context
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from mlg_troubleshoot.errors import OutputError, UsageError
from mlg_troubleshoot.gear.model import Calibration, LinkageModel
from mlg_troubleshoot.geometry.kernel import numba_is_installed
from mlg_troubleshoot.geometry.mechanism import Mechanism
from mlg_troubleshoot.studies.designs import middle_of_level, replicated_levels
from mlg_troubleshoot.studies.indices import failed_note
from mlg_troubleshoot.studies.inputs import Inputs
from mlg_troubleshoot.studies.response import HeldDirections

Array = NDArray[np.float64]
LEVELS_PER_BLOCK = 50


@dataclass(frozen=True, slots=True)
class BlockStudy:
    """Everything that a block depends on; it travels to other processes.

    Parameters
    ----------
    mechanism : Mechanism
        The linkage.
    stroke : tuple of float
        Its release stroke. [in]
    calibration : Calibration
        Its calibration.
    directions : tuple of float
        Directions of the virtual links. [rad]
    sense : float
        +1 for over-travel, −1 for under-travel. [1]
    limits_in : tuple of float
        Limits of the clearances. [in]
    distribution : str
        Their distribution.
    n1, n2 : int
        Repetitions and levels.
    iterations : int
        Iterations to average.
    seed : int
        Seed.
    geometry_sha256 : str
        Hash of the geometry, for resuming.
    """

    mechanism: Mechanism
    stroke: tuple[float, float]
    calibration: Calibration
    directions: tuple[float, ...]
    sense: float
    limits_in: tuple[float, ...]
    distribution: str
    n1: int
    n2: int
    iterations: int
    seed: int
    geometry_sha256: str

    def __post_init__(self) -> None:
        if self.n1 < 2 or self.n2 < 1 or self.iterations < 1:
            raise UsageError(
                f"a total-order study of {self.n1} repetitions, {self.n2} levels, {self.iterations} iterations",
                "It has at least 2 repetitions, 1 level and 1 iteration.",
            )

    @property
    def n(self) -> int:
        """Number of joints."""
        return len(self.limits_in)

    @property
    def evaluations(self) -> int:
        """Solutions of the linkage in the whole study: every joint's, and the base samples."""
        return self.iterations * self.n1 * self.n2 * (self.n1 * self.n + 1)

    @property
    def blocks(self) -> tuple[Block, ...]:
        """Blocks of the study in order."""
        return tuple(
            Block(iteration, start, min(start + LEVELS_PER_BLOCK, self.n2))
            for iteration in range(self.iterations)
            for start in range(0, self.n2, LEVELS_PER_BLOCK)
        )

    def key(self) -> dict[str, Any]:
        """Return what must agree for blocks to be of one study."""
        return {
            "geometry_sha256": self.geometry_sha256,
            "directions": list(self.directions),
            "sense": self.sense,
            "limits_in": list(self.limits_in),
            "distribution": self.distribution,
            "n1": self.n1,
            "n2": self.n2,
            "iterations": self.iterations,
            "seed": self.seed,
            "levels_per_block": LEVELS_PER_BLOCK,
            "compiled": numba_is_installed(),
        }


@dataclass(frozen=True, slots=True)
class Block:
    """A range of levels of one iteration.

    Parameters
    ----------
    iteration, start, stop : int
        Iteration, first level and the level after the last.
    """

    iteration: int
    start: int
    stop: int


@dataclass(frozen=True, slots=True)
class BlockSums:
    """What a block contributes.

    Parameters
    ----------
    within : tuple of float
        Sum over the block's samples of the variance when one joint varies, by joint. [in²]
    total, squares : float
        Sum and sum of squares of the base samples. [in, in²]
    samples : int
        Base samples.
    evaluations, failed : int
        Solutions of the linkage, and those that did not close.
    """

    within: tuple[float, ...]
    total: float
    squares: float
    samples: int
    evaluations: int
    failed: int


@dataclass(frozen=True, slots=True)
class TotalOrder:
    """Total-order indices of the study as far as it has been computed.

    Parameters
    ----------
    total_order : ndarray, shape (n,)
        Mean of the completed iterations. [1]
    scatter : ndarray, shape (n,)
        Standard deviation of one iteration's index; NaN with fewer than two. [1]
    iterations : int
        Completed iterations.
    evaluations, failed : int
        Solutions of the linkage in all blocks done, and those that did not close.
    blocks_done, blocks : int
        Blocks done, and blocks in the study.
    note : str
        What failed samples mean; empty if there are none.
    """

    total_order: Array
    scatter: Array
    iterations: int
    evaluations: int
    failed: int
    blocks_done: int
    blocks: int
    note: str


class Scheduler(Protocol):
    """The part of a Dask client that the study uses."""

    def submit(self, function: Callable[..., Any], *args: Any, **options: Any) -> Any:
        """Compute a function elsewhere."""


def block_study(
    response: HeldDirections,
    inputs: Inputs,
    geometry_sha256: str,
    seed: int,
    n1: int = 100,
    n2: int = 1000,
    iterations: int = 10,
) -> BlockStudy:
    """Describe a total-order study of a response.

    Parameters
    ----------
    response : HeldDirections
        The linkage in held directions.
    inputs : Inputs
        Distributions of the clearances.
    geometry_sha256 : str
        Hash of the geometry.
    seed : int
        Seed.
    n1, n2, iterations : int
        Repetitions, levels and iterations; the paper's by default.

    Returns
    -------
    BlockStudy
        The study.
    """
    model = response.model
    return BlockStudy(
        model.mechanism,
        model.stroke,
        model.calibration,
        tuple(float(angle) for angle in response.directions),
        response.sense,
        tuple(float(limit) for limit in inputs.limits_in),
        inputs.distribution,
        n1,
        n2,
        iterations,
        seed,
        geometry_sha256,
    )


def compute_block(study: BlockStudy, block: Block) -> BlockSums:
    """Compute one block, in this process or any other.

    Parameters
    ----------
    study : BlockStudy
        The study.
    block : Block
        Which block.

    Returns
    -------
    BlockSums
        Its contribution.
    """
    response, inputs = _built(study)
    levels = _levels(study, block.iteration)
    n, n1 = study.n, study.n1
    within = np.zeros(n)
    total = squares = 0.0
    failed = 0
    wide = np.empty((n, n1 * n1))
    for level in range(block.start, block.stop):
        clearance = inputs.at(middle_of_level(levels[:, level, :], study.n2))
        base = response(clearance)
        total += float(base.sum())
        squares += float((base * base).sum())
        failed += int(np.count_nonzero(~np.isfinite(base)))
        columns = clearance.T
        wide.reshape(n, n1, n1)[:] = columns[:, :, None]
        for i in range(n):
            wide.reshape(n, n1, n1)[i] = columns[i][None, :]
            values = response.by_rows(wide).reshape(n1, n1)
            wide.reshape(n, n1, n1)[i] = columns[i][:, None]
            spread = values - values.mean(axis=1, keepdims=True)
            variance = float(np.einsum("ij,ij->", spread, spread)) / (n1 - 1)
            within[i] += variance
            if not np.isfinite(variance):
                failed += int(np.count_nonzero(~np.isfinite(values)))
    count = (block.stop - block.start) * n1
    return BlockSums(tuple(float(v) for v in within), total, squares, count, count * (n1 * n + 1), failed)


@lru_cache(maxsize=4)
def _built(study: BlockStudy) -> tuple[HeldDirections, Inputs]:
    model = LinkageModel(study.mechanism, study.stroke, study.calibration)
    response = HeldDirections(model, np.array(study.directions), study.sense, compiled=numba_is_installed())
    return response, Inputs(np.array(study.limits_in), study.distribution)


@lru_cache(maxsize=2)
def _levels(study: BlockStudy, iteration: int) -> NDArray[np.int64]:
    stream = np.random.SeedSequence(study.seed, spawn_key=(iteration,))
    return replicated_levels(study.n, study.n1, study.n2, np.random.default_rng(stream))


def total_order_study(
    study: BlockStudy,
    workers: int = 1,
    state: Path | None = None,
    scheduler: Scheduler | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> TotalOrder:
    """Run a total-order study; what was computed before the run or an interruption counts.

    Parameters
    ----------
    study : BlockStudy
        The study.
    workers : int
        Threads of this machine with numba, else processes.
    state : Path, optional
        File that every finished block is added to, and that a later run resumes from.
    scheduler : Scheduler, optional
        A Dask client to compute the blocks with, in place of this machine's cores.
    progress : callable, optional
        Called with the blocks done and their number.

    Returns
    -------
    TotalOrder
        Indices of the completed iterations; after Ctrl-C, of those that were completed.

    Raises
    ------
    UsageError
        If the state file belongs to another study.
    OutputError
        If the state file cannot be written.
    """
    blocks = study.blocks
    done = {} if state is None else _resumed(study, state)
    missing = [block for block in blocks if block not in done]
    runner: Iterator[tuple[Block, BlockSums]]
    if scheduler is not None:
        runner = _on_cluster(study, missing, scheduler)
    elif workers > 1 and len(missing) > 1:
        runner = _on_this_machine(study, missing, workers)
    else:
        runner = ((block, compute_block(study, block)) for block in missing)
    try:
        for block, sums in runner:
            done[block] = sums
            if state is not None:
                _append(state, {"block": _plain(block), "sums": _plain(sums)})
            if progress is not None:
                progress(len(done), len(blocks))
    except KeyboardInterrupt:
        pass
    return _summed(study, done)


def _executor(workers: int) -> Executor:
    if numba_is_installed():
        # The compiled loop runs without the interpreter's lock: threads share its memory.
        return ThreadPoolExecutor(workers)
    # Forking a process that has threads of its own can hang; a fresh interpreter cannot.
    return ProcessPoolExecutor(workers, mp_context=get_context("spawn"))


def _on_this_machine(study: BlockStudy, blocks: list[Block], workers: int) -> Iterator[tuple[Block, BlockSums]]:
    with _executor(workers) as pool:
        waiting: dict[Future[BlockSums], Block] = {}
        queue = iter(blocks)
        try:
            while True:
                while len(waiting) < 2 * workers and (block := next(queue, None)) is not None:
                    waiting[pool.submit(compute_block, study, block)] = block
                if not waiting:
                    return
                finished, _ = wait(waiting, return_when=FIRST_COMPLETED)
                for future in finished:
                    yield waiting.pop(future), future.result()
        finally:
            for future in waiting:
                future.cancel()


def _on_cluster(study: BlockStudy, blocks: list[Block], scheduler: Scheduler) -> Iterator[tuple[Block, BlockSums]]:
    distributed: Any = import_module("distributed")

    waiting = {scheduler.submit(compute_block, study, block, pure=False): block for block in blocks}
    for future in distributed.as_completed(list(waiting)):
        yield waiting[future], future.result()


def _summed(study: BlockStudy, done: dict[Block, BlockSums]) -> TotalOrder:
    """Add up blocks in their order, whoever computed them when."""
    indices = []
    for iteration in range(study.iterations):
        blocks = [block for block in study.blocks if block.iteration == iteration]
        if any(block not in done for block in blocks):
            continue
        within, total, squares, samples = np.zeros(study.n), 0.0, 0.0, 0
        for block in blocks:
            sums = done[block]
            within += sums.within
            total, squares, samples = total + sums.total, squares + sums.squares, samples + sums.samples
        variance = squares / samples - (total / samples) ** 2
        indices.append(within / samples / variance)
    failed = sum(sums.failed for sums in done.values())
    evaluations = sum(sums.evaluations for sums in done.values())
    found = np.array(indices) if indices else np.full((1, study.n), np.nan)
    return TotalOrder(
        found.mean(axis=0),
        found.std(axis=0, ddof=1) if len(indices) > 1 else np.full(study.n, np.nan),
        len(indices),
        evaluations,
        failed,
        len(done),
        len(study.blocks),
        failed_note(failed, evaluations) if failed else "",
    )


def _plain(value: Block | BlockSums) -> dict[str, Any]:
    return {name: getattr(value, name) for name in value.__slots__}


def _append(path: Path, entry: dict[str, Any]) -> None:
    try:
        with path.open("a", encoding="utf-8") as file:
            file.write(json.dumps(entry) + "\n")
    except OSError as error:
        raise OutputError(f"{path}: cannot be written: {error}", "Choose another file.") from error


def _resumed(study: BlockStudy, path: Path) -> dict[Block, BlockSums]:
    """Read finished blocks; a last line that was cut off by an interruption is dropped with its block."""
    if not path.exists() or path.stat().st_size == 0:
        _append(path, {"study": study.key()})
        return {}
    lines = path.read_text(encoding="utf-8").splitlines(keepends=True)
    entries = []
    for line in lines:
        try:
            entries.append(json.loads(line))
        except json.JSONDecodeError:
            break
    if not entries or entries[0].get("study") != study.key():
        raise UsageError(f"{path}: belongs to another study", "Give another file, or delete this one.")
    if len(entries) < len(lines) or not lines[-1].endswith("\n"):
        path.write_text("".join(json.dumps(entry) + "\n" for entry in entries), encoding="utf-8")
    known = set(study.blocks)
    done = {}
    for entry in entries[1:]:
        block = Block(**entry["block"])
        if block in known:
            sums = entry["sums"]
            done[block] = BlockSums(**{**sums, "within": tuple(sums["within"])})
    return done
