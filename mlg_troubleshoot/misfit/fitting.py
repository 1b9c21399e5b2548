"""Columns fitted to data under a noise model, freely and with what is known of them beforehand; and
what a fit explains of held-out rows.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mlg_troubleshoot.arrays import Array, Wholes
from mlg_troubleshoot.misfit.covariance import NoiseModel


@dataclass(frozen=True)
class Fit:
    """Least-squares fit of some columns under the noise model.

    Attributes
    ----------
    values, errors : ndarray, shape (k,)
        Parameters, and their standard errors.
    log_likelihood : float
        Profiled over scale and scatter between tails. [1]
    tail_ratio : float
        Scatter between tails over scatter of a row. [1]
    scale : float
        Common standard deviation. [in]
    """

    values: Array
    errors: Array
    log_likelihood: float
    tail_ratio: float
    scale: float


def shrunk(
    noise: NoiseModel, free: Array, columns: Array, covariance: Array, data: Array
) -> tuple[Array, Array]:
    """Fit free columns, and columns whose values are known beforehand to a covariance: values, and
    their covariance.
    """
    both = np.hstack([free, columns])
    scale = noise.scale_in
    product, _log = noise.precision_times(np.column_stack([both, data]), noise.tail_ratios[-1])
    inner = both.T @ product[:, :-1] / scale**2
    k = free.shape[1]
    inner[k:, k:] += np.linalg.inv(covariance)
    inverse = np.linalg.pinv(inner)
    return inverse @ (both.T @ product[:, -1]) / scale**2, np.asarray(inverse, float)


def fit(noise: NoiseModel, columns: Array, data: Array) -> Fit:
    """Fit columns to one data set, scale and tail scatter included."""
    n = len(data) - noise.absorbed
    k = columns.shape[1]
    best: Fit | None = None
    every, determinants = noise.each_precision_times(np.column_stack([columns, data]))
    levels = zip(noise.tail_levels, every, determinants.tolist(), strict=True)
    for (ratio, chance), product, log_determinant in levels:
        inner = columns.T @ product[:, :k]
        inverse = np.linalg.pinv(inner)
        values = inverse @ (columns.T @ product[:, k])
        rest = float(noise.floored(data @ product[:, k] - values @ inner @ values))
        likelihood = chance - 0.5 * n * np.log(rest / n) - 0.5 * log_determinant
        if best is None or likelihood > best.log_likelihood:
            scale = np.sqrt(rest / max(n - k, 1))
            errors = scale * np.sqrt(np.maximum(np.diag(inverse), 0.0))
            best = Fit(values, errors, float(likelihood), ratio, float(scale))
    if best is None:
        raise ValueError("no tail ratio to try")
    return best


_FOLDS = 10
# Share of what a cause does that must remain in the rows it is learned from. [1]
_LEARNED = 0.1


def folds_of(
    row: Wholes, group: Wholes | None, columns: Array, shuffled: Wholes
) -> tuple[Wholes, str]:
    """Number the fold in which each reading is held out: whole groups, or rows where a cause acts
    in one group only.
    """
    if group is not None and group.max() > 0:
        numbers = np.argsort(np.argsort(shuffled[: group.max() + 1]))
        part = np.asarray(numbers % _FOLDS)[group[row]]
        square = columns**2
        least = _LEARNED * np.sum(square, axis=0)
        learnt = [np.sum(square[part != k], axis=0) for k in range(part.max() + 1)]
        if np.all(learnt >= least):
            return part, "group"
    return shuffled[row] % min(_FOLDS, len(shuffled)), "row"


def blocks_of(chain: Wholes, time: Array) -> Wholes:
    """Number the fold in which each row is held out with those that it follows: whole series where
    there are as many as folds, else as many stretches of all series together.
    """
    many = int(chain.max()) + 1
    if many >= _FOLDS:
        return chain % _FOLDS
    place = np.empty(len(chain), np.int64)
    place[np.lexsort((time, chain))] = np.arange(len(chain))
    return place * _FOLDS // len(chain)


def likelier(noise: NoiseModel, before: Array, after: Array, fold: Wholes) -> bool:
    """Tell whether the residual of held-out rows is likelier after than before, what a fold has in
    common being noise.

    Far readings decide no more than others: where noise is estimated they scatter more.
    """
    left = np.column_stack([before, after])
    ratio = noise.tail_ratios[-1]
    square = np.sum(
        [noise.take(fold == k).square(left[fold == k], ratio) for k in np.unique(fold)], axis=0
    )
    return bool(square[1] < square[0])


def held_out_part(
    noise: NoiseModel,
    columns: Array,
    data: Array,
    fold: Wholes,
    known: tuple[Array, Array] | None,
) -> Array:
    """What a model explains of each row that was fitted to the rows of the other folds alone. [in]

    known: further effects, shape (n, k), and the covariance of their sizes that is known
    beforehand.
    """
    explained = np.zeros(len(data))
    for k in np.unique(fold):
        train = fold != k
        test = fold == k
        used = np.any(columns[train] != 0.0, axis=0)
        held = columns[:, used]
        part = noise.take(train)
        if not train.any():
            continue
        if known is not None:
            values, _covariance = shrunk(part, held[train], known[0][train], known[1], data[train])
            explained[test] = np.hstack([held, known[0]])[test] @ values
        elif used.any():
            explained[test] = held[test] @ fit(part, held[train], data[train]).values
    return explained
