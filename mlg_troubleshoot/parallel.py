"""One task over many parts: here, on several cores of this machine, or on a Dask cluster.

What a part gives depends on nothing but the task and the part, so that results are the same
whoever computes them, and in whatever order.
"""

from __future__ import annotations

import pickle
import signal
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import chain, islice
from tempfile import SpooledTemporaryFile
from typing import Any, Generic, TypeVar
from weakref import finalize

_Item = TypeVar("_Item")
_Part = TypeVar("_Part")
_Found = TypeVar("_Found")

# The task of a process of the pool: it travels there once, not with every part.
_held: list[Callable[[Any], Any]] = []
# Parts that are handed out to each process before one comes back: it never waits. [1]
_AHEAD = 2
# What is shorter stays in memory. [bytes]
_IN_MEMORY = 1_000_000


class Blocks(Generic[_Item]):
    """A long list that waits on disk in packed blocks: what is at work takes memory, nothing
    else.
    """

    def __init__(self) -> None:
        self._file = SpooledTemporaryFile(_IN_MEMORY)  # noqa: SIM115 - closed below
        finalize(self, self._file.close)
        self._sizes: list[int] = []
        self._count = 0

    def extend(self, block: Sequence[_Item]) -> None:
        """Append a block."""
        self.add(pickle.dumps(block), len(block))

    def add(self, block: bytes, count: int) -> None:
        """Append a block of so many items that is packed already."""
        self._file.seek(sum(self._sizes))
        self._file.write(block)
        self._sizes.append(len(block))
        self._count += count

    def blocks(self) -> Iterator[bytes]:
        at = 0
        for size in self._sizes:
            self._file.seek(at)
            yield self._file.read(size)
            at += size

    def __iter__(self) -> Iterator[_Item]:
        for block in self.blocks():
            yield from pickle.loads(block)

    def __len__(self) -> int:
        return self._count


def packed(make: Callable[[_Part], Sequence[Any]], part: _Part) -> tuple[bytes, int]:
    """What is made of a part as a block of a long list, and how many items it has."""
    made = make(part)
    return pickle.dumps(made), len(made)


def spread(
    task: Callable[[_Part], _Found],
    parts: Iterable[_Part],
    workers: int = 1,
    scheduler: Any = None,
    *,
    threads: bool = False,
) -> Iterator[_Found]:
    """Compute each part; the results are handed out in the order of the parts, which are taken as
    they are needed.

    workers: cores of this machine, unless `scheduler`, a Dask client, computes. threads: the task
    releases the interpreter's lock, so that threads do, which share its memory.
    """
    each = iter(parts)
    first = list(islice(each, 2))
    parts = chain(first, each)
    if scheduler is not None:
        yield from _on_cluster(task, parts, scheduler)
    elif workers > 1 and len(first) > 1:
        yield from _on_this_machine(task, parts, workers, threads)
    else:
        yield from map(task, parts)


def _on_cluster(
    task: Callable[[_Part], _Found], parts: Iterable[_Part], client: Any
) -> Iterator[_Found]:
    held = client.scatter(task, broadcast=True, hash=False)
    asked = (client.submit(_called, held, part, pure=False) for part in parts)
    waiting: deque[Any] = deque()
    try:
        yield from _in_order(asked, _AHEAD * max(1, sum(client.nthreads().values())), waiting)
    finally:
        client.cancel(list(waiting))


def _on_this_machine(
    task: Callable[[_Part], _Found], parts: Iterable[_Part], workers: int, threads: bool
) -> Iterator[_Found]:
    # Not loaded by what never starts a pool: a check of one gear.
    from concurrent.futures import Executor, Future, ProcessPoolExecutor, ThreadPoolExecutor
    from multiprocessing import active_children, get_context

    pool: Executor
    if threads:
        pool = ThreadPoolExecutor(workers)
    else:
        # Forking a process that has threads of its own can hang; a fresh interpreter cannot.
        pool = ProcessPoolExecutor(
            workers, mp_context=get_context("spawn"), initializer=_hold, initargs=(task,)
        )
    called: Callable[[Any], Any] = task if threads else _of_held
    asked = (pool.submit(called, part) for part in parts)
    waiting: deque[Future[Any]] = deque()
    try:
        yield from _in_order(asked, _AHEAD * workers, waiting)
    finally:
        for child in active_children() if waiting and not threads else ():
            # Interrupted: the parts that are being computed are not needed.
            child.terminate()
        pool.shutdown(cancel_futures=True)


def _in_order(asked: Iterator[Any], ahead: int, waiting: deque[Any]) -> Iterator[Any]:
    """Results of what is asked for, in its order; those that are still computed are waiting."""
    waiting.extend(islice(asked, ahead))
    while waiting:
        found = waiting[0].result()
        waiting.popleft()
        waiting.extend(islice(asked, 1))
        yield found


def _called(task: Callable[[_Part], _Found], part: _Part) -> _Found:
    return task(part)


def _hold(task: Callable[[Any], Any]) -> None:
    # Ctrl-C reaches every process of the terminal: the one that asked ends the others.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    _held[:] = [task]


def _of_held(part: Any) -> Any:
    return _held[0](part)
