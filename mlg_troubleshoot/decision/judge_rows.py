"""From inspections to judgements: prediction, verdict, ranking and next action.

What is looked at first: of the joints of a gear, of the gears of a batch.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from datetime import date
from functools import partial
from operator import attrgetter

import numpy as np
from threadpoolctl import threadpool_limits

from mlg_troubleshoot.arrays import Array, Places
from mlg_troubleshoot.decision import prediction as plunger_reading
from mlg_troubleshoot.decision import sentences
from mlg_troubleshoot.decision.assessment import (
    Action,
    Assessment,
    Basis,
    JointFinding,
    Judgement,
    Rejected,
    RepairSet,
    RigidBound,
    UncertaintyBudget,
    UnjudgedJoint,
    Verdict,
    VerdictTone,
)
from mlg_troubleshoot.decision.inspection import (
    FactKind,
    Fleet,
    Inspection,
    InvalidRow,
    Outcome,
    Side,
)
from mlg_troubleshoot.decision.planner import (
    Course,
    Judged,
    correct,
    plans,
    repair_sets,
    sure_sets,
    with_consequences,
)
from mlg_troubleshoot.decision.prediction import (
    PROVISIONAL_U_IN,
    PROVISIONAL_U_SHARE,
    Cases,
    Extension,
    Prediction,
    chance_at,
    ensemble,
)
from mlg_troubleshoot.decision.verdict_rule import verdict, with_reading
from mlg_troubleshoot.gear.gear import DEFAULT_PLUNGER_U_IN, ROUNDING_IN, Gear
from mlg_troubleshoot.indices.index_table import IndexTable
from mlg_troubleshoot.units import Length, LengthUnit, Sentence

# Where one of these comes next a gear is not done with, whatever its joints predict.
_OPEN = (Action.READ_PLUNGER, Action.RETRACT)
WORST_FIRST = (
    *(Verdict.OUTSIDE_MARGIN, Verdict.INCONCLUSIVE, Verdict.INCOMPLETE),
    *(Verdict.INVALID, Verdict.WITHIN_MARGIN),
)


def rank_joints(
    gear: Gear, table: IndexTable, clearance_in: Array
) -> list[tuple[JointFinding, ...]]:
    """Rank the joints of each gear in the order in which to inspect them; NaN where nothing was
    measured.

    Joints over their limit come first, then by contribution; an unmeasured joint counts with half
    its limit, ties go to the larger total-order index. The range of a rank is over the ensemble of
    geometries.
    """
    over = gear.over_limit(clearance_in)
    places = _places(gear, table, clearance_in)
    of_each = (clearance_in, over, places[:, 0], places.min(axis=1), places.max(axis=1))
    return [
        tuple(
            JointFinding(
                joint=joint.number,
                name=joint.name,
                clearance_in=_number_or_none(clearance),
                limit_in=joint.limit.value,
                over_limit=is_over,
                contribution_in=_number_or_none(indices.plunger_amplification * clearance),
                first_order=indices.first_order,
                total_order=indices.total_order,
                plunger_amplification=indices.plunger_amplification,
                rank=rank,
                rank_range=(best, worst),
                acts_like=gear.alike[joint.number],
            )
            for joint, indices, clearance, is_over, rank, best, worst in zip(
                gear.joints, table.joints, *row, strict=True
            )
        )
        for row in zip(*(each.tolist() for each in of_each), strict=True)
    ]


def _number_or_none(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None


def _places(gear: Gear, table: IndexTable, clearance_in: Array) -> Places:
    """Place of each joint of each gear on each linkage, from 1."""
    assumed = np.where(np.isfinite(clearance_in), clearance_in, 0.5 * gear.limits_in)
    contribution = ensemble(gear)[0] * assumed[:, None]
    # Rounded: both ends of one link contribute alike, and rounding noise must not order them.
    within = ~gear.over_limit(clearance_in)[:, None]
    keys = (-table.total_order, -np.round(contribution, 9), within)
    order = np.lexsort([np.broadcast_to(key, contribution.shape) for key in keys], axis=-1)
    return np.argsort(order, axis=-1) + 1


@dataclass(frozen=True, slots=True)
class Listed:
    """What a list of many says of one judgement, and what orders it: a fraction of its memory.

    worst_in, margin_in, chance: of the prediction; None of a row that was not judged, and the first
    also where no joint was read or the linkage does not close. [in, in, 1] unit: that most readings
    were entered in.
    """

    record_id: str | None
    tail_no: str | None
    side: Side | None
    day: date | None
    verdict: Verdict
    in_brief: str
    title: str
    tone: VerdictTone
    severity: tuple[int, int, float]
    failed: bool
    over_limit: tuple[int, ...]
    worst_in: float | None
    margin_in: float | None
    chance: float | None
    unit: LengthUnit | None

    @classmethod
    def of(cls, judgement: Judgement) -> Listed:
        row = judgement.row
        a = judgement if isinstance(judgement, Assessment) else None
        return cls(
            row.record_id,
            row.tail_no,
            row.side,
            None if a is None else a.inspection.inspection_date,
            judgement.verdict,
            judgement.in_brief,
            judgement.title,
            judgement.tone,
            _severity(judgement),
            a is not None
            and (
                a.inspection.outcome is Outcome.FAILED
                or any(fact.kind is FactKind.FAILED for fact in a.older)
                or (judgement.next_action.required and judgement.next_action.action in _OPEN)
            ),
            () if a is None else tuple(f.joint for f in a.joints if f.over_limit),
            a.deciding_in if a is not None and a.inspection.clearance_in else None,
            None if a is None else a.margin_in,
            None if a is None else a.probability_exceed_random_directions,
            None if a is None else a.inspection.unit_entered,
        )

    @property
    def is_judged(self) -> bool:
        return self.margin_in is not None

    @property
    def is_fine(self) -> bool:
        """Whether nothing about the gear needs attention."""
        within = self.verdict is Verdict.WITHIN_MARGIN
        return within and not self.over_limit and not self.failed


def listed(judgements: Iterable[Judgement]) -> list[Listed]:
    return [Listed.of(judgement) for judgement in judgements]


def latest_of_each_gear(lines: Sequence[Listed]) -> tuple[list[int], list[int]]:
    """Places of the latest inspection of each gear and of the earlier ones, both worst first.

    A row whose gear or date is not known stands by itself: nothing says that it is an earlier one.
    Of several on the last day the worst one stands: their order in the table does not say which is
    later.
    """
    last: dict[object, int] = {}

    def order(place: int) -> tuple[date, bool, tuple[float, ...]]:
        line = lines[place]
        return line.day or date.min, not line.is_fine, tuple(-x for x in line.severity)

    for place, line in enumerate(lines):
        key = place if line.day is None else (line.tail_no, line.side)
        last[key] = max(place, last.get(key, place), key=order)
    latest = set(last.values())
    return worst_first(lines, latest), worst_first(lines, set(range(len(lines))) - latest)


def worst_first(lines: Sequence[Listed], places: Iterable[int]) -> list[int]:
    """Measured beyond the margin first, then by verdict, then by the displacement against the
    margin.
    """
    return sorted(places, key=lambda place: (lines[place].severity, place))


def _severity(judgement: Judgement) -> tuple[int, int, float]:
    rank = WORST_FIRST.index(judgement.verdict)
    if not isinstance(judgement, Assessment):
        return 1, rank, 0.0
    measured = judgement.is_measured_outside
    size = judgement.inspection.measured_displacement_in if measured else judgement.deciding_in
    return (
        0 if measured else 1,
        rank,
        float("-inf") if size is None else -abs(size) / judgement.margin_in,
    )


# Rows judged at once, by one process: bounds the memory. [1]
AT_ONCE = 512


def assess(
    rows: Sequence[Inspection | InvalidRow],
    gear: Gear,
    table: IndexTable,
    *,
    advice: bool = False,
    sets: bool = True,
    extension: Extension | None = None,
    fleet: Fleet | None = None,
) -> tuple[Judgement, ...]:
    """Judge rows: verdict and plan; with `advice` the joints that are likely worn, with
    `sets` the repair sets and what follows each outcome of NEXT. `fleet` is what other gears teach.
    """
    valid = [row for row in rows if isinstance(row, Inspection)]
    # Gears of which the same is known are judged once; to an extension it matters whose they are.
    known: list[object] = [
        n
        if extension is not None
        else tuple(tuple(v.items()) if isinstance(v, Mapping) else v for v in _KNOWN(row))
        for n, row in enumerate(valid)
    ]
    alike = dict(zip(known, valid, strict=True))
    different = [*alike.values()]
    found: list[Assessment] = []
    # Products of this size take twice as long where they wait for other threads.
    with threadpool_limits(1, "blas"):
        for start in range(0, len(different), AT_ONCE):
            cases = Cases.of(gear, different[start : start + AT_ONCE], fleet=fleet)
            part = _assess_valid(cases, table, advice, sets)
            if extension is not None:
                extended = _assess_valid(replace(cases, extension=extension), table, advice, sets)
                approval = extension.approval
                part = [_worse(*both, approval) for both in zip(part, extended, strict=True)]
            if sets:
                part = with_consequences(part, cases, partial(_judged, table=table))
            found += part
    judged = dict(zip(alike, found, strict=True))
    unjudged = tuple(UnjudgedJoint(joint.number, joint.name) for joint in gear.joints)
    assessed = (
        a if (a := judged[each]).inspection is row else replace(a, inspection=row)
        for each, row in zip(known, valid, strict=True)
    )
    return tuple(
        (
            next(assessed)
            if isinstance(row, Inspection)
            else Rejected(row, unjudged, correct(row), row.warnings)
        )
        for row in rows
    )


def verdicts(
    rows: Sequence[Inspection], gear: Gear, table: IndexTable, *, fleet: Fleet | None = None
) -> Iterator[tuple[Verdict, Basis, float | None, float]]:
    """The verdict of each inspection, what it rests on, its worst case (None where the linkage does
    not close) and its margin: without a plan. [in]
    """
    for start in range(0, len(rows), AT_ONCE):
        cases = Cases.of(gear, rows[start : start + AT_ONCE], fleet=fleet)
        with threadpool_limits(1, "blas"):
            judged = _judged(cases, table)
        worst = map(_number_or_none, judged.lower.displacement_in.tolist())
        yield from zip(judged.verdicts, judged.bases, worst, cases.margin_in.tolist(), strict=True)


# What a judgement without an extension does not depend on.
_IDENTITY = {"record_id", "tail_no", "side", "source", "carried", "other_columns"}
_KNOWN = attrgetter(*(f.name for f in fields(Inspection) if f.name not in _IDENTITY))


# From the best to the worst.
_ORDER = (
    Verdict.WITHIN_MARGIN,
    Verdict.INCONCLUSIVE,
    Verdict.INCOMPLETE,
    Verdict.OUTSIDE_MARGIN,
)
# What an extension predicts stands beside a verdict of the plain model.
_PREDICTED = (
    "predicted_displacement_in",
    "over_travel_in",
    "under_travel_in",
    "predicted_upper_in",
    "bound_in",
    "standard_uncertainty_in",
    "geometry_spread_in",
    "budget",
)


def _worse(plain: Assessment, extended: Assessment, approval: str) -> Assessment:
    """The worse of what the plain model and an extension say of one gear: only an approved
    extension relaxes a verdict.
    """

    def badness(found: Assessment) -> tuple[int, float]:
        return _ORDER.index(found.verdict), -(found.probability_within_margin or 0.0)

    decides = not approval and badness(plain) >= badness(extended)
    bound = RigidBound(
        plain.predicted_displacement_in, plain.probability_within_margin, plain.verdict, decides
    )
    if approval:
        said = Sentence.joined([extended.headline, f"With the extension, {approval}."])
        return replace(extended, headline=said, rigid=bound)
    if not decides:
        return replace(extended, rigid=bound)
    beside = sentences.beside(extended.predicted_displacement_in, extended.verdict)
    own = [said for said in extended.warnings if said.startswith(_OF_EXTENSION)]
    return replace(
        plain,
        **{name: getattr(extended, name) for name in _PREDICTED},
        headline=Sentence.joined([plain.headline, beside]),
        warnings=(*plain.warnings, *own),
        rigid=bound,
    )


def _assess_valid(cases: Cases, table: IndexTable, advice: bool, sets: bool) -> list[Assessment]:
    judged = _judged(cases, table)
    findings = rank_joints(cases.gear, table, cases.clearance_in)
    wanted = np.isfinite(judged.lower.displacement_in) & sets
    wanted &= np.array(judged.verdicts) != Verdict.WITHIN_MARGIN
    sure = sure_sets(cases, judged.upper, np.flatnonzero(wanted))
    courses = [*plans(cases, judged, sure, advice=advice, sets=sets)]
    repairs = repair_sets(cases, courses)
    return [
        _assessment(cases, judged, i, *each)
        for i, each in enumerate(zip(findings, courses, repairs, strict=True))
    ]


def _judged(cases: Cases, table: IndexTable) -> Judged:
    """What a plan is made from."""
    lower, upper = cases.predict_bounds()
    p_lower, p_upper = (
        each.probability_within(cases.margin_in, cases.margin_u_in) for each in (lower, upper)
    )
    # A reading clears a gear by what is known of its joints: those that were not read count as 0.
    chance = chance_at(cases, cases.filled(0.0))
    found, bases = zip(*_verdicts(cases, p_lower, p_upper, chance), strict=True)
    order = _places(cases.gear, table, cases.clearance_in)[:, 0].argsort(axis=1)
    return Judged(
        found,
        bases,
        lower,
        upper,
        chance,
        order,
        p_lower,
        lower.standard_uncertainty(cases.margin_u_in),
    )


def _verdicts(
    cases: Cases, p_lower: Array, p_upper: Array, chance: Array
) -> list[tuple[Verdict, Basis]]:
    """The verdict of each gear, and what it rests on."""
    questions = np.array([bool(i.unit_question) for i in cases.inspections])
    off = cases.off_down_lock
    clears = cases.clears_margin & np.isfinite(chance) & ~off & ~questions & ~cases.failed_as_new
    close = np.isfinite(cases.plunger_in) & ~cases.beyond_margin & ~cases.clears_margin
    # A gear whose entry leaves a question cannot be cleared either.
    absent = cases.critical_missing | questions
    of_each = (p_lower, p_upper, absent, cases.beyond_margin, clears, close | off, chance)
    return [
        with_reading(
            verdict(low, high, critical_missing=missing),
            beyond=beyond,
            clears=clear,
            unsettled=unsettled,
            chance=p,
        )
        for low, high, missing, beyond, clear, unsettled, p in zip(
            *(each.tolist() for each in of_each), strict=True
        )
    ]


def _assessment(
    cases: Cases,
    judged: Judged,
    i: int,
    findings: tuple[JointFinding, ...],
    course: Course,
    sets: tuple[RepairSet, ...],
) -> Assessment:
    inspection = cases.inspections[i]
    lower = judged.lower
    margin = float(cases.margin_in[i])
    closes = bool(np.isfinite(lower.displacement_in[i]))
    # A linkage of the ensemble may not close where the reference does: the uncertainty is then
    # unknown.
    known = closes and bool(np.isfinite(judged.u_in[i]))

    def number_or_none(value: float) -> float | None:
        return _number_or_none(value) if closes else None

    worst = float(lower.worst.over_in[i]), float(lower.worst.under_in[i])
    budget = _budget(judged.lower, cases, i) if known else None
    measured = inspection.measured_displacement_in
    size = math.nan if measured is None else measured
    # A failure that may be as new as a repair stands.
    is_new = inspection.is_since_repair(inspection.outcome_date) is not False
    most = _explained_at_most(size, judged.upper, i)
    found = Assessment(
        inspection=inspection,
        verdict=judged.verdicts[i],
        # Adding zero turns a minus zero into zero.
        predicted_displacement_in=number_or_none(lower.displacement_in[i] + 0.0),
        over_travel_in=number_or_none(worst[0]),
        under_travel_in=number_or_none(worst[1]),
        predicted_upper_in=_number_or_none(judged.upper.displacement_in[i]),
        margin_in=margin,
        remaining_in=number_or_none(margin - lower.displacement_in[i]),
        standard_uncertainty_in=number_or_none(judged.u_in[i]),
        probability_within_margin=float(judged.p_within[i]),
        probability_exceed_random_directions=number_or_none(judged.chance[i]),
        geometry_spread_in=(
            (
                float(lower.spread_low_in[i]) + 0.0,
                float(lower.spread_high_in[i]) + 0.0,
            )
            if known
            else None
        ),
        budget=budget,
        over_directions_rad=tuple(lower.worst.over_directions[i].tolist()) if closes else (),
        under_directions_rad=tuple(lower.worst.under_directions[i].tolist()) if closes else (),
        joints=findings,
        plan=course.plan,
        basis=judged.bases[i],
        bound_in=_number_or_none(lower.bound_in[i] + 0.0),
        explained_at_most_in=number_or_none(most),
        unexplained_in=number_or_none(abs(size) - most),
        headline="",
        alarm=sentences.alarms(
            [f.joint for f in findings if f.over_limit],
            failed=inspection.outcome is Outcome.FAILED and is_new,
        ),
        repair_sets=sets if closes else None,
        warnings=_warnings(cases, i, findings, worst, float(judged.u_in[i])),
        posterior=course.posterior if closes else None,
    )
    return replace(found, headline=_headline(found, cases, i))


def _explained_at_most(measured: float, upper: Prediction, i: int) -> float:
    """What of a measured displacement the joints explain at most, unmeasured ones at their limit.
    [in]
    """
    worst = upper.worst
    bound = float(worst.over_in[i] if measured > 0.0 else -worst.under_in[i])
    return min(abs(measured), max(bound, 0.0)) if np.isfinite(bound) else abs(measured)


_PROVISIONAL = Sentence.of(
    "provisional, the larger of {} and {} % of the prediction; a single published failure is too"
    " little to estimate it",
    Length.brief(PROVISIONAL_U_IN),
    f"{100 * PROVISIONAL_U_SHARE:.0f}",
)


def _budget(lower: Prediction, cases: Cases, i: int) -> UncertaintyBudget:
    extension = cases.extension
    source = (
        _PROVISIONAL
        if extension is None
        else f"residual scatter of the diagnosis ({extension.describe()})"
    )
    by_joint = dict(zip(cases.gear.joint_numbers, lower.u_readings_in[i].tolist(), strict=True))
    return UncertaintyBudget(
        {joint: by_joint[joint] for joint in cases.inspections[i].clearance_in},
        float(lower.u_geometry_in[i]),
        float(lower.u_model_in[i]),
        float(cases.margin_u_in[i]),
        source,
    )


def _headline(a: Assessment, cases: Cases, i: int) -> str:
    measured = float(cases.plunger_in[i])
    said: list[str] = [sentences.headline(a, measured)]
    if a.verdict is Verdict.INCONCLUSIVE and cases.off_down_lock[i]:
        said.append(sentences.OFF_DOWN_LOCK)
    elif np.isfinite(measured) and a.basis is Basis.PREDICTED:
        said.append(sentences.close_reading(measured, float(cases.plunger_u_in[i])))
    return Sentence.joined([*said, a.alarm] if a.alarm else said)


_OF_EXTENSION = "The extension of the model"


def _warnings(
    cases: Cases,
    i: int,
    findings: Sequence[JointFinding],
    worst_in: tuple[float, float],
    u: float,
) -> tuple[str, ...]:
    inspection = cases.inspections[i]
    gear = cases.gear
    extension = cases.extension
    warnings = list(inspection.warnings)
    margin_in = inspection.margin_in
    if margin_in is not None and margin_in > gear.margin.value + ROUNDING_IN:
        warnings.append(sentences.larger_margin(margin_in, gear.margin.value))
    lacking = () if extension is None else extension.lacks(inspection)
    if lacking:
        warnings.append(
            f"{_OF_EXTENSION} needs {', '.join(lacking)}, which this inspection lacks:"
            " predicted without it."
        )
    kind = inspection.convention
    warnings += [sentences.over_limit(gear, each, kind) for each in findings if each.over_limit]
    read = [f.clearance_in for f in findings if f.clearance_in is not None]
    if all(f.clearance_in == f.limit_in for f in findings):
        warnings.append(sentences.LIMITS_WRITTEN)
    elif len(read) >= sentences.LEAST_ALIKE and len(set(read)) == 1 and read[0] > 0.0:
        warnings.append(sentences.one_value(read[0]))
    at = inspection.plunger_down_lock_in
    if at is not None and cases.off_down_lock[i]:
        low, high = gear.down_lock_range
        warnings.append(
            Sentence.of(
                "Plunger at Down Lock {} is outside {} to {}: check the rigging first.",
                Length(at),
                Length(low, 2, named=False),
                Length(high, 2),
            )
        )
    if not np.all(np.isfinite(worst_in)):
        warnings.append(
            "With these clearances the linkage does not close in every direction: check the"
            " entries."
        )
    elif not np.isfinite(u):
        warnings.append(
            "With these clearances some linkages of the ensemble do not close: the uncertainty is"
            " unknown."
        )
    elif inspection.clearance_in:
        warnings += filter(None, [plunger_reading.disagreement(inspection, *worst_in, u)])
    if inspection.gauge_u_is_default and inspection.clearance_in:
        warnings.append(
            Sentence.of(
                "Standard uncertainty of the gauge not stated: {} {} taken as the default.",
                Length(inspection.gauge_u_in * kind.per_radial, 5),
                kind.words,
            )
        )
    if inspection.standing_readings_in and inspection.plunger_gauge_u_in is None:
        warnings.append(
            Sentence.of(
                "Standard uncertainty of the plunger reading not stated: {} taken as the default.",
                Length(DEFAULT_PLUNGER_U_IN),
            )
        )
    if plunger_reading.readings_differ(inspection):
        warnings.append(
            "The plunger readings differ: the farthest counts. Void one that was a slip."
        )
    if inspection.is_repaired:
        over = [f.joint for f in findings if f.over_limit]
        warnings += sentences.older_than_the_repair(inspection, over)
    return tuple(warnings)
