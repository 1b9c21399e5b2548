"""Columns fitted to data under a noise model: freely, and with what is known of them beforehand."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mlg_troubleshoot.arrays import Array
from mlg_troubleshoot.misfit.covariance import NoiseModel


@dataclass(frozen=True)
class Fit:
    """Least-squares fit of some columns under the noise model.

    values, shape (k,): parameters. errors, shape (k,): their standard errors. log_likelihood:
    profiled over scale and tail scatter. [1] tail_ratio, scale: scatter between tails over scatter
    of a row [1], common standard deviation [in].
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
    for ratio, chance in noise.tail_levels:
        product, log_determinant = noise.precision_times(np.column_stack([columns, data]), ratio)
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
