"""Around every command: errors become messages and exit codes."""

from __future__ import annotations

import errno
import os
import sys
import traceback
from types import TracebackType

import typer

from mlg_troubleshoot.cli.output import abandon_stdout, say
from mlg_troubleshoot.errors import (
    ExitCode,
    InconclusiveDataError,
    OutputError,
    TroubleshootError,
)

# What helps where the system refuses something.
_MORE_FILES = "Let this program open more files: ulimit -n 256"
_REMEDY = "Make room, or write to another place that you may read and write."
# Some releases of typer carry their own click: what it says about usage is found through a name
# that typer exports.
_UsageMessage: type[typer.BadParameter] = typer.BadParameter.__mro__[2]


class Boundary:
    """A context that turns an exception into a message on stderr and an exit code."""

    def __enter__(self) -> Boundary:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if error is None or isinstance(error, SystemExit):
            return
        if isinstance(error, typer.Exit):
            raise SystemExit(error.exit_code) from None
        if isinstance(error, (KeyboardInterrupt, typer.Abort)):
            # A prompt that was interrupted has said already how to go on.
            if type(error) in (KeyboardInterrupt, typer.Abort):
                say("\nInterrupted.")
            raise SystemExit(ExitCode.INTERRUPTED) from None
        if isinstance(error, BrokenPipeError):
            # Results survive a closed pipe (see output.py); what else was cut short was not
            # finished.
            abandon_stdout()
            raise SystemExit(ExitCode.NOT_WRITTEN) from None
        if isinstance(error, Exception):
            code = _explain(error)
            if code == ExitCode.INTERNAL and os.environ.get("MLG_DEBUG"):
                traceback.print_exception(kind, error, trace)
            raise SystemExit(code) from None


def _explain(error: Exception) -> ExitCode:
    if isinstance(error, TroubleshootError):
        say(f"Error: {error.message}" + (f"\nWhat to do: {error.remedy}" if error.remedy else ""))
        if isinstance(error, OutputError):
            return ExitCode.NOT_WRITTEN
        if isinstance(error, InconclusiveDataError):
            return ExitCode.NO_CONCLUSION
        return ExitCode.USAGE
    if isinstance(error, _UsageMessage):
        command = error.ctx.command_path if error.ctx else "mlg"
        say(f"Error: {error.format_message()}\nWhat to do: See {command} --help.")
        return ExitCode.USAGE
    if isinstance(error, OSError) and error.errno is not None:
        say(f"Error: {error.filename or 'the output'} cannot be written: {error.strerror}")
        say(f"What to do: {_MORE_FILES if error.errno == errno.EMFILE else _REMEDY}")
        try:
            # What is still to be written to stdout is written now or dropped: the interpreter must
            # not fail on it.
            sys.stdout.flush()
        except OSError:
            abandon_stdout()
        return ExitCode.NOT_WRITTEN
    say(
        f"Internal error: {type(error).__name__}: {error}\nWhat to do: this is a defect of the"
        " program, not of your input. Run again with MLG_DEBUG=1 and send the output to the"
        " maintainers."
    )
    return ExitCode.INTERNAL
