"""What is believed of a gear that failed: exact chances of all that nobody knows of it, and drawn
states.

The model is that of docs/reference/models.md; (1) to (11) are its equations. What each joint moves
the plunger by is a distribution over cells of 0.8 thou; sums of joints are products of discrete
Fourier transforms, for each context: a level of wear, with free or with held pins. States are drawn
from the posterior backwards, joint by joint, as in a hidden Markov chain.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from mlg_troubleshoot.arrays import Array, Mask, Places, frozen
from mlg_troubleshoot.decision.case import Cases
from mlg_troubleshoot.decision.fleet import Fleet
from mlg_troubleshoot.decision.inspection import RiggingCheck
from mlg_troubleshoot.decision.priors import PRIORS
from mlg_troubleshoot.decision.second_order import responses
from mlg_troubleshoot.decision.verdict_rule import tabled_normal_cdf
from mlg_troubleshoot.gear.directions import random_directions
from mlg_troubleshoot.gear.gear import Gear

# Cells of the plunger's displacement, with mid-position in the middle of one; the largest
# displacement of all joints worn out together lies inside. [1, in]
_CELLS = 400
_CELL_IN = 0.0008
_AT = (np.arange(_CELLS) - _CELLS // 2) * _CELL_IN
_BELOW, _ABOVE = _AT - 0.5 * _CELL_IN, _AT + 0.5 * _CELL_IN
_FREQUENCIES = 2.0 * np.pi * np.arange(_CELLS // 2 + 1) / (_CELLS * _CELL_IN)

# Shares of its limit that a joint may be worn to: centres of cells. [1]
SHARES = np.asarray((np.arange(50) + 0.5) * 0.04, np.float64)
_WORN = np.asarray(SHARES > 1.0, float)

# Errors of a reading by which it is averaged, with their weights (Gauss–Hermite). [1]
_ERRORS, _GAUSS = np.polynomial.hermite_e.hermegauss(5)
_WEIGHTS = np.array([_GAUSS / _GAUSS.sum()], np.float64)

# States drawn of failures of the joints, and of each other kind. [1]
STATES = 192
_OTHERS = 64
# Contexts less likely than this move no chance that is stated. [1]
_NEGLIGIBLE = 1e-4


def _wear() -> Array:
    levels = np.geomspace(*PRIORS.levels, 6)[:, None]
    usual = np.exp(-SHARES / levels) * (1.0 - _WORN)
    usual /= usual.sum(axis=1, keepdims=True)
    chance = np.geomspace(*PRIORS.worn_out, 6)[:, None]
    alike = (1.0 - chance) * usual + chance * _WORN / _WORN.sum()
    return np.vstack([alike, alike.mean(axis=0)])


# f_k of (2): chance of each cell, by level; in the last row each joint has its own level. [1]
WEAR = _wear()
# p of (1) before a fleet is known. [1]
LEVELS = np.append(np.full(6, PRIORS.alike / 6), 1.0 - PRIORS.alike)


def level_chances(cases: Cases) -> Array:
    """Chances of the levels of wear of each gear given its readings, by (1) and (2). [1]"""
    share = np.clip(cases.filled(0.0) / cases.gear.limits_in, 0.0, 2.0)
    each = np.array([np.interp(share, SHARES, level) for level in np.log(WEAR)])
    total = np.sum(np.where(cases.measured, each, 0.0), axis=2).T
    chances = np.exp(total - total.max(axis=1, keepdims=True)) * (cases.fleet.levels or LEVELS)
    return np.asarray(chances / chances.sum(axis=1, keepdims=True))


def _moved(reach_in: Array, shift_in: Array, *, held: bool) -> Array:
    """Chance of each cell for a joint that reaches so far in its best direction (4), shape
    (..., cells). [1]
    """
    reach = np.maximum(np.asarray(reach_in, float), 1e-9)[..., None]
    if held:
        mean, spread = PRIORS.cosine
        below = tabled_normal_cdf((_BELOW - mean * reach) / (spread * reach))
        return np.asarray(tabled_normal_cdf((_ABOVE - mean * reach) / (spread * reach)) - below)
    shift = np.asarray(shift_in, float)[..., None]
    turn = np.arccos(np.clip((np.append(_BELOW, _ABOVE[-1]) - shift) / reach, -1.0, 1.0))
    return np.asarray((turn[..., :-1] - turn[..., 1:]) / np.pi)


def _transform(moved: Array) -> Array:
    return np.asarray(np.fft.rfft(np.fft.ifftshift(moved, axes=-1)))


def _density(transform: Array) -> Array:
    """Chance of each cell from a transform. [1]"""
    found = np.fft.fftshift(np.fft.irfft(transform, _CELLS), axes=-1)
    return np.asarray(np.maximum(found, 0.0))


@lru_cache(maxsize=4)
def _reach(gear: Gear) -> tuple[Array, Array]:
    """A_j L_j and b_j L_j² of (5) for each joint. [in]"""
    response = responses(gear)[0]
    curvature = np.diag(response.curvature)
    bend = 0.25 * (curvature[0::2] + curvature[1::2])
    return response.amplification * gear.limits_in, bend * gear.limits_in**2


@dataclass(frozen=True, slots=True, eq=False)
class _Joints:
    """What joints move the plunger by, with free and with held pins.

    cells, worn : ndarray, shape (2, levels, joints, cells)
        Chance of each cell, and the part of it that is worn; one level stands for all where the
        level does not matter. [1]
    transforms : ndarray, shape (2, levels, joints, frequencies)
        Transform of the cells.
    excess_in2 : ndarray, shape (2, levels, joints)
        By how much the cells scatter more than the joints. [in²]
    """

    cells: Array
    worn: Array
    transforms: Array
    excess_in2: Array

    @classmethod
    def of(cls, table: Array, chance: Array, share: Array, reach_in: Array, over: Array) -> _Joints:
        """Joints from their cells by wear (2, joints, wear, cells), the chance of each wear
        (levels, joints, wear), and the chance that each is worn.
        """
        cells = np.einsum("kjs,pjsc->pkjc", chance, table)
        worn = np.einsum("kjs,pjsc->pkjc", chance * over, table)
        of_pins = np.array([0.5, PRIORS.cosine[0] ** 2 + PRIORS.cosine[1] ** 2])[:, None, None]
        share2 = np.sum(chance * share**2, axis=2)
        excess = cells @ _AT**2 - of_pins * share2 * reach_in**2
        return cls(cells, worn, _transform(cells), excess)

    def take(self, joints: Places) -> _Joints:
        parts = (self.cells, self.worn, self.transforms, self.excess_in2)
        return _Joints(*(part[:, :, joints] for part in parts))


@lru_cache(maxsize=4)
def _prior(gear: Gear) -> tuple[Array, _Joints]:
    """Joints that nobody read: cells by wear (2, joints, wear, cells), and the joints."""
    reach, bend = _reach(gear)
    at, shift = reach[:, None] * SHARES, bend[:, None] * SHARES**2
    table = np.array([_moved(at, shift, held=held) for held in (False, True)])
    chance = np.repeat(WEAR[:, None], len(reach), axis=1)
    return table, _Joints.of(table, chance, SHARES, reach, _WORN)


@lru_cache(maxsize=1024)
def _unread(gear: Gear, unread: tuple[bool, ...]) -> tuple[Array, Array]:
    """Transform and excess of all joints together that nobody read."""
    joints = _prior(gear)[1]
    some = np.array(unread)
    return joints.transforms[:, :, some].prod(axis=2), joints.excess_in2[:, :, some].sum(axis=2)


def _read_exactly(cases: Cases) -> tuple[Mask, _Joints]:
    """Joints that read what they are (3), those of all gears in one row."""
    exact = cases.measured & (~cases.over_limit | cases.own_gauge)
    at = np.nonzero(exact)
    limits = cases.gear.limits_in[at[1]]
    share = np.abs(
        (cases.clearance_in[at] / limits)[:, None]
        + (cases.gauge_u_in[at] / limits)[:, None] * _ERRORS
    )
    over = tabled_normal_cdf(
        (cases.clearance_in[at] - limits) / np.maximum(cases.gauge_u_in[at], 1e-9)
    )
    reach, bend = (each[at[1]] for each in _reach(cases.gear))
    parts = []
    for some in np.array_split(np.arange(len(share)), max(len(share) // 512, 1)):
        of = share[some]
        places = reach[some, None] * of, bend[some, None] * of**2
        table = np.array([_moved(*places, held=held) for held in (False, True)])
        chance = np.broadcast_to(_WEIGHTS, (1, *of.shape))
        parts.append(_Joints.of(table, chance, of, reach[some], over[some, None]))
    joined = (
        np.concatenate([getattr(part, name) for part in parts], axis=2)
        for name in ("cells", "worn", "transforms", "excess_in2")
    )
    return exact, _Joints(*joined)


def _share_within(margin_in: float) -> Array:
    """Share of each cell within the margin. [1]"""
    return np.asarray(np.clip((margin_in - np.abs(_AT)) / _CELL_IN + 0.5, 0.0, 1.0))


@lru_cache(maxsize=4)
def _even(dimensions: int, n: int) -> Array:
    """Even numbers from 0 to 1, the same for every gear, shape (dimensions, n). [1]"""
    return frozen(random_directions(dimensions, n).T / (2.0 * np.pi))


def _noise(excess_in2: Array) -> Array:
    """Transform of what the linkage adds (5), less the variance that cells add already."""
    variance = np.maximum(PRIORS.linkage_u_in**2 - excess_in2, (0.5 * _CELL_IN) ** 2)
    return np.exp(-0.5 * variance[..., None] * _FREQUENCIES**2)


class Belief:
    """What is believed of one gear: chances by the equations, states drawn from them.

    Attributes
    ----------
    chances : tuple of float
        Chances that the joints, the rigging and something else are the cause (9). [1]
    worn : ndarray, shape (joints,)
        Chance of each joint to be beyond its limit (10). [1]
    held : float
        How much likelier the plunger's reading is with held pins than with free ones. [1]
    """

    chances: tuple[float, float, float]

    def __init__(self, one: Cases, levels: Array, exact: Mask, read: _Joints) -> None:
        gear = one.gear
        self.gear = gear
        self.margin_in = float(one.margin_in[0])
        self._one = one
        self._exact, self._read = exact, read
        self._doubted = {
            j: self._in_doubt(j) for j in np.flatnonzero(one.measured[0] & ~exact).tolist()
        }
        unread = tuple((~one.measured[0]).tolist())
        whole, excess = _unread(gear, unread)
        for some in (read, *(joints for _chance, joints in self._doubted.values())):
            whole = whole * some.transforms.prod(axis=2)
            excess = excess + some.excess_in2.sum(axis=2)
        self._noise = _noise(excess)
        self._stands = _density(self._noise * whole)
        loaded = one.fleet.loaded
        before = np.outer([1.0 - loaded, loaded], levels)
        usual, overlooked = usual_of(gear, one.fleet)
        often = usual[:, None]
        self._factors = (
            before / often,
            before / (1.0 - often) / PRIORS.joints_for_one_elsewhere,
        )
        self._seen_at = [_both_senses(each) for each in self._likelihoods()]
        self._weights = np.array(
            [
                factor * np.einsum("pkc,pc->pk", self._stands, seen)
                for factor, seen in zip(self._factors, self._seen_at, strict=True)
            ]
        )
        self._rigging(levels, overlooked)
        self.held = self._likelier_held(before)

    def _in_doubt(self, j: int) -> tuple[Array, _Joints]:
        """Chance of each wear of a joint that reads over its limit, by level, and the joint (3)."""
        one = self._one
        limits = one.gear.limits_in
        read, u = one.clearance_in[0, j] / limits[j], one.gauge_u_in[0, j] / limits[j]
        slip = -np.expm1(-PRIORS.wrong_readings / len(limits))
        chance = np.zeros_like(WEAR)
        for factor, often in ((1.0, 1.0 - slip), (2.0, slip)):
            spread = np.hypot(u, PRIORS.gauge_scale * factor * SHARES)
            off = (read - factor * SHARES) / spread
            chance += often * WEAR * np.exp(-0.5 * off**2) / spread
        chance = chance / chance.sum(axis=1, keepdims=True)
        table = _prior(self.gear)[0][:, [j]]
        reach = _reach(self.gear)[0][[j]]
        return chance, _Joints.of(table, chance[:, None], SHARES, reach, _WORN)

    @cached_property
    def _contexts(self) -> tuple[Places, Places]:
        """Pins and levels that count."""
        total = self._weights.sum(axis=0)
        pins, levels = np.nonzero(total > _NEGLIGIBLE * float(total.sum()))
        return (pins, levels) if len(pins) else (np.array([0]), np.array([0]))

    @cached_property
    def _joints(self) -> tuple[Array, Array, Array]:
        """Cells, worn cells and transforms of all joints in the contexts that count, (contexts,
        joints, …).
        """
        pins, levels = self._contexts
        prior = _prior(self.gear)[1]
        found = []
        for name in ("cells", "worn", "transforms"):
            whole = getattr(prior, name)[pins, levels]
            whole[:, self._exact] = getattr(self._read, name)[pins, 0]
            for j, (_chance, joint) in self._doubted.items():
                whole[:, j] = getattr(joint, name)[pins, levels, 0]
            found.append(whole)
        return found[0], found[1], found[2]

    def _rigging(self, levels: Array, overlooked: float) -> None:
        """Weigh the causes (8), (9); work that left the rigging wrong leaves few worn joints."""
        worn = np.repeat((WEAR @ _WORN)[:, None], len(self.gear.joints), axis=1)
        worn[:, self._exact] = self._read.worn[0].sum(axis=2)
        for j, (chance, _joint) in self._doubted.items():
            worn[:, j] = chance @ _WORN
        sound = 1.0 - (1.0 - PRIORS.overlooked) * worn
        weight = levels * np.prod(sound, axis=1) / overlooked * self._of_rigging()
        weight = weight / PRIORS.joints_for_one_misrigged
        joints, elsewhere = (float(each.sum()) for each in self._weights)
        rigging = float(weight.sum())
        total = max(joints + elsewhere + rigging, 1e-300)
        self.chances = joints / total, rigging / total, elsewhere / total
        self._rigging_levels = weight / max(rigging, 1e-300)
        self._left_worn = PRIORS.overlooked * worn / sound

    def _likelier_held(self, before: Array) -> float:
        fits = self._weights.sum(axis=0)
        if not self._one.failed[0]:
            seen = self._seen_at[0] + self._seen_at[1]
            fits = before * np.einsum("pkc,pc->pk", self._stands, seen)
        free, held = fits.sum(axis=1).tolist()
        loaded = self._one.fleet.loaded
        return float(held / loaded / max(free / (1.0 - loaded), 1e-300))

    def _likelihoods(self) -> tuple[Array, Array]:
        """Likelihood of the reading in each cell beyond and within the margin. [1]"""
        margin = self.margin_in
        pieces = []
        for low, high in ((margin, np.inf), (-np.inf, -margin), (-margin, margin)):
            pieces.append(self._seen(np.clip(_BELOW, low, high), np.clip(_ABOVE, low, high)))
        return pieces[0] + pieces[1], pieces[2]

    def _seen(self, low: Array, high: Array) -> Array:
        y = float(self._one.plunger_in[0])
        if not np.isfinite(y):
            return np.asarray((high - low) / _CELL_IN)
        u = float(np.hypot(self._one.plunger_u_in[0], 1e-4))
        share = tabled_normal_cdf((high - y) / u) - tabled_normal_cdf((low - y) / u)
        return np.asarray(share * np.sqrt(2.0 * np.pi) * u / _CELL_IN)

    def _of_rigging(self) -> float:
        """Likelihood of the plunger's reading where the rigging is wrong (7), and that somebody
        looked at it. [1]
        """
        one = self._one
        y, margin = float(one.plunger_in[0]), self.margin_in
        looked = one.inspections[0].rigging_checked not in (None, RiggingCheck.NO)
        likely = PRIORS.overlooked if looked else 1.0
        if not np.isfinite(y):
            return likely
        u = float(np.hypot(one.plunger_u_in[0], 1e-4))
        even = 1.0 / (1.0 + (y / (PRIORS.offset * margin)) ** 8)
        out = float(tabled_normal_cdf(np.array((abs(y) - margin) / u)))
        width = 2.0 * (PRIORS.offset - 1.0) * margin
        return float(likely * even * out * np.sqrt(2.0 * np.pi) * u / width)

    @cached_property
    def _others(self) -> Array:
        """Transform of all joints but each one, and of the linkage, (contexts, joints, …)."""
        transforms = self._joints[2]
        joints = range(transforms.shape[1])
        each = [np.delete(transforms, j, axis=1).prod(axis=1) for j in joints]
        return np.stack(each, axis=1) * self._noise[self._contexts][:, None]

    @cached_property
    def worn(self) -> Array:
        """All joints but one as they are, that one worn (10)."""
        worn = self._joints[1]
        pins, levels = self._contexts
        others = self._others * _transform(worn)
        share = np.zeros(worn.shape[1])
        for factor, likelihood in zip(self._factors, self._seen_at, strict=True):
            seen = np.conj(_transform(likelihood))
            seen[:, 1:-1] *= 2.0
            # Parseval.
            by_context = np.einsum("cjf,cf->cj", others, seen[pins]).real / _CELLS
            share += factor[pins, levels] @ by_context
        share /= max(float(self._weights.sum()), 1e-300)
        rigging = self.chances[1]
        found = (1.0 - rigging) * share + rigging * (self._rigging_levels @ self._left_worn)
        return np.asarray(np.clip(found, 0.0, 1.0))

    @property
    def worn_by_leverage(self) -> Array:
        """Chance of each joint to be worn, times how far it moves the plunger against the one that
        moves it most: a worn joint that hardly moves it is hardly the cause. [1]
        """
        amplification = responses(self.gear)[0].amplification
        return np.asarray(self.worn * amplification / amplification.max())

    @cached_property
    def states(self) -> States:
        """Drawn failures, the same ones whoever else is judged."""
        rng = np.random.default_rng(1)
        cause = np.repeat([0, 1], [STATES, _OTHERS])
        moved, worn, stands, held = self._backwards(cause)
        moved = moved[:STATES]
        level = _drawn(rng.random(_OTHERS), self._rigging_levels[None])
        rigging = rng.random((_OTHERS, worn.shape[1])) < self._left_worn[level]
        mean, spread = PRIORS.cosine
        loaded = mean + spread * rng.standard_normal(moved.shape)
        free = np.cos(2.0 * np.pi * rng.random(moved.shape))
        turns = np.where(held[:STATES, None], loaded, free)
        reach = responses(self.gear)[0].amplification * self.gear.new_parts_in
        counts = [STATES, _OTHERS, _OTHERS]
        return States(
            np.repeat(np.diag(np.divide(self.chances, counts)), counts, axis=1),
            np.vstack([worn[:STATES], rigging, worn[STATES:]]),
            moved,
            reach * turns,
            stands[:STATES],
            self.margin_in,
        )

    def second_repair(self, restored: Mask) -> float:
        """Chance that the plunger is beyond its margin once some joints are new (11). [1]"""
        pins, levels = self._contexts
        transforms = self._joints[2]
        gone = transforms[:, restored].prod(axis=1)
        stay = self._noise[pins, levels] * transforms[:, ~restored].prod(axis=1)
        reach = _reach(self.gear)[0] * self.gear.new_parts_in / self.gear.limits_in
        new = [_moved(reach[restored], 0.0 * reach[restored], held=held) for held in (False, True)]
        fresh = _transform(np.array(new)).prod(axis=1)[pins]
        weight = _density(np.conj(gone) * _transform(self._seen_at[0][pins])) * _density(stay)
        weight *= self._factors[0][pins, levels][:, None]
        inside = _density(np.conj(fresh) * _transform(_share_within(self.margin_in)))
        within = np.sum(weight * inside) / max(float(weight.sum()), 1e-300)
        return max(1.0 - float(within), 0.0)

    def chance_of_any(self, joints: Sequence[int]) -> float:
        """Chance that any of some joints, by their places, is worn, whatever the cause. [1]"""
        each, worn = self.worn[list(joints)], self.states.worn[:, list(joints)]
        # Drawn is only how often several are.
        several = self.states.causes.sum(axis=0) @ (worn.sum(axis=1) - worn.any(axis=1))
        return max(float(each.sum() - several), float(each.max()))

    def _backwards(self, cause: Places) -> tuple[Array, Mask, Array, Mask]:
        """Draw failures of some causes: what each joint moves and whether it is worn, given where
        the plunger was read; where it stands, and whether pins are held.
        """
        pins, levels = self._contexts
        cells, worn_cells, transforms = self._joints
        n, joints = len(cause), cells.shape[1]
        even = _even(2 * joints + 3, n)
        weights = np.array([each[pins, levels] for each in self._weights])
        of = _drawn(even[0], weights[cause])
        posterior = self._stands[pins, levels] * np.array(self._seen_at)[:, pins] + 1e-300
        place = _drawn(even[1], posterior[cause, of])
        before = np.ones_like(transforms)
        before[:, 1:] = np.cumprod(transforms[:, :-1], axis=1)
        sums = _density(self._noise[pins, levels][:, None] * before)
        stands = np.asarray(_AT[place] + _CELL_IN * (even[2] - 0.5))
        moved = np.empty((n, joints))
        worn = np.empty(moved.shape, bool)
        middle = _CELLS // 2
        for j in range(joints - 1, -1, -1):
            some = np.flatnonzero(cells[:, j].max(axis=0) > 1e-12)
            # The window of the farthest cells closes one cell before it meets itself.
            most = min(int(np.abs(some - middle).max()), middle - 1)
            round_about = np.concatenate(
                [sums[:, j, -most:], sums[:, j], sums[:, j, :most]], axis=1
            )
            left = sliding_window_view(round_about, 2 * most + 1, axis=1)[of, place]
            own = cells[of, j, middle - most : middle + most + 1][:, ::-1]
            chosen = most - _drawn(even[3 + j], own * left + 1e-300)
            cell = middle + chosen
            moved[:, j] = _AT[cell]
            whole = np.maximum(cells[of, j, cell], 1e-300)
            worn[:, j] = even[3 + joints + j] * whole < worn_cells[of, j, cell]
            place = (place - chosen) % _CELLS
        return moved, worn, stands, pins[of] == 1

    def clearances_in(self, joint: int, at: Sequence[float]) -> list[float]:
        """Quantiles of the clearance of the joint at a place, its wear weighed by the reading.
        [in]
        """
        pins, levels = self._contexts
        others = self._others[:, joint]
        weight = sum(
            factor[pins, levels, None] * seen[pins]
            for factor, seen in zip(self._factors, self._seen_at, strict=True)
        )
        reach, bend = (each[joint] for each in _reach(self.gear))
        share, chance = SHARES, WEAR
        if joint in self._doubted:
            chance = self._doubted[joint][0]
        elif self._exact[joint]:
            one = self._one
            errors = np.linspace(-4.0, 4.0, 33)
            read = one.clearance_in[0, joint] + one.gauge_u_in[0, joint] * errors
            share = np.abs(read) / self.gear.limits_in[joint]
            chance = np.repeat([np.exp(-0.5 * errors**2)], len(WEAR), axis=0)
        total = np.zeros(len(share))
        for context, (held, level) in enumerate(zip(pins.tolist(), levels.tolist(), strict=True)):
            own = _transform(_moved(reach * share, bend * share**2, held=bool(held)))
            fits = _density(others[context] * own) @ np.asarray(weight)[context]
            total += chance[level] * fits
        order = np.argsort(share)
        steps = np.cumsum(total[order]) / max(float(total.sum()), 1e-300)
        values = np.interp(at, steps, share[order]) * self.gear.limits_in[joint]
        return [float(value) for value in values]


def _both_senses(likelihood: Array) -> Array:
    """A likelihood with free pins, and with held ones, which may rest with either sign; shape
    (2, cells). [1]
    """
    mirrored = np.roll(likelihood[::-1], 1)
    return np.array([likelihood, 0.5 * (likelihood + mirrored)])


def _drawn(even: Array, weights: Array) -> Places:
    """One place of each row, by its weights."""
    steps = np.cumsum(weights, axis=1)
    at = even * steps[:, -1]
    return np.asarray(np.argmax(steps >= at[:, None], axis=1))


@dataclass(frozen=True, slots=True, eq=False)
class States:
    """Drawn failures of one gear.

    Attributes
    ----------
    causes : ndarray, shape (3, n)
        Weight of each state as a failure of the joints, of the rigging, of something else: the
        first `STATES` are of the joints. [1]
    worn : ndarray of bool, shape (n, joints)
        Joints beyond their limit.
    moved_in, fresh_in : ndarray, shape (STATES, joints)
        By how much each joint moves the plunger in a failure of the joints, and would if new. [in]
    stands_in : ndarray, shape (STATES,)
        Where the plunger stands then. [in]
    """

    causes: Array
    worn: Mask
    moved_in: Array
    fresh_in: Array
    stands_in: Array
    margin_in: float

    def stays_out(self, sets: Mask) -> Mask:
        """Whether the plunger is beyond its margin in each failure of the joints once sets of
        joints are new: their pins rest anew, the others stay, shape (STATES, sets).
        """
        left = self.stands_in[:, None] - (self.moved_in - self.fresh_in) @ sets.T.astype(float)
        return np.asarray(np.abs(left) > self.margin_in)


@lru_cache(maxsize=8)
def usual_of(gear: Gear, fleet: Fleet) -> tuple[Array, float]:
    """Of a gear of the fleet of which nothing was read: the chance of leaving the margin with free
    and with held pins, and how rarely work on it leaves its worn joints as they are. [1]
    """
    levels = np.array(fleet.levels or LEVELS)
    beyond = 1.0 - _share_within(gear.margin.value)
    whole, excess = _unread(gear, (True,) * len(gear.joints))
    out = _density(_noise(excess) * whole) @ beyond @ levels
    left = (1.0 - (1.0 - PRIORS.overlooked) * (WEAR @ _WORN)) ** len(gear.joints)
    return np.clip(out, 1e-9, 1.0 - 1e-9), float(levels @ left)


def believe(cases: Cases) -> list[Belief]:
    """Weigh what may be the matter with each gear, by everything that is known of it."""
    levels = level_chances(cases)
    exact, joints = _read_exactly(cases)
    ends = np.cumsum(exact.sum(axis=1))
    found = []
    for i, (end, n) in enumerate(zip(ends.tolist(), exact.sum(axis=1).tolist(), strict=True)):
        of = np.arange(end - n, end)
        one = cases.take(np.array([i]))
        found.append(Belief(one, levels[i], exact[i], joints.take(of)))
    return found


# Sets of random directions and wear by which the chance of unread joints is counted. [1]
_IMAGINED = 1024


@lru_cache(maxsize=4)
def _imagined(gear: Gear) -> tuple[Array, Array, Array]:
    """Shared draws of (2) and (4): what each joint moves the plunger by per clearance and per
    clearance squared, (joints, draws), (joints,), and at each level of wear if nobody read it,
    (levels, joints, draws). [1, 1/in, in]
    """
    joints = len(gear.joints)
    reach, bend = _reach(gear)
    even = _even(2 * joints, _IMAGINED)
    turned = np.cos(2.0 * np.pi * even[:joints])
    steps = np.cumsum(WEAR, axis=1)
    share = np.array(
        [np.interp(even[joints:], np.r_[0.0, each], np.linspace(0, 2, 51)) for each in steps]
    )
    moved = share * reach[:, None] * turned + share**2 * bend[:, None]
    per_clearance = reach / gear.limits_in
    return per_clearance[:, None] * turned, bend / gear.limits_in**2, moved


def chance_random(cases: Cases) -> Array:
    """Chance of leaving the margin with random directions (12): joints that were read as they are,
    the others by their usual wear, weighed by where the plunger was read. [1]
    """
    linear, bend, moved = _imagined(cases.gear)
    read = cases.filled(0.0)
    base = read @ linear + (read**2 @ bend)[:, None]
    y, u = cases.plunger_in[:, None], np.hypot(cases.plunger_u_in, PRIORS.linkage_u_in)[:, None]
    is_read = np.isfinite(y[:, 0])
    levels = level_chances(cases)
    beyond = np.empty_like(levels)
    for k, each in enumerate(moved):
        at = base + (~cases.measured).astype(float) @ each
        beyond[:, k] = np.mean(np.abs(at) > cases.margin_in[:, None], axis=1)
        off = (at[is_read] - y[is_read]) / u[is_read]
        levels[is_read, k] *= np.mean(np.exp(-0.5 * off**2), axis=1) + 1e-12
    return np.asarray(np.sum(levels * beyond, axis=1) / levels.sum(axis=1))
