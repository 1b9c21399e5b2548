"""Printed numbers as data: what a source says about a gear, and how far the model may be from
it.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from mlg_troubleshoot.datafile import DataTable, read_toml
from mlg_troubleshoot.errors import GearFileError
from mlg_troubleshoot.gear.gear import Gear

# A limit is met with this share of it, or of 0.05, to spare. [1]
INSIDE = 0.02
KINDS = ("fitted", "calibrated", "reproduced", "not reproduced")


@dataclass(frozen=True, slots=True)
class Target:
    """One printed number or statement.

    measure: name of the computation that gives it.
    low, high: accepted range of the computed number. [unit]
    tolerance: the same in words.
    over: how several joints become one number: min, max or sum.
    clearance_in: clearances by joint, for a case; the others are 0. [in]
    reading: which of two readings of a statement.
    expected: false if it is known not to hold.
    search: true if a reconstruction must meet it.
    claim: the statement of the source that this number bears on; empty if it is a number only.
    """

    quantity: str
    measure: str
    unit: str
    printed: str
    section: str
    kind: str
    low: float
    high: float
    tolerance: str
    joints: tuple[int, ...]
    over: str
    clearance_in: dict[int, float]
    reading: str
    expected: bool
    search: bool
    claim: str
    why: str

    def holds(self, computed: float) -> bool:
        return self.low <= computed <= self.high


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
        kind = "reproduced" if self.target.kind == KINDS[-1] else self.target.kind
        return kind if self.holds else KINDS[-1]

    @property
    def binds(self) -> bool:
        """True if it determines the linkage: a printed value, or a limit that the linkage lies
        at.
        """
        low, high = self.target.low, self.target.high
        if np.isfinite(low) and np.isfinite(high):
            return True
        bound = low if np.isfinite(low) else high
        return abs(self.computed - bound) <= 2.5 * INSIDE * max(abs(bound), 0.05)


def targets_file(gear: Gear) -> Path:
    """Return where the targets of a gear stand: next to its gear file."""
    return gear.path.with_name(f"{gear.path.stem}-targets.toml")


def load_targets(path: Path) -> tuple[Target, ...]:
    remedy = "Write one like hawker-800xp-targets.toml next to the gear file."
    if not path.exists():
        raise GearFileError(f"{path.name}: there are no printed numbers to compare with", remedy)
    table = read_toml(path)
    if table.whole("schema") != 1:
        raise table.fail("schema", "1")
    table.text("gear")
    table.text("source")
    found = tuple(_target(entry) for entry in table.tables("targets"))
    table.finish()
    return found


def _target(entry: DataTable) -> Target:
    low, high, tolerance = -np.inf, np.inf, ""
    unit = entry.text("unit", "")
    if entry.has("value"):
        value, width = entry.number("value"), entry.number("tolerance")
        low, high, tolerance = value - width, value + width, f"± {width:g}"
        if not low < high:
            raise entry.fail(
                "tolerance", "a number above 0 that the value can be distinguished from"
            )
    elif entry.has("at_least"):
        low = entry.number("at_least")
        tolerance = f"≥ {low:g}"
    elif entry.has("at_most"):
        high = entry.number("at_most")
        tolerance = f"≤ {high:g}"
    else:
        raise entry.fail("value", "value with tolerance, at_least or at_most")
    clearance: dict[int, float] = {}
    if entry.has("clearance_in"):
        lengths = entry.table("clearance_in")
        for key in lengths.names:
            if not key.isdecimal():
                raise lengths.fail(key, "the number of a joint")
            clearance[int(key)] = lengths.number(key, least=0.0, most=1.0)
    target = Target(
        quantity=entry.text("quantity"),
        measure=entry.text("measure"),
        unit=unit,
        printed=entry.text("printed"),
        section=entry.text("section"),
        kind=entry.one_of("kind", KINDS),
        low=low,
        high=high,
        tolerance=tolerance,
        joints=entry.wholes("joints"),
        over=entry.one_of("over", ("min", "max", "sum"), "min"),
        clearance_in=clearance,
        reading=entry.text("reading", "maximum"),
        expected=entry.flag("expected", True),
        search=entry.flag("search"),
        claim=entry.text("claim", ""),
        why=entry.text("why", ""),
    )
    entry.finish()
    return target
