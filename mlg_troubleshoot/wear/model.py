"""Fit wear of many units at once, and forecast it: by simulation over the posterior draws.

Wear read at irregular usages, and the same readings laid out for filtering many units at
once.

What readings say of the level and the drift of each unit, for many posterior draws and many
units at once.

Level x and drift b of a path run over a clock c = usage^q:

    x(c + d) = x(c) + b d + s W(d)         Wiener increments
    b(c + d) = b(c) + v W(d)               integrated Wiener: the drift itself wanders

Paths begin at x ~ N(start, start_sd²) with b = unit's drift + N(0, (1 - kept) drift_sd²), and the
unit's drift is N(drift, kept drift_sd²), so that a restored part keeps a share of its own pace. A
reading is x + N(0, r²). Both are filtered exactly (Kalman).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike
from threadpoolctl import threadpool_limits

from mlg_troubleshoot.arrays import Array, Mask, Places, frozen
from mlg_troubleshoot.errors import UsageError
from mlg_troubleshoot.results import Result

# Decimals beyond which a difference between two readings is taken for rounding in the computer. [1]
_DECIMALS = 9
# Readings lie on a grid if it has at least this many readings to a step of their range, and not by
# chance. [1]
_MOST_STEPS = 2000
# Newest readings of a unit that it is followed by, and units read twice or more that are learnt
# from, at most: more would narrow nothing. [1]
_FOLLOWED = 160
# Share of the parts whose values fall from which on wear is taken to fall. [1]
_FALLING = 0.75


@dataclass(frozen=True, slots=True, repr=False, eq=False)
class WearPath(Result):
    """Readings of one part between two restorations.

    Parameters
    ----------
    unit : str
        The part. Paths of one unit stand in the order of time; a restoration begins a new one.
    usage : array_like of shape (n,)
        Usage at each reading, counted from the restoration, ascending; empty for a part restored
        and not read since. [usage]
    value : array_like of shape (n,)
        Wear as read. [value]
    reading_u : float or None
        Standard uncertainty of a reading; None lets it be estimated. [value]
    """

    unit: str
    usage: ArrayLike
    value: ArrayLike
    reading_u: float | None = None

    @property
    def n_readings(self) -> int:
        """Number of readings; 0 for a part restored and not read since."""
        return len(np.asarray(self.usage))

    def __post_init__(self) -> None:
        usage = frozen(self.usage).ravel()
        value = frozen(self.value).ravel()
        if len(usage) != len(value):
            raise UsageError(
                f"path of {self.unit}: {len(usage)} usages and {len(value)} values",
                "Give one value per usage.",
            )
        if not (np.isfinite(usage).all() and np.isfinite(value).all()):
            raise UsageError(
                f"path of {self.unit}: a usage or a value is not a finite number", "Leave it out."
            )
        if (usage < 0.0).any() or (usage[1:] < usage[:-1]).any():
            raise UsageError(
                f"path of {self.unit}: usage must ascend from 0, not"
                f" {', '.join(f'{u:g}' for u in usage[:8])}",
                "Count the usage from the last restoration and begin a new path there.",
            )
        if self.reading_u is not None and not (
            np.isfinite(self.reading_u) and self.reading_u >= 0.0
        ):
            raise UsageError(
                f"path of {self.unit}: reading_u is {self.reading_u:g}",
                "Give zero or more, or None.",
            )
        object.__setattr__(self, "usage", usage)
        object.__setattr__(self, "value", value)


@dataclass(frozen=True, slots=True)
class Scale:
    """What one usage and one value are in the numbers that the filters see: about 1 over all that
    was read.
    """

    usage: float
    value: float
    start: float
    resolution: float


@dataclass(frozen=True)
class Steps:
    """Readings of many units side by side, arrays of shape (steps, units): in each step a unit is
    read once at most.

    ``begins`` marks the first step of a path, ``seen`` a reading; ``known_r2`` is NaN where it is
    to be estimated.
    """

    begins: Mask
    seen: Mask
    usage: Array
    value: Array
    known_r2: Array

    @cached_property
    def alike(self) -> tuple[Places, Places]:
        """The first of the units that were read alike, and which of these stands for each unit."""
        known = np.nan_to_num(self.known_r2, nan=-1.0)
        when = np.concatenate([self.begins, self.seen, self.usage, known])
        _when, first, owner = np.unique(when, axis=1, return_index=True, return_inverse=True)
        return first, owner.ravel()


def grid_step(values: Array) -> float:
    """Step of the grid that all readings lie on, 0 without one."""
    unique = np.unique(np.round(values, _DECIMALS))
    if len(unique) < 3:
        return 0.0
    # The greatest common divisor of all differences, up to rounding.
    whole = np.round(np.diff(unique) * 10.0**_DECIMALS).astype(np.int64)
    step = float(np.gcd.reduce(whole)) / 10.0**_DECIMALS
    return step if (unique[-1] - unique[0]) / step <= _MOST_STEPS else 0.0


def scale_of(paths: Sequence[WearPath]) -> Scale:
    """Find the scales of usage and value, the common start, and which way the wear goes (the sign
    of the value).
    """
    known_paths = (path for path in paths if path.n_readings)
    read = [(np.asarray(path.usage), np.asarray(path.value)) for path in known_paths]
    values = [value for _usage, value in read]
    everything = np.concatenate([*values, np.empty(0)])
    reach = max((float(usage[-1]) for usage, _value in read), default=0.0) or 1.0
    first = [value[0] for _usage, value in read]
    start = float(np.median(first)) if first else 0.0
    changes = [(usage[-1] - usage[0], value[-1] - value[0]) for usage, value in read]
    rates = np.array([rise / run for run, rise in changes if run > 0.0])
    rise = float(np.median(rates)) * reach if len(rates) else 0.0
    if not rise and read:
        rise = float(np.std(everything))
    known = [path.reading_u for path in paths if path.reading_u]
    least = 2.0 * float(np.median(known)) if known else 0.0
    if len(rates):
        least = max(least, 1e-3 * float(np.ptp(everything)))
    size = max(abs(rise), least) or max(abs(start), 1.0)
    # Wear grows unless most parts say otherwise.
    falls = len(rates) > 0 and float(np.mean(rates < 0.0)) >= _FALLING
    return Scale(reach, -size if falls else size, start, grid_step(everything))


def lay_out(groups: Sequence[Sequence[WearPath]], scale: Scale) -> Steps:
    """Lay the newest readings of each unit behind each other; shorter units are padded in front, so
    that all end together.
    """
    lengths = [sum(max(path.n_readings, 1) for path in group) for group in groups]
    shape = (max(lengths, default=0), len(groups))
    steps = Steps(
        begins=np.zeros(shape, bool),
        seen=np.zeros(shape, bool),
        usage=np.zeros(shape),
        value=np.zeros(shape),
        known_r2=np.full(shape, np.nan),
    )
    for column, (group, length) in enumerate(zip(groups, lengths, strict=True)):
        row = shape[0] - length
        for path in group:
            count = path.n_readings
            steps.begins[row, column] = True
            rows = slice(row, row + count)
            steps.seen[rows, column] = True
            steps.usage[rows, column] = np.asarray(path.usage) / scale.usage
            steps.value[rows, column] = (np.asarray(path.value) - scale.start) / scale.value
            if path.reading_u is not None:
                steps.known_r2[rows, column] = (path.reading_u / scale.value) ** 2
            row += max(count, 1)
    newest = Steps(*(getattr(steps, each.name)[-_FOLLOWED:] for each in fields(Steps)))
    newest.begins[:1] |= np.array(lengths) > _FOLLOWED
    return newest


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

    learns_from: ClassVar[int] = _FOLLOWED

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
