"""How the decision writes a probability."""

from __future__ import annotations


def percent(share: float) -> str:
    """Write a probability as a percentage that is never rounded to a 0 or a 100 that it is not.

    Parameters
    ----------
    share : float
        Probability. [1]

    Returns
    -------
    str
        ``0 %``, ``< 0.1 %``, ``2.5 %``, ``25 %``, ``97.5 %``, ``> 99.9 %``, ``100 %``.
    """
    if 0.0 < share < 0.001:
        return "< 0.1 %"
    if 0.999 < share < 1.0:
        return "> 99.9 %"
    near_an_end = 0.0 < share < 0.1 or 0.9 < share < 1.0
    return f"{100.0 * share:.{1 if near_an_end else 0}f} %"
