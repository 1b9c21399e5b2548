"""The commands of ``mlg``. Only the one that is asked for is imported, and nothing heavy before it
runs.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from importlib import import_module
from inspect import cleandoc
from types import ModuleType, SimpleNamespace
from typing import Any, cast

import typer
from typer.core import TyperGroup

from mlg_troubleshoot.cli import options
from mlg_troubleshoot.cli.boundary import Boundary
from mlg_troubleshoot.cli.gone import refuse_gone
from mlg_troubleshoot.errors import ExitCode

# In the order of the help; each stands in the module of its name, as `app`.
_COMMANDS = ("check", "diagnose", "template", "fleet", "study", "history", "gear")
_ASK_FOR_HELP = frozenset(("--help", "-h"))


def _load_help_pages() -> None:
    """Load what typer lays out help with, but not the Markdown and the tracebacks that it can also
    show and this program does not: they take as long as the rest.
    """
    unused = SimpleNamespace(Markdown=None, Traceback=None)
    names = {"rich.markdown", "rich.traceback"} - sys.modules.keys()
    sys.modules.update(dict.fromkeys(names, cast(ModuleType, unused)))
    import_module("typer.rich_utils")
    for name in names:
        del sys.modules[name]


def _unwrap_help(command: Any) -> None:
    """Leave the line breaks within a paragraph to the screen: typer keeps those of a docstring."""
    paragraphs = cleandoc(command.help or "").split("\n\n")
    command.help = "\n\n".join(each.replace("\n", " ") for each in paragraphs)
    for each in getattr(command, "commands", {}).values():
        _unwrap_help(each)


class CommandGroup(TyperGroup):
    """All commands behind one boundary; without a command the help is shown."""

    def main(self, args: Sequence[str] | None = None, *more: Any, **named: Any) -> Any:
        given = list(sys.argv[1:] if args is None else args)
        if not given or _ASK_FOR_HELP.intersection(given):
            _load_help_pages()
            _unwrap_help(self)
        with Boundary():
            refuse_gone(given)
            code = super().main(given or ["--help"], *more, **{**named, "standalone_mode": False})
            raise SystemExit(code if given else ExitCode.USAGE)

    def list_commands(self, _ctx: Any) -> list[str]:
        return [*_COMMANDS]

    def get_command(self, ctx: Any, cmd_name: str) -> Any:
        # One that is not known is compared with all of them.
        for name in (cmd_name,) if cmd_name in _COMMANDS else _COMMANDS:
            if name not in self.commands:
                module = import_module(f"mlg_troubleshoot.cli.{name}")
                self.commands[name] = typer.main.get_command(module.app)
                _unwrap_help(self.commands[name])
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
    help=(
        "Do worn joints push the reversing-valve plunger of a main landing gear outside its margin?"
        " Which joint next? Where is the model wrong?\n\nTroubleshooting aid, not maintenance data:"
        " it does not replace the maintenance manual."
    ),
    context_settings={"help_option_names": ["-h", "--help"]},
    pretty_exceptions_enable=False,
    add_completion=False,
    rich_markup_mode="rich",
)


@app.callback()
def program(_version: options.Version = False) -> None:
    """Options of every command."""
