"""Changes inside the geometric model, row by row: what an extension of the model amounts to."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from mlg_troubleshoot.arrays import Array, Places, central_slopes, central_steps
from mlg_troubleshoot.gear.directions import IN_CACHE, WorstCase, worst_case
from mlg_troubleshoot.gear.model import LinkageModel, links_from


@dataclass(frozen=True, slots=True)
class Adjustment:
    """What differs from the plain model for each of n gears.

    clearance_in, shape (n, n_joints): radial clearances that act. [in] changed, shape (n,): change
    of numbers of the linkage, added to the nominal ones, by name. [in, rad or 1] scaled, shape
    (n,): factors on numbers of the linkage, by name. [1] rate_factor, shape (n,): factor on the
    calibration rate. [1] offset_in, shape (n,): displacement that comes on top, whatever the
    clearances. [in] direction_factors, shape (n_joints,): share of each clearance that acts along
    its worst direction where loads rest
        the pin elsewhere, −1 to 1: the prediction is then the displacement as loaded, an
        expectation, not a bound. [1]
    """

    clearance_in: Array
    changed: Mapping[str, Array] = field(default_factory=dict)
    scaled: Mapping[str, Array] = field(default_factory=dict)
    rate_factor: Array | None = None
    offset_in: Array | None = None
    direction_factors: Array | None = None

    @property
    def acting_in(self) -> Array:
        """Clearances along their worst directions, negative where a pin rests on the other side.
        [in]
        """
        return (
            self.clearance_in
            if self.direction_factors is None
            else self.clearance_in * self.direction_factors
        )

    def numbers(self, model: LinkageModel) -> dict[str, Array]:
        """New values of the changed numbers of one linkage, by name, shape (n,). [in, rad or 1]"""
        nominal = model.kernel.numbers()
        return {
            name: (
                nominal[name] * np.asarray(self.scaled.get(name, 1.0))
                + np.asarray(self.changed.get(name, 0.0))
            )
            for name in dict.fromkeys((*self.changed, *self.scaled))
        }

    def take(self, rows: Places) -> Adjustment:
        return Adjustment(
            self.clearance_in[rows],
            {name: np.asarray(values)[rows] for name, values in self.changed.items()},
            {name: np.asarray(values)[rows] for name, values in self.scaled.items()},
            None if self.rate_factor is None else self.rate_factor[rows],
            None if self.offset_in is None else self.offset_in[rows],
            self.direction_factors,
        )


def adjusted_worst_case(model: LinkageModel, adjustment: Adjustment) -> WorstCase:
    """Worst displacement of each gear with its adjustment; with direction factors the one as
    loaded, twice.
    """
    plain = worst_case(model, adjustment.clearance_in, adjustment.numbers(model))
    over = plain.over_in
    under = plain.under_in
    if adjustment.direction_factors is not None:
        links = links_from(adjustment.acting_in, plain.over_directions)
        over = under = model.displacement(links, adjustment.numbers(model))
    if adjustment.rate_factor is not None:
        over = over * adjustment.rate_factor
        under = under * adjustment.rate_factor
    if adjustment.offset_in is not None:
        over = over + adjustment.offset_in
        under = under + adjustment.offset_in
    return WorstCase(over, under, plain.over_directions, plain.under_directions)


def adjusted_slopes(model: LinkageModel, adjustment: Adjustment, worst: WorstCase) -> Array:
    """Amplification of each clearance to the plunger at the clearances that act, directions held,
    shape (n, n_joints): central differences. [1]
    """
    clearance = adjustment.clearance_in
    joints = adjustment.clearance_in.shape[1]
    directions = worst.governing_directions
    changed = adjustment.numbers(model)
    steps = central_steps(joints)[:, None, :]
    factors = 1.0 if adjustment.direction_factors is None else adjustment.direction_factors
    slopes = np.empty_like(clearance)
    at_once = max(IN_CACHE // len(steps), 1)
    for start in range(0, len(clearance), at_once):
        rows = slice(start, start + at_once)
        links = links_from((clearance[rows] + steps) * factors, directions[rows])
        numbers = {name: each[rows] for name, each in changed.items()}
        slopes[rows] = central_slopes(model.displacement(links, numbers)).T
    rate = 1.0 if adjustment.rate_factor is None else adjustment.rate_factor[:, None]
    return rate * slopes
