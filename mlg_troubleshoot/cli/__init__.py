"""The console command ``mlg``: each command parses, calls one workflow and shows the result."""

from __future__ import annotations

from mlg_troubleshoot.cli.app import app
from mlg_troubleshoot.cli.output import prepare_streams


def main() -> None:
    prepare_streams()
    app(prog_name="mlg")


__all__ = ["app", "main", "remembered"]
