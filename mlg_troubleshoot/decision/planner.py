"""The plan of each gear: the quickest way in expected minutes from what is known now to an end.

The first step follows from the verdict by the rule of the design ("The advice, and where it ends");
where it leaves a choice, expected minutes decide. What comes after the first step is the expected
course: joints that are not measured yet are taken at what is expected of them (`wear_levels`),
levels of wear by what was measured on the same gear.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from mlg_troubleshoot.arrays import Array, Mask, Places
from mlg_troubleshoot.decision import sentences
from mlg_troubleshoot.decision.assessment import RepairSet, Verdict
from mlg_troubleshoot.decision.case import Cases
from mlg_troubleshoot.decision.inspection import InvalidRow
from mlg_troubleshoot.decision.plan import (
    Action,
    End,
    Plan,
    Step,
    minutes_to_measure,
    minutes_to_restore,
)
from mlg_troubleshoot.decision.plunger_reading import Compared
from mlg_troubleshoot.decision.prediction import BatchPrediction, model_uncertainty
from mlg_troubleshoot.decision.repair import SCORE, Search, search, subsets_of
from mlg_troubleshoot.decision.second_order import responses
from mlg_troubleshoot.decision.verdict_rule import verdict
from mlg_troubleshoot.decision.wear_levels import level_chances, moments, tabled_normal_cdf
from mlg_troubleshoot.gear.gear import Gear

# Standard uncertainties that a better gauge can reach: those of bore gauges and micrometers. [in]
BETTER_GAUGES_IN = (0.0004, 0.0003)
# Readings of one round are read together until the verdict is settled with this chance. [1]
_SETTLED = 0.35
# Chance with random directions from which a failure is attributed to clearance: as large as the
# assumed chance of another cause. [1]
_OTHER_CAUSE = 0.05
# Standard scores of 10, 25, 37.5, 50, 62.5, 75 and 90 %: what a round of readings may show. [1]
_POINTS = np.array([-1.2816, -0.6745, -0.3186, 0.0, 0.3186, 0.6745, 1.2816])


def correct(row: InvalidRow) -> Plan:
    return Plan((Step(Action.CORRECT, (), 0.0, None, sentences.correct(row.correct)),), End.CORRECT)


CONFIRM = Plan((Step(Action.CORRECT, (), 0.0, None, sentences.CONFIRM),), End.CORRECT)
NOT_CLOSING = Plan((Step(Action.CORRECT, (), 0.0, None, sentences.CHECK_ENTRIES),), End.CORRECT)


@dataclass(frozen=True, slots=True, eq=False)
class Judged:
    """What the verdict found about n gears.

    order: places of the joints in the order of their rank. p_within, u_in: chance that the worst
    case is within the margin, its uncertainty against the margin. [1, in]
    """

    verdicts: Sequence[Verdict]
    batch: BatchPrediction
    plunger: Compared
    order: Places
    p_within: Array
    u_in: Array


def plans(
    cases: Cases, judged: Judged, found: Search, sets: Sequence[tuple[RepairSet, ...]]
) -> list[Plan]:
    """The expected course of each gear, step by step to its end."""
    facts = _BatchContext(cases, judged, found)
    return [_PlanBuilder(facts, i, sets[i]).plan() for i in range(len(cases))]


class _BatchContext:
    """What the plans of a batch are made from, worked out for all gears at once."""

    def __init__(self, cases: Cases, judged: Judged, found: Search) -> None:
        gear, measured, over = cases.gear, cases.measured, cases.over_limit
        plunger, ahead = judged.plunger, _UnreadJoints(cases, judged)
        self.cases, self.judged = cases, judged
        self.joints_done, self.questions = cases.joints_done, cases.questions
        self.complaint = cases.failed | ((plunger.beyond | over.any(axis=1)) & ~cases.retracted)
        open_critical = ~measured & gear.critical
        missing = np.asarray(open_critical.any(axis=1))
        candidates = np.where(missing[:, None], open_critical, ~measured)
        self.group = np.where(self.complaint[:, None], candidates, ahead.group(candidates))
        self.rest = ~measured & ~self.group
        self.read_first = _reading_is_quicker(gear, found, ahead, self.rest | self.group) | missing
        self.settled_by_plunger = (cases.failed & plunger.clears) | ~plunger.explained
        self.by_clearance = (judged.batch.chance_random > _OTHER_CAUSE) | plunger.beyond | missing
        self.after_limits = _verdicts_after_limits(cases, judged)
        self.again, self.again_u_in = _measure_again(cases, judged)
        self.expected_set, self.expected_end = _expected(cases, judged, ahead, self.complaint)


class _PlanBuilder:
    def __init__(self, facts: _BatchContext, row: int, sets: tuple[RepairSet, ...]) -> None:
        self.facts, self.row, self.sets = facts, row, sets
        self.cases, self.judged, self.gear = facts.cases, facts.judged, facts.cases.gear
        self.steps: list[Step] = []
        self.opened: frozenset[str] = frozenset()
        self.over = self._joints(self.cases.over_limit[row])

    def plan(self) -> Plan:
        """The steps in their order; each branch ends."""
        f, i = self.facts, self.row
        if not np.isfinite(self.judged.batch.lower.displacement_in[i]):
            return NOT_CLOSING
        if f.questions[i] and not self.judged.plunger.beyond[i]:
            return CONFIRM
        if f.settled_by_plunger[i]:
            return self._restore_over_limit().end(End.NOT_EXPLAINED)
        failed = self.cases.failed[i]
        if self.judged.verdicts[i] is Verdict.WITHIN_MARGIN:
            return self._restore_over_limit().end(End.NOT_EXPLAINED if failed else End.WITHIN)
        if failed and not np.isfinite(self.cases.mean_in[i]):
            minutes = self.gear.plunger_reading.value
            self.steps.append(Step(Action.READ_PLUNGER, (), minutes, None, sentences.READ_PLUNGER))
            if not f.by_clearance[i]:
                return self._restore_over_limit().end(End.NOT_EXPLAINED)
        return self._to_repair() if f.complaint[i] else self._to_verdict()

    def _to_repair(self) -> Plan:
        """A gear with a complaint: read until a repair is certain, restore, end."""
        f, i = self.facts, self.row
        unread = not self.cases.measured[i].all()
        if self.sets and not f.read_first[i]:
            best = self.sets[0]
            ranked = self._joints(np.isin(self.gear.joint_numbers, best.joints))
            return self._restore(ranked, best.predicted_displacement_in, unread).end(End.WITHIN)
        if not unread:
            return self._restore_over_limit().end(End.CANNOT_CLEAR)
        self._measure(self._joints(f.group[i]))
        if f.rest[i].any():
            self._measure(self._joints(f.rest[i]))
        expected = self._joints(f.expected_set[i])
        if expected:
            self._restore(expected, None, unread)
        return self.end(
            End.WITHIN
            if expected or f.expected_end[i] is Verdict.WITHIN_MARGIN
            else End.CANNOT_CLEAR
        )

    def _to_verdict(self) -> Plan:
        """A gear without a complaint: read until there is a verdict, restore what is over its
        limit, end.
        """
        f, i = self.facts, self.row
        found = f.after_limits[i]
        if found is Verdict.INCOMPLETE:
            self._measure(self._joints(f.group[i]))
            if f.rest[i].any() and f.expected_end[i] is not Verdict.OUTSIDE_MARGIN:
                self._measure(self._joints(f.rest[i]))
            found = f.expected_end[i]
        elif found is Verdict.INCONCLUSIVE and f.again[i].any():
            joints = self._joints(f.again[i])
            needed = float(f.again_u_in[i])
            minutes = self._open(minutes_to_measure(self.gear, joints, self.opened), joints)
            self.steps.append(
                Step(
                    Action.MEASURE_AGAIN,
                    joints,
                    minutes,
                    needed,
                    sentences.measure_again(joints, needed),
                )
            )
            inside = self.judged.batch.lower.displacement_in[i] <= self.cases.margin_in[i]
            found = Verdict.WITHIN_MARGIN if inside else Verdict.OUTSIDE_MARGIN
        ends = {Verdict.WITHIN_MARGIN: End.WITHIN, Verdict.OUTSIDE_MARGIN: End.OUTSIDE_NO_COMPLAINT}
        return self._restore_over_limit().end(ends.get(found, End.TOO_CLOSE))

    def end(self, where: End) -> Plan:
        """Go on: the plan ends."""
        failed, done = bool(self.cases.failed[self.row]), bool(self.facts.joints_done[self.row])
        text = sentences.go_on(where, failed=failed, joints_done=done)
        self.steps.append(Step(Action.CONTINUE, (), 0.0, None, text))
        return Plan(tuple(self.steps), where)

    def _measure(self, joints: tuple[int, ...]) -> None:
        minutes = self._open(minutes_to_measure(self.gear, joints, self.opened), joints)
        self.steps.append(
            Step(Action.MEASURE, joints, minutes, None, sentences.measure(self.gear, joints))
        )

    def _restore(
        self, joints: tuple[int, ...], worst_in: float | None, unread: bool
    ) -> _PlanBuilder:
        minutes = minutes_to_restore(self.gear, joints, self.opened)
        expected = bool(self.steps) and worst_in is None and joints != self.over
        text = sentences.restore(joints, self.over, worst_in, unread=unread, expected=expected)
        self.steps.append(Step(Action.RESTORE, joints, minutes, None, text))
        return self

    def _restore_over_limit(self) -> _PlanBuilder:
        return self._restore(self.over, None, False) if self.over else self

    def _open(self, minutes: float, joints: tuple[int, ...]) -> float:
        self.opened |= {self.gear.joint(n).area for n in joints}
        return minutes

    def _joints(self, places: Mask) -> tuple[int, ...]:
        """Numbers of joints in the order of their rank."""
        return tuple(self.gear.joint_numbers[j] for j in self.judged.order[self.row] if places[j])


class _UnreadJoints:
    """What to expect of the joints that are not measured, gear by gear and level of wear by level
    of wear.
    """

    def __init__(self, cases: Cases, judged: Judged) -> None:
        self.gear, self.measured = cases.gear, cases.measured
        limits, lower = self.gear.limits_in, judged.batch.lower
        share = np.where(self.measured, np.minimum(cases.filled(0.0) / limits, 1.0), 0.0)
        self.weight = level_chances(share.sum(axis=1), self.measured.sum(axis=1))
        self.worst_in = np.nan_to_num(lower.displacement_in)
        self.slopes = responses(self.gear)[0].slopes(cases.filled(0.5 * limits))
        readings = np.sqrt(np.sum((self.slopes * cases.gauge_u_in) ** 2, axis=1))
        model = model_uncertainty(cases.margin_in, cases.residual_u_in)
        u = np.sqrt(
            readings**2 + np.nan_to_num(lower.u_geometry_in) ** 2 + cases.margin_u_in**2 + model**2
        )
        self.within_in, self.outside_in = cases.margin_in - SCORE * u, cases.margin_in + SCORE * u

    def total(self, joints: Mask) -> tuple[Array, Array]:
        """Mean and standard deviation, at each level, of what some joints add to the worst case.
        [in]
        """
        mean, variance = moments()
        each = np.where(joints, self.slopes * self.gear.limits_in, 0.0)
        return each.sum(axis=1)[:, None] * mean, np.sqrt((each**2).sum(axis=1)[:, None] * variance)

    def settled(self, joints: Mask, rest: Mask) -> Array:
        """Chance that the verdict is settled once some joints are read and the rest is not. [1]"""
        mean, spread = self.total(joints)
        open_in = np.sum(np.where(rest, self.slopes * self.gear.limits_in, 0.0), axis=1)

        def below(bound_in: Array) -> Array:
            scores = (bound_in[:, None] - self.worst_in[:, None] - mean) / np.maximum(spread, 1e-9)
            return np.asarray(np.sum(self.weight * tabled_normal_cdf(scores), axis=1))

        outside = 1.0 - below(self.outside_in)
        within = below(self.within_in - open_in)
        between = np.maximum(below(self.outside_in - open_in) - below(self.within_in), 0.0)
        return outside + np.where((rest & self.gear.critical).any(axis=1), 0.0, within + between)

    def group(self, candidates: Mask) -> Mask:
        """The joints to read in one round: the fewest, most telling a minute first, that likely
        settle the verdict.
        """
        reach = self.slopes * self.gear.limits_in / self.gear.access_minutes
        # Rounded: both ends of one link are worth the same, and rounding noise must not order them.
        order = np.argsort(np.where(candidates, -np.round(reach, 9), np.inf), axis=1, kind="stable")
        chosen, done = np.zeros_like(candidates), ~candidates.any(axis=1)
        rows = np.arange(len(candidates))
        for place in range(candidates.shape[1]):
            joint = order[:, place]
            chosen[rows, joint] |= ~done & candidates[rows, joint]
            if place > 0:
                # Two at least: joints read one by one would not come to an end within twelve
                # rounds.
                done = done | (self.settled(chosen, ~self.measured & ~chosen) >= _SETTLED)
        return chosen


def _reading_is_quicker(gear: Gear, found: Search, ahead: _UnreadJoints, unread: Mask) -> Mask:
    """Whether reading all that is unread and then restoring is expected to be quicker than
    restoring now.
    """
    table = subsets_of(gear)
    minutes = np.append(table.minutes, table.minutes[-1])
    now = found.quickest()
    mean, spread = ahead.total(unread)
    at_limit = np.sum(np.where(unread, ahead.slopes * gear.limits_in, 0.0), axis=1)
    # Mean and scatter over the levels together, taken as one normal distribution at seven equally
    # likely points.
    centre = np.sum(ahead.weight * mean, axis=1)
    scatter = np.sqrt(np.sum(ahead.weight * (spread**2 + (mean - centre[:, None]) ** 2), axis=1))
    after = np.mean(
        [
            minutes[found.quickest(at_limit - np.clip(centre + z * scatter, 0.0, at_limit))]
            for z in _POINTS
        ],
        axis=0,
    )
    areas = [
        (area, np.array([joint.area == area.name for joint in gear.joints])) for area in gear.areas
    ]
    to_read = unread @ gear.access_minutes
    for area, inside in areas:
        shared = np.where(now >= 0, (table.members[now] & inside).any(axis=1), False)
        to_read = to_read + np.where(
            (unread & inside).any(axis=1) & ~shared, area.access.value, 0.0
        )
    return np.asarray(unread.any(axis=1) & ((now < 0) | (to_read + after < minutes[now])))


def _verdicts_after_limits(cases: Cases, judged: Judged) -> list[Verdict]:
    """The verdicts that stand once what is over its limit is restored."""
    verdicts = list(judged.verdicts)
    rows = np.flatnonzero(cases.over_limit.any(axis=1) & ~judged.plunger.beyond)
    if not len(rows):
        return verdicts
    some = cases.take(rows)
    p = []
    for unread in (0.0, cases.gear.limits_in):
        found = some.predict(
            np.where(some.over_limit, cases.gear.new_parts_in, some.filled(unread))
        )
        p.append(found.probability_within(some.margin_in, some.margin_u_in))
    missing = some.critical_missing
    for k, row in enumerate(rows):
        verdicts[int(row)] = verdict(
            float(p[0][k]), float(p[1][k]), critical_missing=bool(missing[k])
        )
    return verdicts


def _measure_again(cases: Cases, judged: Judged) -> tuple[Mask, Array]:
    """Joints to measure again, and how well: the least work that settles the verdict more likely
    than not.

    A new reading differs from the old one by the errors of both.
    """
    n = len(cases)
    chosen, needed = np.zeros_like(cases.measured), np.full(n, np.nan)
    rows = np.flatnonzero([v is Verdict.INCONCLUSIVE for v in judged.verdicts] & ~cases.failed)
    if not len(rows):
        return chosen, needed
    some = cases.take(rows)
    part, margin = judged.batch.lower, cases.margin_in[rows]
    slopes = responses(cases.gear)[0].slopes(some.filled(0.0))
    fixed = part.u_geometry_in[rows] ** 2 + part.u_model_in[rows] ** 2 + some.margin_u_in**2
    own = np.where(some.measured, (slopes * some.gauge_u_in) ** 2, 0.0)
    done = np.zeros(len(rows), bool)
    for better in BETTER_GAUGES_IN:
        eligible = some.measured & ~some.own_gauge & (some.gauge_u_in > better)
        worth = np.where(eligible, slopes**2 * (some.gauge_u_in**2 - better**2), 0.0)
        order = np.argsort(-np.round(worth / cases.gear.access_minutes, 12), axis=1, kind="stable")
        again = np.zeros_like(eligible)
        for place in range(eligible.shape[1]):
            joint = order[:, place]
            again[np.arange(len(rows)), joint] = eligible[np.arange(len(rows)), joint]
            left = np.sum(np.where(again, (slopes * better) ** 2, own), axis=1)
            guard = SCORE * np.sqrt(fixed + left)
            moves = np.sqrt(np.sum(np.where(again, own + (slopes * better) ** 2, 0.0), axis=1))
            off = part.displacement_in[rows] - margin
            moves = np.maximum(moves, 1e-12)
            settles = tabled_normal_cdf((off - guard) / moves) + tabled_normal_cdf(
                (-off - guard) / moves
            )
            now = ~done & again.any(axis=1) & (settles > 0.5)
            chosen[rows[now]], needed[rows[now]] = again[now], better
            done |= now
    return chosen, needed


def _expected(
    cases: Cases, judged: Judged, ahead: _UnreadJoints, complaint: Mask
) -> tuple[Mask, list[Verdict]]:
    """What will be restored, and the verdict, if every unmeasured joint is as worn as expected."""
    full = cases.filled((ahead.weight @ moments()[0])[:, None] * cases.gear.limits_in)
    sets, ends = np.zeros_like(cases.measured), list(judged.verdicts)
    rows = np.flatnonzero(
        ~cases.measured.all(axis=1) & np.isfinite(judged.batch.upper.displacement_in)
    )
    if not len(rows):
        return sets, ends
    some = cases.take(rows)
    read = replace(some, clearance_in=full[rows])
    reference = responses(cases.gear)[0]
    worst = (
        judged.batch.lower.displacement_in[rows]
        + reference.magnitude(full[rows])
        - reference.magnitude(some.filled(0.0))
    )
    for k, row in enumerate(rows):
        within = worst[k] <= ahead.within_in[row]
        between = worst[k] < ahead.outside_in[row]
        ends[row] = (
            Verdict.WITHIN_MARGIN
            if within
            else Verdict.INCONCLUSIVE
            if between
            else Verdict.OUTSIDE_MARGIN
        )
    needed = np.flatnonzero(complaint[rows])
    if len(needed):
        u_readings = judged.batch.upper.u_clearances_in[rows[needed]]
        best = search(read.take(needed), worst[needed], u_readings).quickest()
        sets[rows[needed]] = np.where(
            (best >= 0)[:, None], subsets_of(cases.gear).members[best], False
        )
    return sets, ends
