"""The edge of the program: errors become messages and exit codes."""

from __future__ import annotations

import errno
import os
import sys
import traceback
from types import TracebackType

import typer

from mlg_troubleshoot.errors import InconclusiveDataError, InputFileError, OutputError, TroubleshootError

USAGE, NOTHING_JUDGED, OUTPUT, INTERNAL, INTERRUPTED = 2, 3, 5, 70, 130
_CANNOT_WRITE = {errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO, errno.EROFS}


def abandon_stdout() -> None:
    """Drop what is still to be written to stdout: the reader of the pipe went away, the work goes on."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _settle_stdout() -> None:
    """Write what is still to be written to stdout, or drop it: the interpreter must not fail on it at the end."""
    try:
        sys.stdout.flush()
    except OSError:
        abandon_stdout()


class Boundary:
    """A context that turns what goes wrong inside into a message on stderr and the exit code of the contract.

    Usage 2 · nothing could be judged or concluded 3 · output could not be written 5 · internal error 70 ·
    interrupted 130.
    """

    def __enter__(self) -> Boundary:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if error is None or isinstance(error, (typer.Exit, typer.Abort, SystemExit)):
            return
        if isinstance(error, KeyboardInterrupt):
            # A prompt that was interrupted has said already how to go on.
            if type(error) is KeyboardInterrupt:
                typer.echo("\nInterrupted.", err=True)
            raise typer.Exit(INTERRUPTED) from None
        if isinstance(error, BrokenPipeError):
            # Results survive a closed pipe (see output.py); what else was cut short was not finished.
            abandon_stdout()
            raise typer.Exit(OUTPUT) from None
        if isinstance(error, OSError) and error.errno in _CANNOT_WRITE:
            typer.echo(f"Error: {error.filename or 'the output'} cannot be written: {error.strerror}", err=True)
            typer.echo("What to do: Make room, or write to another place.", err=True)
            _settle_stdout()
            raise typer.Exit(OUTPUT) from None
        if isinstance(error, TroubleshootError):
            typer.echo(f"Error: {error.message}", err=True)
            if error.remedy:
                typer.echo(f"What to do: {error.remedy}", err=True)
            raise typer.Exit(_code(error)) from None
        if isinstance(error, Exception):
            if os.environ.get("MLG_DEBUG"):
                traceback.print_exception(kind, error, trace)
            typer.echo(
                f"Internal error: {type(error).__name__}: {error}\n"
                "What to do: this is a defect of the program, not of your input. Run again with MLG_DEBUG=1 and "
                "send the output to the maintainers.",
                err=True,
            )
            raise typer.Exit(INTERNAL) from None


def _code(error: TroubleshootError) -> int:
    if isinstance(error, OutputError):
        return OUTPUT
    if isinstance(error, (InputFileError, InconclusiveDataError)):
        return NOTHING_JUDGED
    return USAGE
