"""One task over many parts: here, on several cores of this machine, or on a Dask cluster.

What a part gives depends on nothing but the task and the part, so that results are the same
whoever computes them, and in whatever order.
"""

from __future__ import annotations

import pickle
import signal
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import lru_cache, partial
from importlib import import_module
from itertools import chain, islice
from tempfile import SpooledTemporaryFile
from typing import TYPE_CHECKING, Any, Generic, Self, TypeVar
from weakref import finalize

if TYPE_CHECKING:
    from concurrent.futures import Executor, Future

# Told how much is done, and of how much if that is known; or of which stage of the work.
Progress = Callable[[int, int | None], None]
StageProgress = Callable[[str, int, int | None], None]

_Item = TypeVar("_Item")
_Part = TypeVar("_Part")
_Found = TypeVar("_Found")

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


class Processes:
    """At most so many processes of this machine. They start with the first parts, or before while
    parts are still being made: each takes as long to load this program as to judge some hundred
    rows.
    """

    def __init__(self, count: int) -> None:
        self.count = count
        self._pool: Executor | None = None
        self._ahead = 0

    def start(self, count: int, module: str) -> None:
        """Start as many as there will be parts at least, and load a module in each."""
        while self.count > 1 and self._ahead < min(count, self.count):
            self.submit(import_module, module)
            self._ahead += 1

    def submit(self, call: Callable[..., Any], *given: Any) -> Future[Any]:
        if self._pool is None:
            # Not loaded by what never starts one: a check of one gear.
            from concurrent.futures import ProcessPoolExecutor
            from multiprocessing import get_context

            # Forking a process that has threads of its own can hang; a fresh interpreter cannot.
            ignored = signal.SIGINT, signal.SIG_IGN
            self._pool = ProcessPoolExecutor(
                self.count, get_context("spawn"), initializer=signal.signal, initargs=ignored
            )
        # Ctrl-C reaches every process of the terminal: the one that asked ends the others. What
        # starts here inherits that it is blocked.
        if not hasattr(signal, "pthread_sigmask"):
            return self._pool.submit(call, *given)
        before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        try:
            return self._pool.submit(call, *given)
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        if self._pool is None:
            return
        if kind is not None:
            from multiprocessing import active_children

            for child in active_children():
                # Interrupted: the parts that are being computed are not needed.
                child.terminate()
        self._pool.shutdown(cancel_futures=True)


def spread(
    task: Callable[[_Part], _Found],
    parts: Iterable[_Part],
    workers: int | Processes = 1,
    scheduler: Any = None,
    *,
    threads: bool = False,
) -> Iterator[_Found]:
    """Compute each part; the results are handed out in the order of the parts, which are taken as
    they are needed.

    workers: cores of this machine, or its processes, unless `scheduler`, a Dask client, computes.
    threads: the task releases the interpreter's lock, so that threads do, which share its memory.
    """
    each = iter(parts)
    first = list(islice(each, 2))
    parts = chain(first, each)
    count = workers.count if isinstance(workers, Processes) else workers
    if scheduler is not None:
        yield from _on_cluster(task, parts, scheduler)
    elif count <= 1 or len(first) <= 1:
        yield from map(task, parts)
    elif threads:
        yield from _in_threads(task, parts, count)
    elif isinstance(workers, Processes):
        yield from _in_processes(task, parts, workers)
    else:
        with Processes(workers) as processes:
            yield from _in_processes(task, parts, processes)


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


def _in_threads(
    task: Callable[[_Part], _Found], parts: Iterable[_Part], count: int
) -> Iterator[_Found]:
    from concurrent.futures import ThreadPoolExecutor

    pool = ThreadPoolExecutor(count)
    try:
        yield from _in_order((pool.submit(task, part) for part in parts), _AHEAD * count, deque())
    finally:
        pool.shutdown(cancel_futures=True)


def _in_processes(
    task: Callable[[_Part], _Found], parts: Iterable[_Part], processes: Processes
) -> Iterator[_Found]:
    called = partial(_call_packed, pickle.dumps(task))
    asked = (processes.submit(called, part) for part in parts)
    yield from _in_order(asked, _AHEAD * processes.count, deque())


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


def _call_packed(task: bytes, part: Any) -> Any:
    return _unpacked(task)(part)


@lru_cache(maxsize=1)
def _unpacked(task: bytes) -> Callable[[Any], Any]:
    """The task of a process: what it has worked out of a gear serves its next part."""
    found: Callable[[Any], Any] = pickle.loads(task)
    return found
