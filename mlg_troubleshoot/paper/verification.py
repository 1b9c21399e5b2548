"""Every number that the paper prints, with the value of the model."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from pathlib import Path

import numpy as np

from mlg_troubleshoot.arrays import Array
from mlg_troubleshoot.errors import GearFileError
from mlg_troubleshoot.gear.directions import worst_case
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.gear.model import LinkageModel
from mlg_troubleshoot.indices.amplification import Amplification, amplification
from mlg_troubleshoot.indices.inputs import HeldDirections, worst_directions
from mlg_troubleshoot.indices.tensor import CORNERS, TensorIndices, tensor_indices
from mlg_troubleshoot.paper.targets import Computed, Target, load_targets, targets_file

# Strokes of a curve. [1]
_CURVE = 401


def verify(gear: Gear, targets: Path | None = None) -> tuple[Computed, ...]:
    """Compare every printed number with what the gear's reference linkage gives."""
    facts = Facts(gear, gear.model)
    wanted = load_targets(targets_file(gear) if targets is None else targets)
    return tuple(Computed(target, facts.measure(target)) for target in wanted)


class Facts:
    """What a linkage gives for the measures of a targets file; each is computed once."""

    def __init__(self, gear: Gear, model: LinkageModel) -> None:
        self.gear = gear
        self.model = model
        self.limits = np.asarray(gear.limits_in, float)

    def measure(self, target: Target) -> float:
        if target.measure not in _MEASURES:
            raise GearFileError(
                f"target {target.quantity!r}: measure {target.measure!r} is not known",
                f"Use one of {', '.join(_MEASURES)}.",
            )
        named = {*target.joints, *target.clearance_in}
        unknown = named.difference(self.gear.joint_numbers)
        if unknown:
            raise GearFileError(
                f"target {target.quantity!r}: {self.gear.name} has no joint {min(unknown)}",
                f"Use joints {self.gear.joint_numbers[0]} to {self.gear.joint_numbers[-1]}.",
            )
        return float(_MEASURES[target.measure](self, target))

    @cached_property
    def response(self) -> HeldDirections:
        """Worst directions at the limits, held."""
        return worst_directions(self.model, self.limits)

    @cached_property
    def indices(self) -> TensorIndices:
        """Indices over the whole range of clearances."""
        return tensor_indices(self.response, self.limits)

    @cached_property
    def corner_indices(self) -> TensorIndices:
        """Indices with every clearance at an end of its range: the limit of a central composite
        design.
        """
        return tensor_indices(self.response, self.limits, nodes=CORNERS)

    @cached_property
    def growth(self) -> Amplification:
        return amplification(self.gear, self.model)

    @cached_property
    def curve(self) -> tuple[Array, Array]:
        """Stroke and plunger position over the release, Fig. 12. [in]"""
        stroke = np.linspace(*self.model.stroke, _CURVE)
        return stroke, self.model.plunger(stroke)

    def of(self, values: Array, joints: tuple[int, ...]) -> Array:
        """Pick the values of some joints; of all if none is named."""
        numbers = self.gear.joint_numbers
        return values[[numbers.index(j) for j in joints or numbers]]

    def others(self, joints: tuple[int, ...]) -> tuple[int, ...]:
        return tuple(j for j in self.gear.joint_numbers if j not in joints)


_REDUCE: dict[str, Callable[[Array], float]] = {"min": np.min, "max": np.max, "sum": np.sum}


def _worst_displacement(facts: Facts, target: Target) -> float:
    clearance_in = [target.clearance_in.get(j, 0.0) for j in facts.gear.joint_numbers]
    worst = worst_case(facts.model, np.array([clearance_in]))
    return float(worst.magnitude_in[0])


def _travel(facts: Facts, _: Target) -> float:
    stroke, position = facts.curve
    least = int(np.argmin(position))
    before = stroke[max(least - 1, 0)]
    after = stroke[min(least + 1, len(stroke) - 1)]
    near = np.linspace(before, after, _CURVE)
    return float(position[-1] - facts.model.plunger(near).min())


def _least_curvature(facts: Facts, _: Target) -> float:
    stroke, position = facts.curve
    step = stroke[1] - stroke[0]
    return float(np.min(np.diff(position, 2)) / step**2)


def _end_rate(facts: Facts, _: Target) -> float:
    stroke, position = facts.curve
    step = stroke[1] - stroke[0]
    at, least = _least(stroke, position)
    mean = (position[-1] - least) / (stroke[-1] - at)
    rise = 3.0 * position[-1] - 4.0 * position[-2] + position[-3]
    return float(rise / (2.0 * step) / mean)


def _least(stroke: Array, position: Array) -> tuple[float, float]:
    """Stroke and position of the least displacement, by a parabola through the lowest three
    points.
    """
    i = int(np.argmin(position))
    if i in (0, len(position) - 1):
        return float(stroke[i]), float(position[i])
    before, at, after = position[i - 1 : i + 2]
    offset = 0.5 * (before - after) / (before - 2.0 * at + after)
    return float(stroke[i] + offset * (stroke[1] - stroke[0])), float(
        at - 0.25 * (before - after) * offset
    )


def _sharpening(facts: Facts, target: Target) -> float:
    whole = facts.indices.first_order
    corners = facts.corner_indices.first_order
    if target.reading != "raw":
        whole = whole / whole.sum()
        corners = corners / corners.sum()
    return float(facts.of(corners - whole, target.joints).sum())


def _amplification_excess(facts: Facts, target: Target) -> float:
    growth = facts.growth
    product = growth.local_plunger if target.reading == "local" else growth.max_plunger
    excess = growth.shares(product, facts.limits) - facts.indices.first_order
    return float(facts.of(excess, target.joints).min())


def _interaction(facts: Facts) -> Array:
    return facts.indices.total_order - facts.indices.first_order


def _interaction_order(facts: Facts, target: Target) -> float:
    interaction = _interaction(facts)
    near = facts.of(interaction, target.joints)
    far = facts.of(interaction, facts.others(target.joints))
    return float(near.min() - far.max())


_MEASURES: dict[str, Callable[[Facts, Target], float]] = {
    "worst_displacement": _worst_displacement,
    "max_amplification_index": lambda f, t: _REDUCE[t.over](f.of(f.growth.max_stage, t.joints)),
    "first_order": lambda f, t: _REDUCE[t.over](f.of(f.indices.first_order, t.joints)),
    "down_lock": lambda f, _: float(f.model.plunger(f.model.stroke[0])),
    "travel": _travel,
    "least_curvature": _least_curvature,
    "end_rate": _end_rate,
    "sharpening": _sharpening,
    "amplification_excess": _amplification_excess,
    "interaction_order": _interaction_order,
    "interaction_size": lambda f, t: float(f.of(_interaction(f), t.joints).max()),
}
