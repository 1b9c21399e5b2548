"""The one next action that follows from a verdict."""

from __future__ import annotations

from collections.abc import Sequence

from mlg_troubleshoot.decision.assessment import Action, JointFinding, NextAction, RepairSet, Verdict
from mlg_troubleshoot.decision.inspection import InvalidRow, Outcome
from mlg_troubleshoot.decision.repair import access_minutes
from mlg_troubleshoot.gear.gear import Gear

FAILED_BUT_WITHIN = "Joint clearances do not explain this failure: check hydraulics, reversing valve, doors."


def correct(row: InvalidRow) -> NextAction:
    """Return the next action for a row that cannot be judged.

    Parameters
    ----------
    row : InvalidRow
        The row.

    Returns
    -------
    NextAction
        What to correct.
    """
    what = ", ".join(row.correct) if row.correct else "see the list of problems"
    return NextAction(Action.CORRECT, (), f"Do not use. Correct: {what}.")


def next_to_measure(gear: Gear, findings: Sequence[JointFinding]) -> int | None:
    """Choose the unmeasured joint whose reading removes most uncertainty per minute.

    Parameters
    ----------
    gear : Gear
        The gear.
    findings : sequence of JointFinding
        The ranked table.

    Returns
    -------
    int or None
        Number of the joint, critical joints first; None if all are measured.
    """
    missing = [f for f in findings if f.clearance_in is None]
    if not missing:
        return None
    critical = [f for f in missing if gear.joint(f.joint).critical]

    def worth(finding: JointFinding) -> float:
        variance = (finding.plunger_amplification * finding.limit_in) ** 2 / 12.0
        return variance / gear.joint(finding.joint).access.value

    return max(critical or missing, key=worth).joint


def choose(
    gear: Gear,
    verdict: Verdict,
    findings: Sequence[JointFinding],
    outcome: Outcome | None,
    sets: Sequence[RepairSet] | None,
    next_joint: int | None = None,
) -> NextAction:
    """Choose the next action for a valid inspection.

    Parameters
    ----------
    gear : Gear
        The gear.
    verdict : Verdict
        The verdict.
    findings : sequence of JointFinding
        The ranked table.
    outcome : Outcome or None
        What the gear did.
    sets : sequence of RepairSet or None
        Repair sets, best first; None if they were not computed.
    next_joint : int, optional
        The joint whose reading is worth most; without it, the one that removes most variance per minute.

    Returns
    -------
    NextAction
        The one next action.
    """
    ranked = sorted(findings, key=lambda f: f.rank)
    over = tuple(f.joint for f in ranked if f.over_limit)
    failed = outcome is Outcome.FAILED
    if verdict is Verdict.OUTSIDE_MARGIN and (failed or over):
        return _restore(gear, ranked, over, sets)
    if over:
        return NextAction(
            Action.RESTORE,
            over,
            f"Joint {_list(over)} is above its limit: reject to the manual, whatever the prediction says.",
        )
    if verdict is Verdict.OUTSIDE_MARGIN:
        first = tuple(f.joint for f in ranked if f.clearance_in)[:3] or tuple(f.joint for f in ranked)[:3]
        return NextAction(Action.MEASURE, first, f"Clearances could contribute. Inspect in this order: {_list(first)}.")
    if verdict is Verdict.INCOMPLETE:
        joint = next_to_measure(gear, findings) if next_joint is None else next_joint
        if joint is None:
            raise ValueError("an inspection with every joint measured cannot be incomplete")
        return NextAction(Action.MEASURE, (joint,), f"Cannot clear. Measure #{joint} {gear.joint(joint).name} next.")
    if verdict is Verdict.WITHIN_MARGIN:
        text = FAILED_BUT_WITHIN if failed else "Continue fault isolation; within margin is not a release to service."
        return NextAction(Action.CONTINUE, (), text)
    again = max(
        (f for f in findings if f.clearance_in is not None),
        key=lambda f: f.plunger_amplification**2 / gear.joint(f.joint).access.value,
    )
    return NextAction(
        Action.MEASURE,
        (again.joint,),
        f"Too close. Measure #{again.joint} {again.name} again, more precisely.",
    )


def _restore(
    gear: Gear, ranked: Sequence[JointFinding], over: tuple[int, ...], sets: Sequence[RepairSet] | None
) -> NextAction:
    order = [f.joint for f in ranked]
    if sets:
        joints = tuple(sorted(sets[0].joints, key=order.index))
        return NextAction(
            Action.RESTORE,
            joints,
            f"Rectify, in this order: {_list(joints)} (about {sets[0].access_minutes:.0f} min access). The worst case "
            f"is then {sets[0].predicted_displacement_in:.4f} in{_unless_all_measured(ranked)}.",
        )
    worn = tuple(f.joint for f in ranked if f.clearance_in)
    joints = over or worn
    minutes = access_minutes(gear, joints)
    return NextAction(
        Action.RESTORE, joints, f"Rectify, in this order: {_list(joints)} (about {minutes:.0f} min access)."
    )


def _unless_all_measured(findings: Sequence[JointFinding]) -> str:
    missing = [f.joint for f in findings if f.clearance_in is None]
    return f", with {_list(sorted(missing))} not measured and counted as 0" if missing else ""


def _list(joints: Sequence[int]) -> str:
    return ", ".join(f"#{joint}" for joint in joints)
