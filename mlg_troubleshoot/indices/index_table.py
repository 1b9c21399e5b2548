"""The precomputed table of indices that goes with a gear, tied to its geometry by hashes.

Amplification index method: how a small clearance grows from joint to joint (section 3.3, Eqs. 7
to 10).

Every step of the mechanism is one of the three cases of Eq. 10. A clearance enters at the step
whose link it displaces (*current clearance*, ``csc θ``), is handed on by the next links (*previous
clearance*, ``cos φ csc θ``) and by levers and slots (*rigid body*, ``sin φ · L2/L1``).

The stage of a clearance runs from its joint to the first joint of a higher number that moves:
A_i,i+1 of Eq. 9; where a guide moves, to the output. The two ends of one link act alike (Fig. 10),
so both have the stage of the upstream end. Differs from the paper: a fixed pivot that has a
clearance is not a case of Eq. 10, and has its derivative all the same.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Annotated, Any, Literal

import msgspec
import numpy as np
from msgspec import Meta

from mlg_troubleshoot.arrays import STEP, Array, Wholes, central_slopes, central_steps, frozen
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
    Guided,
    Mechanism,
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


def write_index_table(table: IndexTable, path: Path) -> None:
    """Write a table of indices, whole or not at all: over such a table only, through no link."""
    if path.is_symlink():
        raise GearFileError(f"{path.name}: is a link, which no table replaces", "Remove the link.")
    if path.exists():
        read_json(path, IndexTable, "")
    try:
        text = json.dumps(msgspec.to_builtins(table), indent=1, allow_nan=False) + "\n"
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

    The three cases of Eq. 10 are derivatives: what a joint moves per clearance (*current*), or per
    movement of the joint before it (*previous*, *rigid body*). Both are taken as such, by central
    differences.

    model: another linkage of the same gear, else the reference.
    """
    linkage = gear.model if model is None else model
    mechanism = linkage.mechanism
    kernel = linkage.kernel
    numbers = {joint.point: joint.number for joint in gear.joints}
    stroke = frozen(np.linspace(*linkage.stroke, n_strokes))
    both = stroke + STEP * np.array([[1.0], [-1.0]])
    speed = {
        joint: _lengths(central_slopes(_stacked(place, both.shape))[0])
        for joint, place in kernel.positions(both, kernel.no_clearance()).items()
    }
    factor = _per_length(mechanism)
    has_guides = any(isinstance(step, Guided) for step in mechanism.steps)
    stage = []
    onward = []
    of_maxima = []
    for number in gear.joint_numbers:
        first = next(group[0] for group in mechanism.alike if number in group)
        path = _path(mechanism, first)
        after = (i for i, step in enumerate(path) if numbers.get(step.joint, 0) > first)
        end = len(path) - 1 if has_guides else next(after, len(path) - 1)
        links: list[Any] = kernel.no_clearance()
        at = 2 * linkage.joint_numbers.index(first)
        links[at : at + 2] = central_steps(2).T[:, :, None]
        shape = 4, n_strokes
        if has_guides:
            place = _stacked([kernel.output(stroke, links) / factor], shape)
        else:
            place = _stacked(kernel.positions(stroke, links)[path[end].joint], shape)
        # The largest over all directions of the clearance.
        stage.append(np.linalg.norm(central_slopes(place), 2, axis=(0, 2)))
        later = [speed[step.joint] / speed[needs(step)[0]] for step in path[end + 1 :]]
        onward.append(np.prod([np.ones(n_strokes), *later], axis=0))
        of_maxima.append(float(np.prod([each.max() for each in later])))
    return Amplification(
        gear.joint_numbers,
        stroke,
        frozen(stage),
        frozen(onward),
        frozen(of_maxima),
        abs(linkage.rate) * factor,
        frozen(linkage.plunger_amplification()),
    )


def _path(mechanism: Mechanism, number: int) -> list[Step]:
    """The steps from the one whose link or pivot a clearance displaces to the output, each driven
    by the one before.
    """
    entry = next(
        step
        for step in mechanism.steps
        if number
        in (*step.virtual_links, *(mechanism.point(name).virtual_link for name in needs(step)))
    )
    back: list[Step] = []
    step = mechanism.step(mechanism.output.joint)
    while step is not None and step != entry:
        back.append(step)
        step = mechanism.step(needs(step)[0])
    return [entry] if step is None else [entry, *reversed(back)]


def _per_length(mechanism: Mechanism) -> float:
    """What the output moves per movement of its joint: 1 for a position. [1 or rad/in]"""
    output = mechanism.output
    if output.kind == "position":
        return 1.0
    ends = map(mechanism.reference_in_space, (output.joint, output.pivot))
    return float(1.0 / _lengths(np.subtract(*ends)))


def _stacked(parts: Sequence[Array], shape: tuple[int, ...]) -> Array:
    return np.stack([np.broadcast_to(part, shape) for part in parts], axis=-1)


def _lengths(vectors: Array) -> Array:
    lengths: Array = np.linalg.norm(vectors, axis=-1)
    return lengths
