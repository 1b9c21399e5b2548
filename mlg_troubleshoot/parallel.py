"""One task over many parts: here, on several cores of this machine, or on a Dask cluster.

What a part gives depends on nothing but the task and the part, so that results are the same
whoever computes them, and in whatever order.
"""

from __future__ import annotations

import signal
from collections.abc import Callable, Iterator, Sequence
from importlib import import_module
from typing import Any, TypeVar

_Part = TypeVar("_Part")
_Found = TypeVar("_Found")

# The task of a process of the pool: it travels there once, not with every part.
_held: list[Callable[[Any], Any]] = []


def spread(
    task: Callable[[_Part], _Found],
    parts: Sequence[_Part],
    workers: int = 1,
    scheduler: Any = None,
    *,
    threads: bool = False,
) -> Iterator[tuple[int, _Found]]:
    """Compute each part; place and result of each are handed out as they come.

    workers: cores of this machine, unless `scheduler`, a Dask client, computes. threads: the task
    releases the interpreter's lock, so that threads do, which share its memory.
    """
    if scheduler is not None:
        yield from _on_cluster(task, parts, scheduler)
    elif workers > 1 and len(parts) > 1:
        yield from _on_this_machine(task, parts, min(workers, len(parts)), threads)
    else:
        yield from ((k, task(part)) for k, part in enumerate(parts))


def _on_cluster(
    task: Callable[[_Part], _Found], parts: Sequence[_Part], client: Any
) -> Iterator[tuple[int, _Found]]:
    distributed: Any = import_module("distributed")
    held = client.scatter(task, broadcast=True, hash=False)
    waiting = {client.submit(_called, held, part, pure=False): k for k, part in enumerate(parts)}
    try:
        for future in distributed.as_completed(list(waiting)):
            yield waiting.pop(future), future.result()
    finally:
        client.cancel(list(waiting))


def _on_this_machine(
    task: Callable[[_Part], _Found], parts: Sequence[_Part], workers: int, threads: bool
) -> Iterator[tuple[int, _Found]]:
    # Not loaded by what never starts a pool: a check of one gear.
    from concurrent.futures import (
        Executor,
        Future,
        ProcessPoolExecutor,
        ThreadPoolExecutor,
        as_completed,
    )
    from multiprocessing import active_children, get_context

    pool: Executor
    if threads:
        pool = ThreadPoolExecutor(workers)
    else:
        # Forking a process that has threads of its own can hang; a fresh interpreter cannot.
        pool = ProcessPoolExecutor(
            workers, mp_context=get_context("spawn"), initializer=_hold, initargs=(task,)
        )
    asked: Callable[[Any], Any] = task if threads else _of_held
    waiting: dict[Future[Any], int] = {}
    try:
        waiting.update((pool.submit(asked, part), k) for k, part in enumerate(parts))
        for future in as_completed(list(waiting)):
            found = future.result()
            yield waiting.pop(future), found
    finally:
        for child in active_children() if waiting and not threads else ():
            # Interrupted: nobody waits for the parts that are being computed.
            child.terminate()
        pool.shutdown(cancel_futures=True)


def _called(task: Callable[[_Part], _Found], part: _Part) -> _Found:
    return task(part)


def _hold(task: Callable[[Any], Any]) -> None:
    # Ctrl-C reaches every process of the terminal: the one that asked ends the others.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    _held[:] = [task]


def _of_held(part: Any) -> Any:
    return _held[0](part)
