"""The console command ``mlg``: each command parses, calls one workflow and shows the result."""

from __future__ import annotations

import atexit
import gc
import signal
import sys

# New objects after which the collector looks for cycles: a command makes many that stay, and ends
# soon. A large fleet's second call takes a tenth longer with Python's own 700. [1]
_NEW_OBJECTS = 50_000


def main() -> None:
    """Run the command; a process that only judges rows loads this module and nothing of it."""
    from mlg_troubleshoot.cli.app import app
    from mlg_troubleshoot.cli.output import prepare_streams

    gc.set_threshold(_NEW_OBJECTS)
    # On its way out Python looks through all that is left: half a second that somebody waits.
    atexit.register(gc.freeze)
    # What is half written goes as it does with Ctrl-C: the exit code is that of a shell.
    signal.signal(signal.SIGTERM, lambda number, _frame: sys.exit(128 + number))
    prepare_streams()
    app(prog_name="mlg")


__all__ = [
    "main",
]
