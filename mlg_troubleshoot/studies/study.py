"""The study of one gear: a design, indices of every joint, and their spread over the ensemble."""

from __future__ import annotations

import numpy as np

from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.studies.amplification import amplification
from mlg_troubleshoot.studies.response import worst_directions
from mlg_troubleshoot.studies.table import IndexTable, JointIndices, rank_ranges, ranks
from mlg_troubleshoot.studies.tensor import tensor_indices


def exact_table(gear: Gear, seed: int = 0) -> IndexTable:
    """Compute the table of a gear with a tensor of Gauss points, exact to the fifth degree.

    The intervals are the difference to a tensor of two points a joint, which is far wider than the error.

    Parameters
    ----------
    gear : Gear
        The gear.
    seed : int
        Kept in the table; the tensor draws nothing.

    Returns
    -------
    IndexTable
        The table.
    """
    limits = np.asarray(gear.limits_in, float)
    found = [tensor_indices(worst_directions(model, limits), limits, order=3) for model in gear.ensemble_models]
    coarse = tensor_indices(worst_directions(gear.model, limits), limits, order=2)
    reference = found[0]
    first = np.array([each.first_order for each in found])
    total = np.array([each.total_order for each in found])
    growth = amplification(gear)
    places, spans = ranks(first[0]), rank_ranges(first)
    joints = []
    for i, joint in enumerate(gear.joints):
        wide = abs(reference.first_order[i] - coarse.first_order[i])
        wide_total = abs(reference.total_order[i] - coarse.total_order[i])
        joints.append(
            JointIndices(
                joint=joint.number,
                limit_in=joint.limit.value,
                first_order=float(first[0, i]),
                first_order_interval=(float(first[0, i] - wide), float(first[0, i] + wide)),
                total_order=float(total[0, i]),
                total_order_interval=(float(total[0, i] - wide_total), float(total[0, i] + wide_total)),
                plunger_amplification=float(growth.exact[i]),
                max_amplification_index=float(growth.max_stage[i]),
                rank=int(places[i]),
                rank_range=spans[i],
                first_order_spread=(float(first[:, i].min()), float(first[:, i].max())),
                total_order_spread=(float(total[:, i].min()), float(total[:, i].max())),
            )
        )
    return IndexTable(
        gear_id=gear.id,
        geometry_sha256=gear.geometry_sha256,
        ensemble_sha256=gear.ensemble_sha256,
        provenance=gear.provenance,
        seed=seed,
        design="tensor of 3 Gauss points a joint",
        evaluations=sum(each.evaluations for each in found) + coarse.evaluations,
        failed=sum(each.failed for each in found) + coarse.failed,
        joints=tuple(joints),
    )
