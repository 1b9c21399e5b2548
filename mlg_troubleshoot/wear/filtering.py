"""What readings say of the level and the drift of each unit, for many posterior draws and many
units at once.

Level x and drift b of a path run over a clock c = usage^q:

    x(c + d) = x(c) + b d + s W(d)         Wiener increments
    b(c + d) = b(c) + v W(d)               integrated Wiener: the drift itself wanders

Paths begin at x ~ N(start, start_sd²) with b = unit's drift + N(0, (1 - kept) drift_sd²), and the
unit's drift is N(drift, kept drift_sd²), so that a restored part keeps a share of its own pace. A
reading is x + N(0, r²). Both are filtered exactly (Kalman).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mlg_troubleshoot.arrays import Array, Mask, Places
from mlg_troubleshoot.wear.paths import Steps

_LOG_2PI = float(np.log(2 * np.pi))
# Variance added to every reading, as if it were a thousandth of the whole rise worse than stated.
# Without it the posterior is too narrow to sample where all parts begin at the same number. On
# measured cracks (tests/wear/real.py) the probability of one kind was then 0.19 to 0.97, depending
# on the seed; with it 0.22 to 0.23, with 970 to 1,230 effective of 1,600 draws. [1]
_LEAST_VARIANCE = 1e-6


@dataclass(frozen=True, slots=True)
class Draws:
    """Parameters, each of shape (draws, 1), in the units of ``Scale``."""

    start: Array
    start_sd: Array
    drift: Array
    drift_sd: Array
    increment_sd: Array
    wander_sd: Array
    reading_sd: Array
    power: Array
    kept: Array

    def take(self, chosen: Places | Mask) -> Draws:
        return Draws(*(getattr(self, name)[chosen] for name in self.__dataclass_fields__))


@dataclass(frozen=True, slots=True)
class FilterState:
    """Mean and covariance of level and drift at the last step, arrays (draws, units)."""

    level: Array
    drift: Array
    level_var: Array
    both_cov: Array
    drift_var: Array

    def take(self, units: Places) -> FilterState:
        return FilterState(*(getattr(self, name)[:, units] for name in self.__dataclass_fields__))


def clock(usage: Array, power: Array) -> Array:
    """Turn usage into the time that drift and increments count."""
    bent = power.ravel() != 1.0
    if not bent.any():
        return usage
    if bent.all():
        return np.asarray(np.maximum(usage, 0.0) ** power)
    time = np.broadcast_to(usage, np.broadcast_shapes(usage.shape, power.shape)).copy()
    time[bent] = np.maximum(usage, 0.0) ** power[bent]
    return time


class _Covariances:
    """Of level x, drift b and the unit's own drift u, named by the pair, arrays (draws, units)."""

    def __init__(self, draws: Draws, units: int) -> None:
        self._draws = draws
        self._wanders = bool(draws.wander_sd.any())
        self._jumps = bool(draws.increment_sd.any())
        self._own = (1.0 - draws.kept) * draws.drift_sd**2
        kept = draws.kept * draws.drift_sd**2
        shape = (len(draws.start), units)
        self.xx = np.broadcast_to(draws.start_sd**2, shape)
        self.xb = self._xu = np.zeros(shape)
        self.bb = np.broadcast_to(self._own + kept, shape)
        self._bu = self._uu = np.broadcast_to(kept, shape)

    def restore(self, restored: Mask) -> None:
        """Begin new paths of some units."""
        self.xx = np.where(restored, self._draws.start_sd**2, self.xx)
        self.xb = np.where(restored, 0.0, self.xb)
        self._xu = np.where(restored, 0.0, self._xu)
        self.bb = np.where(restored, self._uu + self._own, self.bb)
        self._bu = np.where(restored, self._uu, self._bu)

    def run(self, d: Array, *, own: bool) -> None:
        """Let the clock run by d; the own drift may be asked for."""
        by_drift = d * self.bb
        self.xx = self.xx + d * (2.0 * self.xb + by_drift)
        if self._jumps:
            self.xx += self._draws.increment_sd**2 * d
        self.xb = self.xb + by_drift
        if self._wanders:
            w2 = self._draws.wander_sd**2 * d
            self.xx += w2 * d * d / 3.0
            self.xb += w2 * d / 2.0
            self.bb = self.bb + w2
        if own:
            self._xu = self._xu + d * self._bu

    def read(self, g: Array, *, own: bool) -> tuple[Array, Array, Array | None]:
        """Take in a reading of weight g; return the gains of x, b and, if the own drift will be
        asked for, u.
        """
        to_x = g * self.xx
        to_b = g * self.xb
        to_u = None
        if own:
            to_u = g * self._xu
            self._bu = self._bu - to_b * self._xu
            self._uu = self._uu - to_u * self._xu
            self._xu = self._xu - to_x * self._xu
        self.bb = self.bb - to_b * self.xb
        self.xb = self.xb - to_x * self.xb
        self.xx = self.xx - to_x * self.xx
        return to_x, to_b, to_u


def follow(steps: Steps, draws: Draws, *, likelihood: bool = True) -> tuple[Array, FilterState]:
    """Filter the readings of every unit; return log likelihood (draws, units), zero where it is
    not asked for, and the state at the end.

    Mean of level x, drift b and the unit's own drift u.
    """
    # Covariances do not depend on what was read: once for all units that were read at the same
    # usages, as the joints of one gear are.
    first, owner = steps.alike

    def each(of_alike: Array) -> Array:
        return of_alike.take(owner, axis=-1)

    seens, usages, known_r2 = (of[..., first] for of in (steps.seen, steps.usage, steps.known_r2))
    estimated = np.isnan(known_r2)
    shape = (len(draws.start), steps.seen.shape[1])
    x = np.broadcast_to(draws.start, shape)
    b = u = np.broadcast_to(draws.drift, shape)
    total = np.zeros(shape)
    covariances = _Covariances(draws, seens.shape[1])
    before = np.zeros_like(covariances.xx)
    again = steps.begins & (np.cumsum(steps.begins, axis=0) > 1)
    # After that the own drift decides nothing.
    last = int(np.flatnonzero(again.any(axis=1)).max(initial=-1))
    for i, (begins, value) in enumerate(zip(again, steps.value, strict=True)):
        now = clock(usages[i], draws.power)
        if begins.any():
            x = np.where(begins, draws.start, x)
            b = np.where(begins, u, b)
            before = np.where(begins[first], 0.0, before)
            covariances.restore(begins[first])
        d = now - before
        before = now
        covariances.run(d, own=i < last)
        x = x + b * each(d)
        reading = known_r2[i]
        if estimated[i].any():
            reading = np.where(estimated[i], draws.reading_sd**2, reading)
        s = covariances.xx + reading + _LEAST_VARIANCE
        off = value - x
        if likelihood:
            misfit = off * off / each(s) + each(np.log(s)) + _LOG_2PI
            total -= 0.5 * steps.seen[i] * misfit
        to_x, to_b, to_u = covariances.read(seens[i] / s, own=i < last)
        x = x + each(to_x) * off
        b = b + each(to_b) * off
        if to_u is not None:
            u = u + each(to_u) * off
    xx, xb, bb = map(each, (covariances.xx, covariances.xb, covariances.bb))
    return total, FilterState(x, b, xx, xb, bb)
