"""Printed numbers as data: what a source says about a gear, and how far the model may be from
it.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import msgspec
import numpy as np
from msgspec import Meta

from mlg_troubleshoot.datafile import (
    LARGEST,
    Number,
    RefusedValueError,
    Table,
    Whole,
    read_toml,
)
from mlg_troubleshoot.errors import GearFileError
from mlg_troubleshoot.gear.gear import Gear

JointKey = Annotated[int, Meta(ge=0, le=LARGEST, description="the number of a joint")]


class Target(Table):
    """One printed number or statement: a value with its tolerance, or a limit.

    measure: name of the computation that gives it.
    over: how several joints become one number.
    clearance_in: clearances by joint, for a case; the others are 0. [in]
    reading: which of two readings of a statement.
    expected: false if it is known not to hold.
    search: true if the linkage was searched for it.
    claim: the statement of the source that this number bears on; empty if it is a number only.
    """

    quantity: str
    measure: str
    printed: str
    section: str
    kind: Literal["fitted", "calibrated", "reproduced", "not reproduced"]
    unit: str = ""
    value: Number | None = None
    tolerance: Number | None = None
    at_least: Number | None = None
    at_most: Number | None = None
    joints: tuple[Whole, ...] = ()
    over: Literal["min", "max", "sum"] = "min"
    clearance_in: dict[JointKey, Annotated[float, Meta(ge=0, le=1)]] = msgspec.field(
        default_factory=dict
    )
    reading: str = "maximum"
    expected: bool = True
    search: bool = False
    claim: str = ""
    why: str = ""

    def __post_init__(self) -> None:
        stated = [limit is not None for limit in (self.value, self.at_least, self.at_most)]
        if sum(stated) != 1:
            raise RefusedValueError("value", "one of value with tolerance, at_least, at_most")
        if (self.tolerance is None) == stated[0]:
            raise RefusedValueError(
                "tolerance", "a number" if stated[0] else "it with a value only"
            )
        if not self.low < self.high:
            raise RefusedValueError(
                "tolerance", "a number above 0 that the value can be distinguished from"
            )

    @property
    def low(self) -> float:
        """The least accepted number. [unit]"""
        if self.value is not None and self.tolerance is not None:
            return self.value - self.tolerance
        return -np.inf if self.at_least is None else self.at_least

    @property
    def high(self) -> float:
        """The greatest accepted number. [unit]"""
        if self.value is not None and self.tolerance is not None:
            return self.value + self.tolerance
        return np.inf if self.at_most is None else self.at_most

    @property
    def accepted(self) -> str:
        """The accepted range in words."""
        if self.tolerance is not None:
            return f"± {self.tolerance:g}"
        return f"≤ {self.at_most:g}" if self.at_least is None else f"≥ {self.at_least:g}"

    def holds(self, computed: float) -> bool:
        return self.low <= computed <= self.high


class TargetsFile(Table):
    """What a source says about a gear."""

    schema: Literal[1]
    gear: str
    source: str
    targets: tuple[Target, ...]


@dataclass(frozen=True, slots=True)
class Computed:
    """A printed number and the computed one. [unit of the target]"""

    target: Target
    computed: float

    @property
    def holds(self) -> bool:
        return self.target.holds(self.computed)

    @property
    def status(self) -> str:
        """Fitted, calibrated, reproduced or not reproduced, as it turned out."""
        kind = "reproduced" if self.target.kind == "not reproduced" else self.target.kind
        return kind if self.holds else "not reproduced"


def targets_file(gear: Gear) -> Path:
    """Return where the targets of a gear stand: next to its gear file."""
    return gear.path.with_name(f"{gear.path.stem}-targets.toml")


def load_targets(path: Path) -> tuple[Target, ...]:
    remedy = "Write one like hawker-800xp-targets.toml next to the gear file."
    if not path.exists():
        raise GearFileError(f"{path.name}: no printed numbers to compare with", remedy)
    return read_toml(path, TargetsFile).content.targets
