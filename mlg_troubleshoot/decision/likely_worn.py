"""Which joints explain a measured plunger displacement, by the same densities as the plan.

Wear before the plunger is read, and the chances that rigging moved it or that loads hold the pins,
are those of `causes`. Measured joints have their reading with its uncertainty; readings over the
limit are as doubtful as for the plan. The density of a sum of clearances is the product of their
characteristic functions; that of one clearance, given the sum, follows from the product of all
others.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mlg_troubleshoot.arrays import Array, Mask
from mlg_troubleshoot.decision.assessment import ClearanceInterval, GroupChance, Posterior
from mlg_troubleshoot.decision.case import Cases
from mlg_troubleshoot.decision.causes import Causes, believed
from mlg_troubleshoot.decision.inspection import RiggingCheck
from mlg_troubleshoot.decision.priors import PRIORS
from mlg_troubleshoot.decision.second_order import responses
from mlg_troubleshoot.decision.sentences import percent
from mlg_troubleshoot.decision.verdict_rule import CONFORMANCE
from mlg_troubleshoot.decision.waves import FREQUENCIES, HELD, RANDOM, blur
from mlg_troubleshoot.decision.wear_levels import DENSITIES, SHARES, Doubted, level_chances


def explain(one: Cases, causes: Causes | None = None) -> Posterior:
    """Find which joints explain the plunger's reading of one gear."""
    gear = one.gear
    reading = abs(float(one.plunger_in[0]))
    found = causes or believed(one)
    rigging = float(found.rigging[0])
    loaded = float(found.joints[0] * found.loaded[0])
    clearance = _clearances(one)
    turns = FREQUENCIES * (responses(gear)[0].amplification[:, None] * clearance.at_in)[..., None]
    random = RANDOM.waves(turns)
    aligned = HELD.waves(turns)
    u = np.hypot(found.u_in[0], PRIORS.linkage_u_in)
    # As wide as what a wrong rigging adds, which is about even.
    wide = np.hypot(u, PRIORS.offset * one.margin_in[0] / np.sqrt(3.0))
    given = [
        (chance, _Given(clearance, waves, reading, scatter))
        for chance, waves, scatter in (
            (1.0 - rigging - loaded, random, u),
            (rigging, random, wide),
            (loaded, aligned, u),
        )
    ]
    density = sum(chance * each.density for chance, each in given)

    def chance_of_none(joints: Sequence[int]) -> float:
        places = [gear.joint_numbers.index(number) for number in joints]
        sound = sum(chance * each.none_worn(places) for chance, each in given)
        # Readings are followed to four standard uncertainties: nothing is surer than that.
        return float(np.clip(sound, 1e-4, 1.0 - 1e-4))

    chances = [GroupChance(group, 1.0 - chance_of_none(group)) for group in gear.link_groups]
    chances.sort(key=lambda chance: -chance.probability)
    intervals = tuple(
        ClearanceInterval(number, *_quantiles(at, share), 1.0 - chance_of_none([number]))
        for number, at, share in zip(gear.joint_numbers, clearance.at_in, density, strict=True)
    )
    called = tuple(chance.joints for chance in chances if chance.probability > 0.5)
    none = chance_of_none(gear.joint_numbers)
    looked = one.inspections[0].rigging_checked not in (None, RiggingCheck.NO)
    pushed = bool(one.beyond_margin[0])
    said = _text(chances, called, none, rigging, looked=looked, pushed=pushed)
    return Posterior(tuple(chances), none, rigging, intervals, called, said)


@dataclass(frozen=True, slots=True, eq=False)
class _Clearances:
    """What the joints of one gear may be worn to before its plunger is read.

    Attributes
    ----------
    at_in : ndarray, shape (joints, places)
        Possible clearances. [in]
    chances : ndarray, shape (levels, joints, places)
        Chance of each at each level of wear. [1]
    sound : ndarray of bool, shape (joints, places)
        Which are within their limit.
    levels : ndarray, shape (levels,)
        Chances of the levels. [1]
    """

    at_in: Array
    chances: Array
    sound: Mask
    levels: Array


def _clearances(one: Cases) -> _Clearances:
    read = one.measured[0, :, None]
    limits = one.gear.limits_in[:, None]
    # Clearances that a reading allows: normal, cut off at 0.
    scores = np.linspace(-4, 4, len(SHARES))
    near = one.filled(0.0)[0, :, None] + one.gauge_u_in[0, :, None] * scores
    allowed = np.exp(-0.5 * scores**2) * (near >= 0)
    allowed /= allowed.sum(axis=1, keepdims=True)
    at = np.where(read, np.maximum(near, 0.0), SHARES * limits)
    chances = np.where(read, allowed, DENSITIES[:, None, :])
    levels = level_chances(one)
    doubted = Doubted.of(one, levels)
    for joint, share in zip(doubted.joints, doubted.chances, strict=True):
        if not one.own_gauge[0, joint]:
            at[joint] = SHARES * limits[joint]
            chances[:, joint] = share / share.sum()
    return _Clearances(at, chances, at <= limits, levels[0])


class _Given:
    """The clearances given the plunger's reading, where pins rest in one way.

    waves, shape (joints, places, terms): characteristic function of what each place of each
    clearance does to the plunger.

    Attributes
    ----------
    density : ndarray, shape (joints, places)
        Chance of each place of each clearance. [1]
    """

    def __init__(self, before: _Clearances, waves: Array, reading_in: float, u_in: float) -> None:
        self.seen = blur(u_in) * np.exp(-1j * FREQUENCIES * reading_in)
        self.whole = np.einsum("kjs,jst->kjt", before.chances, waves)
        sound = np.where(before.sound, before.chances, 0.0)
        self.sound = np.einsum("kjs,jst->kjt", sound, waves)
        self.sound_mass = sound.sum(axis=2)
        fits = np.maximum(self._fits(self.whole), 1e-12)
        self.levels = before.levels / (before.levels @ fits)
        joints = range(len(waves))
        rest = np.stack([np.delete(self.whole, j, axis=1).prod(axis=1) for j in joints], axis=1)
        of_each = 0.5 + np.einsum("kjt,jst->kjs", rest * self.seen, waves).real
        density = np.einsum("k,kjs->js", self.levels, before.chances * np.maximum(of_each, 1e-12))
        self.density = density / density.sum(axis=1, keepdims=True)

    def _fits(self, waves: Array, mass: Array | float = 1.0) -> Array:
        """How well each level of wear fits the reading, some clearances left out. [1]"""
        return np.asarray(0.5 * mass + (waves.prod(axis=1) @ self.seen).real)

    def none_worn(self, places: Sequence[int]) -> float:
        """Chance that none of some joints is beyond its limit. [1]"""
        waves = self.whole.copy()
        waves[:, places] = self.sound[:, places]
        return float(self.levels @ self._fits(waves, self.sound_mass[:, places].prod(axis=1)))


def _quantiles(at: Array, density: Array) -> tuple[float, float, float]:
    """Lower end, median and upper end of the central 90 % interval."""
    edges = np.r_[at[0], 0.5 * (at[1:] + at[:-1]), at[-1]]
    steps = np.r_[0.0, np.cumsum(density)]
    low, median, high = np.interp((1.0 - CONFORMANCE, 0.5, CONFORMANCE), steps, edges).tolist()
    return low, median, high


def _text(
    chances: Sequence[GroupChance],
    called: Sequence[tuple[int, ...]],
    none: float,
    not_clearance: float,
    *,
    looked: bool,
    pushed: bool,
) -> str:
    likely = [chance for chance in chances[:2] if chance.probability >= 1.0 - CONFORMANCE]
    ranked = ", then ".join(
        f"{' or '.join(f'#{n}' for n in chance.joints)} ({percent(chance.probability)})"
        for chance in likely
    )
    # Another chance than those of the joints: both can be so at once.
    also = f" Chance that rigging or lock roller moved the plunger: {percent(not_clearance)}."
    if not_clearance > 0.8 and looked:
        return (
            "The joints are unlikely to explain the plunger position"
            f" ({percent(1.0 - not_clearance)}), and rigging and lock roller were checked."
        )
    if not_clearance > 0.8:
        return (
            "Rigging or lock roller, not joint clearance, likely moved the plunger"
            f" ({percent(not_clearance)})."
        )
    if called:
        shown = "The measured displacement points" if pushed else "The readings point"
        return f"{shown} to wear: most likely worn {ranked}.{also}"
    if not likely:
        return f"Probably no joint is beyond its limit ({percent(none)}).{also}"
    shown = "The measured displacement does" if pushed else "The readings do"
    return (
        f"{shown} not show which joint is worn: no joint beyond its limit {percent(none)}; most"
        f" likely worn {ranked}.{also}"
    )
