"""From inspections to judgements: prediction, verdict, ranking and next action."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields, replace
from functools import cache, partial
from itertools import chain
from operator import attrgetter
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from mlg_troubleshoot.arrays import Array
from mlg_troubleshoot.decision import plunger_reading, sentences
from mlg_troubleshoot.decision.assessment import (
    Assessment,
    JointFinding,
    Judgement,
    Rejected,
    RepairSet,
    RigidBound,
    UncertaintyBudget,
    Verdict,
)
from mlg_troubleshoot.decision.belief import Belief, chance_random
from mlg_troubleshoot.decision.case import Cases, chance_at
from mlg_troubleshoot.decision.consequences import consequences
from mlg_troubleshoot.decision.fleet import Fleet
from mlg_troubleshoot.decision.inspection import Inspection, InvalidRow
from mlg_troubleshoot.decision.likely_worn import explain
from mlg_troubleshoot.decision.plan import Basis, Plan
from mlg_troubleshoot.decision.planner import Judged, correct, plans
from mlg_troubleshoot.decision.prediction import (
    PROVISIONAL_U_IN,
    PROVISIONAL_U_SHARE,
    Extension,
    Prediction,
)
from mlg_troubleshoot.decision.ranking import rank_joints
from mlg_troubleshoot.decision.repair import repair_sets, rigging_alternative
from mlg_troubleshoot.decision.second_order import responses
from mlg_troubleshoot.decision.verdict_rule import verdict, with_reading
from mlg_troubleshoot.gear.gauges import DEFAULT_PLUNGER_U_IN
from mlg_troubleshoot.gear.gear import ROUNDING_IN, Gear
from mlg_troubleshoot.indices.index_table import IndexTable
from mlg_troubleshoot.units import Length, Sentence

# Rows judged at once, by one process: bounds the memory. [1]
AT_ONCE = 512


def assess(
    rows: Sequence[Inspection | InvalidRow],
    gear: Gear,
    table: IndexTable,
    *,
    advice: bool = False,
    extension: Extension | None = None,
    fleet: Fleet | None = None,
) -> tuple[Judgement, ...]:
    """Judge rows: verdict, plan, repair sets and allowances; with `advice` re-rigging and
    the joints that are likely worn. `fleet` is what other gears teach.
    """
    parts = [rows[start : start + AT_ONCE] for start in range(0, len(rows), AT_ONCE)]
    task = partial(_judge_part, gear, table, advice, extension, fleet)
    return tuple(chain.from_iterable(map(task, parts)))


def _judge_part(
    gear: Gear,
    table: IndexTable,
    advice: bool,
    extension: Extension | None,
    fleet: Fleet | None,
    part: Sequence[Inspection | InvalidRow],
) -> tuple[Judgement, ...]:
    valid = [row for row in part if isinstance(row, Inspection)]
    # Gears of which the same is known are judged once; to an extension it matters whose they are.
    known: list[object] = [
        n
        if extension is not None
        else tuple(tuple(v.items()) if isinstance(v, Mapping) else v for v in _KNOWN(row))
        for n, row in enumerate(valid)
    ]
    alike = dict(zip(known, valid, strict=True))
    # Products of this size take twice as long where they wait for other threads.
    with threadpool_limits(1, "blas"):
        cases = Cases.of(gear, [*alike.values()], fleet=fleet)
        found = _assess_valid(cases, table, advice) if valid else []
        if extension is not None and valid:
            extended = _assess_valid(replace(cases, extension=extension), table, advice)
            approval = extension.approval
            found = [_worse(*both, approval) for both in zip(found, extended, strict=True)]
        if advice:
            found = [_with_consequences(a, cases, table) for a in found]
    judged = dict(zip(alike, found, strict=True))
    assessed = (
        replace(judged[each], inspection=row) for each, row in zip(known, valid, strict=True)
    )
    return tuple(
        (
            next(assessed)
            if isinstance(row, Inspection)
            else Rejected(row, correct(row), row.warnings)
        )
        for row in part
    )


# What a judgement without an extension does not depend on.
_IDENTITY = {"record_id", "tail_no", "side", "source", "carried", "other_columns"}
_KNOWN = attrgetter(*(f.name for f in fields(Inspection) if f.name not in _IDENTITY))


def _with_consequences(a: Assessment, cases: Cases, table: IndexTable) -> Assessment:
    """Add what follows each outcome of the next action."""

    def judge(rows: list[Inspection]) -> list[Assessment]:
        hypothetical = Cases.of(cases.gear, rows, fleet=cases.fleet)
        return _assess_valid(hypothetical, table, advice=False)

    then = consequences(a, cases.gear, judge)
    return replace(a, plan=replace(a.plan, then=then))


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


def _assess_valid(cases: Cases, table: IndexTable, advice: bool) -> list[Assessment]:
    lower, upper = cases.predict_bounds()
    p_lower, p_upper = (
        each.probability_within(cases.margin_in, cases.margin_u_in) for each in (lower, upper)
    )
    closes = np.isfinite(lower.displacement_in)
    # A reading clears a gear by what is known of its joints: those that were not read count as 0.
    known = chance_at(cases, cases.filled(0.0))
    chance = known.copy()
    unread = np.flatnonzero(~cases.measured.all(axis=1))
    if len(unread) and cases.extension is None:
        chance[unread] = chance_random(cases.take(unread))
    verdicts = _verdicts(cases, p_lower, p_upper, known)
    found = [verdict for verdict, _basis in verdicts]
    wanted = np.array([v is not Verdict.WITHIN_MARGIN for v in found]) & closes
    findings = rank_joints(
        cases.gear,
        table,
        cases.clearance_in,
        allowances(cases, lower),
        cases.gauge_u_in,
    )
    order = np.array([[f.rank for f in row] for row in findings]).argsort(axis=1)
    judged = Judged(
        found,
        [basis for _verdict, basis in verdicts],
        lower,
        upper,
        chance,
        order,
        p_lower,
        lower.standard_uncertainty(cases.margin_u_in),
    )
    belief = cache(lambda row: Belief(cases.take([row])))
    planned, tried = plans(cases, judged, belief)
    sets = repair_sets(cases, upper, np.flatnonzero(wanted), tried, belief)
    asked = belief if advice else None
    return [
        _assessment(cases, judged, i, findings[i], planned[i], sets[i], asked)
        for i in range(len(cases))
    ]


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
    plan: Plan,
    sets: tuple[RepairSet, ...],
    belief: Callable[[int], Belief] | None,
) -> Assessment:
    inspection = cases.inspections[i]
    lower = judged.lower
    margin = float(cases.margin_in[i])
    closes = bool(np.isfinite(lower.displacement_in[i]))
    # A linkage of the ensemble may not close where the reference does: the uncertainty is then
    # unknown.
    known = closes and bool(np.isfinite(judged.u_in[i]))

    def number_or_none(value: Any, when: bool = closes) -> float | None:
        return float(value) if when and np.isfinite(value) else None

    worst = float(lower.worst.over_in[i]), float(lower.worst.under_in[i])
    budget = _budget(judged.lower, cases, i) if known else None
    size = abs(float(cases.plunger_in[i]))
    most = _explained_at_most(cases, judged.upper, i)
    detail = _detail(cases, judged, i, budget, belief) if belief is not None and closes else {}
    found = Assessment(
        inspection=inspection,
        verdict=judged.verdicts[i],
        # Adding zero turns a minus zero into zero.
        predicted_displacement_in=number_or_none(lower.displacement_in[i] + 0.0),
        over_travel_in=number_or_none(worst[0]),
        under_travel_in=number_or_none(worst[1]),
        predicted_upper_in=number_or_none(judged.upper.displacement_in[i], True),
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
        plan=plan,
        basis=judged.bases[i],
        bound_in=number_or_none(lower.bound_in[i] + 0.0, True),
        explained_at_most_in=number_or_none(most),
        unexplained_in=number_or_none(size - most),
        headline="",
        alarm=sentences.alarms(
            [f.joint for f in findings if f.over_limit], failed=bool(cases.failed[i])
        ),
        repair_sets=sets if closes else None,
        warnings=_warnings(cases, i, findings, worst, float(judged.u_in[i])),
        **detail,
    )
    return replace(found, headline=_headline(found, cases, i))


def _explained_at_most(cases: Cases, upper: Prediction, i: int) -> float:
    """What of a measured displacement the joints explain at most, unmeasured ones at their limit.
    [in]
    """
    measured = float(cases.plunger_in[i])
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


def _detail(
    cases: Cases,
    judged: Judged,
    i: int,
    budget: UncertaintyBudget | None,
    belief: Callable[[int], Belief],
) -> dict[str, Any]:
    """What is worked out for a gear that is looked at alone."""
    detail: dict[str, Any] = {}
    if budget is not None and judged.verdicts[i] in (Verdict.OUTSIDE_MARGIN, Verdict.INCONCLUSIVE):
        worst = judged.lower.worst
        worst_in = float(worst.over_in[i]), float(worst.under_in[i])
        detail["rigging"] = rigging_alternative(cases.take([i]), worst_in, budget)
    if np.isfinite(cases.plunger_in[i]) and cases.failed[i]:
        detail["posterior"] = explain(belief(i))
    return detail


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
    warnings += [sentences.over_limit(gear, finding) for finding in findings if finding.over_limit]
    read = [f.clearance_in for f in findings if f.clearance_in is not None]
    if all(f.clearance_in == f.limit_in for f in findings):
        warnings.append(sentences.LIMITS_WRITTEN)
    elif len(read) >= sentences.LEAST_ALIKE and len(set(read)) == 1 and read[0] > 0.0:
        warnings.append(sentences.one_value(read[0]))
    warnings += _down_lock(cases, i)
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
        differs = plunger_reading.disagreement(inspection, *worst_in, u)
        if differs is not None:
            warnings.append(differs)
    if inspection.gauge_u_is_default and inspection.clearance_in:
        warnings.append(
            Sentence.of(
                "Standard uncertainty of the gauge not stated: {} radial taken as the default.",
                Length(inspection.gauge_u_in, 5),
            )
        )
    if inspection.standing_readings_in and inspection.plunger_gauge_u_in is None:
        warnings.append(
            Sentence.of(
                "Standard uncertainty of the plunger reading not stated: {} taken as the default.",
                Length(DEFAULT_PLUNGER_U_IN),
            )
        )
    if inspection.is_repaired:
        over = [f.joint for f in findings if f.over_limit]
        warnings += sentences.older_than_the_repair(inspection, over)
    return tuple(warnings)


def _down_lock(cases: Cases, i: int) -> list[str]:
    at = cases.inspections[i].plunger_down_lock_in
    if at is None or not cases.off_down_lock[i]:
        return []
    low, high = cases.gear.down_lock_range
    return [
        Sentence.of(
            "Plunger at Down Lock {} is outside {} to {}: check the rigging first.",
            Length(at),
            Length(low, 2, named=False),
            Length(high, 2),
        )
    ]


def allowances(cases: Cases, lower: Prediction) -> Array:
    """How much further each measured joint may wear, alone, until the worst case reaches the margin
    or it its limit.

    NaN for a joint that was not measured, and for a gear that is beyond its margin already. The
    second-order expansion, anchored at the exact worst case, gives the wear; one exact worst case
    along its directions corrects it. [in]
    """
    gear = cases.gear
    reference = responses(cases.gear)[0]
    start = cases.filled(0.0)
    worst = lower.displacement_in
    slopes = reference.slopes(start)
    bend = np.diag(reference.worst_curvature)
    sense = np.where(lower.worst.over_in >= -lower.worst.under_in, 1.0, -1.0)[:, None]
    left = (cases.margin_in - worst)[:, None]
    room = np.maximum(gear.limits_in - start, 0.0)
    # Root of slope·t + ½·bend·t² = left, in the form that is stable where the curvature is zero.
    root = np.sqrt(np.maximum(slopes**2 + 2.0 * sense * bend * left, 0.0))
    wear = np.minimum(2.0 * left / np.maximum(slopes + root, 1e-9), room)
    if cases.extension is None:
        worn = start[:, None, :] + wear[:, :, None] * np.eye(start.shape[1])
        senses = np.repeat(sense[:, 0], start.shape[1])
        links = reference.worst_links(worn.reshape(-1, start.shape[1]), senses)
        exact = (senses * gear.model.displacement(list(links))).reshape(wear.shape)
        wear = np.clip(
            wear + (cases.margin_in[:, None] - exact) / np.maximum(slopes, 1e-9), 0.0, room
        )
    return np.where(cases.measured & (left >= 0.0), wear, np.nan)
