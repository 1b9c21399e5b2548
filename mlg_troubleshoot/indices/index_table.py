"""The precomputed table of indices that goes with a gear, tied to its geometry by hashes."""

from __future__ import annotations

import json
from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from typing import Annotated, Any, Literal

import msgspec
import numpy as np
from msgspec import Meta

from mlg_troubleshoot.arrays import Array, Wholes
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

    schema_version: Literal[1]
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
