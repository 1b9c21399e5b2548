"""What is believed before a measured value is looked at: one table of numbers, each with its
meaning.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from statistics import NormalDist

import numpy as np

from mlg_troubleshoot.arrays import Array


@dataclass(frozen=True, slots=True, kw_only=True)
class Beliefs:
    """What is believed beforehand, and from which probability on something is said.

    Parameters
    ----------
    expected : float
        Things wrong in a set of data on average; with ln 2 nothing is wrong in one of two. [1]
    unlisted : float
        Share of what goes wrong that no list has. [1]
    slips : float
        Entry errors in a table that the screening for data faults leaves. [1]
    slip_size : float
        How far such a row lies off, over the scatter of a row. [1]
    shape_size : float
        How large an effect is that no list has, where it acts, over the scatter of a row. [1]
    sizes : tuple of float
        Equally likely ratios of the size of an effect to its plausible size, shared by all causes.
        [1]
    form : float
        Error of a cause's form, as a share of its effect. [1]
    exact : float
        The same of a value that can only be one. [1]
    rarer : mapping of str to float
        How often a cause is what is wrong, over how often any other one is; as the cause states it
        (`often`) where it is not named. [1]
    plausible : mapping of str to float
        How large the parameter of a cause is where it acts, as one standard deviation; as the cause
        states it where it is not named. [unit of the parameter]
    surveyed : float
        The same of another linkage than the drawn one, where the drawn one was measured. [1]
    sure : float
        Probability from which something is said: of ten causes named at 0.9 nine are right. [1]
    alike : float
        Cosine from which two effects are one to these rows. [1]
    """

    expected: float = float(np.log(2.0))
    unlisted: float = 0.1
    slips: float = 0.5
    slip_size: float = 5.0
    shape_size: float = 1.2
    sizes: tuple[float, ...] = (1.0 / 3.0, 1.0, 3.0)
    form: float = 0.1
    exact: float = 0.1
    rarer: Mapping[str, float] = field(default_factory=dict)
    plausible: Mapping[str, float] = field(default_factory=dict)
    surveyed: float = 0.1
    sure: float = 0.9
    alike: float = 0.985

    @property
    def odds(self) -> float:
        """Logarithm of the odds from which something is said. [1]"""
        return float(np.log(self.sure / (1.0 - self.sure)))

    def slip_odds(self, distance: Array) -> Array:
        """Logarithm of the odds that each row of a table is an entry error rather than scatter.

        Parameters
        ----------
        distance : ndarray, shape (n,)
            How far out each row lies, over the scatter of a row; 0 if it is not far out. All that
            do may be errors, and as many as usual besides. [1]
        """
        wide = 1.0 + self.slip_size**2
        share = (self.slips + np.count_nonzero(distance)) / len(distance)
        square = np.asarray(distance) ** 2
        return np.asarray(np.log(share) - 0.5 * (np.log(wide) - square * (1.0 - 1.0 / wide)))

    def apart_from(self, lead: float = 0.0) -> float:
        """Distance of two explanations over the error of a row, from which data make either as sure
        as anything that is said with 80 % power, though the other leads by so much. [1]
        """
        return float(SHORT + np.sqrt(SHORT**2 + 2.0 * (self.odds + lead)))

    def further(self, distance: float, lead: float) -> float:
        """How many times the data are needed again for that, if two explanations that were fitted
        to them are so far apart: what is looked for is found too large, with 80 % power by less
        than a standard error's share. [1]
        """
        return float((self.apart_from(lead) / max(distance - SHORT, 1e-9)) ** 2)


# Standard errors by which an estimate falls short once in five: what is aimed at is seen with a
# power of four in five. [1]
SHORT = NormalDist().inv_cdf(4 / 5)
