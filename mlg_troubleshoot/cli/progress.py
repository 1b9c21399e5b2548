"""A progress bar on stderr for long work; silent without a terminal."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from mlg_troubleshoot.cli.output import is_plain

Advance = Callable[[str, int, int | None], None]

# A bar that would be gone before it is read is not shown. [s]
_WORTH_SHOWING_AFTER_S = 0.5


@contextmanager
def stages(*, quiet: bool) -> Iterator[Advance]:
    """Show how far each stage of a run is, once it has run long enough to be worth it."""
    if quiet or is_plain() or not sys.stderr.isatty():
        yield lambda _name, _done, _total: None
        return
    start = time.monotonic()
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        TaskID,
        TextColumn,
        TimeRemainingColumn,
    )

    bar = Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeRemainingColumn(),
        console=Console(stderr=True),
        transient=True,
    )
    tasks: dict[str, TaskID] = {}

    def advance(name: str, done: int, total: int | None) -> None:
        if not tasks:
            if time.monotonic() - start < _WORTH_SHOWING_AFTER_S:
                return
            bar.start()
        if name not in tasks:
            tasks[name] = bar.add_task(name, total=total)
        bar.update(tasks[name], completed=done, total=total)

    try:
        yield advance
    finally:
        if tasks:
            bar.stop()
