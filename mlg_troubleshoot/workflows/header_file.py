"""A file that says how the headers of a colleague's tables are read (``--map FILE.toml``)."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from msgspec import Meta

from mlg_troubleshoot.datafile import Table, read_toml

HeaderText = Annotated[str, Meta(max_length=200)]


class HeaderFile(Table):
    """What may stand in such a file: ``[headers]``, below it lines as ``"Spiel 3" =
    "clearance_3_mm"``.
    """

    headers: dict[HeaderText, HeaderText]


def read_header_file(file: Path) -> dict[str, str]:
    return read_toml(file, HeaderFile).content.headers
