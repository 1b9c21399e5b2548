"""A file of what is believed before a measured value is looked at, where that differs from the
program's own.
"""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path
from typing import Annotated, Literal

import msgspec
from msgspec import Meta

from mlg_troubleshoot.datafile import AboveZero, Name, Table, read_toml
from mlg_troubleshoot.misfit.beliefs import Beliefs

_OWN = Beliefs()
_Share = Annotated[float, Meta(gt=0, lt=1)]


class BeliefsFile(Table):
    """What a fleet is known to be like; a key that is not there is as in :class:`Beliefs`."""

    schema: Literal[1]
    expected: AboveZero = _OWN.expected
    unlisted: _Share = _OWN.unlisted
    slips: AboveZero = _OWN.slips
    slip_size: AboveZero = _OWN.slip_size
    shape_size: AboveZero = _OWN.shape_size
    sizes: Annotated[tuple[AboveZero, ...], Meta(min_length=1, max_length=9)] = _OWN.sizes
    form: AboveZero = _OWN.form
    exact: AboveZero = _OWN.exact
    alike: _Share = _OWN.alike
    surveyed: AboveZero = _OWN.surveyed
    rarer: dict[Name, AboveZero] = msgspec.field(default_factory=dict)
    plausible: dict[Name, AboveZero] = msgspec.field(default_factory=dict)


def load_beliefs(
    path: Path, sure: float, causes: Collection[str], sized: Collection[str]
) -> Beliefs:
    """Read what is believed; a name that is not of a cause is refused, and the size of one that has
    no single parameter, or one value of it only.
    """
    remedy = (
        "Give a TOML file with schema = 1. Its keys are listed in docs/explanation/diagnosis.md."
    )
    file = read_toml(path, BeliefsFile, remedy)
    for key, known in (("rarer", causes), ("plausible", sized)):
        for name in getattr(file.content, key):
            if name not in known:
                raise file.fail((key, name), f"one of {', '.join(sorted(known))}")
    values = msgspec.structs.asdict(file.content)
    del values["schema"]
    return Beliefs(**values, sure=sure)
