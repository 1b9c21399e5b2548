"""What a study varies and what it looks at: clearances by their distribution in, plunger
displacement out.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from mlg_troubleshoot.arrays import Array, frozen
from mlg_troubleshoot.errors import UsageError
from mlg_troubleshoot.gear.directions import worst_case, worst_of_sense
from mlg_troubleshoot.gear.model import LinkageModel

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


def worst_sense(model: LinkageModel, limits_in: Array, sense: float) -> HeldDirections:
    """Worst directions of one sense at the limits, then held."""
    _, directions = worst_of_sense(model, limits_in[None, :], sense)
    return HeldDirections(model, directions[0], sense)


def _half_normal(u: Array) -> Array:
    """Quantiles of a half-normal distribution cut at its 2.5 σ, scaled to 1."""
    from scipy.special import erf, erfinv

    cut = 2.5 / np.sqrt(2.0)
    quantiles: Array = erfinv(u * erf(cut)) / cut
    return quantiles


_QUANTILES: dict[str, Callable[[Array], Array]] = {
    "uniform": lambda u: u,
    "falling": lambda u: 1 - np.sqrt(1 - u),
    "rising": np.sqrt,
    "half-normal": _half_normal,
}
DISTRIBUTIONS = tuple(_QUANTILES)


@dataclass(frozen=True, slots=True)
class Inputs:
    """Independent clearances on [0, limit], all of one kind of distribution.

    limits_in, shape (n_joints,): upper ends. [in] distribution: uniform (the paper's), falling or
    rising (triangular, most likely at 0 or at the limit), half-
      normal.
    Raises `UsageError` if the distribution is unknown or a limit is not a positive number.
    """

    limits_in: Array
    distribution: str = "uniform"

    def __post_init__(self) -> None:
        if self.distribution not in DISTRIBUTIONS:
            raise UsageError(
                f"distribution {self.distribution!r} is not known",
                f"Give one of {', '.join(DISTRIBUTIONS)}.",
            )
        limits = np.array(self.limits_in, float)
        if limits.ndim != 1 or not np.all(np.isfinite(limits) & (limits > 0.0)):
            raise UsageError(f"limits {limits.tolist()} in", "Every limit is a positive length.")
        object.__setattr__(self, "limits_in", frozen(limits))

    def at(self, unit: Array) -> Array:
        """Clearances at probabilities, points of the unit cube, shape (n, n_joints). [in]"""
        return _QUANTILES[self.distribution](unit) * self.limits_in

    def on_unit_cube(self, response: Response) -> Response:
        return lambda unit: response(self.at(unit))
