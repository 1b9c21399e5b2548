"""What readings do when nothing is wrong: each its own scatter, scatter between groups; and the
smooth shapes in which they may differ from a simulation that no suspect makes wrong.

Such a discrepancy is not noise, but a cause must explain the data better than it does (Kennedy and
O'Hagan 2001).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mlg_troubleshoot.arrays import Array, Wholes, numbered
from mlg_troubleshoot.misfit.covariance import FAR, NoiseModel
from mlg_troubleshoot.misfit.design import basis_of
from mlg_troubleshoot.misfit.runner import least_squares

# What is tried of a size that nobody knows, over the usual one; of a suspect that does not state
# its own all are equally likely.
SIZES = tuple((3.0 ** np.arange(-1, 5)).tolist())
# Scatter between groups over that of a reading: its median beforehand, about which its logarithm
# has a standard deviation of one.
_GROUP_RATIO = 0.15
# Share of the variance of a reading that grows with the square of the prediction: what is tried.
_GROWING = tuple(1 - 1 / k for k in (2, 10, 100))
# Standard deviation of nuisance parameters, over the scatter of a reading: whatever they are.
_WIDE = 1e4
# Rows that stand for all in a smooth shape; lengths in units of the median distance of the rows.
_LANDMARKS = 60
_LENGTHS = 1 / 2 ** np.arange(2, -1, -1)
# Rows with fewer of which no shape is seen.
_LEAST_ROWS = 8
_ORDER = "order of the rows"
# Spare readings with all columns fitted, as a share, below which these say nothing of the noise.
_SPARE = 0.25


@dataclass(frozen=True)
class Readings:
    """Where readings stand: their outputs, groups, and declared standard uncertainty.

    floor: scatter that each has at least, as a number of limited digits. [unit of the readings]
    series: number of the series in which each row follows others, and when in usual steps; None
    where rows stand alone. predicted, shape (N,): the prediction, with which the scatter may grow.
    """

    row: Wholes
    outputs: Sequence[Wholes]
    group: Wholes | None
    declared: Array | None
    floor: float = 1e-300
    series: tuple[Wholes, Array] | None = None
    predicted: Array | None = None

    def noise(
        self, scale: Array, free: Array, correlation: float = 0.0
    ) -> tuple[NoiseModel, Array]:
        """Noise in the unit of each output's scatter, free columns absorbed, and these units."""
        unit = np.empty(len(scale))
        tails = np.zeros(len(scale), np.int64)
        chain = None if self.series is None else self.series[0][self.row] * len(self.outputs)
        for place, index in enumerate(self.outputs):
            unit[index] = np.median(scale[index])
            if chain is not None:
                chain[index] += place
            if self.group is not None:
                tails[index] = self.group[self.row[index]] * len(self.outputs) + place
        relative = scale / unit
        grouped = self.group is not None
        sizes = np.array(SIZES)
        chances = np.exp(-0.5 * np.log(sizes) ** 2)
        basis = basis_of(free / scale[:, None])
        noise = NoiseModel(
            relative=relative,
            tails=numbered(tails),
            gears=np.zeros(len(scale), np.int64),
            loadings=_WIDE * relative[:, None] * basis,
            floor_in=1e-9,
            gear_ratio=0.0,
            tail_ratios=tuple((_GROUP_RATIO * sizes).tolist()) if grouped else (0.0,),
            scale_in=1.0,
            absorbed=basis.shape[1],
            tail_chances=tuple((chances / chances.sum()).tolist()) if grouped else (),
            chain=chain,
            time=None if self.series is None else self.series[1][self.row],
            correlation=correlation,
        )
        return noise, unit

    def scale_of(self, left: Array, spare: float) -> Array:
        """Standard deviation of each reading by itself, from residuals of which a share is spare;
        far ones count less.
        """
        relative = self._grown(left) if self.declared is None else self.declared
        size = np.abs(left) / relative
        level = np.empty(len(left))
        for index in self.outputs if self.declared is None else [np.arange(len(left))]:
            own = size[index]
            spread = 1.4826 * float(np.median(own)) / np.sqrt(spare)
            near = np.minimum(own, FAR * spread) if spread > 0.0 else own
            level[index] = max(
                float(np.sqrt(np.mean(near**2) / spare)), self.floor / float(np.max(relative))
            )
        return relative * level * np.maximum(1.0, size / level / FAR)

    def _grown(self, left: Array) -> Array:
        """Relative scatter of each reading, of which a share grows with the prediction where second
        differences of residuals along it make that clearly likelier (Schwarz 1978).
        """
        relative = np.ones(len(left))
        if self.predicted is None:
            return relative
        for index in self.outputs:
            square = self.predicted[index] ** 2
            group = np.zeros(len(index)) if self.group is None else self.group[self.row[index]]
            order = np.lexsort((self.predicted[index], group))
            inside = group[order][2:] == group[order][:-2]
            bend = np.abs(np.diff(left[index][order], 2))[inside]
            if len(bend) == 0 or not (np.any(bend > 0.0) and np.any(square > 0.0)):
                continue
            square = square / float(np.mean(square))
            bend = np.minimum(bend, FAR * 1.4826 * float(np.median(bend)))
            along = square[order]
            weights = ((along[:-2] + 4.0 * along[1:-1] + along[2:]) / 6.0)[inside]
            least = _log_likelihood(bend, np.ones(len(bend))) + 0.5 * float(np.log(len(index)))
            for share in _GROWING:
                likely = _log_likelihood(bend, np.sqrt(1.0 - share + share * weights))
                if likely > least:
                    least, relative[index] = likely, np.sqrt(1.0 - share + share * square)
        return relative

    def first_scale(self, columns: Array, free: Array, data: Array) -> Array:
        """The same before anything is explained: from what all columns leave, or the free ones
        where rows are too few for all.
        """
        relative = np.ones(len(data)) if self.declared is None else self.declared
        spare = 1.0 - basis_of(columns / relative[:, None], 1e-4).shape[1] / len(data)
        if spare < _SPARE:
            columns = free
            spare = max(1.0 - basis_of(free / relative[:, None]).shape[1] / len(data), 1e-3)
        scale = relative
        for _ in range(6):
            values = least_squares(columns / scale[:, None], data / scale)
            left = data - columns @ values
            scale = self.scale_of(left, spare)
        return scale


def _log_likelihood(size: Array, relative: Array) -> float:
    """Log-likelihood of residuals whose scatter is known up to a common factor."""
    common = float(np.mean((size / relative) ** 2))
    return float(-np.sum(np.log(relative)) - 0.5 * len(size) * np.log(common))


@dataclass(frozen=True)
class Shape:
    """A way in which a discrepancy may move with the rows: with what, and factors of its
    covariance, shape (n, r).
    """

    moves_with: str
    factor: Array


def smooth_shapes(predicted: Array, sensitivities: Array, group: Wholes | None) -> list[Shape]:
    """Shapes in which a discrepancy may move with the rows.

    Near in prediction, near in all sensitivities, near in the order of the rows; the same in every
    group or not. What has few values only (a direction, a place) is not a quantity along which
    something could move smoothly.
    """
    n = len(predicted)
    if n < _LEAST_ROWS:
        return []
    features = {
        "prediction": predicted,
        "sensitivities": sensitivities,
        _ORDER: np.arange(n, dtype=float)[:, None],
    }
    shapes = []
    landmarks = np.unique(np.linspace(0, n - 1, min(n, _LANDMARKS)).astype(np.int64))
    for name, raw in features.items():
        clean = np.nan_to_num(raw, posinf=0.0, neginf=0.0)
        spread = np.ptp(clean, axis=0)
        varied = [
            k
            for k in np.flatnonzero(spread > 0.0)
            if len(np.unique(np.round(clean[:, k] / spread[k], 6))) > 5
        ]
        if not varied:
            continue
        varying = clean[:, varied]
        z = (varying - varying.mean(axis=0)) / varying.std(axis=0)
        apart = _distances(z, landmarks)
        middle = float(np.median(apart[apart > 0.0]))
        for length in _LENGTHS:
            alike = np.exp(-0.5 * (apart / (length * middle)) ** 2)
            shapes.append(Shape(name, _factor(alike, landmarks)))
            if group is not None and name != _ORDER:
                own = alike * (group[:, None] == group[None, landmarks])
                shapes.append(Shape(f"{name} of each group", _factor(own, landmarks)))
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
