"""The precomputed table of indices that goes with a gear, tied to its geometry by hashes."""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mlg_troubleshoot.errors import GearFileError, OutputError
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.gear.gear_file import load_gear, shipped_gears

Array = NDArray[np.float64]
SCHEMA_VERSION = 1
# First-order indices closer than this are one rank: both ends of a link differ by less.
_SAME_RANK = 1e-4


@dataclass(frozen=True, slots=True)
class JointIndices:
    """Indices of one joint, as fractions of the variance and not normalised to 1.

    Parameters
    ----------
    joint : int
        Number of the joint.
    limit_in : float
        Upper end of its clearance's distribution. [in]
    first_order, total_order : float
        Indices of Eqs. 1 and 2. [1]
    first_order_interval, total_order_interval : tuple of float
        Their 95 % intervals. [1]
    plunger_amplification : float
        A_iP of Eq. 8 at mid-position, in the limit of small clearance. [1]
    max_amplification_index : float
        Largest stage-wise index over the release (section 4.3). [1]
    rank : int
        Place by first order, 1 the largest; joints that differ by less than 1e-4 share a place. [1]
    rank_range : tuple of int
        Least and greatest place over the ensemble of linkages. [1]
    first_order_spread, total_order_spread : tuple of float
        Least and greatest index over the ensemble. [1]
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

    Parameters
    ----------
    gear_id : str
        The gear.
    geometry_sha256, ensemble_sha256 : str
        Hashes of the geometry that the table was computed for.
    provenance : str
        Where that geometry comes from.
    seed : int
        Seed of the study.
    design : str
        Design of the study.
    evaluations, failed : int
        Solutions of the linkage, and those that did not close.
    joints : tuple of JointIndices
        One entry a joint, in the order of the mechanism.
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

    def joint(self, number: int) -> JointIndices:
        """Return the indices of a joint.

        Parameters
        ----------
        number : int
            Number of the joint.

        Returns
        -------
        JointIndices
            Its indices.

        Raises
        ------
        KeyError
            If the table has no such joint.
        """
        for entry in self.joints:
            if entry.joint == number:
                return entry
        raise KeyError(f"the table has no joint {number}")

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
        return {
            "schema_version": SCHEMA_VERSION,
            "gear": {
                "id": self.gear_id,
                "geometry_sha256": self.geometry_sha256,
                "ensemble_sha256": self.ensemble_sha256,
                "provenance": self.provenance,
            },
            "seed": self.seed,
            "design": self.design,
            "evaluations": self.evaluations,
            "failed": self.failed,
            "joints": [asdict(entry) for entry in self.joints],
        }


def ranks(first_order: Array) -> NDArray[np.int64]:
    """Place of each joint by first-order index; joints closer than 1e-4 share a place.

    Parameters
    ----------
    first_order : ndarray, shape (n_joints,)
        First-order indices. [1]

    Returns
    -------
    ndarray of int, shape (n_joints,)
        Places, 1 the largest. [1]
    """
    above = first_order[None, :] > first_order[:, None] + _SAME_RANK
    return np.asarray(1 + above.sum(axis=1), dtype=np.int64)


def rank_ranges(ensemble_first_order: Array) -> list[tuple[int, int]]:
    """Least and greatest place of each joint over several linkages.

    Parameters
    ----------
    ensemble_first_order : ndarray, shape (n_linkages, n_joints)
        First-order indices. [1]

    Returns
    -------
    list of tuple of int
        One pair a joint. [1]
    """
    places = np.array([ranks(row) for row in ensemble_first_order])
    return [(int(low), int(high)) for low, high in zip(places.min(axis=0), places.max(axis=0), strict=True)]


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
        If the table is missing, unreadable, or was computed for another geometry, ensemble or limit.
    """
    path = gear.indices_file
    try:
        raw = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise GearFileError(f"{path.name}: the table of indices is missing", _remedy(gear)) from None
    except (OSError, UnicodeDecodeError, json.JSONDecodeError) as error:
        raise GearFileError(f"{path.name}: cannot be read as JSON: {error}", _remedy(gear)) from error
    try:
        table = _from_dict(raw)
    except (KeyError, TypeError, ValueError) as error:
        raise GearFileError(f"{path.name}: is not a table of indices ({error!r})", _remedy(gear)) from error
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
        raise GearFileError(
            f"{path.name}: was computed for other joints or limits: {_differing(limits, wanted_limits)}",
            _remedy(gear),
        )
    return table


def write_index_table(table: IndexTable, path: Path) -> None:
    """Write a table of indices, whole or not at all.

    Parameters
    ----------
    table : IndexTable
        The table.
    path : Path
        The file.

    Raises
    ------
    OutputError
        If the file cannot be written.
    """
    text = json.dumps(table.as_dict(), indent=1, allow_nan=False) + "\n"
    draft = path.with_name(path.name + ".part")
    try:
        draft.write_text(text, encoding="utf-8")
        os.replace(draft, path)  # noqa: PTH105 - the same on every platform
    except OSError as error:
        raise OutputError(f"{path}: cannot be written: {error}", "Choose another folder.") from error


def _remedy(gear: Gear) -> str:
    shipped = gear.id in shipped_gears() and load_gear(gear.id).path == gear.path
    name = gear.id if shipped else str(gear.path)
    return f"Run: mlg study --gear {name} --write-table"


def _differing(found: Sequence[tuple[int, float]], wanted: Sequence[tuple[int, float]]) -> str:
    gone = set(found) ^ set(wanted)
    return ", ".join(f"joint {number} at {limit:g} in" for number, limit in sorted(gone))


def _from_dict(raw: dict[str, Any]) -> IndexTable:
    if raw["schema_version"] != SCHEMA_VERSION:
        raise ValueError(f"schema_version {raw['schema_version']}, expected {SCHEMA_VERSION}")
    joints = []
    for entry in raw["joints"]:
        pairs = {key: tuple(value) for key, value in entry.items() if isinstance(value, list)}
        joints.append(JointIndices(**{**entry, **pairs}))
    gear = raw["gear"]
    return IndexTable(
        gear_id=gear["id"],
        geometry_sha256=gear["geometry_sha256"],
        ensemble_sha256=gear["ensemble_sha256"],
        provenance=gear["provenance"],
        seed=raw["seed"],
        design=raw["design"],
        evaluations=raw["evaluations"],
        failed=raw["failed"],
        joints=tuple(joints),
    )
