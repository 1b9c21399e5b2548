"""What to do next on a gear that failed: the action with the fewest expected minutes to an end.

One step ahead over the states of its belief, by (13) to (16) of docs/reference/models.md.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mlg_troubleshoot.arrays import Array, Mask, Wholes
from mlg_troubleshoot.decision.belief import STATES, Belief
from mlg_troubleshoot.decision.plan import minutes_of
from mlg_troubleshoot.decision.priors import PRIORS, THRESHOLDS
from mlg_troubleshoot.gear.gear import Gear


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
    belief: Belief,
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
    states = belief.states
    groups = [(), *_groups(gear, belief, unread, doubted)]
    starts = np.cumsum([0, *(1 << len(group) for group in groups[:-1])])
    # A row is one pattern of what is worn of one group.
    asked, found = _patterns(groups, len(over))
    rows = np.arange(len(asked))
    differs = states.worn @ (asked & ~found).T | ~states.worn @ (asked & found).T
    matches = (~differs).T.astype(float)
    causes = matches @ states.causes.T

    fixed = over & ~doubted
    bits = _bits(belief, (worn | unread & spare | doubted) & ~fixed, doubted)
    codes = np.arange(bits.sum() + 1)
    sets = ((codes[:, None] & bits) > 0) | fixed
    out = matches[:, :STATES] @ (states.stays_out(sets) * states.causes[0, :STATES, None])
    must = np.where(asked, found, over) @ bits
    more = codes != must[:, None]
    allowed = codes & ~(np.where(asked, spare, worn | over) @ bits)[:, None] == 0
    allowed &= (codes & must[:, None] == must[:, None]) & sets.any(axis=1)
    allowed &= ~more | (out < 0.5 * causes[:, :1])

    nothing = np.zeros_like(over)
    read = minutes_of(gear, asked[starts], nothing)[0]
    minutes = minutes_of(gear, sets, asked[:, None])[1]
    check = gear.rigging_check.value
    after = gear.plunger_reading.value + gear.retraction.value
    # (13)
    second = np.median([joint.restore.value for joint in gear.joints])
    second /= THRESHOLDS.one_repair * gear.second_repair_chance.value

    def ends(causes: Array, late: float = 0.0) -> tuple[Array, int]:
        """Minutes of the best end after each pattern (14), and the place of its set without a
        reading, -1 where the cause is looked for elsewhere; `late`: of a check of the rigging after
        the repair. [min]
        """
        total = causes.sum(axis=1, keepdims=True)
        # In vain: sound joints where the joints are not the cause.
        vain = more * causes[:, 1:].sum(axis=1, keepdims=True)
        restored = total * (minutes + after) + second * (out + vain) + late * causes[:, 1:2]
        restored = np.where(allowed, restored, np.inf)
        places = np.argmin(np.round(restored, 6), axis=1)
        elsewhere = total[:, 0] * (minutes[rows, must] + after * sets[must].any(axis=1))
        elsewhere += THRESHOLDS.sent_away * second * (out[rows, must] + causes[:, 1])
        best = restored[rows, places]
        place = -1 if elsewhere[0] < best[0] else int(places[0])
        return np.minimum(best, elsewhere), place

    def first_step(values: Array, place: int) -> Choice:
        if k := int(values.argmin()):
            return Choice(read=groups[k])
        return Choice(restore=sets[place] if place >= 0 else None)

    # (15)
    right = causes * [1.0, PRIORS.overlooked, 1.0]
    wrong = (causes - right).sum(axis=1) * minutes[rows, must]
    checked, place = ends(right)
    checked += wrong
    now, place_now = ends(causes, 0.0 if looked else check + gear.plunger_reading.value)
    if not looked:
        now[1:] = np.minimum(now, checked + check * causes.sum(axis=1))[1:]
    # (16), rounded: both ends of one link are worth the same, and noise must not choose between
    # them.
    now = np.round(read + np.add.reduceat(now, starts), 6)
    checked = np.round(check + right[0].sum() * read + np.add.reduceat(checked, starts), 6)
    if looked or now.min() <= checked.min():
        return first_step(now, place_now)
    return Choice(then=first_step(checked, place))


def _bits(belief: Belief, may: Mask, first: Mask) -> Wholes:
    """The bit of each joint whose restoration is weighed, 0 of the others: some first, then those
    that move the plunger farthest.
    """
    reach = np.abs(belief.states.freed_in).mean(axis=0)
    weighed = np.lexsort((-reach, ~first, ~may))[: min(int(may.sum()), THRESHOLDS.movable)]
    bits = np.zeros(len(may), np.int64)
    bits[weighed] = 1 << np.arange(len(weighed))
    return bits


def _groups(gear: Gear, belief: Belief, unread: Mask, doubted: Mask) -> list[tuple[int, ...]]:
    """Joints that may be read together: in each area those likeliest worn per minute, by how far
    they move the plunger; readings in doubt.
    """
    rate = np.round(belief.worn_by_leverage, 4) / gear.access_minutes
    found = []
    for area in gear.areas:
        inside = [j for j, joint in enumerate(gear.joints) if joint.area == area.name]
        some = sorted((j for j in inside if unread[j]), key=lambda j: -rate[j])
        some = some[: THRESHOLDS.together]
        found += [tuple(some[:count]) for count in range(1, len(some) + 1)]
    again = tuple(np.flatnonzero(doubted).tolist())
    return [*found, again] if again else found


def _patterns(groups: Sequence[tuple[int, ...]], joints: int) -> tuple[Mask, Mask]:
    """The joints of each group, once for each pattern of its worn ones, and these."""
    found = []
    for group in groups:
        both = np.zeros((2, 1 << len(group), joints), bool)
        both[0, :, group] = True
        both[1, :, group] = np.arange(1 << len(group)) >> np.arange(len(group))[:, None] & 1
        found.append(both)
    asked, worn = np.concatenate(found, axis=1)
    return asked, worn
