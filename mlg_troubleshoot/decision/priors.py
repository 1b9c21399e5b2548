"""What is assumed of gears before anything is read: one table of numbers, each with its meaning. No
fleet of this gear is public, so that all of it is assumed.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from mlg_troubleshoot.misfit.beliefs import Beliefs


@dataclass(frozen=True, kw_only=True)
class Priors:
    """What is assumed of wear, gauges and failures.

    Attributes
    ----------
    joints_for_one_misrigged, joints_for_one_elsewhere : float
        Of the gears that failed, how many did so through the joints for each that was mis-rigged,
        and for each that failed through something that leaves the plunger within its margin. [1]
    offset : float
        How far a wrong rigging moves the plunger: evenly, up to about so many margins. [1]
    overlooked : float
        Chance that somebody overlooks what is wrong: a rigging that was looked at, or a joint over
        its limit at the work that left the rigging wrong. [1]
    loaded : float
        Chance that loads hold all pins near their worst directions. [1]
    scatter_deg : float
        Standard deviation of their angles then. [deg]
    linkage_u_in : float
        Standard deviation of what the linkage of this gear adds to a sum of random directions. [in]
    levels : tuple of float
        Least and largest level of wear, in units of the limit. [1]
    alike : float
        Chance that the joints of one gear have their level in common: as likely as not. [1]
    worn_out : tuple of float
        Chance that a joint is worn out for a reason of its own, to between its limit and twice its
        limit, at the least and at the largest level. Of prior wear that differs in scale and shape
        from gear to gear (six kinds, drawn by other code), it left the least surprise (log loss)
        about the cause and about unread joints. [1]
    gauge_scale : float
        Standard deviation of the scale of a gauge, in addition to its stated uncertainty. [1]
    wrong_readings : float
        Readings of one gear that are the total play where the radial clearance is stated, on
        average: as many as things that are wrong in any set of data. [1]
    """

    joints_for_one_misrigged: float = 3.0
    joints_for_one_elsewhere: float = 3.0
    offset: float = 2.0
    overlooked: float = 0.03
    loaded: float = 0.02
    scatter_deg: float = 20.0
    linkage_u_in: float = 0.0015
    levels: tuple[float, float] = (0.06, 1.2)
    alike: float = 0.5
    worn_out: tuple[float, float] = (0.05, 0.12)
    gauge_scale: float = 0.1
    wrong_readings: float = Beliefs().expected

    @cached_property
    def cosine(self) -> tuple[float, float]:
        """Mean and standard deviation of the cosine of the angle of a loaded pin. [1]"""
        variance = np.radians(self.scatter_deg) ** 2
        squared = float(np.exp(-variance))
        return float(np.sqrt(squared)), (1.0 - squared) / float(np.sqrt(2.0))


@dataclass(frozen=True, kw_only=True)
class Thresholds:
    """Numbers of the rule for NEXT that are not part of the model.

    Attributes
    ----------
    one_repair : float
        So many times the chance of a second repair that a shop accepts over all, one repair may
        have for one more joint: most repairs have far less. [1]
    sent_away : float
        Second repairs that a failure of the joints costs which is sent elsewhere. [1]
    surely_worn : float
        Shares of its limit beyond which a joint is worn whatever its gauge. [1]
    doubtful : float
        Standard uncertainties within which a reading is too near to its limit or margin. [1]
    movable, together : int
        Joints whose sets are weighed, and joints that are read in one round, at most: what a batch
        has time for. [1]
    """

    one_repair: float = 4.0
    sent_away: float = 2.0
    surely_worn: float = 1.5
    doubtful: float = 2.0
    movable: int = 7
    together: int = 4


# Typical readings, well within a limit or a margin and beyond it, as shares of it. [1]
WELL_WITHIN, BEYOND = 0.4, 1.4
PRIORS = Priors()
THRESHOLDS = Thresholds()
