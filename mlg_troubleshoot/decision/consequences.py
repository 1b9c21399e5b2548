"""What follows each outcome of the next action: IF … THEN …, by the same rule that gave it.

Each outcome is a typical reading, entered in the inspection and judged again.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from datetime import date
from typing import Any

from mlg_troubleshoot.decision.assessment import Assessment
from mlg_troubleshoot.decision.inspection import Inspection, Outcome, RiggingCheck
from mlg_troubleshoot.decision.plan import Action, Consequence
from mlg_troubleshoot.decision.sentences import joints_are
from mlg_troubleshoot.gear.gear import Gear

# Typical readings: shares of a limit or a margin, well within it, and beyond it. [1]
_WELL_WITHIN, _BEYOND = 0.4, 1.4
# Days after whatever is known of a gear.
_REPAIR_DAY, _LATER = date(9999, 12, 1), date(9999, 12, 2)


def consequences(
    a: Assessment, gear: Gear, judge: Callable[[list[Inspection]], list[Assessment]]
) -> tuple[Consequence, ...]:
    """Judge a gear once more for each outcome of its next action."""
    cases = list(_outcomes(a, gear))
    rows = [replace(a.inspection, **changed) for _outcome, changed in cases]
    found = []
    for (outcome, _changed), judged in zip(cases, judge(rows) if rows else [], strict=True):
        step = judged.next_action
        text = f"IF {outcome}, THEN {step.text[0].lower()}{step.text[1:]}"
        found.append(Consequence(outcome, step.action, step.joints, step.minutes, text))
    return tuple(found)


def _outcomes(a: Assessment, gear: Gear) -> Iterator[tuple[str, dict[str, Any]]]:
    """Outcomes of the next action, with what each changes in the inspection."""
    row = a.inspection
    step = a.next_action
    names_are = joints_are(step.joints)
    day = _LATER if row.is_repaired else row.plunger_date
    match step.action:
        case Action.READ_PLUNGER:
            for share, where in ((_WELL_WITHIN, "within"), (_BEYOND, "beyond")):
                reading = (*row.standing_readings_in, share * a.margin_in)
                changed = {"readings_in": reading, "plunger_date": day}
                yield f"the plunger is {where} its margin", changed
        case Action.MEASURE:
            yield "all are within their limits", _read(row, gear, step.joints, ())
            yield f"#{step.joints[0]} is over its limit", _read(row, gear, step.joints, (0,))
        case Action.MEASURE_AGAIN:
            again = {"measured_again": (*row.measured_again, *step.joints)}
            yield f"{names_are} over the limit again", again
            yield f"{names_are} within the limit", again | _read(row, gear, step.joints, ())
        case Action.CHECK_RIGGING:
            yield "the rigging is right", {"rigging_checked": RiggingCheck.YES}
            corrected = {"rigging_checked": RiggingCheck.CORRECTED, "repair_date": _REPAIR_DAY}
            yield "the rigging was wrong and is set right", corrected
        case Action.RESTORE:
            new = {n: gear.joint(n).new_part.value for n in step.joints}
            yield (
                f"{names_are} restored",
                {
                    "clearance_in": {**row.clearance_in, **new},
                    "restored_joints": tuple(sorted({*row.restored_joints, *step.joints})),
                    "repair_date": _REPAIR_DAY,
                },
            )
        case Action.RETRACT:
            for outcome, word in ((Outcome.RETRACTED, "retracts"), (Outcome.FAILED, "fails")):
                yield f"the gear {word}", {"outcome": outcome, "outcome_date": _LATER}


def _read(
    row: Inspection, gear: Gear, joints: tuple[int, ...], over: tuple[int, ...]
) -> dict[str, Any]:
    """Readings of joints, those at some places over their limits."""
    shares = {n: _BEYOND if place in over else _WELL_WITHIN for place, n in enumerate(joints)}
    read = {n: share * gear.joint(n).limit.value for n, share in shares.items()}
    return {"clearance_in": {**row.clearance_in, **read}}
