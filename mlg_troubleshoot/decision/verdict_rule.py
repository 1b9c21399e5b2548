"""The verdict under measurement uncertainty (after JCGM 106 and ISO 14253-1, conformance
probability 95 %).
"""

from __future__ import annotations

from mlg_troubleshoot.decision.assessment import Verdict

# Conformance probability of a verdict (JCGM 106). [1]
CONFORMANCE = 0.95


def zone(probability: float) -> Verdict:
    """Classify a probability of being within the margin."""
    if probability <= 1.0 - CONFORMANCE:
        return Verdict.OUTSIDE_MARGIN
    return Verdict.WITHIN_MARGIN if probability >= CONFORMANCE else Verdict.INCONCLUSIVE


def verdict(p_lower: float, p_upper: float, *, critical_missing: bool) -> Verdict:
    """Apply the rule; the first match wins."""
    lower, upper = zone(p_lower), zone(p_upper)
    if lower is Verdict.OUTSIDE_MARGIN:
        return Verdict.OUTSIDE_MARGIN
    if critical_missing or lower is not upper:
        return Verdict.INCOMPLETE
    return lower
