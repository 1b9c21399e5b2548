"""What rows do when nothing is wrong: scatter of readings, scatter between tails, small bias and
slope.

Rows of one aircraft are not exchangeable, noise may grow with the displacement and have heavy
tails, and rounding and scatter of the clearances bias the mean and the slope a little. All of that
is part of the covariance; what stands out against it is an effect.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtri

from mlg_troubleshoot.arrays import Array, Wholes
from mlg_troubleshoot.diagnosis.table import DiagnosisTable
from mlg_troubleshoot.misfit.covariance import FAR, NoiseModel

# What is not a cause yet: set in 2026 on healthy fleets of the study's tuning seeds (iid, heavy
# tails, scatter between tails, confounded, growing noise) so that at most 2 % alarm; more of it
# costs power at S below 10. Not re-tuned.

# Pins scatter by up to some 6° about the worst direction, so a healthy fleet reads less than the
# bound by this share. [1]
EXPECTED_SLOPE = -0.0045
# Bias that the null model allows beyond that, one standard deviation: of the mean [in], and of the
# slope [1]; twice that where clearances are read no better than the plunger.
BIAS_IN = 0.0001
SLOPE = 0.003
# Doubt whether clearances were read as well as declared: standard deviation of the share of the
# declared error, and so of the drawing. [1]
SHARE_DOUBT = 0.35
# Scatter of a row is at least this share of the predictions' size: nothing is known better than
# that. [1]
LEAST_SCATTER = 0.01
# What the errors of reading leave in the level of wear of each gear, in units of the scatter of a
# row.
READ_GEAR_RATIO = 0.28
# Trends over a quantity, and habits of a side or an approach, that are not a cause yet, in the same
# units; twice that likewise.
HABIT = 0.035
# Scatter between the gears of a tail, between gauges, and between technicians, over that of a row,
# before the data are looked at: median, and spread of its logarithm; and the ratios that are tried,
# from three spreads below it to four above.
USUAL_RATIO = 0.1
RATIO_SPREAD = 0.6
_RATIOS = USUAL_RATIO * np.exp(RATIO_SPREAD * np.linspace(-3, 4, 24))
# Fewer levels do not determine it; of more the first are enough.
_LEAST_LEVELS = 4
_MOST_LEVELS = 400
# Ratios of the scatter between tails to the scatter of a row that are tried, nodes of a sum: none,
# and from one spread above the usual ratio on.
TAIL_RATIOS = (0, *(USUAL_RATIO * np.exp(RATIO_SPREAD * np.arange(1, 6))).tolist())
# The first estimate of the scatter has all in it that effects of unknown size explain.
_ROUNDS = 2
# With fewer tails none of them can be left out.
_LEAST_TAILS = 6


@dataclass(frozen=True)
class Rows:
    """What is known of the rows before their misfit is looked at.

    predicted_in, shape (n,): prediction. [in] tails, gears, shape (n,): tail and single gear of
    each row. u_filled_in, u_shared_in, shape (n,): further standard deviation of a row by
    clearances that were not read: its own,
        and common to its gear's rows. [in]
    unread_in, shape (n, k): what joints that nobody read may add or lack in all rows together, each
    at one standard
        deviation. [in]
    along_in, shape (n, k): what is not known of rows along the stroke, and of digits that may be
    cut off, each at one standard deviation. [in]
    u_read_in: standard deviation by the reading of clearances. [in]
    u_measured_in: standard deviation of a row's measured displacement by the plunger gauge alone, 0
    if unknown. [in]
    drawn_in, shape (n,): by how much the prediction from the readings as they are lies above the
    one with all of them drawn to their expectation. [in]
    trends, habits, shape (n, k): shapes of trends and habits that are always there in some small
    measure. [1] readers, shape (n, k): rows of each gauge, and of each technician. [1]
    """

    predicted_in: Array
    tails: NDArray[np.str_]
    gears: NDArray[np.str_]
    u_filled_in: Array
    u_shared_in: Array
    unread_in: Array
    along_in: Array
    u_read_in: float
    u_measured_in: float
    drawn_in: Array
    trends: Array
    habits: Array
    readers: tuple[Array, ...]


def estimate_repeatability(table: DiagnosisTable) -> tuple[float, str]:
    """Estimate how well one reading repeats."""
    readings = table.readings_in
    counts = np.isfinite(readings).sum(axis=1)
    degrees = int(np.sum(counts[counts > 1] - 1))
    if degrees >= 5:
        repeated = readings[counts > 1]
        centred = repeated - np.nanmean(repeated, axis=1, keepdims=True)
        return float(np.sqrt(np.nansum(centred**2) / degrees)), "repeat readings"
    if table.plunger_gauge_u_in is not None:
        return float(np.nanmedian(table.plunger_gauge_u_in)), "declared"
    return float("nan"), "unknown"


def measured_uncertainty(table: DiagnosisTable) -> float:
    """Standard deviation of a row's mean reading by the plunger gauge alone."""
    repeatability, _source = estimate_repeatability(table)
    if not np.isfinite(repeatability):
        return 0.0
    count = np.maximum(np.isfinite(table.readings_in).sum(axis=1), 1)
    return float(repeatability * np.sqrt(np.mean(1.0 / count)))


def robust_scale(values: Array) -> float:
    """Standard deviation from the median absolute deviation."""
    return float(1.4826 * np.median(np.abs(values - np.median(values))))


def tail_numbers(tails: Sequence[str] | NDArray[np.str_]) -> Wholes:
    """Number the tails in order of their names."""
    return np.unique(np.asarray(tails), return_inverse=True)[1].astype(np.int64)


def small_trends(table: DiagnosisTable) -> tuple[Array, Array, tuple[Array, ...]]:
    """Trends and habits that are always there in some small measure: people, gauges, seasons,
    wear.
    """
    trends = []
    for values in table.quantities.values():
        known = np.isfinite(values)
        if known.sum() > 2 and np.std(values[known]) > 0.0:
            z = (values - np.mean(values[known])) / np.std(values[known])
            trends.append(np.where(known, z, 0.0))
            trends.append(np.where(known, z * z - 1.0, 0.0) / np.sqrt(2.0))
    empty = np.empty((len(table), 0))
    habits = np.hstack([empty, *(_levels(table, name) for name in ("side", "approach"))])
    readers = tuple(
        levels
        for name in ("gauge_id", "technician_id")
        if (levels := _levels(table, name)).shape[1] > 1
    )
    return np.column_stack(trends) if trends else empty, habits, readers


def _levels(table: DiagnosisTable, name: str) -> Array:
    """Rows of each level of a factor, one column each. [1]"""
    texts = table.factors.get(name)
    if texts is None:
        return np.empty((len(table), 0))
    levels = np.unique(texts)
    return np.asarray(texts[:, None] == levels[levels != ""], float)


def build_noise(
    misfit: Array, rows: Rows, explained: Array | None = None, effects_in: Array | None = None
) -> NoiseModel:
    """Estimate the noise from the misfit; effects of unknown size, and of the curve, are not
    scatter but its doubt.
    """
    rest = misfit if explained is None else misfit - explained
    wide = rows.along_in if effects_in is None else np.hstack([rows.along_in, effects_in])
    noise = _scatter(rest, rest, rows)
    gears = tail_numbers(rows.gears)
    unread = rows.unread_in if rows.unread_in.any() else np.empty((len(rest), 0))
    for _ in range(_ROUNDS if wide.size + unread.size else 0):
        known = noise.with_effects(wide)
        left = rest - known.share_of(wide, rest)
        alone = left - known.share_of(unread, rest)
        if unread.size:
            alone = alone - known.share_of_groups(rows.u_shared_in, gears, rest)
        noise = _scatter(left, alone, rows)
    return noise.with_effects(wide) if wide.size else noise


def _scatter(rest: Array, alone: Array, rows: Rows) -> NoiseModel:
    """Noise of the rows; `alone` is the residual without what unread joints most likely add to
    gears. [in]
    """
    predicted = rows.predicted_in
    numbers = tail_numbers(rows.tails)
    centred = alone.copy()
    for tail in range(numbers.max() + 1):
        own = numbers == tail
        if own.sum() > 2:
            centred[own] -= np.median(alone[own])
    least = max(LEAST_SCATTER * float(np.sqrt(np.mean(predicted**2))), 1e-9)
    scale = max(robust_scale(centred), least)
    relative = growth(centred, predicted)
    scale = max(robust_scale(centred / relative), least)
    gears = tail_numbers(rows.gears)
    shared, own = _shared(rows.u_shared_in / scale, gears)
    relative = np.sqrt(relative**2 + (rows.u_filled_in / scale) ** 2 + own**2)
    # Rows far out in the tails of the distribution count less, but never as nothing.
    standard = np.minimum(np.abs(centred), _companion(alone, numbers)) / (scale * relative)
    relative = relative * np.maximum(1.0, standard / FAR)
    # Clearances cannot scatter more than the misfit does beyond the plunger gauge.
    room = np.sqrt(max(scale**2 - rows.u_measured_in**2, 0.0))
    read = min(rows.u_read_in, room) / scale
    small = 1.0 + read
    bias = [
        np.full(len(rest), small * BIAS_IN / scale),
        small * SLOPE * predicted / scale,
        SHARE_DOUBT * rows.drawn_in / scale,
    ]
    trends = small * HABIT * rows.trends
    habits = small * HABIT * rows.habits
    gear_ratio = float(np.hypot(USUAL_RATIO, read * READ_GEAR_RATIO))
    ratios = _tail_ratios(rest / (scale * relative), numbers, gear_ratio)
    loadings = np.hstack([np.column_stack(bias), rows.unread_in / scale, trends, habits])
    noise = NoiseModel(
        relative,
        numbers,
        gears,
        loadings,
        0.5 * least,
        gear_ratio,
        ratios,
        scale,
        of_gear=shared if shared.any() else None,
    )
    standard = rest / scale
    each_own = [USUAL_RATIO] * len(rows.readers)
    for place, levels in enumerate(rows.readers):
        others = [USUAL_RATIO * other for k, other in enumerate(rows.readers) if k != place]
        with_others = replace(noise, loadings=np.hstack([loadings, *others]))
        each_own[place] = _ratio(with_others, levels, standard, USUAL_RATIO, RATIO_SPREAD)
    loadings = np.hstack(
        [loadings, *(ratio * levels for ratio, levels in zip(each_own, rows.readers, strict=True))]
    )
    alike = replace(noise, loadings=loadings, gear_ratio=0.0)
    some = gears < _MOST_LEVELS
    each = (gears[some][:, None] == np.arange(min(gears.max() + 1, _MOST_LEVELS))).astype(float)
    ratio = _ratio(alike.take(some), each, standard[some], gear_ratio, RATIO_SPREAD)
    return replace(noise, loadings=loadings, gear_ratio=ratio)


def _shared(relative: Array, gears: Wholes) -> tuple[Array, Array]:
    """Scatter that the rows of a gear have in common because its unread joints make all of them
    wrong alike, and, where that is small, each row's own. [1]
    """
    largest = np.zeros(gears.max() + 1)
    np.maximum.at(largest, gears, relative)
    alike = largest[gears] > USUAL_RATIO
    return np.where(alike, relative, 0.0), np.where(alike, 0.0, relative)


def _ratio(noise: NoiseModel, levels: Array, rest: Array, expected: float, spread: float) -> float:
    """Scatter between the levels of a factor over that of a row. [1]

    Restricted likelihood with the fleet's level and the one that stands out most left free, because
    that may be an effect; weighed with what is expected before the data are looked at (median, and
    spread of the logarithm), and enlarged by what the one that stands out most among as many
    carries on average.
    """
    count = levels.shape[1]
    if count < _LEAST_LEVELS:
        return expected
    held = np.column_stack([np.ones(len(rest)), levels])
    product, _log = noise.precision_times(np.column_stack([held, rest]), noise.tail_ratios[-1])
    inner = held.T @ product[:, :-1]
    along = held.T @ product[:, -1]
    square, score = _apart(inner, along, 0)
    most = int(np.argmax(score**2 / np.maximum(np.diag(square), 1e-9)))
    square, score = _apart(square, score, most)
    values, vectors = np.linalg.eigh(square)
    weight = np.maximum(values, 0.0) * _RATIOS[:, None] ** 2
    pull = (vectors.T @ score) ** 2 * _RATIOS[:, None] ** 2
    likelihood = 0.5 * np.sum(pull / (1.0 + weight) - np.log1p(weight), axis=1)
    likelihood -= 0.5 * (np.log(_RATIOS / expected) / spread) ** 2
    chance = np.exp(likelihood - likelihood.max())
    largest = float(ndtri(1.0 - 0.25 / count)) ** 2 / count
    return float(np.sqrt(chance @ _RATIOS**2 / chance.sum() / (1.0 - largest)))


def _apart(inner: Array, along: Array, free: int) -> tuple[Array, Array]:
    """Products of columns with each other and with the data, one of the columns left free and taken
    out.
    """
    kept = np.delete(np.arange(len(along)), free)
    share = inner[kept, free] / max(float(inner[free, free]), 1e-9)
    return (
        inner[np.ix_(kept, kept)] - np.outer(share, inner[free, kept]),
        along[kept] - share * along[free],
    )


def _tail_ratios(standard: Array, tails: Wholes, gear_ratio: float) -> tuple[float, ...]:
    """Scatter between tails that is likely, over that of a row: from none to its estimate. [1]

    By moments, about the fleet's level, without the tail that stands out most, which may be an
    effect, and enlarged by what the largest of as many normal tails carries on average.
    """
    count = np.bincount(tails).astype(float)
    if len(count) < _LEAST_TAILS:
        return TAIL_RATIOS
    mean = np.bincount(tails, standard) / count
    chance = 1.0 / count + 0.5 * gear_ratio**2
    level = float(np.median(mean))
    square = (mean - level) ** 2
    kept = np.ones(len(count), bool)
    kept[np.argmax(square / (chance + np.median(square)))] = False
    largest = float(ndtri(1.0 - 0.25 / len(count))) ** 2 / len(count)
    between = float(np.mean(square[kept])) / (1.0 - largest)
    most = float(np.sqrt(max(between - float(np.mean(chance[kept])), 0.0)))
    return (*(ratio for ratio in TAIL_RATIOS if ratio < most), most) if most > 0.0 else (0.0,)


def _companion(values: Array, tails: Wholes) -> Array:
    """Distance of each row to the nearest other row of its tail: rows that stand out together are
    not outliers. [in]
    """
    nearest = np.full(len(values), np.inf)
    for tail in range(tails.max() + 1):
        rows = np.flatnonzero(tails == tail)
        if len(rows) > 1:
            apart = np.abs(values[rows][:, None] - values[rows])
            np.fill_diagonal(apart, np.inf)
            nearest[rows] = apart.min(axis=1)
    return nearest


def growth(centred: Array, predicted: Array) -> Array:
    """Relative standard deviation of each row where noise grows with displacement, median 1."""
    size = np.abs(centred)
    size = np.minimum(size, 4.0 * np.median(size) + 1e-12)
    at = np.abs(predicted)
    if np.ptp(at) <= 1e-9 * np.max(at):
        return np.ones(len(at))
    slope, level = np.polyfit(at, size, 1)
    fitted = np.maximum(level + slope * at, 0.3 * np.median(size) + 1e-12)
    # A slope within its own error is not growth.
    error = np.std(size - level - slope * at) / (np.std(at) * np.sqrt(len(at)))
    if slope < 1.0 * error:
        return np.ones(len(at))
    return np.asarray(fitted / np.median(fitted))
