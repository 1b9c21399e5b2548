"""The plan of each gear: the quickest way in expected minutes from what is known now to an end.

A gear that failed is followed by what is believed of it (`belief`): the joints, the rigging or
something else. A gear without a complaint is read until there is a verdict, and what is over its
limit is restored, nothing else. What comes after the first step is the expected course.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from mlg_troubleshoot.arrays import Array, Mask, Places
from mlg_troubleshoot.decision import sentences
from mlg_troubleshoot.decision.assessment import Verdict
from mlg_troubleshoot.decision.belief import Belief
from mlg_troubleshoot.decision.case import Cases
from mlg_troubleshoot.decision.choice import Choice, choose
from mlg_troubleshoot.decision.inspection import InvalidRow, RiggingCheck
from mlg_troubleshoot.decision.plan import (
    Action,
    Basis,
    End,
    Plan,
    Step,
    how_to,
    minutes_of,
)
from mlg_troubleshoot.decision.prediction import Prediction
from mlg_troubleshoot.decision.priors import PRIORS, THRESHOLDS
from mlg_troubleshoot.gear.gauges import BETTER_GAUGES_IN


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
    lower, upper : Prediction
        With unmeasured joints at 0, and at their limit.
    chance : ndarray, shape (n,)
        Chance of leaving the margin with random directions. [1]
    order : ndarray of int, shape (n, joints)
        Places of the joints in the order of their rank.
    p_within : ndarray, shape (n,)
        Chance that the worst case is within the margin. [1]
    u_in : ndarray, shape (n,)
        Uncertainty of the worst case against the margin. [in]
    """

    verdicts: Sequence[Verdict]
    bases: Sequence[Basis]
    lower: Prediction
    upper: Prediction
    chance: Array
    order: Places
    p_within: Array
    u_in: Array


def plans(
    cases: Cases, judged: Judged, belief: Callable[[int], Belief]
) -> tuple[list[Plan], dict[int, Mask]]:
    """The plan of each gear, and the joints of those whose repair is to be tried."""
    courses = [_PlanBuilder(cases, judged, belief, i) for i in range(len(cases))]
    planned = [course.plan() for course in courses]
    return planned, {c.row: c.tried for c in courses if c.tried is not None}


class _PlanBuilder:
    """The course of one gear: each branch appends its steps and ends."""

    def __init__(
        self, cases: Cases, judged: Judged, belief: Callable[[int], Belief], row: int
    ) -> None:
        self.cases = cases
        self.judged = judged
        self.row = row
        self.gear = cases.gear
        self.numbers = cases.gear.joint_numbers
        self.inspection = cases.inspections[row]
        self.beyond = bool(cases.beyond_margin[row])
        self._belief = belief
        self.steps: list[Step] = []
        self.tried: Mask | None = None
        self.taken_again = False
        # Joints whose areas are open.
        self.opened: Mask = np.zeros(len(self.numbers), bool)
        self.over_limit = self._joints(self.cases.over_limit[row])
        self.over = self._joints(self.cases.must_restore[row])
        self.read_plunger = bool(np.isfinite(self.cases.plunger_in[row]))
        self.looked = self.inspection.rigging_checked not in (None, RiggingCheck.NO)

    @property
    def belief(self) -> Belief:
        """What is believed of a gear that failed, or failed before its repair."""
        return self._belief(self.row)

    @cached_property
    def doubted(self) -> Mask:
        """Readings over their limits that are taken again: within two standard uncertainties of the
        limit, or, on a gear that failed, at odds with the plunger; of no joint far beyond its
        limit.
        """
        cases = self.cases
        i = self.row
        limits = self.gear.limits_in
        read = cases.clearance_in[i]
        may_be = cases.over_limit[i] & cases.reachable[i] & ~cases.own_gauge[i]
        may_be &= read <= THRESHOLDS.surely_worn * limits
        near = may_be & (read - limits <= THRESHOLDS.doubtful * cases.gauge_u_in[i])
        failed = cases.failed[i] or self.inspection.is_repaired
        if failed and self.read_plunger and (may_be & ~near).any():
            sound = 1.0 - self.belief.worn
            near |= may_be & (sound > self.gear.second_repair_chance.value)
        return np.asarray(near)

    def plan(self) -> Plan:
        """The steps in their order."""
        i = self.row
        if not np.isfinite(self.judged.lower.displacement_in[i]):
            return NOT_CLOSING
        if self.inspection.unit_question and not self.beyond:
            return CONFIRM
        found = self._course()
        return replace(found, open_question=self._open_question(found))

    def _course(self) -> Plan:
        i = self.row
        if self.cases.off_down_lock[i]:
            self._check_rigging(again=True)
        if self.cases.failed[i]:
            return self._failed()
        if self.cases.complained[i] or (self.inspection.is_repaired and self.beyond):
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
        return self._end(End.OUTSIDE_NO_COMPLAINT if self.beyond else End.TOO_CLOSE)

    def _repaired(self) -> Plan:
        """A gear that failed and was repaired: the plunger says whether the repair holds."""
        if self.over:
            return self._try(self.cases.over_limit[self.row])
        if self.over_limit:
            # The plunger is read after these are restored, whatever it reads before.
            return self._restore_over_limit()._stop_for_today()
        if self.beyond and not self._again():
            return self._failed()
        if not self.read_plunger or self._again():
            self._read_the_plunger(again=self.read_plunger)
        return self._retract()

    def _again(self) -> bool:
        """Whether the plunger is read again: read only once and at the edge of its margin, or
        perhaps before the repair.
        """
        cases = self.cases
        i = self.row
        u = np.hypot(cases.plunger_u_in[i], cases.margin_u_in[i])
        at_edge = abs(abs(cases.plunger_in[i]) - cases.margin_in[i]) < THRESHOLDS.doubtful * u
        once = len(self.inspection.standing_readings_in) < 2
        return bool(at_edge and once) or self.inspection.is_plunger_in_doubt

    def _failed(self) -> Plan:
        """A gear that failed: the plunger first, then what has the fewest expected minutes."""
        if not self.read_plunger or self._again():
            self._read_the_plunger(again=self.read_plunger)
        joints, _rigging, elsewhere = self.belief.chances
        if not self.read_plunger and joints < elsewhere:
            return self._restore_over_limit()._end(End.NOT_EXPLAINED)
        cases = self.cases
        i = self.row
        choice = choose(
            self.gear,
            self.belief,
            over=cases.over_limit[i],
            worn=cases.removable[i],
            spare=cases.restorable[i],
            unread=~cases.measured[i] & cases.reachable[i],
            doubted=self.doubted,
            looked=self.looked or not self.read_plunger,
        )
        return self._follow(choice)

    def _follow(self, choice: Choice) -> Plan:
        """Do what was chosen; what comes after it is the expected course."""
        joints, rigging, elsewhere = self.belief.chances
        if choice.then is not None:
            self._check_rigging()
            if rigging > 0.5:
                return self._restore_over_limit()._end(End.NOT_EXPLAINED)
            rigging *= PRIORS.overlooked
            choice = choice.then
        if choice.read:
            return self._read_and_restore(choice.read)
        if choice.restore is not None:
            self.tried = choice.restore
            return self._try(choice.restore)
        if self.over:
            return self._try(self.cases.over_limit[self.row])
        explained = joints > rigging + elsewhere
        return self._end(End.CANNOT_CLEAR if explained else End.NOT_EXPLAINED)

    def _read_and_restore(self, places: tuple[int, ...]) -> Plan:
        """Read joints, then the expected repair."""
        over = self.cases.over_limit[self.row]
        if over[list(places)].all():
            self._reread()
            return self._try(over)
        self._measure(tuple(self.numbers[j] for j in places))
        worn = self.belief.worn_by_leverage
        # What is over its limit already does not suffice, or there would be nothing to read: one
        # joint more is restored on average.
        joints = self.cases.must_restore[self.row].copy()
        joints[max(places, key=lambda j: float(worn[j]))] = True
        without = self._joints(joints & ~self.cases.restorable[self.row])
        if without:
            return self._restore_over_limit()._stop_for_today(without)
        return self._try(joints, expected=True)

    def _left_unread(self) -> list[int]:
        """Joints that nobody read and that no step reads."""
        asked = {n for step in self.steps for n in step.joints}
        return [n for n in self._joints(~self.cases.measured[self.row]) if n not in asked]

    def _try(self, members: Mask, *, expected: bool = False) -> Plan:
        """Restore, read the plunger, retract the gear: done. Where something over its limit must
        wait for its spare, that comes after it.
        """
        waits = self.over != self.over_limit
        if waits and not expected:
            self.tried = None
            return self._restore_over_limit()._stop_for_today()
        self._restore(self._joints(members), expected=expected)
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
            as_new = self._joints(
                self.cases.measured[self.row]
                & (self.cases.filled(0.0)[self.row] <= 2.0 * self.gear.new_parts_in)
            )
            text = sentences.check_rigging(
                float(self.cases.plunger_in[self.row]) if self.beyond else None,
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
            beyond=self.beyond,
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
        places = np.isin(self.numbers, joints)
        minutes = float(minutes_of(self.gear, places, self.opened)[0])
        self.opened = self.opened | places
        if needed is None:
            self._step(Action.MEASURE, minutes, sentences.measure(self.gear, joints), joints)
        else:
            text = sentences.measure_again(joints)
            self._step(Action.MEASURE_AGAIN, minutes, text, joints, needed)

    def _restore(self, joints: tuple[int, ...], *, expected: bool) -> None:
        """Restore joints; where a reading over the limit is in doubt it is taken again first."""
        if not expected:
            self._reread()
        minutes = float(minutes_of(self.gear, np.isin(self.numbers, joints), self.opened)[1])
        text = sentences.RESTORE_WORN if expected else sentences.restore(joints, self.over)
        self._step(Action.RESTORE, minutes, text, joints)
        self.opened = np.zeros_like(self.opened)

    def _reread(self) -> bool:
        """Take the readings in doubt again, once in a plan; whether there are any."""
        doubted = self._joints(self.doubted)
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
