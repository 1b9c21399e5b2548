"""What every estimator returns."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from mlg_troubleshoot.arrays import Array
from mlg_troubleshoot.gear.gear import Gear

Estimate = tuple[Array, Array]


@dataclass(frozen=True, slots=True)
class Indices:
    """First- and total-order indices with 95 % intervals, as fractions of the variance.

    first_order, total_order, shape (n,): indices of Eqs. 1 and 2. [1] first_order_interval,
    total_order_interval, shape (n, 2): their 95 % intervals. [1] mean, variance: moments of the
    response. [its unit, its unit squared] evaluations, failed: evaluations of the response, and
    those that gave no number: one makes the indices NaN. note: what the user should know about the
    route taken; empty if nothing.
    """

    design: str
    seed: int
    first_order: Array
    first_order_interval: Array
    total_order: Array
    total_order_interval: Array
    mean: float
    variance: float
    evaluations: int
    failed: int
    note: str = ""

    @classmethod
    def around(
        cls, design: str, seed: int, first: Estimate, total: Estimate, *rest: Any
    ) -> Indices:
        """Indices from values with the half widths of their intervals, both of shape (n,). [1]"""
        first_interval = _interval(*first)
        total_interval = _interval(*total)
        return cls(design, seed, first[0], first_interval, total[0], total_interval, *rest)


@dataclass(frozen=True, slots=True)
class GroupIndices:
    """Indices of both ends of one link taken as one joint.

    closed: what the group explains alone, interactions within it included. [1]
    total: what the group takes part in. [1]
    """

    joints: tuple[int, ...]
    closed: float
    total: float


def group_indices(
    gear: Gear, closed: Callable[[tuple[int, ...]], float]
) -> tuple[GroupIndices, ...]:
    """Indices of every link, from the share of the variance that joints at some places explain
    alone.
    """
    places = {number: i for i, number in enumerate(gear.joint_numbers)}
    found = []
    for group in gear.link_groups:
        others = tuple(i for number, i in places.items() if number not in group)
        alone = closed(tuple(places[n] for n in group))
        found.append(GroupIndices(group, alone, 1.0 - closed(others)))
    return tuple(found)


def _interval(values: Array, half: Array) -> Array:
    """Lower and upper ends around each value, shape (n, 2). [1]"""
    return np.stack([values - half, values + half], axis=1)


def student_half(scatter: Array, count: int) -> Array:
    """Half width of the 95 % interval of a mean of independent values.

    count: number of values, at least 2; else the result is NaN.
    """
    from scipy.special import stdtrit

    if count < 2:
        return np.full_like(scatter, np.nan)
    half: Array = float(stdtrit(count - 1, 0.975)) * scatter / np.sqrt(count)
    return half


def failed_note(failed: int, evaluations: int) -> str:
    return (
        f"{failed} of {evaluations} samples do not close, so the variance over the whole range is"
        " not defined: use smaller limits."
    )
