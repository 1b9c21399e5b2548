"""The ranked table of joints: which to inspect first, and how sure that order is."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from mlg_troubleshoot.decision.assessment import JointFinding
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.studies.table import IndexTable

Array = NDArray[np.float64]


@lru_cache(maxsize=4)
def ensemble_amplification(gear: Gear) -> Array:
    """Plunger amplification index of each joint on each linkage of the ensemble.

    Parameters
    ----------
    gear : Gear
        The gear.

    Returns
    -------
    ndarray, shape (n_linkages, n_joints)
        A_iP at mid-position, the reference first. [1]
    """
    return np.array([model.plunger_amplification() for model in gear.ensemble_models])


def rank_joints(
    gear: Gear,
    table: IndexTable,
    clearance_in: Mapping[int, float],
    allowance_in: Mapping[int, float] | None = None,
) -> tuple[JointFinding, ...]:
    """Rank the joints of one gear in the order in which to inspect them.

    Joints over their limit come first, then by contribution; an unmeasured joint counts with half its limit,
    ties go to the larger total-order index.

    Parameters
    ----------
    gear : Gear
        The gear.
    table : IndexTable
        Its precomputed indices.
    clearance_in : mapping of int to float
        Radial clearances of the measured joints. [in]
    allowance_in : mapping of int to float, optional
        How much further each joint alone may wear. [in]

    Returns
    -------
    tuple of JointFinding
        One for each joint, in the order of the joints' numbers.
    """
    assumed = np.array([clearance_in.get(j.number, 0.5 * j.limit.value) for j in gear.joints])
    over = [j.is_over_limit(clearance_in.get(j.number, 0.0)) for j in gear.joints]
    places = _places(np.array(over), ensemble_amplification(gear) * assumed, table.total_order)
    best, worst = places.min(axis=0).tolist(), places.max(axis=0).tolist()
    findings = []
    for j, joint in enumerate(gear.joints):
        clearance = clearance_in.get(joint.number)
        indices = table.joints[j]
        findings.append(
            JointFinding(
                joint=joint.number,
                name=joint.name,
                clearance_in=clearance,
                limit_in=joint.limit.value,
                over_limit=over[j],
                contribution_in=None if clearance is None else indices.plunger_amplification * clearance,
                first_order=indices.first_order,
                total_order=indices.total_order,
                plunger_amplification=indices.plunger_amplification,
                rank=int(places[0, j]),
                rank_range=(best[j], worst[j]),
                alike=gear.alike[joint.number],
                allowance_in=None if allowance_in is None else allowance_in.get(joint.number),
            )
        )
    return tuple(findings)


def _places(over: NDArray[np.bool_], contribution: Array, total_order: Array) -> NDArray[np.intp]:
    """Place of each joint on each linkage, from 1."""
    # Rounded: both ends of one link contribute alike, and rounding noise must not order them.
    keys = (-np.round(total_order, 6), -np.round(contribution, 9), ~over)
    order = np.lexsort([np.broadcast_to(key, contribution.shape) for key in keys], axis=-1)
    return np.argsort(order, axis=-1) + 1
