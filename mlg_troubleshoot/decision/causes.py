"""What made a gear fail, as one probability model: joints read and unread, where their pins rest,
the linkage, the gauges, the rigging, and everything else.

The plunger stands where the sum of all joints puts it, each clearance times its amplification times
the cosine of its direction, plus a rigging offset where there is one. Densities of such sums are
products of characteristic functions: of a clearance c in uniformly random directions J₀(t·A·c), of
a joint that nobody read the same averaged over its wear. With a small chance the loads hold all
pins in their worst directions: a reading near the bound then says so.

Wear before the plunger is read is that of `wear_levels`. No fleet of this gear is public: all of
this is assumed, and stands in the table of `priors`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from mlg_troubleshoot.arrays import Array, Mask
from mlg_troubleshoot.decision.assessment import RepairSet
from mlg_troubleshoot.decision.case import Cases
from mlg_troubleshoot.decision.inspection import RiggingCheck
from mlg_troubleshoot.decision.priors import PRIORS
from mlg_troubleshoot.decision.second_order import responses
from mlg_troubleshoot.decision.verdict_rule import tabled_normal_cdf
from mlg_troubleshoot.decision.waves import (
    AT_IN,
    COSINES,
    FREQUENCIES,
    HALF_IN,
    STEP_IN,
    bessel,
    blur,
    inside,
)
from mlg_troubleshoot.decision.wear_levels import (
    BEYOND,
    DENSITIES,
    LEVELS,
    MEAN,
    SHARES,
    level_chances,
    surely_worn,
)
from mlg_troubleshoot.gear.gear import Gear


@dataclass(frozen=True, slots=True, eq=False)
class _Tables:
    """What a gear says of joints that nobody read: characteristic functions, and the same of worn
    ones, (levels, joints, terms); the bend of the mean, by joint.
    """

    amplification: Array
    unread: Array
    worn: Array
    bend: Array
    exceeds: float


@lru_cache(maxsize=4)
def _tables(gear: Gear) -> _Tables:
    response = responses(gear)[0]
    reach = response.amplification * gear.limits_in
    waves = bessel(FREQUENCIES[None, None, :] * reach[:, None, None] * SHARES[None, :, None])
    unread = np.einsum("ls,jsk->ljk", DENSITIES, waves)
    worn = np.einsum("ls,jsk->ljk", BEYOND, waves)
    diagonal = np.diag(response.curvature)
    bend = 0.25 * (diagonal[0::2] + diagonal[1::2])
    everything = np.prod(unread, axis=1).mean(axis=0) * blur(PRIORS.linkage_u_in)
    exceeds = float(1.0 - inside(everything[None], np.array([gear.margin.value]))[0])
    return _Tables(response.amplification, unread, worn, bend, exceeds)


@dataclass(frozen=True, slots=True, eq=False)
class Causes:
    """What is believed of n gears.

    joints, rigging, elsewhere: chances that a failure is one of the joints, of the rigging or lock
    roller, or of something that leaves the plunger within its margin. [1]
    worn: chance that each joint is beyond its limit. [1]
    levels: chances of the levels of wear, (n, levels). [1]
    exceeds: chance with random directions that the joints hold the plunger beyond its margin,
    unread ones by their wear, whatever the plunger reads. [1]
    waves: characteristic function of each joint, (n, joints, terms).
    loaded: chance that loads hold the pins in their worst directions. [1]
    """

    cases: Cases
    joints: Array
    rigging: Array
    elsewhere: Array
    worn: Array
    levels: Array
    exceeds: Array
    waves: Array
    loaded: Array
    mean_in: Array
    u_in: Array

    @property
    def expected_elsewhere(self) -> float:
        """Chance of leaving the margin from which the joints are the likelier cause. [1]"""
        return _tables(self.cases.gear).exceeds / PRIORS.joints_for_one_elsewhere

    @property
    def leverage(self) -> Array:
        """Amplification of each joint as a share of the largest. [1]"""
        amplification = _tables(self.cases.gear).amplification
        return np.asarray(amplification / amplification.max())

    @property
    def reach_in(self) -> Array:
        """How far each joint can move the plunger. [in]"""
        return _tables(self.cases.gear).amplification * self.mean_in

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
        cases, gear = self.cases, self.cases.gear
        tables, waves = _tables(gear), self.waves[row]
        margin, x = float(cases.margin_in[row]), float(cases.mean_in[row])
        fresh = bessel(FREQUENCIES * (tables.amplification * gear.new_parts_in)[:, None])
        left = np.prod(np.where(members[:, :, None], 1.0, waves), axis=1) * blur(
            PRIORS.linkage_u_in
        )
        new = np.prod(np.where(members[:, :, None], fresh, 1.0), axis=1)
        if not np.isfinite(x):
            return np.asarray(1.0 - inside(left * new, np.full(len(left), margin)))
        gone = np.prod(np.where(members[:, :, None], waves, 1.0), axis=1)
        gone = gone * blur(self.u_in[row])
        # The density of what is left, given that all together read x.
        of_left = np.maximum(0.5 + left @ COSINES, 0.0)
        of_gone = np.maximum(0.5 + gone @ np.cos(FREQUENCIES[:, None] * (x - AT_IN)), 0.0)
        given = of_left * of_gone
        given /= np.maximum(given.sum(axis=1, keepdims=True), 1e-300)
        # Restored parts move it a little.
        spread = np.sqrt(members @ (0.5 * (tables.amplification * gear.new_parts_in) ** 2))
        spread = np.hypot(spread, 0.3 * STEP_IN)[:, None]
        beyond = tabled_normal_cdf((np.abs(AT_IN) - margin) / spread)
        uniform = np.sum(given * beyond, axis=1)
        loaded = float(self.loaded[row])
        return np.asarray((1.0 - loaded) * uniform + loaded * self._loaded(row, members))

    def _loaded(self, row: int, members: Mask) -> Array:
        """The same with all pins near their worst directions: normal distributions. [1]"""
        cases, tables = self.cases, _tables(self.cases.gear)
        a, linkage = tables.amplification, PRIORS.linkage_u_in**2
        centre, spread = (
            PRIORS.cosine[0] * a * self.mean_in[row],
            PRIORS.cosine[1] * a * self.mean_in[row],
        )
        margin, x = float(cases.margin_in[row]), abs(float(cases.mean_in[row]))
        kept = ~members
        left, of_left = kept @ centre, kept @ spread**2 + linkage
        total, of_total = (
            centre.sum(),
            np.sum(spread**2) + self.u_in[row] ** 2 + PRIORS.linkage_u_in**2,
        )
        given = left + of_left / of_total * (x - total) + members @ (a * cases.gear.new_parts_in)
        u = np.sqrt(np.maximum(of_left * (1.0 - of_left / of_total), linkage))
        return tabled_normal_cdf((given - margin) / u)


def believed(cases: Cases) -> Causes:
    """Weigh what may be the matter with n gears, by everything that is known of each."""
    gear = cases.gear
    tables, read, limits = _tables(gear), cases.measured, gear.limits_in
    levels = level_chances(cases)
    known = bessel(FREQUENCIES * (tables.amplification * cases.filled(0.0))[:, :, None])
    known = known * blur(np.sqrt(0.5) * tables.amplification * cases.gauge_u_in)
    x = np.abs(np.nan_to_num(cases.mean_in))
    u = np.hypot(cases.mean_u_in, 1e-4)
    seen = np.isfinite(cases.mean_in)
    likely, worn = levels.copy(), levels @ BEYOND.sum(axis=1)
    worn = np.repeat(worn[:, None], len(limits), axis=1)
    rows = np.flatnonzero(seen)
    if len(rows):
        likely[rows], worn[rows] = _given_plunger(
            tables, read[rows], known[rows], levels[rows], x[rows], u[rows]
        )
    flat = tables.unread.reshape(len(LEVELS), -1)
    before = np.where(read[:, :, None], known, (levels @ flat).reshape(known.shape))
    exceeds = 1.0 - inside(np.prod(before, axis=1) * blur(PRIORS.linkage_u_in), cases.margin_in)
    waves = before.copy()
    if len(rows):
        after = (likely[rows] @ flat).reshape(known[rows].shape)
        waves[rows] = np.where(read[rows, :, None], known[rows], after)
    mean_in = np.where(read, cases.filled(0.0), (likely @ MEAN)[:, None] * limits)
    worn = np.where(read, surely_worn(cases, levels), np.clip(worn, 0.0, 1.0))
    return _weighed(cases, tables, waves, mean_in, worn, likely, u, exceeds)


def _given_plunger(
    tables: _Tables, read: Mask, known: Array, levels: Array, x: Array, u: Array
) -> tuple[Array, Array]:
    """Chances of the levels, and of each unread joint being worn, given the plunger's reading."""
    at = blur(np.hypot(u, PRIORS.linkage_u_in)) * np.cos(FREQUENCIES * x[:, None])
    count, beyond = read.shape[1], BEYOND.sum(axis=1)
    density, worn = np.empty_like(levels), np.zeros((len(x), len(LEVELS), count))
    for k in range(len(LEVELS)):
        waves = np.where(read[:, :, None], known, tables.unread[k])
        ahead, behind = _products(waves)
        density[:, k] = 0.5 + np.sum(ahead[-1] * at, axis=1)
        for j in range(count):
            rest = ahead[j] * behind[j + 1] * at
            worn[:, k, j] = 0.5 * beyond[k] + rest @ tables.worn[k, j]
    density, worn = np.maximum(density, 1e-12), np.maximum(worn, 0.0)
    likely = levels * density
    likely /= likely.sum(axis=1, keepdims=True)
    return likely, np.sum(likely[:, :, None] * worn / density[:, :, None], axis=1)


def _weighed(
    cases: Cases,
    tables: _Tables,
    waves: Array,
    mean_in: Array,
    worn: Array,
    levels: Array,
    u: Array,
    exceeds: Array,
) -> Causes:
    """Divide each gear between its joints, its rigging and everything else."""
    margin, seen = cases.margin_in, np.isfinite(cases.mean_in)
    x = np.nan_to_num(cases.mean_in)
    together = np.prod(waves, axis=1) * blur(PRIORS.linkage_u_in)
    shift = np.sum(tables.bend * mean_in**2, axis=1)
    density = np.maximum(0.5 + together @ COSINES, 0.0) * STEP_IN / HALF_IN
    fits = np.exp(-0.5 * ((x[:, None] - shift[:, None] - AT_IN) / u[:, None]) ** 2) / u[:, None]
    stands = np.abs(AT_IN + shift[:, None])
    outside = tabled_normal_cdf((stands - margin[:, None]) / (0.5 * STEP_IN))
    by_joints = np.sum(density * fits * outside, axis=1)
    # Pins in their worst directions, either sense.
    centre = PRIORS.cosine[0] * mean_in @ tables.amplification
    variance = np.sum((PRIORS.cosine[1] * tables.amplification * mean_in) ** 2, axis=1)
    variance += (0.1 * centre) ** 2 + PRIORS.linkage_u_in**2
    scatter, off = np.sqrt(variance + u**2), np.abs(x) - centre
    loaded = PRIORS.loaded * np.exp(-0.5 * (off / scatter) ** 2) / (2.0 * scatter)
    # Where the plunger then stands, by its reading and by the clearances.
    stood = centre + variance / scatter**2 * off
    loaded_outside = loaded * tabled_normal_cdf(
        (stood - margin) * scatter / (np.sqrt(variance) * u)
    )
    by_elsewhere = np.sum(density * fits * (1.0 - outside), axis=1) + loaded - loaded_outside
    by_elsewhere *= tables.exceeds / PRIORS.joints_for_one_elsewhere
    offset = 1.0 / (1.0 + (AT_IN / (PRIORS.offset * margin[:, None])) ** 8)
    by_rigging = np.sum(offset * fits * outside, axis=1) / np.sum(offset * outside, axis=1)
    by_rigging *= tables.exceeds / PRIORS.joints_for_one_misrigged
    looked = np.array([i.rigging_checked not in (None, RiggingCheck.NO) for i in cases.inspections])
    by_rigging *= np.where(looked, PRIORS.overlooked, 1.0)
    all_joints = by_joints + loaded_outside
    total = np.maximum(all_joints + by_elsewhere + by_rigging, 1e-300)
    before = np.array(
        [1.0, 1.0 / PRIORS.joints_for_one_misrigged, 1.0 / PRIORS.joints_for_one_elsewhere]
    )
    before /= before.sum()
    parts = [
        np.where(seen, part / total, prior)
        for part, prior in zip((all_joints, by_rigging, by_elsewhere), before, strict=True)
    ]
    return Causes(
        cases,
        joints=parts[0],
        rigging=parts[1],
        elsewhere=parts[2],
        worn=worn,
        levels=levels,
        exceeds=exceeds,
        waves=waves,
        loaded=np.where(seen, loaded_outside / np.maximum(all_joints, 1e-300), PRIORS.loaded),
        mean_in=mean_in,
        u_in=u,
    )


def _products(waves: Array) -> tuple[list[Array], list[Array]]:
    """Products of the characteristic functions before each joint, and from each joint on."""
    count = waves.shape[1]
    ahead, behind = [np.ones_like(waves[:, 0])], [np.ones_like(waves[:, 0])]
    for j in range(count):
        ahead.append(ahead[-1] * waves[:, j])
        behind.append(behind[-1] * waves[:, count - 1 - j])
    return ahead, behind[::-1]
