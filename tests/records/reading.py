"""Read one table, from a file or from memory under a name."""

from __future__ import annotations

import io
from pathlib import Path

from mlg_troubleshoot.errors import Problem
from mlg_troubleshoot.records import ReadOptions, ReadResult, read_many

HEADER = (
    *("record_id", "tail_no", "side", "clearance_convention", "clearance_3_in", "clearance_5_in"),
)
GOOD = ("R1", "N100AB", "LH", "RADIAL", 0.013, 0.007)


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


def only(result: ReadResult) -> Problem:
    """Return the only problem of a result."""
    assert len(result.problems) == 1, result.problems
    return result.problems[0]
