"""Wear read at irregular usages, and the same readings laid out for filtering many units at
once.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from mlg_troubleshoot.arrays import Array, Mask, Places, frozen
from mlg_troubleshoot.errors import UsageError
from mlg_troubleshoot.results import Result

# Decimals beyond which a difference between two readings is taken for rounding in the computer. [1]
_DECIMALS = 9
# Readings lie on a grid if it has at least this many readings to a step of their range, and not by
# chance. [1]
_MOST_STEPS = 2000
# Share of the parts whose values fall from which on wear is taken to fall. [1]
_FALLING = 0.75


@dataclass(frozen=True, slots=True, repr=False, eq=False)
class WearPath(Result):
    """Readings of one part between two restorations.

    Parameters
    ----------
    unit : str
        The part. Paths of one unit stand in the order of time; a restoration begins a new one.
    usage : array_like of shape (n,)
        Usage at each reading, counted from the restoration, ascending; empty for a part restored
        and not read since. [usage]
    value : array_like of shape (n,)
        Wear as read. [value]
    reading_u : float or None
        Standard uncertainty of a reading; None lets it be estimated. [value]
    """

    unit: str
    usage: ArrayLike
    value: ArrayLike
    reading_u: float | None = None

    @property
    def n_readings(self) -> int:
        """Number of readings; 0 for a part restored and not read since."""
        return len(np.asarray(self.usage))

    def __post_init__(self) -> None:
        usage = frozen(self.usage).ravel()
        value = frozen(self.value).ravel()
        if len(usage) != len(value):
            raise UsageError(
                f"path of {self.unit}: {len(usage)} usages and {len(value)} values",
                "Give one value per usage.",
            )
        if not (np.isfinite(usage).all() and np.isfinite(value).all()):
            raise UsageError(
                f"path of {self.unit}: a usage or a value is not a finite number", "Leave it out."
            )
        if (usage < 0.0).any() or (usage[1:] < usage[:-1]).any():
            raise UsageError(
                f"path of {self.unit}: usage must ascend from 0, not"
                f" {', '.join(f'{u:g}' for u in usage[:8])}",
                "Count the usage from the last restoration and begin a new path there.",
            )
        if self.reading_u is not None and not (
            np.isfinite(self.reading_u) and self.reading_u >= 0.0
        ):
            raise UsageError(
                f"path of {self.unit}: reading_u is {self.reading_u:g}",
                "Give zero or more, or None.",
            )
        object.__setattr__(self, "usage", usage)
        object.__setattr__(self, "value", value)


@dataclass(frozen=True, slots=True)
class Scale:
    """What one usage and one value are in the numbers that the filters see: about 1 over all that
    was read.
    """

    usage: float
    value: float
    start: float
    resolution: float


@dataclass(frozen=True)
class Steps:
    """Readings of many units side by side, arrays of shape (steps, units): in each step a unit is
    read once at most.

    ``begins`` marks the first step of a path, ``seen`` a reading; ``known_r2`` is NaN where it is
    to be estimated.
    """

    begins: Mask
    seen: Mask
    usage: Array
    value: Array
    known_r2: Array

    @cached_property
    def alike(self) -> tuple[Places, Places]:
        """The first of the units that were read alike, and which of these stands for each unit."""
        known = np.nan_to_num(self.known_r2, nan=-1.0)
        when = np.concatenate([self.begins, self.seen, self.usage, known])
        _when, first, owner = np.unique(when, axis=1, return_index=True, return_inverse=True)
        return first, owner.ravel()


def grid_step(values: Array) -> float:
    """Step of the grid that all readings lie on, 0 without one."""
    unique = np.unique(np.round(values, _DECIMALS))
    if len(unique) < 3:
        return 0.0
    # The greatest common divisor of all differences, up to rounding.
    whole = np.round(np.diff(unique) * 10.0**_DECIMALS).astype(np.int64)
    step = float(np.gcd.reduce(whole)) / 10.0**_DECIMALS
    return step if (unique[-1] - unique[0]) / step <= _MOST_STEPS else 0.0


def scale_of(paths: Sequence[WearPath]) -> Scale:
    """Find the scales of usage and value, the common start, and which way the wear goes (the sign
    of the value).
    """
    known_paths = (path for path in paths if path.n_readings)
    read = [(np.asarray(path.usage), np.asarray(path.value)) for path in known_paths]
    values = [value for _usage, value in read]
    everything = np.concatenate([*values, np.empty(0)])
    reach = max((float(usage[-1]) for usage, _value in read), default=0.0) or 1.0
    first = [value[0] for _usage, value in read]
    start = float(np.median(first)) if first else 0.0
    changes = [(usage[-1] - usage[0], value[-1] - value[0]) for usage, value in read]
    rates = np.array([rise / run for run, rise in changes if run > 0.0])
    rise = float(np.median(rates)) * reach if len(rates) else 0.0
    if not rise and read:
        rise = float(np.std(everything))
    known = [path.reading_u for path in paths if path.reading_u]
    least = 2.0 * float(np.median(known)) if known else 0.0
    if len(rates):
        least = max(least, 1e-3 * float(np.ptp(everything)))
    size = max(abs(rise), least) or max(abs(start), 1.0)
    # Wear grows unless most parts say otherwise.
    falls = len(rates) > 0 and float(np.mean(rates < 0.0)) >= _FALLING
    return Scale(reach, -size if falls else size, start, grid_step(everything))


def lay_out(groups: Sequence[Sequence[WearPath]], scale: Scale) -> Steps:
    """Lay the paths of each unit behind each other; shorter units are padded in front, so that all
    end together.
    """
    lengths = [sum(max(path.n_readings, 1) for path in group) for group in groups]
    shape = (max(lengths, default=0), len(groups))
    steps = Steps(
        begins=np.zeros(shape, bool),
        seen=np.zeros(shape, bool),
        usage=np.zeros(shape),
        value=np.zeros(shape),
        known_r2=np.full(shape, np.nan),
    )
    for column, (group, length) in enumerate(zip(groups, lengths, strict=True)):
        row = shape[0] - length
        for path in group:
            count = path.n_readings
            steps.begins[row, column] = True
            rows = slice(row, row + count)
            steps.seen[rows, column] = True
            steps.usage[rows, column] = np.asarray(path.usage) / scale.usage
            steps.value[rows, column] = (np.asarray(path.value) - scale.start) / scale.value
            if path.reading_u is not None:
                steps.known_r2[rows, column] = (path.reading_u / scale.value) ** 2
            row += max(count, 1)
    return steps
