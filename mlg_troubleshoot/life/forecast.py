"""How many landings gears have left: to a joint's limit, to the margin, to the next inspection."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from datetime import date
from functools import partial
from hashlib import sha256
from itertools import islice
from operator import attrgetter

import numpy as np

from mlg_troubleshoot.arrays import Array
from mlg_troubleshoot.decision.assessment import Verdict
from mlg_troubleshoot.decision.sentences import joint_list
from mlg_troubleshoot.gear.directions import worst_case
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.life.folding import GearLife
from mlg_troubleshoot.life.state import GearKey
from mlg_troubleshoot.life.wear_paths import placed_in_time, unit_of, wear_paths
from mlg_troubleshoot.wear import (
    Samples,
    WearModel,
    WearPath,
    first_passage,
    fit_wear,
)

# Where a forecast looks between the last inspection and the horizon: now, and from 1/800 of the
# horizon (25 of 20,000 landings, about a week) on in equal ratios. [1]
_AHEAD = np.concatenate([[0], np.geomspace(1 / 800, 1, 28)])
# At which of these the model itself is asked for the worst case, which departs slowly from the sum
# of amplified clearances.
_ASKED = np.array([0, 8, 14, 18, 22, 25, 28])
# Gears that are forecast at once: their simulated clearances are 15 MB.
_GEARS_AT_ONCE = 25
# Gears that the wear is learnt from at first; more follow only where these say too little. [1]
TEACHERS = 100
# Stands for the worst case of a linkage that does not close: beyond any margin. [in]
_NOT_CLOSING_IN = 1000


Quantiles = Mapping[str, float | None]


@dataclass(frozen=True, slots=True)
class Forecast:
    """Landings that remain from a gear's last inspection, of the joints ever read; infinite beyond
    the horizon.

    bands: 5, 50 and 95 % quantiles of the clearance of each joint, after `landings_of_bands`. [in]
    limit_joint: the joint that most often is the first at its limit.
    due_now: why nothing remains, in words; empty where something may.
    due_date: the day of the next inspection, None where it is not known.
    """

    joints: Mapping[int, Quantiles] = field(default_factory=dict)
    bands: Mapping[int, Array] = field(default_factory=dict)
    landings_to_limit: Quantiles | None = None
    limit_joint: int | None = None
    landings_to_margin: Quantiles | None = None
    next_inspection_landings: float | None = None
    due_now: str = ""
    due_date: str | None = None


def _quantiles(samples: Array) -> list[Quantiles]:
    """The 5, 50 and 95 % quantiles of samples on the last axis, question by question; null beyond
    the horizon.
    """
    ends = Samples(samples).quantile([0.05, 0.5, 0.95]).reshape(-1, 3)
    return [
        {
            name: end if np.isfinite(end) else None
            for name, end in zip(("p05", "p50", "p95"), each, strict=True)
        }
        for each in ends.tolist()
    ]


def landings_of_bands(gear: Gear) -> Array:
    """Landings after the last inspection at which the bands of a forecast are known."""
    landings: Array = gear.horizon.value * _AHEAD[_ASKED]
    return landings


def teachers_first(keys: Iterable[GearKey]) -> list[GearKey]:
    """The gears of a fleet in an order by chance, which stays as the fleet grows."""
    return sorted(keys, key=lambda key: sha256("\0".join(key).encode()).digest())


def fit_fleet(
    lives: Iterable[GearLife],
    gear: Gear,
    fit: Callable[[Sequence[WearPath]], WearModel] = fit_wear,
) -> WearModel | None:
    """Learn the wear of joints from as many gears as are needed, of which the dates and landings
    agree; None if none states its landings.
    """
    paths: list[WearPath] = []
    asked = (life for life in lives if life.inspections)
    while part := sorted(islice(asked, TEACHERS), key=attrgetter("key")):
        paths += [
            path
            for life in part
            if not life.warnings
            for own, _begun in wear_paths(life, gear.joint_numbers).values()
            for path in own
            if len(own) > 1 or len(np.asarray(path.usage))
        ]
        followed = {path.unit for path in paths if path.n_readings > 1}
        if len(followed) >= WearModel.learns_from:
            break
    return fit(paths) if any(path.n_readings for path in paths) else None


def forecast(
    lives: Sequence[GearLife],
    model: WearModel | None,
    gear: Gear,
) -> dict[GearKey, Forecast]:
    """Forecast gears from their last inspection on.

    Nothing remains to one that is due now, whatever else is wrong with its records. Another one
    without landings, or whose dates and landings disagree, has no forecast.
    """
    forecasts = {life.key: _due_now(life, gear) or Forecast() for life in lives if life.latest}
    known = [
        life
        for life in lives
        if life.key in forecasts
        and not (life.warnings or forecasts[life.key].due_now)
        and life.inspections[-1].inspection.gear_landings is not None
    ]
    if model is not None:
        parts = [known[at : at + _GEARS_AT_ONCE] for at in range(0, len(known), _GEARS_AT_ONCE)]
        look = partial(_forecast_part, model=model, gear=gear)
        # NumPy lets others work meanwhile.
        with ThreadPoolExecutor(os.cpu_count()) as pool:
            for ahead in pool.map(look, parts):
                forecasts.update(ahead)
    found = ((life, forecasts.get(life.key, Forecast())) for life in lives)
    return {life.key: replace(ahead, due_date=_due_date(life, ahead)) for life, ahead in found}


def _due_now(life: GearLife, gear: Gear) -> Forecast | None:
    """The forecast of a gear that is outside its margin or has a joint over its limit: nothing
    remains of anything.
    """
    if life.state is None:
        return None
    over = _over_limit(life.state.inspection.clearance_in, gear)
    outside = life.now.verdict is Verdict.OUTSIDE_MARGIN
    reasons = ["outside the margin at the last inspection"] if outside else []
    if over:
        reasons.append(f"{joint_list(list(over))} over the limit when last read")
    if not reasons:
        return None
    (nothing,) = _quantiles(np.zeros(1))
    worst = max(over, key=lambda n: over[n] / gear.joint(n).limit.value, default=None)
    why = ", and ".join(reasons)
    return Forecast(dict.fromkeys(over, nothing), {}, nothing, worst, nothing, 0.0, why)


def _due_date(life: GearLife, ahead: Forecast) -> str | None:
    """The day on which the next inspection is due if the gear goes on landing as often as between
    its inspections.
    """
    last = life.latest
    if last is None or last.at is None or ahead.next_inspection_landings is None:
        return None
    latest = last.at.toordinal()
    days = 0.0
    if not ahead.due_now:
        eras = [np.array(era) for era in placed_in_time(life) if era]
        passed, flown = np.sum([np.zeros(2), *(era[-1] - era[0] for era in eras)], axis=0).tolist()
        if flown <= 0.0 or passed <= 0.0:
            return None
        days = ahead.next_inspection_landings * passed / flown
    if latest + days >= date.max.toordinal():
        return None
    return date.fromordinal(latest + int(days)).isoformat()


def _over_limit(clearance_in: Mapping[int, float], gear: Gear) -> dict[int, float]:
    return {n: c for n, c in clearance_in.items() if gear.joint(n).is_over_limit(c)}


def _forecast_part(
    part: Sequence[GearLife], model: WearModel, gear: Gear
) -> dict[GearKey, Forecast]:
    numbers = gear.joint_numbers
    ahead = gear.horizon.value * _AHEAD
    read = np.array(
        [
            [any(n in kept.inspection.clearance_in for kept in life.inspections) for n in numbers]
            for life in part
        ]
    )
    wear = _wear_ahead(part, model, gear)
    # A joint that was never read counts as it does in the prediction: not at all.
    wear[~read] = 0.0
    asked = wear[:, :, _ASKED]
    displacement = _worst_case_of(wear, asked, gear)
    bands = np.quantile(asked, [0.05, 0.5, 0.95], axis=3)
    margins = [life.inspections[-1].inspection.margin_in for life in part]
    to_limit = first_passage(ahead, wear, gear.limits_in)
    to_any = to_limit.min(axis=1)
    to_margin = first_passage(
        ahead, displacement, [gear.margin.value if one is None else one for one in margins]
    )
    due = Samples(np.minimum(to_any, to_margin)).quantile(gear.accepted_chance.value)
    of_joints, of_any, of_margin = map(_quantiles, (to_limit, to_any, to_margin))
    first = to_limit.argmin(axis=1)
    found = {}
    for g, life in enumerate(part):
        known = [(j, number) for j, number in enumerate(numbers) if read[g, j]]
        passed = first[g, np.isfinite(to_any[g])]
        found[life.key] = Forecast(
            {number: of_joints[g * len(numbers) + j] for j, number in known},
            {number: bands[:, g, j] for j, number in known},
            of_any[g],
            numbers[int(np.bincount(passed).argmax())] if len(passed) else None,
            of_margin[g],
            float(due[g]) if np.isfinite(due[g]) else None,
        )
    return found


def _wear_ahead(lives: Sequence[GearLife], model: WearModel, gear: Gear) -> Array:
    """Simulated clearances (gears, joints, ahead, samples). [in]

    Each gear from the model's seed: its forecast is the same whoever else is asked for.
    """
    ahead = gear.horizon.value * _AHEAD
    paths: list[WearPath] = []
    usage = []
    for life in lives:
        now = (life.inspections[-1].inspection.gear_landings or 0.0) + ahead
        for own, begun in wear_paths(life, gear.joint_numbers).values():
            paths += own
            usage.append(np.maximum(now - begun, 0.0))
    units = [unit_of(life.key, number) for life in lives for number in gear.joint_numbers]
    joints = len(gear.joint_numbers)
    found = model.of(paths).forecast(units, usage, reading=False, together=joints).samples
    np.maximum(found, 0.0, out=found)
    return found.reshape(len(lives), joints, *found.shape[1:])


def _worst_case_of(wear: Array, asked: Array, gear: Gear) -> Array:
    """Worst-case displacement (gears, ahead, samples) of simulated clearances, some of them as they
    are `asked` about. [in]

    The sum of amplified clearances, times how far the model's worst case of the median clearances
    departs from their sum.
    """
    amplification = gear.model.plunger_amplification()
    straight = np.einsum("j,gjts->gts", amplification, wear)
    middle = np.median(asked, axis=3)
    clearances = np.moveaxis(middle, 1, 2)
    rows = clearances.reshape(-1, clearances.shape[-1])
    predicted = worst_case(gear.model, rows).magnitude_in
    predicted = np.where(np.isnan(predicted), _NOT_CLOSING_IN, predicted)
    summed = np.einsum("j,gjt->gt", amplification, middle)
    departure = predicted.reshape(summed.shape) / np.maximum(summed, 1e-12)
    along = np.array([np.interp(_AHEAD, _AHEAD[_ASKED], of_gear) for of_gear in departure])
    displacement: Array = straight * along[:, :, None]
    return displacement
