"""Indices of joints taken together: both ends of one link as one, and pairs beyond their single effects."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from mlg_troubleshoot.gear.gear import Gear


class Shares(Protocol):
    """Anything that knows how much of the variance a group explains alone."""

    def closed(self, group: tuple[int, ...]) -> float:
        """Share of the variance that a group explains alone."""


@dataclass(frozen=True, slots=True)
class GroupIndices:
    """Indices of one group of joints.

    closed: what the group explains alone, interactions within it included. [1]
    total: what the group takes part in. [1]
    """

    joints: tuple[int, ...]
    closed: float
    total: float


def link_groups(gear: Gear) -> tuple[tuple[int, ...], ...]:
    """Group the joints at both ends of one link: the plunger cannot tell them apart."""
    return tuple(dict.fromkeys(tuple(sorted((number, *gear.alike[number]))) for number in gear.joint_numbers))


def group_indices(gear: Gear, shares: Shares, groups: tuple[tuple[int, ...], ...]) -> tuple[GroupIndices, ...]:
    numbers = gear.joint_numbers
    found = []
    for group in groups:
        places = tuple(numbers.index(j) for j in group)
        others = tuple(i for i in range(len(numbers)) if i not in places)
        found.append(GroupIndices(group, shares.closed(places), 1.0 - shares.closed(others)))
    return tuple(found)
