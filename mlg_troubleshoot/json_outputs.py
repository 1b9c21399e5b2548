"""What the commands write with ``--json``: lengths in inches, numbers not rounded, null where not
known.

The order of the keys is that of the output. Records that are written whole are those of the model.
"""

from __future__ import annotations

from typing import Annotated, Literal, NotRequired, TypedDict

from msgspec import Meta

from mlg_troubleshoot.decision.assessment import (
    Action,
    Basis,
    End,
    Posterior,
    RepairSet,
    Rigging,
    RigidBound,
    Step,
    Verdict,
)
from mlg_troubleshoot.decision.inspection import FactKind, Side
from mlg_troubleshoot.errors import Problem
from mlg_troubleshoot.gear.gear import Sourced

Version = Literal[2]
Probability = Annotated[float, Meta(ge=0, le=1)]
Size = Annotated[float, Meta(ge=0)]
Positive = Annotated[float, Meta(gt=0)]
Count = Annotated[int, Meta(ge=0)]
JointNumber = Annotated[int, Meta(ge=1)]
Sha256 = Annotated[str, Meta(pattern="^[0-9a-f]{64}$")]
Interval = tuple[float, float]
# What a study could not compute is null.
Ends = tuple[float | None, float | None]


class GearIdentity(TypedDict):
    """The gear that was used."""

    id: str
    geometry_sha256: Sha256
    provenance: str


class CheckedJoint(TypedDict):
    """One joint of an inspection.

    clearance_in: radial, null if not measured. contribution_in: plunger_amplification ×
    clearance_in. first_order, total_order: fractions of the variance (Eqs. 1 and 2).
    plunger_amplification: A_iP of Eq. 8 at mid-position in the limit of small clearance. rank:
    order in which to inspect; rank_range: over the ensemble of geometries. allowance_in: how much
    further this joint alone may wear until the worst case reaches the margin or it its limit.
    acts_like: joints at the other end of the same link, which the plunger cannot distinguish.
    """

    joint: JointNumber
    name: str
    clearance_in: Size | None
    over_limit: bool | None
    contribution_in: Size | None
    first_order: float | None
    total_order: float | None
    plunger_amplification: Size | None
    rank: JointNumber | None
    rank_range: tuple[int, int] | None
    allowance_in: Size | None
    acts_like: list[JointNumber] | None


class StandingFact(TypedDict):
    """A fact that the verdict rests on: of this row, or of another visit of the gear.

    value_in: radial clearance, or signed displacement of the plunger. date: the day, with its time
    if one was stated; null where it is not known. record: the visit that states it.
    """

    kind: FactKind
    joint: JointNumber | None
    value_in: float | None
    date: str | None
    record: str


# What follows one outcome of the next action. minutes: of what is done then.
NextOutcome = TypedDict(
    "NextOutcome",
    {"if": str, "action": Action, "joints": list[JointNumber], "minutes": Size, "text": str},
)


class CheckedInspection(TypedDict):
    """One data row of the input; of an INVALID one every number is null.

    The verdict is that of the state of the gear at this row: what older visits found and no later
    one or repair replaced counts as well. standing: the facts that it rests on, with their day.

    predicted_displacement_in: worst case, the larger of the two senses in magnitude; null where the
    linkage does not close. over_travel_in, under_travel_in: signed worst case of each sense.
    predicted_upper_in: with unmeasured joints at their limit. bound_in: over all directions,
    whatever an extension predicts. remaining_in: margin_in less the displacement that decides.
    rigid: the plain model's bound, which an extension does not relax: the verdict is that of the
    worse of both; null without an extension.
    standard_uncertainty_in: of the prediction against the margin. probability_within_margin: that
    the worst-case bound is within the margin. probability_exceed_random_directions: chance of
    exceeding the margin with uniformly random directions. geometry_spread_in: least and largest
    prediction over the ensemble. explained_at_most_in, unexplained_in: of a measured displacement,
    by the joints' worst case; null without a reading. headline: the words of the verdict, as every
    channel prints them. basis: MEASURED where a plunger reading decides. standing: the facts that
    the verdict rests on. next_action: the first step of the plan, of which only that binds;
    required is false where nothing must be done. in_brief: the same in words that stand alone, as
    on screen, in CSV and on paper. then: what follows each outcome of the next action; empty in a
    batch. open_question: what the day does not allow to settle. repair_sets: null where the
    linkage does not close. posterior: null in a batch, and of a gear that did not fail or whose
    plunger was not read.
    """

    record_id: str | None
    tail_no: str | None
    side: Side | None
    outcome: Literal["RETRACTED", "FAILED"] | None
    inspection_date: str | None
    gear_landings: float | None
    verdict: Verdict
    headline: str
    predicted_displacement_in: float | None
    over_travel_in: float | None
    under_travel_in: float | None
    predicted_upper_in: float | None
    bound_in: Size | None
    rigid: RigidBound | None
    margin_in: Positive | None
    remaining_in: float | None
    standard_uncertainty_in: Size | None
    probability_within_margin: Probability | None
    probability_exceed_random_directions: Probability | None
    geometry_spread_in: Interval | None
    explained_at_most_in: Size | None
    unexplained_in: Size | None
    measured_displacement_in: float | None
    joints: list[CheckedJoint]
    basis: Basis | None
    standing: list[StandingFact] | None
    next_action: Step
    in_brief: str
    then: list[NextOutcome]
    plan: Annotated[list[Step], Meta(min_length=1)]
    end: End
    open_question: str | None
    repair_sets: list[RepairSet] | None
    rigging: Rigging | None
    posterior: Posterior | None
    warnings: list[str]


class CheckOutput(TypedDict):
    """Output of mlg check --json: every data row of the input appears exactly once.

    problems: errors only. warnings: notes on the input as a whole.
    """

    schema_version: Version
    gear: GearIdentity
    inspections: list[CheckedInspection]
    problems: list[Problem]
    warnings: list[str]


class RowCounts(TypedDict):
    """Rows of the table that a diagnosis read, used and set aside."""

    read: Count
    used: Count
    set_aside: Count


class SuspectCell(TypedDict):
    """A cell that is likely wrong; suggested is used in the analysis only."""

    row: JointNumber
    record_id: str
    column: str
    kind: Literal[
        "mm_as_in",
        "factor_10",
        "swapped_joints",
        "implausible",
        "restored_joint",
    ]
    value: str
    suggested: str | None


class MisfitSize(TypedDict):
    """Measured − predicted, and the repeatability of one reading."""

    mean_in: float
    rms_in: float
    repeatability_in: Size | None
    repeatability_source: str


class TargetedCause(TypedDict):
    """A cause and what it acts on: joint 4, tail N123, gauge G-03; null if it has no target."""

    cause: Annotated[str, Meta(min_length=1)]
    target: str | None


class DescribedCause(TargetedCause):
    """A cause in a sentence, as whoever wrote it says what it is."""

    sentence: str


class PossibleCause(DescribedCause):
    """A cause that the data do not rule out, and the reading that would."""

    separating_reading: str


class LikelyCause(PossibleCause):
    """A cause of a set, and how likely it is; class_probability: it or one that these rows cannot
    tell from it.
    """

    probability: Probability
    class_probability: Probability


class LeftOutColumn(TypedDict):
    """A column that only this table has and that is not compared, and why."""

    column: str
    why: str


class DetectableEffect(TypedDict):
    """Root mean square from which an effect of a listed cause is detected with 80 % power."""

    cause: str
    rms_in: Size


class NamedCauseOutput(DescribedCause):
    """A cause that the data name."""

    effect_rms_in: Size
    probability: Probability
    class_probability: Probability
    parameters: dict[str, float]
    interval_95: dict[str, Interval]


class NotTestable(TypedDict):
    """A cause that the columns of the table cannot show."""

    cause: str
    missing_column: str


class FittedTerm(DescribedCause):
    """One named cause with its fitted parameter."""

    parameter: str
    value: float
    interval_95: Interval


class FittedExtension(TypedDict):
    """What the model is extended by."""

    geometry_sha256: Sha256
    data_sha256: list[Sha256]
    residual_u_in: Size
    terms: Annotated[list[FittedTerm], Meta(min_length=1)]


class ExtensionGain(TypedDict):
    """What the extension is worth on held-out rows; without one, after is as before."""

    held_out_rms_before_in: Size
    held_out_rms_after_in: Size
    share_removed_interval_95: Interval
    held_out_by: str | None
    false_within_before: Count
    false_within_after: Count
    false_outside_before: Count
    false_outside_after: Count
    verdicts_changed: list[str]


class RowFarOff(TypedDict):
    """A row that lies too far off for scatter and that nothing explains."""

    record_id: str
    residual_in: float


class Remainder(TypedDict):
    """What no named cause explains."""

    p_value: Probability
    p_something_else: Probability
    looks_like_noise: bool
    rms_in: Size
    expected_from_gauges_in: Size | None
    rows_far_off: list[RowFarOff]


class ConditionOfData(TypedDict):
    """One thing that is to be known of the data: what it does to the answer, and what to record."""

    kind: Literal[
        "rounded",
        "censored",
        "blank_not_at_random",
        "copied",
        "duplicate",
        "limit_written",
        "selected",
        "landings_fall",
        "identical_cells",
    ]
    where: str
    share: Probability
    effect: str
    record_next: str


class DiagnoseOutput(TypedDict):
    """Output of mlg diagnose --json.

    causes: NAMED: by effect; else empty. also_possible: AMBIGUOUS: the whole set that the data
    cannot separate; else empty. beside: NAMED: causes of which one or more act in addition to what
    is named; the data cannot tell which. cannot_say: statements that so few rows or aircraft cannot
    carry.
    """

    schema_version: Version
    rows: RowCounts
    data_faults: list[SuspectCell]
    misfit: MisfitSize
    verdict: Literal["NONE", "NAMED", "AMBIGUOUS", "UNLISTED"]
    causes: list[NamedCauseOutput]
    also_possible: list[LikelyCause]
    beside: list[LikelyCause]
    p_nothing: Probability
    p_unlisted: Probability
    sure: Probability
    unlisted_variables: list[str]
    unlisted_tails: list[str]
    unlisted_rms_in: Size | None
    not_testable: list[NotTestable]
    cannot_say: list[str]
    ruled_out: list[TargetedCause]
    columns_used: list[str]
    columns_left_out: list[LeftOutColumn]
    smallest_detectable_rms_in: Size | None
    detectable: list[DetectableEffect]
    extension: FittedExtension | None
    gain: ExtensionGain
    data_condition: list[ConditionOfData]
    remainder: Remainder
    warnings: list[str]


class NotConcluded(TypedDict):
    """Output of mlg diagnose --json where nothing can be concluded (exit code 3)."""

    schema_version: Version
    verdict: None
    reason: str
    remedy: str
    warnings: list[str]


class StudiedGear(TypedDict):
    """The gear that was studied, with the hash of its ensemble."""

    id: str
    geometry_sha256: Sha256
    ensemble_sha256: Sha256
    provenance: str


class StudiedJoint(TypedDict):
    """Indices of one joint, fractions of the variance and not normalised to 1.

    limit_in: upper end of its clearance's distribution. plunger_amplification: A_iP of Eq. 8 at
    mid-position in the limit of small clearance. max_amplification_index: largest stage-wise index
    over the release (section 4.3). rank_range, first_order_spread, total_order_spread: over the
    ensemble of geometries.
    """

    joint: JointNumber
    limit_in: Positive
    first_order: float | None
    first_order_interval: Ends
    total_order: float | None
    total_order_interval: Ends
    plunger_amplification: float
    max_amplification_index: float
    rank: JointNumber
    rank_range: tuple[int, int]
    first_order_spread: Ends
    total_order_spread: Ends


class StudiedAmplification(TypedDict):
    """Amplification of each joint by stage and to the plunger (Eqs. 7 to 10)."""

    local_stage: list[float]
    max_stage: list[float]
    local_plunger: list[float]
    max_plunger: list[float]
    exact_plunger: list[float]


class StudiedGroup(TypedDict):
    """Both ends of one link taken as one joint."""

    joints: list[JointNumber]
    closed: float | None
    total: float | None


class StudiedEvidence(TypedDict):
    """A number that bears on a statement, on every linkage."""

    quantity: str
    accepted: str
    unit: str
    values: list[float | None]
    holds: list[bool]
    why: str


class StudiedStatement(TypedDict):
    """A statement of the paper and what the linkages say to it."""

    claim: str
    section: str
    outcome: Literal[
        "holds", "holds only under a reading", "holds on some linkages", "does not hold"
    ]
    linkages: list[str]
    evidence: list[StudiedEvidence]
    paragraph: str


class StudyOutput(TypedDict):
    """Output of mlg study --json, and, up to joints, the table of indices that ships with a gear.

    failed: solutions that did not close; they are counted, not dropped.
    """

    schema_version: Version
    gear: StudiedGear
    seed: Count
    design: str
    evaluations: Count
    failed: Count
    joints: Annotated[list[StudiedJoint], Meta(min_length=1)]
    directions: NotRequired[str]
    distribution: NotRequired[str]
    note: NotRequired[str]
    mean: NotRequired[float | None]
    variance: NotRequired[float | None]
    first_order_plain: NotRequired[list[float | None] | None]
    groups: NotRequired[list[StudiedGroup]]
    ensemble: NotRequired[list[str]]
    amplification: NotRequired[StudiedAmplification]


class Landings(TypedDict):
    """The 5, 50 and 95 % quantiles of landings; null beyond the horizon."""

    p05: float | None
    p50: float | None
    p95: float | None


class JointReading(TypedDict):
    """A reading of the joint that was asked for; radial clearance."""

    date: str | None
    gear_landings: float | None
    clearance_in: float


class FleetGear(TypedDict):
    """One gear of a fleet: its last inspection, what is urgent and why, and the landings that it
    has left. failed: days; changed: since the day that was asked for; repair: whether the last one
    helped.
    """

    tail_no: str
    side: Side
    record_id: str
    inspection_date: str | None
    gear_landings: float | None
    verdict: Verdict | None
    worst_joint: JointNumber | None
    landings_to_limit: Landings | None
    limit_joint: JointNumber | None
    landings_to_margin: Landings | None
    next_inspection_landings: float | None
    due_date: str | None
    repairs: Count
    predicted_displacement_in: float | None
    margin_in: float | None
    next_action: str | None
    minutes: float
    restore: list[JointNumber]
    why: str
    failed: list[str]
    repair: str
    changed: list[str]
    readings: list[JointReading]


class FleetOutput(TypedDict):
    """Output of mlg fleet --json and, without forecasts, mlg history --json: the most urgent first.

    Of each gear: predicted_displacement_in: worst case, a bound, and margin_in: of its last
    inspection. next_action: in words that stand alone. minutes, restore: work and joints that the
    plan of that inspection expects. work: both summed over the fleet, in words.
    """

    schema_version: Version
    gears: list[FleetGear]
    work: str
    parts_within: str | None
    warnings: list[str]


class LifeEvent(TypedDict):
    """One line of the log book of a gear, in the order of time. value_in: of one joint, radial; of
    the plunger, signed; of a verdict, the worst case. counts: false where it was voided.
    """

    kind: Literal[
        "FAILED",
        "RETRACTED",
        "plunger",
        "reading",
        "restored",
        "rigging",
        "finding",
        "verdict",
        "correction",
        "void",
    ]
    text: str
    date: str | None
    joints: list[JointNumber]
    value_in: float | None
    verdict: Verdict | None
    gear_landings: float | None
    record_id: str | None
    hash: Sha256
    counts: bool


class LifeJoint(TypedDict):
    """A joint's readings (landings, radial clearance) since it was last restored."""

    joint: JointNumber
    limit_in: Positive
    readings: list[Interval]
    landings_to_limit: Landings | None


class LifeOutput(TypedDict):
    """Output of mlg history TAIL SIDE --json."""

    schema_version: Version
    tail_no: str
    side: Side
    events: list[LifeEvent]
    joints: list[LifeJoint]
    landings_to_limit: Landings | None
    limit_joint: JointNumber | None
    landings_to_margin: Landings | None
    next_inspection_landings: float | None
    due_date: str | None
    notes: list[str]
    warnings: list[str]


class ShownJoint(TypedDict):
    """A joint as the gear file describes it."""

    joint: JointNumber
    name: str
    location: str
    limit: Sourced
    new_part: Sourced
    access: Sourced
    area: str
    critical: bool
    acts_like: list[JointNumber]


class ShownPoint(TypedDict):
    """A point of the linkage at mid-position."""

    plane: str
    at_in: Interval
    fixed: bool


class GearOutput(TypedDict):
    """Output of mlg gear --json."""

    schema_version: Version
    id: str
    name: str
    provenance: str
    geometry_sha256: Sha256
    ensemble: list[str]
    calibration_rate: float
    margin: Sourced
    release_stroke_in: float
    joints: list[ShownJoint]
    points: dict[str, ShownPoint]
    numbers: list[Sourced]


class VerifiedNumber(TypedDict):
    """A number that the paper prints, and that of the model."""

    quantity: str
    section: str
    printed: str
    computed: float
    unit: str
    tolerance: str
    status: str
    holds: bool
    should_hold: bool


class VerifyOutput(TypedDict):
    """Output of mlg gear verify --json."""

    schema_version: Version
    gear: str
    numbers: list[VerifiedNumber]
    statements: list[StudiedStatement]
