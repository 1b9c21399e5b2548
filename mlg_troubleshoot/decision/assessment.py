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
class Rigging:
    """What re-rigging alone would do: the plunger's range shifted to the middle, the clearances left as they are.

    Parameters
    ----------
    shift_in : float
        By how much to shift the plunger. [in]
    predicted_displacement_in : float
        Worst case afterwards: half of the range between the worst cases of both senses. [in]
    probability_within_margin : float
        Probability that this bound is within the margin. [1]
    probability_exceed_random_directions : float
        Chance of leaving the margin afterwards with uniformly random directions. [1]
    """

    shift_in: float
    predicted_displacement_in: float
    probability_within_margin: float
    probability_exceed_random_directions: float


@dataclass(frozen=True, slots=True)
class ReadingWorth:
    """What measuring one joint is worth.

    Parameters
    ----------
    joint : int
        Number of the joint.
    minutes : float
        Time to reach it from the state of the inspection, areas that are open already being free. [min]
    risk_drop : float
        Expected drop of the decision risk; 0 where this reading alone cannot change the decision. [1]
    variance_in2 : float
        Share of the variance of the worst case that the reading removes. [in²]
    critical : bool
        True if no gear can be cleared without it.
    """

    joint: int
    minutes: float
    risk_drop: float
    variance_in2: float
    critical: bool

    def per_minute(self, *, by_risk: bool) -> float:
        """Worth per minute.

        Parameters
        ----------
        by_risk : bool
            True for the drop in risk, False for the variance.

        Returns
        -------
        float
            Worth. [1/min or in²/min]
        """
        return (self.risk_drop if by_risk else self.variance_in2) / self.minutes


@dataclass(frozen=True, slots=True)
class MeasuringAdvice:
    """Which joint to measure next, and whether one may stop.

    Parameters
    ----------
    worth : tuple of ReadingWorth
        The unmeasured joints, best first.
    stop : bool
        True if more measuring will not change the verdict.
    verdict : Verdict
        The verdict that stands if one may stop, else the verdict so far.
    expected_within : float
        Chance that the gear is within its margin, unmeasured joints taken by their distribution. For the advice
        only: a verdict takes them at their bounds. [1]
    expected : Verdict or None
        WITHIN_MARGIN or OUTSIDE_MARGIN where that chance is enough to go on troubleshooting, INCONCLUSIVE where
        measuring the other joints would hardly settle it, else None.
    text : str
        The advice as a sentence.
    """

    worth: tuple[ReadingWorth, ...]
    stop: bool
    verdict: Verdict
    expected_within: float
    expected: Verdict | None
    text: str

    @property
    def joint(self) -> int | None:
        """The joint to measure next; None if all are measured."""
        return self.worth[0].joint if self.worth else None


@dataclass(frozen=True, slots=True)
class Confidence:
    """How far the probability of being within the margin can be trusted as a number.

    Parameters
    ----------
    analytic : float
        With the response taken as linear in the errors of the readings. [1]
    monte_carlo : float
        With its curvature, by Monte Carlo. [1]
    standard_error : float
        Of the Monte Carlo value. [1]
    draws : int
        Number of draws.
    """

    analytic: float
    monte_carlo: float
    standard_error: float
    draws: int


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
class GroupChance:
    """Chance that a joint, or one of two that the plunger cannot tell apart, is worn beyond its limit.

    Parameters
    ----------
    joints : tuple of int
        The joint, or the ends of one link.
    probability : float
        Chance that at least one of them is worn. [1]
    """

    joints: tuple[int, ...]
    probability: float


@dataclass(frozen=True, slots=True)
class ClearanceInterval:
    """What is known of one joint's clearance after the readings.

    Parameters
    ----------
    joint : int
        Number of the joint.
    low_in, median_in, high_in : float
        Median and ends of the central 90 % interval of the radial clearance. [in]
    worn : float
        Chance that it is beyond its limit. [1]
    """

    joint: int
    low_in: float
    median_in: float
    high_in: float
    worn: float


@dataclass(frozen=True, slots=True)
class Posterior:
    """Which joints explain a measured plunger displacement.

    Parameters
    ----------
    groups : tuple of GroupChance
        Groups of joints, most likely worn first.
    no_joint_worn : float
        Chance that no joint is worn beyond its limit. [1]
    not_clearance : float
        Chance that something other than clearance displaced the plunger. [1]
    intervals : tuple of ClearanceInterval
        One for each joint, in the order of the joints' numbers.
    called_worn : tuple of tuple of int
        Groups that are more likely worn than not.
    effective_draws : float
        Independent draws that the result is worth. [1]
    text : str
        The finding as a sentence.
    """

    groups: tuple[GroupChance, ...]
    no_joint_worn: float
    not_clearance: float
    intervals: tuple[ClearanceInterval, ...]
    called_worn: tuple[tuple[int, ...], ...]
    effective_draws: float
    text: str


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
    measuring : MeasuringAdvice or None
        What further measuring is worth; None if it was not asked for or the linkage does not close.
    rigging : Rigging or None
        What re-rigging alone would do; None if it was not asked for or is not needed.
    confidence : Confidence or None
        Monte Carlo check of the probability; None if it was not asked for or there is no uncertainty.
    posterior : Posterior or None
        Which joints explain the measured displacement; None if none was measured or it was not asked for.
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
    measuring: MeasuringAdvice | None = None
    rigging: Rigging | None = None
    confidence: Confidence | None = None
    posterior: Posterior | None = None

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
