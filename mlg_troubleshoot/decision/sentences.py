"""Every sentence that a verdict, a step or an end can say: one place for screen, batch, files and
paper.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from datetime import date

from mlg_troubleshoot.decision.assessment import (
    Assessment,
    RepairKind,
    RepairSet,
    Rigging,
    Verdict,
)
from mlg_troubleshoot.decision.inspection import Inspection
from mlg_troubleshoot.decision.plan import STOP, End
from mlg_troubleshoot.decision.verdict_rule import CONFORMANCE
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.units import Length, Sentence

NO_CLOSURE = (
    "With these clearances the linkage does not close in its worst position: outside any margin."
)
CHECK_ENTRIES = (
    "Do not use. Correct: the linkage does not close with these clearances; check the entries."
)
LIMITS_WRITTEN = (
    "Every clearance is the limit of its joint: if limits were written in place of readings, the"
    " verdict says nothing of this gear; enter what was read."
)
# So many joints that read the same were hardly each read. [1]
LEAST_ALIKE = 5
_SET_THAT_HOLDS = (
    "set of joints that can be restored brings the worst case within the margin with"
    f" {100.0 * CONFORMANCE:.0f} % probability."
)
GO_ON = {
    End.WITHIN: "Go on with fault isolation: within margin is not a release to service.",
    End.NOT_EXPLAINED: (
        "Joint clearances do not explain it: check rigging, lock roller, reversing valve,"
        " hydraulics, doors."
    ),
    End.TOO_CLOSE: "Go on: too close to the margin for the model to decide.",
    End.OUTSIDE_NO_COMPLAINT: (
        "Go on: clearances could contribute, but no failure is recorded. Engineering decides."
    ),
    End.CANNOT_CLEAR: f"Refer the gear to engineering: no {_SET_THAT_HOLDS}",
}


OFF_DOWN_LOCK = (
    "The plunger is out of its position at Down Lock: what is predicted does not hold before the"
    " rigging is checked."
)
ALL_WITHIN_LIMITS = "Every joint was measured and is within its limit."
FAILED_BUT_WITHIN = (
    "Joint clearances do not explain this failure: check hydraulics, reversing valve, doors."
)
FAILED_AND_UNREAD = (
    "Joint clearances do not explain this failure: check rigging and lock roller first, unless the"
    " plunger is read within its margin."
)
_BEYOND_NOT_EXPLAINED = (
    "Joint clearances do not explain the plunger position. If rigging and lock roller were set"
    " right, read the plunger again; if they are right, refer the gear to engineering."
)
_BEYOND_AND_LOOKED = (
    "Joint clearances do not explain the plunger position, and rigging and lock roller were"
    " checked: refer the gear to engineering."
)
RETRACT = "Retract the gear (trial retraction). Enter the outcome with its date and time."


def one_value(read_in: float) -> str:
    """Say that all joints read one clearance. [in]"""
    return Sentence.of(
        "Every clearance is {}, hardly a reading of each joint: if they were filled in, the"
        " verdict says nothing of this gear; enter what was read.",
        Length(read_in),
    )


def percent(share: float) -> str:
    """Write a probability as a percentage that is never rounded to a 0 or a 100 that it is not."""
    if 0.0 < share < 0.001:
        return "< 0.1 %"
    if 0.999 < share < 1.0:
        return "> 99.9 %"
    near_an_end = 0.0 < share < 0.1 or 0.9 < share < 1.0
    return f"{100.0 * share:.{1 if near_an_end else 0}f} %"


def go_on(end: End, *, failed: bool, beyond: bool, looked: bool, look_again: str) -> str:
    """Step CONTINUE: where to look depends on where the plunger stands."""
    if end is End.NOT_EXPLAINED and beyond:
        return _BEYOND_AND_LOOKED if looked else _BEYOND_NOT_EXPLAINED
    if end is End.NOT_EXPLAINED and failed:
        return FAILED_BUT_WITHIN
    return f"{GO_ON[end]} {look_again}".rstrip()


def done(*, repaired: bool, recorded: bool, read: int, unread: int) -> str:
    """Step DONE; `recorded`: the inspection names the repair already; `read`, `unread`: how many
    joints were read, and how many never.
    """
    if not read:
        stands = "No joint was read"
    else:
        stands = f"{'The joints that were read' if unread else 'Joints'} are within limits"
    if repaired:
        then = "; record the repair. This"
    elif recorded:
        then = ", and the repair is entered here: sign it off in the aircraft's records. This"
    else:
        then = ". No further action on the joints; this"
    return f"{stands}{then} is not a release to service."


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
        f" If {joint_list(as_new)} were restored after the failure, enter them in restored_joints"
        " and read the plunger again instead."
    )
    return Sentence.of("{}{}", said, asked)


# Landings and months after which a gear that is too close is looked at again: half of what most
# operators leave between inspections of this kind; assumed. [landings, months]
_AGAIN_LANDINGS = 300
_AGAIN_MONTHS = 6


def look_again(inspection: Inspection) -> str:
    """By when a gear that is too close to its margin is looked at again."""
    day = inspection.inspection_date
    landings = inspection.gear_landings
    if landings is not None:
        by = f"at {landings + _AGAIN_LANDINGS:.0f} landings"
    else:
        by = f"within {_AGAIN_LANDINGS} landings"
    if day is None:
        return f"Look again {by} or {_AGAIN_MONTHS} months, whichever comes first."
    month = day.month + _AGAIN_MONTHS
    year = min(day.year + (month - 1) // 12, date.max.year)
    until = date(year, (month - 1) % 12 + 1, min(day.day, 28))
    return f"Look again {by} or by {until.isoformat()}, whichever comes first."


def open_question(unread: Sequence[int], over: Sequence[int]) -> str | None:
    """What cannot be settled today."""
    said = []
    if unread:
        are = "cannot be reached and is" if len(unread) == 1 else "cannot be reached and are"
        said.append(f"{joint_list(unread)} {are} not read.")
    if over:
        are = "is" if len(over) == 1 else "are"
        said.append(f"{joint_list(over)} {are} over the limit and cannot be restored today.")
    return " ".join(said) or None


def never_read(unread: Sequence[int], minutes: float) -> str:
    """What a plan that ends leaves unread."""
    if len(unread) == 1:
        what = f"{joint_list(unread)} was not read and may be over its limit"
        them = "it"
    else:
        what = f"{joint_list(unread)} were not read; one or more may be over its limit"
        them = "them"
    return f"{what}: to know, measure {them} ({minutes:.0f} min)."


def stop_for_today(over: Sequence[int], if_worn: Sequence[int], barred: Sequence[int]) -> str:
    """Step CONTINUE: joints over their limit have to wait, or joints that may be found worn, or
    joints that the day bars from being read or restored.
    """
    if over:
        because = f": {joint_list(over)} must be restored but cannot be"
    elif if_worn:
        because = f" if the readings find {joint_list(if_worn)} worn, which cannot be restored"
    else:
        because = f": {joint_list(barred)} would decide, but cannot be reached or restored"
    return f"{STOP}{because}. Hand over what stays open."


@dataclass(frozen=True, slots=True)
class Predicted:
    """The numbers that stand together everywhere: as predicted, over all directions, and in random
    ones. [in, 1]
    """

    displacement_in: float
    bound_in: float
    chance: float
    read: int = 1
    unread: int = 0

    @property
    def loaded(self) -> bool:
        """True where the prediction is an expectation, not a bound."""
        return self.displacement_in != self.bound_in

    @property
    def words(self) -> Sentence:
        chance = f"chance with random directions {percent(self.chance)}"
        if self.unread:
            chance += ", unread joints by their usual wear"
        if not self.read:
            return Sentence(f"no joint was read; {chance}")
        displacement = Length(self.displacement_in)
        bound = Length(self.bound_in)
        alone = " from the measured joints alone" if self.unread else ""
        if self.loaded:
            return Sentence.of(
                "as loaded {}, worst case {}{}, {}", displacement, bound, alone, chance
            )
        return Sentence.of("worst case {}{}, {}", displacement, alone, chance)


def beside(displacement_in: float | None, verdict: Verdict) -> Sentence:
    """What an extension predicts, after the headline of a verdict that it does not relax."""
    if displacement_in is None:
        return Sentence("With the extension the linkage does not close.")
    return Sentence.of(
        "With the extension: {}, {}; it relaxes no verdict.",
        Length(displacement_in),
        verdict.words.lower(),
    )


def outside(margin_in: float, said: Predicted) -> Sentence:
    """Headline of OUTSIDE_MARGIN, predicted."""
    can = "push" if said.loaded else "could push"
    return Sentence.of(
        "Clearances {} the plunger outside its margin of {} ({}).",
        can,
        Length(margin_in),
        said.words,
    )


def measured(measured_in: float, margin_in: float, where: str) -> Sentence:
    """Where the plunger was measured: ``outside`` or ``within`` its margin; outside is said first
    and loudest.
    """
    sense = "beyond" if measured_in > 0 else "short of"
    word = "MEASURED" if where == "outside" else "Measured"
    return Sentence.of(
        "{}: the plunger stands {} {} mid-position, {} its margin of {}.",
        word,
        Length(abs(measured_in)),
        sense,
        where,
        Length(margin_in),
    )


def larger_margin(stated_in: float, of_the_gear_in: float) -> Sentence:
    """An inspection whose own margin allows more than that of the gear file."""
    return Sentence.of(
        "The margin of {} stated for this gear is larger than that of the gear file ({}): the"
        " verdict uses the stated one. Check the entry.",
        Length(stated_in),
        Length(of_the_gear_in),
    )


def explained(explained_in: float, unexplained_in: float, *, by_read: bool) -> Sentence:
    """What joint clearances explain of a displacement beyond its margin."""
    if unexplained_in <= 0.0:
        then = "" if by_read else " if joints that were not read are worn"
        return Sentence(f"Joint clearances can explain all of it{then}.")
    return Sentence.of(
        "Joint clearances explain at most {} of it; {} has another cause.",
        Length(explained_in),
        Length(unexplained_in),
    )


def within(
    margin_in: float,
    said: Predicted,
    *,
    failed: bool,
    clears: bool,
    joints_done: bool,
    repaired: bool,
) -> Sentence:
    """Headline of WITHIN_MARGIN."""
    then = "Not a release." if repaired else "Continue fault isolation; not a release."
    if failed:
        then = FAILED_BUT_WITHIN if clears else FAILED_AND_UNREAD
    then = ALL_WITHIN_LIMITS if joints_done else then
    if not said.loaded:
        return Sentence.of(
            "Even the worst case stays within the margin of {} ({}). {}",
            Length(margin_in),
            said.words,
            then,
        )
    return Sentence.of(
        "Within its margin of {} as loaded ({}). Other loads than this fleet's could push it to {}."
        " {}",
        Length(margin_in),
        Length(said.displacement_in),
        Length(said.bound_in),
        then,
    )


def incomplete(open_joints: Sequence[int], said: Predicted) -> Sentence:
    """Headline of INCOMPLETE."""
    return Sentence.of("Cannot clear: not measured {} ({}).", joint_list(open_joints), said.words)


def entry_in_question(question: str, said: Predicted) -> Sentence:
    """Headline of a gear whose readings must be confirmed first."""
    return Sentence.of(
        "Cannot clear before the readings are confirmed: {} ({} as entered).", question, said.words
    )


CONFIRM = "Do not use. Confirm the readings in question and their unit, or correct them."


def inconclusive(margin_in: float, said: Predicted, p_within: float) -> Sentence:
    """Headline of INCONCLUSIVE."""
    what = "the plunger" if said.loaded else "the bound"
    return Sentence.of(
        "Too close to the margin of {} to decide ({}; probability that {} is within the margin"
        " {}).",
        Length(margin_in),
        said.words,
        what,
        percent(p_within),
    )


def plunger_unsettled(measured_in: float, u_in: float, margin_in: float) -> Sentence:
    """Headline of INCONCLUSIVE where only the plunger's reading is too close to its margin."""
    return Sentence.of(
        "Measured: the plunger is {} off, which two standard uncertainties of {} bring beyond its"
        " margin of {}: too close to decide.",
        Length(abs(measured_in)),
        Length(u_in),
        Length(margin_in),
    )


def measure(gear: Gear, joints: Sequence[int]) -> str:
    """Step MEASURE."""
    if len(joints) == 1:
        return f"Measure #{joints[0]} {gear.joint(joints[0]).name}."
    return f"Measure, in this order: {joint_list(joints)}."


def measure_again(joints: Sequence[int], gauge_u_needed_in: float) -> Sentence:
    """Step MEASURE_AGAIN."""
    return Sentence.of(
        "Measure {} again with another gauge, to a standard uncertainty of {} radial or less, and"
        " confirm which convention was read.",
        joint_list(joints),
        Length(gauge_u_needed_in, 5),
    )


READ_PLUNGER = "Read the plunger displacement at mid-position."
READ_PLUNGER_AGAIN = (
    "Read the plunger displacement at mid-position once more: it is too close to its margin for one"
    " reading."
)


def restore(
    joints: Sequence[int],
    over: Sequence[int],
    best: RepairSet | None,
    *,
    unread: bool,
    expected: bool,
) -> str:
    """Step RESTORE; `expected`: what is measured before decides."""
    if expected:
        guessed = [joint for joint in joints if joint not in over]
        found = f"what the readings find worn, perhaps {joint_list(guessed)}"
        return f"Restore {f'{joint_list(over)} and ' if over else ''}{found}."
    said = (
        f"Restore, in this order: {joint_list(joints)}."
        if len(joints) > 1
        else f"Restore {joint_list(joints)}."
    )
    if over:
        said += f" Above its limit, reject to the manual: {joint_list(over)}."
    if best is None:
        return said
    if best.kind is RepairKind.TRY:
        chance = percent(best.second_repair_probability or 0.0)
        return f"{said} Then read the plunger again; chance of a second repair {chance}."
    return Sentence.of(
        "{} The worst case is then {}{}.",
        said,
        Length(best.predicted_displacement_in),
        ", unmeasured joints at their limit" if unread else "",
    )


def correct(columns: Sequence[str]) -> str:
    """Step CORRECT of a row that cannot be judged."""
    return f"Do not use. Correct: {', '.join(columns) if columns else 'see the list of problems'}."


def joint_list(joints: Sequence[int]) -> str:
    """Joints as a list: ``#3, #5``."""
    return ", ".join(f"#{joint}" for joint in joints)


def chance_wrong_sentence(a: Assessment) -> str | None:
    """The chance that a verdict by the prediction is wrong; None where no prediction decides."""
    if a.chance_wrong is None:
        return None
    what = "worst case" if a.decided_by_bound else "displacement as loaded"
    unread = (
        "; joints that were not measured count as 0"
        if any(f.clearance_in is None for f in a.joints)
        else ""
    )
    return (
        f"This gear is called {a.verdict.words.lower()}. The chance that its {what} lies on the"
        f" other side of the margin is {percent(a.chance_wrong)}{unread}."
    )


def no_repair_set(a: Assessment) -> str:
    """Why no repair is offered."""
    unread = [finding.joint for finding in a.joints if finding.clearance_in is None]
    if (a.probability_within_margin or 0.0) >= CONFORMANCE:
        of_which = " of the measured joints" if unread else ""
        return f"None needed: the worst case{of_which} is within the margin already."
    if unread:
        are = "is" if len(unread) == 1 else "are"
        return (
            f"No repair set is certain while {joint_list(unread)} {are} not measured: unmeasured"
            " joints count at their limit here."
        )
    return f"No {_SET_THAT_HOLDS}"


def older_than_the_repair(inspection: Inspection, over_limit: Collection[int]) -> list[str]:
    """Ask about what stands in a row and may be older than its repair; joints over their limit."""
    said = [
        f"Joint #{joint} was restored, and its reading, which counts as taken after that, is above"
        " its limit. Was it taken before? Then leave it blank, and read the joint once more."
        for joint in inspection.restored_joints
        if joint in over_limit
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


def rigging_sentence(rigging: Rigging) -> Sentence:
    return Sentence.of(
        "Re-rigging alone (plunger shifted by {}) would leave a worst case of {}: probability"
        " within the margin {}, chance of leaving it with random directions {}; the joints stay"
        " worn.",
        Length(rigging.shift_in, sign=True),
        Length(rigging.predicted_displacement_in),
        percent(rigging.probability_within_margin),
        percent(rigging.probability_exceed_random_directions),
    )
