"""The one place where files are written: whole or not at all, over another file only if asked to.

An output never replaces an input, a store or a device.
"""

from __future__ import annotations

import os
import re
import stat
import tempfile
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from mlg_troubleshoot.errors import OutputError, UsageError

Field = str | float | int | bool | None
# What begins a field of a CSV, whichever separator a program assumes: the start of the text, a
# separator or a line break, then any quotation marks and blanks. The comma is left out: a program
# that knows it keeps our quotation marks. The wide forms of the signs start a formula in some
# language versions of Excel.
_BREAKS = r"\t-\r\x1c-\x1e\x85\u2028\u2029"
_SIGNS = r"=+\-@＝＋－＠"
_FORMULA = re.compile(
    rf'(\A(?=[{_BREAKS}])|(?:\A|[;|{_BREAKS}])(?=(?:[^\S{_BREAKS}]|")*[{_SIGNS}]))'
)
_SEPARATORS = re.compile(r'[,;|\t"\r\n]')
# How a file of SQLite begins: such a file is a store, of this program or of another.
_DATABASE = b"SQLite format 3\0"
_STANDARD_OUTPUT = "-"
_EXISTS = "exists"


@contextmanager
def whole_file(path: str | Path) -> Iterator[Callable[[bytes], object]]:
    """Open a file to be written piece by piece so that it appears whole or not at all.

    A link is followed, so that it stays one. A file that is replaced keeps its mode; a new one gets
    what the umask leaves. Folders that are missing are made. Anything that is not a regular file is
    refused with an `OutputError`.
    """
    target = Path(os.path.realpath(path))
    scratch = None
    try:
        with _refused(path):
            target.parent.mkdir(parents=True, exist_ok=True)
            mode = _mode_of(target, path)
            handle, scratch = tempfile.mkstemp(prefix=".mlg-", suffix=".part", dir=target.parent)
        with os.fdopen(handle, "wb") as file:
            yield _refused(path)(file.write)
            _refused(path)(file.flush)()
        with _refused(path):
            Path(scratch).chmod(mode)
            Path(scratch).replace(target)
        scratch = None
    finally:
        if scratch is not None:
            Path(scratch).unlink(missing_ok=True)


@contextmanager
def _refused(path: str | Path) -> Iterator[None]:
    """Say of what the system refuses which file it was."""
    try:
        yield
    except OSError as error:
        raise _cannot_be_written(path, error) from error


def write_bytes(path: str | Path, data: bytes) -> None:
    """Write a file as `whole_file` does."""
    with whole_file(path) as write:
        write(data)


def write_text(path: str | Path, text: str) -> None:
    """Write a text in UTF-8 as `write_bytes` does."""
    write_bytes(path, text.encode("utf-8"))


def write_csv(path: str | Path, header: Sequence[str], rows: Iterable[Sequence[Field]]) -> None:
    """Write a table as CSV in UTF-8, in which no text can become a formula."""
    write_text(path, csv_lines((header, *rows)))


def csv_lines(rows: Iterable[Sequence[Field]]) -> str:
    """Return rows as CSV in which no text can become a formula, whatever separator a program takes
    it to have.
    """
    lines = [[_quoted(harmless(value)) for value in row] for row in rows]
    return "".join(",".join(line) + "\n" for line in lines)


def _quoted(field: str) -> str:
    """A field that stays one whichever separator a program takes the file to have."""
    return '"' + field.replace('"', '""') + '"' if _SEPARATORS.search(field) else field


def harmless(value: Field) -> str:
    """Return a value as a CSV field that a spreadsheet program takes as it is.

    Numbers are unchanged; in a text, a sign that would start a formula gets an apostrophe in front.
    """
    if value is None:
        return ""
    if isinstance(value, bool):
        return "TRUE" if value else "FALSE"
    if isinstance(value, int | float):
        return repr(value) if isinstance(value, int) else repr(float(value))
    return _FORMULA.sub(r"\1'", value)


def claim_outputs(
    inputs: Iterable[str | Path | int],
    outputs: Iterable[tuple[str, str | Path | None]],
    *,
    force: bool = False,
) -> None:
    """Refuse, before anything is read, an output that would replace what it must not.

    That is an input, the file of another output, or a file that exists; with ``force`` the last is
    replaced, if it is not a database. Inputs are files, folders of which every file counts, or the
    descriptor of an open file; outputs are options and their files, None where nothing is asked
    for. A file is the one that would be written, through links and missing folders. Raises
    `UsageError` (exit code 2), and `OutputError` (5) where nothing can be written.
    """
    files = [file for given in inputs for file in _files_of(given)]
    taken = {_identity(file): f"is one of the inputs ({_named(file)})" for file in files}
    for option, path in outputs:
        if path is None:
            continue
        shown = f"{option} {path}"
        if str(path) == _STANDARD_OUTPUT:
            raise UsageError(f"{shown} is not the name of a file", "Give the name of a file.")
        why = taken.get(_identity(path)) or _why_not_replaced(path, shown, force=force)
        if why:
            remedy = f"Give {option} another name"
            if why == _EXISTS:
                remedy += ", or --force to replace the file"
            raise UsageError(f"{shown} {why}: nothing was read and nothing written", f"{remedy}.")
        taken[_identity(path)] = f"is the file of {option} as well"


def _why_not_replaced(path: str | Path, shown: str, *, force: bool) -> str:
    target = Path(os.path.realpath(str(path)))
    try:
        _mode_of(target, str(path))
        if not target.exists():
            return ""
        with target.open("rb") as file:
            if file.read(len(_DATABASE)) == _DATABASE:
                return "is a database, such as a store of inspections, which is never replaced"
    except OSError as error:
        raise _cannot_be_written(shown, error) from error
    return "" if force else _EXISTS


def _cannot_be_written(path: str | Path, error: OSError) -> OutputError:
    return OutputError(
        f"{path} cannot be written: {error.strerror or error}",
        "Check the folder, the permissions and the free space, or write to another place.",
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
        raise OutputError(
            f"{asked} is {kind}, not a file: nothing was written", "Give the name of a file."
        )
    return stat.S_IMODE(found.st_mode)


def _files_of(given: str | Path | int) -> list[Path | int]:
    if isinstance(given, int):
        return [given]
    path = Path(given)
    if not path.is_dir():
        return [path]
    return [file for file in path.iterdir() if not file.is_dir()]


def _named(file: Path | int) -> str:
    return "standard input" if isinstance(file, int) else str(file)


def _identity(file: str | Path | int) -> tuple[int, int] | str:
    """What makes two names one file: device and inode, or where a file that does not exist yet
    would stand.
    """
    place = file if isinstance(file, int) else Path(os.path.realpath(file))
    try:
        found = os.fstat(place) if isinstance(place, int) else place.stat()
    except OSError:
        return str(place)
    return found.st_dev, found.st_ino
