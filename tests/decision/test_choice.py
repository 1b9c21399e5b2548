"""The next action on a gear that failed, against (13) to (16) of docs/reference/models.md written
out one drawn state and one repair at a time.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator
from itertools import combinations
from statistics import median

import numpy as np
import pytest

from mlg_troubleshoot.arrays import Mask
from mlg_troubleshoot.decision.belief import STATES, Inference, States
from mlg_troubleshoot.decision.inspection import Outcome
from mlg_troubleshoot.decision.planner import choose
from mlg_troubleshoot.decision.prediction import Cases
from mlg_troubleshoot.decision.priors import PRIORS, THRESHOLDS
from mlg_troubleshoot.gear.gear import Gear
from tests.decision.conftest import every_joint, inspected


def subsets(of: Collection[int]) -> Iterator[set[int]]:
    for size in range(len(of) + 1):
        yield from map(set, combinations(of, size))


class Plain:
    """One gear with some joints over their limits, whose rigging nobody looked at."""

    def __init__(self, gear: Gear, states: States, over: set[int]) -> None:
        self.gear, self.states, self.over = gear, states, over
        joint = median(each.restore.value for each in gear.joints)
        self.second = joint / (THRESHOLDS.one_repair * gear.second_repair_chance.value)
        self.after = gear.plunger_reading.value + gear.retraction.value

    def opening(self, joints: Collection[int], opened: Collection[int] = ()) -> float:
        areas = {self.gear.joints[j].area for j in joints}
        areas -= {self.gear.joints[j].area for j in opened}
        return sum(area.access.value for area in self.gear.areas if area.name in areas)

    def repair(self, joints: Collection[int], opened: Collection[int] = ()) -> float:
        restored = sum(self.gear.joints[j].restore.value for j in joints)
        return self.opening(joints, opened) + restored

    def reading(self, joints: Collection[int]) -> float:
        return self.opening(joints) + sum(float(self.gear.access_minutes[j]) for j in joints)

    def end(self, like: Mask, over: set[int], read: Collection[int], *, checked: bool) -> float:
        """(14), of the states that are alike."""
        share = np.array([1.0, PRIORS.overlooked if checked else 1.0, 1.0])
        joints, rigging, other = (self.states.causes[:, like].sum(axis=1) * share).tolist()

        def out(restored: set[int]) -> float:
            left = self.states.stands_in - self.states.freed_in[:, [*restored]].sum(axis=1)
            stays = (np.abs(left) > self.states.margin_in) & like[:STATES]
            return float(self.states.causes[0, :STATES][stays].sum())

        total = joints + rigging + other
        took = self.repair(over, read) + self.after * bool(over)
        best = total * took + THRESHOLDS.sent_away * self.second * (out(over) + rigging)
        late = 0.0 if checked else self.gear.rigging_check.value + self.gear.plunger_reading.value
        for more in subsets(set(read) - over):
            restored = over | more
            if restored and (not more or out(restored) < 0.5 * joints):
                vain = out(restored) + (rigging + other if more else 0.0)
                took = self.repair(restored, read) + self.after
                best = min(best, total * took + self.second * vain + late * rigging)
        return best

    def patterns(self, read: Collection[int]) -> Iterator[tuple[set[int], Mask, float]]:
        """What is over its limit once some joints are read, its states, and the chance of a wrong
        rigging that a check finds.
        """
        for worn in subsets(read):
            like = np.all(self.states.worn[:, [*read]] == [j in worn for j in read], axis=1)
            wrong = float(self.states.causes[1, like].sum()) * (1.0 - PRIORS.overlooked)
            yield self.over - set(read) | worn, like, wrong

    def minutes(self, read: Collection[int]) -> tuple[float, float, float]:
        """(14) to (16): read some joints or none at once; after the rigging was found right; and
        what it takes where it was found wrong.
        """
        check = self.gear.rigging_check.value
        now = right = found_wrong = 0.0
        for over, like, wrong in self.patterns(read):
            share = float(self.states.causes[:, like].sum())
            corrected = wrong * self.repair(over, read)
            checked = self.end(like, over, read, checked=True)
            end = self.end(like, over, read, checked=False)
            now += min(end, checked + corrected + check * share) if read else end
            now += share * self.reading(read)
            right += checked + (share - wrong) * self.reading(read)
            found_wrong += corrected
        return now, right, check + found_wrong


@pytest.mark.parametrize(
    ("over", "doubted"), [(set(), set()), ({2}, set()), ({2}, {2}), ({4, 7}, {7}), ({2, 7}, {2, 7})]
)
@pytest.mark.parametrize("unread", [(3,), (0, 1, 3), (5, 6, 8)])
def test_the_next_action_has_the_fewest_minutes_of_the_equations(
    gear: Gear, unread: tuple[int, ...], over: set[int], doubted: set[int]
) -> None:
    read = {n: c for n, c in every_joint(0.0008).items() if n - 1 not in unread}
    read |= {j + 1: 1.1 * gear.joints[j].limit.value for j in over}
    rows = [
        inspected(read, outcome=Outcome.FAILED, readings_in=(y,))
        for y in (0.0325, -0.0345, 0.038, -0.048, 0.055, -0.06, 0.065)
    ]
    joints = np.arange(10)
    is_over, is_doubted, is_unread = (np.isin(joints, [*each]) for each in (over, doubted, unread))
    masks = {"over": is_over, "worn": is_over, "doubted": is_doubted, "unread": is_unread}
    for states in Inference(Cases.of(gear, rows), range(len(rows))).states:
        rate = np.round(states.blamed, 4) / gear.access_minutes
        groups = [(), tuple(sorted(doubted))]
        for area in gear.areas:
            inside = [j for j in unread if gear.joints[j].area == area.name]
            inside.sort(key=lambda j: -rate[j])
            groups += [tuple(inside[: k + 1]) for k in range(len(inside))]
        plain = Plain(gear, states, over)
        now, right, wrong = np.array([plain.minutes(group) for group in groups]).T
        choice = choose(gear, states, **masks, spare=joints >= 0, looked=False)
        chosen = choice.then or choice
        checked = float(np.min(right + wrong))
        assert (choice.then is not None) == (checked < now.min()) or checked == pytest.approx(
            now.min(), abs=1e-3
        )
        costs = now if choice.then is None else right
        assert costs[groups.index(chosen.read)] <= costs.min() + 1e-3
