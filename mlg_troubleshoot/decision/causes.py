"""What made a gear fail, as one probability model: joints read and unread, where their pins rest,
the linkage, the gauges, the rigging, and everything else.

The plunger stands where the sum of all joints puts it, each clearance times its amplification times
the cosine of its direction, plus a rigging offset where there is one. Densities of such sums are
products of characteristic functions: of a clearance in random directions, or held near its worst
one by the loads, of a joint that nobody read the same averaged over its wear. How often loads hold
the pins, and how far gears are worn, is assumed, or learned from a fleet (`fleet`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from mlg_troubleshoot.arrays import Array, Mask, Places
from mlg_troubleshoot.decision.assessment import RepairSet
from mlg_troubleshoot.decision.case import Cases
from mlg_troubleshoot.decision.inspection import RiggingCheck
from mlg_troubleshoot.decision.priors import PRIORS
from mlg_troubleshoot.decision.second_order import responses
from mlg_troubleshoot.decision.verdict_rule import tabled_normal_cdf
from mlg_troubleshoot.decision.waves import (
    AT_IN,
    FREQUENCIES,
    HALF_IN,
    HELD,
    RANDOM,
    SMOOTHED,
    STEP_IN,
    Pins,
    blur,
    density,
    inside,
)
from mlg_troubleshoot.decision.wear_levels import (
    BEYOND,
    DENSITIES,
    MEAN,
    PRIOR_OF_LEVELS,
    SHARES,
    Doubted,
    level_chances,
)
from mlg_troubleshoot.gear.gear import Gear

_LINKAGE = blur(PRIORS.linkage_u_in)


@dataclass(frozen=True, slots=True, eq=False)
class _Unread:
    """A gear of which nothing was read, with its pins at rest in one way.

    Attributes
    ----------
    amplification : ndarray, shape (joints,)
        Amplification of each joint. [1]
    bend : ndarray, shape (joints,)
        By how much each joint moves the plunger on average, per clearance squared. [1/in]
    by_share : ndarray, shape (joints, shares, terms)
        Characteristic functions of the joints by what they are worn to.
    unread, worn : ndarray, shape (levels, joints, terms)
        The same of joints that nobody read, and of those beyond their limit, by level of wear.
    fresh : ndarray, shape (joints, terms)
        The same of new parts.
    exceeds : ndarray, shape (levels,)
        Chance of leaving the margin, by level of wear. [1]
    """

    pins: Pins
    amplification: Array
    bend: Array
    by_share: Array
    unread: Array
    worn: Array
    fresh: Array
    exceeds: Array


@lru_cache(maxsize=4)
def _unread(gear: Gear) -> tuple[_Unread, _Unread]:
    response = responses(gear)[0]
    found = []
    amplification = response.amplification
    diagonal = np.diag(response.curvature)
    bend = 0.25 * (diagonal[0::2] + diagonal[1::2])
    reach = amplification * gear.limits_in
    margin = np.full(len(PRIOR_OF_LEVELS), gear.margin.value)
    for pins in (RANDOM, HELD):
        waves = pins.waves(FREQUENCIES * reach[:, None, None] * SHARES[:, None])
        unread = np.einsum("ls,jst->ljt", DENSITIES, waves)
        everything = np.prod(unread, axis=1) * _LINKAGE
        found.append(
            _Unread(
                pins,
                amplification,
                bend if pins is RANDOM else 0.0 * bend,
                waves,
                unread,
                np.einsum("ls,jst->ljt", BEYOND, waves),
                pins.waves(FREQUENCIES * (amplification * gear.new_parts_in)[:, None]),
                1.0 - inside(everything, margin),
            )
        )
    random, held = found
    return random, held


@dataclass(frozen=True, slots=True, eq=False)
class _Believed:
    """What is believed of n gears if their pins rest in one way.

    Attributes
    ----------
    fits : ndarray
        Density of the plunger's reading.
    levels : ndarray, shape (n, levels)
        Chances of the levels of wear. [1]
    worn : ndarray, shape (n, joints)
        Chance that each unread joint is beyond its limit. [1]
    waves : ndarray, shape (n, joints, terms)
        Characteristic function of each joint given the plunger's reading.
    sums : ndarray, shape (n, terms)
        Characteristic function of all joints together, whatever the plunger reads.
    exceeds : ndarray, shape (n,)
        Chance that the joints hold the plunger beyond its margin, whatever it reads. [1]
    usually : float
        The same of a gear of the fleet of which nothing was read. [1]
    by_share : ndarray, shape (readings, shares)
        Density of the plunger's reading by what each joint in doubt is worn to.
    """

    unread: _Unread
    fits: Array
    levels: Array
    worn: Array
    waves: Array
    sums: Array
    exceeds: Array
    usually: float
    by_share: Array

    def of_failures(self, outside: Array, within: Array) -> tuple[Array, Array]:
        """Densities of the plunger's reading among failures of the joints and of something else,
        by how many of each there are.
        """
        elsewhere = (1.0 - self.usually) * PRIORS.joints_for_one_elsewhere
        return outside / self.usually, within / elsewhere


@dataclass(frozen=True, slots=True, eq=False)
class Causes:
    """What is believed of n gears.

    Attributes
    ----------
    cases : Cases
        The gears.
    joints, rigging, elsewhere : ndarray, shape (n,)
        Chances that a failure is one of the joints, of the rigging or lock roller, or of something
        that leaves the plunger within its margin. [1]
    worn : ndarray, shape (n, joints)
        Chance that each joint is beyond its limit. [1]
    levels : ndarray, shape (n, levels)
        Chances of the levels of wear. [1]
    exceeds : ndarray, shape (n,)
        Chance with random directions that the joints hold the plunger beyond its margin, unread
        ones by their wear, whatever the plunger reads. [1]
    before_plunger : ndarray, shape (n,)
        How many failures of the joints there are for each of something else, by the readings of the
        joints alone. [1]
    loaded : ndarray, shape (n,)
        Chance that loads hold the pins near their worst directions, the joints being the cause. [1]
    outside, within : tuple of ndarray, shape (n,)
        Densities of the plunger's reading where the joints hold it beyond its margin and where they
        do not, with random pins and with held ones. [1]
    by_rigging : ndarray, shape (n,)
        The same density where rigging does, by how many such failures there are for each of the
        joints. [1]
    mean_in : ndarray, shape (n, joints)
        Clearances, read or expected. [in]
    u_in : ndarray, shape (n,)
        Standard uncertainty of the plunger's reading. [in]
    by_pins : tuple of _Believed
        What is believed with random pins and with held ones.
    """

    cases: Cases
    joints: Array
    rigging: Array
    elsewhere: Array
    worn: Array
    levels: Array
    exceeds: Array
    before_plunger: Array
    loaded: Array
    outside: tuple[Array, ...]
    within: tuple[Array, ...]
    by_rigging: Array
    mean_in: Array
    u_in: Array
    by_pins: tuple[_Believed, ...]

    @property
    def held(self) -> Array:
        """How much likelier the plunger's reading is if loads hold the pins. [1]"""
        likely = []
        for each, outside, within in zip(self.by_pins, self.outside, self.within, strict=True):
            joints, elsewhere = each.of_failures(outside, within)
            failed = joints + elsewhere + self.by_rigging
            likely.append(np.where(self.cases.failed, failed, outside + within))
        return likely[1] / np.maximum(likely[0], 1e-300)

    @property
    def leverage(self) -> Array:
        """Amplification of each joint as a share of the largest. [1]"""
        amplification = self.by_pins[0].unread.amplification
        return np.asarray(amplification / amplification.max())

    @property
    def reach_in(self) -> Array:
        """How far each joint can move the plunger. [in]"""
        return self.by_pins[0].unread.amplification * self.mean_in

    def with_chances(self, sets: Sequence[tuple[RepairSet, ...]]) -> list[tuple[RepairSet, ...]]:
        """Repair sets with the chance of a second repair after each, of gears that failed."""
        numbers = self.cases.gear.joint_numbers
        failed = self.cases.failed | self.cases.complained
        said: list[tuple[RepairSet, ...]] = []
        for row, some in enumerate(sets):
            if not failed[row]:
                said.append(some)
                continue
            members = np.array([[n in each.joints for n in numbers] for each in some], bool)
            second = self.second_repair(row, members).tolist() if some else []
            said.append(
                tuple(
                    replace(each, second_repair_probability=chance)
                    for each, chance in zip(some, second, strict=True)
                )
            )
        return said

    def second_repair(self, row: int, members: Mask) -> Array:
        """Chance that the plunger stays beyond its margin once subsets of joints are restored.

        Given the plunger's reading, joints that are left as they are keep their directions, and
        what is restored takes new ones. [1]
        """
        return self._over_pins(
            row, lambda each: self._second_repair(row, members, each, each.waves[row])
        )

    def second_once_read(self, row: int, restored: Mask, joints: Places) -> Array:
        """The same once `joints` are read and what was found worn is restored with some others:
        each in turn being the one beyond its limit; last, none of them. [1]
        """
        n = len(joints)
        members = np.repeat(restored[None], n + 1, axis=0)
        members[np.arange(n), joints] = True

        def second(each: _Believed) -> Array:
            levels = each.levels[row]
            worn = np.tensordot(levels, each.unread.worn[:, joints], 1)
            beyond = float(levels @ BEYOND.sum(axis=1))
            waves = np.repeat(each.waves[row][None], n + 1, axis=0)
            waves[np.arange(n), joints] = worn / beyond
            waves[n, joints] = (waves[n, joints] - worn) / (1.0 - beyond)
            return self._second_repair(row, members, each, waves)

        return self._over_pins(row, second)

    def _over_pins(self, row: int, chance_of: Callable[[_Believed], Array]) -> Array:
        """A chance, averaged over how the pins rest."""
        loaded = float(self.loaded[row])
        chances = ((1.0 - loaded, self.by_pins[0]), (loaded, self.by_pins[1]))
        # What is less likely than this moves no decision.
        return np.asarray(
            sum(chance * chance_of(each) for chance, each in chances if chance > 1e-3)
        )

    def _second_repair(
        self, row: int, members: Mask, believed_of: _Believed, waves: Array
    ) -> Array:
        unread = believed_of.unread
        pins = unread.pins
        gear = self.cases.gear
        margin = float(self.cases.margin_in[row])
        x = float(self.cases.plunger_in[row])
        left = np.prod(np.where(members[:, :, None], 1.0, waves), axis=1) * _LINKAGE
        if not np.isfinite(x):
            new = np.prod(np.where(members[:, :, None], unread.fresh, 1.0), axis=1)
            return 1.0 - inside(left * new, np.full(len(left), margin))
        gone = np.prod(np.where(members[:, :, None], waves, 1.0), axis=1)
        gone = gone * blur(self.u_in[row])
        gone = gone * SMOOTHED
        # The density of the remainder, given that all together read x.
        away = np.exp(-1j * FREQUENCIES * abs(x))
        given = density(left) * density(gone * away)[:, ::-1]
        given /= np.maximum(given.sum(axis=1, keepdims=True), 1e-300)
        # Restored parts move it a little, always on where loads hold them.
        moved = unread.amplification * gear.new_parts_in
        spread = np.hypot(np.sqrt(members @ (0.5 * moved**2)), 0.3 * STEP_IN)[:, None]
        on = (members @ moved)[:, None] if pins is HELD else 0.0
        beyond = tabled_normal_cdf((np.abs(AT_IN + on) - margin) / spread)
        return np.asarray(np.sum(given * beyond, axis=1))


def believed(cases: Cases) -> Causes:
    """Weigh what may be the matter with n gears, by everything that is known of each."""
    levels = level_chances(cases)
    u = np.hypot(cases.plunger_u_in, 1e-4)
    doubted = Doubted.of(cases, levels)
    both = tuple(_believed(cases, unread, levels, u, doubted) for unread in _unread(cases.gear))
    chances = np.array([1.0 - cases.fleet.loaded, cases.fleet.loaded])[:, None]
    chances = chances * [each.fits for each in both]
    chances /= chances.sum(axis=0)
    likely, worn = (
        sum(chance[:, None] * part for chance, part in zip(chances, parts, strict=True))
        for parts in ([each.levels for each in both], [each.worn for each in both])
    )
    read = cases.measured
    mean_in = np.where(read, cases.filled(0.0), (likely @ MEAN)[:, None] * cases.gear.limits_in)
    worn = np.where(read, 0.0, np.clip(worn, 0.0, 1.0))
    found = _weighed(cases, both, mean_in, worn, likely, u, doubted.if_restored(read, levels))
    # Readings in doubt, given where the plunger stands.
    of = doubted.rows
    is_read = np.isfinite(cases.plunger_in[of, None])
    random, held = (each.by_share / each.usually for each in both)
    by_cause = (1.0 - cases.fleet.loaded) * random + cases.fleet.loaded * held
    by_cause *= (np.sqrt(2.0 * np.pi) * u[of] / STEP_IN)[:, None]
    by_cause += found.by_rigging[of, None]
    chances = doubted.chances * np.where(is_read, by_cause, 1.0)
    worn[of, doubted.joints] = np.minimum((chances @ (SHARES > 1.0)) / chances.sum(axis=1), 1.0)
    return found


def _believed(
    cases: Cases, unread: _Unread, levels: Array, u: Array, doubted: Doubted
) -> _Believed:
    pins = unread.pins
    read = cases.measured
    known = pins.waves(FREQUENCIES * (unread.amplification * cases.filled(0.0))[:, :, None])
    known = known * blur(pins.cosine * unread.amplification * cases.gauge_u_in)
    # A reading in doubt counts as what the joint may be worn to.
    doubts = doubted.chances / doubted.chances.sum(axis=1, keepdims=True)
    by_joint = [np.flatnonzero(doubted.joints == j) for j in range(read.shape[1])]
    for j, of in enumerate(by_joint):
        known[doubted.rows[of], j] = doubts[of] @ unread.by_share[j]
    flat = unread.unread.reshape(len(PRIOR_OF_LEVELS), -1)
    waves = np.where(read[:, :, None], known, (levels @ flat).reshape(known.shape))
    worn = np.repeat((levels @ BEYOND.sum(axis=1))[:, None], read.shape[1], axis=1)
    fits = np.ones(len(cases))
    likely = levels.copy()
    by_share = np.ones(doubted.chances.shape)
    of_read = np.prod(np.where(read[:, :, None], known, 1.0), axis=1)
    sums = of_read * _LINKAGE
    # Gears of which the same joints were not read, and those joints.
    patterns, of = np.unique(read, axis=0, return_inverse=True)
    alike = [
        (np.flatnonzero(of.ravel() == k), np.flatnonzero(~each)) for k, each in enumerate(patterns)
    ]
    for same, joints in alike:
        sums[same] *= np.einsum("nl,lt->nt", levels[same], np.prod(unread.unread[:, joints], 1))
    rows = np.flatnonzero(np.isfinite(cases.plunger_in))
    if len(rows):
        at = np.exp(-1j * FREQUENCIES * np.abs(cases.plunger_in[rows])[:, None])
        at = (at if pins is HELD else at.real) * blur(u[rows]) * _LINKAGE
        whole = np.zeros((len(cases), len(FREQUENCIES)), at.dtype)
        whole[rows] = at
        given = _given_plunger(unread, alike, of_read * whole, levels)
        fits[rows], likely[rows], worn[rows] = (each[rows] for each in given)
        rest = waves[doubted.rows]
        rest[np.arange(len(rest)), doubted.joints] = 1.0
        rest = np.prod(rest, axis=1) * whole[doubted.rows]
        for j, of in enumerate(by_joint):
            by_share[of] = (rest[of] @ unread.by_share[j].T).real
        by_share = np.maximum(pins.sense * (0.5 + by_share), 0.0)
        after = (likely[rows] @ flat).reshape(known[rows].shape)
        waves[rows] = np.where(read[rows, :, None], known[rows], after)
    exceeds = 1.0 - inside(sums, cases.margin_in)
    # Wear alone never reaches a margin that is wide enough: a division needs some chance even then.
    usually = max(float(unread.exceeds @ (cases.fleet.levels or PRIOR_OF_LEVELS)), 1e-9)
    return _Believed(unread, fits, likely, worn, waves, sums, exceeds, usually, by_share)


def _given_plunger(
    unread: _Unread, alike: Sequence[tuple[Places, Places]], through: Array, levels: Array
) -> tuple[Array, Array, Array]:
    """Density of the plunger's reading, and given it chances of the levels, and of each unread
    joint being worn; through: characteristic function of the joints that were read, at the reading.
    """
    fits = np.empty_like(levels)
    worn = np.zeros((len(levels), *unread.worn.shape[:2]))
    for same, joints in alike:
        here = through[same]
        all_unread = np.prod(unread.unread[:, joints], axis=1)
        fits[same] = 0.5 + np.einsum("nt,lt->nl", here, all_unread).real
        for j in joints:
            others = np.prod(unread.unread[:, joints[joints != j]], axis=1) * unread.worn[:, j]
            density_if_worn = 0.5 * BEYOND.sum(axis=1) + np.einsum("nt,lt->nl", here, others).real
            worn[same, :, j] = density_if_worn
    fits = np.maximum(fits, 1e-12)
    worn = np.maximum(worn, 0.0)
    likely = levels * fits
    total = likely.sum(axis=1, keepdims=True)
    likely /= total
    worn = np.sum(likely[:, :, None] * worn / fits[:, :, None], axis=1)
    return unread.pins.sense * total[:, 0], likely, worn


def _weighed(
    cases: Cases,
    both: tuple[_Believed, ...],
    mean_in: Array,
    worn: Array,
    levels: Array,
    u: Array,
    if_restored: Array,
) -> Causes:
    """Divide each gear between its joints, its rigging and everything else.

    Loads hold the pins of a fleet or they do not, and failures of the joints are as many for each
    of another cause in either.
    """
    margin = cases.margin_in[:, None]
    seen = np.isfinite(cases.plunger_in)
    x = np.nan_to_num(cases.plunger_in)
    outside = []
    within = []
    for each in both:
        pins = each.unread.pins
        waves = each.sums
        shift = np.sum(each.unread.bend * mean_in**2, axis=1)
        reading = x - shift
        if pins is HELD:
            # One way on, whichever way that is; the expansion is good to a tenth there.
            waves = waves * blur(0.1 * np.asarray(mean_in @ each.unread.amplification))
            reading = np.abs(x)
        fits = pins.sense * density(waves)
        fits = fits * np.exp(-0.5 * ((reading[:, None] - AT_IN) / u[:, None]) ** 2)
        stands = np.abs(AT_IN + shift[:, None])
        beyond = tabled_normal_cdf((stands - margin) / (0.5 * STEP_IN))
        outside.append(np.sum(fits * beyond, axis=1))
        within.append(np.sum(fits * (1.0 - beyond), axis=1))
    fits = np.exp(-0.5 * ((x[:, None] - AT_IN) / u[:, None]) ** 2)
    offset = 1.0 / (1.0 + (AT_IN / (PRIORS.offset * margin)) ** 8)
    offset = offset * tabled_normal_cdf((np.abs(AT_IN) - margin) / (0.5 * STEP_IN))
    by_rigging = HALF_IN / STEP_IN * np.sum(offset * fits, axis=1) / np.sum(offset, axis=1)
    looked = np.array([i.rigging_checked not in (None, RiggingCheck.NO) for i in cases.inspections])
    by_rigging *= np.where(looked, PRIORS.overlooked, 1.0) / PRIORS.joints_for_one_misrigged
    by_rigging *= if_restored
    shares = (1.0 - cases.fleet.loaded, cases.fleet.loaded)
    random, held = (
        share * np.array(each.of_failures(*densities))
        for share, each, *densities in zip(shares, both, outside, within, strict=True)
    )
    all_joints, by_elsewhere = random + held
    parts = np.array([all_joints, by_rigging, by_elsewhere])
    before = np.array(
        [1.0, 1.0 / PRIORS.joints_for_one_misrigged, 1.0 / PRIORS.joints_for_one_elsewhere]
    )
    chances = np.where(
        seen,
        parts / np.maximum(parts.sum(axis=0), 1e-300),
        (before / before.sum())[:, None],
    )
    before_plunger = sum(
        share * each.exceeds / each.usually for share, each in zip(shares, both, strict=True)
    )
    joints, rigging, elsewhere = chances
    return Causes(
        cases,
        joints=joints,
        rigging=rigging,
        elsewhere=elsewhere,
        worn=worn,
        levels=levels,
        exceeds=both[0].exceeds,
        before_plunger=np.asarray(PRIORS.joints_for_one_elsewhere * before_plunger),
        loaded=np.where(seen, held[0] / np.maximum(all_joints, 1e-300), cases.fleet.loaded),
        outside=tuple(outside),
        within=tuple(within),
        by_rigging=by_rigging,
        mean_in=mean_in,
        u_in=u,
        by_pins=both,
    )
