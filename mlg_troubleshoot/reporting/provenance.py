"""What a report says about where it comes from."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import datetime


@dataclass(frozen=True, slots=True)
class ReportProvenance:
    """Program, inputs and moment behind a report.

    Parameters
    ----------
    program_version : str
        Version of this program.
    created : datetime.datetime
        Moment of the report, given by the caller: the same input and the same moment give the same bytes.
    geometry_sha256 : str
        Hash of the geometry that predicted.
    input_sha256 : mapping of str to str
        Hash of the bytes of each input file by its name; empty for prompts and the command line.
    indices_sha256 : str or None
        Hash of the precomputed sensitivity table.
    seed : int or None
        Seed of whatever was drawn at random; None if nothing was.
    extension : str or None
        The extension of the model in words, with its hash, if one is in use.
    """

    program_version: str
    created: datetime
    geometry_sha256: str
    input_sha256: Mapping[str, str] = field(default_factory=dict)
    indices_sha256: str | None = None
    seed: int | None = None
    extension: str | None = None
