"""The one place where files are written: whole or not at all, never over an input, never over a device."""

from __future__ import annotations

import os
import stat
import tempfile
from collections.abc import Iterable, Sequence
from pathlib import Path

from mlg_troubleshoot.errors import OutputError, UsageError

Field = str | float | int | bool | None
# The wide forms of the signs start a formula in some language versions of Excel.
_STARTS_FORMULA = ("=", "+", "-", "@", "\t", "\r", "\n", "＝", "＋", "－", "＠")


def write_bytes(path: str | Path, data: bytes) -> None:
    """Write a file so that it appears whole or not at all.

    A link is followed, so that it stays one. A file that is replaced keeps its mode; a new one gets what the umask
    leaves. Folders that are missing are made. Anything that is no regular file is refused with an `OutputError`.
    """
    target = Path(os.path.realpath(path))
    scratch = None
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        mode = _mode_of(target, path)
        handle, scratch = tempfile.mkstemp(prefix=".mlg-", suffix=".part", dir=target.parent)
        with os.fdopen(handle, "wb") as file:
            file.write(data)
        Path(scratch).chmod(mode)
        Path(scratch).replace(target)
        scratch = None
    except OSError as error:
        raise OutputError(
            f"{path} cannot be written: {error.strerror or error}",
            "Check the folder, the permissions and the free space, or write to another place.",
        ) from error
    finally:
        if scratch is not None:
            Path(scratch).unlink(missing_ok=True)


def write_text(path: str | Path, text: str) -> None:
    """Write a text in UTF-8 as `write_bytes` does."""
    write_bytes(path, text.encode("utf-8"))


def write_csv(path: str | Path, header: Sequence[str], rows: Iterable[Sequence[Field]]) -> None:
    """Write a table as CSV in UTF-8, in which no text can become a formula."""
    write_text(path, csv_text(header, rows))


def csv_text(header: Sequence[str], rows: Iterable[Sequence[Field]]) -> str:
    """Return a table as CSV in which no text can become a formula, whatever separator a program takes it to have."""
    lines = [[_quoted(harmless(value)) for value in row] for row in (header, *rows)]
    return "".join(",".join(line) + "\n" for line in lines)


def _quoted(field: str) -> str:
    """A field that stays one whichever separator a program takes the file to have."""
    return '"' + field.replace('"', '""') + '"' if any(sign in field for sign in ',;\t"\r\n') else field


def harmless(value: Field) -> str:
    """Return a value as a CSV field that a spreadsheet program takes as it is.

    Numbers are unchanged; a text that would become a formula gets an apostrophe in front.
    """
    if value is None:
        return ""
    if isinstance(value, bool):
        return "TRUE" if value else "FALSE"
    if isinstance(value, int | float):
        return repr(value) if isinstance(value, int) else repr(float(value))
    return f"'{value}" if value.lstrip(" ").startswith(_STARTS_FORMULA) else value


def refuse_inputs_as_outputs(inputs: Iterable[str | Path], outputs: Iterable[tuple[str, str | Path | None]]) -> None:
    """Refuse an output that is one of the inputs, before anything is read.

    Inputs are files, or folders of which every file counts; outputs are pairs of the option and what it was given.
    The same file through a link counts, too. Raises `UsageError` (exit code 2).
    """
    files = [file for given in inputs for file in _files_of(Path(given))]
    known = {_identity(file): file for file in files}
    for option, output in outputs:
        if output is None:
            continue
        same = known.get(_identity(Path(output)))
        if same is not None:
            raise UsageError(
                f"{option} {output} is one of the inputs ({same}): nothing was read and nothing written",
                f"Give {option} another name: what was measured is not replaced.",
            )


def _mode_of(target: Path, asked: str | Path) -> int:
    """The mode that the file has or, if it is new, what the umask leaves of rw-rw-rw-."""
    try:
        found = target.stat()
    except FileNotFoundError:
        umask = os.umask(0)
        os.umask(umask)
        return 0o666 & ~umask
    if not stat.S_ISREG(found.st_mode):
        kind = "a folder" if stat.S_ISDIR(found.st_mode) else "a device, a pipe or a socket"
        raise OutputError(f"{asked} is {kind}, not a file: nothing was written", "Give the name of a file.")
    return stat.S_IMODE(found.st_mode)


def _files_of(path: Path) -> list[Path]:
    return [file for file in path.iterdir() if not file.is_dir()] if path.is_dir() else [path]


def _identity(path: Path) -> tuple[int, int] | str:
    """What makes two names one file: device and inode, or where a file that does not exist yet would stand."""
    try:
        found = path.stat()
    except OSError:
        return os.path.realpath(path)
    return found.st_dev, found.st_ino
