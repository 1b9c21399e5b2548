"""How worn the joints may be that nobody read: the one prior of wear, for plan, chances and advice.
A verdict takes unread joints at their bounds.

No wear rate of this gear is public, so the prior knows no fleet: the shares of one gear's joints
are exponential about a level, up to the limit at which an overhaul restores them; a few joints are
worn out for reasons of their own, more on gears that are worn more. The joints of a gear have their
level in common, and what was read tells what to expect of the rest; or each joint has its own.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mlg_troubleshoot.arrays import Array, Mask, Places
from mlg_troubleshoot.decision.case import Cases
from mlg_troubleshoot.decision.prediction import Prediction, model_uncertainty
from mlg_troubleshoot.decision.priors import PRIORS
from mlg_troubleshoot.decision.second_order import responses
from mlg_troubleshoot.decision.verdict_rule import SCORE, tabled_normal_cdf

# Shares of its limit that a joint may be worn to, and how wide each is. [1]
SHARE = 0.04
SHARES = (np.arange(50) + 0.5) * SHARE

# Chance from which a gear counts as too close to its margin for any reading of a joint to settle
# it. [1]
TOO_CLOSE = 0.8


def _densities() -> Array:
    levels = np.geomspace(*PRIORS.levels, 6)[:, None]
    out = np.where(SHARES > 1.0, 1.0, 0.0)
    even = np.exp(-SHARES / levels) * (1.0 - out)
    even /= even.sum(axis=1, keepdims=True)
    chance = np.geomspace(*PRIORS.worn_out, len(levels))[:, None]
    alike = (1.0 - chance) * even + chance * out / out.sum()
    return np.vstack([alike, alike.mean(axis=0)])


# Chance of each share, (levels, shares): at each level that the joints of a gear have in common, in
# the last row where each joint has its own; of those beyond the limit; mean and variance of the
# share, by level. [1]
DENSITIES = _densities()
BEYOND = DENSITIES * (SHARES > 1)
MEAN = DENSITIES @ SHARES
VARIANCE = DENSITIES @ SHARES**2 - MEAN**2
# Chances of the levels before any gear of the fleet is known, each common one as likely. [1]
PRIOR_OF_LEVELS = np.full(len(DENSITIES), PRIORS.alike / (len(DENSITIES) - 1))
PRIOR_OF_LEVELS[-1] = 1.0 - PRIORS.alike


def level_chances(cases: Cases) -> Array:
    """Chances of the levels of wear of each gear, given what was read on it. [1]"""
    share = np.clip(cases.filled(0.0) / cases.gear.limits_in, 0.0, 2.0)
    each = np.array([np.interp(share, SHARES, level) for level in np.log(DENSITIES / SHARE)])
    total = np.sum(np.where(cases.measured, each, 0.0), axis=2).T
    chances = np.exp(total - total.max(axis=1, keepdims=True)) * (
        cases.fleet.levels or PRIOR_OF_LEVELS
    )
    return np.asarray(chances / chances.sum(axis=1, keepdims=True))


@dataclass(frozen=True, slots=True, eq=False)
class Doubted:
    """Readings over the limit, each with the chance of what the joint is really worn to.

    A gauge may have an error of scale, and a reading may be the total play; neither is likely of a
    joint that was measured again.

    Attributes
    ----------
    rows, joints : ndarray of int, shape (readings,)
        Places of the gears and of their joints.
    chances : ndarray, shape (readings, shares)
        Chance of each of `SHARES`, not normalised. [1]
    """

    rows: Places
    joints: Places
    chances: Array

    @classmethod
    def of(cls, cases: Cases, levels: Array) -> Doubted:
        limits = cases.gear.limits_in
        rows, joints = np.nonzero(cases.over_limit)
        read = (cases.clearance_in[rows, joints] / limits[joints])[:, None]
        # No share is known better than its cell is wide.
        u = np.maximum(cases.gauge_u_in[rows, joints] / limits[joints], 0.25 * SHARE)[:, None]
        again = cases.own_gauge[rows, joints][:, None]
        logs = []
        slip = -np.expm1(-PRIORS.wrong_readings / len(limits))
        for factor, share in ((1.0, 1.0 - slip), (2.0, slip)):
            spread = np.hypot(u, np.where(again, 0.0, PRIORS.gauge_scale * factor * SHARES))
            log = -0.5 * ((read - factor * SHARES) / spread) ** 2 - np.log(spread)
            logs.append(np.where(again & (factor > 1.0), -np.inf, log + np.log(share)))
        # The level by the other readings: this one is in doubt.
        others = levels[rows] / DENSITIES[:, np.minimum(read[:, 0] / SHARE, 49.0).astype(int)].T
        weight = np.logaddexp(*logs) + np.log(others @ DENSITIES)
        return cls(rows, joints, np.exp(weight - weight.max(axis=1, keepdims=True)))

    def if_restored(self, read: Mask, levels: Array) -> Array:
        """How much likelier the readings of each gear are if what was over its limit was restored
        when somebody last worked on it: a rigging goes wrong at such work. [1]
        """
        left = PRIORS.overlooked * (levels @ BEYOND.sum(axis=1))
        sound = (1.0 - left) / (1.0 - levels @ BEYOND.sum(axis=1))
        each = np.where(read, sound[:, None], 1.0)
        beyond = (self.chances @ (SHARES > 1.0)) / self.chances.sum(axis=1)
        at = self.rows
        each[at, self.joints] = (1.0 - beyond) * sound[at] + beyond * PRIORS.overlooked
        return np.asarray(np.prod(each, axis=1))


class Unread:
    """What the unread joints of n gears may add to the worst case, level of wear by level of wear.

    At each level the worst case is normal, a sum over several joints where none dominates, and
    linear about the clearances that are expected.

    levels: chances of the levels, (n, levels). [1] reach_in: what each unread joint adds at its
    limit. [in]
    """

    def __init__(self, cases: Cases, lower: Prediction, levels: Array) -> None:
        gear = cases.gear
        linkages = responses(cases.gear)
        self.levels = levels
        self.gear = gear
        self.read = cases.measured
        self.margin_in = cases.margin_in
        self.base_in = np.nan_to_num(lower.displacement_in)
        expected = cases.filled((levels @ MEAN)[:, None] * gear.limits_in)
        each = np.array([linkage.magnitude(expected) for linkage in linkages])
        slopes = linkages[0].slopes(expected)
        self.reach_in = np.where(self.read, 0.0, slopes * gear.limits_in)
        geometry = np.std(each, axis=0, ddof=1) if len(each) > 1 else np.zeros(len(cases))
        parts = (
            np.sqrt(np.sum((slopes * cases.gauge_u_in) ** 2, axis=1)),
            geometry,
            cases.margin_u_in,
            model_uncertainty(each[0], cases.residual_u_in),
        )
        self.u_in = np.sqrt(sum(part**2 for part in parts))
        guard = SCORE * self.u_in
        self.within_in = cases.margin_in - guard
        self.outside_in = cases.margin_in + guard

    def adds(self, joints: Mask) -> tuple[Array, Array]:
        """Mean and variance, at each level, of what some joints add to the worst case. [in, in²]"""
        each = np.where(joints, self.reach_in, 0.0)
        mean = each.sum(axis=1)[:, None] * MEAN
        return mean, (each**2).sum(axis=1)[:, None] * VARIANCE

    def below(self, bound_in: Array, joints: Mask, u_in: Array | float = 0.0) -> Array:
        """Chance that the worst case, some joints added, is below a bound known to `u_in`. [1]"""
        mean, variance = self.adds(joints)
        spread = np.sqrt(np.maximum(variance + np.square(u_in), 1e-18))
        scores = (bound_in[:, None] - self.base_in[:, None] - mean) / spread
        return np.asarray(np.sum(self.levels * tabled_normal_cdf(scores), axis=1))

    def too_close(self) -> Array:
        """Chance that neither verdict conforms once every joint is read. [1]"""
        return self.below(self.outside_in, ~self.read) - self.below(self.within_in, ~self.read)

    def settled(self, joints: Mask, rest: Mask) -> Array:
        """Chance that the verdict is settled once some joints are read and the rest is not. [1]"""
        open_in = np.sum(np.where(rest, self.reach_in, 0.0), axis=1)
        outside = 1.0 - self.below(self.outside_in, joints)
        within = self.below(self.within_in - open_in, joints)
        between = self.below(self.outside_in - open_in, joints) - self.below(self.within_in, joints)
        critical = (rest & self.gear.critical).any(axis=1)
        return outside + np.where(critical, 0.0, within + np.maximum(between, 0.0))

    def group(self, candidates: Mask, enough: float) -> Mask:
        """The joints to read in one round: the fewest, most telling a minute first, that settle
        the verdict with chance `enough`.
        """
        # Rounded: both ends of one link are worth the same, and rounding noise must not order them.
        rate = np.round(self.reach_in / self.gear.access_minutes, 9)
        order = np.argsort(np.where(candidates, -rate, np.inf), axis=1, kind="stable")
        chosen = np.zeros_like(candidates)
        done = ~candidates.any(axis=1)
        rows = np.arange(len(candidates))
        for place in range(candidates.shape[1]):
            joint = order[:, place]
            chosen[rows, joint] |= ~done & candidates[rows, joint]
            if place > 0:
                # Two at least: joints read one by one would not come to an end within twelve
                # rounds.
                done = done | (self.settled(chosen, ~self.read & ~chosen) >= enough)
        return chosen
