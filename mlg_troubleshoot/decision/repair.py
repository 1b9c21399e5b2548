"""What to restore: all subsets of a gear by the expansion, the best checked exactly; and what
re-rigging would do.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache

import numpy as np

from mlg_troubleshoot.arrays import Array, Mask, Places
from mlg_troubleshoot.decision.assessment import RepairKind, RepairSet, Rigging, UncertaintyBudget
from mlg_troubleshoot.decision.belief import Belief
from mlg_troubleshoot.decision.case import Cases, exact_chance
from mlg_troubleshoot.decision.plan import minutes_of
from mlg_troubleshoot.decision.prediction import Prediction, model_uncertainty
from mlg_troubleshoot.decision.second_order import responses
from mlg_troubleshoot.decision.verdict_rule import CONFORMANCE, SCORE, normal_cdf
from mlg_troubleshoot.gear.gear import Gear

# Repair sets that are shown. [1]
_SHOWN = 5
# Within this of the conformance limit a subset counts as about sufficient: how far the expansion
# may be off. [in]
_ABOUT_IN = 5e-4


@lru_cache(maxsize=4)
def subsets_of(gear: Gear) -> tuple[Mask, Array]:
    """All subsets of a gear's joints, the quickest to restore first, then the smallest, and the
    minutes of each. [min]
    """
    n = len(gear.joints)
    members = ((np.arange(2**n)[:, None] >> np.arange(n)) & 1).astype(bool)
    minutes = minutes_of(gear, members, np.zeros(n, bool))[1]
    order = np.lexsort((members.sum(axis=1), np.round(minutes, 6)))
    return members[order], minutes[order]


def restored(cases: Cases, rows: Sequence[int], sets: Sequence[Mask]) -> tuple[Cases, Prediction]:
    """Some gears, each with a set restored, unmeasured joints at their limit."""
    some = cases.take(np.array(rows))
    now = some.filled(cases.gear.limits_in)
    return some, some.predict(np.where(sets, np.minimum(now, cases.gear.new_parts_in), now))


class Sets:
    """The sets of joints that may be restored on one gear.

    Attributes
    ----------
    members : ndarray of bool, shape (sets, joints)
        Every joint over its limit is in each, and none that gains nothing.
    slack_in : ndarray, shape (sets,)
        How far the worst case stays inside the conformance limit: margin less worst case less its
        guard band, by the second-order expansion, anchored at the exact worst case. [in]
    """

    def __init__(self, cases: Cases, upper: Prediction, row: int) -> None:
        gear = cases.gear
        members, minutes = subsets_of(gear)
        allowed = ~(members & ~cases.removable[row]).any(axis=1)
        allowed &= (members | ~cases.must_restore[row]).all(axis=1)
        self.row = row
        self.members = members[allowed]
        self.minutes = minutes[allowed]
        now = np.where(cases.measured[[row]], cases.clearance_in[[row]], gear.limits_in)
        after = np.where(self.members, np.minimum(now, gear.new_parts_in), now)
        each = np.array([linkage.magnitude(after) for linkage in responses(gear)])
        reference = responses(gear)[0]
        worst = each[0] + upper.displacement_in[row] - reference.magnitude(now)
        read = (reference.slopes(after) * cases.gauge_u_in[row] * cases.measured[row]) ** 2
        variance = read.sum(axis=1) + model_uncertainty(worst, cases.extension) ** 2
        variance += cases.margin_u_in[row] ** 2
        variance += each.var(axis=0, ddof=1) if len(each) > 1 else 0.0
        # Rounded: both ends of one link leave the same, and noise must not choose between them.
        self.slack_in = np.round(cases.margin_in[row] - worst - SCORE * np.sqrt(variance), 7)

    def quickest(self, among: Mask) -> int:
        """The quickest of some; of equally many joints in equal minutes that with most slack."""
        first = int(np.argmax(among))
        size = self.members.sum(axis=1)
        alike = among & (self.minutes == self.minutes[first]) & (size == size[first])
        return int(np.argmax(np.where(alike, self.slack_in, -np.inf)))

    def sufficient(self) -> list[int]:
        """Those that suffice, the quickest first, none within another; none if none is needed."""
        left = self.slack_in >= 0.0
        found: list[int] = []
        while left.any() and len(found) < _SHOWN:
            found.append(self.quickest(left))
            left &= (self.members[found[-1]] & ~self.members).any(axis=1)
        return [k for k in found if self.members[k].any()]


def repair_sets(
    cases: Cases,
    upper: Prediction,
    wanted: Places,
    tried: Mapping[int, Mask],
    belief: Callable[[int], Belief],
) -> list[tuple[RepairSet, ...]]:
    """Find the sets of joints which, restored, bring the worst case of the wanted gears within the
    margin; `upper`: with unmeasured joints at their limit. `tried`: sets that plans restore.

    Unmeasured joints count with their limit: what holds with them at 0 sends every fifth gear back.
    Of sure sets only those that contain no smaller sufficient set are returned, the quickest first,
    each checked by the exact worst case.
    """
    result: list[tuple[RepairSet, ...]] = [()] * len(cases)
    each = [Sets(cases, upper, row) for row in wanted.tolist()]
    near = [
        (sets, sets.quickest(about))
        for sets in each
        if (about := sets.slack_in >= -_ABOUT_IN).any()
    ]
    if near:
        # Shifted so that it is exact for the quickest set that is about sufficient.
        some, after = restored(cases, [s.row for s, _ in near], [s.members[k] for s, k in near])
        guard = SCORE * after.standard_uncertainty(some.margin_u_in)
        exact = some.margin_in - after.displacement_in - guard
        for (sets, k), slack in zip(near, exact.tolist(), strict=True):
            sets.slack_in = sets.slack_in + np.nan_to_num(slack - sets.slack_in[k])
    asked = [(s.row, s.members[k], RepairKind.SURE) for s, _ in near for k in s.sufficient()]
    asked += [(row, members, RepairKind.TRY) for row, members in tried.items()]
    if not asked:
        return result
    some, after = restored(cases, [row for row, *_ in asked], [each for _, each, _ in asked])
    within = after.probability_within(some.margin_in, some.margin_u_in)
    complained = cases.beyond_margin & (cases.failed | cases.repaired)
    for (row, members, kind), moved, p in zip(
        asked, after.displacement_in.tolist(), within.tolist(), strict=True
    ):
        joints = tuple(np.array(cases.gear.joint_numbers)[members].tolist())
        sure = kind is RepairKind.SURE
        if p < CONFORMANCE if sure else joints in [each.joints for each in result[row]]:
            continue
        access, minutes = map(float, minutes_of(cases.gear, members, np.zeros_like(members)))
        stated = complained[row] or not sure
        second = belief(row).second_repair(members) if stated else None
        result[row] = (*result[row], RepairSet(joints, moved, p, access, minutes, kind, second))
    return result


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
