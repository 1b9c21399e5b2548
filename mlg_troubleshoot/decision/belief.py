"""What is believed of a gear that failed: chances of all that nobody knows of it, and drawn states.

The model is that of docs/reference/models.md; (1) to (12) are its equations. Each joint has a
characteristic function for each wear; readings weigh the wears, a sum of joints is a product, and
the plunger's reading is met on a grid by discrete Fourier transforms, for each level of wear with
free and with held pins.

Which joints explain a measured plunger displacement, in numbers and words.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from copy import copy
from dataclasses import dataclass
from functools import cached_property, lru_cache
from statistics import NormalDist

import numpy as np
from numpy.typing import NDArray

from mlg_troubleshoot.arrays import Array, Mask, Places, frozen
from mlg_troubleshoot.decision.assessment import GroupChance, Posterior
from mlg_troubleshoot.decision.inspection import Fleet, RiggingCheck
from mlg_troubleshoot.decision.prediction import Cases, responses
from mlg_troubleshoot.decision.priors import BEYOND, PRIORS, WELL_WITHIN
from mlg_troubleshoot.decision.sentences import percent
from mlg_troubleshoot.decision.verdict_rule import CONFORMANCE, tabled_normal_cdf
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.gear.linkage import random_directions

# Cells of the plunger's displacement, mid-position first, then over-travel, then under-travel: what
# joints that are worn out together move it by stays inside. [1, in]
_CELLS = 192
_CELL_IN = 0.00125
_PLACES = np.arange(_CELLS)
_AT = np.asarray(np.fft.fftfreq(_CELLS) * _CELLS * _CELL_IN, np.float64)
_ENDS_IN = np.array([_AT - 0.5 * _CELL_IN, _AT + 0.5 * _CELL_IN], np.float64)
_FREQUENCIES = 2.0 * np.pi * np.fft.rfftfreq(_CELLS, _CELL_IN)
# Share of the likeliest cell below which a chance is none. [1]
_NEGLIGIBLE = 1e-7
# Transform of what the linkage adds (5).
_LINKAGE = np.exp(-0.5 * (PRIORS.linkage_u_in * _FREQUENCIES) ** 2)

# Shares of its limit that a joint may be worn to: ends and centres of cells. [1]
_ENDS = np.linspace(0.0, 2.0, 51)
SHARES = np.asarray(0.5 * (_ENDS[1:] + _ENDS[:-1]), np.float64)
_WORN = SHARES > 1.0
# The first cell beyond the limit.
_LIMIT = int(np.argmax(_WORN))

# Gears of which is believed at once: what they need stays in the cache of a processor. [1]
_AT_ONCE = 8
# States drawn of failures of the joints, and of each other kind. [1]
STATES = 192
_OTHERS = 64
# Points that stand for the wear of a joint, denser where it is worn, the matrix that sums by their
# weights, and what stands for where its pin rests. [1]
_LEFT = (np.arange(32)[::-1] + 0.5) / 32
_QUANTILES = 1.0 - _LEFT**2
_SUMS = (np.tri(32) * _LEFT).T.astype(np.float32)
_TURNS = np.mod(np.arange(1, 33) * 0.5 * np.sqrt(5.0), 1.0)
_SCORES = np.array([NormalDist().inv_cdf(turn) for turn in _TURNS.tolist()])


def _wear() -> Array:
    levels = np.geomspace(*PRIORS.levels, 6)[:, None]
    usual = np.exp(-SHARES / levels) * ~_WORN
    usual /= usual.sum(axis=1, keepdims=True)
    chance = np.geomspace(*PRIORS.worn_out, 6)[:, None]
    alike = (1.0 - chance) * usual + chance * _WORN / _WORN.sum()
    return np.vstack([alike, alike.mean(axis=0)])


# f_k of (2): chance of each cell, by level; in the last row each joint has its own level. [1]
WEAR = _wear()
# The cells that stand for a joint that nobody read, (levels, points).
_USUAL_POINTS = np.array(
    [np.searchsorted(np.cumsum(each), _QUANTILES).clip(max=len(each) - 1) for each in WEAR]
)
# p of (1) before a fleet is known. [1]
LEVELS = np.append(np.full(6, PRIORS.alike / 6), 1.0 - PRIORS.alike)


def given_readings(cases: Cases, rows: Sequence[int] | slice = slice(None)) -> tuple[Array, Array]:
    """Chances of the levels of some gears given their readings (1) to (3), (n, levels), and of each
    cell of wear at each level, (n, joints, levels, wear). [1]
    """
    gear, measured = cases.gear, cases.measured[rows]
    limits = np.broadcast_to(gear.limits_in, measured.shape)[measured]
    share = np.clip(cases.clearance_in[rows][measured] / limits, 0.0, 2.0)
    u = np.maximum(cases.gauge_u_in[rows][measured] / limits, 1e-3)
    likely = np.diff(tabled_normal_cdf((_ENDS - share[:, None]) / u[:, None]))
    doubtful = (cases.over_limit & ~cases.own_gauge)[rows][measured]
    likely[doubtful] = 0.0
    share, u = share[doubtful, None], u[doubtful, None]
    slip = -np.expm1(-PRIORS.wrong_readings / len(gear.joints))
    for factor, often in ((1.0, 1.0 - slip), (2.0, slip)):
        spread = np.hypot(u, PRIORS.gauge_scale * factor * SHARES)
        above, below = ((factor * ends - share) / spread for ends in (_ENDS[1:], _ENDS[:-1]))
        likely[doubtful] += often / factor * (tabled_normal_cdf(above) - tabled_normal_cdf(below))
    wear = np.empty((*measured.shape, *WEAR.shape))
    wear[...] = WEAR
    wear[measured] *= likely[:, None]
    fits = wear.sum(axis=3, keepdims=True)
    levels = fits[..., 0].prod(axis=1) * (cases.fleet.levels or LEVELS)
    wear /= fits
    return levels / levels.sum(axis=1, keepdims=True), wear


def _characteristic(reach_in: Array, shift_in: Array) -> Array:
    """Characteristic function of what a joint moves the plunger by, with free and with held pins
    (4), that reaches so far in its best direction, shape (2, ..., frequencies).
    """
    reach = reach_in[..., None] * _FREQUENCIES
    turns = (np.arange(32) + 0.5) * np.pi / 64
    free = sum(np.cos(reach * np.cos(turn)) for turn in turns) / len(turns)
    mean, spread = PRIORS.cosine
    held = np.exp(-0.5 * (spread * reach) ** 2 - 1j * mean * reach)
    return np.array([free * np.exp(-1j * shift_in[..., None] * _FREQUENCIES), held])


@lru_cache(maxsize=4)
def _reach(gear: Gear) -> tuple[Array, Array]:
    """A_j L_j and b_j L_j² of (5) for each joint. [in]"""
    response = responses(gear)[0]
    curvature = np.diag(response.curvature)
    bend = 0.25 * (curvature[0::2] + curvature[1::2])
    return response.amplification * gear.limits_in, bend * gear.limits_in**2


@lru_cache(maxsize=4)
def _by_wear(gear: Gear) -> Array:
    """Characteristic functions of joints for each wear, real and imaginary parts in turns, shape
    (2, joints, wear, 2 frequencies).
    """
    reach, bend = _reach(gear)
    return _characteristic(reach[:, None] * SHARES, bend[:, None] * SHARES**2).view(float)


def _of_joints(gear: Gear, wear: Array) -> NDArray[np.complex128]:
    """Transforms of joints by their wear, shape (joints, n, wear), with free and with held pins,
    (2, joints, n, frequencies).
    """
    return np.asarray((wear @ _by_wear(gear)).view(complex))


def _density(transform: NDArray[np.complexfloating]) -> Array:
    """Chance of each cell from a transform. [1]"""
    found = np.fft.irfft(transform, _CELLS)
    # Less is what the frequencies that are left out would take away.
    least = _NEGLIGIBLE * found.max(axis=-1, keepdims=True)
    return np.asarray(np.where(found > least, found, 0.0))


def _share_within(margin_in: Array | float) -> Array:
    """Share of each cell within the margin. [1]"""
    return np.asarray(np.clip((margin_in - np.abs(_AT)) / _CELL_IN + 0.5, 0.0, 1.0))


def _products_before(
    factors: NDArray[np.complex128], first: NDArray[np.complexfloating] | Array
) -> NDArray[np.complex128]:
    """Product of the factors before each one along the second axis, and of one before them all."""
    before = np.empty_like(factors)
    before[:, 0] = first
    for j in range(factors.shape[1] - 1):
        np.multiply(before[:, j], factors[:, j], out=before[:, j + 1])
    return before


@lru_cache(maxsize=8)
def usual_of(gear: Gear, fleet: Fleet) -> tuple[Array, float]:
    """Of a gear of the fleet of which nothing was read: the chance of leaving the margin with free
    and with held pins, and how rarely work on it leaves its worn joints as they are. [1]
    """
    levels = np.array(fleet.levels or LEVELS)
    usual = np.broadcast_to(WEAR, (len(gear.joints), *WEAR.shape))
    whole = _of_joints(gear, usual).prod(axis=1) * _LINKAGE
    out = _density(whole) @ (1.0 - _share_within(gear.margin.value)) @ levels
    left = (1.0 - (1.0 - PRIORS.overlooked) * (WEAR @ _WORN)) ** len(gear.joints)
    return np.clip(out, 1e-9, 1.0 - 1e-9), float(levels @ left)


class Inference:
    """What is believed of some gears that failed, by everything that is known of them.

    Attributes
    ----------
    looked : list of bool
        Whether the rigging was checked.
    chances : ndarray, shape (n, 3)
        Chances that the joints, the rigging and something else are the cause (9). [1]
    held : ndarray, shape (n,)
        How much likelier the plunger's reading is with held pins than with free ones. [1]
    """

    def __init__(self, cases: Cases, rows: Sequence[int]) -> None:
        some = list(rows)
        levels, wear = given_readings(cases, some)
        self.gear, fleet = cases.gear, cases.fleet
        self.measured = cases.measured[some]
        self.margin_in = cases.margin_in[some]
        checks = [cases.inspections[row].rigging_checked for row in some]
        self.looked = [check not in (None, RiggingCheck.NO) for check in checks]
        self._levels, self._wear = levels, wear
        # By pins, joints, gears, levels and frequencies.
        by_joint = wear.swapaxes(0, 1)
        of_joints = _of_joints(self.gear, by_joint.reshape(len(by_joint), -1, len(SHARES)))
        self._transforms = of_joints.reshape(2, *by_joint.shape[:3], -1)
        self._before = _products_before(self._transforms, _LINKAGE)
        self._stands = _density(self._before[:, -1] * self._transforms[:, -1])
        usual, overlooked = usual_of(self.gear, fleet)
        before = np.array([1.0 - fleet.loaded, fleet.loaded])[:, None, None] * levels
        often = usual[:, None, None]
        elsewhere = before / (1.0 - often) / PRIORS.joints_for_one_elsewhere
        # By cause, pins, gears and levels.
        self._factors = np.array([before / often, elsewhere])
        # (8): work that left the rigging wrong leaves few worn joints.
        left = wear * np.where(_WORN, PRIORS.overlooked, 1.0)
        sound = left.sum(axis=3)
        self._of_levels = levels * np.prod(sound, axis=1) / overlooked
        self._rigging_levels = self._of_levels / self._of_levels.sum(axis=1, keepdims=True)
        self._left_worn = left[..., _WORN].sum(axis=3) / sound
        self._plunger_u_in = np.hypot(cases.plunger_u_in[some], 1e-4)
        self._unread = copy(self)
        self._see(cases.plunger_in[some])

    @cached_property
    def within(self) -> Inference:
        """What would be believed if the plunger were read within its margin."""
        return self._read(WELL_WITHIN)

    @cached_property
    def beyond(self) -> Inference:
        """What would be believed if the plunger were read beyond its margin."""
        return self._read(BEYOND)

    def _read(self, share: float) -> Inference:
        found = copy(self._unread)
        found._see(share * self.margin_in)
        return found

    def _see(self, y: Array) -> None:
        """Weigh by the readings of the plunger, NaN without one."""
        margin, u = self.margin_in, self._plunger_u_in
        is_read = np.isfinite(y)
        y = np.where(is_read, y, 0.0)
        # (6), and (7) of a wrong rigging.
        below, above = tabled_normal_cdf((_ENDS_IN[:, None] - y[:, None]) / u[:, None])
        seen = np.where(is_read[:, None], (above - below) / _CELL_IN, 1.0)
        even = 1.0 / (1.0 + (y / (PRIORS.offset * margin)) ** 8)
        out = tabled_normal_cdf((np.abs(y) - margin) / u)
        of_rigging = even * out / (2.0 * (PRIORS.offset - 1.0) * margin)
        of_rigging = np.where(is_read, of_rigging, 1.0)
        within = _share_within(margin[:, None])
        likely = seen * np.array([1.0 - within, within])
        # By cause, pins, gears and cells; held pins may rest with either sign.
        self._seen_at = np.stack([likely, 0.5 * (likely + likely[..., -_PLACES])], axis=1)
        fits = (self._stands @ self._seen_at[..., None])[..., 0]
        free, held = np.sum(fits.sum(axis=0) * self._levels, axis=2)
        self.held = held / np.maximum(free, 1e-300)
        # By gears, causes, pins and levels.
        self._weights = np.ascontiguousarray(np.moveaxis(self._factors * fits, 2, 0))
        # (9)
        rigging = np.where(self.looked, PRIORS.overlooked, 1.0) * of_rigging
        rigging *= self._of_levels.sum(axis=1) / PRIORS.joints_for_one_misrigged
        joints, other = self._weights.reshape(len(y), 2, -1).sum(axis=2).T
        total = np.maximum(joints + rigging + other, 1e-300)
        self.chances = np.transpose([joints / total, rigging / total, other / total])

    @cached_property
    def worn(self) -> Array:
        """Chance of each joint to be beyond its limit (10), (n, joints). [1]"""
        seen = np.conj(np.fft.rfft(self._seen_at))
        seen[..., 1:-1] *= 2.0
        # What the readings and the other joints say of where each one moves the plunger.
        said = np.sum(self._factors[..., None] * seen[..., None, :], axis=0)
        others = _products_before(self._transforms[:, ::-1], said)[:, ::-1] * self._before
        by_wear = _by_wear(self.gear)[:, :, _LIMIT:]
        shape = *by_wear.shape[:2], -1, by_wear.shape[-1]
        of_worn = np.conj(others).view(float).reshape(shape) @ by_wear.swapaxes(2, 3)
        wear = self._wear[..., _LIMIT:].swapaxes(0, 1)
        worn = np.sum(of_worn.sum(axis=0).reshape(wear.shape) * wear, axis=(2, 3)).T
        total = self._weights.sum(axis=(1, 2, 3))[:, None]
        worn /= np.maximum(_CELLS * total, 1e-300)
        rigging = self.chances[:, 1:2]
        left = (self._left_worn @ self._rigging_levels[..., None])[..., 0]
        return np.asarray((1.0 - rigging) * np.clip(worn, 0.0, 1.0) + rigging * left)

    @cached_property
    def chance_random(self) -> Array:
        """Chance of leaving the margin with random directions, whatever the outcome (12). [1]"""
        free, seen = self._stands[0], self._seen_at[:, 0].sum(axis=0)
        levels = self._levels * (free @ seen[..., None])[..., 0] + 1e-300
        out = free @ (1.0 - _share_within(self.margin_in[:, None]))[..., None]
        return np.asarray(np.sum(levels * out[..., 0], axis=1) / levels.sum(axis=1))

    def chance_of_any(self, place: int, joints: Sequence[int]) -> float:
        """Chance that any of some joints of one gear, by their places, is worn, whatever the cause.
        [1]
        """
        each, states = self.worn[place, list(joints)], self.states[place]
        worn = states.worn[:, list(joints)]
        # Drawn is only how often several are.
        several = states.causes.sum(axis=0) @ (worn.sum(axis=1) - worn.any(axis=1))
        return max(float(each.sum() - several), float(each.max()))

    def second_repair(self, place: int, restored: Mask) -> float:
        """Chance that the plunger is beyond its margin once some joints of one gear are new (11).
        [1]
        """
        of_joints, seen_at = self._transforms[:, :, place], self._seen_at[0, :, place]
        gone, stay = (of_joints[:, some].prod(axis=1) for some in (restored, ~restored))
        fresh = _as_new(self.gear)[:, restored].prod(axis=1)
        out = np.fft.rfft(seen_at)[:, None]
        weight = _density(np.conj(gone) * out) * _density(stay * _LINKAGE)
        weight *= self._factors[0, :, place, :, None]
        inside = _density(np.conj(fresh) * np.fft.rfft(_share_within(self.margin_in[place])))
        # Where the joints can hardly be the cause no repair is one.
        within = np.sum(weight * inside[:, None]) / max(float(weight.sum()), 1e-9)
        return float(np.clip(1.0 - within, _NEGLIGIBLE, 1.0 - _NEGLIGIBLE))

    @cached_property
    def states(self) -> list[States]:
        """Drawn failures of each gear, the same ones whoever else is judged: where the plunger
        stands, then what each joint moved, one after another, as in a hidden Markov chain.
        """
        chances = self.chances.copy()
        chances[chances[:, 2] < _NEGLIGIBLE, 2] = 0.0
        counts = [STATES, _OTHERS, _OTHERS * bool(chances[:, 2].any())]
        causes = np.repeat([0, 1], counts[::2])
        gears, joints, half = len(self._wear), len(self.gear.joints), _CELLS // 2
        even = _even(joints + 3, STATES + _OTHERS)[:, : len(causes)]
        turns, of_level, of_joint = _random(joints)
        each = np.arange(gears)[:, None]
        weights = self._weights.reshape(2 * gears, -1)
        drawn = _drawn(weights, 2 * each + causes, even[0])
        # Pins and levels of a gear that some state has.
        found, context = _distinct(each * weights.shape[1] + drawn, gears * weights.shape[1])
        gear, pins, levels = np.unravel_index(found, self._weights[:, 0].shape)
        likely = self._stands[pins, gear, levels] * self._seen_at[:, pins, gear] + 1e-300
        place = _drawn(likely.reshape(-1, _CELLS), causes * len(gear) + context, even[1])
        stands = _AT[place] + _CELL_IN * (even[2] - 0.5)
        # In single precision: a draw needs no more, and half of the time.
        before = _density(self._before[pins, :, gear, levels].astype(np.complex64))
        before = np.concatenate(
            [before[..., half:], before, before[..., :half]], axis=2, dtype=np.float32
        )
        share = even[3:, :, None].astype(np.float32)
        is_worn, at_in = self._points(gear, pins, levels)
        # The cells go round: from half of them below to half above.
        cell = (np.rint(at_in / _CELL_IN).astype(int) + half) % _CELLS - half
        moved, worn = np.empty((*place.shape, joints)), np.empty((*place.shape, joints), bool)
        for j in range(joints - 1, -1, -1):
            some, which = _distinct(_CELLS * context + place, _CELLS * len(gear))
            at, stood = np.divmod(some, _CELLS)
            first = 2 * _CELLS * (joints * at + j) + half + stood
            steps = (before.take(first[:, None] - cell[j].take(at, axis=0)) @ _SUMS)[which]
            chosen = np.argmax(steps >= share[j] * steps[..., -1:], axis=2)
            chosen += len(_QUANTILES) * context
            place = (place - cell[j].take(chosen)) % _CELLS
            moved[..., j] = at_in[j].take(chosen)
            worn[..., j] = is_worn[j].take(chosen)
        level = _drawn(self._rigging_levels, each, of_level)
        rigging = of_joint < self._left_worn[each, :, level]
        fresh = turns[pins[context[:, :STATES]], np.arange(STATES)]
        amplification = responses(self.gear)[0].amplification
        freed = moved[:, :STATES] - amplification * self.gear.new_parts_in * fresh
        each_weighs = chances / [STATES, _OTHERS, _OTHERS]
        blamed = self.worn * amplification / amplification.max()
        worn = np.concatenate([worn[:, :STATES], rigging, worn[:, STATES:]], axis=1)
        return [
            States(
                np.repeat(np.diag(each_weighs[k]), counts, axis=1),
                worn[k],
                freed[k],
                stands[k, :STATES],
                blamed[k],
                float(self.margin_in[k]),
            )
            for k in range(gears)
        ]

    def _points(self, gear: Places, pins: Places, levels: Places) -> tuple[Mask, Array]:
        """Points that stand for each joint in some contexts, (joints, contexts, points): whether it
        is worn, and what it moves the plunger by. [in]
        """
        cells = np.array(_USUAL_POINTS[levels][:, None].repeat(len(self.gear.joints), axis=1))
        is_read = self.measured[gear]
        read = self._wear[gear, :, levels][is_read]
        cells[is_read] = _drawn(read, np.arange(len(read))[:, None], _QUANTILES)
        share = SHARES[cells.swapaxes(0, 1)]
        reach, bend = (each[:, None, None] for each in _reach(self.gear))
        mean, spread = PRIORS.cosine
        turned = np.array([np.cos(2.0 * np.pi * _TURNS), mean + spread * _SCORES])[pins]
        return share > 1.0, reach * share * turned + (pins == 0)[:, None] * bend * share**2


def believed(cases: Cases, rows: Sequence[int]) -> Iterator[tuple[Inference, int]]:
    """What is believed of each of some gears, by its place among those worked out together."""
    for start in range(0, len(rows), _AT_ONCE):
        some = rows[start : start + _AT_ONCE]
        belief = Inference(cases, some)
        yield from ((belief, place) for place in range(len(some)))


@lru_cache(maxsize=4)
def _as_new(gear: Gear) -> Array:
    """Characteristic functions of new joints, (2, joints, frequencies)."""
    reach = _reach(gear)[0] * gear.new_parts_in / gear.limits_in
    return _characteristic(reach, 0.0 * reach)


@lru_cache(maxsize=4)
def _even(dimensions: int, n: int) -> Array:
    """Even numbers from 0 to 1, the same for every gear, shape (dimensions, n). [1]"""
    return frozen(random_directions(dimensions, n).T / (2.0 * np.pi))


@lru_cache(maxsize=4)
def _random(joints: int) -> tuple[Array, Array, Array]:
    """Random numbers that every gear has in common: cosines of the pins of new joints, free and
    held (4), (2, STATES, joints); and what draws the level and the worn joints of a wrong rigging.
    [1]
    """
    rng = np.random.default_rng(1)
    of_level, of_joint = rng.random(_OTHERS), rng.random((_OTHERS, joints))
    mean, spread = PRIORS.cosine
    held = mean + spread * rng.standard_normal((STATES, joints))
    free = np.cos(2.0 * np.pi * rng.random((STATES, joints)))
    return np.array([free, held]), of_level, of_joint


def _distinct(keys: Places, end: int) -> tuple[Places, Places]:
    """The whole numbers below an end that occur, and the place of each among them."""
    occurs = np.zeros(end, bool)
    occurs[keys] = True
    return np.flatnonzero(occurs), (np.cumsum(occurs) - 1)[keys]


def _drawn(weights: Array, rows: Places, share: Array) -> Places:
    """Where a share of the sum of a row of weights is reached."""
    steps = np.cumsum(weights, axis=1)
    steps = steps / np.maximum(steps[:, -1:], 1e-300) + np.arange(len(steps))[:, None]
    width = weights.shape[1]
    found = np.searchsorted(steps.ravel(), rows + share) - width * rows
    return np.asarray(found.clip(0, width - 1))


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
    freed_in : ndarray, shape (STATES, joints)
        By how much less each joint would move the plunger if it were new, in a failure of the
        joints: its pin rests anew. [in]
    stands_in : ndarray, shape (STATES,)
        Where the plunger stands then. [in]
    blamed : ndarray, shape (joints,)
        Chance of each joint to be worn, times how far it moves the plunger against the one that
        moves it most: a worn joint that hardly moves it is hardly the cause. [1]
    """

    causes: Array
    worn: Mask
    freed_in: Array
    stands_in: Array
    blamed: Array
    margin_in: float

    def stays_out(self, sets: Mask) -> NDArray[np.float32]:
        """Whether the plunger is beyond its margin in each failure of the joints once sets of
        joints are new, 1 or 0, shape (STATES, sets).
        """
        left = self.freed_in.astype(np.float32) @ sets.T.astype(np.float32)
        left -= self.stands_in[:, None].astype(np.float32)
        return (np.abs(left, out=left) > self.margin_in).astype(np.float32)


def explain(belief: Inference, place: int) -> Posterior:
    """Find which joints explain the plunger's reading of one gear that failed."""
    gear = belief.gear
    every = [*gear.link_groups, gear.joint_numbers]
    places = [[gear.joint_numbers.index(n) for n in group] for group in every]
    # Nothing is surer than what drawn states allow.
    *chances, worn = np.clip(
        [belief.chance_of_any(place, each) for each in places], 1e-4, 1.0 - 1e-4
    ).tolist()
    groups = [GroupChance(*each) for each in zip(gear.link_groups, chances, strict=True)]
    groups.sort(key=lambda group: -group.probability)
    none = 1.0 - worn
    rigging = float(belief.chances[place, 1])
    return Posterior(
        tuple(groups),
        none,
        rigging,
        _text(groups, none, rigging, looked=belief.looked[place]),
    )


def _text(groups: Sequence[GroupChance], none: float, rigging: float, *, looked: bool) -> str:
    if rigging > 0.8 and looked:
        return (
            f"The joints are unlikely to be the cause ({percent(1.0 - rigging)}); rigging and lock"
            " roller were checked."
        )
    if rigging > 0.8:
        return (
            "Rigging or lock roller, not joint clearance, likely moved the plunger"
            f" ({percent(rigging)})."
        )
    likely = [group for group in groups[:2] if group.probability >= 1.0 - CONFORMANCE]
    # Another chance than those of the joints: both can be so at once.
    also = f"Chance that rigging or lock roller moved the plunger: {percent(rigging)}."
    if not likely:
        return f"Probably no joint is beyond its limit ({percent(none)}). {also}"
    ranked = ", then ".join(
        f"{' or '.join(f'#{n}' for n in group.joints)} ({percent(group.probability)})"
        for group in likely
    )
    return f"Chance of a worn joint: {ranked}. {also}"
