"""Where results go: stdout, stderr, and what a reader that went away means."""

from __future__ import annotations

from collections.abc import Iterable

import typer
from rich.console import Console

from mlg_troubleshoot.cli.boundary import abandon_stdout

# A file or a pipe has no width; reports in text are set for this one.
_WIDTH_ELSEWHERE = 110


class ResultConsole(Console):
    """A console whose closed pipe ends the printing and not the run: reports and exit codes still follow."""

    def on_broken_pipe(self) -> None:
        """Stop printing."""
        self.quiet = True
        abandon_stdout()


def console(*, to_stderr: bool = False) -> Console:
    """Return a console for stdout or stderr, as wide as the terminal.

    Parameters
    ----------
    to_stderr : bool
        True for messages, False for results.

    Returns
    -------
    Console
        The console.
    """
    found = ResultConsole(stderr=to_stderr, highlight=False)
    if found.is_terminal:
        return found
    return ResultConsole(stderr=to_stderr, highlight=False, width=_WIDTH_ELSEWHERE)


def write(text: str) -> None:
    """Write a result to stdout as it stands.

    Parameters
    ----------
    text : str
        The result.
    """
    try:
        typer.echo(text)
    except BrokenPipeError:
        abandon_stdout()


def write_pieces(pieces: Iterable[str]) -> None:
    """Write a long result to stdout piece by piece; a reader that goes away ends the writing.

    Parameters
    ----------
    pieces : iterable of str
        The result.
    """
    try:
        for piece in pieces:
            typer.echo(piece, nl=False)
    except BrokenPipeError:
        abandon_stdout()
