"""What rows do when nothing is wrong: scatter of readings, scatter between tails, small bias and
slope.

Rows of one aircraft are not exchangeable, noise may grow with the displacement and have heavy
tails, and rounding and scatter of the clearances bias the mean and the slope a little. All of that
is part of the covariance; what stands out against it is an effect.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from statistics import NormalDist

import numpy as np
from numpy.typing import NDArray

from mlg_troubleshoot.arrays import Array, numbered, rms
from mlg_troubleshoot.diagnosis.table import DiagnosisTable
from mlg_troubleshoot.misfit.beliefs import Beliefs
from mlg_troubleshoot.misfit.columns import FAR, NoiseModel

# What is not a cause yet: set in 2026 on healthy fleets of the study's tuning seeds (iid, heavy
# tails, scatter between tails, confounded, growing noise) so that at most 2 % alarm; more of it
# costs power at S below 10. Not re-tuned.

# Pins scatter by up to some 6° about the worst direction, so a healthy fleet reads less than the
# bound by this share. [1]
EXPECTED_SLOPE = -0.0045
# Bias that the null model allows beyond that, one standard deviation: of the mean [in], and of the
# slope [1].
BIAS_IN = 0.0001
SLOPE = 0.003
# Wear, landings and misfits have heavier tails than a normal distribution: degrees of freedom of
# Student's t. [1]
FREEDOM = 8.0
# Doubt whether clearances were read as well as declared: standard deviation of the share of the
# declared error, and so of the drawing. [1]
SHARE_DOUBT = 0.35
# Scatter of a row is at least this share of the predictions' size: nothing is known better than
# that. [1]
LEAST_SCATTER = 0.01
# Trends over a quantity, and habits of a side or an approach, that are not a cause yet: standard
# deviation over the scatter of a row. [1]
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
# Ratios of the scatter between tails to the scatter of a row, nodes of a sum by that prior: as much
# as usual or less, and one to five spreads more.
TAIL_RATIOS = (0, *(USUAL_RATIO * np.exp(RATIO_SPREAD * np.arange(1, 6))).tolist())
_TAIL_CHANCES = tuple(np.exp(-(np.arange(len(TAIL_RATIOS)) ** 2) / 2).tolist())
# The first estimate of the scatter has all in it that effects of unknown size explain.
_ROUNDS = 2


@dataclass(frozen=True)
class Rows:
    """What is known of the rows before their misfit is looked at.

    Attributes
    ----------
    predicted_in : ndarray, shape (n,)
        Prediction. [in]
    tails, gears : ndarray of str, shape (n,)
        Tail and single gear of each row.
    u_filled_in : ndarray, shape (n,)
        Further standard deviation of each row by clearances that were not read. [in]
    u_shared_in : ndarray, shape (n,)
        The same, common to all rows of a gear. [in]
    unread_in : ndarray, shape (n, k)
        What joints that nobody read may add or take away in all rows together, each at one
        standard deviation. [in]
    drawn_in : ndarray, shape (n,)
        Prediction from the readings as they are, minus the prediction with all readings shrunk
        to their expectation. [in]
    trends : ndarray, shape (n, k)
        Shapes of trends and habits that are always present in some small measure. [1]
    readers : tuple of ndarray, shape (n, k) each
        Rows of each gauge, and of each technician. [1]
    own : ndarray, shape (n, k)
        Rows of each value of a column that only this table has. Their shifts are not counted as
        scatter between readers. [1]
    """

    predicted_in: Array
    tails: NDArray[np.str_]
    gears: NDArray[np.str_]
    u_filled_in: Array
    u_shared_in: Array
    unread_in: Array
    drawn_in: Array
    trends: Array
    readers: tuple[Array, ...]
    own: Array


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


def student(off: Array, spread: Array | float) -> Array:
    """Log-density of Student's t without its constant, 0 where there is nothing. [1]"""
    tails = 0.5 * (FREEDOM + 1.0) * np.log1p((off / spread) ** 2 / FREEDOM)
    return np.where(np.isnan(off), 0.0, -tails - np.log(spread))


def standardised(values: Array) -> Array | None:
    """Values less their mean, over their standard deviation; None if they do not vary. [1]"""
    known = values[np.isfinite(values)]
    least = 1e-12 * max(1.0, float(np.max(np.abs(known), initial=0.0)))
    if len(known) < 3 or np.std(known) <= least:
        return None
    z: Array = (values - np.mean(known)) / np.std(known)
    return z


def small_trends(table: DiagnosisTable) -> tuple[Array, tuple[Array, ...], Array]:
    """Trends and habits that are always there in some small measure: people, gauges, seasons,
    wear; rows of each reader, and of each value of the table's own columns.
    """
    trends = []
    for values in table.quantities.values():
        if (z := standardised(values)) is not None:
            trends += [np.nan_to_num(z), np.nan_to_num(z * z - 1.0) / np.sqrt(2.0)]
    habits = [_levels(table, name) for name in ("side", "approach")]
    readers = tuple(
        levels
        for name in ("gauge_id", "technician_id")
        if (levels := _levels(table, name)).shape[1] > 1
    )
    own = np.hstack([habits[0][:, :0], *(_levels(table, name) for name in table.own_factors)])
    return np.column_stack([*trends, *habits]), readers, own


def _levels(table: DiagnosisTable, name: str) -> Array:
    """Rows of each level of a factor, one column each. [1]"""
    texts = table.texts(name)
    levels = np.unique(texts)
    return np.asarray(texts[:, None] == levels[levels != ""], float)


def less_expected(misfit: Array, predicted_in: Array) -> Array:
    """Misfit less what pins scatter. [in]"""
    return misfit - EXPECTED_SLOPE * predicted_in


def build_noise(
    misfit: Array, rows: Rows, explained: Array | None = None, far: float = FAR
) -> NoiseModel:
    """Estimate V and σ of Eq. M2 from the misfit. Rows further out than `far` standard deviations
    scatter more than others.
    """
    rest = misfit if explained is None else misfit - explained
    noise = _scatter(rest, rest, rows, far)
    gears = numbered(rows.gears)
    for _ in range(_ROUNDS if rows.unread_in.any() else 0):
        alone = rest - noise.share_of(rows.unread_in, rest)
        alone -= noise.share_of_groups(rows.u_shared_in, gears, rest)
        noise = _scatter(rest, alone, rows, far)
    return noise


def _scatter(rest: Array, alone: Array, rows: Rows, far: float) -> NoiseModel:
    """Noise of the rows; `alone` is the residual without what unread joints most likely add to
    gears. [in]
    """
    predicted = rows.predicted_in
    numbers = numbered(rows.tails)
    centred = alone.copy()
    for tail in range(numbers.max() + 1):
        own = numbers == tail
        if own.sum() > 2:
            centred[own] -= np.median(alone[own])
    least = max(LEAST_SCATTER * rms(predicted), 1e-9)
    scale = max(robust_scale(centred), least)
    relative = growth(centred, predicted)
    scale = max(robust_scale(centred / relative), least)
    gears = numbered(rows.gears)
    relative = np.hypot(relative, rows.u_filled_in / scale)
    # Rows far out in the tails of the distribution count less, but never as nothing.
    far_out = np.maximum(1.0, np.abs(centred) / (scale * relative) / far)
    bias = [
        np.full(len(rest), BIAS_IN / scale),
        SLOPE * predicted / scale,
        SHARE_DOUBT * rows.drawn_in / scale,
    ]
    loadings = np.hstack([np.column_stack(bias), rows.unread_in / scale, HABIT * rows.trends])
    noise = NoiseModel(
        relative * far_out,
        numbers,
        gears,
        loadings,
        0.5 * least,
        USUAL_RATIO,
        TAIL_RATIOS,
        scale,
        tail_chances=_TAIL_CHANCES,
        of_gear=rows.u_shared_in / scale,
        far_out=far_out,
    )
    standard = rest / scale
    usual = [USUAL_RATIO * levels for levels in rows.readers]
    shifted = Beliefs().shape_size * rows.own
    each_own = []
    for place, levels in enumerate(rows.readers):
        others = usual[:place] + usual[place + 1 :]
        with_others = replace(noise, loadings=np.hstack([loadings, *others, shifted]))
        each_own.append(_ratio(with_others, levels, standard) * levels)
    loadings = np.hstack([loadings, *each_own])
    alike = replace(noise, loadings=loadings, gear_ratio=0.0)
    some = gears < _MOST_LEVELS
    marks = np.arange(_MOST_LEVELS)[: gears.max() + 1]
    each = (gears[some][:, None] == marks).astype(float)
    ratio = _ratio(alike.take(some), each, standard[some])
    return replace(noise, loadings=loadings, gear_ratio=ratio)


def _ratio(noise: NoiseModel, levels: Array, rest: Array) -> float:
    """Scatter between the levels of a factor over that of a row. [1]

    Restricted likelihood with the fleet's level and the one that stands out most left free, because
    that may be an effect; weighed with what is expected before the data are looked at (median, and
    spread of the logarithm), and enlarged by what the one that stands out most among as many
    carries on average.
    """
    count = levels.shape[1]
    if count < _LEAST_LEVELS:
        return USUAL_RATIO
    inner = noise.products(np.column_stack([np.ones(len(rest)), levels, rest]))
    square, score = _apart(inner[:-1, :-1], inner[:-1, -1], 0)
    most = int(np.argmax(score**2 / np.maximum(np.diag(square), 1e-9)))
    square, score = _apart(square, score, most)
    values, vectors = np.linalg.eigh(square)
    weight = np.maximum(values, 0.0) * _RATIOS[:, None] ** 2
    pull = (vectors.T @ score) ** 2 * _RATIOS[:, None] ** 2
    likelihood = 0.5 * np.sum(pull / (1.0 + weight) - np.log1p(weight), axis=1)
    likelihood -= 0.5 * (np.log(_RATIOS / USUAL_RATIO) / RATIO_SPREAD) ** 2
    chance = np.exp(likelihood - likelihood.max())
    largest = NormalDist().inv_cdf(1.0 - 0.25 / count) ** 2 / count
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
