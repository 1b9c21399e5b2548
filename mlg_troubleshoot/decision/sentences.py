"""Every sentence that a verdict, a step or an end can say: one place for screen, batch, files and
paper.

Instructions have at most 20 words, descriptions 25 (ASD-STE100).
"""

from __future__ import annotations

from collections.abc import Collection, Sequence

from mlg_troubleshoot.decision.assessment import (
    STOP,
    Assessment,
    Basis,
    End,
    JointFinding,
    Verdict,
)
from mlg_troubleshoot.decision.inspection import Inspection
from mlg_troubleshoot.decision.verdict_rule import CONFORMANCE
from mlg_troubleshoot.gear.gear import Gear, SourceKind
from mlg_troubleshoot.units import ClearanceConvention, Length, Sentence

NO_CLOSURE = "COULD BE OUTSIDE: the linkage does not close with these clearances."
CHECK_ENTRIES = "Do not use. Correct the entries: the linkage does not close with these clearances."
LIMITS_WRITTEN = (
    "Every clearance is the limit of its joint. Were limits written in place of readings?"
    " Enter what was read."
)
# So many joints that read the same were hardly each read. [1]
LEAST_ALIKE = 5
NOT_A_RELEASE = "This is not a release to service."
CONFIRM = "Do not use. Confirm the readings in question and their unit, or correct them."
RETRACT = "Retract the gear (trial retraction). Enter the outcome with its date and time."
READ_PLUNGER = "Read the plunger displacement at mid-position."
_ONCE_MORE = "Read the plunger displacement at mid-position once more."
READ_PLUNGER_AGAIN = f"{_ONCE_MORE} One reading is too close to the margin."
READ_A_THIRD_TIME = f"{_ONCE_MORE} The two readings differ."
RESTORE_WORN = "Restore the joints that are over their limits."
_SET_THAT_HOLDS = (
    "set of joints that can be restored brings the worst case within the margin with"
    f" {100.0 * CONFORMANCE:.0f} % probability."
)
_SIGN_OFF = "Sign the repair off in the aircraft's records."
_NOTHING = "Nothing is required."
_TOO_CLOSE = "The gear is too close to its margin to show that it is within it."
SIGN_OFF_TOO_CLOSE = f"{_SIGN_OFF} {_TOO_CLOSE}"
_GO_ON = {
    End.TOO_CLOSE: f"{_NOTHING} {_TOO_CLOSE}",
    End.OUTSIDE_NO_COMPLAINT: (
        "Refer the gear to engineering. The plunger is outside its margin; no failure is recorded."
    ),
    End.CANNOT_CLEAR: f"Refer the gear to engineering. No {_SET_THAT_HOLDS}",
    End.NOT_EXPLAINED: (
        "Check hydraulics, reversing valve and doors. The plunger reads within its margin: joint"
        " clearances do not explain the failure."
    ),
}


def percent(share: float) -> str:
    """Write a probability as a percentage that is never rounded to a 0 or a 100 that it is not."""
    if 0.0 < share < 0.001:
        return "< 0.1 %"
    if 0.999 < share < 1.0:
        return "> 99.9 %"
    near_an_end = 0.0 < share < 0.1 or 0.9 < share < 1.0
    return f"{100.0 * share:.{1 if near_an_end else 0}f} %"


def joint_list(joints: Sequence[int]) -> str:
    """Joints as a list: ``#3, #5``."""
    return ", ".join(f"#{joint}" for joint in joints)


def joints_are(joints: Sequence[int], one: str = "is", more: str = "are") -> str:
    """Joints as a subject with its verb: ``#3 is``, ``#3, #5 are``."""
    return f"{joint_list(joints)} {one if len(joints) == 1 else more}"


def chance_said(chance: float | None) -> str:
    """Write a chance with random directions: none of a few thousand sets is not never, and joints
    may be unread.
    """
    return percent(chance) if chance else "< 0.1 %"


def headline(a: Assessment, measured_in: float) -> Sentence:
    """The words of a verdict, as every channel prints them; NaN if the plunger was not read."""
    head = a.title
    margin = Length(a.margin_in)
    if a.basis is Basis.MEASURED:
        head = Sentence.of(
            "{} {} of {}.", head, Length(measured_in, sign=True, named=False), margin
        )
        within = a.verdict is Verdict.WITHIN_MARGIN
        said = within and a.predicted_displacement_in
        return Sentence.joined([head, _worst(a)]) if said else head
    question = a.inspection.unit_question
    if question:
        return Sentence.of("{}: confirm the readings. {}", head, question)
    if a.predicted_displacement_in is None:
        return Sentence(NO_CLOSURE)
    if a.verdict is Verdict.INCOMPLETE:
        return Sentence.of("{}: {} not measured.", head, joint_list(a.unread))
    worst = Length(a.predicted_displacement_in, named=False)
    if a.verdict is Verdict.WITHIN_MARGIN:
        where = "as loaded" if a.as_loaded else "even in the worst directions"
        return Sentence.of("{}, {}: {} of {}.", head, where, worst, margin)
    what = "as loaded" if a.as_loaded else "worst case"
    chance = chance_said(a.probability_exceed_random_directions)
    return Sentence.of("{}: {} {} of {}, chance {}.", head, what, worst, margin, chance)


def _worst(a: Assessment) -> Sentence:
    alone = " from the joints that were read" if a.unread else ""
    return Sentence.of(
        "Worst directions could reach {}{}, chance {}.",
        Length(a.predicted_displacement_in or 0.0),
        alone,
        chance_said(a.probability_exceed_random_directions),
    )


def close_reading(measured_in: float, u_in: float) -> Sentence:
    """Why a plunger that was measured within its margin does not clear the gear."""
    return Sentence.of(
        "The plunger was measured {}, with a standard uncertainty of {}.",
        Length(measured_in, sign=True),
        Length(u_in),
    )


OFF_DOWN_LOCK = "The plunger is out of its position at Down Lock: check the rigging first."


def alarms(over: Sequence[int], *, failed: bool) -> str:
    """What must be done about a gear whatever its verdict."""
    said = ["The gear FAILED."] if failed else []
    if over:
        said.append(f"Over the limit: {joint_list(over)}.")
    return " ".join(said)


def over_limit(gear: Gear, finding: JointFinding, kind: ClearanceConvention) -> Sentence:
    """A joint over its limit, as it was read, with where the limit comes from."""
    limit = gear.joint(finding.joint).limit
    read = finding.clearance_in or 0.0
    # Shown as it was compared: never two numbers alike.
    decimals = 5 if f"{read:.4f}" == f"{limit.value:.4f}" else 4
    assumed = ", an assumed limit: look up the manual's"
    return Sentence.of(
        "#{} {}: {} {} is over its limit of {}{}.",
        finding.joint,
        finding.name,
        Length(read * kind.per_radial, decimals),
        kind.words,
        Length(limit.value * kind.per_radial, decimals),
        assumed if limit.kind is SourceKind.ASSUMED else f" ({limit.kind})",
    )


def one_value(read_in: float) -> str:
    """Say that all joints read one clearance. [in]"""
    return Sentence.of(
        "Every clearance is {}, hardly a reading of each joint. Were they filled in? Enter what"
        " was read.",
        Length(read_in),
    )


def larger_margin(stated_in: float, of_the_gear_in: float) -> Sentence:
    """An inspection whose own margin allows more than that of the gear file."""
    return Sentence.of(
        "The margin of {} stated for this gear is larger than that of the gear file ({}). The"
        " verdict uses the stated one. Check the entry.",
        Length(stated_in),
        Length(of_the_gear_in),
    )


def beside(displacement_in: float | None, verdict: Verdict) -> Sentence:
    """What an extension predicts, after the headline of a verdict that it does not relax."""
    if displacement_in is None:
        return Sentence("With the extension the linkage does not close.")
    return Sentence.of(
        "With the extension: {}, {}; it relaxes no verdict.",
        Length(displacement_in),
        verdict.title().lower(),
    )


def go_on(end: End, *, read: bool, beyond: bool, looked: bool) -> str:
    """Step CONTINUE: where to look depends on where the plunger stands."""
    if end is End.NOT_EXPLAINED and not read:
        return (
            "IF the plunger reads within its margin, THEN check hydraulics, reversing valve and"
            " doors."
        )
    if end is not End.NOT_EXPLAINED or not beyond:
        return _GO_ON[end]
    if looked:
        return (
            "Refer the gear to engineering. The joints do not explain the plunger position, and the"
            " rigging was checked."
        )
    return (
        "Refer the gear to engineering if the rigging is right. The joints do not explain the"
        " plunger position."
    )


_COUNTS = ("No", "One", "Two", "Three", "Four", "Five", "Six", "Seven", "Eight", "Nine", "Ten")


def done(unread: int, *, repaired: bool) -> str:
    """Step DONE; `repaired`: joints were restored; `unread`: joints that were not read."""
    said = [_SIGN_OFF if repaired else _NOTHING]
    if unread:
        count = _COUNTS[unread] if unread < len(_COUNTS) else str(unread)
        verb, what = ("was", "it") if unread == 1 else ("were", "them")
        joints = "joint" if unread == 1 else "joints"
        said.append(
            f"{count} {joints} {verb} not read: read {what} if the manual asks for every limit."
        )
    return " ".join([*said, NOT_A_RELEASE])


def read_to_clear(minutes: float) -> str:
    """Step READ_PLUNGER of a gear without a complaint."""
    return (
        f"{_NOTHING} To show that the gear is within its margin, read the plunger"
        f" ({minutes:.0f} min)."
    )


def check_rigging(stands_in: float | None, as_new: Sequence[int]) -> Sentence:
    """Step CHECK_RIGGING; `as_new`: joints that read like new parts on a gear that failed."""
    stands = (
        ""
        if stands_in is None
        else Sentence.of(" The plunger is {} off.", Length(stands_in, sign=True))
    )
    said = Sentence.of(
        "Check rigging and lock roller.{} Enter rigging_checked: yes or corrected.", stands
    )
    if not as_new:
        return said
    asked = (
        f" IF {joints_are(as_new, 'was', 'were')} restored after the failure, THEN enter that in"
        " restored_joints."
    )
    return Sentence.of("{}{}", said, asked)


def open_question(unread: Sequence[int], over: Sequence[int]) -> str | None:
    """What cannot be settled today."""
    said = []
    if unread:
        barred = joints_are(unread, *(f"cannot be reached and {are}" for are in ("is", "are")))
        said.append(f"{barred} not read.")
    if over:
        said.append(f"{joints_are(over)} over the limit and cannot be restored today.")
    return " ".join(said) or None


def stop_for_today(over: Sequence[int], barred: Sequence[int]) -> str:
    """Step CONTINUE: joints over their limit have to wait, or joints that the day bars from being
    read or restored.
    """
    if over:
        because = f": {joint_list(over)} must be restored but cannot be"
    else:
        because = f": {joint_list(barred)} would decide, but cannot be reached or restored"
    return f"{STOP}{because}. Hand over what stays open."


def measure(gear: Gear, joints: Sequence[int]) -> str:
    """Step MEASURE."""
    if len(joints) == 1:
        return f"Measure #{joints[0]} {gear.joint(joints[0]).name}."
    return f"Measure, in this order: {joint_list(joints)}."


def measure_again(joints: Sequence[int]) -> str:
    """Step MEASURE_AGAIN."""
    return f"Measure {joint_list(joints)} once more with another gauge."


def restore(joints: Sequence[int], over: Sequence[int]) -> str:
    """Step RESTORE; `over`: those over their limits."""
    order = ", in this order:" if len(joints) > 1 else ""
    said = f"Restore{order} {joint_list(joints)}."
    sound = [joint for joint in joints if joint not in over]
    if over and sound:
        said += f" {joints_are(sound)} within the limit and must move less."
    return said


def correct(columns: Sequence[str]) -> str:
    """Step CORRECT of a row that cannot be judged."""
    what = ", ".join(columns) if columns else "see the list of problems"
    return f"CANNOT BE JUDGED. Correct: {what}."


def no_repair_set(a: Assessment) -> str:
    """Why no repair is offered."""
    if (a.probability_within_margin or 0.0) >= CONFORMANCE:
        of_which = " of the measured joints" if a.unread else ""
        return f"None needed: the worst case{of_which} is within the margin already."
    if a.unread:
        return (
            f"No repair set is certain while {joints_are(a.unread)} not measured. Unmeasured"
            " joints count at their limit here."
        )
    return f"No {_SET_THAT_HOLDS}"


def older_than_the_repair(inspection: Inspection, over: Collection[int]) -> list[str]:
    """Ask about what stands in a row and may be older than its repair; joints over their limit."""
    said = [
        f"#{joint} was restored, but its reading is over its limit. If it was taken before, leave"
        " it blank and read the joint once more."
        for joint in inspection.restored_joints
        if joint in over
    ]
    if inspection.outcome is not None:
        counts = inspection.is_since_repair(inspection.outcome_date)
        said += _order(f"outcome {inspection.outcome}", "outcome_date", counts)
    if inspection.readings_in:
        counts = inspection.is_since_repair(inspection.plunger_date)
        said += _order("plunger reading", "plunger_date", counts)
    if inspection.repair_date is None:
        said.append("The repair has no date: enter repair_date, with the time if known.")
    return said


def _order(what: str, column: str, is_newer: bool | None) -> list[str]:
    """Say what of a row does not count, or not for certain, because of its repair."""
    if is_newer:
        return []
    if is_newer is False:
        return [f"The {what} is older than the repair and does not count."]
    return [
        f"The {what} may be older or newer than the repair: the worse of both counts. Enter"
        f" {column}, on the day of the repair with both times."
    ]
