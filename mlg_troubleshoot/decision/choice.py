"""What to do next on a gear that failed: the action with the fewest expected minutes to an end.

One step ahead over the states of its belief, by (13) to (16) of docs/reference/models.md.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mlg_troubleshoot.arrays import Array, Mask
from mlg_troubleshoot.decision.belief import STATES, Belief
from mlg_troubleshoot.decision.plan import minutes_to_measure
from mlg_troubleshoot.decision.priors import PRIORS, THRESHOLDS
from mlg_troubleshoot.gear.gear import Gear


@dataclass(frozen=True, slots=True, eq=False)
class Possible:
    """What can be done on one gear, by the place of each joint.

    over : joints over their limit. worn : joints that can be restored with a gain. spare : joints
    that may be restored. unread : joints that nobody read and that can be reached. doubted :
    readings over the limit that may be taken again. looked : whether the rigging was checked, or
    cannot be asked for yet. opened : areas that are open.
    """

    over: Mask
    worn: Mask
    spare: Mask
    unread: Mask
    doubted: Mask
    looked: bool
    opened: frozenset[str]


@dataclass(frozen=True, slots=True, eq=False)
class Choice:
    """The next action.

    read : places of the joints to read. restore : joints to restore; None where the cause is looked
    for elsewhere. then : what follows a check of the rigging, which comes first, if it is right.
    """

    read: tuple[int, ...] = ()
    restore: Mask | None = None
    then: Choice | None = None


def choose(gear: Gear, belief: Belief, possible: Possible) -> Choice:
    """The action with the fewest expected minutes."""
    tree = _Tree(gear, belief, possible)
    groups = [(), *_groups(gear, belief, possible)]
    values, places = zip(*map(tree.expected_minutes, groups), strict=True)
    # Rounded: both ends of one link are worth the same, and noise must not choose between them.
    now, checked = np.round(values, 6).T
    best, then = (
        Choice(read=groups[k])
        if (k := int(minutes.argmin()))
        else Choice(restore=tree.sets[place] if place >= 0 else None)
        for minutes, place in zip((now, checked), places[0], strict=True)
    )
    return best if possible.looked or now.min() <= checked.min() else Choice(then=then)


def _groups(gear: Gear, belief: Belief, possible: Possible) -> list[tuple[int, ...]]:
    """Joints that may be read together: in each area those likeliest worn per minute, by how far
    they move the plunger; readings in doubt.
    """
    rate = np.round(belief.worn_by_leverage, 4) / gear.access_minutes
    found = []
    for area in gear.areas:
        inside = [j for j, joint in enumerate(gear.joints) if joint.area == area.name]
        some = sorted((j for j in inside if possible.unread[j]), key=lambda j: -rate[j])
        some = some[: THRESHOLDS.together]
        found += [tuple(some[:count]) for count in range(1, len(some) + 1)]
    doubted = tuple(np.flatnonzero(possible.doubted).tolist())
    return [*found, doubted] if doubted else found


class _Tree:
    """The sets of joints that may be restored, and how often each leaves the plunger outside."""

    def __init__(self, gear: Gear, belief: Belief, possible: Possible) -> None:
        states = belief.states
        self.gear = gear
        self.possible = possible
        self.states = states
        fixed = possible.over & ~possible.doubted
        may = (possible.worn | possible.unread & possible.spare | possible.doubted) & ~fixed
        reach = np.abs(states.moved_in).mean(axis=0)
        order = np.lexsort((-reach, ~possible.doubted, ~may))
        movable = order[: min(int(may.sum()), THRESHOLDS.movable)]
        self.bits = np.zeros(len(may), int)
        self.bits[movable] = 1 << np.arange(len(movable))
        self.codes = np.arange(1 << len(movable))
        self.sets = ((self.codes[:, None] & self.bits) > 0) | fixed
        self.out = states.stays_out(self.sets) * states.causes[0, :STATES, None]
        inside = np.array([[j.area == area.name for j in gear.joints] for area in gear.areas])
        self.opens = (self.sets[:, None, :] & inside).any(axis=2)
        each = np.array([joint.restore.value for joint in gear.joints])
        self.restoring = self.sets @ each
        # (13)
        accepted = THRESHOLDS.one_repair * gear.second_repair_chance.value
        self.second_min = float(np.median(each)) / accepted

    def expected_minutes(
        self, group: tuple[int, ...]
    ) -> tuple[tuple[float, float], tuple[int, int]]:
        """Of reading some joints and the best end after each pattern of what is worn (16), with the
        rigging as it is, and of checking it first (15); the place of the set to restore at the end,
        -1 where the cause is looked for elsewhere. [min, 1]
        """
        gear = self.gear
        joints = list(group)
        numbers = [gear.joint_numbers[j] for j in joints]
        opened = {gear.joint(n).area for n in numbers} | self.possible.opened
        shut = [0.0 if area.name in opened else area.access.value for area in gear.areas]
        minutes = self.restoring + self.opens @ np.array(shut)
        power = 1 << np.arange(len(joints))
        patterns = np.arange(1 << len(joints))[:, None]
        of = (self.states.worn[:, joints] @ power) == patterns
        causes = of @ self.states.causes.T
        out = of[:, :STATES].astype(float) @ self.out
        known = self.possible.over.copy()
        known[joints] = False
        must = self.bits[known].sum() + ((patterns & power) > 0) @ self.bits[joints]
        may = self.possible.worn | self.possible.over
        may[joints] = self.possible.spare[joints]
        holds = (self.codes & ~self.bits[may].sum()) == 0
        allowed = holds & ((self.codes & must[:, None]) == must[:, None]) & self.sets.any(axis=1)
        allowed &= (self.codes == must[:, None]) | (out <= 0.5 * causes[:, :1])
        right = causes * [1.0, PRIORS.overlooked, 1.0]
        wrong = (causes - right).sum(axis=1) * minutes[must]
        check = gear.rigging_check.value
        checked, place = self._ends(right, out, minutes, must, allowed)
        with_check = checked + wrong + check * causes.sum(axis=1)
        late = 0.0 if self.possible.looked else check + gear.plunger_reading.value
        now, first = self._ends(causes, out, minutes, must, allowed, late)
        if group and not self.possible.looked:
            now = np.minimum(now, with_check)
        read = minutes_to_measure(gear, numbers, self.possible.opened)
        first_check = check + wrong.sum() + right.sum() * read + checked.sum()
        return (read + now.sum(), first_check), (int(first[0]), int(place[0]))

    def _ends(
        self, causes: Array, out: Array, minutes: Array, must: Array, allowed: Mask, late: float = 0
    ) -> tuple[Array, Array]:
        """Minutes of the best end after each pattern (14), and the place of its set; `late`: of a
        check of the rigging after the repair. [min]
        """
        rows = np.arange(len(must))
        total = causes.sum(axis=1)
        after = self.gear.plunger_reading.value + self.gear.retraction.value
        # In vain: sound joints where the joints are not the cause.
        vain = (self.codes != must[:, None]) * causes[:, 1:].sum(axis=1)[:, None]
        restored = total[:, None] * (minutes + after) + self.second_min * (out + vain)
        restored = np.where(allowed, restored + late * causes[:, 1:2], np.inf)
        places = np.argmin(np.round(restored, 6), axis=1)
        elsewhere = total * (minutes[must] + after * self.sets[must].any(axis=1))
        sent_away = out[rows, must] + causes[:, 1]
        elsewhere += THRESHOLDS.sent_away * self.second_min * sent_away
        best = restored[rows, places]
        return np.minimum(best, elsewhere), np.where(elsewhere < best, -1, places)
