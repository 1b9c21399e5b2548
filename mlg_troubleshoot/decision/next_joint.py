"""Which joint to measure next, by what its reading is worth per minute, and when to stop."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mlg_troubleshoot.arrays import Array
from mlg_troubleshoot.decision.assessment import MeasuringAdvice, ReadingWorth, Verdict
from mlg_troubleshoot.decision.case import Cases
from mlg_troubleshoot.decision.plan import Action, Plan, minutes_to_measure
from mlg_troubleshoot.decision.verdict_rule import CONFORMANCE
from mlg_troubleshoot.decision.wear_levels import TOO_CLOSE, Unread, level_chances

# At a conformance probability of 95 % one wrong WITHIN weighs as much as this many wrong OUTSIDE.
COST_OF_WRONG_WITHIN = CONFORMANCE / (1 - CONFORMANCE)
# A drop in risk below this is rounding: the reading has no value of its own.
_NO_VALUE = 1e-6
# An expectation is enough where being wrong costs at most this share of what a just conforming
# OUTSIDE does. [1]
_ENOUGH_SHARE = 0.5


def decision_risk(probability: Array | float) -> Array:
    """Expected cost of the better of WITHIN and OUTSIDE. [1]"""
    p = np.asarray(probability, float)
    return np.asarray(np.minimum(COST_OF_WRONG_WITHIN * (1.0 - p), p))


def enough(within: float, too_close: float = 0.0) -> Verdict | None:
    """Say which verdict an expectation is enough for, to go on troubleshooting."""
    if decision_risk(within) <= _ENOUGH_SHARE * (1.0 - CONFORMANCE) * (1.0 + 1e-9):
        return Verdict.WITHIN_MARGIN if within > 0.5 else Verdict.OUTSIDE_MARGIN
    return Verdict.INCONCLUSIVE if too_close >= TOO_CLOSE else None


@dataclass(frozen=True, slots=True)
class Outlook:
    """Chances that one gear is within its margin, and that it is INCONCLUSIVE once every joint is
    measured. [1]
    """

    worth: tuple[ReadingWorth, ...]
    within: float
    too_close: float


def outlook(one: Cases, unread: Unread | None = None) -> Outlook:
    """Find what each reading is worth, and the chances that the gear is within its margin or too
    close to it.

    What the risk falls by on average, once a joint is read, is the value of the reading. Where no
    single reading has a value, the share of the variance of the worst case takes its place.
    """
    if unread is None:
        unread = Unread(one, one.predict(one.filled(0.0)), level_chances(one))
    gear = one.gear
    removed = unread.variance(0)
    opened = frozenset(
        joint.area for joint, read in zip(gear.joints, one.measured[0], strict=True) if read
    )
    worth = [
        ReadingWorth(
            gear.joint_numbers[j],
            minutes_to_measure(gear, [gear.joint_numbers[j]], opened),
            _risk_drop(*unread.known(0, j)),
            float(removed[j]),
            gear.joints[j].critical,
        )
        for j in np.flatnonzero(~one.measured[0]).tolist()
    ]
    first = [w for w in worth if w.critical] or worth
    valued = any(w.risk_drop > 0.0 for w in first)

    def place(w: ReadingWorth) -> tuple[bool, float]:
        return not w.critical, -(w.risk_drop if valued else w.variance_in2) / w.minutes

    ordered = tuple(sorted(worth, key=place))
    return Outlook(ordered, float(unread.within()[0]), float(unread.too_close()[0]))


def _risk_drop(read: Array, within: Array) -> float:
    drop = float(decision_risk(read @ within) - read @ decision_risk(within))
    return drop if drop > _NO_VALUE else 0.0


def advise(
    one: Cases, unread: Unread, found: Verdict, p_within: float, plan: Plan
) -> MeasuringAdvice:
    """Say of one gear what measuring is worth, in the order and the words of its plan."""
    ahead = outlook(one, unread)
    first = plan.steps[0]
    reads = first.action in (Action.MEASURE, Action.MEASURE_AGAIN)
    order = {joint: place for place, joint in enumerate(first.joints)}
    worth = sorted(ahead.worth, key=lambda w: order.get(w.joint, len(order)) if reads else 0)
    complete = bool(one.measured.all())
    text = f"Next: {first.words}."
    return MeasuringAdvice(
        tuple(worth),
        stop=not reads,
        verdict=found,
        expected_within=p_within if complete else ahead.within,
        expected=(found if found is not Verdict.INCONCLUSIVE else None)
        if complete
        else enough(ahead.within, ahead.too_close),
        text=text if reads else f"No measurement is needed now. {text}",
    )
