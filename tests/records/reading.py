"""Read one table, from a file or from memory under a name."""

from __future__ import annotations

import io
from pathlib import Path

from mlg_troubleshoot.records import ReadOptions, ReadResult, read_many


class Named(io.BytesIO):
    """Bytes that have the name of a file."""

    def __init__(self, data: bytes, name: str) -> None:
        super().__init__(data)
        self.name = name


def read_inspections(
    source: str | Path | io.BytesIO, options: ReadOptions, *, name: str | None = None
) -> ReadResult:
    if name is not None:
        data = source.getvalue() if isinstance(source, io.BytesIO) else Path(source).read_bytes()
        source = Named(data, name)
    return read_many([source], options)
