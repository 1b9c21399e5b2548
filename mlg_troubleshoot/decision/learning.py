"""What inspections of a fleet teach of its next gear: how far gears are worn, and whether loads
hold their pins near their worst directions.

Wear is learned from readings of joints, as chances of its levels; the share of gears whose pins are
held from gears with all joints and the plunger read, by how much likelier the plunger's reading is
then. Before any gear is known, the share is either small or large: a beta distribution that weighs
as much as one gear, its mean what `priors` assumes.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.special import betaincinv

from mlg_troubleshoot.decision.belief import LEVELS, SHARES, WEAR, believed, given_readings
from mlg_troubleshoot.decision.inspection import Fleet, Inspection
from mlg_troubleshoot.decision.prediction import Cases
from mlg_troubleshoot.decision.priors import PRIORS
from mlg_troubleshoot.decision.sentences import percent
from mlg_troubleshoot.gear.gear import Gear

# Quantiles of the share of gears whose pins are held, and rounds in which shares of levels settle.
_QUANTILES = (np.arange(2000) + 0.5) / 2000
_ROUNDS = 50


def learned(gear: Gear, inspections: Sequence[Inspection]) -> Fleet:
    """Learn from the last inspections of some gears.

    Parameters
    ----------
    gear : Gear
        The linkage of all of them.
    inspections : sequence of Inspection
        One of each gear, as it stood when it was read.

    Returns
    -------
    Fleet
        What to expect of another gear.
    """
    known = Cases.of(gear, inspections)
    read = known.measured.any(axis=1)
    fits = given_readings(known)[0][read] / LEVELS
    levels = LEVELS
    for _ in range(_ROUNDS):
        each = fits * levels
        each /= each.sum(axis=1, keepdims=True)
        levels = (len(LEVELS) * LEVELS + each.sum(axis=0)) / (len(LEVELS) + len(fits))
    whole = np.flatnonzero(known.measured.all(axis=1) & np.isfinite(known.plunger_in))
    share = betaincinv(PRIORS.loaded, 1.0 - PRIORS.loaded, _QUANTILES)
    likely = np.zeros(len(share))
    if len(whole):
        ratio = np.array([each.held[place] for each, place in believed(known, whole.tolist())])
        likely = np.log1p(share[:, None] * (ratio - 1.0)).sum(axis=1)
    weight = np.exp(likely - likely.max())
    loaded = float(np.sum(share * weight) / np.sum(weight))
    text = (
        f"Expected from {len(fits)} gears kept: an unread joint is worn to"
        f" {percent(float(levels @ WEAR @ SHARES))} of its limit on average; the chance that loads"
        f" hold the pins near their worst directions is {percent(loaded)}"
    )
    return Fleet(loaded, tuple(levels.tolist()), text)
