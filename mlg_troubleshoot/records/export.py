"""CSV for other programs, in which no text can become a formula."""

from __future__ import annotations

import csv
import io
import os
import tempfile
from collections.abc import Iterable, Sequence
from pathlib import Path

from mlg_troubleshoot.errors import OutputError

# The wide forms of the signs start a formula in some language versions of Excel.
_STARTS_FORMULA = ("=", "+", "-", "@", "\t", "\r", "\n", "＝", "＋", "－", "＠")


def harmless(value: str | float | int | bool | None) -> str:
    """Return a value as a CSV field that a spreadsheet program takes as it is.

    Parameters
    ----------
    value : str, float, int, bool or None
        The value.

    Returns
    -------
    str
        Numbers unchanged; a text that would become a formula gets an apostrophe in front.
    """
    if value is None:
        return ""
    if isinstance(value, bool):
        return "TRUE" if value else "FALSE"
    if isinstance(value, int | float):
        return repr(value) if isinstance(value, int) else repr(float(value))
    return f"'{value}" if value.lstrip(" ").startswith(_STARTS_FORMULA) else value


def write_csv(
    path: str | Path, header: Sequence[str], rows: Iterable[Sequence[str | float | int | bool | None]]
) -> None:
    """Write a table as CSV in UTF-8.

    Parameters
    ----------
    path : str or Path
        File to write; it appears whole or not at all.
    header : sequence of str
        Names of the columns.
    rows : iterable of sequence
        The rows.

    Raises
    ------
    OutputError
        If the file cannot be written.
    """
    buffer = io.StringIO()
    writer = csv.writer(buffer, lineterminator="\n")
    writer.writerow([harmless(name) for name in header])
    for row in rows:
        writer.writerow([harmless(value) for value in row])
    write_bytes(path, buffer.getvalue().encode("utf-8"))


def write_bytes(path: str | Path, data: bytes) -> None:
    """Write a file so that it appears whole or not at all.

    Parameters
    ----------
    path : str or Path
        File to write.
    data : bytes
        Its content.

    Raises
    ------
    OutputError
        If it cannot be written.
    """
    target = Path(path)
    try:
        handle, scratch = tempfile.mkstemp(prefix=f".{target.name}.", dir=target.parent)
        try:
            with os.fdopen(handle, "wb") as file:
                file.write(data)
            Path(scratch).chmod(0o644)
            Path(scratch).replace(target)
        except OSError:
            Path(scratch).unlink(missing_ok=True)
            raise
    except OSError as error:
        raise OutputError(
            f"{target} cannot be written: {error.strerror}", "Check the folder, the permissions and the free space."
        ) from None
