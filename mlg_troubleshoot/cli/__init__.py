"""The console command ``mlg``: each command parses, calls one workflow and shows the result."""

from __future__ import annotations


def main() -> None:
    """Run the command; a process that only judges rows loads this module and nothing of it."""
    from mlg_troubleshoot.cli.app import app
    from mlg_troubleshoot.cli.output import prepare_streams

    prepare_streams()
    app(prog_name="mlg")


__all__ = ["main", "remembered"]
