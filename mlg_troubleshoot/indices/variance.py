"""What a study looks at: clearances in, plunger displacement out.

Indices by an exact tensor of Gauss points: the reference that faster routes are held against.

With m Gauss points a variable, every conditional mean of Eqs. 1 and 2 is exact for polynomials of
degree 2m − 1 in each variable: no sampling, no seed, no interval.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from mlg_troubleshoot.arrays import Array, count_failed
from mlg_troubleshoot.errors import UsageError
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.gear.linkage import LinkageModel, worst_case

Response = Callable[[Array], Array]


@dataclass(frozen=True, slots=True)
class HeldDirections:
    """Plunger displacement when every virtual link keeps its direction.

    sense: +1 for over-travel, −1 for under-travel: the displacement in this sense is positive. [1]
    """

    model: LinkageModel
    directions: Array
    sense: float = 1.0
    compiled: bool = False

    def __call__(self, clearance_in: Array) -> Array:
        """Displacement for a batch of clearances.

        Returns, shape (n,): displacement in this sense; NaN where the linkage does not close. [in]
        """
        return self.by_rows(np.ascontiguousarray(clearance_in.T))

    def by_rows(self, clearance_in: Array) -> Array:
        """Displacement for a batch that is laid out one row per joint, as the kernel reads it.

        clearance_in, shape (n_joints, n): radial clearances. [in]
        Returns, shape (n,): displacement in this sense; NaN where the linkage does not close. [in]
        """
        model = self.model
        moved = model.kernel.batch(
            model.stroke[1], clearance_in, self.directions, compiled=self.compiled
        )
        moved -= model.mid
        moved *= self.sense * model.rate
        return moved


def worst_directions(model: LinkageModel, limits_in: Array) -> HeldDirections:
    """Worst directions found with every clearance at its limit, then held for all samples (section
    4.3).

    "We set the direction of the clearances so that the plunger would have the maximum number of
    failures." Differs from the paper: both senses are tried and the governing one is kept. Finding
    the directions anew for every sample changes no index of the shipped linkages by more than 5e-4.
    """
    worst = worst_case(model, limits_in[None, :])
    over = worst.over_in[0]
    under = -worst.under_in[0]
    # A sense in which the linkage does not close governs: its samples must be seen to fail.
    is_over = bool(np.isnan(over) or (over >= under))
    directions = (worst.over_directions if is_over else worst.under_directions)[0]
    return HeldDirections(model, directions, 1.0 if is_over else -1.0)


@dataclass(frozen=True, slots=True)
class Indices:
    """First- and total-order indices with 95 % intervals, as fractions of the variance.

    orders, half, shape (2, n): indices of Eqs. 1 and 2, and the half widths of their 95 %
    intervals. [1]
    mean, variance: moments of the response. [its unit, its unit squared]
    evaluations, failed: evaluations of the response, and those that gave no number: one makes the
    indices NaN.
    note: what the user should know about the route taken; empty if nothing.
    """

    design: str
    orders: Array
    half: Array
    mean: float
    variance: float
    evaluations: int
    failed: int
    note: str = ""


@dataclass(frozen=True, slots=True)
class GroupIndices:
    """Indices of both ends of one link taken as one joint.

    closed: what the group explains alone, interactions within it included. [1]
    total: what the group takes part in. [1]
    """

    joints: tuple[int, ...]
    closed: float
    total: float


def group_indices(
    gear: Gear, closed: Callable[[tuple[int, ...]], float]
) -> tuple[GroupIndices, ...]:
    """Indices of every link, from the share of the variance that joints at some places explain
    alone.
    """
    places = {number: i for i, number in enumerate(gear.joint_numbers)}
    found = []
    for group in gear.link_groups:
        others = tuple(i for number, i in places.items() if number not in group)
        alone = closed(tuple(places[n] for n in group))
        found.append(GroupIndices(group, alone, 1.0 - closed(others)))
    return tuple(found)


def student_half(scatter: Array, count: int) -> Array:
    """Half width of the 95 % interval of a mean of independent values.

    count: number of values, at least 2; else the result is NaN.
    """
    from scipy.special import stdtrit

    if count < 2:
        return np.full_like(scatter, np.nan)
    half: Array = float(stdtrit(count - 1, 0.975)) * scatter / np.sqrt(count)
    return half


# Gauss points per variable: the next ones change no index of a shipped gear by 2e-5. [1]
_ORDER = 3
# Nodes and weights of a two-point rule: the response at no clearance and at the limit. [1]
CORNERS = (np.arange(2, dtype=float), np.full(2, 0.5))
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
