"""From inspections to judgements: prediction, verdict, ranking and next action."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mlg_troubleshoot.decision import measured as measured_plunger
from mlg_troubleshoot.decision.assessment import (
    Assessment,
    JointFinding,
    Judgement,
    Rejected,
    UncertaintyBudget,
    Verdict,
)
from mlg_troubleshoot.decision.confidence import check_probability
from mlg_troubleshoot.decision.explain import explain
from mlg_troubleshoot.decision.inspection import Inspection, InvalidRow, Outcome
from mlg_troubleshoot.decision.measuring import advise, worth_of_readings
from mlg_troubleshoot.decision.next_action import FAILED_BUT_WITHIN, choose, correct
from mlg_troubleshoot.decision.prediction import BatchPrediction, Extension, predict_batch
from mlg_troubleshoot.decision.ranking import rank_joints
from mlg_troubleshoot.decision.repair import repair_sets
from mlg_troubleshoot.decision.rigging import rigging_alternative
from mlg_troubleshoot.decision.rule import verdict
from mlg_troubleshoot.decision.wording import percent
from mlg_troubleshoot.gear.adjustment import Adjustment, adjusted_worst_case
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.studies.table import IndexTable

Array = NDArray[np.float64]

_CHUNK = 1024


@dataclass(frozen=True, slots=True)
class AssessOptions:
    """What to compute beside the verdicts.

    Parameters
    ----------
    repairs : bool
        Search the repair sets of each gear that is not within its margin.
    allowances : bool
        Find how much further each joint may wear.
    advice : bool
        Say what further measuring is worth, check the probability by Monte Carlo, and find which joints explain
        a measured displacement.
    seed : int
        Seed of the Monte Carlo draws.
    extension : Extension or None
        An extension of the model to predict with.
    """

    repairs: bool = False
    allowances: bool = False
    advice: bool = False
    seed: int = 1
    extension: Extension | None = None


def assess(
    rows: Sequence[Inspection | InvalidRow],
    gear: Gear,
    table: IndexTable,
    options: AssessOptions | None = None,
    progress: Callable[[int], None] | None = None,
) -> tuple[Judgement, ...]:
    """Judge each row, in order.

    Parameters
    ----------
    rows : sequence of Inspection or InvalidRow
        The rows.
    gear : Gear
        The gear.
    table : IndexTable
        Its precomputed indices.
    options : AssessOptions, optional
        What else to compute.
    progress : callable, optional
        Called with the number of rows just done.

    Returns
    -------
    tuple of Assessment or Rejected
        One for each row, in the same order.
    """
    options = options or AssessOptions()
    judged: list[Judgement] = []
    for start in range(0, len(rows), _CHUNK):
        part = rows[start : start + _CHUNK]
        valid = [row for row in part if isinstance(row, Inspection)]
        assessed = iter(_assess_valid(valid, gear, table, options) if valid else ())
        for row in part:
            if isinstance(row, Inspection):
                judged.append(next(assessed))
            else:
                judged.append(Rejected(row, correct(row), row.warnings))
        if progress is not None:
            progress(len(part))
    return tuple(judged)


def _assess_valid(
    inspections: Sequence[Inspection], gear: Gear, table: IndexTable, options: AssessOptions
) -> list[Assessment]:
    batch = predict_batch(gear, inspections, options.extension)
    p_lower = batch.lower.probability_within(batch.margin_in, batch.margin_u_in)
    p_upper = batch.upper.probability_within(batch.margin_in, batch.margin_u_in)
    u = batch.lower.standard_uncertainty(batch.margin_u_in)
    critical = np.array([joint.critical for joint in gear.joints])
    missing = np.any(~np.isfinite(batch.clearance_in) & critical, axis=1)
    return [
        _assess_one(
            gear,
            table,
            options,
            inspection,
            batch,
            i,
            float(p_lower[i]),
            float(p_upper[i]),
            float(u[i]),
            bool(missing[i]),
        )
        for i, inspection in enumerate(inspections)
    ]


def _assess_one(
    gear: Gear,
    table: IndexTable,
    options: AssessOptions,
    inspection: Inspection,
    batch: BatchPrediction,
    i: int,
    p_lower: float,
    p_upper: float,
    u: float,
    critical_missing: bool,
) -> Assessment:
    lower, margin = batch.lower, float(batch.margin_in[i])
    # Adding zero turns a minus zero into zero.
    displacement = float(lower.displacement_in[i]) + 0.0
    closes = bool(np.isfinite(displacement))
    # A linkage of the ensemble may not close where the reference does: the uncertainty is then unknown.
    known = closes and bool(np.isfinite(u))
    found = verdict(p_lower, p_upper, critical_missing=critical_missing)
    allowances = None
    if options.allowances and closes:
        allowances = allowance(gear, inspection, margin, options.extension)
    findings = rank_joints(gear, table, inspection.clearance_in, allowances)
    sets = None
    if options.repairs:
        sets = repair_sets(gear, inspection, margin, options.extension) if found is not Verdict.WITHIN_MARGIN else ()
    worst = over, under = float(lower.worst.over_in[i]), float(lower.worst.under_in[i])
    upper = float(batch.upper.displacement_in[i])
    chance = float(batch.chance_random[i])
    model_source = (
        "provisional: the larger of 0.003 in and 10 % of the prediction, because one published failure gives none"
        if options.extension is None
        else f"residual scatter of the diagnosis ({options.extension.describe()})"
    )
    budget = None
    if known:
        budget = UncertaintyBudget(
            float(lower.u_clearances_in[i]),
            float(lower.u_geometry_in[i]),
            float(lower.u_model_in[i]),
            float(batch.margin_u_in[i]),
            model_source,
        )
    measuring = advise(gear, inspection, margin, options.extension) if options.advice and closes else None
    next_joint = None
    if measuring is not None:
        next_joint = measuring.joint
    elif found is Verdict.INCOMPLETE:
        next_joint = _next_joint(gear, inspection, margin, options.extension, findings, worst)
    rigging = None
    if options.repairs and budget is not None and found in (Verdict.OUTSIDE_MARGIN, Verdict.INCONCLUSIVE):
        rigging = rigging_alternative(gear, inspection, worst, margin, budget, options.extension)
    rng = np.random.default_rng(options.seed)
    residual = None if options.extension is None else options.extension.residual_u_in
    return Assessment(
        inspection=inspection,
        verdict=found,
        predicted_displacement_in=displacement if closes else None,
        over_travel_in=over if closes else None,
        under_travel_in=under if closes else None,
        predicted_upper_in=upper if np.isfinite(upper) else None,
        margin_in=margin,
        remaining_in=margin - displacement if closes else None,
        standard_uncertainty_in=u if known else None,
        probability_within_margin=p_lower,
        probability_exceed_random_directions=chance if closes else None,
        geometry_spread_in=(float(lower.spread_low_in[i]) + 0.0, float(lower.spread_high_in[i]) + 0.0)
        if known
        else None,
        budget=budget,
        over_directions_rad=tuple(lower.worst.over_directions[i].tolist()) if closes else (),
        under_directions_rad=tuple(lower.worst.under_directions[i].tolist()) if closes else (),
        joints=findings,
        next_action=choose(gear, found, findings, inspection.outcome, sets, next_joint),
        headline=_headline(found, displacement, chance, margin, p_lower, findings, inspection.outcome),
        measured_statement=measured_plunger.statement(inspection, margin),
        repair_sets=sets,
        warnings=_warnings(gear, inspection, findings, closes, over, under, u, options.extension),
        measuring=measuring,
        rigging=rigging,
        confidence=check_probability(gear, inspection, worst, margin, budget, rng)
        if options.advice and budget is not None
        else None,
        posterior=explain(gear, inspection, rng, residual_u_in=residual) if options.advice else None,
    )


def _next_joint(
    gear: Gear,
    inspection: Inspection,
    margin_in: float,
    extension: Extension | None,
    findings: Sequence[JointFinding],
    worst_in: tuple[float, float],
) -> int | None:
    """The joint to measure next, without the work of comparing where there is no choice."""
    missing = [f.joint for f in findings if f.clearance_in is None]
    critical = [number for number in missing if gear.joint(number).critical]
    if len(critical or missing) == 1:
        return (critical or missing)[0]
    anchor = worst_in if np.all(np.isfinite(worst_in)) else None
    return worth_of_readings(gear, inspection, margin_in, extension, anchor)[0].joint


def _headline(
    found: Verdict,
    displacement: float,
    chance: float,
    margin: float,
    p_within: float,
    findings: Sequence[JointFinding],
    outcome: Outcome | None,
) -> str:
    if not np.isfinite(displacement):
        return "With these clearances the linkage does not close in its worst position: outside any margin."
    numbers = f"worst case {displacement:.4f} in, chance with random directions {percent(chance)}"
    if found is Verdict.OUTSIDE_MARGIN:
        return f"Clearances could push the plunger outside its margin of {margin:.4f} in ({numbers})."
    if found is Verdict.WITHIN_MARGIN:
        then = FAILED_BUT_WITHIN if outcome is Outcome.FAILED else "Continue fault isolation; not a release."
        return f"Even the worst case stays within the margin of {margin:.4f} in ({numbers}). {then}"
    if found is Verdict.INCOMPLETE:
        open_joints = ", ".join(f"#{f.joint}" for f in findings if f.clearance_in is None)
        return f"Cannot clear: not measured {open_joints} ({numbers} from the measured joints alone)."
    return (
        f"Too close to the margin of {margin:.4f} in to say ({numbers}; "
        f"probability that the bound is within the margin {percent(p_within)})."
    )


def _warnings(
    gear: Gear,
    inspection: Inspection,
    findings: Sequence[JointFinding],
    closes: bool,
    over: float,
    under: float,
    u: float,
    extension: Extension | None,
) -> tuple[str, ...]:
    warnings = list(inspection.warnings)
    lacking = () if extension is None else extension.lacks(inspection)
    if lacking:
        warnings.append(
            f"The extension of the model needs {', '.join(lacking)}, which this inspection lacks: predicted without."
        )
    warnings += [
        f"Joint #{finding.joint} {finding.name}: {finding.clearance_in:.4f} in radial is above its limit of "
        f"{finding.limit_in:.4f} in ({gear.joint(finding.joint).limit.kind}): reject to the manual."
        for finding in findings
        if finding.over_limit and finding.clearance_in is not None
    ]
    down_lock = inspection.plunger_down_lock_in
    low, high = gear.down_lock_range
    if down_lock is not None and not low <= down_lock <= high:
        warnings.append(
            f"Plunger at Down Lock {down_lock:.4f} in is outside {low:.2f} to {high:.2f} in: check the rigging first."
        )
    if not closes:
        warnings.append("With these clearances the linkage does not close in every direction: check the entries.")
    elif not np.isfinite(u):
        warnings.append("With these clearances some linkages of the ensemble do not close: the uncertainty is unknown.")
    else:
        differs = measured_plunger.disagreement(inspection, over, under, u)
        if differs is not None:
            warnings.append(differs)
    if inspection.gauge_u_is_default:
        warnings.append(f"Gauge uncertainty not stated: {inspection.gauge_u_in:.5f} in radial taken as the default.")
    if inspection.outcome is Outcome.FAILED and inspection.measured_displacement_in is None:
        warnings.append("The gear failed and no plunger displacement was measured: measure it at mid-position.")
    return tuple(warnings)


def allowance(
    gear: Gear, inspection: Inspection, margin_in: float, extension: Extension | None = None
) -> dict[int, float]:
    """Find how much further each measured joint may wear, alone, until the worst case reaches the margin.

    Parameters
    ----------
    gear : Gear
        The gear.
    inspection : Inspection
        What was measured; unmeasured joints count as 0.
    margin_in : float
        Allowed displacement. [in]
    extension : Extension, optional
        An extension of the model.

    Returns
    -------
    dict of int to float
        Further radial wear by joint, at most the gear file's hard limit; empty if the worst case is beyond
        the margin already. [in]
    """
    places = [(j, joint.number) for j, joint in enumerate(gear.joints) if joint.number in inspection.clearance_in]
    start = np.array([[inspection.clearance_in.get(number, 0.0) for number in gear.joint_numbers]])

    def worst(clearance: Array) -> Array:
        same = [inspection] * len(clearance)
        adjustment = Adjustment(clearance) if extension is None else extension.adjust(same, clearance)
        return adjusted_worst_case(gear.model, adjustment).magnitude_in

    if not worst(start)[0] <= margin_in:
        return {}
    low, high = np.zeros(len(places)), np.full(len(places), gear.hard_limit.value)
    for _ in range(18):
        middle = 0.5 * (low + high)
        worn = np.tile(start, (len(places), 1))
        for row, (j, _number) in enumerate(places):
            worn[row, j] += middle[row]
        fits = worst(worn) <= margin_in
        low, high = np.where(fits, middle, low), np.where(fits, high, middle)
    return {number: float(low[row]) for row, (_j, number) in enumerate(places)}
