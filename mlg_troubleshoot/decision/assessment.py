"""What the decision says about one gear: the result that views, reports and JSON are made from.

The advice as a plan: what to do, step by step, to an end. Only the first step binds.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import date
from enum import StrEnum
from functools import lru_cache

import numpy as np

from mlg_troubleshoot.arrays import Array, Mask, Probability, Size
from mlg_troubleshoot.decision.inspection import Fact, FactKind, Inspection, InvalidRow, Outcome
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.results import Result


class Action(StrEnum):
    """What to do; each has one word on every channel."""

    MEASURE = "MEASURE"
    MEASURE_AGAIN = "MEASURE_AGAIN"
    READ_PLUNGER = "READ_PLUNGER"
    CHECK_RIGGING = "CHECK_RIGGING"
    RESTORE = "RESTORE"
    RETRACT = "RETRACT"
    CONTINUE = "CONTINUE"
    DONE = "DONE"
    CORRECT = "CORRECT"

    @property
    def words(self) -> str:
        words = {
            "READ_PLUNGER": "read the plunger",
            "CHECK_RIGGING": "check the rigging",
            "RETRACT": "retract the gear",
            "CONTINUE": "go on",
        }
        return words.get(self.value, self.value.replace("_", " ").lower())


class End(StrEnum):
    WITHIN = "WITHIN"
    NOT_EXPLAINED = "NOT_EXPLAINED"
    TOO_CLOSE = "TOO_CLOSE"
    OUTSIDE_NO_COMPLAINT = "OUTSIDE_NO_COMPLAINT"
    CANNOT_CLEAR = "CANNOT_CLEAR"
    DONE = "DONE"
    CORRECT = "CORRECT"


# Where a plan ends, in words that stand alone; the whole sentence is the text of its last step.
_ENDS = {
    End.NOT_EXPLAINED: "Look elsewhere: the joints do not explain it",
    End.TOO_CLOSE: "Nothing required: too close to the margin to decide",
    End.OUTSIDE_NO_COMPLAINT: "Refer to engineering: outside its margin, no failure recorded",
    End.CANNOT_CLEAR: "Refer to engineering: no repair brings it within its margin",
}
# How a step begins that the day forces, whatever the end.
STOP = "Stop for today"


def in_brief(step: Step, end: End) -> str:
    """Say the next action in words that stand alone: the same on screen, in files and on paper."""
    if step.action is Action.DONE:
        return step.text.partition(".")[0]
    if step.action is Action.CONTINUE:
        stops = step.text.startswith(STOP)
        return f"{STOP}: hand over what stays open" if stops else _ENDS[end]
    return step.words.capitalize() if step.required else f"Nothing required: {step.words} to clear"


class Basis(StrEnum):
    MEASURED = "MEASURED"
    PREDICTED = "PREDICTED"


@dataclass(frozen=True, slots=True)
class Step:
    """One step of a plan.

    minutes: how long it takes: an area counts at its first step and again after a repair closed it.
    [min] gauge_u_needed_in: largest standard uncertainty of one radial reading that serves; for
    `MEASURE_AGAIN` only. [in] required: false where nothing must be done. how: where, with what,
    from which datum, what is safe.
    """

    action: Action
    joints: tuple[int, ...]
    minutes: Size
    gauge_u_needed_in: float | None
    text: str
    required: bool = True
    how: str = ""

    @property
    def words(self) -> str:
        """The step in a few words: ``measure #3, #5``."""
        joints = ", ".join(f"#{joint}" for joint in self.joints)
        return f"{self.action.words} {joints}".rstrip()


@dataclass(frozen=True, slots=True)
class Consequence:
    """What follows one outcome of the next action: IF `outcome` THEN `text`. minutes: [min]"""

    json_names = "if=outcome action joints minutes text"
    outcome: str
    action: Action
    joints: tuple[int, ...]
    minutes: Size
    text: str


@dataclass(frozen=True, slots=True)
class Plan:
    """The expected course from what is known now to an end; never empty, and only its first step
    binds.

    open_question: what the day does not allow to settle. then: what follows the outcomes of the
    first step.
    """

    steps: tuple[Step, ...]
    end: End
    open_question: str | None = None
    then: tuple[Consequence, ...] = ()


_HOW = {
    Action.READ_PLUNGER: "read_plunger",
    Action.CHECK_RIGGING: "check_rigging",
    Action.RETRACT: "trial_retraction",
    Action.MEASURE: "measure",
    Action.MEASURE_AGAIN: "measure",
    Action.RESTORE: "restore",
}


def how_to(gear: Gear, action: Action, joints: Sequence[int]) -> str:
    """How an action is done, by the gear file: where the joints are, then each instruction."""
    name = _HOW.get(action)
    if name is None:
        return ""
    places = [f"#{n}: {gear.joint(n).location}." for n in joints]
    return " ".join([*places, *gear.how[name]])


@lru_cache(maxsize=4)
def _areas(gear: Gear) -> tuple[Mask, Array, Array]:
    """Which joint is in which area; minutes to open the areas, and to restore the joints. [min]"""
    inside = np.array([[joint.area == area.name for area in gear.areas] for joint in gear.joints])
    opening = np.array([area.access.value for area in gear.areas])
    return inside, opening, np.array([joint.restore.value for joint in gear.joints])


def minutes_of(gear: Gear, joints: Mask, opened: Mask) -> tuple[Array, Array]:
    """Minutes to read joints, and to restore them, shape (..., joints): an area is opened once, and
    not where it is open for other joints. [min]
    """
    inside, opening, restoring = _areas(gear)
    opens = (joints @ inside & ~(opened @ inside)) @ opening
    return opens + joints @ gear.access_minutes, opens + joints @ restoring


class Verdict(StrEnum):
    """The five verdicts, in the order in which the rule tries them."""

    INVALID = "INVALID"
    OUTSIDE_MARGIN = "OUTSIDE_MARGIN"
    INCOMPLETE = "INCOMPLETE"
    WITHIN_MARGIN = "WITHIN_MARGIN"
    INCONCLUSIVE = "INCONCLUSIVE"

    def title(self, basis: Basis | None = None) -> str:
        """The verdict in capitals, as it heads every channel."""
        if basis is Basis.MEASURED:
            outside = self.value == "OUTSIDE_MARGIN"
            return "OUTSIDE MARGIN, MEASURED" if outside else "WITHIN MARGIN, MEASURED"
        return {
            "INVALID": "CANNOT BE JUDGED",
            "OUTSIDE_MARGIN": "COULD BE OUTSIDE",
            "INCOMPLETE": "NOT ENOUGH READ",
            "WITHIN_MARGIN": "WITHIN MARGIN",
            "INCONCLUSIVE": "CLOSE TO THE MARGIN",
        }[self.value]


class VerdictTone(StrEnum):
    """How loud a verdict is: RED is for what must be done now."""

    RED = "red"
    AMBER = "amber"
    GREEN = "green"


@dataclass(frozen=True, slots=True)
class JointFinding:
    """One line of the ranked table.

    Attributes
    ----------
    joint : int
        Number of the joint, from 1.
    name : str
        Its name.
    clearance_in : float or None
        Radial clearance; None if it was not measured. [in]
    limit_in : float
        Largest clearance allowed. [in]
    over_limit : bool
        Whether the clearance is beyond the limit.
    contribution_in : float or None
        Plunger amplification × radial clearance; None if it was not measured. [in]
    first_order, total_order : float
        Sensitivity indices of the precomputed table (Eqs. 1 and 2). [1]
    plunger_amplification : float
        A_iP at mid-position in the limit of small clearance (Eq. 8). [1]
    rank : int
        Place in the order in which to inspect, from 1.
    rank_range : tuple of int
        First and last place over the ensemble of geometries.
    acts_like : tuple of int
        Joints at the other end of the same link: plunger data alone cannot distinguish them.
    """

    joint: int
    name: str
    clearance_in: Size | None
    limit_in: Size
    over_limit: bool
    contribution_in: Size | None
    first_order: float
    total_order: float
    plunger_amplification: Size
    rank: int
    rank_range: tuple[int, int]
    acts_like: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class UnjudgedJoint:
    """A joint of a row that cannot be judged: its numbers are null in JSON."""

    json_names = "joint name"
    json_nulls = JointFinding
    joint: int
    name: str


class RepairKind(StrEnum):
    """Whether a repair holds in the worst case, or is to be tried: expected to be quicker, the
    plunger read again after it.
    """

    SURE = "sure"
    TRY = "try"


@dataclass(frozen=True, slots=True)
class RepairSet:
    """Joints to restore, with what is predicted of the gear afterwards.

    access_minutes, minutes: time to reach them; to open their areas and restore them. [min]
    second_repair_probability: chance that the plunger stays outside and more must be restored. [1]
    """

    joints: tuple[int, ...]
    predicted_displacement_in: float
    probability_within_margin: Probability
    access_minutes: Size
    minutes: Size
    kind: RepairKind
    second_repair_probability: float | None = None


@dataclass(frozen=True, slots=True)
class UncertaintyBudget:
    """Standard uncertainties behind the probability, at the prediction with unmeasured joints at 0.
    [in]
    """

    readings_in: Mapping[int, float]
    geometry_in: float
    model_in: float
    margin_in: Size
    model_source: str

    @property
    def lines(self) -> tuple[tuple[str, float, float], ...]:
        """Name, standard uncertainty and share of the combined variance of each part, largest
        reading first. [in, 1]
        """
        readings = sorted(self.readings_in.items(), key=lambda reading: -reading[1])
        parts = {
            **{f"reading of #{joint}": u for joint, u in readings},
            "geometry, over the ensemble": self.geometry_in,
            "model": self.model_in,
            "margin": self.margin_in,
        }
        variance = sum(u**2 for u in parts.values()) or 1.0
        return tuple((name, u, u**2 / variance) for name, u in parts.items())


@dataclass(frozen=True, slots=True)
class GroupChance:
    """Chance that a joint, or one of two that the plunger cannot distinguish, is worn beyond its
    limit. [1]
    """

    joints: tuple[int, ...]
    probability: Probability


@dataclass(frozen=True, slots=True)
class Posterior:
    """Which joints explain a measured plunger displacement, most likely worn first.

    no_joint_worn: chance that no joint is worn beyond its limit. [1]
    not_clearance: chance that something other than clearance displaced the plunger. [1]
    """

    groups: tuple[GroupChance, ...]
    no_joint_worn: float
    not_clearance: float
    text: str


@dataclass(frozen=True, slots=True)
class RigidBound:
    """What the plain model says of a gear that was predicted with an extension.

    Parameters
    ----------
    displacement_in : float or None
        Worst case over all directions; None where the linkage does not close. [in]
    probability_within_margin : float or None
        Probability that it is within the margin. [1]
    verdict : Verdict
        The verdict of the plain model.
    decides : bool
        True if the verdict of the gear rests on it: the extension's own is not worse.
    """

    displacement_in: float | None
    probability_within_margin: Probability | None
    verdict: Verdict
    decides: bool


# Whose row it is, its verdict and what to do next.
_COURSE = """
    record_id=row.record_id tail_no=row.tail_no side=row.side verdict headline next_action in_brief
    then=plan.then plan=plan.steps end open_question=plan.open_question joints warnings
"""


class _Planned:
    """What has a plan: its first step is the one next action."""

    __slots__ = ()
    plan: Plan

    @property
    def next_action(self) -> Step:
        """The one next action: the plan's first step."""
        return self.plan.steps[0]

    @property
    def end(self) -> End:
        """Where the plan is expected to end."""
        return self.plan.end


@dataclass(frozen=True, slots=True, repr=False, eq=False)
class Assessment(_Planned, Result):
    """The decision about one gear.

    Parameters
    ----------
    inspection : Inspection
        What was measured.
    verdict : Verdict
        The verdict.
    predicted_displacement_in : float or None
        Worst case, the larger of the two senses in magnitude; None where the linkage does not
        close. [in]
    over_travel_in, under_travel_in : float or None
        Signed worst case of each sense. [in]
    predicted_upper_in : float or None
        The worst case with unmeasured joints at their limit. [in]
    margin_in : float
        Allowed displacement. [in]
    remaining_in : float or None
        Margin less the displacement that decides. [in]
    standard_uncertainty_in : float or None
        Of the prediction against the margin; None where a linkage of the ensemble does not close.
        [in]
    probability_within_margin : float or None
        Probability that the worst-case bound is within the margin, unmeasured joints taken as 0.
        [1]
    probability_exceed_random_directions : float or None
        Chance with uniformly random directions, unmeasured joints worn as usual; of a gear that is
        within its margin by a reading, unmeasured joints taken as 0. [1]
    geometry_spread_in : tuple of float or None
        Least and largest prediction over the ensemble of geometries. [in]
    budget : UncertaintyBudget or None
        What the standard uncertainty is made of.
    over_directions_rad, under_directions_rad : tuple of float
        Worst directions, one per joint, for the curve and the schematic; empty where nothing
        closes. [rad]
    joints : tuple of JointFinding
        Ranked table, in the order of the joints' numbers.
    plan : Plan
        What to do, to an end; its first step is the one next action.
    basis : Basis
        Whether the verdict rests on a measured displacement or on the prediction.
    bound_in : float or None
        Worst case over all directions, whatever an extension predicts. [in]
    explained_at_most_in, unexplained_in : float or None
        What of a measured displacement the joints can explain at most, unmeasured ones at their
        limit, and what they cannot; None without a reading. [in]
    headline : str
        The words of the verdict, as every channel prints them.
    alarm : str
        What must be done about the gear whatever its verdict; empty if nothing.
    repair_sets : tuple of RepairSet or None
        Repair sets; None if they were not asked for.
    warnings : tuple of str
        Everything else a user must see.
    posterior : Posterior or None
        Which joints explain the measured displacement; None if none was measured or it was not
        asked for.
    rigid : RigidBound or None
        The plain model's bound, which an extension does not relax; None without an extension.
    older : tuple of Fact
        What stands of other visits to the gear.
    """

    json_names = f"""
        {_COURSE} rigid margin_in remaining_in standard_uncertainty_in probability_within_margin
        predicted_displacement_in over_travel_in under_travel_in predicted_upper_in bound_in
        probability_exceed_random_directions geometry_spread_in explained_at_most_in unexplained_in
        measured_displacement_in=row.measured_displacement_in basis standing repair_sets
        posterior outcome=row.outcome inspection_date=row.inspection_date
        gear_landings=row.gear_landings
    """
    inspection: Inspection
    verdict: Verdict
    predicted_displacement_in: float | None
    over_travel_in: float | None
    under_travel_in: float | None
    predicted_upper_in: float | None
    margin_in: Size
    remaining_in: float | None
    standard_uncertainty_in: Size | None
    probability_within_margin: Probability | None
    probability_exceed_random_directions: Probability | None
    geometry_spread_in: tuple[float, float] | None
    budget: UncertaintyBudget | None
    over_directions_rad: tuple[float, ...]
    under_directions_rad: tuple[float, ...]
    joints: tuple[JointFinding, ...]
    plan: Plan
    basis: Basis
    bound_in: Size | None
    explained_at_most_in: Size | None
    unexplained_in: Size | None
    headline: str
    alarm: str
    repair_sets: tuple[RepairSet, ...] | None
    warnings: tuple[str, ...]
    posterior: Posterior | None = None
    rigid: RigidBound | None = None
    older: tuple[Fact, ...] = ()

    @property
    def standing(self) -> tuple[Fact, ...]:
        """The facts that the verdict rests on, those of other visits with their own day."""
        replaced = {(fact.kind, fact.joint) for fact in self.older}
        own = (f for f in self.inspection.facts if (f.kind, f.joint) not in replaced)
        return (*own, *self.older)

    @property
    def row(self) -> Inspection:
        """What was measured, by the name that it has where a row cannot be judged."""
        return self.inspection

    @property
    def unread(self) -> tuple[int, ...]:
        """Joints that were not measured."""
        return tuple(f.joint for f in self.joints if f.clearance_in is None)

    @property
    def title(self) -> str:
        """The verdict in capitals, as it heads every channel."""
        return self.verdict.title(self.basis)

    @property
    def is_measured_outside(self) -> bool:
        """Whether the plunger was measured beyond its margin."""
        return self.basis is Basis.MEASURED and self.verdict is Verdict.OUTSIDE_MARGIN

    @property
    def tone(self) -> VerdictTone:
        """Red for what must be done now, green for a gear that is in order."""
        failed = any(fact.kind is FactKind.FAILED for fact in self.older)
        if self.is_measured_outside or self.alarm or failed:
            return VerdictTone.RED
        return VerdictTone.GREEN if self.verdict is Verdict.WITHIN_MARGIN else VerdictTone.AMBER

    @property
    def in_brief(self) -> str:
        """The next action in words that stand alone."""
        return in_brief(self.next_action, self.end)

    @property
    def as_loaded(self) -> bool:
        """True where the prediction is the displacement as loaded: an expectation, with the bound
        also given.
        """
        return self.predicted_displacement_in != self.bound_in

    @property
    def decided_by_bound(self) -> bool:
        """True where the verdict rests on a worst case over all directions."""
        return not self.as_loaded if self.rigid is None else self.rigid.decides

    @property
    def deciding_in(self) -> float | None:
        """Displacement that decides: of the plain model, where an extension predicts less. [in]"""
        if self.rigid is not None and self.rigid.decides:
            return self.rigid.displacement_in
        return self.predicted_displacement_in

    @property
    def rigid_displacement_in(self) -> float | None:
        """The plain model's bound; None without an extension. [in]"""
        return None if self.rigid is None else self.rigid.displacement_in

    @property
    def rigid_verdict(self) -> str | None:
        """The plain model's verdict; None without an extension."""
        return None if self.rigid is None else str(self.rigid.verdict)

    @property
    def ranked(self) -> tuple[JointFinding, ...]:
        """The joints in the order in which to inspect them."""
        return tuple(sorted(self.joints, key=lambda finding: finding.rank))


@dataclass(frozen=True, slots=True, repr=False, eq=False)
class Rejected(_Planned, Result):
    """A row that cannot be judged: verdict INVALID, its numbers absent."""

    json_names = f"{_COURSE} standing outcome inspection_date"
    json_nulls = Assessment
    row: InvalidRow
    joints: tuple[UnjudgedJoint, ...]
    plan: Plan
    warnings: tuple[str, ...]

    @property
    def verdict(self) -> Verdict:
        return Verdict.INVALID

    @property
    def title(self) -> str:
        return self.verdict.title()

    @property
    def tone(self) -> VerdictTone:
        """Amber: nothing was found, and nothing can be."""
        return VerdictTone.AMBER

    @property
    def headline(self) -> str:
        """What to correct."""
        return self.next_action.text

    @property
    def standing(self) -> tuple[Fact, ...]:
        return ()

    @property
    def outcome(self) -> Outcome | None:
        """What the gear did, as far as it could be read."""
        return None if self.row.understood is None else self.row.understood.outcome

    @property
    def inspection_date(self) -> date | None:
        return None if self.row.understood is None else self.row.understood.inspection_date

    @property
    def in_brief(self) -> str:
        """What to correct: the cells where each has one, else the columns."""
        row = self.row
        if row.cells and len(row.cells) == len(row.correct):
            return f"Correct {'cell' if len(row.cells) == 1 else 'cells'} {', '.join(row.cells)}"
        return f"Correct {', '.join(row.correct)}" if row.correct else "Correct: see the problems"


Judgement = Assessment | Rejected
