"""The plan of each gear: the quickest way in expected minutes from what is known now to an end.

A gear that failed is followed by what is believed of it (`belief`): the joints, the rigging or
something else. A gear without a complaint is read until there is a verdict, and what is over its
limit is restored, nothing else. What comes after the first step is the expected course.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from mlg_troubleshoot.arrays import Array, Mask, Places
from mlg_troubleshoot.decision import sentences
from mlg_troubleshoot.decision.assessment import RepairKind, RepairSet, Verdict
from mlg_troubleshoot.decision.belief import Belief
from mlg_troubleshoot.decision.case import Cases
from mlg_troubleshoot.decision.inspection import InvalidRow, RiggingCheck
from mlg_troubleshoot.decision.plan import (
    Action,
    Basis,
    End,
    Plan,
    Step,
    how_to,
    minutes_to_measure,
    minutes_to_restore,
)
from mlg_troubleshoot.decision.plunger_reading import Compared
from mlg_troubleshoot.decision.prediction import BatchPrediction
from mlg_troubleshoot.decision.priors import PRIORS
from mlg_troubleshoot.decision.repair import removable
from mlg_troubleshoot.decision.second_order import responses
from mlg_troubleshoot.decision.verdict_rule import CONFORMANCE
from mlg_troubleshoot.gear.gauges import BETTER_GAUGES_IN

# A cause counts as excluded below this chance. [1]
_EXCLUDED = 1 - CONFORMANCE
# Joints read in one round of a gear that failed: until this share of what may be worn in the area
# is read, two at least. [1]
_TOGETHER = 0.6
# Joints beyond those over their limit that a repair to be tried may hold. [1]
_MOST_EXTRA = 2
# They are chosen among as many joints, those that move the plunger most.
_MOST_TRIED = 6
# Shares of its limit beyond which a joint is worn whatever its gauge. [1]
_SURELY_WORN = 1.5
# What one repair may be above the chance that the shop accepts over all: most are far below it, and
# the average of simulated gears stays below it. [1]
_FOR_ONE_REPAIR = 4


def _doubted(cases: Cases, beliefs: Sequence[Belief | None]) -> Mask:
    """Readings over their limits that are taken again: within two standard uncertainties of the
    limit, or, on a gear that failed, at odds with the plunger; of no joint far beyond its limit.
    """
    gear = cases.gear
    read = cases.filled(0.0)
    near = read - gear.limits_in <= 2.0 * cases.gauge_u_in
    contradicts = np.zeros_like(near)
    rows = np.flatnonzero(cases.over_limit.any(axis=1) & np.isfinite(cases.plunger_in))
    for row in rows.tolist():
        belief = beliefs[row]
        if belief is not None:
            contradicts[row] = 1.0 - belief.worn > gear.second_repair_chance.value
    may_be = cases.over_limit & cases.reachable & ~cases.own_gauge
    may_be &= read <= _SURELY_WORN * gear.limits_in
    return np.asarray(may_be & (near | contradicts))


def _correction(text: str) -> Plan:
    return Plan((Step(Action.CORRECT, (), 0.0, None, text),), End.CORRECT)


def correct(row: InvalidRow) -> Plan:
    return _correction(sentences.correct(row.correct))


CONFIRM, NOT_CLOSING = map(_correction, (sentences.CONFIRM, sentences.CHECK_ENTRIES))


@dataclass(frozen=True, slots=True, eq=False)
class Judged:
    """What the verdict found about n gears.

    Attributes
    ----------
    order : ndarray of int, shape (n, joints)
        Places of the joints in the order of their rank.
    p_within : ndarray, shape (n,)
        Chance that the worst case is within the margin. [1]
    u_in : ndarray, shape (n,)
        Uncertainty of the worst case against the margin. [in]
    """

    verdicts: Sequence[Verdict]
    bases: Sequence[Basis]
    batch: BatchPrediction
    plunger: Compared
    order: Places
    p_within: Array
    u_in: Array


def plans(
    cases: Cases,
    judged: Judged,
    beliefs: Sequence[Belief | None],
    sets: Sequence[tuple[RepairSet, ...]],
) -> list[tuple[Plan, tuple[RepairSet, ...]]]:
    """The plan of each gear, and the repairs that it chose from."""
    facts = _BatchContext(cases, judged, beliefs)
    courses = [_PlanBuilder(facts, i, sets[i]) for i in range(len(cases))]
    planned = [course.plan() for course in courses]
    _predict_tried(cases, courses)
    return [(plan, course.sets) for plan, course in zip(planned, courses, strict=True)]


def _predict_tried(cases: Cases, courses: Sequence[_PlanBuilder]) -> None:
    """Predict the gears after the repairs to be tried, all at once: the plans need no more than
    their chances.
    """
    rows = [i for i, course in enumerate(courses) if course.tried is not None]
    if not rows:
        return
    some = cases.take(np.array(rows))
    numbers = np.array(cases.gear.joint_numbers)
    tried = [course.tried for course in courses if course.tried is not None]
    members = np.array([np.isin(numbers, each.joints) for each in tried])
    now = some.filled(cases.gear.limits_in)
    after = some.predict(np.where(members, np.minimum(now, cases.gear.new_parts_in), now))
    within = after.probability_within(some.margin_in, some.margin_u_in)
    for k, row in enumerate(rows):
        found = replace(
            tried[k],
            predicted_displacement_in=float(after.displacement_in[k]),
            probability_within_margin=float(within[k]),
        )
        courses[row].sets = (*courses[row].sets, found)


class _BatchContext:
    """What the plans of a batch are made from, worked out for all gears at once."""

    def __init__(self, cases: Cases, judged: Judged, beliefs: Sequence[Belief | None]) -> None:
        gear = cases.gear
        self.cases = cases
        self.judged = judged
        self.beliefs = beliefs
        amplification = responses(gear)[0].amplification
        # Amplification of each joint as a share of the largest. [1]
        self.leverage: Array = np.asarray(amplification / amplification.max())
        self.numbers = gear.joint_numbers
        self.restore_min = np.array([joint.restore.value for joint in gear.joints])
        self.access_min = np.array([area.access.value for area in gear.areas])
        self.inside = np.array(
            [[joint.area == area.name for joint in gear.joints] for area in gear.areas]
        )
        self.complained = cases.complained
        self.over = cases.over_limit & cases.restorable
        self.removable = removable(cases)
        self.open: Mask = np.asarray(~cases.measured & cases.reachable)
        self.doubted = _doubted(cases, beliefs)
        u = np.hypot(cases.plunger_u_in, cases.margin_u_in)
        apart = np.abs(np.abs(cases.plunger_in) - cases.margin_in)
        self.at_edge: Mask = np.asarray(apart < 2.0 * u)


class _PlanBuilder:
    """The course of one gear: each branch appends its steps and ends."""

    def __init__(self, facts: _BatchContext, row: int, sets: tuple[RepairSet, ...]) -> None:
        self.facts = facts
        self.row = row
        self.sets = sets
        self.cases = facts.cases
        self.judged = facts.judged
        self.gear = facts.cases.gear
        self.numbers = facts.numbers
        self.inspection = self.cases.inspections[row]
        self.steps: list[Step] = []
        self.tried: RepairSet | None = None
        # Chance of a second repair up to which one repair is taken for enough. [1]
        self.accepted = _FOR_ONE_REPAIR * self.gear.second_repair_chance.value
        self.taken_again = False
        self.opened: frozenset[str] = frozenset()
        self.over_limit = self._joints(self.cases.over_limit[row])
        self.over = self._joints(facts.over[row])
        self.read_plunger = bool(np.isfinite(self.cases.plunger_in[row]))
        self.looked = self.inspection.rigging_checked not in (None, RiggingCheck.NO)

    @property
    def belief(self) -> Belief:
        """What is believed of a gear that failed, or failed before its repair."""
        found = self.facts.beliefs[self.row]
        assert found is not None
        return found

    def plan(self) -> Plan:
        """The steps in their order."""
        i = self.row
        if not np.isfinite(self.judged.batch.lower.displacement_in[i]):
            return NOT_CLOSING
        if self.inspection.unit_question and not self.judged.plunger.beyond[i]:
            return CONFIRM
        found = self._course()
        return replace(found, open_question=self._open_question(found))

    def _course(self) -> Plan:
        i = self.row
        if self.cases.off_down_lock[i]:
            self._check_rigging(again=True)
        if self.cases.failed[i]:
            return self._failed()
        beyond = bool(self.judged.plunger.beyond[i])
        if self.facts.complained[i] or (self.inspection.is_repaired and beyond):
            return self._repaired()
        return self._without_complaint()

    def _without_complaint(self) -> Plan:
        """What is over its limit is restored; a reading of the plunger may clear the gear, and
        nothing else is required.
        """
        i = self.row
        self._restore_over_limit()
        if self.over != self.over_limit:
            return self._stop_for_today()
        if self.judged.verdicts[i] is Verdict.WITHIN_MARGIN and not (
            self.over and self.judged.bases[i] is Basis.MEASURED
        ):
            return self._done()
        if not self.read_plunger or self.over or self.inspection.is_plunger_in_doubt:
            minutes = self.gear.plunger_reading.value
            text = sentences.read_to_clear(minutes)
            self._step(Action.READ_PLUNGER, minutes, text, required=False)
            return self._done()
        beyond = bool(self.judged.plunger.beyond[i])
        return self._end(End.OUTSIDE_NO_COMPLAINT if beyond else End.TOO_CLOSE)

    def _repaired(self) -> Plan:
        """A gear that failed and was repaired: the plunger says whether the repair holds."""
        beyond = self.judged.plunger.beyond[self.row]
        if self.over:
            return self._try(self.over)
        if self.over_limit:
            # The plunger is read after these are restored, whatever it reads before.
            return self._restore_over_limit()._stop_for_today()
        if self.read_plunger and beyond and not self._again():
            return self._failed()
        if not self.read_plunger or self._again():
            self._read_the_plunger(again=self.read_plunger)
        return self._retract()

    def _again(self) -> bool:
        """Whether the plunger is read again: read only once and at the edge of its margin, or
        perhaps before the repair.
        """
        readings = self.inspection.standing_readings_in
        at_edge = bool(self.facts.at_edge[self.row]) and len(readings) < 2
        return at_edge or self.inspection.is_plunger_in_doubt

    def _failed(self) -> Plan:
        """A gear that failed: the plunger first, then whatever is likeliest per minute."""
        joints, rigging, elsewhere = self.belief.chances
        if not self.read_plunger or self._again():
            self._read_the_plunger(again=self.read_plunger)
        if not self.read_plunger:
            if joints < elsewhere:
                return self._restore_over_limit()._end(End.NOT_EXPLAINED)
            following = self._worth_reading(None)
            if following:
                return self._read_and_restore(following)
            return self._to_repair(joints, rigging)
        if joints + rigging < _EXCLUDED:
            return self._elsewhere()
        return self._to_repair(joints, rigging)

    def _elsewhere(self) -> Plan:
        """The joints are not the cause; what is over its limit is restored nevertheless."""
        if self.over and self.over == self.over_limit:
            return self._try(self.over)
        return self._restore_over_limit()._end(End.NOT_EXPLAINED)

    def _to_repair(self, joints: float, rigging: float) -> Plan:
        f = self.facts
        i = self.row
        best = self._repair()
        unread = self._joints(f.open[i])
        following = self._worth_reading(best) if unread else ()
        if following:
            minutes = minutes_to_measure(self.gear, unread, self.opened)
        elif best is not None:
            # In vain are the sound joints, and the plunger's reading after the repair.
            sound = [n for n in best.joints if n not in self.over_limit]
            minutes = minutes_to_restore(self.gear, sound, self.opened)
            minutes += self.gear.plunger_reading.value
        else:
            minutes = np.inf
        if not self.looked and self.read_plunger:
            check = self.gear.rigging_check.value
            # No sound joint is restored before the rigging was looked at, unless it is excluded.
            tears = not following and best is not None and set(best.joints) > set(self.over_limit)
            worth = rigging > _EXCLUDED and (tears or rigging * minutes > joints * check)
            # What is over its limit is restored whatever the cause: a reading of it in doubt is
            # taken again in any case, so before the check, which it may spare.
            again = (worth or not following) and self._reread()
            if worth and (rigging > 0.5 or not again):
                self._check_rigging()
                if rigging > 0.5:
                    return self._restore_over_limit()._end(End.NOT_EXPLAINED)
                joints /= 1.0 - (1.0 - PRIORS.overlooked) * rigging
        if following:
            return self._read_and_restore(following)
        # A failure of the joints that is sent away stays outside its margin: against a rigging
        # that was looked at, the likelier cause decides.
        likely = joints >= 0.5 and self.belief.chances[2] <= 1.0 - PRIORS.usual
        if best is not None and (likely or set(best.joints) <= set(self.over_limit)):
            return self._try(best.joints)
        if best is not None:
            return self._elsewhere()
        if joints < 0.5 or not self.over:
            explained = joints >= 0.5
            return self._end(End.CANNOT_CLEAR if explained else End.NOT_EXPLAINED)
        return self._try(self.over)

    def _read_and_restore(self, following: tuple[int, ...]) -> Plan:
        """Read joints, then the expected repair."""
        self._measure(following)
        worn = self.belief.worn * self.facts.leverage
        numbers = self.numbers
        likely = sorted(following, key=lambda n: -worn[numbers.index(n)])
        # What is over its limit already does not suffice, or there would be nothing to read: one
        # joint more is restored on average.
        joints = (*self.over, *likely[:1])
        without = [n for n in joints if not self.cases.restorable[self.row, numbers.index(n)]]
        if without:
            return self._restore_over_limit()._stop_for_today(without)
        return self._try(joints, expected=True)

    def _repair(self) -> RepairSet | None:
        """The quickest repair after which a second one is at most as likely as the shop accepts;
        None without one.

        Offered are what is over its limit with the fewest more, and what holds in the worst case.
        What is over its limit is restored in any case, if not today: until then no reading is worth
        more than it is with every spare at hand.
        """
        f = self.facts
        i = self.row
        over_limit = self.cases.over_limit[i]
        over = np.flatnonzero(over_limit)
        more = np.flatnonzero(f.removable[i] & ~over_limit)
        more = more[
            np.argsort(-np.abs(self.belief.states.moved_in[:, more]).mean(axis=0), kind="stable")
        ][:_MOST_TRIED]
        chosen = [
            (*over, *extra)
            for count in range(_MOST_EXTRA + 1)
            for extra in combinations(more, count)
        ]
        chosen = [places for places in chosen if places]
        if not chosen:
            return None
        members = np.zeros((len(chosen), len(self.gear.joints)), bool)
        for row, places in enumerate(chosen):
            members[row, list(places)] = True
        second = self.belief.states.second_repair(members)
        shut = [k for k, area in enumerate(self.gear.areas) if area.name not in self.opened]
        opened = (members[:, None, :] & f.inside[shut]).any(axis=2)
        minutes = members @ f.restore_min + opened @ f.access_min[shut]
        sure = [
            each
            for each in self.sets
            if (each.second_repair_probability or 0.0) <= self.accepted
            and set(self.over_limit) <= set(each.joints)
        ]
        enough = np.flatnonzero(second <= self.accepted)
        if len(enough):
            best = enough[np.lexsort((second[enough], np.round(minutes[enough], 6)))[0]]
        elif sure or not len(over):
            return sure[0] if sure else None
        elif f.open[i].any():
            return None
        else:
            # Nothing is left to read: what is over its limit is restored, and the plunger decides.
            best = 0
        if second[best] > 0.5 and not len(over):
            return None
        joints = tuple(np.array(self.numbers)[members[best]].tolist())
        tried = RepairSet(
            joints,
            np.nan,
            np.nan,
            minutes_to_measure(self.gear, joints),
            minutes_to_restore(self.gear, joints),
            RepairKind.TRY,
            float(second[best]),
        )
        quicker = [s for s in sure if s.minutes < tried.minutes]
        today = self.over == self.over_limit
        if today and all(set(each.joints) != set(tried.joints) for each in self.sets):
            self.tried = tried
        return quicker[0] if quicker else tried

    def _worth_reading(self, best: RepairSet | None) -> tuple[int, ...]:
        """The joints to read next; none where a repair is quicker than what reading may save."""
        f = self.facts
        i = self.row
        # A worn joint that hardly moves the plunger is hardly the cause.
        # Rounded: both ends of one link are worth the same, and noise must not order them.
        worn = np.round(self.belief.worn * f.leverage, 4)
        chosen: tuple[int, ...] = ()
        most = -1.0
        for area in self.gear.areas:
            inside = [
                j
                for j, joint in enumerate(self.gear.joints)
                if f.open[i, j] and joint.area == area.name
            ]
            inside.sort(key=lambda j: -worn[j] / self.gear.joints[j].access.value)
            total = sum(worn[j] for j in inside)
            taken = 0.0
            group: list[int] = []
            for j in inside:
                group.append(j)
                taken += worn[j]
                if len(group) > 1 and taken >= _TOGETHER * total:
                    break
            numbers = tuple(self.numbers[j] for j in group)
            if not group:
                continue
            rate = taken / minutes_to_measure(self.gear, numbers, self.opened)
            if rate > most:
                chosen = numbers
                most = rate
        if best is None or not chosen:
            return chosen
        sound = [n for n in best.joints if n not in self.over_limit]
        if not sound:
            return ()
        # A reading saves the sound joints where it finds one worn that is enough without them, or
        # none, after which what is over its limit may be enough. It opens no area that the repair
        # opens anyway.
        places = np.array([self.numbers.index(n) for n in chosen])
        second = self.belief.states.second_once_read(self.cases.over_limit[i], places)
        worn = self.belief.worn[places]
        spared = 1.0 - float(np.prod(1.0 - worn * (1.0 - second[:-1])))
        if second[-1] <= self.accepted:
            spared += float(np.prod(1.0 - worn))
        anyway = self.opened | {self.gear.joint(n).area for n in (*self.over_limit, *chosen)}
        saved = spared * minutes_to_restore(self.gear, sound, anyway)
        opened = self.opened | {self.gear.joint(n).area for n in best.joints}
        return chosen if saved > minutes_to_measure(self.gear, chosen, opened) else ()

    def _left_unread(self) -> list[int]:
        """Joints that nobody read and that no step reads."""
        asked = {n for step in self.steps for n in step.joints}
        return [n for n in self._joints(~self.cases.measured[self.row]) if n not in asked]

    def _try(self, joints: Sequence[int], *, expected: bool = False) -> Plan:
        """Restore, read the plunger, retract the gear: done. Where something over its limit must
        wait for its spare, that comes after it.
        """
        waits = self.over != self.over_limit
        if waits and not expected:
            return self._restore_over_limit()._stop_for_today()
        ranked = self._joints(np.array([n in joints for n in self.numbers]))
        self._restore(ranked, expected=expected)
        if waits:
            return self._stop_for_today()
        self._read_the_plunger()
        return self._retract()

    def _read_the_plunger(self, *, again: bool = False) -> None:
        in_doubt = self.inspection.is_plunger_in_doubt
        text = sentences.READ_PLUNGER_AGAIN if again and not in_doubt else sentences.READ_PLUNGER
        self._step(Action.READ_PLUNGER, self.gear.plunger_reading.value, text)

    def _retract(self) -> Plan:
        self._step(Action.RETRACT, self.gear.retraction.value, sentences.RETRACT)
        return self._done()

    def _stop_for_today(self, if_worn: Sequence[int] = ()) -> Plan:
        """What is over its limit, or may be found worn, cannot be restored today."""
        left = [n for n in self.over_limit if n not in self.over]
        text = sentences.stop_for_today([*left, *if_worn], self._barred())
        self._step(Action.CONTINUE, 0.0, text)
        return Plan(tuple(self.steps), End.CANNOT_CLEAR)

    def _barred(self) -> tuple[int, ...]:
        """Joints that the day keeps from being read, or restored on a gear that failed."""
        cases = self.cases
        i = self.row
        unread = ~cases.measured[i] & ~cases.reachable[i]
        return self._joints(unread | ~cases.restorable[i] if cases.failed[i] else unread)

    def _done(self) -> Plan:
        if self.over != self.over_limit:
            return self._stop_for_today()
        restored = any(step.action is Action.RESTORE for step in self.steps)
        text = sentences.done(
            len(self._left_unread()), repaired=restored or self.inspection.is_repaired
        )
        end = End.DONE
        if len(self.steps) == 0 and self.judged.bases[self.row] is Basis.PREDICTED:
            end = End.WITHIN
        self._step(Action.DONE, 0.0, text, required=False)
        return Plan(tuple(self.steps), end)

    def _check_rigging(self, *, again: bool = False) -> _PlanBuilder:
        checked = any(step.action is Action.CHECK_RIGGING for step in self.steps)
        if not checked and (again or not self.looked):
            beyond = bool(self.judged.plunger.beyond[self.row])
            as_new = self._joints(
                self.cases.measured[self.row]
                & (self.cases.filled(0.0)[self.row] <= 2.0 * self.gear.new_parts_in)
            )
            text = sentences.check_rigging(
                float(self.cases.plunger_in[self.row]) if beyond else None,
                () if self.inspection.is_repaired or not self.cases.failed[self.row] else as_new,
            )
            self._step(Action.CHECK_RIGGING, self.gear.rigging_check.value, text)
        return self

    def _end(self, where: End) -> Plan:
        """Go on: the plan ends."""
        if where is End.CANNOT_CLEAR and self._barred():
            return self._stop_for_today()
        text = sentences.go_on(
            where,
            self.inspection,
            failed=bool(self.cases.failed[self.row]),
            beyond=bool(self.judged.plunger.beyond[self.row]),
            looked=self.looked,
        )
        required = where is not End.TOO_CLOSE
        self._step(Action.CONTINUE, 0.0, text, required=required)
        return Plan(tuple(self.steps), where)

    def _step(
        self,
        action: Action,
        minutes: float,
        text: str,
        joints: tuple[int, ...] = (),
        gauge_u_needed_in: float | None = None,
        *,
        required: bool = True,
    ) -> None:
        how = how_to(self.gear, action, joints)
        self.steps.append(Step(action, joints, minutes, gauge_u_needed_in, text, required, how))

    def _measure(self, joints: tuple[int, ...], needed: float | None = None) -> None:
        """Measure joints; again where it is said how well."""
        minutes = minutes_to_measure(self.gear, joints, self.opened)
        self.opened |= {self.gear.joint(n).area for n in joints}
        if needed is None:
            self._step(Action.MEASURE, minutes, sentences.measure(self.gear, joints), joints)
        else:
            text = sentences.measure_again(joints)
            self._step(Action.MEASURE_AGAIN, minutes, text, joints, needed)

    def _restore(self, joints: tuple[int, ...], *, expected: bool) -> None:
        """Restore joints; where a reading over the limit is in doubt it is taken again first."""
        if not expected:
            self._reread()
        minutes = minutes_to_restore(self.gear, joints, self.opened)
        text = sentences.RESTORE_WORN if expected else sentences.restore(joints, self.over)
        self._step(Action.RESTORE, minutes, text, joints)
        self.opened = frozenset()

    def _reread(self) -> bool:
        """Take the readings in doubt again, once in a plan; whether there are any."""
        doubted = self._joints(self.facts.doubted[self.row])
        if doubted and not self.taken_again:
            self._measure(doubted, BETTER_GAUGES_IN[-1])
            self.taken_again = True
        return self.taken_again

    def _restore_over_limit(self) -> _PlanBuilder:
        """Restore what can be today; a reading in doubt is taken again also where it cannot."""
        self._reread()
        if self.over:
            self._restore(self.over, expected=False)
        return self

    def _joints(self, places: Mask) -> tuple[int, ...]:
        """Numbers of joints in the order of their rank."""
        order = self.judged.order[self.row].tolist()
        return tuple(self.numbers[j] for j in order if places[j]) if places.any() else ()

    def _open_question(self, found: Plan) -> str | None:
        """What cannot be settled because of the day."""
        if found.end is End.CORRECT:
            return None
        cases = self.cases
        i = self.row
        unread = self._joints(~cases.measured[i] & ~cases.reachable[i])
        over = self._joints(cases.over_limit[i] & ~cases.restorable[i])
        return sentences.open_question(unread, over)
