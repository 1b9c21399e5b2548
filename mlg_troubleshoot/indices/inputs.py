"""What a study looks at: clearances in, plunger displacement out."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from mlg_troubleshoot.arrays import Array
from mlg_troubleshoot.gear.directions import worst_case
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
