"""Which joints explain a measured plunger displacement: importance sampling over wear, clearances
and directions.

Wear before the plunger is read, and the chance that rigging moved it, are those of the plan
(`causes`). Measured joints have their reading with its uncertainty. Every clearance takes a
uniformly random direction.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mlg_troubleshoot.arrays import Array, Mask
from mlg_troubleshoot.decision.assessment import ClearanceInterval, GroupChance, Posterior
from mlg_troubleshoot.decision.case import Cases
from mlg_troubleshoot.decision.causes import Causes, believed
from mlg_troubleshoot.decision.prediction import model_uncertainty
from mlg_troubleshoot.decision.second_order import responses
from mlg_troubleshoot.decision.sentences import percent
from mlg_troubleshoot.decision.wear_levels import BEYOND, DENSITIES, SHARE, SHARES, level_chances
from mlg_troubleshoot.gear.gear import Gear

_QUANTILES = (0.05, 0.5, 0.95)
# Below this chance no joint is named as likely worn. [1]
_WORTH_SAYING = 0.05
# Standard deviation of what a wrong rigging adds, in units of the gear's margin. [1]
_OFFSET_U = 2.0
# A worn joint is drawn at least this often, and weighed accordingly. [1]
_DRAWN_WORN = 0.1


def explain(
    one: Cases, rng: np.random.Generator, draws: int = 32768, causes: Causes | None = None
) -> Posterior | None:
    gear, reading = one.gear, float(one.mean_in[0])
    if not np.isfinite(reading):
        return None
    drawn, log_weight = _draw_clearances(one, rng, draws)
    turns = rng.uniform(0.0, 2.0 * np.pi, drawn.shape)
    links = np.empty((draws, 2 * drawn.shape[1]))
    links[:, 0::2], links[:, 1::2] = drawn * np.cos(turns), drawn * np.sin(turns)
    predicted = responses(gear)[0].displacement(links)
    u = np.hypot(model_uncertainty(predicted, one.residual_u_in), one.mean_u_in[0])
    wide = np.hypot(u, _OFFSET_U * gear.margin.value)
    plain = log_weight - np.log(u) - 0.5 * ((reading - predicted) / u) ** 2
    other = log_weight - np.log(wide) - 0.5 * ((reading - predicted) / wide) ** 2
    by_joints, by_rigging = (np.exp(each - each.max()) for each in (plain, other))
    rigging = float((causes or believed(one)).rigging[0])
    weight = (1.0 - rigging) * by_joints / by_joints.sum() + rigging * by_rigging / by_rigging.sum()
    worn = drawn > gear.limits_in
    return _summary(gear, drawn, worn, weight, rigging)


def _draw_clearances(one: Cases, rng: np.random.Generator, n: int) -> tuple[Array, Array]:
    """Clearances, and the log of prior over proposal: worn joints are drawn more often than they
    occur. [in, 1]
    """
    found, limits = one.clearance_in[0], one.gear.limits_in
    level = rng.choice(len(DENSITIES), n, p=level_chances(one)[0])
    chance = BEYOND.sum(axis=1)[level]
    often = np.maximum(chance, _DRAWN_WORN)
    drawn, log_weight = np.empty((n, len(found))), np.zeros(n)
    for j in range(len(found)):
        if np.isfinite(found[j]):
            drawn[:, j] = _reading_with_error(float(found[j]), float(one.gauge_u_in[0, j]), rng, n)
            continue
        is_worn = rng.random(n) < often
        log_weight += np.where(is_worn, np.log(chance / often), np.log((1 - chance) / (1 - often)))
        for k in range(len(DENSITIES)):
            for part, rows in ((BEYOND[k], is_worn), (DENSITIES[k] - BEYOND[k], ~is_worn)):
                here = np.flatnonzero(rows & (level == k))
                drawn[here, j] = rng.choice(SHARES, len(here), p=part / part.sum())
                drawn[here, j] += SHARE * (rng.random(len(here)) - 0.5)
        drawn[:, j] *= limits[j]
    return drawn, log_weight


def _reading_with_error(found: float, u: float, rng: np.random.Generator, n: int) -> Array:
    """Clearances that a reading allows: normal, cut off at 0. [in]"""
    drawn = rng.normal(found, u, n)
    for _ in range(60):
        below = drawn < 0.0
        if not below.any():
            break
        drawn[below] = rng.normal(found, u, int(below.sum()))
    return np.maximum(drawn, 0.0)


def _summary(
    gear: Gear, drawn: Array, worn: Mask, weight: Array, not_clearance: float
) -> Posterior:
    index = {number: j for j, number in enumerate(gear.joint_numbers)}
    chances = [
        GroupChance(
            group, min(float(weight[worn[:, [index[n] for n in group]].any(axis=1)].sum()), 1.0)
        )
        for group in gear.link_groups
    ]
    chances.sort(key=lambda chance: -chance.probability)
    intervals = []
    for number, j in index.items():
        low, median, high = _weighted_quantiles(drawn[:, j], weight)
        intervals.append(
            ClearanceInterval(number, low, median, high, min(float(weight[worn[:, j]].sum()), 1.0))
        )
    called = tuple(chance.joints for chance in chances if chance.probability > 0.5)
    # A sum of weights may pass 1 by rounding.
    none = min(float(weight[~worn.any(axis=1)].sum()), 1.0)
    effective = float(1.0 / np.sum(weight**2))
    return Posterior(
        tuple(chances),
        none,
        not_clearance,
        tuple(intervals),
        called,
        effective,
        _text(chances, called, none, not_clearance),
    )


def _weighted_quantiles(values: Array, weight: Array) -> tuple[float, float, float]:
    order = np.argsort(values)
    steps = np.cumsum(weight[order])
    at = np.minimum(np.searchsorted(steps, np.array(_QUANTILES) * steps[-1]), len(values) - 1)
    low, median, high = values[order][at].tolist()
    return low, median, high


def _text(
    chances: Sequence[GroupChance],
    called: Sequence[tuple[int, ...]],
    none: float,
    not_clearance: float,
) -> str:
    likely = [chance for chance in chances[:2] if chance.probability >= _WORTH_SAYING]
    ranked = ", then ".join(
        f"{' or '.join(f'#{n}' for n in chance.joints)} ({percent(chance.probability)})"
        for chance in likely
    )
    # Another chance than those of the joints: both can be so at once.
    also = f" Chance that rigging or lock roller moved the plunger: {percent(not_clearance)}."
    if not_clearance > 0.8:
        return (
            "Rigging or lock roller, not joint clearance, likely moved the plunger"
            f" ({percent(not_clearance)})."
        )
    if called:
        return f"The measured displacement points to wear: most likely worn {ranked}.{also}"
    if not likely:
        return f"Probably no joint is beyond its limit ({percent(none)}).{also}"
    return (
        "The measured displacement does not show which joint is worn: no joint beyond its limit"
        f" {percent(none)}; most likely worn {ranked}.{also}"
    )
