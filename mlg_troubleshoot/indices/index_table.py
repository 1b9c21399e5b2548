"""The precomputed table of indices that goes with a gear, tied to its geometry by hashes."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from mlg_troubleshoot.arrays import Array, Wholes
from mlg_troubleshoot.datafile import MOST_ENTRIES, DataTable, read_json
from mlg_troubleshoot.errors import GearFileError
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.gear.gear_file import load_gear, shipped_gears
from mlg_troubleshoot.outputs import OutputKind, write_text

SCHEMA_VERSION = 1
# A sampled index may lie a little outside 0 to 1, its interval further.
_INDEX = {"least": -2, "most": 3}
# First-order indices closer than this are one rank: both ends of a link differ by less.
_SAME_RANK = 1e-4


@dataclass(frozen=True, slots=True)
class JointIndices:
    """Indices of one joint, as fractions of the variance and not normalised to 1.

    limit_in: upper end of its clearance's distribution. [in] first_order, total_order: indices of
    Eqs. 1 and 2. [1] first_order_interval, total_order_interval: their 95 % intervals. [1]
    plunger_amplification: A_iP of Eq. 8 at mid-position, in the limit of small clearance. [1]
    max_amplification_index: largest stage-wise index over the release (section 4.3). [1] rank:
    place by first order, 1 the largest; joints that differ by less than 1e-4 share a place. [1]
    rank_range: least and greatest place over the ensemble of linkages. [1] first_order_spread,
    total_order_spread: least and greatest index over the ensemble. [1]
    """

    joint: int
    limit_in: float
    first_order: float
    first_order_interval: tuple[float, float]
    total_order: float
    total_order_interval: tuple[float, float]
    plunger_amplification: float
    max_amplification_index: float
    rank: int
    rank_range: tuple[int, int]
    first_order_spread: tuple[float, float]
    total_order_spread: tuple[float, float]


@dataclass(frozen=True, slots=True)
class IndexTable:
    """Precomputed indices of a gear.

    geometry_sha256, ensemble_sha256: hashes of the geometry that the table was computed for.
    """

    gear_id: str
    geometry_sha256: str
    ensemble_sha256: str
    provenance: str
    seed: int
    design: str
    evaluations: int
    failed: int
    joints: tuple[JointIndices, ...]

    @property
    def first_order(self) -> Array:
        """First-order index of every joint, shape (n_joints,). [1]"""
        return np.array([entry.first_order for entry in self.joints])

    @property
    def total_order(self) -> Array:
        """Total-order index of every joint, shape (n_joints,). [1]"""
        return np.array([entry.total_order for entry in self.joints])

    def as_dict(self) -> dict[str, Any]:
        """Return the table as plain values, in the order of the JSON contract of ``mlg study``."""
        values = asdict(self)
        names = {
            "gear_id": "id",
            **{n: n for n in ("geometry_sha256", "ensemble_sha256", "provenance")},
        }
        gear = {shown: values.pop(name) for name, shown in names.items()}
        return {"schema_version": SCHEMA_VERSION, "gear": gear, **values}


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
    return [
        (int(low), int(high))
        for low, high in zip(places.min(axis=0), places.max(axis=0), strict=True)
    ]


def load_index_table(gear: Gear) -> IndexTable:
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
        raise GearFileError(f"{path.name}: the table of indices is missing", _remedy(gear))
    try:
        state = path.stat()
        table = _read_once(path, state.st_mtime_ns, state.st_size)
    except GearFileError as error:
        raise GearFileError(error.message, _remedy(gear)) from error
    for what, found, wanted in (
        ("gear", table.gear_id, gear.id),
        ("geometry", table.geometry_sha256, gear.geometry_sha256),
        ("ensemble", table.ensemble_sha256, gear.ensemble_sha256),
    ):
        if found != wanted:
            raise GearFileError(
                f"{path.name}: was computed for another {what}: {found[:16]}, not {wanted[:16]}",
                _remedy(gear),
            )
    limits = tuple((entry.joint, entry.limit_in) for entry in table.joints)
    wanted_limits = tuple((joint.number, joint.limit.value) for joint in gear.joints)
    if limits != wanted_limits:
        gone = sorted(set(limits) ^ set(wanted_limits))
        named = ", ".join(f"joint {number} at {limit:g} in" for number, limit in gone)
        raise GearFileError(
            f"{path.name}: was computed for other joints or limits: {named}", _remedy(gear)
        )
    return table


@lru_cache(maxsize=4)
def _read_once(path: Path, _changed_ns: int, _size: int) -> IndexTable:
    """A file that has not changed is not read again."""
    return _index_table(read_json(path, ""))


def _text(values: Mapping[str, Any]) -> str:
    return json.dumps(values, indent=1, allow_nan=False) + "\n"


# How every table begins, up to the name of its gear.
INDEX_TABLE = OutputKind.marked(
    "is not a table of indices",
    _text({"schema_version": SCHEMA_VERSION, "gear": {"id": ""}}).partition('""')[0],
)


def write_index_table(table: IndexTable, path: Path) -> None:
    """Write a table of indices, whole or not at all."""
    write_text(path, _text(table.as_dict()))


def _remedy(gear: Gear) -> str:
    shipped = gear.id in shipped_gears() and load_gear(gear.id).path == gear.path
    name = gear.id if shipped else str(gear.path)
    return f"Run: mlg study --gear {name} --write-table"


def _index_table(t: DataTable) -> IndexTable:
    if t.whole("schema_version") != SCHEMA_VERSION:
        raise t.fail("schema_version", str(SCHEMA_VERSION))
    gear = t.table("gear")
    return IndexTable(
        gear_id=gear.text("id"),
        geometry_sha256=gear.text("geometry_sha256"),
        ensemble_sha256=gear.text("ensemble_sha256"),
        provenance=gear.text("provenance"),
        seed=t.whole("seed", least=0),
        design=t.text("design"),
        evaluations=t.whole("evaluations", least=0),
        failed=t.whole("failed", least=0),
        joints=tuple(map(_joint_indices, t.tables("joints"))),
    )


def _joint_indices(t: DataTable) -> JointIndices:
    def indices(key: str) -> tuple[float, float]:
        return t.rising(key, **_INDEX)

    low, high = t.rising("rank_range", least=1, most=MOST_ENTRIES)
    entry = JointIndices(
        joint=t.whole("joint", least=1),
        limit_in=t.positive("limit_in"),
        first_order=t.number("first_order", **_INDEX),
        first_order_interval=indices("first_order_interval"),
        total_order=t.number("total_order", **_INDEX),
        total_order_interval=indices("total_order_interval"),
        plunger_amplification=t.number("plunger_amplification", least=0.0, most=1e6),
        max_amplification_index=t.number("max_amplification_index", least=0.0, most=1e6),
        rank=t.whole("rank", least=1, most=MOST_ENTRIES),
        rank_range=(int(low), int(high)),
        first_order_spread=indices("first_order_spread"),
        total_order_spread=indices("total_order_spread"),
    )
    t.finish()
    return entry
