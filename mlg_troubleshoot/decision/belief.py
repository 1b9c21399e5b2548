"""What is believed of a gear that failed: chances of all that nobody knows of it, and drawn states.

The model is that of docs/reference/models.md; (1) to (12) are its equations. Each joint has a
characteristic function for each wear; readings weigh the wears, a sum of joints is a product, and
the plunger's reading is met on a grid by discrete Fourier transforms, for each level of wear with
free and with held pins.

Which joints explain a measured plunger displacement, in numbers and words.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from statistics import NormalDist

import numpy as np
from numpy.typing import NDArray

from mlg_troubleshoot.arrays import Array, Mask, Places, frozen
from mlg_troubleshoot.decision.assessment import ClearanceInterval, GroupChance, Posterior
from mlg_troubleshoot.decision.inspection import Fleet, RiggingCheck
from mlg_troubleshoot.decision.prediction import Cases, responses
from mlg_troubleshoot.decision.priors import PRIORS
from mlg_troubleshoot.decision.sentences import percent
from mlg_troubleshoot.decision.verdict_rule import CONFORMANCE, tabled_normal_cdf
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.gear.linkage import random_directions

# Cells of the plunger's displacement, mid-position first, then over-travel, then under-travel; all
# joints worn out together stay inside. [1, in]
_CELLS = 256
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
# p of (1) before a fleet is known. [1]
LEVELS = np.append(np.full(6, PRIORS.alike / 6), 1.0 - PRIORS.alike)


@lru_cache(maxsize=2)
def given_readings(cases: Cases) -> tuple[Array, Array]:
    """Chances of the levels of each gear given its readings (1) to (3), (n, levels), and of each
    cell of wear at each level, (n, joints, levels, wear). [1]
    """
    limits = cases.gear.limits_in
    share = np.clip(cases.filled(0.0) / limits, 0.0, 2.0)[..., None]
    doubtful = (cases.over_limit & ~cases.own_gauge)[..., None]
    u = np.maximum(cases.gauge_u_in / limits, 1e-3)[..., None]
    slip = doubtful * -np.expm1(-PRIORS.wrong_readings / len(limits))
    likely = np.zeros((*cases.measured.shape, len(SHARES)))
    for factor, often in ((1.0, 1.0 - slip), (2.0, slip)):
        if not often.any():
            continue
        spread = np.hypot(u, doubtful * PRIORS.gauge_scale * factor * SHARES)
        above, below = ((factor * ends - share) / spread for ends in (_ENDS[1:], _ENDS[:-1]))
        likely += often / factor * (tabled_normal_cdf(above) - tabled_normal_cdf(below))
    likely[~cases.measured] = 1.0
    wear = likely[:, :, None] * WEAR
    fits = wear.sum(axis=3, keepdims=True)
    levels = fits[..., 0].prod(axis=1) * (cases.fleet.levels or LEVELS)
    return levels / levels.sum(axis=1, keepdims=True), wear / fits


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


def _density(transform: Array | NDArray[np.complex128]) -> Array:
    """Chance of each cell from a transform. [1]"""
    found = np.fft.irfft(transform, _CELLS)
    # Less is what the frequencies that are left out would take away.
    least = _NEGLIGIBLE * found.max(axis=-1, keepdims=True)
    return np.asarray(np.where(found > least, found, 0.0))


def _share_within(margin_in: Array | float) -> Array:
    """Share of each cell within the margin. [1]"""
    return np.asarray(np.clip((margin_in - np.abs(_AT)) / _CELL_IN + 0.5, 0.0, 1.0))


def _products_before(factors: Array, first: Array | float = 1.0) -> Array:
    """Product of the factors before each one along the second axis, and of one before them all."""
    before = np.empty_like(factors)
    before[:, 0] = first
    for j in range(factors.shape[1] - 1):
        before[:, j + 1] = before[:, j] * factors[:, j]
    return before


@lru_cache(maxsize=8)
def usual_of(gear: Gear, fleet: Fleet) -> tuple[Array, float]:
    """Of a gear of the fleet of which nothing was read: the chance of leaving the margin with free
    and with held pins, and how rarely work on it leaves its worn joints as they are. [1]
    """
    levels = np.array(fleet.levels or LEVELS)
    whole = (WEAR @ _by_wear(gear)).view(complex).prod(axis=1) * _LINKAGE
    out = _density(whole) @ (1.0 - _share_within(gear.margin.value)) @ levels
    left = (1.0 - (1.0 - PRIORS.overlooked) * (WEAR @ _WORN)) ** len(gear.joints)
    return np.clip(out, 1e-9, 1.0 - 1e-9), float(levels @ left)


class Belief:
    """What is believed of one gear that failed, by everything that is known of it.

    Attributes
    ----------
    looked : bool
        Whether the rigging was checked.
    chances : tuple of float
        Chances that the joints, the rigging and something else are the cause (9). [1]
    held : float
        How much likelier the plunger's reading is with held pins than with free ones. [1]
    """

    def __init__(self, cases: Cases, row: int = 0) -> None:
        levels, wear = (each[row] for each in given_readings(cases))
        gear, fleet = cases.gear, cases.fleet
        self.gear = gear
        self.margin_in = margin = float(cases.margin_in[row])
        self.looked = cases.inspections[row].rigging_checked not in (None, RiggingCheck.NO)
        self._wear = wear
        # By pins, joints and levels.
        self._transforms = (wear @ _by_wear(gear)).view(complex)
        self._before = _products_before(self._transforms, _LINKAGE)
        self._stands = _density(self._before[:, -1] * self._transforms[:, -1])
        y, u = float(cases.plunger_in[row]), float(np.hypot(cases.plunger_u_in[row], 1e-4))
        seen, of_rigging = np.ones(_CELLS), 1.0
        if np.isfinite(y):
            # (6), and (7) of a wrong rigging.
            below, above = tabled_normal_cdf((_ENDS_IN - y) / u)
            seen = (above - below) / _CELL_IN
            even = 1.0 / (1.0 + (y / (PRIORS.offset * margin)) ** 8)
            out = float(tabled_normal_cdf(np.array((abs(y) - margin) / u)))
            of_rigging = even * out / (2.0 * (PRIORS.offset - 1.0) * margin)
        within = _share_within(margin)
        usual, overlooked = usual_of(gear, fleet)
        before = np.outer([1.0 - fleet.loaded, fleet.loaded], levels)
        often = usual[:, None]
        elsewhere = before / (1.0 - often) / PRIORS.joints_for_one_elsewhere
        # By cause, pins and levels; by cause, pins and cells.
        self._factors = np.array([before / often, elsewhere])
        likely = seen * np.array([1.0 - within, within])
        # Held pins may rest with either sign.
        self._seen_at = np.stack([likely, 0.5 * (likely + likely[:, -_PLACES])], axis=1)
        fits = np.einsum("pkx,cpx->cpk", self._stands, self._seen_at)
        free, held = (fits.sum(axis=0) @ levels).tolist()
        self.held = held / max(free, 1e-300)
        self._weights = self._factors * fits
        # (8), (9): work that left the rigging wrong leaves few worn joints.
        left = wear * np.where(_WORN, PRIORS.overlooked, 1.0)
        sound = left.sum(axis=2)
        of_levels = levels * np.prod(sound, axis=0) / overlooked
        looked = PRIORS.overlooked if self.looked else 1.0
        rigging = looked * of_rigging * float(of_levels.sum()) / PRIORS.joints_for_one_misrigged
        joints, other = self._weights.sum(axis=(1, 2)).tolist()
        total = max(joints + rigging + other, 1e-300)
        self.chances = joints / total, rigging / total, other / total
        self._rigging_levels = of_levels / of_levels.sum()
        self._left_worn = left[..., _WORN].sum(axis=2) / sound

    @cached_property
    def wear(self) -> Array:
        """Chance of each cell of wear of each joint where the rigging is right, (joints, wear): all
        others as they are, this one worn so far. [1]
        """
        after = _products_before(self._transforms[:, ::-1])[:, ::-1]
        seen = np.fft.rfft(self._seen_at)
        seen[..., 1:-1] *= 2.0
        weighed = np.einsum("cpk,cpf->pkf", self._factors, np.conj(seen))
        others = self._before * after * weighed[:, None]
        # Parseval.
        by_wear = np.conj(others).view(float) @ _by_wear(self.gear).swapaxes(2, 3)
        found = np.maximum(np.einsum("pjks,jks->js", by_wear, self._wear), 1e-300)
        return np.asarray(found / found.sum(axis=1, keepdims=True))

    @cached_property
    def worn(self) -> Array:
        """Chance of each joint to be beyond its limit (10). [1]"""
        rigging = self.chances[1]
        found = (1.0 - rigging) * (self.wear @ _WORN)
        return np.asarray(found + rigging * (self._left_worn @ self._rigging_levels))

    @property
    def worn_by_leverage(self) -> Array:
        """Chance of each joint to be worn, times how far it moves the plunger against the one that
        moves it most: a worn joint that hardly moves it is hardly the cause. [1]
        """
        amplification = responses(self.gear)[0].amplification
        return np.asarray(self.worn * amplification / amplification.max())

    def clearances_in(self, at: Sequence[float]) -> Array:
        """Quantiles of the clearance of each joint, (joints, quantiles). [in]"""
        steps = np.cumsum(self.wear, axis=1)
        found = [np.interp(at, [0.0, *each], _ENDS) for each in steps]
        return np.array(found) * self.gear.limits_in[:, None]

    def second_repair(self, restored: Mask) -> float:
        """Chance that the plunger is beyond its margin once some joints are new (11). [1]"""
        gone, stay = (self._transforms[:, some].prod(axis=1) for some in (restored, ~restored))
        fresh = _as_new(self.gear)[:, restored].prod(axis=1)
        out = np.fft.rfft(self._seen_at[0])[:, None]
        weight = _density(np.conj(gone) * out) * _density(stay * _LINKAGE)
        weight *= self._factors[0][..., None]
        inside = _density(np.conj(fresh) * np.fft.rfft(_share_within(self.margin_in)))
        # Where the joints can hardly be the cause no repair is one.
        within = np.sum(weight * inside[:, None]) / max(float(weight.sum()), 1e-9)
        return float(np.clip(1.0 - within, _NEGLIGIBLE, 1.0 - _NEGLIGIBLE))

    def chance_of_any(self, joints: Sequence[int]) -> float:
        """Chance that any of some joints, by their places, is worn, whatever the cause. [1]"""
        each, worn = self.worn[list(joints)], self.states.worn[:, list(joints)]
        # Drawn is only how often several are.
        several = self.states.causes.sum(axis=0) @ (worn.sum(axis=1) - worn.any(axis=1))
        return max(float(each.sum() - several), float(each.max()))

    @cached_property
    def states(self) -> States:
        """Drawn failures, the same ones whoever else is judged: where the plunger stands, then what
        each joint moved, one after another, as in a hidden Markov chain.
        """
        causes = np.repeat([0, 1], [STATES, _OTHERS])
        n, joints, half = len(causes), len(self.gear.joints), _CELLS // 2
        even, (turns, of_level, of_joint) = _even(joints + 3, n), _random(joints)
        # A context is a cause with pins and a level.
        shape = self._weights.shape
        drawn = _drawn(self._weights.reshape(2, -1), causes, even[0])
        drawn += causes * shape[1] * shape[2]
        is_used = np.bincount(drawn, minlength=self._weights.size) > 0
        context = np.cumsum(is_used)[drawn] - 1
        cause, pins, levels = np.unravel_index(np.flatnonzero(is_used), shape)
        likely = self._stands[pins, levels] * self._seen_at[cause, pins] + 1e-300
        place = _drawn(likely, context, even[1])
        stands = _AT[place] + _CELL_IN * (even[2] - 0.5)
        before = _density(self._before[pins, :, levels])
        before = before.swapaxes(0, 1)
        # In single precision: a draw needs no more, and half of the time.
        before = np.concatenate(
            [before[..., half:], before, before[..., :half]], axis=2, dtype=np.float32
        )
        share = even[3:, :, None].astype(np.float32)
        is_worn, at_in = self._points(pins, levels)
        # The cells go round: from half of them below to half above.
        cell = (np.rint(at_in / _CELL_IN).astype(int) + half) % _CELLS - half
        first = 2 * _CELLS * context + half
        chosen = np.empty((joints, n), int)
        for j in range(joints - 1, -1, -1):
            left = (first + place)[:, None] - cell[j].take(context, axis=0)
            steps = before[j].take(left) @ _SUMS
            chosen[j] = np.argmax(steps >= share[j] * steps[:, -1:], axis=1)
            place = (place - cell[j, context, chosen[j]]) % _CELLS
        at = np.arange(joints)[:, None], context, chosen
        moved, worn = at_in[at].T, is_worn[at].T
        level = _drawn(self._rigging_levels[None], np.zeros(_OTHERS, int), of_level)
        rigging = of_joint < self._left_worn[:, level].T
        fresh = turns[pins[context[:STATES]], np.arange(STATES)]
        reach = responses(self.gear)[0].amplification * self.gear.new_parts_in
        counts = [STATES, _OTHERS, _OTHERS]
        return States(
            np.repeat(np.diag(np.divide(self.chances, counts)), counts, axis=1),
            np.vstack([worn[:STATES], rigging, worn[STATES:]]),
            moved[:STATES] - reach * fresh,
            stands[:STATES],
            self.margin_in,
        )

    def _points(self, pins: Places, levels: Places) -> tuple[Mask, Array]:
        """Points that stand for each joint in some contexts, (joints, contexts, points): whether it
        is worn, and what it moves the plunger by. [in]
        """
        wear = self._wear.reshape(-1, len(SHARES))
        cells = _drawn(wear, np.arange(len(wear))[:, None], _QUANTILES)
        share = SHARES[cells].reshape(*self._wear.shape[:2], -1)[:, levels]
        reach, bend = (each[:, None, None] for each in _reach(self.gear))
        mean, spread = PRIORS.cosine
        turned = np.array([np.cos(2.0 * np.pi * _TURNS), mean + spread * _SCORES])[pins]
        return share > 1.0, reach * share * turned + (pins == 0)[:, None] * bend * share**2


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
    """

    causes: Array
    worn: Mask
    freed_in: Array
    stands_in: Array
    margin_in: float

    def stays_out(self, sets: Mask) -> Mask:
        """Whether the plunger is beyond its margin in each failure of the joints once sets of
        joints are new, shape (STATES, sets).
        """
        left = self.stands_in[:, None] - self.freed_in @ sets.T
        return np.asarray(np.abs(left) > self.margin_in)


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
    share = np.array([np.interp(even[joints:], np.r_[0.0, each], _ENDS) for each in steps])
    moved = share * reach[:, None] * turned + share**2 * bend[:, None]
    per_clearance = reach / gear.limits_in
    return per_clearance[:, None] * turned, bend / gear.limits_in**2, moved


def chance_random(cases: Cases, rows: Places) -> Array:
    """Chance of leaving the margin with random directions (12) of some gears: joints that were read
    as they are, the others by their usual wear, weighed by where the plunger was read. [1]
    """
    levels = given_readings(cases)[0][rows]
    cases = cases.take(rows)
    linear, bend, moved = _imagined(cases.gear)
    read = cases.filled(0.0)
    base = read @ linear + (read**2 @ bend)[:, None]
    y, u = cases.plunger_in[:, None], np.hypot(cases.plunger_u_in, PRIORS.linkage_u_in)[:, None]
    is_read = np.isfinite(y[:, 0])
    beyond = np.empty_like(levels)
    for k, each in enumerate(moved):
        at = base + (~cases.measured).astype(float) @ each
        beyond[:, k] = np.mean(np.abs(at) > cases.margin_in[:, None], axis=1)
        off = (at[is_read] - y[is_read]) / u[is_read]
        levels[is_read, k] *= np.mean(np.exp(-0.5 * off**2), axis=1) + 1e-12
    return np.asarray(np.sum(levels * beyond, axis=1) / levels.sum(axis=1))


_INTERVAL = 1.0 - CONFORMANCE, 0.5, CONFORMANCE


def explain(belief: Belief) -> Posterior:
    """Find which joints explain the plunger's reading of one gear that failed."""
    gear = belief.gear
    every = [*gear.link_groups, gear.joint_numbers]
    places = [[gear.joint_numbers.index(n) for n in group] for group in every]
    # Nothing is surer than what drawn states allow.
    *chances, worn = np.clip(
        [belief.chance_of_any(each) for each in places], 1e-4, 1.0 - 1e-4
    ).tolist()
    groups = [GroupChance(*each) for each in zip(gear.link_groups, chances, strict=True)]
    groups.sort(key=lambda group: -group.probability)
    intervals = tuple(
        ClearanceInterval(number, low, median, high, worn)
        for number, (low, median, high), worn in zip(
            gear.joint_numbers,
            belief.clearances_in(_INTERVAL).tolist(),
            belief.worn.tolist(),
            strict=True,
        )
    )
    called = tuple(group.joints for group in groups if group.probability > 0.5)
    none = 1.0 - worn
    rigging = belief.chances[1]
    return Posterior(
        tuple(groups),
        none,
        rigging,
        intervals,
        called,
        _text(groups, none, rigging, looked=belief.looked),
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
