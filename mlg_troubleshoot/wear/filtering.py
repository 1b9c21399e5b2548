"""What readings say of the level and the drift of each unit, for many posterior draws and many
units at once.

Level x and drift b of a path run over a clock c = usage^q:

    x(c + d) = x(c) + b d + s W(d)         Wiener increments
    b(c + d) = b(c) + v W(d)               integrated Wiener: the drift itself wanders
    x(c + d) = x(c) + Gamma(d / s², b s²)  gamma increments: mean b d, variance b² s² d

Paths begin at x ~ N(start, start_sd²) with b = unit's drift + N(0, (1 - kept) drift_sd²), and the
unit's drift is N(drift, kept drift_sd²), so that a restored part keeps a share of its own pace. A
reading is x + N(0, r²). Wiener and integrated Wiener are filtered exactly (Kalman); gamma
increments by their mean and their variance, which is what is expected of it from the readings so
far: s² d E[b²] = s² d (mean² + variance of the drift).
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
    """Parameters, each of shape (draws, 1), in the units of ``Scale``; ``gamma`` says that
    increments are gamma.
    """

    gamma: Mask
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


def clock(usage: Array, power: Array) -> Array:
    """Turn usage into the time that drift and increments count."""
    return np.where(power == 1.0, usage, np.maximum(usage, 0.0) ** power)


def follow(steps: Steps, draws: Draws, *, likelihood: bool = True) -> tuple[Array, FilterState]:
    """Filter the readings of every unit; return log likelihood (draws, units), zero where it is
    not asked for, and the state at the end.

    Mean of level x, drift b and the unit's own drift u; their covariances are named by the pair.
    """
    shape = (len(draws.start), steps.seen.shape[1])
    own = (1.0 - draws.kept) * draws.drift_sd**2
    kept = draws.kept * draws.drift_sd**2
    x = np.broadcast_to(draws.start, shape)
    b = u = np.broadcast_to(draws.drift, shape)
    xx = np.broadcast_to(draws.start_sd**2, shape)
    xb = xu = total = before = np.zeros(shape)
    bb = np.broadcast_to(own + kept, shape)
    bu = uu = np.broadcast_to(kept, shape)
    for begins, seen, usage, value, known in zip(
        steps.begins, steps.seen, steps.usage, steps.value, steps.known_r2, strict=True
    ):
        now = clock(usage, draws.power)
        if begins.any():
            x = np.where(begins, draws.start, x)
            b = np.where(begins, u, b)
            xx = np.where(begins, draws.start_sd**2, xx)
            xb = np.where(begins, 0.0, xb)
            xu = np.where(begins, 0.0, xu)
            bb = np.where(begins, uu + own, bb)
            bu = np.where(begins, uu, bu)
            before = np.where(begins, 0.0, before)
        d = now - before
        before = now
        x = x + b * d
        w2 = draws.wander_sd**2 * d
        s2 = draws.increment_sd**2 * d
        s2 = np.where(draws.gamma, s2 * (b * b + bb), s2)
        xx = xx + d * (2.0 * xb + d * bb) + s2 + w2 * d * d / 3.0
        xb = xb + d * bb + w2 * d / 2.0
        bb = bb + w2
        xu = xu + d * bu
        reading = np.where(np.isnan(known), draws.reading_sd**2, known)
        s = xx + reading + _LEAST_VARIANCE
        g = seen / s
        off = value - x
        if likelihood:
            total = total - 0.5 * seen * (off * off / s + np.log(s) + _LOG_2PI)
        x = x + g * xx * off
        b = b + g * xb * off
        u = u + g * xu * off
        bb = bb - g * xb * xb
        bu = bu - g * xb * xu
        uu = uu - g * xu * xu
        xb = xb - g * xx * xb
        xu = xu - g * xx * xu
        xx = xx - g * xx * xx
    return total, FilterState(x, b, xx, xb, bb)
