"""Every number that the paper prints, with the value of the model.

Printed numbers as data: what a source says about a gear, and how far the model may be from
it.

Which statements of the source hold, in which reading, and on how many of the linkages.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import StrEnum
from functools import cached_property
from pathlib import Path
from typing import Annotated, Literal

import msgspec
import numpy as np
from msgspec import Meta

from mlg_troubleshoot.arrays import Array
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
from mlg_troubleshoot.gear.linkage import LinkageModel, worst_case
from mlg_troubleshoot.indices.index_table import Amplification, amplification
from mlg_troubleshoot.indices.variance import (
    CORNERS,
    HeldDirections,
    TensorIndices,
    tensor_indices,
    worst_directions,
)
from mlg_troubleshoot.results import JsonOutput

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

    json_names = """
        quantity=target.quantity section=target.section printed=target.printed computed
        unit=target.unit tolerance=target.accepted status holds should_hold=target.expected
    """
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


class ClaimOutcome(StrEnum):
    HOLDS = "holds"
    READING = "holds only under a reading"
    SOME = "holds on some linkages"
    FAILS = "does not hold"


@dataclass(frozen=True, slots=True)
class ClaimEvidence:
    """One computed number that bears on a statement, on every linkage.

    values: the number on each linkage, the reference first. [unit]
    """

    json_names = """
        quantity=target.quantity accepted=target.accepted unit=target.unit values holds
        why=target.why
    """
    target: Target
    values: tuple[float, ...]

    @property
    def holds(self) -> tuple[bool, ...]:
        """Whether it is accepted, on each linkage."""
        return tuple(map(self.target.holds, self.values))


@dataclass(frozen=True, slots=True)
class Statement:
    """A statement of the source and what the linkages say to it.

    evidence: the numbers; several if the statement has parts or readings.
    """

    json_names = "claim section outcome linkages evidence paragraph"
    claim: str
    section: str
    outcome: ClaimOutcome
    linkages: tuple[str, ...]
    evidence: tuple[ClaimEvidence, ...]

    @property
    def numbers(self) -> str:
        """What the linkages say, in sentences: each number, where it is accepted and why it is
        so.
        """
        parts = []
        for each in self.evidence:
            low = min(each.values)
            high = max(each.values)
            of = each.target
            unit = f" {of.unit}" if of.unit else ""
            parts.append(
                f"{of.quantity[0].upper()}{of.quantity[1:]}: {each.values[0]:.4g}{unit} on"
                f" {self.linkages[0]}, {low:.4g} to {high:.4g} over {len(each.values)} linkages;"
                f" {of.accepted} on {sum(each.holds)}. {of.why}"
            )
        return " ".join(parts)

    @property
    def paragraph(self) -> str:
        return f"{self.claim} (section {self.section}): {self.outcome}. {self.numbers}"


@dataclass(frozen=True, slots=True, eq=False)
class Verification(JsonOutput):
    """Every number that the paper prints beside the model's, and what the linkages say to its
    statements.
    """

    json_names = "schema_version gear=gear.id numbers statements"
    gear: Gear
    numbers: tuple[Computed, ...]
    statements: tuple[Statement, ...]

    @property
    def failed(self) -> list[Computed]:
        """Required numbers that do not hold."""
        return [n for n in self.numbers if n.target.expected and not n.holds]


def check_statements(
    gear: Gear, progress: Callable[[int, int], None] | None = None
) -> tuple[Statement, ...]:
    """Check every statement of the targets of a gear on the reference and the whole ensemble."""
    entries = load_targets(targets_file(gear))
    columns: list[list[float]] = []
    for model in gear.ensemble_models:
        facts = Facts(gear, model)
        columns.append([facts.measure(target) for target in entries])
        if progress is not None:
            progress(len(columns), len(gear.ensemble))
    by_claim: dict[str, list[ClaimEvidence]] = {}
    for target, values in zip(entries, zip(*columns, strict=True), strict=True):
        if target.claim:
            by_claim.setdefault(target.claim, []).append(ClaimEvidence(target, values))
    found = []
    for claim, evidence in by_claim.items():
        readings = {each.target.reading for each in evidence}
        outcome = _outcome(evidence, by_reading=len(readings) > 1)
        section = evidence[0].target.section
        found.append(Statement(claim, section, outcome, gear.ensemble_names, tuple(evidence)))
    return tuple(found)


def _outcome(evidence: Sequence[ClaimEvidence], *, by_reading: bool) -> ClaimOutcome:
    everywhere = [all(each.holds) for each in evidence]
    if all(everywhere):
        return ClaimOutcome.HOLDS
    if by_reading and any(everywhere):
        return ClaimOutcome.READING
    return ClaimOutcome.SOME if any(any(each.holds) for each in evidence) else ClaimOutcome.FAILS
