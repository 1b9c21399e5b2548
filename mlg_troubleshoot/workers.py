"""Processes of this machine that compute blocks.

They import nothing from the current folder, which holds files of others, and end with the process
that started them, whatever ends that.
"""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ProcessPoolExecutor
from contextlib import contextmanager
from multiprocessing import get_context
from multiprocessing.connection import Connection, wait
from threading import Thread
from typing import Any

from mlg_troubleshoot.errors import UsageError

_SAFE_PATH = "PYTHONSAFEPATH"


class WorkerProcesses(ProcessPoolExecutor):
    """At most so many processes, started with the first blocks."""

    def __init__(self, count: int) -> None:
        if sys.flags.ignore_environment and not sys.flags.safe_path:
            raise UsageError(
                "python -E starts processes that import files of the current folder",
                "Use python -I, or one worker.",
            )
        # Forking a process that has threads of its own can hang; a fresh interpreter cannot.
        context = get_context("spawn")
        watched, self._held = context.Pipe(duplex=False)
        with _safe_start():
            super().__init__(count, context, initializer=_begin, initargs=(watched,))

    def submit(self, call: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        with _safe_start():
            return super().submit(call, *args, **kwargs)

    def __exit__(self, kind: type[BaseException] | None, *error: Any) -> bool | None:
        if kind is not None:
            # Interrupted: what is being computed is not needed.
            self._held.close()
        return super().__exit__(kind, *error)


@contextmanager
def _safe_start() -> Iterator[None]:
    """What is started in it leaves the current folder off its module path, and Ctrl-C, which
    reaches every process of a terminal, to the one that started it.
    """
    before = os.environ.get(_SAFE_PATH)
    os.environ[_SAFE_PATH] = "1"
    can_block = hasattr(signal, "pthread_sigmask")
    mask = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT}) if can_block else set()
    try:
        yield
    finally:
        if can_block:
            signal.pthread_sigmask(signal.SIG_SETMASK, mask)
        if before is None:
            del os.environ[_SAFE_PATH]
        else:
            os.environ[_SAFE_PATH] = before


def _begin(watched: Connection) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    Thread(target=_end_with, args=(watched,), daemon=True).start()


def _end_with(watched: Connection) -> None:
    """The other end of the pipe closes when its process closes it, or ends, or is killed."""
    wait([watched])
    os._exit(1)
