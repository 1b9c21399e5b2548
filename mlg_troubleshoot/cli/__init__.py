"""The console command ``mlg``: each command parses, calls one workflow and shows the result."""

from __future__ import annotations

from mlg_troubleshoot.cli.app import app


def main() -> None:
    """Run the console command."""
    app(prog_name="mlg")


__all__ = ["app", "main"]
