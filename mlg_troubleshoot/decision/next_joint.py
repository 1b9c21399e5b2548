"""Which joint to measure next, by what its reading is worth per minute, and when to stop."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from mlg_troubleshoot.arrays import Array
from mlg_troubleshoot.decision.assessment import MeasuringAdvice, ReadingWorth, Verdict
from mlg_troubleshoot.decision.case import Cases
from mlg_troubleshoot.decision.plan import Action, Plan, minutes_to_measure
from mlg_troubleshoot.decision.prediction import model_uncertainty
from mlg_troubleshoot.decision.second_order import Response, responses
from mlg_troubleshoot.decision.sentences import percent
from mlg_troubleshoot.decision.verdict_rule import CONFORMANCE, verdict, zone
from mlg_troubleshoot.decision.wear_levels import (
    level_likelihood,
    level_weights,
    moments,
    quantiles,
    tabled_normal_cdf,
    uncertainty_parts,
)

# At a conformance probability of 95 % one wrong WITHIN weighs as much as this many wrong OUTSIDE.
COST_OF_WRONG_WITHIN = CONFORMANCE / (1.0 - CONFORMANCE)
# A drop in risk below this is rounding: the reading has no value of its own.
_NO_VALUE = 1e-6
# Clearances that a reading may show, at evenly spaced probabilities. [1]
_QUANTILES = 12
# An expectation is enough where being wrong costs at most this share of what a just conforming
# OUTSIDE does. [1]
_ENOUGH_SHARE = 0.5
# Chance from which a gear counts as too close to its margin for any reading of a joint to settle
# it. [1]
_TOO_CLOSE = 0.9
# Places and weights of a normal distribution, for the worst case once everything is measured.
_SPOTS = np.linspace(-3.2, 3.2, 65)
_SPOT_WEIGHTS = np.exp(-0.5 * _SPOTS**2) / np.exp(-0.5 * _SPOTS**2).sum()


def decision_risk(probability: Array | float) -> Array:
    """Expected cost of the better of WITHIN and OUTSIDE. [1]"""
    p = np.asarray(probability, float)
    return np.asarray(np.minimum(COST_OF_WRONG_WITHIN * (1.0 - p), p))


def enough(within: float, too_close: float = 0.0) -> Verdict | None:
    """Say which verdict an expectation is enough for, to go on troubleshooting."""
    if decision_risk(within) <= _ENOUGH_SHARE * (1.0 - CONFORMANCE) * (1.0 + 1e-9):
        return Verdict.WITHIN_MARGIN if within > 0.5 else Verdict.OUTSIDE_MARGIN
    return Verdict.INCONCLUSIVE if too_close >= _TOO_CLOSE else None


@dataclass(frozen=True, slots=True)
class Outlook:
    """Chances that one gear is within its margin, and that it is INCONCLUSIVE once every joint is
    measured. [1]
    """

    worth: tuple[ReadingWorth, ...]
    within: float
    too_close: float

    @property
    def enough(self) -> Verdict | None:
        return enough(self.within, self.too_close)


def outlook(one: Cases, anchor: tuple[float, float] | None = None) -> Outlook:
    """Find what each reading is worth, and the chances that the gear is within its margin or too
    close to it.

    The unmeasured joints are taken by their distribution (`wear_levels`). For each joint the
    probability of being within the margin, once its clearance is known, follows for a range of
    clearances; what the risk falls by on average is the value of the reading. Where no single
    reading has a value, the share of the variance of the worst case takes its place. Distribution
    and expansion serve the ranking only.
    """
    gear, missing = one.gear, np.flatnonzero(~one.measured[0]).tolist()
    opened = frozenset(
        joint.area for joint, read in zip(gear.joints, one.measured[0], strict=True) if read
    )
    linkages = responses(gear)
    if anchor is not None:
        linkages = (linkages[0].anchored(one.filled(0.0)[0], *anchor), *linkages[1:])
    belief = _Belief(one, linkages)
    worth = [
        ReadingWorth(
            gear.joint_numbers[j],
            minutes_to_measure(gear, [gear.joint_numbers[j]], opened),
            belief.risk_drop(j),
            belief.variance(j),
            gear.joints[j].critical,
        )
        for j in missing
    ]
    first = [w for w in worth if w.critical] or worth
    valued = any(w.risk_drop > _NO_VALUE for w in first)
    ordered = tuple(
        sorted(
            worth,
            key=lambda w: (
                not w.critical,
                -(w.risk_drop if valued else w.variance_in2) / w.minutes,
            ),
        )
    )
    return Outlook(ordered, belief.within(), belief.too_close())


class _Belief:
    """One gear with its unmeasured joints distributed, level of wear by level of wear.

    At each level the worst case is taken as normal: a sum over several joints, where none
    dominates. The unmeasured joints are at their mean there, and the worst case is linearised.
    """

    def __init__(self, one: Cases, linkages: Sequence[Response]) -> None:
        self.limits, self.residual_u_in = one.gear.limits_in, one.residual_u_in
        known, found, self.margin_in = one.measured[0], one.filled(0.0)[0], float(one.margin_in[0])
        share, variance = moments()
        self.mean = np.where(known, found, share[:, None] * self.limits)
        parts = uncertainty_parts(linkages, self.mean, one.gauge_u_in[0], float(one.margin_u_in[0]))
        self.worst, self.slopes, self.u_rest = parts
        self.spread = np.where(known, 0.0, variance[:, None] * self.limits**2)
        self.weight = level_weights((found / self.limits)[known])

    def _chance(self, worst: Array, variance: Array, u_rest: Array | None = None) -> Array:
        """Chance of being within the margin, from the worst case expected and the variance of what
        is open.
        """
        u_rest = self.u_rest if u_rest is None else u_rest
        u = np.sqrt(variance + u_rest**2 + model_uncertainty(worst, self.residual_u_in) ** 2)
        return tabled_normal_cdf((self.margin_in - worst) / u)

    def within(self) -> float:
        """Chance of being within the margin with what is measured so far."""
        return float(
            self.weight @ self._chance(self.worst, np.sum(self.slopes**2 * self.spread, axis=1))
        )

    def too_close(self) -> float:
        """Chance that neither verdict conforms once every joint is measured."""
        spread = np.sqrt(np.sum(self.slopes**2 * self.spread, axis=1))
        worst = self.worst[:, None] + spread[:, None] * _SPOTS
        within = self._chance(worst, np.zeros_like(worst), self.u_rest[:, None])
        between = (within > 1.0 - CONFORMANCE) & (within < CONFORMANCE)
        return float(np.sum(self.weight[:, None] * _SPOT_WEIGHTS * between))

    def risk_drop(self, j: int) -> float:
        shares = quantiles(_QUANTILES)
        weight = np.repeat(self.weight / _QUANTILES, _QUANTILES)
        level = self.weight * level_likelihood(shares.ravel())
        level /= level.sum(axis=1, keepdims=True)
        clearance = shares.ravel()[:, None] * self.limits[j]
        worst = self.worst + self.slopes[:, j] * (clearance - self.mean[:, j])
        open_still = np.sum(np.delete(self.slopes**2 * self.spread, j, axis=1), axis=1)
        known = np.sum(level * self._chance(worst, open_still), axis=1)
        drop = float(decision_risk(weight @ known) - weight @ decision_risk(known))
        return drop if drop > _NO_VALUE else 0.0

    def variance(self, j: int) -> float:
        """Variance of the worst case that a reading of one joint removes. [in²]"""
        within = float(self.weight @ (self.slopes[:, j] ** 2 * self.spread[:, j]))
        means = self.slopes[:, j] * self.mean[:, j]
        return within + float(self.weight @ (means - self.weight @ means) ** 2)


def advise(one: Cases) -> MeasuringAdvice:
    """Say of one gear which joint to measure next and whether one may stop.

    One may stop where the verdict is the same with every unmeasured joint measured as 0 and
    measured at its limit: the worst case grows with every clearance, so nothing between can differ.
    A joint beyond its limit is found only by measuring it.
    """
    ends = np.vstack([one.filled(0.0), one.filled(one.gear.limits_in)])
    four = one.take(np.zeros(4, np.intp))
    # Unread joints at 0 and at their limit: as unread, then as if those were readings.
    read = np.vstack([one.measured, one.measured, np.ones_like(ends, bool)])
    prediction = four.predict(np.vstack([ends, ends]), read)
    p = prediction.probability_within(four.margin_in, four.margin_u_in)
    now = verdict(float(p[0]), float(p[1]), critical_missing=bool(one.critical_missing[0]))
    low, high = zone(float(p[2])), zone(float(p[3]))
    settled = low is high
    if one.measured.all():
        precise = _can_precision_settle(one, now)
        certain = None if now is Verdict.INCONCLUSIVE else now
        return MeasuringAdvice(
            (), not precise, now, float(p[0]), certain, _all_measured(now, precise)
        )
    anchor = float(prediction.worst.over_in[0]), float(prediction.worst.under_in[0])
    ahead = outlook(one, anchor if np.isfinite(anchor).all() else None)
    return MeasuringAdvice(
        ahead.worth,
        stop=settled,
        verdict=low if settled else now,
        expected_within=ahead.within,
        expected=ahead.enough,
        text=_settled(low) if settled else _text(one, ahead),
    )


def in_one_voice(advice: MeasuringAdvice, plan: Plan) -> MeasuringAdvice:
    """What measuring is worth, in the order and the words of the plan."""
    first = plan.steps[0]
    if first.action is Action.CORRECT:
        return advice
    if first.action is not Action.MEASURE:
        text = f"Nothing is to be measured now. Next: {first.words}."
        return replace(advice, stop=True, text=text)
    order = {joint: place for place, joint in enumerate(first.joints)}
    worth = tuple(sorted(advice.worth, key=lambda w: order.get(w.joint, len(order))))
    return replace(advice, worth=worth, stop=False, text=f"Next: {first.words}.")


def _settled(verdict_then: Verdict) -> str:
    return (
        f"More measuring does not change the verdict ({verdict_then.words}): you may stop. A joint"
        " over its limit is found only by measuring it."
    )


def _text(one: Cases, ahead: Outlook) -> str:
    best, within = ahead.worth[0], ahead.within
    name = one.gear.joint(best.joint).label
    minutes = f"about {best.minutes:.0f} min access"
    if ahead.enough is Verdict.INCONCLUSIVE:
        plunger = (
            ""
            if np.isfinite(one.mean_in[0])
            else " Measure the plunger displacement at mid-position."
        )
        return (
            "If the unmeasured joints are worn like the measured ones, measuring them will hardly"
            f" settle it: too close to the margin (chance {percent(ahead.too_close)}).{plunger} The"
            f" most informative joint is {name} ({minutes})."
        )
    if ahead.enough is None:
        if best.risk_drop > 0.0:
            return f"Most useful next reading: {name} ({minutes})."
        return (
            f"Next: {name} ({minutes}); no single reading is decisive, but this one removes"
            " the most uncertainty per minute."
        )
    likely = within > 0.5
    chance = percent(within if likely else 1.0 - within)
    where = "inside the margin" if likely else "outside the margin"
    return (
        f"If the unmeasured joints are worn like the measured ones, the worst case is {where}"
        f" (chance {chance}): enough to go on troubleshooting. To be certain, measure {name} next"
        f" ({minutes})."
    )


def _all_measured(now: Verdict, precise: bool) -> str:
    if now is not Verdict.INCONCLUSIVE:
        return "All joints are measured: more measuring does not change the verdict."
    if precise:
        return "All joints are measured. More precise readings may still settle it."
    return (
        "All joints are measured, and more precise readings do not settle it: the uncertainty of"
        " the geometry and of the model is larger than that of the readings. Measure the plunger"
        " displacement at mid-position."
    )


def _can_precision_settle(one: Cases, now: Verdict) -> bool:
    """True if exact readings, within two standard uncertainties of these ones, could leave
    INCONCLUSIVE.
    """
    if now is not Verdict.INCONCLUSIVE:
        return False
    found, gauge_u_in, two = one.clearance_in[0], one.gauge_u_in[0], one.take(np.zeros(2, np.intp))
    slopes = responses(one.gear)[0].slopes(found)
    step = (
        2.0
        * gauge_u_in**2
        * slopes
        / np.maximum(np.sqrt(np.sum((gauge_u_in * slopes) ** 2)), 1e-12)
    )
    rows = np.maximum(np.array([found - step, found + step]), 0.0)
    p = two.predict(rows, np.zeros(rows.shape, bool)).probability_within(
        two.margin_in, two.margin_u_in
    )
    return any(zone(float(value)) is not Verdict.INCONCLUSIVE for value in p)
