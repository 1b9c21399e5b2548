"""The commands of ``mlg``. Only the one that is asked for is imported, and nothing heavy before it
runs.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from importlib import import_module
from typing import Any

import typer
from typer.core import TyperGroup

from mlg_troubleshoot.cli import options
from mlg_troubleshoot.cli.boundary import Boundary
from mlg_troubleshoot.cli.gone import refuse_gone
from mlg_troubleshoot.errors import ExitCode

# In the order of the help; each stands in the module of its name, as `app`.
_COMMANDS = {
    "check": "a gear, or tables: verdict, joints and what to do next",
    "template": "an empty workbook, or a form to fill in by hand",
    "history": "the log of each gear; repairs and corrections",
    "fleet": "the gears that need attention, first things first",
    "diagnose": "measured against predicted: what is wrong, by name",
    "study": "the sensitivity and amplification indices again",
    "gear": "the model in use, and every number of the paper",
}
_HELP = "\n".join(
    [
        "Start: mlg check            asks for one gear, joint by joint",
        "       mlg check FILE       judges a table",
        "",
        *(f"  {name:<10}{what}" for name, what in _COMMANDS.items()),
        "",
        "Options of a command: mlg help COMMAND. Version: mlg --version.",
        "Troubleshooting aid, not maintenance data: the manual decides.",
    ]
)
_ALL = "--help-all"


def _understood(given: list[str]) -> list[str]:
    """The command line with what else people type for help and reports."""
    if given[:1] == ["help"]:
        return [*given[1:], "--help"]
    if given[:1] == ["report"]:
        # The last folder that is named counts.
        return ["history", "--report", "report", *given[1:]]
    return given


class CommandGroup(TyperGroup):
    """All commands behind one boundary; without a command the help is shown."""

    shows_all = False

    def main(self, args: Sequence[str] | None = None, *more: Any, **named: Any) -> Any:
        given = list(sys.argv[1:] if args is None else args)
        with Boundary():
            if "SOURCE_DATE_EPOCH" in os.environ:
                from mlg_troubleshoot.reporting.html import moment_of_report

                # NumPy reads it as well, and does not say what is wrong with it.
                moment_of_report()
            refuse_gone(given)
            given = _understood(given)
            self.shows_all = _ALL in given
            given = ["--help" if each == _ALL else each for each in given]
            code = super().main(given or ["--help"], *more, **{**named, "standalone_mode": False})
            raise SystemExit(code if given else ExitCode.USAGE)

    def get_help(self, _ctx: Any) -> str:
        return _HELP

    def list_commands(self, _ctx: Any) -> list[str]:
        return [*_COMMANDS]

    def get_command(self, ctx: Any, cmd_name: str) -> Any:
        # One that is not known is compared with all of them.
        for name in (cmd_name,) if cmd_name in _COMMANDS else _COMMANDS:
            module = import_module(f"mlg_troubleshoot.cli.{name}")
            found: Any = self.commands.get(name) or typer.main.get_command(module.app)
            common = getattr(module, "COMMON", ())
            for option in found.params if common else ():
                option.hidden = not self.shows_all and option.name not in common
            self.commands[name] = found
        return super().get_command(ctx, cmd_name)

    def invoke(self, ctx: Any) -> Any:
        """Also run the command behind the boundary: on its way out typer says nothing of an
        interrupt.
        """
        with Boundary():
            return super().invoke(ctx)


app = typer.Typer(
    name="mlg",
    cls=CommandGroup,
    context_settings=options.HELP,
    pretty_exceptions_enable=False,
    add_completion=False,
    rich_markup_mode=None,
)


@app.callback()
def program(_version: options.Version = False) -> None:
    """Options of every command."""
