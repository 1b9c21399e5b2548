"""What to restore: all subsets of all gears as one array, the best checked exactly; and what
re-rigging would do.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from mlg_troubleshoot.arrays import Array, Mask, Places
from mlg_troubleshoot.decision.assessment import RepairKind, RepairSet, Rigging, UncertaintyBudget
from mlg_troubleshoot.decision.case import Cases, exact_chance
from mlg_troubleshoot.decision.plan import minutes_to_measure, minutes_to_restore
from mlg_troubleshoot.decision.prediction import Prediction, model_uncertainty
from mlg_troubleshoot.decision.second_order import Response, responses
from mlg_troubleshoot.decision.verdict_rule import CONFORMANCE, SCORE, normal_cdf
from mlg_troubleshoot.gear.gear import Gear

# Repair sets that are shown, and gears searched at once: more do not fit the cache. [1]
_SHOWN = 5
_ROWS = 32
# Within this of the conformance limit a subset counts as about sufficient: how far the expansion
# may be off. [in]
_ABOUT_IN = 5e-4
# A reading less than this above a new part: restoring the joint gains nothing. [in]
_AS_NEW_IN = 1e-4


@dataclass(frozen=True, slots=True, eq=False)
class Subsets:
    """All subsets of a gear's joints, the quickest to restore first, then the smallest.

    Attributes
    ----------
    members : ndarray of bool, shape (subsets, joints)
        Which joints each holds.
    weights : ndarray, shape (subsets, joints)
        The same as 0 and 1, for sums. [1]
    minutes : ndarray, shape (subsets,)
        Minutes to restore them. [min]
    binary : ndarray of int, shape (subsets,)
        Each as a number, its joints being the digits from the last on.
    alike : ndarray of int, shape (subsets,)
        The same number for subsets of equally many joints in equal minutes.
    joints : sequence of tuple of int
        Numbers of the joints of each.
    to_measure : sequence of float
        Minutes to read them. [min]
    """

    members: Mask
    weights: Array
    minutes: Array
    binary: Places
    alike: Places
    joints: Sequence[tuple[int, ...]]
    to_measure: Sequence[float]


@lru_cache(maxsize=4)
def subsets_of(gear: Gear) -> Subsets:
    """Enumerate the subsets of a gear's joints in the order of their minutes."""
    n = len(gear.joints)
    members = ((np.arange(2**n)[:, None] >> np.arange(n)) & 1).astype(bool)
    numbers = np.array(gear.joint_numbers)
    minutes = np.array([minutes_to_restore(gear, numbers[row].tolist()) for row in members])
    order = np.lexsort((members.sum(axis=1), np.round(minutes, 6)))
    members = members[order]
    minutes = minutes[order]
    joints = [tuple(numbers[row].tolist()) for row in members]
    keys = np.column_stack([np.round(minutes, 6), members.sum(axis=1)])
    alike = np.cumsum(np.r_[0, np.any(np.diff(keys, axis=0) != 0.0, axis=1)])
    return Subsets(
        members,
        members.astype(float),
        minutes,
        order,
        alike,
        joints,
        [minutes_to_measure(gear, each) for each in joints],
    )


def _surest(table: Subsets, slack_in: Array, among: Mask) -> Places:
    """The quickest of some subsets; of equally many joints in equal minutes the one with most
    slack; −1 if none.
    """
    first = np.argmax(among, axis=1)
    rows = np.arange(len(among))
    alike = among & (table.alike[first][:, None] == table.alike)
    # Rounded: both ends of one link leave the same, and rounding noise must not choose between
    # them.
    found = np.argmax(np.where(alike, np.round(slack_in, 7), -np.inf), axis=1)
    return np.where(among[rows, first], found, -1)


def removable(cases: Cases) -> Mask:
    """Joints that can be restored with a gain: measured, and worn beyond a new part."""
    return (
        cases.measured
        & cases.restorable
        & (cases.filled(0.0) > cases.gear.new_parts_in + _AS_NEW_IN)
    )


def search(cases: Cases, worst_in: Array, u_clearances_in: Array) -> Array:
    """How far each subset, restored, stays inside the conformance limit, (n, subsets): margin less
    worst case less its guard band, unmeasured joints at their limit. [in]

    By the second-order expansion, anchored at the exact worst case `worst_in`; −inf for a subset
    that restores what is new or unmeasured, or leaves a joint over its limit.
    """
    table = subsets_of(cases.gear)
    linkages = responses(cases.gear)
    worn = removable(cases)
    now = cases.filled(cases.gear.limits_in)
    less = np.where(worn, now - cases.gear.new_parts_in, 0.0)
    over = cases.over_limit & cases.restorable
    # A subset must contain every joint over its limit, and no joint that gains nothing.
    barred = (~worn).astype(float) @ table.weights.T + over.astype(float) @ (
        1.0 - table.weights.T
    ) > 0.0
    # Restoring a clearance also lowers the slopes, and so the uncertainty from the other readings.
    readings = (cases.gauge_u_in * cases.measured) ** 2
    slack = np.empty(barred.shape)
    for start in range(0, len(cases), _ROWS):
        part = slice(start, start + _ROWS)
        some = now[part]
        gone = less[part]
        members = _restored_worst(linkages, some, gone)
        geometry = _variance(members)[table.binary]
        first = members[0, table.binary]
        falls = first[0] - first
        after = worst_in[part] - falls
        # What the expansion misses grows with the square of the drop.
        square = (falls / np.maximum(falls[-1], 1e-12)) ** 2
        after += _third_order(cases, some - gone, after[-1]) * square
        model = model_uncertainty(after, cases.residual_u_in)
        gauges = u_clearances_in[part] ** 2 - _variance_drop(
            linkages[0], table, some, gone, readings[part]
        )
        u = np.sqrt(np.maximum(gauges, 0.0) + cases.margin_u_in[part] ** 2 + geometry + model**2)
        slack[part] = (cases.margin_in[part] - after - SCORE * u).T
    return np.where(barred | ~np.isfinite(slack), -np.inf, slack)


def _restored_worst(linkages: Sequence[Response], now_in: Array, less_in: Array) -> Array:
    """Worst case with each subset restored, by the expansion, (linkages, subsets, n): the subsets
    as binary numbers, each made of the one without its last joint. [in]
    """
    sense, magnitude, slopes, curvature = (
        np.array(each)
        for each in (
            [linkage.sense(now_in) for linkage in linkages],
            [linkage.magnitude(now_in) for linkage in linkages],
            [linkage.slopes(now_in) for linkage in linkages],
            [linkage.worst_curvature for linkage in linkages],
        )
    )
    less = less_in.T
    count = len(less)
    worst = np.empty((len(linkages), 2**count, len(now_in)))
    worst[:, 0] = magnitude
    added = np.empty_like(worst[:, : 2 ** (count - 1)])
    for j in range(count):
        bend = sense * less[j]
        added[:, 0] = (0.5 * bend * curvature[:, j, j, None] - slopes[:, :, j]) * less[j]
        for k in range(j):
            pair = bend * curvature[:, k, j, None] * less[k]
            np.add(added[:, : 2**k], pair[:, None], out=added[:, 2**k : 2 ** (k + 1)])
        np.add(worst[:, : 2**j], added[:, : 2**j], out=worst[:, 2**j : 2 ** (j + 1)])
    return worst


def _third_order(cases: Cases, least_in: Array, expanded_in: Array) -> Array:
    """What the expansion misses with everything restored. [in]"""
    if cases.extension is not None:
        return np.zeros(len(least_in))
    reference = responses(cases.gear)[0]
    sense = reference.sense(least_in)
    links = reference.worst_links(least_in, sense)
    missed = sense * cases.gear.model.displacement(list(links)) - expanded_in
    return np.where(np.isfinite(missed), missed, 0.0)


def _variance_drop(
    linkage: Response, table: Subsets, clearance_in: Array, less_in: Array, variance_in2: Array
) -> Array:
    """What restoring each subset takes from the variance that the readings cause, to first order.
    [in²]
    """
    turned = (variance_in2 * linkage.slopes(clearance_in)) @ linkage.worst_curvature
    return 2.0 * linkage.sense(clearance_in) * (table.weights @ (less_in * turned).T)


def _variance(members: Array) -> Array:
    """Variance over the ensemble, without a copy of all of it. [in²]"""
    n = len(members)
    total = np.zeros_like(members[0])
    square = np.zeros_like(members[0])
    for member in members[1:]:
        off = member - members[0]
        total += off
        square += np.multiply(off, off, out=off)
    return np.asarray(np.maximum(square - total * total / n, 0.0) / max(n - 1, 1))


def calibrated(cases: Cases, slack_in: Array) -> Array:
    """What a search found, shifted so that it is exact for the quickest subset of each gear that is
    about sufficient. [in]
    """
    near = _surest(subsets_of(cases.gear), slack_in, slack_in >= -_ABOUT_IN)
    rows = np.flatnonzero(near > 0)
    if not len(rows):
        return slack_in
    prediction, _ = _restored(cases, rows, near[rows])
    u = prediction.standard_uncertainty(cases.margin_u_in[rows])
    exact = cases.margin_in[rows] - prediction.displacement_in - SCORE * u
    shift = np.zeros(len(cases))
    shift[rows] = np.where(np.isfinite(exact), exact - slack_in[rows, near[rows]], 0.0)
    return slack_in + shift[:, None]


def _restored(cases: Cases, rows: Places, places: Places) -> tuple[Prediction, Array]:
    """The exact prediction of some gears, each with one subset restored, and its probability."""
    some = cases.take(rows)
    now = some.filled(cases.gear.limits_in)
    after = np.where(
        subsets_of(cases.gear).members[places], np.minimum(now, cases.gear.new_parts_in), now
    )
    found = some.predict(after)
    return found, found.probability_within(some.margin_in, some.margin_u_in)


def repair_sets(cases: Cases, upper: Prediction, wanted: Places) -> list[tuple[RepairSet, ...]]:
    """Find the sets of joints which, restored, bring the worst case of the wanted gears within the
    margin; `upper`: with unmeasured joints at their limit.

    Unmeasured joints count with their limit: what holds with them at 0 sends every fifth gear back.
    Only sets that contain no smaller sufficient set are returned, the quickest first, each checked
    by the exact worst case.
    """
    result: list[tuple[RepairSet, ...]] = [()] * len(cases)
    if not len(wanted):
        return result
    some = cases.take(wanted)
    table = subsets_of(cases.gear)
    slack = search(some, upper.displacement_in[wanted], upper.u_clearances_in[wanted])
    chosen = _quickest_sets(table, calibrated(some, slack))
    rows = np.repeat(np.arange(len(wanted)), [len(places) for places in chosen])
    if not len(rows):
        return result
    sets = np.concatenate(chosen)
    prediction, p = _restored(some, rows, sets)
    for k in np.flatnonzero(p >= CONFORMANCE):
        which = sets[k]
        row = int(wanted[rows[k]])
        minutes = table.to_measure[which], float(table.minutes[which])
        moved = float(prediction.displacement_in[k])
        held = RepairSet(table.joints[which], moved, float(p[k]), *minutes, RepairKind.SURE)
        result[row] = (*result[row], held)
    return result


def _quickest_sets(table: Subsets, slack_in: Array) -> Sequence[Places]:
    """Places of the quickest sufficient subsets of each gear, none within another; none where none
    is needed.
    """
    open_sets = slack_in >= 0.0
    members = table.weights
    chosen: list[list[int]] = [[] for _ in range(len(slack_in))]
    for _ in range(_SHOWN):
        best = _surest(table, slack_in, open_sets)
        for row in np.flatnonzero(best > 0):
            chosen[row].append(int(best[row]))
        # Drop the sets that contain the set just chosen.
        open_sets &= members[best] @ members.T < members[best].sum(axis=1, keepdims=True)
    return [np.array(places, dtype=np.intp) for places in chosen]


def rigging_alternative(
    one: Cases, worst_in: tuple[float, float], budget: UncertaintyBudget
) -> Rigging:
    """Shift the plunger back by what was measured, else so that the worst cases of both senses are
    equally far.

    Re-rigging moves the range of the plunger and cannot narrow it: what remains is half the
    distance between both worst cases, or, where a measured offset is taken out, the worst case of
    the joints. The uncertainties of the decision rule stay as they are.
    """
    over, under = worst_in
    measured = float(one.plunger_in[0])
    if np.isfinite(measured):
        shift = 0.0 - measured
        left = max(over, -under)
        chance = exact_chance(one, one.filled(0.0))
    else:
        shift = -0.5 * (over + under)
        left = 0.5 * (over - under)
        chance = exact_chance(one, one.filled(0.0), shift)
    within = float(normal_cdf((one.margin_in - left) / budget.combined_in)[0])
    return Rigging(shift, left, within, float(chance[0]))
