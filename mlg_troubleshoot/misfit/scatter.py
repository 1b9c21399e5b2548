"""What readings do when nothing is wrong: each its own scatter, scatter between groups, and smooth
discrepancy.

Smooth discrepancy is what a simulation gets wrong without any suspect being the reason; it is not
noise, but a cause must stand out against it, not only against what a repeat reading scatters
(Kennedy and O'Hagan 2001).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mlg_troubleshoot.arrays import Array, Wholes
from mlg_troubleshoot.misfit.runner import least_squares

# Readings further out than this many standard deviations count less.
_FAR = 3.0
# Scatter between groups over that of a reading: median and spread of the logarithm before the data
# are looked at, and what is tried.
GROUP_RATIO, _GROUP_SPREAD = 0.15, 1.0
_GROUP_RATIOS = np.geomspace(0.02, 6.0, 12)
# Size of a smooth discrepancy over the scatter of a reading that is tried.
_SMOOTH_RATIOS = (0.3, 0.6, 1.2, 2.5, 5.0, 10.0, 20.0)
# Rows that stand for all in a smooth shape; lengths in units of the median distance of the rows.
_LANDMARKS = 60
_LENGTHS = (0.25, 0.5, 1.0)


@dataclass(frozen=True)
class Whitener:
    """Makes readings equal and independent: V^(−1/2), V the covariance of a diagonal and few common
    shapes.

    Scale of each reading by itself; of each output its readings, orthonormal shapes, and how much
    each is shortened.
    """

    scale: Array
    parts: Sequence[tuple[Wholes, Array, Array]]
    log_determinant: float

    def __call__(self, columns: Array) -> Array:
        """Whiten columns of readings."""
        white = (columns.T / self.scale).T
        for index, shapes, shorter in self.parts:
            white[index] -= shapes @ (shorter * (shapes.T @ white[index]).T).T
        return np.asarray(white)


def build_whitener(
    scale: Array, outputs: Sequence[Wholes], row: Wholes, factor: Array | None
) -> Whitener:
    """Build a whitener from each reading's own scatter and the rows' common factors in units of
    it.
    """
    log_determinant = 2.0 * float(np.sum(np.log(scale)))
    if factor is None or not factor.shape[1]:
        return Whitener(scale, (), log_determinant)
    parts = []
    for index in outputs:
        # What is common to rows is so in the unit of the readings, however much a single one of
        # them scatters.
        own = factor[row[index]] * (np.median(scale[index]) / scale[index])[:, None]
        square, vectors = np.linalg.eigh(own.T @ own)
        kept = square > 1e-12 * square[-1]
        square, vectors = square[kept], vectors[:, kept]
        log_determinant += float(np.sum(np.log1p(square)))
        parts.append((index, own @ (vectors / np.sqrt(square)), 1.0 - 1.0 / np.sqrt(1.0 + square)))
    return Whitener(scale, parts, log_determinant)


def restricted_likelihood(white: Whitener, columns: Array, data: Array) -> float:
    """Restricted log-likelihood of a covariance, its common scale profiled out. [1]"""
    shaped, rest = white(columns), white(data)
    values, vectors = np.linalg.eigh(shaped.T @ shaped)
    kept = (
        values > 1e-10 * values[-1]
        if len(values) and values[-1] > 0.0
        else np.zeros(len(values), bool)
    )
    along = (vectors[:, kept] / np.sqrt(values[kept])).T @ (shaped.T @ rest)
    square = max(float(rest @ rest - along @ along), 1e-300)
    degrees = max(len(data) - len(along), 1)
    return float(
        -0.5 * (degrees * np.log(square) + white.log_determinant + np.sum(np.log(values[kept])))
    )


def basis_of(columns: Array, tolerance: float = 1e-7) -> Array:
    """Orthonormal basis of what some columns of equal worth span."""
    size = np.linalg.norm(columns, axis=0)
    if not np.any(size > 0.0):
        return np.empty((len(columns), 0))
    left, values, _right = np.linalg.svd(
        columns[:, size > 0.0] / size[size > 0.0], full_matrices=False
    )
    return np.asarray(left[:, values > tolerance * values[0]])


def robust_scale(
    columns: Array, data: Array, declared: Array | None, outputs: Sequence[Wholes]
) -> Array:
    """Standard deviation of each reading by itself, what all columns explain taken out; far ones
    count less.
    """
    relative = np.ones(len(data)) if declared is None else declared.copy()
    level = np.ones(len(data))
    scaled, rest = (columns.T / relative).T, data / relative
    weight = np.ones(len(data))
    for _ in range(6):
        root = np.sqrt(weight) / level
        values = least_squares((scaled.T * root).T, rest * root)
        left = rest - scaled @ values
        spare = (
            max(
                1.0 - np.linalg.matrix_rank(scaled, tol=1e-7 * np.linalg.norm(scaled)) / len(data),
                0.05,
            )
            if scaled.size
            else 1.0
        )
        pooled = declared is not None
        for index in [np.arange(len(data))] if pooled else outputs:
            size = np.abs(left[index])
            spread = 1.4826 * float(np.median(size)) / np.sqrt(spare)
            near = np.minimum(size, _FAR * spread) if spread > 0.0 else size
            level[index] = max(
                float(np.sqrt(np.mean(near**2) / spare)),
                1e-12 * float(np.max(np.abs(data))),
                1e-300,
            )
        weight = np.minimum(1.0, 2.0 / np.maximum(np.abs(left) / level, 1e-12))
    return np.asarray(relative * level * np.maximum(1.0, np.abs(left) / level / _FAR))


@dataclass(frozen=True)
class GroupRatios:
    """Scatter between groups over that of a reading, with the chance of each. [1]"""

    chance: Array

    @property
    def mean(self) -> float:
        """Root of the mean square of what is likely. [1]"""
        return float(np.sqrt(self.chance @ _GROUP_RATIOS**2))

    def beyond(self, count: int, rng: np.random.Generator) -> Array:
        """Draw how much scatter there may be beyond the mean. [1]"""
        drawn = rng.choice(_GROUP_RATIOS, count, p=self.chance)
        return np.sqrt(np.maximum(drawn**2 - self.mean**2, 0.0))


def group_ratios(
    scale: Array, outputs: Sequence[Wholes], row: Wholes, group: Wholes, columns: Array, data: Array
) -> GroupRatios:
    """Judge the scatter between groups: restricted likelihood times what is expected of it."""
    indicator = (group[:, None] == np.arange(group.max() + 1)).astype(float)
    likely = np.array(
        [
            restricted_likelihood(
                build_whitener(scale, outputs, row, ratio * indicator), columns, data
            )
            - 0.5 * (np.log(ratio / GROUP_RATIO) / _GROUP_SPREAD) ** 2
            for ratio in _GROUP_RATIOS
        ]
    )
    chance = np.exp(likely - likely.max())
    return GroupRatios(chance / chance.sum())


def smooth_shapes(predicted: Array, sensitivities: Array, group: Wholes | None) -> list[Array]:
    """Shapes in which a discrepancy may move with the rows, each as factors of a covariance, shape
    (n, r).

    Near in prediction, near in all sensitivities, near in the order of the rows; the same in every
    group or not. What has few values only (a direction, a place) is not a quantity along which
    something could move smoothly.
    """
    n = len(predicted)
    features = [predicted, sensitivities, np.arange(n, dtype=float)[:, None]]
    shapes = []
    landmarks = np.unique(np.linspace(0, n - 1, min(n, _LANDMARKS)).astype(np.int64))
    for place, raw in enumerate(features):
        clean = np.nan_to_num(raw, posinf=0.0, neginf=0.0)
        spread = np.ptp(clean, axis=0)
        varied = [
            k
            for k in np.flatnonzero(spread > 0.0)
            if len(np.unique(np.round(clean[:, k] / spread[k], 6))) > 5
        ]
        if not varied:
            continue
        z = (clean[:, varied] - clean[:, varied].mean(axis=0)) / clean[:, varied].std(axis=0)
        apart = _distances(z, landmarks)
        middle = float(np.median(apart[apart > 0.0]))
        for length in _LENGTHS:
            alike = np.exp(-0.5 * (apart / (length * middle)) ** 2)
            kinds = [alike]
            if group is not None and place < 2:
                kinds.append(alike * (group[:, None] == group[None, landmarks]))
            shapes += [_factor(kind, landmarks) for kind in kinds]
    return shapes


def _distances(z: Array, landmarks: Wholes) -> Array:
    square = np.sum(z**2, axis=1)
    return np.asarray(
        np.sqrt(np.maximum(square[:, None] + square[landmarks] - 2.0 * z @ z[landmarks].T, 0.0))
    )


def _factor(alike: Array, landmarks: Wholes) -> Array:
    """L with L Lᵀ near the covariance of which some columns are given (Nyström)."""
    values, vectors = np.linalg.eigh(alike[landmarks])
    kept = values > 1e-6 * values[-1]
    return np.asarray(alike @ (vectors[:, kept] / np.sqrt(values[kept])))


def smooth_factor(
    scale: Array,
    outputs: Sequence[Wholes],
    row: Wholes,
    fixed: Array,
    shapes: Sequence[Array],
    columns: Array,
    data: Array,
) -> Array:
    """Most likely smooth discrepancy, as factors of a covariance in units of the scatter of a
    reading.
    """
    sized = [ratio * shape for shape in shapes for ratio in _SMOOTH_RATIOS]
    likely = [
        restricted_likelihood(
            build_whitener(scale, outputs, row, np.hstack([fixed, factor])), columns, data
        )
        for factor in sized
    ]
    return sized[int(np.argmax(likely))]
