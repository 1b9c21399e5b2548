"""What measured data say about a model."""

from __future__ import annotations

from enum import StrEnum

import numpy as np


class MisfitVerdict(StrEnum):
    """What measured data say about a simulation."""

    NONE = "NONE"
    NAMED = "NAMED"
    AMBIGUOUS = "AMBIGUOUS"
    UNLISTED = "UNLISTED"


# p-value below which something is wrong (alarm), below which a cause is named, and below which the
# residual is not noise: set in 2026 on the tuning seeds of the study of hidden effects (at most 2 %
# of healthy fleets alarm) and on five simulated rigs. A lower bar names more at S = 5 to 7 and
# names more wrongly; a higher one leaves more sets undecided.
ALARM, NAME, REMAINS = 0.012, 0.002, 0.002


def refutes(p: float, size: float = np.inf, slip: float = 0.0) -> bool:
    """Tell whether the residual refutes what is named: it is not noise, and larger than an error in
    a cause's form.
    """
    return p <= REMAINS and size >= slip


def verdict_of(p: float, rivals: bool, refuted: bool) -> MisfitVerdict:
    """What follows from the p-value, from rivals of what is named, and from the residual.

    A name needs clearer evidence than an alarm does.
    """
    if refuted:
        return MisfitVerdict.UNLISTED
    if p > ALARM:
        return MisfitVerdict.NONE
    return MisfitVerdict.AMBIGUOUS if rivals or p > NAME else MisfitVerdict.NAMED
