"""Which joints explain a measured plunger displacement, in numbers and words."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mlg_troubleshoot.decision.assessment import ClearanceInterval, GroupChance, Posterior
from mlg_troubleshoot.decision.belief import Belief
from mlg_troubleshoot.decision.sentences import percent
from mlg_troubleshoot.decision.verdict_rule import CONFORMANCE

_ENDS = 1.0 - CONFORMANCE, 0.5, CONFORMANCE


def explain(belief: Belief) -> Posterior:
    """Find which joints explain the plunger's reading of one gear that failed."""
    gear = belief.gear
    every = [*gear.link_groups, gear.joint_numbers]
    places = [[gear.joint_numbers.index(n) for n in group] for group in every]
    # Nothing is surer than what drawn states allow.
    *chances, worn = np.clip(
        [belief.chance_of_any(each) for each in places], 1e-4, 1.0 - 1e-4
    ).tolist()
    groups = [GroupChance(*each) for each in zip(gear.link_groups, chances, strict=True)]
    groups.sort(key=lambda group: -group.probability)
    intervals = tuple(
        ClearanceInterval(number, low, median, high, worn)
        for number, (low, median, high), worn in zip(
            gear.joint_numbers,
            belief.clearances_in(_ENDS).tolist(),
            belief.worn.tolist(),
            strict=True,
        )
    )
    called = tuple(group.joints for group in groups if group.probability > 0.5)
    none = 1.0 - worn
    rigging = belief.chances[1]
    return Posterior(
        tuple(groups),
        none,
        rigging,
        intervals,
        called,
        _text(groups, none, rigging, looked=belief.looked),
    )


def _text(groups: Sequence[GroupChance], none: float, rigging: float, *, looked: bool) -> str:
    if rigging > 0.8 and looked:
        return (
            f"The joints are unlikely to be the cause ({percent(1.0 - rigging)}); rigging and lock"
            " roller were checked."
        )
    if rigging > 0.8:
        return (
            "Rigging or lock roller, not joint clearance, likely moved the plunger"
            f" ({percent(rigging)})."
        )
    likely = [group for group in groups[:2] if group.probability >= 1.0 - CONFORMANCE]
    # Another chance than those of the joints: both can be so at once.
    also = f"Chance that rigging or lock roller moved the plunger: {percent(rigging)}."
    if not likely:
        return f"Probably no joint is beyond its limit ({percent(none)}). {also}"
    ranked = ", then ".join(
        f"{' or '.join(f'#{n}' for n in group.joints)} ({percent(group.probability)})"
        for group in likely
    )
    return f"Most likely worn: {ranked}. {also}"
