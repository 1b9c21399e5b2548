"""The precomputed table of indices that goes with a gear, tied to its geometry by hashes.

Amplification index method: how a small clearance grows from joint to joint (section 3.3, Eqs. 7
to 10).

Every step of the mechanism is one of the three cases of Eq. 10. A clearance enters at the step
whose link it displaces (*current clearance*, ``csc θ``), is handed on by the next links (*previous
clearance*, ``cos φ csc θ``) and by levers and slots (*rigid body*, ``sin φ · L2/L1``).

The stage of a clearance runs from its joint to the first joint of a higher number that moves:
A_i,i+1 of Eq. 9. The two ends of one link act alike (Fig. 10), so both have the stage of the
upstream end. Differs from the paper: a fixed pivot that has a clearance is not a case of Eq. 10;
its stage is the exact derivative, and so is that of every joint to the output where a guide moves.
In a slider the guide stands for an infinitely long second link,
so that its csc θ is the secant of the angle between link and axis.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Annotated, Any, Literal

import msgspec
import numpy as np
from msgspec import Meta

from mlg_troubleshoot.arrays import STEP, Array, Wholes, frozen
from mlg_troubleshoot.datafile import (
    LARGEST,
    MOST_ENTRIES,
    AboveZero,
    Count,
    RefusedValueError,
    Table,
    read_json,
)
from mlg_troubleshoot.errors import GearFileError
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.gear.linkage import LinkageModel
from mlg_troubleshoot.geometry.mechanism import (
    Crank,
    Dyad,
    Guided,
    Lever,
    Mechanism,
    Slider,
    Slot,
    Step,
    needs,
)
from mlg_troubleshoot.outputs import write_text
from mlg_troubleshoot.results import Result

# A sampled index may lie a little outside 0 to 1, its interval further.
Index = Annotated[float, Meta(ge=-2, le=3)]
Growth = Annotated[float, Meta(ge=0, le=1_000_000)]
Rank = Annotated[int, Meta(ge=1, le=MOST_ENTRIES)]
# First-order indices closer than this are one rank: both ends of a link differ by less.
_SAME_RANK = 1e-4
_KEPT = "mlg study --write-table keeps it."
_NO_TABLE = "Move the file away: a check then computes the table itself."


class StaleTableError(GearFileError):
    """A table of indices that is missing, or was computed for another geometry or other limits."""


class JointIndices(Table):
    """Indices of one joint, as fractions of the variance and not normalised to 1.

    limit_in: upper end of its clearance's distribution. [in] first_order, total_order: indices of
    Eqs. 1 and 2. [1] first_order_interval, total_order_interval: their 95 % intervals. [1]
    plunger_amplification: A_iP of Eq. 8 at mid-position, in the limit of small clearance. [1]
    max_amplification_index: largest stage-wise index over the release (section 4.3). [1] rank:
    place by first order, 1 the largest; joints that differ by less than 1e-4 share a place. [1]
    rank_range: least and greatest place over the ensemble of linkages. [1] first_order_spread,
    total_order_spread: least and greatest index over the ensemble. [1]
    """

    joint: Annotated[int, Meta(ge=1, le=LARGEST)]
    limit_in: AboveZero
    first_order: Index
    first_order_interval: tuple[Index, Index]
    total_order: Index
    total_order_interval: tuple[Index, Index]
    plunger_amplification: Growth
    max_amplification_index: Growth
    rank: Rank
    rank_range: tuple[Rank, Rank]
    first_order_spread: tuple[Index, Index]
    total_order_spread: tuple[Index, Index]

    def __post_init__(self) -> None:
        for key in (
            "first_order_interval",
            "total_order_interval",
            "rank_range",
            "first_order_spread",
            "total_order_spread",
        ):
            low, high = getattr(self, key)
            if low > high:
                raise RefusedValueError(key, "two numbers, the smaller one first")


class TableGear(Table):
    """The gear that a table was computed for, and the hashes of its geometry."""

    id: str
    geometry_sha256: str
    ensemble_sha256: str
    provenance: str


class IndexTable(Result, Table):
    """Precomputed indices of a gear, as the file holds them."""

    json_names = "schema_version gear seed design evaluations failed joints"
    schema_version: Literal[2]
    gear: TableGear
    seed: Count
    design: str
    evaluations: Count
    failed: Count
    joints: tuple[JointIndices, ...]

    @property
    def first_order(self) -> Array:
        """First-order index of every joint, shape (n_joints,). [1]"""
        return np.array([entry.first_order for entry in self.joints])

    @property
    def total_order(self) -> Array:
        """Total-order index of every joint, shape (n_joints,). [1]"""
        return np.array([entry.total_order for entry in self.joints])


def ranks(first_order: Array) -> Wholes:
    """Place of each joint by first-order index, 1 the largest; joints closer than 1e-4 share a
    place.
    """
    above = first_order[None, :] > first_order[:, None] + _SAME_RANK
    return np.asarray(1 + above.sum(axis=1), dtype=np.int64)


def rank_ranges(ensemble_first_order: Array) -> list[tuple[int, int]]:
    """Least and greatest place of each joint over several linkages, from indices of shape
    (n_linkages, n_joints).
    """
    places = np.array([ranks(row) for row in ensemble_first_order])
    least = places.min(axis=0).tolist()
    greatest = places.max(axis=0).tolist()
    return list(zip(least, greatest, strict=True))


def read_index_table(gear: Gear) -> IndexTable:
    """Load the precomputed table of a gear and refuse one that belongs to another geometry.

    Parameters
    ----------
    gear : Gear
        The gear.

    Returns
    -------
    IndexTable
        Its table.

    Raises
    ------
    GearFileError
        If the table is missing, unreadable, or was computed for another geometry, ensemble or
        limit.
    """
    path = gear.indices_file
    if not path.exists():
        raise StaleTableError(f"{path.name}: the table of indices is missing", _KEPT)
    try:
        state = path.stat()
        table = _read_once(path, state.st_mtime_ns, state.st_size)
    except GearFileError as error:
        raise GearFileError(error.message, _NO_TABLE) from error
    for what, found, wanted in (
        ("gear", table.gear.id, gear.id),
        ("geometry", table.gear.geometry_sha256, gear.geometry_sha256),
        ("ensemble", table.gear.ensemble_sha256, gear.ensemble_sha256),
    ):
        if found != wanted:
            raise StaleTableError(
                f"{path.name}: was computed for another {what}: {found[:16]}, not {wanted[:16]}",
                _KEPT,
            )
    limits = tuple((entry.joint, entry.limit_in) for entry in table.joints)
    wanted_limits = tuple((joint.number, joint.limit.value) for joint in gear.joints)
    if limits != wanted_limits:
        gone = sorted(set(limits) ^ set(wanted_limits))
        named = ", ".join(f"joint {number} at {limit:g} in" for number, limit in gone)
        raise StaleTableError(
            f"{path.name}: was computed for other joints or limits: {named}", _KEPT
        )
    return table


@lru_cache(maxsize=4)
def _read_once(path: Path, _changed_ns: int, _size: int) -> IndexTable:
    """A file that has not changed is not read again."""
    return read_json(path, IndexTable, "").content


def _text(values: Mapping[str, Any]) -> str:
    return json.dumps(values, indent=1, allow_nan=False) + "\n"


def write_index_table(table: IndexTable, path: Path) -> None:
    """Write a table of indices, whole or not at all: over such a table only, through no link."""
    if path.is_symlink():
        raise GearFileError(f"{path.name}: is a link, which no table replaces", "Remove the link.")
    if path.exists():
        read_json(path, IndexTable, "")
    try:
        text = _text(msgspec.to_builtins(table))
    except ValueError:
        raise GearFileError(
            f"{path.name}: {table.failed} samples do not close at these limits: some indices are"
            " not known",
            "Check the limits and the points of the gear file.",
        ) from None
    write_text(path, text)


# Positions of the release at which stage indices are computed. [1]
STROKES = 2001


@dataclass(frozen=True, slots=True)
class Amplification:
    """Stage-wise and plunger amplification indices of one linkage.

    stroke, shape (n_strokes,): actuator extension from Down Lock to mid-position. [in] stage, shape
    (n_joints, n_strokes): stage-wise index A_i,i+1 over the release. [1] handed_on, shape
    (n_joints, n_strokes): product of the indices of all later stages, as the chain from the
      stage's end to the output. [1]
    onward_of_maxima, shape (n_joints,): the same product, each factor at its own maximum over the
    release. [1] beta: β of Eq. 9: what follows the last joint, here the calibration rate k. [1]
    exact, shape (n_joints,): plunger amplification index at mid-position from the exact gradient.
    [1]
    """

    json_names = "local_stage max_stage local_plunger max_plunger exact_plunger=exact"
    joints: tuple[int, ...]
    stroke: Array
    stage: Array
    handed_on: Array
    onward_of_maxima: Array
    beta: float
    exact: Array

    @property
    def local_stage(self) -> Array:
        """Stage-wise index at mid-position, shape (n_joints,). [1]"""
        return self.stage[:, -1]

    @property
    def max_stage(self) -> Array:
        """Largest stage-wise index over the release, shape (n_joints,). [1]"""
        largest: Array = self.stage.max(axis=1)
        return largest

    @property
    def local_plunger(self) -> Array:
        """A_iP by the product of Eq. 9 at mid-position, shape (n_joints,). [1]"""
        return self.beta * self.stage[:, -1] * self.handed_on[:, -1]

    @property
    def max_plunger(self) -> Array:
        """A_iP by Eq. 9 with every index at its maximum over the release, shape (n_joints,). [1]"""
        return self.beta * self.max_stage * self.onward_of_maxima

    def shares(self, plunger: Array, limits_in: Array) -> Array:
        """Share of each joint in the variance of the linearised displacement: Fig. 13b's index.

        plunger, shape (n_joints,): plunger amplification indices: local, of maxima, or exact. [1]
        limits_in, shape (n_joints,): largest clearance of each joint, each uniformly distributed
        from 0. [in] Returns, shape (n_joints,): shares, 1 in total. [1]
        """
        squares = (plunger * limits_in) ** 2
        shares: Array = squares / squares.sum()
        return shares


def amplification(
    gear: Gear, model: LinkageModel | None = None, n_strokes: int = STROKES
) -> Amplification:
    """Compute the amplification indices of a linkage over its release stroke.

    model: another linkage of the same gear, else the reference.
    """
    linkage = gear.model if model is None else model
    chain = _Chain(linkage, {joint.number: joint.point for joint in gear.joints}, n_strokes)
    stage = []
    onward = []
    of_maxima = []
    for number in gear.joint_numbers:
        own, later = chain.stage_and_later(number)
        stage.append(own)
        onward.append(np.prod([np.ones(n_strokes), *later], axis=0))
        of_maxima.append(float(np.prod([factor.max() for factor in later])))
    return Amplification(
        gear.joint_numbers,
        chain.stroke,
        frozen(stage),
        frozen(onward),
        frozen(of_maxima),
        abs(linkage.rate) * chain.output_factor(),
        frozen(linkage.plunger_amplification()),
    )


def csc(first: Array, second: Array) -> Array:
    """Cosecant of the angle between two links, at least 1, shape (...). [1]"""
    lengths = _lengths(first) * _lengths(second)
    cosine = np.sum(first * second, axis=-1) / lengths
    sine: Array = np.sqrt(1.0 - cosine**2)
    return 1.0 / sine


class _Chain:
    """Positions of all joints in space over the release, and the cases of Eq. 10 between them."""

    def __init__(self, model: LinkageModel, points: dict[int, str], n_strokes: int) -> None:
        self.model = model
        self.mechanism: Mechanism = model.mechanism
        self.points = points
        self.numbers = {point: number for number, point in points.items()}
        self.stroke = frozen(np.linspace(*model.stroke, n_strokes))
        flat = model.kernel.positions(self.stroke, model.kernel.no_clearance())
        self.place: dict[str, Array] = {}
        for point in self.mechanism.points:
            if point.name in flat:
                origin, axes = self.mechanism.frame(point.plane)
                x, y = (np.broadcast_to(part, (n_strokes,))[:, None] for part in flat[point.name])
                self.place[point.name] = origin + x * axes[0] + y * axes[1]

    def stage_and_later(self, number: int) -> tuple[Array, list[Array]]:
        """Index of the stage of a joint, and the index of every later stage, each over the
        release.
        """
        first = next(group[0] for group in self.mechanism.alike if number in group)
        if any(isinstance(step, Guided) for step in self.mechanism.steps):
            return self._of_output(number), []
        entry = self._entry(first)
        path = self._path(entry)
        later = (i for i, step in enumerate(path) if self.numbers.get(step.joint, 0) > first)
        end = next(later, len(path) - 1)
        if self.mechanism.point(self.points[first]).fixed:
            own = self._derivative(first, path[end].joint)
        else:
            own = self._current(entry) * np.prod(
                [self._previous(step) for step in path[1 : end + 1]], axis=0
            )
        return own, [self._previous(step) for step in path[end + 1 :]]

    def output_factor(self) -> float:
        output = self.mechanism.output
        if output.kind == "position":
            return 1.0
        arms = self.place[output.joint] - self.place[output.pivot]
        arm = arms[-1]
        return float(1.0 / np.linalg.norm(arm))

    def _entry(self, number: int) -> Step:
        """Return the step whose link or pivot the clearance displaces."""
        return next(
            step
            for step in self.mechanism.steps
            if number
            in (
                *step.virtual_links,
                *(self.mechanism.point(name).virtual_link for name in needs(step)),
            )
        )

    def _path(self, entry: Step) -> list[Step]:
        """Return the steps from one step to the output, each driven by the one before."""
        path = [entry]
        joint = self.mechanism.output.joint
        back: list[Step] = []
        while joint != entry.joint:
            step = self.mechanism.step(joint)
            if step is None:
                return path
            back.append(step)
            joint = needs(step)[0]
        return path + back[::-1]

    def _tangent(self, step: Step) -> Array:
        """Unit vector along which a step's joint moves when only the mechanism's input changes."""
        axes = self._axes(step)
        place = self.place[step.joint]
        if isinstance(step, Slider):
            direction = np.cos(step.axis) * axes[0] + np.sin(step.axis) * axes[1]
            return np.broadcast_to(direction, place.shape)
        from_centre = place - self.place[needs(step)[-1]]
        return _unit(np.cross(axes[2], from_centre))

    def _axes(self, step: Step) -> Array:
        return self.mechanism.frame(self.mechanism.point(step.joint).plane)[1]

    def _link(self, step: Dyad | Slider) -> Array:
        return self.place[step.joint] - self.place[step.upstream]

    def _current(self, step: Step) -> Array:
        """Current clearance: csc θ; on a slot's pin, which is a rigid body, L2/L1 (Eq. 10 with sin
        φ = 1).
        """
        match step:
            case Dyad() | Slider():
                axes = self._axes(step)
                in_plane = self._link(step) @ axes[:2].T
                tangent = self._tangent(step) @ axes[:2].T
                # The joint moves across its second link: the sine of θ is the cosine between link
                # and path.
                normal = np.stack([-tangent[:, 1], tangent[:, 0]], axis=-1)
                return csc(in_plane, normal)
            case Slot():
                return self._arms(step, step.pin)
            case Crank() | Lever() | Guided():
                return np.ones(len(self.stroke))

    def _previous(self, step: Step) -> Array:
        """Previous clearance, cos φ csc θ, or rigid body, sin φ · L2/L1 (Eq. 10)."""
        match step:
            case Dyad() | Slider():
                link = _unit(self._link(step))
                handed = self.mechanism.step(step.upstream)
                if handed is None:
                    return np.ones(len(self.stroke))
                cosine = np.sum(link * self._tangent(handed), axis=-1)
                sine = np.sum(link * self._tangent(step), axis=-1)
                index: Array = np.abs(cosine / sine)
                return index
            case Slot():
                handed = self.mechanism.step(step.pin)
                arm = _unit(self.place[step.pin] - self.place[step.pivot])
                if handed is None:
                    return self._arms(step, step.pin)
                across: Array = np.cross(arm, self._tangent(handed))
                return _lengths(across) * self._arms(step, step.pin)
            case Lever():
                return self._arms(step, step.follows)
            case Crank() | Guided():
                return np.ones(len(self.stroke))

    def _arms(self, step: Lever | Slot, other: str) -> Array:
        pivot = self.place[step.pivot]
        driven = _lengths(self.place[step.joint] - pivot)
        driving = _lengths(self.place[other] - pivot)
        return driven / driving

    def _derivative(self, number: int, joint: str) -> Array:
        """Largest movement of a joint per unit of one clearance over all directions."""

        def place(links: list[float]) -> Array:
            positions = self.model.kernel.positions(self.stroke, links)
            return np.stack(positions[joint], axis=-1)

        return self._largest(number, place)

    def _of_output(self, number: int) -> Array:
        """The same of the output, as a movement of its joint."""
        kernel = self.model.kernel
        moved = self._largest(number, lambda links: kernel.output(self.stroke, links)[:, None])
        return moved / self.output_factor()

    def _largest(self, number: int, place: Callable[[list[float]], Array]) -> Array:
        at = 2 * self.model.joint_numbers.index(number)

        def moved_by(axis: int, step: float) -> Array:
            links = self.model.kernel.no_clearance()
            links[at + axis] = step
            return place(links)

        def slope(axis: int) -> Array:
            return (moved_by(axis, STEP) - moved_by(axis, -STEP)) / (2 * STEP)

        jacobian = np.stack([slope(0), slope(1)], axis=-1)
        largest: Array = np.linalg.norm(jacobian, 2, axis=(-2, -1))
        return largest


def _lengths(vectors: Array) -> Array:
    lengths: Array = np.linalg.norm(vectors, axis=-1)
    return lengths


def _unit(vectors: Array) -> Array:
    return vectors / _lengths(vectors)[..., None]
