"""The plan of each gear: the quickest way in expected minutes from what is known now to an end.

A gear that failed is followed by what is believed of it (`belief`): the joints, the rigging or
something else. A gear without a complaint is read until there is a verdict, and what is over its
limit is restored, nothing else. What comes after the first step is the expected course.

`choose`: the next action on a gear that failed has the fewest expected minutes to an end, one step
ahead over the states of its belief, by (13) to (16) of docs/reference/models.md. Repair sets: all
subsets by the expansion, the best checked exactly. Consequences, IF …
THEN …: each outcome is a typical reading, entered in the inspection and judged by the same rule.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from copy import copy
from dataclasses import dataclass, replace
from datetime import date
from functools import cached_property, lru_cache
from statistics import median
from typing import Any

import numpy as np

from mlg_troubleshoot.arrays import Array, Mask, Places, Wholes
from mlg_troubleshoot.decision import sentences
from mlg_troubleshoot.decision.assessment import (
    Action,
    Assessment,
    Basis,
    Consequence,
    End,
    Plan,
    Posterior,
    RepairKind,
    RepairSet,
    Step,
    Verdict,
    how_to,
    minutes_of,
)
from mlg_troubleshoot.decision.belief import STATES, Inference, States, believed, explain
from mlg_troubleshoot.decision.inspection import Inspection, InvalidRow, Outcome, RiggingCheck
from mlg_troubleshoot.decision.prediction import (
    Cases,
    Prediction,
    ensemble,
    model_uncertainty,
    readings_differ,
    responses,
)
from mlg_troubleshoot.decision.priors import BEYOND, PRIORS, THRESHOLDS, WELL_WITHIN
from mlg_troubleshoot.decision.sentences import joints_are
from mlg_troubleshoot.decision.verdict_rule import CONFORMANCE, SCORE
from mlg_troubleshoot.gear.gear import BETTER_GAUGE_U_IN, Gear


@dataclass(frozen=True, slots=True, eq=False)
class Choice:
    """The next action.

    read : places of the joints to read. restore : joints to restore; None where the cause is looked
    for elsewhere. then : what follows a check of the rigging, which comes first, if it is right.
    """

    read: tuple[int, ...] = ()
    restore: Mask | None = None
    then: Choice | None = None


def choose(
    gear: Gear,
    states: States,
    *,
    over: Mask,
    worn: Mask,
    spare: Mask,
    unread: Mask,
    doubted: Mask,
    looked: bool,
) -> Choice:
    """The action with the fewest expected minutes.

    over : joints over their limit. worn : joints that can be restored with a gain. spare : joints
    that may be restored. unread : joints that nobody read and that can be reached. doubted :
    readings over the limit that may be taken again. looked : whether the rigging was checked, or
    cannot be asked for yet.
    """
    groups = [(), *_groups(gear, states, unread, doubted)]
    # A row is one pattern of what is worn of one group.
    starts, of_row, asked, found = _patterns(groups)
    rows, joints = np.arange(len(asked)), np.arange(len(over))
    matches = states.worn @ (1 << joints) & asked[:, None] == found[:, None]
    matches = matches.astype(np.float32)
    causes = matches @ states.causes.T

    fixed = over & ~doubted
    bits = _bits(states, (worn | unread & spare | doubted) & ~fixed, doubted)
    codes = np.arange(bits.sum() + 1)
    sets = ((codes[:, None] & bits) > 0) | fixed
    # Failures of the joints weigh the same.
    out = states.causes[0, 0] * (matches[:, :STATES] @ states.stays_out(sets))
    is_asked, is_found = (each[:, None] >> joints & 1 > 0 for each in (asked, found))
    must = np.where(is_asked, is_found, over) @ bits
    allowed = codes & ~(np.where(is_asked, spare, worn | over) @ bits)[:, None] == 0
    allowed &= (codes & must[:, None] == must[:, None]) & sets.any(axis=1)
    allowed &= (out < 0.5 * causes[:, :1]) | (codes == must[:, None])

    opened = is_asked[starts]
    read = minutes_of(gear, opened, np.zeros_like(over))[0]
    minutes = minutes_of(gear, sets, opened[:, None])[1][of_row]
    check, reading = gear.rigging_check.value, gear.plunger_reading.value
    after = reading + gear.retraction.value
    # (13)
    restore = median(joint.restore.value for joint in gear.joints)
    second = restore / (THRESHOLDS.one_repair * gear.second_repair_chance.value)
    out *= second
    repeated = np.where(allowed, out, np.inf)

    def ends(causes: Array, late: float = 0.0) -> tuple[Array, int]:
        """Minutes of the best end after each pattern (14), and the place of its set without a
        reading, -1 where the cause is looked for elsewhere; `late`: of a check of the rigging after
        the repair. [min]
        """
        total = causes.sum(axis=1)
        # In vain: sound joints where the joints are not the cause.
        vain = second * causes[:, 1:].sum(axis=1)
        restored = total[:, None] * (minutes + after) + repeated
        restored[rows, must] -= vain
        best = restored.min(axis=1)
        # The first of those that differ by rounding.
        place = int(np.argmax(restored[0] <= best[0] + 1e-6))
        best += vain + late * causes[:, 1]
        elsewhere = total * (minutes[rows, must] + after * sets[must].any(axis=1))
        elsewhere += THRESHOLDS.sent_away * (out[rows, must] + second * causes[:, 1])
        return np.minimum(best, elsewhere), -1 if elsewhere[0] < best[0] else place

    def first_step(values: Array, place: int) -> Choice:
        if k := int(values.argmin()):
            return Choice(read=groups[k])
        return Choice(restore=sets[place] if place >= 0 else None)

    now, place = ends(causes, 0.0 if looked else check + reading)
    # Rounded: both ends of one link are worth the same, and noise must not choose between them.
    if not looked:
        # (15)
        right = causes * [1.0, PRIORS.overlooked, 1.0]
        checked, place_checked = ends(right)
        wrong = (causes - right).sum(axis=1) * minutes[rows, must]
        now[1:] = np.minimum(now, checked + wrong + check * causes.sum(axis=1))[1:]
        checked = np.round(right[0].sum() * read + np.add.reduceat(checked, starts), 6)
        wrong = np.add.reduceat(wrong, starts)
    # (16)
    now = np.round(read + np.add.reduceat(now, starts), 6)
    if not looked and np.round(check + checked + wrong, 6).min() < now.min():
        return Choice(then=first_step(checked, place_checked))
    return first_step(now, place)


def _bits(states: States, may: Mask, first: Mask) -> Wholes:
    """The bit of each joint whose restoration is weighed, 0 of the others: some first, then those
    that move the plunger farthest.
    """
    reach = np.abs(states.freed_in).mean(axis=0)
    weighed = np.lexsort((-reach, ~first, ~may))[: min(int(may.sum()), THRESHOLDS.movable)]
    bits = np.zeros(len(may), np.int64)
    bits[weighed] = 1 << np.arange(len(weighed))
    return bits


def _groups(gear: Gear, states: States, unread: Mask, doubted: Mask) -> list[tuple[int, ...]]:
    """Joints that may be read together: in each area those likeliest worn per minute, by how far
    they move the plunger; readings in doubt.
    """
    rate = np.round(states.blamed, 4) / gear.access_minutes
    found = []
    for area in gear.areas:
        inside = [j for j, joint in enumerate(gear.joints) if joint.area == area.name]
        some = sorted((j for j in inside if unread[j]), key=lambda j: -rate[j])
        some = some[: THRESHOLDS.together]
        found += [tuple(some[:count]) for count in range(1, len(some) + 1)]
    again = tuple(np.flatnonzero(doubted).tolist())
    return [*found, again] if again else found


def _patterns(groups: Sequence[tuple[int, ...]]) -> tuple[Wholes, Wholes, Wholes, Wholes]:
    """The patterns of worn joints of all groups: the first one of each group, the group of each
    pattern, the joints of that group and those that are worn, as bits.
    """
    found = [_worn_of(group) for group in groups]
    sizes = [len(each) for each in found]
    of_row = np.repeat(np.arange(len(groups)), sizes)
    whole = np.array([each[-1] for each in found])
    return np.cumsum([0, *sizes[:-1]]), of_row, whole[of_row], np.concatenate(found)


@lru_cache(maxsize=1024)
def _worn_of(group: tuple[int, ...]) -> Wholes:
    """Which joints of a group are worn, in every pattern, as bits; all of them in the last."""
    subsets = np.arange(1 << len(group))[:, None] >> np.arange(len(group)) & 1
    return np.asarray(subsets @ (1 << np.array(group, np.int64)))


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


@dataclass(frozen=True, slots=True, eq=False)
class Course:
    """The plan of one gear, the repairs that are offered, each with the chance of a second one, and
    which joints explain its plunger.
    """

    plan: Plan
    repairs: Sequence[tuple[RepairKind, Mask, float | None]]
    posterior: Posterior | None


def plans(
    cases: Cases,
    judged: Judged,
    sure: Mapping[int, Mask] | None,
    *,
    advice: bool,
    sets: bool,
) -> Iterator[Course]:
    """The course of each gear. `sure`: sets that bring its worst case within the margin."""
    complained = cases.beyond_margin & (cases.failed | cases.repaired)
    is_open = cases.beyond_margin | np.isfinite(cases.plunger_in) & cases.over_limit.any(axis=1)
    needed = cases.failed | cases.repaired & is_open
    unread = np.zeros_like(needed)
    if sure is not None and cases.extension is None:
        within = Verdict.WITHIN_MARGIN, Basis.MEASURED
        cleared = [each == within for each in zip(judged.verdicts, judged.bases, strict=True)]
        # A reading clears a gear by the joints that were read alone, and that chance is stated.
        unread = ~cases.measured.all(axis=1) & ~np.array(cleared)
        needed |= unread
    # Failures are drawn of all that are believed of together.
    drawn = (cases.failed & ~cases.clears_margin).astype(int)
    beliefs = [believed(cases, np.flatnonzero(needed & (drawn == k)).tolist()) for k in (0, 1)]
    for row, is_needed in enumerate(needed.tolist()):
        belief, place = next(beliefs[drawn[row]]) if is_needed else (None, 0)
        builder = _PlanBuilder(cases, judged, belief, place, row, sets=sets)
        plan = builder.plan()
        repairs: list[tuple[RepairKind, Mask, float | None]] = []
        if sure and row in sure:
            second = belief.second_repair(place, sure[row]) if belief and complained[row] else None
            repairs.append((RepairKind.SURE, sure[row], second))
        if belief and sets and builder.tried is not None:
            second = belief.second_repair(place, builder.tried)
            repairs.append((RepairKind.TRY, builder.tried, second))
        explained = advice and cases.failed[row] and builder.read_plunger
        posterior = explain(belief, place) if belief and explained else None
        if belief and unread[row]:
            judged.chance[row] = belief.chance_random[place]
        yield Course(plan, repairs, posterior)


class _PlanBuilder:
    """The course of one gear: each branch appends its steps and ends."""

    def __init__(
        self,
        cases: Cases,
        judged: Judged,
        belief: Inference | None,
        place: int,
        row: int,
        *,
        sets: bool,
    ) -> None:
        self.cases = cases
        self.judged = judged
        self.row = row
        self.gear = cases.gear
        self.numbers = cases.gear.joint_numbers
        self.inspection = cases.inspections[row]
        self.beyond = bool(cases.beyond_margin[row])
        self._belief = belief
        self.place = place
        self.sets = sets
        self.steps: list[Step] = []
        self.then: list[Consequence] = []
        self.tried: Mask | None = None
        self.taken_again = False
        # Joints whose areas are open.
        self.opened: Mask = np.zeros(len(self.numbers), bool)
        self.over_limit = self._joints(self.cases.over_limit[row])
        self.over = self._joints(self.cases.must_restore[row])
        # Whether something over its limit must wait for its spare.
        self.waits = self.over != self.over_limit
        self.plunger_in = float(cases.plunger_in[row])
        self.read_plunger = math.isfinite(self.plunger_in)
        self.looked = self.inspection.rigging_checked not in (None, RiggingCheck.NO)

    @property
    def belief(self) -> Inference:
        """What is believed of a gear that failed, or failed before its repair."""
        assert self._belief is not None
        return self._belief

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
            sound = 1.0 - self.belief.worn[self.place]
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
        then = tuple(self.then) if self.sets else ()
        return replace(found, open_question=self._open_question(found), then=then)

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
        if self.waits:
            return self._stop_for_today()
        if self.judged.verdicts[i] is Verdict.WITHIN_MARGIN and not (
            self.over and self.judged.bases[i] is Basis.MEASURED
        ):
            return self._done()
        if self.beyond and self._are_at_odds():
            self._read_the_plunger(again=True)
        elif not self.read_plunger or self.over or self._in_doubt():
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
        """Whether the plunger is read again: read only once and at the edge of its margin, or in
        doubt.
        """
        once = len(self.inspection.standing_readings_in) < 2
        return (once and self._is_at_edge(self.plunger_in)) or self._in_doubt()

    def _is_at_edge(self, reading_in: float) -> bool:
        cases = self.cases
        i = self.row
        u = np.hypot(cases.plunger_u_in[i], cases.margin_u_in[i])
        return bool(abs(abs(reading_in) - cases.margin_in[i]) < THRESHOLDS.doubtful * u)

    def _in_doubt(self) -> bool:
        """Whether the plunger was perhaps read before the repair, or its readings are at odds."""
        return self.inspection.is_plunger_in_doubt or self._are_at_odds()

    def _are_at_odds(self) -> bool:
        """Whether two readings of the plunger, neither at the edge of its margin, differ by more
        than their uncertainty: a third shows which of them was a slip.
        """
        readings = self.inspection.standing_readings_in
        is_pair = len(readings) == 2 and readings_differ(self.inspection)
        return is_pair and not any(map(self._is_at_edge, readings))

    def _failed(self) -> Plan:
        """A gear that failed: the plunger first, then what has the fewest expected minutes."""
        if not self.read_plunger:
            return self._once_read()
        if self._again():
            self._read_the_plunger(again=True)
        return self._find_cause()

    def _once_read(self) -> Plan:
        """The plunger is read first; what follows a typical reading beyond its margin is expected
        where the joints are the likelier cause.
        """
        self._read_the_plunger()
        joints, _rigging, elsewhere = self.belief.chances[self.place].tolist()
        if self.sets:
            self._if_read("within", WELL_WITHIN)
        if self.sets or joints >= elsewhere:
            after, rest = self._if_read("beyond", BEYOND)
        if joints < elsewhere:
            return self._restore_over_limit()._end(End.NOT_EXPLAINED)
        self.tried = after.tried
        return Plan((*self.steps, *rest.steps), rest.end)

    def _if_read(self, where: str, share: float) -> tuple[_PlanBuilder, Plan]:
        """What follows if the plunger stands at a share of its margin."""
        after = self._after(
            _belief=getattr(self.belief, where),
            beyond=share > 1.0,
            read_plunger=True,
            plunger_in=share * float(self.cases.margin_in[self.row]),
        )
        rest = after._find_cause()
        self._follows(f"the plunger is {where} its margin", rest)
        return after, rest

    def _follows(self, outcome: str, rest: Plan) -> None:
        """Note what follows an outcome of the next action."""
        if len(self.steps) == 1:
            self.then.append(_consequence(outcome, rest.steps[0]))

    def _after(self, **changed: Any) -> _PlanBuilder:
        """The same gear after its first step, without steps of its own."""
        after = copy(self)
        vars(after).update(steps=[], then=[], **changed)
        return after

    def _find_cause(self) -> Plan:
        """The plunger was read: what has the fewest expected minutes."""
        cases = self.cases
        i = self.row
        over = cases.over_limit[i]
        elsewhere = self.belief.chances[self.place, 2]
        if elsewhere > 1.0 - 1e-7:
            return self._follow(Choice(restore=over if over.any() else None))
        choice = choose(
            self.gear,
            self.belief.states[self.place],
            over=over,
            worn=cases.removable[i],
            spare=cases.restorable[i],
            unread=~cases.measured[i] & cases.reachable[i],
            doubted=self.doubted,
            looked=self.looked,
        )
        return self._follow(choice)

    def _follow(self, choice: Choice) -> Plan:
        """Do what was chosen; what comes after it is the expected course."""
        joints, rigging, elsewhere = self.belief.chances[self.place].tolist()
        if choice.then is not None:
            self._check_rigging()
            right = self._after(looked=True)
            rest = right._follow(choice.then)
            self._follows("the rigging is right", rest)
            if rigging > 0.5:
                return self._restore_over_limit()._end(End.NOT_EXPLAINED)
            self.tried = right.tried
            return Plan((*self.steps, *rest.steps), rest.end)
        if self.looked and not self.belief.looked[self.place]:
            rigging *= PRIORS.overlooked
        if choice.read:
            return self._read_and_restore(choice.read)
        if choice.restore is not None:
            self.tried = choice.restore
            return self._try(choice.restore)
        if self.over:
            return self._try(self.cases.over_limit[self.row])
        return self._end(End.CANNOT_CLEAR if joints > rigging + elsewhere else End.NOT_EXPLAINED)

    def _read_and_restore(self, places: tuple[int, ...]) -> Plan:
        """Read joints, then the expected repair."""
        over = self.cases.over_limit[self.row]
        if over[list(places)].all():
            self._reread()
            return self._try(over)
        self._measure(tuple(self.numbers[j] for j in places))
        worn = self.belief.states[self.place].blamed
        # What is over its limit already does not suffice, or there would be nothing to read: one
        # joint more is restored on average.
        joints = self.cases.must_restore[self.row].copy()
        joints[max(places, key=lambda j: round(float(worn[j]), 6))] = True
        without = self._joints(joints & ~self.cases.restorable[self.row])
        if without:
            return self._restore_over_limit()._stop_for_today(without)
        return self._try(joints, expected=True)

    def _try(self, members: Mask, *, expected: bool = False) -> Plan:
        """Restore, read the plunger, retract the gear: done. Where something over its limit must
        wait for its spare, that comes after it.
        """
        if self.waits and not expected:
            self.tried = None
            return self._restore_over_limit()._stop_for_today()
        self._restore(self._joints(members), expected=expected)
        if self.waits:
            return self._stop_for_today()
        self._read_the_plunger()
        return self._retract()

    def _read_the_plunger(self, *, again: bool = False) -> None:
        text = sentences.READ_PLUNGER
        if again and self._are_at_odds():
            text = sentences.READ_A_THIRD_TIME
        elif again and not self.inspection.is_plunger_in_doubt:
            text = sentences.READ_PLUNGER_AGAIN
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
        if self.waits:
            return self._stop_for_today()
        restored = any(step.action is Action.RESTORE for step in self.steps)
        asked = {n for step in self.steps for n in step.joints}
        left = {*self._joints(~self.cases.measured[self.row])} - asked
        text = sentences.done(len(left), repaired=restored or self.inspection.is_repaired)
        end = End.DONE
        if not self.steps and self.judged.bases[self.row] is Basis.PREDICTED:
            end = End.WITHIN
        self._step(Action.DONE, 0.0, text, required=False)
        return Plan(tuple(self.steps), end)

    def _check_rigging(self, *, again: bool = False) -> None:
        checked = any(step.action is Action.CHECK_RIGGING for step in self.steps)
        if not checked and (again or not self.looked):
            as_new = self._joints(
                self.cases.measured[self.row]
                & (self.cases.filled(0.0)[self.row] <= 2.0 * self.gear.new_parts_in)
            )
            text = sentences.check_rigging(
                self.plunger_in if self.beyond else None,
                () if self.inspection.is_repaired or not self.cases.failed[self.row] else as_new,
            )
            self._step(Action.CHECK_RIGGING, self.gear.rigging_check.value, text)

    def _end(self, where: End) -> Plan:
        """Go on: the plan ends."""
        if where is End.CANNOT_CLEAR and self._barred():
            return self._stop_for_today()
        if where is End.TOO_CLOSE and self.inspection.is_repaired:
            text = sentences.SIGN_OFF_TOO_CLOSE
        else:
            text = sentences.go_on(
                where, read=self.read_plunger, beyond=self.beyond, looked=self.looked
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
        places = np.array([number in joints for number in self.numbers])
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
        places = np.array([number in joints for number in self.numbers])
        minutes = float(minutes_of(self.gear, places, self.opened)[1])
        text = sentences.RESTORE_WORN if expected else sentences.restore(joints, self.over)
        self._step(Action.RESTORE, minutes, text, joints)
        self.opened = np.zeros_like(self.opened)

    def _reread(self) -> None:
        """Take the readings in doubt again, once in a plan."""
        doubted = self._joints(self.doubted)
        if doubted and not self.taken_again:
            self._measure(doubted, BETTER_GAUGE_U_IN)
            self.taken_again = True

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


# Within this of the conformance limit a subset counts as about sufficient: how far the expansion
# may be off. [in]
_ABOUT_IN = 5e-4


@lru_cache(maxsize=4)
def subsets_of(gear: Gear) -> tuple[Wholes, Mask, Array]:
    """All subsets of a gear's joints, as bits and as masks, the quickest to restore first, then
    the smallest; and the minutes of each. [min]
    """
    n = len(gear.joints)
    codes = np.arange(2**n)
    members = (codes[:, None] >> np.arange(n) & 1).astype(bool)
    minutes = minutes_of(gear, members, np.zeros(n, bool))[1]
    order = np.lexsort((members.sum(axis=1), np.round(minutes, 6)))
    return codes[order], members[order], minutes[order]


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
        codes, members, minutes = subsets_of(gear)
        each_joint = 1 << np.arange(len(gear.joints))
        may, must = cases.removable[row] @ each_joint, cases.must_restore[row] @ each_joint
        allowed = (codes & ~may == 0) & (codes & must == must)
        self.row = row
        self.members = members[allowed]
        self.minutes = minutes[allowed]
        now = np.where(cases.measured[[row]], cases.clearance_in[[row]], gear.limits_in)
        after = np.where(self.members, np.minimum(now, gear.new_parts_in), now)
        # The larger of the two senses on each linkage, before and after.
        both = np.vstack([now, after])
        amplification, curvature = ensemble(gear)
        bent = 0.5 * np.sum((both @ curvature) * both, axis=2)
        size = amplification @ both.T + np.abs(bent)
        each = size[:, 1:]
        reference = responses(gear)[0]
        worst = each[0] + upper.displacement_in[row] - size[0, 0]
        read = (reference.slopes(after) * cases.gauge_u_in[row] * cases.measured[row]) ** 2
        variance = read.sum(axis=1) + model_uncertainty(worst, cases.extension) ** 2
        variance += cases.margin_u_in[row] ** 2
        variance += each.var(axis=0, ddof=1) if len(each) > 1 else 0.0
        # Rounded: both ends of one link leave the same, and noise must not choose between them.
        self.slack_in = np.round(cases.margin_in[row] - worst - SCORE * np.sqrt(variance), 7)

    def quickest(self, least_in: float) -> int | None:
        """The quickest with so much slack, of equally many joints in equal minutes that with most;
        None if there is none.
        """
        among = self.slack_in >= least_in
        if not among.any():
            return None
        first = int(np.argmax(among))
        size = self.members.sum(axis=1)
        alike = among & (self.minutes == self.minutes[first]) & (size == size[first])
        return int(np.argmax(np.where(alike, self.slack_in, -np.inf)))


def sure_sets(cases: Cases, upper: Prediction, wanted: Places) -> dict[int, Mask]:
    """Find the quickest set of joints which, restored, brings the worst case of each wanted gear
    within the margin by the expansion; `upper`: with unmeasured joints at their limit.

    Unmeasured joints count with their limit: what holds with them at 0 sends every fifth gear back.
    """
    near = []
    for row in wanted.tolist():
        sets = Sets(cases, upper, row)
        about = sets.quickest(-_ABOUT_IN)
        if about is not None:
            near.append((sets, about))
    if not near:
        return {}
    # Shifted so that it is exact for the quickest set that is about sufficient.
    some, after = restored(cases, [s.row for s, _ in near], [s.members[k] for s, k in near])
    guard = SCORE * after.standard_uncertainty(some.margin_u_in)
    exact = some.margin_in - after.displacement_in - guard
    found = {}
    for (sets, k), slack in zip(near, exact.tolist(), strict=True):
        sets.slack_in = sets.slack_in + np.nan_to_num(slack - sets.slack_in[k])
        best = sets.quickest(0.0)
        if best is not None and sets.members[best].any():
            found[sets.row] = sets.members[best]
    return found


def repair_sets(cases: Cases, courses: Sequence[Course]) -> list[tuple[RepairSet, ...]]:
    """The repairs that are offered for each gear, each checked by the exact worst case."""
    result: list[tuple[RepairSet, ...]] = [()] * len(cases)
    asked = [(row, *each) for row, course in enumerate(courses) for each in course.repairs]
    if not asked:
        return result
    sets = [members for _row, _kind, members, _second in asked]
    some, after = restored(cases, [row for row, *_ in asked], sets)
    within = after.probability_within(some.margin_in, some.margin_u_in)
    access, minutes = minutes_of(cases.gear, np.array(sets), np.zeros_like(sets[0]))
    of_each = (after.displacement_in, within, access, minutes)
    for (row, kind, members, second), moved, p, opening, takes in zip(
        asked, *(each.tolist() for each in of_each), strict=True
    ):
        joints = tuple(np.array(cases.gear.joint_numbers)[members].tolist())
        sure = kind is RepairKind.SURE
        if p < CONFORMANCE if sure else joints in [each.joints for each in result[row]]:
            continue
        result[row] = (*result[row], RepairSet(joints, moved, p, opening, takes, kind, second))
    return result


# Days after whatever is known of a gear.
_REPAIR_DAY, _LATER = date(9999, 12, 1), date(9999, 12, 2)


def with_consequences(
    found: Sequence[Assessment], cases: Cases, judge: Callable[[Cases], Judged]
) -> list[Assessment]:
    """Add to each plan what follows each outcome of its next action, judged by the same rule."""
    each = [[*_outcomes(a, cases.gear)] for a in found]
    rows = [
        replace(a.inspection, **changed)
        for a, outcomes in zip(found, each, strict=True)
        for _outcome, changed in outcomes
    ]
    if not rows:
        return [*found]
    after = Cases.of(cases.gear, rows, fleet=cases.fleet)
    courses = plans(after, judge(after), None, advice=False, sets=False)

    def follows(a: Assessment, outcomes: Sequence[tuple[str, Any]]) -> Assessment:
        then = [_consequence(outcome, next(courses).plan.steps[0]) for outcome, _ in outcomes]
        return replace(a, plan=replace(a.plan, then=(*a.plan.then, *then)))

    return [follows(*each) for each in zip(found, each, strict=True)]


def _consequence(outcome: str, step: Step) -> Consequence:
    text = f"IF {outcome}, THEN {step.text[0].lower()}{step.text[1:]}"
    return Consequence(outcome, step.action, step.joints, step.minutes, text)


def _outcomes(a: Assessment, gear: Gear) -> Iterator[tuple[str, dict[str, Any]]]:
    """Outcomes of the next action, with what each changes in the inspection."""
    row = a.inspection
    step = a.next_action
    names_are = joints_are(step.joints)
    day = _LATER if row.is_repaired else row.plunger_date
    match step.action:
        case Action.READ_PLUNGER if not a.plan.then:
            for share, where in ((WELL_WITHIN, "within"), (BEYOND, "beyond")):
                reading = (*row.standing_readings_in, share * a.margin_in)
                changed = {"readings_in": reading, "plunger_date": day}
                yield f"the plunger is {where} its margin", changed
        case Action.MEASURE:
            yield "all are within their limits", _read(row, gear, step.joints, ())
            yield f"#{step.joints[0]} is over its limit", _read(row, gear, step.joints, (0,))
        case Action.MEASURE_AGAIN:
            again = {"measured_again": (*row.measured_again, *step.joints)}
            yield f"{names_are} over the limit again", again
            yield f"{names_are} within the limit", again | _read(row, gear, step.joints, ())
        case Action.CHECK_RIGGING:
            if not a.plan.then:
                yield "the rigging is right", {"rigging_checked": RiggingCheck.YES}
            corrected = {"rigging_checked": RiggingCheck.CORRECTED, "repair_date": _REPAIR_DAY}
            yield "the rigging was wrong and is set right", corrected
        case Action.RESTORE:
            new = {n: gear.joint(n).new_part.value for n in step.joints}
            yield (
                f"{names_are} restored",
                {
                    "clearance_in": {**row.clearance_in, **new},
                    "restored_joints": tuple(sorted({*row.restored_joints, *step.joints})),
                    "repair_date": _REPAIR_DAY,
                },
            )
        case Action.RETRACT:
            for outcome, word in ((Outcome.RETRACTED, "retracts"), (Outcome.FAILED, "fails")):
                yield f"the gear {word}", {"outcome": outcome, "outcome_date": _LATER}


def _read(
    row: Inspection, gear: Gear, joints: tuple[int, ...], over: tuple[int, ...]
) -> dict[str, Any]:
    """Readings of joints, those at some places over their limits."""
    shares = {n: BEYOND if place in over else WELL_WITHIN for place, n in enumerate(joints)}
    read = {n: share * gear.joint(n).limit.value for n, share in shares.items()}
    return {"clearance_in": {**row.clearance_in, **read}}
