"""What the decision says about one gear: the result that views, reports and JSON are made from."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

from mlg_troubleshoot.decision.inspection import Inspection, InvalidRow


class Verdict(StrEnum):
    """The five verdicts, in the order in which the rule tries them."""

    INVALID = "INVALID"
    OUTSIDE_MARGIN = "OUTSIDE_MARGIN"
    INCOMPLETE = "INCOMPLETE"
    WITHIN_MARGIN = "WITHIN_MARGIN"
    INCONCLUSIVE = "INCONCLUSIVE"

    @property
    def words(self) -> str:
        """The verdict as a technician reads it."""
        return {
            "INVALID": "INVALID – do not use",
            "OUTSIDE_MARGIN": "OUTSIDE MARGIN",
            "INCOMPLETE": "INCOMPLETE – cannot clear",
            "WITHIN_MARGIN": "WITHIN MARGIN",
            "INCONCLUSIVE": "INCONCLUSIVE – too close",
        }[self.value]


class Action(StrEnum):
    """What to do next."""

    MEASURE = "MEASURE"
    RESTORE = "RESTORE"
    CONTINUE = "CONTINUE"
    CORRECT = "CORRECT"


@dataclass(frozen=True, slots=True)
class NextAction:
    """The one next action.

    Parameters
    ----------
    action : Action
        What to do.
    joints : tuple of int
        The joints to do it to, in this order.
    text : str
        The action as a sentence.
    """

    action: Action
    joints: tuple[int, ...]
    text: str


@dataclass(frozen=True, slots=True)
class JointFinding:
    """One line of the ranked table.

    Parameters
    ----------
    joint : int
        Number of the joint.
    name : str
        Its name.
    clearance_in : float or None
        Radial clearance; None if not measured. [in]
    limit_in : float
        Its limit. [in]
    over_limit : bool
        True if the clearance is above the limit.
    contribution_in : float or None
        Plunger amplification × clearance; None if not measured. [in]
    first_order, total_order : float
        Sensitivity indices of the precomputed table (Eqs. 1 and 2). [1]
    plunger_amplification : float
        A_iP at mid-position in the limit of small clearance (Eq. 8). [1]
    rank : int
        Order in which to inspect, from 1.
    rank_range : tuple of int
        Best and worst rank of its contribution over the ensemble of geometries.
    alike : tuple of int
        Joints at the other end of the same link: plunger data alone cannot tell them apart.
    allowance_in : float or None
        How much further this joint alone may wear until the worst case reaches the margin; None if it is
        not measured or the worst case is beyond the margin already. [in]
    """

    joint: int
    name: str
    clearance_in: float | None
    limit_in: float
    over_limit: bool
    contribution_in: float | None
    first_order: float
    total_order: float
    plunger_amplification: float
    rank: int
    rank_range: tuple[int, int]
    alike: tuple[int, ...]
    allowance_in: float | None = None


@dataclass(frozen=True, slots=True)
class RepairSet:
    """A set of joints which, restored, brings the worst case within the margin.

    Parameters
    ----------
    joints : tuple of int
        Joints to restore.
    predicted_displacement_in : float
        Worst-case displacement afterwards. [in]
    probability_within_margin : float
        Probability that the bound is within the margin afterwards. [1]
    access_minutes : float
        Time to reach them. [min]
    """

    joints: tuple[int, ...]
    predicted_displacement_in: float
    probability_within_margin: float
    access_minutes: float


@dataclass(frozen=True, slots=True)
class UncertaintyBudget:
    """Standard uncertainties behind the probability, at the prediction with unmeasured joints at 0.

    Parameters
    ----------
    clearances_in : float
        From the readings of the measured joints. [in]
    geometry_in : float
        Spread of the prediction over the ensemble of geometries. [in]
    model_in : float
        Of the model itself. [in]
    margin_in : float
        Of the margin. [in]
    model_source : str
        Where `model_in` comes from: provisional, or the residual scatter of a diagnosis.
    """

    clearances_in: float
    geometry_in: float
    model_in: float
    margin_in: float
    model_source: str


@dataclass(frozen=True, slots=True)
class Assessment:
    """The decision about one gear.

    Parameters
    ----------
    inspection : Inspection
        What was measured.
    verdict : Verdict
        The verdict.
    predicted_displacement_in : float or None
        Worst case, the larger of the two senses in magnitude; None where the linkage does not close. [in]
    over_travel_in, under_travel_in : float or None
        Signed worst case of each sense. [in]
    predicted_upper_in : float or None
        The worst case with unmeasured joints at their limit. [in]
    margin_in : float
        Allowed displacement. [in]
    remaining_in : float or None
        Margin less prediction. [in]
    standard_uncertainty_in : float or None
        Of the prediction against the margin; None where a linkage of the ensemble does not close. [in]
    probability_within_margin : float or None
        Probability that the worst-case bound is within the margin, unmeasured joints taken as 0. [1]
    probability_exceed_random_directions : float or None
        Chance with uniformly random directions. [1]
    geometry_spread_in : tuple of float or None
        Least and largest prediction over the ensemble of geometries. [in]
    budget : UncertaintyBudget or None
        What the standard uncertainty is made of.
    over_directions_rad, under_directions_rad : tuple of float
        Worst directions, one a joint, for the curve and the schematic; empty where nothing closes. [rad]
    joints : tuple of JointFinding
        Ranked table, in the order of the joints' numbers.
    next_action : NextAction
        The one next action.
    headline : str
        The verdict in one or two plain sentences.
    measured_statement : str or None
        What a measured displacement says, in its own words; None if none was measured.
    repair_sets : tuple of RepairSet or None
        Repair sets; None if they were not asked for.
    warnings : tuple of str
        Everything else a user must see.
    """

    inspection: Inspection
    verdict: Verdict
    predicted_displacement_in: float | None
    over_travel_in: float | None
    under_travel_in: float | None
    predicted_upper_in: float | None
    margin_in: float
    remaining_in: float | None
    standard_uncertainty_in: float | None
    probability_within_margin: float | None
    probability_exceed_random_directions: float | None
    geometry_spread_in: tuple[float, float] | None
    budget: UncertaintyBudget | None
    over_directions_rad: tuple[float, ...]
    under_directions_rad: tuple[float, ...]
    joints: tuple[JointFinding, ...]
    next_action: NextAction
    headline: str
    measured_statement: str | None
    repair_sets: tuple[RepairSet, ...] | None
    warnings: tuple[str, ...]

    @property
    def ranked(self) -> tuple[JointFinding, ...]:
        """The joints in the order in which to inspect them."""
        return tuple(sorted(self.joints, key=lambda finding: finding.rank))


@dataclass(frozen=True, slots=True)
class Rejected:
    """A row that cannot be judged: verdict INVALID, its numbers absent.

    Parameters
    ----------
    row : InvalidRow
        Identity as far as it could be read.
    next_action : NextAction
        What to correct.
    warnings : tuple of str
        What the reader noticed.
    """

    row: InvalidRow
    next_action: NextAction
    warnings: tuple[str, ...]

    @property
    def verdict(self) -> Verdict:
        """Always INVALID."""
        return Verdict.INVALID


Judgement = Assessment | Rejected
