"""Indices by an exact tensor of Gauss points: the reference that faster routes are held against.

With m Gauss points a variable, every conditional mean of Eqs. 1 and 2 is exact for polynomials of
degree 2m − 1 in each variable: no sampling, no seed, no interval.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mlg_troubleshoot.arrays import Array, count_failed
from mlg_troubleshoot.errors import UsageError
from mlg_troubleshoot.indices.inputs import Response

# Gauss points per variable: the next ones change no index of a shipped gear by 2e-5. [1]
_ORDER = 3
# Nodes and weights of a two-point rule: the response at no clearance and at the limit. [1]
CORNERS = (np.array([0, 1], float), np.array([0.5, 0.5]))
# Points of a tensor at most, and those evaluated at once. [1]
_MOST_POINTS = 2_000_000
_ROWS = 1 << 16


@dataclass(frozen=True, slots=True)
class TensorIndices:
    """First- and total-order indices from a tensor of points.

    evaluations, failed: number of points, and of those that gave no number; one failure makes all
    indices NaN.
    """

    first_order: Array
    total_order: Array
    mean: float
    variance: float
    evaluations: int
    failed: int
    values: Array
    weights: Array

    def closed(self, group: tuple[int, ...]) -> float:
        """Share of the variance that a group of variables explains alone, interactions within it
        included.
        """
        partial = _averaged(self.values, self.weights, set(group))
        return float(_variance(partial, self.weights) / self.variance)


def order_for(n: int) -> int:
    """Gauss points per variable: two where a tensor of three has too many points."""
    return _ORDER if _ORDER**n <= _MOST_POINTS else 2


def tensor_indices(
    response: Response, limits: Array, order: int = _ORDER, nodes: tuple[Array, Array] | None = None
) -> TensorIndices:
    """Compute indices of a response to independent uniform variables on [0, limit].

    nodes, shape (m,): other points in [0, 1] and their weights, for example the ends of the range.
    Raises `UsageError` if the tensor would have more than two million points.
    """
    n = len(limits)
    if nodes is None:
        points, weights = np.polynomial.legendre.leggauss(order)
        points = (points + 1.0) / 2.0
        weights = weights / 2.0
    else:
        points, weights = nodes
    m = len(points)
    if m**n > _MOST_POINTS:
        raise UsageError(
            f"a tensor of {m} points in {n} variables has {m**n} points, more than {_MOST_POINTS}",
            "Use fewer joints or one of the paper's designs.",
        )
    values = np.empty(m**n)
    for start in range(0, m**n, _ROWS):
        flat = np.arange(start, min(start + _ROWS, m**n))
        places = np.unravel_index(flat, (m,) * n)
        nodes_at = points[np.stack(places, axis=-1)]
        values[flat] = response(nodes_at * limits)
    tensor = values.reshape((m,) * n)
    mean = float(_averaged(tensor, weights, set()))
    tensor = tensor - mean
    variance = float(_variance(tensor, weights))
    variables = set(range(n))

    def explained(group: set[int]) -> float:
        return float(_variance(_averaged(tensor, weights, group), weights)) / variance

    first = [explained({i}) for i in variables]
    others = [explained(variables - {i}) for i in variables]
    return TensorIndices(
        np.array(first),
        1.0 - np.array(others),
        mean,
        variance,
        m**n,
        count_failed(values),
        tensor,
        np.asarray(weights),
    )


def _averaged(tensor: Array, weights: Array, keep: set[int]) -> Array:
    """Average over every axis that is not kept."""
    for axis in reversed(range(tensor.ndim)):
        if axis not in keep:
            tensor = np.tensordot(tensor, weights, axes=(axis, 0))
    return tensor


def _variance(tensor: Array, weights: Array) -> float:
    mean = float(_averaged(tensor, weights, set()))
    return float(_averaged((tensor - mean) ** 2, weights, set()))
