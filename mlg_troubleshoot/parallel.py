"""One function over many blocks: here, or by any executor of :mod:`concurrent.futures`.

What a block gives depends on nothing but the function and the block, so that results are the same
whoever computes them, and in whatever order.
"""

from __future__ import annotations

import pickle
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from functools import lru_cache, partial
from itertools import islice
from typing import TYPE_CHECKING, Any, TypeVar

if TYPE_CHECKING:
    from concurrent.futures import Executor

# Told how much is done, and of how much if that is known; or of which stage of the work.
Progress = Callable[[int, int | None], None]
StageProgress = Callable[[str, int, int | None], None]

_Block = TypeVar("_Block")
_Result = TypeVar("_Result")

# Blocks that an executor holds at once: so many cores are busy at most. [1]
_AHEAD = 32


def map_blocks(
    function: Callable[[_Block], _Result],
    blocks: Iterable[_Block],
    executor: Executor | None = None,
) -> Iterator[_Result]:
    """Compute each block; results come in the order of the blocks, which are taken as needed.

    executor: of processes, of a Dask cluster (``client.get_executor()``), of Ray; None computes
    here.
    """
    if executor is None:
        yield from map(function, blocks)
        return
    call = partial(_call, pickle.dumps(function))
    futures = (executor.submit(call, block) for block in blocks)
    waiting = deque(islice(futures, _AHEAD))
    # A cancelled future would end the thread that tells of processes that are gone.
    while waiting:
        result = waiting.popleft().result()
        waiting.extend(islice(futures, 1))
        yield result


def _call(function: bytes, block: Any) -> Any:
    return _unpack(function)(block)


@lru_cache(maxsize=1)
def _unpack(function: bytes) -> Callable[[Any], Any]:
    """What a worker derived from the gear of a function serves its next block."""
    unpacked: Callable[[Any], Any] = pickle.loads(function)
    return unpacked
