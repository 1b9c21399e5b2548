"""How many landings gears have left: to a joint's limit, to the margin, to the next inspection.

From the readings of each joint between its restorations, as paths of wear over landings, follow:
landings left, the day of the next inspection, and which gear comes first; last inspections that
wear does not explain (a restoration without a record); and how worn gears usually are.
"""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from datetime import date
from functools import partial
from hashlib import sha256
from itertools import islice
from math import inf
from operator import attrgetter
from typing import NamedTuple

import numpy as np

from mlg_troubleshoot.arrays import Array
from mlg_troubleshoot.decision.assessment import Verdict
from mlg_troubleshoot.decision.inspection import Fleet, Inspection
from mlg_troubleshoot.decision.sentences import joint_list
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.gear.linkage import worst_case
from mlg_troubleshoot.life.folding import GearLife, TodaysVerdict, is_readable
from mlg_troubleshoot.life.logbook import LogLine, log_of
from mlg_troubleshoot.life.state import GearKey, Moment
from mlg_troubleshoot.life.urgency import (
    OVER_LIMIT,
    Urgency,
    changes_since,
    repair_sentence,
    urgency_of,
)
from mlg_troubleshoot.results import JsonOutput
from mlg_troubleshoot.store import RecordKind, Store, inspection_from
from mlg_troubleshoot.units import LengthUnit
from mlg_troubleshoot.wear import (
    Samples,
    WearModel,
    WearPath,
    first_passage,
    fit_wear,
)


@dataclass(slots=True)
class Stretch:
    """What was read of a joint between two restorations: landings (None: not stated), clearance and
    its uncertainty. Landings before the last overhaul are negative.
    """

    begun: float
    readings: list[tuple[float | None, float, float]]

    def count_from(self, landings: float) -> None:
        """Count landings from these on."""
        self.begun -= landings
        self.readings = [
            (None if at is None else at - landings, value, u) for at, value, u in self.readings
        ]

    @property
    def placed(self) -> list[tuple[float, float, float]]:
        """The readings whose landings are known."""
        return [(at, value, u) for at, value, u in self.readings if at is not None]


def stretches(life: GearLife, joints: Sequence[int]) -> dict[int, list[Stretch]]:
    """Readings of each joint between its restorations, in the order of time."""
    found = {joint: [Stretch(0.0, [])] for joint in joints}
    eras = _placed_in_time(life) if life.repairs else []
    landings = 0.0
    for place, event in enumerate(life.events):
        if place in life.overhauls:
            _begin_anew(found, life.overhauls[place], landings)
        if event.joints is None:
            landings = landings if event.landings is None else event.landings
            for joint, reading in event.read.items():
                if joint in found:
                    found[joint][-1].readings.append((event.landings, *reading))
        else:
            at = _landings_of(event, eras)
            for joint in found.keys() & event.joints:
                begun = found[joint][-1].begun if at is None else at
                found[joint].append(Stretch(begun, []))
    return found


def _begin_anew(
    found: Mapping[int, list[Stretch]], restored: Collection[int], landings: float
) -> None:
    """Count landings from an overhaul on, after which restored joints begin anew."""
    for joint, between in found.items():
        for stretch in between:
            stretch.count_from(landings)
        if joint in restored:
            between.append(Stretch(0.0, []))


def wear_paths(life: GearLife, joints: Sequence[int]) -> dict[int, tuple[list[WearPath], float]]:
    """Paths of each joint between its restorations, and the landings at which the current one
    began.
    """
    found = {}
    for joint, between in stretches(life, joints).items():
        paths = []
        reading_u: float | None = None
        for stretch in between:
            placed = stretch.placed
            reading_u = placed[-1][2] if placed else reading_u
            landings = [max(at - stretch.begun, 0.0) for at, _value, _u in placed]
            # Only those of another gear's inspection fall.
            usage = np.maximum.accumulate(landings)
            value = [value for _at, value, _u in placed]
            paths.append(WearPath(unit_of(life.key, joint), usage, value, reading_u))
        found[joint] = paths, between[-1].begun
    return found


def unit_of(key: GearKey, joint: int) -> str:
    """Name of a joint of a gear for the forecasts."""
    return f"{key[0]} {key[1]} #{joint}"


def _placed_in_time(life: GearLife) -> list[Array]:
    """Day and landings of the inspections that state both, those between two overhauls together,
    shape (n, 2). [d, landings]
    """
    found: list[list[tuple[int, float]]] = [[]]
    for place, event in enumerate(life.events):
        if place in life.overhauls:
            found.append([])
        if event.joints is None and event.day and event.landings is not None:
            found[-1].append((date.fromisoformat(event.day).toordinal(), event.landings))
    return [np.array(era, float) for era in found if era]


def _landings_of(repair: Moment, eras: Sequence[Array]) -> float | None:
    """Landings at a repair: as recorded, else between the inspections about it, by their days."""
    if repair.landings is not None:
        return float(repair.landings)
    if not eras or not repair.day:
        return None
    day = date.fromisoformat(repair.day).toordinal()
    begun = [era for era in eras if era[0, 0] <= day]
    days, landings = (begun or eras[:1])[-1].T
    return float(np.interp(day, days, landings))


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
        eras = _placed_in_time(life)
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


# A reading as many standard deviations below the line through those before it is not wear: a
# restoration that nobody recorded. At 4 one in 30,000 sound joints is named. [1]
_DROP = 4


def suggestion(life: GearLife, gear: Gear) -> str:
    """Say that the last inspection looks like an unrecorded restoration; empty if it does not."""
    if life.latest is None:
        return ""
    read = sorted(gear.joint_numbers & life.latest.inspection.clearance_in.keys())
    dropped = [n for n, found in stretches(life, read).items() if _has_dropped(found[-1].placed)]
    if not dropped:
        return ""
    return (
        f"{life.name}: {joint_list(dropped)} read much tighter than before. Restored without a"
        f" record? mlg history repair {life.name} --joint {dropped[0]} --date D"
    )


def _has_dropped(readings: Sequence[tuple[float, float, float]]) -> bool:
    """Whether the last reading lies far below the line through those before it (least squares over
    the landings; their mean where one was read before).
    """
    if len(readings) < 2 or readings[-1][1] >= readings[-2][1]:
        return False
    landings, value, u = np.transpose(readings)
    terms = np.vander(landings / max(abs(landings).max(), 1.0), min(len(readings) - 1, 2))
    weights = terms[-1] @ np.linalg.pinv(terms[:-1])
    below = float(weights @ value[:-1] - value[-1])
    return below >= _DROP * float(np.hypot(u[-1], np.linalg.norm(weights * u[:-1])))


class Reading(NamedTuple):
    """A reading of one joint. [in]"""

    date: str | None
    gear_landings: float | None
    clearance_in: float


@dataclass(frozen=True, slots=True)
class FleetLine:
    """One gear of a fleet as every output shows it: its latest inspection, what is said of it
    today, and its landings left.

    inspections, repairs: how many count. Numbers stand as they did in the record. unit: that most
    readings were entered in.
    """

    json_names = """
        tail_no side record_id inspection_date gear_landings verdict=now.verdict
        basis=now.basis worst_joint=now.worst_joint landings_to_limit=ahead.landings_to_limit
        limit_joint=ahead.limit_joint landings_to_margin=ahead.landings_to_margin
        next_inspection_landings=ahead.next_inspection_landings due_date=ahead.due_date repairs
        predicted_displacement_in=now.predicted_displacement_in margin_in=now.margin_in
        next_action=now.next_action minutes=now.minutes restore=now.restore why=urgency.why failed
        repair changed readings
    """
    tail_no: str
    side: str
    inspections: int
    repairs: int
    warnings: tuple[str, ...]
    now: TodaysVerdict
    ahead: Forecast
    record_id: str
    inspection_date: date | None
    gear_landings: int | float | None
    urgency: Urgency
    failed: tuple[str, ...]
    repair: str
    suggestion: str
    changed: tuple[str, ...]
    readings: tuple[Reading, ...]
    unit: LengthUnit | None

    @classmethod
    def of(
        cls, life: GearLife, ahead: Forecast, gear: Gear, since: str = "", joint: int | None = None
    ) -> FleetLine:
        """`since`: a day (ISO 8601); `joint`: whose readings are listed."""
        lines = log_of(life, gear, () if joint is None else (joint,))
        failed = [e.date or "no date" for e in lines if e.counts and e.kind == "FAILED"]
        row = None if life.latest is None else life.latest.inspection
        newest_first = (each.inspection.unit_entered for each in reversed(life.inspections))
        return cls(
            *life.key,
            len(life.inspections),
            len(life.repairs),
            life.warnings,
            life.now,
            ahead,
            "" if row is None else row.record_id,
            None if row is None else row.inspection_date,
            None if row is None else row.gear_landings,
            urgency_of(life, lines, gear),
            tuple(day for day in failed if day >= since),
            repair_sentence(lines),
            suggestion(life, gear),
            changes_since(life, lines, since) if since else (),
            tuple(
                Reading(e.date, e.gear_landings, e.value_in or 0.0)
                for e in lines
                if e.counts and e.kind == "reading" and e.joints == (joint,)
            ),
            next(filter(None, newest_first), None),
        )

    def by_when(self, gear: Gear) -> str:
        """When the gear is to be looked at: now, on a day, or after so many landings."""
        if self.urgency.rank <= OVER_LIMIT or self.ahead.due_now:
            return "now"
        after = self.ahead.next_inspection_landings
        left = "-" if after is None else f"{landings_shown(after, gear)} landings"
        return self.ahead.due_date or left

    @property
    def key(self) -> GearKey:
        return self.tail_no, self.side

    @property
    def place(self) -> tuple[int, float, float, GearKey]:
        """By what is most urgent, how far it is, and landings to the next inspection."""
        due = self.ahead.next_inspection_landings
        return self.urgency.rank, -self.urgency.size, inf if due is None else due, self.key


class JointLeft(NamedTuple):
    """A joint, its readings (landings, radial clearance) since it was last restored, and the
    landings to its limit. [in]
    """

    joint: int
    limit_in: float
    readings: list[tuple[float, float]]
    landings_to_limit: Quantiles | None


@dataclass(frozen=True, slots=True, eq=False)
class LifeAhead(JsonOutput):
    """The life of one gear: its log book in the order of time, its joints, its landings left."""

    json_names = """
        schema_version tail_no=life.tail_no side=life.side events joints
        landings_to_limit=ahead.landings_to_limit limit_joint=ahead.limit_joint
        landings_to_margin=ahead.landings_to_margin
        next_inspection_landings=ahead.next_inspection_landings due_date=ahead.due_date
        notes=life.notes warnings=life.warnings
    """
    life: GearLife
    ahead: Forecast
    gear: Gear

    @property
    def events(self) -> list[LogLine]:
        """The lines of its log book."""
        return log_of(self.life, self.gear)

    @property
    def joints(self) -> list[JointLeft]:
        return [
            JointLeft(
                number,
                self.gear.joint(number).limit.value,
                [(at, value) for at, value, _u in between[-1].placed],
                self.ahead.joints.get(number),
            )
            for number, between in stretches(self.life, self.gear.joint_numbers).items()
        ]


def most_urgent_first(lines: Iterable[FleetLine]) -> list[FleetLine]:
    """The gears that were inspected."""
    return sorted((line for line in lines if line.inspections), key=attrgetter("place"))


def work_sentence(lines: Sequence[FleetLine]) -> str:
    """Sum the minutes and the parts that the plans of a fleet expect."""
    parts = Counter(joint for line in lines for joint in line.now.restore)
    restored = ", ".join(f"#{joint} ({count})" for joint, count in sorted(parts.items()))
    minutes = sum(line.now.minutes for line in lines)
    return (
        f"Work that the plans expect: {minutes:.0f} min on"
        f" {sum(line.now.minutes > 0.0 for line in lines)} of {len(lines)} gears; joints to restore"
        f" (number of gears): {restored or 'none'}."
    )


def parts_within(lines: Iterable[FleetLine], landings: float) -> str:
    """The joints that more likely than not reach their limit within so many landings."""
    parts = Counter(
        joint
        for line in lines
        for joint, left in line.ahead.joints.items()
        if joint not in line.now.restore and left["p50"] is not None and left["p50"] <= landings
    )
    listed = ", ".join(f"#{joint} ({count})" for joint, count in sorted(parts.items()))
    return (
        f"Within {landings:g} landings these probably reach their limit as well (number of gears):"
        f" {listed or 'none'}."
    )


def span(ends: Quantiles | None, gear: Gear) -> str:
    """Median and 90 % interval of landings, the horizon standing for what lies beyond it."""
    if ends is None:
        return "-"
    low, middle, high = (landings_shown(end, gear) for end in ends.values())
    return middle if low == high else f"{middle} ({low} to {high})"


def landings_shown(count: float | None, gear: Gear) -> str:
    """Landings to two digits: a forecast has no more; None lies beyond the horizon."""
    return f"> {gear.horizon.value:.0f}" if count is None else f"{float(f'{count:.2g}'):.0f}"


def outlook_sentence(life: GearLife, ahead: Forecast, gear: Gear) -> str:
    """Say how many landings a gear has left, to which margin and by which joint; empty where
    nothing was forecast.
    """
    if ahead.due_now:
        return f"No landings left: {ahead.due_now}. Next inspection due now."
    if life.latest is not None and life.latest.inspection.gear_landings is None:
        return "No forecast: the last inspection does not state its landings (gear_landings)."
    if ahead.landings_to_limit is None:
        return ""
    joint = ""
    if ahead.limit_joint is not None:
        joint = f", where #{ahead.limit_joint} most likely reaches its limit first"
    after = ahead.next_inspection_landings
    due = "beyond the horizon" if after is None else f"in {landings_shown(after, gear)} landings"
    day = f", about {ahead.due_date}" if ahead.due_date else ""
    return (
        "Landings left from the last inspection: to a joint's limit"
        f" {span(ahead.landings_to_limit, gear)}{joint}; to the margin, by the worst-case bound,"
        f" {span(ahead.landings_to_margin, gear)}. Next inspection due"
        f" {due}{day} (accepted chance {gear.accepted_chance.value:.0%})."
    )


# Newest inspections that a fleet is judged by, which give a share to a few percent; fewest gears.
_MOST = 500
_FEWEST = 10


def expected_of(store: Store, gear: Gear) -> Fleet | None:
    """Learn from the last inspection of each gear among the newest that are kept; None with too
    few that fit this linkage.
    """
    from mlg_troubleshoot.decision.learning import learned

    joints = set(gear.joint_numbers)
    last: dict[GearKey, Inspection] = {}
    voids = filter(is_readable, store.newest(RecordKind.VOID, _MOST))
    void = {record.body["voids"] for record in voids}
    for record in store.newest(RecordKind.INSPECTION, _MOST):
        if record.key not in void and (record.tail_no, record.side) not in last:
            row = inspection_from(record)
            # A visit at which no joint was read says nothing of wear.
            if row.clearance_in and set(row.clearance_in) <= joints:
                last[record.tail_no, record.side] = row
    rows = [*last.values()]
    return learned(gear, rows) if len(rows) >= _FEWEST else None
