"""Which joints to restore: every subset is tried."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from mlg_troubleshoot.decision.assessment import RepairSet
from mlg_troubleshoot.decision.inspection import Inspection
from mlg_troubleshoot.decision.prediction import Extension, clearances, predict
from mlg_troubleshoot.decision.rule import CONFORMANCE
from mlg_troubleshoot.gear.gear import Gear

Array = NDArray[np.float64]

_SHOWN = 5


def access_minutes(gear: Gear, joints: Iterable[int]) -> float:
    """Time to reach a set of joints; opening an area counts once.

    Parameters
    ----------
    gear : Gear
        The gear.
    joints : iterable of int
        Numbers of the joints.

    Returns
    -------
    float
        Time. [min]
    """
    specs = [gear.joint(number) for number in joints]
    opened = {spec.area for spec in specs}
    areas = sum(area.access.value for area in gear.areas if area.name in opened)
    return areas + sum(spec.access.value for spec in specs)


def repair_sets(
    gear: Gear, inspection: Inspection, margin_in: float, extension: Extension | None = None
) -> tuple[RepairSet, ...]:
    """Find the sets of joints which, restored, bring the worst case within the margin.

    All subsets of the measured joints are tried, joints over their limit being in every one. A restored joint
    has the gear file's new-part clearance. Unmeasured joints stay at 0, as in the prediction, so a set is no
    better than that assumption. Only sets that contain no smaller sufficient set are returned.

    Parameters
    ----------
    gear : Gear
        The gear.
    inspection : Inspection
        What was measured.
    margin_in : float
        Allowed displacement. [in]
    extension : Extension, optional
        An extension of the model.

    Returns
    -------
    tuple of RepairSet
        Sufficient sets, least access time first, then fewest joints; empty if no set is sufficient, or if
        nothing need be restored.
    """
    found = clearances([inspection], gear, np.full(len(gear.joints), np.nan))[0]
    measured = np.flatnonzero(np.isfinite(found))
    mandatory = np.array([gear.joints[j].is_over_limit(float(found[j])) for j in measured], bool)
    new = np.array([joint.new_part.value for joint in gear.joints])
    codes = np.arange(2 ** len(measured))
    restored = ((codes[:, None] >> np.arange(len(measured))) & 1).astype(bool)
    restored = restored[np.all(restored[:, mandatory], axis=1)]
    after = np.tile(np.nan_to_num(found), (len(restored), 1))
    after[:, measured] = np.where(restored, np.minimum(found[measured], new[measured]), found[measured])
    n = len(after)
    prediction = predict(
        gear,
        [inspection] * n,
        after,
        np.tile(np.isfinite(found), (n, 1)),
        np.full(n, inspection.gauge_u_in),
        extension,
    )
    p = prediction.probability_within(np.full(n, margin_in), np.full(n, inspection.margin_u_in))
    numbers = np.array(gear.joint_numbers)[measured]
    if np.any(p[~restored.any(axis=1)] >= CONFORMANCE):
        return ()
    enough = [
        RepairSet(joints, float(prediction.displacement_in[row]), float(p[row]), access_minutes(gear, joints))
        for row in np.flatnonzero(p >= CONFORMANCE)
        for joints in [tuple(int(number) for number in numbers[restored[row]])]
    ]
    enough.sort(key=lambda s: (len(s.joints), s.joints))
    least: list[RepairSet] = []
    for candidate in enough:
        if not any(set(kept.joints) <= set(candidate.joints) for kept in least):
            least.append(candidate)
    least.sort(key=lambda s: (s.access_minutes, len(s.joints), -s.probability_within_margin))
    return tuple(least[:_SHOWN])
