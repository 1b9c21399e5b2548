"""What other gears of a fleet say of one before anything is read on it: how far they are worn, and
whether loads hold their pins near their worst directions.
"""

from __future__ import annotations

from dataclasses import dataclass

from mlg_troubleshoot.decision.priors import PRIORS


@dataclass(frozen=True, slots=True)
class Fleet:
    """What is expected of a gear before anything is read on it.

    Parameters
    ----------
    loaded : float
        Chance that loads hold its pins near their worst directions. [1]
    levels : tuple of float
        Chances of the levels of wear of `belief`; empty if each is as likely. [1]
    text : str
        What was learned and from how many gears, in words; empty if nothing was.
    """

    loaded: float = PRIORS.loaded
    levels: tuple[float, ...] = ()
    text: str = ""
