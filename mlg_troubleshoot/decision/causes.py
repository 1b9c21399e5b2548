"""What made a gear fail, as one probability model: joints read and unread, where their pins rest,
the linkage, the gauges, the rigging, and everything else.

The plunger stands where the sum of all joints puts it, each clearance times its amplification times
the cosine of its direction, plus a rigging offset where there is one. Densities of such sums are
products of characteristic functions: of a clearance c in uniformly random directions J₀(t·A·c), of
a joint that nobody read the same averaged over its wear. With a small chance the loads hold all
pins in their worst directions: a reading near the bound then says so.

Wear before the plunger is read is that of `wear_levels`. No fleet of this gear is public: all of
this is assumed, and stands in the tables below.
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
from mlg_troubleshoot.decision.second_order import responses
from mlg_troubleshoot.decision.verdict_rule import tabled_normal_cdf
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

# Of the gears that failed: how many did so through the joints for each that was mis-rigged, and for
# each that failed through something that leaves the plunger within its margin.
_JOINTS_FOR_ONE_MISRIGGED, _JOINTS_FOR_ONE_ELSEWHERE = 3.0, 3.0
# How far a wrong rigging moves the plunger: standard deviation in margins. [1]
_OFFSET = 1.5
# Chance that a rigging that was looked at is wrong nevertheless. [1]
_OVERLOOKED = 0.03
# Chance that loads hold all pins near their worst directions, and how near: mean and standard
# deviation of the cosine of 20° of scatter. [1]
_LOADED, _COSINE, _COSINE_U = 0.02, 0.94, 0.08
# Standard deviation of what the linkage of this gear adds to a sum of random directions. [in]
_LINKAGE_U_IN = 0.0015

# Half the range of displacements that a sum may have, the frequencies and the places of its
# density. [in, 1/in, in]
_HALF_IN, _TERMS, _PLACES = 0.18, 104, 145
_T = np.pi * np.arange(1, _TERMS + 1) / _HALF_IN
_AT = np.linspace(-_HALF_IN, _HALF_IN, _PLACES)
_STEP_IN = _AT[1] - _AT[0]
_COSINES = np.cos(_T[:, None] * _AT)


@lru_cache(maxsize=1)
def _bessel_table() -> Array:
    turns = (np.arange(512) + 0.5) * np.pi / 512
    return np.asarray(np.mean(np.cos(np.arange(0.0, 260.0, 0.05)[:, None] * np.sin(turns)), axis=1))


def _bessel(z: Array) -> Array:
    """J₀ from a table. [1]"""
    table = _bessel_table()
    return np.asarray(np.interp(z, np.arange(len(table)) * 0.05, table))


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
    waves = _bessel(_T[None, None, :] * reach[:, None, None] * SHARES[None, :, None])
    unread = np.einsum("ls,jsk->ljk", DENSITIES, waves)
    worn = np.einsum("ls,jsk->ljk", BEYOND, waves)
    diagonal = np.diag(response.curvature)
    bend = 0.25 * (diagonal[0::2] + diagonal[1::2])
    everything = np.prod(unread, axis=1).mean(axis=0) * _blur(_LINKAGE_U_IN)
    exceeds = float(1.0 - _inside(everything[None], np.array([gear.margin.value]))[0])
    return _Tables(response.amplification, unread, worn, bend, exceeds)


def _blur(u_in: Array | float) -> Array:
    return np.asarray(np.exp(-0.5 * (np.asarray(u_in)[..., None] * _T) ** 2))


def _inside(waves: Array, bound_in: Array) -> Array:
    """Chance that a sum is within ± a bound, from its characteristic function. [1]"""
    inside = np.sum(waves * np.sin(_T * bound_in[:, None]) / _T, axis=-1)
    return np.asarray(np.clip((bound_in + 2.0 * inside) / _HALF_IN, 0.0, 1.0))


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
        return _tables(self.cases.gear).exceeds / _JOINTS_FOR_ONE_ELSEWHERE

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
        fresh = _bessel(_T * (tables.amplification * gear.new_parts_in)[:, None])
        left = np.prod(np.where(members[:, :, None], 1.0, waves), axis=1) * _blur(_LINKAGE_U_IN)
        new = np.prod(np.where(members[:, :, None], fresh, 1.0), axis=1)
        if not np.isfinite(x):
            return np.asarray(1.0 - _inside(left * new, np.full(len(left), margin)))
        gone = np.prod(np.where(members[:, :, None], waves, 1.0), axis=1)
        gone = gone * _blur(self.u_in[row])
        # The density of what is left, given that all together read x.
        of_left = np.maximum(0.5 + left @ _COSINES, 0.0)
        of_gone = np.maximum(0.5 + gone @ np.cos(_T[:, None] * (x - _AT)), 0.0)
        given = of_left * of_gone
        given /= np.maximum(given.sum(axis=1, keepdims=True), 1e-300)
        # Restored parts move it a little.
        spread = np.sqrt(members @ (0.5 * (tables.amplification * gear.new_parts_in) ** 2))
        spread = np.hypot(spread, 0.3 * _STEP_IN)[:, None]
        beyond = tabled_normal_cdf((np.abs(_AT) - margin) / spread)
        uniform = np.sum(given * beyond, axis=1)
        loaded = float(self.loaded[row])
        return np.asarray((1.0 - loaded) * uniform + loaded * self._loaded(row, members))

    def _loaded(self, row: int, members: Mask) -> Array:
        """The same with all pins near their worst directions: normal distributions. [1]"""
        cases, tables = self.cases, _tables(self.cases.gear)
        a = tables.amplification
        centre, spread = _COSINE * a * self.mean_in[row], _COSINE_U * a * self.mean_in[row]
        margin, x = float(cases.margin_in[row]), abs(float(cases.mean_in[row]))
        kept = ~members
        left, of_left = kept @ centre, kept @ spread**2 + _LINKAGE_U_IN**2
        total, of_total = centre.sum(), np.sum(spread**2) + self.u_in[row] ** 2 + _LINKAGE_U_IN**2
        given = left + of_left / of_total * (x - total) + members @ (a * cases.gear.new_parts_in)
        u = np.sqrt(np.maximum(of_left * (1.0 - of_left / of_total), _LINKAGE_U_IN**2))
        return tabled_normal_cdf((given - margin) / u)


def believed(cases: Cases) -> Causes:
    """Weigh what may be the matter with n gears, by everything that is known of each."""
    gear = cases.gear
    tables, read, limits = _tables(gear), cases.measured, gear.limits_in
    levels = level_chances(cases)
    known = _bessel(_T * (tables.amplification * cases.filled(0.0))[:, :, None])
    known = known * _blur(np.sqrt(0.5) * tables.amplification * cases.gauge_u_in)
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
    exceeds = 1.0 - _inside(np.prod(before, axis=1) * _blur(_LINKAGE_U_IN), cases.margin_in)
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
    at = _blur(np.hypot(u, _LINKAGE_U_IN)) * np.cos(_T * x[:, None])
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
    together = np.prod(waves, axis=1) * _blur(_LINKAGE_U_IN)
    shift = np.sum(tables.bend * mean_in**2, axis=1)
    density = np.maximum(0.5 + together @ _COSINES, 0.0) * _STEP_IN / _HALF_IN
    fits = np.exp(-0.5 * ((x[:, None] - shift[:, None] - _AT) / u[:, None]) ** 2) / u[:, None]
    stands = np.abs(_AT + shift[:, None])
    outside = tabled_normal_cdf((stands - margin[:, None]) / (0.5 * _STEP_IN))
    by_joints = np.sum(density * fits * outside, axis=1)
    # Pins in their worst directions, either sense.
    centre = _COSINE * mean_in @ tables.amplification
    variance = np.sum((_COSINE_U * tables.amplification * mean_in) ** 2, axis=1)
    variance += (0.1 * centre) ** 2 + _LINKAGE_U_IN**2
    scatter, off = np.sqrt(variance + u**2), np.abs(x) - centre
    loaded = _LOADED * np.exp(-0.5 * (off / scatter) ** 2) / (2.0 * scatter)
    # Where the plunger then stands, by its reading and by the clearances.
    stood = centre + variance / scatter**2 * off
    loaded_outside = loaded * tabled_normal_cdf(
        (stood - margin) * scatter / (np.sqrt(variance) * u)
    )
    by_elsewhere = np.sum(density * fits * (1.0 - outside), axis=1) + loaded - loaded_outside
    by_elsewhere *= tables.exceeds / _JOINTS_FOR_ONE_ELSEWHERE
    wide = _OFFSET * margin
    offset = np.exp(-0.5 * (_AT / wide[:, None]) ** 2) / wide[:, None] * _STEP_IN / 2.5066
    share = 2.0 * (1.0 - tabled_normal_cdf(np.full(1, 1.0 / _OFFSET)))[0]
    by_rigging = np.sum(offset * fits * outside, axis=1)
    by_rigging *= tables.exceeds / (_JOINTS_FOR_ONE_MISRIGGED * share)
    looked = np.array([i.rigging_checked not in (None, RiggingCheck.NO) for i in cases.inspections])
    by_rigging *= np.where(looked, _OVERLOOKED, 1.0)
    all_joints = by_joints + loaded_outside
    total = np.maximum(all_joints + by_elsewhere + by_rigging, 1e-300)
    before = np.array([1.0, 1.0 / _JOINTS_FOR_ONE_MISRIGGED, 1.0 / _JOINTS_FOR_ONE_ELSEWHERE])
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
        loaded=np.where(seen, loaded_outside / np.maximum(all_joints, 1e-300), _LOADED),
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
