"""Changes inside the geometric model, row by row: what an extension of the model amounts to."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from mlg_troubleshoot.gear.directions import WorstCase, worst_case
from mlg_troubleshoot.gear.model import LinkageModel

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Adjustment:
    """What differs from the plain model for each of n gears.

    Parameters
    ----------
    clearance_in : ndarray, shape (n, n_joints)
        Radial clearances that act. [in]
    changed : mapping of str to ndarray of shape (n,)
        Change of numbers of the linkage, added to the nominal ones, by name. [in, rad or 1]
    scaled : mapping of str to ndarray of shape (n,)
        Factors on numbers of the linkage, by name. [1]
    rate_factor : ndarray, shape (n,)
        Factor on the calibration rate. [1]
    offset_in : ndarray, shape (n,)
        Displacement that comes on top, whatever the clearances. [in]
    """

    clearance_in: Array
    changed: Mapping[str, Array] = field(default_factory=dict)
    scaled: Mapping[str, Array] = field(default_factory=dict)
    rate_factor: Array | None = None
    offset_in: Array | None = None

    def numbers(self, model: LinkageModel) -> dict[str, Array]:
        """Return the changed numbers of one linkage.

        Parameters
        ----------
        model : LinkageModel
            The linkage.

        Returns
        -------
        dict of str to ndarray of shape (n,)
            New values by name. [in, rad or 1]
        """
        nominal = dict(zip(model.kernel.parameter_names, model.kernel.parameters.tolist(), strict=True))
        names = [*self.changed, *(name for name in self.scaled if name not in self.changed)]
        return {
            name: nominal[name] * np.asarray(self.scaled.get(name, 1.0)) + np.asarray(self.changed.get(name, 0.0))
            for name in names
        }


def adjusted_worst_case(model: LinkageModel, adjustment: Adjustment) -> WorstCase:
    """Worst displacement of each gear with its adjustment.

    Parameters
    ----------
    model : LinkageModel
        The calibrated linkage.
    adjustment : Adjustment
        The clearances that act and what else differs.

    Returns
    -------
    WorstCase
        Displacements, rate and offset included, and directions. [in]
    """
    plain = worst_case(model, adjustment.clearance_in, adjustment.numbers(model))
    over, under = plain.over_in, plain.under_in
    if adjustment.rate_factor is not None:
        over, under = over * adjustment.rate_factor, under * adjustment.rate_factor
    if adjustment.offset_in is not None:
        over, under = over + adjustment.offset_in, under + adjustment.offset_in
    return WorstCase(over, under, plain.over_directions, plain.under_directions)
