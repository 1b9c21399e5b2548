"""Fit wear of many units at once, and forecast it: by simulation over the posterior draws."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike
from threadpoolctl import threadpool_limits

from mlg_troubleshoot.arrays import Array, Places
from mlg_troubleshoot.errors import UsageError
from mlg_troubleshoot.results import Result
from mlg_troubleshoot.wear.filtering import Draws, FilterState, clock, follow
from mlg_troubleshoot.wear.paths import Scale, WearPath, lay_out, scale_of

# Posterior draws that every forecast is averaged over. [1]
_DRAWS = 128
# Simulated paths of a unit of a population of few units and of many. [1]
_PATHS = 4096
_PATHS_OF_MANY = 256
_MANY = 64
# Units read once that the population is learnt from at most, in addition to `learns_from`. [1]
_LEARN_FROM_OTHERS = 40
# Standard deviation of the pace of wear beyond the usage that any unit has reached: no reading so
# far can show a curve that bends later. [1]
_DOUBT = 0.25
# Usages at which a path is asked whether it has passed a limit, from the last reading on, per usage
# that any unit has reached. [1]
_TO_LIMIT = np.concatenate([[0], np.geomspace(1 / 50, 40, 44)])
# The clock of a simulated path never stops. [1]
_SLOWEST = 0.1


@dataclass(frozen=True, slots=True, repr=False, eq=False)
class Samples(Result):
    """Samples of what was asked, with infinity for what never happens.

    Parameters
    ----------
    samples : ndarray, shape (..., n_samples)
        Samples on the last axis, before it one axis per question. [as asked]
    """

    samples: Array

    def quantile(self, probability: ArrayLike) -> Array:
        """Quantiles of the samples, each the nearest one, at a probability or several, shape (p,).
        [1]

        Returns, shape (..., p): infinite, never NaN, where a quantile lies among samples that never
        happen. [as asked]
        """
        ordered = np.sort(self.samples, axis=-1)
        at = np.rint(np.asarray(probability) * (ordered.shape[-1] - 1)).astype(int)
        return np.asarray(ordered[..., at])


@dataclass(frozen=True, repr=False, eq=False)
class WearModel(Result):
    """Wear of units from one population.

    Parameters
    ----------
    paths : mapping of str to tuple of WearPath
        What was read, by unit, in the order of time.
    kinds : mapping of str to float
        Posterior probability of each kind of increments. [1]
    scale : Scale
        Units of the computation.
    draws : Draws
        Posterior draws of the population's parameters.
    seed : int
        Seed of fit and forecasts.
    simulated : int
        Simulated paths of each unit. [1]
    """

    # Units read twice or more that are learnt from at most: more would not narrow it. [1]
    learns_from: ClassVar[int] = 160

    paths: Mapping[str, tuple[WearPath, ...]]
    kinds: Mapping[str, float]
    scale: Scale
    draws: Draws
    seed: int
    simulated: int

    def of(self, paths: Iterable[WearPath]) -> WearModel:
        """The same population, asked about other units of it."""
        return replace(self, paths=_by_unit(paths))

    def forecast(
        self,
        unit: str | Sequence[str],
        usage: ArrayLike,
        *,
        reading: bool = True,
        together: int | None = None,
    ) -> Samples:
        """Forecast readings of the current path of a unit, or of n units at once.

        unit: one that is not known is a new one of the same population. usage, shape (m,) or (n,
        m): usage since the last restoration, the same for all or one row per unit; before
          the last reading the path is followed back along its drift. [usage]
        reading: of a new reading, with its error; otherwise of the wear itself.
        together: consecutive units that are forecast as if no others were asked
          for. Along the usages a sample is one path. Returns samples of shape (m, n_samples) or (n,
        m, n_samples). [value]
        """
        units = [unit] if isinstance(unit, str) else list(unit)
        asked = np.asarray(usage, float)
        if not np.isfinite(asked).all() or (asked < 0.0).any():
            raise UsageError("a usage to forecast is negative or not finite", "Give usages from 0.")
        wanted = np.atleast_1d(asked)
        wanted = np.broadcast_to(wanted, (len(units), wanted.shape[-1]))
        draws, state = self._followed
        repeats = self.simulated // len(draws.start)
        rng = _Streams(self.seed)
        parts = []
        for chosen in self._chunks(len(units), together or 1):
            if together is not None:
                rng = _Streams(self.seed, len(chosen) // together)
            names = [units[i] for i in chosen]
            order = np.argsort(wanted[chosen], axis=1)
            ascending = np.take_along_axis(wanted[chosen], order, axis=1) / self.scale.usage
            end = _Ends.drawn(draws, state.take(self._places(names)), repeats, rng)
            samples = np.empty((*ascending.shape, end.level[:, 0].size))
            last, known = self._last(names), self._known_reading(names)
            followed = end.follow(ascending, last, known, rng, reading=reading)
            for at, path in zip(order.T, followed, strict=True):
                samples[np.arange(len(names)), at] = path.swapaxes(0, 1).reshape(len(names), -1)
            samples *= self.scale.value
            samples += self.scale.start
            parts.append(samples)
        if isinstance(unit, str):
            return Samples(parts[0][0])
        return Samples(parts[0] if len(parts) == 1 else np.concatenate(parts))

    def usage_to_limit(self, unit: str | Sequence[str], limit: ArrayLike) -> Samples:
        """Forecast the usage at which the wear itself of one unit or n, not a reading of it,
        crosses a limit, along simulated paths.

        limit, one for all or shape (n,): the limit. [value] Returns samples of shape (n_samples,)
        or (n, n_samples): usage since the last restoration at the crossing,
          infinite where there never is one; at the last reading where the limit is passed already.
          [usage]
        """
        units = [unit] if isinstance(unit, str) else list(unit)
        limits = np.broadcast_to(limit, (len(units),))
        last = self._last(units)[:, None] * self.scale.usage
        ahead = self.scale.usage * _TO_LIMIT
        wear = self.forecast(units, last + ahead, reading=False).samples
        # Wear that falls passes its limit from above.
        up = np.sign(self.scale.value)
        wear *= up
        samples = last + first_passage(ahead, wear, up * limits)
        return Samples(samples[0] if isinstance(unit, str) else samples)

    def _chunks(self, units: int, together: int) -> Iterator[Places]:
        """Units that are worked out at once: whole groups of those asked about together."""
        most = _MANY if self.simulated > _PATHS_OF_MANY else 250
        size = max(most // together, 1) * together
        for first in range(0, units, size):
            yield np.arange(first, min(first + size, units))

    def _paths(self, unit: str) -> tuple[WearPath, ...]:
        return self.paths.get(unit) or (WearPath(unit, (), ()),)

    def _last(self, units: Sequence[str]) -> Array:
        last = [np.append(0.0, self._paths(u)[-1].usage).max() for u in units]
        return np.array(last) / self.scale.usage

    def _known_reading(self, units: Sequence[str]) -> Array:
        """Variance of the next reading, NaN where it is estimated: a new reading is like the last
        ones.
        """
        default = next(iter(self.paths.values()))[-1].reading_u
        last = [self.paths[u][-1].reading_u if u in self.paths else default for u in units]
        return np.array([np.nan if u is None else (u / self.scale.value) ** 2 for u in last])

    def _places(self, units: Sequence[str]) -> Places:
        places = {unit: place for place, unit in enumerate(self.paths)}
        return np.array([places.get(unit, len(places)) for unit in units], int)

    @cached_property
    def _followed(self) -> tuple[Draws, FilterState]:
        """What was read of each unit says so much of it, and at the end of a new one, by draw."""
        steps = lay_out([*self.paths.values(), (WearPath("", (), ()),)], self.scale)
        draws = self.draws
        if self.simulated <= _PATHS_OF_MANY:
            # Draws stand kind by kind: every second one keeps their shares.
            draws = draws.take(np.arange(0, _DRAWS, 2))
        return draws, follow(steps, draws, likelihood=False)[1]


class _Streams:
    """Random numbers of arrays (draws, units, repeats), the same for each of several groups of
    units.
    """

    def __init__(self, seed: int, groups: int = 1) -> None:
        self._groups = groups
        self._stream = np.random.default_rng(seed)

    def normal(self, count: int, shape: tuple[int, int, int]) -> Array:
        draws, units, repeats = shape
        found = self._stream.standard_normal((count, draws, units // self._groups, repeats))
        return np.tile(found, (self._groups, 1))


@dataclass(frozen=True, slots=True)
class _Ends:
    """Level, drift and pace beyond the reach of paths at their last reading, each (draws, units,
    repeats).
    """

    draws: Draws
    level: Array
    drift: Array
    pace: Array

    @classmethod
    def drawn(cls, draws: Draws, state: FilterState, repeats: int, rng: _Streams) -> _Ends:
        """Sample levels and drifts jointly."""
        shape = (len(state.level), state.level.shape[1], repeats)
        level, drift, level_var, cov, drift_var = (
            getattr(state, name)[:, :, None]
            for name in ("level", "drift", "level_var", "both_cov", "drift_var")
        )
        sd = np.sqrt(np.maximum(level_var, 1e-30))
        one, two, three = rng.normal(3, shape)
        rest = np.sqrt(np.maximum(drift_var - (cov / sd) ** 2, 0.0))
        pace = np.maximum(1.0 + _DOUBT * three, _SLOWEST)
        drift = drift + cov / sd * one + rest * two
        return cls(draws, level + sd * one, drift, pace)

    def _column(self, name: str) -> Array:
        return np.asarray(getattr(self.draws, name))[:, :, None]

    def follow(
        self, usage: Array, last: Array, known: Array, rng: _Streams, *, reading: bool
    ) -> Iterator[Array]:
        """Simulate the paths on to ascending usages (units, m), one after the other (draws, units,
        repeats).
        """
        power = self._column("power")
        s = self._column("increment_sd")
        v = self._column("wander_sd")
        known = known[None, :, None]
        sd = np.where(np.isnan(known), self._column("reading_sd"), np.sqrt(known))
        start = clock(last[None, :, None], power)
        # The unit itself may have reached further than all that the population was learnt from.
        bend = clock(np.maximum(last, 1.0)[None, :, None], power)
        x = self.level
        b = self.drift
        before = np.zeros((1, 1, 1))
        for j in range(usage.shape[1]):
            at = clock(usage[None, :, j, None], power)
            beyond = np.maximum(at - bend, 0.0)
            now = np.minimum(at, bend) - start
            if beyond.any():
                now = now + self.pace * beyond
            d = now - before
            before = now
            span = np.abs(d)
            turn = v * np.sqrt(span)
            one, two = rng.normal(2, x.shape)
            sway = np.sqrt((turn * turn * span / 12.0 + s * s) * span)
            x = x + b * d + 0.5 * turn * span * one + sway * two
            b = b + turn * one
            yield x + sd * rng.normal(1, x.shape)[0] if reading else x


def first_passage(at: Array, paths: Array, limit: ArrayLike) -> Array:
    """Find where each simulated path first passes a limit; between two usages it is interpolated.

    Parameters
    ----------
    at : ndarray, shape (m,)
        Ascending usages. [usage]
    paths : ndarray, shape (..., m, n_samples)
        The wear of each path at these usages. [value]
    limit : array_like, shape (...)
        The limit. [value]

    Returns
    -------
    ndarray, shape (..., n_samples)
        Usage of each first passage, infinite beyond the last usage. [usage]
    """
    limits = np.asarray(limit, float)[..., None]
    over = paths > limits[..., None]
    k = np.argmax(over, axis=-2)
    before = np.maximum(k - 1, 0)
    high, low = (
        np.take_along_axis(paths, place[..., None, :], axis=-2)[..., 0, :] for place in (k, before)
    )
    with np.errstate(invalid="ignore"):
        rise = np.where(high > low, high - low, 1.0)
        share = np.where(np.isfinite(high), (limits - low) / rise, 1.0)
    passed = at[before] + share * (at[k] - at[before])
    passed = np.where(k == 0, 0.0, passed)
    return np.where(over.any(axis=-2), passed, np.inf)


def fit_wear(
    paths: Sequence[WearPath],
    *,
    seed: int = 0,
    progress: Callable[[int, int], None] = lambda _done, _total: None,
) -> WearModel:
    """Learn how a population of units wears, from readings of some of them.

    Each unit has a drift from the population's; increments are correlated along a path (Wiener or
    integrated Wiener) in proportion to usage or to a power of it, all averaged in the measure of
    their evidence; readings have errors, at least of the resolution that they show; a
    restoration starts a new path of the same unit. See ``filtering`` for the equations and
    ``posterior`` for the priors.

    Parameters
    ----------
    paths : sequence of WearPath
        Paths of all units; those of one unit in the order of time.
    seed : int
        Seed of the random numbers of the fit and of its forecasts.
    progress : callable
        Told how many kinds of wear were tried, and of how many. [1]

    Returns
    -------
    WearModel
        Forecasts for every unit and for new ones.

    Raises
    ------
    UsageError
        If nothing was read at all.
    """
    # Who goes on with a model that was learnt before needs no optimizer.
    from mlg_troubleshoot.wear.posterior import members, posterior

    if not any(len(np.asarray(path.usage)) for path in paths):
        raise UsageError("no path has a reading", "Give at least one reading of one unit.")
    by_unit = _by_unit(paths)
    rng = np.random.default_rng(seed)
    scale = scale_of(paths)
    readings = {unit: max(path.n_readings for path in own) for unit, own in by_unit.items()}
    learn: list[str] = []
    for most, pool in (
        (WearModel.learns_from, [u for u, n in readings.items() if n > 1]),
        (_LEARN_FROM_OTHERS, [u for u, n in readings.items() if n == 1]),
    ):
        learn += [pool[i] for i in sorted(rng.permutation(len(pool))[:most])]
    steps = lay_out([by_unit[unit] for unit in learn], scale)
    kinds = members(
        estimate_reading=any(path.reading_u is None for unit in learn for path in by_unit[unit]),
        restored=any(len(by_unit[unit]) > 1 for unit in learn),
    )
    # Matrices this small only wait for other threads.
    with threadpool_limits(1, "blas"):
        draws, shares = posterior(steps, scale, _DRAWS, rng, kinds, progress)
    simulated = _PATHS if len(by_unit) <= _MANY else _PATHS_OF_MANY
    return WearModel(by_unit, shares, scale, draws, seed, simulated)


def _by_unit(paths: Iterable[WearPath]) -> dict[str, tuple[WearPath, ...]]:
    """The paths of each unit, in their order."""
    found: dict[str, list[WearPath]] = {}
    for path in paths:
        found.setdefault(path.unit, []).append(path)
    return {unit: tuple(own) for unit, own in found.items()}
